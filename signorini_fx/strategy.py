"""Which algorithms a scene runs, in which order: the only place that knows them all.

Two independent choices make a method.  ``algorithm`` says how the regularisation is treated: ``ssn`` (gamma fixed),
``continuation``, ``path-following``, ``alm``, ``exact``.  ``coulomb`` says how the friction bound meets the pressure:
``fp`` (fixed point of Tresca problems) or ``newton`` (monolithic).  (FP) of the paper is ssn with fp, (ALM-FP) alm with
fp.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.algorithms.alm import augmented_lagrangian
from signorini_fx.algorithms.continuation import continuation
from signorini_fx.algorithms.coulomb_newton import coulomb_newton
from signorini_fx.algorithms.fp import fixed_point
from signorini_fx.algorithms.path_following import path_following
from signorini_fx.algorithms.ssn import History, SemismoothNewton
from signorini_fx.boundary import ContactBoundary
from signorini_fx.complementarity import ActiveSets, FrictionLaw, RegularisedData
from signorini_fx.exact import ExactProblem
from signorini_fx.linalg import ElasticSystem
from signorini_fx.linalg.rotated import rotate
from signorini_fx.problem import ContactProblem, RegularisedProblem
from signorini_fx.results import Status
from signorini_fx.rigid import RigidMotions
from signorini_fx.scene import SolverSettings

# gamma above this times E / size of the body loses the last digits that double precision has for contact pressures.
LARGEST_GAMMA = 1e9


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
        first_sets: sets of the first linear solve.
        first_iteration: its number.
        natural_gamma: E over the size of the body, the natural unit of gamma.
        history: records.
        goal: the regularisation error that path-following may leave, in the energy norm, judged at an iterate.
        x: the iterate.
        problem: the problem that was solved last.
        regularisation_error: what path-following says is left, in the energy norm; None where it did not run.
    """

    settings: SolverSettings
    system: ElasticSystem
    boundary: ContactBoundary
    motions: RigidMotions
    data: RegularisedData
    law: FrictionLaw | None
    has_coulomb: bool
    first_sets: ActiveSets
    first_iteration: int
    natural_gamma: float
    history: History
    goal: Callable[[PETSc.Vec], float]
    x: PETSc.Vec = field(init=False)
    problem: ContactProblem = field(init=False)
    regularisation_error: float | None = None

    def __post_init__(self) -> None:
        self.x = self.system.start.copy()
        self.problem = RegularisedProblem(self.system, self.boundary)

    def newton(self, problem: ContactProblem, *, symmetric: bool = True) -> SemismoothNewton:
        """The inner method on ``problem``, working on the shared iterate."""
        return SemismoothNewton(
            problem, self.motions, self.x, self.settings.max_iterations, self.history, symmetric=symmetric
        )

    def displacement(self) -> PETSc.Vec:
        """All displacement dofs of the iterate."""
        return self.system.displacement(self.x)


def run(task: Task) -> Status:
    """Solve the task; the iterate, the sets and the data stay in it."""
    newton = task.newton(task.problem)
    if task.law is None or not task.has_coulomb:
        status = _given_friction(task, newton, task.data)
    else:
        status = _coulomb(task, newton, task.law)
    if task.settings.algorithm == "exact" and status is Status.CONVERGED:
        status = _exact(task)
    return status


def _given_friction(task: Task, newton: SemismoothNewton, data: RegularisedData) -> Status:
    """Frictionless or Tresca contact by the algorithm of the scene."""
    s = task.settings
    match s.algorithm:
        case "continuation":
            steps = [(data.gamma_n * factor, data.gamma_t * factor) for factor in _continuation_factors(task)]
            return continuation(newton, data, task.first_sets, steps, first_iteration=task.first_iteration)
        case "path-following":
            ratio = data.gamma_t / data.gamma_n
            start = replace(data, gamma_n=_START_GAMMA * task.natural_gamma)
            status, task.data, task.regularisation_error = path_following(
                newton,
                replace(start, gamma_t=start.gamma_n * ratio),
                task.first_sets,
                first_iteration=task.first_iteration,
                goal=lambda: task.goal(task.x),
                largest=LARGEST_GAMMA * task.natural_gamma,
                max_outer=s.max_outer_iterations,
            )
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


# Path-following begins where the penetration is about a hundredth of the displacements.
_START_GAMMA = 100.0


def _continuation_factors(task: Task) -> list[float]:
    """From the first gamma of the scene to its gamma; by default the step of Table 4."""
    first = task.settings.gamma_first
    return [1e-4, 1.0] if first == "auto" else [first / task.data.gamma_n, 1.0]


def _coulomb(task: Task, newton: SemismoothNewton, law: FrictionLaw) -> Status:
    """Coulomb friction, from the solution of the pure contact problem."""
    s = task.settings
    start = _coulomb_start(task)
    if s.algorithm == "alm":  # (ALM-FP) shifts together with the bound, the start not at all
        status = newton.solve(start, task.first_sets, first_iteration=task.first_iteration)
    else:
        status = _given_friction(task, newton, start)
    if status is not Status.CONVERGED:
        return status
    data = replace(task.problem.data, bound=law.given)

    def fixed() -> Status:
        return fixed_point(
            newton, data, law, tolerance=s.tolerance, max_outer=s.max_outer_iterations, shift=s.algorithm == "alm"
        )

    if s.coulomb != "newton" or s.algorithm == "alm":
        return fixed()
    return coulomb_newton(task.newton(task.problem, symmetric=False), data, law, fixed)


def _coulomb_start(task: Task) -> RegularisedData:
    """Section 7: the pure contact problem, g = 0; but a body that only friction holds sideways starts from stick."""
    boundary = task.boundary
    everywhere: npt.NDArray[np.bool_] = np.ones(boundary.size, dtype=bool)
    if task.motions.held_by(boundary, everywhere, ~everywhere):
        return replace(task.data, bound=None)
    return replace(task.data, bound=np.full(boundary.size, np.inf))


def _exact(task: Task) -> Status:
    """The unregularised limit, from the sets of the regularised solution."""
    sets = task.problem.sets
    pressure, _ = task.problem.multipliers(task.x, sets)
    system, boundary = rotate(task.system, task.boundary)
    if system is not task.system:
        # The turned start differs from the solution found, but an iterate follows from its sets alone.
        task.x = system.start.copy()
    task.system, task.problem = system, ExactProblem(system, boundary)
    newton = task.newton(task.problem)
    bound = None if task.law is None else task.law.bound(pressure)
    data = replace(task.data, gamma_n=np.inf, gamma_t=np.inf, bound=bound)
    status = newton.solve(data, sets)
    if task.law is None or not task.has_coulomb or status is not Status.CONVERGED:
        return status
    s = task.settings
    return fixed_point(newton, data, task.law, tolerance=s.tolerance, max_outer=s.max_outer_iterations)
