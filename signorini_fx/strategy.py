"""Which algorithms a scene runs, in which order: the only place that knows them all.

Two independent choices make a method.  ``algorithm`` says how the regularisation is treated: ``ssn`` (gamma fixed),
``continuation``, ``path-following``, ``alm``, ``exact``.  ``coulomb`` says how the friction bound meets the pressure:
``fp`` (fixed point of Tresca problems) or ``newton`` (monolithic).  (FP) of the paper is ssn with fp, (ALM-FP) alm with
fp.  Load steps repeat the method, each from the state that the one before has left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.algorithms.alm import augmented_lagrangian
from signorini_fx.algorithms.continuation import continuation
from signorini_fx.algorithms.coulomb_newton import coulomb_newton
from signorini_fx.algorithms.fp import fixed_point
from signorini_fx.algorithms.ladder import climb
from signorini_fx.algorithms.path_following import path_following
from signorini_fx.algorithms.ssn import History, SemismoothNewton
from signorini_fx.boundary import ContactBoundary
from signorini_fx.complementarity import (
    ActiveSets,
    FrictionLaw,
    Nodal,
    RegularisedData,
    slip_multiplier,
    slip_of,
)
from signorini_fx.exact import ExactProblem
from signorini_fx.holding import balance_exists
from signorini_fx.linalg import ElasticSystem
from signorini_fx.linalg.rotated import rotate
from signorini_fx.problem import ContactProblem, RegularisedProblem
from signorini_fx.quantities import ContactState
from signorini_fx.resting import Rest
from signorini_fx.results import OuterRecord, Status
from signorini_fx.rigid import RigidMotions
from signorini_fx.scene import SolverSettings

# gamma above this times E / size of the body loses the last digits that double precision has for contact pressures.
LARGEST_GAMMA = 1e9
# Path-following begins where the penetration is about a hundredth of the displacements.
START_GAMMA = 100.0
# Continuation begins where Table 4 does: at this share of the last gamma.
CONTINUATION_SHARE = 1e-4
# Fixed points that do not contract are damped, more and more.
_DAMPING = (0.5, 0.2)
# The augmented Lagrangian method takes over with a gamma that much smaller, though none below that of a path's start.
_AUGMENTED_SHARE = 1e-3


@dataclass
class Task:
    """A contact problem ready to be solved, and what the algorithms leave behind.

    Attributes:
        settings: the solver settings of the scene.
        system: the elastic system.
        boundary: the contact nodes.
        motions: rigid motions of the body.
        data: the regularised problem with the gamma of the scene.
        law: the friction law, None without friction.
        has_coulomb: whether its bound follows the pressure anywhere.
        first_sets: sets of the first linear solve; None: from the iterate.
        first_iteration: its number.
        start: (lambda, mu) to start from, where there are any.
        rest: where displacements are counted from; None: from where the body was at first.
        natural_gamma: E over the size of the body, the natural unit of gamma.
        history: records.
        linear_algebra: which kind of elastic system it is, and why.
        goal: the regularisation error that path-following may leave, in the energy norm, judged at an iterate.
        step: the load step, from 0.
        x: the iterate.
        problem: the problem that holds the answer.
        monolithic: whether Coulomb friction was solved monolithically.
        regularisation_error: what path-following says is left, in the energy norm; None where it did not run.
    """

    settings: SolverSettings
    system: ElasticSystem
    boundary: ContactBoundary
    motions: RigidMotions
    data: RegularisedData
    law: FrictionLaw | None
    has_coulomb: bool
    first_sets: ActiveSets | None
    first_iteration: int
    natural_gamma: float
    history: History
    linear_algebra: str
    goal: Callable[[PETSc.Vec], float]
    start: tuple[Nodal, Nodal] | None = None
    rest: Rest | None = None
    step: int = 0
    x: PETSc.Vec = field(init=False)
    problem: ContactProblem = field(init=False)
    monolithic: bool = False
    regularisation_error: float | None = None

    def __post_init__(self) -> None:
        self.x = self.system.start.copy()
        self._regularised = self.problem = RegularisedProblem(self.system, self.boundary, self.motions)
        self._symmetric = self._newton(self._regularised)
        self._unsymmetric: SemismoothNewton | None = None
        self._exact: SemismoothNewton | None = None

    def _newton(self, problem: ContactProblem, *, symmetric: bool = True) -> SemismoothNewton:
        start = self.x if problem is self._regularised else problem.system.start.copy()
        return SemismoothNewton(
            problem,
            start,
            self.settings.max_iterations,
            self.history,
            symmetric=symmetric,
            climb=climb if self.settings.fallbacks else None,
            limited=_limited(self.settings, "max_iterations"),
        )

    @property
    def newton(self) -> SemismoothNewton:
        """The inner method on the regularised problem."""
        return self._symmetric

    @property
    def unsymmetric_newton(self) -> SemismoothNewton:
        """The same with an unsymmetric tangent, on the same iterate."""
        if self._unsymmetric is None:
            self._unsymmetric = self._newton(self._regularised, symmetric=False)
        return self._unsymmetric

    @property
    def exact_newton(self) -> SemismoothNewton:
        """The inner method on the unregularised problem, with an iterate of its own."""
        if self._exact is None:
            system, boundary = rotate(self.system, self.boundary)
            self._exact = self._newton(ExactProblem(system, boundary, self.boundary, self.motions))
        return self._exact

    @property
    def answer(self) -> SemismoothNewton:
        """The inner method whose iterate is the answer."""
        return self._symmetric if self.problem is self._regularised else self.exact_newton

    def displacement(self) -> PETSc.Vec:
        """All displacement dofs of the answer, counted from where the body rests."""
        return self.problem.system.displacement(self.answer.x)

    def contact(self) -> ContactState:
        """The contact nodes of this rank as the answer has them, displacements from where the body was at first."""
        problem = self.problem
        sets, data = problem.sets, problem.data
        u_n, u_t = problem.traces(self.answer.x)
        rest_n, rest_t = (0.0, 0.0) if self.rest is None else (self.rest.u_n, self.rest.u_t)
        pressure, shear = self.answer.multipliers()
        return ContactState(
            boundary=self.boundary,
            gap=data.gap + rest_n,
            u_n=u_n + rest_n,
            u_t=u_t + rest_t,
            pressure=pressure,
            shear=shear,
            # Of the law itself: the iteration may have stopped with the bound of the pressure before.
            bound=np.zeros_like(pressure) if not data.has_friction or self.law is None else self.law.bound(pressure),
            in_contact=sets.contact,
            slip=sets.slip,
            has_friction=data.has_friction,
            bilateral=np.zeros(self.boundary.size, dtype=bool) if data.bilateral is None else data.bilateral,
            slip_length=slip_of(u_t, data),
            xi=slip_multiplier(sets, shear, u_t, data) if data.has_friction else slip_of(u_t, data),
            lambda_hat=data.lambda_hat,
            mu_hat=data.mu_hat,
            compliance=(1 / data.gamma_n, 1 / data.gamma_t),
        )

    def begin_from(self, sets: ActiveSets, start: tuple[Nodal, Nodal]) -> None:
        """Start from sets and (lambda, mu) that another mesh, or fewer contact nodes, have led to."""
        self.first_sets, self.first_iteration, self.start = sets, 1, start

    def gave_up(self, status: Status) -> bool:
        """Whether a method has failed that was not told when to end."""
        limit = {Status.MAX_ITERATIONS: "max_iterations", Status.OUTER_MAX_ITERATIONS: "max_outer_iterations"}
        return status is Status.CYCLING or (status in limit and not _limited(self.settings, limit[status]))

    def restart(self, step: int, scale: float = 1.0) -> None:
        """Take the loads and prescribed displacements of a load step, times ``scale``, on the iterate that there is."""
        for problem in {id(p): p for p in (self._regularised, self.problem)}.values():
            problem.system.set_step(step, scale)
        fixed = self.system.fixed
        self.x.getArray()[fixed] = self.system.start.getArray(readonly=True)[fixed]
        self.problem = self._regularised

    def next_step(self) -> None:
        """Go on to the next load step: friction acts on what is added to the slip, from the shear that there is."""
        _, u_t = self.problem.traces(self.answer.x)
        pressure, shear = self.answer.multipliers()
        self.step += 1
        self.restart(self.step)
        self.data = replace(self.data, slip_origin=u_t)
        if self.law is not None:
            self.data = replace(self.data, mu_hat=shear, bound=self.law.bound(pressure))
        self.first_sets, self.first_iteration, self.start = None, 1, (pressure, shear)


def _limited(settings: SolverSettings, name: str) -> bool:
    """Whether a limit is lower than usual: then it is an end that was asked for, and no failure."""
    return bool(getattr(settings, name) < SolverSettings.model_fields[name].default)


def run(task: Task) -> Status:
    """Solve the current load step; the iterate, the sets and the data stay in the task."""
    if _nothing_acts(task):
        return _stay(task)
    coulomb = task.law if task.has_coulomb else None
    status = _given_friction(task, task.data) if coulomb is None else _coulomb(task, coulomb)
    if task.settings.fallbacks and task.gave_up(status) and task.settings.algorithm != "alm":
        status = _augmented(task, coulomb, status)
    elif task.settings.algorithm == "exact" and status is Status.CONVERGED:
        status = _exact(task)
        if task.settings.fallbacks and task.gave_up(status):  # but the problem with gamma was solved
            status = _augmented(task, coulomb, status, share=1.0)
    return status


def _augmented(task: Task, coulomb: FrictionLaw | None, failed: Status, share: float = _AUGMENTED_SHARE) -> Status:
    """The last resort on one mesh: augmentation, whose small gamma makes the easiest problems; the limit is the same
    for every gamma, and leaves no regularisation error.
    """
    s, newton = task.settings, task.newton
    task.problem = newton.problem
    share = max(share, min(1.0, START_GAMMA * task.natural_gamma / task.data.gamma_n))
    data = replace(task.data, gamma_n=share * task.data.gamma_n, gamma_t=share * task.data.gamma_t)
    task.history.add(f"{failed.value}: augmented Lagrangian with gamma_n = {data.gamma_n:.3g}")
    task.monolithic = False
    everywhere = ActiveSets.all_in_contact(task.boundary.size)
    if coulomb is None:
        status = augmented_lagrangian(
            newton, data, everywhere, first_iteration=1, tolerance=s.tolerance, max_outer=s.max_outer_iterations
        )
    else:
        start = _coulomb_start(task)
        status = newton.solve(replace(start, gamma_n=data.gamma_n, gamma_t=data.gamma_t), everywhere)
        if status is Status.CONVERGED:
            status = fixed_point(
                newton,
                data,
                coulomb,
                newton.multipliers(),
                None,
                tolerance=s.tolerance,
                max_outer=s.max_outer_iterations,
                shift=True,
            )
    if status is not Status.CONVERGED:
        return failed
    task.regularisation_error = None  # what path-following left is not left here
    return status


def _nothing_acts(task: Task) -> bool:
    """Whether the body stays where it is: held, no load, nothing prescribed, no penetration; collective."""
    data = task.data
    if task.step > 0 or task.motions.free.shape[1] > 0:
        return False
    if task.system.load.norm() > 0 or task.system.start.norm() > 0:
        return False
    pushed = data.gap < 0
    if data.bilateral is not None:
        pushed = pushed | (data.bilateral & (data.gap != 0))
    return not parallel.any_rank(task.system.comm, bool(pushed.any()))


def _stay(task: Task) -> Status:
    """Zero is the solution; nothing is solved for."""
    task.x.set(0.0)
    _touch_nothing(task)
    task.history.add("nothing loads the body: it stays where it is")
    task.history.add(OuterRecord(len(task.history.outer), 0, task.data.gamma_n, None, Status.CONVERGED.value))
    return Status.CONVERGED


def _touch_nothing(task: Task) -> None:
    """The sets of a body that nothing was solved for: no contact, hence no traction."""
    nodes = task.boundary.size
    task.problem.set_data(task.data, ActiveSets(np.zeros(nodes, dtype=bool), np.zeros(nodes, dtype=np.int8)))
    task.problem.sets = task.problem.following


def _given_friction(task: Task, data: RegularisedData) -> Status:
    """Frictionless or Tresca contact by the algorithm of the scene."""
    s, newton = task.settings, task.newton
    match s.algorithm:
        case "continuation":
            share = CONTINUATION_SHARE if s.gamma_first == "auto" else s.gamma_first / data.gamma_n
            gammas = [(data.gamma_n * factor, data.gamma_t * factor) for factor in (share, 1.0)]
            return continuation(newton, data, task.first_sets, gammas, first_iteration=task.first_iteration)
        case "path-following":
            # A later load step begins with the gamma that the one before has found.
            first = START_GAMMA * task.natural_gamma if task.step == 0 else data.gamma_n
            status, last, task.regularisation_error = path_following(
                newton,
                replace(data, gamma_n=first, gamma_t=first * data.gamma_t / data.gamma_n),
                task.first_sets,
                first_iteration=task.first_iteration,
                goal=lambda: task.goal(task.x),
                largest=LARGEST_GAMMA * task.natural_gamma,
                max_outer=s.max_outer_iterations,
            )
            task.data = replace(task.data, gamma_n=last.gamma_n, gamma_t=last.gamma_t)
            return status
        case "alm":
            return augmented_lagrangian(
                newton,
                data,
                task.first_sets,
                first_iteration=task.first_iteration,
                tolerance=s.tolerance,
                max_outer=s.max_outer_iterations,
                inner_iterations=None if s.inner_iterations == "auto" else s.inner_iterations,
                gamma_factor=s.gamma_factor,
            )
    return newton.solve(data, task.first_sets, first_iteration=task.first_iteration)


def _coulomb(task: Task, law: FrictionLaw) -> Status:
    """Coulomb friction, from what a coarser mesh or a load step has left, else from the pure contact problem."""
    s, newton = task.settings, task.newton
    first_sets, start = task.first_sets, task.start
    # These find their gamma, or go through several, on the pure contact problem of every mesh.
    finds_gamma = task.step == 0 and s.algorithm in ("path-following", "continuation")
    if start is None or finds_gamma:
        data = _coulomb_start(task)
        lost = _no_balance(task, law) if data.bound is not None else None
        if lost is not None:
            _touch_nothing(task)
            return lost
        if s.algorithm == "alm":  # (ALM-FP) shifts together with the bound, the start not at all
            status = newton.solve(data, first_sets, first_iteration=task.first_iteration)
        else:
            status = _given_friction(task, data)
        if status is not Status.CONVERGED:
            return status
        start, first_sets = newton.multipliers(), None
        if data.bound is None:  # this start knows no slip: mu = xi = 0, hence stick everywhere
            contact = task.problem.following.contact
            first_sets = ActiveSets(contact, np.zeros(contact.size, dtype=np.int8))
    data = replace(task.data, bound=law.given)
    state, sets = newton.x.copy(), task.problem.sets

    def fixed(damping: float = 1.0) -> Status:
        return fixed_point(
            newton,
            data,
            law,
            start,
            first_sets,
            tolerance=s.tolerance,
            max_outer=s.max_outer_iterations,
            shift=s.algorithm == "alm",
            damping=damping,
        )

    def monolithic() -> Status:
        task.monolithic = True
        if s.algorithm != "alm":
            return coulomb_newton(task.unsymmetric_newton, data, law, first_sets)
        return augmented_lagrangian(
            task.unsymmetric_newton,
            replace(data, bound=law.given, coupling=law.coefficient),
            first_sets,
            first_iteration=1,
            tolerance=s.tolerance,
            max_outer=s.max_outer_iterations,
        )

    # The monolithic tangent is unsymmetric, and knows neither a cap nor a pressure of either sign.
    smooth = law.cap is None and task.data.bilateral is None and task.system.unsymmetric
    started = s.coulomb == "auto" and task.start is not None and task.step == 0 and s.algorithm != "alm"
    ways: list[tuple[str, Callable[[], Status]]] = [("fixed point", fixed)]
    if smooth:
        ways.insert(0 if s.coulomb == "newton" or started else 1, ("monolithic Newton", monolithic))
    ways += [(f"fixed point damped by {damping:g}", partial(fixed, damping)) for damping in _DAMPING]
    # A fixed point is the fall-back of Newton's method anyway: that is what the setting says.
    needed = ways[0][1] is monolithic
    for place, (name, way) in enumerate(ways):
        if place > needed and not (s.fallbacks and task.gave_up(status)):
            break
        if place > 0:
            task.history.add(f"{status.value}: {name} from the same start")
            state.copy(newton.x)
            task.problem.sets = sets
            task.monolithic = False
        status = way()
        if status in (Status.CONVERGED, Status.SINGULAR):
            break
    return status


def _no_balance(task: Task, law: FrictionLaw) -> Status | None:
    """How a body that needs friction gets away, whatever friction the law may allow for; None: it does not."""
    everywhere: npt.NDArray[np.bool_] = np.ones(task.boundary.size, dtype=bool)
    held = task.motions.held_by(task.boundary, everywhere, everywhere)
    if task.data.bilateral is not None or task.motions.free.shape[1] == 0 or not held:
        return None  # what is not held at all has a name of its own, given by the iteration

    def balanced(data: RegularisedData) -> bool:
        return balance_exists(data, task.boundary, task.motions, task.system.resultant)

    if balanced(replace(task.data, bound=law.given, coupling=law.coefficient)):
        return None
    rough = replace(task.data, bound=np.full(task.boundary.size, np.inf))
    return Status.SLIDES if balanced(rough) else Status.OPEN


def _coulomb_start(task: Task) -> RegularisedData:
    """Section 7: the pure contact problem, g = 0; but a body that cannot do without friction starts from stick."""
    boundary = task.boundary
    everywhere: npt.NDArray[np.bool_] = np.ones(boundary.size, dtype=bool)
    frictionless = replace(task.data, bound=None)
    held = task.motions.held_by(boundary, everywhere, ~everywhere)
    if held and (
        task.motions.free.shape[1] == 0 or balance_exists(frictionless, boundary, task.motions, task.system.resultant)
    ):
        return frictionless
    return replace(task.data, bound=np.full(boundary.size, np.inf))


def _exact(task: Task) -> Status:
    """The unregularised limit, from the sets of the regularised solution."""
    sets = task.problem.sets
    pressure, _ = task.newton.multipliers()
    newton = task.exact_newton
    task.problem = newton.problem
    newton.x.getArray()[:] = newton.problem.system.start.getArray(readonly=True)
    bound = None if task.law is None else task.law.bound(pressure)
    data = replace(task.data, gamma_n=np.inf, gamma_t=np.inf, bound=bound)
    status = newton.solve(data, sets)
    if task.law is None or not task.has_coulomb or status is not Status.CONVERGED:
        return status
    s = task.settings
    start = newton.multipliers()
    return fixed_point(newton, data, task.law, start, None, tolerance=s.tolerance, max_outer=s.max_outer_iterations)
