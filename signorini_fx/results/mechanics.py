"""What results are made of: contact conditions, stresses and forces of a model."""

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
from signorini_fx.results.certificate.contact_nodes import ContactConditions
from signorini_fx.results.certificate.equilibrium import Balance
from signorini_fx.results.certificate.law_of_method import (
    Law,
    PreviousStep,
    Tractions,
    overclosures_of,
)

if TYPE_CHECKING:
    from signorini_fx.algebra.linalg import ElasticSystem
    from signorini_fx.results.accuracy.stress_recovery import StressRecovery
    from signorini_fx.results.certificate.nodal_forces import NodalForces
    from signorini_fx.results.certificate.pair_points import PairPoints
    from signorini_fx.results.resultants import ActingForces, NamedForces
    from signorini_fx.results.stresses import RawStresses


@dataclass(frozen=True)
class Mechanics(ABC):
    """What says the forces and stresses of a model, and what holds at its contact points: entries
    by name, forms, or a residual.
    """

    no_bounds: ClassVar[str] = ""  # why there are no guaranteed bounds; "": there may be

    model: Model
    statement: Statement  # names; of forms of a user's own less than all that acts

    def conditions(self, y: fem.Function) -> ContactConditions | None:
        """Return the contact points at a displacement, and what holds there; None if there is no
        contact; collective.
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
        """Return the shapes of hard foundations at a place in the lists of factors; None: the
        present.
        """
        return ()

    @abstractmethod
    def stress(self, y: fem.Function, step: float) -> RawStresses | str:
        """Return the stress of a displacement at a place in the lists of factors, or why it is not
        known; collective.
        """

    @cached_property
    def recovery(self) -> StressRecovery:
        """What projects the stress of any displacement; collective."""
        raise RuntimeError("a nonlinear body has no recovered stress")

    def loads_at(self, step: float) -> Loads:
        """Return all loads at a place, times their factors; collective."""
        raise RuntimeError("the loads of a nonlinear body are in its residual")

    def load(self, system: ElasticSystem, step: float) -> Array:
        """Give a system the loads that depend on the time as they are at a place, and return the
        factors of all loads, for ``system.set_load``; collective.
        """
        raise RuntimeError("the loads of a nonlinear body are in its residual")

    @abstractmethod
    def balance(self, y: fem.Function, step: float) -> Balance:
        """Return the forces on the body without contact at a displacement and a place in the lists
        of factors; collective.
        """

    @abstractmethod
    def acting(self, y: fem.Function, step: float) -> ActingForces:
        """Return the forces at a displacement with the names of what acts; collective."""

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
        """Return the certificate of a result at a place; collective.

        ``last``: the end of the last load step.
        ``more``: give what effects in time add to the balance at a displacement; for the other
            arguments see ``results.certificate.certificate.judged``.
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
        """Return what drives rigid bodies at a place."""
        return self.model.rigid.drives()


@dataclass(frozen=True)
class StatedMechanics(Mechanics):
    """The mechanics of a model that the entries of its statement say all of."""

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
    """Return what acts on the body of a statement, ``followers`` among it, with the names of the
    statement; collective.
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
        place: its place in the lists of factors, see ``statement.load_path``: 0 for the first
            factor.
        time: its time.
        name: its name; "": it has none.
        status: how it ended.
        displacement: y at its end, length.
        contact: nodal state of the contact boundary of this rank, None for a scene without contact.
        certificate: the check of the conditions of the step.
        deformation: how much the body is deformed.
        strain_energy: a(y, y) / 2, an energy per thickness; None of a nonlinear body.
        linear_solves: linear solves of the step.
        rigid_bodies: how rigid bodies have moved.
        figures: what effects in time tell of it, by names.
        told: what they say of it.
        between: the times and figures of shorter steps since the load step before.
        reason: why there is no solution; None: it is not known, or told by ``check``.
        acting: gives what acts on the body beside contact, where that is not what is stated at its
            displacement: forces of inertia; None: it is; collective.
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
