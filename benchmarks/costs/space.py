"""The block in 3D: the package with multigrid, one linear solve, and the form in which all programs answer.

The linear solve is the same body held at the bottom: assemble, set up GAMG, CG to the residual at which the package
ends its own solves.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from once import stopwatch
from petsc4py import PETSc

from signorini_fx import solve, sweep
from signorini_fx.algebra.linalg import krylov, multigrid
from signorini_fx.algebra.linalg.elasticity import Level
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, generate_mesh
from signorini_fx.records import Status
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.tuned import KRYLOV_TOLERANCE

YOUNG, POISSON = 5000.0, 0.4
TRACTION = {"y": 4.0, "z": -20.0}  # on 1 <= x[0] <= 2 of the top
LAWS: dict[str, dict[str, Any]] = {
    "frictionless": {"law": "none"},
    "tresca": {"law": "tresca", "bound": 1.5},
    "coulomb": {"law": "coulomb", "coefficient": 0.3},
}
CELLS = ("hexahedron", "tetrahedron")
MIDDLE = (1.5, 0.5, 1.0)  # of the top, where the deflection is measured

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Answer:
    """The answer of every program for the block.

    Attributes:
        deflection: u_z in the middle of the top, length.
        force: resultant of the foundation on the body, shape (3,).
        x: the contact nodes in 2D of the bottom, shape (n, 2), ordered along x[0], then x[1].
        contact: nodes in contact.
        slip: nodes that slip; none without friction, nor where the bound is zero.
    """

    deflection: float
    force: Floats
    x: Floats
    contact: Flags
    slip: Flags

    @classmethod
    def at(cls, deflection: float, force: Floats, x: Floats, contact: Flags, slip: Flags) -> Answer:
        """From nodes in any order."""
        order = np.lexsort(np.round(x[:, 1::-1], 9).T)
        return cls(deflection, force, x[order, :2], contact[order], slip[order])

    @classmethod
    def of(cls, solution: Solution) -> Answer:
        """The package's."""
        c = solution.contact
        assert c is not None
        y = solution.displacement
        values = y.x.array.reshape(-1, 3)
        deflection = float(values[node_at(y.function_space, MIDDLE), 2])
        force = np.sum(c.forces, axis=0)
        slip = (np.linalg.norm(c.direction, axis=1) > 0.5) & (c.bound > 0)
        return cls.at(deflection, force, c.boundary.x, c.in_contact, slip)

    def far(self, other: Answer) -> tuple[float, float, int, int]:
        """Differences of deflection and force, relative; numbers of nodes in other sets, contact and slip.

        Raises:
            ValueError: the other one is for another mesh.
        """
        if self.x.shape != other.x.shape or np.abs(self.x - other.x).max() > 1e-9:
            raise ValueError("answers on two meshes are not compared")
        deflection = abs(other.deflection - self.deflection) / abs(self.deflection)
        force = float(np.linalg.norm(other.force - self.force) / np.linalg.norm(self.force))
        sets = (np.count_nonzero(self.contact != other.contact), np.count_nonzero(self.slip != other.slip))
        return deflection, force, *map(int, sets)


def node_at(space: fem.FunctionSpace, place: tuple[float, float, float]) -> int:
    """The node at a place of a mesh in one piece; one rank."""
    return int(np.argmin(np.linalg.norm(space.tabulate_dof_coordinates() - np.array(place), axis=1)))


@dataclass(frozen=True)
class Run:
    """The result of a run.

    Attributes:
        seconds: without the making of meshes.
        cpu: CPU seconds of the same, on which other processes have little influence.
        steps: of all Krylov solves on the finest mesh.
        set_ups: multigrid hierarchies, on all meshes.
        dofs: unknowns of the finest mesh.
        note: the steps of each solve.
        converged: whether there is a certified solution.
        answer: of programs that solve the contact problem.
    """

    seconds: float
    cpu: float
    steps: int
    set_ups: int
    dofs: int
    note: str = ""
    converged: bool = True
    answer: Answer | None = None


