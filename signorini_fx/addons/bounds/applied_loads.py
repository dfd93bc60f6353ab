"""Loads as a stress in equilibrium can hold them: moments with linear functions, and what these miss.

Constants of Korn's inequality, in ``korn``, bound the work of what is missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_scene import BoundPoints, DensityPoints, profile_of
from signorini_fx.addons.bounds.equilibrated_stress import Loads
from signorini_fx.addons.bounds.facets import coefficients
from signorini_fx.addons.bounds.initial_stress import sizes_of_rules
from signorini_fx.addons.bounds.integrated_loads import (
    Density,
    Integrated,
    closest_linear,
    in_simplices,
    integral,
    on_edges,
)
from signorini_fx.addons.bounds.johnson_mercier import constant_forces
from signorini_fx.addons.bounds.korn import missed_squares, work_beside_linear, work_inside
from signorini_fx.addons.bounds.lifted_forces import lifted_forces
from signorini_fx.addons.bounds.simplices import CORNERS_OF_PARTS, EDGES, EDGES_OF_FACET, Simplices
from signorini_fx.addons.bounds.varying_springs import SpringReaction
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.quantities.proved_statements import Refused

# Which of the cells, or all of them.
Cells = npt.NDArray[np.bool_] | slice
EVERYWHERE = slice(None)
# Sizes of the rules in the plane: of the one that counts, and of the one that it is compared with.
_SIZES_IN_PLANE = (8, 5)


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
        beyond: degree of what its values are multiplied by.
    """

    factor: float
    load: Force
    facets: Ints | None
    mass: Array
    whole: float = np.nan
    doubtful: float = 0.0
    beyond: int = 0

    @staticmethod
    def of(t: Simplices, factor: float, load: Force, facets: Ints | None, mass: Array) -> Acting:
        """With the integral of its ``weighting``."""
        acting = Acting(factor, load, facets, mass)
        if facets is None or load.weighting is None:
            return acting
        total, unknown = integral(t, facets, load.weighting)
        if not abs(total) > 2 * unknown:
            raise Refused(f"what {load.label} of {load.where!r} is spread by has no known integral")
        return replace(acting, whole=total, doubtful=unknown / (abs(total) - unknown))

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

    def on(self, t: Simplices, facets: Ints, points: BoundPoints) -> Array:
        """Force per area at points on parts of facets, shape (m, q, d)."""
        return self.at(t.sides[facets, 0], points)


Load = Acting | SpringReaction


def beside(t: Simplices, cells: Cells) -> npt.NDArray[np.bool_]:
    """Which facets of the boundary are those of some cells, shape (f,)."""
    selected = np.zeros(len(t.corners), dtype=bool)
    selected[cells] = True
    return np.asarray(selected[t.sides[:, 0]])


