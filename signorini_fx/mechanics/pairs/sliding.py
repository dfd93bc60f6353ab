"""The map of a pair whose bodies slide and turn: at the deformed sides, with what changes it.

A point i of the slave sees the master at distances g along directions N half-way between the
normals of both sides,

    x_s + g N = x_m(xi),   gap_i = sum_q P_iq g_q,

where P_iq are the functions of the points times areas of the undeformed slave, over their sum w_i.
The rows dgap_i of the map, see ``sliding_pieces``, are zero on every joint rigid motion, so that
pressures on both sides, their transpose, balance in forces and moments.  Points of quadrature,
functions, and the angles between N and the normals of the slave are held: what these change of the
gap is of second order where sides touch.  The map of friction is that of ``mortar_coupling``, with
half of the rotations of both sides.

Slips are chords.  With the functions D, M of the beginning of a step, marked by 0,

    slip_i = T_i^T (D0 x_s - M0 x_m) - T0_i^T (D0 x0_s - M0 x0_m),

which no joint motion changes, and which goes over any number of facets.  In 3D the tangents T_i
turn with the facets of the slave around the node of the point, about the normal, too.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from signorini_fx.arrays import Array, Flags, Ints, inner, matvec, quotient, rmatvec
from signorini_fx.machine import parallel
from signorini_fx.mechanics.pairs.dual_functions import carried_evenly
from signorini_fx.mechanics.pairs.mortar_coupling import coupled, projected
from signorini_fx.mechanics.pairs.overlap import axes_across
from signorini_fx.mechanics.pairs.pair_side import (
    ALONE,
    PairSurface,
    Sharing,
    along_vectors,
    in_blocks,
    means_along,
    turned_normals,
)
from signorini_fx.mechanics.pairs.sliding_pieces import SlidingPieces, rotations_at_nodes


@dataclass(frozen=True)
class Frames:
    """Which nodes of both sides a point of the slave meets, and in which frame, n points.

    Attributes:
        both: D and - M, nodes of the slave first, sparse, shape (n, m).
        tangents: T_i, orthonormal, one per column, shape (n, d, d - 1).
        partnered: whether the point sees the other side, shape (n,).
    """

    both: sp.csr_array
    tangents: Array
    partnered: Flags


@dataclass(frozen=True)
class SlidingCoupling:
    """The contact points of a pair of deformed sides, one for each of some nodes of the slave, n of
    them.

    They are those of this rank.  A point that sees no partner has the displacement of its node, and
    the reach for a gap.

    Attributes:
        slave, master: both sides as they are deformed.
        nodes: of the slave, shape (n,).
        seen: whether any point of any rank sees the other side.
        weight: w_i, undeformed area, shape (n,).
        normal: n_i, from the slave to the master, of length one, shape (n, d).
        gap: length, shape (n,).
        frames: of the points.
        normal_rows: - dgap_i, from displacements of the nodes of both sides, those of the slave
            first, sparse, shape (n, d m).
        tangent_rows: the relative displacement along T_i, a row for each tangent of a point, shape
            (n (d - 1), d m).
        centre: where forces act, length, shape (n, d).
        covered: undeformed area of the slave where both sides see each other and one can move.
        pieces: what the second derivatives of the gap are made of.
    """

    slave: PairSurface
    master: PairSurface
    nodes: Ints
    seen: bool
    weight: Array
    normal: Array
    gap: Array
    frames: Frames
    normal_rows: sp.csr_array
    tangent_rows: sp.csr_array
    centre: Array
    covered: float
    pieces: SlidingPieces = field(repr=False)

    def slip(self, begun: SlidingCoupling) -> Array:
        """Return the slip of the points along T_i since a step has begun with another map, length,
        shape (n, d - 1): of points that had no partner then with the nodes that they meet now.
        """
        tangents = self.frames.tangents
        ways = []
        for frames, old in ((begun.frames, begun.frames.tangents), (self.frames, tangents)):
            then, now = (
                frames.both @ np.concatenate((at.slave.x, at.master.x)) for at in (begun, self)
            )
            ways.append(rmatvec(tangents, now) - rmatvec(old, then))
        return np.where(begun.frames.partnered[:, None], ways[0], ways[1])

    def stiffness(self, pressure: Array, shear: Array, *, symmetric: bool) -> sp.csr_array:
        """Return the stiffness that tractions add to the tangent as the frames of the points turn
        and their partners shift, force / length, sparse, shape (d m, d m), which is the sum over
        the ranks; collective.

        The stiffness of pressures is the second derivative of the gaps.  Shears turn with the
        normals, which is made symmetric by its transpose: that acts along the normals alone, where
        sides in contact do not move.

        The shift of partners takes shears on from node to node of the master: its derivative is not
        symmetric, and is left out of what is ``symmetric``.  ``pressure``: lambda, stress, shape
        (n,); ``shear``: mu along T_i, stress, shape (n, d - 1).
        """
        shears = np.einsum("n,ndk,nk->nd", self.weight, self.frames.tangents, shear)
        forces = np.column_stack((self.weight * pressure, 0.0 * shears if symmetric else shears))
        stiffness = self.pieces.stiffness(forces)
        if parallel.any_rank(self.pieces.tested.sharing.comm, shear):
            turns = self._turning(shears).T.tocsr() @ self.normal_rows
            stiffness = stiffness - turns - turns.T
        return sp.csr_array(stiffness)

    def _turning(self, along: Array) -> sp.csr_array:
        """Return the derivative of n_i along vectors, shape (n, d), by displacements of both sides,
        sparse, shape (n, d m).
        """
        sums = self.frames.both @ np.concatenate((self.slave.directions, self.master.directions))
        size = np.linalg.norm(sums, axis=1)[:, None]
        along = quotient(along, size)
        turns = means_along(along, self.frames.both) @ turned_normals(self.slave, self.master)
        return turns - self.pieces.passing(along)


def slide(
    slave: PairSurface,
    master: PairSurface,
    points: Ints,
    reach: float,
    whole: PairSurface | None = None,
    sharing: Sharing = ALONE,
) -> SlidingCoupling:
    """Return the map of two deformed sides, see ``PairSurface.displaced``, in 3D of degree 1; None:
    the slave; a PairingError: a facet sees two sheets of the master; collective.

    ``points``: nodes of the slave that have a point, ascending, shape (n,).
    ``reach``: distance beyond which facets are no partners, length.
    ``whole``: the surface of which the slave is a part, which points that see no partner belong to.
    ``sharing``: between the ranks.
    """
    tested, directions = projected(slave, master, reach, sharing, apart=True)
    assert directions is not None
    tested = tested.moving
    whole = slave if whole is None else whole
    nodes, shares = carried_evenly(slave, tested.covered, tested.areas, tested.movable)
    partnered = np.isin(points, nodes)
    dim = slave.dimension
    entries = np.zeros(points.size + 1, dtype=np.int64)
    entries[1:][partnered] = np.diff(shares.indptr)
    placed = shares.data, shares.indices, entries.cumsum()
    found = coupled(tested, points, sp.csr_array(placed, shape=(points.size, shares.shape[1])))
    pieces = SlidingPieces.of(tested, directions, points, found.mean)
    points = found.nodes
    seen = bool(partnered.any())
    partnered = partnered[found.here]
    normals = np.where(partnered[:, None], found.normal, whole.nodal_normals[points])
    both = found.both
    tangents = tangents_of_points(whole, points, normals)
    # Along T_i, with half of the rotations of both sides, see ``mortar_coupling``.
    tangent_rows = along_vectors(tangents, in_blocks(both, dim) + found.turning)
    # A point alone moves with its node.
    own = means_along(np.where(partnered[:, None], 0.0, normals), both)
    gap = np.where(partnered, pieces.gap, reach)
    weights = np.where(partnered, found.weight, whole.area[points])
    frames = Frames(both, tangents, partnered)
    rows = (own - pieces.rows, tangent_rows)
    at_points = (points, seen, weights, normals, gap, frames, *rows, found.centre)
    return SlidingCoupling(slave, master, *at_points, found.covered, pieces)


def tangents_of_points(slave: PairSurface, points: Ints, normals: Array) -> Array:
    """T_i of points at some nodes, shape (n, d, d - 1): in 3D they turn with the slave around the
    node; the first one of a point in a plane of symmetry, where neither half turns about the normal
    alone, stays across it.
    """
    if slave.dimension == 2:
        return np.stack((-normals[:, 1], normals[:, 0]), axis=1)[:, :, None]
    assert slave.undeformed is not None
    outward = slave.undeformed.nodal_normals[points]
    first = axes_across(outward)[:, 0]
    rotation = rotations_at_nodes(slave, points)
    outward, first = (matvec(rotation, vectors) for vectors in (outward, first))
    # The least rotation that takes the normal to that of the point.
    bisector = outward + normals
    along = inner(normals, first)
    first = first - (along / (1.0 + inner(outward, normals)))[:, None] * bisector
    on_plane = slave.across[points].any(axis=(1, 2))
    first[on_plane] = np.linalg.eigh(slave.across[points[on_plane]])[1][:, :, -1]
    return np.stack((first, np.cross(normals, first)), axis=2)
