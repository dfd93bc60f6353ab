"""The one entry point: a scene in, a solution out; the same outcome on every rank."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.algorithms.fp import fixed_point
from signorini_fx.algorithms.ssn import OPTIONS_PREFIX, History, SemismoothNewton
from signorini_fx.boundary import ContactBoundary
from signorini_fx.complementarity import (
    ActiveSets,
    FrictionLaw,
    Nodal,
    RegularisedData,
    contact_pressure,
    tangential_traction,
)
from signorini_fx.discretisation import Discretisation, discretise
from signorini_fx.errors import ConvergenceError, SceneError
from signorini_fx.expressions import sample
from signorini_fx.linalg import ElasticSystem
from signorini_fx.linalg.full import FullSystem
from signorini_fx.mesh import load_mesh
from signorini_fx.problem import RegularisedProblem
from signorini_fx.quantities import Certificate, ContactState, certify
from signorini_fx.results import Status, Timings
from signorini_fx.scene import Box, CoulombFriction, Scene, TrescaFriction, friction_acts

# gamma = this times E / size of the body: penetration of about 1e-5 of the displacements, far from round-off.
_AUTOMATIC_GAMMA = 1e5


@dataclass(frozen=True)
class Solution:
    """The result of a solve.

    Attributes:
        scene: what was solved.
        status: how it ended; only ``Status.CONVERGED`` is a solution.
        algorithm: ``linear``, ``ssn`` or ``fp``.
        discretisation: mesh, space and operators.
        displacement: y, a finite element function.
        contact: nodal state of the contact boundary of this rank, None for a scene without contact.
        certificate: the conditions of the problem, checked anew after the solve.
        history: every linear solve and every regularised problem.
        parameters: gamma_n, gamma_t, sigma in force.
        timings: wall seconds by phase, on this rank.
    """

    scene: Scene
    status: Status
    algorithm: str
    discretisation: Discretisation
    displacement: fem.Function
    contact: ContactState | None
    certificate: Certificate
    history: History
    parameters: dict[str, float] = field(default_factory=dict)
    timings: Timings = field(default_factory=Timings)

    @property
    def converged(self) -> bool:
        """Whether this is a solution, certificate included."""
        return self.status is Status.CONVERGED

    @property
    def comm(self) -> MPI.Comm:
        """The ranks that share the solution."""
        comm: MPI.Comm = self.discretisation.tagged.mesh.comm
        return comm


def solve(
    scene: Scene,
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    check: bool = True,
    observers: Sequence[Callable[[Any], None]] = (),
) -> Solution:
    """Solve a scene.

    Args:
        scene: from ``read_scene`` or built in Python.
        comm: the ranks that share the work; the call is collective.
        check: raise if no solution was reached; otherwise look at ``Solution.status``.
        observers: called with each ``IterationRecord`` and ``OuterRecord`` as it happens.

    Raises:
        SceneError: the scene does not fit its mesh.
        MeshError: the mesh cannot be had.
        ConvergenceError: no solution was reached; it carries the last iterate.
    """
    timings = Timings()
    with timings.phase("mesh"):
        tagged = load_mesh(scene, comm)
    discretisation = discretise(scene, tagged, timings)
    history = History(observers=list(observers))
    with timings.phase("iterate"):
        if discretisation.boundary is None:
            status, x = _linear_solve(discretisation)
            algorithm, contact, parameters = "linear", None, {}
        else:
            status, x, algorithm, contact, parameters = _contact_solve(discretisation, discretisation.boundary, history)
    with timings.phase("certify"):
        displacement = discretisation.function(x)
        certificate = certify(discretisation, displacement, contact)
        if status is Status.CONVERGED and not certificate.holds:
            status = Status.NOT_CERTIFIED
    solution = Solution(
        scene, status, algorithm, discretisation, displacement, contact, certificate, history, parameters, timings
    )
    if check and not solution.converged:
        raise ConvergenceError(solution)
    return solution


def _linear_solve(discretisation: Discretisation) -> tuple[Status, PETSc.Vec]:
    """A scene without contact: one factorisation, one solve, no SNES."""
    system = FullSystem.of(discretisation)
    x = system.start.copy()
    if discretisation.motions.free.shape[1] > 0:
        return Status.NOT_HELD, x
    ksp = PETSc.KSP().create(system.comm)
    ksp.setOptionsPrefix(OPTIONS_PREFIX)
    system.configure(ksp, symmetric=True)
    ksp.setOperators(system.matrix)
    ksp.setFromOptions()
    ksp.solve(system.load, x)
    return (Status.CONVERGED if ksp.getConvergedReason() > 0 else Status.SINGULAR), x


def _contact_solve(
    discretisation: Discretisation, boundary: ContactBoundary, history: History
) -> tuple[Status, PETSc.Vec, str, ContactState, dict[str, float]]:
    scene = discretisation.scene
    system: ElasticSystem = FullSystem.of(discretisation)
    law = _friction_law(scene, boundary)
    data = _regularised_data(scene, discretisation, boundary, law)
    problem = RegularisedProblem(system, boundary)
    newton = SemismoothNewton(problem, discretisation.motions, scene.solver.max_iterations, history)
    first_sets, first_iteration = _first_sets(scene, boundary)
    algorithm = _algorithm(scene)
    start = data
    if algorithm == "fp" and law is not None:
        start = _fixed_point_start(discretisation, data, law)
    status = newton.solve(start, first_sets, first_iteration=first_iteration)
    if algorithm == "fp" and law is not None and status is Status.CONVERGED:
        settings = scene.solver
        status = fixed_point(
            newton, data, law, tolerance=settings.tolerance, max_outer=settings.max_outer_iterations
        )
    contact = _contact_state(newton, boundary, problem.data)
    parameters = {"gamma_n": data.gamma_n, "gamma_t": data.gamma_t, "sigma": data.sigma}
    return status, newton.x, algorithm, contact, parameters


def _algorithm(scene: Scene) -> str:
    """What the scene needs, or what it asks for if that can solve it."""
    needed = "fp" if scene.has_coulomb else "ssn"
    wanted = scene.solver.algorithm
    if wanted == "ssn" and needed == "fp":
        raise SceneError([("solver.algorithm", "ssn alone cannot solve Coulomb friction: use fp or auto")])
    return needed


def _friction_law(scene: Scene, boundary: ContactBoundary) -> FrictionLaw | None:
    """Nodal data of the friction laws; None where no law can act."""
    if not scene.has_friction:
        return None
    given, coefficient = np.zeros(boundary.size), np.zeros(boundary.size)
    for index, effect in enumerate(scene.contact):
        here = boundary.part == index
        path = f"contact[{index}].friction"
        match effect.friction:
            case TrescaFriction(bound=value) if friction_acts(effect.friction):
                given[here] = _nodal(value, boundary, here, f"{path}.bound", minimum=0.0)
            case CoulombFriction(coefficient=value) if friction_acts(effect.friction):
                coefficient[here] = _nodal(value, boundary, here, f"{path}.coefficient", minimum=0.0)
    return FrictionLaw(given, coefficient)


def _regularised_data(
    scene: Scene, discretisation: Discretisation, boundary: ContactBoundary, law: FrictionLaw | None
) -> RegularisedData:
    gap = np.zeros(boundary.size)
    for index, effect in enumerate(scene.contact):
        here = boundary.part == index
        gap[here] = _nodal(effect.gap, boundary, here, f"contact[{index}].gap", minimum=-np.inf)
    automatic = _AUTOMATIC_GAMMA * scene.material.young / discretisation.tagged.size
    settings = scene.solver
    zero = np.zeros(boundary.size)
    return RegularisedData(
        gap=gap,
        gamma_n=automatic if settings.gamma_n == "auto" else settings.gamma_n,
        gamma_t=automatic if settings.gamma_t == "auto" else settings.gamma_t,
        sigma=np.inf if settings.sigma == "auto" else settings.sigma,
        lambda_hat=zero,
        mu_hat=zero,
        bound=None if law is None else law.given,
    )


def _nodal(
    value: Any, boundary: ContactBoundary, here: npt.NDArray[np.bool_], path: str, *, minimum: float
) -> Nodal:
    """Values at the nodes ``here``, checked on all ranks together."""
    points = np.zeros((3, int(np.count_nonzero(here))))
    points[:2] = boundary.x[here].T
    values = sample(value, points)
    bad = np.flatnonzero(~np.isfinite(values) | (values < minimum))
    error = None
    if bad.size:
        x, y = points[:2, bad[0]]
        wanted = "finite" if minimum == -np.inf else "finite and not negative"
        error = SceneError([(path, f"is {values[bad[0]]:g} at ({x:g}, {y:g}); it must be {wanted}")])
    parallel.raise_together(boundary.comm, error)
    return values


def _first_sets(scene: Scene, boundary: ContactBoundary) -> tuple[ActiveSets, int]:
    """The sets of the first linear solve and its number (section 7: a solve that only makes the start has number 0)."""
    region = scene.solver.initial_contact
    every = ActiveSets.all_in_contact(boundary.size)
    if isinstance(region, str):
        return every, 0
    if isinstance(region, Box):
        near = 1e-9 * np.ptp(parallel.gather_rows(boundary.comm, boundary.x), axis=0).max()
        inside = np.ones(boundary.size, dtype=bool)
        for axis, (low, high) in enumerate((region.x, region.y)):
            inside &= (boundary.x[:, axis] >= low - near) & (boundary.x[:, axis] <= high + near)
    else:
        points = np.zeros((3, boundary.size))
        points[:2] = boundary.x.T
        inside = sample(region, points) > 0
    if parallel.global_sum(boundary.comm, np.array(np.count_nonzero(inside))) == 0:
        raise SceneError([("solver.initial_contact", "holds no contact node")])
    return ActiveSets(inside, every.slip), 1


def _fixed_point_start(discretisation: Discretisation, data: RegularisedData, law: FrictionLaw) -> RegularisedData:
    """Section 7: the pure contact problem, g = 0; but a body that only friction holds sideways starts from stick."""
    from dataclasses import replace

    boundary = discretisation.boundary
    assert boundary is not None
    everywhere = np.ones(boundary.size, dtype=bool)
    if discretisation.motions.held_by(boundary, everywhere, ~everywhere):
        return replace(data, bound=None)
    return replace(data, bound=np.full(boundary.size, np.inf))


def _contact_state(newton: SemismoothNewton, boundary: ContactBoundary, data: RegularisedData) -> ContactState:
    sets = newton.problem.sets
    u_n, u_t = newton.problem.traces(newton.x)
    return ContactState(
        boundary=boundary,
        gap=data.gap,
        u_n=u_n,
        u_t=u_t,
        pressure=contact_pressure(sets, u_n, data),
        shear=tangential_traction(sets, u_t, data),
        bound=data.bound if data.bound is not None else np.zeros(boundary.size),
        in_contact=sets.contact,
        slip=sets.slip,
        has_friction=data.has_friction,
    )
