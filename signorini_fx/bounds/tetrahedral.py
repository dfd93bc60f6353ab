"""A scene in space with its solution as plain arrays on tetrahedra: loads, supports, contact."""

from __future__ import annotations

from dataclasses import dataclass

import basix
import numpy as np
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
from signorini_fx.bounds.tetrahedra import Tetrahedra
from signorini_fx.effects.contact import CoulombFriction, TrescaFriction, UnilateralContact
from signorini_fx.effects.displacement import PrescribedDisplacement
from signorini_fx.scene.cut_simplices import cut
from signorini_fx.scene.effect import Force
from signorini_fx.scene.load_steps import factor_at

# Share of the largest displacement, or load, up to which polynomials hold one.
_HELD, _LOADED = 1e-9, 1e-12


def _quadrature(count: int) -> tuple[Array, Array]:
    """Barycentric points and weights of Gauss' rule on a triangle, collapsed, shapes (q, 3) and (q,)."""
    points, weights = np.polynomial.legendre.leggauss(count)
    s, w = (points + 1) / 2, weights / 2
    a, b = (grid.ravel() for grid in np.meshgrid(s, s, indexing="ij"))
    products = np.outer(2 * w * (1 - s), w).ravel()
    return np.column_stack((1 - a - b * (1 - a), a, b * (1 - a))), np.asarray(products, dtype=np.float64)


# Points of quadrature on a face, and those at which gaps and friction bounds are looked at.
GAUSS, WEIGHTS = _quadrature(6)
_SEEN: Array = np.array([(8 - i - j, i, j) for i in range(9) for j in range(9 - i)]) / 8
# Vertices and middles opposite them among the latter.
_NODES: Ints = np.array([int(np.abs(_SEEN - p).sum(axis=1).argmin()) for p in (*np.eye(3), *((1 - np.eye(3)) / 2))])
# Points in a tetrahedron at which a body force has to be constant.
_INSIDE: Array = (np.ones((4, 4)) + 12 * np.eye(4)) / 16
_INSIDE = np.concatenate((_INSIDE, np.eye(4) * 0.94 + 0.015, np.full((1, 4), 0.25)))


def bernstein(local: Array) -> Array:
    """Values of Bernstein's quadratics of the vertices and of the edges opposite them at points (q, 3), (q, 6)."""
    return np.column_stack((local**2, 2 * local[:, [1, 0, 0]] * local[:, [2, 2, 1]]))


def coefficients(nodal: Array) -> Array:
    """Of Bernstein, from values at three vertices and the middles of the edges opposite them, shape (m, 6, ...)."""
    ends = nodal[:, :3]
    between = 2 * nodal[:, 3:] - (ends.sum(axis=1, keepdims=True) - ends) / 2
    return np.concatenate((ends, between), axis=1)


@dataclass
class FacesInContact:
    """The faces of one contact.

    Attributes:
        faces: of the tetrahedra, shape (m,).
        normal: to the foundation, shape (m, 3).
        gap: at the points of ``GAUSS``, and coefficients of Bernstein of a quadratic below it, lengths, shapes (m, q)
            and (m, 6).
        below: see ``gap``.
        bound: g at the points of ``GAUSS``, stress, shape (m, q).
        pressure: p at the vertices, stress, shape (m, 3).
        shear: mu at the vertices, perpendicular to the normal, stress, shape (m, 3, 3).
        least: a linear function of which |mu| is at most, at the vertices, stress, shape (m, 3).
    """

    faces: Ints
    normal: Array
    gap: Array
    below: Array
    bound: Array
    pressure: Array
    shear: Array
    least: Array

    @property
    def traction(self) -> Array:
        """On the body at the vertices, stress, shape (m, 3, 3)."""
        return -self.pressure[:, :, None] * self.normal[:, None] - self.shear


