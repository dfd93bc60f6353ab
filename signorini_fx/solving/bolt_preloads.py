"""Sections across bolts that are shortened, by a given length or until a force goes through them.

What is beyond a section jumps against what is before it, see ``loads.initial_strains``.  In a load
step in which forces tighten sections the shortenings are found at which these forces go through
them: the forces N(s) grow with the shortenings s, and are linear in them while no contact point
changes its state.  The contact problem is solved for one s after the other by the method of C. G.
Broyden, Math. Comp. 19 (1965) 577-593; for one section it is that of secants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.arrays import Array
from signorini_fx.mechanics.effects.loads import Preload
from signorini_fx.mechanics.model import Model
from signorini_fx.records import Finding, Status
from signorini_fx.results.contact_figures import section_forces
from signorini_fx.solving.frames import Posed
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, LEFT_BY_SOLVES, ROOT_OF_EPS, SHORTENED_AT_MOST

# Contact problems for one load step.
_MOST_PROBLEMS = 30


def solve_tightened(
    model: Model, task: Task, start: Start, max_iterations: int | None
) -> tuple[Model, Start, Outcome, Finding | None]:
    """Return the last contact problem of a load step in which forces tighten sections; collective.

    Returns:
        The model with the shortenings, where the problem starts, how it ended, and why there is no
        solution, if known.
    """
    place = start.place
    newton = task.newton
    loads = _tightened(model, place)
    of_all = [k for k, load in enumerate(model.applied) if load.entry is not None]
    numbers = [of_all.index(k) for k in loads]
    wanted = np.array([entry.value_at(model.statement, place) for entry in loads.values()])
    previous = np.array(shortenings(model, place))
    # Shortenings s, and ``slope``, length per force: Broyden's approximation of the inverse of
    # dN/ds, empty until every section holds some of its force; ``last`` are s and N of the iterate
    # before.
    s = np.where(previous > 0, previous, wanted / model.scales.stiffness(model.scales.size))
    slope = np.empty((0, 0))
    last = (s, s)
    best = np.inf
    for _ in range(_MOST_PROBLEMS):
        model = with_shortenings(model, place, s)
        start = replace(start, factors=model.factors(place))
        begun = newton.checkpoint()
        outcome = solve_task(task, start, max_iterations)
        force = np.zeros_like(s)
        if outcome.status is Status.CONVERGED:
            y = model.from_rest(task.rest, outcome.displacement())
            force = np.array([row.force for row in section_forces(model, y, place)])[numbers]
        elif slope.size or outcome.status is Status.NOT_HELD:  # whatever the shortenings are
            return model, start, outcome, None
        missing = float(np.abs(wanted - force).max() / wanted.max())
        task.history.add(
            f"sections shortened by {', '.join(f'{entry:.6g}' for entry in s)}: error of "
            f"the forces {missing:.1e}"
        )
        if missing <= LEFT_BY_SOLVES or best / 2 <= missing <= CERTIFICATE_TOLERANCE:
            return model, start, outcome, None
        if outcome.status is Status.CONVERGED:
            start = start.begin_from(outcome.problem.sets, outcome.newton.multipliers())
        else:
            newton.restore(begun)
        if not slope.size and (SHORTENED_AT_MOST * force < wanted).any():
            loose = np.where(force <= CERTIFICATE_TOLERANCE * wanted, s, 0.0)
            if loose.max() > model.scales.size:
                when = f"load step {start.step + 1}: " if model.path.several else ""
                message = (
                    f"{when}{[*loads.values()][int(np.argmax(loose))].name}: the bolt clamps "
                    "nothing: check gaps and contacts of both parts"
                )
                reason = Finding("warning", "preload", message)
                return model, start, replace(outcome, status=Status.OPEN), reason
            s = s * wanted / np.maximum(force, wanted / SHORTENED_AT_MOST)
            continue
        if not slope.size:  # as if the forces were proportional to the shortenings
            slope = np.diag(s / force)
        else:
            ds = s - last[0]
            dn = force - last[1]
            seen = slope @ dn
            along = ds @ seen
            if abs(along) > ROOT_OF_EPS * np.linalg.norm(ds) * np.linalg.norm(seen):
                slope = slope + np.outer(ds - seen, ds @ slope) / along
        best = min(best, missing)
        last = (s, force)
        s = s + slope @ (wanted - force)
    return model, start, replace(outcome, status=Status.OUTER_MAX_ITERATIONS), None


def _tightened(model: Model, step: float) -> dict[int, Preload]:
    """Return the loads that are sections which forces tighten at a place, by their numbers."""
    return {
        k: load.entry
        for k, load in enumerate(model.applied)
        if load.entry is not None and load.entry.tightens(step)
    }


def shortenings(model: Model, step: float) -> list[float]:
    """Return the shortenings that forces have led to at a place, in the order of ``_tightened``,
    length.
    """
    entries = _tightened(model, step).values()
    return [entry.shortening_at(model.statement, step) for entry in entries]


def with_shortenings(model: Model, step: float, lengths: Sequence[float] | Array) -> Model:
    """Return the model with shortenings that were found at a place; nothing is assembled again."""
    found = dict(model.statement.found)
    for entry, length in zip(_tightened(model, step).values(), lengths, strict=True):
        found[id(entry)] = {**found.get(id(entry), {}), step: float(length)}
    return model.with_statement(replace(model.statement, found=found))


def tightened(posed: Posed, start: Start, found: Array) -> tuple[Posed, Start]:
    """Return a load step with the shortenings that its forces have led to, as ``found_in`` gives
    them.
    """
    body = posed.body
    place = start.place
    lengths = zip(_by_force(body), found, strict=False)
    tight = [length for entry, length in lengths if entry.tightens(place)]
    if not tight:
        return posed, start
    body = with_shortenings(body, place, tight)
    return replace(posed, body=body), replace(start, factors=body.factors(place))


def found_in(model: Model, step: float) -> Array:
    """Return by how much forces have shortened each of their sections up to a place, length; nan:
    by nothing.
    """
    return np.array([entry.found_at(model.statement, step) for entry in _by_force(model)])


def with_found(model: Model, step: float, lengths: Array) -> Model:
    """Return the model whose forces have led to these shortenings before a step, nan: to none."""
    found = {}
    for entry, length in zip(_by_force(model), lengths, strict=False):
        known = model.statement.found.get(id(entry), {})
        earlier = {place: shortening for place, shortening in known.items() if place < step}
        if not np.isnan(length):
            earlier[max(earlier, default=-1.0)] = float(length)
        found[id(entry)] = earlier
    return model.with_statement(replace(model.statement, found=found))


def _by_force(model: Model) -> list[Preload]:
    entries = (load.entry for load in model.applied if load.entry is not None)
    return [entry for entry in entries if entry.force is not None]
