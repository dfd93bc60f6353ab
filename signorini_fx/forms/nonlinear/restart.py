"""The load steps of a nonlinear body in a checkpoint.

Stored are the displacement of a load step, that at which its last tangent was formed, and the iterate of the contact
problem of that.  All else follows as load steps are gone through again: each is certified anew, and the state of
materials, slips and the ways of shapes are those of the displacements.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from dolfinx import fem

from signorini_fx.algebra.algorithms.task import Task
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import MatrixError
from signorini_fx.forms.nonlinear.leaps import Leaps
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.forms.nonlinear.residual import Residual
from signorini_fx.forms.nonlinear.step_sizes import PathSizes
from signorini_fx.mechanics.body.elastic import ElasticBody
from signorini_fx.mechanics.body.joint_pressure import JointPressure
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.records import Timings
from signorini_fx.results.solution import StepResult
from signorini_fx.solving.restart import MeshCheckpoint, Recalled

_SOLUTION, _TANGENT = "solution", "tangent"


@dataclass(frozen=True)
class RestartedBody:
    """A nonlinear body as a checkpoint sees it, see ``StoredBody``.

    Attributes:
        linear: the contact problem of its last tangent.
        timings: of the run.
        figures: of the load step, plain data.
    """

    linear: LinearisedProblem
    timings: Timings
    figures: dict[str, Any] = field(default_factory=dict)

    @property
    def model(self) -> ElasticBody:
        """That of the last tangent."""
        return self.linear.elastic

    @property
    def size(self) -> float:
        """Of the body, length."""
        return self.linear.scales.size

    def load(self, system: ElasticSystem, path_step: float) -> Nodal:
        """It has its load."""
        return np.ones(1)

    def stored(self, path_step: float, result: StepResult) -> tuple[dict[str, Nodal], dict[str, Any]]:
        """See ``StoredBody``."""
        return {}, self.figures

    def recalled(
        self, task: Task, path_step: float, nodal: dict[str, Nodal], figures: dict[str, Any]
    ) -> tuple[RestartedBody, JointPressure | None]:
        """See ``StoredBody``."""
        return self, None


@dataclass
class StepsOnDisk:
    """The checkpoint of a path of load steps; all methods are collective.

    Attributes:
        checkpoint: of the run on its mesh.
        sizes: the way through the load steps.
        marks: numbers of linear solves, regularised problems and events before the next load step.
    """

    checkpoint: MeshCheckpoint
    sizes: PathSizes
    marks: tuple[int, int, int] = (0, 0, 0)

    def begin(self, linear: LinearisedProblem) -> None:
        """What is recorded from here belongs to the next load step."""
        history = linear.history
        self.marks = history.linear_solves, len(history.outer), len(history.events)

    def end(self, number: int) -> float | None:
        """Where a load step ends, by how many were before it; None: it is not there."""
        return self.checkpoint.place(number) if self.checkpoint.checkpoint.found else None

    def forget(self, number: int) -> None:
        """Remove a load step, and all later ones: it is solved again."""
        self.checkpoint.forget(number)

    def figure(self, number: int, name: str) -> int:
        """One of a load step that is there: ``newton``, its iterations, or ``linear_solves``."""
        return int(self.checkpoint.figure(number, name))

    def leaps(self, number: int, leaps: Leaps) -> None:
        """Give ``leaps`` what was known of jumps after a load step that is there."""
        leaps.resume(self.checkpoint.figure(number, "leaps"))

    def recall(self, linear: LinearisedProblem, residual: Residual, timings: Timings) -> Recalled[RestartedBody] | None:
        """Give a body the displacement and the contact of its next load step; None: it is not there, or does not fit.

        Args:
            linear: its contact problem, with loads and shapes as they are in the load step.
            residual: of the body.
            timings: of the run.
        """
        number = linear.step
        fields = self.checkpoint.beside(number, linear.space, (_SOLUTION, _TANGENT))
        if fields is None:
            self.forget(number)
            return None
        solution, tangent = fields
        try:
            if residual.at(tangent.x.array.copy()) is None:
                return None
            linear.moving_tools.carry_to(self._coordinates(number, _TANGENT, linear))
            linear.begin_at_tangent(definite=bool(self.checkpoint.figure(number, "definite")))
            recalled = self.checkpoint.recall(RestartedBody(linear, timings), linear.task, linear.begun)
        except (FormError, MatrixError, PairingError):
            recalled = None
        if recalled is not None:
            linear.accept(recalled.outcome)
            linear.moving_tools.carry_to(self._coordinates(number, _SOLUTION, linear))
            residual.u.x.array[:] = solution.x.array
        return recalled

    def _coordinates(self, number: int, name: str, linear: LinearisedProblem) -> Nodal:
        """Those of tools in a load step that is there, lengths, shape (t, m), see ``MovingTools``."""
        stored = np.array(self.checkpoint.figure(number, "coordinates")[name], dtype=np.float64)
        return stored.reshape(linear.moving_tools.coordinates.shape)

    def store(
        self,
        linear: LinearisedProblem,
        step: StepResult,
        tangent: tuple[Nodal, Nodal],
        iterations: int,
        timings: Timings,
        leaps: Leaps,
    ) -> None:
        """Store a load step that has a solution.

        Args:
            linear: its last contact problem.
            step: its result.
            tangent: where the last tangent was formed: values of the displacement, and coordinates of tools.
            iterations: of Newton's method.
            timings: of the run.
            leaps: jumps so far.
        """
        assert linear.outcome is not None
        space, start = linear.space, replace(linear.begun, place=step.place)
        ways = {_SOLUTION: linear.moving_tools.coordinates.tolist(), _TANGENT: tangent[1].tolist()}
        figures: dict[str, Any] = {"newton": iterations, "linear_solves": step.linear_solves}
        figures |= {"definite": linear.definite, "coordinates": ways, "leaps": leaps.stored()}
        body, at, iterate = RestartedBody(linear, timings, figures), fem.Function(space), linear.u.copy()
        at.x.array[:] = tangent[0]
        beside = {_SOLUTION: step.displacement, _TANGENT: at}
        result = replace(step, displacement=iterate)
        self.checkpoint.store(body, linear.task, start, linear.outcome, result, self.sizes, self.marks, beside)
