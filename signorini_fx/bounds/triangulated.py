"""A scene with its solution as plain arrays on triangles, for what can be proved of it: loads, supports, contact."""

from __future__ import annotations

from dataclasses import dataclass

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx import compat
from signorini_fx.body.assembly import facet_entities
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.bounds.arrays import Array, Ints
from signorini_fx.bounds.bounded_error import SAME_LENGTH
from signorini_fx.bounds.bounded_scene import (
    BoundPoints,
    Grounds,
    Refused,
    grounds,
    lame_of,
    refuse_unknown,
)
from signorini_fx.bounds.integrated_loads import in_triangles, on_edges
from signorini_fx.bounds.local_stress import constant_forces
from signorini_fx.bounds.triangles import GAUSS, Triangles, divide
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


class TriangulatedProblem:
    """A scene with its solution as plain arrays on triangles."""

    def __init__(self, d: Discretisation, y: fem.Function, contact: ContactState | None, step: float) -> None:
        self._d, self._position = d, step
        refuse_unknown(d)
        if d.tagged.dimension != 2:
            raise Refused("in space the error alone has a guaranteed bound")
        self._triangulate(y)
        t = self.t
        self.held = np.zeros((len(t.edges), 2, 2))
        self.traction = np.zeros((len(t.edges), 2, 2))
        self.missed_on_edges = np.zeros(len(t.edges))
        # Of the loads on each triangle what quadrature does not know, force.
        self.unknown = np.zeros(len(t.corners))
        self._supports()
        self._body()
        self.unknown_inside = self.unknown.copy()
        self._tractions()
        self.contacts = (
            []
            if contact is None
            else [self._contact(number, effect, contact) for number, effect in enumerate(d.scene.contact)]
        )

    @property
    def grounds(self) -> Grounds:
        """What all that is proved rests on."""
        size = float((self.t.length[:, None, None] * np.abs(self._on_edges)).sum() + np.abs(self.body).sum())
        unknown = float(self.unknown.sum()) / size if size > 0 else 0.0
        return grounds(self._d, coulomb=self._d.scene.has_coulomb, unknown=unknown)

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
            if np.abs(across).max() > SAME_LENGTH * self._d.tagged.size:
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

    def along(self, edges: npt.NDArray[np.int64], s: Array) -> BoundPoints:
        """Points along edges, with their normals."""
        a, b = (self.t.x[self.t.edges[edges, k]][:, None] for k in (0, 1))
        x = a + s[:, None] * (b - a)
        return BoundPoints(x, np.broadcast_to(self.t.outward[edges][:, None], x.shape))

    def _supports(self) -> None:
        """Directions in which edges are held; the displacement there is one that the elements hold."""
        scene, size = self._d.scene, np.abs(self.y).max()
        for effect in scene.of(PrescribedDisplacement):
            edges = self._edges(str(effect.boundary))
            factor = factor_at(scene.factors_of(effect), self._position)
            points = self.along(edges, GAUSS[0])
            displacement = quadratic(self.y, self.middle, self.t.edges, edges, GAUSS[0])
            rows = [(effect.normal, self.t.outward[edges])]
            rows += [(value, np.tile(np.eye(2)[k], (len(edges), 1))) for k, value in enumerate(effect.components[:2])]
            for value, direction in rows:
                if value is None:
                    continue
                component = np.einsum("fqd,fd->fq", displacement, direction)
                prescribed = factor * points.value(value)
                if np.abs(component - prescribed).max(initial=0.0) > _HELD * max(
                    size, np.abs(prescribed).max(initial=0.0)
                ):
                    raise Refused(f"the displacement of {effect.boundary!r} is no polynomial of the elements")
                self.held[edges] += direction[:, :, None] * direction[:, None]
        values, vectors = np.linalg.eigh(self.held)
        self.held = np.einsum("eik,ek,ejk->eij", vectors, np.where(values > SAME_LENGTH, 1.0, 0.0), vectors)

    def _forces(self, *, inside: bool) -> list[tuple[float, Force]]:
        """The loads in the body, or those on its boundary, that act, with their factors."""
        scene = self._d.scene
        loads = [(factor_at(scene.factors_of(load), self._position), load) for load in scene.of(Force)]
        return [(factor, load) for factor, load in loads if factor != 0 and (load.where is None) == inside]

    def _tractions(self) -> None:
        """Linear tractions with the moments of those given, and the square of what they miss on each edge."""
        t, loads = self.t, self._forces(inside=False)
        self._on_edges, self._unknown_on_edges = np.zeros((2, len(t.edges), 3, 2))
        if not loads:
            return
        acts_on = [self._edges(str(load.where)) for _, load in loads]
        edges = np.unique(np.concatenate(acts_on))

        def density(owner: Ints, points: BoundPoints) -> Array:
            """Without what supports take of it."""
            force = np.zeros_like(points.x)
            for (factor, load), loaded_edges in zip(loads, acts_on, strict=True):
                rows = np.flatnonzero(np.isin(edges[owner], loaded_edges))
                force[rows] += factor * load.density_at(BoundPoints(points.x[rows], points.normal[rows]))
            return np.asarray(force - np.einsum("mij,mqj->mqi", self.held[edges[owner]], force))

        integrated = on_edges(t, edges, density, [value for _, load in loads for value in load.given.values()])
        self._on_edges[edges], self._unknown_on_edges[edges] = integrated.moments, integrated.unknown
        first, second = (integrated.moments[:, k] + integrated.moments[:, 1] / 2 for k in (0, 2))
        self.traction[edges] = np.stack((4 * first - 2 * second, 4 * second - 2 * first), axis=1)
        self.missed_on_edges[edges] = t.length[edges] * integrated.missed
        np.add.at(self.unknown, t.sides[edges].max(axis=1), t.length[edges] * integrated.unknown.sum(axis=(1, 2)))

    def _body(self) -> None:
        """Moments of the body force, and the square of what constants on the thirds miss of it in each triangle."""
        t, loads = self.t, self._forces(inside=True)
        self.body, self.missed_inside = np.zeros((len(t.corners), 3, 2)), np.zeros(len(t.corners))
        self._bubbles, self._unknown_bubbles = np.zeros((2, len(t.corners), 3, 2))
        if not loads:
            return

        def density(_: Ints, points: BoundPoints) -> Array:
            parts = [factor * np.broadcast_to(load.density_at(points), points.x.shape) for factor, load in loads]
            return np.asarray(sum(parts, np.zeros_like(points.x)))

        values, means = [value for _, load in loads for value in load.given.values()], []
        for third in range(3):  # so that the constants are seen
            corners = np.full((3, 3), 1 / 3)
            corners[0], corners[1] = np.eye(3)[(third + 1) % 3], np.eye(3)[(third + 2) % 3]
            integrated = in_triangles(np.einsum("kc,ncd->nkd", corners, t.x[t.corners]), density, values)
            # Barycentric coordinates of the triangle are linear in those of the third, and so are their products.
            pairs = [np.outer(corners[:, (i + 1) % 3], corners[:, (i + 2) % 3]).ravel() for i in range(3)]
            share = t.area[:, None, None] / 3
            moments, unknown = integrated.moments, integrated.unknown
            self.body += share * np.einsum("kc,nkd->ncd", corners, moments[:, :3])
            self._bubbles += share * 4 * np.einsum("ck,nkd->ncd", np.array(pairs), moments[:, 3:])
            self._unknown_bubbles += share * 4 * np.einsum("ck,nkd->ncd", np.array(pairs), unknown[:, 3:])
            self.unknown += (share * unknown[:, :3]).sum(axis=(1, 2))
            self.missed_inside += t.area / 3 * integrated.missed
            means.append(integrated.means)
        # The constants have the moments of the force, and differ from its means.
        differ = constant_forces(t, self.body) - np.stack(means, axis=1)
        self.missed_inside += np.einsum("n,nid->n", t.area / 3, differ**2)

    def work(self, y: Array, middle: Array) -> float:
        """Of the loads on a displacement of degree 2, without what supports take of them, energy per thickness."""
        t = self.t
        on_edges = np.einsum("ebd,ebd->e", self._on_edges, self._bernstein(y, middle))
        above = middle[t.of_triangle] - y[t.edges].mean(axis=1)[t.of_triangle]
        inside = np.einsum("ncd,ncd->", self.body, y[t.corners]) + np.einsum("ncd,ncd->", self._bubbles, above)
        return float(t.length @ on_edges + inside)

    def unknown_work(self, y: Array, middle: Array) -> float:
        """How far that work is not known by quadrature, energy per thickness."""
        t = self.t
        on_edges = np.einsum("ebd,ebd->e", self._unknown_on_edges, np.abs(self._bernstein(y, middle)))
        above = np.abs(middle[t.of_triangle] - y[t.edges].mean(axis=1)[t.of_triangle])
        largest = np.abs(y[t.corners]).max(axis=(1, 2))
        inside = self.unknown_inside @ largest + np.einsum("ncd,ncd->", self._unknown_bubbles, above)
        return float(inside) + float(t.length @ on_edges)

    def _bernstein(self, y: Array, middle: Array) -> Array:
        """The coefficients of Bernstein of a displacement along the edges, shape (e, 3, 2)."""
        a, b = y[self.t.edges[:, 0]], y[self.t.edges[:, 1]]
        return np.stack((a, 2 * middle - (a + b) / 2, b), axis=1)

    def _contact(self, number: int, effect: UnilateralContact, contact: ContactState) -> FacetsInContact:
        """The facets of a contact, with admissible tractions near the nodal ones."""
        t, boundary, edges = self.t, contact.boundary, self._edges(effect.boundary)
        normal = t.outward[edges]
        if effect.direction is not None:
            normal = np.tile(np.array(effect.direction[:2]) / np.linalg.norm(effect.direction[:2]), (len(edges), 1))
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
        order = np.argsort(np.searchsorted(t.edges @ [len(t.x), 1], np.sort(near, axis=1) @ [len(t.x), 1]))
        order = order[np.argsort(np.argsort(edges))]
        back = (near[:, 0] > near[:, 1])[order, None]

        def linear(nodal: Array, *, positive: bool = False) -> Array:
            """Linear functions on the edges with the moments of the nodal rule, or not negative with its resultants."""
            tractions = nodal[rows]
            if rows.shape[1] == 3:
                tractions = tractions @ _LINEAR.T
                if positive:  # with the resultant of each facet, of which a thin body takes notice
                    cut = tractions.clip(min=0.0)
                    share = tractions @ [0.25, 0.5, 0.25] / np.maximum(cut @ [0.25, 0.5, 0.25], np.finfo(float).tiny)
                    tractions = cut * share.clip(0.0, 1.0)[:, None]
            tractions = np.stack((tractions[:, :-1], tractions[:, 1:]), axis=2).reshape(-1, 2)[order]
            return np.where(back, tractions[:, ::-1], tractions)

        pressure = linear(contact.pressure, positive=True).clip(min=0.0)
        gauss = self.along(edges, GAUSS[0])
        match effect.friction if effect.friction.acts else None:
            case TrescaFriction(bound=bound):
                bounds = gauss.value(bound)
                seen = self.along(edges, _ALONG).value(bound)
                over = (on_line(seen[:, [0, -1]], _ALONG) - seen).max(axis=1).clip(min=0.0)
                least = (seen[:, [0, -1]] - over[:, None]).clip(min=0.0)
            case CoulombFriction():
                least = linear(contact.bound).clip(min=0.0)
                bounds = on_line(least, GAUSS[0])
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
