"""Findings about foundations that are things: a part of one that lies inside the deformed body."""

from __future__ import annotations

from dolfinx import fem

from signorini_fx.body.shapes_inside import BodyCells
from signorini_fx.records import Finding
from signorini_fx.scene.model import Scene


def shapes_in_results(scene: Scene, displacement: fem.Function) -> list[Finding]:
    """Foundations between the nodes of a result, or in parts of the body that are in no contact; collective.

    Args:
        scene: with its foundations where they are in the result.
        displacement: the result.
    """
    findings, cells = [], None
    for index, effect in enumerate(scene.contact):
        shape = effect.surface
        if shape is None or shape.driven or not isinstance(effect.gap, int | float):
            continue
        space = displacement.function_space  # a section with torsion is one of space, its foundations are plane
        cells = cells or BodyCells.of(space, space.mesh.topology.dim)
        deep = cells.inside(cells.placed(displacement.x.array), shape, float(effect.gap))
        if deep is not None:
            message = (
                f"a part of the foundation lies inside the deformed body, {deep}: between two nodes, or where there is "
                "no contact boundary; take facets that are not wider than the foundation, and more of the boundary"
            )
            findings.append(Finding("warning", f"contact[{index}].foundation", message))
    return findings
