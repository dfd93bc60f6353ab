"""The result of a load step."""

from __future__ import annotations

from dataclasses import dataclass

from dolfinx import fem

from signorini_fx.mechanics.body.deformation import Deformation
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodyMotion
from signorini_fx.records import Finding, Status, StepRecord
from signorini_fx.results.certificate.certificate import Certificate


@dataclass(frozen=True, repr=False)
class StepResult:
    """The result of a load step.

    Attributes:
        step: its number, from 1.
        place: its place in the lists of factors, see ``statement.load_path``: 0 for the first factor.
        time: its time.
        name: its name; "": it has none.
        status: how it ended.
        displacement: y, length.
        contact: nodal state of the contact boundary of this rank, None for a scene without contact.
        certificate: the check of the conditions of the step.
        deformation: how much the body is deformed.
        strain_energy: a(y, y) / 2, an energy per thickness; None of a nonlinear body.
        linear_solves: linear solves of the step.
        tools: how rigid bodies have moved.
        reason: why there is no solution; None: it is not known, or told by ``check``.
    """

    step: int
    place: float
    time: float
    name: str
    status: Status
    displacement: fem.Function
    contact: ContactState | None
    certificate: Certificate
    deformation: Deformation
    strain_energy: float | None
    linear_solves: int
    tools: tuple[RigidBodyMotion, ...] = ()
    reason: Finding | None = None

    def __repr__(self) -> str:
        return f"<StepResult {self.step}: {self.status.value}, {self.linear_solves} linear solves>"

    def __str__(self) -> str:
        return str(StepRecord(self.step, self.name, self.time))
