"""``NonlinearContactProblem``: contact and friction for anybody's residual, in the idiom of
dolfinx's ``NonlinearProblem``; see ``newton`` for one step and the way through load steps.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import ufl
from dolfinx import fem

from signorini_fx.arrays import Array, Indices
from signorini_fx.errors import FormError
from signorini_fx.forms.contact_problem import ProblemOfForms
from signorini_fx.forms.elasticity import exterior_facets
from signorini_fx.forms.given_forms import (
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
from signorini_fx.solving.restart import StoredStates
from signorini_fx.solving.solve_on_mesh import contact_solution
from signorini_fx.solving.step import Failure, ended, step
from signorini_fx.solving.time_steps import all_steps

if TYPE_CHECKING:
    from signorini_fx.forms.given_forms import (
        CompilerOptions,
        Density,
        FormOptions,
        PetscOptions,
        SettingValue,
        UflOrCompiled,
    )


def checked(
    F: ufl.Form, u: fem.Function, J: UflOrCompiled | None, contact: Sequence[Foundation | Pair]
) -> tuple[Foundation | Pair, ...]:
    """Return the foundations and pairs; a FormError says that the arguments do not fit each
    other.
    """
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
    """A nonlinear problem of your own forms with contact: find u with F(u; v) = 0 for all v, and
    contact with rigid foundations or of two bodies on parts of the boundary.

        circle = Foundation(facets, shape={"shape": "circle", "centre": (1.0, 1.5), "radius": 0.5})
        problem = NonlinearContactProblem(F, u, bcs=[fixed], contact=circle)
        problem.run([0.5, 1.0], lambda t: problem.place(0, shift=(0.0, -0.3 * t)))

    A foundation with a ``shape``, a ``Shape`` or a table of one, is met at the displaced points,
    however far they slide on it, and its friction is relative to it; gaps and directions without a
    shape are those of the undeformed boundary. Pressures, shears and bounds of friction are per
    area of the undeformed boundary.  Friction depends on the path: ``advance`` ends a step.

    The sides of a ``Pair`` slide on each other, in 3D with degree 1: its points see the other side
    at displaced places, half-way between the normals of both, and slip along it over any number of
    facets.  Areas, and so bounds of friction such as those of ``Tresca``, are those of the
    undeformed first side; a bound without pressure acts wherever a point sees the other side, in
    contact or not.  Where both sides are the same, they may touch each other: each step finds the
    parts that face each other.

    Args:
        F: the residual, a UFL form with one argument, nonlinear in ``u``.
        u: the Function that takes the solution, in a vector Lagrange space of degree 1 or 2; its
            values are the first iterate.
        bcs: Dirichlet conditions as dolfinx makes them; their values may change between two solves.
        contact: the foundations, and pairs of sides of the mesh; none: the body alone.
        J: the tangent, a form with two arguments, UFL or compiled; None: the derivative of ``F``.
            Where it is not symmetric, as that of loads that follow the body, it is factorised as a
            whole.
        update: called before anything is assembled at new values of ``u``, such as to return
            stresses to a yield surface, from the state of the last ``commit``.  Where it raises an
            exception the increment is shortened.
        commit: called at the end of a step: the state at ``u`` is that from which the next one
            starts.
        kept: the Functions of cells that ``commit`` changes, by name, such as that of the plastic
            strain: they are in the fields of each ``State``, so that ``step`` and ``restart`` can
            begin there; empty: it changes none.
        effects: what else happens from load step to load step, see ``StepEffect``.
        petsc_options_prefix, petsc_options, form_compiler_options, jit_options, boundaries: see
            ``ContactProblem``.
        stability: whether the inertia of the tangent is looked at after each solve, by a
            factorisation of its own where the last one does not tell; then *converged* means that
            the equilibrium is stable.  The verdict is that of the derivative of ``F``: a ``J`` that
            differs from it, tried by a difference, only leads Newton's method.
        max_newton: iterations of Newton's method.
        density: see ``ContactProblem``; loads in F are those of the end of a time step.
        settings: algorithm, coulomb, ..., see ``SolverSettings``.

    Attributes:
        u: the solution.
        pressure, shear, gap, slip: see ``ContactFields``.
        solution: the last solution with all that results are made of; after ``run`` with all of its
            steps.  Where the first one has no solution it is the body as it was before, under the
            load of this step, and converged it is not.  Of what needs a strain energy it says that
            a nonlinear body has none.

    After a failure ``u``, ``pressure``, ``state``, ``certificate`` and all others are those of the
    last solution again, and ``update`` has been called there.

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
        update: Callable[[], object] | None = None,
        commit: Callable[[], object] | None = None,
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
        self._solver = self._ended = EquilibriumSolver(self.linear, *actions)
        further = "; or raise max_newton, or give the derivative of F as J"
        self._solver.cures = {Status.NOT_SOLVED: f"{Status.NOT_SOLVED.advice}{further}"}

    @property
    def iterations(self) -> int:
        """Return the number of Newton iterations of the last solve."""
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
        if run:  # else the loop is the user's own
            names = tuple(step.name for step in steps)
            path = LoadPath(tuple(step.time for step in steps), names if any(names) else ())

        def errors(strain: bool) -> tuple[Array, Norms] | str:
            """Return the estimated errors of the body as it is now."""
            if self._solver.solved is not solved:
                return "there is no estimate of the error of an earlier solve"
            return self._errors_now(strain=strain)

        model = replace(solved.mechanics.model, title=title, path=path)
        mechanics = replace(solved.mechanics, model=model, ends=ends, errors_now=errors)
        ended = (solved.outcome, solved.data)
        found = self.findings
        solution = contact_solution(
            mechanics, steps, linear.task, ended, self._solver.timings, lambda: found
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
        """Return the stated F by components, UFL."""
        return lowered(self._stated)

    def _errors_now(self, *, strain: bool) -> tuple[Array, Norms] | str:
        """Return what each owned cell has of the squared relative error of the stress in L2, shape
        (cells,), or with ``strain`` also of that of the strain, shape (2, cells), and the norms of
        both; or why they are not known; collective.
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
        # A stress without a strain is that of a body at rest.  What is left of the traction is the
        # same share of both.
        strains = squares / of_strain + left if of_strain > 0 else shares
        norms = (float(np.sqrt(size)), float(np.sqrt(of_strain or size)))
        return np.array([shares, strains]), norms

    def _loaded(self) -> Indices:
        """Return the exterior facets of this rank on which F has forces."""
        integrals = self._lowered.integrals_by_type("exterior_facet")
        mesh = self.u.function_space.mesh
        return np.concatenate(
            [np.zeros(0, np.int32), *(exterior_facets(integral, mesh) for integral in integrals)]
        )

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is to be known about the last solution, see ``ContactProblem``; collective."""
        solved = self._solver.solved
        steps = [step for step, _ in self._solver.ends]
        ends = [*steps, *(() if solved is None else (solved.result,))]
        # Where nothing presses on a body its forces are round-off.
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
        """Return the motions of the rigid bodies in the last solution."""
        return self.linear.foundations.rigid_bodies.motions

    def _differentiated(self) -> tuple[Any, ...]:
        self.linear.refuse_moving(UNDERIVED)
        named = self.solution.model
        body = copy(self.linear)  # which is assembled in its place
        return lambda: named, linearised_at(self._solver, body), body.data_now

    def solve(self) -> fem.Function:
        """Solve with the values that Constants, Functions, conditions and shapes have now, return
        ``u``; collective.

        Raises:
            ConvergenceError: no solution was reached; ``status`` says why, and all else is as the
                last solution was.
            FormError: a value is not finite, cannot be evaluated, or ``update`` raised an
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
        """The load steps: those of a scene, else those of an own loop so far."""
        return counted_path(self.linear.begin.number)

    def step(self, state: State, time: float) -> tuple[State, StepResult]:
        """Solve the load step from a state with the values of now, see ``ContactProblem.step``;
        ``commit`` is called where it has a solution; collective.

        Args:
            state: the end of the load step before, or ``initial()``; it stays as it is.
            time: of the end of the load step.

        Returns:
            The state at its end and the result, whose ``status`` says whether it is a solution.

        Raises:
            ConvergenceError: there is no solution, and nothing that can be shown.
            FormError: see ``solve``; or ``commit`` changes what is not ``kept``.
            SceneError: the time is not after that of the state, or the state is of another mesh.
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
        """End a step of a user's own loop, and begin the next one there."""
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
        """Take the way from a state to a time; the places of both."""
        self._solver.go_through(LoadPath((time,)))
        return -1.0, 0.0

    def _through(
        self,
        path: LoadPath,
        clock: Clock,
        stored: StoredStates | None,
        on_step: Callable[[StepResult], object],
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
    """Return the last solution with its linearised problem, which is assembled there, see
    ``SolvedStep.of``; collective.
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
