"""A start from fewer contact nodes: a condensed problem is solved at every eighth node first, for example.

The active sets hardly depend on the mesh, and a dense solve with half of the contact nodes costs an eighth.  With
displacements that are linear between the nodes that stay, the condensed matrix becomes a Galerkin system, and the state
at these nodes starts the next finer one, as that of a coarser mesh would (``nested.carry_over``).  This needs no
coarser mesh, and only a few solves are left for all nodes.  It is a start: the solution stays the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.algorithms.strategy import solve_task
from signorini_fx.algorithms.task import Start, Task
from signorini_fx.body.contact_boundary import ContactBoundary, chains
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.contact_table import with_points
from signorini_fx.body.elastic import ElasticBody
from signorini_fx.contact.map import ContactMap
from signorini_fx.contact.points import ContactPoints
from signorini_fx.linalg.condensed import CondensedSystem, DenseSystem, dense_matrix
from signorini_fx.records import History, Status
from signorini_fx.solving.nested import carry_over
from signorini_fx.tuned import COARSEST_NODES, FEWEST_NODES_TO_COARSEN

_ALGORITHMS = ("auto", "ssn", "exact")

Indices = npt.NDArray[np.int64]


def worthwhile(task: Task, body: ElasticBody) -> bool:
    """Whether a task has a dense matrix large enough, whose unknowns are the displacements of contact nodes along a
    boundary in the plane, or relative ones of two bodies, no prescribed start, and an algorithm that would use
    another one; collective.
    """
    boundary, system = body.boundary, task.system
    if (
        not isinstance(system, CondensedSystem)
        or boundary is None
        or body.rotation is not None
        or body.settings.initial_contact != "auto"
        or task.settings.algorithm not in _ALGORITHMS
    ):
        return False
    counts = parallel.global_sum(boundary.comm, np.array((boundary.size, np.unique(boundary.nodes).size)))
    return bool(counts[0] > FEWEST_NODES_TO_COARSEN and np.count_nonzero(_of_nodes(system)) == 2 * counts[1])


def start_from_fewer_nodes(task: Task, boundary: ContactBoundary) -> Start:
    """Where the task starts: from the sets and multipliers at some of the nodes, or where it would start without;
    collective.
    """
    numbers = np.column_stack((boundary.part.astype(np.int64), boundary.global_nodes))
    numbers, segments, x = (
        parallel.gather_rows(boundary.comm, point_data) for point_data in (numbers, boundary.segments, boundary.x)
    )
    ranges, order, _ = chains(numbers, with_points(numbers, segments), x)
    lines, state = [order[rows.start : rows.stop] for rows in ranges], None
    stride = 2 ** int(np.log2(len(x) / COARSEST_NODES))
    while stride > 1:
        coarse, coarse_boundary = _with_every(stride, lines, task, boundary)
        start = coarse.start if state is None else coarse.start.begin_from(*carry_over(state, coarse_boundary))
        outcome = solve_task(coarse, start, task.settings.max_iterations)
        solves, size = coarse.history.linear_solves, parallel.global_sum(boundary.comm, coarse_boundary.size)
        task.history.add(f"{size} contact nodes first: {solves} linear solves, {outcome.status.value}")
        if outcome.status is not Status.CONVERGED:
            return task.start
        state = ContactState.of(coarse.contact(outcome, start), coarse_boundary)
        stride //= 2
    return task.start if state is None else task.start.begin_from(*carry_over(state, boundary))


def _with_every(
    stride: int, lines: Sequence[Indices], task: Task, boundary: ContactBoundary
) -> tuple[Task, ContactBoundary]:
    """The problem at every so many-th point of each line, its ends, and the nodes of two boundaries; collective.

    Args:
        stride: how many.
        lines: the points of all ranks, stacked in rank order, along each piece of the boundary.
        task: the problem at all points.
        boundary: the points of this rank.
    """
    system, motions, start, comm, count = task.system, task.motions, task.start, boundary.comm, boundary.size
    assert isinstance(system, CondensedSystem)
    nodes, x, every_weight = (
        parallel.gather_rows(comm, point_data) for point_data in (boundary.global_nodes, boundary.x, boundary.weight)
    )
    offset = parallel.rows_before(comm, count)
    _, first, node, times = np.unique(nodes, return_index=True, return_inverse=True, return_counts=True)
    between = _linear(stride, lines, x, times[node] > 1)
    points: Indices = np.unique(between.indices).astype(np.int64)
    rows = points[(offset <= points) & (points < offset + count)] - offset
    weight, segments = (between.T @ every_weight)[offset + rows], boundary.segments[:0]
    coarse_boundary = replace(_at(rows, count, boundary), weight=weight, segments=segments, averages=None)
    # The two unknowns of each node, in the order of their numbers; what else two bodies have stays as it is.
    of_nodes = between[first] @ sp.csr_array((np.ones(nodes.size), node, np.arange(nodes.size + 1)))
    carrying, free = _of_nodes(system), ~parallel.gather_rows(comm, system.contact.fixed)
    order = np.argsort(np.concatenate((np.flatnonzero(carrying), np.flatnonzero(~carrying))))
    prolongation = sp.csr_array(
        sp.block_diag((sp.kron(of_nodes, np.eye(2)), sp.eye_array(np.count_nonzero(~carrying))))
    )
    stays = ~carrying
    stays[carrying] = np.repeat(np.isin(np.arange(first.size), node[points]), 2)
    stays &= free
    change = sp.csr_array(sp.diags_array(free.astype(np.float64)) @ prolongation[order][:, order])[:, stays]
    u_n, u_t = system.contact.traces(system.start)
    data, origin = start.data, start.data.slip_origin
    data = replace(data, gap=data.gap - u_n, slip_origin=(0.0 if origin is None else origin) - u_t)
    law, sets = (None if point_data is None else _at(rows, count, point_data) for point_data in (start.law, start.sets))
    coarse = replace(
        task,
        settings=replace(task.settings, algorithm="ssn", fallbacks=False),
        system=_projected(system, change, np.flatnonzero(stays), rows, coarse_boundary.points),
        motions=motions.some(coarse_boundary.points, rows),
        start=replace(start, data=_at(rows, count, data), law=law, sets=sets, factors=None),
        rest=None,
        history=History(),
    )
    return coarse, coarse_boundary


def _of_nodes(system: CondensedSystem) -> npt.NDArray[np.bool_]:
    """The unknowns of all ranks that are of nodes with contact points: all, unless two bodies are in contact."""
    return np.ones(len(system.entries), dtype=bool) if system.relative is None else system.relative.at_points


def _projected(
    system: CondensedSystem, change: Any, stays: npt.NDArray[np.intp], rows: Indices, points: ContactPoints
) -> DenseSystem:
    """The Galerkin system for x = start + P x~, at some of the contact points: P^T A P and P^T (b - A start);
    collective.

    Its relative displacements count from those of ``start``.

    Args:
        system: A and b.
        change: P, scipy sparse, shape (unknowns, fewer), zero in the rows that are prescribed.
        stays: the unknowns that stay, each on its own rank, ascending.
        rows: local numbers of the contact points that it has, shape (n,).
        points: these points.
    """
    half = change.T @ system.entries  # A is symmetric: both products are sparse times dense
    first, last = system.matrix.getOwnershipRange()
    owned = (first <= stays) & (stays < last)
    matrix = dense_matrix(system.comm, change.T @ half.T, np.count_nonzero(owned))
    load, start = matrix.createVecRight(), matrix.createVecRight()
    missing = system.load.duplicate()
    system.matrix.mult(system.start, missing)
    missing.aypx(-1.0, system.load)
    load.getArray()[:] = (change.T @ parallel.gather_rows(system.comm, missing.getArray(readonly=True)))[owned]
    starts, columns, values = system.contact.operator.getValuesCSR()
    (count, _), (_, width) = system.contact.operator.getSizes()
    full_operator = sp.csr_array((values, columns, starts), shape=(count, width))
    coarse_operator = sp.csr_array(
        full_operator[(points.dimension * rows[:, None] + np.arange(points.dimension)).ravel()] @ change
    )
    csr = (
        coarse_operator.indptr.astype(PETSc.IntType),
        coarse_operator.indices.astype(PETSc.IntType),
        coarse_operator.data,
    )
    size = ((coarse_operator.shape[0], None), (np.count_nonzero(owned), None))
    operator = PETSc.Mat().createAIJ(size, csr=csr, comm=system.comm)
    fixed = np.zeros(np.count_nonzero(owned), dtype=bool)
    contact = ContactMap(operator, points, fixed, paired=system.contact.paired)
    return DenseSystem(matrix, load, start, system.resultant, contact)


def _linear(
    stride: int, lines: Sequence[Indices], x: npt.NDArray[np.float64], shared: npt.NDArray[np.bool_]
) -> sp.csr_array:
    """Interpolation from the points that stay to all, linear in the length along each line, shape (points, points)."""
    entries = []
    for line in lines:
        stay = (np.arange(line.size) % stride == 0) | shared[line]
        stay[-1] = True
        places = np.flatnonzero(stay)
        right = np.searchsorted(places, np.arange(line.size))  # the place itself where a point stays
        left_end = np.maximum(right - ~stay, 0)
        along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(x[line], axis=0), axis=1))))
        left_length, right_length = along[places[left_end]], along[places[right]]
        share = np.divide(along - left_length, right_length - left_length, out=np.ones(line.size), where=~stay)
        entries += [(line, line[places[left_end]], 1.0 - share), (line, line[places[right]], share)]
    points, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    interpolation = sp.csr_array((values, (points, columns)), shape=(len(x), len(x)))
    interpolation.eliminate_zeros()
    return interpolation


def _at(rows: Indices, count: int, of_points: Any) -> Any:
    """Data of points at some of them: what has as many entries as there are points has those of ``rows``."""
    values = {field.name: getattr(of_points, field.name) for field in fields(of_points)}
    nodal = {
        name: entries[rows]
        for name, entries in values.items()
        if isinstance(entries, np.ndarray) and len(entries) == count
    }
    return replace(of_points, **nodal)
