"""The map of a pair whose bodies slide and rotate, evaluated at the deformed sides, and its
derivative.

A slave point i has distances g to the master along directions N half-way between the normals of
both sides,

    x_s + g N = x_m(xi),   gap_i = sum_q P_iq g_q,

where P_iq are the functions of the points times areas of the undeformed slave, divided by their sum
w_i.  The rows dgap_i of the map, see ``sliding_pieces``, vanish for every joint rigid motion, so
that pressures on both sides, their transpose, balance in forces and moments.  Quadrature points,
functions, and the angles between N and the normals of the slave are held constant: their effect on
the gap is of second order where sides touch.  The map of friction is that of ``mortar_coupling``,
with half of the rotations of both sides.

Slips are chords.  With the functions D, M at the beginning of a step, marked by 0,

    slip_i = T_i^T (D0 x_s - M0 x_m) - T0_i^T (D0 x0_s - M0 x0_m),

which is unchanged by joint rigid motions, and may extend over any number of facets.  In 3D the
tangents T_i turn with the slave facets around the node of the point, also about the normal.
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
    """The nodes of both sides that each of n points couples, and the tangents at the points.

    Attributes:
        both: D and - M, nodes of the slave first, sparse, shape (n, m).
        tangents: T_i, orthonormal, one per column, shape (n, d, d - 1).
        partnered: whether the point has a partner on the other side, shape (n,).
    """

    both: sp.csr_array
    tangents: Array
    partnered: Flags


@dataclass(frozen=True)
class SlidingCoupling:
    """The n contact points of this rank on a pair of deformed sides, each at a node of the slave.

    A point without a partner has the displacement of its node, and ``reach`` for its gap.

    Attributes:
        slave, master: both deformed sides.
        nodes: the slave nodes of the points, shape (n,).
        seen: whether any point of any rank has a partner.
        weight: w_i, undeformed area, shape (n,).
        normal: n_i, from the slave to the master, of length one, shape (n, d).
        gap: length, shape (n,).
        frames: couplings and tangents of the points.
        normal_rows: - dgap_i, from displacements of the nodes of both sides, those of the slave
            first, sparse, shape (n, d m).
        tangent_rows: the relative displacement along T_i, a row for each tangent of a point, shape
            (n (d - 1), d m).
        centre: point of action of the forces, length, shape (n, d).
        covered: undeformed area of the slave where both sides overlap and at least one can move.
        pieces: data of the second derivatives of the gap.
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
        """Return the slip of the points along T_i since the beginning of the step, length, shape
        (n, d - 1).

        Points that had no partner then are compared at the nodes that they couple now.

        Args:
            begun: the map at the beginning of the step.
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
        """Return the stiffness that tractions add to the tangent as the frames of the points rotate
        and their partners shift, force / length, sparse, shape (d m, d m); to be summed over the
        ranks; collective.

        Pressures contribute the second derivative of the gaps.  Shears rotate with the normals;
        adding the transpose makes this term symmetric.  The transpose acts along the normals only,
        where sides in contact do not move relative to each other.  The shift of partners transfers
        shears from node to node of the master; its derivative is not symmetric, and is left out if
        ``symmetric``.

        Args:
            pressure: lambda, stress, shape (n,).
            shear: mu along T_i, stress, shape (n, d - 1).
            symmetric: whether to leave out what is not symmetric.
        """
        shears = np.einsum("n,ndk,nk->nd", self.weight, self.frames.tangents, shear)
        forces = np.column_stack((self.weight * pressure, 0.0 * shears if symmetric else shears))
        stiffness = self.pieces.stiffness(forces)
        if parallel.any_rank(self.pieces.tested.sharing.comm, shear):
            turns = self._turning(shears).T.tocsr() @ self.normal_rows
            # One after another, as each is larger than the stiffness.
            stiffness = stiffness - turns
            turns = turns.T.tocsr()
            stiffness = stiffness - turns
        return sp.csr_array(stiffness)

    def _turning(self, along: Array) -> sp.csr_array:
        """Return the derivative of n_i, times the vectors ``along``, shape (n, d), with respect to
        the displacements of both sides, sparse, shape (n, d m).
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
    """Return the map of two deformed sides, see ``PairSurface.displaced``; collective.

    In 3D both sides have degree 1.

    Args:
        slave: the side with the contact points.
        master: the opposite side.
        points: slave nodes that have a point, ascending, shape (n,).
        reach: distance beyond which facets are not paired, length.
        whole: the surface of which the slave is a part, to which points without a partner belong;
            None: the slave.
        sharing: division of the pair between the ranks.

    Raises:
        PairingError: a facet faces two sheets of the master.
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
    """Return T_i of points at some nodes, shape (n, d, d - 1).

    In 3D they turn with the slave around the node.  For a point in a plane of symmetry the first
    tangent stays perpendicular to the plane, as neither half rotates about the normal alone.
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
