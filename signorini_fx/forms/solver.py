"""What a ``ContactProblem`` does: assemble what has changed, solve, certify, and keep the end of
the last step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from signorini_fx.algebra.algorithms.task import Task
from signorini_fx.algebra.linalg import LoadCase
from signorini_fx.algebra.linalg.petsc_options import defaults, refuse_exchanged, refused
from signorini_fx.arrays import Array, Flags, Indices
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
    Foundations,
    ShapeDistances,
)
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.rigid.rigid_bodies import Driven, RigidBodies
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.load_path import LoadPath, counted_path
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.mechanics.step_effect import StepEffect, effects_of_contact
from signorini_fx.records import History, Status, Timings
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.contact_fields import ContactFields
from signorini_fx.solving.frames import Posed
from signorini_fx.solving.step import Report, contact_equilibrium, recalled_equilibrium, step

if TYPE_CHECKING:
    from signorini_fx.forms.given_forms import Density, PetscOptions, SettingValue

Clock = Callable[[float], object]  # changes a problem to what it is at a time

LASTS = "a step with inertia has a duration: use step(state, time) or run, not solve"
UNDERIVED = "derivatives of motions with inertia are not possible yet"


class BodyOfForms:
    """What stays of a body from solve to solve: its forms, its supports and what it touches."""

    stated_by: Sequence[str] = ()  # what a user gives; empty: forms a and L
    # What of it parts of contacts may refuse, by the names of features, and the argument for each.
    refused_features: Sequence[tuple[str, str]] = ()
    foundations: Foundations
    model_of_scene: Model | None = None  # whose statement effects begin with; None: there is none

    def __init__(
        self,
        forms: GivenForms,
        bcs: Sequence[fem.DirichletBC],
        settings: dict[str, SettingValue],
        petsc_options: tuple[str, PetscOptions],  # a prefix, and options without it
        effects: Sequence[StepEffect],
        foundations: Callable[..., Foundations] = Foundations,
        density: Density = None,  # see ``Model``
    ) -> None:
        space = self.space = forms.space
        self.forms = forms
        self.options = petsc_options
        self.bcs = conditions_of(bcs, space)
        self.settings = settings_of(settings)
        names = [f"contact {number}" for number in range(len(forms.contact))]
        self.foundations = foundations(space, forms.contact, forms.facets, names, forms.masters)
        self.foundations.check_driven()
        self.fields = ContactFields.on(space)
        self.history = History()
        self.folders = list[Path]()  # with the load steps of its runs
        self.density = density
        self.effects = (*effects_of_contact(forms.contact), *effects)
        # Whether effects may move the body far without deforming it.
        self.moves = any(effect.moves_bodies for effect in self.effects)
        self._check_parts()
        self._mesh_x = space.mesh.geometry.x.copy()  # with which all that is kept was assembled
        self._state: ContactState | None = None

    def _check_parts(self) -> None:
        """Refuse what parts of contacts, such as wear, do not go together with; collective.

        Raises:
            FormError: there is such a thing.
        """
        problems = list[tuple[str, str]]()
        inertia = [("inertia", "density")] * (self.density is not None)
        uses = [*self.refused_features, *inertia]
        for number, contact in enumerate(self.contact):
            beside = [(part.key, f"contact[{number}].{part.key}") for part in contact.parts]
            for part in contact.parts:
                wrong = part.contradictions(self.named[0], number)
                for (_, _, *keys), reason in wrong:
                    problems.append((".".join((f"contact[{number}]", *map(str, keys))), reason))
                refused = part.refuses.get(part.key, {})
                problems += [
                    (name, refused[used]) for used, name in (*uses, *beside) if used in refused
                ]
        if problems:
            raise FormError(problems)

    @cached_property
    def named(self) -> tuple[Statement, TaggedMesh]:
        """See ``named_parts``."""
        return named_parts(self.forms, self.settings, self.stated_by)

    @property
    def contact(self) -> tuple[Foundation | Pair, ...]:
        """The contact of the forms."""
        return self.forms.contact

    @property
    def owned(self) -> int:
        """The number of displacement unknowns that this rank owns."""
        dofmap = self.space.dofmap
        return int(dofmap.index_map.size_local * dofmap.index_map_bs)

    @property
    def state(self) -> ContactState:
        """The contact points of this rank after the last solve, with forces and areas."""
        if self._state is None:
            raise RuntimeError("there is no solution so far: call solve()")
        return self._state

    def show(self, state: ContactState | None) -> None:
        """Make contact points those that the user sees, or None if there are none."""
        self._state = state
        self.fields.take(self.space, state)

    def initial(self) -> State:
        """Return the body before the first step, with foundations where they are."""
        foundations = self.foundations
        zero = np.zeros_like(fem.Function(self.space).x.array)
        rigid = np.zeros(foundations.rigid_bodies.fixed.size)
        state = State(0, 0.0, zero, rigid, foundations.placed)
        for effect in self.effects:
            state = effect.initial(self.model_of_scene, state)
        return state

    @property
    def mesh_has_moved(self) -> bool:
        """Whether coordinates have changed since something was assembled; collective."""
        mesh = self.space.mesh
        return parallel.any_rank(mesh.comm, not np.array_equal(self._mesh_x, mesh.geometry.x))

    def refuse_driven(self) -> None:
        """Refuse rigid bodies that forces move.

        Raises:
            FormError: there is one.
        """
        if self.foundations.rigid_bodies.bodies:
            reason = "rigid bodies that forces move have no mass in forms yet: prescribe the motion"
            raise FormError.at("density", reason)

    def refuse_moving(self, reason: str) -> None:
        """Raise a FormError where bodies move."""
        if self.moves:
            raise FormError.at("density", reason)

    def supports(self) -> tuple[Flags, Array]:
        """Return which dofs of this rank are prescribed now, ghosts included, and to what, shapes
        (dofs,); collective.
        """
        return prescribed(self.space, conditions_of(self.bcs, self.space))

    def contact_points(
        self, shapes: Sequence[ShapeDistances], fixed: Flags, values: Array
    ) -> ContactBoundary:
        """Return the contact points; collective.

        ``fixed``, ``values``: what is ``prescribed``.

        Raises:
            FormError: none of a contact can move.
        """
        boundary = self.foundations.points(shapes, fixed, values)
        moving = ~boundary.points.immovable | self.foundations.alone(boundary)
        counts = np.bincount(boundary.part[moving], minlength=len(shapes))
        for k, count in enumerate(parallel.global_sum(boundary.comm, counts)):
            if count == 0:
                wrong = (
                    "bcs prescribe the displacement along the normal at all of its points, or "
                    "measure is zero"
                )
                raise FormError.at(f"contact[{k}]", wrong)
        return boundary

    def contact_now(self, solved: Any) -> tuple[Any, ...]:
        """Prescribed values, contact points, gap and law of now; collective.

        Args:
            solved: a problem of the same body with the solution.
        """
        foundations = self.foundations
        shapes = foundations.shapes()
        fixed = solved.elastic.fixed
        boundary = solved.boundary
        if any(shape.factor is not None or shape.direction is not None for shape in shapes):
            at_rest = foundations.at_rest(*solved.prescribed)
            boundary = foundations.boundary(shapes, fixed, at_rest)
        of_body = solved.elastic.settings, solved.elastic.scales
        data, law = foundations.problem(boundary, foundations.data(shapes), *of_body)
        return self.supports()[1][: fixed.size], boundary, data.gap, law


class FormSolver(BodyOfForms):
    """The contact problem of forms on a path: as it is now, and the end of the last step."""

    boundary: ContactBoundary
    elastic: Model
    task: Task
    prescribed: tuple[
        Flags, Array
    ]  # dofs of this rank, ghosts included, and to what, shapes (dofs,)

    def __init__(
        self,
        forms: GivenForms,
        u: fem.Function,
        bcs: Sequence[fem.DirichletBC],
        settings: dict[str, SettingValue],
        petsc_options: tuple[str, PetscOptions],  # a prefix, and options without it
        effects: Sequence[StepEffect] = (),
        density: Density = None,
    ) -> None:
        super().__init__(forms, bcs, settings, petsc_options, effects, density=density)
        self.u = u
        self.go_through(counted_path(0))
        self.report: Report | None = None  # of the last step
        self.outdated = False  # whether another problem has been assembled since
        self.coarser: MeshLevel | None = None
        self.coarser_state: ContactState | None = None  # of a coarser mesh
        self._inputs_before: dict[str, list[bytes]] | None = None  # of what is assembled
        self._natural: float | None = None  # see ``with_modulus``
        # Duration and beginning of the step that effects make the matrix for; None: none does.
        self._timed: tuple[float, State] | None = None
        self.begin = self.initial()  # from which steps begin
        self.last: State | None = (
            None  # the last solution of the step that begins there, or of the one before
        )

    @property
    def status(self) -> Status | None:
        """How the last step has ended, or None if there is none."""
        return None if self.report is None else self.report.status

    @property
    def certificate(self) -> Certificate | None:
        """The check of its result, or None if there is none."""
        return None if self.report is None else self.report.result.certificate

    @property
    def set_up(self) -> bool:
        """Whether all is assembled."""
        return self._inputs_before is not None

    def points(self) -> tuple[ContactBoundary, fem.FunctionSpace]:
        """See ``State.save``."""
        if not self.set_up:
            self.update()
        return self.boundary, self.space

    def go_through(
        self, path: LoadPath, clock: Clock = lambda time: None, *, waits: bool = False
    ) -> None:
        """Take load steps, with what changes the problem to what it is at a time.

        ``waits``: see ``LinearProblem``.
        """
        self.path = path
        self.clock = clock
        self.waits = waits
        self.timings = Timings()

    equilibrium = contact_equilibrium
    recall = recalled_equilibrium

    def accept(self, new: State, report: Report) -> None:
        """What the clock changes is the user's."""

    def pose_at(self, state: State, place: float, dt: float) -> Posed:
        """Pose the step to a place, of a duration, after a state; collective."""
        self.clock(self.path.time_at(place))
        self.begin = state
        if any(effect.overrides("body") for effect in self.effects):
            self._timed = dt, state
        with self.timings.phase("assemble"):
            self.update()
            placed = self.foundations.placed
            drift = self.foundations.moved(self.boundary, state.placed)
            body = replace(self.elastic, path=self.path)
            assert body.data is not None
            resting = self.task.rest
            data = body.data if resting is None else resting.data_from(body.data)
            first = replace(self.task.start, data=data, law=body.law, factors=np.ones(1))
            return Posed(body, self.task, first, placed, drift)

    def advance(self) -> None:
        """End a step, see ``ContactProblem.advance``."""
        if self.outdated or self.status is not Status.CONVERGED or self.last is None:
            raise RuntimeError("there is no solution to advance from")
        self.begin = self.last

    def show_step(self, new: State, report: Report) -> None:
        """Make the end of a step the one that the user sees; collective."""
        self.report = report
        self.outdated = False
        result = report.result
        points = self.task.contact(report.outcome, report.start)
        self.show(result.contact or ContactState.of(points, self.boundary))
        result.displacement.name = self.u.name
        self.u.x.array[:] = result.displacement.x.array
        if self.status is Status.CONVERGED:
            self.last = new

    def update(self) -> None:
        """Assemble what has changed since the last solve, and evaluate gap and friction;
        collective.
        """
        space = self.space
        foundations = self.foundations
        if self.mesh_has_moved:
            self._renew_mesh()
        self.prescribed = self.supports()
        shapes = foundations.shapes()
        rigid = foundations.rigid_bodies
        driven = rigid.driven()
        now = self._inputs(shapes, rigid, driven)
        last = self._inputs_before
        self._inputs_before = None  # until all that follows has gone well
        changed = {
            name: parallel.any_rank(space.mesh.comm, last is None or last[name] != values)
            for name, values in now.items()
        }
        if changed["form"]:
            forms = self.forms
            self._natural = natural_modulus(forms.stress, forms.original[0], forms.measures, space)
        renewed = changed["form"] or changed["body"]
        anew = renewed or changed["points"]
        if anew:
            self._set_up(shapes, renewed=renewed)
        elif changed["loads"]:
            self.task.system.set_case(0, self._case(driven))
        of_body = self.settings, self.elastic.scales
        data, law = foundations.problem(self.boundary, foundations.data(shapes), *of_body)
        pairs = foundations.pairs
        self.elastic = replace(self.elastic, data=data, law=law, pairs=pairs, rigid=rigid)
        if anew:
            case = self._case(driven)
            self.task = self.elastic.task(
                [case], np.ones(1), coarser=self.coarser, history=self.history
            )
            self.outdated = True
        self._inputs_before = now

    def _inputs(
        self, shapes: Sequence[ShapeDistances], rigid: RigidBodies, driven: Driven
    ) -> dict[str, list[bytes]]:
        """Return all values of now that something is assembled from: the form and the rest of the
        stiffness, the contact points, and the loads; collective.
        """
        a, L = self.forms.compiled
        fixed, values = self.prescribed
        axes = [shape.axes for shape in shapes if shape.axes is not None]
        of_points: list[Array | Flags | None] = [self.foundations.at_rest(fixed, values)]
        of_points += [value for shape in shapes for value in (shape.factor, shape.direction)]
        of_points += [value for each in axes for value in (each.along, each.ratio)]
        of_body = [fixed, rigid.fixed, rigid.stiffness]
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

    def _set_up(self, shapes: Sequence[ShapeDistances], *, renewed: bool) -> None:
        """Contact points and stiffness, unless only points are ``renewed``; collective."""
        fixed, values = self.prescribed
        free_unused(self.space.mesh)
        boundary = self.boundary = self.contact_points(shapes, fixed, values)
        points = boundary if self.contact else None
        if renewed:
            elastic = self._body(fixed[: self.owned], points)
        else:
            eliminated = self.task.system.eliminated
            elastic = replace(self.elastic, boundary=points, eliminated=eliminated)
        self.elastic = with_modulus(elastic, boundary, self._natural, self.foundations.facets)

    def _case(self, driven: Driven) -> LoadCase:
        """Return the right-hand side; collective.

        Args:
            driven: what drives rigid bodies.
        """
        values = self.prescribed[1]
        return case_of(self.elastic, assemble(self.forms.compiled[1]), values, driven, values)

    def _body(self, fixed: Flags, points: ContactBoundary | None) -> Model:
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

    def mechanics(self, model: Model) -> FormMechanics:
        """Return what the forms say of a model, with their values of now."""
        of_forms = self.forms, self.prescribed, self.foundations.placed_shapes
        return FormMechanics(model, self.named[0], *of_forms)

    def data_now(self, solved: FormSolver | None = None) -> tuple[Any, ...]:
        """Return the problem of now as derivatives take it; collective.

        Args:
            solved: one of the same body with the solution.
        """
        now = self.contact_now(solved or self)
        return [self.forms.compiled[0]], assemble(self.forms.compiled[1]), *now


