"""A load step in which forces tighten sections: the shortenings at which these forces go through them.

The forces N(s) through the sections grow with the shortenings s, and are linear in them while no contact point changes
its state.  The contact problem is solved for one s after the other, by the method of C. G. Broyden, Math. Comp. 19
(1965) 577-593, which for one section is that of secants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from signorini_fx.algorithms.strategy import solve_task
from signorini_fx.algorithms.task import Outcome, Start, Task
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.records import Finding, Status
from signorini_fx.results.sections import section_forces
from signorini_fx.scene.effect import SectionJump

Array = npt.NDArray[np.float64]

# The share of the forces that they may miss: of round-off; and what friction, whose iteration ends before, may leave.
_EXACT, _ENOUGH = 1e-11, 1e-6
# Contact problems for one load step.
_MOST = 30
# Below this share of its force a section is loose, and is shortened by this factor, or at most by this one if not.
_NOTHING, _TIGHTER, _FURTHER = 1e-6, 4.0, 30.0


def tightened_at(d: Discretisation, place: float) -> list[int]:
    """The loads that are sections which forces tighten at a place."""
    found = [(k, load.section) for k, load in enumerate(d.applied)]
    return [k for k, one in found if one is not None and one.force_at(d.scene, place) is not None]


def shortenings(d: Discretisation, place: float) -> list[float]:
    """Those that forces have led to at a place, in the order of ``tightened_at``, length."""
    return [d.applied[k].factor(place) for k in tightened_at(d, place)]


def solve_tightened(
    d: Discretisation, task: Task, start: Start, most: int, scale: float = 1.0
) -> tuple[Discretisation, Start, Outcome, Finding | None]:
    """Solve a load step; collective.

    Args:
        d: the discretised scene.
        task: its contact problem.
        start: where the load step starts.
        most: linear solves allowed for each shortening.
        scale: factor of all loads, these forces included.

    Returns:
        The scene with the shortenings that were found, over ``scale``, where the load step starts with them, how it
        ended, and which section has nothing to pull at.
    """
    loads, place, newton = tightened_at(d, start.place), start.place, task.iterate.newton
    of_all = [k for k, load in enumerate(d.applied) if load.section is not None]
    here = [of_all.index(k) for k in loads]
    wanted = scale * np.array([_section(d, k).force_at(d.scene, place) for k in loads], dtype=np.float64)
    before = scale * np.array(shortenings(d, place))
    s = np.where(before > 0, before, wanted / d.scales.stiffness(d.scales.size))
    slope, last, best = np.empty((0, 0)), (s, s), np.inf
    for _ in range(_MOST):
        d = with_shortenings(d, loads, place, s / scale)
        start, begun = replace(start, factors=scale * d.factors(place)), newton.checkpoint()
        outcome, force = solve_task(task, start, most), np.zeros_like(s)
        if outcome.status is Status.CONVERGED:
            y = d.from_rest(task.rest, outcome.displacement())
            force = np.array([one.force for one in section_forces(d.scene, d.tagged, y, place, scale)])[here]
        elif slope.size or outcome.status is Status.NOT_HELD:  # whatever the shortenings are
            return d, start, outcome, None
        missing = float(np.abs(wanted - force).max() / wanted.max())
        task.history.add(f"sections shortened by {', '.join(f'{one:.6g}' for one in s)}: forces miss {missing:.1e}")
        if missing <= _EXACT or best / 2 <= missing <= _ENOUGH:
            return d, start, outcome, None
        if outcome.status is Status.CONVERGED:
            start = start.begin_from(outcome.problem.sets, outcome.newton.multipliers())
        else:
            newton.restore(begun)
        none = force <= _NOTHING * wanted
        if not slope.size and none.any():
            if s[none].max() > d.scales.size:
                return d, start, replace(outcome, status=Status.OPEN), _loose(d, loads[int(np.argmax(none * s))], start)
            s = np.where(none, _TIGHTER * s, s)
            continue
        if not slope.size:  # as if the forces were proportional to the shortenings
            slope = np.diag(np.minimum(s / force, _FURTHER * s / wanted))
        else:
            ds, dn = s - last[0], force - last[1]
            slope = slope + np.outer(ds - slope @ dn, ds @ slope) / (ds @ slope @ dn)
        best, last = min(best, missing), (s, force)
        s = s + slope @ (wanted - force)
    return d, start, replace(outcome, status=Status.OUTER_MAX_ITERATIONS), None


def _loose(d: Discretisation, number: int, start: Start) -> Finding:
    """What to say of a section that is shortened by more than the size of the body, without any force."""
    when = f"load step {start.step + 1}: " if d.scene.several_steps else ""
    message = (
        f"{when}{_section(d, number).name}: no force goes through it even if it is shortened by the size of "
        "the body: a part that it pulls at comes loose, or never meets what it is to clamp; check the gaps and "
        "the contacts of both parts"
    )
    return Finding("warning", "preload", message)


def _section(d: Discretisation, number: int) -> SectionJump:
    """Of a load that is one."""
    found = d.applied[number].section
    assert found is not None
    return found


def with_shortenings(
    d: Discretisation, loads: list[int], place: float, found: Sequence[float] | Array
) -> Discretisation:
    """The same with shortenings that were found at a place; nothing is assembled again."""
    sections = [_section(d, k) for k in loads]
    tight = {id(one): one.tightened(place, float(s)) for one, s in zip(sections, found, strict=True)}
    changed = {
        key: tuple(tight.get(id(one), one) for one in entries)
        for key, entries in d.scene.effects.items()
        if any(id(one) in tight for one in entries)
    }
    scene, applied = d.scene.model_copy(update=changed), []
    for load in d.applied:
        one = load.section and tight.get(id(load.section), load.section)
        applied.append(load if one is None else replace(load, section=one, amount=partial(one.shortening_at, scene)))
    same = replace(d, scene=scene, applied=tuple(applied))
    vars(same).update({name: value for name, value in vars(d).items() if name not in vars(same)})
    return same
