"""Bodies that lie loose, in words: nothing presses on them, and they can move without touching anything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from signorini_fx.algebra.algorithms.loose import idle, untouched
from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.mechanics.body.elastic_body import ElasticBody
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.rigid.motion_names import names_of
from signorini_fx.records import Finding, Status
from signorini_fx.results.mechanics import StepResult


def explained(body: Model, task: Task, outcome: Outcome, when: str) -> Finding | None:
    """Which bodies lie loose where contact opens without a load that opens it; ``when``: the name of the load step with
    a colon, or ""; None: it is another outcome; collective.
    """
    if outcome.status is not Status.OPEN:
        return None
    loose = idle(task)
    if len(loose) < len(task.motions.assemblies):  # what a load moves away lies beside them
        loose = untouched(task.motions, loose, np.asarray(np.column_stack(outcome.newton.multipliers()).any(axis=1)))
    if not loose:
        return None
    message = (
        f"{when}nothing presses on {_named(body, loose)}: it lies loose, and many positions are in equilibrium; press "
        "it on, or prescribe a displacement"
    )
    return Finding("warning", body.statement.forces_at, message)


def loose_in(body: ElasticBody, step: StepResult) -> list[int]:
    """The assemblies that supports do not hold, and that have no tractions in a load step; collective."""
    motions = body.at_contact
    if step.contact is None or not motions.count:
        return []
    pressed = np.asarray(np.column_stack((step.contact.pressure, step.contact.shear)).any(axis=1))
    return untouched(motions, [number for number, _ in motions.assemblies], pressed)


def loose_at_rest(
    body: ElasticBody, steps: Sequence[StepResult], path: str, names: tuple[str, ...] = ()
) -> list[Finding]:
    """Load steps that leave what the supports do not hold near to where it was, as nothing presses on it; ``names``: of
    the bodies that its pieces are, if the pieces have none; collective.
    """
    loose = {step.step: numbers for step in steps if (numbers := loose_in(body, step))}
    if len(steps) == 1 or not loose:
        return []
    which = f"load step{'s' * (len(loose) > 1)} {', '.join(map(str, loose))}"
    bodies = _named(body, sorted(set().union(*loose.values())), names)
    message = (
        f"{which}: nothing presses on {bodies}: it is left as near as possible to where it was, one of many positions "
        "in equilibrium"
    )
    return [Finding("note", path, message)]


def _named(body: ElasticBody, loose: Sequence[int], names: tuple[str, ...] = ()) -> str:
    """These assemblies with their free motions; ``names``: see ``loose_at_rest``."""
    motions = body.motions
    if names:
        motions = replace(motions, pieces=replace(motions.pieces, bodies=names))
    members = np.flatnonzero(np.isin(motions.pieces.assembly, loose))
    free = names_of(motions.of_all[:, np.isin(motions.assembly, loose)], motions, members)
    if members.size == 1 and motions.moving is None:
        return f"the body, of which the supports do not hold {free}"
    return f"{free}, which the supports do not hold"
