"""What a ``ContactProblem`` does: assemble what has changed, solve, certify, and keep the end of
the last step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from petsc4py import PETSc

from signorini_fx.algebra import Settings
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.linalg import LoadCase
from signorini_fx.algebra.linalg.petsc_options import defaults, refuse_exchanged, refused
from signorini_fx.arrays import Array, Flags
from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import FormMechanics, elastic_body, modulus_of, natural_modulus
from signorini_fx.forms.given_forms import (
    GivenForms,
    conditions_of,
    named_parts,
    settings_of,
)
from signorini_fx.machine import compat, parallel
from signorini_fx.machine.petsc_objects import free_unused
from signorini_fx.mechanics.assembly.mesh_entities import assemble, forget_positions, prescribed
from signorini_fx.mechanics.assembly.pieces import forget_pieces
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.interfaces import Foundation, Pair
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.obstacles.foundations_on_points import (
    FoundationData,
    Foundations,
    ShapeDistances,
)
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.rigid.rigid_bodies import Driven, RigidBodies, RigidBodyMotion
from signorini_fx.mechanics.scales import Scales
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.load_path import LoadPath, counted_path
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.mechanics.step_effect import StepEffect, effects_of_contact
from signorini_fx.records import History, Status, Timings
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.contact_fields import ContactFields
from signorini_fx.results.mechanics import StepResult
from signorini_fx.solving.frames import Posed, guess_of
from signorini_fx.solving.step import Report, contact_equilibrium, step


class FormSolver:
    """The contact problem of forms as it is now, and the end of the last step."""

    _stated_by: Sequence[str] = ()  # what a user gives; empty: forms a and L
    # What of it parts of contacts may refuse, by the names of features, and the argument for each.
    _refused_features: Sequence[tuple[str, str]] = ()
    _foundations_class: Callable[..., Foundations] = Foundations

    boundary: ContactBoundary
    elastic: Model
    task: Task
    begun: Start  # where the last solve began
    rigid: RigidBodies
    driven: Driven  # what drives them
    data: list[FoundationData]  # at the nodes, as they are now
    unshifted: RegularisedData  # displacements counted from the initial position
    law: PointFriction | None  # of friction at the contact points, as it is now
    prescribed: tuple[
        Flags, Array
    ]  # dofs of this rank, ghosts included, and to what, shapes (dofs,)

    def __init__(
        self,
        forms: GivenForms,
        u: fem.Function,
        bcs: Any,
        settings: dict[str, Any],
        petsc_options: tuple[str, Mapping[str, Any]],  # a prefix, and options without it
        effects: Sequence[StepEffect] = (),
        density: Any = None,  # see ``Model``
    ) -> None:
        space = self.space = forms.space
        self.forms = forms
        self.u = u
        self.options = petsc_options
        self.bcs = conditions_of(bcs, space)
        self.settings = settings_of(settings)
        names = [f"contact {number}" for number in range(len(forms.contact))]
        self.foundations = self._foundations_class(
            space, forms.contact, forms.facets, names, forms.masters
        )
        self.foundations.check_driven()
        self.fields = ContactFields.on(space)
        self.history = History()
        self.timings = Timings()
        self.status: Status | None = None
        self.certificate: Certificate | None = None
        self.result: StepResult | None = None  # of a path, or of the user's own loop
        self.rigid_bodies: tuple[RigidBodyMotion, ...] = ()
        self.outcome: Outcome | None = (
            None  # of the last solve, unless another problem has been assembled since
        )
        self.coarser: MeshLevel | None = None
        self.coarser_state: ContactState | None = None  # of a coarser mesh
        self.folders = list[Path]()  # with the load steps of its runs
        self._inputs_before: dict[str, list[bytes]] | None = None  # of what is assembled
        self._mesh_x = space.mesh.geometry.x.copy()  # with which it was, and all that is kept
        self._modulus: float | None = None  # of the forms; None: they do not say it
        self._check_parts(density)
        self.effects = (*effects_of_contact(forms.contact), *effects)
        self.density = density
        # Duration and beginning of the step that effects make the matrix for; None: none does.
        self._timed: tuple[float, State] | None = None
        self.begin = self.initial()  # from which steps begin
        self.last: State | None = (
            None  # the last solution of the step that begins there, or of the one before
        )
        self._state: ContactState | None = None

    def _check_parts(self, density: Any) -> None:
        """Refuse what parts of contacts, such as wear, do not go together with; collective.

        Raises:
            FormError: there is such a thing.
        """
        problems = list[tuple[str, str]]()
        uses = [*self._refused_features, *([("inertia", "density")] * (density is not None))]
        for number, contact in enumerate(self.contact):
            for part in contact.parts:
                wrong = part.contradictions(self.named[0], number)
                for (_, _, *keys), reason in wrong:
                    problems.append((".".join((f"contact[{number}]", *map(str, keys))), reason))
                refused = part.refuses.get(part.key, {})
                problems += [(name, refused[used]) for used, name in uses if used in refused]
        if problems:
            raise FormError(problems)

    @cached_property
    def named(self) -> tuple[Statement, TaggedMesh]:
        """See ``named_parts``."""
        return named_parts(self.forms, self.settings, self._stated_by)

    @property
    def scales(self) -> Scales:
        """Return the scales of the body."""
        return self.elastic.scales

    @property
    def set_up(self) -> bool:
        """Whether all is assembled."""
        return self._inputs_before is not None

    def points(self) -> tuple[ContactBoundary, fem.FunctionSpace]:
        """See ``State.save``."""
        if not self.set_up:
            self.update()
        return self.boundary, self.space

    def initial(self) -> State:
        """The body before the first step, with foundations where they are."""
        zero = np.zeros_like(self.u.x.array)
        state = State(0, 0.0, zero, np.zeros(0), self.foundations.placed)
        for effect in self.effects:
            state = effect.initial(None, state)
        return state

    waits = False  # see ``Problem``

    @property
    def path(self) -> LoadPath:
        """The load steps of the user's own loop so far."""
        return counted_path(self.begin.number)

    def attempt(self) -> str:
        """Solve with the values of now; why there is no solution, and what to do, "": there is one;
        collective.
        """
        if any(effect.overrides("body") for effect in self.effects):
            lasts = "a step with inertia has a duration: use step(state, time) or run, not solve"
            raise FormError.at("density", lasts)
        self.timings = Timings()
        guess = self.last
        self.foundations.without_times()
        with options_applied(*self.options):
            if self.last is None and self.coarser_state is not None:
                from signorini_fx.solving.meshed_problem import carry_over

                self.update()
                guess = guess_of(
                    *carry_over(self.coarser_state, self.boundary), self.boundary, self.begin
                )
            self.show(*step(self, self.begin, float(self.begin.number), guess=guess))
        status = self.status
        if status is None or status is Status.CONVERGED:
            return ""
        reason = None if self.result is None else self.result.reason
        advice = status.advice if reason is None else f"{reason.path}: {reason.message}"
        return f"{status.value}: {advice}"

    @property
    def state(self) -> ContactState:
        """The contact points of this rank after the last solve, with forces and areas."""
        if self._state is None:
            raise RuntimeError("there is no solution so far: call solve()")
        return self._state

    def pose(self, state: State, dt: float = 0.0) -> Posed:
        """What a solve from a state over a duration is made of, with what the problem is now;
        collective.
        """
        if any(effect.overrides("body") for effect in self.effects):
            self._timed = dt, state
        data, law = self.update()
        if (resting := self.task.rest) is not None:
            data = resting.data_from(data)
        sets = ActiveSets.all_in_contact(*data.mu_hat.shape)
        first = Start(data, law, 0.0 * data.mu_hat, sets, iteration=0, factors=np.ones(1))
        drift = self.moved(self.boundary)
        spin = self.foundations.spin_at(self.boundary, state.placed)
        return Posed(
            self.elastic, self.rigid, self.task, first, self.foundations.placed, drift, spin
        )

    def pose_at(self, state: State, place: float, dt: float, path: LoadPath | None = None) -> Posed:
        """Pose the step for the body with its names, on a path; None: that of the user's own loop;
        collective.
        """
        self.begin = state
        with self.timings.phase("assemble"):
            posed = self.pose(state, dt)
            return replace(posed, body=self.model(path or self.path))

    equilibrium = contact_equilibrium

    def accept(self, new: State, report: Report) -> None:
        """The next step goes on from values of then."""

    def advance(self) -> None:
        """End a step, see ``ContactProblem.advance``."""
        if self.outcome is None or self.status is not Status.CONVERGED or self.last is None:
            raise RuntimeError("there is no solution to advance from")
        self.begin = self.last

    def show(self, new: State, report: Report) -> None:
        """Make the end of a step the one that the user sees; collective."""
        self.outcome = report.outcome
        self.begun = report.start
        result = report.result
        self.result = result
        self.rigid_bodies = result.rigid_bodies
        self.status = result.status
        self.certificate = result.certificate
        self._state = result.contact or ContactState.of(
            self.task.contact(report.outcome, self.begun), self.boundary
        )
        result.displacement.name = self.u.name
        self.u.x.array[:] = result.displacement.x.array
        self.fields.take(self.space, self.state)
        if self.status is Status.CONVERGED:
            self.last = new

    def update(self) -> tuple[RegularisedData, PointFriction | None]:
        """Assemble what has changed since the last solve, and evaluate gap and friction;
        collective.
        """
        space = self.space
        if parallel.any_rank(
            space.mesh.comm, not np.array_equal(self._mesh_x, space.mesh.geometry.x)
        ):
            self._renew_mesh()
        self.prescribed = prescribed(space, conditions_of(self.bcs, space))
        shapes = self.foundations.shapes()
        self.rigid = self.foundations.rigid_bodies
        self.driven = self.rigid.driven()
        now = self._inputs(shapes)
        last = self._inputs_before
        self._inputs_before = None  # until all that follows has gone well
        changed = {
            name: parallel.any_rank(space.mesh.comm, last is None or last[name] != values)
            for name, values in now.items()
        }
        if changed["form"]:
            forms = self.forms
            law = forms.stress
            a = forms.original[0]
            self._modulus = natural_modulus(law, a, forms.measures, space)
        if changed["form"] or changed["body"] or changed["points"]:
            data = self._set_up(shapes, renewed=changed["form"] or changed["body"])
            self.outcome = None  # its iterate is that of another system
        else:
            if changed["loads"]:
                self.task.system.set_case(0, self._case(self.prescribed[1]))
            data = self._point_data(shapes)
        self._inputs_before = now
        return data

    def _inputs(self, shapes: Sequence[ShapeDistances]) -> dict[str, list[bytes]]:
        """All values of now that something is assembled from: the form and the rest of the
        stiffness, the contact points, and the loads; collective.
        """
        a, L = self.forms.compiled
        fixed, values = self.prescribed
        rigid = self.rigid
        driven = self.driven
        axes = [shape.axes for shape in shapes if shape.axes is not None]
        of_points: list[Any] = [self.foundations.at_rest(fixed, values)]
        of_points += [value for shape in shapes for value in (shape.factor, shape.direction)]
        of_points += [value for each in axes for value in (each.along, each.ratio)]
        of_body = [fixed, rigid.fixed, rigid.stiffness, *self._beside()]
        if self._timed is not None:
            dt, state = self._timed
            of_body += [np.array(dt), np.array(" ".join(sorted(state.fields)))]
        of_loads = [*compat.form_data(L), values, driven.forces, driven.motion]
        return {
            name: [np.asarray(one).tobytes() for one in arrays if one is not None]
            for name, arrays in (
                ("form", compat.form_data(a)),
                ("body", of_body),
                ("points", of_points),
                ("loads", of_loads),
            )
        }

    def _renew_mesh(self) -> None:
        """Forget what was computed of coordinates that have changed; collective."""
        self._inputs_before = None
        self._mesh_x = self.space.mesh.geometry.x.copy()
        self.__dict__.pop("named", None)  # with the size of the mesh
        forget_positions(self.space)
        forget_pieces(self.space.mesh)

    def _set_up(
        self, shapes: Sequence[ShapeDistances], *, renewed: bool
    ) -> tuple[RegularisedData, PointFriction | None]:
        """Contact points, stiffness, unless only points are ``renewed``, and linear algebra, and
        the data of the points; collective.
        """
        space = self.space
        fixed, values = self.prescribed
        free_unused(space.mesh)
        boundary = self.contact_points(shapes, fixed, values)
        moving = ~boundary.points.immovable | self.foundations.alone(boundary)
        counts = np.bincount(boundary.part[moving], minlength=len(shapes))
        for k, count in enumerate(parallel.global_sum(space.mesh.comm, counts)):
            if count == 0:
                wrong = (
                    "bcs prescribe the displacement along the normal at all of its points, or "
                    "measure is zero"
                )
                raise FormError.at(f"contact[{k}]", wrong)
        self.boundary = boundary
        if renewed:
            owned = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
            self.elastic = self._body(fixed[:owned], boundary)
        else:
            points = boundary if self.contact else None
            eliminated = self.task.system.eliminated
            self.elastic = replace(self.elastic, boundary=points, eliminated=eliminated)
        modulus = self._modulus
        if modulus is None:
            modulus = modulus_of(self.elastic, boundary, self.foundations.facets)
        self.elastic = elastic = replace(self.elastic, modulus=modulus)
        case = self._case(values)
        data = self._point_data(shapes)
        self.task = elastic.task(
            [case],
            np.ones(1),
            *data,
            coarser=self.coarser,
            natural_gamma=self.scales.gamma,
            coordinate_error=self.scales.coordinate_error,
            history=self.history,
            has_coulomb=any(
                contact.friction and contact.friction.follows_pressure
                for contact in self.forms.contact
            ),
        )
        return data

    def contact_points(
        self, shapes: Sequence[ShapeDistances], fixed: Flags, values: Array
    ) -> ContactBoundary:
        """The contact points; ``fixed``, ``values``: what is ``prescribed``; collective."""
        owned = self.space.dofmap.index_map.size_local * self.space.dofmap.index_map_bs
        at_rest = self.foundations.at_rest(fixed, values)
        return self.foundations.rigid_bodies.on(
            self.foundations.boundary(shapes, fixed[:owned], at_rest)
        )

    @property
    def contact(self) -> tuple[Foundation | Pair, ...]:
        """The contact of the forms."""
        return self.forms.contact

    def _case(self, values: Array) -> LoadCase:
        """The right-hand side, with prescribed displacements, ghosts included, shape (dofs,);
        collective.
        """
        forces, lifted = self._forces(values)
        for name, entries in (("bcs", values), ("L", forces)):
            if parallel.any_rank(self.space.mesh.comm, not np.isfinite(entries).all()):
                raise FormError.at(name, "is not finite somewhere")
        return self.elastic.case(forces, values, self.driven, lifted=lifted)

    def _body(self, fixed: Flags, boundary: ContactBoundary) -> Model:
        points = boundary if self.contact else None
        stated = body = elastic_body(
            self.space,
            self.forms.compiled[0],
            self.bcs,
            fixed,
            points,
            self.settings,
            self.named,
            density=lambda: self.density,
        )
        if self._timed is not None:
            dt, state = self._timed
            for effect in self.effects:
                body = effect.body(body, state, dt)
        return stated if body is stated else replace(body, of_body={}, of_contact={})

    def _forces(self, values: Array) -> tuple[Array, Array]:
        """The right-hand side, shape (owned dofs,), without what is returned of the prescribed
        values; collective.
        """
        return assemble(self.forms.compiled[1]), values

    def moved(self, boundary: ContactBoundary) -> Array | None:
        """How far foundations have moved at contact points since ``advance``, shape (n, d); None:
        they have not.
        """
        return self.foundations.moved(boundary, self.begin.placed)

    def _beside(self) -> Sequence[npt.NDArray[Any]]:
        """What the matrix is made of beside ``a`` and ``bcs``."""
        return ()

    def _point_data(
        self, shapes: Sequence[ShapeDistances]
    ) -> tuple[RegularisedData, PointFriction | None]:
        """Gap, friction and regularisation at the contact points, as they are now; collective."""
        self.data = self.foundations.data(shapes)
        problem = self.foundations.problem(
            self.boundary, self.data, Settings.of(self.settings), self.scales
        )
        self.unshifted, self.law = problem
        return problem

    def model(self, path: LoadPath | None = None, title: str = "") -> Model:
        """The body as the forms are now; without a path its load steps are those of the user's own
        loop; collective.
        """
        return replace(
            self.elastic,
            title=title,
            path=path or counted_path(self.begun.step),
            law=self.law,
            pairs=self.foundations.pairs,
            rigid=self.rigid,
            data=self.unshifted,
        )

    def mechanics(self, model: Model) -> FormMechanics:
        """What the forms say of a model, with their values of now."""
        return FormMechanics(model, self.forms, self.prescribed, self.foundations.placed_shapes)

    def data_now(self, solved: FormSolver | None = None) -> tuple[Any, ...]:
        """The problem of now as derivatives take it; ``solved``: one of the same body with the
        solution; collective.
        """
        return [self.forms.compiled[0]], assemble(self.forms.compiled[1]), *self.contact_now(solved)

    def contact_now(self, solved: FormSolver | None) -> tuple[Any, ...]:
        """Prescribed values, contact points, gap and law of now, see ``data_now``; collective."""
        solved = self if solved is None else solved
        shapes = self.foundations.shapes()
        fixed = solved.elastic.fixed
        boundary = solved.boundary
        if any(shape.factor is not None or shape.direction is not None for shape in shapes):
            boundary = self.foundations.boundary(
                shapes, fixed, self.foundations.at_rest(*solved.prescribed)
            )
        settings = Settings.of(self.settings)
        data, law = self.foundations.problem(
            boundary, self.foundations.data(shapes), settings, solved.scales
        )
        values = prescribed(self.space, conditions_of(self.bcs, self.space))[1][: fixed.size]
        return values, boundary, data.gap, law


@contextmanager
def options_applied(prefix: str, problem_options: Mapping[str, Any]) -> Iterator[None]:
    """Put the options of a problem where its solver objects read them, beside those of the
    database; an OptionsError says that PETSc fails with them, or would run another method than ours
    with one of them.
    """
    wanted = {
        name: None if value is None else str(value) for name, value in problem_options.items()
    }
    of_database = PETSc.Options().getAll().items()
    wanted |= {
        name.removeprefix(prefix): value or None
        for name, value in of_database
        if name.startswith(prefix)
    }
    with defaults(wanted):
        refuse_exchanged()
        try:
            yield
        except PETSc.Error as error:
            raise refused(error) or error from None
