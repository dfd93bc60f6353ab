"""A scene with its solution as plain arrays on triangles, for what can be proved of it: loads, supports, contact."""

from __future__ import annotations

from dataclasses import dataclass

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx import compat
from signorini_fx.accuracy.bounded_error import SAME
from signorini_fx.accuracy.bounded_scene import Points, Refused, lame_of, refuse_unknown
from signorini_fx.accuracy.local_stress import constant_forces
from signorini_fx.accuracy.triangles import GAUSS, Array, Triangles, divide
from signorini_fx.body.assembly import facet_entities
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.effects.contact import CoulombFriction, TrescaFriction, UnilateralContact
from signorini_fx.effects.displacement import PrescribedDisplacement
from signorini_fx.scene.effect import Force
from signorini_fx.scene.load_steps import factor_at

# Places along a facet at which gaps and friction bounds are looked at; those between two of them are assumed to be
# bounded by what is seen there.
_ALONG: Array = np.arange(33) / 32
# Values at both ends and in the middle of the linear function whose moments with linear ones are those that Simpson's
# rule has from nodal values.
_LINEAR: Array = np.array([[2.0, 2.0, -1.0], [0.5, 2.0, 0.5], [-1.0, 2.0, 2.0]]) / 3
# Share of the largest displacement up to which elements hold one.
_HELD = 1e-9


@dataclass
class FacetsInContact:
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


