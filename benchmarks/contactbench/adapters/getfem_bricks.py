"""Runs GetFEM: its basic contact brick (Alart and Curnier) with forces at nodes, and Newton."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import numpy.typing as npt

from ..answers import Answer, CannotRun, ContactForces, refuse_histories
from ..elasticity import nodal_weights, prescribed, values_at
from ..grids import Grid
from ..problem import Contact, Problem

Floats = npt.NDArray[np.float64]
_STEPS, _RESIDUAL = 100, 1e-9
# Force at a node per displacement, and how far the body is moved towards the foundation at first:
# what is tried.
_AUGMENTATIONS, _STARTS = (10.0, 100.0, 1.0), (1.01, 0.3, 0.05, 0.0)
# Corners in GetFEM's order.
_ORDER = {4: [0, 1, 3, 2], 8: [0, 1, 3, 2, 4, 5, 7, 6]}
_TRANSFORM = {4: "GT_QK(2,1)", 8: "GT_QK(3,1)"}
_RULE = {4: "IM_GAUSS_PARALLELEPIPED(2,6)", 8: "IM_GAUSS_PARALLELEPIPED(3,4)"}


def available() -> None:
    """Raise ``CannotRun`` where the package is not there."""
    try:
        import getfem  # noqa: F401
    except ImportError as error:
        raise CannotRun(f"{error}: apt install python3-getfem") from None


def solve(problem: Problem, grid: Grid) -> Answer:
    """Solve a problem on a mesh.

    Raises:
        CannotRun: Tresca friction, two bodies, plane stress, or an incompressible body.
        RuntimeError: Newton's method does not converge.
    """
    refuse_histories(problem)
    if any(contact.law == "tresca" for contact in problem.contacts):
        raise CannotRun("the basic contact brick has no Tresca friction")
    if (
        problem.hypothesis == "plane stress"
        or len(problem.contacts) > 1
        or problem.contacts[0].against
    ):
        raise CannotRun("this adapter has one contact with a foundation, and no plane stress")
    if any(body.poisson == 0.5 for body in problem.bodies):
        raise CannotRun("linear elements lock where the body is incompressible")
    import getfem as gf

    gf.util_trace_level(0)
    start = time.process_time()
    body = _Body(gf, problem, grid)
    contact = _Rows(gf, body, problem.contacts[0])
    note = contact.solve()
    seconds = time.process_time() - start
    u = np.empty_like(grid.points)
    values = body.model.variable("u").reshape(-1, problem.dimension)
    u[:] = values[body.node_of]
    return Answer(
        u, {contact.name: contact.result()}, values.size, seconds, body.energy(gf), note=note
    )


class _Body:
    """Mesh, space and the model without contact."""

    def __init__(self, gf: Any, problem: Problem, grid: Grid) -> None:
        self.problem, self.grid, d, corners = problem, grid, problem.dimension, grid.cells.shape[1]
        mesh = self.mesh = gf.Mesh("empty", d)
        at = grid.points[grid.cells[:, _ORDER[corners]]].transpose(2, 1, 0)
        mesh.add_convex(gf.GeoTrans(_TRANSFORM[corners]), np.ascontiguousarray(at))
        self.space = gf.MeshFem(mesh, d)
        self.space.set_classical_fem(1)
        rule = self.rule = gf.MeshIm(mesh, gf.Integ(_RULE[corners]))
        model = self.model = gf.Model("real")
        model.add_fem_variable("u", self.space)
        young, poisson = problem.bodies[0].young, problem.bodies[0].poisson
        model.add_initialized_data("mu", problem.bodies[0].mu)
        model.add_initialized_data("lame", young * poisson / ((1 + poisson) * (1 - 2 * poisson)))
        model.add_linear_term(rule, self._work("Test_u"))
        self.places = self.space.basic_dof_nodes().T[::d]  # of each vector of the displacement
        self.node_of = self._nearest(grid.points)
        self.load = 0.0
        self._loads(gf, rule)
        self._supports(gf)

    def _work(self, other: str) -> str:
        """Of the stress of u on the strain of another displacement."""
        if self.problem.hypothesis != "axisymmetric":
            return f"lame*Trace(Grad_u)*Trace(Grad_{other}) + 2*mu*Sym(Grad_u):Grad_{other}"
        traces = f"(Trace(Grad_u)+u(1)/X(1))*(Trace(Grad_{other})+{other}(1)/X(1))"
        return (
            f"2*pi*X(1)*(lame*{traces} + 2*mu*(Sym(Grad_u):Grad_{other} + "
            f"u(1)*{other}(1)/sqr(X(1))))"
        )

    def energy(self, gf: Any) -> float:
        """The strain energy."""
        return float(gf.asm_generic(self.rule, 0, self._work("u"), -1, self.model)) / 2

    def _nearest(self, x: Floats) -> npt.NDArray[np.int64]:
        from scipy.spatial import cKDTree

        return np.asarray(cKDTree(self.places).query(x)[1])

    def region(self, boundary: str) -> Any:
        """Convexes and faces of a boundary."""
        nodes = self.grid.nodes(boundary)
        points = self.mesh.pid_from_coords(np.ascontiguousarray(self.grid.points[nodes].T))
        faces, outer = self.mesh.faces_from_pid(points), self.mesh.outer_faces()
        wanted = set(map(tuple, outer.T.tolist()))
        return np.array([face for face in faces.T.tolist() if tuple(face) in wanted]).T

    def _loads(self, gf: Any, rule: Any) -> None:
        data = gf.MeshFem(self.mesh, self.problem.dimension)
        data.set_classical_fem(3)
        d = self.problem.dimension
        places = data.basic_dof_nodes().T[::d]
        for number, traction in enumerate(self.problem.tractions, 1):
            self.mesh.set_region(number, self.region(traction.boundary))
            near = np.unique(data.basic_dof_on_region(number) // d)
            values = np.zeros_like(places)
            for k, formula in traction.components.items():
                values[near, k] = values_at(self.problem, formula, places[near])
            factor = "2*pi*X(1)*" if self.problem.hypothesis == "axisymmetric" else ""
            self.model.add_initialized_fem_data(f"t{number}", data, values.ravel())
            self.model.add_source_term(rule, f"{factor}t{number}.Test_u", number)
            self.load = max(self.load, float(np.abs(values).max()))

    def _supports(self, gf: Any) -> None:
        d = self.problem.dimension
        fixed = prescribed(self.problem, self.grid)
        if fixed:
            rows = np.array([self.node_of[node] * d + k for node, k in fixed])
            matrix = selection(gf, rows, self.space.nbdof())
            self.model.add_variable("reaction", len(rows))
            self.model.add_constraint_with_multipliers(
                "u", "reaction", matrix, np.array(list(fixed.values()))
            )
            self.load = max(self.load, np.abs(list(fixed.values())).max())


def selection(gf: Any, columns: Any, size: int, factor: float = 1.0) -> Any:
    """The matrix with one entry in each row."""
    matrix = gf.Spmat("empty", len(columns), size)
    for row, column in enumerate(columns):
        matrix.add(row, int(column), factor)
    return matrix


class _Rows:
    """The brick: a row for each node in contact, along the normal and across."""

    def __init__(self, gf: Any, body: _Body, contact: Contact) -> None:
        self.body, self.contact, self.name, self.model = body, contact, contact.boundary, body.model
        problem, grid = body.problem, body.grid
        self.nodes = grid.nodes(contact.boundary)
        self.x, self.dofs = grid.points[self.nodes], body.node_of[self.nodes]
        self.weight = nodal_weights(problem, grid, contact.boundary)[self.nodes]
        normal = np.tile([problem.number(c) for c in contact.direction], (len(self.x), 1))
        rows = [self._row(k, normal[k]) for k in range(len(self.x))]
        tangents = self._tangents(normal)
        young, size = problem.bodies[0].young, body.space.nbdof()
        gap = values_at(problem, contact.gap, self.x)
        model = self.model
        model.add_initialized_data("gap", gap)
        model.add_initialized_data("alpha", np.ones(len(gap)))
        # Force at a node per displacement.
        self.augmentation = young * float(
            np.median(self.weight[self.weight > 0]) / np.ptp(self.x, axis=0).max()
        )
        model.add_initialized_data("r", self.augmentation)
        model.add_variable("lambda_n", len(gap))
        down = self._matrix(gf, rows, size)
        self.law = contact.law
        if contact.law == "none":
            model.add_basic_contact_brick("u", "lambda_n", "r", down, "gap", "alpha", 1)
        else:
            along = [self._row(k, tangent) for k, pair in enumerate(tangents) for tangent in pair]
            model.add_variable("lambda_t", len(along))
            model.add_initialized_data(
                "coefficient", values_at(problem, contact.coefficient, self.x)
            )
            across = self._matrix(gf, along, size)
            model.add_basic_contact_brick(
                "u", "lambda_n", "lambda_t", "r", down, across, "coefficient", "gap", "alpha", 1
            )
        self.tangents = tangents
        self.toward, self.farthest = normal[0], float(gap.max())
        self.force = max(body.load, self.augmentation * float(np.abs(gap).max()))

    def solve(self) -> str:
        """From several starts and with several parameters of the Lagrangian, until one converges.

        Raises:
            RuntimeError: none does.
        """
        model, tries = self.model, [(r, start) for start in _STARTS for r in _AUGMENTATIONS]
        for attempt, (augmentation, start) in enumerate(tries, 1):
            model.set_variable("r", augmentation * self.augmentation)
            self._start(start)
            what = (
                "max_res",
                _RESIDUAL * self.force,
                "max_iter",
                _STEPS,
                "lsolver",
                "mumps",
                "lsearch",
                "simplest",
            )
            try:
                steps, converged = model.solve(*what)
            except RuntimeError:
                continue
            moved = model.variable("u")
            if converged and steps < _STEPS and np.isfinite(moved).all():
                return f"{int(steps)} Newton steps at attempt {attempt}"
        raise RuntimeError(f"Newton's method does not converge from any of {len(tries)} starts")

    def _start(self, share: float) -> None:
        """Where nothing else holds the body: so far onto the foundation, of what contact everywhere
        would take.
        """
        start = np.tile(share * max(self.farthest, 1e-9) * self.toward, len(self.body.places))
        self.model.set_variable("u", start)
        for name in ("lambda_n", "lambda_t") if self.law != "none" else ("lambda_n",):
            self.model.set_variable(name, np.zeros(len(self.model.variable(name))))

    def _tangents(self, normal: Floats) -> list[list[Floats]]:
        if self.body.problem.dimension == 2:
            return [[np.array([-n[1], n[0]])] for n in normal]
        return [[np.array([1.0, 0, 0]), np.array([0, 1.0, 0])] for _ in normal]

    def _row(self, k: int, direction: Floats) -> dict[int, float]:
        """Displacement of a node along a direction, by degrees of freedom."""
        d = len(direction)
        return {int(self.dofs[k]) * d + c: float(direction[c]) for c in range(d) if direction[c]}

    def _matrix(self, gf: Any, rows: list[dict[int, float]], size: int) -> Any:
        matrix = gf.Spmat("empty", len(rows), size)
        for number, row in enumerate(rows):
            for column, value in row.items():
                matrix.add(number, column, value)
        return matrix

    def result(self) -> ContactForces:
        """Forces at the nodes."""
        normal = -self.model.variable("lambda_n")
        friction = np.zeros_like(self.x)
        if self.law != "none":
            count = len(self.tangents[0])
            shear = self.model.variable("lambda_t").reshape(-1, count)
            friction = np.einsum("nk,nkd->nd", shear, np.array(self.tangents))
        return ContactForces(self.x, self.weight, normal, friction)
