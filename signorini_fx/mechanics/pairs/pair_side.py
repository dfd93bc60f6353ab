"""One side of a pair: facets with Lagrange functions, their positions, directions and nodal
integrals; the overlap of
both: triples of a slave point, the master point over it, and an area; and sparse maps of vectors at
nodes, such as the rotation of normals.

A facet has k nodes at reference places in [0, 1] (d = 2), in the triangle with the vertices (0, 0),
(1, 0), (0, 1), or in [0, 1]^2, in any order: what the functions are follows from the places.
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
        """Return the monomials at points of shape (..., d - 1), or their derivatives along one
        direction, shape (..., k).
        """
        factors = []
        for axis, power in enumerate(self._exponents):
            s = at[..., axis, None]
            ones = np.ones_like(s)
            powers = (0.0 * s, ones, 2.0 * s) if axis == along else (ones, s, s * s)
            factors.append(np.concatenate([powers[k] for k in power], axis=-1))
        return factors[0] if len(factors) == 1 else factors[0] * factors[1]

    def values(self, at: Array) -> Array:
        """Return the values at points of shape (..., d - 1), shape (..., k)."""
        return self._monomials(at) @ self._coefficients

    def slopes(self, at: Array) -> Array:
        """Return the derivatives along the d - 1 directions, shape (d - 1, ..., k)."""
        return np.array(
            [self._monomials(at, axis) @ self._coefficients for axis in range(self.places.shape[1])]
        )

    def polynomials(self, values: Array) -> Array:
        """Return the factors of the powers of the place, ascending, of the polynomials that
        interpolate nodal values in an interval, shape (..., k, d) as theirs.
        """
        return self._coefficients @ values

    @property
    def curvatures(self) -> Array:
        """Return the second derivatives in an interval, where they are the same everywhere, shape
        (k,).
        """
        coefficients = self._coefficients
        return 2.0 * coefficients[2] if self.degree == 2 else np.zeros(len(coefficients))

    def rule(self, degree: int) -> tuple[Array, Array]:
        """Points, shape (q, d - 1), and weights of a quadrature on the reference facet."""
        kind = basix.CellType.interval
        if self.places.shape[1] == 2:
            kind = basix.CellType.triangle if self.simplex else basix.CellType.quadrilateral
        return _quadrature(kind, degree)

    @cached_property
    def tests(self) -> Lagrange:
        """The functions that the test functions are dual to: on quadratic triangles the hats of the
        vertices, which come first; else the functions themselves.
        """
        return Lagrange(self.places[:3]) if self.places.shape == (6, 2) else self

    @cached_property
    def tested_slopes(self) -> tuple[Array, Array]:
        """Return the data of integrals of test functions times normals: values with weights, and
        slopes, at the points of a rule, shapes (q, t) and (d - 1, q, k).
        """
        points, weights = self.rule(2 * self.degree + 2)
        return self.tests.values(points) * weights[:, None], self.slopes(points)

    @cached_property
    def linear(self) -> Lagrange:
        """Return the functions of the corners."""
        return Lagrange(self.corners)

    @cached_property
    def vertices(self) -> list[int]:
        """Numbers of the nodes at the corners, in order around the facet."""
        return [int(np.abs(self.places - corner).sum(axis=1).argmin()) for corner in self.corners]

    @cached_property
    def parts(self) -> Array:
        """Corners of the linear parts of the reference facet, in order around each, shape (parts,
        corners, d - 1).
        """
        if self.degree == 1 or self.places.shape[1] == 1:
            return self.corners[None]
        corners = [self.corners / 2 + shift for shift in self.corners / 2]
        return np.array([*corners, (1.0 - self.corners) / 2] if self.simplex else corners)

    @cached_property
    def corners(self) -> Array:
        """Return the corners of the reference facet, in order around it, shape (corners, d - 1)."""
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
        functions: of each facet.
        sign: +1 where the outward normal is (dx/ds x dx/dt), in 2D dx/ds turned clockwise; else -1,
            shape (f,).
        across: projectors onto the directions across planes of symmetry at all nodes, shape (N, d,
            d).
        held: nodes that supports hold along their normals, shape (N,).
        unable: nodes that cannot carry a point, because another contact owns them, shape (N,).
        measure: by what areas are multiplied, at all nodes, between which it is interpolated, shape
            (N,); None: 1.
        undeformed: of which areas are, where ``x`` are positions of a deformed body; None: the
            same.
        wall: how far behind each facet the back of its body is a part of the surface, length, inf:
            nowhere, shape (f,); None: nowhere behind any.
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
        """Return a side that nothing holds."""
        none = np.zeros(len(x), dtype=bool)
        return cls(nodes, x, functions, sign, np.zeros((*x.shape, x.shape[1])), none, none, measure)

    def displaced(self, displacement: Array) -> PairSurface:
        """Return the surface with displaced nodes and the areas of the undeformed surface.

        Args:
            displacement: shape (N, d).
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
        """D."""
        return int(self.x.shape[1])

    @cached_property
    def corners(self) -> Array:
        """Positions of the nodes of each facet, shape (f, k, d)."""
        return self.x[self.nodes]

    @property
    def points(self) -> Ints:
        """Numbers of the nodes of each facet that test functions belong to, shape (f, t)."""
        return self.nodes[:, : len(self.functions.tests.places)]

    def normals(self, facets: Ints, at: Array) -> Array:
        """Outward normals times the area (in 2D: length) of a unit of the reference facet at points
        of some facets, shape (m, q, d - 1), or the same of all, (1, q, d - 1): shape (m, q, d).
        """
        return self._crossed(facets, at) * self.sign[facets][:, None, None]

    def sizes(self, facets: Ints, at: Array) -> Array:
        """Undeformed area (in 2D: length) of a unit of the reference facet times the measure, shape
        (m, q), see ``normals``.
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
        """Normals up to their signs."""
        return across(self.functions.slopes(at) @ self.corners[facets])

    def positions(self, facets: Ints, at: Array) -> Array:
        """Return positions of points of each facet, length, shapes as in ``normals``."""
        return self.functions.values(at) @ self.corners[facets]

    @cached_property
    def _areas(self) -> tuple[Array, Array]:
        """Integrals of test functions, and of 1 over each facet: (N,), (f,)."""
        if self.undeformed is not None:
            return self.undeformed._areas
        points, weights = self.functions.rule(_DEGREE)
        sizes = self.sizes(np.arange(len(self.nodes)), points[None]) * weights
        area = np.zeros(len(self.x))
        np.add.at(area, self.points, sizes @ self.functions.tests.values(points))
        return area, sizes.sum(axis=1)

    @property
    def area(self) -> Array:
        """The area (in 2D: length) of each node, the integral of its test function times the
        measure, shape
        (N,).
        """
        return self._areas[0]

    @property
    def without_area(self) -> Flags:
        """Nodes whose test functions have none because of the measure, shape (N,).

        Of a quadratic node on an axis of revolution the function is zero, but for the curvature of
        its facet.
        """
        if self.measure is None:
            return np.zeros(len(self.x), dtype=bool)
        least = SAME_NUMBER * self.measure.max() if self.functions.degree > 1 else -np.inf
        return (self.measure <= least) | (self.area <= SAME_NUMBER * self.area.max())

    @cached_property
    def nodal_normals(self) -> Array:
        """Outward unit normals at the nodes with test functions, means of those around them, with
        their mirror images where a plane of symmetry cuts the surface, shape (N, d); zero
        elsewhere.
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
        """Return vectors at some nodes, shape (m, d), without what they have across planes of
        symmetry, and of length one; zero where they are.
        """
        vectors = vectors - (self.across[nodes] @ vectors[..., None])[..., 0]
        size = np.linalg.norm(vectors, axis=1, keepdims=True)
        return quotient(vectors, size)

    @cached_property
    def turning(self) -> Array:
        """Return the derivatives of ``nodal_normals`` by displacements of the nodes of each facet,
        shape (f, t, k, d, d).
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
        """Return the pattern of the sparse matrix that sums ``turning``, shape (d N, d N): the
        entry to which each value is added, the columns of the entries, and their number in each
        row.
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
        """``nodal_normals``, and between the vertices of quadratic triangles the means of those at
        both, of length one; zero at nodes of no facet, shape (N, d).
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
        """Which facets have a node in common, sparse, ones, shape (f, f)."""
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
        """Which facets have neighbours in common, sparse, shape (f, f)."""
        if self.undeformed is not None:
            return self.undeformed.around_neighbours
        return sp.csr_array(self.neighbours @ self.neighbours)

    @cached_property
    def focus(self) -> Array:
        """Return how strongly the surface is concave at each facet: one over the distance at which
        its normals meet those of its neighbours, at most, zero where they part, shape (f,).
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
        """The area of the facets around a node that are around another one, too, sparse, shape (N,
        N).
        """
        if self.undeformed is not None:
            return self.undeformed.around
        areas = self.facet_areas[:, None, None]
        shape = (len(self.x), len(self.x))
        return summed(shape, areas, self.nodes[:, :, None], self.nodes[:, None])


