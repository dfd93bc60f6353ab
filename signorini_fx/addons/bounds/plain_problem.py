"""A scene with its solution on triangles or tetrahedra: displacement, supports, loads, contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.addons.bounds.balanced_tractions import onto_disc
from signorini_fx.addons.bounds.bounded_scene import refused
from signorini_fx.addons.bounds.contact_parts import MASTER, SLAVE, ContactParts, coefficients
from signorini_fx.addons.bounds.scene_arrays import Rows
from signorini_fx.addons.bounds.simplices import (
    EDGES,
    EDGES_OF_FACET,
    OF_QUARTERS,
    TWICE,
    Array,
    Ints,
    Moduli,
    Simplices,
    divide,
    with_hats,
)
from signorini_fx.tuned import SAME_LENGTH, ZERO_IN_SOLUTION

# Values at both ends of the linear function whose moments with linear ones are those that Simpson's rule has from nodal
# values, those at the ends first.
_LINEAR: Array = np.array([[4, -2, 4], [-2, 4, 4]]) / 6
# Of functions of degree 1 and 2 on an edge, by the number of their values at ends and middle, the values on its halves,
# which end with its middle, as that has the higher number.
_ON_HALVES: dict[int, Array] = {
    2: np.array([[[2, 0], [1, 1]], [[0, 2], [1, 1]]]) / 2,
    3: np.array([[[8, 0, 0], [0, 0, 8], [3, -1, 6]], [[0, 8, 0], [0, 0, 8], [-1, 3, 6]]]) / 8,
}


@dataclass
class FacetsInContact:
    """One contact."""

    parts: ContactParts  # where it is, m of them, on f facets with contact points
    gap: Array  # coefficients of Bernstein on the parts, length, shape (m, 3 or 6)
    bound: Array  # g at the vertices of the facets, stress, shape (f, d)
    pressure: Array  # p, see ``bound``
    shear: Array  # mu there, perpendicular to the normal, stress, shape (f, d, d)
    share: float  # of a change of the jump that the side with the contact points takes

    @property
    def paired(self) -> bool:
        """Whether it is between two bodies."""
        return len(self.parts.facets) == 2

    @property
    def traction(self) -> Array:
        """On the first body at the vertices of the parts, stress, shape (m, d, d)."""
        pressure, shear = self.parts.on_parts(self.pressure), self.parts.on_parts(self.shear)
        return np.asarray(-pressure[:, :, None] * self.parts.normal[:, None] - shear)

    def excess(self, displacement: Array) -> Array:
        """Coefficients of Bernstein of what a displacement is beyond the foundation or the other body, from its own,
        length, shape (m, c).
        """
        return np.einsum("fcd,fd->fc", displacement, self.parts.normal) - self.gap

    def work(self, motions: Array) -> tuple[Array, Array]:
        """Of unit pressures and shears at the vertices of the facets, shapes (f, d, k) and (f, d, d, k); ``motions``:
        linear displacements at the vertices of the parts, relative to the other side, length, shape (m, d, d, k).
        """
        parts = self.parts
        moments = with_hats(motions, parts.area)
        normal = -np.einsum("fadk,fd->fak", moments, parts.normal)
        across = -(moments + np.einsum("fak,fd->fadk", normal, parts.normal))
        return parts.moments(normal), parts.moments(across)


class PlainProblem:
    """A scene with its solution as plain arrays.

    Attributes:
        t: the cells; triangles of degree 2 are divided.
        y: the displacement at vertices, and at the middles of edges, length, shape (v + e, d).
        held: projectors onto the directions in which supports hold facets, shape (f, d, d).
        body: force per volume at the corners of the cells, shape (n, d + 1, d).
        traction: of loads at the vertices of the facets, without what supports take of it, stress, shape (f, d, d).
        named: the facets of the boundary that is asked for.
        contacts: the contacts of the scene, in its order.
        cells: how many the mesh has.
    """

    def __init__(self, rows: Rows, degree: int) -> None:
        self._rows, self.cells = rows, len(rows["corners"])
        d = int(rows["x"].shape[2])
        numbers, corners = np.unique(rows["corners"], return_inverse=True)
        corners = corners.reshape(-1, d + 1)
        self._numbers, x, body = numbers, np.zeros((len(numbers), d)), rows["body"]
        x[corners], ends = rows["x"], np.sort(corners[:, EDGES[d]], axis=2)
        turned = np.linalg.det(x[corners][:, 1:] - x[corners][:, :1]) < 0
        order = np.where(turned[:, None], [*range(d - 1), d, d - 1], np.arange(d + 1))
        body = np.take_along_axis(body, order[:, :, None], axis=1)
        t = Simplices(x, np.take_along_axis(corners, order, axis=1), _moduli(rows, d))
        y = np.zeros((len(x) + len(t.edges), d))
        y[np.column_stack((corners, len(x) + np.searchsorted(t.keys(t.edges), t.keys(ends))))] = rows["displacement"]
        self._given, self._halves = t, np.arange(len(t.facets))[:, None]
        if d == 2 and degree == 2:
            # The stress is linear: on four triangles it is as accurate as that of degree 2.
            self.t, self.y, self._halves = divide(t, y)
            body = np.einsum("kab,nbd->knad", OF_QUARTERS, body).reshape(-1, 3, 2)
        else:
            self.t, self.y = t, y
        self.body = body
        self.held = self._supports(y)
        self.traction: Array = np.zeros((len(self.t.facets), d, d))
        facets, values = self._on_halves(self._placed("loaded"), rows["traction"])
        np.add.at(self.traction, facets, values)
        self.traction = self.traction @ (np.eye(d) - self.held)
        self.named: Ints = self._halves[self._placed("named")].ravel()
        count = sum(name.startswith("slave ") for name in rows)
        self.contacts = [self._contact(number) for number in range(count)] if "point" in rows else []

    @property
    def body_moments(self) -> Array:
        """Integrals of the force per volume times the barycentric coordinates, force, shape (n, d + 1, d)."""
        return with_hats(self.body, self.t.volume)

    def work(self, y: Array) -> float:
        """Of the loads on a displacement that is linear on the cells, at the vertices, shape (v, d), an energy."""
        t = self.t
        on_facets = np.einsum("fad,fad->", with_hats(self.traction, t.area), y[t.facets])
        return float(on_facets + np.einsum("ncd,ncd->", self.body_moments, y[t.corners]))

    def relative(self, surface: FacetsInContact, y: Array) -> Array:
        """Coefficients of Bernstein of a displacement of degree 2 relative to the other body, on parts."""
        parts, nodes = surface.parts, self.t.nodes_of_facets
        of_sides = [parts.restricted(coefficients(y[nodes[parts.facet(side)]]), side) for side in parts.sides]
        return np.asarray(of_sides[SLAVE] - of_sides[MASTER] if surface.paired else of_sides[SLAVE])

    def _placed(self, name: str) -> Ints:
        """Facets of the undivided cells from their vertices, ascending, which rows with a name are."""
        t = self._given
        return np.searchsorted(t.keys(t.facets), t.keys(np.searchsorted(self._numbers, self._rows[name])))

    def _on_halves(self, facets: Ints, values: Array) -> tuple[Ints, Array]:
        """Facets of the cells from undivided ones, and values of polynomials at their vertices, or at middles too."""
        halves = self._halves[facets]
        if halves.shape[1] == 1:
            return halves[:, 0], values
        halved = np.einsum("hab,fb...->fha...", _ON_HALVES[values.shape[1]], values)
        return halves.ravel(), halved.reshape(-1, *values.shape[1:])

    def _supports(self, y: Array) -> Array:
        """Projectors onto the directions that supports hold, where the displacement is what they prescribe."""
        t, d = self.t, self.t.dimension
        facets, prescribed, direction = self._placed("supported"), self._rows["prescribed"], self._rows["direction"]
        nodal = y[self._given.nodes_of_facets[facets]]
        missed = np.abs(np.einsum("mcd,md->mc", nodal, direction) - prescribed).max(initial=0.0)
        if missed > ZERO_IN_SOLUTION * max(np.abs(y).max(), np.abs(prescribed).max(initial=0.0)):
            raise refused("supports that prescribe different displacements where they meet")
        held: Array = np.zeros((len(t.facets), d, d))
        for halves in self._halves[facets].T:
            np.add.at(held, halves, direction[:, :, None] * direction[:, None])
        sizes, vectors = np.linalg.eigh(held)
        return np.einsum("fik,fk,fjk->fij", vectors, np.where(sizes > SAME_LENGTH, 1.0, 0.0), vectors)

    def _contact(self, number: int) -> FacetsInContact:
        """With admissible tractions near the nodal ones."""
        t, rows, d = self.t, self._rows, self.t.dimension
        undivided = self._placed(f"slave {number}")
        towards = np.repeat(rows[f"towards {number}"], self._halves.shape[1], axis=0)
        facets, gap = self._on_halves(undivided, rows[f"gap {number}"])
        _, bound = self._on_halves(undivided, rows[f"bound {number}"])
        if f"master {number}" in rows:
            parts = ContactParts.between(t, facets, self._halves[self._placed(f"master {number}")].ravel())
            self._refuse_pair(number, parts, acts=bool(bound.any()))
        else:
            parts = ContactParts.on_foundation(t, facets, towards)
        points = np.flatnonzero(rows["contact of point"] == number)
        at, pressure, shear = (rows[name][points] for name in ("point", "pressure", "shear"))
        pressure, shear = self._linear(undivided, at, pressure, positive=True), self._linear(undivided, at, shear)
        order = np.argsort(facets)
        of_facets = order[np.searchsorted(facets, parts.facets[SLAVE], sorter=order)]
        normal = np.zeros((len(of_facets), d))
        normal[parts.row[SLAVE]] = parts.normal
        shear, bound = shear[of_facets], bound[of_facets].clip(min=0.0)
        shear = onto_disc(shear - np.einsum("fad,fd,fe->fae", shear, normal, normal), bound)
        gap = parts.restricted(coefficients(gap)[of_facets][parts.row[SLAVE]], SLAVE)
        if len(parts.facets) > 1 and rows[f"by geometry {number}"].any():
            apart = self._away(parts)
            gap += np.concatenate((apart, apart[:, EDGES_OF_FACET[d]].mean(axis=2)), axis=1)
        surface = FacetsInContact(parts, gap, bound, pressure[of_facets].clip(min=0.0), shear, 1.0)
        if surface.paired:
            soft = [float(t.moduli.stiffest[t.sides[side, 0]].mean()) for side in parts.facets]
            surface.share = soft[MASTER] / (soft[SLAVE] + soft[MASTER])
        return surface

    def _linear(self, undivided: Ints, points: Array, values: Array, *, positive: bool = False) -> Array:
        """At the vertices of facets of a contact, shape (m, d, ...), linear functions with values at its points, zero
        elsewhere; on halved facets with the moments of the nodal rule, or not negative with its resultants.
        """
        t, given = self.t, self._given
        # Of this side alone: vertices of the other body may be at the same places.
        halved = len(t.x) > len(given.x)  # then the middles of edges are vertices, too
        nodes = (given.nodes_of_facets if halved else given.facets)[undivided]
        own, nodal = np.unique(nodes), np.zeros((len(t.x), *values.shape[1:]))
        nodal[own[cKDTree(t.x[own]).query(points)[1]]] = values
        tractions = nodal[nodes]
        if halved:
            tractions = np.einsum("ab,mb...->ma...", _LINEAR, tractions)
            if positive:  # with the resultant of each facet, of which a thin body takes notice
                cut = tractions.clip(min=0.0)
                share = tractions.sum(axis=1) / np.maximum(cut.sum(axis=1), np.finfo(float).tiny)
                tractions = cut * share.clip(0.0, 1.0)[:, None]
        return self._on_halves(undivided, tractions)[1]

    def _away(self, parts: ContactParts) -> Array:
        """The distance of both sides along the normal at the vertices of the parts, length, shape (m, d)."""
        x = [parts.local[side] @ self.t.x[self.t.facets[parts.facet(side)]] for side in (SLAVE, MASTER)]
        return np.einsum("fad,fd->fa", x[MASTER] - x[SLAVE], parts.normal)

    def _refuse_pair(self, number: int, parts: ContactParts, *, acts: bool) -> None:
        """Refuse sides that the proof does not know; ``acts``: whether the contact has friction."""
        covered = float(self._rows[f"covered {number}"].sum())
        if abs(float(parts.area.sum()) - covered) > SAME_LENGTH * covered or not covered > 0:
            raise refused("sides of two bodies that neither match nor are flat and parallel")
        if acts and np.abs(self._away(parts)).max() > SAME_LENGTH * float(np.ptp(self.t.x, axis=0).max()):
            raise refused("friction of sides that are apart")


def _moduli(rows: Rows, d: int) -> Moduli:
    """Of the cells of the mesh."""
    if "stiffness" not in rows:
        return Moduli.isotropic(rows["lame"], rows["mu"], d)
    stiffness = rows["stiffness"]
    return Moduli(stiffness * TWICE[d], np.linalg.inv(stiffness) / TWICE[d][:, None])
