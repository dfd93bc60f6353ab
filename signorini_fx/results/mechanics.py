"""What the results of a body are made of: its contact sides, stresses and resultants, whoever has stated them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from dolfinx import fem

from signorini_fx.mechanics.body.contact_state import ContactState
from signorini_fx.mechanics.body.rigid_bodies import RigidBodyMotion
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.results.certificate.certificate import Certificate, certify
from signorini_fx.results.certificate.contact_nodes import ContactSide
from signorini_fx.results.certificate.contact_sides import sides_of
from signorini_fx.results.certificate.promised_law import Law, PreviousStep, Tractions
from signorini_fx.results.resultants import Resultants, StatedResultants
from signorini_fx.results.safety import Safety, safety_of
from signorini_fx.results.stresses import RawStresses, Stresses

if TYPE_CHECKING:
    from signorini_fx.mechanics.model import Model
    from signorini_fx.results.certificate.nodal_forces import NodalForces
    from signorini_fx.results.section_forces import SectionForce


NO_ESTIMATE = "nonlinear bodies have no estimate of their error: compare solutions on two meshes"


class Mechanics(Protocol):
    """What forces, stresses and contact sides of a body are.  The entries of a statement say it, or forms do."""

    @property
    def has_stress(self) -> bool:
        """Whether stresses are known."""
        ...

    @property
    def linear(self) -> bool:
        """Whether forces are linear in the displacement, so that there is a strain energy, and errors are estimated."""
        ...

    def sides(self, model: Model) -> list[ContactSide]:
        """The parts of the boundary with contact, for second opinions."""
        ...

    def stress(self, model: Model, y: fem.Function, step: float, shared: dict[str, StressRecovery]) -> RawStresses:
        """The stress of a displacement at a place in the lists of factors; collective.

        Args:
            model: the body.
            y: the displacement, length.
            step: the place, see ``statement.load_path``.
            shared: where what projects is kept for other displacements.

        Raises:
            RuntimeError: stresses are not known.
        """
        ...

    def resultants(self, model: Model, y: fem.Function, contact: ContactState | None, step: float) -> Resultants:
        """Forces and moments on the body through each boundary; ``contact``: of this rank."""
        ...

    def sections(self, model: Model, y: fem.Function, step: float) -> list[SectionForce]:
        """The forces through sections that are tightened; collective.  Forms name none."""
        return []

    def safety(self, model: Model, contact: ContactState, step: float) -> Safety | None:
        """By how much the live loads can grow before the body moves away, see ``Solution``; collective.  Forms do not
        say which loads are live.
        """
        return None

    def stated(self, model: Model) -> Model:
        """The body with loads, supports and moduli as entries of its statement, which proofs read.

        Raises:
            quantities.proved_statements.Refused: something of them cannot be stated.
        """
        ...


@dataclass(frozen=True)
class StatedMechanics:
    """What the entries of a statement say, see ``Mechanics``.

    Attributes:
        evaluation: what has evaluated another certificate on this space; None: there is none.
    """

    evaluation: NodalForces | None = None
    has_stress: bool = True
    linear: bool = True

    def certified(
        self,
        model: Model,
        displacement: fem.Function,
        tractions: Tractions | None,
        *,
        law: Law,
        step: float,
        last: PreviousStep | None,
        rigid: tuple[RigidBodyMotion, ...],
    ) -> Certificate:
        """See ``certify``."""
        on, like = (model.statement, model.tagged), self.evaluation
        return certify(
            *on, displacement, tractions, law=law, step=step, before=last, pairs=model.pairs, rigid=rigid, like=like
        )

    def sides(self, model: Model) -> list[ContactSide]:
        """See ``Mechanics``."""
        return sides_of(model.statement, model.tagged, model.space, model.pairs)

    def stress(self, model: Model, y: fem.Function, step: float, shared: dict[str, StressRecovery]) -> Stresses:
        """See ``Mechanics``."""
        return Stresses.of(model, y, step, shared)

    def resultants(self, model: Model, y: fem.Function, contact: ContactState | None, step: float) -> Resultants:
        """See ``Mechanics``."""
        return StatedResultants(model.statement, model.tagged, y, contact, step, model.pairs)

    def sections(self, model: Model, y: fem.Function, step: float) -> list[SectionForce]:
        """See ``Mechanics``."""
        from signorini_fx.results.section_forces import section_forces

        return section_forces(model.statement, model.tagged, y, step)

    def safety(self, model: Model, contact: ContactState, step: float) -> Safety | None:
        """See ``Mechanics``."""
        return safety_of(model, contact, step)

    def stated(self, model: Model) -> Model:
        """See ``Mechanics``: the body itself."""
        return model