def parameters(nx: int, cell: str, height: int = 1) -> dict[str, Any]:
    """The generator's parameters; ``height``: of the block."""
    sizes = {"length": 3.0, "width": 1.0, "height": float(height)}
    return {**sizes, "nx": nx, "ny": nx // 3, "nz": height * (nx // 3), "cell": cell}


def scene(law: str, nx: int, cell: str, gamma: float, levels: int, degree: int = 1) -> Scene:
    """The block 3 x 1 x 1 over a paraboloid, pressed in the middle of its top and pulled along x[1]."""
    loaded = {component: f"{value} if 1 <= x[0] <= 2 else 0" for component, value in TRACTION.items()}
    return parse_scene(
        {
            "mesh": {"generator": "box", "parameters": parameters(nx, cell)},
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": [{"boundary": name, "x": 0.0, "y": 0.0} for name in ("left", "right")],
            "traction": {"boundary": "top", **loaded},
            "contact": {
                "boundary": "bottom",
                "gap": "0.003 * ((x[0] - 1.5)**2 + (x[1] - 0.5)**2) + 0.001",
                "friction": LAWS[law],
            },
            "solver": {"gamma_n": gamma, "gamma_t": gamma, "linear_algebra": "krylov", "levels": levels},
        }
    )


@contextmanager
def _watch() -> Iterator[tuple[list[tuple[int, int]], list[int]]]:
    """Unknowns and steps of each Krylov solve, and the sizes of the hierarchies that are set up."""
    steps: list[tuple[int, int]] = []
    sizes: list[int] = []
    configure, create = krylov.KrylovSystem.configure, multigrid.Hierarchy.of

    def watched(self: krylov.KrylovSystem, ksp: PETSc.KSP, **how: Any) -> None:
        configure(self, ksp, **how)
        ksp.setPostSolve(lambda solver, b, _x: steps.append((b.getSize(), solver.getIterationNumber())))

    def counted(matrix: PETSc.Mat, level: Level | None = None) -> multigrid.Hierarchy:
        sizes.append(matrix.getSize()[0])
        return create(matrix, level)

    krylov.KrylovSystem.configure = watched
    multigrid.Hierarchy.of = counted
    try:
        yield steps, sizes
    finally:
        krylov.KrylovSystem.configure, multigrid.Hierarchy.of = configure, create


def package(law: str, nx: int, cell: str, gamma: float, levels: int, degree: int = 1) -> Run:
    """The whole solve, all coarser meshes included, from the function space to the certificate."""
    with _watch() as (steps, sizes), stopwatch() as making, stopwatch(time.process_time) as burnt:
        start, cpu = time.perf_counter(), time.process_time()
        solution = solve(scene(law, nx, cell, gamma, levels, degree), MPI.COMM_SELF, check=False)
        seconds, cpu = time.perf_counter() - start - sum(making), time.process_time() - cpu - sum(burnt)
    finest = max(size for size, _ in steps)
    spent = [count for size, count in steps if size == finest]
    note = f"steps of each solve on it {spent}"
    return Run(seconds, cpu, sum(spent), len(sizes), finest, note, solution.converged, Answer.of(solution))


def linear(nx: int, cell: str, height: int = 1, degree: int = 1) -> Run:
    """One linear solve."""
    tagged = generate_mesh("box", parameters(nx, cell, height), MPI.COMM_SELF)
    start, cpu = time.perf_counter(), time.process_time()
    held = {"left": (0, 1), "right": (0, 1), "bottom": (0, 1, 2)}
    _space, matrix, load, _fixed = assemble(tagged, held, degree)  # the space keeps the communicator of the load
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setType(PETSc.KSP.Type.CG)
    ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    ksp.setTolerances(rtol=KRYLOV_TOLERANCE, max_it=1000)
    ksp.getPC().setType(PETSc.PC.Type.GAMG)
    x = load.duplicate()
    ksp.solve(load, x)
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    return Run(seconds, cpu, ksp.getIterationNumber(), 1, load.getSize(), converged=ksp.getConvergedReason() > 0)


def sweep_coefficients(nx: int, gamma: float, coefficients: Sequence[float], levels: int) -> Run:
    """Coulomb friction with all coefficients, from the mesh to the last contact state, with all coarser meshes."""
    made = scene("coulomb", nx, CELLS[0], gamma, levels)
    with _watch() as (steps, sizes):
        start, cpu = time.perf_counter(), time.process_time()
        points = sweep(made, MPI.COMM_SELF, coefficients=coefficients)
        seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    spent = sum(count for _, count in steps)
    note = f"{sum(point.linear_solves for point in points)} linear solves, {spent} Krylov steps"
    converged = all(point.status is Status.CONVERGED for point in points)
    return Run(seconds, cpu, spent, len(sizes), max(size for size, _ in steps), note, converged)


def assemble(
    tagged: TaggedMesh, held: dict[str, tuple[int, ...]], degree: int = 1
) -> tuple[fem.FunctionSpace, PETSc.Mat, PETSc.Vec, list[fem.DirichletBC]]:
    """Function space, stiffness, with the rigid motions as its near null space, load, and what is fixed."""
    mesh = tagged.mesh
    space = fem.functionspace(mesh, ("Lagrange", degree, (3,)))
    y, z = ufl.TrialFunction(space), ufl.TestFunction(space)
    lame = fem.Constant(mesh, YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON))
    mu = fem.Constant(mesh, YOUNG / 2 / (1 + POISSON))
    strain, test = ufl.sym(ufl.grad(y)), ufl.sym(ufl.grad(z))
    stiffness = ufl.inner(lame * ufl.tr(strain) * ufl.Identity(3) + 2 * mu * strain, test) * ufl.dx
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tagged.facet_tags, metadata={"quadrature_degree": 4})
    x = ufl.SpatialCoordinate(mesh)
    middle = ufl.conditional(ufl.And(ufl.ge(x[0], 1.0), ufl.le(x[0], 2.0)), 1.0, 0.0)
    force = ufl.as_vector((0.0, TRACTION["y"], TRACTION["z"]))
    load = middle * ufl.inner(force, z) * ds(tagged.boundaries["top"])
    fixed = []
    for boundary, components in held.items():
        for component in components:
            part = space.sub(component)
            dofs = fem.locate_dofs_topological(part, 2, tagged.facets(boundary))
            fixed.append(fem.dirichletbc(PETSc.ScalarType(0.0), dofs, part))
    matrix = fem_petsc.assemble_matrix(fem.form(stiffness), fixed, YOUNG)
    matrix.assemble()
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    vector = fem_petsc.assemble_vector(fem.form(load))
    fem_petsc.set_bc(vector, fixed)
    place = space.tabulate_dof_coordinates() - np.array([1.5, 0.5, 0.5])
    modes = np.zeros((6, len(place), 3))
    for k in range(3):
        modes[k, :, k] = 1.0
        modes[3 + k] = np.cross(np.eye(3)[k], place)
    orthonormal = np.linalg.qr(modes.reshape(6, -1).T)[0]
    vectors = [matrix.createVecRight() for _ in range(6)]
    for k, one in enumerate(vectors):
        one.getArray()[:] = orthonormal[:, k]
    matrix.setNearNullSpace(PETSc.NullSpace().create(vectors=vectors, comm=matrix.comm))
    return space, matrix, vector, fixed
