"""``NonlinearContactProblem``: contact and friction for anybody's residual, in the idiom of dolfinx's
``NonlinearProblem``.

Newton's method for the body has the semi-smooth method for contact inside: each of its iterations is a linear
``ContactProblem`` for the whole displacement, see ``linearised``.  Contact pressure and friction are those of the new
displacement, so the old ones only enter through the curvature of the shapes.  A line search follows
d . (R(u + s d) + B^T (lambda, mu)), the slope of the energy with contact where there is one; it needs no energy
(P. Wriggers, Computational Contact Mechanics, 2006, chapter 10).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.errors import FormError
from signorini_fx.forms.arguments import foundations_of
from signorini_fx.forms.elasticity import MatrixError, MatrixFault
from signorini_fx.forms.nonlinear import outcomes
from signorini_fx.forms.nonlinear.arguments import checked
from signorini_fx.forms.nonlinear.displaced_certificate import certified, mechanics_at
from signorini_fx.forms.nonlinear.displacement_control import (
    Control,
    ControlSteps,
    SnapThrough,
    alike,
    load_that_holds,
)
from signorini_fx.forms.nonlinear.leaps import Leaps
from signorini_fx.forms.nonlinear.line_search import length_of_increment
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.forms.nonlinear.mechanics import ResidualMechanics
from signorini_fx.forms.nonlinear.moving_pairs import alternating_points
from signorini_fx.forms.nonlinear.moving_shapes import MovingShape, fitting, hessians_at, motion_at, place, spin_at
from signorini_fx.forms.nonlinear.overlap import overlap, overlap_of_bodies
from signorini_fx.forms.nonlinear.quadrature_rules import refuse_miscompiled
from signorini_fx.forms.nonlinear.residual import Residual
from signorini_fx.forms.nonlinear.restart import RestartedBody
from signorini_fx.forms.nonlinear.results import SolvedBody
from signorini_fx.forms.nonlinear.snapshot import Snapshot
from signorini_fx.forms.nonlinear.stability import Stability
from signorini_fx.forms.nonlinear.step_sizes import LoadSizes, PathSizes, RampStep, Way
from signorini_fx.forms.nonlinear.tangent import Tangents, round_off
from signorini_fx.forms.problem_of_forms import ProblemOfForms
from signorini_fx.forms.results import findings_of_last
from signorini_fx.forms.steps import begun_path
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.body.averages import averaging
from signorini_fx.mechanics.body.contact_state import ContactState
from signorini_fx.mechanics.body.foundation import Foundation, Pair
from signorini_fx.mechanics.body.node_positions import node_positions
from signorini_fx.mechanics.body.rigid_bodies import RigidBodyMotion
from signorini_fx.mechanics.body.shapes_inside import BodyCells
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.mechanics.statement.load_steps import LoadPath
from signorini_fx.records import Finding, History, Status, StepRecord, Timings
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.certificate.promised_law import Tractions
from signorini_fx.results.mechanics import NO_ESTIMATE
from signorini_fx.results.solution import ConvergenceError, Solution, StepResult
from signorini_fx.solving.load_steps import Marks, Stepping
from signorini_fx.solving.restart import MeshCheckpoint
from signorini_fx.tuned import LEAST_INCREMENT, LOAD_DIFFERENCE, SMALL_INCREMENT, SMALLEST_STEP

Array = npt.NDArray[np.float64]
# Iterations of Newton's method, unless it is said otherwise.
MOST_ITERATIONS = 30


class NonlinearContactProblem(ProblemOfForms):
    """Find u with F(u; v) = 0 for all v, and contact with rigid foundations or of two bodies on parts of the boundary.

        problem = NonlinearContactProblem(F, u, bcs=[fixed], contact=Foundation(facets, shape=circle))
        problem.ramp(lambda t: problem.place(0, shift=(0.0, -0.3 * t)))

    A foundation with a ``shape`` is met at the displaced points, however far they slide on it, and its friction is
    relative to it; gaps and directions without a shape are those of the undeformed boundary.  Pressures, shears and
    bounds of friction are per area of the undeformed boundary.  Friction depends on the path: ``advance`` ends a step.

    The sides of a ``Pair`` slide on each other, in space with degree 1: its points see the other side at displaced
    places, half-way between the normals of both, and slip along it over any number of facets.

    Args:
        F: the residual, a UFL form with one argument, nonlinear in ``u``.
        u: the Function that takes the solution, in a vector Lagrange space of degree 1 or 2; its values are the first
            iterate.
        bcs: Dirichlet conditions as dolfinx makes them; their values may change between two solves.
        contact: the foundations, and pairs of sides of the mesh.
        J: the tangent, a form with two arguments, UFL or compiled; None: the derivative of ``F``.  Where it is not
            symmetric, as that of loads that follow the body, it is factorised as a whole.
        update: called before anything is assembled at new values of ``u``, such as to return stresses to a yield
            surface, from the state of the last ``commit``.  Where it raises an exception the increment is shortened.
        commit: called by ``advance``: the state at ``u`` is that from which the next step starts.
        petsc_options_prefix: see ``ContactProblem``.
        petsc_options: see ``ContactProblem``.
        form_compiler_options: see ``dolfinx.fem.form``.
        jit_options: see ``dolfinx.fem.form``.
        stability: whether the inertia of the tangent is looked at after each solve, one more factorisation; then
            *converged* means that the equilibrium is stable.  The verdict is that of the derivative of ``F``: a ``J``
            that differs from it, tried by a difference, only leads Newton's method.
        max_newton: iterations of Newton's method.
        boundaries: see ``ContactProblem``.
        settings: algorithm, coulomb, ..., see ``SolverSettings``.

    Attributes:
        u: the solution.
        contact: the foundations and pairs.
        pressure, shear, gap, slip: see ``ContactFields``.
        status: how the last solve ended; None before the first one, and after an error.
        certificate: the check of the last solution against F and the shapes; None before the first solve.
        iterations: of Newton's method in the last solve.
        history: every linear solve of all solves so far, those of solves that have failed too.

    After a failure ``u``, ``pressure``, ``state``, ``certificate`` and all others are those of the last solution again,
    and ``update`` has been called there.

    Raises:
        FormError: an argument is wrong.
        MachineError: a form cannot be compiled.
    """

    def __init__(
        self,
        F: Any,
        u: fem.Function,
        *,
        bcs: Sequence[fem.DirichletBC] = (),
        contact: Sequence[Foundation | Pair] | Foundation | Pair = (),
        J: Any = None,
        update: Callable[[], object] | None = None,
        commit: Callable[[], object] | None = None,
        petsc_options_prefix: str = "sfx_",
        petsc_options: Mapping[str, Any] | None = None,
        form_compiler_options: dict[str, Any] | None = None,
        jit_options: dict[str, Any] | None = None,
        stability: bool = True,
        max_newton: int = MOST_ITERATIONS,
        boundaries: Mapping[str, Any] | None = None,
        **settings: Any,
    ) -> None:
        self.u, self.contact = u, checked(F, u, J, foundations_of(contact), update, commit, max_newton, settings)
        self._commit = commit or (lambda: None)
        self._max_newton, self._asks_stability = max_newton, stability
        space = self._space = u.function_space
        self._dimension = int(space.mesh.geometry.dim)
        options: dict[str, Any] = {"form_compiler_options": form_compiler_options, "jit_options": jit_options}
        self._tangents = Tangents(F, J, u, options)
        with compiling():
            residual = fem.form(F, **options)
        refuse_miscompiled(F, residual, u, options)
        self._residual = Residual(residual, u, update or (lambda: None))
        shaped = [k for k, entry in enumerate(self.contact) if entry.shape is not None]
        self.linear = LinearisedProblem(
            self._tangents.leading,
            residual,
            self._residual,
            u,
            bcs,
            [self._seen(k) if k in shaped else entry for k, entry in enumerate(self.contact)],
            petsc_options_prefix=petsc_options_prefix,
            petsc_options=dict(petsc_options or {}),
            boundaries=boundaries,
            **settings,
        )
        self.shapes = {k: self._shape_of(k) for k in shaped}
        self.linear.begin(
            lambda boundary: motion_at(boundary, self.shapes, self._places),
            lambda boundary: spin_at(boundary, self.shapes),
            self.shapes,
        )
        fields = self.linear.fields
        self.pressure, self.shear, self.gap, self.slip = fields.pressure, fields.shear, fields.gap, fields.slip
        self._fields = self.pressure, self.shear, self.gap, self.slip
        bounds = parallel.global_bounds(space.mesh.comm, space.mesh.geometry.x.astype(np.float64))
        self._size = float(np.linalg.norm(np.ptp(bounds, axis=0)))
        self.status: Status | None = None
        self.certificate: Certificate | None = None
        self.iterations = 0
        self._good: Snapshot | None = None  # the last solution, once there was a solve
        self._stability = Stability(u, self.linear, self._tangents, self._forces_at, self._bend)
        self._cells = BodyCells.of(space, space.mesh.geometry.dim)
        self._overlap = ""  # where a shape was inside the body in the last solve
        self._failure = ""  # how the last solve failed that did
        self._tangent_at = u.x.array.copy()  # the displacement of the last iteration
        self._tools_at = self.linear.moving_tools.coordinates  # where tools were in it
        self._predicted = 0.0  # how far the first tangent of the last solve moves the body
        self._leaps = Leaps(update is not None)  # of the last ramp
        self._inner = ""  # how the last contact problem of a tangent ended that had no solution
        self._solved: SolvedBody | None = None  # the last solution
        self._ramped: list[StepResult] = []  # the steps of the last ramp, until the next solve
        self._mechanics_of_steps: list[tuple[fem.Function, ResidualMechanics]] = []
        self._timings = Timings()  # of the last solve or ramp

    @property
    def bcs(self) -> Any:
        """The Dirichlet conditions; the list may change between two solves."""
        return self.linear.bcs

    @bcs.setter
    def bcs(self, bcs: Any) -> None:
        self.linear.bcs = bcs

    @property
    def history(self) -> History:
        """Every linear solve of all solves so far."""
        return self.linear.history

    @property
    def state(self) -> ContactState:
        """The contact points of this rank after the last solve, with forces and areas of the undeformed boundary."""
        return self.linear.state

    @property
    def cost(self) -> str:
        """Why it is not known what a better accuracy would take, see ``Solution``."""
        return NO_ESTIMATE

    @property
    def solution(self) -> Solution:
        """The last solution with all that results are made of; after a ramp with all of its steps, whose times are the
        sizes of their loads.  Where the first step of a ramp has no solution it is the body as it was before, under the
        load of this step, and converged it is not; collective.

        Of what needs a strain energy (estimates of errors, bounds, uniqueness) it says that a nonlinear body has none.

        Raises:
            RuntimeError: there is none so far.
        """
        return self.titled("")

    def titled(self, title: str) -> Solution:
        """See ``ProblemOfForms``."""
        if self._solved is None:
            raise RuntimeError("there is no solution so far: call solve()")
        ended = self.status or Status.CONVERGED, self.findings
        spent, steps = (self.history, self._timings), self._ramped
        if self._solved.step.status is not Status.CONVERGED:
            steps = [self._solved.step]
        solution = self._solved.solution(self.linear.rigid, steps, ended, spent, title)
        return replace(solution, mechanics=replace(self._solved.mechanics, steps=tuple(self._mechanics_of_steps)))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is to be known about the last solution, see ``ContactProblem``; collective."""
        return () if self.linear.solved.state is None else (*self._leaps.findings, *findings_of_last(self.linear))

    @property
    def tools(self) -> tuple[RigidBodyMotion, ...]:
        """Where the foundations are that forces move: in the last solution, by how much they have moved."""
        return self.linear.moving_tools.motions

    @property
    def _places(self) -> Array:
        """Displacements of the nodes, shape (nodes, d)."""
        return self.u.x.array.reshape(-1, self._dimension)

    # --- shapes -------------------------------------------------------------------------------------------------------

    def _shape_of(self, number: int) -> MovingShape:
        """The shape of a foundation at its nodes."""
        entry, values = self._foundation(number), self.linear.nodal_values[number]
        x = node_positions(self._space)[values.nodes]
        turns = entry.measure is None and not averaging(self._space)
        shape = fitting(number, entry.shape, self._dimension, turns=turns)
        self.linear.check_shape(number, shape)
        added = values(entry.gap, f"contact[{number}].gap")[values.nodes]
        return MovingShape(shape, shape, added, values.nodes, x[:, : self._dimension].astype(np.float64), turns)

    def _foundation(self, number: int) -> Foundation:
        entry = self.contact[number]
        assert isinstance(entry, Foundation)
        return entry

    def _seen(self, number: int) -> Foundation:
        """A foundation with a shape as the linearised problem has it: a gap and a direction."""

        def seen() -> tuple[Array, Array]:
            moving = self.shapes[number]
            return moving.seen_from(self._places[moving.nodes])

        return replace(self._foundation(number), shape=None, gap=lambda x: seen()[0], direction=lambda x: seen()[1].T)

    def _bend(self) -> None:
        """Give the tangent the curvature of the shapes with the contact tractions of now; collective."""
        if (state := self.linear.solved.state) is not None:
            self.linear.bend(hessians_at(state.boundary, self.shapes, self._places, self._size))

    def place(self, number: int, **placement: Any) -> None:
        """Turn and move a foundation that has a shape, or change what drives it, for the next solve and those after it.

        A shape of a user's own needs ``placed(**placement)``, which returns another object, and ``moved_from(earlier,
        x)``, how far its points closest to x have moved since it was placed like ``earlier``, length, shape (n, d).

        Args:
            number: of the foundation in ``contact``.
            placement: its shift, rotation and pivot, see ``statement.rigid_shape.Shape``; of one that forces move
                its force, prescribed and spring, see ``statement.rigid_motion``; what is left out stays.

        Raises:
            FormError: it has no shape that can be placed, or the placement is wrong.
        """
        place(self.shapes.get(number), number, placement)

    # --- Newton's method ----------------------------------------------------------------------------------------------

    def solve(self) -> fem.Function:
        """Solve with the values that Constants, Functions, conditions and shapes have now, return ``u``; collective.

        Raises:
            ConvergenceError: no solution was reached; ``status`` says why, and all else is as the last solution was.
            FormError: a value is not finite, cannot be evaluated, or ``update`` raised an exception.
        """
        self._forget_steps()
        self._attempt()
        return self.u

    def _forget_steps(self) -> None:
        """Those of the last ramp, and what was shown of one whose first step had no solution."""
        self._ramped, self._mechanics_of_steps, self._timings = [], [], Timings()
        self._leaps, self._solves_before = Leaps(self._leaps.yields), len(self.history.iterations)
        if self._solved is not None and self._solved.step.status is not Status.CONVERGED:
            self._solved = None

    def _attempt(self, *, damps: bool = True) -> None:
        """``solve``; collective.

        Args:
            damps: whether no smaller step will be tried, so that the tangent is damped where nothing else helps, and a
                failure is asked why there may be no solution.
        """
        for number, moving in self.shapes.items():
            moving.check(number, self._space.mesh.comm)
        self._good = self._good or self._snapshot()
        self.certificate, self.status, self._says_no, self._overlap = None, None, "", ""
        solves = len(self.history.iterations)
        try:
            with self._timings.phase("iterate"):
                status = self._iterate(damps=damps)
            if status is Status.CONVERGED and self._asks_stability:
                status = self._stability.verdict()
            elif damps and status not in (Status.CONVERGED, *outcomes.NOT_BY_STIFFNESS) and not self._says_no:
                self._says_no = self._stability.reason_for_none(self._good.displacement, self._size)
        except Exception:
            self._go_back(self._good)
            raise
        self.status = status
        if status is Status.CONVERGED:
            self._take_solution(len(self.history.iterations) - solves)
            return
        self._failure = outcomes.failure(status, self.certificate, self._says_no, self._inner, self._overlap)
        self._go_back(self._good)
        raise ConvergenceError(self, f"{self._failure}: {self._advice_on(status)}")

    def _take_solution(self, solves: int) -> None:
        """What there is now is the last solution, after so many linear solves; collective."""
        self._good, foundations = self._snapshot(), (self.contact, self.shapes)
        assert self.certificate is not None
        self._solved = SolvedBody.of(self.linear, self.u, self.certificate, self._mechanics, foundations, solves)

    def _snapshot(self) -> Snapshot:
        """All that a solve changes, and where the shapes are."""
        return Snapshot.of(self.u, self._fields, self.linear, self.shapes, (self.certificate, self.iterations))

    def _go_back(self, snapshot: Snapshot) -> None:
        """Go back to the last solution; loads and shapes stay as they are now, but for tools that forces move;
        collective.
        """
        self.certificate, self.iterations = snapshot.restore(self.u, self._fields, self.linear)
        self.linear.moving_tools.carry_to(snapshot.tools)
        with suppress(FormError):  # before the first solution it may not be possible
            self._residual.updated()

    def _forces_at(self, values: Array) -> Array | None:
        """See ``Residual``; collective."""
        return self._residual.at(values)

    def _iterate(self, *, damps: bool) -> Status:
        """Newton's method from the present ``u``; ``damps``: whether its tangent may be damped; collective.

        It ends where increments are small and the certificate holds.  Where increments are small and it does not, as
        with a tangent that is not the derivative of F, iterations go on for as long as they make it better.  In a body
        that comes to rest without load increments are relative to nothing: with a J, which may be another tangent, the
        residual is round-off once they are no longer halved.
        """
        comm, u, worst, before = self._space.mesh.comm, self.u, np.inf, np.inf
        self.linear.begin_anew()
        residual: Array | None = None
        for iteration in range(1, self._max_newton + 1):
            self.iterations = iteration
            old = self._tangent_at = u.x.array.copy()
            self._tools_at = self.linear.moving_tools.coordinates
            residual = self._forces_at(old) if residual is None else residual
            if residual is None:
                return Status.INVERTED
            try:
                self.linear.slide()
            except PairingError as error:
                self._overlap = str(error)
                return Status.FOLDED
            self._bend()
            try:
                increment, length, residual = self._increment(old, residual, search=iteration > 1, damps=damps)
            except ConvergenceError as error:
                return self._not_solved(error.solution.status)
            except MatrixError as error:
                if error.fault is MatrixFault.NOT_FINITE:
                    return Status.NOT_FINITE
                raise
            if length == 0.0:
                return Status.INVERTED
            if iteration == 1:
                self._predicted = float(parallel.largest(comm, np.abs(increment), 0.0))
            u.x.array[:] = old + length * increment
            moved = length * (self.linear.reached - self._tools_at)
            self.linear.moving_tools.carry_to(self._tools_at + moved)
            change, size = (
                max(float(parallel.largest(comm, np.abs(values), 0.0)), float(np.abs(further).max(initial=0.0)))
                for values, further in ((length * increment, moved), (u.x.array, self._tools_at + moved))
            )
            small, least = change <= SMALL_INCREMENT * size, change <= LEAST_INCREMENT * self._size
            shortened, before = self._tangents.given and 2 * change < before, change
            if small or (least and not (shortened and iteration < self._max_newton)):
                status = self._judge()
                if status is not Status.NOT_CERTIFIED or self.certificate is None or not self.certificate.worst < worst:
                    return status
                worst = self.certificate.worst
        self._overlap = alternating_points(self.linear.pairs)
        return Status.MAX_ITERATIONS

    def _increment(
        self, old: Array, residual: Array, *, search: bool, damps: bool
    ) -> tuple[Array, float, Array | None]:
        """An increment, the share of it to take, and F there, see ``length_of_increment``; collective.

        Where the tangent is not definite on what contact admits, as beyond a limit point, the contact problem has no
        solution, or its solution goes up.  With enough of its diagonal added it goes down.

        Args:
            old: values of ``u``.
            residual: F there.
            search: see ``length_of_increment``.
            damps: see ``_iterate``.

        Raises:
            ConvergenceError: the contact problem has no solution.
            MatrixError: the tangent is not finite, or not symmetric.
        """
        linear = self.linear
        while True:
            linear.residual = residual
            try:
                linear.solve()
            except ConvergenceError as error:
                if damps and error.solution.status in outcomes.DAMPED and linear.damp():
                    continue
                raise
            finally:
                linear.residual = None
            increment = linear.u.x.array - old
            at = old, increment, residual
            length, forces, descends = length_of_increment(linear, self._forces_at, at, search=search)
            if descends or not damps or not linear.damp():
                linear.damp_less()
                return increment, length, forces
            self._forces_at(old)  # the next tangent is taken there, too

    def _not_solved(self, inner: Status) -> Status:
        """How a solve ends in which a linear contact problem has no solution: what is proved of that is not proved of
        the body.
        """
        if inner in outcomes.OF_LINEAR_BODIES:
            if self._stability.leads(self.u.x.array.copy()):
                self._says_no = f"the tangent does not hold it: {inner.value}"
            return Status.NOT_SOLVED
        self._inner = inner.value
        return Status.NOT_SOLVED if inner is Status.CYCLING else inner

    # --- what is said of a solution -----------------------------------------------------------------------------------

    def _judge(self) -> Status:
        """Whether an iterate is a solution: no shape is inside the body, and the certificate holds; collective."""
        linear, values = self.linear, self.u.x.array.copy()
        residual = self._forces_at(values)
        if residual is None:
            return Status.INVERTED
        assert self._good is not None
        self._overlap = overlap(self.u, self._cells, self.shapes, self._good)
        if self._overlap:
            return Status.INSIDE
        self._overlap = overlap_of_bodies(self.u, self._cells, linear.pairs, self._good)
        if self._overlap:
            return Status.PASSED
        try:
            linear.slide()
        except PairingError as error:
            self._overlap = str(error)
            return Status.FOLDED
        for pair in linear.pairs.values():
            if reached := pair.at_end(self.state):
                self._overlap = reached
                return Status.AT_END
        lost = round_off(self.u, residual, self._forces_at)
        self._forces_at(values)
        self.certificate, self._mechanics = self._certified(residual, lost)
        return Status.CONVERGED if self.certificate.holds else Status.NOT_CERTIFIED

    def _certified(self, residual: Array, lost: Array | None = None) -> tuple[Certificate, ResidualMechanics]:
        """The certificate of what there is now, with the forces that it is of; collective.

        Args:
            residual: F there.
            lost: see ``mechanics_at``.
        """
        linear, tractions = self.linear, Tractions.of(self.state)
        mechanics = mechanics_at(self.u, self._seen_anew(residual), linear, self.contact, self.shapes, lost)
        conditions = tractions, linear.law, linear.previous_step, linear.driven_tools
        return certified(self.u, mechanics, self.shapes, *conditions), self._loaded(mechanics)

    def _seen_anew(self, residual: Array) -> Array:
        """The residual as the certificate takes it: itself, as nothing else knows it; collective."""
        return residual

    def _loaded(self, mechanics: ResidualMechanics) -> ResidualMechanics:
        """With the loads that are not in F: there are none."""
        return mechanics

    # --- load steps ---------------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """End a step: friction acts on what the next solves add to the slip, and the state is that of ``u``.

        Raises:
            RuntimeError: the last solve has no solution.
        """
        if self.status is not Status.CONVERGED:
            raise RuntimeError("there is no solution to advance from")
        self.linear.tools = self.tools
        self.linear.advance()
        self._commit()
        for moving in self.shapes.values():
            moving.settled = moving.shape
        for pair in self.linear.pairs.values():
            pair.move(self.u)
            pair.settle()

    def ramp(
        self,
        apply: Callable[[float], object],
        to: float = 1.0,
        *,
        first: float | None = None,
        largest: float | None = None,
        smallest: float = SMALLEST_STEP,
        control: tuple[int, str] | None = None,
        on_step: Callable[[RampStep], object] = lambda step: None,
    ) -> list[RampStep]:
        """Raise the load from 0 in steps, with ``advance`` after each; collective.

        A step without a solution is halved, and begins again at the end of the last one; one that was easy makes the
        next larger.  Whatever ends the ramp, the problem is left at the last step that has a solution.

        Args:
            apply: changes the problem to what it is at a load; it may be called with a smaller one again.
            to: the load to reach, which may be negative.
            first: size of the first step; None: all of it.
            largest: size that any step may have; None: there is none.
            smallest: share of ``to`` below which no step is halved.
            control: a foundation that a force moves, and a component of its translation, such as ``(0, "y")``: beyond a
                limit point, which steps end at or jump over, this is prescribed and goes on as before, and the load,
                which may fall, is what holds it there, until it is ``to``.  The way beyond the limit point is not
                longer than the body.  None: a step without a solution ends the ramp, and others may jump.
            on_step: called after each step.

        Returns:
            The steps.

        Raises:
            ConvergenceError: a step cannot be shortened any more.  ``status`` is ``LIMIT`` where the tangent or the
                displacement says that there is no equilibrium, otherwise how the smallest step ends.  Or an
                equilibrium is unstable, or its stability is not known.
            FormError: an argument is wrong, or the smallest step ends with one, such as one of ``update``.
        """
        sizes, steps = LoadSizes(to, first, largest, smallest), list[RampStep]()
        tool = None if control is None else Control.of(control, self.shapes, self._dimension)
        places = [] if tool is None else [self._begins_to_move(tool, apply, sizes, LOAD_DIFFERENCE * to)]
        gone = [0.0]  # how far the load has gone, up and down

        def named(load: float, step: StepResult) -> StepResult:
            gone.append(gone[-1] + abs(load - (steps[-1].load if steps else 0.0)))
            steps.append(RampStep(load, self.iterations, step.linear_solves))
            if tool is not None:
                places.append(tool.position(self.shapes))
            return replace(step, place=float(step.step - 1), time=gone[-1])

        way = Way(sizes, apply, named, controlled=tool is not None)
        try:
            self._follow(way, lambda step: on_step(steps[-1]))
        except (ConvergenceError, SnapThrough):
            if tool is None or not steps or self.status in outcomes.NOT_A_LIMIT:
                raise
            self._beyond_limit(tool, way, to, places, lambda step: on_step(steps[-1]))
        return steps

    def _begins_to_move(
        self, tool: Control, apply: Callable[[float], object], sizes: LoadSizes, slightest: float
    ) -> float:
        """Where a tool is under hardly any load, once it has come to the body; collective.

        The first step, which no other tells from a jump, is halved until the tool gives way in both of its halves
        alike.

        Args:
            tool: whose translation will be prescribed.
            apply: see ``ramp``.
            sizes: of the steps.
            slightest: hardly any load.
        """
        begun, kept = self._snapshot(), (self._good, self._solved, self.status)

        def tried(load: float) -> tuple[float, float] | None:
            """Where the tool is, and what drives it there; None: there is no solution."""
            try:
                apply(load)
                self._attempt(damps=False)
                return tool.position(self.shapes), tool.drive(self.shapes)
            except (ConvergenceError, FormError):
                return None
            finally:
                self._begin_again(begun, partial(apply, 0.0))
                self._good, self._solved, self.status = kept

        start = tried(slightest) or (tool.position(self.shapes), 0.0)
        whole = tried(sizes.next)
        while sizes.may_halve:
            half = tried(sizes.next / 2)
            if alike(start, half, whole):
                break
            self.history.add(f"load {sizes.next:g} may be beyond a limit point: the first step is halved")
            sizes.halve()
            whole = half
        return start[0]

    def _beyond_limit(
        self, tool: Control, way: Way, to: float, places: list[float], on_step: Callable[[StepResult], object]
    ) -> None:
        """Steps of a ramp beyond a limit point, see ``ramp``; collective.

        Args:
            tool: whose translation is prescribed.
            way: of the ramp.
            to: see ``ramp``.
            places: where the tool was at the beginning and after each step, which ``way.named`` adds to.
            on_step: see ``Stepping``.

        Raises:
            ConvergenceError: an increment cannot be shortened any more, or the load is not reached.
            FormError: likewise, see ``load_that_holds``.
        """
        steps, load = ControlSteps(places, self._size), float(self._ramped[-1].time) * float(np.sign(to))
        largest = load
        self.history.add(f"beyond the limit point at load {load:g} {tool.key} of contact[{tool.number}] is prescribed")

        def solve() -> ContactState:
            with tool.held_at(steps.next, self.shapes):
                self._attempt(damps=not steps.may_halve)
            return self.state

        def load_at_next() -> float:
            holds = load_that_holds(tool, self.shapes, way.apply, solve, load, LOAD_DIFFERENCE * to, largest)
            if holds is None:
                self.status = Status.OUTER_MAX_ITERATIONS
                raise ConvergenceError(self, f"no load is found that holds contact[{tool.number}] at {steps.next:g}")
            if abs(holds) < abs(to) or holds * to <= 0:
                return holds
            way.apply(to)  # on a branch that carries it
            self._attempt()
            return to

        def solved() -> StepResult | None:
            nonlocal load
            begun = self._snapshot()
            try:
                load = load_at_next()
            except Exception as error:
                self._begin_again(begun, partial(way.apply, load))
                self.history.add(f"{tool.key} {steps.next:g} is given up, back at {places[-1]:g}: {error}")
                wrong = isinstance(error, FormError) and error.source == "ramp"  # an argument
                if wrong or not (isinstance(error, ConvergenceError | FormError) and steps.may_halve):
                    raise
                steps.halve()
                return None
            steps.accept(self.iterations)
            return self._end_step(way, load)

        Stepping(self.history, self._timings, lambda: load == to or steps.ended, solved).all(on_step)
        if load != to:
            self.status = Status.LIMIT
            reached = f"{tool.key} of contact[{tool.number}] was moved to {places[-1]:g}, where load {load:g} holds it"
            raise ConvergenceError(self, f"{Status.LIMIT.value}: {reached}; load {to:g} is not reached")

    def run(
        self,
        path: LoadPath | Sequence[float],
        at: Callable[[float], object] | fem.Constant,
        *,
        folder: str | Path | None = None,
        restart: bool = False,
        on_step: Callable[[StepResult], object] = lambda step: None,
    ) -> Solution:
        """Solve load steps, with ``advance`` between them; collective.

        A step without a solution is halved, be it that of a ramp or not, and begins again at the end of the last one;
        the first one begins at time 0.  Whatever ends the path, the problem is left at the last step that has a
        solution.

        Args:
            path: the times, one load step each, or a ``LoadPath``, whose ramp takes the steps that it asks for.
            at: changes the problem to what it is at a time, which may also be an earlier one than the last; or a
                Constant that takes the time.
            folder: in which every load step is stored as soon as it is complete, each run in one of its own; None:
                nowhere.
            restart: go on from what an earlier run of the same program has stored there, on any number of ranks;
                ``commit`` is called at the end of each of its load steps again.
            on_step: called with the result of each load step.

        Raises:
            ConvergenceError: see ``ramp``; the ``solution`` of this problem has the load steps before.
            FormError: see ``ramp``; or the folder is that of another problem or run.
        """
        path, clock, stored = begun_path(self.linear, path, at, folder, restart=restart)
        self._run(path, lambda step: clock.turn(path.time_at(step)), on_step, stored)
        return self.solution

    def _run(
        self,
        path: LoadPath,
        apply: Callable[[float], object],
        on_step: Callable[[StepResult], object],
        checkpoint: MeshCheckpoint | None = None,
    ) -> None:
        """``run`` by places instead of times; for the arguments see ``Way``; collective."""

        def named(end: float, step: StepResult) -> StepResult:
            return replace(step, place=end, time=path.time_at(end), name=path.name_at(end))

        def announce(end: float) -> None:
            number = len(self._ramped) + 1
            self.history.move(step=number, steps=len(path.times))
            if path.several:
                self.history.add(StepRecord(number, path.name_at(end), path.time_at(end)))

        self._follow(Way(PathSizes(path), apply, named, announce), on_step, checkpoint)

    def _follow(
        self, way: Way, on_step: Callable[[StepResult], object], checkpoint: MeshCheckpoint | None = None
    ) -> None:
        """Solve the steps of a way, see ``Stepping``; collective.

        Raises:
            ConvergenceError: one has no solution, and no smaller one is to be tried.
            FormError: likewise.
            SnapThrough: a step may jump, and must not.
        """
        self._forget_steps()
        stepping = Stepping[StepResult](
            self.history,
            self._timings,
            ended=lambda: way.sizes.ended,
            solved=partial(self._next_step, way),
            recalled=partial(self._recall, way),
            store=partial(self._store, way),
        )
        stepping.all(on_step, checkpoint)

    def _next_step(self, way: Way) -> StepResult | None:
        """Solve the next step of a way; None: it has no solution and will be another one; collective.

        Raises:
            Exception: see ``_follow``.
        """
        begun, sizes = self._snapshot(), way.sizes
        end = sizes.next
        try:
            way.announce(end)
            way.apply(end)
            self._attempt_at_step(way, begun)
        except Exception as error:
            self._give_up(way, begun, error)
            return None
        sizes.accept(self.iterations, grows=self._leaps.end is None)
        return self._end_step(way, end)

    def _attempt_at_step(self, way: Way, begun: Snapshot) -> None:
        """Solve a step, with the problem as it is at its end; collective.

        Args:
            way: that of the step.
            begun: the body when it begins.

        Raises:
            ConvergenceError: it has no solution.
            SnapThrough: it may jump, and must not.
        """
        sizes, last_solution = way.sizes, (self._good, self._solved, self.status)
        begin, end = sizes.reached, sizes.next
        self._attempt(damps=not sizes.may_halve)
        moved = float(parallel.largest(self._space.mesh.comm, np.abs(self.u.x.array - begun.displacement), 0.0))
        predicted = max(self._predicted, SMALL_INCREMENT * self._size)
        if not self._leaps.suspects(moved, predicted, begin, end, large=sizes.large):
            self._leaps.pass_by(begin, end)
        elif sizes.jumps or not (self._ends_before_jumps(way) or sizes.may_halve):
            self._leaps.take(f"{sizes.kind}s", sizes.shown(begin), sizes.shown(end))
        else:
            self._good, self._solved, self.status = last_solution
            raise SnapThrough("the body may jump")

    def _ends_before_jumps(self, way: Way) -> bool:
        """Whether a step that may jump is none of the way, and no smaller one is tried."""
        return way.controlled and bool(self._ramped)

    def _give_up(self, way: Way, begun: Snapshot, error: Exception) -> None:
        """Go back to where a step has begun that has no solution, and say where it is to end instead; collective.

        Args:
            way: that of the step.
            begun: the body when it begins.
            error: why there is none.

        Raises:
            Exception: no other step is to be tried.
        """
        sizes, leaps, snaps = way.sizes, self._leaps, isinstance(error, SnapThrough)
        final = not sizes.may_halve or self.status in outcomes.FINAL
        if final and isinstance(error, ConvergenceError) and self._solved is None:
            self._solved = self._before_the_first(way)
        self._begin_again(begun, way.back)
        end, reached = f"{sizes.kind} {sizes.shown(sizes.next):g}", sizes.shown(sizes.reached)
        self.history.add(f"{end} is given up, back at {reached:g}: {error}")
        if not isinstance(error, ConvergenceError | FormError | SnapThrough):
            raise error
        if snaps and self._ends_before_jumps(way):
            raise error
        if snaps or not final:
            sizes.halve()
        elif not sizes.jumps and leaps.end is not None and leaps.ends_beyond(sizes.reached, sizes.next):
            sizes.reach(leaps.end)
        else:
            last = outcomes.last_solution(reached if self._ramped else None, sizes.to)
            if isinstance(error, FormError):
                raise outcomes.at_load(error, end, last) from error.__cause__
            assert self.status is not None
            self.status = Status.LIMIT if self._says_no else self.status
            text = outcomes.end_of_ramp(self.status, self._failure, end, last, self._advice_on(self.status))
            raise ConvergenceError(self, text) from error.__cause__

    def _end_step(self, way: Way, end: float, linear_solves: int | None = None) -> StepResult:
        """Take the last solution for a step, and begin the next one; collective.

        Args:
            way: that of the step.
            end: where it ends.
            linear_solves: of an earlier run; None: those of this one.
        """
        assert self._solved is not None
        step = way.named(end, replace(self._solved.step, step=len(self._ramped) + 1))
        if linear_solves is not None:
            step = replace(step, linear_solves=linear_solves)
        self._solved = replace(self._solved, step=step)
        self._ramped.append(step)
        self._mechanics_of_steps.append((step.displacement, self._solved.mechanics))
        self.advance()
        return step

    def _store(self, way: Way, checkpoint: MeshCheckpoint, step: StepResult, marks: Marks) -> None:
        """Store a step in a checkpoint; for the arguments see ``Stepping``; collective."""
        figures = {"newton": self.iterations, "leaps": self._leaps.stored()}
        body, tangent = RestartedBody(self.linear, self._timings, figures), (self._tangent_at, self._tools_at)
        body.store(checkpoint, step, tangent, way.sizes, marks)

    def _recall(self, way: Way, checkpoint: MeshCheckpoint) -> StepResult | None:
        """Go to the next step as an earlier run has left it, and certify it anew; None: it is not there, or is solved
        again; collective.
        """
        number = self.linear.step
        end = checkpoint.place(number)
        if end is None:
            return None
        begun = self._snapshot()
        self._good = self._good or begun
        with self._timings.phase("restart"):
            way.apply(end)
            recalled = RestartedBody(self.linear, self._timings).recall(checkpoint, self._residual)
        if recalled is not None:
            with self._timings.phase("certify"):
                status = self._judge()
            if status is Status.CONVERGED:
                figures = {name: checkpoint.figure(number, name) for name in ("newton", "linear_solves", "leaps")}
                self.status, self.iterations, solves = status, figures["newton"], figures["linear_solves"]
                self._take_solution(solves)
                recalled.accept(self.history, self._timings, way.sizes)
                self._leaps.resume(figures["leaps"])
                return self._end_step(way, end, solves)
            self.history.add(f"restart: load step {number + 1}: {status.value}: it is solved again")
            checkpoint.forget(number)
        self._begin_again(begun, way.back)
        return None

    def _before_the_first(self, way: Way) -> SolvedBody | None:
        """The body as it is before the first step of a way, under the load of that step, which has no solution; None:
        its residual or tangent cannot be evaluated there; collective.
        """
        assert self.status is not None
        status, linear = Status.LIMIT if self._says_no else self.status, self.linear
        try:
            residual = self._forces_at(self.u.x.array.copy())
            if residual is None:
                return None
            linear.slide()
            linear.leave_open(status)
            judged = self._certified(residual)
        except (FormError, MatrixError, PairingError):
            return None
        solves = len(self.history.iterations) - self._solves_before
        body = SolvedBody.of(linear, self.u, *judged, (self.contact, self.shapes), solves, status)
        return replace(body, step=way.named(way.sizes.next, body.step))

    def _advice_on(self, status: Status) -> str:
        """What to do about the outcome of a solve."""
        return outcomes.advice_on_forms(status)

    def _begin_again(self, begun: Snapshot, load: Callable[[], object]) -> None:
        """Go back to where a step has begun, with its load and its shapes; collective."""
        load()
        for number, shape in begun.shapes.items():
            self.shapes[number].put(shape)
        self._go_back(begun)
