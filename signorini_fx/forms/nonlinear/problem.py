"""``NonlinearContactProblem``: contact and friction for a residual of the user, with the interface
of dolfinx's ``NonlinearProblem``; see ``newton`` for one step and ``steps`` for load steps.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
import ufl
from dolfinx import fem

from signorini_fx.arrays import Array, Indices
from signorini_fx.errors import FormError
from signorini_fx.forms.contact_problem import ProblemOfForms
from signorini_fx.forms.elasticity import exterior_facets
from signorini_fx.forms.given_forms import (
    CompilerOptions,
    Density,
    FormOptions,
    PetscOptions,
    SettingValue,
    UflOrCompiled,
    foundations_of,
    space_of,
    supported,
)
from signorini_fx.forms.nonlinear.linearised import NonlinearBody
from signorini_fx.forms.nonlinear.residual import (
    KeptFunctions,
    Residual,
    Tangents,
    lowered,
    refuse_miscompiled,
)
from signorini_fx.forms.nonlinear.results import (
    Norms,
    green_strain,
    lost_digits,
    slid_past_partners,
    squared_errors,
    stress_of,
    traction_left,
)
from signorini_fx.forms.nonlinear.steps import EquilibriumSolver
from signorini_fx.forms.nonlinear.verdicts import leads
from signorini_fx.forms.solver import LASTS, UNDERIVED, Clock
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.interfaces import Facets, Foundation, Pair
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodyMotion
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.load_path import LoadPath, counted_path
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.mechanics.step_effect import StepEffect, SteppedForms
from signorini_fx.records import Finding, Status
from signorini_fx.results.mechanics import StepResult
from signorini_fx.results.solution import ConvergenceError, Solution
from signorini_fx.solving.findings import loose_at_rest, loose_in, pushed_nodes
from signorini_fx.solving.increments import HalvedIncrements, check_step
from signorini_fx.solving.load_path import all_steps
from signorini_fx.solving.restart import StoredStates
from signorini_fx.solving.solve_on_mesh import contact_solution
from signorini_fx.solving.step import Failure, ended, step


def checked(
    F: ufl.Form, u: fem.Function, J: UflOrCompiled | None, contact: Sequence[Foundation | Pair]
) -> tuple[Foundation | Pair, ...]:
    """Return the foundations and pairs; raise a FormError if the arguments do not fit together."""
    problems = list[tuple[str, str]]()
    kept = 'give sliding = "small"'
    problems += [
        (f"contact[{k}].{key}", reason)
        for k, entry in enumerate(contact)
        if isinstance(entry, Pair) and entry.slides
        for key, wrong, reason in (
            (
                "distance",
                entry.distance != "geometry",
                f'must be "geometry" where sides slide, as partners change: or {kept}',
            ),
            ("kind", entry.bonded, f"{entry.kind!r} is not possible where sides slide: {kept}"),
            (
                "adjust",
                entry.adjust is not None,
                f"is not possible where sides slide: move the meshes, or {kept}",
            ),
        )
        if wrong
    ]
    instead = (
        "prescribe the displacement of this boundary, or tie it to a stiff body (against, "
        'sliding = "small")'
    )
    problems += [
        (
            f"contact[{k}].kind",
            f"'bonded' is not possible yet: nonlinear bodies are not tied to rigid ones: {instead}",
        )
        for k, entry in enumerate(contact)
        if entry.bonded and entry.against is None
    ]
    if not isinstance(u, fem.Function):
        problems.append(("u", f"must be a Function, not {kind_of(u)}"))
    if not isinstance(F, ufl.Form) or F.empty() or len(F.arguments()) != 1:
        problems.append(
            ("F", "must be a UFL form with one test function; what is 0 times a form has none")
        )
    elif J is None and u not in F.coefficients():
        problems.append(
            ("F", "does not contain u, so that its derivative is zero: form it with u, or give J")
        )
    if problems:
        raise FormError(problems)
    space = supported(u.function_space, "u")
    try:
        space_of(
            ufl.inner(ufl.TrialFunction(space), ufl.TestFunction(space)) * ufl.dx
            if J is None
            else J,
            F,
            u,
        )
    except FormError as error:
        raise FormError(
            [({"a": "J", "L": "F"}.get(key, key), why) for key, why in error.problems]
        ) from None
    if space.mesh.geometry.dim != 2 and space.element.basix_element.degree > 1:
        reason = (
            "in 3D two bodies slide on each other with degree 1 only, as curved facets are not "
            "worked out there: "
            'take degree 1, or, where sides slide by little of a facet, sliding = "small"'
        )
        problems += [(f"contact[{k}]", reason) for k, entry in enumerate(contact) if entry.slides]
        if problems:
            raise FormError(problems)
    return tuple(contact)


class NonlinearContactProblem(ProblemOfForms):
    """A nonlinear problem of your own forms with contact: find u with F(u; v) = 0 for all v,
    subject to contact with rigid foundations or between bodies on parts of the boundary.

        circle = Foundation(facets, shape={"shape": "circle", "centre": (1.0, 1.5), "radius": 0.5})
        problem = NonlinearContactProblem(F, u, bcs=[fixed], contact=circle)
        problem.run([0.5, 1.0], lambda t: problem.place(0, shift=(0.0, -0.3 * t)))

    A foundation with a ``shape``, a ``Shape`` or a table of one, is in contact at the displaced
    points, however far they slide on it, and friction acts on the motion relative to it. Without a
    shape, gaps and directions are those of the undeformed boundary. Pressures, shears and friction
    bounds are per area of the undeformed boundary. Friction depends on the path: ``advance`` ends a
    step.

    The sides of a ``Pair`` slide on each other over any number of facets, in 3D with degree 1.
    Points are projected onto the displaced other side along the mean of both normals. Areas, and so
    friction bounds such as those of ``Tresca``, are those of the undeformed first side; a bound
    without pressure acts wherever a point has a partner on the other side, in contact or not. If
    both sides are the same, the body may touch itself: each step finds the parts that face each
    other.

    Args:
        F: the residual, a UFL form with one argument, nonlinear in ``u``.
        u: the Function for the solution, in a vector Lagrange space of degree 1 or 2; its values
            are the first iterate.
        bcs: Dirichlet conditions of dolfinx; their values may change between two solves.
        contact: the foundations, and the pairs of sides of the mesh; empty: no contact.
        J: the tangent, a form with two arguments, UFL or compiled; None: the derivative of ``F``.
            An unsymmetric one, as with loads that follow the body, is factorised by LU.
        update: called before any assembly at new values of ``u``, for example to return stresses to
            a yield surface, from the state of the last ``commit``. If it raises an exception, the
            increment is shortened.
        commit: called at the end of a step: the next step starts from the state at ``u``.
        kept: the Functions of cells that ``commit`` changes, by name, such as the plastic strain.
            They are stored in each ``State``, so that ``step`` and ``restart`` can begin there.
            Empty: ``commit`` changes none.
        effects: further effects from load step to load step, such as wear, see ``StepEffect``.
        petsc_options_prefix, petsc_options, form_compiler_options, jit_options, boundaries: see
            ``ContactProblem``.
        stability: whether to check the inertia of the tangent after each solve, by one more
            factorisation if needed; then *converged* means that the equilibrium is stable. The
            check uses the derivative of ``F``: a ``J`` that differs from it, as a difference
            quotient shows, is used in Newton's method only.
        max_newton: largest number of iterations of Newton's method.
        density: see ``ContactProblem``; loads in F are those at the end of a time step.
        settings: settings of the solver, such as algorithm and coulomb, see ``SolverSettings``.

    Attributes:
        u: the solution.
        pressure, shear, gap, slip: nodal fields on all contact boundaries, see ``ContactFields``.
        solution: the last solution with its results; after ``run`` with all load steps. If the
            first step fails, it shows the body before that step under its load, and ``converged``
            is false. Results that need a strain energy are not available for a nonlinear body.

    After a failure ``u``, ``pressure``, ``state``, ``certificate`` and all others are reset to the
    last solution, and ``update`` is called there.

    Raises:
        FormError: an argument is wrong.
        MachineError: a form cannot be compiled.

    Examples:
        >>> V = fem.functionspace(block.mesh, ("Lagrange", 1, (2,)))
        >>> u, v = fem.Function(V), ufl.TestFunction(V)
        >>> C = (ufl.Identity(2) + ufl.grad(u)).T * (ufl.Identity(2) + ufl.grad(u))
        >>> energy = 100.0 * ufl.inner(C - ufl.Identity(2), C - ufl.Identity(2)) * ufl.dx
        >>> F = ufl.derivative(energy, u, v) + 2.0 * v[1] * ufl.dx
        >>> rough = sfx.Foundation(block.facets("bottom"), friction=sfx.Coulomb(0.5))
        >>> problem = sfx.NonlinearContactProblem(F, u, contact=rough)
        >>> y = problem.solve()
        >>> print(np.round(problem.state.forces[0], 6))
        [0. 4.]
    """

    _named_residual: ClassVar[str] = "F"
    assembled: NonlinearBody

    def __init__(
        self,
        F: ufl.Form,
        u: fem.Function,
        *,
        bcs: Sequence[fem.DirichletBC] = (),
        contact: Sequence[Foundation | Pair] | Foundation | Pair = (),
        J: UflOrCompiled | None = None,
        update: Callable[[], None] | None = None,
        commit: Callable[[], None] | None = None,
        kept: Mapping[str, fem.Function] | None = None,
        effects: Sequence[StepEffect] = (),
        petsc_options_prefix: str = "sfx_",
        petsc_options: PetscOptions | None = None,
        form_compiler_options: CompilerOptions = None,
        jit_options: CompilerOptions = None,
        stability: bool = True,
        max_newton: int = 30,
        boundaries: Mapping[str, Facets] | None = None,
        density: Density = None,
        **settings: SettingValue,
    ) -> None:
        self.u = u
        contact = checked(F, u, J, foundations_of(contact))
        if not isinstance(max_newton, int | np.integer) or max_newton < 1:
            reason = f"must be a whole number from 1, got {max_newton!r}"
            raise FormError.at("max_newton", reason)
        of_forms = density is not None and not any(one.overrides("stepped") for one in effects)
        if of_forms:
            from signorini_fx.mechanics.body.inertia import MidpointRule, density_of

            density = density_of(density, u.function_space)
            effects = *effects, MidpointRule()
        hooks = ("body", "load", "forces", "solved", "repeat")
        others = [effect for effect in effects if not effect.overrides("stepped")]
        if any(effect.overrides(name) for effect in others for name in hooks):
            reason = (
                "change loads, the body or its balance, or repeat steps, which is not possible yet "
                "with one"
            )
            raise FormError.at("effects", f"{reason} that is nonlinear: contact and after are")
        options: FormOptions = {
            "form_compiler_options": form_compiler_options,
            "jit_options": jit_options,
        }
        stepped: SteppedForms | None = None
        whole: fem.Form | None = None
        self._stated = F
        with compiling():
            for effect in effects:
                if (stepped := effect.stepped(F, J, u, density)) is not None:
                    if update is not None:
                        reason = "what a material remembers is not possible yet with inertia"
                        raise FormError.at("update", reason)
                    whole = fem.form(F, **options)
                    F, J = stepped.residual, stepped.tangent
                    break
            residual = Residual(fem.form(F, **options), u, update, stepped=stepped, whole=whole)
        tangents = Tangents(F, J, u, options)
        refuse_miscompiled(F, residual.form, u, options)
        self.assembled = self.linear = NonlinearBody(
            tangents,
            residual,
            bcs,
            contact,
            (petsc_options_prefix, dict(petsc_options or {})),
            boundaries,
            effects,
            density,
            **settings,
        )
        if of_forms:
            self.linear.refuse_driven()
        self.shapes, fields = self.linear.foundations.moving, self.linear.fields
        self.pressure = fields.pressure
        self.shear = fields.shear
        self.gap = fields.gap
        self.slip = fields.slip
        remembers = None if kept is None else KeptFunctions(kept)
        actions = commit, remembers, max_newton, stability and not self.linear.moves
        self._solver = EquilibriumSolver(self.linear, *actions)
        further = "; or raise max_newton, or give the derivative of F as J"
        self._solver.cures = {Status.NOT_SOLVED: f"{Status.NOT_SOLVED.advice}{further}"}

    @property
    def iterations(self) -> int:
        """The number of Newton iterations of the last solve."""
        solved = self._solver.solved
        return 0 if solved is None else solved.iterations

    def _titled(self, title: str) -> Solution:
        solved = self._solver.solved
        if solved is None:
            raise RuntimeError("there is no solution so far: call solve()")
        linear = solved.solved.linear
        run = self._solver.ends if solved.status is Status.CONVERGED else [solved.end]
        ends = run or [solved.end]
        steps = [step for step, _ in ends]
        path = counted_path(solved.result.step - 1)
        if run:  # otherwise the user's own loop counts the steps
            names = tuple(step.name for step in steps)
            path = LoadPath(tuple(step.time for step in steps), names if any(names) else ())

        def errors(strain: bool) -> tuple[Array, Norms] | str:
            """Return the estimated errors of the last solution, or why there are none."""
            if self._solver.solved is not solved:
                return "there is no estimate of the error of an earlier solve"
            return self._errors_now(strain=strain)

        model = replace(solved.mechanics.model, title=title, path=path)
        mechanics = replace(solved.mechanics, model=model, ends=ends, errors_now=errors)
        found = self.findings
        solution = contact_solution(
            mechanics, steps, linear.task, solved, self._solver.timings, lambda *_: found
        )
        status = self.status or Status.CONVERGED
        algorithm = f"newton, {solution.algorithm}"
        state = self._solver.reached
        return replace(solution, status=status, algorithm=algorithm, state=state)

    def _errors_in_body(
        self, solution: Solution
    ) -> tuple[Array, float, Collection[int], float | None]:
        mechanics: Any = solution.mechanics
        known = mechanics.errors_now(True)
        if isinstance(known, str):
            raise RuntimeError(known)
        shares, (stress, strain) = known
        work = stress * strain
        moving = self.linear.foundations
        displaced = {*moving.moving, *moving.sliding}
        return shares * work, work / 2, displaced, stress / strain

    @cached_property
    def _lowered(self) -> ufl.Form:
        """The residual F as given, in terms of components, in UFL."""
        return lowered(self._stated)

    def _errors_now(self, *, strain: bool) -> tuple[Array, Norms] | str:
        """Return the squared relative L2 error of the stress of each owned cell, shape (cells,),
        and the norms of stress and strain; or, as text, why there is no estimate; collective.

        Args:
            strain: whether to return also the error of the strain, shape (2, cells); otherwise its
                norm is 1.
        """
        stress = stress_of(self._lowered, self.u)
        parts = self.linear.forms.parts
        squares, size = squared_errors(stress, self.u, parts)
        if not size > 0:
            return "there is no stress, and no error of it"
        left = traction_left(self.linear, self._loaded(), stress) / size
        shares = squares / size + left
        if not strain:
            return shares, (float(np.sqrt(size)), 1.0)
        squares, of_strain = squared_errors(stress_of(green_strain(self.u), self.u), self.u, parts)
        # Without strain the stress is that of a body at rest.  The residual of the traction is the
        # same fraction of both.
        strains = squares / of_strain + left if of_strain > 0 else shares
        norms = (float(np.sqrt(size)), float(np.sqrt(of_strain or size)))
        return np.array([shares, strains]), norms

    def _loaded(self) -> Indices:
        """Return the exterior facets of this rank over which F has integrals."""
        integrals = self._lowered.integrals_by_type("exterior_facet")
        mesh = self.u.function_space.mesh
        return np.concatenate(
            [np.zeros(0, np.int32), *(exterior_facets(integral, mesh) for integral in integrals)]
        )

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Warnings and notes about the last solution, see ``ContactProblem``; collective."""
        solved = self._solver.solved
        steps = [step for step, _ in self._solver.ends]
        ends = [*steps, *(() if solved is None else (solved.result,))]
        # Forces on a body without contact are round-off.
        if solved is None:
            return ()
        at_end = solved.solved
        elastic = at_end.linear.elastic
        pressed = [step.certificate for step in ends if not loose_in(elastic, step)]
        digits = lost_digits(pressed, self._named_residual)
        inside = pushed_nodes([at_end.state], elastic.scales.size)
        loose = loose_at_rest(elastic, steps, "contact", self.linear.bodies)
        passed = [
            Finding("warning", f"contact[{number}]", f"{text}: let this boundary touch it, too")
            for number, text in self._solver.passed.items()
        ]
        sliding = at_end.body.foundations.sliding.items()
        said = [(number, pair.in_words(at_end.state)) for number, pair in sliding]
        notes = [Finding("note", f"contact[{number}]", text) for number, text in said if text]
        return (*inside, *passed, *slid_past_partners(at_end), *notes, *loose, *digits)

    @property
    def rigid_bodies(self) -> tuple[RigidBodyMotion, ...]:
        """The motions of the rigid bodies in the last solution."""
        return self.linear.foundations.rigid_bodies.motions

    def _differentiated(self) -> tuple[Any, ...]:
        self.linear.refuse_moving(UNDERIVED)
        named = self.solution.model
        body = copy(self.linear)  # a copy, which is assembled in place of the body
        return lambda: named, linearised_at(self._solver, body), body.data_now

    def solve(self) -> fem.Function:
        """Solve with the present values of Constants, Functions, conditions and shapes, and return
        ``u``; collective.

        Raises:
            ConvergenceError: no solution was found; ``status`` gives the reason, and all results
                stay those of the last solution.
            FormError: a value is not finite or cannot be evaluated, or ``update`` raised an
                exception.
        """
        self.linear.refuse_moving(LASTS)
        self._solver.begin_path()
        self.linear.several = False
        self._solver.reached = None
        self.linear.foundations.without_times()
        if why := self._solver.attempt():
            raise ConvergenceError(self, why)
        self._solver.take()
        self._share()
        return self.u

    @property
    def path(self) -> LoadPath:
        """The load steps of the user's own loop so far."""
        return counted_path(self.linear.begin.number)

    def step(self, state: State, time: float) -> tuple[State, StepResult]:
        """Solve the load step that follows a state with the present values, see
        ``ContactProblem.step``; collective.

        ``commit`` is called if the step has a solution.

        Args:
            state: the end of the previous load step, or ``initial()``; it is not changed.
            time: the end of the load step.

        Returns:
            The state at the end and the result, whose ``status`` says whether it is a solution.

        Raises:
            ConvergenceError: there is no solution, and no result that can be shown.
            FormError: see ``solve``; or ``commit`` changes Functions that are not ``kept``.
            SceneError: the time is not after that of the state, or the state belongs to another
                mesh.
        """
        check_step(state, time, self.linear.space)
        solver = self._solver
        reached, place = self._step_to(state, time)
        solver.begin_path()
        new, report = all_steps(solver, state, reached, place, partial(step, solver))
        if isinstance(report, Failure):
            raise report.error or ConvergenceError(self, report.why)
        if report.status is Status.CONVERGED:
            solver.start(new)
            self._share()
        return new, report.result

    def advance(self) -> None:
        """End a step of your own time loop, and begin the next one from it."""
        solver = self._solver
        if self.status is not Status.CONVERGED:
            raise RuntimeError("there is no solution to advance from")
        if self.linear.last is None or solver.solved is None:
            return
        begin = self.linear.begin
        time = counted_path(begin.number).time_at(begin.number)
        solver.go_through(self.path)
        new, report = ended(solver, begin, solver.committed(time), solver.solved)
        solver.accept(new, report)
        solver.start(new)

    def _step_to(self, state: State, time: float) -> tuple[float, float]:
        """Set the load path to a single step to a time; return the places of its beginning and end
        on it.
        """
        self._solver.go_through(LoadPath((time,)))
        return -1.0, 0.0

    def _through(
        self,
        path: LoadPath,
        clock: Clock,
        stored: StoredStates | None,
        on_step: Callable[[StepResult], None],
    ) -> Solution:
        way = HalvedIncrements(path)
        self._solver.go_through(path, lambda place: clock(path.time_at(place)), way)
        failure, advice = self._solver.solve_path(self.linear.begin, on_step, stored)
        if self._solver.solved is not None:
            self._share()
        if failure:
            raise ConvergenceError(self, f"{failure}. {advice[0].upper()}{advice[1:]}")
        return self.solution