@dataclass(frozen=True)
class BodyLoads:
    """Forces in n cells.

    Attributes:
        t: the cells.
        moments: integrals times the barycentric coordinates, force, shape (n, d + 1, d).
        bubbles: those times 4 l_a l_b of each edge, in the order of ``EDGES``, force, shape (n, 3 or 6, d).
        missed: the square of what constants on the parts of cells miss of them, shape (n,).
        beyond: integrals of the products of the components of what linear functions in cells miss, shape (n, d, d).
        unknown: of the moments what quadrature does not know, force, shape (n,).
        unknown_bubbles: the same of ``bubbles``, shape (n, 3 or 6, d).
    """

    t: Simplices
    moments: Array
    bubbles: Array
    missed: Array
    beyond: Array
    unknown: Array
    unknown_bubbles: Array

    @classmethod
    def of(cls, t: Simplices, loads: list[Acting]) -> BodyLoads:
        """Of some loads, all of which act in cells."""
        n, d = len(t.corners), t.dimension
        moments: Array = np.zeros((n, d + 1, d))
        beyond: Array = np.zeros((n, d, d))
        unknown: Array = np.zeros(n)
        bubbles, unknown_bubbles = np.zeros((2, n, len(EDGES[d]), d))
        if not loads:
            return cls(t, moments, bubbles, np.zeros(n), beyond, unknown, unknown_bubbles)

        def density(owner: Ints, points: BoundPoints) -> Array:
            return np.asarray(sum((load.at(owner, points) for load in loads), np.zeros_like(points.x)))

        values, at_corners = [value for load in loads for value in load.profile(d)], []
        varies = not all(isinstance(value, float) for value in values)
        sizes = _SIZES_IN_PLANE[: 1 + varies] if d == 2 else None
        share = t.volume[:, None, None] / (d + 1)
        for corners in CORNERS_OF_PARTS[d]:  # so that the constants are seen
            integrated = in_simplices(corners @ t.x[t.corners], density, values, sizes=sizes)
            # Barycentric coordinates of the cell are linear in those of the part, and so are their products.
            pairs = 4 * np.array([np.outer(corners[:, a], corners[:, b]).ravel() for a, b in EDGES[d]])
            moments += share * np.einsum("kc,nkd->ncd", corners, integrated.moments[:, : d + 1])
            bubbles += share * np.einsum("ck,nkd->ncd", pairs, integrated.moments[:, d + 1 :])
            unknown_bubbles += share * np.einsum("ck,nkd->ncd", pairs, integrated.unknown[:, d + 1 :])
            unknown += (share * integrated.unknown[:, : d + 1]).sum(axis=(1, 2))
            beyond += share * integrated.missed
            at_corners.append(closest_linear(integrated.moments[:, : d + 1]))
        # What linear functions on the parts miss is orthogonal to the differences of these.
        on_parts = np.stack(at_corners, axis=1)

        def differing(constants: Array) -> Array:
            """Integrals of the products of the components of these differences, shape (n, d, d)."""
            differ = on_parts - constants
            total = differ.sum(axis=2)
            products = np.einsum("npci,npcj->nij", differ, differ) + np.einsum("npi,npj->nij", total, total)
            return np.asarray(share / ((d + 1) * (d + 2)) * products)

        missed = np.einsum("nii->n", beyond + differing(constant_forces(t, moments)[:, :, None]))
        linear = closest_linear(moments / t.volume[:, None, None])
        beyond = beyond + differing(np.einsum("pkc,ncd->npkd", CORNERS_OF_PARTS[d], linear))
        return cls(t, moments, bubbles, missed, beyond, unknown, unknown_bubbles)

    def work(self, y: Array, middle: Array, cells: Cells = EVERYWHERE) -> float:
        """On a displacement of degree 2, an energy; ``cells``: in which it is not zero."""
        above = self._above(y, middle)[cells]
        inside = np.einsum("ncd,ncd->", self.moments[cells], y[self.t.corners[cells]])
        return float(inside + np.einsum("ncd,ncd->", self.bubbles[cells], above))

    def unknown_work(self, y: Array, middle: Array, cells: Cells = EVERYWHERE) -> float:
        """How far that work is not known by quadrature, an energy."""
        largest = np.abs(y[self.t.corners[cells]]).max(axis=(1, 2), initial=0.0)
        above = np.abs(self._above(y, middle)[cells])
        return float(self.unknown[cells] @ largest + np.einsum("ncd,ncd->", self.unknown_bubbles[cells], above))

    def _above(self, y: Array, middle: Array) -> Array:
        """What a displacement is at the middles of edges above the linear one, length, shape (n, 3 or 6, d)."""
        return np.asarray((middle - y[self.t.edges].mean(axis=1))[self.t.edges_of])


def _tractions(t: Simplices, facets: Ints, loads: list[tuple[Load, Ints]], held: Array) -> Density:
    """The sum of loads on some facets, without what supports take of it.

    Args:
        t: the cells.
        facets: on parts of which it is asked for, shape (m,).
        loads: with the facets that they load.
        held: projectors onto the directions that supports hold on all facets, shape (f, d, d).
    """

    def density(owner: Ints, points: BoundPoints) -> Array:
        force = np.zeros_like(points.x)
        for load, loaded_facets in loads:
            rows = np.flatnonzero(np.isin(facets[owner], loaded_facets))
            at = BoundPoints(points.x[rows], points.normal[rows])
            force[rows] += load.on(t, facets[owner[rows]], at)
        return np.asarray(force - np.einsum("mij,mqj->mqi", held[facets[owner]], force))

    return density


