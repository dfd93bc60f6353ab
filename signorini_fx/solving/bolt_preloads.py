"""Sections across bolts that are shortened, by a given length or until a given force acts in them.

The displacement jumps across a section, see ``loads.initial_strains``.  In a load step in which
forces tighten sections, the shortenings s are sought at which the forces N(s) have the given
values.  The forces grow with the shortenings, and are linear in them while no contact point changes
its state.  The contact problem is solved for a sequence of s by the method of C. G. Broyden, Math.
Comp. 19 (1965) 577-593; for one section it is the secant method.
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
    """Solve a load step in which forces tighten sections; collective.

    Args:
        model: the body.
        task: the contact problem.
        start: the initial state of the load step.
        max_iterations: linear solves allowed for one contact problem; None: those of the settings.

    Returns:
        The model with the shortenings, the initial state and the outcome of the last contact
        problem, and why there is no solution, if known.
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
    """Return the preloads that are tightened by forces at a position on the path, by their numbers
    in ``model.applied``.
    """
    return {
        k: load.entry
        for k, load in enumerate(model.applied)
        if load.entry is not None and load.entry.tightens(step)
    }


def shortenings(model: Model, step: float) -> list[float]:
    """Return the shortenings of the sections that forces tighten, in the order of ``_tightened``,
    length.
    """
    entries = _tightened(model, step).values()
    return [entry.shortening_at(model.statement, step) for entry in entries]


def with_shortenings(model: Model, step: float, lengths: Sequence[float] | Array) -> Model:
    """Return the model with the shortenings that were found at a position on the path; nothing is
    assembled again.
    """
    found = dict(model.statement.found)
    for entry, length in zip(_tightened(model, step).values(), lengths, strict=True):
        found[id(entry)] = {**found.get(id(entry), {}), step: float(length)}
    return model.with_statement(replace(model.statement, found=found))


def tightened(posed: Posed, start: Start, found: Array) -> tuple[Posed, Start]:
    """Return a load step with the shortenings found for its forces; ``found`` is as in
    ``found_in``.
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
    """Return the shortening of each section with a given force up to a position on the path,
    length; nan where it has not been tightened.
    """
    return np.array([entry.found_at(model.statement, step) for entry in _by_force(model)])


def with_found(model: Model, step: float, lengths: Array) -> Model:
    """Return the model with the shortenings found before a step, length; nan where there
    are none.
    """
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