def solve_now(solver: FormSolver) -> str:
    """Solve with the values of now; why there is no solution, and what to do, "": there is one;
    collective.
    """
    solver.refuse_moving(LASTS)
    guess = solver.last
    number = solver.begin.number
    solver.foundations.without_times()
    solver.go_through(counted_path(number))
    with options_applied(*solver.options):
        if guess is None and solver.coarser_state is not None:
            from signorini_fx.solving.meshed_problem import carry_over

            solver.update()
            guess = carry_over(solver.coarser_state, solver.boundary, solver.begin)
        new, report = step(solver, solver.begin, float(number), guess=guess)
        assert isinstance(report, Report)  # as of all linear bodies
        solver.show_step(new, report)
    status = report.status
    if status is Status.CONVERGED:
        return ""
    reason = report.result.reason
    advice = status.advice if reason is None else f"{reason.path}: {reason.message}"
    return f"{status.value}: {advice}"


def with_modulus(
    elastic: Model, boundary: ContactBoundary, natural: float | None, facets: Sequence[Indices]
) -> Model:
    """Return a body of forms with its unit of stress, the natural one, None: by its stiffness;
    collective.
    """
    modulus = modulus_of(elastic, boundary, facets) if natural is None else natural
    return replace(elastic, modulus=modulus)


def case_of(
    elastic: Model, forces: Array, values: Array, driven: Driven, lifted: Array
) -> LoadCase:
    """Return the right-hand side of forces, shape (owned dofs,), with prescribed displacements,
    ghosts included, shape (dofs,), and what of these is returned to it; collective.

    Raises:
        FormError: something is not finite.
    """
    for name, entries in (("bcs", values), ("L", forces)):
        if parallel.any_rank(elastic.comm, not np.isfinite(entries).all()):
            raise FormError.at(name, "is not finite somewhere")
    return elastic.case(forces, values, driven, lifted=lifted)


@contextmanager
def options_applied(prefix: str, problem_options: PetscOptions) -> Iterator[None]:
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