class Problem:
    """A scene with its solution as plain arrays on triangles."""

    def __init__(self, d: Discretisation, y: fem.Function, contact: ContactState | None, place: float) -> None:
        self._d, self._place, self.assumed = d, place, ""
        refuse_unknown(d)
        if d.tagged.dimension != 2:
            raise Refused("in space the error alone has a guaranteed bound")
        self._triangulate(y)
        t = self.t
        self.held = np.zeros((len(t.edges), 2, 2))
        self.traction = np.zeros((len(t.edges), 2, 2))
        self.missed_on_edges = np.zeros(len(t.edges))
        self._supports()
        self._tractions()
        self._body()
        self.contacts = (
            []
            if contact is None
            else [self._contact(number, effect, contact) for number, effect in enumerate(d.scene.contact)]
        )

    def _triangulate(self, y: fem.Function) -> None:
        """Triangles of the cells, with degree 2 four of each, and the displacement at vertices and middles of edges."""
        mesh, space = self._d.tagged.mesh, y.function_space
        cells = np.asarray(compat.geometry_cells(mesh), dtype=np.int64)
        x = np.asarray(mesh.geometry.x[:, :2], dtype=np.float64)
        used, cells = np.unique(cells, return_inverse=True)
        cells = cells.reshape(len(space.dofmap.list), -1)
        x = x[used]
        self.cells = cells
        values = y.x.array.reshape(-1, 2)[space.dofmap.list]
        at: Array = np.zeros((len(x), 2))
        at[cells] = values[:, : cells.shape[1]]
        quads = mesh.topology.cell_name() == "quadrilateral"
        if quads:
            across = x[cells[:, 0]] - x[cells[:, 1]] - x[cells[:, 2]] + x[cells[:, 3]]
            if np.abs(across).max() > SAME * self._d.tagged.size:
                raise Refused("a guaranteed bound is for quadrilaterals that are parallelograms: use triangles")
        corners = np.concatenate((cells[:, [0, 1, 3]], cells[:, [0, 3, 2]])) if quads else cells
        owner = np.tile(np.arange(len(cells)), 2) if quads else np.arange(len(cells))
        p = x[corners]
        turned = np.linalg.det(p[:, 1:] - p[:, :1]) < 0
        order = np.where(turned[:, None], [0, 2, 1], [0, 1, 2])
        corners = np.take_along_axis(corners, order, axis=1)
        self.t = t = Triangles(x, corners, lame_of(self._d, owner))
        middle: Array = at[t.edges].mean(axis=1)
        if quads:  # the middle of the diagonal is that of the cell
            half = len(cells)
            diagonal = np.where(turned[:half], t.of_triangle[:half, 2], t.of_triangle[:half, 1])
            middle[diagonal] = values.mean(axis=1)
        elif values.shape[1] == 6:
            middle[t.of_triangle] = np.take_along_axis(values[:, 3:], order[:, :, None], axis=1)
        self.owner, self.y, self.middle = owner, at, middle
        self._keys = t.edges @ [len(x), 1]
        self._parts: npt.NDArray[np.int64] = np.arange(len(t.edges))[:, None]
        if values.shape[1] == 6:  # the stress is linear: on four triangles it is as accurate as that of degree 2
            self.t, self.y, self.middle, self._parts = divide(t, at, middle)
            self.owner = np.tile(owner, 4)

    def _edges(self, name: str) -> npt.NDArray[np.int64]:
        """The edges of a boundary, the parts of each facet one after the other."""
        mesh = self._d.tagged.mesh
        entities = facet_entities(mesh, self._d.tagged.facets(name))
        local = np.array(basix.topology(getattr(basix.CellType, mesh.topology.cell_name()))[1])
        ends = np.sort(np.take_along_axis(self.cells[entities[:, 0]], local[entities[:, 1]], axis=1), axis=1)
        count = int(self.cells.max()) + 1
        return self._parts[np.searchsorted(self._keys, ends @ [count, 1])].ravel()

    def along(self, edges: npt.NDArray[np.int64], s: Array) -> Points:
        """Points along edges, with their normals."""
        a, b = (self.t.x[self.t.edges[edges, k]][:, None] for k in (0, 1))
        x = a + s[:, None] * (b - a)
        return Points(x, np.broadcast_to(self.t.outward[edges][:, None], x.shape))

    def _supports(self) -> None:
        """Directions in which edges are held; the displacement there is one that the elements hold."""
        scene, size = self._d.scene, np.abs(self.y).max()
        for effect in scene.of(PrescribedDisplacement):
            edges = self._edges(str(effect.boundary))
            factor = factor_at(scene.factors_of(effect), self._place)
            points = self.along(edges, GAUSS[0])
            found = quadratic(self.y, self.middle, self.t.edges, edges, GAUSS[0])
            rows = [(effect.normal, self.t.outward[edges])]
            rows += [(value, np.tile(np.eye(2)[k], (len(edges), 1))) for k, value in enumerate(effect.components[:2])]
            for value, direction in rows:
                if value is None:
                    continue
                there = np.einsum("fqd,fd->fq", found, direction)
                given = factor * points.value(value)
                if np.abs(there - given).max(initial=0.0) > _HELD * max(size, np.abs(given).max(initial=0.0)):
                    raise Refused(f"the displacement of {effect.boundary!r} is no polynomial of the elements")
                self.held[edges] += direction[:, :, None] * direction[:, None]
        values, vectors = np.linalg.eigh(self.held)
        self.held = np.einsum("eik,ek,ejk->eij", vectors, np.where(values > SAME, 1.0, 0.0), vectors)

    def _tractions(self) -> None:
        """Linear tractions with the moments of those given, and the square of what they miss on each edge."""
        s, w = GAUSS
        total = np.zeros((len(self.t.edges), len(s), 2))
        for load in self._d.scene.of(Force):
            factor = factor_at(self._d.scene.factors_of(load), self._place)
            if load.where is not None and factor != 0:
                edges = self._edges(load.where)
                total[edges] += factor * load.density_at(self.along(edges, s))
        total -= np.einsum("eij,eqj->eqi", self.held, total)
        self._on_edges = total
        first, second = np.einsum("q,eqd->ed", w * (1 - s), total), np.einsum("q,eqd->ed", w * s, total)
        self.traction = np.stack((4 * first - 2 * second, 4 * second - 2 * first), axis=1)
        linear = np.einsum("qa,ead->eqd", np.column_stack((1 - s, s)), self.traction)
        self.missed_on_edges = self.t.length * np.einsum("q,eqd->e", w, (total - linear) ** 2)

    def _body(self) -> None:
        """Moments of the body force, and the square of what constants on the thirds miss of it in each triangle."""
        t = self.t
        loads = [load for load in self._d.scene.of(Force) if load.where is None]
        self.body, self.missed_inside = np.zeros((len(t.corners), 3, 2)), np.zeros(len(t.corners))
        self._bubbles = np.zeros_like(self.body)
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
            points = Points(x, np.zeros_like(x))
            force = np.zeros_like(x)
            for load in loads:
                factor = factor_at(self._d.scene.factors_of(load), self._place)
                force += factor * np.broadcast_to(load.density_at(points), x.shape)
            self.body += np.einsum("n,q,qc,nqd->ncd", t.area / 3, weight, barycentric, force)
            bubbles = 4 * barycentric[:, [1, 2, 0]] * barycentric[:, [2, 0, 1]]
            self._bubbles += np.einsum("n,q,qc,nqd->ncd", t.area / 3, weight, bubbles, force)
            mean = np.einsum("q,nqd->nd", weight, force)
            self.missed_inside += t.area / 3 * np.einsum("q,nqd->n", weight, (force - mean[:, None]) ** 2)
            self._means = [*getattr(self, "_means", []), mean]
        # The constants have the moments of the force, and differ from its means.
        differ = constant_forces(t, self.body) - np.stack(self._means, axis=1)
        self.missed_inside += np.einsum("n,nid->n", t.area / 3, differ**2)

    def work(self, y: Array, middle: Array) -> float:
        """Of the loads on a displacement of degree 2, without what supports take of them, energy per thickness."""
        t, every = self.t, np.arange(len(self.t.edges))
        on_edges = np.einsum("eqd,q,eqd->e", self._on_edges, GAUSS[1], quadratic(y, middle, t.edges, every, GAUSS[0]))
        above = middle[t.of_triangle] - y[t.edges].mean(axis=1)[t.of_triangle]
        inside = np.einsum("ncd,ncd->", self.body, y[t.corners]) + np.einsum("ncd,ncd->", self._bubbles, above)
        return float(t.length @ on_edges + inside)

    def _contact(self, number: int, effect: UnilateralContact, contact: ContactState) -> FacetsInContact:
        """The facets of a contact, with admissible tractions near the nodal ones."""
        t, boundary, edges = self.t, contact.boundary, self._edges(effect.boundary)
        normal = t.outward[edges]
        if effect.direction is not None:
            normal = np.tile(np.array(effect.direction[:2]) / np.linalg.norm(effect.direction[:2]), (len(edges), 1))
        if hasattr(effect.gap, "ufl_shape"):
            raise Refused("a gap given as a form is not known between the nodes")
        fine = self.along(edges, _ALONG).value(effect.gap)
        below = fine[:, [0, len(_ALONG) // 2, -1]]
        above = (on_parabola(below, _ALONG) - fine).max(axis=1).clip(min=0.0)
        # The nodes at both ends of each edge, and the edge of each row of them.
        rows = boundary.segments[boundary.segments[:, 0] == number][:, 1:]
        of_part = boundary.part == number
        index = np.full(int(boundary.global_nodes.max()) + 1, -1)
        index[boundary.global_nodes[of_part]] = np.flatnonzero(of_part)
        rows = index[rows]
        ends = np.stack((rows[:, :-1], rows[:, 1:]), axis=2).reshape(-1, 2)
        near = cKDTree(t.x).query(boundary.x[ends][..., :2])[1]
        place = np.argsort(np.searchsorted(t.edges @ [len(t.x), 1], np.sort(near, axis=1) @ [len(t.x), 1]))
        place = place[np.argsort(np.argsort(edges))]
        back = (near[:, 0] > near[:, 1])[place, None]

        def linear(nodal: Array, *, positive: bool = False) -> Array:
            """Linear functions on the edges with the moments of the nodal rule, or not negative with its resultants."""
            found = nodal[rows]
            if rows.shape[1] == 3:
                found = found @ _LINEAR.T
                if positive:  # with the resultant of each facet, of which a thin body takes notice
                    cut = found.clip(min=0.0)
                    share = found @ [0.25, 0.5, 0.25] / np.maximum(cut @ [0.25, 0.5, 0.25], np.finfo(float).tiny)
                    found = cut * share.clip(0.0, 1.0)[:, None]
            found = np.stack((found[:, :-1], found[:, 1:]), axis=2).reshape(-1, 2)[place]
            return np.where(back, found[:, ::-1], found)

        pressure = linear(contact.pressure, positive=True).clip(min=0.0)
        gauss = self.along(edges, GAUSS[0])
        match effect.friction if effect.friction.acts else None:
            case TrescaFriction(bound=bound):
                if hasattr(bound, "ufl_shape"):
                    raise Refused("a friction bound given as a form is not known between the nodes")
                bounds = gauss.value(bound)
                seen = self.along(edges, _ALONG).value(bound)
                over = (on_line(seen[:, [0, -1]], _ALONG) - seen).max(axis=1).clip(min=0.0)
                least = (seen[:, [0, -1]] - over[:, None]).clip(min=0.0)
            case CoulombFriction():
                least = linear(contact.bound).clip(min=0.0)
                bounds = on_line(least, GAUSS[0])
                self.assumed = (
                    "of the Tresca problem with the computed friction bound, converged or not: that this is the bound "
                    "of the exact solution is assumed"
                )
            case _:
                least, bounds = np.zeros_like(pressure), np.zeros((len(edges), len(GAUSS[0])))
        shear = np.clip(linear(contact.shear[:, 0]), -least, least)
        return FacetsInContact(
            edges, normal, gauss.value(effect.gap), below - above[:, None], bounds, pressure, shear, least
        )


def on_line(ends: Array, s: Array) -> Array:
    """Values of linear functions at places, shape (m, q)."""
    return ends[:, :1] * (1 - s) + ends[:, 1:] * s


def on_bernstein(coefficients: Array, s: Array) -> Array:
    """Values of parabolas from their coefficients of Bernstein, shape (m, q)."""
    return np.asarray(coefficients @ np.stack(((1 - s) ** 2, 2 * s * (1 - s), s**2)))


def on_parabola(values: Array, s: Array) -> Array:
    """Values of parabolas from those at both ends and in the middle, shape (m, q)."""
    a, m, b = values.T
    return on_bernstein(np.column_stack((a, 2 * m - (a + b) / 2, b)), s)


def quadratic(y: Array, middle: Array, ends: npt.NDArray[np.int64], edges: npt.NDArray[np.int64], s: Array) -> Array:
    """A displacement at places along edges, shape (m, q, 2)."""
    a, b, m = y[ends[edges, 0]][:, None], y[ends[edges, 1]][:, None], middle[edges][:, None]
    x = s[:, None]
    return np.asarray(a * (1 - x) * (1 - 2 * x) + 4 * m * x * (1 - x) + b * x * (2 * x - 1))
