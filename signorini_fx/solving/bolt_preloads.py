"""Sections across bolts that are shortened, by a given length or until a force goes through them.

What is beyond a section jumps against what is before it, see ``loads.initial_strains``.  In a load
step in which forces tighten sections the shortenings are found at which these forces go through
them: the forces N(s) grow with the shortenings s, and are linear in them while no contact point
changes its state.  The contact problem is solved for one s after the other by the method of C. G.
Broyden, Math. Comp. 19 (1965) 577-593; for one section it is that of secants.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np

from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.arrays import Array
from signorini_fx.mechanics.effects.loads import Preload
from signorini_fx.mechanics.model import Model, stated
from signorini_fx.records import Finding, Status
from signorini_fx.results.contact_figures import section_forces
from signorini_fx.solving.frames import Posed
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, LEFT_BY_SOLVES, ROOT_OF_EPS, SHORTENED_AT_MOST

B = TypeVar("B", bound=Model)

# Contact problems for one load step.
_MOST_PROBLEMS = 30


def solve_tightened(
    model: Model, task: Task, start: Start, max_iterations: int | None
) -> tuple[Model, Start, Outcome, Finding | None]:
    """The last contact problem of a load step in which forces tighten sections; collective.

    Returns:
        The model with the shortenings, where the problem starts, how it ended, and why there is no
        solution, if known.
    """
    place = start.place
    newton = task.newton
    loads = _tightened(model, place)
    of_all = [k for k, load in enumerate(model.applied) if isinstance(load.entry, Preload)]
    numbers = [of_all.index(k) for k in loads]
    wanted = np.array(
        [entry.force_at(model.statement, place) for entry in loads.values()], dtype=np.float64
    )
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
    """The loads that are sections which forces tighten at a place, by their numbers."""
    entries = {
        k: load.entry for k, load in enumerate(model.applied) if isinstance(load.entry, Preload)
    }
    return {
        k: entry
        for k, entry in entries.items()
        if entry.force_at(model.statement, step) is not None
    }


def shortenings(model: Model, step: float) -> list[float]:
    """Return the shortenings that forces have led to at a place, in the order of ``_tightened``,
    length.
    """
    return [model.applied[k].factor(step) for k in _tightened(model, step)]


def with_shortenings(model: B, step: float, lengths: Sequence[float] | Array) -> B:
    """Return the model with shortenings that were found at a place; nothing is assembled again."""
    shortened = zip(_tightened(model, step).values(), lengths, strict=True)
    return _with(model, {id(entry): entry.tightened(step, float(s)) for entry, s in shortened})


def tightened(posed: Posed, start: Start, found: Array) -> tuple[Posed, Start]:
    """A load step with the shortenings that its forces have led to, as ``found_in`` gives them."""
    body = posed.body
    place = start.place
    assert isinstance(body, Model)
    lengths = zip(_by_force(body), found, strict=False)
    tight = {
        id(at): at.tightened(place, float(s))
        for at, s in lengths
        if at.force_at(body.statement, place) is not None
    }
    if not tight:
        return posed, start
    body = _with(body, tight)
    return replace(posed, body=body), replace(start, factors=body.factors(place))


def found_in(model: Model, step: float) -> Array:
    """Return by how much forces have shortened each of their sections up to a place, length; nan:
    by nothing.
    """
    return np.array([entry.found_at(step) for entry in _by_force(model)])


def with_found(model: B, step: float, found: Array) -> B:
    """Return the model whose forces have led to these shortenings before a step; itself if it has
    them.
    """
    entries = _by_force(model)
    if not found.size:
        found = np.full(len(entries), np.nan)
    begun = (
        (entry, entry.found_before(step, float(length)))
        for entry, length in zip(entries, found, strict=True)
    )
    changed = {id(entry): again for entry, again in begun if again is not entry}
    return _with(model, changed) if changed else model


def _by_force(model: Model) -> list[Preload]:
    entries = [load.entry for load in model.applied if isinstance(load.entry, Preload)]
    return [entry for entry in entries if entry.force is not None]


def _with(model: B, tight: Mapping[int, Preload]) -> B:
    """Return the model with other entries in place of these, by their identity."""
    changed = {
        key: tuple(tight.get(id(entry), entry) for entry in entries)
        for key, entries in model.statement.effects.items()
        if any(id(entry) in tight for entry in entries)
    }
    statement = model.statement.changed(**changed)
    applied = list(model.applied)
    for k, load in enumerate(applied):
        if isinstance(load.entry, Preload):
            entry = tight.get(id(load.entry), load.entry)
            applied[k] = replace(load, entry=entry, factor=partial(entry.shortening_at, statement))
    return replace(model, **stated(statement), applied=tuple(applied))
