"""Runs scikit-fem: its assembly, and a primal-dual active set method by hand, as it has no contact of its own.

Constraints are exact at the nodes: those in contact are put onto the foundation, those that stick are held, those that
slip get the force of friction (S. Hueber, B. Wohlmuth, Comput. Methods Appl. Mech. Engrg. 194 (2005) 3147-3166).
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import numpy.typing as npt

from contactbench.answers import Answer, CannotRun, ContactForces
from contactbench.elasticity import nodal_loads, nodal_weights, prescribed, values_at
from contactbench.grids import Grid
from contactbench.problem import Problem

Floats = npt.NDArray[np.float64]
_STEPS = 200
# Relative change of a force at a node that ends the iteration of Coulomb friction.
_SAME = 1e-9


def available() -> None:
    """Raise ``CannotRun`` where the package is not there."""
    try:
        import skfem  # noqa: F401
    except ImportError as error:
        raise CannotRun(f"{error}: pip install scikit-fem") from None


def solve(problem: Problem, grid: Grid) -> Answer:
    """Solve a problem on a mesh.

    Raises:
        CannotRun: two bodies, an incompressible one, or a surface that is not along the axes.
        RuntimeError: the sets go round in circles.
    """
    if any(contact.against for contact in problem.contacts):
        raise CannotRun("this adapter has no contact between two bodies")
    if any(body.poisson == 0.5 for body in problem.bodies):
        raise CannotRun("linear elements lock where the body is incompressible")
    direction = np.array([problem.number(c) for c in problem.contacts[0].direction])
    if len(problem.contacts) > 1 or np.count_nonzero(direction) != 1:
        raise CannotRun("this adapter has one contact, along an axis")
    if problem.dimension == 3 and problem.contacts[0].law != "none":
        raise CannotRun("this adapter has no friction in space")
    from scipy.sparse.linalg import splu

    start = time.process_time()
    stiffness = _stiffness(problem, grid)
    active = _ActiveSets(problem, grid, direction)
    loads, fixed = nodal_loads(problem, grid).ravel(), prescribed(problem, grid)
    d = problem.dimension
    held = {node * d + k: value for (node, k), value in fixed.items()}
    every = np.arange(loads.size)
    for _ in range(_STEPS):
        now = held | active.held(held)
        rows = np.fromiter(now, int)
        u = np.zeros(loads.size)
        u[rows] = list(now.values())
        free = np.setdiff1d(every, rows)
        right = loads + active.forces()
        factor = splu(stiffness[free][:, free].tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        u[free] = factor.solve((right - stiffness @ u)[free])
        if active.settled(u.reshape(-1, d), (stiffness @ u - loads).reshape(-1, d)):
            break
    else:
        raise RuntimeError(f"the sets are not found in {_STEPS} steps")
    contacts = {problem.contacts[0].boundary: active.result()}
    return Answer(u.reshape(-1, d), contacts, loads.size, time.process_time() - start, note="active sets")


def _stiffness(problem: Problem, grid: Grid) -> Any:
    """By scikit-fem, rows by nodes and components as in the grid."""
    import skfem
    from skfem.helpers import ddot, sym_grad, trace

    kinds = {3: (skfem.MeshTri, skfem.ElementTriP1), 4: (skfem.MeshQuad, skfem.ElementQuad1)}
    kinds[8] = (skfem.MeshHex, skfem.ElementHex1)
    mesh_of, element = kinds[grid.cells.shape[1]]
    # scikit-fem: corners (0,0,0), (0,0,1), (0,1,0), (1,0,0), (0,1,1), (1,0,1), (1,1,0), (1,1,1).
    order = [0, 4, 3, 1, 7, 5, 2, 6] if grid.dimension == 3 else list(range(grid.cells.shape[1]))
    mesh = mesh_of(np.ascontiguousarray(grid.points.T), np.ascontiguousarray(grid.cells[:, order].T))
    basis = skfem.Basis(mesh, skfem.ElementVector(element()), intorder=4)
    body = problem.bodies[0]
    mu, lame = body.mu, body.young * body.poisson / ((1 + body.poisson) * (1 - 2 * body.poisson))
    if problem.hypothesis == "plane stress":
        lame = 2 * lame * mu / (lame + 2 * mu)
    axisymmetric = problem.hypothesis == "axisymmetric"

    @skfem.BilinearForm
    def elasticity(u: Any, v: Any, w: Any) -> Any:
        e, f = sym_grad(u), sym_grad(v)
        if not axisymmetric:
            return 2 * mu * ddot(e, f) + lame * trace(e) * trace(f)
        r = w.x[0]
        around, other = u[0] / r, v[0] / r
        work = 2 * mu * (ddot(e, f) + around * other) + lame * (trace(e) + around) * (trace(f) + other)
        return 2 * np.pi * r * work

    dofs = basis.nodal_dofs.T.ravel()  # of each node its components
    return elasticity.assemble(basis).tocsr()[dofs][:, dofs]


class _ActiveSets:
    """Nodes in contact, those that stick, and the bounds of friction forces."""

    def __init__(self, problem: Problem, grid: Grid, direction: Floats) -> None:
        self.contact = problem.contacts[0]
        self.d, self.axis = problem.dimension, int(np.abs(direction).argmax())
        self.sign = direction[self.axis]
        self.nodes, self.rows = grid.nodes(self.contact.boundary), grid.points.size
        self.x = grid.points[self.nodes]
        self.weight = nodal_weights(problem, grid, self.contact.boundary)[self.nodes]
        self.gap = values_at(problem, self.contact.gap, self.x)
        self.closed = np.ones(len(self.nodes), dtype=bool)
        law = self.contact.law
        self.sticks = np.full(len(self.nodes), law != "none")
        self.across = 1 - self.axis if self.d == 2 else self.axis
        self.toward = np.zeros(len(self.nodes))  # of slip, -1 or 1
        self.coefficient = values_at(problem, self.contact.coefficient, self.x)
        self.bound = values_at(problem, self.contact.bound, self.x) * self.weight
        self.normal, self.friction = np.zeros(len(self.nodes)), np.zeros(len(self.nodes))

    def held(self, fixed: dict[int, float]) -> dict[int, float]:
        """Prescribed displacements by row."""
        rows = self.nodes * self.d
        down = zip(rows[self.closed].tolist(), self.gap[self.closed].tolist(), strict=True)
        found = {row + self.axis: self.sign * gap for row, gap in down}
        found |= {int(r) + self.across: 0.0 for r in rows[self.sticks] if int(r) + self.across not in fixed}
        return found

    def forces(self) -> Floats:
        """Of friction on slipping nodes, by row."""
        found = np.zeros(self.rows)
        if self.contact.law != "none":
            found[self.nodes * self.d + self.across] = -self.toward * self.bound * ~self.sticks
        return found

    def settled(self, u: Floats, residual: Floats) -> bool:
        """Whether all conditions hold; else the sets are changed.

        Args:
            u: displacement, shape (n, d).
            residual: forces of supports and contact on the body, shape (n, d).
        """
        size = np.abs(residual[self.nodes, self.axis]).max()
        self.normal = -self.sign * residual[self.nodes, self.axis]
        inside = self.sign * u[self.nodes, self.axis] - self.gap
        closed = np.where(self.closed, self.normal > -1e-12 * size, inside > 0)
        same = bool((closed == self.closed).all())
        self.closed = closed
        self.normal = np.where(closed, self.normal, 0.0)
        if self.contact.law == "none":
            return same
        self.friction = residual[self.nodes, self.across]
        if self.contact.law == "coulomb":
            bound = self.coefficient * self.normal.clip(min=0.0)
            same &= bool(np.abs(bound - self.bound).max() <= _SAME * max(bound.max(), 1e-300))
            self.bound = bound
        slip = u[self.nodes, self.across]
        too_much = np.abs(self.friction) > self.bound * (1 + 1e-9)
        backwards = self.toward * slip < 0
        sticks = np.where(self.sticks, ~too_much, backwards)
        self.toward = np.where(sticks, 0.0, np.where(self.sticks, -np.sign(self.friction), self.toward))
        same &= bool((sticks == self.sticks).all())
        self.sticks = sticks
        return same

    def result(self) -> ContactForces:
        """Forces at the nodes."""
        friction = np.zeros_like(self.x)
        if self.contact.law != "none":
            friction[:, self.across] = self.friction
        return ContactForces(self.x, self.weight, self.normal, friction)
