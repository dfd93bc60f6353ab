"""The solver behind ``ContactProblem``: it assembles what has changed, solves, certifies, and keeps
the end of the last step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

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
    Density,
    GivenForms,
    PetscOptions,
    SettingValue,
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

Clock = Callable[[float], None]  # changes a problem to what it is at a time

LASTS = "a step with inertia has a duration: use step(state, time) or run, not solve"
UNDERIVED = "derivatives of motions with inertia are not possible yet"


class BodyOfForms:
    """The part of a body that stays from solve to solve: its forms, Dirichlet conditions and
    contact.
    """

    stated_by: Sequence[str] = ()  # the arguments that state the body; empty: the forms a and L
    # Features of the body that parts of contacts may refuse, each with the argument that it comes
    # from.
    refused_features: Sequence[tuple[str, str]] = ()
    foundations: Foundations
    model_of_scene: Model | None = (
        None  # the model whose statement effects begin with; None: no scene
    )

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
        self.folders = list[Path]()  # folders in which its runs have stored load steps
        self.density = density
        self.effects = (*effects_of_contact(forms.contact), *effects)
        # Whether effects may move the body by large rigid motions.
        self.moves = any(effect.moves_bodies for effect in self.effects)
        self._check_parts()
        self._mesh_x = (
            space.mesh.geometry.x.copy()
        )  # the node coordinates of everything that is assembled
        self._state: ContactState | None = None

    def _check_parts(self) -> None:
        """Refuse parts of contacts, such as wear, that cannot be combined with other features of
        the problem; collective.

        Raises:
            FormError: there is such a combination.
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
        """The statement and the tagged mesh of the forms, see ``named_parts``."""
        return named_parts(self.forms, self.settings, self.stated_by)

    @property
    def contact(self) -> tuple[Foundation | Pair, ...]:
        """The foundations and pairs of the forms."""
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
        """Make these contact points those of ``state`` and of the contact fields; None: there are
        none.
        """
        self._state = state
        self.fields.take(self.space, state)

    def initial(self) -> State:
        """Return the state before the first step, with the foundations at their present places."""
        foundations = self.foundations
        zero = np.zeros_like(fem.Function(self.space).x.array)
        rigid = np.zeros(foundations.rigid_bodies.fixed.size)
        state = State(0, 0.0, zero, rigid, foundations.placed)
        for effect in self.effects:
            state = effect.initial(self.model_of_scene, state)
        return state

    @property
    def mesh_has_moved(self) -> bool:
        """Whether node coordinates have changed since the last assembly; collective."""
        mesh = self.space.mesh
        return parallel.any_rank(mesh.comm, not np.array_equal(self._mesh_x, mesh.geometry.x))

    def refuse_driven(self) -> None:
        """Refuse rigid bodies whose motion follows from forces, which have no mass here.

        Raises:
            FormError: there is one.
        """
        if self.foundations.rigid_bodies.bodies:
            reason = "rigid bodies that forces move have no mass in forms yet: prescribe the motion"
            raise FormError.at("density", reason)

    def refuse_moving(self, reason: str) -> None:
        """Raise a FormError with this reason if effects move the body, as inertia does."""
        if self.moves:
            raise FormError.at("density", reason)

    def supports(self) -> tuple[Flags, Array]:
        """Return the flags and values of the prescribed dofs of this rank at present, ghosts
        included, shapes (dofs,); collective.
        """
        return prescribed(self.space, conditions_of(self.bcs, self.space))

    def contact_points(
        self, shapes: Sequence[ShapeDistances], fixed: Flags, values: Array
    ) -> ContactBoundary:
        """Return the contact points; collective.

        Args:
            shapes: distances of the contacts.
            fixed: flags of prescribed dofs, see ``supports``.
            values: their values.

        Raises:
            FormError: all points of a contact are immovable.
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
        """Return the present prescribed values, contact points, gap and friction law; collective.

        Args:
            solved: a problem of the same body that holds the solution.
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
    """The contact problem of forms along a load path: the present assembled problem and the end of
    the last step.
    """

    boundary: ContactBoundary
    elastic: Model
    task: Task
    prescribed: tuple[
        Flags, Array
    ]  # flags and values of prescribed dofs of this rank, ghosts included, shapes (dofs,)

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
        self.report: Report | None = None  # the end of the last step
        self.outdated = False  # whether a different problem has been assembled since
        self.coarser: MeshLevel | None = None
        self.coarser_state: ContactState | None = (
            None  # the contact state of a coarser mesh, to start from
        )
        self._inputs_before: dict[str, list[bytes]] | None = (
            None  # the input values that the present matrices were assembled from
        )
        self._natural: float | None = None  # see ``with_modulus``
        # Duration and initial state of the step if effects change its matrix; None: none does.
        self._timed: tuple[float, State] | None = None
        self.begin = self.initial()  # the state from which steps begin
        self.last: State | None = (
            None  # the last solution, of the step from ``begin`` or of the step before it
        )

    @property
    def status(self) -> Status | None:
        """The status of the last step, or None if there is none."""
        return None if self.report is None else self.report.status

    @property
    def certificate(self) -> Certificate | None:
        """The certificate of the last step, or None if there is none."""
        return None if self.report is None else self.report.result.certificate

    @property
    def set_up(self) -> bool:
        """Whether everything is assembled."""
        return self._inputs_before is not None

    def points(self) -> tuple[ContactBoundary, fem.FunctionSpace]:
        """Return the contact points and the space of the displacement, see ``State.save``."""
        if not self.set_up:
            self.update()
        return self.boundary, self.space

    def go_through(
        self, path: LoadPath, clock: Clock = lambda time: None, *, waits: bool = False
    ) -> None:
        """Set the load path for the following steps.

        Args:
            path: the load steps.
            clock: a function that changes the problem to a given time.
            waits: whether a body without load stays where it is until its load comes, see
                ``LinearProblem``.
        """
        self.path = path
        self.clock = clock
        self.waits = waits
        self.timings = Timings()

    equilibrium = contact_equilibrium
    recall = recalled_equilibrium

    def accept(self, new: State, report: Report) -> None:
        """Do nothing: the user's program keeps the states of the forms."""

    def pose_at(self, state: State, place: float, dt: float) -> Posed:
        """Assemble the step from a state to a place on the load path; collective.

        Args:
            state: the state at which the step begins.
            place: the place on the path where it ends.
            dt: its duration.
        """
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
        """Update ``u``, contact points and fields to the end of a step; collective.

        Args:
            new: the state at the end of the step.
            report: how the step has ended.
        """
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
        self._inputs_before = None  # set at the end, so that it stays None if an error is raised
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
        of_body = self.settings, self.elastic.scales
        data, law = foundations.problem(self.boundary, foundations.data(shapes), *of_body)
        pairs = foundations.pairs
        self.elastic = replace(self.elastic, data=data, law=law, pairs=pairs, rigid=rigid)
        if anew or changed["loads"]:
            values = self.prescribed[1]
            forces = assemble(self.forms.compiled[1])
            case = case_of(self.elastic, forces, values, driven, values)
            if anew:
                self.task = self.elastic.task(
                    [case], np.ones(1), coarser=self.coarser, history=self.history
                )
                self.outdated = True
            else:
                self.task.system.set_case(0, case)
        self._inputs_before = now

    def _inputs(
        self, shapes: Sequence[ShapeDistances], rigid: RigidBodies, driven: Driven
    ) -> dict[str, list[bytes]]:
        """Return the bytes of all present values that matrices and loads are assembled from, under
        "form", "body" (the rest of the stiffness), "points" and "loads"; collective.
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
        """Discard everything computed from node coordinates that have changed; collective."""
        self._inputs_before = None
        self._mesh_x = self.space.mesh.geometry.x.copy()
        self.__dict__.pop("named", None)  # it has the size of the mesh
        forget_positions(self.space)
        forget_pieces(self.space.mesh)

    def _set_up(self, shapes: Sequence[ShapeDistances], *, renewed: bool) -> None:
        """Find the contact points and, if ``renewed``, assemble the stiffness; collective."""
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
        """Return the mechanics of a model with the present values of the forms."""
        of_forms = self.forms, self.prescribed, self.foundations.placed_shapes
        return FormMechanics(model, self.named[0], *of_forms)

    def data_now(self, solved: FormSolver | None = None) -> tuple[Any, ...]:
        """Return the present forms, loads, prescribed values, contact points, gap and friction law
        for the computation of derivatives; collective.

        Args:
            solved: a solver of the same body that holds the solution; None: this one.
        """
        now = self.contact_now(solved or self)
        return [self.forms.compiled[0]], assemble(self.forms.compiled[1]), *now


def solve_now(solver: FormSolver) -> str:
    """Solve with the present values; collective.

    Returns an empty string, or if there is no solution the reason and what to do about it.
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
        assert isinstance(report, Report)  # all linear bodies end with a Report
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
    """Return a body of forms with its modulus, the unit of stress; collective.

    Args:
        elastic: the body.
        boundary: its contact points.
        natural: the modulus from ``natural_modulus``; None: it is estimated from the stiffness.
        facets: the facets of each contact.
    """
    modulus = modulus_of(elastic, boundary, facets) if natural is None else natural
    return replace(elastic, modulus=modulus)


def case_of(
    elastic: Model, forces: Array, values: Array, driven: Driven, lifted: Array
) -> LoadCase:
    """Return the right-hand side of a linear contact problem; collective.

    Args:
        elastic: the body.
        forces: loads at the owned dofs, shape (owned dofs,).
        values: prescribed displacements, ghosts included, shape (dofs,).
        driven: forces and prescribed motions of rigid bodies.
        lifted: displacements whose elastic forces are subtracted from the loads (Dirichlet
            lifting), shape (dofs,).

    Raises:
        FormError: ``forces`` or ``values`` are not finite.
    """
    for name, entries in (("bcs", values), ("L", forces)):
        if parallel.any_rank(elastic.comm, not np.isfinite(entries).all()):
            raise FormError.at(name, "is not finite somewhere")
    return elastic.case(forces, values, driven, lifted=lifted)


@contextmanager
def options_applied(prefix: str, problem_options: PetscOptions) -> Iterator[None]:
    """Apply a problem's PETSc options while its solver objects are made and run, in addition to
    those in the database.

    An OptionsError is raised if PETSc fails with one of them, or if an option would replace our
    method by another one.

    Args:
        prefix: prefix of the problem in the database.
        problem_options: options without the prefix.
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
