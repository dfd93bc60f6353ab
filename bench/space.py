"""The block in space that three programs agree on: the package with multigrid, and one linear solve.

The linear solve is the same body held at the bottom: assemble, set up GAMG, CG to the residual at which the package
ends its own solves.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from once import stopwatch
from petsc4py import PETSc

from signorini_fx import solve
from signorini_fx.linalg import krylov, multigrid
from signorini_fx.linalg.mesh_levels import MeshLevel
from signorini_fx.mesh.tagged import TaggedMesh, generate_mesh
from signorini_fx.scene.model import Scene
from signorini_fx.scene.reading import parse_scene
from signorini_fx.tuned import KRYLOV_TOLERANCE

YOUNG, POISSON = 5000.0, 0.4
TRACTION = {"y": 4.0, "z": -20.0}  # on 1 <= x[0] <= 2 of the top
LAWS: dict[str, dict[str, Any]] = {
    "frictionless": {"law": "none"},
    "tresca": {"law": "tresca", "bound": 1.5},
    "coulomb": {"law": "coulomb", "coefficient": 0.3},
}
CELLS = ("hexahedron", "tetrahedron")


@dataclass(frozen=True)
class Run:
    """What a run leaves.

    Attributes:
        seconds: without the making of meshes.
        steps: of all Krylov solves on the finest mesh.
        set_ups: multigrid hierarchies, on all meshes.
        dofs: unknowns of the finest mesh.
        note: what the steps are made of.
        converged: whether there is a certified solution.
    """

    seconds: float
    steps: int
    set_ups: int
    dofs: int
    note: str = ""
    converged: bool = True


def parameters(nx: int, cell: str) -> dict[str, Any]:
    """The generator's parameters."""
    return {"length": 3.0, "width": 1.0, "height": 1.0, "nx": nx, "ny": nx // 3, "nz": nx // 3, "cell": cell}


def scene(law: str, nx: int, cell: str, gamma: float, levels: int) -> Scene:
    """The block 3 x 1 x 1 over a paraboloid, pressed in the middle of its top and pulled along x[1]."""
    loaded = {component: f"{value} if 1 <= x[0] <= 2 else 0" for component, value in TRACTION.items()}
    return parse_scene(
        {
            "mesh": {"generator": "box", "parameters": parameters(nx, cell)},
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

    def counted(matrix: PETSc.Mat, level: MeshLevel | None = None) -> multigrid.Hierarchy:
        sizes.append(matrix.getSize()[0])
        return create(matrix, level)

    krylov.KrylovSystem.configure = watched
    multigrid.Hierarchy.of = counted
    try:
        yield steps, sizes
    finally:
        krylov.KrylovSystem.configure, multigrid.Hierarchy.of = configure, create


def package(law: str, nx: int, cell: str, gamma: float, levels: int) -> Run:
    """The whole solve, all coarser meshes included, from the function space to the certificate."""
    with _watch() as (steps, sizes), stopwatch() as making:
        start = time.perf_counter()
        solution = solve(scene(law, nx, cell, gamma, levels), MPI.COMM_SELF, check=False)
        seconds = time.perf_counter() - start - sum(making)
    finest = max(size for size, _ in steps)
    spent = [count for size, count in steps if size == finest]
    note = f"steps of each solve on it {spent}"
    return Run(seconds, sum(spent), len(sizes), finest, note, solution.converged)


def linear(nx: int, cell: str) -> Run:
    """One linear solve."""
    tagged = generate_mesh("box", parameters(nx, cell), MPI.COMM_SELF)
    start = time.perf_counter()
    _space, matrix, load = _assemble(tagged)  # the space keeps the communicator of the load
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setType(PETSc.KSP.Type.CG)
    ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    ksp.setTolerances(rtol=KRYLOV_TOLERANCE, max_it=1000)
    ksp.getPC().setType(PETSc.PC.Type.GAMG)
    x = load.duplicate()
    ksp.solve(load, x)
    seconds = time.perf_counter() - start
    return Run(seconds, ksp.getIterationNumber(), 1, load.getSize(), converged=ksp.getConvergedReason() > 0)


def _assemble(tagged: TaggedMesh) -> tuple[fem.FunctionSpace, PETSc.Mat, PETSc.Vec]:
    """Function space, stiffness, with the rigid motions as its near null space, and load."""
    mesh = tagged.mesh
    space = fem.functionspace(mesh, ("Lagrange", 1, (3,)))
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
    for boundary, components in (("left", (0, 1)), ("right", (0, 1)), ("bottom", (0, 1, 2))):
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
    return space, matrix, vector
