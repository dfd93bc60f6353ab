"""``ContactProblem``: contact and friction for anybody's symmetric form, in the idiom of ``dolfinx.fem.petsc``."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.mesh import MeshTags
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.accuracy.error_estimates import Errors
from signorini_fx.accuracy.level_results import level_result
from signorini_fx.accuracy.mesh_level import LevelResult
from signorini_fx.accuracy.price_list import Price, peak_memory, price_list
from signorini_fx.algorithms.strategy import solve_task
from signorini_fx.algorithms.task import Outcome, Start, Task
from signorini_fx.body.assembly import assemble
from signorini_fx.body.averages import averaging
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.contact_table import contact_table
from signorini_fx.body.deformation import Deformation, deformation_of
from signorini_fx.body.elastic import ElasticBody
from signorini_fx.body.foundation import Foundation, Pair
from signorini_fx.body.foundations import Foundations, ShapeDistances
from signorini_fx.body.rigid_bodies import RigidBodies, RigidBodyMotion
from signorini_fx.body.supports import prescribed
from signorini_fx.check.laws_in_results import laws_in_results
from signorini_fx.check.pushed_nodes import held_in_result, pushed_nodes
from signorini_fx.check.shapes_in_results import shapes_in_results
from signorini_fx.contact.friction import PointFriction
from signorini_fx.contact.laws import ActiveSets, RegularisedData
from signorini_fx.errors import FormError, SceneError
from signorini_fx.extensions import add_on
from signorini_fx.forms import options
from signorini_fx.forms.arguments import conditions_of, facets_of, foundations_of, parts_of, settings_of, space_of
from signorini_fx.forms.certificate import balance_of, sides_of
from signorini_fx.forms.elasticity import Array, case_of, digest, elastic_body, scales_of
from signorini_fx.forms.fields import ContactFields
from signorini_fx.forms.levels import errors_of
from signorini_fx.forms.named_parts import boundaries_of, named_body
from signorini_fx.forms.solved_problem import SolvedProblem
from signorini_fx.forms.stated_values import constants_of
from signorini_fx.forms.steps import Clock, FormSteps, SolvedPath, StepBeginning
from signorini_fx.forms.stress import law_of, stresses_of
from signorini_fx.linalg.elasticity import LoadCase
from signorini_fx.machine.compilation import compiling
from signorini_fx.machine.petsc_objects import free_unused
from signorini_fx.method import Settings
from signorini_fx.quantities.functional import Gradient
from signorini_fx.records import Finding, History, Inventory, Status, Timings
from signorini_fx.results.asked_law import asked_law
from signorini_fx.results.certificate import Certificate, judged
from signorini_fx.results.checkpoint import Checkpoint
from signorini_fx.results.promised_law import Law, PreviousStep, Tractions
from signorini_fx.results.solution import ConvergenceError, StepResult
from signorini_fx.results.step_frames import LastSolution, StepEnd, relative_to
from signorini_fx.results.stresses import RawStresses
from signorini_fx.scales import Scales
from signorini_fx.scene.load_steps import LoadPath
from signorini_fx.solving.first_start import CoarserMesh, first_start
from signorini_fx.solving.load_path import Increments
from signorini_fx.solving.load_steps import all_load_steps
from signorini_fx.solving.load_steps import judged as judged_status
from signorini_fx.solving.one_mesh import used_parameters
from signorini_fx.solving.restart import MeshCheckpoint, open_checkpoint


class ContactProblem(SolvedProblem):
    """Find y with a(y, z) = L(z) for all z, and contact with rigid foundations on parts of the boundary.

        problem = ContactProblem(a, L, bcs, contact=[Foundation(facets, gap=0.01, friction=Coulomb(0.3))])
        y = problem.solve()

    Constants and Functions in the forms, in the conditions and in the foundations may change between two solves: what
    has not changed is neither assembled nor factorised again.  An own time loop calls ``advance`` after each step.

    Args:
        a: a symmetric bilinear form on a vector Lagrange space of degree 1 or 2, UFL or compiled; on a mesh of plane
            cells in space, a section, too.
        L: a linear form on the same space.
        bcs: Dirichlet conditions as dolfinx makes them; where two meet the later one applies.
        contact: the foundations, and the pairs of bodies that can touch.
        u: the Function that takes the solution; None: a new one.
        petsc_options_prefix: of the options of this problem in PETSc's database.
        petsc_options: options without that prefix, for the SNES, its KSP and PC.
        form_compiler_options: see ``dolfinx.fem.form``.
        jit_options: see ``dolfinx.fem.form``.
        stress: of the displacement, linear in its strain: a function of it that returns UFL, or UFL of ``u`` or of
            the trial function, shape (d, d), or in the plane (3, 3); None: there are no stresses.
        materials: tags on all cells; the stress may jump where they change.  None: it does not jump.
        boundaries: names of parts of the boundary for results, each with its facets, as a ``Foundation`` takes them.
        settings: algorithm, coulomb, gamma_n, ..., see ``SolverSettings``.

    Attributes:
        u: the solution.
        bcs: the Dirichlet conditions; the list may change between two solves.
        contact: the foundations.
        pressure, shear, gap, slip: of all foundations, see ``ContactFields``.
        history: every linear solve of all solves so far.
        status: how the last solve ended; None before the first one.
        tools: how the foundations that forces move have moved in the last solution.
        certificate: the check of the last solution against the conditions of the problem; None before the first solve.

    Raises:
        FormError: an argument is wrong.
        MachineError: a form cannot be compiled.
    """

    _foundations_class = Foundations

    def __init__(
        self,
        a: Any,
        L: Any,
        bcs: Sequence[fem.DirichletBC] = (),
        contact: Sequence[Foundation | Pair] | Foundation | Pair = (),
        u: fem.Function | None = None,
        *,
        petsc_options_prefix: str = "sfx_",
        petsc_options: Mapping[str, Any] | None = None,
        form_compiler_options: dict[str, Any] | None = None,
        jit_options: dict[str, Any] | None = None,
        stress: Any = None,
        materials: MeshTags | None = None,
        boundaries: Mapping[str, Any] | None = None,
        **settings: Any,
    ) -> None:
        space = self._space = space_of(a, L, u)
        self.settings = settings_of(settings)
        self.contact = foundations_of(contact)
        self.bcs = conditions_of(bcs, space)
        facets, masters = facets_of(self.contact, space.mesh)
        with compiling():
            self._a, self._L = (
                form
                if isinstance(form, fem.Form)
                else fem.form(form, form_compiler_options=form_compiler_options, jit_options=jit_options)
                for form in (a, L)
            )
        self.u = fem.Function(space, name="displacement") if u is None else u
        self._options = petsc_options_prefix, dict(petsc_options or {})
        self._forms, self._named = (a, L), (facets, masters)
        self._law, self._parts = law_of(stress, self.u), parts_of(materials, space.mesh)
        self._boundaries = boundaries_of(boundaries, space.mesh)
        self._stresses: RawStresses | None = None
        self._names = [f"contact {k}" for k in range(len(facets))]
        self._foundations = self._foundations_class(space, self.contact, facets, self._names, Inventory(), masters)
        self._foundations.check_driven(self.settings.algorithm)
        self._rigid: RigidBodies
        self.tools: tuple[RigidBodyMotion, ...] = ()
        self._memory, self._marks, self._cost = peak_memory(space.mesh.comm), 0, (0.0, 0.0)
        fields = self._fields = ContactFields.on(space, self._degree)
        self.pressure, self.shear, self.gap, self.slip = fields.pressure, fields.shear, fields.gap, fields.slip
        self.history = History()
        self.status: Status | None = None
        self.certificate: Certificate | None = None
        self.deformation: Deformation | None = None  # of the last solution, beside the limit of the settings
        self._last_pattern: tuple[bytes, bytes] | None = None
        self._boundary: ContactBoundary
        self._elastic: ElasticBody
        self._scales: Scales
        self._task: Task
        self._prescribed: tuple[npt.NDArray[np.bool_], Array]
        self._fallen: Array  # the displacement of the resting place that slips are counted from
        self._checkpoint: Any  # the iterate at the beginning of the last solve
        self._last: StepEnd | None = None  # at the last advance
        self._start: Start | None = None  # of the present step, in the frames of the present foundations
        self._previous_step: PreviousStep | None = None  # the end of the last step, as the present foundations see it
        self._solution: LastSolution | None = None  # from which the next solve may begin
        self._path: SolvedPath | None = None  # of the last ``run``, until the next solve
        self._outcome: Outcome | None = None
        self._state: ContactState | None = None
        self._coarser = CoarserMesh()
        self._first: Start | None = None  # where the first step starts, in these frames

    @property
    def _degree(self) -> int:
        """Of the contact fields."""
        return 1 if averaging(self._space) else int(self._space.element.basix_element.degree)

    @property
    def stress(self) -> RawStresses:
        """The stress of the last solution, raw and recovered, with the estimate of its error, see ``RawStresses``;
        collective.

        Raises:
            RuntimeError: the problem was given no ``stress``.
            FormError: this has another shape, or some strain has no stress.
        """
        if self._law is None:
            raise RuntimeError("only the form knows the stresses: give stress=, a function of the displacement")
        if self._stresses is None:
            y, fixed, touching = self.u.copy(), self._prescribed[0], [*self._named[0], *self._named[1].values()]
            self._stresses = stresses_of(self._law, y, self._parts, self._forms, touching, fixed)
        return self._stresses

    @property
    def errors(self) -> Errors:
        """Estimated errors of the last solution: of the displacement and of the contact pressure, relative; collective.

        What the mesh does not resolve of loads, gap and friction is not among them.

        Raises:
            RuntimeError: the problem was given no ``stress``.
            FormError: see ``stress``; or the forms are multiplied by a measure, which the estimate does not know.
        """
        stress, outcome = self.stress, self._outcome
        if any(getattr(contact, "measure", None) is not None for contact in self.contact):
            raise FormError([("stress", "there is no error estimate where the forms are multiplied by a measure")])
        assert outcome is not None
        return errors_of(stress, self.u, self.state, self._named[0], self._names, outcome, self._scales.modulus)

    def price_list(self, *coarser: ContactProblem) -> list[Price]:
        """Errors and costs of the last solve here and on coarser meshes, and those expected of the next; collective.

        Args:
            coarser: the same problem on coarser meshes, solved, the coarsest first; at least one.

        Raises:
            RuntimeError: see ``errors``; or a problem has no solution.
            FormError: see ``errors``.
        """
        return price_list([problem._level(k) for k, problem in enumerate((*coarser, self))], coarser[0]._memory)

    def _level(self, number: int) -> LevelResult:
        """The errors and the cost of the last solve; collective."""
        if self._outcome is None or self.status is not Status.CONVERGED:
            raise RuntimeError("there is no solution: a price list needs one on each mesh")
        errors = self.errors
        return level_result(
            number,
            self._elastic,
            self._task,
            self._outcome,
            errors.size,
            errors,
            contact_table(self.state, self._names),
            own=self.history.iterations[self._marks :],
            cost=self._cost,
            contacts=[self.state],
        )

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is to be known about the last solution: that its law is not the one asked for, friction laws of a
        user's own that are not what they say at its pressures, contact nodes that supports hold inside their
        foundation, which are left out of the contact, and shapes that lie inside the deformed body; collective.
        """
        warnings, outcome, certificate = list[Finding](), self._outcome, self.certificate
        if outcome is not None and certificate is not None and self.status is Status.CONVERGED:
            parameters = used_parameters(outcome, outcome.problem.data, certificate.strain_energy)
            warnings = asked_law(self.settings, {1: certificate}, parameters.get("regularisation_error")).findings
        held = held_in_result(self.state, self.u, self._foundations.pairs)
        pushed = pushed_nodes(self._space.mesh.comm, [held], self._scales.size)
        inside = shapes_in_results(self._foundations.placed_shapes, self.u)
        return (*warnings, *self._doubtful_laws(), *pushed, *inside)

    def _doubtful_laws(self) -> list[Finding]:
        """See ``laws_in_results``; collective."""
        return laws_in_results(self._data, self._begun.law, self._state, self._scales.modulus)

    @property
    def solver(self) -> PETSc.SNES:
        """The SNES of the semi-smooth Newton method, for monitors and options; set up if it is not yet; collective."""
        with options.applied(*self._options):
            if self._last_pattern is None:
                self._update()
            return self._task.iterate.newton.snes

    def fields_of(self, number: int) -> ContactFields:
        """The fields of one foundation alone, new Functions: at its end a node may belong to another one, too."""
        fields = ContactFields.on(self._space, self._degree)
        fields.take(self._space, self.state, self._boundary.part == number)
        return fields

    @property
    def state(self) -> ContactState:
        """The contact points of this rank after the last solve, with forces and areas."""
        if self._state is None:
            raise RuntimeError("there is no solution so far: call solve()")
        return self._state

    def solve(self) -> fem.Function:
        """Solve with the values that constants, Functions and conditions have now; collective.

        Returns:
            ``u``.

        Raises:
            ConvergenceError: no solution was reached; ``status`` says why, and ``u`` is the last iterate.
            FormError: a value is not finite, or cannot be evaluated.
        """
        begin, self._marks, self._path = time.perf_counter(), len(self.history.iterations), None
        self._timings = Timings()
        with options.applied(*self._options), self._timings.phase("solve"):
            self._begun = self._begin()
            self._take(solve_task(self._task, self._begun))
        self._cost = time.perf_counter() - begin, peak_memory(self._space.mesh.comm)
        status = self.status
        if status is not None and status is not Status.CONVERGED:
            told = [f"{finding.path}: {finding.message}" for finding in self._doubtful_laws()]
            raise ConvergenceError(self, "\n".join([f"{status.value}: {status.advice}", *told]))
        return self.u

    def _begin(self) -> Start:
        """Where a solve begins with what the problem is now; collective."""
        data, law = self._update()
        begun = self._start
        moved = self._foundations.moved(self._boundary)  # slip is relative to the foundation
        drift = 0.0 if moved is None else np.einsum("nij,ni->nj", self._boundary.tangents, moved)
        if begun is None:  # slip counts from the body without loads, and the shapes as they were given
            self._previous_step = None
            if moved is not None:
                at_rest = PreviousStep(fem.Function(self._space), Tractions.none(self._boundary))
                self._previous_step = replace(at_rest, moved=moved)
                data = replace(data, slip_origin=np.asarray(drift))
            data = data if (resting := self._task.rest) is None else resting.data_from(data)
            begun = self._first_start(Start(data, law, ActiveSets.all_in_contact(*data.mu_hat.shape), 0))
        else:  # friction is that of the pressure with which the last step has ended
            assert begun.multipliers is not None
            assert self._last is not None
            assert begun.data.slip_origin is not None
            gap = data.gap if (resting := self._task.rest) is None else resting.data_from(data).gap
            bound, origin = None if law is None else law.bound(begun.multipliers[0]), begun.data.slip_origin + drift
            self._previous_step = relative_to(
                self._last.before, self._last.boundary, self._boundary, moved, self._spin(self._boundary)
            )
            begun = replace(
                begun,
                data=replace(begun.data, gap=gap, bound=bound, slip_origin=origin, immovable=data.immovable),
                law=law,
            )
        begun = replace(begun, factors=np.ones(1))
        self._checkpoint = self._task.iterate.newton.checkpoint()
        return begun if self._solution is None else self._solution.begins(begun, self._boundary)

    def _first_start(self, start: Start) -> Start:
        """From a coarser mesh, as long as there is no solution; collective."""
        if self._solution is not None:
            return start
        first = self._first
        if first is None:
            coarser = self._coarser
            first = self._first = first_start(self._task, start, self._elastic, coarser.state, coarser.displaced)
        return replace(start, sets=first.sets, iteration=first.iteration, multipliers=first.multipliers)

    def _beginning(self) -> StepBeginning:
        last, start, previous, solution = self._last, self._start, self._previous_step, self._solution
        return StepBeginning(last, start, previous, solution, self._foundations.settled, self._boundary)

    def _go_back(self, beginning: StepBeginning) -> None:
        """The next solve begins there, with the foundations where they are."""
        if self._boundary is not beginning.boundary:  # in whose frames that beginning is
            self._last_pattern = None
        self._last, self._start, self._previous_step = beginning.last, beginning.start, beginning.previous
        self._solution, self._foundations.settled = beginning.solution, beginning.settled

    def _load(self) -> None:
        """Give the present contact problem the loads and prescribed displacements of now; collective."""
        assert self._last_pattern is not None
        self._prescribed = _, values = prescribed(self._space, conditions_of(self.bcs, self._space))
        self._rigid = self._foundations.rigid_bodies
        pattern, last = self._last_pattern
        fingerprint = digest(self._L, values, *self._rigid.driven_by)
        if parallel.any_rank(self._space.mesh.comm, fingerprint != last):
            self._task.system.set_case(0, self._case(values))
            self._last_pattern = pattern, fingerprint

    def run(
        self,
        path: LoadPath | Sequence[float],
        at: Callable[[float], object] | fem.Constant,
        *,
        folder: str | Path | None = None,
        restart: bool = False,
        on_step: Callable[[StepResult], object] = lambda step: None,
    ) -> SolvedPath:
        """Solve load steps, with ``advance`` between them; collective.

        A ramp takes smaller increments where there is no solution.  The problem is left at the last load step, from
        which another run goes on after ``advance``.

        Args:
            path: the times, one load step each, or a ``LoadPath``, which may be a ramp.
            at: changes the problem to what it is at a time, which may also be an earlier one than the last; or a
                Constant that takes the time.
            folder: in which every load step is stored as soon as it is complete; None: nowhere.
            restart: go on from what an earlier run of the same program has stored there, on any number of ranks.
            on_step: called with the result of each load step that has a solution; in a ramp that begins again with the
                first one anew.

        Raises:
            ConvergenceError: a load step has no solution; the ``solution`` of the error has those before it.
            FormError: see ``solve``; or an argument is wrong, or the folder is that of another problem.
        """
        clock, path = Clock(at), path if isinstance(path, LoadPath) else LoadPath(tuple(path))
        if restart and folder is None:
            raise FormError([("restart", "needs the folder of the checkpoint")])
        if folder is not None:
            clock.turn(path.time_at(0))  # the checkpoint is that of the Constants at this time
        stored = None if folder is None else MeshCheckpoint(self._checkpoint_in(folder, path, restart=restart), 0)
        solved = self._run(path, clock, on_step, stored)
        if not solved.converged:
            raise ConvergenceError(solved, solved.outcome())
        return solved

    def _run(
        self, path: LoadPath, clock: Clock, on_step: Callable[[StepResult], object], stored: MeshCheckpoint | None
    ) -> SolvedPath:
        """See ``run``."""
        begin, self._marks, timings = time.perf_counter(), len(self.history.iterations), Timings()
        follows = any(getattr(contact.friction, "follows_pressure", False) for contact in self.contact)
        increments = Increments(path, self.settings, has_coulomb=follows)
        with options.applied(*self._options):
            clock.turn(path.time_at(increments.next))
            with timings.phase("assemble"):
                start = self._begin()
            steps = FormSteps(self, path, clock, timings, self._beginning())
            progress = all_load_steps(steps, self._task, start, increments, lambda step: on_step(step.result), stored)
        self._cost = time.perf_counter() - begin, peak_memory(self._space.mesh.comm)
        self._path = SolvedPath(path, tuple(progress.results), self.history, timings, increments.bracket)
        return self._path

    def _checkpoint_in(self, folder: str | Path, path: LoadPath, *, restart: bool) -> Checkpoint:
        comm, mesh, dofmap = self._space.mesh.comm, self._space.mesh, self._space.dofmap
        described = {
            "path": asdict(path),
            "settings": self.settings.model_dump(mode="json"),
            "contact": [type(contact).__name__ for contact in self.contact],
            "constants": constants_of((self._a, self._L), self.contact),
            "cells": mesh.topology.index_map(mesh.topology.dim).size_global,
            "unknowns": dofmap.index_map.size_global * dofmap.index_map_bs,
        }
        opening = comm, folder, described, self.history
        try:
            return open_checkpoint(*opening, restart=restart, several_steps=path.several)
        except SceneError as error:
            raise FormError(error.problems, "run") from None

    def advance(self) -> None:
        """End a step of an own time loop: friction acts on what the next solve adds to the slip, from the shear of the
        last one, which turns with directions that change.  Solves before the next call
        start from here, whatever was tried between.

        Raises:
            RuntimeError: the last solve has no solution.
        """
        if self._outcome is None or self.status is not Status.CONVERGED:
            raise RuntimeError("there is no solution to advance from")
        law = Law(*self._task.promised(self._outcome))
        self._start = replace(self._outcome.next_step(self._begun), place=0.0)
        normal = self._outcome.problem.system.contact.traces(self._outcome.newton.x)[0]
        previous = PreviousStep.of(self.u.copy(), Tractions.of(self.state), law, self._previous_step, self.tools)
        self._last = StepEnd(self._start, self._task.rest, normal, self._boundary, previous)
        self._foundations.settle()

    def gradient(self, of: Any, by: Any) -> Gradient:
        """Derivatives of a result of the last solve by Constants of the problem, by one adjoint solve; collective.

            problem.gradient(of=u[1] * ds(top), by=[young, friction])

        Args:
            of: a UFL form of ``u`` without arguments; or a quantity as scenes have it, of a contact by name or number:
                ``"force 0 y"``, ``"moment 0 z"``, ``"pressure 0 8"``, ``"area 0 2"``, ``"mean top y"``.
            by: Constants with one value in the forms, the conditions, or the foundations.

        Raises:
            RuntimeError: there is no solution, or the result depends on what was there before ``advance``.
            FormError: an argument is wrong.
        """
        if self._outcome is None or self.status is not Status.CONVERGED:
            raise RuntimeError("there is no solution to differentiate")
        if self.tools:
            raise RuntimeError("derivatives by what moves a foundation are those of scenes")
        _, law = self._point_data(self._foundations.shapes())
        solved = self._elastic, self._task, self._outcome, self._begun, self.state, self.u, law
        return add_on("gradient")(of, by, lambda: named_body(self), solved, self._data_now)

    def _data_now(self) -> tuple[Any, ...]:
        """The problem with the values that Constants have now, as derivatives take it; collective."""
        shapes, fixed = self._foundations.shapes(), self._elastic.fixed
        boundary = self._boundary
        if any(shape.factor is not None or shape.direction is not None for shape in shapes):
            boundary = self._foundations.boundary(shapes, fixed, at_rest=self._foundations.at_rest(*self._prescribed))
        settings = Settings.of(self.settings)
        data, law = self._foundations.problem(boundary, self._foundations.data(shapes), settings, self._scales)
        values = prescribed(self._space, conditions_of(self.bcs, self._space))[1][: fixed.size]
        return [self._a], assemble(self._L), values, boundary, data.gap, law

    def place(self, number: int, **placement: Any) -> None:
        """Turn and move a foundation that has a shape, for the next solve and those after it.

        Gap and normals are those of the new place.  After ``advance`` friction acts on the slip relative to the
        foundation, which moves with its points.  One that forces move is driven by others instead.

        Args:
            number: of the foundation in ``contact``.
            placement: its shift, rotation and pivot, or its force, moment and prescribed components, see
                ``scene.rigid_shape.Shape``; what is left out stays.

        Raises:
            FormError: it has no shape, or the placement is wrong.
        """
        self._foundations.place(number, placement)

    def _take(self, outcome: Outcome) -> None:
        """Make a result the one that the user sees, and certify it; collective."""
        self.u.x.array[:] = self._elastic.function(outcome.displacement()).x.array
        if self._task.rest is not None:
            self.u.x.array[:] += self._fallen
        self._outcome, self._stresses = outcome, None
        self.tools = self._rigid.moved(self._elastic.driven(outcome.displacement(), self._task.rest))
        state = self._state = self._elastic.state(self._task, outcome, self._begun)
        self._fields.take(self._space, state)
        self.certificate = self._judged(outcome)
        self.status = outcome.status
        if self.certificate is not None:
            self.deformation = deformation_of(self._elastic, self.u, self._scales.size)
            self.status = judged_status(outcome.status, self.certificate, self.deformation, self.settings)
        if self.status is not Status.CONVERGED:  # the next solve begins where this one has begun
            self._task.iterate.newton.restore(self._checkpoint)
        else:
            self._solution = LastSolution.of(outcome, self._begun.step, self._boundary)

    def _update(self) -> tuple[RegularisedData, PointFriction | None]:
        """Assemble what has changed since the last solve, and evaluate gap and friction; collective."""
        space, comm = self._space, self._space.mesh.comm
        self._prescribed = fixed, values = prescribed(space, conditions_of(self.bcs, space))
        shapes = self._foundations.shapes()
        geometry = [values for shape in shapes for values in (shape.factor, shape.direction) if values is not None]
        at_rest = self._foundations.at_rest(fixed, values)
        rigid = self._rigid = self._foundations.rigid_bodies
        fingerprints = (
            digest(self._a, fixed, at_rest, *geometry, rigid.fixed, *self._beside()),
            digest(self._L, values, *rigid.driven_by),
        )
        last, self._last_pattern = self._last_pattern, None  # until all that follows has gone well
        if last is None or parallel.any_rank(comm, fingerprints[0] != last[0]):
            self._set_up(shapes)
            self._outcome = None  # its iterate is that of another system
        elif parallel.any_rank(comm, fingerprints[1] != last[1]):
            self._task.system.set_case(0, self._case(values))
        data = self._point_data(shapes)
        self._last_pattern = fingerprints
        return data

    def _set_up(self, shapes: Sequence[ShapeDistances]) -> None:
        """Contact points, stiffness and linear algebra; collective."""
        space, (fixed, values) = self._space, self._prescribed
        free_unused(space.mesh)
        owned = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
        at_rest = self._foundations.at_rest(fixed, values)
        boundary = self._rigid.on(self._foundations.boundary(shapes, fixed[:owned], at_rest=at_rest))
        counts = np.bincount(boundary.part[~boundary.points.immovable], minlength=len(shapes))
        for k, count in enumerate(parallel.global_sum(space.mesh.comm, counts)):
            if count == 0:
                wrong = "bcs prescribe the displacement along the normal at all of its points, or measure is zero"
                raise FormError([(f"contact[{k}]", wrong)])
        resting = None
        if self._last is not None:
            # A body that has fallen may have been taken hold of since: then it is counted from the initial position.
            fallen = self._last.rest is not None and bool(self._fallen[fixed].any())
            held, spin = parallel.any_rank(space.mesh.comm, fallen), self._spin(boundary)
            self._start, resting = self._last.seen_from(boundary, held=held, spin=spin)
        self._boundary, self._first = boundary, None
        elastic = self._elastic = self._body(fixed[:owned], boundary)
        self._scales = scales_of(elastic, boundary, self._foundations.facets)
        task = elastic.task(
            [self._case(values)],
            np.ones(1),
            *self._point_data(shapes),
            coarser=self._coarser.level,
            natural_gamma=self._scales.gamma,
            history=self.history,
            has_coulomb=any(
                contact.friction is not None and contact.friction.follows_pressure for contact in self.contact
            ),
        )
        if self._start is None:
            resting = task.rest
            self._fallen = np.zeros(0) if resting is None else elastic.motions.displacement(resting.motion).ravel()
        self._task = replace(task, rest=resting)

    def _case(self, values: Array) -> LoadCase:
        """See ``case_of``."""
        return case_of(self._elastic, self._forces(), values, self._rigid.driven_together)

    def _body(self, fixed: npt.NDArray[np.bool_], boundary: ContactBoundary) -> ElasticBody:
        """See ``elastic_body``."""
        return elastic_body(self._space, self._a, self.bcs, fixed, boundary, self.settings)

    def _forces(self) -> Array:
        """The right-hand side without what is prescribed, shape (owned dofs,); collective."""
        return assemble(self._L)

    def _spin(self, boundary: ContactBoundary) -> Array | None:
        """By which rotation the foundation of each point has turned since ``advance``, shape (n, d, d); None: by none
        that counts.
        """
        return None

    def _beside(self) -> Sequence[npt.NDArray[Any]]:
        """What the matrix is made of beside ``a`` and ``bcs``."""
        return ()

    def _judged(self, outcome: Outcome) -> Certificate | None:
        """The certificate of a result; None: its owner makes another one; collective."""
        return judged(
            self.u,
            balance_of((self._a, self._L), self.u, *self._prescribed, self._scales),
            sides_of(self._data, self.contact, self._named, self._space),
            Tractions.of(self.state),
            law=Law(*self._task.promised(outcome)),
            before=self._previous_step,
            rigid=[*zip(self.tools, self._rigid.drives(), strict=True)],
        )

    def _point_data(self, shapes: Sequence[ShapeDistances]) -> tuple[RegularisedData, PointFriction | None]:
        """Gap, friction and regularisation at the contact points, as they are now; collective."""
        self._data = self._foundations.data(shapes)
        return self._foundations.problem(self._boundary, self._data, Settings.of(self.settings), self._scales)
