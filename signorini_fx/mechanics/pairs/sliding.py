"""The map of a pair whose bodies slide and turn: at the deformed sides, with what changes it.

A point i of the slave sees the master along directions N that are half-way between the normals of both sides,

    x_s + g N = x_m(xi),   gap_i = sum_q P_iq g_q,

where P_iq are the functions of the points times areas of the undeformed slave, over their sum w_i.  A displacement d
changes the distance g by

    dg = nu . (d_m - d_s - g dN) / (nu . N),   dxi = (d_s + g dN - d_m) . N^ / (x_m' . N^),

with nu the normal of the facet of the master, N^ the direction across N, and dN the turning of the normals of the
slave.  The rows dgap_i of the map are zero on every joint rigid motion, so that pressures on both sides, their
transpose, balance in forces and moments.  Points of quadrature, functions, and the angles between N and the normals
of the slave are held: what these change of the gap is of second order where sides touch.  The map of friction is that
of ``mortar_coupling``, with half of the rotations of both sides.  In space xi are two numbers, and all points of a
facet of the slave have one direction, see ``sliding_space``; here is what the plane has of its own, and what both have.

Slips are chords.  With the functions D, M of the beginning of a step, marked by 0,

    slip_i = T_i^T (D0 x_s - M0 x_m) - T0_i^T (D0 x0_s - M0 x0_m),

which no joint motion changes, and which goes over any number of facets.  In space the tangents T_i turn with the facets
of the slave around the node of the point, about the normal, too.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI

from signorini_fx.mechanics.pairs.dual_functions import EvenCarriers, HeldSides, dual_coefficients
from signorini_fx.mechanics.pairs.fixed_distances import FixedDistances
from signorini_fx.mechanics.pairs.mortar_coupling import Tested, projected, turning_of
from signorini_fx.mechanics.pairs.overlap_plane import PLACES_OF_RULE
from signorini_fx.mechanics.pairs.overlap_quadrature import Overlap
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.mechanics.pairs.sliding_space import SpacePieces, rotations_at_nodes, turned_normals
from signorini_fx.mechanics.pairs.sparse_scaling import beside, of_components, scaled_rows
from signorini_fx.tuned import NO_PART

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Frames:
    """Which nodes of both sides a point of the slave meets, and in which frame, n points.

    Attributes:
        slave: D, sparse, shape (n, nodes of the slave).
        master: M, sparse, shape (n, nodes of the master).
        tangents: T_i, orthonormal, one per column, shape (n, d, d - 1).
        way: T_i^T (D x_s - M x_m), length, shape (n, d - 1).
        partnered: whether the point sees the other side, shape (n,).
    """

    slave: sp.csr_array
    master: sp.csr_array
    tangents: Array
    way: Array
    partnered: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class SlidingCoupling:
    """The contact points of a pair of deformed sides, one for each of some nodes of the slave, n of them.

    A point that sees no partner has the displacement of its node, and no gap that counts.

    Attributes:
        slave, master: both sides as they are deformed.
        nodes: of the slave, shape (n,).
        weight: w_i, undeformed area, shape (n,).
        normal: n_i, from the slave to the master, of length one, shape (n, d).
        gap: length, shape (n,); infinite without a partner.
        frames: of the points.
        covered: share of the area of each node that sees the master, shape (n,).
        helpless: nodes that carry no point because both sides are held there, shape (h,).
        helpless_gap: of their functions, length, shape (h,).
        fixed: where supports fix the distance of both sides; None: nowhere that points see.
        fixed_shares: what distances there would add to the gaps, which do not count them, sparse, shape (n, k); None:
            nothing.
        normal_rows: - dgap_i, from displacements of the nodes of both sides, those of the slave first, sparse, shape
            (n, d m).
        tangent_rows: the relative displacement along T_i, a row for each tangent of a point, shape (n (d - 1), d m).
        centre: where forces act, length, shape (n, d).
        pieces: what the second derivatives of the gap are made of; None: no point has a partner.
    """

    slave: PairSurface
    master: PairSurface
    nodes: Indices
    weight: Array
    normal: Array
    gap: Array
    frames: Frames
    covered: Array
    helpless: Indices
    helpless_gap: Array
    fixed: FixedDistances | None
    fixed_shares: sp.csr_array | None
    normal_rows: sp.csr_array
    tangent_rows: sp.csr_array
    centre: Array
    pieces: _Pieces | _TurningPieces | None = field(repr=False)

    def fixed_part(self, allowance: Array) -> Array:
        """What values at the nodes of the slave, shape (N,), would add to those of the points where supports fix the
        distance, shape (n,).
        """
        if self.fixed is None:
            return np.zeros(self.nodes.size)
        return np.asarray(self.fixed_shares @ (self.fixed.slave @ allowance))

    def slip(self, begun: Frames) -> Array:
        """How far the points have slid since a step has begun, along T_i, length, shape (n, d - 1); of a point that had
        no partner then with the functions that it has now, see ``started``.
        """
        return _way(self.frames.tangents, begun.slave @ self.slave.x - begun.master @ self.master.x) - begun.way

    def started(self, begun: Frames, slave: Array, master: Array) -> Frames:
        """The frames at the beginning of a step, and for points that had no partner then, those of now there.

        Args:
            begun: as they were.
            slave: positions of the nodes of the slave at the beginning, shape (N, 2).
            master: those of the master.
        """
        if begun.partnered.all():
            sharing, opposite = begun.slave, begun.master
        else:
            old, new = begun.partnered.astype(np.float64), (~begun.partnered).astype(np.float64)
            sharing = scaled_rows(old, begun.slave) + scaled_rows(new, self.frames.slave)
            opposite = scaled_rows(old, begun.master) + scaled_rows(new, self.frames.master)
        met = begun.partnered[:, None]
        return Frames(
            sharing,
            opposite,
            np.where(met[..., None], begun.tangents, self.frames.tangents),
            np.where(met, begun.way, _way(self.frames.tangents, sharing @ slave - opposite @ master)),
            begun.partnered | self.frames.partnered,
        )

    def slides(self, displacement: Array) -> float:
        """How far a displacement of the nodes of both sides, shape (m, d), moves points along the other side, in facets
        of that.
        """
        along = (self.tangent_rows @ displacement.ravel()).reshape(self.nodes.size, -1)
        far = np.linalg.norm(along, axis=1)[self.frames.partnered].max(initial=0.0)
        ends = self.master.x[self.master.nodes]
        return float(far / np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))

    def stiffness(self, pressure: Array, shear: Array, *, near: bool) -> sp.csr_array:
        """What tractions add to the tangent as the frames of the points turn and their partners shift, force / length,
        symmetric, sparse, shape (d m, d m).

        The stiffness of pressures is the second derivative of the gaps.  Shears turn with the normals, which is made
        symmetric by its transpose: that acts along the normals alone, where sides in contact do not move.

        Args:
            pressure: lambda of the points, stress, shape (n,).
            shear: mu along T_i, shape (n, d - 1).
            near: whether points hardly slide any more: then the normals of the master turn at its vertices, where
                points see these, else evenly along its facets.
        """
        if self.pieces is None:
            return sp.csr_array(self.normal_rows.shape[1:] * 2)
        shearing = (self.weight[:, None] * shear).ravel()
        return self.pieces.stiffness(self.weight * pressure, shearing, self.normal_rows, near=near)


@dataclass(frozen=True)
class _Pieces:
    """Rows at the points of quadrature, all of displacements of the nodes of both sides, sparse, shape (q, 2 m).

    Attributes:
        shares: P, sparse, shape (n, q).
        along: nu . d(x_m') / (nu . N).
        shift: dxi.
        change: dg.
        turn: nu . dN / (nu . N).
        turning: of n_i, angles, sparse, shape (n, 2 m).
        vertices: the functions at the points of the slave that see vertices of the master, over the width of the
            facet, sparse, shape (n, v).
        passing: w of each of them, sparse, shape (v, 2 m), and k / J, see ``_vertices``, shape (v,).
        bending: what dxi turns of the normal of the master, evenly along its facets, times the length of x_m' along
            N^, shape (q,).
        curved: nu . x_m'' / (nu . N), of facets that are no straight lines, shape (q,).
    """

    shares: sp.csr_array
    along: sp.csr_array
    shift: sp.csr_array
    change: sp.csr_array
    turn: sp.csr_array
    turning: sp.csr_array
    vertices: sp.csr_array
    passing: tuple[sp.csr_array, Array]
    bending: Array
    curved: Array

    def stiffness(self, pressing: Array, shearing: Array, normal_rows: sp.csr_array, *, near: bool) -> sp.csr_array:
        """See ``SlidingCoupling.stiffness``, with forces at the points, shape (n,) each."""
        forces = self.shares.T @ pressing
        bends = self.along.T @ scaled_rows(forces, self.shift) - self.change.T @ scaled_rows(forces, self.turn)
        half = -bends
        if shearing.any():
            half = half - self.turning.T @ scaled_rows(shearing, normal_rows)
        passing, kinks = self.passing
        if near:
            corners = passing.T @ scaled_rows((self.vertices.T @ pressing) * kinks, passing)
            if self.curved.any():
                corners = corners - self.shift.T @ scaled_rows(forces * self.curved, self.shift)
        else:
            corners = self.shift.T @ scaled_rows(forces * self.bending, self.shift)
        return sp.csr_array(half + half.T + corners)


@dataclass(frozen=True)
class _TurningPieces:
    """Of a pair in space.

    Attributes:
        pieces: what pressures are made of.
        sides: slave and master.
        overlap: of both.
        points: D, M and T_i.
    """

    pieces: SpacePieces
    sides: tuple[PairSurface, PairSurface]
    overlap: Overlap
    points: tuple[sp.csr_array, sp.csr_array, Array]

    def stiffness(self, pressing: Array, shearing: Array, normal_rows: sp.csr_array, *, near: bool) -> sp.csr_array:
        """See ``SlidingCoupling.stiffness``, with forces at the points, shapes (n,) and (2 n,)."""
        pressed = self.pieces.stiffness(pressing, near=near)
        if not shearing.any():
            return pressed
        doubling = sp.kron(sp.eye_array(pressing.size), np.ones((2, 1)))
        turns = self._turning.T @ sp.diags_array(shearing) @ doubling @ normal_rows
        return sp.csr_array(pressed - turns - turns.T)

    @property
    def _turning(self) -> sp.csr_array:
        """What displacements of both sides turn n_i along T_i, sparse, shape (2 n, 3 m)."""
        (slave, master), (sharing, opposite, tangents) = self.sides, self.points
        size = np.linalg.norm(sharing @ slave.directions - opposite @ master.directions, axis=1)
        parts = [
            sp.kron(matrix, sp.eye_array(3)) @ turned_normals(side)
            for matrix, side in zip((sharing, -opposite), self.sides, strict=True)
        ]
        passing = self.pieces.passing(master.directions[master.nodes[self.overlap.master]])
        return sp.csr_array(along_vectors(tangents / size[:, None, None]) @ (sp.hstack(parts) - passing))


def slide(
    slave: PairSurface,
    master: PairSurface,
    points: Indices,
    unable: npt.NDArray[np.bool_],
    reach: float,
    held: HeldSides | None = None,
    fixed: FixedDistances | None = None,
) -> SlidingCoupling:
    """The map of two deformed sides, in space of degree 1.

    Args:
        slave: the side with the points, see ``PairSurface.displaced``.
        master: the other one.
        points: nodes of the slave that have a point, ascending, shape (n,).
        unable: nodes of the slave that cannot carry a point, shape (N,).
        reach: distance beyond which facets are no partners, length.
        held: nodes that supports hold; None: there are none.
        fixed: see ``fixed_by_supports``; None: no distances.

    Raises:
        PairingError: a facet sees two sheets of the master.
    """
    whole, directions = projected(slave, master, reach, apart=True)
    assert directions is not None
    tested = whole if held is None else whole.parted(slave, master, held, MPI.COMM_SELF)[0]
    weight, arms = tested.areas(slave, MPI.COMM_SELF), tested.arms(slave, master)
    sharing, opposite = tested.products(slave, master)
    helpless = np.zeros(len(slave.x), dtype=bool) if held is None else held.helpless(opposite)
    carriers = EvenCarriers.of(slave, tested.covered, weight, unable | helpless)
    nodes, shares = carriers.nodes, carriers.shares
    at = np.searchsorted(points, nodes)  # rows of points that have a partner
    partnered = np.zeros(points.size, dtype=bool)
    partnered[at] = True
    count, sizes, dim = points.size, (len(slave.x), len(master.x)), slave.dimension
    placing = sp.csr_array(sp.coo_array((np.ones(at.size), (at, np.arange(at.size))), shape=(count, at.size)))
    lonely = np.flatnonzero(~partnered)
    itself = sp.csr_array(sp.coo_array((np.ones(lonely.size), (lonely, points[lonely])), shape=(count, sizes[0])))

    weights = np.where(partnered, placing @ (shares @ weight), slave.area[points])
    covered = (placing @ (shares @ weight)) / slave.area[points]
    mean = sp.csr_array(placing @ scaled_rows(1.0 / (shares @ weight), shares))  # of moments of the functions
    fixed_shares = None if fixed is None else sp.csr_array(mean @ fixed.met)
    of_whole = weight, [sharing, opposite]
    if held is not None and whole is not tested:
        of_whole = whole.areas(slave, MPI.COMM_SELF), whole.products(slave, master)
        helpless = held.helpless(of_whole[1][1])
        helpless[nodes] = False
    lonely_gap = _gap_of_nodes(slave, master, of_whole, helpless)
    sharing, opposite = sp.csr_array(mean @ sharing + itself), sp.csr_array(mean @ opposite)
    normals, distance = _directed(slave, master, sharing, opposite), opposite @ master.x - sharing @ slave.x
    distance[lonely] = 0.0
    normals = slave.in_planes(normals, points)
    tangents = tangents_of_points(slave, points, normals)
    turnings = [
        of_components(placing, dim) @ turning_of(sp.csr_array(shares @ arm), side.x, 0.5 * distance[at])
        for arm, side in zip(arms, (slave, master), strict=True)
    ]
    translating = of_components(sharing, dim), of_components(-opposite, dim)
    relative = beside(*(moved + turned for moved, turned in zip(translating, turnings, strict=True)))
    normal_rows, tangent_rows = (along_vectors(vectors) @ relative for vectors in (normals[:, :, None], tangents))
    gap = np.full(count, np.inf)
    pieces: _Pieces | _TurningPieces | None = None
    if at.size:
        if dim == 2:
            pieces, distance_along = _pieces(slave, master, tested, directions, (mean, sharing, opposite, normals))
            gaps, change = pieces.shares @ distance_along, pieces.shares @ pieces.change
        else:
            in_space = SpacePieces.of(slave, master, tested, directions, mean)
            pieces = _TurningPieces(in_space, (slave, master), tested.overlap, (sharing, opposite, tangents))
            gaps, change = in_space.gap, in_space.rows
        if fixed is not None and fixed_shares is not None:
            gaps = gaps - fixed_shares @ fixed.distance(slave.x, master.x)
        gap[at] = gaps[at]
        normal_rows = scaled_rows((~partnered).astype(np.float64), normal_rows) - change
    way = _way(tangents, sharing @ slave.x - opposite @ master.x)
    frames = Frames(sharing, opposite, tangents, way, partnered)
    centre = sharing @ slave.x + distance / 2
    rows = sp.csr_array(normal_rows), sp.csr_array(tangent_rows)
    idle = np.flatnonzero(helpless), lonely_gap, fixed, fixed_shares
    return SlidingCoupling(slave, master, points, weights, normals, gap, frames, covered, *idle, *rows, centre, pieces)


def fixed_by_supports(slave: PairSurface, master: PairSurface, held: HeldSides, reach: float) -> FixedDistances | None:
    """The distances that supports fix where both sides are; None: there are none.

    Raises:
        PairingError: see ``slide``.
    """
    if not (held.slave.any() and held.master.any()):
        return None
    both_sides, directions = projected(slave, master, reach, apart=True)
    tested, _ = both_sides.parted(slave, master, held, MPI.COMM_SELF)
    overlaps = both_sides.overlap, tested.overlap
    return FixedDistances.of((slave, master), held, overlaps, tested.weighted, directions)


def _gap_of_nodes(
    slave: PairSurface,
    master: PairSurface,
    integrals: tuple[Array, list[sp.csr_array]],
    chosen: npt.NDArray[np.bool_],
) -> Array:
    """The distance of both sides along their mean normal, averaged by the functions of some nodes, length, shape (m,).

    Args:
        slave: the side with the nodes.
        master: the other one.
        integrals: of the functions of the nodes, and of these times those of both sides, over all that both have over
            each other, see ``Tested``.
        chosen: which nodes, shape (N,).
    """
    rows = np.flatnonzero(chosen)
    if not rows.size:
        return np.zeros(0)
    areas, products = integrals
    sharing, opposite = (scaled_rows(np.asarray(1.0 / areas[rows]), matrix[rows]) for matrix in products)
    normals = _directed(slave, master, sharing, opposite)
    return np.asarray(np.einsum("nd,nd->n", normals, opposite @ master.x - sharing @ slave.x))


def _directed(slave: PairSurface, master: PairSurface, sharing: sp.csr_array, opposite: sp.csr_array) -> Array:
    """Mean normals of both sides at the points, of length one, shape (n, d)."""
    normals = sharing @ slave.directions - opposite @ master.directions
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def along_vectors(vectors: Array) -> sp.csr_array:
    """The matrix that multiplies vectors at points with k others, one per column, shape (n, d, k): sparse, shape
    (n k, n d).
    """
    count, dim, columns = vectors.shape
    numbers = np.arange(count + 1)
    shape = (count * columns, count * dim)
    return sp.csr_array(sp.bsr_array((vectors.transpose(0, 2, 1), numbers[:-1], numbers), shape=shape))


def _way(tangents: Array, vectors: Array) -> Array:
    """The components of vectors, shape (n, d), along tangents, shape (n, d - 1)."""
    return np.asarray(np.einsum("ndk,nd->nk", tangents, vectors))


def tangents_of_points(slave: PairSurface, points: Indices, normals: Array) -> Array:
    """T_i of points at some nodes, shape (n, d, d - 1): in space they turn with the slave around the node."""
    if slave.dimension == 2:
        return np.stack((-normals[:, 1], normals[:, 0]), axis=1)[:, :, None]
    start = slave if slave.undeformed is None else slave.displaced(np.zeros_like(slave.x))
    outward = start.nodal_normals[points]
    least = np.eye(3)[np.abs(outward).argmin(axis=1)]
    first = np.cross(outward, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    rotation = rotations_at_nodes(slave, points)
    outward, first = (np.einsum("nij,nj->ni", rotation, vectors) for vectors in (outward, first))
    # The least rotation that takes the normal to that of the point.
    bisector, along = outward + normals, np.einsum("ni,ni->n", normals, first)
    first = first - (along / (1.0 + np.einsum("ni,ni->n", outward, normals)))[:, None] * bisector
    return np.stack((first, np.cross(normals, first)), axis=2)


def _turned(side: PairSurface) -> sp.csr_array:
    """The angles by which displacements of the nodes of a side turn its normals at the nodes, sparse, shape (N, 2 N).

    The normal of a node is along the integral of that of its facets times its function.  Those in planes of symmetry do
    not turn.
    """
    normals = side.nodal_normals
    at, weights = side.functions.rule(2 * side.functions.degree)
    functions = side.functions.values(at) * weights[:, None]
    products = functions.T @ side.functions.slopes(at)[0]
    facets, moments = np.arange(len(side.nodes)), np.zeros_like(normals)
    facing = side.normals(facets, np.broadcast_to(at, (len(facets), *at.shape)))
    np.add.at(moments, side.nodes, np.einsum("qk,fqd->fkd", functions, facing))
    size = np.linalg.norm(moments, axis=1)
    held = np.zeros(len(size), dtype=bool) if side.across is None else side.across.any(axis=(1, 2))
    factor = np.divide(-1.0, size, out=np.zeros_like(size), where=(size > 0) & ~held)[side.nodes] * side.sign[:, None]
    values = (factor[:, :, None] * products)[..., None] * normals[side.nodes][:, :, None]
    return _rows(side.nodes[:, :, None], side.nodes[:, None], values, (len(side.x), len(side.x)))


def _rows(rows: Indices, nodes: Indices, values: Array, shape: tuple[int, int]) -> sp.csr_array:
    """A matrix of displacements of nodes; values of shape (..., 2), with the rows and nodes that they belong to.

    Args:
        rows: broadcast to shape (...).
        nodes: likewise.
        values: the two components.
        shape: how many rows and nodes there are.
    """
    rows = np.broadcast_to(rows[..., None], values.shape)
    columns = np.broadcast_to(2 * nodes[..., None] + np.arange(2), values.shape)
    entries = values.ravel(), (rows.ravel(), columns.ravel())
    return sp.csr_array(sp.coo_array(entries, shape=(shape[0], 2 * shape[1])))


def _pieces(
    slave: PairSurface,
    master: PairSurface,
    tested: Tested,
    directions: Array,
    points: tuple[sp.csr_array, sp.csr_array, sp.csr_array, Array],
) -> tuple[_Pieces, Array]:
    """The rows at the points of quadrature, and the distances of both sides there, length, shape (q,).

    Args:
        slave: the side with the points.
        master: the other one.
        tested: their overlap.
        directions: of projection at the nodes of the slave, of length one, shape (N, 2).
        points: from moments of the functions of the nodes of the slave to means at the points, D, M and n.
    """
    overlap, (mean, sharing, opposite, normals) = tested.overlap, points
    count, per_piece = overlap.weight.shape
    size = count * per_piece
    row = np.arange(size)

    def flat(values: Indices) -> Indices:
        return np.repeat(values, per_piece, axis=0)

    seen, over = flat(slave.nodes[overlap.slave]), flat(master.nodes[overlap.master])
    shape = slave.functions.values(overlap.at).reshape(size, -1)
    shape_over = master.functions.values(overlap.over).reshape(size, -1)
    slope_over = master.functions.slopes(overlap.over)[0].reshape(size, -1)
    ways = np.einsum("qk,qkd->qd", shape, directions[seen])
    length = np.linalg.norm(ways, axis=1, keepdims=True)
    ways = ways / length
    across = np.column_stack((-ways[:, 1], ways[:, 0]))
    facet = np.einsum("qk,qkd->qd", slope_over, master.x[over])
    facing = np.column_stack((-facet[:, 1], facet[:, 0])) / np.linalg.norm(facet, axis=1, keepdims=True)
    cosine = np.einsum("qd,qd->q", facing, ways)[:, None]  # of either sign, which cancels
    distance = np.einsum("qd,qd->q", overlap.distance(slave, master).reshape(size, 2), ways)

    total = len(slave.x) + len(master.x)
    at_slave, at_master = seen, len(slave.x) + over
    turned = [_columns(_turned(side), first, total) for side, first in ((slave, 0), (master, len(slave.x)))]
    shares_of_turn = shape * np.einsum("qkd,qd->qk", directions[seen], ways) / length
    turn = _nodal(row, seen, shares_of_turn, (size, len(slave.x))) @ turned[0]  # of N, an angle

    of_both, signed = np.hstack((at_master, at_slave)), np.hstack((shape_over, -shape))

    def difference(vectors: Array) -> sp.csr_array:
        """The product of d_m - d_s with vectors at the points of quadrature."""
        return _rows(row[:, None], of_both, signed[:, :, None] * vectors[:, None], (size, total))

    inclined = np.einsum("qd,qd->q", facing, across) / cosine[:, 0]
    change = difference(facing / cosine) - scaled_rows(distance * inclined, turn)
    stretched = np.einsum("qd,qd->q", facet, across)
    shift = scaled_rows(1.0 / stretched, scaled_rows(distance, turn) - difference(across))
    along_facet = _rows(row[:, None], at_master, slope_over[:, :, None] * (facing / cosine)[:, None], (size, total))
    weighted = tested.weighted.reshape(size, -1)
    functions = _nodal(flat(slave.points[overlap.slave]), row[:, None], weighted, (len(slave.x), size))
    shares = sp.csr_array(mean @ functions)

    # The turning of n_i, with the normals of the master at the points that shift.
    tangents = np.column_stack((-normals[:, 1], normals[:, 0]))
    means = sharing @ slave.directions - opposite @ master.directions
    inverse = 1.0 / np.linalg.norm(means, axis=1)
    parts = []
    for side, matrix, angles, sign in ((slave, sharing, turned[0], 1.0), (master, opposite, turned[1], -1.0)):
        entries = matrix.tocoo()
        normal = side.directions[entries.col]
        crossed = np.column_stack((-normal[:, 1], normal[:, 0]))
        values = sign * entries.data * inverse[entries.row] * np.einsum("kd,kd->k", tangents[entries.row], crossed)
        parts.append(sp.csr_array(sp.coo_array((values, (entries.row, entries.col)), shape=matrix.shape)) @ angles)
    bend = np.einsum("qk,qkd->qd", slope_over, master.directions[over])
    along_n, along_t = (np.einsum("qkd,qd->qk", master.directions[over], w) for w in (ways, across))
    bending = np.einsum("qk,qk->q", slope_over, along_t / along_n) * stretched
    for axis in range(2):
        parts.append(scaled_rows(-tangents[:, axis] * inverse, shares) @ scaled_rows(bend[:, axis], shift))
    turning = sp.csr_array(sum(parts[1:], parts[0]))
    rows = along_facet, shift, sp.csr_array(change), scaled_rows(inclined, turn), turning
    corners = _vertices((slave, master), overlap, directions, mean, turned[0])
    second = master.x[over] * master.functions.curvatures[:, None]
    curved = np.einsum("qkd,qd->q", second, facing / cosine)
    return _Pieces(shares, *rows, *corners, bending, curved), distance


def _vertices(
    sides: tuple[PairSurface, PairSurface],
    overlap: Overlap,
    directions: Array,
    mean: sp.csr_array,
    turned: sp.csr_array,
) -> tuple[sp.csr_array, tuple[sp.csr_array, Array]]:
    """Where points of the slave see vertices of the master, at which its normal turns, see ``_Pieces``.

    There the derivative of the distance jumps by k w, with w = (d_v - d_s - g dN) . N^, and the place moves by
    w / J along the slave.

    Args:
        sides: slave and master.
        overlap: of both.
        directions: see ``_pieces``.
        mean: from moments of the functions of the nodes of the slave to means at the points.
        turned: angles of the normals of the slave at its nodes.
    """
    slave, master = sides
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
    count, total = below.size, len(slave.x) + len(master.x)
    facets, s = facet[below], ends[below]
    shape, slope = slave.functions.values(s[:, None]), slave.functions.slopes(s[:, None])[0]
    nodes, vertices = slave.nodes[facets], vertex[below]
    ways, turns = (np.einsum("vk,vkd->vd", values, directions[nodes]) for values in (shape, slope))
    length = np.linalg.norm(ways, axis=1, keepdims=True)
    ways = ways / length
    across = np.column_stack((-ways[:, 1], ways[:, 0]))
    distance = np.einsum("vd,vd->v", master.x[vertices] - np.einsum("vk,vkd->vd", shape, slave.x[nodes]), ways)

    def inclination(rows: Indices) -> Array:
        """The normal of a facet at its vertex along N^ over that along N."""
        numbers, end = overlap.master[piece[rows]], np.where(first[rows], 0.0, 1.0)
        normal = master.normals(numbers, end[:, None, None])[:, 0]
        return np.asarray(np.einsum("vd,vd->v", normal, across) / np.einsum("vd,vd->v", normal, ways))

    kink = inclination(above) - inclination(below)
    stretch = np.einsum("vk,vkd->vd", slope, slave.x[nodes]) + distance[:, None] * turns / length
    rate = kink / np.einsum("vd,vd->v", stretch, across)
    row = np.arange(count)
    turn = _nodal(row, nodes, shape * np.einsum("vkd,vd->vk", directions[nodes], ways) / length, (count, len(slave.x)))
    of_both, signed = np.column_stack((len(slave.x) + vertices, nodes)), np.column_stack((np.ones(count), -shape))
    passing = _rows(row[:, None], of_both, signed[:, :, None] * across[:, None], (count, total))
    passing = passing - scaled_rows(distance, turn @ turned)
    coefficients = dual_coefficients(slave, overlap)[facets]
    functions = np.einsum("vij,vj->vi", coefficients, slave.tests.values(s[:, None]))
    at_vertices = s[:, None, None]
    functions *= slave.measured(facets, at_vertices, slave.sizes(facets, at_vertices))
    at_nodes = _nodal(slave.points[facets], row[:, None], functions, (len(slave.x), count))
    return sp.csr_array(mean @ at_nodes), (sp.csr_array(passing), rate)


def _nodal(rows: Indices, columns: Indices, values: Array, shape: tuple[int, int]) -> sp.csr_array:
    """A matrix of values, shape (m, k), with the rows and columns that they belong to."""
    pairs = (numbers if numbers.ndim == 2 else numbers[:, None] for numbers in (rows, columns))
    at = tuple(np.broadcast_to(numbers, values.shape).ravel() for numbers in pairs)
    return sp.csr_array(sp.coo_array((values.ravel(), at), shape=shape))


def _columns(matrix: sp.csr_array, first: int, total: int) -> sp.csr_array:
    """A matrix of displacements of one side as one of both; ``first``: where its nodes begin among all."""
    entries = matrix.tocoo()
    shape = (matrix.shape[0], 2 * total)
    return sp.csr_array(sp.coo_array((entries.data, (entries.row, entries.col + 2 * first)), shape=shape))
