"""Loads as a stress in equilibrium can hold them: moments with linear functions, and what these miss.

In the plane any load is integrated, and the constants of Korn's inequality bound the work of what is missed.  In space
none of use is known: there loads have to be linear on facets and constant in cells.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_scene import BoundPoints, DensityPoints, profile_of
from signorini_fx.addons.bounds.equilibrated_stress import Loads
from signorini_fx.addons.bounds.facets import POINTS, WEIGHTS, bernstein, coefficients
from signorini_fx.addons.bounds.integrated_loads import in_triangles, integral, on_edges
from signorini_fx.addons.bounds.johnson_mercier import constant_forces
from signorini_fx.addons.bounds.korn import missed_squares
from signorini_fx.addons.bounds.simplices import Simplices
from signorini_fx.mechanics.statement.cut_simplices import cut
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.tuned import ZERO_SUM


@dataclass(frozen=True)
class Acting:
    """A load on the body.

    Attributes:
        factor: of the load step.
        load: as it is then.
        facets: that it acts on; None: in the body.
        mass: of the cells, mass per volume, shape (n,).
        whole: the integral of its ``weighting``; what has none does not ask for it.
        doubtful: how far this is not known by quadrature, relative.
    """

    factor: float
    load: Force
    facets: Ints | None
    mass: Array
    whole: float = np.nan
    doubtful: float = 0.0

    @staticmethod
    def of(t: Simplices, factor: float, load: Force, facets: Ints | None, mass: Array) -> Acting:
        """With the integral of its ``weighting``."""
        acting = Acting(factor, load, facets, mass)
        if facets is None or load.weighting is None:
            return acting
        whole, unknown = integral(t, facets, load.weighting)
        if not abs(whole) > 2 * unknown:
            raise Refused(f"what {load.label} of {load.where!r} is spread by has no known integral")
        return replace(acting, whole=whole, doubtful=unknown / (abs(whole) - unknown))

    def profile(self, dimension: int) -> tuple[Any, ...]:
        """See ``Force``."""
        return profile_of(self.load, dimension)

    def at(self, rows: Ints, points: BoundPoints) -> Array:
        """Force per volume or area at points on parts of cells, or of facets at these, shape (m, q, d).

        Args:
            rows: the cells, shape (m,).
            points: where.
        """
        asked = DensityPoints(points.x, points.normal, self.mass[rows], self.whole)
        return np.asarray(self.factor * np.broadcast_to(self.load.density_at(asked), points.x.shape))


# Points in a tetrahedron at which a body force has to be constant.
_INSIDE: Array = (np.ones((4, 4)) + 12 * np.eye(4)) / 16
_INSIDE = np.concatenate((_INSIDE, np.eye(4) * 0.94 + 0.015, np.full((1, 4), 0.25)))


class PlaneLoads:
    """Loads on triangles.

    Attributes:
        body: see ``equilibrated_stress.Loads``.
        traction: see ``body``.
        missed_inside: the square of what constants on the thirds miss of the force in each triangle, shape (n,).
    """

    def __init__(self, t: Simplices, held: Array, forces: list[Acting]) -> None:
        self._t, self._held = t, held
        self.body, self.missed_inside = np.zeros((len(t.corners), 3, 2)), np.zeros(len(t.corners))
        self.traction, self._missed_on_edges = np.zeros((len(t.facets), 2, 2)), np.zeros(len(t.facets))
        self._bubbles, self._unknown_bubbles = np.zeros((2, len(t.corners), 3, 2))
        self._on_edges, self._unknown_on_edges = np.zeros((2, len(t.facets), 3, 2))
        # Of the loads on each triangle what quadrature does not know, force.
        self._unknown = np.zeros(len(t.corners))
        self._integrate_body([force for force in forces if force.facets is None])
        self._unknown_inside = self._unknown.copy()
        self._integrate_tractions([(force, force.facets) for force in forces if force.facets is not None])

    @property
    def acting(self) -> Loads:
        """What the stress is in equilibrium with."""
        return Loads(self.body, self.traction, self._unknown)

    @property
    def unknown_share(self) -> float:
        """The part of them that quadrature does not know, relative."""
        size = float((self._t.area[:, None, None] * np.abs(self._on_edges)).sum() + np.abs(self.body).sum())
        return float(self._unknown.sum()) / size if size > 0 else 0.0

    def missed_beside(self, contact: Array) -> Array:
        """Squares of bounds of the work of what the stress does not hold, per unit of the energy norm, shape (n,).

        Args:
            contact: norms in L2 of what it does not hold of the tractions of contact on each edge, shape (f,).
        """
        edges = (np.sqrt(self._missed_on_edges) + contact) ** 2
        return missed_squares(self._t, self.missed_inside, edges)

    def _integrate_tractions(self, loads: list[tuple[Acting, Ints]]) -> None:
        """Linear tractions with the moments of those given, and the square of what they miss on each edge."""
        t = self._t
        if not loads:
            return
        edges = np.unique(np.concatenate([loaded_edges for _, loaded_edges in loads]))

        def density(owner: Ints, points: BoundPoints) -> Array:
            """Without what supports take of it."""
            force = np.zeros_like(points.x)
            for load, loaded_edges in loads:
                rows = np.flatnonzero(np.isin(edges[owner], loaded_edges))
                at = BoundPoints(points.x[rows], points.normal[rows])
                force[rows] += load.at(t.sides[edges[owner[rows]], 0], at)
            return np.asarray(force - np.einsum("mij,mqj->mqi", self._held[edges[owner]], force))

        values = [value for load, _ in loads for value in load.profile(2)]
        integrated = on_edges(t, edges, density, values)
        self._on_edges[edges], self._unknown_on_edges[edges] = integrated.moments, integrated.unknown
        missed: Array = np.zeros(len(t.facets))
        missed[edges] = np.sqrt(integrated.missed)
        for load, loaded_edges in loads:
            if load.doubtful > 0:
                largest, missed_alone = self._largest_moments(load, loaded_edges)
                self._unknown_on_edges[loaded_edges] += load.doubtful * largest[:, None, None]
                missed[loaded_edges] += load.doubtful * missed_alone
        first, second = (integrated.moments[:, k] + integrated.moments[:, 1] / 2 for k in (0, 2))
        self.traction[edges] = np.stack((4 * first - 2 * second, 4 * second - 2 * first), axis=1)
        self._missed_on_edges[:] = t.area * missed**2
        unknown = self._unknown_on_edges[edges].sum(axis=(1, 2))
        np.add.at(self._unknown, t.sides[edges, 0], t.area[edges] * unknown)

    def _largest_moments(self, load: Acting, edges: Ints) -> tuple[Array, Array]:
        """Bounds of the moments of a traction on edges, which are at most the root of its mean square, and that of what
        linear functions miss of it, stresses, shape (m,).
        """
        integrated = on_edges(
            self._t,
            edges,
            lambda owner, points: load.at(self._t.sides[edges[owner], 0], points),
            list(load.profile(2)),
        )
        linear = 4 * np.linalg.norm(integrated.moments, axis=2).sum(axis=1)
        missed = np.sqrt(integrated.missed)
        return linear + missed, missed

    def _integrate_body(self, loads: list[Acting]) -> None:
        """Moments of the body force, and the square of what constants on the thirds miss of it in each triangle."""
        t = self._t
        if not loads:
            return

        def density(owner: Ints, points: BoundPoints) -> Array:
            return np.asarray(sum((load.at(owner, points) for load in loads), np.zeros_like(points.x)))

        values, means = [value for load in loads for value in load.profile(2)], []
        for third in range(3):  # so that the constants are seen
            corners = np.full((3, 3), 1 / 3)
            corners[0], corners[1] = np.eye(3)[(third + 1) % 3], np.eye(3)[(third + 2) % 3]
            integrated = in_triangles(np.einsum("kc,ncd->nkd", corners, t.x[t.corners]), density, values)
            # Barycentric coordinates of the triangle are linear in those of the third, and so are their products.
            pairs = [np.outer(corners[:, (i + 1) % 3], corners[:, (i + 2) % 3]).ravel() for i in range(3)]
            share = t.volume[:, None, None] / 3
            moments, unknown = integrated.moments, integrated.unknown
            self.body += share * np.einsum("kc,nkd->ncd", corners, moments[:, :3])
            self._bubbles += share * 4 * np.einsum("ck,nkd->ncd", np.array(pairs), moments[:, 3:])
            self._unknown_bubbles += share * 4 * np.einsum("ck,nkd->ncd", np.array(pairs), unknown[:, 3:])
            self._unknown += (share * unknown[:, :3]).sum(axis=(1, 2))
            self.missed_inside += t.volume / 3 * integrated.missed
            means.append(integrated.means)
        # The constants have the moments of the force, and differ from its means.
        differ = constant_forces(t, self.body) - np.stack(means, axis=1)
        self.missed_inside += np.einsum("n,nid->n", t.volume / 3, differ**2)

    def work(self, y: Array, middle: Array) -> float:
        """Of the loads on a displacement of degree 2, without what supports take of them, energy per thickness."""
        t, on_edges, above = self._t, *self._parts(y, middle)
        inside = np.einsum("ncd,ncd->", self.body, y[t.corners]) + np.einsum("ncd,ncd->", self._bubbles, above)
        return float(t.area @ np.einsum("ebd,ebd->e", self._on_edges, on_edges) + inside)

    def size_of_work(self, y: Array, middle: Array) -> float:
        """The sizes of what is summed up to that work, energy per thickness.

        In the moments of an edge or a triangle cancels what linear functions, or constants, miss there.
        """
        t, along = self._t, self._parts(y, middle)[0]
        on_edges = t.area * np.abs(self._on_edges).sum(axis=(1, 2)) + np.sqrt(t.area * self._missed_on_edges)
        inside = np.abs(self.body).sum(axis=(1, 2)) + np.sqrt(t.volume * self.missed_inside)
        largest = np.abs(along).max(axis=(1, 2))
        return float(on_edges @ largest + inside @ largest[t.facets_of].max(axis=1))

    def unknown_work(self, y: Array, middle: Array) -> float:
        """How far that work is not known by quadrature, energy per thickness."""
        t, on_edges, above = self._t, *self._parts(y, middle)
        largest = np.abs(y[t.corners]).max(axis=(1, 2))
        inside = self._unknown_inside @ largest + np.einsum("ncd,ncd->", self._unknown_bubbles, np.abs(above))
        return float(inside) + float(t.area @ np.einsum("ebd,ebd->e", self._unknown_on_edges, np.abs(on_edges)))

    def _parts(self, y: Array, middle: Array) -> tuple[Array, Array]:
        """A displacement along the edges, coefficients (e, 3, 2), and its parts that vanish at corners, (n, 3, 2)."""
        t, middles = self._t, y[self._t.edges].mean(axis=1)
        along = np.stack((y[t.edges[:, 0]], 2 * middle - middles, y[t.edges[:, 1]]), axis=1)
        return along, (middle - middles)[t.facets_of]


class LinearLoads:
    """Loads on tetrahedra that are linear on faces and constant in cells: the stress holds them.

    Attributes:
        body: see ``equilibrated_stress.Loads``.
        traction: see ``body``.
        unknown_share: see ``PlaneLoads``.
    """

    unknown_share = 0.0

    def __init__(self, t: Simplices, held: Array, forces: list[Acting]) -> None:
        self._t = t
        self.body, self.traction = np.zeros((len(t.corners), 4, 3)), np.zeros((len(t.facets), 3, 3))
        for force in forces:
            if force.doubtful > ZERO_SUM:
                raise Refused(
                    "in space a guaranteed bound is for forces whose spread is a polynomial: that on "
                    f"{force.load.where!r} is not"
                )
            if force.facets is None:
                self.body += (t.volume[:, None] / 4 * self._constant(force))[:, None]
            else:
                self.traction[force.facets] += self._linear(force, force.facets)
        self.traction -= np.einsum("fij,faj->fai", held, self.traction)

    @property
    def acting(self) -> Loads:
        """See ``PlaneLoads``."""
        return Loads(self.body, self.traction)

    def missed_beside(self, contact: Array) -> Array:
        """See ``PlaneLoads``: nothing, and for tractions of contact no constants are known."""
        if contact.any():
            raise Refused("in space a guaranteed bound is for tractions that are linear on each facet")
        return np.zeros(len(self.body))

    def _linear(self, load: Acting, faces: Ints) -> Array:
        """A traction at the vertices of faces, shape (m, 3, 3)."""
        t, points, weights, cells = self._t, POINTS[3], WEIGHTS[3], self._t.sides[faces, 0]
        x = np.einsum("qc,fcd->fqd", points, t.x[t.facets[faces]])
        at = BoundPoints(x, np.broadcast_to(t.normal[faces][:, None], x.shape))
        tractions = load.at(cells, at)
        moments = np.einsum("q,qa,qb->ab", weights, points, points)
        linear = np.linalg.solve(moments, np.einsum("q,qa,fqd->fad", weights, points, tractions))
        inside, owner, corners = _in_parts(t.x[t.facets[faces]], t.normal[faces], load)
        away = load.at(cells[owner], corners) - inside @ linear[owner]
        size = np.abs(tractions).max(initial=0.0)
        if max(np.abs(tractions - points @ linear).max(initial=0.0), np.abs(away).max(initial=0.0)) > ZERO_SUM * size:
            raise Refused(
                "in space a guaranteed bound is for tractions that are linear on each facet: that of "
                f"{load.load.where!r} is not"
            )
        return np.asarray(linear)

    def _constant(self, load: Acting) -> Array:
        """A force per volume, shape (n, 3)."""
        corners = self._t.x[self._t.corners]
        x = np.einsum("qc,ncd->nqd", _INSIDE, corners)
        densities = load.at(np.arange(len(corners)), BoundPoints(x, np.zeros_like(x)))
        means = densities.mean(axis=1)
        _, owner, points = _in_parts(corners, np.zeros((len(corners), 3)), load)
        away = load.at(owner, points) - means[owner][:, None]
        if max(np.ptp(densities, axis=1).max(), np.abs(away).max()) > ZERO_SUM * np.abs(densities).max():
            raise Refused("in space a guaranteed bound is for body forces that are constant in each cell")
        return np.asarray(means)

    def work(self, y: Array, middle: Array) -> float:
        """Of the loads on a displacement of degree 2, an energy."""
        t = self._t
        bubble = (middle - y[t.edges].mean(axis=1))[t.edges_of].sum(axis=1) / 5  # integrals of 4 l_a l_b
        inside = (self.body.sum(axis=1) * (y[t.corners].mean(axis=1) + bubble)).sum()
        loaded = np.flatnonzero(self.traction.any(axis=(1, 2)))
        nodal = np.concatenate((y[t.facets[loaded]], middle[t.edges_of_facets[loaded]]), axis=1)
        values = (bernstein(POINTS[3]) @ coefficients(nodal) * (POINTS[3] @ self.traction[loaded])).sum(axis=2)
        return float(inside + t.area[loaded] @ values @ WEIGHTS[3])

    def unknown_work(self, y: Array, middle: Array) -> float:  # all of it is known
        """See ``PlaneLoads``."""
        return 0.0


def _in_parts(x: Array, normal: Array, load: Acting) -> tuple[Array, Ints, BoundPoints]:
    """A point in each corner of the parts of faces or tetrahedra in which a load does not jump.

    Args:
        x: corners, length, shape (n, k, 3).
        normal: shape (n, 3).
        load: whose expressions say where it may jump.

    Returns:
        Their barycentric coordinates, shape (m, k, k), the face or tetrahedron that each part is in, shape (m,), and
        the points.
    """
    owner, parts = cut(x, load.profile(3))
    inside = 0.99 * parts + 0.01 * parts.mean(axis=1, keepdims=True)
    at = inside @ x[owner]
    return inside, owner, BoundPoints(at, np.broadcast_to(normal[owner][:, None], at.shape))
