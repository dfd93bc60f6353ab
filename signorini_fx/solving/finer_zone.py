"""The largest contact pressure with halved cells where bodies touch, which tells the error of that on the mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from signorini_fx.algebra.linalg.failures import memory_ended
from signorini_fx.errors import SignoriniError
from signorini_fx.mechanics.mesh.zone_halving import halved_around, has_divisible_zone
from signorini_fx.records import History
from signorini_fx.results.accuracy.peak_error import FinerZone, Peak
from signorini_fx.solving.meshed_problem import MeshedProblem, SolvedMesh
from signorini_fx.tuned import LARGEST_ZONE, ZONE_HALVINGS, ZONE_REACH


def peak_of_finer_zone(
    problem: MeshedProblem[Any],
    solved: SolvedMesh,
    *,
    everywhere: bool = False,
    allowed: Callable[[float], bool] = lambda growth: True,
) -> FinerZone | None:
    """The largest pressure with halved cells in contact, from the contact state on the mesh; collective.

    Triangles in contact are halved twice, other cells once, quadrilaterals and hexahedra in whole rows; if all cells
    are, once.  The linear solves count in the history of the problem.

    Args:
        problem: on the mesh, with which ``solved`` was made.
        solved: the mesh.
        everywhere: whether all cells are halved.
        allowed: whether a mesh with so many times the cells may be solved, the same on all ranks.

    Returns:
        None without contact, for curved boundaries of forms whose names the mesh does not know, where the mesh would be
        too large, and where there is no solution or, on one rank, not enough memory.
    """
    level, history = solved.level, problem.history
    if level is None or not has_divisible_zone(solved.tagged):
        return None
    if everywhere and 2**level.dimension > LARGEST_ZONE[level.dimension]:
        return None
    peak, columns = Peak.of(level.table), level.table.columns
    pressed = columns["pressure"] > 0
    if peak.spacing <= 0:
        return None
    points = np.column_stack([columns[axis] for axis in "xyz" if axis in columns])[pressed]
    names, against = solved.solution.statement.sides
    # Where straight facets stay when cells are divided, the polygon is the body.
    curved = set() if problem.polygonal else {name for name in (*names, *(against or ())) if name is not None}
    if not curved <= set(solved.tagged.boundaries):
        return None
    # What it records goes on from what there is, and is not shown.
    of_zone = History([*history.iterations], [*history.outer], limit=history.limit, is_late=history.is_late)
    cells = solved.tagged.mesh.topology.index_map(solved.tagged.dimension)
    reach = ZONE_REACH[level.dimension] * peak.spacing
    times = 1 if everywhere else ZONE_HALVINGS.get(solved.tagged.mesh.topology.cell_name(), 1)
    try:
        tagged = halved_around(solved.tagged, points, reach, curved, times=times, everywhere=everywhere)
        growth = tagged.mesh.topology.index_map(tagged.dimension).size_global / cells.size_global
        if not (growth <= LARGEST_ZONE[level.dimension] and allowed(growth)):
            return None
        finer = replace(problem, history=of_zone, stored=None).on(tagged).solved(0, solved.state, None)
    except SignoriniError:
        return None
    except Exception as failure:  # the solution stands; of several ranks that lack memory the others wait
        if problem.comm.size > 1 or not memory_ended(failure):
            raise
        return None
    finally:
        solves = of_zone.linear_solves - history.linear_solves
        history.recall(of_zone.iterations[history.linear_solves :], of_zone.outer[len(history.outer) :], ())
    if finer.level is None:
        return None
    history.add(
        f"largest pressure: its error is told by halved cells{'' if everywhere else ' in contact'}, "
        f"{finer.level.dofs} unknowns, {solves} linear solves"
    )
    return FinerZone(Peak.of(finer.level.table), finer.level.energy)
