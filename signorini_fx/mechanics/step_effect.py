"""The base class of effects in time, such as wear or inertia: what happens between load steps.

Other packages add effects by entry points:

    [project.entry-points."signorini_fx.step_effects"]
    wear = "its.module:Wear"

An entry of a scene, or a part of a contact, whose class names one of them has this effect in the
load steps of that scene.  What an effect remembers is in fields of the state, which are carried
along and stored with it.
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
    """The contact conditions at the n contact points of this rank in a load step.

    Attributes:
        model: the body with these points.
        boundary: the points.
        gap: distances from the obstacles at the end of the step, length, shape (n,).
        data: data of the contact problem to solve; its gap differs from ``gap`` if the problem is
            solved for another displacement than that at the end of the step.
        law: the friction law; None: there is none.
        drift: displacement of the obstacles since the state, length, shape (n, d); None: they have
            not moved.
        reference: displacement from which the contact problem counts, ghosts included, length,
            shape (dofs,); None: that of the body.
        part: fraction of the duration of the step at which the contact problem is solved: 1 at its
            end, 0.5 in its middle.
        softness: growth of the gap with the pressure, length per stress, shape (n,); None: none.
        linear: whether the body is linear; a nonlinear body is solved for the displacement at the
            end of the step.
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
        """Return the conditions with lengths added to ``gap`` and ``data.gap``, shape (n,)."""
        data = replace(self.data, gap=self.data.gap + added)
        return replace(self, gap=self.gap + added, data=data)


@dataclass(frozen=True)
class AddedForces:
    """Corrections to the equilibrium that a certificate checks, at the owned nodes of the body.

    Attributes:
        resisting: forces added to those of the strains, shape (owned nodes, d).
        loads: forces added to the loads at the end of the step, of the same shape.
        prescribed: displacements of supports that replace those at the end of the step, length, of
            the same shape.
        lost: round-off of ``resisting``, of the same shape.
        energy: other energy that stresses may come from, such as kinetic energy, shape (owned
            nodes,).
        drives: forces and motions of rigid bodies that replace those at the end of the step; empty:
            those are kept.
        named: forces to show in the results: the name of a boundary or None for the body, the name
            of the force, and the forces, shape (owned nodes, d).
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
    """The results of a load step, as effects need them.

    Attributes:
        model: the body in the step.
        contact: pressure, shear and slip at its contact points on this rank; None: it has none.
        gap: distances from the obstacles at the end of the step, length, shape (n,).
        solved: the displacement that the contact problem was solved for, ghosts included, length,
            shape (dofs,).
        loads: the loads at the end of the step.
        reactions: returns the forces of supports on the owned nodes, shape (owned nodes, d);
            collective.
        elastic: the part of the slip before the step that the regularisation causes, length, shape
            (n, d).
        augmented: whether contact obeys the law without regularisation.
        dt: duration of the step.
        place: its end as a place in the lists of factors, see ``statement.load_path``.
        internal: returns the internal forces of a nonlinear body at a displacement, without those
            of effects, from shape (dofs,) to (owned dofs,), collective; None: the body is linear.
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
    """The residual of a time step of a nonlinear body, which replaces the static one.

    Attributes:
        residual: the residual, UFL.
        tangent: its derivative, UFL; None: UFL derives it.
        begin: sets both to a step from a state (state, duration, loads at the end of the step) and
            returns forces on the owned dofs that are added to these loads.
    """

    residual: ufl.Form
    tangent: ufl.Form | None
    begin: Callable[[State, float, Array | float], Array | float]


