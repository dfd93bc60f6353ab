"""A load step with loads that enter contact as it opens: their pressure follows the open points until both agree.

The loads begin where the last load step has left them.  The contact problem with their pressure is solved, and they go
on from all points that they have reached through points that are open in its solution, by one facet beyond them, until
they reach no more.  Never is a point loaded that an equilibrium with less of the load has not led to, and none is left
again: the region is the smallest one, and depends on nothing that the iteration does.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.algorithms.strategy import solve_task
from signorini_fx.algorithms.task import Outcome, Start, Task
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.joint_loads import JointLoads
from signorini_fx.body.joint_pressure import Flags, JointPressure, Stage, work_on_motions
from signorini_fx.linalg.elasticity import LoadCase
from signorini_fx.records import Status

Array = npt.NDArray[np.float64]


def solve_with_joint_loads(
    d: Discretisation,
    task: Task,
    start: Start,
    previous: JointPressure | None,
    max_iterations: int,
    holds: Callable[[Outcome, JointPressure], bool],
) -> tuple[Outcome, JointPressure]:
    """Solve a load step; collective.

    Args:
        d: the discretised scene.
        task: its contact problem.
        start: where the load step starts.
        previous: the pressure of the loads at the end of the last one; None: there is none.
        max_iterations: linear solves allowed for each distribution of the pressure.
        holds: whether the certificate of a solution holds from which the loads go on; collective.

    Returns:
        How it ended with the last pressure of the loads, and that pressure.
    """
    assert d.boundary is not None
    loads, newton = JointLoads(d.scene, d.tagged, d.space, d.boundary, start.place), task.iterate.newton
    reached = loads.beginning(None if previous is None else previous.reached)
    cold, begun = start, newton.checkpoint()
    stage: Stage | None = None
    pressure = solved = loads.pressure(reached)
    outcome: Outcome | None = None
    while True:
        if outcome is None or parallel.any_rank(d.comm, not np.array_equal(pressure, solved)):
            _press(d, task, pressure)
            outcome, solved = solve_task(task, start, max_iterations), pressure
            if start is not cold and task.gave_up(outcome.status):
                task.history.add(f"{outcome.status.value}: from where the loads were in contact before: begun again")
                newton.restore(begun)
                outcome = solve_task(task, cold, max_iterations)
        points = loads.at_points(reached)
        if outcome.status is not Status.CONVERGED:
            return outcome, JointPressure(pressure, points, stage)
        multipliers = outcome.newton.multipliers()
        open_: Flags = np.asarray(multipliers[0] <= 0)
        grown = loads.grown(open_, reached)
        joint_pressure = JointPressure(pressure, points, stage, settled=not _differ(d, grown, reached))
        if joint_pressure.settled or not holds(outcome, joint_pressure):
            return outcome, joint_pressure
        stage, reached = Stage(points, open_), grown
        pressure = loads.pressure(reached)
        counts = np.array([np.count_nonzero(loads.at_points(reached).any(axis=1)), pressure.size])
        reached_count, point_count = parallel.global_sum(d.comm, counts)
        task.history.add(f"loads have entered contact at {reached_count:.0f} of {point_count:.0f} points: solved again")
        start = cold.begin_from(outcome.problem.sets, multipliers)


def recalled_joint_loads(d: Discretisation, task: Task, step: float, reached: Array) -> JointPressure:
    """The pressure of loads that had reached some contact points, flags of shape (n, m), and set in the contact
    problem; collective.
    """
    assert d.boundary is not None
    loads = JointLoads(d.scene, d.tagged, d.space, d.boundary, step)
    nodes = loads.beginning(reached > 0.5)
    pressure = loads.pressure(nodes)
    _press(d, task, pressure)
    return JointPressure(pressure, loads.at_points(nodes), recalled=True)


def _differ(d: Discretisation, grown: list[Flags], reached: list[Flags]) -> bool:
    """Whether nodes that loads have reached are not the same; collective."""
    return parallel.any_rank(
        d.comm, any((new_flags != old_flags).any() for new_flags, old_flags in zip(grown, reached, strict=True))
    )


def _press(d: Discretisation, task: Task, pressure: Array) -> None:
    """Put pressures at the contact points, shape (n,), on the body: on both bodies where two touch each other."""
    load, start = d.stiffness.createVecRight(), d.stiffness.createVecRight()
    assert d.at_contact is not None
    d.contact.add_forces(-pressure, np.zeros((pressure.size, d.dimension - 1)), load)
    case = LoadCase(load, start, work_on_motions(d.at_contact, pressure))
    task.system.set_case(len(d.applied) - 1, case)
