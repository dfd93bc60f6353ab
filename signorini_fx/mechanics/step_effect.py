"""What else happens to a body from load step to load step, such as wear or inertia: a base class.

Other packages have more by entry points:

    [project.entry-points."signorini_fx.step_effects"]
    wear = "its.module:Wear"

An entry of a scene, or a part of a contact, whose class names one of them acts by it in the load
steps of that scene.  What an effect remembers is in fields of the state, which are carried along
and stored with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import ufl

from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.linalg import LoadCase
from signorini_fx.arrays import Array, Expr
from signorini_fx.extensions import STEP_EFFECTS, load_class
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Loads, Model
from signorini_fx.mechanics.rigid.rigid_bodies import Drive, RigidBodies
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.effect import ContactPart, Effect
from signorini_fx.mechanics.statement.rigid_body import RigidBody
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import Finding, Status

if TYPE_CHECKING:
    from dolfinx import fem


@dataclass(frozen=True)
class StepContact:
    """What holds at the n contact points of this rank in a load step.

    Attributes:
        model: the body with these points.
        boundary: the points.
        gap: distances from the obstacles at the end of the step, length, shape (n,).
        data: what the contact problem is solved with; its gap is another one where that is solved
            for another displacement than that of the end.
        law: of friction; None: there is none.
        drift: by how much obstacles have moved since the state, length, shape (n, d); None: they
            have not.
        reference: a displacement from which the contact problem counts, ghosts included, length,
            shape (dofs,); None: that of the body.
        part: of the duration of the step, after which the body is where the contact problem is
            solved for.
        softness: by how much the gap grows with the pressure, length per stress, shape (n,); None:
            it does not.
        linear: whether the body is; else the problem is solved for the displacement of the end.
    """

    model: Model
    boundary: ContactBoundary
    gap: Array
    data: RegularisedData
    law: PointFriction | None
    drift: Array | None
    reference: Array | None = None
    part: float = 1.0
    softness: Array | None = None
    linear: bool = True

    def with_gap(self, added: Array) -> StepContact:
        """Return the same with lengths added to the gap, shape (n,)."""
        data = replace(self.data, gap=self.data.gap + added)
        return replace(self, gap=self.gap + added, data=data)


@dataclass(frozen=True)
class AddedForces:
    """What a certificate has to add to the forces on a body, at its owned nodes.

    Attributes:
        resisting: forces beside those of the strains, shape (owned nodes, d).
        loads: forces beside the loads of the end of the step, of the same shape.
        prescribed: what supports prescribe in place of the displacement of the end, length, of the
            same shape.
        lost: round-off of ``resisting``, of the same shape.
        energy: another energy that stresses may come from, such as the kinetic one, shape (owned
            nodes,).
        drives: what drives rigid bodies, in place of that of the end of the step; empty: that.
        named: what of these forces results show, each with the name of a boundary, None: the body,
            what acts there, and the forces, shape (owned nodes, d).
    """

    resisting: Array
    loads: Array
    prescribed: Array
    lost: Array
    energy: Array
    drives: Sequence[Drive] = ()
    named: Sequence[tuple[str | None, str, Array]] = ()


@dataclass(frozen=True)
class StepEnd:
    """How a load step has ended.

    Attributes:
        model: the body in the step.
        contact: pressure, shear and slip at its contact points on this rank; None: it has none.
        gap: distances from the obstacles at its end, length, shape (n,).
        solved: the displacement that the contact problem was solved for, ghosts included, length,
            shape (dofs,).
        loads: those of its end.
        reactions: gives the forces of supports on the owned nodes, shape (owned nodes, d);
            collective.
        elastic: the part of the slip before the step that is due to the regularisation, length,
            shape (n, d).
        augmented: whether contact keeps to the law without regularisation.
        dt: its duration.
        place: its end, see ``statement.load_path``.
        internal: gives the forces of a nonlinear body at a displacement, as they are without
            effects, shapes (dofs,) and (owned dofs,), collective; None: it is linear.
    """

    model: Model
    contact: ContactState | None
    gap: Array
    solved: Array
    loads: Loads
    reactions: Callable[[], Array]
    elastic: Array
    augmented: bool
    dt: float
    place: float
    internal: Callable[[Array], Array] | None


@dataclass(frozen=True)
class SteppedForms:
    """What a step of a nonlinear body is solved with in place of its residual.

    Attributes:
        residual: UFL.
        tangent: its derivative, UFL; None: UFL finds it.
        begin: takes these to a step from a state, of a duration, and returns what acts beside the
            loads of its end, forces on the owned dofs.
    """

    residual: ufl.Form
    tangent: ufl.Form | None
    begin: Callable[[State, float, Array | float], Array | float]


class StepEffect:
    """An effect that does nothing: a class of a user's own overrides what it does.  All methods but
    ``next_time`` are collective.

    Examples:
        >>> class Pressed(sfx.StepEffect):
        ...     def after(self, state, new, ended):
        ...         return self.added(new, "impulse", "points", ended.contact.pressure)
        >>> pressed = sfx.solve(scene, effects=[Pressed()])
        >>> print(np.round(pressed.state.fields["impulse"].values.mean(), 6))
        2.0
    """

    # Whether bodies may move far without being deformed.
    moves_bodies: ClassVar[bool] = False
    # The power of their duration with which the error of all steps decreases.
    order: ClassVar[float] = 1

    @classmethod
    def of(cls, entry: Any) -> Self:
        """Return the effect that an entry of a scene states, an ``Effect``, of several the first
        one, or that parts of contacts do, ``ContactPart`` tables by the numbers of their contacts.
        """
        return cls()

    def initial(self, model: Model | None, state: State) -> State:
        """Return the state before the first step with what the effect remembers.

        ``model``: None: of forms, which state nothing of it.
        """
        return state

    def body(self, model: Model, state: State, dt: float) -> Model:
        """Return the body with other terms, which depend on the duration of the step and the names
        of the fields of the state alone, or itself.
        """
        return model

    def stepped(
        self, F: ufl.Form, J: ufl.Form | None, u: fem.Function, density: Expr | ufl.Form
    ) -> SteppedForms | None:
        """Return what steps of a nonlinear body are solved with in place of a residual at the
        displacement ``u`` and its tangent, UFL, None: UFL finds it; None: these.

        ``density``: mass per volume or the form of the mass.
        """
        return None

    def driven(self, rigid: RigidBodies, state: State, dt: float) -> Sequence[RigidBody]:
        """Return rigid bodies with what drives them in a step of a nonlinear body."""
        return rigid.bodies

    def at_nodes(self, model: Model, state: State, time: float) -> Mapping[str, Array]:
        """Return what initial strains of the step to a time follow from, by the names by which they
        ask for it, at the nodes of this rank, shape (nodes,).
        """
        return {}

    def load(self, model: Model, loads: Loads, state: State, dt: float) -> LoadCase | None:
        """Return the loads of a step in place of those that act at its end; None: these."""
        return None

    def contact(self, contact: StepContact, state: State, dt: float) -> StepContact:
        """Return what holds at the contact points in a step of this duration."""
        return contact

    def forces(
        self, model: Model, loads: Loads, state: State, dt: float, y: Array
    ) -> AddedForces | None:
        """Return what equilibrium at a displacement, ghosts included, shape (dofs,), has beside
        stresses, springs and loads; None: nothing.
        """
        return None

    def solved(self, state: State, new: State) -> State:
        """Return a new state with the displacement, and the coordinates of rigid bodies, that the
        contact problem of the step that has led to it was solved for.
        """
        return new

    def repeat(self, state: State, new: State, ended: StepEnd) -> State | None:
        """Return the state to begin the same step from again, with what its solution says in fields
        of the effect; None if it says what they have.
        """
        return None

    def last_begun(self, state: State, new: State) -> State:
        """Return the state that a step between two states was begun from in the end, see
        ``repeat``.
        """
        return state

    def after(self, state: State, new: State, ended: StepEnd) -> State:
        """Return the end of a step that has a solution, with what the effect remembers.

        Args:
            state: from which the step began.
            new: its end, with the fields of ``state``.
            ended: how it has ended.
        """
        return new

    def outcome(self, state: State, new: State, ended: StepEnd) -> tuple[Status, Finding] | None:
        """Return why a step that has a solution has none with the effect, as worn cells have not;
        None if it has one.
        """
        return None

    def figures(self, state: State, new: State, ended: StepEnd) -> Mapping[str, float]:
        """Return what is told of a step that has a solution, by names of columns."""
        return {}

    def columns(self, new: State) -> Mapping[str, Array]:
        """Return what is shown of each contact point at the end of a step, by names of columns of
        the table of contact, each of shape (n,).
        """
        return {}

    def told(self, new: State, ended: StepEnd, figures: Mapping[str, float]) -> Iterator[Finding]:
        """Yield what ``solve`` says of the last step, the same on all ranks, from its figures."""
        yield from ()

    def next_time(self, state: State, end: float) -> float:
        """Return the time of the end of the step after a state, at most that of the load step."""
        return end

    def shortest(self, model: Model) -> float:
        """Return the shortest duration of steps that makes sense, time."""
        return 0.0

    def findings(self, model: Model) -> Iterator[Finding]:
        """Yield what ``check`` says of it in a scene, the same on all ranks."""
        yield from ()

    @classmethod
    def overrides(cls, name: str) -> bool:
        """Return whether it does anything where a method of this name is called."""
        return getattr(cls, name) is not getattr(StepEffect, name)

    @staticmethod
    def added(state: State, name: str, at: str, values: Array) -> State:
        """Return a state with values added to a field, which is zero where there is none yet."""
        earlier = state.fields.get(name)
        return state.with_field(name, at, values if earlier is None else earlier.values + values)


def effects_of_contact(contacts: Sequence[Any]) -> list[StepEffect]:
    """Return what the parts of contacts do from load step to load step: one effect for each kind,
    made of all parts of this kind by the numbers of their contacts.
    """
    parts = dict[str, dict[int, ContactPart]]()
    for number, contact in enumerate(contacts):
        for part in filter(lambda part: part.step_effect, contact.parts):
            parts.setdefault(part.step_effect, {})[number] = part
    return [_class(name).of(several) for name, several in parts.items()]


def stated_effects(statement: Statement) -> list[StepEffect]:
    """Return what contacts and the entries of a statement do from load step to load step."""
    named = {entry.step_effect: entry for entry in reversed(statement.of(Effect))}
    of_entries = (_class(name).of(named[name]) for name in reversed(named) if name)
    return [*effects_of_contact(statement.contact), *of_entries]


def _class(name: str) -> type[StepEffect]:
    return cast("type[StepEffect]", load_class(STEP_EFFECTS, name, StepEffect))
