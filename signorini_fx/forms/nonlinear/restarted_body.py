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
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.forms.nonlinear.residual import Residual
from signorini_fx.forms.nonlinear.step_sizes import StepSizes
from signorini_fx.mechanics.body.elastic_body import ElasticBody
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.records import Timings
from signorini_fx.results.step_result import StepResult
from signorini_fx.solving.checkpointed_steps import MeshCheckpoint, Recalled

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
        """One factor: the residual already contains the loads of now."""
        return np.ones(1)

    def stored(self, path_step: float, result: StepResult) -> tuple[dict[str, Nodal], dict[str, Any]]:
        """See ``StoredBody``."""
        return {}, self.figures

    def recalled(self, task: Task, path_step: float, nodal: dict[str, Nodal], figures: dict[str, Any]) -> RestartedBody:
        """See ``StoredBody``."""
        return self

    def recall(self, checkpoint: MeshCheckpoint, residual: Residual) -> Recalled[RestartedBody] | None:
        """Give the body the displacement and the contact of its next load step; None: it is not there, or does not fit;
        collective.

        Args:
            checkpoint: of the run on its mesh; loads and shapes are as they are in the load step.
            residual: of the body.
        """
        linear = self.linear
        number, tools = linear.step, linear.moving_tools
        fields = checkpoint.beside(number, linear.space, (_SOLUTION, _TANGENT))
        if fields is None:
            checkpoint.forget(number)
            return None
        (solution, tangent), shape, ways = fields, tools.coordinates.shape, checkpoint.figure(number, "coordinates")
        coordinates = {name: np.array(values, dtype=np.float64).reshape(shape) for name, values in ways.items()}
        try:
            if residual.at(tangent.x.array.copy()) is None:
                return None
            tools.carry_to(coordinates[_TANGENT])
            kind = {name: bool(checkpoint.figure(number, name)) for name in ("definite", "symmetric")}
            linear.begin_at_tangent(**kind)
            recalled = checkpoint.recall(self, linear.task, linear.begun)
        except (FormError, MatrixError, PairingError):
            recalled = None
        if recalled is not None:
            linear.accept(recalled.outcome)
            tools.carry_to(coordinates[_SOLUTION])
            residual.u.x.array[:] = solution.x.array
        return recalled

    def store(
        self,
        checkpoint: MeshCheckpoint,
        step: StepResult,
        tangent: tuple[Nodal, Nodal],
        sizes: StepSizes,
        marks: tuple[int, int, int],
    ) -> None:
        """Store a load step that has a solution; collective.

        Args:
            checkpoint: of the run on its mesh.
            step: its result.
            tangent: where the last tangent was formed: values of the displacement, and coordinates of tools.
            sizes: the way through the load steps.
            marks: see ``MeshCheckpoint.store``.
        """
        linear = self.linear
        assert linear.outcome is not None
        ways = {_SOLUTION: linear.moving_tools.coordinates.tolist(), _TANGENT: tangent[1].tolist()}
        kind = {"definite": linear.definite, "symmetric": linear.symmetric}
        figures = self.figures | {"linear_solves": step.linear_solves, "coordinates": ways} | kind
        at, start = fem.Function(linear.space), replace(linear.begun, place=step.place)
        at.x.array[:] = tangent[0]
        beside, result = {_SOLUTION: step.displacement, _TANGENT: at}, replace(step, displacement=linear.u.copy())
        body = replace(self, figures=figures)
        checkpoint.store(body, linear.task, start, linear.outcome, result, sizes, marks, beside)
