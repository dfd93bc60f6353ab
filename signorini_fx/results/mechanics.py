"""What the results of a body are made of: its contact sides, stresses and resultants, whoever has stated them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from dolfinx import fem

from signorini_fx.mechanics.body.rigid_bodies import RigidBodyMotion
from signorini_fx.mechanics.statement.effect import Force, Resistance
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.results.certificate.certificate import Certificate, certify, evaluated_balance, judged
from signorini_fx.results.certificate.contact_nodes import ContactSide
from signorini_fx.results.certificate.contact_sides import sides_of
from signorini_fx.results.certificate.equilibrium import Balance
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.results.certificate.promised_law import Law, PreviousStep, Tractions
from signorini_fx.results.resultants import ActingForces, NamedForces
from signorini_fx.results.stresses import RawStresses, Stresses

if TYPE_CHECKING:
    from signorini_fx.mechanics.model import Model


NO_ESTIMATE = "nonlinear bodies have no estimate of their error: compare solutions on two meshes"


class Mechanics(Protocol):
    """What forces, stresses and contact sides of a body are.  The entries of a statement say it, or forms do."""

    def sides(self, model: Model, y: fem.Function) -> list[ContactSide]:
        """The parts of the boundary with contact at a displacement, for second opinions."""
        ...

    def stress(
        self, model: Model, y: fem.Function, step: float, shared: dict[str, StressRecovery]
    ) -> RawStresses | str:
        """The stress of a displacement at a place in the lists of factors, or why it is not known; collective.

        Args:
            model: the body.
            y: the displacement, length.
            step: the place, see ``statement.load_path``.
            shared: where what projects is kept for other displacements.
        """
        ...

    def balance(self, model: Model, y: fem.Function, step: float) -> Balance:
        """The forces on the body without contact at a displacement and a place in the lists of factors; collective."""
        ...

    def acting(self, model: Model, y: fem.Function, step: float) -> ActingForces:
        """The same with the names of what acts; collective."""
        ...

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
        """The certificate of a result at a place; ``last``: the end of the last load step; for the other arguments see
        ``results.certificate.certificate.certify``; collective.
        """
        balance, sides = self.balance(model, displacement, step), self.sides(model, displacement)
        drives = [*zip(rigid, model.rigid.drives(), strict=True)]
        return judged(displacement, balance, sides, tractions, law=law, before=last, rigid=drives)

    def stated(self, model: Model) -> Model:
        """The body with loads, supports and moduli as entries of its statement, which proofs read.

        Raises:
            quantities.proved_statements.Refused: something of them cannot be stated.
        """
        ...


@dataclass(frozen=True)
class StatedMechanics:
    """What the entries of a statement say, see ``Mechanics``."""

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
        on, like = (model.statement, model.tagged), NodalForces.on(model)
        return certify(
            *on, displacement, tractions, law=law, step=step, before=last, pairs=model.pairs, rigid=rigid, like=like
        )

    def sides(self, model: Model, y: fem.Function) -> list[ContactSide]:
        """See ``Mechanics``."""
        return sides_of(model.statement, model.tagged, model.space, model.pairs)

    def stress(self, model: Model, y: fem.Function, step: float, shared: dict[str, StressRecovery]) -> Stresses:
        """See ``Mechanics``."""

        def energy() -> float:
            balance = self.balance(model, y, step)
            nodal_displacements = y.x.array.reshape(-1, balance.surface.dimension)
            return balance.strain_energy(balance.works(nodal_displacements[: balance.surface.owned]))

        return Stresses.of(model, y, step, shared, energy)

    def balance(self, model: Model, y: fem.Function, step: float) -> Balance:
        """See ``Mechanics``."""
        return evaluated_balance(NodalForces.on(model), y, step)

    def acting(self, model: Model, y: fem.Function, step: float) -> ActingForces:
        """See ``Mechanics``."""
        supports = [entry.place if entry.holds_at(step) else None for entry in model.statement.displacement]
        names = [effect.where for _, effect in model.statement.listed()]
        return ActingForces(self.balance(model, y, step), supports, loads_of(NodalForces.on(model), y, step), names)

    def stated(self, model: Model) -> Model:
        """See ``Mechanics``: the body itself."""
        return model


def loads_of(forces: NodalForces, y: fem.Function, step: float) -> list[NamedForces]:
    """The loads of a statement and what resists a displacement, those of one kind and place together, see
    ``ActingForces``; collective.
    """
    displacements, loads = y.x.array.reshape(-1, forces.dimension), []
    for kind in forces.statement.effects.values():
        for where in dict.fromkeys(effect.where for effect in kind):
            effects = [effect for effect in kind if effect.where == where]
            pushing = [effect for effect in effects if isinstance(effect, Force)]
            resisting = [effect for effect in effects if isinstance(effect, Resistance)]
            if pushing or resisting:
                values = forces.external(step, some=pushing) - forces.resisted(displacements, resisting)
                loads.append((where, effects[0].label, values))
    return loads
