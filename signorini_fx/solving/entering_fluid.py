"""A load step with fluids that enter contact as it opens: their pressure follows the open points until both agree.

The fluids begin where open points of the last load step lead them to, without what is closed now.  The contact problem
with their pressure is solved, and they go on from all points that they have reached through open ones, until they reach
no more.  What they have reached then stays wet during the load step: points may close again behind them.  While
everything opens that they come to, they go on by twice as many facets each time; from what does not open they go back,
and on by one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.algorithms.strategy import solve_task
from signorini_fx.algorithms.task import Outcome, Start, Task
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.entering_fluid import EnteringFluid, Flags
from signorini_fx.contact.motions import RigidLoad
from signorini_fx.linalg.elasticity import LoadCase
from signorini_fx.records import Status

Array = npt.NDArray[np.float64]


def solve_with_fluid(d: Discretisation, task: Task, start: Start, most: int) -> tuple[Outcome, Array]:
    """Solve a load step; collective.

    Args:
        d: the discretised scene.
        task: its contact problem.
        start: where the load step starts.
        most: linear solves allowed for each distribution of the pressure.

    Returns:
        How it ended with the last pressure of the fluids, and that pressure at the contact points, stress, shape (n,).
    """
    assert d.boundary is not None
    fluid, number = EnteringFluid(d.scene, d.tagged, d.space, d.boundary, start.place), len(d.applied) - 1
    dry = np.zeros(d.boundary.size, dtype=bool)
    entrance, newton = fluid.grown(dry), task.iterate.newton
    wet = before = entrance if start.multipliers is None else fluid.grown(start.multipliers[0] <= 0)
    ahead, recedes, guessed = 1, True, not within(d.comm, wet, entrance)
    while True:
        pressure, begun = fluid.pressure(wet), newton.checkpoint()
        task.system.set_case(number, _case(d, pressure))
        outcome = solve_task(task, start, most)
        if outcome.status is not Status.CONVERGED:
            # Of what it has not reached, ahead of it or in the step before, a failure proves nothing.
            if not within(d.comm, wet, before):
                wet, ahead = before, 1
            elif guessed:
                wet, before, ahead, recedes, guessed = entrance, entrance, 1, False, False
            else:
                return outcome, pressure
            task.history.add(f"{outcome.status.value}: with the fluid where it may not be: it is put on fewer points")
            newton.restore(begun)
            continue
        multipliers = outcome.newton.multipliers()
        kept = [one & other for one, other in zip(wet, fluid.grown(multipliers[0] <= 0), strict=True)]
        found = fluid.grown(multipliers[0] <= 0, before)
        recedes = recedes and not within(d.comm, wet, kept)
        if recedes:
            wet = before = kept
        elif within(d.comm, wet, found):
            if within(d.comm, found, wet):
                return outcome, pressure
            before, ahead = found, 2 * ahead
            wet = fluid.beyond(found, ahead)
        else:
            wet, ahead = before, 1
        counts = np.array([np.count_nonzero(fluid.pressure(wet)), pressure.size])
        reached, points = parallel.global_sum(d.comm, counts)
        task.history.add(f"the fluid is put on {reached:.0f} of {points:.0f} contact points: solved again")
        start = start.begin_from(outcome.problem.sets, multipliers)


def within(comm: MPI.Comm, some: Sequence[Flags], others: Sequence[Flags]) -> bool:
    """Whether nodes are among others, of each fluid; collective."""
    return not parallel.any_rank(comm, any((one & ~other).any() for one, other in zip(some, others, strict=True)))


def _case(d: Discretisation, pressure: Array) -> LoadCase:
    """The load of pressures at the contact points, shape (n,): on both bodies where two touch each other."""
    motions, load, start = d.at_contact, d.stiffness.createVecRight(), d.stiffness.createVecRight()
    assert motions is not None
    push = motions.points.weight * pressure
    d.contact.add_forces(-pressure, np.zeros((pressure.size, d.dimension - 1)), load)
    size = [push[motions.of_point == number].sum() for number in motions.assembly]
    total = parallel.global_sum(d.comm, np.array([-push @ motions.normal, size]))
    return LoadCase(load, start, RigidLoad(total[0], total[1], motions.assembly))
