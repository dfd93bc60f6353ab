"""Nested iteration on the contact boundary alone: the condensed problem is solved on few contact nodes first.

The active sets can be found on a coarse boundary, and a solve on half of the contact nodes costs an eighth.  The
condensed matrix is coarsened along the boundary by Galerkin projection, to every second node at a time and linear in
between; the contact problem is solved on the coarsest boundary, and its state starts the next finer one
(``nested.carry_over``).  This needs no coarser mesh, and only a few solves remain on all contact nodes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.algorithms.strategy import solve_task
from signorini_fx.algorithms.task import Start, Task
from signorini_fx.body.contact_boundary import ContactBoundary, chains
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.contact.laws import ActiveSets, FrictionLaw, Nodal, RegularisedData
from signorini_fx.contact.motions import FreeMotions
from signorini_fx.linalg import ElasticSystem
from signorini_fx.linalg.coarsened import CoarsenedSystem
from signorini_fx.linalg.condensed import CondensedSystem
from signorini_fx.records import History, Status
from signorini_fx.solving.nested import carry_over
from signorini_fx.tuned import COARSEST_NODES, FEWEST_NODES_TO_COARSEN

_ALGORITHMS = ("auto", "ssn", "exact")

Indices = npt.NDArray[np.int64]
Entries = tuple[Indices, Indices, Nodal]


@dataclass(frozen=True)
class _Level:
    """A contact problem on some of the contact nodes; ``retained`` are their rows in the next finer boundary."""

    system: ElasticSystem
    boundary: ContactBoundary
    motions: FreeMotions
    data: RegularisedData
    law: FrictionLaw | None
    first_sets: ActiveSets | None
    chains: list[Indices]
    retained: Indices


def worthwhile(task: Task, discretisation: Discretisation) -> bool:
    """Whether a task has a dense system large enough, no start yet, and an algorithm that would use one."""
    boundary = discretisation.boundary
    return (
        isinstance(task.system, CondensedSystem)
        and boundary is not None
        and boundary.x.shape[1] == 2  # on a surface "every second node" is not defined
        and boundary.axes is None  # whose unknowns are not interpolated
        and boundary.size > FEWEST_NODES_TO_COARSEN
        and discretisation.scene.solver.initial_contact == "auto"
        and task.settings.algorithm in _ALGORITHMS
    )


def start_from_few_nodes(task: Task, boundary: ContactBoundary) -> Start:
    """A start from the sets and the multipliers of the problem on every second contact node, and so on.

    If a coarse problem has no solution, the next finer one starts from scratch: it is only a start.
    """
    levels = [_finest(task, boundary)]
    while levels[-1].boundary.size > 2 * COARSEST_NODES:
        levels.append(_coarser(levels[-1]))
    start: tuple[ActiveSets, tuple[Nodal, Nodal]] | None = None
    for fine, level in zip(levels[-2::-1], levels[:0:-1], strict=True):
        history = History()
        coarse = replace(
            task,
            settings=replace(task.settings, algorithm="ssn", fallbacks=False),
            system=level.system,
            motions=level.motions,
            start=replace(task.start, data=level.data, law=level.law, sets=level.first_sets),
            rest=None,
            history=history,
        )
        outcome = solve_task(coarse, coarse.start if start is None else coarse.start.begin_from(*start))
        status, start = outcome.status, None
        if status is Status.CONVERGED:
            start = carry_over(ContactState.of(coarse.contact(outcome, coarse.start), level.boundary), fine.boundary)
        solves = f"{history.linear_solves} linear solves"
        task.history.add(f"{level.boundary.size} contact nodes first: {solves}, {status.value}")
    return task.start if start is None else task.start.begin_from(*start)


def _finest(task: Task, boundary: ContactBoundary) -> _Level:
    begin = task.start
    numbers: Indices = np.column_stack((boundary.part.astype(np.int64), boundary.global_nodes))
    ranges, order, _ = chains(numbers, boundary.segments, boundary.x)
    found = [order[rows.start : rows.stop] for rows in ranges]
    return _Level(
        task.system, boundary, task.motions, begin.data, begin.law, begin.sets, found, np.arange(boundary.size)
    )


def _coarser(fine: _Level) -> _Level:
    """Every second node of each chain, its ends, and the nodes of two boundaries."""
    boundary, system = fine.boundary, fine.system
    # The system has the two unknowns of each node, in the order of their numbers.
    _, first, node_of, counts = np.unique(
        boundary.global_nodes, return_index=True, return_inverse=True, return_counts=True
    )
    unknowns = 2 * node_of.reshape(-1, 1) + np.arange(2)
    shared = counts[node_of.ravel()] > 1
    retained: list[Indices] = []
    ranges: list[Indices] = []
    pieces: list[Entries] = []
    before = 0
    for chain in fine.chains:
        stay = (np.arange(chain.size) % 2 == 0) | shared[chain]
        stay[-1] = True
        places: Indices = np.flatnonzero(stay)
        own: Indices = np.arange(before, before + places.size)
        before += places.size
        retained.append(chain[places])
        ranges.append(own)
        pieces += _linear(chain, places, own, boundary.x[chain])
    rows = np.concatenate(retained)
    interpolation = _matrix(pieces, (boundary.size, before))
    # From entries to nodes, which entries of two boundaries may share.
    coarse_nodes, coarse_first, coarse_of = np.unique(node_of.ravel()[rows], return_index=True, return_inverse=True)
    merge = _matrix([(np.arange(before), coarse_of.ravel(), np.ones(before))], (before, coarse_nodes.size))
    dofs = unknowns[first]
    kept_dofs = unknowns[rows[coarse_first]].ravel()
    prolongation = _of_dofs(interpolation[first] @ merge, dofs, kept_dofs, system.fixed)
    coarse = replace(
        boundary,
        nodes=boundary.nodes[rows],
        x=boundary.x[rows],
        weight=interpolation.T @ boundary.weight,
        normal=boundary.normal[rows],
        part=boundary.part[rows],
        free=boundary.free[rows],
        segments=boundary.segments[:0],
        global_nodes=boundary.global_nodes[rows],
    )
    d, law, sets = fine.data, fine.law, fine.first_sets

    def some(values: Nodal | None) -> Nodal | None:
        return None if values is None else values[rows]

    data = replace(
        d,
        gap=d.gap[rows],
        lambda_hat=d.lambda_hat[rows],
        mu_hat=d.mu_hat[rows],
        bound=some(d.bound),
        bilateral=None if d.bilateral is None else d.bilateral[rows],
        slip_origin=some(d.slip_origin),
    )
    return _Level(
        CoarsenedSystem.of(system, prolongation, kept_dofs, coarse.points, rows),
        coarse,
        fine.motions.some(rows, coarse.points),
        data,
        None if law is None else FrictionLaw(law.given[rows], law.coefficient[rows], some(law.cap)),
        None if sets is None else ActiveSets.of(sets.contact[rows], sets.direction[rows]),
        ranges,
        rows,
    )


def _linear(chain: Indices, places: Indices, columns: Indices, x: Nodal) -> list[Entries]:
    """Interpolation along a chain between the ``places`` that stay, linear in the arc length."""
    if places.size == 1:
        return [(chain, columns, np.ones(1))]
    s = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1))))
    right = np.clip(np.searchsorted(places, np.arange(chain.size)), 1, places.size - 1)
    share = (s - s[places[right - 1]]) / (s[places[right]] - s[places[right - 1]])
    return [(chain, columns[right - 1], 1.0 - share), (chain, columns[right], share)]


def _matrix(entries: list[Entries], shape: tuple[int, int]) -> sp.csr_matrix:
    """A sparse matrix without explicit zeros from (rows, columns, values)."""
    rows, columns, values = (np.concatenate(one) for one in zip(*entries, strict=True))
    matrix = sp.csr_matrix((values, (rows, columns)), shape=shape)
    matrix.eliminate_zeros()
    return matrix


def _of_dofs(
    nodal: sp.csr_matrix,
    dofs: Indices,
    retained: Indices,
    fixed: npt.NDArray[np.bool_],
) -> sp.csr_matrix:
    """Both components; a prescribed one takes no part in the interpolation."""
    entries = nodal.tocoo()
    rows = dofs[entries.row].ravel()
    columns = (2 * entries.col[:, None] + np.arange(2)).ravel()
    values = np.repeat(entries.data, 2)
    requested = (retained[columns] == rows) | ~(fixed[rows] | fixed[retained[columns]])
    shape = (fixed.size, retained.size)
    return sp.csr_matrix((values[requested], (rows[requested], columns[requested])), shape=shape)
