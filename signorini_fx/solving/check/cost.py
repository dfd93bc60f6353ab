"""A rough estimate of the cost of a solve: linear solves, seconds and memory."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from signorini_fx.algebra.linalg import choice
from signorini_fx.algebra.linalg.factorisation import factor_entries
from signorini_fx.machine import parallel
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import Finding
from signorini_fx.results.accuracy.next_accuracy import next_refinement
from signorini_fx.tuned import (
    BASE_BYTES,
    BYTES_PER_DOF,
    DENSE_SPEED,
    FACTOR_SECONDS,
    KRYLOV_SECONDS,
    MEMORY_SHARE,
    NEWTON_SOLVES,
    NEXT_ERROR,
    PAIRED_BYTES,
    SOLVES_OF_START,
    SOLVES_PER_DOUBLING,
)


@dataclass(frozen=True)
class Cost:
    """A rough estimate, good to a factor of about three, for one core of a machine of the 2020s.

    Attributes:
        unknowns: displacement components that are not prescribed, of the body and of rigid ones.
        linear_algebra: ``full``, ``krylov`` or ``condensed``, and why.
        linear_solves: from and to, of all load steps.
        factorisation_seconds: of one sparse factorisation, whether one is made or not.
        factorisation_bytes: its factor.
        seconds: linear algebra of the whole solve, from and to.
        memory_bytes: of the whole process.
        next_error: the share of the error that the next two are about.
        next_seconds: that it would take, from and to.
        next_local: whether cells are divided where the error is; otherwise all become smaller.
    """

    unknowns: int
    linear_algebra: str
    linear_solves: tuple[int, int]
    factorisation_seconds: float
    factorisation_bytes: float
    seconds: tuple[float, float]
    memory_bytes: float
    next_error: float
    next_seconds: tuple[float, float]
    next_local: bool


def linear_solves(statement: Statement, nodes: int) -> tuple[int, int]:
    """Linear solves to expect, from and to."""
    steps, finer = statement.expected_steps, statement.solver.levels - 1
    if statement.nonlinear:
        return NEWTON_SOLVES[0] * steps, NEWTON_SOLVES[1] * steps
    if not statement.contact:
        return steps * (1 + finer), steps * (1 + finer)
    size = math.log2(max(nodes / 2**finer, 4))
    size *= 2 if any(contact.coulomb for contact in statement.contact) else 1
    low, high = (round(factor * size) for factor in SOLVES_PER_DOUBLING)
    # A later load step starts from the sets of the previous one, a finer mesh from those of the coarser one.
    least, greatest = SOLVES_OF_START
    return low + least * (steps - 1 + finer * steps), high * steps + greatest * finer * steps


def estimated_cost(model: Model) -> Cost:
    """Nested dissection: n log n entries and n^1.5 operations in two dimensions, n^(4/3) and n^2 in three; multigrid: n
    of both.
    """
    comm = model.comm
    n = model.dofs
    of_rank = 0 if model.boundary is None else np.unique(model.boundary.nodes).size
    nodes = int(parallel.global_sum(comm, np.array(of_rank)))
    dim = model.tagged.dimension
    entries = factor_entries(n, dim)
    factorisation = FACTOR_SECONDS[dim][0] * n + FACTOR_SECONDS[dim][1] * n ** (1.5 if dim == 2 else 2.0)
    solves = linear_solves(model.statement, nodes)
    matrix = 12.0 * dim * 3**dim * n  # a row of Q1 has so many entries
    kind, reason = choice.choose_kind(model.system_size(), model.statement.solver.linear_algebra)
    dense, held = 0, 12.0 * entries
    if kind == "krylov":
        once, per_solve, held = KRYLOV_SECONDS * n, KRYLOV_SECONDS * n, matrix
    elif kind == "condensed":
        dense = dim * nodes
        once, per_solve = factorisation, dense**3 / 3 / DENSE_SPEED
    elif model.boundary is None:
        reason, once, per_solve = "one factorisation for all load steps", factorisation, FACTOR_SECONDS[dim][0] * n
    else:
        once, per_solve = 0.0, factorisation
    if model.statement.nonlinear:  # each linear solve has a factorisation
        once, per_solve = 0.0, factorisation
    free = int(parallel.global_sum(comm, np.array(np.count_nonzero(~model.fixed))))
    if model.boundary is not None and model.boundary.moving is not None:
        free += int(np.count_nonzero(~model.boundary.moving.fixed))
    seconds = once + solves[0] * per_solve, once + solves[1] * per_solve
    of = "energy" if model.statement.accuracy is None else model.statement.accuracy.of
    refinement = next_refinement(model.statement, model.tagged, of, free)
    paired = PAIRED_BYTES[dim] * nodes if any(contact.against for contact in model.statement.contact) else 0.0
    return Cost(
        unknowns=free,
        linear_algebra=f"{kind}: {reason}",
        linear_solves=solves,
        factorisation_seconds=factorisation,
        factorisation_bytes=9.0 * entries,
        seconds=seconds,
        memory_bytes=BASE_BYTES * comm.size + BYTES_PER_DOF * n + 2 * matrix + held + 24.0 * dense**2 + paired,
        next_error=NEXT_ERROR[dim],
        next_seconds=(seconds[0] * refinement.times[0], seconds[1] * refinement.times[1]),
        next_local=refinement.local,
    )


def memory_finding(cost: Cost, comm: MPI.Comm) -> list[Finding]:
    """A warning if the machine has too little memory; collective."""
    available = parallel.machine_memory(comm)
    if cost.memory_bytes < MEMORY_SHARE * available:
        return []
    message = (
        f"about {cost.memory_bytes / 1e9:.0f} GB are needed, this machine has {available / 1e9:.0f}: use a coarser mesh"
    )
    return [Finding("warning", "mesh", message)]
