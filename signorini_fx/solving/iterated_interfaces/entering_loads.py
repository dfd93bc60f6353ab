"""A load step with loads that enter contact as it opens: their pressure follows the open points until both agree.

The loads begin where the last load step has left them.  The contact problem with their pressure is solved, and they go
on from all points that they have reached through points that are open in its solution, by one facet beyond them, until
they reach no more.  Never is a point loaded that an equilibrium with less of the load has not led to, and none is left
again: the region is the smallest one, and depends on nothing that the iteration does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.algebra.algorithms.task import Task
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.linalg.elasticity import LoadCase
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.joint_pressure import Flags, JointPressure, Stage, work_on_motions
from signorini_fx.mechanics.loads.joint_loads import JointLoads
from signorini_fx.mechanics.loads.load_vectors import AppliedLoad
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.records import Status
from signorini_fx.results.mechanics import SolidBody
from signorini_fx.solving.iterated_interfaces.protocol import Interface, LoadStepEnd, LoadStepStart

Array = npt.NDArray[np.float64]


class EnteringLoads(Interface):
    """Those of a scene, see ``Interface``."""

    # Each stage is an equilibrium with all else that is sought.
    outer: ClassVar[bool] = True

    def loads(self, tagged: TaggedMesh, space: fem.FunctionSpace, boundary: ContactBoundary) -> list[AppliedLoad]:
        """See ``Interface``; raises a ``SceneError`` where a load does not meet a contact that it enters."""
        JointLoads(self.statement, tagged, space, boundary, 0)
        owned = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
        ones, nothing = (1.0,) * self.statement.steps, np.zeros(owned)  # which ``_press`` replaces
        return [AppliedLoad(ones, (), (), nothing, fem.Function(space), grows=False, entry=self._first)]

    @property
    def _first(self) -> Any:
        """The entry that stands for all of them."""
        return next(iter(self.entries.values()))

    def solve(self, step: LoadStepStart) -> LoadStepEnd:
        """See ``Interface``."""
        model, task, start = step.model, step.task, step.start
        assert model.boundary is not None
        loads, newton = (
            JointLoads(model.statement, model.tagged, model.space, model.boundary, start.place),
            task.iterate.newton,
        )
        reached = loads.beginning(None if step.earlier is None else step.earlier.reached)
        cold, begun = start, newton.checkpoint()
        stage: Stage | None = None
        pressure = solved = loads.pressure(reached)
        end: LoadStepEnd | None = None
        while True:
            if end is None or parallel.any_rank(model.comm, not np.array_equal(pressure, solved)):
                self._press(model, task, pressure)
                end, solved = step.solved(model, start), pressure
                if start is not cold and task.gave_up(end.outcome.status):
                    task.history.add(
                        f"{end.outcome.status.value}: from where the loads were in contact before: begun again"
                    )
                    newton.restore(begun)
                    end = step.solved(model, cold)
                model, cold, outcome = end.model, replace(cold, factors=end.start.factors), end.outcome
            points = loads.at_points(reached)
            if outcome.status is not Status.CONVERGED:
                return LoadStepEnd(model, cold, outcome, JointPressure(pressure, points, stage), end.reason)
            multipliers = outcome.newton.multipliers()
            open_: Flags = np.asarray(multipliers[0] <= 0)
            grown = loads.grown(open_, reached)
            joint_pressure = JointPressure(pressure, points, stage, settled=not _differ(model, grown, reached))
            if joint_pressure.settled or not step.holds(model, outcome, joint_pressure):
                return LoadStepEnd(model, cold, outcome, joint_pressure)
            stage, reached = Stage(points, open_), grown
            pressure = loads.pressure(reached)
            counts = np.array([np.count_nonzero(loads.at_points(reached).any(axis=1)), pressure.size])
            reached_count, point_count = parallel.global_sum(model.comm, counts)
            task.history.add(
                f"loads have entered contact at {reached_count:.0f} of {point_count:.0f} points: solved again"
            )
            start = cold.begin_from(outcome.problem.sets, multipliers)

    def stored(
        self, model: SolidBody, step: float, contact: ContactState | None
    ) -> tuple[dict[str, Nodal], dict[str, Any]]:
        """See ``Interface``: the contact points that loads have reached, as numbers."""
        assert contact is not None
        assert contact.joint is not None
        return {"reached": contact.joint.reached.astype(np.float64)}, {}

    def recalled(
        self, model: SolidBody, task: Task, step: float, nodal: Mapping[str, Nodal], figures: Mapping[str, Any]
    ) -> tuple[SolidBody, JointPressure | None]:
        """See ``Interface``."""
        assert model.boundary is not None
        loads = JointLoads(model.statement, model.tagged, model.space, model.boundary, step)
        nodes = loads.beginning(nodal["reached"] > 0.5)
        pressure = loads.pressure(nodes)
        self._press(model, task, pressure)
        return model, JointPressure(pressure, loads.at_points(nodes), recalled=True)

    def _press(self, model: SolidBody, task: Task, pressure: Array) -> None:
        """Put pressures at the contact points, shape (n,), on the body: on both bodies where two touch each other."""
        load, start = model.stiffness.createVecRight(), model.stiffness.createVecRight()
        model.contact.add_forces(-pressure, np.zeros((pressure.size, model.dimension - 1)), load)
        case = LoadCase(load, start, work_on_motions(model.at_contact, pressure))
        number = next(k for k, applied in enumerate(model.applied) if applied.entry is self._first)
        task.system.set_case(number, case)


Kind = EnteringLoads


def _differ(model: SolidBody, grown: list[Flags], reached: list[Flags]) -> bool:
    """Whether nodes that loads have reached are not the same; collective."""
    return parallel.any_rank(
        model.comm, any((new_flags != old_flags).any() for new_flags, old_flags in zip(grown, reached, strict=True))
    )