class ProblemInSpace:
    """A scene with its solution as plain arrays on tetrahedra."""

    def __init__(self, d: Discretisation, y: fem.Function, contact: ContactState | None, step: float) -> None:
        self._d, self._position = d, step
        refuse_unknown(d)
        self._arrays(y)
        self.held = np.zeros((len(self.t.faces), 3, 3))
        self.traction = np.zeros((len(self.t.faces), 3, 3))
        self._supports()
        self._tractions()
        self._body()
        self.contacts = (
            []
            if contact is None
            else [self._contact(number, effect, contact) for number, effect in enumerate(d.scene.contact)]
        )

    @property
    def grounds(self) -> Grounds:
        """What all that is proved rests on."""
        return grounds(self._d, coulomb=self._d.scene.has_coulomb, unknown=0.0)

    def _arrays(self, y: fem.Function) -> None:
        """Tetrahedra, and the displacement at vertices and middles of edges."""
        mesh, dofs = self._d.tagged.mesh, y.function_space.dofmap.list
        used, cells = np.unique(np.asarray(compat.geometry_cells(mesh), dtype=np.int64), return_inverse=True)
        x, cells = np.asarray(mesh.geometry.x, dtype=np.float64)[used], cells.reshape(len(dofs), 4)
        values = y.x.array.reshape(-1, 3)[dofs]
        at: Array = np.zeros((len(x), 3))
        at[cells] = values[:, :4]
        turned = np.linalg.det(x[cells][:, 1:] - x[cells][:, :1]) < 0
        corners = np.where(turned[:, None], cells[:, [0, 1, 3, 2]], cells)
        self.t = t = Tetrahedra(x, corners, lame_of(self._d, np.arange(len(corners))))
        middle: Array = at[t.edges].mean(axis=1)
        if values.shape[1] == 10:
            ends = np.sort(cells[:, np.array(basix.topology(basix.CellType.tetrahedron)[1])], axis=2)
            middle[np.searchsorted(t.edges @ [len(x), 1], ends @ [len(x), 1])] = values[:, 4:]
        self.cells, self.y, self.middle = cells, at, middle

    def _faces(self, name: str) -> Ints:
        """The faces of a boundary."""
        entities = facet_entities(self._d.tagged.mesh, self._d.tagged.facets(name))
        local = np.array(basix.topology(basix.CellType.tetrahedron)[2])
        corners = np.sort(np.take_along_axis(self.cells[entities[:, 0]], local[entities[:, 1]], axis=1), axis=1)
        count = len(self.t.x)
        # Faces are in the order of their vertices.
        return np.searchsorted(self.t.faces @ [count**2, count, 1], corners @ [count**2, count, 1])

    def on(self, faces: Ints, local: Array) -> BoundPoints:
        """Points on faces, with their normals."""
        x = np.einsum("qc,fcd->fqd", local, self.t.x[self.t.faces[faces]])
        return BoundPoints(x, np.broadcast_to(self.t.normal[faces][:, None], x.shape))

    def nodal(self, y: Array, middle: Array, faces: Ints) -> Array:
        """A displacement at the vertices of faces and the middles of the edges opposite them, shape (m, 6, 3)."""
        return np.concatenate((y[self.t.faces[faces]], middle[self.t.edges_of_faces[faces]]), axis=1)

    def values(self, y: Array, middle: Array, faces: Ints) -> Array:
        """A displacement of degree 2 at the points of ``GAUSS`` on faces, shape (m, q, 3)."""
        return np.einsum("qc,fcd->fqd", bernstein(GAUSS), coefficients(self.nodal(y, middle, faces)))

    def _supports(self) -> None:
        """Directions in which faces are held; the displacement there is one that the elements hold."""
        scene, size = self._d.scene, np.abs(self.y).max()
        for effect in scene.of(PrescribedDisplacement):
            faces = self._faces(str(effect.boundary))
            factor = factor_at(scene.factors_of(effect), self._position)
            points, displacement = self.on(faces, GAUSS), self.values(self.y, self.middle, faces)
            rows = [(effect.normal, self.t.normal[faces])]
            rows += [(value, np.tile(np.eye(3)[k], (len(faces), 1))) for k, value in enumerate(effect.components[:3])]
            for value, direction in rows:
                if value is None:
                    continue
                component, prescribed = np.einsum("fqd,fd->fq", displacement, direction), factor * points.value(value)
                if np.abs(component - prescribed).max(initial=0.0) > _HELD * max(
                    size, np.abs(prescribed).max(initial=0.0)
                ):
                    raise Refused(f"the displacement of {effect.boundary!r} is no polynomial of the elements")
                self.held[faces] += direction[:, :, None] * direction[:, None]
        sizes, vectors = np.linalg.eigh(self.held)
        self.held = np.einsum("fik,fk,fjk->fij", vectors, np.where(sizes > SAME_LENGTH, 1.0, 0.0), vectors)

    def _tractions(self) -> None:
        """Those given, which have to be linear on faces: no constant of Korn's inequality is needed then."""
        moments = np.einsum("q,qa,qb->ab", WEIGHTS, GAUSS, GAUSS)
        for load in self._d.scene.of(Force):
            factor = factor_at(self._d.scene.factors_of(load), self._position)
            if load.where is None or factor == 0:
                continue
            faces = self._faces(load.where)
            tractions = factor * load.density_at(self.on(faces, GAUSS))
            linear = np.linalg.solve(moments, np.einsum("q,qa,fqd->fad", WEIGHTS, GAUSS, tractions))
            inside, owner, points = _in_parts(self.t.x[self.t.faces[faces]], self.t.normal[faces], load)
            away = factor * load.density_at(points) - inside @ linear[owner]
            size = np.abs(tractions).max(initial=0.0)
            if max(np.abs(tractions - GAUSS @ linear).max(initial=0.0), np.abs(away).max(initial=0.0)) > _LOADED * size:
                raise Refused(
                    f"in space a guaranteed bound is for tractions that are linear on each facet: that of "
                    f"{load.where!r} is not"
                )
            self.traction[faces] += linear
        self.traction -= np.einsum("fij,faj->fai", self.held, self.traction)

    def _body(self) -> None:
        """The force per volume, which has to be constant in each tetrahedron."""
        t = self.t
        self.body = np.zeros((len(t.corners), 3))
        for load in self._d.scene.of(Force):
            factor = factor_at(self._d.scene.factors_of(load), self._position)
            if load.where is not None or factor == 0:
                continue
            x = np.einsum("qc,ncd->nqd", _INSIDE, t.x[t.corners])
            densities = factor * np.broadcast_to(load.density_at(BoundPoints(x, np.zeros_like(x))), x.shape)
            _, owner, points = _in_parts(t.x[t.corners], np.zeros((len(t.corners), 3)), load)
            away = (
                factor * np.broadcast_to(load.density_at(points), points.x.shape)
                - densities.mean(axis=1)[owner][:, None]
            )
            if max(np.ptp(densities, axis=1).max(), np.abs(away).max()) > _LOADED * np.abs(densities).max():
                raise Refused("in space a guaranteed bound is for body forces that are constant in each cell")
            self.body += densities.mean(axis=1)

    def work(self, y: Array, middle: Array) -> float:
        """Of the loads on a displacement of degree 2, an energy."""
        t, all_faces = self.t, np.arange(len(self.t.faces))
        bubble = (middle - y[t.edges].mean(axis=1))[t.edges_of].sum(axis=1) / 5  # integrals of 4 l_a l_b
        inside = t.volume @ (self.body * (y[t.corners].mean(axis=1) + bubble)).sum(axis=1)
        loaded = all_faces[self.traction.any(axis=(1, 2))]
        values = (self.values(y, middle, loaded) * (GAUSS @ self.traction[loaded])).sum(axis=2)
        return float(inside + t.area[loaded] @ values @ WEIGHTS)

    def _contact(self, number: int, effect: UnilateralContact, contact: ContactState) -> FacesInContact:
        """The faces of a contact, with admissible tractions near the nodal ones."""
        t, boundary, faces = self.t, contact.boundary, self._faces(effect.boundary)
        normal = t.normal[faces]
        if effect.direction is not None:
            normal = np.tile(np.array(effect.direction) / np.linalg.norm(effect.direction), (len(faces), 1))
        fine = self.on(faces, _SEEN).value(effect.gap)
        below = coefficients(fine[:, _NODES])
        below -= (below @ bernstein(_SEEN).T - fine).max(axis=1, initial=0.0)[:, None]
        rows = np.flatnonzero(boundary.part == number)
        near = cKDTree(t.x).query(boundary.x[rows])[1]

        def at_vertices(values: Array) -> Array:
            """Values of contact points at the vertices of the faces; zero where there is none."""
            nodal = np.zeros((len(t.x), *values.shape[1:]))
            nodal[near] = values[rows]
            return np.asarray(nodal[t.faces[faces]])

        pressure = at_vertices(contact.pressure).clip(min=0.0)
        points = self.on(faces, GAUSS)
        match effect.friction if effect.friction.acts else None:
            case TrescaFriction(bound=bound):
                bounds, seen = points.value(bound), self.on(faces, _SEEN).value(bound)
                least = seen[:, _NODES[:3]]
                least = (least - (least @ _SEEN.T - seen).max(axis=1, initial=0.0)[:, None]).clip(min=0.0)
            case CoulombFriction():
                least = at_vertices(contact.bound).clip(min=0.0)
                bounds = least @ GAUSS.T
            case _:
                least, bounds = np.zeros_like(pressure), np.zeros((len(faces), len(GAUSS)))
        shear = at_vertices(np.einsum("nij,nj->ni", boundary.tangents, contact.shear))
        shear -= np.einsum("fad,fd,fe->fae", shear, normal, normal)
        surface = FacesInContact(faces, normal, points.value(effect.gap), below, bounds, pressure, shear, least)
        surface.shear = onto_disc(shear, least)
        return surface


def _in_parts(x: Array, normal: Array, load: Force) -> tuple[Array, Ints, BoundPoints]:
    """A point in each corner of the parts of faces or tetrahedra in which a load does not jump.

    Args:
        x: corners, length, shape (n, k, 3).
        normal: shape (n, 3).
        load: whose expressions say where it may jump.

    Returns:
        Their barycentric coordinates, shape (m, k, k), the face or tetrahedron that each part is in, shape (m,), and
        the points.
    """
    owner, parts = cut(x, load.given.values())
    inside = 0.99 * parts + 0.01 * parts.mean(axis=1, keepdims=True)
    at = inside @ x[owner]
    return inside, owner, BoundPoints(at, np.broadcast_to(normal[owner][:, None], at.shape))


def onto_disc(shear: Array, least: Array) -> Array:
    """The closest vectors of a size of at most ``least``, shape (..., 3)."""
    size = np.linalg.norm(shear, axis=-1)
    share = np.divide(least, size, out=np.ones_like(size), where=size > least) * (1 - 2 * np.finfo(float).eps)
    return np.asarray(shear * share[..., None])
