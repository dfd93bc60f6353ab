"""``ContactProblem``: contact and friction for a symmetric bilinear form of the user, with the
interface of ``dolfinx.fem.petsc.LinearProblem``.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy.typing as npt
from dolfinx import fem
from dolfinx.mesh import MeshTags
from petsc4py import PETSc

from signorini_fx.errors import FormError
from signorini_fx.extensions import add_on
from signorini_fx.forms.given_forms import (
    CompilerOptions,
    Density,
    Law,
    PetscOptions,
    SettingValue,
    UflOrCompiled,
    given_forms,
)
from signorini_fx.forms.solver import UNDERIVED, FormSolver, options_applied, solve_now
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.interfaces import Facets, Foundation, Pair
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodyMotion
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.records import History, Status
from signorini_fx.results.certificate.certificate import Certificate

if TYPE_CHECKING:
    import ufl
    from ufl.core.expr import Expr

    from signorini_fx.arrays import Array
    from signorini_fx.forms.steps import Ran
    from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
    from signorini_fx.mechanics.contact_points.scalar_map import ScalarMap
    from signorini_fx.mechanics.state import State
    from signorini_fx.mechanics.step_effect import StepEffect
    from signorini_fx.quantities.differentiable import Gradient
    from signorini_fx.results.accuracy.error_estimates import Errors
    from signorini_fx.results.mechanics import StepResult
    from signorini_fx.results.solution import Solution
    from signorini_fx.results.stresses import RawStresses
    from signorini_fx.solving.step import Report


class ProblemOfForms:
    """The interface that linear and nonlinear problems of forms share: run, results and
    derivatives.
    """

    assembled: Any
    _solver: Any  # the object that holds the status and certificate of the last solve
    _titled: Callable[[str], Solution]  # ``solution`` with a title; collective
    # The squared error of each owned cell, the strain energy, the contacts that are met at
    # displaced points, and the modulus; see ``combined``; collective.
    _errors_in_body: Callable[[Solution], tuple[Array, float, Collection[int], float | None]]
    # A function that returns the named model, the last solution as ``SolvedStep.of`` takes it, and
    # a function that returns the present data of the problem; collective.
    _differentiated: Callable[[], tuple[Any, ...]]
    # Solves the path, clock and checkpoint of ``begun_path``, calls ``on_step``, and returns the
    # solution; collective.
    _through: Callable[..., Solution]
    _shared: Solution | None = None  # the solution on several ranks, see ``_share``

    def __repr__(self) -> str:
        dofmap = self.assembled.space.dofmap
        unknowns = dofmap.index_map.size_global * dofmap.index_map_bs
        ended = "not solved so far" if self.status is None else self.status.value
        return f"<{type(self).__name__}: {unknowns} unknowns, {ended}>"

    @property
    def bcs(self) -> list[fem.DirichletBC]:
        """The Dirichlet conditions; the list may change between two solves."""
        return self.assembled.bcs

    @bcs.setter
    def bcs(self, bcs: list[fem.DirichletBC]) -> None:
        self.assembled.bcs = bcs

    @property
    def contact(self) -> tuple[Foundation | Pair, ...]:
        """The foundations and pairs."""
        return self.assembled.contact

    @property
    def status(self) -> Status | None:
        """How the last solve ended; None before the first one, and after an error."""
        return self._solver.status

    @property
    def certificate(self) -> Certificate | None:
        """The check of the last solution against the conditions of the problem; for a nonlinear
        body, against F and the shapes at displaced points.  None before the first solve.
        """
        return self._solver.certificate

    @property
    def history(self) -> History:
        """Every linear solve of all solves so far."""
        return self.assembled.history

    @property
    def state(self) -> ContactState:
        """The contact points of this rank after the last solve, with forces and areas on the
        undeformed boundary.
        """
        return self.assembled.state

    @property
    def solution(self) -> Solution:
        """The last solution; after ``run``, with all load steps.  A ``ContactProblem`` that did not
        converge gives its last iterate.

        On one rank its results use the present values of the forms.  On several ranks they are
        those of the solve, so that one rank may read them alone.

        Raises:
            RuntimeError: there is no solution yet.
        """
        return self._titled("") if self._shared is None else self._shared

    def _share(self) -> None:
        """Build ``solution`` now if there are several ranks, so that one of them may read it alone
        later; collective.
        """
        self._shared = None
        if self.assembled.space.mesh.comm.size > 1:
            self._shared = self._titled("")

    @property
    def errors(self) -> Errors:
        """Estimated relative errors of the last solution: of the displacement in the energy norm
        (of a nonlinear body, of the stress), and of contact pressure and contact force; collective.

        They do not include what the mesh fails to resolve of loads, gap and friction.

        Raises:
            RuntimeError: there is no solution yet, or it has no stress.
            FormError: there is no contact, no ``stress``, or a measure multiplies the forms.
        """
        if not self.assembled.contact:
            wrong = (
                "there is none, so its pressure has no error; stress.error is that of the stress"
            )
            raise FormError.at("contact", wrong)
        return self.errors_of(self.solution)

    def errors_of(self, solution: Solution) -> Errors:
        """Return the estimated errors of the last solution; collective.

        Args:
            solution: the last solution, with any title and names.
        """
        from signorini_fx.results.accuracy.error_estimates import combined

        squares, energy, displaced, modulus = self._errors_in_body(solution)
        return combined(
            solution.model,
            solution.table,
            squares,
            energy,
            solution.statement.kinematics_in(solution.model.tagged.dimension),
            displaced=displaced,
            modulus=modulus,
        )

    def initial(self) -> State:
        """Return the state before the first load step, with the foundations at their present
        places.
        """
        return self._solver.initial()

    def points(self) -> tuple[ContactBoundary, fem.FunctionSpace]:
        """See ``State.save``."""
        return self.assembled.points()

    def place(self, number: int, **placement: npt.ArrayLike | None) -> None:
        """Shift and turn a foundation that has a shape, or change the forces that drive it, for the
        next solve and all later ones.

        Gap and normals follow from the new place.  After ``advance``, friction acts on the slip
        relative to the foundation and its motion.

        Args:
            number: index of the foundation in ``contact``.
            placement: its ``shift``, ``rotation`` and ``pivot``; for a foundation moved by forces
                also its force, moment, prescribed components and spring, see
                ``statement.rigid_shape.Shape``. What is left out stays as it is.

        Raises:
            FormError: the foundation has no shape that can be placed, or the placement is wrong.
        """
        self.assembled.foundations.place(number, placement)

    def map(self, space: fem.FunctionSpace) -> ScalarMap:
        """Return a ``ScalarMap`` between nodes and the contact points of the last solve: it
        evaluates nodal values, such as temperatures, at the points and returns what acts there to
        the nodes; collective.

        Args:
            space: a scalar space with the nodes of ``u``.

        Raises:
            FormError: the space does not fit.
            RuntimeError: there is no solution yet.
        """
        from signorini_fx.mechanics.contact_points.scalar_map import ScalarMap

        return ScalarMap(self.state.boundary, space)

    def advance(self) -> None:
        """End a step of your own time loop.

        From then on friction acts on the additional slip, starting from the shear of this step,
        which turns with the tangent directions; a material goes on from its present state.  All
        solves until the next call start from here, whatever was tried in between.

        Raises:
            RuntimeError: the last solve has no solution.
        """

    def run(
        self,
        path: LoadPath | Iterable[float],
        at: Callable[[float], None] | fem.Constant,
        *,
        folder: str | Path | None = None,
        restart: bool = False,
        on_step: Callable[[StepResult], None] = lambda step: None,
    ) -> Solution:
        """Solve load steps, with ``advance`` between them; collective.

        A ramp takes smaller increments where there is no solution. With a nonlinear body any step
        may be halved, the first one from time 0, and the problem is left at the last step with a
        solution, however the path ends. A ``ContactProblem`` is left at the last load step; after
        ``advance`` another run continues from there.

        Args:
            path: the times, one load step each, or a ``LoadPath``, which may be a ramp.
            at: a function that changes the problem to a given time, which may be earlier than the
                last one; or a Constant whose value becomes the time.
            folder: the folder in which each complete load step is stored, one folder per run; None:
                nothing is stored.
            restart: whether to continue from what an earlier run of the same program stored there,
                on any number of ranks. Functions that the ``commit`` of a nonlinear body changes
                must be ``kept``.
            on_step: called with the result of each load step that has a solution.

        Raises:
            ConvergenceError: a load step has no solution; the ``solution`` of the error has those
                before it. For a nonlinear body: the step cannot be shortened further (``status`` is
                ``LIMIT`` where tangent or displacement indicate that there is no equilibrium,
                otherwise that of the smallest step), or the equilibrium is unstable, or its
                stability is unknown.
            FormError: see ``solve``; or an argument is wrong, or the folder belongs to another
                problem or run, or the smallest step raises one, for example from ``update``.
        """
        from signorini_fx.forms.steps import begun_path

        return self._through(
            *begun_path(self.assembled, path, at, folder, restart=restart), on_step
        )

    def gradient(self, of: ufl.Form | str, by: fem.Constant | Sequence[fem.Constant]) -> Gradient:
        """Return the derivatives of a result of the last solve with respect to Constants of the
        problem, by one adjoint solve; collective.

            problem.gradient(of=u[1] * ds(top), by=[young, friction])

        The derivatives include that contact forces on a nonlinear body turn with the displacement.

        Args:
            of: a UFL form of ``u`` without arguments; or a quantity as in scenes, with the name or
                number of the contact: ``"force 0 y"``, ``"moment 0 z"``, ``"pressure 0 8"``,
                ``"mean top y"``.
            by: Constants with one value in the forms, the conditions, or the foundations.

        Raises:
            RuntimeError: there is no solution; or the result depends on states before ``advance``,
                or of a nonlinear body on those before the last step, as with friction or a material
                state.
            FormError: an argument is wrong; there is no contact; forces move a foundation; or two
                nonlinear bodies touch.
        """
        if self.status is not Status.CONVERGED:
            raise RuntimeError("there is no solution to differentiate")
        if not self.contact:
            raise FormError.at(
                "contact", "there is none: derivatives are those of contact problems"
            )
        if self.assembled.foundations.rigid_bodies.bodies:
            raise FormError.at(
                "contact", "derivatives are not possible yet where forces move a foundation"
            )
        return add_on("gradient")(of, by, *self._differentiated())

    def write(
        self,
        folder: str | Path,
        *,
        title: str = "",
        fields: bool = True,
        pictures: bool | Sequence[str] = True,
        pdf: bool = False,
        report: bool = False,
    ) -> dict[str, Any]:
        """Write the result folder of the last solution, with the same files as for a scene;
        collective.

        Args:
            folder: the folder, created if it does not exist.
            title: the title of the results.
            fields: see ``write_results``.
            pictures: see ``write_results``.
            pdf: see ``write_results``.
            report: whether to write ``report.html`` as well.

        Returns:
            The summary.

        Raises:
            OutputError: see ``write_results``.
            RuntimeError: there is no solution so far.
        """
        from signorini_fx.results.files import write_results

        solution = self._titled(title)
        summary = write_results(solution, folder, fields=fields, pictures=pictures, pdf=pdf)
        if report:
            parallel.on_root(solution.comm, lambda: add_on("report")(folder))
        return summary


class ContactProblem(ProblemOfForms):
    """A linear problem of your own forms with contact: find y with a(y, z) = L(z) for all z,
    subject to contact conditions on parts of the boundary.

    Constants and Functions in the forms, in the Dirichlet conditions and in the foundations may
    change between two solves; only what has changed is assembled and factorised again. In your own
    time loop call ``advance`` after each step.

    Args:
        a: a symmetric bilinear form on a vector Lagrange space of degree 1 or 2, UFL or compiled;
            on a mesh of plane cells in 3D, a section, too.
        L: a linear form on the same space.
        bcs: Dirichlet conditions of dolfinx; where two prescribe the same unknown, the later one
            applies.
        contact: the foundations and the pairs of bodies that can touch; empty: no contact.
        u: the Function for the solution; None: a new one.
        petsc_options_prefix: prefix of this problem's options in the PETSc database.
        petsc_options: options for the SNES, its KSP and PC, without that prefix.
        form_compiler_options, jit_options: see ``dolfinx.fem.form``.
        stress: the stress, linear in the strain: a function of the displacement that returns UFL,
            or UFL of ``u`` or of the trial function, shape (d, d), or (3, 3) in 2D; None: no
            stresses are evaluated.
        materials: tags on all cells; the stress may jump where they change. None: the stress is
            continuous.
        boundaries: names of parts of the boundary for results, each with its facets, given as for a
            ``Foundation``.
        effects: further effects from load step to load step, such as wear, see ``StepEffect``.
        density: mass per volume, a number or UFL, or the bilinear form of the mass: the body has
            inertia, and each load step is a time step; None: no inertia.
        settings: settings of the solver, such as algorithm, coulomb and gamma_n, see
            ``SolverSettings``.

    Attributes:
        u: the solution.
        assembled: the underlying solver, for programs that go beyond this class.
        pressure, shear, gap, slip: nodal fields on all contact boundaries, see ``ContactFields``.

    Raises:
        FormError: an argument is wrong.
        MachineError: a form cannot be compiled.

    Examples:
        >>> V = fem.functionspace(block.mesh, ("Lagrange", 1, (2,)))
        >>> u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
        >>> a = 1000.0 * ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))) * ufl.dx
        >>> L = ufl.inner(fem.Constant(block.mesh, (0.1, -2.0)), v) * ufl.dx
        >>> bottom = sfx.Foundation(block.facets("bottom"), friction=sfx.Coulomb(0.3))
        >>> problem = sfx.ContactProblem(a, L, contact=bottom)
        >>> y = problem.solve()
        >>> print(problem.status.value, np.round(problem.state.forces, 6).tolist())
        converged [[0.0, 4.0], [-0.2, 0.0]]
    """

    assembled: FormSolver

    def __init__(
        self,
        a: UflOrCompiled,
        L: UflOrCompiled,
        bcs: Sequence[fem.DirichletBC] = (),
        contact: Sequence[Foundation | Pair] | Foundation | Pair = (),
        u: fem.Function | None = None,
        *,
        petsc_options_prefix: str = "sfx_",
        petsc_options: PetscOptions | None = None,
        form_compiler_options: CompilerOptions = None,
        jit_options: CompilerOptions = None,
        stress: Expr | Law | None = None,
        materials: MeshTags | None = None,
        boundaries: Mapping[str, Facets] | None = None,
        effects: Sequence[StepEffect] = (),
        density: Density = None,
        **settings: SettingValue,
    ) -> None:
        forms, self.u = given_forms(
            a,
            L,
            contact,
            u,
            stress=stress,
            materials=materials,
            boundaries=boundaries,
            form_compiler_options=form_compiler_options,
            jit_options=jit_options,
        )
        options_of_petsc = petsc_options_prefix, dict(petsc_options or {})
        if density is not None:
            from signorini_fx.mechanics.body.inertia import MidpointRule, density_of

            density = density_of(density, forms.space)
            effects = *effects, MidpointRule()
        of_forms = forms, self.u, bcs, settings, options_of_petsc
        self.assembled = self._solver = FormSolver(*of_forms, tuple(effects), density)
        if density is not None:
            self.assembled.refuse_driven()
        fields = self.assembled.fields
        self.pressure = fields.pressure
        self.shear = fields.shear
        self.gap = fields.gap
        self.slip = fields.slip
        # Stresses of the last solution, with the report that they belong to.
        self._stresses: tuple[Report | None, RawStresses] | None = None
        self._ran: Ran | None = None  # the last ``run``, until the next solve

    def step(self, state: State, time: float) -> tuple[State, StepResult]:
        """Solve the load step that follows a state, with the present values of the problem;
        collective.

            state = problem.initial()
            for time in (1.0, 2.0):
                load.value = 10.0 * time
                state, result = problem.step(state, time)

        ``u``, ``pressure`` and all other fields are updated to this step.

        Args:
            state: the end of the previous load step, or ``initial()``; it is not changed.
            time: the end of the load step.

        Returns:
            The state at the end and the result, whose ``status`` says whether it is a solution.

        Raises:
            FormError: see ``solve``.
            SceneError: the time is not after that of the state, or the state belongs to another
                mesh.
        """
        from signorini_fx.forms.steps import solve_step

        self._ran = None
        return solve_step(self.assembled, state, time)

    def advance(self) -> None:
        self.assembled.advance()

    @property
    def rigid_bodies(self) -> tuple[RigidBodyMotion, ...]:
        """The motions of the rigid bodies in the last solution."""
        report = self.assembled.report
        return () if report is None else report.result.rigid_bodies

    @property
    def stress(self) -> RawStresses:
        """The stress of the last solution, raw and recovered, with the estimate of its error, see
        ``RawStresses``; collective.

        Raises:
            RuntimeError: the problem has no ``stress``, or there is no solution yet.
            FormError: the stress has the wrong shape, or is zero for some strain.
        """
        return self._stress_of(lambda: self.solution)

    def _stress_of(self, solution: Callable[[], Solution]) -> RawStresses:
        report = self.assembled.report
        if self.assembled.outdated or self._stresses is None or self._stresses[0] is not report:
            self._stresses = report, solution().stress
        return self._stresses[1]

    def _errors_in_body(
        self, solution: Solution
    ) -> tuple[Array, float, Collection[int], float | None]:
        stress = self._stress_of(lambda: solution)
        if self.assembled.forms.measures:
            wrong = "there is no error estimate where the forms are multiplied by a measure"
            raise FormError.at("stress", wrong)
        return stress.squares, stress.energy, (), None

    def _titled(self, title: str) -> Solution:
        from signorini_fx.forms.steps import solution_of

        return solution_of(self.assembled, self._ran, title)

    @property
    def solver(self) -> PETSc.SNES:
        """The SNES of the semi-smooth Newton method, for monitors and options; the first access
        sets the problem up; collective.
        """
        solver = self.assembled
        with options_applied(*solver.options):
            if not solver.set_up:
                solver.update()
            return solver.task.newton.snes

    def solve(self) -> fem.Function:
        """Solve with the present values of Constants, Functions and Dirichlet conditions;
        collective.

        Returns:
            ``u``.

        Raises:
            ConvergenceError: no solution was found; ``status`` gives the reason, and ``u`` is the
                last iterate.
            FormError: a value is not finite, or cannot be evaluated.
        """
        self._ran = None
        why = solve_now(self.assembled)
        self._share()
        if why:
            from signorini_fx.results.solution import ConvergenceError

            raise ConvergenceError(self, why)
        return self.u

    def _through(self, *run: Any) -> Solution:
        from signorini_fx.forms.steps import converged, solve_path

        self._ran = solve_path(self.assembled, *run)
        self._share()
        return converged(self.solution)

    def _differentiated(self) -> tuple[Any, ...]:
        solver = self.assembled
        report = solver.report
        if solver.outdated or report is None:
            raise RuntimeError("there is no solution to differentiate")
        solver.refuse_moving(UNDERIVED)
        for number, contact in enumerate(solver.contact):
            for part in contact.parts:
                reason = f"derivatives are not possible yet with {part.key}: leave it out"
                raise FormError.at(f"contact[{number}].{part.key}", reason)
        start = report.start
        of_task = solver.elastic, solver.task, report.outcome, start
        return lambda: solver.elastic, (*of_task, self.state, self.u, start.law), solver.data_now
