"""The block in 3D: the package with multigrid, and one linear solve by CG with GAMG as users of
dolfinx write it.

The linear solve is the same body held at the bottom, to the residual at which the package ends its
own solves.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx import solve
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, generate_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.tuned import LEFT_BY_SOLVES

YOUNG, POISSON = 5000.0, 0.4
TRACTION = {"y": 4.0, "z": -20.0}  # on 1 <= x[0] <= 2 of the top
GAMMA = 1e7
LAWS: dict[str, dict[str, Any]] = {
    "frictionless": {"law": "none"},
    "tresca": {"law": "tresca", "bound": 1.5},
    "coulomb": {"law": "coulomb", "coefficient": 0.3},
}


@dataclass(frozen=True)
class Run:
    """The result of a run.

    Attributes:
        cpu: CPU seconds, on which other processes have little influence.
        dofs: unknowns of the finest mesh.
        note: Krylov steps, or linear solves of each mesh.
        converged: whether there is a solution, certified if it is of the package.
    """

    cpu: float
    dofs: int
    note: str
    converged: bool


def parameters(nx: int) -> dict[str, Any]:
    """The generator's parameters for hexahedra."""
    return {
        "length": 3.0,
        "width": 1.0,
        "height": 1.0,
        "nx": nx,
        "ny": nx // 3,
        "nz": nx // 3,
        "cell": "hexahedron",
    }


def levels(nx: int) -> int:
    """Meshes from one with 12 cells along the block, two at least, to one with ``nx``."""
    return max(2, 1 + round(np.log2(nx / 12)))


def scene(law: str, nx: int) -> Scene:
    """The block 3 x 1 x 1 over a paraboloid, pressed in the middle of its top and pulled along
    x[1].
    """
    loaded = {
        component: f"{value} if 1 <= x[0] <= 2 else 0" for component, value in TRACTION.items()
    }
    return parse_scene(
        {
            "mesh": {"generator": "box", "parameters": parameters(nx)},
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": [{"boundary": name, "x": 0.0, "y": 0.0} for name in ("left", "right")],
            "traction": {"boundary": "top", **loaded},
            "contact": {
                "boundary": "bottom",
                "gap": "0.003 * ((x[0] - 1.5)**2 + (x[1] - 0.5)**2) + 0.001",
                "friction": LAWS[law],
            },
            "solver": {
                "gamma_n": GAMMA,
                "gamma_t": GAMMA,
                "linear_algebra": "krylov",
                "levels": levels(nx),
            },
        }
    )


def package(law: str, nx: int) -> Run:
    """The whole solve, from the meshes, all coarser ones included, to the certificate."""
    start = time.process_time()
    solution = solve(scene(law, nx), MPI.COMM_SELF, check=False)
    cpu = time.process_time() - start
    note = f"linear solves {[level.linear_solves for level in solution.levels]}"
    return Run(cpu, solution.model.dofs, note, solution.converged)


def linear(nx: int) -> Run:
    """One linear solve: mesh, assembly, set-up of GAMG, CG."""
    start = time.process_time()
    tagged = generate_mesh("box", parameters(nx), MPI.COMM_SELF)
    _space, matrix, load = assemble(tagged, {"left": (0, 1), "right": (0, 1), "bottom": (0, 1, 2)})
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setType(PETSc.KSP.Type.CG)
    ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    ksp.setTolerances(rtol=LEFT_BY_SOLVES, max_it=1000)
    ksp.getPC().setType(PETSc.PC.Type.GAMG)
    x = load.duplicate()
    ksp.solve(load, x)
    cpu = time.process_time() - start
    return Run(
        cpu, load.getSize(), f"{ksp.getIterationNumber()} steps", ksp.getConvergedReason() > 0
    )


def assemble(
    tagged: TaggedMesh, held: dict[str, tuple[int, ...]]
) -> tuple[fem.FunctionSpace, PETSc.Mat, PETSc.Vec]:
    """Function space, which keeps the communicator, stiffness with the rigid motions as near null
    space, and load.
    """
    mesh = tagged.mesh
    space = fem.functionspace(mesh, ("Lagrange", 1, (3,)))
    y, z = ufl.TrialFunction(space), ufl.TestFunction(space)
    lame = fem.Constant(mesh, YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON))
    mu = fem.Constant(mesh, YOUNG / 2 / (1 + POISSON))
    strain, test = ufl.sym(ufl.grad(y)), ufl.sym(ufl.grad(z))
    stiffness = ufl.inner(lame * ufl.tr(strain) * ufl.Identity(3) + 2 * mu * strain, test) * ufl.dx
    ds = ufl.Measure(
        "ds", domain=mesh, subdomain_data=tagged.facet_tags, metadata={"quadrature_degree": 4}
    )
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
    return space, matrix, vector
