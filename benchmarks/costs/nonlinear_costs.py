"""What contact costs a nonlinear body: the same load steps solved with contact, and with the contact known.

    ./env python3 benchmarks/costs/nonlinear_costs.py [--scale 1] [--rounds 3] >> docs/evidence/nonlinear_costs.csv

Where it is known, the nodes on which contact acts at the end of one of the load steps are moved as contact moves them:
what is left is Newton's method for the body, by dolfinx and a Cholesky factorisation of MUMPS alone.  Forms and mesh
are the same.  Iterations are those of Newton's method, each with a new tangent, but for those of contact that keep the
last one.  CPU times are of one thread, the least of some rounds, without compiling forms.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem, Pair
from signorini_fx.forms.nonlinear.step_sizes import RampStep

Floats = npt.NDArray[np.float64]

_ACTS = 1e-8  # of the largest nodal force: what acts on a node
_SMALL = 1e-8  # of the displacement: the last increment
_MOST = 20  # iterations


@dataclass(frozen=True)
class Problem:
    """Bodies, and how they are moved.

    Attributes:
        title: of the rows.
        u: the displacement.
        F: the residual.
        bcs: conditions, with values that ``move`` changes.
        contact: a foundation or a pair.
        move: takes a solver and a time to where they are then.
        times: of the load steps.
    """

    title: str
    u: fem.Function
    F: Any
    bcs: list[fem.DirichletBC]
    contact: Foundation | Pair
    move: Callable[[NonlinearContactProblem, float], None]
    times: Sequence[float]


@dataclass(frozen=True)
class Cost:
    """Of all load steps.

    Attributes:
        steps: load steps.
        iterations: of Newton's method.
        solves: linear solves.
        cpu: seconds.
    """

    steps: int
    iterations: int
    solves: int
    cpu: float

    @property
    def cells(self) -> list[str]:
        """Of a row."""
        return [str(self.steps), str(self.iterations), str(self.solves), f"{self.cpu:.2f}"]


def rubber(u: fem.Function, shear: Any) -> Any:
    """The residual of a neo-Hookean body."""
    dim = u.function_space.mesh.geometry.dim
    gradient = ufl.Identity(dim) + ufl.grad(u)
    volume = ufl.det(gradient)
    energy = shear / 2 * (ufl.inner(gradient, gradient) - dim - 2 * ufl.ln(volume) + 3 * ufl.ln(volume) ** 2)
    return ufl.derivative(energy * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(u.function_space))


def facets_at(mesh: dmesh.Mesh, where: Callable[[Floats], Floats]) -> npt.NDArray[np.int32]:
    """Exterior facets on which a function is zero."""
    return dmesh.locate_entities_boundary(mesh, mesh.topology.dim - 1, lambda x: np.isclose(where(x), 0.0))


def held(u: fem.Function, facets: npt.NDArray[np.int32], value: Any) -> fem.DirichletBC:
    """A condition on facets."""
    space = u.function_space
    return fem.dirichletbc(value, fem.locate_dofs_topological(space, space.mesh.topology.dim - 1, facets), space)


def ploughing(scale: int) -> Problem:
    """A circle pressed into a block in 2D, and moved over it."""
    size = [[0.0, 0.0], [4.0, 1.0]]
    mesh = dmesh.create_rectangle(MPI.COMM_SELF, size, [48 * scale, 12 * scale], dmesh.CellType.quadrilateral)
    u = fem.Function(fem.functionspace(mesh, ("Lagrange", 1, (2,))))
    circle = {"shape": "circle", "centre": (1.5, 1.5), "radius": 0.5}

    def move(solver: NonlinearContactProblem, t: float) -> None:
        solver.place(0, shift=(max(0.0, t - 3.0) / 10, -min(t, 3.0) / 12))

    bottom, top = facets_at(mesh, lambda x: x[1]), facets_at(mesh, lambda x: x[1] - 1.0)
    contact = Foundation(top, shape=circle, friction=Coulomb(0.3))
    return Problem(
        "circle on rubber, plane", u, rubber(u, 40.0), [held(u, bottom, np.zeros(2))], contact, move, range(1, 9)
    )


def indentation(scale: int) -> Problem:
    """A sphere pressed into a block in 3D and moved over it; half the scale."""
    n = 6 * ((scale + 1) // 2)
    mesh = dmesh.create_box(MPI.COMM_SELF, [[-1, -1, -1], [1, 1, 0]], [2 * n, 2 * n, n], dmesh.CellType.hexahedron)
    u = fem.Function(fem.functionspace(mesh, ("Lagrange", 1, (3,))))
    sphere = {"shape": "sphere", "centre": (0.0, 0.0, 1.0), "radius": 1.0}

    def move(solver: NonlinearContactProblem, t: float) -> None:
        solver.place(0, shift=(max(0.0, t - 2.0) / 20, 0.0, -min(t, 2.0) / 10))

    below, above = facets_at(mesh, lambda x: x[2] + 1.0), facets_at(mesh, lambda x: x[2])
    contact = Foundation(above, shape=sphere, friction=Coulomb(0.3))
    return Problem(
        "sphere on rubber, space", u, rubber(u, 40.0), [held(u, below, np.zeros(3))], contact, move, range(1, 5)
    )


def sliding(scale: int) -> Problem:
    """A block with a round bottom that slides over a softer one in 2D, facet by facet."""
    n = 6 * scale
    grid = dmesh.create_rectangle(MPI.COMM_SELF, [[0, 0], [4, 2]], [4 * n, 2 * n], dmesh.CellType.quadrilateral)
    upper = (0.99, 2.01)
    inside = dmesh.locate_entities(
        grid, 2, lambda x: (x[1] < 0.51) | ((x[1] > 0.99) & (x[0] > upper[0]) & (x[0] < upper[1]))
    )
    mesh = dmesh.create_submesh(grid, 2, inside)[0]
    x, y = mesh.geometry.x.T[:2]
    rise = 0.5 * (x - 1.5) ** 2
    y[:] = np.where(y > 0.9, 0.501 + rise + (y - 1.0) * (1.0 - rise), y)
    u, way = fem.Function(fem.functionspace(mesh, ("Lagrange", 1, (2,)))), fem.Constant(mesh, np.zeros(2))

    def move(_: NonlinearContactProblem, t: float) -> None:
        way.value[:] = max(0.0, t - 2.0) / 10, -min(t, 2.0) / 20

    shear = ufl.conditional(ufl.gt(ufl.SpatialCoordinate(mesh)[1], 0.5005), 400.0, 40.0)
    bottom = facets_at(mesh, lambda x: x[1])
    driven = facets_at(mesh, lambda x: x[1] - 1.501)
    lower_side = facets_at(mesh, lambda x: x[1] - 0.5)
    upper_side = facets_at(mesh, lambda x: x[1] - 0.501 - 0.5 * (x[0] - 1.5) ** 2)
    pair = Pair(lower_side, upper_side, friction=Coulomb(0.3))
    bcs = [held(u, bottom, np.zeros(2)), held(u, driven, way)]
    return Problem("two bodies slide, plane", u, rubber(u, shear), bcs, pair, move, range(1, 9))


def with_contact(problem: Problem) -> tuple[Cost, list[Floats]]:
    """What the path costs with contact, and the displacement at the end of each load step."""
    problem.u.x.array[:] = 0.0
    start = time.process_time()
    solver = NonlinearContactProblem(problem.F, problem.u, bcs=problem.bcs, contact=problem.contact)
    taken, ends = list[RampStep](), []
    for begin, end in pairwise((0.0, *problem.times)):
        taken += solver.ramp(lambda t, a=begin, b=end: problem.move(solver, a + t * (b - a)), first=1.0)
        ends.append(problem.u.x.array.copy())
    cpu = time.process_time() - start
    if len(taken) > len(problem.times):  # of attempts that failed no iterations are known
        raise RuntimeError("a load step was halved: take smaller load steps")
    return Cost(len(taken), sum(step.iterations for step in taken), len(solver.history.iterations), cpu), ends


def bonded(problem: Problem, ends: Sequence[Floats]) -> tuple[Cost, list[Floats]]:
    """Newton's method for the body alone: the nodes on which contact acts at the end of one of the load steps move as
    they do with it.
    """
    u, space = problem.u, problem.u.function_space
    tangent = ufl.derivative(problem.F, u, ufl.TrialFunction(space))
    residual, matrix, dim = fem.form(problem.F), fem.form(tangent), space.mesh.geometry.dim
    given = np.zeros(u.x.array.size // dim, dtype=bool)
    for condition in problem.bcs:
        given[condition.dof_indices()[0] // dim] = True
    touching = np.zeros_like(given)
    for values in ends:
        u.x.array[:] = values
        forces = np.linalg.norm(fem.assemble_vector(residual).array.reshape(-1, dim), axis=1)
        touching |= ~given & (forces > _ACTS * forces.max())
    free = np.flatnonzero(np.repeat(~(given | touching), dim))
    held, found, iterations = np.setdiff1d(np.arange(u.x.array.size), free), [], 0
    u.x.array[:] = 0.0
    start = time.process_time()
    for end in ends:
        change = end[held] - u.x.array[held]
        for _ in range(_MOST):
            forces = fem.assemble_vector(residual).array
            rows = fem.assemble_matrix(matrix).to_scipy().tocsr()[free]
            increment = _solved(rows[:, free], -forces[free] - rows[:, held] @ change)
            u.x.array[free] += increment
            u.x.array[held] += change
            iterations, change = iterations + 1, np.zeros(held.size)
            if np.abs(increment).max() <= _SMALL * np.abs(u.x.array).max():
                break
        else:
            raise RuntimeError("Newton's method for the body alone does not converge: take smaller load steps")
        found.append(u.x.array.copy())
    return Cost(len(ends), iterations, iterations, time.process_time() - start), found


def _solved(matrix: Any, right: Floats) -> Floats:
    """By Cholesky's factorisation of MUMPS."""
    matrix.sort_indices()
    size = matrix.shape[0]
    csr = (matrix.indptr.astype(PETSc.IntType), matrix.indices.astype(PETSc.IntType), matrix.data)
    operator = PETSc.Mat().createAIJ((size, size), csr=csr, comm=PETSc.COMM_SELF)
    operator.setOption(PETSc.Mat.Option.SPD, True)
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOperators(operator)
    ksp.setType("preonly")
    ksp.pc.setType("cholesky")
    ksp.pc.setFactorSolverType("mumps")
    load, solution = operator.createVecs()
    load.array[:] = right
    ksp.solve(load, solution)
    result = solution.array.copy()
    for part in (ksp, operator, load, solution):
        part.destroy()
    return result


def rows(scale: int, rounds: int) -> Iterator[list[str]]:
    """Of the table: of each problem with contact, and with the contact known."""
    for problem in (ploughing(scale), indentation(scale), sliding(scale)):
        costs = []
        for _ in range(rounds + 1):  # the first one compiles the forms
            whole, ends = with_contact(problem)
            alone, same = bonded(problem, ends)
            costs.append((whole, alone))
        apart = max(float(np.abs(a - b).max() / np.abs(a).max()) for a, b in zip(ends, same, strict=True))
        whole, alone = (min(of, key=lambda cost: cost.cpu) for of in zip(*costs[1:], strict=True))
        yield [problem.title, str(problem.u.x.array.size), "with contact", *whole.cells, "", ""]
        yield ["", "", "contact known", *alone.cells, f"{whole.cpu / alone.cpu:.2g}", f"{apart:.0e}"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scale", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=3)
    asked = parser.parse_args(arguments)
    writer = csv.writer(sys.stdout)
    for row in rows(asked.scale, asked.rounds):
        writer.writerow(row)
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