@dataclass(frozen=True)
class Sharing:
    """How ranks share a pair: each has the pieces of the overlap on an equal part of the facets of
    the slave, whichever rank has their cells, and the points at its own nodes.

    ``comm``: the ranks; ``owner``: the rank of each node of the slave, shape (N,), None: this one.
    """

    comm: MPI.Comm
    owner: Ints | None

    def part(self, count: int) -> Ints:
        """Return which of so many facets this rank pairs."""
        comm = self.comm
        return np.arange(count * comm.rank // comm.size, count * (comm.rank + 1) // comm.size)

    def own(self, nodes: Ints) -> Ints:
        """Return which of the points at some nodes are of this rank."""
        if self.owner is None:
            return np.arange(nodes.size)
        return np.flatnonzero(self.owner[nodes] == self.comm.rank)

    def rows(self, matrix: sp.csr_array, nodes: Ints) -> sp.csr_array:
        """Return the sums over the ranks of the rows for points at some nodes, those of the points
        of this rank; collective.
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
        """Return the values of the points at some nodes, shape (n, k), on every rank, from those of
        its own; collective.
        """
        rows = np.zeros((nodes.size, values.shape[1]))
        rows[self.own(nodes)] = values
        return parallel.global_sum(self.comm, rows)


# Of a pair that no other rank knows of.
ALONE = Sharing(MPI.COMM_SELF, None)


@dataclass(frozen=True)
class Overlap:
    """Pieces of the overlap, p of them, each on one facet of either side, with q points each, by
    pairs of facets, f of them.

    Attributes:
        slave, master: numbers of the facets, shape (p,).
        at: the points in the reference facet of the slave, shape (p, q, d - 1).
        over: those in the reference facet of the master, shape (p, q, d - 1).
        weight: area (in 2D: length) of the slave side that a point stands for, times its measure,
            shape (p, q).
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
        """The first piece of each pair of facets, shape (f,)."""
        if not self.slave.size:
            return np.zeros(0, dtype=np.int64)
        others = (np.diff(self.slave) != 0) | (np.diff(self.master) != 0)
        return np.append(0, 1 + np.flatnonzero(others))

    @cached_property
    def pair(self) -> Ints:
        """The pair of each piece, shape (p,)."""
        count = self.first.size
        return np.repeat(np.arange(count), np.diff(np.append(self.first, self.slave.size)))

    def of_pairs(self, values: Array) -> Array:
        """Return sums over the pieces of each pair, shape (f, ...)."""
        if len(self.first) == len(values):
            return values
        return np.asarray(np.add.reduceat(values, self.first, axis=0), dtype=np.float64)


def summed(shape: tuple[int, int], values: Array, rows: Ints, columns: Ints) -> sp.csr_array:
    """Return a sparse matrix, the sum of values, of shapes that are broadcast."""
    narrow = (entry.astype(np.int32) for entry in (rows, columns))
    flat = [entry.ravel() for entry in np.broadcast_arrays(values, *narrow)]
    return sp.csr_array((flat[0], (flat[1], flat[2])), shape=shape)


def in_rows(values: Array, columns: Ints, width: int) -> sp.csr_array:
    """Return a sparse matrix with i rows for each of p pieces: values of shape (p, i, c), in
    columns that all rows of a piece have, shape (p, c).
    """
    count, rows, entries = values.shape
    indices = np.repeat(columns, rows, axis=0)
    ends = np.arange(0, values.size + 1, entries)
    return sp.csr_array((values.ravel(), indices.ravel(), ends), shape=(count * rows, width))


def components(nodes: Ints, dimension: int) -> Ints:
    """Return the numbers of the components of vectors at nodes, shape (..., k): shape (..., d
    k).
    """
    return (dimension * nodes[..., None] + np.arange(dimension)).reshape(
        *nodes.shape[:-1], dimension * nodes.shape[-1]
    )


def in_blocks(matrix: sp.csr_array, count: int) -> sp.bsr_array:
    """Return a matrix of nodes as one of vectors at them, which does the same to each of so many
    components.
    """
    shape = (count * matrix.shape[0], count * matrix.shape[1])
    return sp.bsr_array(
        (matrix.data[:, None, None] * np.eye(count), matrix.indices, matrix.indptr), shape=shape
    )


def means_along(vectors: Array, matrix: sp.csr_array) -> sp.csr_array:
    """Return the map from vectors at m nodes to the products of ``vectors``, shape (n, d), and the
    means that a matrix makes of them, sparse, shape (n, d m).
    """
    dim = vectors.shape[1]
    values = matrix.data[:, None] * np.repeat(vectors, np.diff(matrix.indptr), axis=0)
    shape = (matrix.shape[0], dim * matrix.shape[1])
    return sp.csr_array(
        (values.ravel(), components(matrix.indices, dim), dim * matrix.indptr), shape=shape
    )


def along_vectors(vectors: Array, blocks: sp.bsr_array) -> sp.csr_array:
    """Return the map from vectors at m nodes to the products of k ``vectors`` at each point, one
    per column, shape (n, d, k), and those that ``blocks``, shape (n d, d m), make of them: sparse,
    shape (n k, d m).
    """
    row = np.repeat(np.arange(len(vectors)), np.diff(blocks.indptr))
    values = vectors.swapaxes(1, 2)[row] @ blocks.data
    shape = (vectors.shape[0] * vectors.shape[2], blocks.shape[1])
    rows = sp.bsr_array((values, blocks.indices, blocks.indptr), shape=shape).tocsr()
    rows.eliminate_zeros()
    return rows


def without_round_off(matrix: sp.csr_array) -> sp.csr_array:
    """Return the matrix without the round-off of zeros; entries have no unit."""
    matrix.data[np.abs(matrix.data) < ZERO_COMPONENT] = 0.0
    matrix.eliminate_zeros()
    return matrix


def turning_of(
    arms: sp.csr_array, places: Sequence[Array], distances: Sequence[Array]
) -> sp.bsr_array:
    """Return the sum of omega_i(u) x d_i over sides as a matrix, see ``Coupling``.

    ``arms``: a_il, shape (n, m), ``places``: of the nodes of each side, ``distances``: its d_i,
        shape (n, d).
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
    """Return the derivative of ``nodal_normals`` by displacements of the nodes of sides, sparse,
    shape (d m, d m).

    ``turned_too``: maps these turns to those of other vectors, shape (m, d, d).
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
    """Return the normals of d - 1 tangents, shape (d - 1, ..., d), shape (..., d): in 2D a tangent
    turned clockwise.
    """
    return (
        np.cross(*along)
        if len(along) == 2
        else np.stack((along[0, ..., 1], -along[0, ..., 0]), axis=-1)
    )


def _crossing(vectors: Array) -> Array:
    """Return the matrices of v x ., shape (n, 3, 3), in 2D (n, 1, 2)."""
    if vectors.shape[1] == 2:
        return np.stack((-vectors[:, 1], vectors[:, 0]), axis=1)[:, None]
    matrices = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    matrices[:, 0, 1] = -z
    matrices[:, 0, 2] = y
    matrices[:, 1, 2] = -x
    return matrices - matrices.transpose(0, 2, 1)
