"""A guaranteed bound of the error of a displacement in the energy norm, for contact without or with Tresca friction.

Let v be a displacement that keeps to its supports and does not enter the foundation, and tau a symmetric stress in
equilibrium with the loads, with a pressure p >= 0 and a shear |mu| <= g on the contact boundary.  The squared distances
of v and tau from the solution, in the norms of the energy and of the complementary energy, add up to at most

    |C eps(v) - tau|^2 + 2 int p (d - v_n) + 2 int (g |v_t| - mu v_t),

of which every part is local and not negative (W. Prager and J. L. Synge, Quart. Appl. Math. 5 (1947) 241-269; for
contact the gap of the dual functionals, I. Ekeland and R. Temam, Convex Analysis and Variational Problems).  v is the
finite element solution without what it enters the foundation, tau the stress of least complementary energy of
``equilibrated_stress`` with tractions made of the nodal pressures.  What the stress does not hold of the loads enters
with explicit constants.  docs/theory.md lists what is assumed.  In the plane, straight cells, one rank.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx import compat
from signorini_fx.accuracy.equilibrated_stress import (
    GAUSS,
    Loads,
    Triangles,
    constant_forces,
    equilibrate,
    free_motions,
)
from signorini_fx.body.assembly import facet_entities
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.effects.contact import CoulombFriction, TrescaFriction, UnilateralContact
from signorini_fx.effects.displacement import PrescribedDisplacement
from signorini_fx.scene.effect import Force, Resistance
from signorini_fx.scene.expressions import in_space, sample
from signorini_fx.scene.load_steps import factor_at

Array = npt.NDArray[np.float64]

# Places along a facet at which gaps and friction bounds are looked at; those between two of them are assumed to be
# bounded by what is seen there.
_ALONG: Array = np.arange(33) / 32
# Lengths below this share of the size of the body are equal; prescribed displacements that elements hold.
_SAME, _HELD = 1e-9, 1e-9
_ROUND_OFF = 64 * float(np.finfo(float).eps)
_BALANCES = 200


class _Refused(Exception):
    """A problem that has no bound here, with the reason."""


@dataclass(frozen=True, repr=False)
class ErrorBound:
    """A bound of the error of a computed displacement; energy norms are the square root of a(y, y).

    Attributes:
        error: bound of the energy norm of the error, everything included.
        size: energy norm of the computed displacement.
        duality: its share from the gap between both functionals.
        data: that of loads between what the stress holds of them.
        moved: that of the displacement without penetration instead of the computed one.
        round_off: that of sums and linear systems.
        squares: contributions of the cells to the square of ``error``, shape (cells,).
        assumed: what the statement rests on beside the data at points of quadrature; "": nothing.
    """

    error: float
    size: float
    duality: float
    data: float
    moved: float
    round_off: float
    squares: Array
    assumed: str = ""

    @property
    def relative(self) -> float:
        """Bound of the error relative to the energy norm of the exact solution; infinite where it proves nothing."""
        return self.error / (self.size - self.error) if self.error < self.size else np.inf

    @property
    def strain_energy(self) -> tuple[float, float]:
        """Bounds of the strain energy of the exact solution, an energy per thickness."""
        return max(self.size - self.error, 0.0) ** 2 / 2, (self.size + self.error) ** 2 / 2

    def __str__(self) -> str:
        """One sentence."""
        if not np.isfinite(self.relative):
            return "the bound of the error is larger than the solution"
        low, high = self.strain_energy
        said = f"at most {100 * self.relative:.3g} % in the energy norm; strain energy between {low:.6g} and {high:.6g}"
        return f"{said}; {self.assumed}" if self.assumed else said

    def as_dict(self) -> dict[str, Any]:
        """JSON-safe; null for a relative error without a bound."""
        return {
            "relative_error": self.relative if np.isfinite(self.relative) else None,
            "strain_energy": list(self.strain_energy),
            **{name: getattr(self, name) for name in ("error", "duality", "data", "moved", "round_off")},
            "statement": str(self),
        }


def error_bound(
    d: Discretisation, y: fem.Function, contact: ContactState | None, place: float = 0.0
) -> ErrorBound | str:
    """The bound for a solution; or why there is none.

    Args:
        d: the discretised scene.
        y: the displacement.
        contact: the contact nodes.
        place: of the load step in the lists of factors.
    """
    try:
        return _Problem(d, y, contact, place).bound()
    except _Refused as refused:
        return str(refused)


@dataclass(frozen=True)
class _Points:
    """Points of quadrature, ``scene.effect.Points``.

    Attributes:
        x: shape (f, q, 2).
        normal: outward, shape (f, q, 2).
    """

    x: Array
    normal: Array

    @property
    def displacement(self) -> Array:
        """Not known."""
        raise _Refused("a load that follows the displacement has no bound of its error")

    def value(self, value: Any) -> Array:
        """Of a number, an expression or a callable, shape (f, q)."""
        if hasattr(value, "ufl_shape"):
            raise _Refused("a load given as a form is not known between points of quadrature")
        return sample(value, in_space(self.x.reshape(-1, 2))).reshape(self.x.shape[:2])

    def vector(self, values: tuple[Any, ...]) -> Array:
        """Values along the axes, shape (f, q, 2)."""
        return np.stack([self.value(value) for value in values[:2]], axis=2)


@dataclass
class _Contact:
    """The facets of one contact.

    Attributes:
        edges: of the triangles, shape (m,).
        normal: to the foundation, shape (m, 2).
        gap: at the points of ``GAUSS``, and at both ends and the middle of a parabola below it, lengths, shapes (m, q)
            and (m, 3).
        below: see ``gap``.
        bound: g at the points of ``GAUSS``, stress, shape (m, q).
        pressure: p at both ends, stress, shape (m, 2).
        shear: mu at both ends, stress, shape (m, 2).
        least: a linear function of which |mu| is at most, at both ends, stress, shape (m, 2).
    """

    edges: npt.NDArray[np.int64]
    normal: Array
    gap: Array
    below: Array
    bound: Array
    pressure: Array
    shear: Array
    least: Array

    @property
    def tangent(self) -> Array:
        """T = (-n_2, n_1), shape (m, 2)."""
        return np.column_stack((-self.normal[:, 1], self.normal[:, 0]))

    @property
    def traction(self) -> Array:
        """On the body at both ends, stress, shape (m, 2, 2)."""
        return -self.pressure[:, :, None] * self.normal[:, None] - self.shear[:, :, None] * self.tangent[:, None]


class _Problem:
    """A scene with its solution as plain arrays on triangles."""

    def __init__(self, d: Discretisation, y: fem.Function, contact: ContactState | None, place: float) -> None:
        self._d, self._place, self.assumed = d, place, ""
        self._refuse()
        self._triangulate(y)
        t = self.t
        self._held = np.zeros((len(t.edges), 2, 2))
        self._traction = np.zeros((len(t.edges), 2, 2))
        self._missed_on_edges = np.zeros(len(t.edges))
        self._supports()
        self._tractions()
        self._body()
        self.contacts = (
            []
            if contact is None
            else [self._contact(number, effect, contact) for number, effect in enumerate(d.scene.contact)]
        )

    def _refuse(self) -> None:
        """Raise where the scene has something that this proof does not know."""
        d = self._d
        mesh, degree = d.tagged.mesh, d.space.element.basix_element.degree
        kind = mesh.topology.cell_name()
        for wrong, reason in (
            (d.comm.size > 1, "a guaranteed bound is computed on one rank"),
            (d.tagged.dimension != 2, "a guaranteed bound is for bodies in the plane"),
            (compat.geometry_degree(mesh) > 1, "a guaranteed bound is for straight cells"),
            (kind == "quadrilateral" and degree > 1, "on quadrilaterals a guaranteed bound is for degree 1"),
            (d.scene.several_steps, "a guaranteed bound is for one load step"),
            (bool(d.scene.of(Resistance)), "springs have no guaranteed bound"),
            (
                any(type(one) is not UnilateralContact or one.against for one in d.scene.contact),
                "a guaranteed bound is for unilateral contact with a rigid foundation",
            ),
        ):
            if wrong:
                raise _Refused(reason)

    def _triangulate(self, y: fem.Function) -> None:
        """Triangles of the cells, and the displacement at their vertices and middles of edges."""
        mesh, space = self._d.tagged.mesh, y.function_space
        cells = np.asarray(compat.geometry_cells(mesh), dtype=np.int64)
        x = np.asarray(mesh.geometry.x[:, :2], dtype=np.float64)
        used, cells = np.unique(cells, return_inverse=True)
        cells = cells.reshape(len(space.dofmap.list), -1)
        x = x[used]
        self._cells, self._geometry = cells, np.full(int(used.max()) + 1, -1)
        self._geometry[used] = np.arange(len(used))
        values = y.x.array.reshape(-1, 2)[space.dofmap.list]
        at = np.zeros((len(x), 2))
        at[cells] = values[:, : cells.shape[1]]
        quads = mesh.topology.cell_name() == "quadrilateral"
        if quads:
            across = x[cells[:, 0]] - x[cells[:, 1]] - x[cells[:, 2]] + x[cells[:, 3]]
            if np.abs(across).max() > _SAME * self._d.tagged.size:
                raise _Refused("a guaranteed bound is for quadrilaterals that are parallelograms: use triangles")
        corners = np.concatenate((cells[:, [0, 1, 3]], cells[:, [0, 3, 2]])) if quads else cells
        owner = np.tile(np.arange(len(cells)), 2) if quads else np.arange(len(cells))
        p = x[corners]
        turned = np.linalg.det(p[:, 1:] - p[:, :1]) < 0
        order = np.where(turned[:, None], [0, 2, 1], [0, 1, 2])
        corners = np.take_along_axis(corners, order, axis=1)
        lame = []
        for part in self._d.lame:
            by_cell = part.x.array[part.function_space.dofmap.list[:, 0]] if isinstance(part, fem.Function) else None
            lame.append(np.full(len(corners), float(part.value)) if by_cell is None else by_cell[owner])
        self.t = t = Triangles(x, corners, np.column_stack(lame))
        middle = at[t.edges].mean(axis=1)
        if quads:  # the middle of the diagonal is that of the cell
            half = len(cells)
            diagonal = np.where(turned[:half], t.of_triangle[:half, 2], t.of_triangle[:half, 1])
            middle[diagonal] = values.mean(axis=1)
        elif values.shape[1] == 6:
            middle[t.of_triangle] = np.take_along_axis(values[:, 3:], order[:, :, None], axis=1)
        self.owner, self.y, self.middle = owner, at, middle

    def _edges(self, name: str) -> npt.NDArray[np.int64]:
        """The edges of a boundary."""
        mesh = self._d.tagged.mesh
        entities = facet_entities(mesh, self._d.tagged.facets(name))
        local = np.array(basix.topology(getattr(basix.CellType, mesh.topology.cell_name()))[1])
        ends = np.sort(np.take_along_axis(self._cells[entities[:, 0]], local[entities[:, 1]], axis=1), axis=1)
        keys = self.t.edges @ [len(self.t.x), 1]
        return np.searchsorted(keys, ends @ [len(self.t.x), 1])

    def _along(self, edges: npt.NDArray[np.int64], s: Array) -> _Points:
        """Points along edges, with their normals."""
        a, b = (self.t.x[self.t.edges[edges, k]][:, None] for k in (0, 1))
        x = a + s[:, None] * (b - a)
        return _Points(x, np.broadcast_to(self.t.outward[edges][:, None], x.shape))

    def _supports(self) -> None:
        """Directions in which edges are held; the displacement there is one that the elements hold."""
        scene, size = self._d.scene, np.abs(self.y).max()
        for effect in scene.of(PrescribedDisplacement):
            edges = self._edges(effect.boundary)
            factor = factor_at(scene.factors_of(effect), self._place)
            points = self._along(edges, GAUSS[0])
            found = _quadratic(self.y, self.middle, self.t.edges, edges, GAUSS[0])
            rows = [(effect.normal, self.t.outward[edges])]
            rows += [(value, np.tile(np.eye(2)[k], (len(edges), 1))) for k, value in enumerate(effect.components[:2])]
            for value, direction in rows:
                if value is None:
                    continue
                there = np.einsum("fqd,fd->fq", found, direction)
                given = factor * points.value(value)
                if np.abs(there - given).max(initial=0.0) > _HELD * max(size, np.abs(given).max(initial=0.0)):
                    raise _Refused(f"the displacement of {effect.boundary!r} is no polynomial of the elements")
                self._held[edges] += direction[:, :, None] * direction[:, None]
        values, vectors = np.linalg.eigh(self._held)
        self._held = np.einsum("eik,ek,ejk->eij", vectors, np.where(values > _SAME, 1.0, 0.0), vectors)

    def _tractions(self) -> None:
        """Linear tractions with the moments of those given, and the square of what they miss on each edge."""
        s, w = GAUSS
        total = np.zeros((len(self.t.edges), len(s), 2))
        for load in self._d.scene.of(Force):
            factor = factor_at(self._d.scene.factors_of(load), self._place)
            if load.where is not None and factor != 0:
                edges = self._edges(load.where)
                total[edges] += factor * load.density_at(self._along(edges, s))
        total -= np.einsum("eij,eqj->eqi", self._held, total)
        first, second = np.einsum("q,eqd->ed", w * (1 - s), total), np.einsum("q,eqd->ed", w * s, total)
        self._traction = np.stack((4 * first - 2 * second, 4 * second - 2 * first), axis=1)
        linear = np.einsum("qa,ead->eqd", np.column_stack((1 - s, s)), self._traction)
        self._missed_on_edges = self.t.length * np.einsum("q,eqd->e", w, (total - linear) ** 2)

    def _body(self) -> None:
        """Moments of the body force, and the square of what constants on the thirds miss of it in each triangle."""
        t = self.t
        loads = [load for load in self._d.scene.of(Force) if load.where is None]
        self.body, self._missed_inside = np.zeros((len(t.corners), 3, 2)), np.zeros(len(t.corners))
        if not loads:
            return
        # On each third, so that the constants are seen: products of Gauss' points, collapsed.
        s, w = GAUSS
        a, b = (grid.ravel() for grid in np.meshgrid(s, s, indexing="ij"))
        weight = np.outer(w * (1 - s), w).ravel() * 2
        local = np.column_stack((1 - a - b * (1 - a), a, b * (1 - a)))
        for third in range(3):
            corners = np.full((3, 3), 1 / 3)
            corners[0], corners[1] = np.eye(3)[(third + 1) % 3], np.eye(3)[(third + 2) % 3]
            barycentric = local @ corners
            x = np.einsum("qc,ncd->nqd", barycentric, t.x[t.corners])
            points = _Points(x, np.zeros_like(x))
            force = np.zeros_like(x)
            for load in loads:
                factor = factor_at(self._d.scene.factors_of(load), self._place)
                force += factor * np.broadcast_to(load.density_at(points), x.shape)
            self.body += np.einsum("n,q,qc,nqd->ncd", t.area / 3, weight, barycentric, force)
            mean = np.einsum("q,nqd->nd", weight, force)
            self._missed_inside += t.area / 3 * np.einsum("q,nqd->n", weight, (force - mean[:, None]) ** 2)
            self._means = [*getattr(self, "_means", []), mean]
        # The constants have the moments of the force, and differ from its means.
        differ = constant_forces(t, self.body) - np.stack(self._means, axis=1)
        self._missed_inside += np.einsum("n,nid->n", t.area / 3, differ**2)

    def _contact(self, number: int, effect: UnilateralContact, contact: ContactState) -> _Contact:
        """The facets of a contact, with admissible tractions near the nodal ones."""
        t, boundary, edges = self.t, contact.boundary, self._edges(effect.boundary)
        normal = t.outward[edges]
        if effect.direction is not None:
            normal = np.tile(np.array(effect.direction[:2]) / np.linalg.norm(effect.direction[:2]), (len(edges), 1))
        if hasattr(effect.gap, "ufl_shape"):
            raise _Refused("a gap given as a form is not known between the nodes")
        fine, ends = self._along(edges, _ALONG).value(effect.gap), len(_ALONG) - 1
        parabola = np.stack((fine[:, 0], fine[:, ends // 2], fine[:, ends]), axis=1)
        above = (_parabola(parabola, _ALONG) - fine).max(axis=1).clip(min=0.0)
        # Nodal values at both ends of each edge, and in its middle.
        rows = boundary.segments[boundary.segments[:, 0] == number][:, 1:]
        of_part = boundary.part == number
        index = np.full(int(boundary.global_nodes.max()) + 1, -1)
        index[boundary.global_nodes[of_part]] = np.flatnonzero(of_part)
        rows = index[rows]
        near = cKDTree(t.x).query(boundary.x[rows[:, [0, -1]]][..., :2])[1]
        keys = t.edges @ [len(t.x), 1]
        place = np.searchsorted(keys, np.sort(near, axis=1) @ [len(t.x), 1])
        rows = np.where((near[:, 0] > near[:, 1])[:, None], rows[:, ::-1], rows)
        rows = rows[np.argsort(place)][np.argsort(np.argsort(edges))]

        def linear(nodal: Array) -> Array:
            """The linear function with the moments of the nodal rule."""
            found = nodal[rows]
            if rows.shape[1] == 2:
                return found
            a, m, b = found.T
            return np.column_stack((2 * a - b + 2 * m, 2 * b - a + 2 * m)) / 3

        pressure = linear(contact.pressure).clip(min=0.0)
        gauss = self._along(edges, GAUSS[0])
        match effect.friction if effect.friction.acts else None:
            case TrescaFriction(bound=bound):
                if hasattr(bound, "ufl_shape"):
                    raise _Refused("a friction bound given as a form is not known between the nodes")
                bounds = gauss.value(bound)
                seen = self._along(edges, _ALONG).value(bound)
                below = (_linear(seen[:, [0, -1]], _ALONG) - seen).max(axis=1).clip(min=0.0)
                least = (seen[:, [0, -1]] - below[:, None]).clip(min=0.0)
            case CoulombFriction():
                least = linear(contact.bound).clip(min=0.0)
                bounds = _linear(least, GAUSS[0])
                self.assumed = (
                    "of the Tresca problem with the computed friction bound: that the fixed point of the bound is "
                    "reached is assumed"
                )
            case _:
                least, bounds = np.zeros_like(pressure), np.zeros((len(edges), len(GAUSS[0])))
        shear = np.clip(linear(contact.shear[:, 0]), -least, least)
        return _Contact(
            edges, normal, gauss.value(effect.gap), parabola - above[:, None], bounds, pressure, shear, least
        )

    def bound(self) -> ErrorBound:
        """The bound of the error."""
        t = self.t
        computed = t.strain_at_corners(self.y, self.middle)
        self._balance()
        y, middle = self._admissible()
        traction = self._traction.copy()
        for one in self.contacts:
            free = np.eye(2) - self._held[one.edges]
            traction[one.edges] += np.einsum("eij,eaj->eai", free, one.traction)
        bubble = 2 / 3 * (middle - y[t.edges].mean(axis=1))
        stress = equilibrate(t, Loads(self.body, traction, self._held), y[t.edges] + bubble[:, None])
        strain = t.strain_at_corners(y, middle)
        own, centre = t.stress(strain), t.stress(strain).mean(axis=1)
        thirds = np.stack(
            [np.stack((own[:, (i + 1) % 3], own[:, (i + 2) % 3], centre), axis=1) for i in range(3)], axis=1
        )
        difference = thirds - stress.stress
        gap = (t.area / 36)[:, None] * (
            t.compliance_square(difference).sum(axis=2) + t.compliance_square(difference.sum(axis=2))
        )
        duality = gap.sum(axis=1)
        for one in self.contacts:
            np.add.at(duality, t.sides[one.edges].max(axis=1), 2 * self._on_contact(one, y, middle))
        moved = _energy(t, strain - computed)
        data = self._data()
        size = float(np.sqrt(_energy(t, computed).sum()))
        parts = [float(np.sqrt(squares.sum())) for squares in (duality, data, moved)]
        round_off = stress.missing + _ROUND_OFF * size
        total = (sum(parts) + round_off) * (1 + _ROUND_OFF * np.sqrt(len(t.corners)))
        squares: Array = np.zeros(len(self._cells))
        np.add.at(squares, self.owner, duality + data + moved)
        return ErrorBound(total, size, parts[0], parts[1], parts[2], round_off, squares, self.assumed)

    def _data(self) -> Array:
        """Squares of the bounds of the work of what the stress does not hold of the loads, by triangle."""
        t = self.t
        inside, gradient = t.korn
        longest = t.length[t.of_triangle].max(axis=1)
        found = inside * np.sqrt(self._missed_inside)
        for i in range(3):
            edge = t.of_triangle[:, i]
            outer = (t.sides[edge] < 0).any(axis=1)
            # |w|^2 on an edge <= |e| / |K| (|w|^2 + h |w| |grad w|) in the triangle.
            trace = np.sqrt(t.length[edge] / t.area * (inside**2 + longest * inside * gradient))
            found += np.where(outer, trace * np.sqrt(self._missed_on_edges[edge]), 0.0)
        return np.asarray(found**2 / t.softest)

    def _on_contact(self, one: _Contact, y: Array, middle: Array) -> Array:
        """Integrals of p (d - v_n) + g |v_t| - mu v_t over the facets, energies per thickness, shape (m,)."""
        s, w = GAUSS
        edges, length = one.edges, self.t.length[one.edges]
        v = _quadratic(y, middle, self.t.edges, edges, s)
        normal = np.einsum("fqd,fd->fq", v, one.normal)
        slip = np.einsum("fqd,fd->fq", v, one.tangent)
        work = _linear(one.pressure, s) * (one.gap - normal).clip(min=0.0)
        # Where the slip changes its sign its size is bounded by those of its coefficients of Bernstein.
        a, b = (np.einsum("fd,fd->f", y[self.t.edges[edges, k]], one.tangent) for k in (0, 1))
        m = 2 * np.einsum("fd,fd->f", middle[edges], one.tangent) - (a + b) / 2
        bernstein = np.column_stack((a, m, b))
        changes = (bernstein.min(axis=1) < 0) & (bernstein.max(axis=1) > 0)
        size = np.where(changes[:, None], _bernstein(np.abs(bernstein), s), np.abs(slip))
        work += (one.bound * size - _linear(one.shear, s) * slip).clip(min=0.0)
        return np.asarray(length * (work @ w))

    def _balance(self) -> None:
        """Change pressures and shears of a body that supports do not hold so that they balance its loads."""
        t = self.t
        modes = free_motions(t, self._held).reshape(len(t.x), 2, -1)
        if not modes.shape[2]:
            return
        if not self.contacts:
            raise _Refused("the body is not held")

        def work(traction: Array, edges: npt.NDArray[np.int64]) -> Array:
            """Of linear tractions (m, 2, 2) on the modes, shape (m, k)."""
            a, b = traction[:, 0], traction[:, 1]
            ends = np.stack((2 * a + b, a + 2 * b), axis=1) * t.length[edges, None, None] / 6
            return np.einsum("ead,eadk->ek", ends, modes[t.edges[edges]])

        loads = np.einsum("ncd,ncdk->k", self.body, modes[t.corners]) + work(
            self._traction, np.arange(len(t.edges))
        ).sum(axis=0)
        rows, low, high, start, weight = [], [], [], [], []
        for one in self.contacts:
            for end in (0, 1):
                for direction, least, most, now in (
                    (one.normal, np.zeros(len(one.edges)), np.full(len(one.edges), np.inf), one.pressure[:, end]),
                    (one.tangent, -one.least[:, end], one.least[:, end], one.shear[:, end]),
                ):
                    unit = np.zeros((len(one.edges), 2, 2))
                    unit[:, end] = -direction
                    rows.append(work(unit, one.edges))
                    low.append(least)
                    high.append(most)
                    start.append(now)
                    weight.append(1 / t.length[one.edges])
        a, least, most = np.concatenate(rows), np.concatenate(low), np.concatenate(high)
        z, flexible = np.concatenate(start), np.concatenate(weight)
        scale = np.abs(loads).max() + np.abs(a * z[:, None]).sum(axis=0).max()
        for _ in range(_BALANCES):
            rest = loads + a.T @ z
            if np.abs(rest).max() <= _ROUND_OFF * scale:
                break
            room = np.minimum(z - least, most - z) > 0
            use = a * (flexible * room)[:, None]
            z = np.clip(z - use @ np.linalg.lstsq(use.T @ a, rest, rcond=1e-12)[0], least, most)
        else:
            raise _Refused("no admissible tractions near the nodal ones balance the loads")
        parts = iter(np.split(z, np.cumsum([len(part) for part in start])[:-1]))
        for one in self.contacts:
            for end in (0, 1):
                one.pressure[:, end], one.shear[:, end] = next(parts), next(parts)

    def _admissible(self) -> tuple[Array, Array]:
        """The displacement without what it enters the foundation, at vertices and middles of edges."""
        t = self.t
        y, middle = self.y.copy(), self.middle.copy()
        tiny = _ROUND_OFF * (np.abs(y).max() + max((np.abs(one.below).max() for one in self.contacts), default=0.0))
        held = np.zeros((len(t.x), 2, 2))
        for k in (0, 1):
            np.add.at(held, t.edges[t.outer, k], self._held[t.outer])
        values, vectors = np.linalg.eigh(held)
        free = np.einsum("vik,vk,vjk->vij", vectors, np.where(values > _SAME, 0.0, 1.0), vectors)
        wanted: dict[int, list[tuple[Array, float]]] = {}
        for one in self.contacts:
            for end, column in ((0, 0), (1, 2)):
                vertex = t.edges[one.edges, end]
                excess = np.einsum("fd,fd->f", y[vertex], one.normal) - one.below[:, column]
                for k in np.flatnonzero(excess > -tiny):
                    wanted.setdefault(int(vertex[k]), []).append((one.normal[k], float(excess[k]) + tiny))
        for vertex, rows in wanted.items():
            y[vertex] -= _out(
                np.array([row[0] for row in rows]), np.array([row[1] for row in rows]), free[vertex], tiny
            )
        middle += y[t.edges].mean(axis=1) - self.y[t.edges].mean(axis=1)
        for one in self.contacts:
            a, b = (np.einsum("fd,fd->f", y[t.edges[one.edges, k]], one.normal) for k in (0, 1))
            m = np.einsum("fd,fd->f", middle[one.edges], one.normal)
            # Twice the middle of a parabola minus the mean of its ends is its second coefficient of Bernstein.
            excess = 2 * (m - one.below[:, 1]) - (a + b - one.below[:, 0] - one.below[:, 2]) / 2
            for k in np.flatnonzero(excess > -tiny):
                edge = one.edges[k]
                middle[edge] -= _out(
                    one.normal[k : k + 1], excess[k : k + 1] / 2 + tiny, np.eye(2) - self._held[edge], tiny
                )
        return y, middle


def _out(normals: Array, excess: Array, free: Array, tiny: float) -> Array:
    """A small displacement in free directions, shape (2,), whose components along normals are at least an excess."""
    along = normals @ free
    size = np.linalg.norm(along, axis=1)
    stuck = size <= _SAME
    if (excess[stuck] > 4 * tiny).any():
        raise _Refused("a support pushes the body into its foundation")
    along, excess, normals = along[~stuck], excess[~stuck].clip(min=0.0), normals[~stuck]
    if not len(along):
        return np.zeros(2)
    together = along.sum(axis=0)
    if (along @ together).min() < 0.1 * float(together @ together) / len(along):
        found = np.asarray(np.linalg.lstsq(along, excess, rcond=None)[0], dtype=np.float64)  # faces at a corner
        if ((along @ found) < excess - tiny).any():
            raise _Refused("the faces of the foundation meet at too sharp a corner")
        return found
    return np.asarray(together * (excess / (along @ together)).max())


def _energy(t: Triangles, strain: Array) -> Array:
    """Squares of energy norms of linear strains at corners, by triangle."""
    total = strain.sum(axis=1)
    stress = t.stress(strain)
    return np.asarray(t.area / 12 * (_product(stress, strain).sum(axis=1) + _product(stress.sum(axis=1), total)))


def _product(stress: Array, strain: Array) -> Array:
    return np.asarray((stress * strain * [1.0, 1.0, 2.0]).sum(axis=-1))


def _linear(ends: Array, s: Array) -> Array:
    """Values of linear functions at places, shape (m, q)."""
    return ends[:, :1] * (1 - s) + ends[:, 1:] * s


def _bernstein(coefficients: Array, s: Array) -> Array:
    """Values of parabolas from their coefficients of Bernstein, shape (m, q)."""
    return np.asarray(coefficients @ np.stack(((1 - s) ** 2, 2 * s * (1 - s), s**2)))


def _parabola(values: Array, s: Array) -> Array:
    """Values of parabolas from those at both ends and in the middle, shape (m, q)."""
    a, m, b = values.T
    return _bernstein(np.column_stack((a, 2 * m - (a + b) / 2, b)), s)


def _quadratic(y: Array, middle: Array, ends: npt.NDArray[np.int64], edges: npt.NDArray[np.int64], s: Array) -> Array:
    """A displacement at places along edges, shape (m, q, 2)."""
    a, b, m = y[ends[edges, 0]][:, None], y[ends[edges, 1]][:, None], middle[edges][:, None]
    x = s[:, None]
    return np.asarray(a * (1 - x) * (1 - 2 * x) + 4 * m * x * (1 - x) + b * x * (2 * x - 1))
