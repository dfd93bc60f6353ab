"""What contact of two deformable bodies costs, beside one body on a rigid foundation and both bodies as one mesh.

    ./env python3 bench/two_bodies.py [--cells 12,20,28] [--gamma 1e5,1e7,1e9]

Two blocks of hexahedra, whose meshes do not match, with a gap of paraboloids between them, are pressed and sheared.
Printed are linear solves of the pair over those of one block on a rigid plane (half the gap, half the motion), CG steps
of a linear solve over those of both blocks as one mesh, each to 1e-8, for each gamma (E is 1000), and the CPU
times of the pairing, of the certificate and of the Coulomb solve over that of one linear solve of both as one.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx import ContactProblem, Coulomb, Foundation, Pair
from signorini_fx.body import paired_points
from signorini_fx.forms import contact_problem
from signorini_fx.linalg.multigrid import ContactPreconditioner

Floats = npt.NDArray[np.float64]

YOUNG, POISSON, COEFFICIENT, RADIUS = 1000.0, 0.3, 0.3, 5.0
PUSHED = (0.006, 0.003, -0.04)  # the displacement of the top against the bottom
EXACT = {"ksp_rtol": 1e-8, "ksp_norm_type": "unpreconditioned"}


@dataclass
class Clock:
    """CPU seconds of functions by their names, and how often they were called."""

    seconds: dict[str, float] = field(default_factory=dict)
    calls: dict[str, int] = field(default_factory=dict)

    def watched(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, whose time is taken."""

        def timed(*given: Any, **more: Any) -> Any:
            begin = time.process_time()
            try:
                return function(*given, **more)
            finally:
                self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - begin
                self.calls[name] = self.calls.get(name, 0) + 1

        return timed


def blocks(*bodies: tuple[int, float, float]) -> dmesh.Mesh:
    """Blocks on each other, each with so many cells along x and y, half of them along z, from a height to another."""
    cells: list[Floats] = []
    points: list[Floats] = []
    for count, low, high in bodies:
        across = np.linspace(-1.0, 1.0, count + 1)
        up = np.linspace(low, high, max(1, round(count * (high - low) / 2)) + 1)
        x = np.stack(np.meshgrid(across, across, up, indexing="ij"), axis=-1).reshape(-1, 3)
        row, column = len(up), len(up) * (count + 1)
        first = [i * column + j * row + k for i in range(count) for j in range(count) for k in range(len(up) - 1)]
        corners = [a * column + b * row + c for c in (0, 1) for b in (0, 1) for a in (0, 1)]
        cells.append(np.array(first)[:, None] + np.array(corners) + sum(map(len, points)))
        points.append(x)
    element = basix.ufl.element("Lagrange", "hexahedron", 1, shape=(3,))
    return dmesh.create_mesh(
        MPI.COMM_SELF, cells=np.concatenate(cells).astype(np.int64), x=np.concatenate(points), e=ufl.Mesh(element)
    )


