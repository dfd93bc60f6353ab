"""Nested iteration: the contact state of a coarse mesh starts the iteration on the next finer one.

The semi-smooth Newton method has to find the active sets, and these hardly depend on the mesh: a node of the fine mesh
starts in the set of its coarse neighbours.  On every mesh but the coarsest only a few linear solves remain.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.nodal_vectors import Nodal, length, unit
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.records import History
from signorini_fx.results.accuracy.convergence_table import convergence_table, with_polygon
from signorini_fx.results.accuracy.level_results import LevelResult
from signorini_fx.results.solution import Solution
from signorini_fx.solving.checkpointed_steps import MeshCheckpoint
from signorini_fx.solving.meshed_problem import MeshedProblem, Unsolved
from signorini_fx.tuned import MIDDLE_RATIO


def solve_nested(
    problems: Iterable[MeshedProblem],
    count: int,
    comm: MPI.Comm,
    history: History,
    stored: MeshCheckpoint | None = None,
) -> Solution:
    """Solve on one mesh after the other, each starting from the contact state of the previous one; collective.

    Where the last mesh has no solution that of the finest one with a solution is returned, see ``Unsolved``.
    """
    base_memory = parallel.peak_memory(comm)
    state: ContactState | None = None
    coarser: MeshLevel | None = None
    levels: list[LevelResult] = []
    sides, polygon = None, None
    certified: Solution | None = None
    unsolved: Unsolved | None = None
    following = iter(problems)
    for number in range(count):
        name = f"mesh {number + 1} of {count}"
        try:
            problem = next(following)
            solved = problem.solved(number, state, coarser, stored)
        except Exception as error:
            if certified is None:
                raise
            unsolved = Unsolved.by_error(error, name, comm)
            break
        solution, state = solved.solution, None
        if levels and solution.statement.sides != sides:
            history.add(
                "the convergence table begins here: on the coarser meshes the contact points are on other boundaries"
            )
            levels.clear()
        sides = solution.statement.sides
        coarser = solved.as_level(coarser)
        if solution.converged:
            state, certified = solved.state, solution
        elif certified is not None and number + 1 == count:
            unsolved = Unsolved.by_outcome(solution.status, name)
        if solved.level is not None:
            if levels and levels[-1].dofs >= solved.level.dofs:  # there is no coarser mesh
                levels.pop()
            polygon = problem.polygon_error(solved, polygon)
            levels.append(with_polygon(solved.level, polygon))
        if number + 1 < count:  # on the next mesh nothing else of this one is needed, least of all its multigrid
            del solved, solution
    if certified is not None and unsolved is not None:
        solution = unsolved.leaves(certified, history)
    solved_one = solution.converged or unsolved is not None
    prices = convergence_table(levels, base_memory) if len(levels) > 1 and solved_one else ()
    return replace(solution, levels=tuple(levels), convergence_table=tuple(prices))


def carry_over(coarse: ContactState, fine: ContactBoundary) -> tuple[ActiveSets, tuple[Nodal, Nodal]]:
    """Sets and (lambda, mu) for the nodes of a finer mesh, from the nearest coarse nodes; collective."""
    boundary = coarse.boundary
    tangents = boundary.tangents
    # Directions and shears as vectors in 3D, because the tangents of neighbours need not agree.
    state = [
        boundary.part,
        boundary.x,
        coarse.in_contact,
        coarse.pressure,
        np.einsum("ijk,ik->ij", tangents, coarse.direction),
        np.einsum("ijk,ik->ij", tangents, coarse.shear),
        length(coarse.slip_length),
        coarse.bound,
        boundary.normal,
    ]
    dim = boundary.x.shape[1]
    rows = parallel.gather_rows(boundary.comm, np.column_stack(state))
    # Of neighbours at the same distance the search takes those that come first: in no order of the ranks.
    rows = rows[np.lexsort(rows[:, dim::-1].T)]
    contact = np.zeros(fine.size, dtype=bool)
    direction, shear = (np.zeros((fine.size, dim)) for _ in range(2))
    pressure, turning = np.zeros(fine.size), np.zeros(fine.size)
    for part in np.unique(fine.part):
        on_part, coarse_rows = fine.part == part, rows[rows[:, 0] == part]
        # Two neighbours: a node in the middle between two sets joins the one that constrains it more, contact and
        # stick; the iteration releases superfluous nodes faster than it finds missing ones.
        count = min(2, len(coarse_rows))
        places = cKDTree(coarse_rows[:, 1 : 1 + dim])
        distance, nearest = (a.reshape(-1, count) for a in places.query(fine.x[on_part], count))
        share = distance[:, ::-1] / np.maximum(distance.sum(axis=1, keepdims=True), 1e-300) if count == 2 else 1.0
        near = (distance <= MIDDLE_RATIO * distance[:, :1]) | (np.arange(count) == 0)
        columns = np.cumsum((1, 1, dim, dim, 1, 1))
        touching, load, sliding, sheared, slipped, bound, normal = np.split(
            coarse_rows[nearest][:, :, 1 + dim :], columns, axis=2
        )
        # Between two bodies the points may have changed sides, and what one does to the other has the other sign.
        side = np.where(np.einsum("ijk,ik->ij", normal, fine.normal[on_part]) < 0, -1.0, 1.0)[:, :, None]
        sliding, sheared = side * sliding, side * sheared
        contact[on_part] = (near & (touching[:, :, 0] > 0)).any(axis=1)
        sliding = np.where(near[:, :, None], sliding, sliding[:, :1])
        together = (np.einsum("ijk,ik->ij", sliding, sliding[:, 0]) > 0).all(axis=1)
        direction[on_part] = np.where(together[:, None], sliding.sum(axis=1), 0.0)
        pressure[on_part] = (share * load[:, :, 0]).sum(axis=1)
        shear[on_part] = (np.atleast_2d(share)[:, :, None] * sheared).sum(axis=1)
        # Perpendicular to its direction the shear depends on the slip by the factor bound / slip.
        bound = np.where(np.isfinite(bound), bound, 0.0)  # where nothing slips
        far, shear_bound = ((share * values[:, :, 0]).sum(axis=1) for values in (slipped, bound))
        turning[on_part] = np.divide(shear_bound, far, out=np.zeros_like(far), where=far > 0)
    turned = np.einsum("ijk,ij->ik", fine.cotangents, direction)
    slip = length(turned) > 0
    sets = ActiveSets.of(contact, np.where(slip[:, None], unit(turned), 0.0), turning)
    return sets, (pressure, np.einsum("ijk,ij->ik", fine.cotangents, shear))
