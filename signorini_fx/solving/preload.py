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
_MOST_PROBLEMS = 30
# Below this share of its force a section is loose, and is shortened by this factor, or at most by this one if not.
_NOTHING, _TIGHTER, _FURTHER = 1e-6, 4.0, 30.0


def tightened_at(d: Discretisation, step: float) -> list[int]:
    """The loads that are sections which forces tighten at a place."""
    sections = [(k, load.section) for k, load in enumerate(d.applied)]
    return [k for k, section in sections if section is not None and section.force_at(d.scene, step) is not None]


def shortenings(d: Discretisation, step: float) -> list[float]:
    """Those that forces have led to at a place, in the order of ``tightened_at``, length."""
    return [d.applied[k].factor(step) for k in tightened_at(d, step)]


def solve_tightened(
    d: Discretisation, task: Task, start: Start, max_iterations: int, scale: float = 1.0
) -> tuple[Discretisation, Start, Outcome, Finding | None]:
    """Solve a load step; collective.

    Args:
        d: the discretised scene.
        task: its contact problem.
        start: where the load step starts.
        max_iterations: linear solves allowed for each shortening.
        scale: factor of all loads, these forces included.

    Returns:
        The scene with the shortenings that were found, over ``scale``, where the load step starts with them, how it
        ended, and which section has nothing to pull at.
    """
    loads, step, newton = tightened_at(d, start.place), start.place, task.iterate.newton
    of_all = [k for k, load in enumerate(d.applied) if load.section is not None]
    numbers = [of_all.index(k) for k in loads]
    wanted = scale * np.array([_section(d, k).force_at(d.scene, step) for k in loads], dtype=np.float64)
    previous = scale * np.array(shortenings(d, step))
    s = np.where(previous > 0, previous, wanted / d.scales.stiffness(d.scales.size))
    slope, last, best = np.empty((0, 0)), (s, s), np.inf
    for _ in range(_MOST_PROBLEMS):
        d = with_shortenings(d, loads, step, s / scale)
        start, begun = replace(start, factors=scale * d.factors(step)), newton.checkpoint()
        outcome, force = solve_task(task, start, max_iterations), np.zeros_like(s)
        if outcome.status is Status.CONVERGED:
            y = d.from_rest(task.rest, outcome.displacement())
            force = np.array([entry.force for entry in section_forces(d.scene, d.tagged, y, step, scale)])[numbers]
        elif slope.size or outcome.status is Status.NOT_HELD:  # whatever the shortenings are
            return d, start, outcome, None
        missing = float(np.abs(wanted - force).max() / wanted.max())
        task.history.add(f"sections shortened by {', '.join(f'{entry:.6g}' for entry in s)}: forces miss {missing:.1e}")
        if missing <= _EXACT or best / 2 <= missing <= _ENOUGH:
            return d, start, outcome, None
        if outcome.status is Status.CONVERGED:
            start = start.begin_from(outcome.problem.sets, outcome.newton.multipliers())
        else:
            newton.restore(begun)
        slack = force <= _NOTHING * wanted
        if not slope.size and slack.any():
            if s[slack].max() > d.scales.size:
                return (
                    d,
                    start,
                    replace(outcome, status=Status.OPEN),
                    _loose(d, loads[int(np.argmax(slack * s))], start),
                )
            s = np.where(slack, _TIGHTER * s, s)
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
    section = d.applied[number].section
    assert section is not None
    return section


def with_shortenings(
    d: Discretisation, loads: list[int], step: float, lengths: Sequence[float] | Array
) -> Discretisation:
    """The same with shortenings that were found at a place; nothing is assembled again."""
    sections = [_section(d, k) for k in loads]
    tight = {id(section): section.tightened(step, float(s)) for section, s in zip(sections, lengths, strict=True)}
    changed = {
        key: tuple(tight.get(id(section), section) for section in entries)
        for key, entries in d.scene.effects.items()
        if any(id(section) in tight for section in entries)
    }
    scene, applied = d.scene.model_copy(update=changed), []
    for load in d.applied:
        section = load.section and tight.get(id(load.section), load.section)
        applied.append(
            load if section is None else replace(load, section=section, amount=partial(section.shortening_at, scene))
        )
    return replace(d, scene=scene, applied=tuple(applied))
