"""``NonlinearContactProblem``: contact and friction for anybody's residual, in the idiom of dolfinx's
``NonlinearProblem``.

Newton's method for the body has the semi-smooth method for contact inside: each of its iterations is a linear
``ContactProblem`` for the whole displacement y,

    a(y, z) = L(z),    a = F'(u) - lambda Hess phi,    L = a(u, .) - F(u),

with the gaps and normals of the shapes at X + u.  Contact pressure and friction are those of the new displacement, so
the old ones only enter through the curvature of the shapes.  A line search follows d . (R(u + s d) + B^T (lambda, mu)),
the slope of the energy with contact where there is one; it needs no energy (P. Wriggers, Computational Contact
Mechanics, 2006, chapter 10).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from signorini_fx import parallel
from signorini_fx.body.assembly import action, assemble
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.foundation import Foundation, Pair
from signorini_fx.body.foundations import Foundations
from signorini_fx.body.node_positions import node_positions
from signorini_fx.errors import FormError, SceneError
from signorini_fx.forms.arguments import conditions_of, foundations_of
from signorini_fx.forms.contact_problem import ContactProblem
from signorini_fx.machine.compilation import compiling
from signorini_fx.nonlinear.certificate import certified
from signorini_fx.nonlinear.inertia import negative_directions
from signorini_fx.nonlinear.moving_shapes import MovingShape
from signorini_fx.records import History, Status
from signorini_fx.results.certificate import Certificate
from signorini_fx.results.promised_law import Law, Tractions
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.scene.rigid_shape import distance_from
from signorini_fx.scene.values import kind_of
from signorini_fx.tuned import (
    BRACKET_MARGIN,
    FEW_NEWTON_ITERATIONS,
    LEAST_INCREMENT,
    LINE_SEARCH_STEPS,
    NO_LINE_SEARCH,
    SAME_NUMBER,
    SHORTENED_SLOPE,
    SMALL_INCREMENT,
    SMALLEST_STEP,
    STEP_GROWTH,
    WHOLE_SLOPE,
)

Array = npt.NDArray[np.float64]


class _MovingFoundations(Foundations):
    """Foundations whose shapes are seen from displaced points."""

    motion: Callable[[ContactBoundary], Array | None]

    def moved(self, boundary: ContactBoundary) -> Array | None:
        """See ``Foundations``."""
        return self.motion(boundary)


class _LinearisedProblem(ContactProblem):
    """The contact problem of one iteration."""

    _foundations_class = _MovingFoundations


@dataclass(frozen=True)
class RampStep:
    """One step of a ramp.

    Attributes:
        load: how far it goes.
        iterations: of Newton's method.
        linear_solves: all of them, those of the contact included.
    """

    load: float
    iterations: int
    linear_solves: int


class NonlinearContactProblem:
    """Find u with F(u; v) = 0 for all v, and contact with rigid foundations on parts of the boundary.

        problem = NonlinearContactProblem(F, u, bcs=[fixed], contact=Foundation(facets, shape=circle))
        problem.ramp(lambda t: problem.place(0, shift=(0.0, -0.3 * t)))

    A foundation with a ``shape`` is met at the displaced points, however far they slide on it, and its friction is
    relative to it; gaps and directions without a shape are those of the undeformed boundary.  Pressures, shears and
    bounds of friction are per area of the undeformed boundary.  Friction depends on the path: ``advance`` ends a step.

    Args:
        F: the residual, a UFL form with one argument, nonlinear in ``u``.
        u: the Function that takes the solution, in a vector Lagrange space of degree 1 or 2; its values are the first
            iterate.
        bcs: Dirichlet conditions as dolfinx makes them; their values may change between two solves.
        contact: the foundations.
        J: the tangent, a UFL form with two arguments; None: the derivative of ``F``.
        update: called before anything is assembled at new values of ``u``, such as to return stresses to a yield
            surface, from the state of the last ``commit``.
        commit: called by ``advance``: the state at ``u`` is that from which the next step starts.
        petsc_options_prefix: see ``ContactProblem``.
        petsc_options: see ``ContactProblem``.
        form_compiler_options: see ``dolfinx.fem.form``.
        jit_options: see ``dolfinx.fem.form``.
        stability: whether the inertia of the tangent is looked at after each solve; one more factorisation.
        max_newton: iterations of Newton's method.
        settings: algorithm, coulomb, ..., see ``SolverSettings``.

    Attributes:
        u: the solution.
        contact: the foundations.
        pressure, shear, gap, slip: see ``ContactFields``.
        status: how the last solve ended; None before the first one.
        certificate: the check of the last solution against F and the shapes; None before the first solve.
        iterations: of Newton's method in the last solve.
        history: every linear solve of all solves so far.

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
        contact: Sequence[Foundation] | Foundation = (),
        J: Any = None,
        update: Callable[[], object] | None = None,
        commit: Callable[[], object] | None = None,
        petsc_options_prefix: str = "sfx_",
        petsc_options: Mapping[str, Any] | None = None,
        form_compiler_options: dict[str, Any] | None = None,
        jit_options: dict[str, Any] | None = None,
        stability: bool = True,
        max_newton: int = 30,
        **settings: Any,
    ) -> None:
        self.u, self.contact = u, self._checked(F, u, foundations_of(contact))
        self._update, self._commit = update or (lambda: None), commit or (lambda: None)
        self._stability, self._max_newton = stability, max_newton
        space = self._space = u.function_space
        self._dimension = int(space.mesh.geometry.dim)
        self._owned = space.dofmap.index_map.size_local * self._dimension
        test, trial = F.arguments()[0], ufl.TrialFunction(space)
        tangent = ufl.derivative(F, u, trial) if J is None else J
        linear = ufl.derivative(F, u, u) if J is None else ufl.action(J, u)
        shaped = [k for k, entry in enumerate(self.contact) if entry.shape is not None]
        self._curvature: fem.Function | None = None
        self._weights: Array = np.zeros(0)
        if shaped and space.element.basix_element.degree == 1:
            rate = self._curvature_term(F, tangent, test)
            tangent, linear = tangent + rate(trial), linear + rate(u)
        with compiling():
            self._residual = fem.form(F, form_compiler_options=form_compiler_options, jit_options=jit_options)
        self._linear = _LinearisedProblem(
            tangent,
            linear - F,
            bcs,
            [self._seen(k, entry) if k in shaped else entry for k, entry in enumerate(self.contact)],
            petsc_options_prefix=petsc_options_prefix,
            petsc_options=petsc_options,
            form_compiler_options=form_compiler_options,
            jit_options=jit_options,
            **settings,
        )
        self._linear._foundations.motion = self._moved  # type: ignore[attr-defined]
        self._shapes = {k: self._shape_of(k) for k in shaped}
        linear_problem = self._linear
        self.pressure, self.shear = linear_problem.pressure, linear_problem.shear
        self.gap, self.slip = linear_problem.gap, linear_problem.slip
        bounds = parallel.global_bounds(space.mesh.comm, space.mesh.geometry.x.astype(np.float64))
        self._size = float(np.linalg.norm(np.ptp(bounds, axis=0)))
        self.status: Status | None = None
        self.certificate: Certificate | None = None
        self.iterations = 0
        self._advanced = u.x.array.copy()

    @staticmethod
    def _checked(F: Any, u: Any, contact: Sequence[Foundation | Pair]) -> tuple[Foundation, ...]:
        """The foundations, if the arguments fit each other.

        Raises:
            FormError: they do not.
        """
        problems = list[tuple[str, str]]()
        if not isinstance(u, fem.Function):
            problems.append(("u", f"must be a Function, not {kind_of(u)}"))
        if not isinstance(F, ufl.Form) or len(F.arguments()) != 1:
            problems.append(("F", "must be a UFL form with one test function"))
        foundations = list[Foundation]()
        for k, entry in enumerate(contact):
            if isinstance(entry, Pair):
                problems.append((f"contact[{k}]", "two nonlinear bodies are not possible yet: give a Foundation"))
            else:
                foundations.append(entry)
        if problems:
            raise FormError(problems)
        return tuple(foundations)

    @property
    def bcs(self) -> Any:
        """The Dirichlet conditions; the list may change between two solves."""
        return self._linear.bcs

    @bcs.setter
    def bcs(self, bcs: Any) -> None:
        self._linear.bcs = bcs

    @property
    def history(self) -> History:
        """Every linear solve of all solves so far."""
        return self._linear.history

    @property
    def state(self) -> ContactState:
        """The contact points of this rank after the last solve, with forces and areas of the undeformed boundary."""
        return self._linear.state

    # --- shapes -------------------------------------------------------------------------------------------------------

    def _shape_of(self, number: int) -> MovingShape:
        """The shape of a foundation at its nodes."""
        entry, values = self.contact[number], self._linear._foundations._values[number]
        x = node_positions(self._space)[values.nodes]
        shape = self._distance(number, entry.shape)
        added = values(entry.gap, f"contact[{number}].gap")[values.nodes]
        return MovingShape(shape, shape, added, values.nodes, x[:, : self._dimension].astype(np.float64))

    def _distance(self, number: int, shape: Any) -> Any:
        """The shape, if it fits the mesh.

        Raises:
            FormError: it does not.
        """
        try:
            found = distance_from(shape, self._dimension).shape
            if getattr(found, "driven", False):
                raise SceneError([("force", "cannot move it yet: place() it")])
            return found
        except SceneError as error:
            raise FormError([(f"contact[{number}].shape.{key}", reason) for key, reason in error.problems]) from None

    def _seen(self, number: int, entry: Foundation) -> Foundation:
        """A foundation with a shape as the linearised problem has it: a gap and a direction."""

        def seen() -> tuple[Array, Array]:
            moving = self._shapes[number]
            return moving.seen_from(self.u.x.array.reshape(-1, self._dimension)[moving.nodes])

        return replace(entry, shape=None, gap=lambda x: seen()[0], direction=lambda x: seen()[1].T)

    def _moved(self, boundary: ContactBoundary) -> Array | None:
        """How far the shapes have moved at the contact points since the last step."""
        if all(moving.shape == moving.settled for moving in self._shapes.values()):
            return None
        motion = np.zeros((self.u.x.array.size // self._dimension, self._dimension))
        places = self.u.x.array.reshape(-1, self._dimension)
        displacements = np.zeros_like(boundary.x)
        for number, moving in self._shapes.items():
            motion[moving.nodes] = moving.moved(moving.x + places[moving.nodes])
            on_part = boundary.part == number
            displacements[on_part] = motion[boundary.nodes[on_part]]
        return displacements

    def _curvature_term(self, F: Any, tangent: Any, test: Any) -> Callable[[Any], Any]:
        """The form of - lambda Hess phi, with the weights of nodes, as a function of its trial function."""
        mesh, dim = self._space.mesh, self._dimension
        data = [
            integral.subdomain_data()
            for form in (F, tangent)
            for integral in form.integrals()
            if integral.integral_type() == "exterior_facet"
        ]
        nodal = {"quadrature_rule": "vertex", "quadrature_degree": 1}
        ds = ufl.Measure("ds", domain=mesh, subdomain_data=data[0] if data else None, metadata=nodal)
        curvature = self._curvature = fem.Function(fem.functionspace(mesh, ("Lagrange", 1, (dim, dim))))
        with compiling():
            weights = fem.form(ufl.inner(ufl.as_vector([1.0] * dim), test) * ufl.Measure("ds", mesh, metadata=nodal))
        self._weights = assemble(weights).reshape(-1, dim)[:, 0]
        return lambda trial: -ufl.inner(ufl.dot(curvature, trial), test) * ds

    def _bend(self) -> None:
        """Give the tangent the curvature of the shapes with the contact pressures of now; collective."""
        if self._curvature is None or self._linear._state is None:
            return
        state, dim = self.state, self._dimension
        boundary, places = state.boundary, self.u.x.array.reshape(-1, dim)
        blocks = self._curvature.x.array.reshape(-1, dim, dim)
        blocks[:] = 0.0
        position = node_positions(self._space)[:, :dim]
        for number, moving in self._shapes.items():
            at = np.flatnonzero((boundary.part == number) & (state.pressure > 0))
            nodes = boundary.nodes[at]
            hessian = moving.curvature(position[nodes] + places[nodes], self._size)
            share = state.pressure[at] * boundary.weight[at] / self._weights[nodes]
            blocks[nodes] = share[:, None, None] * hessian
        self._curvature.x.scatter_forward()

    def place(self, number: int, **placement: Any) -> None:
        """Turn and move a foundation that has a shape, for the next solve and those after it.

        Args:
            number: of the foundation in ``contact``.
            placement: its shift, rotation and pivot, see ``scene.rigid_shape.Shape``; what is left out stays.

        Raises:
            FormError: it has no shape, or the placement is wrong.
        """
        moving = self._shapes.get(number)
        if moving is None or not hasattr(moving.shape, "placed"):
            raise FormError([(f"contact[{number}].shape", "this foundation has no shape that can be placed")])
        try:
            moving.shape = self._distance(number, moving.shape.placed(**placement))
        except ValueError as error:
            raise FormError([(f"contact[{number}].shape", str(error))]) from None

    # --- Newton's method ----------------------------------------------------------------------------------------------

    def solve(self) -> fem.Function:
        """Solve with the values that Constants, Functions, conditions and shapes have now; collective.

        Returns:
            ``u``.

        Raises:
            ConvergenceError: no solution was reached; ``status`` says why, and ``u`` is the last iterate.
            FormError: a value is not finite, or cannot be evaluated.
        """
        self.certificate = None
        self.status = self._iterate()
        if self.status is Status.CONVERGED:
            self.status = self._judge()
        if self.status is not Status.CONVERGED:
            smaller = "take smaller steps, as ramp does, or raise max_newton"
            advice = smaller if self.status is Status.MAX_ITERATIONS else self.status.advice
            raise ConvergenceError(self, f"{self.status.value}: {advice}")
        return self.u

    def _iterate(self) -> Status:
        """Newton's method from the present ``u``; collective."""
        comm, u = self._space.mesh.comm, self.u
        for iteration in range(1, self._max_newton + 1):
            self.iterations = iteration
            self._update()
            self._bend()
            residual, old = assemble(self._residual), u.x.array.copy()
            if parallel.any_rank(comm, not np.isfinite(residual).all()):
                return Status.INVERTED
            try:
                self._linear.solve()
            except ConvergenceError as error:
                return error.solution.status or Status.NOT_FINITE
            increment = self._linear.u.x.array - old
            length = self._length(old, increment, residual, search=iteration > 1)
            if length == 0.0:
                return Status.INVERTED
            u.x.array[:] = old + length * increment
            change, size = (
                float(parallel.largest(comm, np.abs(values), 0.0)) for values in (length * increment, u.x.array)
            )
            if change <= max(SMALL_INCREMENT * size, LEAST_INCREMENT * self._size):
                return Status.CONVERGED
        return Status.MAX_ITERATIONS

    def _length(self, old: Array, increment: Array, residual: Array, *, search: bool) -> float:
        """The share of an increment to take; 0: the residual is not finite however short it is; collective.

        Args:
            old: values of ``u``, ghosts included.
            increment: to them.
            residual: at them.
            search: whether the slope decides, too: not where prescribed values must arrive.
        """
        comm, u, moved = self._space.mesh.comm, self.u, fem.Function(self._space)
        moved.x.array[:] = increment
        nodes = np.arange(increment.size // self._dimension, dtype=np.int32)
        linear = action((self._linear._a,), moved, nodes)
        free = ~self._linear._prescribed[0][: self._owned]
        ahead = np.where(free, increment[: self._owned], 0.0)
        # The contact forces of the linearised problem are - a(d, .) - R(u).
        contact = -linear - residual

        def slope(length: float) -> float:
            u.x.array[:] = old + length * increment
            self._update()
            forces = assemble(self._residual)
            if parallel.any_rank(comm, not np.isfinite(forces).all()):
                return np.inf
            return float(parallel.global_sum(comm, np.array(ahead @ (forces + contact))))

        first = -float(parallel.global_sum(comm, np.array(ahead @ linear)))
        length, now = 1.0, slope(1.0)
        for _ in range(LINE_SEARCH_STEPS):
            if np.isfinite(now):
                break
            length /= 2
            now = slope(length)
        if not np.isfinite(now):
            return 0.0
        size = float(parallel.largest(comm, np.abs(old), 0.0))
        small = float(parallel.largest(comm, np.abs(increment), 0.0)) <= NO_LINE_SEARCH * size
        if not search or small or first >= 0 or abs(now) <= WHOLE_SLOPE * abs(first):
            return length
        below, at_below, above, at_above = 0.0, first, length, now
        for _ in range(LINE_SEARCH_STEPS):
            if abs(now) <= SHORTENED_SLOPE * abs(first) or at_above <= 0:
                break
            length = (below * at_above - above * at_below) / (at_above - at_below)  # regula falsi
            margin = BRACKET_MARGIN * (above - below)
            length = min(max(length, below + margin), above - margin)
            now = slope(length)
            if now > 0:
                above, at_above = length, now
            else:
                below, at_below = length, now
        return length

    def _judge(self) -> Status:
        """Certify the solution, and look at the inertia of its tangent; collective."""
        linear = self._linear
        self._update()
        last, outcome = linear._last, linear._outcome
        assert outcome is not None
        self.certificate = certified(
            self.u,
            assemble(self._residual),
            linear._prescribed,
            linear._scales,
            (linear._data, self.contact, linear._named[0]),
            self._shapes,
            Tractions.of(self.state),
            Law(*linear._task.promised(outcome)),
            None if last is None else last.before,
        )
        if not self.certificate.holds:
            return Status.NOT_CERTIFIED
        if self._stability and self._unstable():
            return Status.UNSTABLE
        return Status.CONVERGED

    def _unstable(self) -> bool:
        """Whether the tangent has a negative direction that contact admits; collective."""
        self._bend()
        boundary, sets = self.state.boundary, self._linear._outcome.problem.sets  # type: ignore[union-attr]
        held = np.einsum("ni,nj->nij", boundary.normal, boundary.normal) * sets.contact[:, None, None]
        rough = np.array([entry.friction is not None for entry in self.contact])[boundary.part]
        sticks = sets.contact & ~sets.slip & rough
        held += np.einsum("nik,njk->nij", boundary.tangents, boundary.tangents) * sticks[:, None, None]
        bcs = conditions_of(self.bcs, self._space)
        return negative_directions(self._linear._a, bcs, boundary.nodes, held) > 0

    # --- load steps ---------------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """End a step: friction acts on what the next solves add to the slip, and the state is that of ``u``.

        Raises:
            RuntimeError: the last solve has no solution.
        """
        if self.status is not Status.CONVERGED:
            raise RuntimeError("there is no solution to advance from")
        self._linear.advance()
        self._commit()
        for moving in self._shapes.values():
            moving.settled = moving.shape
        self._advanced = self.u.x.array.copy()

    def ramp(
        self,
        apply: Callable[[float], object],
        to: float = 1.0,
        *,
        first: float | None = None,
        largest: float | None = None,
        smallest: float = SMALLEST_STEP,
        on_step: Callable[[RampStep], object] = lambda step: None,
    ) -> list[RampStep]:
        """Raise the load from 0 in steps, with ``advance`` after each; collective.

        A step without a solution is halved, and begins again at the end of the last one; one that was easy makes the
        next larger.

        Args:
            apply: changes the problem to what it is at a load; it may be called with a smaller one again.
            to: the load to reach.
            first: the first step; None: all of it.
            largest: that any step may have; None: there is none.
            smallest: share of ``to`` below which no step is halved.
            on_step: called after each step.

        Returns:
            The steps.

        Raises:
            ConvergenceError: a step cannot be shortened any more: ``status`` is ``LIMIT``, and the problem is left at
                the last step that has a solution.  Or an equilibrium is unstable.
        """
        reached, step, steps = 0.0, to if first is None else first, list[RampStep]()
        while reached < to:
            load, solves = min(to, reached + step), len(self.history.iterations)
            load = to if to - load < SAME_NUMBER * to else load
            try:
                apply(load)
                self.solve()
            except ConvergenceError:
                failed = self.status
                self.u.x.array[:] = self._advanced
                apply(reached)
                if failed is Status.UNSTABLE:
                    raise
                step = (load - reached) / 2
                if step < smallest * to:
                    self.status = Status.LIMIT
                    because = "" if failed is None else f"; a further step ends with: {failed.value}"
                    message = f"{Status.LIMIT.value}: there is one at {reached:g} of {to:g}{because}"
                    raise ConvergenceError(self, f"{message}. {Status.LIMIT.advice}") from None
                continue
            self.advance()
            reached = load
            steps.append(RampStep(load, self.iterations, len(self.history.iterations) - solves))
            on_step(steps[-1])
            if self.iterations <= FEW_NEWTON_ITERATIONS:
                step = min(step * STEP_GROWTH, to if largest is None else largest)
        return steps
