"""The expected cost of a solve before it begins, and of the next accuracy after it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from signorini_fx.algebra.linalg import choice
from signorini_fx.algebra.linalg.factorisation import factor_entries
from signorini_fx.machine import parallel
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Effect
from signorini_fx.mechanics.statement.features import accuracy_refused
from signorini_fx.results.accuracy.next_accuracy import next_refinement
from signorini_fx.tuned import (
    BASE_BYTES,
    BYTES_PER_DOF,
    FACTOR_SECONDS,
    FIXED_UNKNOWNS,
    NEWTON_SOLVES,
    NEXT_ERROR,
    PAIRED_BYTES,
    SOLVE_SECONDS,
    SOLVES_OF_START,
    SOLVES_PER_DOUBLING,
    WHOLE_SECONDS,
)


@dataclass(frozen=True)
class Cost:
    """A rough estimate, good to a factor of about three, for one core of a machine of the 2020s."""

    unknowns: int  # free displacement components, of the body and of rigid bodies
    linear_algebra: str  # ``full``, ``krylov`` or ``condensed``, and why
    linear_solves: tuple[int, int]  # from and to, of all load steps
    seconds: tuple[float, float]  # of the whole solve, from and to
    memory_bytes: float  # of the whole process
    next_error: float  # ratio of the next error to the present one
    next_seconds: tuple[float, float]  # seconds for the next error, from and to
    next_local: bool  # whether cells are divided where the error is; otherwise all become smaller
    next_refused: str  # why no accuracy can be requested; "" if it can


def linear_solves(model: Model, nodes: int) -> tuple[int, int]:
    """Return the smallest and largest number of linear solves to expect."""
    divided = max(
        (entry.time_steps(model.path.times) for entry in model.statement.of(Effect)), default=0
    )
    steps = model.path.expected + divided
    finer = model.settings.levels - 1
    if model.statement.nonlinear:
        return NEWTON_SOLVES[0] * steps, NEWTON_SOLVES[1] * steps
    if not model.contacts:
        return steps * (1 + finer), steps * (1 + finer)
    size = math.log2(max(nodes / 2**finer, 4))
    size *= 2 if model.has_coulomb else 1
    low, high = (round(factor * size) for factor in SOLVES_PER_DOUBLING)
    # A later load step starts from the sets of the previous one, a finer mesh from those of the
    # coarser one.
    least, greatest = SOLVES_OF_START
    if divided:  # in short steps sets hardly change
        return divided, least * steps
    return low + least * (steps - 1 + finer * steps), high * steps + greatest * finer * steps


def factorisation_seconds(unknowns: float, dimension: int) -> float:
    """Return the seconds of one sparse factorisation."""
    return SOLVE_SECONDS * unknowns + FACTOR_SECONDS[dimension] * unknowns ** (
        1.5 if dimension == 2 else 2.0
    )


def estimated_cost(model: Model) -> Cost:
    """Return the expected cost of a solve; collective.

    Nested dissection has n log n entries and n^1.5 operations in 2D, n^(4/3) and n^2 in 3D;
    multigrid has n of both.
    """
    comm = model.comm
    n = model.dofs
    dim = model.tagged.dimension
    touching = 0 if model.boundary is None else np.unique(model.boundary.nodes).size
    nodes, free = map(
        int, parallel.global_sum(comm, np.array([touching, np.count_nonzero(~model.fixed)]))
    )
    factorisation = factorisation_seconds(n, dim)
    solves = linear_solves(model, nodes)
    matrix = 12.0 * dim * 3**dim * n  # entries of the rows of Q1
    kind, reason = choice.choose_kind(model.system_size(), model.settings.linear_algebra)
    dense = 0
    held = 12.0 * factor_entries(n, dim)
    once, per_solve = 0.0, factorisation
    if kind == "krylov":
        per_solve = 0.0
        held = matrix
    elif kind == "condensed":  # dense solves take no longer, or it would not be chosen
        dense = dim * nodes
    elif model.boundary is None:
        reason = "one factorisation for all load steps"
        once = factorisation
        per_solve = SOLVE_SECONDS * n
    if model.boundary is not None and model.boundary.moving is not None:
        free += int(np.count_nonzero(~model.boundary.moving.fixed))
    # All other work, for each load step.
    steps = 1 if model.boundary is None else model.path.expected
    rest = steps * WHOLE_SECONDS[dim] * (FIXED_UNKNOWNS[dim] + n)
    seconds = (max(once + solves[0] * per_solve, rest), max(once + solves[1] * per_solve, rest))
    of = "energy" if model.statement.accuracy is None else model.statement.accuracy.of
    refused = accuracy_refused(model.statement, of)
    refinement = next_refinement(model.statement, model.tagged, of, free, able=not refused)
    paired = (
        PAIRED_BYTES[dim] * nodes if any(contact.against for contact in model.contacts) else 0.0
    )
    return Cost(
        unknowns=free,
        linear_algebra=f"{kind}: {reason}",
        linear_solves=solves,
        seconds=seconds,
        memory_bytes=BASE_BYTES * comm.size
        + BYTES_PER_DOF * n
        + 2 * matrix
        + held
        + 24.0 * dense**2
        + paired,
        next_error=NEXT_ERROR[dim],
        next_seconds=(seconds[0] * refinement.times[0], seconds[1] * refinement.times[1]),
        next_refused=refused if model.contacts else "",
        next_local=refinement.local,
    )
