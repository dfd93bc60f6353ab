"""Bodies that lie loose: their loads balance each other, and contact need not press on them.

They are in equilibrium without any traction in many places, so that no method finds one.  Springs at the contact
points, far softer than the body, lead from the last place to the nearest one, where they carry nothing: each solve is
one step of the proximal point method (R. T. Rockafellar, SIAM J. Control Optim. 14 (1976) 877-898).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.motions import FreeMotions
from signorini_fx.algebra.regularised import SoftSprings
from signorini_fx.machine import parallel
from signorini_fx.records import Status
from signorini_fx.tuned import NO_FORCE

# Outcomes that do not say why there is no solution: it may be that a body lies loose.
UNEXPLAINED = (
    Status.OPEN,
    Status.MAX_ITERATIONS,
    Status.OUTER_MAX_ITERATIONS,
    Status.CYCLING,
    Status.SLIDES_AT_PRESSURES,
    Status.SINGULAR,
    Status.LINEAR_SOLVER,
    Status.ROUND_OFF,
)


def idle(task: Task) -> list[int]:
    """The numbers of the assemblies that can move, and whose loads balance each other."""
    return [number for number, columns in task.motions.assemblies if not task.system.resultant[columns].any()]


def untouched(motions: FreeMotions, numbers: list[int], pressed: npt.NDArray[np.bool_]) -> list[int]:
    """Which of these assemblies have no contact point with tractions; ``pressed``: which points have, shape (n,);
    collective.
    """
    comm, of = motions.points.comm, motions.of_point
    return [number for number in numbers if not parallel.any_rank(comm, bool(pressed[of == number].any()))]


def near_the_last_place(task: Task, start: Start, solve: Callable[[Task, Start], Outcome]) -> Outcome | None:
    """The solution nearest to the iterate of the task, without tractions where bodies lie loose; None: none is found;
    ``solve``: solves a load step of bodies that are held; collective.
    """
    motions, newton, comm = task.motions, task.newton, task.motions.points.comm
    numbers, law = idle(task), start.law
    without_load = np.isin(motions.of_point, numbers)
    if law is not None:
        law = law.without_pressure(without_load)
        start = replace(start, law=law, data=replace(start.data, bound=law.given))
    held = replace(
        task,
        motions=replace(motions, relative=motions.relative[:, :, :0], assembly=motions.assembly[:0]),
        has_coulomb=law is not None and parallel.any_rank(comm, law.follows_pressure),
        settings=replace(task.settings, algorithm="ssn"),
    )
    start, problem = replace(start, factors=None), held.newton.problem
    held.newton.begin_at(newton.x)
    position = np.column_stack(problem.system.contact.traces(newton.x))
    farthest, moved = parallel.largest(comm, np.abs(position), 0.0), np.inf
    while True:
        problem.springs = SoftSprings(NO_FORCE * task.natural_gamma, position)
        outcome, last_position = solve(held, start), position
        if outcome.status not in (Status.CONVERGED, Status.ROUND_OFF):  # the springs may carry no more than that
            return None
        position = np.column_stack(problem.system.contact.traces(outcome.newton.x))
        size = parallel.largest(comm, np.abs(position), 0.0)
        farthest = max(farthest, size)
        last_moved, moved = moved, parallel.largest(comm, np.abs(position - last_position), 0.0)
        if moved <= NO_FORCE * size:
            break
        if 2 * moved > last_moved:  # loads drive a body, or round-off of lengths over the share of the springs does
            if moved > task.coordinate_error / NO_FORCE:
                return None
            break
        start = start.begin_from(outcome.problem.sets, outcome.newton.multipliers())
    (x, sets, data), tractions = outcome.newton.checkpoint(), np.column_stack(outcome.newton.multipliers())
    assert data is not None
    pressed = np.abs(tractions).max(axis=1) > NO_FORCE * task.natural_gamma * farthest
    loose = np.isin(motions.of_point, untouched(motions, numbers, pressed))
    if task.has_coulomb and parallel.any_rank(comm, bool((without_load & ~loose).any())):
        return None
    system, reached = problem.system, x.norm(PETSc.NormType.NORM_INFINITY)
    if system.load.norm() == system.start.norm() == 0.0 and reached <= NO_FORCE * farthest:  # round-off of the way back
        x.set(0.0)
    newton.restore((x, replace(sets, contact=sets.contact & ~(loose & ~data.bilateral)), data))
    regularised = task.settings.algorithm == "alm"
    return replace(outcome, status=Status.CONVERGED, newton=newton, regularised=regularised)
