"""Bodies that lie loose: nothing loads them, and they can move without touching anything.

They are in equilibrium without any traction, in every position on the way, so that no method finds one.  Whether
there is room for that depends on where supports and loads move the bodies around them: it is asked after a method has
failed, and takes one linear solve.  Where nothing at all has acted before one of several load steps, they stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from signorini_fx.algebra.algorithms.coulomb_statics import free_state
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.nodal_vectors import Nodal, length
from signorini_fx.algebra.contact.reactions import Reactions, reactions
from signorini_fx.algebra.contact.statics import null_space, squeezed
from signorini_fx.machine import parallel
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.rigid.motion_names import names_of
from signorini_fx.records import Finding, Status
from signorini_fx.results.solution import StepResult
from signorini_fx.tuned import CLOSED_GAP

# Outcomes that say how the methods have failed, and not why there is no solution, or not of which body.
_UNEXPLAINED = (
    Status.OPEN,
    Status.MAX_ITERATIONS,
    Status.OUTER_MAX_ITERATIONS,
    Status.CYCLING,
    Status.SLIDES_AT_PRESSURES,
    Status.SINGULAR,
    Status.LINEAR_SOLVER,
    Status.ROUND_OFF,
)


def explained(body: Model, task: Task, start: Start, outcome: Outcome, when: str) -> tuple[Outcome, Finding | None]:
    """The outcome of a load step, *opens* where a body lies loose, and which one does; collective.

    Args:
        body: the model.
        task: its contact problem.
        start: where the load step started.
        outcome: how it ended.
        when: the name of the load step, with a colon; "": there is one.
    """
    understood = outcome.status not in _UNEXPLAINED
    number = None if understood else loose_assembly(task, start.data, start.law)
    if number is None:
        if outcome.status is not Status.OPEN or task.system.resultant.any():
            return outcome, None
        message = (
            "no load presses the body on, and the supports do not hold it: press it on, or prescribe a displacement"
        )
        return outcome, Finding("warning", body.statement.forces_at, f"{when}{message}")
    if outcome.status is not Status.OPEN:
        task.history.add(f"{outcome.status.value}: nothing presses on a body, which can move without touching anything")
    motions = body.motions
    members = np.flatnonzero(motions.pieces.assembly == number)
    names = names_of(motions.of_all[:, motions.assembly == number], motions, members)
    loose = f"{names}, which the supports do not hold"
    if members.size == 1:
        loose = f"the body, of which the supports do not hold {names}"
    message = (
        f"nothing presses on {loose}: it lies loose, and many positions are in equilibrium; press it on, or prescribe "
        "a displacement"
    )
    return replace(outcome, status=Status.OPEN), Finding("warning", body.statement.forces_at, f"{when}{message}")


def loose_at_rest(body: Model, steps: Sequence[StepResult]) -> list[Finding]:
    """Load steps in which nothing has acted yet on what the supports do not hold, so that it stays; collective.

    Args:
        body: the model.
        steps: results of load steps that have a solution.
    """
    if len(steps) == 1 or not body.motions.free.shape[1]:
        return []
    resting = [step for step in steps if not parallel.any_rank(body.comm, bool(step.displacement.x.array.any()))]
    if not resting:
        return []
    numbers = [str(step.step) for step in resting]
    which = f"load step{'s' * (len(numbers) > 1)} {', '.join(numbers)}"
    message = (
        f"{which}: nothing loads the body, and the supports do not hold it: it is left where it is, one of many "
        "positions in equilibrium"
    )
    return [Finding("note", body.statement.forces_at, message)]


def loose_assembly(task: Task, data: RegularisedData, law: PointFriction | None) -> int | None:
    """The number of an assembly that lies loose in a load step; None where that is not proved of any; collective.

    Args:
        task: the contact problem.
        data: its problem, with the shear and the slip that friction counts from.
        law: the friction law itself, not the bound of an iterate; None without friction.
    """
    motions, load = task.motions, task.system.resultant
    idle = [(number, columns) for number, columns in motions.assemblies if not load[columns].any()]
    if not idle or (law is not None and law.ends_open is not None):
        return None
    free = free_state(task, data)
    if free is None:
        return None
    table = parallel.gather_rows(motions.points.comm, np.column_stack((free[0], length(data.mu_hat), free[1])))
    all_reactions = reactions(motions, law, data.bilateral)
    for number, columns in idle:
        assembly_reactions = all_reactions.of(number, columns)
        gap, shear, *slip = table[all_reactions.assembly == number].T
        if gap.size and _movable(assembly_reactions, gap, np.array(slip).T, shear):
            return number
    return None


def _movable(assembly_reactions: Reactions, gap: Nodal, slip: Nodal, shear: Nodal) -> bool:
    """Whether one assembly without tractions can be somewhere, and with given friction at more than one place.

    Args:
        assembly_reactions: its contact nodes, n of them.
        gap: in the free state, length, shape (n,).
        slip: in the free state, length, shape (n, d - 1).
        shear: its magnitude at the end of the load step before, stress, shape (n,).
    """
    frictional = assembly_reactions.given > 0
    if not frictional.any():
        return not squeezed(assembly_reactions, gap)
    # Given friction acts on open nodes, too: there is no shear only where there was none and nothing slips.
    rows = assembly_reactions.tangential[frictional].reshape(-1, assembly_reactions.normal.shape[1])
    ways, missing = null_space(rows), slip[frictional].ravel()
    back = np.linalg.lstsq(rows, -missing, rcond=None)[0]
    gap = gap - assembly_reactions.normal @ back
    size = max(float(np.abs(gap).max()), float(np.abs(missing).max()))
    if not ways.shape[1] or shear[frictional].any() or np.abs(missing + rows @ back).max() > CLOSED_GAP * size:
        return False
    return not squeezed(
        replace(assembly_reactions, normal=assembly_reactions.normal @ ways),
        gap - np.where(assembly_reactions.bilateral, 0.0, CLOSED_GAP * size),
    )
