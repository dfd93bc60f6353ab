"""One side of a pair, the overlap of both sides, and sparse maps of vectors at nodes.

A side has facets with Lagrange functions, their positions, directions and nodal integrals.  The
overlap consists of triples: a slave point, the master point opposite it, and an area.  The maps
include the rotation of normals.

A facet has k nodes at reference places in [0, 1] (d = 2), in the triangle with the vertices (0, 0),
(1, 0), (0, 1), or in [0, 1]^2, in any order: the places determine the functions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from itertools import product

import basix
import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from signorini_fx.arrays import Array, Flags, Ints, inner, quotient
from signorini_fx.machine import parallel
from signorini_fx.tuned import SAME_NUMBER, ZERO_COMPONENT

# Degree of quadrature for areas of one side alone: exact on affine facets.
_DEGREE = 8

_quadrature = cache(basix.make_quadrature)


@dataclass(frozen=True)
class Lagrange:
    """The Lagrange functions of k places in the reference facet, shape (k, d - 1)."""

    places: Array

    @property
    def simplex(self) -> bool:
        """Whether the facet is an interval or a triangle."""
        return self.places.shape[1] == 1 or len(self.places) in (3, 6)

    @cached_property
    def degree(self) -> int:
        """Return the degree of the functions along a side, 1 or 2."""
        return 2 if (self.places.shape[1], len(self.places)) in ((1, 3), (2, 6), (2, 9)) else 1

    @cached_property
    def _exponents(self) -> list[tuple[int, ...]]:
        powers = [
            power[::-1] for power in product(range(self.degree + 1), repeat=self.places.shape[1])
        ]
        kept = [power for power in powers if not self.simplex or sum(power) <= self.degree]
        return list(zip(*kept, strict=True))  # of each direction

    @cached_property
    def _coefficients(self) -> Array:
        return np.asarray(np.linalg.inv(self._monomials(self.places)), dtype=np.float64)

    def _monomials(self, at: Array, along: int | None = None) -> Array:
        """Return the monomials at points of shape (..., d - 1), shape (..., k); with ``along``
        their derivatives in that direction.
        """
        factors = []
        for axis, power in enumerate(self._exponents):
            s = at[..., axis, None]
            ones = np.ones_like(s)
            powers = (0.0 * s, ones, 2.0 * s) if axis == along else (ones, s, s * s)
            factors.append(np.concatenate([powers[k] for k in power], axis=-1))
        return factors[0] if len(factors) == 1 else factors[0] * factors[1]

    def values(self, at: Array) -> Array:
        """Return the values of the functions at points of shape (..., d - 1), shape (..., k)."""
        return self._monomials(at) @ self._coefficients

    def slopes(self, at: Array) -> Array:
        """Return the derivatives along the d - 1 directions, shape (d - 1, ..., k)."""
        return np.array(
            [self._monomials(at, axis) @ self._coefficients for axis in range(self.places.shape[1])]
        )

    def polynomials(self, values: Array) -> Array:
        """Return the coefficients, by ascending powers, of the polynomials that interpolate nodal
        values in an interval, shape (..., k, d), as the values.
        """
        return self._coefficients @ values

    @property
    def curvatures(self) -> Array:
        """The second derivatives of the functions in an interval, which are constant, shape
        (k,).
        """
        coefficients = self._coefficients
        return 2.0 * coefficients[2] if self.degree == 2 else np.zeros(len(coefficients))

    def rule(self, degree: int) -> tuple[Array, Array]:
        """Return the points, shape (q, d - 1), and weights of a quadrature on the reference
        facet.
        """
        kind = basix.CellType.interval
        if self.places.shape[1] == 2:
            kind = basix.CellType.triangle if self.simplex else basix.CellType.quadrilateral
        return _quadrature(kind, degree)

    @cached_property
    def tests(self) -> Lagrange:
        """The functions to which the test functions are dual: the hats of the vertices, which come
        first, on quadratic triangles; otherwise the functions themselves.
        """
        return Lagrange(self.places[:3]) if self.places.shape == (6, 2) else self

    @cached_property
    def tested_slopes(self) -> tuple[Array, Array]:
        """Data for integrals of test functions times normals: weighted test functions, shape (q,
        t), and slopes, shape (d - 1, q, k), at the points of a quadrature.
        """
        points, weights = self.rule(2 * self.degree + 2)
        return self.tests.values(points) * weights[:, None], self.slopes(points)

    @cached_property
    def linear(self) -> Lagrange:
        """The linear (on quadrilaterals: bilinear) functions of the corners."""
        return Lagrange(self.corners)

    @cached_property
    def vertices(self) -> list[int]:
        """Numbers of the nodes at the corners, in order around the facet."""
        return [int(np.abs(self.places - corner).sum(axis=1).argmin()) for corner in self.corners]

    @cached_property
    def parts(self) -> Array:
        """The corners of the linear parts of the reference facet, in order around each part, shape
        (parts, corners, d - 1).
        """
        if self.degree == 1 or self.places.shape[1] == 1:
            return self.corners[None]
        corners = [self.corners / 2 + shift for shift in self.corners / 2]
        return np.array([*corners, (1.0 - self.corners) / 2] if self.simplex else corners)

    @cached_property
    def corners(self) -> Array:
        """The corners of the reference facet, in order around it, shape (corners, d - 1)."""
        if self.places.shape[1] == 1:
            return np.array([[0.0], [1.0]])
        square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        return square[[0, 1, 3]] if self.simplex else square


@dataclass(frozen=True)
class PairSurface:
    """The facets of one side, f of them.

    Attributes:
        nodes: numbers of the k nodes of each facet, shape (f, k).
        x: positions of all nodes, length, shape (N, d).
        functions: the shape functions of a facet.
        sign: +1 where the outward normal is (dx/ds x dx/dt), in 2D dx/ds turned clockwise; else -1,
            shape (f,).
        across: projectors onto the normals of planes of symmetry at all nodes, shape (N, d, d).
        held: nodes that supports hold along their normals, shape (N,).
        unable: nodes that cannot carry a point, because another contact owns them, shape (N,).
        measure: nodal factors of the areas, interpolated between the nodes, shape (N,); None: 1.
        undeformed: the undeformed surface, whose areas are used where ``x`` are positions of a
            deformed body; None: this surface is undeformed.
        wall: distance from each facet back through its body to the opposite part of the surface,
            length, shape (f,); inf: no such part within reach; None: infinite for all facets.
    """

    nodes: Ints
    x: Array
    functions: Lagrange
    sign: Array
    across: Array
    held: Flags
    unable: Flags
    measure: Array | None = None
    undeformed: PairSurface | None = None
    wall: Array | None = None

    @classmethod
    def of(
        cls,
        nodes: Ints,
        x: Array,
        functions: Lagrange,
        sign: Array,
        measure: Array | None = None,
    ) -> PairSurface:
        """Return a side without supports, symmetry planes or nodes of other contacts."""
        none = np.zeros(len(x), dtype=bool)
        return cls(nodes, x, functions, sign, np.zeros((*x.shape, x.shape[1])), none, none, measure)

    def displaced(self, displacement: Array) -> PairSurface:
        """Return the surface with displaced nodes and the areas of the undeformed surface.

        Args:
            displacement: displacement from the undeformed surface, length, shape (N, d).
        """
        start = self if self.undeformed is None else self.undeformed
        return replace(start, x=start.x + displacement, undeformed=start)

    def chosen(self, facets: Ints) -> PairSurface:
        """Return the surface of some of its facets, with all of its nodes."""
        start = None if self.undeformed is None else self.undeformed.chosen(facets)
        wall = None if self.wall is None else self.wall[facets]
        return replace(
            self, nodes=self.nodes[facets], sign=self.sign[facets], wall=wall, undeformed=start
        )

    @property
    def dimension(self) -> int:
        """The geometric dimension d, 2 or 3."""
        return int(self.x.shape[1])

    @cached_property
    def corners(self) -> Array:
        """Positions of the nodes of each facet, shape (f, k, d)."""
        return self.x[self.nodes]

    @property
    def points(self) -> Ints:
        """Numbers of those nodes of each facet that have test functions, shape (f, t)."""
        return self.nodes[:, : len(self.functions.tests.places)]

    def normals(self, facets: Ints, at: Array) -> Array:
        """Return outward normals at points of some facets, shape (m, q, d); their length is the
        area (in 2D: length) per unit of the reference facet.

        ``at``: reference coordinates, shape (m, q, d - 1), or (1, q, d - 1) if the same on all
        facets.
        """
        return self._crossed(facets, at) * self.sign[facets][:, None, None]

    def sizes(self, facets: Ints, at: Array) -> Array:
        """Return the undeformed area (in 2D: length) per unit of the reference facet, times the
        measure, shape (m, q); for the arguments see ``normals``.
        """
        if self.undeformed is not None:
            return self.undeformed.sizes(facets, at)
        sizes = np.linalg.norm(self._crossed(facets, at), axis=2)
        if self.measure is not None:
            sizes *= (self.functions.values(at) @ self.measure[self.nodes[facets]][..., None])[
                ..., 0
            ]
        return sizes

    def _crossed(self, facets: Ints, at: Array) -> Array:
        """Return the normals up to their signs, see ``normals``."""
        return across(self.functions.slopes(at) @ self.corners[facets])

    def positions(self, facets: Ints, at: Array) -> Array:
        """Return positions of points of each facet, length, shapes as in ``normals``."""
        return self.functions.values(at) @ self.corners[facets]

    @cached_property
    def _areas(self) -> tuple[Array, Array]:
        """Integrals of the test functions of all nodes, shape (N,), and areas of the facets, shape
        (f,).
        """
        if self.undeformed is not None:
            return self.undeformed._areas
        points, weights = self.functions.rule(_DEGREE)
        sizes = self.sizes(np.arange(len(self.nodes)), points[None]) * weights
        area = np.zeros(len(self.x))
        np.add.at(area, self.points, sizes @ self.functions.tests.values(points))
        return area, sizes.sum(axis=1)

    @property
    def area(self) -> Array:
        """The area (in 2D: length) of each node: the integral of its test function times the
        measure, shape (N,).
        """
        return self._areas[0]

    @property
    def without_area(self) -> Flags:
        """Flags of the nodes whose test functions have no area because of the measure, shape (N,).

        The function of a quadratic node on an axis of revolution has zero area, except for the
        curvature of its facet.
        """
        if self.measure is None:
            return np.zeros(len(self.x), dtype=bool)
        least = SAME_NUMBER * self.measure.max() if self.functions.degree > 1 else -np.inf
        return (self.measure <= least) | (self.area <= SAME_NUMBER * self.area.max())

    @cached_property
    def nodal_normals(self) -> Array:
        """Outward unit normals at the nodes with test functions, shape (N, d); zero elsewhere.

        They are averages of the normals around a node, mirror images included where a plane of
        symmetry cuts the surface.
        """
        return self.in_planes(self.moments, np.arange(len(self.x)))

    @cached_property
    def moments(self) -> Array:
        """The integrals of the outward normal times the test function of each node, shape (N,
        d).
        """
        tests, slopes = self.functions.tested_slopes
        moments = np.zeros(self.x.shape)
        normals = across(slopes[:, None] @ self.corners) * self.sign[:, None, None]
        np.add.at(moments, self.points, tests.T @ normals)
        return moments

    def in_planes(self, vectors: Array, nodes: Ints) -> Array:
        """Return vectors at some nodes, shape (m, d), projected into the planes of symmetry and
        scaled to length one; zero vectors stay zero.
        """
        vectors = vectors - (self.across[nodes] @ vectors[..., None])[..., 0]
        size = np.linalg.norm(vectors, axis=1, keepdims=True)
        return quotient(vectors, size)

    @cached_property
    def turning(self) -> Array:
        """The derivatives of ``nodal_normals`` with respect to the displacements of the nodes of
        each facet, shape (f, t, k, d, d).
        """
        tests, slopes = self.functions.tested_slopes
        dim = self.dimension
        if dim == 2:
            turning = (tests.T @ slopes[0])[None, :, :, None, None] * np.array(
                [[0.0, 1.0], [-1.0, 0.0]]
            )
        else:
            along = slopes[:, None] @ self.corners
            first, second = (
                slopes[k][None, :, :, None] * along[1 - k][:, :, None] for k in range(2)
            )
            vectors = np.einsum("qt,fqld->ftld", tests, second - first, optimize=True)
            turning = _crossing(vectors.reshape(-1, 3)).reshape(*vectors.shape, 3)
        within = np.eye(dim) - self.across
        normals = self.nodal_normals
        size = np.linalg.norm((within @ self.moments[..., None])[..., 0], axis=1)
        inverse = quotient(1.0, size)
        across = inverse[:, None, None] * (within - normals[:, :, None] * normals[:, None])
        return across[self.points][:, :, None] @ (turning * self.sign[:, None, None, None, None])

    @cached_property
    def turning_places(self) -> tuple[Ints, Ints, Ints]:
        """The sparsity pattern of the matrix, shape (d N, d N), that sums ``turning``: the entry to
        which each value is added, the columns of the entries, and their number in each row.
        """
        if self.undeformed is not None:
            return self.undeformed.turning_places
        width = self.x.size
        rows = components(self.points, self.dimension)
        columns = components(self.nodes, self.dimension)
        entries, place = np.unique(rows[:, :, None] * width + columns[:, None], return_inverse=True)
        row, columns = np.divmod(entries, width)
        return place.ravel(), columns, np.bincount(row, minlength=width)

    @cached_property
    def directions(self) -> Array:
        """The outward unit directions at all nodes, shape (N, d): ``nodal_normals``, and at the
        midside nodes of quadratic triangles the normalised mean of both vertices.  Zero at nodes of
        no facet.
        """
        if len(self.functions.tests.places) == len(self.functions.places):
            return self.nodal_normals
        directions = np.zeros(self.x.shape)
        directions[self.nodes] = (
            self.functions.tests.values(self.functions.places) @ self.nodal_normals[self.points]
        )
        size = np.linalg.norm(directions, axis=1, keepdims=True)
        return quotient(directions, size)

    @property
    def facet_areas(self) -> Array:
        """Area (in 2D: length) of each facet, times the measure, shape (f,)."""
        return self._areas[1]

    @cached_property
    def neighbours(self) -> sp.csr_array:
        """Matrix of ones for facets that have a node in common, themselves included, sparse, shape
        (f, f).
        """
        if self.undeformed is not None:
            return self.undeformed.neighbours
        ends = np.arange(0, self.nodes.size + 1, self.nodes.shape[1])
        shape = (len(self.nodes), len(self.x))
        of_facets = sp.csr_array((np.ones(self.nodes.size), self.nodes.ravel(), ends), shape=shape)
        shared = sp.csr_array(of_facets @ of_facets.T)
        shared.data[:] = 1.0
        return shared

    @cached_property
    def around_neighbours(self) -> sp.csr_array:
        """Matrix with entries for facets that have neighbours in common, sparse, shape (f, f)."""
        if self.undeformed is not None:
            return self.undeformed.around_neighbours
        return sp.csr_array(self.neighbours @ self.neighbours)

    @cached_property
    def focus(self) -> Array:
        """How concave the surface is at each facet, per length, shape (f,): one over the smallest
        distance at which its normal meets those of its neighbours; zero where the normals diverge.
        """
        facets = np.arange(len(self.nodes))
        middle = self.functions.corners.mean(axis=0)[None, None]
        x = self.positions(facets, middle)[:, 0]
        normals = self.normals(facets, middle)[:, 0]
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        beside = self.neighbours
        row = np.repeat(facets, np.diff(beside.indptr))
        way = x[beside.indices] - x[row]
        apart = inner(way, way)
        bent = inner(normals[row] - normals[beside.indices], way)
        curvature = quotient(bent, apart)
        # Each facet is beside itself, with a curvature of zero.
        return np.maximum.reduceat(curvature, beside.indptr[:-1]) if facets.size else curvature

    @cached_property
    def around(self) -> sp.csr_array:
        """The area of the facets that two nodes have in common, sparse, shape (N, N)."""
        if self.undeformed is not None:
            return self.undeformed.around
        areas = self.facet_areas[:, None, None]
        shape = (len(self.x), len(self.x))
        return summed(shape, areas, self.nodes[:, :, None], self.nodes[:, None])


@dataclass(frozen=True)
class Sharing:
    """The division of a pair between ranks.

    Each rank has the pieces of the overlap on an equal part of the slave facets, whichever rank
    owns their cells, and the contact points at its own nodes.

    ``comm``: the ranks; ``owner``: the rank of each slave node, shape (N,); None: this rank.
    """

    comm: MPI.Comm
    owner: Ints | None

    def part(self, count: int) -> Ints:
        """Return the numbers of those of ``count`` facets that this rank pairs."""
        comm = self.comm
        return np.arange(count * comm.rank // comm.size, count * (comm.rank + 1) // comm.size)

    def own(self, nodes: Ints) -> Ints:
        """Return the indices in ``nodes`` of the points that belong to this rank."""
        if self.owner is None:
            return np.arange(nodes.size)
        return np.flatnonzero(self.owner[nodes] == self.comm.rank)

    def rows(self, matrix: sp.csr_array, nodes: Ints) -> sp.csr_array:
        """Return the rows of a matrix that belong to the points of this rank, summed over the
        ranks; collective.

        Args:
            matrix: this rank's contribution, a row for each of the points of all ranks.
            nodes: the slave node of each of these points.
        """
        if self.owner is None:
            return matrix
        entries = matrix.tocoo()
        to = self.owner[nodes][entries.row]
        parts = [
            (entries.row[here], entries.col[here], entries.data[here])
            for here in (np.flatnonzero(to == rank) for rank in range(self.comm.size))
        ]
        received = zip(*parallel.exchanged(self.comm, parts), strict=True)
        rows, columns, values = (np.concatenate(entry) for entry in received)
        own = self.own(nodes)
        shape = (own.size, matrix.shape[1])
        return sp.csr_array((values, (np.searchsorted(own, rows), columns)), shape=shape)

    def everywhere(self, values: Array, nodes: Ints) -> Array:
        """Return values at the points of all ranks, shape (n, k), on every rank; collective.

        Args:
            values: values at the points of this rank.
            nodes: the slave node of each of the points of all ranks.
        """
        rows = np.zeros((nodes.size, values.shape[1]))
        rows[self.own(nodes)] = values
        return parallel.global_sum(self.comm, rows)


# For a pair that is on this rank only.
ALONE = Sharing(MPI.COMM_SELF, None)


@dataclass(frozen=True)
class Overlap:
    """The pieces of the overlap, p of them with q points each, sorted by pairs of facets, f of
    them.

    Each piece lies on one facet of either side.

    Attributes:
        slave, master: numbers of the facets, shape (p,).
        at: reference coordinates of the points on the slave, shape (p, q, d - 1).
        over: reference coordinates of the opposite points on the master, shape (p, q, d - 1).
        weight: area (in 2D: length) of the slave side that each point stands for, times the
            measure, shape (p, q).
    """

    slave: Ints
    master: Ints
    at: Array
    over: Array
    weight: Array

    def chosen(self, pieces: Ints | Flags) -> Overlap:
        """Return some of the pieces."""
        return Overlap(*(getattr(self, entry.name)[pieces] for entry in fields(self)))

    @cached_property
    def first(self) -> Ints:
        """The number of the first piece of each pair of facets, shape (f,)."""
        if not self.slave.size:
            return np.zeros(0, dtype=np.int64)
        others = (np.diff(self.slave) != 0) | (np.diff(self.master) != 0)
        return np.append(0, 1 + np.flatnonzero(others))

    @cached_property
    def pair(self) -> Ints:
        """The number of the pair of facets of each piece, shape (p,)."""
        count = self.first.size
        return np.repeat(np.arange(count), np.diff(np.append(self.first, self.slave.size)))

    def of_pairs(self, values: Array) -> Array:
        """Return sums over the pieces of each pair, shape (f, ...)."""
        if len(self.first) == len(values):
            return values
        return np.asarray(np.add.reduceat(values, self.first, axis=0), dtype=np.float64)


def summed(shape: tuple[int, int], values: Array, rows: Ints, columns: Ints) -> sp.csr_array:
    """Return the sparse matrix that sums ``values`` at ``rows`` and ``columns``; all three are
    broadcast.
    """
    narrow = (entry.astype(np.int32) for entry in (rows, columns))
    flat = [entry.ravel() for entry in np.broadcast_arrays(values, *narrow)]
    return sp.csr_array((flat[0], (flat[1], flat[2])), shape=shape)


def in_rows(values: Array, columns: Ints, width: int) -> sp.csr_array:
    """Return a sparse matrix with i rows for each of p pieces.

    Args:
        values: the entries, shape (p, i, c).
        columns: their columns, the same for all rows of a piece, shape (p, c).
        width: number of columns of the matrix.
    """
    count, rows, entries = values.shape
    indices = np.repeat(columns, rows, axis=0)
    ends = np.arange(0, values.size + 1, entries)
    return sp.csr_array((values.ravel(), indices.ravel(), ends), shape=(count * rows, width))


def components(nodes: Ints, dimension: int) -> Ints:
    """Return the numbers of the components of vectors at nodes: (..., k) nodes give shape (..., d
    k).
    """
    return (dimension * nodes[..., None] + np.arange(dimension)).reshape(
        *nodes.shape[:-1], dimension * nodes.shape[-1]
    )


def in_blocks(matrix: sp.csr_array, count: int) -> sp.bsr_array:
    """Return a matrix that acts on values at nodes as one that acts on each of ``count`` components
    of vectors at nodes.
    """
    shape = (count * matrix.shape[0], count * matrix.shape[1])
    return sp.bsr_array(
        (matrix.data[:, None, None] * np.eye(count), matrix.indices, matrix.indptr), shape=shape
    )


def means_along(vectors: Array, matrix: sp.csr_array) -> sp.csr_array:
    """Return the map from vectors at m nodes to the components, along ``vectors`` of shape (n, d),
    of their means by ``matrix``; sparse, shape (n, d m).
    """
    dim = vectors.shape[1]
    values = matrix.data[:, None] * np.repeat(vectors, np.diff(matrix.indptr), axis=0)
    shape = (matrix.shape[0], dim * matrix.shape[1])
    return sp.csr_array(
        (values.ravel(), components(matrix.indices, dim), dim * matrix.indptr), shape=shape
    )


def along_vectors(vectors: Array, blocks: sp.bsr_array) -> sp.csr_array:
    """Return the map from vectors at m nodes to the components, along k vectors at each point, of
    what ``blocks`` makes of them; sparse, shape (n k, d m).

    Args:
        vectors: k vectors at each point, one per column, shape (n, d, k).
        blocks: map to vectors at the points, shape (n d, d m).
    """
    row = np.repeat(np.arange(len(vectors)), np.diff(blocks.indptr))
    values = vectors.swapaxes(1, 2)[row] @ blocks.data
    shape = (vectors.shape[0] * vectors.shape[2], blocks.shape[1])
    rows = sp.bsr_array((values, blocks.indices, blocks.indptr), shape=shape).tocsr()
    rows.eliminate_zeros()
    return rows


def without_round_off(matrix: sp.csr_array) -> sp.csr_array:
    """Return the matrix without entries that are zero up to round-off; entries are
    dimensionless.
    """
    matrix.data[np.abs(matrix.data) < ZERO_COMPONENT] = 0.0
    matrix.eliminate_zeros()
    return matrix


def turning_of(
    arms: sp.csr_array, places: Sequence[Array], distances: Sequence[Array]
) -> sp.bsr_array:
    """Return the sum of omega_i(u) x d_i over the sides as a matrix, see ``Coupling``.

    ``arms``: a_il, shape (n, m); ``places``: positions of the nodes of each side; ``distances``:
    d_i
        for each side, shape (n, d).
    """
    arms.sort_indices()
    count, dim = distances[0].shape
    side = np.repeat(np.arange(len(places)), [len(x) for x in places])[arms.indices]
    row = len(places) * np.repeat(np.arange(count), np.diff(arms.indptr)) + side
    distance = np.stack(distances, axis=1).reshape(-1, dim)
    count = count * len(places)
    a = arms.data
    r = np.concatenate(places)[arms.indices]
    d = distance[row]
    total = np.bincount(row, a, minlength=count)[:, None]
    # The second time without the round-off of coordinates far from the origin, which is a motion of
    # the middle.
    for _ in range(2):
        sums = np.stack([np.bincount(row, a * component, count) for component in r.T], axis=1)
        r = r - sums[row] / total[row]
    turns = _crossing(r)
    moments = a[:, None, None] * _crossing(r)
    inertia = np.zeros((count, *turns.shape[1:2] * 2))
    np.add.at(inertia, row, moments @ turns.swapaxes(1, 2))
    inverse = quotient(1.0, inertia)
    if dim == 3:
        inverse = np.asarray(
            np.linalg.pinv(inertia, rcond=SAME_NUMBER, hermitian=True), dtype=np.float64
        )
    blocks = _crossing(d).swapaxes(1, 2) @ inverse[row] @ moments
    blocks[np.abs(blocks) < ZERO_COMPONENT] = 0.0
    shape = (dim * arms.shape[0], dim * arms.shape[1])
    return sp.bsr_array((blocks, arms.indices, arms.indptr), shape=shape)


def turned_normals(*sides: PairSurface, turned_too: Array | None = None) -> sp.csr_array:
    """Return the derivative of ``nodal_normals`` with respect to the displacements of the nodes of
    the sides, sparse, shape (d m, d m).

    ``turned_too``: matrices that map the derivatives of the normals to those of other vectors,
    shape
        (m, d, d).
    """
    parts = []
    first = 0
    for side in sides:
        values = side.turning
        place, columns, counts = side.turning_places
        if turned_too is not None:
            values = turned_too[side.points][:, :, None] @ values
        sums = np.bincount(place, values.swapaxes(2, 3).ravel(), minlength=columns.size)
        parts.append((sums.astype(np.float64), first + columns, counts))
        first += side.x.size
    entries, columns, counts = (np.concatenate(part) for part in zip(*parts, strict=True))
    return sp.csr_array((entries, columns, np.append(0, counts.cumsum())), shape=(first, first))


def across(along: Array) -> Array:
    """Return normals, shape (..., d), from d - 1 tangents, shape (d - 1, ..., d): the cross
    product, in 2D the tangent turned clockwise.
    """
    return (
        np.cross(*along)
        if len(along) == 2
        else np.stack((along[0, ..., 1], -along[0, ..., 0]), axis=-1)
    )


def _crossing(vectors: Array) -> Array:
    """Return the matrices of the cross product v x ., shape (n, 3, 3), in 2D (n, 1, 2)."""
    if vectors.shape[1] == 2:
        return np.stack((-vectors[:, 1], vectors[:, 0]), axis=1)[:, None]
    matrices = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    matrices[:, 0, 1] = -z
    matrices[:, 0, 2] = y
    matrices[:, 1, 2] = -x
    return matrices - matrices.transpose(0, 2, 1)