class PlaneLoads:
    """Loads on triangles.

    Attributes:
        body: see ``equilibrated_stress.Loads``.
        traction: see ``body``.
        missed_inside: the square of what constants on the thirds miss of the force in each triangle, shape (n,).
    """

    def __init__(self, t: Simplices, held: Array, forces: Sequence[Load]) -> None:
        self._t, self._held = t, held
        self._inside = BodyLoads.of(
            t, [force for force in forces if isinstance(force, Acting) and force.facets is None]
        )
        self.body, self.missed_inside = self._inside.moments, self._inside.missed
        self.traction, self._missed_on_edges = np.zeros((len(t.facets), 2, 2)), np.zeros(len(t.facets))
        self._on_edges, self._unknown_on_edges = np.zeros((2, len(t.facets), 3, 2))
        # Of the loads on each triangle what quadrature does not know, force.
        self._unknown = self._inside.unknown.copy()
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

    def _integrate_tractions(self, loads: list[tuple[Load, Ints]]) -> None:
        """Linear tractions with the moments of those given, and the square of what they miss on each edge."""
        t = self._t
        if not loads:
            return
        edges = np.unique(np.concatenate([loaded_edges for _, loaded_edges in loads]))

        values = [value for load, _ in loads for value in load.profile(2)]
        integrated = on_edges(t, edges, _tractions(t, edges, loads, self._held), values)
        self._on_edges[edges], self._unknown_on_edges[edges] = integrated.moments, integrated.unknown
        missed: Array = np.zeros(len(t.facets))
        missed[edges] = np.sqrt(integrated.missed)
        for load, loaded_edges in loads:
            if load.doubtful > 0:
                largest, missed_alone = self._largest_moments(load, loaded_edges)
                self._unknown_on_edges[loaded_edges] += load.doubtful * largest[:, None, None]
                missed[loaded_edges] += load.doubtful * missed_alone
        self.traction[edges] = closest_linear(integrated.moments[:, :2] + integrated.moments[:, 2:] / 2)
        self._missed_on_edges[:] = t.area * missed**2
        unknown = self._unknown_on_edges[edges].sum(axis=(1, 2))
        np.add.at(self._unknown, t.sides[edges, 0], t.area[edges] * unknown)

    def _largest_moments(self, load: Load, edges: Ints) -> tuple[Array, Array]:
        """Bounds of the moments of a traction on edges, which are at most the root of its mean square, and that of what
        linear functions miss of it, stresses, shape (m,).
        """
        integrated = on_edges(
            self._t,
            edges,
            lambda owner, points: load.on(self._t, edges[owner], points),
            list(load.profile(2)),
        )
        linear = 4 * np.linalg.norm(integrated.moments, axis=2).sum(axis=1)
        missed = np.sqrt(integrated.missed)
        return linear + missed, missed

    def work(self, y: Array, middle: Array, cells: Cells = EVERYWHERE) -> float:
        """Of the loads on a displacement of degree 2, without what supports take of them, energy per thickness.

        Args:
            y: at the vertices, length, shape (v, 2).
            middle: at the middles of the edges, shape (e, 2).
            cells: in which the displacement is not zero.
        """
        along = self._along(y, middle)
        on_edges = self._t.area * np.einsum("ebd,ebd->e", self._on_edges, along)
        return float(on_edges[beside(self._t, cells)].sum()) + self._inside.work(y, middle, cells)

    def size_of_work(self, y: Array, middle: Array) -> float:
        """The sizes of what is summed up to that work, energy per thickness.

        In the moments of an edge or a triangle cancels what linear functions, or constants, miss there.
        """
        t, along = self._t, self._along(y, middle)
        on_edges = t.area * np.abs(self._on_edges).sum(axis=(1, 2)) + np.sqrt(t.area * self._missed_on_edges)
        inside = np.abs(self.body).sum(axis=(1, 2)) + np.sqrt(t.volume * self.missed_inside)
        largest = np.abs(along).max(axis=(1, 2))
        return float(on_edges @ largest + inside @ largest[t.facets_of].max(axis=1))

    def unknown_work(self, y: Array, middle: Array, cells: Cells = EVERYWHERE) -> float:
        """How far that work is not known by quadrature, energy per thickness."""
        along = np.abs(self._along(y, middle))
        on_edges = self._t.area * np.einsum("ebd,ebd->e", self._unknown_on_edges, along)
        return float(on_edges[beside(self._t, cells)].sum()) + self._inside.unknown_work(y, middle, cells)

    def _along(self, y: Array, middle: Array) -> Array:
        """A displacement along the edges, coefficients of Bernstein, shape (e, 3, 2)."""
        t = self._t
        return coefficients(np.concatenate((y[t.facets], middle[t.edges_of_facets]), axis=1))