def linearised_at(solver: EquilibriumSolver, body: NonlinearBody) -> tuple[Any, ...]:
    """Return the last solution with its linearised problem, see ``SolvedStep.of``; collective.

    Args:
        solver: the solver with the last solution.
        body: a copy of its body, in which the problem is assembled.

    Raises:
        FormError: two bodies touch, or the tangent is not the derivative of F.
        RuntimeError: the solution depends on an earlier state of the material.
    """
    residual = body.evaluated
    for number, entry in enumerate(body.contact):
        if entry.against is not None and not entry.bonded:
            raise FormError.at(
                f"contact[{number}]", "derivatives are not possible yet where two bodies touch"
            )
    if residual.update is not None and body.begin.number > 0:
        why = (
            "the solution depends on the state of the material before it, whose derivatives are "
            "not kept"
        )
        raise RuntimeError(f"{why}: ask for derivatives of the first step, before advance()")
    values = body.at.x.array.copy()
    residual.go_to(values)
    if not leads(body, values):
        unseen = (
            "is needed: the derivative of F by UFL does not contain the changes that update makes"
        )
        wrong = "is not the derivative of F at the solution: leave it out, or mend it"
        raise FormError.at("J", wrong if body.tangents.given else unseen)
    assert solver.solved is not None
    return body.derivative_at(solver.solved.solved)
