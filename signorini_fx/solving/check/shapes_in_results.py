"""Findings about foundations that are things: a part of one that lies inside the deformed body."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from dolfinx import fem

from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells
from signorini_fx.records import Finding


def shapes_in_results(foundations: Iterable[tuple[str, Any, Any]], displacement: fem.Function) -> list[Finding]:
    """Foundations between the nodes of a result, or in parts of the body that are in no contact; collective.

    Args:
        foundations: the name of each, its shape where it is in the result, None: it has none, and what is added to its
            distance; with other than a number it is not looked at.
        displacement: the result.
    """
    findings, cells = [], None
    for name, shape, added in foundations:
        if shape is None or getattr(shape, "driven", False) or not isinstance(added, int | float):
            continue
        space = displacement.function_space
        cells = cells or BodyCells.of(space, space.mesh.geometry.dim)
        deep = cells.inside(cells.placed(displacement.x.array), shape, float(added))
        if deep is not None:
            message = (
                f"a part of the foundation lies inside the deformed body, {deep}: between two nodes, or where there is "
                "no contact boundary; take facets that are not wider than the foundation, and more of the boundary"
            )
            findings.append(Finding("warning", name, message))
    return findings
