"""The mechanics from which results are evaluated: contact conditions, stresses and forces of a
model.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

from dolfinx import fem

from signorini_fx.arrays import Array
from signorini_fx.mechanics.body.deformation import Deformation
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.interfaces import PlacedShape
from signorini_fx.mechanics.model import Loads, Model
from signorini_fx.mechanics.rigid.rigid_bodies import Drive, RigidBodyMotion
from signorini_fx.mechanics.statement.effect import ForceDensity, Resistance
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.mechanics.step_effect import AddedForces
from signorini_fx.records import Finding, Status, StepRecord
from signorini_fx.results.certificate.certificate import Certificate, balance_of, judged
from signorini_fx.results.certificate.contact_nodes import (
    ContactConditions,
    Law,
    PreviousStep,
    Tractions,
    overclosures_of,
)
from signorini_fx.results.certificate.equilibrium import Balance

if TYPE_CHECKING:
    from signorini_fx.algebra.linalg import ElasticSystem
    from signorini_fx.results.accuracy.stress_recovery import StressRecovery
    from signorini_fx.results.certificate.nodal_forces import NodalForces
    from signorini_fx.results.certificate.pair_points import PairPoints
    from signorini_fx.results.resultants import ActingForces, NamedForces
    from signorini_fx.results.stresses import RawStresses


@dataclass(frozen=True)
class Mechanics(ABC):
    """Forces and stresses of a model, and the conditions at its contact points.

    Subclasses take them from named entries of a scene, from forms, or from a residual.  A ``step``
    is the position in the lists of load factors.
    """

    no_bounds: ClassVar[str] = ""  # why there are no guaranteed bounds; "" if there may be

    model: Model
    statement: Statement  # named entries; with forms, not everything that acts

    def conditions(self, y: fem.Function) -> ContactConditions | None:
        """Return the contact points at a displacement and their conditions, or None without
        contact.  Collective.
        """
        if self.model.boundary is None:
            return None
        assert self.model.data is not None
        points = (self.model.boundary, self.model.data.gap)
        pairs: dict[int, PairPoints] = {}
        if self.model.pairs:
            from signorini_fx.results.certificate.pair_points import PairPoints

            pairs = {number: PairPoints.of(pair) for number, pair in self.model.pairs.items()}
        if self.model.boundary.corners is not None:
            from signorini_fx.results.certificate.corner_feet import judged_corners

            points = judged_corners(*points, self.shapes())
        data = self.model.data
        return ContactConditions(*points, self.model.law, data.bilateral, pairs, data.bond)

    def shapes(self, step: float | None = None) -> Sequence[PlacedShape]:
        """Return the shapes of hard foundations at a step; None for the present ones."""
        return ()

    @abstractmethod
    def stress(self, y: fem.Function, step: float) -> RawStresses | str:
        """Return the stress of a displacement at a step, or the reason why it is not known.
        Collective.
        """

    @cached_property
    def recovery(self) -> StressRecovery:
        """The stress recovery, which projects the stress of any displacement.  Collective."""
        raise RuntimeError("a nonlinear body has no recovered stress")

    def loads_at(self, step: float) -> Loads:
        """Return all loads at a step, times their factors.  Collective."""
        raise RuntimeError("the loads of a nonlinear body are in its residual")

    def load(self, system: ElasticSystem, step: float) -> Array:
        """Update the loads of a system that depend on time to a step, and return the factors of all
        loads for ``system.set_load``.  Collective.
        """
        raise RuntimeError("the loads of a nonlinear body are in its residual")

    @abstractmethod
    def balance(self, y: fem.Function, step: float) -> Balance:
        """Return the forces on the body without contact at a displacement and a step.
        Collective.
        """

    @abstractmethod
    def acting(self, y: fem.Function, step: float) -> ActingForces:
        """Return the forces on the body at a displacement and a step, each with its name.
        Collective.
        """

    def certified(
        self,
        displacement: fem.Function,
        tractions: Tractions | None,
        *,
        law: Law,
        step: float,
        last: PreviousStep | None,
        rigid: tuple[RigidBodyMotion, ...],
        more: Sequence[Callable[[Array], AddedForces | None]] = (),
    ) -> Certificate:
        """Return the certificate of a result at a step.  Collective.

        For arguments that are not listed see ``results.certificate.certificate.judged``.  ``last``
        is the end of the last load step; ``more`` are functions of the displacement that return
        what effects in time add to the balance.
        """
        balance = self.balance(displacement, step)
        driving: Sequence[Drive] = self.drives(step)
        for add in more:
            if (added := add(displacement.x.array)) is not None:
                balance = balance.with_added(added)
                driving = added.drives or driving
        drives = [*zip(rigid, driving, strict=bool(rigid))]
        law = replace(law, overclosures=overclosures_of(self.model.contacts))
        contact = self.conditions(displacement)
        return judged(displacement, balance, contact, tractions, law=law, before=last, rigid=drives)

    def drives(self, step: float) -> list[Drive]:
        """Return the forces, moments or motions that drive rigid bodies at a step."""
        return self.model.rigid.drives()


@dataclass(frozen=True)
class StatedMechanics(Mechanics):
    """The mechanics of a model that the entries of its statement describe completely."""

    def drives(self, step: float) -> list[Drive]:
        return self.statement.drives(self.model.tagged.dimension, step)

    def shapes(self, step: float | None = None) -> Sequence[PlacedShape]:
        from signorini_fx.mechanics.obstacles.scene_contact import hard_foundations

        model = self.model
        now = model.contacts if step is None else self.statement.contacts_at(step)
        return hard_foundations(now, model.kinematics)

    def loads_at(self, step: float) -> Loads:
        return replace(self.model.loads_at(step), drives=self.drives(step))

    def load(self, system: ElasticSystem, step: float) -> Array:
        for number, load in enumerate(self.model.applied):
            if load.again is not None:
                system.set_case(number, self.model.case_of(load.at(step)))
        return self.model.factors(step)

    def stress(self, y: fem.Function, step: float) -> RawStresses:
        from signorini_fx.results.accuracy.stress_recovery import element_stress
        from signorini_fx.results.stresses import RawStresses

        return RawStresses(element_stress(self.model, y, step), self, step)

    @cached_property
    def recovery(self) -> StressRecovery:
        from signorini_fx.results.accuracy.stress_recovery import StressRecovery

        return StressRecovery.of(self.model)

    def balance(self, y: fem.Function, step: float) -> Balance:
        from signorini_fx.results.certificate.nodal_forces import NodalForces

        return balance_of(NodalForces.on(self.model), y, step)

    def acting(self, y: fem.Function, step: float) -> ActingForces:
        from signorini_fx.results.certificate.nodal_forces import NodalForces

        return acting_on(NodalForces.on(self.model), self.balance(y, step), y, step)


def acting_on(
    forces: NodalForces,
    balance: Balance,
    y: fem.Function,
    step: float,
    followers: Sequence[NamedForces] = (),
    *,
    displaced: bool = False,
) -> ActingForces:
    """Return the forces on the body of a statement, each with its name in the statement.
    Collective.

    Args:
        forces: the nodal forces of the statement.
        balance: the forces on the body without contact.
        y: displacement.
        step: position in the lists of load factors.
        followers: named forces that follow the body, to be included.
        displaced: whether forces act at the displaced points.
    """
    from signorini_fx.results.resultants import ActingForces

    statement = forces.statement
    loads = [*followers]
    entries = [effect for _, effect in statement.listed()]
    for effect in entries:
        if isinstance(effect, ForceDensity):
            loads.append((effect.where, effect.label, forces.external(step, some=[effect])))
        if isinstance(effect, Resistance):
            loads.append((effect.where, effect.label, -forces.resisted(y, [effect])))
    supports = [entry.place if entry.holds_at(step) else None for entry in statement.displacement]
    names = [effect.where for effect in entries] + [where for where, *_ in followers]
    return ActingForces(balance, supports, loads, names, displaced)


@dataclass(frozen=True, repr=False)
class StepResult:
    """The result of a load step.

    Attributes:
        step: its number, from 1.
        place: its position in the lists of factors, see ``statement.load_path``: 0 for the first
            factor.
        time: its time.
        name: its name; "" without one.
        status: how it ended.
        displacement: y at its end, length.
        contact: nodal state of the contact boundary of this rank, None for a scene without contact.
        certificate: the check of the conditions of the step.
        deformation: how much the body is deformed.
        strain_energy: a(y, y) / 2, an energy per thickness; None of a nonlinear body.
        linear_solves: number of linear solves of the step.
        rigid_bodies: the motions of rigid bodies.
        figures: figures that effects in time compute, by name.
        told: findings of these effects.
        between: times and figures of shorter steps since the previous load step.
        reason: why there is no solution; None if it is not known, or reported by ``check``.
        acting: returns the forces on the body other than contact, where they are not those of the
            statement at this displacement, such as forces of inertia; None where they are;
            collective.
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
    rigid_bodies: tuple[RigidBodyMotion, ...] = ()
    figures: Mapping[str, float] = field(default_factory=dict)
    told: tuple[Finding, ...] = ()
    between: tuple[tuple[float, Mapping[str, float]], ...] = ()
    reason: Finding | None = None
    acting: Callable[[], ActingForces] | None = None

    def __repr__(self) -> str:
        return f"<StepResult {self.step}: {self.status.value}, {self.linear_solves} linear solves>"

    def __str__(self) -> str:
        return str(StepRecord(self.step, self.name, self.time))
