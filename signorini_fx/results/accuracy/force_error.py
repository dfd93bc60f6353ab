"""The error of contact and friction force, from its changes from mesh to mesh.

A force is an average: its error decreases like the square of that of the solution.  With one body that of the contact
pressure counts as well, if it decreases less.  Between two bodies contact mostly ends at edges of one of them: there
the error of the pressure in L2 hardly decreases on any mesh and says nothing about the force.  But forces change to and
fro when nodes come into contact, by about as much as the square of the error of the pressure, whatever the changes say.
On meshes that are divided here and there the change is no error where cells stay as they are: in 3D, with elements
of degree 1, the error is at least a share of the square of that of the displacement (J. A. Nitsche's argument), unless
statics determines the force, which then does not change at all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from signorini_fx.results.accuracy.mesh_level import LevelResult
from signorini_fx.tuned import (
    CHANGES_USED,
    FORCE_OF_ENERGY,
    LARGEST_CHANGE,
    SLOWEST_DECREASE,
    ZERO_IN_SOLUTION,
)


def force_error(levels: Sequence[LevelResult], *, uniform: bool = True) -> float | None:
    """Error of contact and friction force on the last mesh, relative; None where there is no force; ``levels``: at
    least two, coarsest first; ``uniform``: whether each mesh is finer than the one before everywhere.

    Of several contact boundaries it is that of all their forces together, relative to these: their resultant may
    vanish, as that of a body between two walls does.
    """
    fine = levels[-1]
    size = float(np.linalg.norm(fine.force))
    if size == 0.0:
        return None
    estimates = [fine.inside**2 if fine.paired else 0.0]
    for coarse in levels[-1 - CHANGES_USED : -1]:
        change = float(np.linalg.norm(fine.force - coarse.force)) / size
        if fine.paired and coarse is not levels[-2] and change > LARGEST_CHANGE:
            continue
        share = float(np.clip(_share(coarse, fine), 0.0, SLOWEST_DECREASE))
        estimates.append(change * share / (1 - share))
    seen = max(estimates)
    if not uniform and (fine.dimension, fine.degree) in FORCE_OF_ENERGY and seen > ZERO_IN_SOLUTION:
        seen = max(seen, FORCE_OF_ENERGY[fine.dimension, fine.degree] * fine.energy**2)
    return seen + fine.loads


def _share(coarse: LevelResult, fine: LevelResult) -> float:
    """The share of the error on the coarse mesh that is left on the fine one.

    By Nitsche's argument it is the square of that of the displacement.  Between two bodies h^2 at best: of degree 2 the
    displacement improves faster than the ends of the contact zones, which depend on the places of the nodes.  A coarse
    mesh without any error, such as one on which nothing touches, says nothing: all of it may be left.
    """
    pairs = [(coarse.energy, fine.energy), (coarse.h, fine.h) if fine.paired else (coarse.inside, fine.inside)]
    return max((fine_error / coarse_error for coarse_error, fine_error in pairs if coarse_error > 0), default=1.0) ** 2
