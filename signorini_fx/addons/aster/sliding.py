"""Whether contact that follows the surfaces as they move, REAC_GEOM, has another answer than ours, which does not."""

from __future__ import annotations

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np

from signorini_fx.addons.aster.study import AsterStudy
from signorini_fx.machine import parallel
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import LINEAR_IN_DECK


def slips_too_far(solution: Solution, study: AsterStudy) -> list[str]:
    """What is lost where surfaces slide so far that others touch, by a share of their length, or along a curve so that
    their distance changes: a slip s on a surface of curvature k leaves the tangent by k s^2 / 2, which is compared with
    the largest displacement; collective.

    Args:
        solution: of the scene that was drafted.
        study: what it was drafted from.
    """
    if not study.follows or not study.zones:
        return []
    sides = [marks for zone in study.zones for marks in (zone.slave, zone.master)]
    length = min(study.mesh.extent(marks) for marks in sides)
    slip, size = 0.0, 0.0
    for step in solution.shown_steps:
        moment = solution.at(step)
        size = max(size, parallel.global_max(moment.comm, float(np.abs(moment.displacement.x.array).max(initial=0.0))))
        slip = max(slip, parallel.global_max(moment.comm, _largest_slip(moment)))
    away = max(map(study.mesh.curvature, sides)) * slip**2 / 2
    message = f"{study.follows}: REAC_GEOM: contact does not follow surfaces that slide by {slip:.2g}"
    if slip > LINEAR_IN_DECK * length:
        return [f"{message}, {100 * slip / length:.2g} % of their length"]
    if size and away > LINEAR_IN_DECK * size:
        return [f"{message}: their distance changes by {100 * away / size:.2g} % of the displacement"]
    return []


def _largest_slip(moment: Solution) -> float:
    """Of the points of this rank that touch."""
    if moment.contact is None:
        return 0.0
    columns = moment.table.columns
    touching = np.asarray(columns["state"]) != "open"
    names = [name for name in columns if name == "u_t" or name.startswith("u_t_")]
    slips = np.column_stack([columns[name] for name in names])[touching]
    return float(np.linalg.norm(slips, axis=1).max(initial=0.0))
