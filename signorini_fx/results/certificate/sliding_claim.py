"""The independent check on two sides of the plane that slide on each other, at displaced points, by code of its own.

What the solver says of the undeformed sides, as which nodes may carry a point and which supports hold (``HeldSides``),
areas of nodes and planes of symmetry, is tried by ``undeformed_sides``.  What is done otherwise here:
- who carries a point, and how points take over functions, is evaluated anew (``taken_functions``),
- the places where vertices of the other side are seen are roots of quadratic equations, of curved facets found by
  bisection,
- the facet over each point is looked for among all that face it,
- distances are those of the rays of points and the lines or parabolas of facets, and the forces of pressures their
  derivatives by complex steps, so that no formula of the solver's derivatives enters,
- slips are evaluated from the displacements of both ends of the step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities, node_positions
from signorini_fx.mechanics.pairs.dual_functions import HeldSides
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.results.certificate.held_distances import DisplacedSide, held_distances
from signorini_fx.results.certificate.paired_claim import nodal_allowance
from signorini_fx.results.certificate.taken_functions import (
    TakenFunctions,
    TestedNodes,
    movable,
    taken_functions,
    times_rows,
)
from signorini_fx.tuned import COMPLEX_STEP, FACING_SIDES, SAME_DIRECTION, SAME_LENGTH, SAME_PLACE_IN_CELL

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]

# Points of a part of a facet between two vertices of the other side.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(9)
# Points along each side of a facet for its area: as many as that is defined by, as curved facets have no polynomial of
# their places as their area.
POINTS_OF_AREAS = 5
# Rays that are stepped at once.
_STEPPED = 2**13


def _unit(vectors: Any) -> Any:
    """Along the last axis, complex numbers as if they were real."""
    return vectors / np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True))


def _combined(factors: Any, values: Any) -> Any:
    """Sums of values, shape (r, k, d), times factors, shape (r, k): shape (r, d); for many r and few k several times as
    fast as ``np.einsum``.
    """
    return sum(factors[:, k, None] * values[:, k] for k in range(1, values.shape[1])) + factors[:, :1] * values[:, 0]


def _cross(a: Any, b: Any) -> Any:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


# Where changes of sign are looked for along curved facets, and how often what lies between is halved.
_SCANNED = np.arange(33) / 32
_HALVED = 52


def _hats(s: Any, count: int) -> Any:
    """The functions of the ends of a facet, and of its middle if it has three nodes, shape (..., count)."""
    if count == 2:
        return np.stack((1 - s, s), axis=-1)
    return np.stack(((1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)), axis=-1)


def _slopes(s: Any, count: int) -> Any:
    """Their derivatives."""
    if count == 2:
        return np.stack((0 * s - 1, 0 * s + 1), axis=-1)
    return np.stack((4 * s - 3, 4 * s - 1, 4 - 8 * s), axis=-1)


def _meeting(nodes: Array, points: Any, rays: Any) -> Array:
    """Where rays through points, shape (..., 2), meet facets with these nodes, shape (..., k, 2): places, shape (...);
    outside of [0, 1] they do not.
    """
    start, end = nodes[..., 0, :], nodes[..., 1, :]
    bend = 0 * start if nodes.shape[-2] == 2 else 2 * (start + end) - 4 * nodes[..., 2, :]
    square = _cross(bend, rays)
    linear = _cross(end - start - bend, rays)
    constant = _cross(start - points, rays)
    root = np.sqrt(np.maximum(linear**2 - 4 * square * constant, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(2 * constant / -(linear + np.where(linear >= 0, root, -root)))


@dataclass(frozen=True)
class BoundaryPolyline:
    """Facets of one side, the same on every rank.

    Attributes:
        nodes: global numbers, ascending, shape (N,).
        x: their initial positions, length, shape (N, 2).
        facets: first and last node of each, with the body on the left, and of degree 2 the one between, numbers of the
            side, shape (f, k).
        measure: by what areas are multiplied, at the nodes, between which it is linear along facets, shape (N,).
    """

    nodes: Numbers
    x: Array
    facets: Numbers
    measure: Array

    @classmethod
    def of(
        cls, space: fem.FunctionSpace, facets: npt.NDArray[np.int32], factor: Array | None = None
    ) -> BoundaryPolyline:
        """Those of all ranks; collective.

        Args:
            space: of the displacement.
            facets: owned, local numbers.
            factor: of the measure, at all nodes of this rank, shape (nodes,); None: 1.
        """
        mesh, dofmap = space.mesh, space.dofmap
        positions = node_positions(space)[:, :2]
        listed = []
        for cell, number in facet_entities(mesh, facets):
            cell_nodes, layout = dofmap.list[cell], dofmap.dof_layout
            between = list(layout.entity_dofs(1, int(number)))
            a, b = cell_nodes[[at for at in layout.entity_closure_dofs(1, int(number)) if at not in between]]
            inside = positions[cell_nodes].mean(axis=0) - positions[a]
            ends = (a, b) if _cross(positions[b] - positions[a], inside) > 0 else (b, a)
            listed.append((*ends, *cell_nodes[between]))
        count = space.element.basix_element.degree + 1
        local = np.array(listed, dtype=np.int32).reshape(-1, count)
        names = dofmap.index_map.local_to_global(local.ravel()).reshape(-1, count)
        names = parallel.gather_rows(mesh.comm, names)
        places = parallel.gather_rows(mesh.comm, np.asarray(positions[local], dtype=np.float64).reshape(-1, 2 * count))
        nodes, first, numbers = np.unique(names, return_index=True, return_inverse=True)
        numbers, measure = numbers.reshape(names.shape).astype(np.int64), np.ones(nodes.size)
        if factor is not None:
            listed_factors = parallel.gather_rows(
                mesh.comm, np.asarray(factor[local], dtype=np.float64).reshape(-1, count)
            )
            measure = listed_factors.ravel()[first]
        return cls(nodes.astype(np.int64), places.reshape(-1, 2)[first], numbers, measure)

    @property
    def width(self) -> int:
        """How many nodes a facet has."""
        return int(self.facets.shape[1])

    @cached_property
    def beside(self) -> Numbers:
        """The facet before and the facet behind each, -1: there is none, shape (f, 2)."""
        ending, beginning = np.full((2, self.nodes.size), -1, dtype=np.int64)
        ending[self.facets[:, 1]] = beginning[self.facets[:, 0]] = np.arange(len(self.facets))
        return np.stack((ending[self.facets[:, 0]], beginning[self.facets[:, 1]]), axis=1)

    @cached_property
    def products(self) -> Array:
        """Integrals of the functions of a facet times their derivatives, shape (k, k)."""
        s = (_POINTS + 1) / 2
        return np.asarray((_hats(s, self.width) * _WEIGHTS[:, None] / 2).T @ _slopes(s, self.width))

    def moments(self, x: Any) -> Any:
        """The normals of some facets, with nodes at x, shape (m, k, 2), times the functions, integrated, likewise."""
        along = np.tensordot(x, self.products, axes=(1, 1))
        return np.stack((along[:, 1], -along[:, 0]), axis=-1)

    @property
    def quadratic(self) -> bool:
        """Whether its functions are."""
        return self.width == 3

    @cached_property
    def diagonals(self) -> Array:
        """Of the box around the nodes of each facet, length, shape (f,)."""
        return np.asarray(np.linalg.norm(np.ptp(self.x[self.facets], axis=1), axis=1))

    @cached_property
    def nodal_areas(self) -> Array:
        """Integrals of the functions of the nodes times the measure, over the undeformed facets, shape (N,)."""
        points, weights = np.polynomial.legendre.leggauss(POINTS_OF_AREAS)
        hats, slopes = (of((points + 1) / 2, self.width) for of in (_hats, _slopes))
        sizes = np.linalg.norm(np.einsum("qk,fkd->fqd", slopes, self.x[self.facets]), axis=2)
        return self._summed_at_nodes((sizes * weights / 2 * (self.measure[self.facets] @ hats.T)) @ hats)

    def _summed_at_nodes(self, of_facets: Array) -> Array:
        """Values of the nodes of each facet, shape (f, k), added up, shape (N,)."""
        return np.asarray(
            np.bincount(self.facets.ravel(), of_facets.ravel(), minlength=self.nodes.size), dtype=np.float64
        )

    def normals(self, x: Array) -> Array:
        """Outward unit normals at the nodes where these are at x, shape (N, 2)."""
        sums = np.zeros_like(x)
        np.add.at(sums, self.facets, self.moments(x[self.facets]))
        return np.asarray(sums / np.linalg.norm(sums, axis=1, keepdims=True))


@dataclass(frozen=True)
class Rays:
    """Points of the slave with the facet of the master over each, r of them.

    Attributes:
        facet: of the slave, shape (r,).
        at: place on it, in [0, 1], shape (r,), in 3D (r, 2).
        over: the facet of the master, shape (r,).
        place: on that, likewise.
        distance: along the ray, length, shape (r,).
        area: undeformed, times the measure of the slave, shape (r,).
    """

    facet: Numbers
    at: Array
    over: Numbers
    place: Array
    distance: Array
    area: Array

    @classmethod
    def none(cls) -> Rays:
        """No rays."""
        numbers, values = np.zeros(0, dtype=np.int64), np.zeros(0)
        return cls(numbers, values, numbers, values, values, values)


def _breaks(positions: Array, directions: Array, vertices: Array, seen: npt.NDArray[np.bool_]) -> tuple[Numbers, Array]:
    """The ends of facets of the slave, and the places on them that see vertices along directions: the facet of each,
    ascending, and the place, ascending on each.

    Args:
        positions: of their nodes, shape (m, k, 2).
        directions: there, likewise.
        vertices: of the master, shape (v, 2).
        seen: which of them each facet may see, shape (m, v).
    """
    if positions.shape[1] == 2:
        along, turn = (values[:, None, 1] - values[:, None, 0] for values in (positions, directions))
        # (p - s q) x (N_a + s m) = 0
        away = vertices - positions[:, None, 0]
        square, linear = -_cross(along, turn), _cross(away, turn) - _cross(along, directions[:, None, 0])
        constant = _cross(away, directions[:, None, 0])
        root = np.sqrt(np.maximum(linear**2 - 4 * square * constant, 0.0))
        half = -(linear + np.where(linear >= 0, root, -root)) / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            places = np.stack((half / square, constant / half), axis=2)
        facet, vertex, _ = np.nonzero((places > 0) & (places < 1) & seen[:, :, None])
        coordinate = places[(places > 0) & (places < 1) & seen[:, :, None]]
    else:
        facet, vertex = np.nonzero(seen)

        def missed(s: Array, rows: Numbers) -> Array:
            hats, of = _hats(s, positions.shape[1]), facet[rows]
            at, way = (np.einsum("...k,...kd->...d", hats, values[of]) for values in (positions, directions))
            return np.asarray(_cross(vertices[vertex[rows]] - at, way))

        all_facets = np.arange(facet.size)[:, None]
        values = missed(_SCANNED[None], all_facets)
        row, first = np.nonzero((values[:, :-1] >= 0) != (values[:, 1:] >= 0))
        low, high, rising = _SCANNED[first], _SCANNED[first + 1], values[row, first + 1] >= 0
        for _ in range(_HALVED):
            coordinate = (low + high) / 2
            above = (missed(coordinate, row) >= 0) == rising
            low, high = np.where(above, low, coordinate), np.where(above, coordinate, high)
        coordinate = (low + high) / 2
        facet = facet[row]
    ends, inside = np.arange(len(positions)), (coordinate > 0) & (coordinate < 1)
    facet = np.concatenate((ends, ends, facet[inside]))
    coordinate = np.concatenate((np.zeros(ends.size), np.ones(ends.size), coordinate[inside]))
    order = np.lexsort((coordinate, facet))
    facet, coordinate = facet[order], coordinate[order]
    fresh = np.append(True, (np.diff(facet) > 0) | (np.diff(coordinate) > 0))
    return facet[fresh], coordinate[fresh]


# How many facets of the slave are looked at together.
_TOGETHER = 64


def _rays(slave: BoundaryPolyline, x: Array, ways: Array, master: BoundaryPolyline, y: Array, reach: float) -> Rays:
    """All pairs of points that see each other along directions at the nodes of the slave, of length one, shape (N, 2);
    the nodes of both sides are at x and y.
    """
    blocks = [
        _rays_of(slave, np.arange(first, min(first + _TOGETHER, len(slave.facets))), x, ways, master, y)
        for first in range(0, len(slave.facets), _TOGETHER)
    ]
    facet, at, over, place, distance, area, *apart_columns = (
        np.concatenate(column) for column in zip(*blocks, strict=True)
    )
    if not facet.size:
        return Rays.none()
    # Pairs of facets are partners by their mean distance.
    key = facet * len(master.facets) + over
    _, pair = np.unique(key, return_inverse=True)
    first, second = (np.bincount(pair, area * column) for column in apart_columns)
    means = np.column_stack((first, second)) / np.bincount(pair, area)[:, None]
    near = np.flatnonzero(np.linalg.norm(means[pair], axis=1) <= (1.0 + SAME_LENGTH) * reach)
    return Rays(facet[near], at[near], over[near], place[near], distance[near], area[near])


def _rays_of(
    slave: BoundaryPolyline, numbers: Numbers, x: Array, ways: Array, master: BoundaryPolyline, y: Array
) -> tuple[Numbers, Array, Numbers, Array, Array, Array, Array, Array]:
    """Those of some facets of the slave: the facets, the places on them, the facets over these, the places there, how
    far along the rays, the areas, and the distance as vectors, one array for each component.
    """
    facing, outward = (
        np.column_stack((away[:, 1], -away[:, 0])) / np.linalg.norm(away, axis=1, keepdims=True)
        for away in (at[ends[:, 1]] - at[ends[:, 0]] for at, ends in ((y, master.facets), (x, slave.facets[numbers])))
    )
    opposite = outward @ facing.T < FACING_SIDES
    seen = np.zeros((numbers.size, len(y)), dtype=bool)
    facet, over = np.nonzero(opposite)
    seen[facet[:, None], master.facets[over, :2]] = True
    vertices = np.flatnonzero(seen.any(axis=0))
    nodes = slave.facets[numbers]
    facet, place = _breaks(x[nodes], ways[nodes], y[vertices], seen[:, vertices])
    parts = np.flatnonzero(facet[1:] == facet[:-1])
    facet, low, high = facet[parts], place[parts, None], place[parts + 1, None]
    s = low + (high - low) * np.append(0.5, (_POINTS + 1) / 2)
    hats, of_part = _hats(s, slave.width), nodes[facet]
    points, rays = hats @ x[of_part], _unit(hats @ ways[of_part])
    stretch = _slopes(s[:, 1:], slave.width) @ slave.x[of_part]
    area = _WEIGHTS / 2 * (high - low) * np.hypot(stretch[..., 0], stretch[..., 1])
    area = area * np.einsum("pqk,pk->pq", hats[:, 1:], slave.measure[of_part])
    # A part sees one facet of each sheet of the master: that which its middle sees.
    middle = _meeting(y[master.facets], points[:, :1], rays[:, :1])
    part, over = np.nonzero((middle >= 0) & (middle <= 1) & opposite[facet])
    of_over, points, rays = y[master.facets[over]], points[part, 1:], rays[part, 1:]
    met_at = _meeting(of_over[:, None], points, rays)
    apart = _hats(met_at, master.width) @ of_over - points
    distance = np.sum(apart * rays, axis=2)
    count = _POINTS.size
    return (
        np.repeat(numbers[facet[part]], count),
        s[part, 1:].ravel(),
        np.repeat(over, count),
        met_at.ravel(),
        distance.ravel(),
        area[part].ravel(),
        apart[..., 0].ravel(),
        apart[..., 1].ravel(),
    )


@dataclass(frozen=True)
class SeenSides:
    """What points see at one displacement.

    Attributes:
        x, y: positions of the nodes of slave and master.
        ways: directions of the rays at the nodes of the slave, shape (N, d).
        rays: see ``Rays``.
        shares: of points in the functions of nodes of the slave, which they take over, scipy sparse, shape (n, N).
        functions: of the points at the rays times their areas, scipy sparse, shape (n, r).
        weight: area, shape (n,).
        sharing: D, scipy sparse, shape (n, N).
        opposite: M, scipy sparse, shape (n, M).
        normal: of the points, shape (n, d).
        partnered: which points see the other side, shape (n,).
        gap: length, shape (n,).
        uncounted: what the points do not count of values at the nodes of the slave, as supports fix distances there,
            scipy sparse, shape (n, N).
    """

    x: Array
    y: Array
    ways: Array
    rays: Rays
    shares: Any
    functions: Any
    weight: Array
    sharing: Any
    opposite: Any
    normal: Array
    partnered: npt.NDArray[np.bool_]
    gap: Array
    uncounted: Any

    @property
    def tangent(self) -> Array:
        """Shape (n, 2)."""
        return np.column_stack((-self.normal[:, 1], self.normal[:, 0]))


# What points see, facets of both sides that see each other, and functions at rays: see ``SlidingClaim``.
LookedAt = tuple[SeenSides, tuple[Numbers, Numbers], Any]
# At how many displacements this is kept.
_REMEMBERED = 3


@dataclass(frozen=True)
class KnownSides:
    """What a certificate has found of two sides at one displacement.

    Attributes:
        values: the displacement of the nodes of both sides, shape (m, d).
        measure: of the slave, shape (N,).
        looked_at: what it has found.
    """

    values: Array
    measure: Array
    looked_at: LookedAt


@dataclass
class PairMemory:
    """What certificates have found of a pair, which they alone read.

    Attributes:
        displacements: the last few with what was found there: the end of a step is where the next one begins.
        at_rest: which components of the nodes of both sides were prescribed to be zero by the first certificate, shapes
            (N, d) and (M, d); None: there was none.
    """

    displacements: list[KnownSides] = field(default_factory=list)
    at_rest: tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]] | None = None


@dataclass(frozen=True)
class SlidingClaim:
    """A pair of sides as the certificate sees it, n points on this rank.

    Attributes:
        space: of the displacement.
        surface, other_surface: slave and master, of which the solver says who carries points, and what planes of
            symmetry are.
        chains: both sides.
        carriers: nodes of the slave that have points, shape (p,) on all ranks.
        unable: nodes of the slave that cannot carry one, shape (N,).
        held: nodes of both sides that supports hold.
        reach: distance beyond which facets are no partners, length.
        slave: owned facets of the side with the points, local numbers, as the problem names them.
        master: those of the other side.
        ends: values of the displacement at the nodes of both sides, now and at the beginning of the step, shape (m, 2).
        allowed: the reach that the problem names, length; None: the usual one.
        memory: what certificates have found of this pair.
    """

    space: fem.FunctionSpace
    surface: PairSurface
    other_surface: PairSurface
    chains: tuple[BoundaryPolyline, BoundaryPolyline]
    carriers: Numbers
    unable: npt.NDArray[np.bool_]
    held: HeldSides
    reach: float
    slave: npt.NDArray[np.int32]
    master: npt.NDArray[np.int32]
    ends: tuple[Array, Array]
    allowed: float | None
    memory: PairMemory = field(default_factory=PairMemory, repr=False)
    nominal: bool = False
    followed: None = None
    displaced: ClassVar[bool] = True
    kind_of_chain: ClassVar[type[BoundaryPolyline]] = BoundaryPolyline

    @classmethod
    def of(
        cls,
        space: fem.FunctionSpace,
        sides: tuple[PairSurface, PairSurface],
        points: tuple[Numbers, npt.NDArray[np.bool_], HeldSides, float],
        facets: tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]],
        ends: tuple[fem.Function, fem.Function | None],
        factor: Array | None,
        allowed: float | None,
        memory: PairMemory,
    ) -> Self:
        """The independent check on a pair; collective.

        Args:
            space: of the displacement.
            sides: slave and master.
            points: nodes of the slave with points, those that cannot carry one, those of both sides that supports hold,
                and the reach.
            facets: of both sides, owned, local numbers.
            ends: displacements now and at the beginning of the step; None: none.
            factor: by what the problem says that areas are multiplied, at all nodes of this rank, shape (nodes,); None:
                1.
            allowed: the reach that the problem names, length; None: the usual one.
            memory: see ``SlidingClaim``.
        """
        chains = cls.kind_of_chain.of(space, facets[0], factor), cls.kind_of_chain.of(space, facets[1])
        surface = replace(sides[0], measure=None if factor is None else chains[0].measure)
        names, dim = np.concatenate([chain.nodes for chain in chains]), space.mesh.geometry.dim
        owned = space.dofmap.index_map.size_local
        now, begun = (
            np.zeros((names.size, dim))
            if function is None
            else from_owners(function.x.array.reshape(-1, dim)[:owned], names, space.mesh.comm)
            for function in ends
        )
        return cls(space, surface, sides[1], chains, *points, *facets, (now, begun), allowed, memory)

    @property
    def comm(self) -> MPI.Comm:
        """The ranks."""
        comm: MPI.Comm = self.space.mesh.comm
        return comm

    @cached_property
    def _mine(self) -> Numbers:
        first, last = self.space.dofmap.index_map.local_range
        names = self.chains[0].nodes[self.carriers]
        return np.flatnonzero((names >= first) & (names < last))

    @property
    def points(self) -> Numbers:
        """Local node of each point, shape (n,)."""
        return np.asarray(self.chains[0].nodes[self.carriers[self._mine]] - self.space.dofmap.index_map.local_range[0])

    @cached_property
    def present(self) -> SeenSides:
        """What the points see at the displacement of now."""
        return self._seen(self.ends[0])

    @cached_property
    def _begun(self) -> SeenSides:
        """What they saw at the beginning of the step, without rays, of which there are many."""
        return replace(self._seen(self.ends[1]), rays=Rays.none(), functions=None)

    @property
    def weight(self) -> Array:
        """Undeformed area of each point, shape (n,)."""
        return self.present.weight[self._mine]

    @property
    def facing(self) -> npt.NDArray[np.bool_]:
        """Which points see the other side, and may have tractions, shape (n,)."""
        return self.present.partnered[self._mine]

    @property
    def across(self) -> Array:
        """Projectors onto the directions across planes of symmetry at the points, in which nothing slides, shape (n, d,
        d).
        """
        return np.asarray(self.surface.across[self.carriers[self._mine]])

    def in_planes(self, nodes: Numbers, vectors: Array) -> Array:
        """See ``Claim``."""
        size = np.linalg.norm(vectors, axis=1, keepdims=True)
        return np.divide(vectors, size, out=np.zeros_like(vectors), where=size > 0)

    def normal(self, slave: Array, master: Array) -> Array:
        """Of the points, half-way between both sides as they are displaced, shape (n, 2); see ``Claim``."""
        return self.present.normal[self._mine]

    def gap(self, normal: Array) -> Array:
        """Zero: ``relative`` has it."""
        return np.zeros(self._mine.size)

    @property
    def counted(self) -> Array:
        """See ``Claim``; no sides that slide are adjusted, which alone asks for this."""
        return np.ones(self._mine.size)

    def fixed_gap(self, allowance_at: Callable[[Any], Array]) -> Array:
        """See ``Claim``; the distance of both sides, without what supports fix, is in ``relative``."""
        return np.asarray(self.present.uncounted @ nodal_allowance(allowance_at, self.chains[0].nodes, self.space))[
            self._mine
        ]

    def relative(self, owned: Array) -> Array:
        """What both sides of the points do at a displacement of the owned nodes, shape (owned nodes, 2): along the
        normal the distance, negative, and along the tangent the slip since the step has begun; shape (n, 2).
        """
        rows = np.concatenate([chain.nodes for chain in self.chains])
        values = from_owners(owned, rows, self.comm)
        end_number = next((k for k, end in enumerate(self.ends) if np.array_equal(values, end)), None)
        seen = (self.present, self._begun)[end_number] if end_number is not None else self._seen(values)
        begun, (sharing, opposite) = self._begun, self._met_since(seen)
        start = np.where(begun.partnered[:, None], begun.tangent, seen.tangent)
        slip = np.sum(seen.tangent * (sharing @ seen.x - opposite @ seen.y), axis=1)
        slip -= np.sum(start * (sharing @ begun.x - opposite @ begun.y), axis=1)
        slip = np.where(seen.partnered, slip, 0.0)[self._mine]
        normal, tangent = self.present.normal[self._mine], self.present.tangent[self._mine]
        slip = np.where(np.einsum("ni,nij,nj->n", tangent, self.across, tangent) > SAME_DIRECTION, 0.0, slip)
        return np.asarray(slip[:, None] * tangent - seen.gap[self._mine, None] * normal)

    def _met_since(self, seen: SeenSides) -> tuple[Any, Any]:
        """D and M of the beginning of the step, and of points that saw nothing then those of ``seen``."""
        begun = self._begun
        if begun.partnered.all():
            return begun.sharing, begun.opposite
        then, now = begun.partnered.astype(np.float64), (~begun.partnered).astype(np.float64)
        sharing = times_rows(then, begun.sharing) + times_rows(now, seen.sharing)
        return sharing, times_rows(then, begun.opposite) + times_rows(now, seen.opposite)

    def terms(self, owned: Array) -> Array:
        """See ``Claim``."""
        count = self.chains[0].nodes.size
        values = np.abs(from_owners(owned, np.concatenate([chain.nodes for chain in self.chains]), self.comm))
        sums = abs(self.present.sharing) @ values[:count] + abs(self.present.opposite) @ values[count:]
        return np.asarray(sums[self._mine])

    def forces(self, traction: Array, owned: int) -> tuple[Numbers, Array, Array]:
        """See ``Claim``; collective."""
        seen, slave = self.present, self.chains[0]
        count, names = slave.nodes.size, np.concatenate([chain.nodes for chain in self.chains])
        components = np.zeros((owned, 2))
        components[self.points, 0] = np.sum(traction * seen.normal[self._mine], axis=1)
        components[self.points, 1] = np.sum(traction * seen.tangent[self._mine], axis=1)
        pressure, shear = from_owners(components, slave.nodes[self.carriers], self.comm).T
        forces = np.zeros((names.size, 2))
        nodes, rates = self._rates
        pushing = seen.functions.T @ (np.where(seen.partnered, pressure, 0.0))
        np.add.at(forces, nodes, -pushing[:, None, None] * rates)
        drag = (seen.weight * seen.partnered * shear)[:, None] * seen.tangent
        forces[:count] += seen.sharing.T @ drag
        forces[count:] -= seen.opposite.T @ drag
        self._add_couples(forces, drag)
        area = np.concatenate((abs(seen.sharing).T @ seen.weight, abs(seen.opposite).T @ seen.weight))
        # A quadratic node on an axis of revolution has no share of any ring: its shares are round-off.
        rays = seen.rays
        area[:count] = np.maximum(area[:count], _rings(slave, rays.facet, rays.at, rays.area))
        area[count:] = np.maximum(area[count:], _rings(self.chains[1], rays.over, rays.place, rays.area))
        # What turns normals acts on the neighbours of points, too.
        area[:count] = np.maximum(area[:count], 0.5 * (forces[:count].any(axis=1)) * self.surface.area)
        first, last = self.space.dofmap.index_map.local_range
        here = np.flatnonzero((names >= first) & (names < last) & (area > 0))
        return names[here] - first, forces[here], area[here]

    @property
    def _in_plane(self) -> npt.NDArray[np.bool_]:
        """Which nodes of the slave are in planes of symmetry, shape (N,)."""
        return np.asarray(self.surface.across.any(axis=(1, 2)))

    @property
    def reached(self) -> Numbers:
        """Global numbers of the nodes of the other side."""
        return self.chains[1].nodes

    @property
    def others(self) -> Any:
        """M of ``Claim``, scipy sparse, with a column for each of ``reached``."""
        return sp.csr_array(self.present.opposite[self._mine])

    def on_other_side(self, of_node: Numbers) -> Numbers:
        """See ``Claim``; collective."""
        master = self.chains[1]
        numbers = from_owners(of_node[:, None].astype(np.float64), master.nodes, self.comm)[:, 0].astype(np.int64)
        most = np.asarray(abs(self.present.opposite).argmax(axis=1)).ravel()
        return np.where(self.present.partnered, numbers[most], -1)[self._mine]

    def moved(self, flags: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """See ``Claim``."""
        count = self.chains[0].nodes.size
        names = np.concatenate([chain.nodes for chain in self.chains])
        values = from_owners(flags.astype(np.float64), names, self.comm)
        reached = abs(self.present.sharing) @ values[:count] + abs(self.present.opposite) @ values[count:]
        return np.asarray((reached > 0) & self.present.partnered[:, None])[self._mine]

    def error(self) -> float:
        """The largest error of sums of shares, and of the balance of forces and moments of a pressure at each ray,
        relative to one; collective.

        Where a plane of symmetry holds the direction of rays it takes a moment, too.
        """
        seen = self.present
        if not seen.partnered.any():
            return 0.0
        errors = [
            float(np.max(np.abs(matrix[seen.partnered].sum(axis=1) - 1.0))) for matrix in (seen.sharing, seen.opposite)
        ]
        nodes, rates = self._rates
        places = np.concatenate((seen.x, seen.y))[nodes] - seen.x.mean(axis=0)
        size = np.ptp(seen.x, axis=0).max()
        errors.append(float(np.max(np.abs(rates.sum(axis=1)))))
        turning = ~self._in_plane[self.chains[0].facets[seen.rays.facet]].any(axis=1)
        moments = _cross(places, rates).sum(axis=1)[turning]
        errors.append(float(np.max(np.abs(moments), initial=0.0) / size))
        return parallel.global_max(self.comm, max(errors))

    # --- at one displacement ---

    def _looked(self, values: Array, of_places: Array | None = None) -> LookedAt:
        """What the points see at a displacement, with what supports fix in the gap; facets of both sides that see each
        other, also where both are held; and the functions of the nodes at the rays, see ``_functions``; ``of_places``:
        see ``movable``.
        """
        (slave, master), surface = self.chains, self.surface
        count = slave.nodes.size
        x, y = slave.x + values[:count], master.x + values[count:]
        side = surface.displaced(values[:count])
        own_normals = side.in_planes(slave.normals(x), np.arange(count))
        other_normals = self.other_surface.in_planes(master.normals(y), np.arange(len(y)))
        ways, rays = own_normals, Rays.none()
        partners: tuple[Numbers, Numbers] = rays.facet, rays.over
        for turn in range(2):
            rays = _rays(slave, x, ways, master, y, self.reach)
            if turn:
                partners, rays = (rays.facet, rays.over), self._moving(rays)
            psi = self._functions(rays)
            sums = np.asarray(psi.sum(axis=1)).ravel()
            carriers, nodes = self._carriers(rays, psi, sums, of_places, moving=turn > 0)
            able, shares = carriers.nodes, carriers.shares
            if turn or not able.size:
                break
            mean = times_rows(1.0 / (shares @ sums), shares) @ psi
            of_own = _at(slave, own_normals, rays.facet, rays.at)
            of_other = _at(master, other_normals, rays.over, rays.place)
            ways = side.in_planes(carriers.ways(nodes, own_normals, mean @ of_own, mean @ of_other), np.arange(count))
        shares, functions, partnered, weight, mean = self._carried(able, shares, psi)
        sharing, opposite = self._shares_of(rays, mean, partnered)
        normal = side.in_planes(sharing @ own_normals - opposite @ other_normals, self.carriers)
        gap = np.where(partnered, mean @ rays.distance, self.reach)
        nothing = sp.csr_array((partnered.size, count))
        seen = SeenSides(
            x, y, ways, rays, shares, functions, weight, sharing, opposite, normal, partnered, gap, nothing
        )
        return seen, partners, psi

    def _known_at(self, values: Array) -> LookedAt:
        """See ``_looked``; once for each displacement."""
        measure = self.chains[0].measure
        for sides in self.memory.displacements:
            if np.array_equal(sides.values, values) and np.array_equal(sides.measure, measure):
                return sides.looked_at
        looked_at = self._looked(values)
        self.memory.displacements.append(KnownSides(values.copy(), measure, looked_at))
        del self.memory.displacements[:-_REMEMBERED]
        return looked_at

    def _seen(self, values: Array) -> SeenSides:
        """What the points see at a displacement of the nodes of both sides, shape (m, d).

        Which distances supports fix, and what functions have of them, is known from the displacement of the beginning
        of the step, with each side moved by as much as its held nodes on average.
        """
        held = self.held.slave, self.held.master
        if not all(flags.any() for flags in held):
            return self._known_at(values)[0]
        along, count = self.ends[1].copy(), self.chains[0].nodes.size
        for part, flags in ((slice(count), held[0]), (slice(count, None), held[1])):
            along[part] += (values - self.ends[1])[part][flags].mean(axis=0)
        there, partners, psi = self._known_at(along)
        loose, rays = self.held.loose or (None, None), there.rays
        sides = [
            DisplacedSide(
                chain.facets,
                x,
                chain.x,
                (surface.in_planes(chain.normals(chain.x), every), surface.in_planes(chain.normals(x), every)),
                flags,
                projectors,
                partial(self._hats, chain=chain),
            )
            for chain, surface, x, flags, projectors in zip(
                self.chains, (self.surface, self.other_surface), (there.x, there.y), held, loose, strict=True
            )
            for every in [np.arange(chain.nodes.size)]
        ]
        places = rays.facet, rays.at, rays.over, rays.place, rays.area
        seeing = self._place_over, self._place_under
        fixed = held_distances((sides[0], sides[1]), there.ways, partners, places, seeing)
        seen, _, _ = self._looked(values, fixed.of_nodes)
        of_points = times_rows(np.asarray(1.0 / seen.weight), seen.shares) @ (psi @ fixed.at_rays)
        gap = seen.gap - of_points @ fixed.distance(seen.x, seen.y)
        return replace(seen, gap=gap, uncounted=sp.csr_array(of_points @ fixed.slave))

    def _place_over(self, facets: Array, points: Array, ways: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
        """The places on facets, nodes of shape (m, k, 2), that points see along ways, and whether they are on them."""
        places = _meeting(facets, points, ways)
        return places, np.abs(places - 0.5) <= 0.5 + SAME_PLACE_IN_CELL

    def _place_under(self, facets: Array, ways: Array, points: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
        """The places on facets that see points along ways at their nodes, shape (m, k, 2), and whether there are any:
        where a change of sign is.
        """

        def missed(s: Array, rows: Any) -> Array:
            hats = _hats(s, facets.shape[1])
            at, way = (np.einsum("...k,...kd->...d", hats, values[rows]) for values in (facets, ways))
            return np.asarray(_cross(points[rows] - at, way))

        scanned = np.concatenate(([-SAME_PLACE_IN_CELL], _SCANNED[1:-1], [1.0 + SAME_PLACE_IN_CELL]))
        all_facets = np.arange(len(facets))[:, None]
        values = missed(np.broadcast_to(scanned, (len(facets), scanned.size)), all_facets)
        changes = (values[:, :-1] >= 0) != (values[:, 1:] >= 0)
        first, rows = changes.argmax(axis=1), np.arange(len(facets))
        low, high, rising = scanned[first], scanned[first + 1], values[rows, first + 1] >= 0
        for _ in range(_HALVED):
            middle = (low + high) / 2
            above = (missed(middle, rows) >= 0) == rising
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        return (low + high) / 2, changes.any(axis=1)

    def _carried(self, able: Numbers, shares: Any, psi: Any) -> tuple[Any, Any, npt.NDArray[np.bool_], Array, Any]:
        """The shares of all points, see ``SeenSides``, their functions at rays, scipy sparse, shape (p, r), which of
        them have some, their areas, and the functions over these.

        Args:
            able: nodes of the slave that carry a point with functions.
            shares: of the functions of all nodes in theirs.
            psi: the functions of the nodes.
        """
        at, size = np.searchsorted(self.carriers, able), self.carriers.size
        placing = sp.csr_array((np.ones(at.size), (at, np.arange(at.size))), shape=(size, at.size))
        of_points = sp.csr_array(placing @ shares)
        functions = sp.csr_array(of_points @ psi)
        partnered, weight = np.zeros(size, dtype=bool), np.array(self.surface.area[self.carriers])
        partnered[at] = True
        weight[at] = shares @ np.asarray(psi.sum(axis=1)).ravel()
        return of_points, functions, partnered, weight, times_rows(np.asarray(1.0 / weight), functions)

    def _shares_of(self, rays: Rays, mean: Any, partnered: npt.NDArray[np.bool_]) -> tuple[Any, Any]:
        """D and M, see ``SeenSides``, of functions over areas at rays."""
        slave, master = self.chains
        unpaired = np.flatnonzero(~partnered)
        entries = np.ones(unpaired.size), (unpaired, self.carriers[unpaired])
        itself = sp.csr_array(entries, shape=(partnered.size, slave.nodes.size))
        sharing = sp.csr_array(mean @ self._at_nodes(slave, rays.facet, rays.at) + itself)
        return sharing, sp.csr_array(mean @ self._at_nodes(master, rays.over, rays.place))

    def _functions(self, rays: Rays) -> Any:
        """The dual functions of the nodes of the slave at rays times their areas, scipy sparse, shape (N, r)."""
        slave = self.chains[0]
        hats = self._hats(rays.at, slave)
        mass = np.zeros((len(slave.facets), slave.width, slave.width))
        for k in range(slave.width):
            for j in range(slave.width):
                products = hats[:, k] * hats[:, j] * rays.area
                mass[:, k, j] = np.bincount(rays.facet, products, minlength=len(mass))
        covered = np.unique(rays.facet)
        duals = np.zeros_like(mass)
        inverse = np.linalg.pinv(mass[covered], rcond=1e-10, hermitian=True)
        duals[covered] = mass[covered].sum(axis=2)[:, :, None] * inverse
        values = np.zeros_like(hats)
        for k in range(slave.width):
            values += duals[rays.facet, :, k] * (hats[:, k] * rays.area)[:, None]
        numbers = np.broadcast_to(np.arange(len(values))[:, None], values.shape)
        places = slave.facets[rays.facet].ravel(), numbers.ravel()
        return sp.csr_array((values.ravel(), places), shape=(slave.nodes.size, len(values)))

    def _hats(self, places: Array, chain: BoundaryPolyline) -> Array:
        """The functions of the nodes of facets of a side at places, shape (r, k)."""
        return np.asarray(_hats(places, chain.width))

    @cached_property
    def _rates(self) -> tuple[Numbers, Array]:
        """The nodes of both sides that the distance along each ray depends on, some of them several times, with parts
        of its derivatives, of which the place on the facet of the slave, and the angles between rays and normals of the
        slave are held; shapes (r, n) and (r, n, 2).
        """
        seen, (slave, master), rays = self.present, self.chains, self.present.rays
        count, width, own = slave.nodes.size, slave.width, slave.facets[rays.facet]
        sides = slave.beside[rays.facet].T
        nodes = np.column_stack((own, *(slave.facets[beside] for beside in sides), count + master.facets[rays.over]))
        both = np.concatenate((seen.x, seen.y))
        places = both[nodes].astype(np.complex128)
        normals = self.surface.displaced(self.ends[0][:count]).in_planes(slave.normals(seen.x), np.arange(count))
        cosine, sine = np.sum(seen.ways * normals, axis=1)[own], _cross(normals, seen.ways)[own]
        in_plane, outward_of = self._in_plane[own], normals[own]
        hats, there = _hats(rays.at, width), [(beside >= 0)[:, None] for beside in sides]

        def distance(x: Any, ray_of: Numbers) -> Any:
            sums = slave.moments(x[:, :width])
            before, behind = (slave.moments(x[:, first : first + width]) for first in (width, 2 * width))
            sums[:, 0] += there[0][ray_of] * before[:, 1]
            sums[:, 1] += there[1][ray_of] * behind[:, 0]
            outward = np.where(in_plane[ray_of][..., None], outward_of[ray_of], _unit(sums))
            turned = np.stack((-outward[..., 1], outward[..., 0]), axis=-1)
            ways = cosine[ray_of][..., None] * outward + sine[ray_of][..., None] * turned
            own_hats = hats[ray_of]
            start, ray = (_combined(own_hats, values) for values in (x[:, :width], ways))
            ray = _unit(ray)
            facet, over = x[:, 3 * width :], rays.place[ray_of]
            # One step of Newton's method has the derivative of the place.
            apart = _combined(_hats(over, master.width), facet) - start
            along = _combined(_slopes(over, master.width), facet)
            over = over - _cross(apart, ray) / _cross(along, ray)
            return np.sum((_combined(_hats(over, master.width), facet) - start) * ray, axis=1)

        rates, size = np.zeros((*nodes.shape, 2)), len(nodes)
        steps = [(k, component) for k in range(nodes.shape[1]) for component in range(2)]
        together = max(1, _STEPPED // max(size, 1))
        for first in range(0, len(steps), together):
            group = steps[first : first + together]
            stepped = np.tile(places, (len(group), 1, 1, 1))
            for number, (k, component) in enumerate(group):
                stepped[number, :, k, component] += 1j * COMPLEX_STEP
            ray_of = np.tile(np.arange(size), len(group))
            changes = distance(stepped.reshape(-1, *places.shape[1:]), ray_of).imag.reshape(len(group), size)
            for (k, component), change in zip(group, changes, strict=True):
                rates[:, k, component] = change / COMPLEX_STEP
        return nodes, rates

    def _add_couples(self, forces: Array, drag: Array) -> None:
        """Add the couples of forces at points whose places on both sides are apart, half on each side."""
        seen, (slave, master), count = self.present, self.chains, self.chains[0].nodes.size
        apart = seen.opposite @ seen.y - seen.sharing @ seen.x
        apart[~seen.partnered] = 0.0
        couples = _cross(apart, drag) / 2
        points = np.flatnonzero(couples != 0.0)
        own = slave.facets[seen.rays.facet]
        rays = np.repeat(np.arange(len(own)), own.shape[1])
        at_nodes = np.repeat(seen.rays.area, own.shape[1]), (own.ravel(), rays)
        # The area of each ray that each of the points has.
        shares = sp.csr_array(seen.shares)[points] @ sp.csr_array(at_nodes, shape=(slave.nodes.size, len(own)))
        for chain, facets, x, first in ((slave, seen.rays.facet, seen.x, 0), (master, seen.rays.over, seen.y, count)):
            met = chain.facets[facets]
            entries = np.ones(met.size), (np.repeat(np.arange(len(met)), met.shape[1]), met.ravel())
            arms = sp.coo_array(shares @ sp.csr_array(entries, shape=(len(met), chain.nodes.size)))
            point, node, area = arms.row, arms.col, arms.data
            sums = np.bincount(point, area, points.size)
            middles = np.stack([np.bincount(point, area * way, points.size) / sums for way in x[node].T], axis=1)
            r = x[node] - middles[point]
            polar = np.bincount(point, area * np.sum(r**2, axis=1), points.size)
            turned = np.column_stack((-r[:, 1], r[:, 0]))
            np.add.at(forces, first + node, (couples[points] / polar)[point, None] * area[:, None] * turned)

    def _moving(self, rays: Rays) -> Rays:
        """Those where one of the sides can move: supports do not hold all nodes of both facets."""
        slave, master = (chain.facets for chain in self.chains)
        still = self.held.slave[slave[rays.facet]].all(axis=1) & self.held.master[master[rays.over]].all(axis=1)
        moving = np.flatnonzero(~still)
        return Rays(
            rays.facet[moving],
            rays.at[moving],
            rays.over[moving],
            rays.place[moving],
            rays.distance[moving],
            rays.area[moving],
        )

    def _carriers(
        self, rays: Rays, functions: Any, sums: Array, of_places: Array | None, *, moving: bool
    ) -> tuple[TakenFunctions, TestedNodes]:
        """Which nodes carry points, and how these take over functions.

        Args:
            rays: where something can move.
            functions: of the nodes of the slave at rays times areas, scipy sparse, shape (N, r).
            sums: areas of these, shape (N,).
            of_places: see ``movable``.
            moving: whether nodes that nothing can move, and those of other contacts, carry none.
        """
        slave, master = self.chains
        unable = np.array(self.surface.without_area)
        shares: Array = np.ones(slave.nodes.size)
        if moving:
            met = sp.csr_array(functions @ self._at_nodes(master, rays.over, rays.place))
            unable |= self.unable
            shares = movable((self.held.slave, self.held.master), met, of_places)
        facets = slave.facets[np.unique(rays.facet)]
        nodes = TestedNodes(facets, slave.facets, self.surface.area, sums, unable, shares)
        return taken_functions(nodes), nodes

    def _at_nodes(self, chain: BoundaryPolyline, facets: Numbers, places: Array) -> Any:
        """The functions of the nodes of a side at rays, scipy sparse, shape (r, N)."""
        values, nodes = self._hats(places, chain), chain.facets[facets]
        rows = np.broadcast_to(np.arange(len(values))[:, None], values.shape)
        entries = values.ravel(), (rows.ravel(), nodes.ravel())
        return sp.csr_array(entries, shape=(len(values), chain.nodes.size))


def _at(chain: BoundaryPolyline, values: Array, facets: Numbers, places: Array) -> Array:
    """Values between those at the nodes of a side, at places on facets."""
    return np.asarray(_combined(_hats(places, chain.width), values[chain.facets[facets]]))


def _rings(chain: BoundaryPolyline, facets: Numbers, places: Array, areas: Array) -> Array:
    """Integrals of the magnitudes of the functions of the nodes of a side, at places on facets, shape (N,)."""
    sums = np.zeros(chain.nodes.size)
    np.add.at(sums, chain.facets[facets], areas[:, None] * np.abs(_hats(places, chain.width)))
    return sums
