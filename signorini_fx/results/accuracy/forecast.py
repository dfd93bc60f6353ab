"""How time and memory grow from mesh to mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from signorini_fx.tuned import LEAST_GROWING_TIME, MEMORY_POWER, TIME_POWER


def grown(
    value: float, earlier: float, seen: float, growth: float, power: float, *, offset: float = 0.0, least: float = 0.0
) -> float:
    """A constant part, at least ``offset``, and one that grows like this power of the unknowns; ``seen``: quotient of
    the unknowns of the last two meshes; ``growth``: of the next mesh and the last; ``least``: the least share of the
    rest that grows.
    """
    growing = (value - earlier) / (1 - seen**-power)
    excess = max(value - offset, 0.0)
    return float(value + np.clip(growing, least * excess, excess) * (growth**power - 1))


def powers(dofs: float, dimension: int, krylov_from: float) -> tuple[float, float]:
    """The powers of the unknowns with which time and memory grow up to a mesh; ``krylov_from``: unknowns from which on
    a Krylov method is taken, whose time and memory are those of its products.
    """
    return (1.0, 1.0) if dofs >= krylov_from else (TIME_POWER[dimension], MEMORY_POWER[dimension])


def seconds_to_come(solved: Sequence[tuple[int, float]], meshes: int, dimension: int, krylov_from: float) -> float:
    """The time that more meshes will take, each with cells half as large as the previous one; ``solved``: unknowns and
    seconds of the solved meshes, at least one; all of the time of a single one grows.
    """
    (earlier_dofs, earlier), (dofs, seconds) = solved[-2] if len(solved) > 1 else solved[-1], solved[-1]
    total = 0.0
    for number in range(1, meshes + 1):
        growth = 2.0 ** (dimension * number)
        power, _ = powers(dofs * growth, dimension, krylov_from)
        if earlier_dofs < dofs:
            total += grown(seconds, earlier, dofs / earlier_dofs, growth, power, least=LEAST_GROWING_TIME)
        else:
            total += seconds * growth**power
    return total
