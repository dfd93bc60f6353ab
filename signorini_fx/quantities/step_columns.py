"""Columns of the table of load steps: by axis, and by boundary where a sum over boundaries means nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def of_boundaries(statement: Any) -> list[str]:
    """The contact boundaries whose forces have no sum that acts on one body; none: they have one."""
    names = [effect.boundary for effect in statement.contact]
    return names if len(names) > 1 and any(effect.against for effect in statement.contact) else []


def by_axis(key: str, values: Sequence[Any], names: Sequence[str]) -> dict[str, float]:
    """Numbers under their key, vectors with an entry for each axis.

    Args:
        key: of the quantity.
        values: of each boundary, or one of all together.
        names: of the boundaries, which stand behind the key; "" or no names: the key alone.
    """
    columns = {}
    for name, value in zip(names or [""], values, strict=True):
        of = f" {name}" if name else ""
        if np.ndim(value) == 0:
            columns[f"{key}{of}"] = float(value)
        else:
            axes = zip("xyz", value, strict=False)
            columns |= {f"{key}_{axis}{of}": float(component) for axis, component in axes}
    return columns


def closed_boundaries(solution: Any) -> list[tuple[str, Any]]:
    """The ``ContactFigures`` of each boundary that closes around a body, with its name if sums mean nothing;
    collective.
    """
    names = of_boundaries(solution.statement)
    if solution.contact is None or not (names or len(solution.statement.contact) == 1):
        return []
    each = zip(names or [""], solution.contact_figures, strict=True)
    return [(name, figures) for name, figures in each if figures.friction_moment is not None]
