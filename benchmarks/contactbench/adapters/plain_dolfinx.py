"""Runs dolfinx by hand: a penalty at the vertices of the contact facets, and Newton's method on
UFL's derivative.

The penalty is raised step by step, each problem starting from the solution of the one before; a
step that Newton's method does not solve is halved.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from ..answers import Answer, CannotRun, ContactForces, refuse_histories
from ..elasticity import nodal_loads, nodal_weights, prescribed
from ..grids import Grid
from ..problem import Problem

# The last penalty in units of E over the shortest facet in contact, and the first one in those of
# the last.
PENALTY, _FIRST = 100.0, 1e-4
_FACTOR, _SMALLEST, _STEPS, _SAME = 10.0, 1.01, 25, 1e-9


def available() -> None:
    """Raise ``CannotRun`` where the package is not there."""
    try:
        import dolfinx  # noqa: F401
    except ImportError as error:
        raise CannotRun(f"{error}: install FEniCSx") from None


def solve(problem: Problem, grid: Grid) -> Answer:
    """Solve a problem on a mesh.

    Raises:
        CannotRun: two bodies, or an incompressible one.
        RuntimeError: Newton's method does not converge.
    """
    refuse_histories(problem)
    if any(contact.against for contact in problem.contacts):
        raise CannotRun("plain dolfinx has no contact between two bodies")
    if any(body.poisson == 0.5 for body in problem.bodies):
        raise CannotRun("linear elements lock where the body is incompressible")
    start = time.process_time()
    newton = _Newton(problem, grid)
    gamma, factor = _FIRST * newton.last, _FACTOR
    state = newton.start()
    # Forms are compiled once on a machine: their time does not count.
    while True:
        found = newton.solve(state, gamma)
        if found is not None:
            state, solved = found, gamma
            if gamma >= newton.last * (1 - 1e-12):
                break
        elif gamma == _FIRST * newton.last or factor < _SMALLEST:
            raise RuntimeError(f"Newton's method does not converge for a penalty of {gamma:.3g}")
        else:
            factor = factor**0.5
        gamma = min(solved * factor, newton.last)
    seconds = time.process_time() - start - newton.compiling
    u, contacts = newton.answer(state)
    return Answer(
        u, contacts, u.size, seconds, newton.energy(state), note=f"penalty {newton.last:.3g}"
    )


class _Newton:
    """The compiled forms and one factorisation a step."""

    def __init__(self, problem: Problem, grid: Grid) -> None:
        import ufl
        from dolfinx import fem
        from dolfinx.fem import petsc

        from .dolfinx_mesh import make_mesh, tag_facets

        self.problem, self.grid, self.d = problem, grid, problem.dimension
        mesh, self.nodes = make_mesh(grid)
        facets, tags = tag_facets(mesh, self.nodes, grid)
        space = fem.functionspace(mesh, ("Lagrange", 1, (self.d,)))
        self.u, v, x = fem.Function(space), ufl.TestFunction(space), ufl.SpatialCoordinate(mesh)
        body, contact = problem.bodies[0], problem.contacts[0]
        mu, lame = (
            body.mu,
            body.young * body.poisson / ((1 + body.poisson) * (1 - 2 * body.poisson)),
        )
        if problem.hypothesis == "plane stress":
            lame = 2 * lame * mu / (lame + 2 * mu)
        around = 2 * ufl.pi * x[0] if problem.hypothesis == "axisymmetric" else 1.0

        def strain(w: Any) -> Any:
            if problem.hypothesis != "axisymmetric":
                return ufl.sym(ufl.grad(w))
            g = ufl.grad(w)
            shear = (g[0, 1] + g[1, 0]) / 2
            return ufl.as_matrix([[g[0, 0], shear, 0], [shear, g[1, 1], 0], [0, 0, w[0] / x[0]]])

        stress = 2 * mu * strain(self.u) + lame * ufl.tr(strain(self.u)) * ufl.Identity(
            strain(self.u).ufl_shape[0]
        )
        residual = (
            ufl.inner(stress, strain(v))
            * around
            * ufl.dx(metadata={"quadrature_degree": 2 + (around != 1.0)})
        )
        self.work = ufl.replace(residual, {v: self.u})
        # At the vertices, with the areas that belong to them.
        metadata = {"quadrature_rule": "vertex", "quadrature_degree": 1}
        ds = ufl.Measure("ds", domain=mesh, subdomain_data=facets, metadata=metadata)(
            tags[contact.boundary]
        )
        normal = ufl.FacetNormal(mesh)
        if contact.direction:
            normal = ufl.as_vector([problem.number(c) for c in contact.direction])
        self.gamma = fem.Constant(mesh, 1.0)
        scalar = fem.functionspace(mesh, ("Lagrange", 1))
        self.fields = {key: fem.Function(scalar) for key in ("gap", "bound", "share")}
        for key, formula in (
            ("gap", contact.gap),
            ("bound", contact.bound),
            ("share", contact.coefficient),
        ):
            self.fields[key].x.array[:] = self._by_node(formula)
        circumference = fem.Function(scalar)
        circumference.x.array[:] = self._circumferences()[self.nodes]
        inside = ufl.inner(self.u, normal) - self.fields["gap"]
        pressure = self.gamma * ufl.max_value(inside, 0.0)
        along = self.u - ufl.inner(self.u, normal) * normal
        residual += pressure * ufl.inner(v, normal) * circumference * ds
        if contact.law != "none":
            bound = (
                self.fields["bound"] if contact.law == "tresca" else self.fields["share"] * pressure
            )
            trial = self.gamma * along
            size = ufl.sqrt(ufl.inner(trial, trial) + 1e-30 * body.young**2)
            shear = trial * ufl.conditional(ufl.gt(size, bound), bound / size, 1.0)
            residual += ufl.inner(shear, v) * circumference * ds
        before = time.process_time()
        self.residual, self.jacobian = (
            fem.form(residual),
            fem.form(ufl.derivative(residual, self.u)),
        )
        self.compiling = time.process_time() - before
        self.matrix = petsc.create_matrix(self.jacobian)
        self.loads = nodal_loads(problem, grid)[self.nodes].ravel()
        where = {int(node): k for k, node in enumerate(self.nodes)}
        fixed = {
            where[node] * self.d + k: value
            for (node, k), value in prescribed(problem, grid).items()
        }
        self.rows, self.values = (
            np.array(list(fixed), dtype=np.int32),
            np.array(list(fixed.values())),
        )
        at = grid.points[grid.facets[contact.boundary]]
        shortest = min(float(np.linalg.norm(at - np.roll(at, 1, axis=1), axis=2).min()), np.inf)
        self.last = PENALTY * body.young / shortest

    def _by_node(self, formula: Any) -> Any:
        from ..elasticity import values_at

        return values_at(self.problem, formula, self.grid.points[self.nodes])

    def start(self) -> Any:
        """Everything in contact, since otherwise nothing may hold the body."""
        direction = [self.problem.number(c) for c in self.problem.contacts[0].direction]
        boundary = self.grid.nodes(self.problem.contacts[0].boundary)
        where = np.isin(self.nodes, boundary)
        state = np.zeros((len(self.nodes), self.d))
        if direction:
            state += (
                1.01
                * max(float(self.fields["gap"].x.array[where].max()), 1e-9)
                * np.array(direction)
            )
        return state.ravel()

    def solve(self, state: Any, gamma: float) -> Any:
        """The displacement for a penalty; None: Newton's method does not converge."""
        from dolfinx.fem import petsc
        from petsc4py import PETSc

        self.gamma.value, u = gamma, state.copy()
        u[self.rows] = self.values
        solver = PETSc.KSP().create(self.matrix.comm)
        solver.setType("preonly")
        solver.getPC().setType("lu")
        solver.getPC().setFactorSolverType("mumps")
        scale = None
        for _ in range(_STEPS):
            self.u.x.array[:] = u
            vector = petsc.assemble_vector(self.residual)
            rest = vector.array.copy() - self.loads
            vector.destroy()
            size = max(
                float(np.abs(rest[self.rows]).max(initial=0.0)),
                float(np.abs(self.loads).max()),
                1e-300,
            )
            rest[self.rows] = 0.0
            if scale is not None and np.abs(rest).max() <= _SAME * size:
                solver.destroy()
                return u
            scale = size
            self.matrix.zeroEntries()
            petsc.assemble_matrix(self.matrix, self.jacobian)
            self.matrix.assemble()
            self.matrix.zeroRowsColumns(self.rows, 1.0)
            solver.setOperators(self.matrix)
            right, step = self.matrix.createVecs()
            right.array[:] = -rest
            try:
                solver.solve(right, step)
            except PETSc.Error:
                break
            if solver.getConvergedReason() < 0 or not np.isfinite(step.array).all():
                break
            u = u + step.array
        solver.destroy()
        return None

    def energy(self, state: Any) -> float:
        """The strain energy."""
        from dolfinx import fem

        self.u.x.array[:] = state
        return float(fem.assemble_scalar(fem.form(self.work))) / 2

    def answer(self, state: Any) -> tuple[Any, dict[str, ContactForces]]:
        """Displacements at the nodes of the grid, and the forces of the contact."""
        u = np.empty((len(self.nodes), self.d))
        u[self.nodes] = state.reshape(-1, self.d)
        contact = self.problem.contacts[0]
        boundary = self.grid.nodes(contact.boundary)
        weight = nodal_weights(self.problem, self.grid, contact.boundary)[boundary]
        direction = np.array([self.problem.number(c) for c in contact.direction])
        fields = {key: np.empty(len(u)) for key in self.fields}
        for key, field in self.fields.items():
            fields[key][self.nodes] = field.x.array
        inside = u[boundary] @ direction - fields["gap"][boundary]
        pressure = self.last * inside.clip(min=0.0)
        friction = np.zeros_like(u[boundary])
        if contact.law != "none":
            trial = self.last * (u[boundary] - np.outer(u[boundary] @ direction, direction))
            bound = (
                fields["bound"][boundary]
                if contact.law == "tresca"
                else fields["share"][boundary] * pressure
            )
            size = np.linalg.norm(trial, axis=1)
            friction = (
                -trial * np.where(size > bound, bound / np.where(size > 0, size, 1.0), 1.0)[:, None]
            )
        forces = ContactForces(
            self.grid.points[boundary], weight, weight * pressure, weight[:, None] * friction
        )
        return u, {contact.boundary: forces}

    def _circumferences(self) -> Any:
        """Areas of a revolution that belong to the nodes in contact over the lengths of facets that
        do; else 1.
        """
        boundary, found = self.problem.contacts[0].boundary, np.ones(len(self.grid.points))
        if self.problem.hypothesis == "axisymmetric":
            own = self.grid.nodes(boundary)
            plane = nodal_weights(
                replace(self.problem, hypothesis="plane strain"), self.grid, boundary
            )
            found[own] = (
                nodal_weights(self.problem, self.grid, boundary) / np.where(plane > 0, plane, 1.0)
            )[own]
        return found
