"""The distances of a pair in 2D whose bodies slide and turn, and their derivatives, see ``sliding``.

All rows at the points of a piece of the overlap are of the displacements of few nodes, which are those of both of its
facets and those that turn the normals of the slave there.  So they are dense arrays for each piece, which are summed
once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.mechanics.pairs.mortar_coupling import Tested
from signorini_fx.mechanics.pairs.overlap_plane import PLACES_OF_RULE
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.tuned import NO_PART

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class PlanePieces:
    """The pieces of an overlap in 2D, p of them with q points each, and l components of displacements each.

    Attributes:
        mean: from moments of the functions of the nodes of the slave to means at the n points, sparse, shape (n, N).
        points: nodes of the slave whose functions a piece meets, shape (p, t).
        weighted: these functions times areas, shape (p, q, t).
        unknowns: which components of the nodes of both sides a piece depends on, those of the facet of the master last,
            shape (p, l).
        count: of the components of both sides.
        distance: g, length, shape (p, q).
        change: dg, shape (p, q, l).
        shift: dxi, likewise.
        turn: nu . dN / (nu . N), without the facet of the master, on which it does not depend.
        along: nu . d(x_m') / (nu . N), of the facet of the master alone.
        bend: what dxi turns the normal of the master by, shape (p, q, 2).
        curved: nu . x_m'' / (nu . N), of facets that are no straight lines, shape (p, q).
        sides: slave and master, their overlap, and the directions of projection, see ``of``.
    """

    mean: sp.csr_array
    points: Indices
    weighted: Array = field(repr=False)
    unknowns: Indices
    count: int
    distance: Array
    change: Array = field(repr=False)
    shift: Array = field(repr=False)
    turn: Array = field(repr=False)
    along: Array = field(repr=False)
    bend: Array = field(repr=False)
    curved: Array
    sides: tuple[PairSurface, PairSurface, Tested, Array] = field(repr=False)

    @classmethod
    def of(
        cls, slave: PairSurface, master: PairSurface, tested: Tested, directions: Array, mean: sp.csr_array
    ) -> PlanePieces:
        """Those of two sides.

        Args:
            slave: the side with the points.
            master: the other one.
            tested: their overlap.
            directions: of projection at the nodes of the slave, of length one, shape (N, 2).
            mean: see ``PlanePieces``.
        """
        overlap = tested.overlap
        seen, over = slave.nodes[overlap.slave], master.nodes[overlap.master]
        shape, shape_over = slave.functions.values(overlap.at), master.functions.values(overlap.over)
        slope_over = master.functions.slopes(overlap.over)[0]
        ways = shape @ directions[seen]
        length = np.linalg.norm(ways, axis=2, keepdims=True)
        ways = ways / length
        across = _turned(ways)
        facet = slope_over @ master.x[over]
        facing = _turned(facet) / np.linalg.norm(facet, axis=2, keepdims=True)
        cosine = np.einsum("pqd,pqd->pq", facing, ways)  # of either sign, which cancels
        facing_over = facing / cosine[..., None]
        distance = np.einsum("pqd,pqd->pq", overlap.distance(slave, master), ways)

        first, own_nodes = len(slave.x), _own_functions(slave, overlap.slave)
        angles = turned_at_nodes(slave)[overlap.slave].reshape(len(seen), seen.shape[1], -1)
        turn = (np.einsum("pkd,pqd->pqk", directions[seen], ways) * shape / length) @ angles  # of N, an angle
        inclined = np.einsum("pqd,pqd->pq", facing_over, across)
        stretched = np.einsum("pqd,pqd->pq", facet, across)
        shares = np.concatenate((-(shape @ own_nodes), shape_over), axis=2)
        width = turn.shape[2]
        change, shift = _products(shares, facing_over), -_products(shares, across)
        change[..., :width] -= (distance * inclined)[..., None] * turn
        shift[..., :width] += distance[..., None] * turn
        shift /= stretched[..., None]

        bend = slope_over @ master.directions[over]
        second = master.functions.curvatures @ master.x[over]
        geometry = (
            inclined[..., None] * turn,
            _products(slope_over, facing_over),
            bend,
            np.einsum("pd,pqd->pq", second, facing_over),
        )
        nodes = np.hstack((slave.neighbours.around[overlap.slave], first + over))
        unknowns, points = _components(nodes), slave.points[overlap.slave]
        sides, count = (slave, master, tested, directions), 2 * (first + len(master.x))
        return cls(mean, points, tested.weighted, unknowns, count, distance, change, shift, *geometry, sides)

    @cached_property
    def corners(self) -> _SeenVertices:
        """Where points of the slave see vertices of the master."""
        return _SeenVertices.of(*self.sides)

    @property
    def gap(self) -> Array:
        """At the points, length, shape (n,)."""
        moments = np.einsum("pqt,pq->pt", self.weighted, self.distance)
        return np.asarray(self.mean @ np.bincount(self.points.ravel(), moments.ravel(), self.mean.shape[1]))

    @property
    def rows(self) -> sp.csr_array:
        """Of the derivative of the gap, sparse, shape (n, 2 m)."""
        function, _, factor = self._met
        return self._at_points(factor[:, None] * self._moments(self.change)[function])

    def turning_by_shift(self, vectors: Array) -> sp.csr_array:
        """What the places that shift change of the normal of the master, along vectors at the points, shape (n, 2):
        sparse, shape (n, 2 m).
        """
        function, point, factor = self._met
        along = (factor[:, None] * vectors[point]).T[..., None]
        moments = [self._moments(bend[..., None] * self.shift)[function] for bend in np.moveaxis(self.bend, 2, 0)]
        return self._at_points(along[0] * moments[0] + along[1] * moments[1])

    def stiffness(self, pressing: Array) -> sp.csr_array:
        """Minus the second derivative of the gaps with forces at the points, shape (n,), sparse, shape (2 m, 2 m)."""
        nodal = self.mean.T @ pressing
        forces = np.einsum("pqt,pt->pq", self.weighted, nodal[self.points])
        width, size = self.turn.shape[2], self.unknowns.shape[1]
        turned = np.matmul(self.change.swapaxes(1, 2), forces[..., None] * self.turn)
        shifted = np.matmul(self.along.swapaxes(1, 2), forces[..., None] * self.shift)
        blocks = np.zeros((len(self.unknowns), size, size))
        blocks[:, :, :width] += turned
        blocks[:, width:] -= shifted
        blocks += blocks.swapaxes(1, 2)
        turns = -forces * self.curved
        if turns.any():
            blocks += np.matmul(self.shift.swapaxes(1, 2), turns[..., None] * self.shift)
        entries = [_entries(blocks, self.unknowns), self.corners.entries(nodal)]
        values, *at = (np.concatenate(parts) for parts in zip(*entries, strict=True))
        return sp.csr_array((values, tuple(at)), shape=(self.count, self.count))

    @cached_property
    def _met(self) -> tuple[Indices, Indices, Array]:
        """Which function of which piece, numbered piece by piece, counts at which point, and by how much, shape (e,)
        each.
        """
        mean = self.mean.tocsc()
        nodes = self.points.ravel()
        counts = np.diff(mean.indptr)[nodes]
        function = np.repeat(np.arange(nodes.size), counts)
        entry = np.arange(function.size) + np.repeat(mean.indptr[nodes] - np.cumsum(counts) + counts, counts)
        return function, mean.indices[entry], mean.data[entry]

    def _moments(self, values: Array) -> Array:
        """Integrals of the functions of each piece times values at its points, shape (p, q, l): shape (p t, l)."""
        moments = np.matmul(self.weighted.swapaxes(1, 2), values)
        return np.asarray(moments.reshape(-1, values.shape[2]))

    def _at_points(self, values: Array) -> sp.csr_array:
        """Rows of the functions where they count, see ``_met``, shape (e, l), at the points, sparse, shape (n, 2 m)."""
        function, point, _ = self._met
        columns = self.unknowns[function // self.points.shape[1]]
        at = np.repeat(point, columns.shape[1]), columns.ravel()
        return sp.csr_array((values.ravel(), at), shape=(self.mean.shape[0], self.count))


@dataclass(frozen=True)
class _SeenVertices:
    """Where points of the slave see vertices of the master, at which its normal turns, v of them.

    There the derivative of the distance jumps by k w, with w = (d_v - d_s - g dN) . N^, and the place moves by
    w / J along the slave.

    Attributes:
        points: nodes of the slave whose functions meet the place, shape (v, t).
        functions: these functions times the width of the facet and k / J, shape (v, t).
        unknowns: see ``PlanePieces``, shape (v, l).
        passing: w, of their displacements, shape (v, l).
    """

    points: Indices
    functions: Array
    unknowns: Indices
    passing: Array

    @classmethod
    def of(cls, slave: PairSurface, master: PairSurface, tested: Tested, directions: Array) -> _SeenVertices:
        """Those of an overlap; for the arguments see ``PlanePieces``."""
        overlap = tested.overlap
        at, over = overlap.at[..., 0], overlap.over[..., 0]
        half = (at[:, -1] - at[:, 0]) / (2 * PLACES_OF_RULE[-1])
        middle = (at[:, 0] + at[:, -1]) / 2
        rises = over[:, -1] > over[:, 0]
        ends, places = np.concatenate((middle - half, middle + half)), master.functions.places[:, 0]
        first = np.concatenate((rises, ~rises))  # whether the vertex is at the beginning of the facet
        piece = np.tile(np.arange(len(at)), 2)
        vertex = master.nodes[overlap.master[piece], np.where(first, places.argmin(), places.argmax())]
        upper = np.repeat([False, True], len(at))
        inside = (ends > NO_PART) & (ends < 1.0 - NO_PART)
        facet = overlap.slave[piece]
        key = facet * len(master.x) + vertex
        below, above = (np.flatnonzero(inside & side) for side in (upper, ~upper))
        _, from_below, from_above = np.intersect1d(key[below], key[above], return_indices=True)
        below, above = below[from_below], above[from_above]
        facets, s = facet[below], ends[below]
        shape, slope = slave.functions.values(s[:, None]), slave.functions.slopes(s[:, None])[0]
        nodes, vertices = slave.nodes[facets], vertex[below]
        ways, turns = (np.einsum("vk,vkd->vd", values, directions[nodes]) for values in (shape, slope))
        length = np.linalg.norm(ways, axis=1, keepdims=True)
        ways = ways / length
        across = _turned(ways)
        distance = np.einsum("vd,vd->v", master.x[vertices] - np.einsum("vk,vkd->vd", shape, slave.x[nodes]), ways)

        def inclination(rows: Indices) -> Array:
            """The normal of a facet at its vertex along N^ over that along N."""
            numbers, end = overlap.master[piece[rows]], np.where(first[rows], 0.0, 1.0)
            normal = master.normals(numbers, end[:, None, None])[:, 0]
            return np.asarray(np.einsum("vd,vd->v", normal, across) / np.einsum("vd,vd->v", normal, ways))

        kink = inclination(above) - inclination(below)
        stretch = np.einsum("vk,vkd->vd", slope, slave.x[nodes]) + distance[:, None] * turns / length
        rate = kink / np.einsum("vd,vd->v", stretch, across)
        shares = shape * np.einsum("vkd,vd->vk", directions[nodes], ways) / length
        turn = np.einsum("vk,vkwd->vwd", shares, turned_at_nodes(slave)[facets])
        own_shares = np.einsum("vk,vkw->vw", shape, _own_functions(slave, facets))
        moved = np.concatenate((-own_shares, np.ones((len(own_shares), 1))), axis=1)
        passing = moved[..., None] * across[:, None]
        passing[:, :-1] -= distance[:, None, None] * turn
        functions = np.einsum("vij,vj->vi", tested.coefficients[facets], slave.tests.values(s[:, None]))
        at_vertices = s[:, None, None]
        functions *= slave.measured(facets, at_vertices, slave.sizes(facets, at_vertices))
        around = np.column_stack((slave.neighbours.around[facets], len(slave.x) + vertices))
        return cls(
            slave.points[facets],
            functions * rate[:, None],
            _components(around),
            passing.reshape(len(moved), 2 * moved.shape[1]),
        )

    def entries(self, nodal: Array) -> tuple[Array, Indices, Indices]:
        """What forces of the functions of the nodes of the slave, shape (N,), add to the tangent, with the rows and
        columns, shape (e,) each.
        """
        forces = np.einsum("vt,vt->v", self.functions, nodal[self.points])
        return _entries(forces[:, None, None] * self.passing[:, :, None] * self.passing[:, None], self.unknowns)


def turned_at_nodes(side: PairSurface) -> Array:
    """The angles by which displacements of the nodes around each facet turn the normals of a side at the nodes of the
    facet, shape (f, k, w, 2), see ``PairSurface.neighbours``.
    """
    if "turned_at_nodes" in side.of_places:
        return np.asarray(side.of_places["turned_at_nodes"])
    around, values = side.neighbours, _turned_by_facets(side)
    facets, count = side.nodes.shape
    width = around.around.shape[1]
    at = (around.turned[:, None] * width + around.places).ravel()
    of_nodes = values.reshape(-1, count, 2)[around.turning].reshape(-1, 2)
    sums = [np.bincount(at, component, facets * count * width) for component in of_nodes.T]
    angles = np.asarray(np.stack(sums, axis=1).reshape(facets, count, width, 2), dtype=np.float64)
    side.of_places["turned_at_nodes"] = angles
    return angles


def turning_at_nodes(sides: Sequence[PairSurface]) -> sp.csr_array:
    """The angles by which displacements of the nodes of some sides turn their normals at the nodes, sparse, shape (m,
    2 m), the nodes of the first one first.
    """
    entries, first = list[tuple[Array, Indices, Indices]](), 0
    for side in sides:
        values, nodes = _turned_by_facets(side), first + side.nodes
        columns = _components(nodes)[:, None]
        flat = values.reshape(*nodes.shape, -1)
        row, column = (np.broadcast_to(numbers, flat.shape).ravel() for numbers in (nodes[:, :, None], columns))
        entries.append((flat.ravel(), row, column))
        first += len(side.x)
    angles, *at_both = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    return sp.csr_array((angles, tuple(at_both)), shape=(first, 2 * first))


def _turned_by_facets(side: PairSurface) -> Array:
    """What each facet turns of the normals at its nodes, as these are displaced, angles, shape (f, k, k, 2).

    The normal of a node is along the integral of that of its facets times its function.  Those in planes of symmetry do
    not turn.
    """
    if "turned_by_facets" in side.of_places:
        return np.asarray(side.of_places["turned_by_facets"])
    normals = side.nodal_normals
    at, weights = side.functions.rule(2 * side.functions.degree)
    functions = side.functions.values(at) * weights[:, None]
    products = functions.T @ side.functions.slopes(at)[0]
    facets, moments = np.arange(len(side.nodes)), np.zeros_like(normals)
    facing = side.normals(facets, np.broadcast_to(at, (len(facets), *at.shape)))
    np.add.at(moments, side.nodes, np.einsum("qk,fqd->fkd", functions, facing))
    size = np.linalg.norm(moments, axis=1)
    turns = (size > 0) & ~side.across.any(axis=(1, 2))
    factor = np.divide(-1.0, size, out=np.zeros_like(size), where=turns)[side.nodes] * side.sign[:, None]
    angles = np.asarray((factor[:, :, None] * products)[..., None] * normals[side.nodes][:, :, None])
    side.of_places["turned_by_facets"] = angles
    return angles


def _own_functions(side: PairSurface, facets: Indices) -> Array:
    """Which of the nodes around some facets are their own, as ones, shape (p, k, w)."""
    around = side.neighbours
    ones = np.zeros((*around.own_places.shape, around.around.shape[1]))
    np.put_along_axis(ones, around.own_places[..., None], 1.0, axis=2)
    return np.asarray(ones[facets])


def _turned(vectors: Array) -> Array:
    """Vectors, shape (..., 2), turned by 90 degrees."""
    return np.stack((-vectors[..., 1], vectors[..., 0]), axis=-1)


def _products(shares: Array, vectors: Array) -> Array:
    """Vectors at points, shape (p, q, 2), times shares of nodes, shape (p, q, c), as rows, shape (p, q, 2 c)."""
    return np.asarray((shares[..., None] * vectors[:, :, None]).reshape(*shares.shape[:2], -1))


def _components(nodes: Indices) -> Indices:
    """The components at nodes, shape (..., c), as numbers, shape (..., 2 c)."""
    return np.asarray((2 * nodes[..., None] + np.arange(2)).reshape(*nodes.shape[:-1], 2 * nodes.shape[-1]))


def _entries(blocks: Array, unknowns: Indices) -> tuple[Array, Indices, Indices]:
    """Blocks of some unknowns, shapes (p, l, l) and (p, l), as values with their rows and columns, shape (e,) each."""
    rows, columns = (
        np.broadcast_to(unknowns[:, :, None], blocks.shape),
        np.broadcast_to(unknowns[:, None], blocks.shape),
    )
    return blocks.ravel(), rows.ravel(), columns.ravel()