def forms(mesh: dmesh.Mesh) -> tuple[fem.FunctionSpace, Any, Any]:
    """The space, a and L = 0."""
    space = fem.functionspace(mesh, ("Lagrange", 1, (3,)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    strain = ufl.sym(ufl.grad(u))
    stress = YOUNG / (1 + POISSON) * (strain + POISSON / (1 - 2 * POISSON) * ufl.tr(strain) * ufl.Identity(3))
    return (
        space,
        ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx,
        ufl.inner(fem.Constant(mesh, (0.0,) * 3), v) * ufl.dx,
    )


def held(space: fem.FunctionSpace, height: float, pushed: Sequence[float]) -> fem.DirichletBC:
    """All nodes at a height are moved."""
    nodes = fem.locate_dofs_geometrical(space, lambda x: np.isclose(x[2], height))
    return fem.dirichletbc(np.array(pushed), nodes, space)


def gap(x: Floats) -> Floats:
    """Between both bodies, nominally, length."""
    return np.asarray((x[0] ** 2 + x[1] ** 2) / (2 * RADIUS))


def sides(mesh: dmesh.Mesh) -> list[npt.NDArray[np.int32]]:
    """The facets at height 0 of the upper and of the lower body, as far as these are there."""
    found = dmesh.locate_entities_boundary(mesh, 2, lambda x: np.isclose(x[2], 0.0))
    mesh.topology.create_connectivity(2, 3)
    links = mesh.topology.connectivity(2, 3)
    cells = np.array([links.links(facet)[0] for facet in found], dtype=np.int32)
    above = dmesh.compute_midpoints(mesh, 3, cells)[:, 2] > 0
    return [found[above], found[~above]]


def contact(mesh: dmesh.Mesh, *, rigid: bool = False, **settings: Any) -> ContactProblem:
    """The pair, or the upper block on a rigid plane, solved."""
    space, a, L = forms(mesh)
    upper, lower = sides(mesh)
    share = 0.5 if rigid else 1.0
    bcs = [held(space, 1.0, [share * value for value in PUSHED])]
    law = Coulomb(COEFFICIENT)
    touching: Foundation | Pair = Foundation(upper, gap=lambda x: share * gap(x), friction=law)
    if not rigid:
        bcs.append(held(space, -1.0, (0.0, 0.0, 0.0)))
        touching = Pair(upper, lower, gap=gap, friction=law)
    problem = ContactProblem(a, L, bcs, contact=touching, linear_algebra="krylov", **settings)
    problem.solve()
    return problem


def as_one(count: int) -> tuple[int, int, float]:
    """Both blocks as one mesh: unknowns, CG steps to 1e-8 with GAMG, CPU seconds of assembly, set-up and solve."""
    mesh = blocks((count, -1.0, 1.0))
    space, a, L = forms(mesh)
    bcs = [held(space, 1.0, PUSHED), held(space, -1.0, (0.0, 0.0, 0.0))]
    a, L = fem.form(a), fem.form(L)
    begin = time.process_time()
    matrix = fem_petsc.assemble_matrix(a, bcs)
    matrix.assemble()
    matrix.setBlockSize(3)
    x = space.tabulate_dof_coordinates()
    modes = np.zeros((6, *x.shape))
    modes[range(3), :, range(3)] = 1.0
    for k in range(3):
        modes[3 + k] = np.cross(np.eye(3)[k], x)
    vectors = [PETSc.Vec().createWithArray(row) for row in np.linalg.qr(modes.reshape(6, -1).T)[0].T.copy()]
    matrix.setNearNullSpace(PETSc.NullSpace().create(vectors=vectors))
    load = fem_petsc.assemble_vector(L)
    fem_petsc.apply_lifting(load, [a], [bcs])
    for condition in bcs:
        condition.set(load.array_w)
    solver = PETSc.KSP().create()
    solver.setOperators(matrix)
    solver.setType(PETSc.KSP.Type.CG)
    solver.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    solver.setTolerances(rtol=1e-8)
    solver.getPC().setType(PETSc.PC.Type.GAMG)
    solver.solve(load, load.duplicate())
    return matrix.getSize()[0], solver.getIterationNumber(), time.process_time() - begin


def main() -> None:
    """Print a row for each mesh and gamma."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", default="8,12", help="cells along the lower block; the upper one has a quarter more")
    parser.add_argument("--gamma", default="1e5,1e7,1e9", help="stress per length")
    given = parser.parse_args()
    clock = Clock()
    paired_points.couple = clock.watched("pairing", paired_points.couple)
    contact_problem.certify = clock.watched("certificate", contact_problem.certify)
    ContactPreconditioner.apply = clock.watched("cycle", ContactPreconditioner.apply)  # type: ignore[method-assign]
    as_one(2), contact(blocks((2, -1.0, 0.0), (3, 0.0, 1.0)))  # which compiles
    print("unknowns  gamma  solves  on rigid  steps  as one  pairing  certificate  whole solve / one linear solve")
    for count in map(int, given.cells.split(",")):
        size = count * 5 // 4
        _, steps, once = as_one(round((count + size) / 2))
        rigid = contact(blocks((size, 0.0, 1.0)), rigid=True).history.linear_solves
        for factor in map(float, given.gamma.split(",")):
            mesh, stiff = (
                blocks((count, -1.0, 0.0), (size, 0.0, 1.0)),
                {"gamma_n": factor, "gamma_t": factor},
            )
            clock.seconds.clear()
            begin = time.process_time()
            problem = contact(mesh, **stiff)
            whole = time.process_time() - begin
            parts = [
                clock.seconds[name] / (whole - clock.seconds["certificate"]) for name in ("pairing", "certificate")
            ]
            clock.calls.clear()
            solves = problem.history.linear_solves
            exact = contact(mesh, **stiff, petsc_options=EXACT)
            each = clock.calls["cycle"] / exact.history.linear_solves
            print(
                f"{problem.u.x.array.size:8d} {factor:6.0e} {solves:7d} {rigid:9d} {each:6.1f} {steps:7d} "
                f"{parts[0]:8.1%} {parts[1]:12.1%} {(whole - clock.seconds['certificate'] / 2) / once:8.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