class StepEffect:
    """An effect that does nothing; subclasses override the methods that they need.

    All methods but ``next_time`` are collective.

    Examples:
        >>> class Pressed(sfx.StepEffect):
        ...     def after(self, state, new, ended):
        ...         return self.added(new, "impulse", "points", ended.contact.pressure)
        >>> pressed = sfx.solve(scene, effects=[Pressed()])
        >>> print(np.round(pressed.state.fields["impulse"].values.mean(), 6))
        2.0
    """

    # Whether bodies may have large rigid motions.
    moves_bodies: ClassVar[bool] = False
    # The order of convergence in time: the power of the step size in the error.
    order: ClassVar[float] = 1

    @classmethod
    def of(cls, entry: Any) -> Self:
        """Return the effect that a scene asks for.

        Args:
            entry: an ``Effect``, the first one if there are several; or, for parts of contacts,
                their ``ContactPart`` tables by the numbers of the contacts.
        """
        return cls()

    def initial(self, model: Model | None, state: State) -> State:
        """Return the state before the first step, with the fields that the effect starts from.

        Args:
            model: the body; None: a user's forms, which state no data of the effect.
            state: the state without these fields.
        """
        return state

    def body(self, model: Model, state: State, dt: float) -> Model:
        """Return the body with the terms of the effect added; the default returns it unchanged.

        The terms may depend only on the duration of the step and on which fields the state has.
        """
        return model

    def stepped(
        self, F: ufl.Form, J: ufl.Form | None, u: fem.Function, density: Expr | ufl.Form
    ) -> SteppedForms | None:
        """Return forms that replace the static residual of a nonlinear body; None: it is kept.

        Args:
            F: the static residual, UFL.
            J: its tangent, UFL; None: UFL derives it.
            u: the displacement in both.
            density: mass per volume, or the form of the mass.
        """
        return None

    def driven(self, rigid: RigidBodies, state: State, dt: float) -> Sequence[RigidBody]:
        """Return the rigid bodies, with the forces and motions that drive them in a step of a
        nonlinear body.
        """
        return rigid.bodies

    def at_nodes(self, model: Model, state: State, time: float) -> Mapping[str, Array]:
        """Return nodal values that initial strains of a step depend on, such as the temperature, by
        name.

        Args:
            model: the body.
            state: from which the step starts.
            time: at which it ends.

        Returns:
            Values at the nodes of this rank, shape (nodes,).
        """
        return {}

    def load(self, model: Model, loads: Loads, state: State, dt: float) -> LoadCase | None:
        """Return the right-hand side of a step that replaces the loads at its end; None: they are
        kept.
        """
        return None

    def contact(self, contact: StepContact, state: State, dt: float) -> StepContact:
        """Return the contact conditions of a step of duration ``dt``, changed by the effect."""
        return contact

    def forces(
        self, model: Model, loads: Loads, state: State, dt: float, y: Array
    ) -> AddedForces | None:
        """Return forces that equilibrium has in addition to stresses, springs and loads; None:
        none.

        Args:
            model: the body.
            loads: at the end of the step.
            state: from which the step starts.
            dt: duration of the step.
            y: the displacement, ghosts included, length, shape (dofs,).
        """
        return None

    def solved(self, state: State, new: State) -> State:
        """Return ``new`` with the displacement and the coordinates of rigid bodies for which the
        contact problem of the step was solved.
        """
        return new

    def repeat(self, state: State, new: State, ended: StepEnd) -> State | None:
        """Return the state from which to solve the same step again; None: its solution is
        consistent.

        An effect that depends on the solution of the step puts what it has found into its fields
        and repeats the step until they no longer change.
        """
        return None

    def last_begun(self, state: State, new: State) -> State:
        """Return the state from which the step between two states was solved the last time, see
        ``repeat``.
        """
        return state

    def after(self, state: State, new: State, ended: StepEnd) -> State:
        """Return the end of a converged step, with the fields of the effect updated.

        Args:
            state: from which the step began.
            new: its end, with the fields of ``state``.
            ended: its results.
        """
        return new

    def outcome(self, state: State, new: State, ended: StepEnd) -> tuple[Status, Finding] | None:
        """Return the outcome and the reason if the effect rejects a converged step, such as one
        that wears a cell away; None: it accepts the step.
        """
        return None

    def figures(self, state: State, new: State, ended: StepEnd) -> Mapping[str, float]:
        """Return numbers to report of a converged step, by names of columns."""
        return {}

    def columns(self, new: State) -> Mapping[str, Array]:
        """Return columns to add to the contact table at the end of a step, by name, each of shape
        (n,).
        """
        return {}

    def told(self, new: State, ended: StepEnd, figures: Mapping[str, float]) -> Iterator[Finding]:
        """Yield the notes and warnings of ``solve`` on the last step, the same on all ranks.

        Args:
            new: the end of the step.
            ended: its results.
            figures: its numbers from ``figures``.
        """
        yield from ()

    def next_time(self, state: State, end: float) -> float:
        """Return the end of the time step that follows a state, at most ``end``, that of the load
        step.
        """
        return end

    def shortest(self, model: Model) -> float:
        """Return the shortest duration of a step that makes sense, time; 0: there is no limit."""
        return 0.0

    def findings(self, model: Model) -> Iterator[Finding]:
        """Yield the notes and warnings of ``check`` on the effect, the same on all ranks."""
        yield from ()

    @classmethod
    def overrides(cls, name: str) -> bool:
        """Return whether the class overrides the method of this name."""
        return getattr(cls, name) is not getattr(StepEffect, name)

    @staticmethod
    def added(state: State, name: str, at: str, values: Array) -> State:
        """Return a state with values added to a field; a missing field counts as zero."""
        earlier = state.fields.get(name)
        return state.with_field(name, at, values if earlier is None else earlier.values + values)


def effects_of_contact(contacts: Sequence[Any]) -> list[StepEffect]:
    """Return the effects that the parts of contacts ask for.

    All parts of one kind, by the numbers of their contacts, make one effect.
    """
    parts = dict[str, dict[int, ContactPart]]()
    for number, contact in enumerate(contacts):
        for part in filter(lambda part: part.step_effect, contact.parts):
            parts.setdefault(part.step_effect, {})[number] = part
    return [_class(name).of(several) for name, several in parts.items()]


def stated_effects(statement: Statement) -> list[StepEffect]:
    """Return the effects that the contacts and entries of a statement ask for."""
    named = {entry.step_effect: entry for entry in reversed(statement.of(Effect))}
    of_entries = (_class(name).of(named[name]) for name in reversed(named) if name)
    return [*effects_of_contact(statement.contact), *of_entries]


def _class(name: str) -> type[StepEffect]:
    return cast("type[StepEffect]", load_class(STEP_EFFECTS, name, StepEffect))
