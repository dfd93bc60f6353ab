"""Random nonlinear bodies and rigid circles that press, slide, or are led into them and through them, by seed.

    ./env python3 -m benchmarks.stability.nonlinear_bodies 300

What the package calls *converged* is judged by another program, in NumPy, that shares nothing with its certificate: its
own neo-Hookean forces (shape functions by collocation at the nodes), and the outline of the deformed body as a dense
polygon with its own test of what is inside.  Every other end must be a named outcome.  Whether the energy is least is
judged by ``nonlinear_scenes``.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx import ConvergenceError, Coulomb, FormError, Foundation, NonlinearContactProblem

Array = npt.NDArray[np.float64]
_CELLS = {"triangle": dmesh.CellType.triangle, "quadrilateral": dmesh.CellType.quadrilateral}
# Monomials of each element, as powers of x and y.
_MONOMIALS = {
    ("triangle", 1): ((0, 0), (1, 0), (0, 1)),
    ("quadrilateral", 1): ((0, 0), (1, 0), (0, 1), (1, 1)),
    ("triangle", 2): ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)),
    ("quadrilateral", 2): tuple((a, b) for a in range(3) for b in range(3)),
}
_QUADRATURE = 4  # degree, of the form and of the judge


@dataclass(frozen=True)
class RandomBody:
    """A rectangle [0, w] x [0, h] that is held at y = 0, and a circle on a straight way.

    Attributes:
        kind: *pressed* against the top, *down* into it, *through* from the side, or *slid* along the top.
        cell: of the mesh.
        degree: of the displacement.
        size: w and h, length.
        counts: of cells along both.
        moduli: mu and lambda, stress.
        start, end: of the centre of the circle, length, shape (2,).
        radius: length.
        friction: coefficient; 0: none.
        pull: dead traction on the top, stress, shape (2,).
        pressure: on the top, that follows the body, stress.
        wrong_tangent: factor of mu in a J that is not the derivative of F; 1: no J is given.
        first: the first step of a ramp; None: one solve.
    """

    kind: str
    cell: str
    degree: int
    size: tuple[float, float]
    counts: tuple[int, int]
    moduli: tuple[float, float]
    start: Array
    end: Array
    radius: float
    friction: float
    pull: Array
    pressure: float
    wrong_tangent: float
    first: float | None

    @classmethod
    def drawn(cls, seed: int) -> RandomBody:
        """That of a seed."""
        rng = np.random.default_rng([55, seed])
        unit, young, poisson = 10.0 ** rng.integers(-3, 4), 10.0 ** rng.choice([0, 2, 6, 11]), rng.uniform(0.0, 0.45)
        width, height = rng.choice([0.4, 1.0, 2.0, 4.0]), rng.choice([0.5, 1.0, 2.0])
        fine = rng.choice([2.0, 4.0, 6.0])
        counts = max(1, int(fine * width)), max(1, int(fine * height))
        degree = int(rng.integers(1, 3))
        if degree == 2:
            counts = max(1, counts[0] // 2), max(1, counts[1] // 2)
        radius = rng.choice([0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0]) * rng.uniform(0.8, 1.2)
        clear = radius * 1.02
        kind = rng.choice(["pressed", "through", "slid", "down"])
        along, aside = rng.uniform(0.1, 0.9) * width, rng.uniform(0.2, 1.0) * height
        begin, end = {
            "pressed": ((along, height + clear), (along, height + clear - rng.uniform(0.05, 0.4) * height)),
            "down": ((along, height + clear), (along, -0.5 * height)),
            "through": ((-clear - rng.uniform(0, 2), aside), (width + clear + rng.uniform(0, 2), aside)),
            "slid": ((-clear, height + 0.6 * radius), (width * rng.uniform(0.3, 1.5), height + 0.8 * radius)),
        }[str(kind)]
        pull = young * rng.uniform(-1, 1, 2) * rng.choice([0.0, 0.0, 3e-3])
        return cls(
            str(kind),
            str(rng.choice(["triangle", "quadrilateral"])),
            degree,
            (width * unit, height * unit),
            counts,
            (young / 2 / (1 + poisson), young * poisson / (1 + poisson) / (1 - 2 * poisson)),
            unit * np.array(begin),
            unit * np.array(end),
            unit * radius,
            float(rng.choice([0.0, 0.0, 0.3])),
            pull,
            float(young * rng.choice([0.0] * 9 + [1e-3])),
            float(rng.choice([1.0, 1.0, 1.0, 1.2])),
            [None, None, 1.0, 0.1, 0.02][rng.integers(5)],
        )

    def centre(self, share: float) -> Array:
        """Of the circle after a share of its way."""
        return np.asarray(self.start + share * (self.end - self.start))


@dataclass
class Judge:
    """The second program for one body; ``u``: displacements of the nodes, length, shape (n, 2)."""

    body: RandomBody
    x: Array
    cells: npt.NDArray[np.int64]
    _weights: Array = field(init=False)
    _gradients: Array = field(init=False)  # of the shape functions at quadrature points, shape (c, q, k, 2)

    def __post_init__(self) -> None:
        body = self.body
        powers = np.array(_MONOMIALS[body.cell, body.degree])
        corner = self.x[self.cells].min(axis=1)
        extent = self.x[self.cells].max(axis=1) - corner
        local = (self.x[self.cells] - corner[:, None]) / extent[:, None]
        inverse = np.linalg.inv(np.prod(local[:, :, None] ** powers, axis=3))  # of rows of nodes, columns of monomials
        points, weights = basix.make_quadrature(getattr(basix.CellType, body.cell), _QUADRATURE)
        if body.cell == "triangle":  # onto the half of the unit square that the cell is
            vertices = _corners(local)
            points = vertices[:, :1] + np.einsum("qi,cij->cqj", points, vertices[:, 1:] - vertices[:, :1])
        else:
            points = np.broadcast_to(points, (len(local), *points.shape))
        slopes = []
        for axis in (0, 1):
            lower = powers.copy()
            lower[:, axis] = np.maximum(lower[:, axis] - 1, 0)
            slopes.append(powers[:, axis] * np.prod(points[:, :, None] ** lower, axis=3))
        gradient = np.einsum("cqmd,cmk->cqkd", np.stack(slopes, axis=3), inverse)
        self._gradients = gradient / extent[:, None, None]
        self._weights = weights * np.prod(extent, axis=1)[:, None]

    def _deformation(self, u: Array) -> tuple[Array, Array]:
        """Deformation gradients and their determinants at the quadrature points."""
        gradient = np.eye(2) + np.einsum("cki,cqkj->cqij", u[self.cells], self._gradients)
        return gradient, np.linalg.det(gradient)

    def loads(self) -> Array:
        """Dead forces, shape (n, 2)."""
        forces = np.zeros_like(self.x)
        for nodes, length in self.top_edges():
            shares = [1 / 6, 2 / 3, 1 / 6] if len(nodes) == 3 else [0.5, 0.5]
            forces[nodes] += length * np.array(shares)[:, None] * self.body.pull
        return forces

    def top_edges(self) -> list[tuple[list[int], float]]:
        """Nodes of each edge of the top in order, and its length."""
        top = np.flatnonzero(np.isclose(self.x[:, 1], self.body.size[1], rtol=1e-9))
        top = top[np.argsort(self.x[top, 0])]
        step = self.body.degree
        runs = [top[k : k + step + 1].tolist() for k in range(0, len(top) - 1, step)]
        return [(run, float(self.x[run[-1], 0] - self.x[run[0], 0])) for run in runs]

    def forces(self, u: Array) -> Array:
        """The residual: forces of the body without contact, shape (n, 2)."""
        (mu, lame), (gradient, volume) = self.body.moduli, self._deformation(u)
        turned = np.linalg.inv(gradient).swapaxes(2, 3)
        stress = mu * gradient + (lame * np.log(volume) - mu)[..., None, None] * turned
        forces = np.zeros_like(self.x)
        np.add.at(forces, self.cells, np.einsum("cq,cqij,cqkj->cki", self._weights, stress, self._gradients))
        forces -= self.loads()
        if self.body.pressure:  # p times the cofactor of the gradient times the normal: the turned tangent
            gauss, weight = np.polynomial.legendre.leggauss(4)
            for nodes, _ in self.top_edges():
                places = np.linspace(-1.0, 1.0, len(nodes))
                inverse = np.linalg.inv(np.vander(places, increasing=True))
                value = np.vander(gauss, len(nodes), increasing=True) @ inverse
                slope = np.array([[k * s ** max(k - 1, 0) for k in range(len(nodes))] for s in gauss]) @ inverse
                tangent = slope @ (self.x + u)[nodes]
                outward = np.column_stack((-tangent[:, 1], tangent[:, 0]))
                forces[nodes] += self.body.pressure * np.einsum("s,sk,si->ki", weight, value, outward)
        return forces

    def outline(self, u: Array, dense: int = 12) -> Array:
        """The deformed outline as a closed polygon, shape (m, 2)."""
        width, height = self.body.size
        near = 1e-9 * max(width, height)
        sides = [
            (np.abs(self.x[:, 1]) <= near, self.x[:, 0]),
            (np.abs(self.x[:, 0] - width) <= near, self.x[:, 1]),
            (np.abs(self.x[:, 1] - height) <= near, -self.x[:, 0]),
            (np.abs(self.x[:, 0]) <= near, -self.x[:, 1]),
        ]
        degree, points = self.body.degree, []
        share = np.arange(dense)[:, None] / dense
        for on_side, order in sides:
            nodes = np.flatnonzero(on_side)
            nodes = nodes[np.argsort(order[nodes])]
            for k in range(0, len(nodes) - 1, degree):
                ends = (self.x + u)[nodes[k : k + degree + 1]]
                if degree == 1:
                    points.append((1 - share) * ends[0] + share * ends[1])
                else:
                    quadratic = (1 - share) * (1 - 2 * share), 4 * share * (1 - share), share * (2 * share - 1)
                    points.append(sum(f * end for f, end in zip(quadratic, ends, strict=True)))
        return np.concatenate(points)

    # --- what must hold -----------------------------------------------------------------------------------------------

    def faults(self, u: Array, centre: Array) -> list[str]:
        """What is wrong with a state that is called converged."""
        body, size = self.body, max(self.body.size)
        if (self._deformation(u)[1] <= 0).any():
            return ["turned inside out"]
        away = self.x + u - centre
        distance = np.linalg.norm(away, axis=1)
        normal, gap = away / distance[:, None], distance - body.radius
        held = np.isclose(self.x[:, 1], 0.0, atol=1e-9 * size)
        outline = self.outline(u)
        faults = []
        boundary = _boundary(self.x, body.size) & ~held
        if (gap[boundary] < -1e-6 * size).any():
            faults.append(f"node inside the circle by {-gap[boundary].min() / size:.1e}")
        if _inside(outline, centre[None])[0]:
            faults.append("circle inside the body")
        depth = body.radius - np.linalg.norm(np.concatenate((outline, (self.x + u)[~held])) - centre, axis=1)
        if depth.max() > 0.75 * body.radius:
            faults.append(f"outline {depth.max() / body.radius:.2f} radii inside the circle")
        forces = self.forces(u)
        scale = np.abs(forces).max() + np.abs(self.loads()).max() + 1e-9 * body.moduli[0] * size
        pressing = np.einsum("ni,ni->n", forces, normal)
        shear = forces - pressing[:, None] * normal
        open_ = ~held & ~(boundary & (gap < 1e-6 * size))
        if np.abs(forces[open_]).max(initial=0.0) > 1e-5 * scale:
            faults.append(f"forces of {np.abs(forces[open_]).max() / scale:.1e} without contact")
        touching = ~held & ~open_
        if pressing[touching].min(initial=0.0) < -1e-5 * scale:
            faults.append("the circle pulls")
        beyond = np.linalg.norm(shear, axis=1)[touching] - body.friction * np.maximum(pressing[touching], 0.0)
        if beyond.max(initial=0.0) > 1e-5 * scale:
            faults.append(f"friction beyond its bound by {beyond.max() / scale:.1e}")
        return faults

    def passed(self, before: tuple[Array, Array], now: tuple[Array, Array]) -> bool:
        """Whether the centre of the circle is inside the body on the straight way between two states."""
        far = np.linalg.norm(now[1] - before[1]) + np.abs(now[0] - before[0]).max()
        steps = int(np.clip(np.ceil(far / (0.2 * self.body.radius)), 1, 2000))
        for share in np.arange(1, steps) / steps:
            u, centre = ((1 - share) * a + share * b for a, b in zip(before, now, strict=True))
            if _inside(self.outline(u, dense=3), centre[None])[0]:
                return True
        return False


def _corners(local: Array) -> Array:
    """Corners of triangles whose nodes have these places in their boxes, shape (c, 3, 2)."""
    at_corner = (np.isclose(local, 0) | np.isclose(local, 1)).all(axis=2)
    return np.asarray(local[at_corner].reshape(len(local), 3, 2))


def _boundary(x: Array, size: tuple[float, float]) -> npt.NDArray[np.bool_]:
    near = 1e-9 * max(size)
    return np.asarray(((np.abs(x) <= near) | (np.abs(x - np.array(size)) <= near)).any(axis=1))


def _inside(polygon: Array, points: Array) -> npt.NDArray[np.bool_]:
    """Whether points are inside a closed polygon: by the winding number, shape (n,)."""
    arms = polygon[None] - points[:, None]
    ahead = np.roll(arms, -1, axis=1)
    cross = arms[..., 0] * ahead[..., 1] - arms[..., 1] * ahead[..., 0]
    turning = np.arctan2(cross, (arms * ahead).sum(axis=2)).sum(axis=1)
    return np.asarray(np.abs(turning) > np.pi)


def posed(body: RandomBody) -> tuple[NonlinearContactProblem, Judge]:
    """The problem of the package, and its judge."""
    mesh = dmesh.create_rectangle(MPI.COMM_SELF, [[0.0, 0.0], list(body.size)], body.counts, _CELLS[body.cell])
    space = fem.functionspace(mesh, ("Lagrange", body.degree, (2,)))
    u, test, trial = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
    lame = fem.Constant(mesh, body.moduli[1])
    dx = ufl.dx(metadata={"quadrature_degree": _QUADRATURE})

    def facets(where: Callable[[Array], Any]) -> Any:
        return dmesh.locate_entities_boundary(mesh, 1, where)

    near = 1e-9 * max(body.size)
    top = facets(lambda x: np.abs(x[1] - body.size[1]) <= near)
    bottom = facets(lambda x: np.abs(x[1]) <= near)
    others = np.setdiff1d(facets(lambda x: np.full(x.shape[1], True)), bottom)
    tags = dmesh.meshtags(mesh, 1, np.sort(top), np.ones(len(top), dtype=np.int32))
    ds = ufl.Measure("ds", mesh, subdomain_data=tags, metadata={"quadrature_degree": _QUADRATURE})(1)

    def elastic(stiff: float) -> Any:
        mu = fem.Constant(mesh, stiff * body.moduli[0])
        gradient = ufl.Identity(2) + ufl.grad(u)
        volume = ufl.det(gradient)
        density = mu / 2 * (ufl.inner(gradient, gradient) - 2) - mu * ufl.ln(volume) + lame / 2 * ufl.ln(volume) ** 2
        return ufl.derivative(density * dx, u, test)

    F = elastic(1.0) - ufl.inner(fem.Constant(mesh, body.pull), test) * ds
    if body.pressure:
        gradient = ufl.Identity(2) + ufl.grad(u)
        area = ufl.det(gradient) * ufl.inv(gradient).T * ufl.FacetNormal(mesh)
        F += fem.Constant(mesh, body.pressure) * ufl.inner(area, test) * ds
    given = body.wrong_tangent != 1.0 or body.pressure
    J = ufl.derivative(elastic(body.wrong_tangent), u, trial) if given else None
    held = fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(space, 1, bottom), space)
    friction = Coulomb(body.friction) if body.friction else None
    circle = {"shape": "circle", "centre": tuple(body.start), "radius": body.radius}
    contact = Foundation(others, shape=circle, friction=friction)
    problem = NonlinearContactProblem(F, u, bcs=[held], contact=contact, J=J, algorithm="alm", max_newton=40)
    nodes = space.dofmap.list.astype(np.int64)
    return problem, Judge(body, space.tabulate_dof_coordinates()[:, :2], nodes)


def tried(seed: int) -> tuple[str, list[str]]:
    """How the solve of a seed ends, and what is wrong with it; the latter is empty unless it is called converged."""
    body = RandomBody.drawn(seed)
    problem, judge = posed(body)
    states = [(np.zeros_like(judge.x), body.start)]
    faults = list[str]()

    def place(share: float) -> None:
        problem.place(0, shift=tuple(body.centre(share) - body.start))

    def judged(share: float) -> None:
        state = problem.u.x.array.reshape(-1, 2).copy(), body.centre(share)
        if judge.passed(states[-1], state):
            faults.append(f"passed through before {share:.3g}")
        faults.extend(f"at {share:.3g}: {fault}" for fault in judge.faults(*state))
        states.append(state)

    try:
        if body.first is None:
            place(1.0)
            problem.solve()
            judged(1.0)
        else:
            problem.ramp(place, first=body.first, on_step=lambda step: judged(step.load))
    except ConvergenceError:
        status = problem.status
        return (status.value if status is not None else "no status"), faults
    except FormError as error:
        return f"refused: {str(error).split(':')[1].strip()}", faults
    return "converged", faults


def main(count: int, first: int = 0) -> int:
    """Try seeds, print what is wrong and how each kind of scene ends; the number of wrong ones."""
    ends, wrong, begun = Counter[tuple[str, str]](), Counter[str](), time.process_time()
    for seed in range(first, first + count):
        kind, (end, faults) = RandomBody.drawn(seed).kind, tried(seed)
        ends[end, kind] += 1
        wrong[kind] += bool(faults)
        if faults:
            print(f"seed {seed}: {end}: {'; '.join(faults[:3])}", flush=True)
    print(f"{count} bodies, {wrong.total()} wrong, {time.process_time() - begun:.0f} s\n")
    kinds, totals = sorted({kind for _, kind in ends}), Counter[str]()
    for (end, _), number in ends.items():
        totals[end] += number

    def row(title: str, numbers: Sequence[object], total: object) -> None:
        print(f"{title:36}" + "".join(f"{number!s:>9}" for number in (*numbers, total)))

    row("", kinds, "all")
    for end, total in totals.most_common():
        row(end, [ends[end, kind] for kind in kinds], total)
    row("wrong", [wrong[kind] for kind in kinds], wrong.total())
    return wrong.total()


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:3]))))