class SpatialLoads:
    """Loads on tetrahedra.

    Attributes:
        body: see ``equilibrated_stress.Loads``.
        traction: see ``body``.
    """

    def __init__(self, t: Simplices, held: Array, forces: Sequence[Load]) -> None:
        self._t, self._held = t, held
        self._inside = BodyLoads.of(
            t, [force for force in forces if isinstance(force, Acting) and force.facets is None]
        )
        self.body, self.traction = self._inside.moments, np.zeros((len(t.facets), 3, 3))
        loads = [(force, force.facets) for force in forces if force.facets is not None]
        self._faces: Ints = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(faces for _, faces in loads)]))
        m = len(self._faces)
        # On the faces that are loaded: moments with the polynomials of Bernstein of degree 2 and how far these are not
        # known, stress; mean products of the components of what linear functions miss, stress squared.
        self._moments, self._unknown_moments = np.zeros((2, m, 6, 3))
        self._missed: Array = np.zeros((m, 3, 3))
        self._unknown = self._inside.unknown.copy()
        if loads:
            self._integrate_tractions(loads)

    @property
    def acting(self) -> Loads:
        """See ``PlaneLoads``."""
        return Loads(self.body, self.traction, self._unknown)

    @property
    def unknown_share(self) -> float:
        """See ``PlaneLoads``."""
        of_faces = self._t.area[self._faces, None, None] * np.abs(self._moments)
        size = float(of_faces.sum() + np.abs(self.body).sum())
        return float(self._unknown.sum()) / size if size > 0 else 0.0

    def missed_beside(self, contact: Array) -> Array:
        """See ``PlaneLoads``; tractions of contact are linear in space.

        Raises:
            Refused: they are not.
        """
        if contact.any():
            raise Refused("in space a guaranteed bound is for tractions of contact that are linear on each facet")
        t, faces, inside = self._t, self._faces, self._inside
        bounds = work_inside(t, inside.beyond)
        np.add.at(bounds, t.sides[faces, 0], work_beside_linear(t, faces, t.area[faces, None, None] * self._missed))
        linear = lifted_forces(t, closest_linear(inside.moments / t.volume[:, None, None]))
        return np.asarray((bounds / np.sqrt(t.moduli.softest) + linear) ** 2)

    def _integrate_tractions(self, loads: list[tuple[Load, Ints]]) -> None:
        """Linear tractions with the moments of those given, and what they miss."""
        t, faces = self._t, self._faces

        def integrated(selected: list[tuple[Load, Ints]]) -> tuple[Integrated, Array]:
            """Without what supports take of some loads; and the linear tractions at vertices, shape (m, 3, 3)."""
            density = _tractions(t, faces, selected, self._held)
            values = [value for load, _ in selected for value in load.profile(3)]
            sizes = sizes_of_rules(values, 1 + max(load.beyond for load, _ in selected))
            integral_values = in_simplices(t.x[t.facets[faces]], density, values, normal=t.normal[faces], sizes=sizes)
            return integral_values, closest_linear(integral_values.moments[:, :3])

        def of_bernstein(moments: Array) -> Array:
            """Those of degree 2, from those with products of barycentric coordinates."""
            products = moments[:, 3:].reshape(-1, 3, 3, 3)
            first, second = EDGES_OF_FACET[3].T
            return np.concatenate((products[:, range(3), range(3)], 2 * products[:, first, second]), axis=1)

        integrals, linear = integrated(loads)
        self.traction[faces] = linear
        self._moments, self._missed = of_bernstein(integrals.moments), integrals.missed
        self._unknown_moments = of_bernstein(integrals.unknown)
        for load, loaded_faces in loads:
            if (share := load.doubtful) > 0:
                alone, linear = integrated([(load, loaded_faces)])
                # A moment is at most the root of the mean square.
                largest = np.linalg.norm(linear, axis=2).max(axis=1) + np.sqrt(np.einsum("mii->m", alone.missed))
                self._unknown_moments += share * largest[:, None, None]
                # |a + s b|^2 <= (1 + s) (|a|^2 + s |b|^2)
                self._missed = (1 + share) * (self._missed + share * alone.missed)
        np.add.at(self._unknown, t.sides[faces, 0], t.area[faces] * self._unknown_moments.sum(axis=(1, 2)))

    def work(self, y: Array, middle: Array, cells: Cells = EVERYWHERE) -> float:
        """See ``PlaneLoads``, an energy."""
        on_faces = self._t.area[self._faces] * np.einsum("fbd,fbd->f", self._moments, self._on_faces(y, middle))
        return float(on_faces[beside(self._t, cells)[self._faces]].sum()) + self._inside.work(y, middle, cells)

    def unknown_work(self, y: Array, middle: Array, cells: Cells = EVERYWHERE) -> float:
        """See ``PlaneLoads``, an energy."""
        along = np.abs(self._on_faces(y, middle))
        on_faces = self._t.area[self._faces] * np.einsum("fbd,fbd->f", self._unknown_moments, along)
        return float(on_faces[beside(self._t, cells)[self._faces]].sum()) + self._inside.unknown_work(y, middle, cells)

    def _on_faces(self, y: Array, middle: Array) -> Array:
        """A displacement on the faces that are loaded, coefficients of Bernstein, shape (m, 6, 3)."""
        t, faces = self._t, self._faces
        return coefficients(np.concatenate((y[t.facets[faces]], middle[t.edges_of_facets[faces]]), axis=1))
