"""The map of a pair: relative displacement at the contact points from the displacements of both
sides.

For the function psi_i of a point and its weight w_i = int psi_i over the covered part of the slave,

    D_ij = int psi_i N_j / w_i,   M_il = int psi_i (N_l o P) / w_i,
    d_i = int psi_i (x_m - x_s) / w_i,
    n_i = sum_j D_ij n_j - sum_l M_il n_l, of length one, with the normals n_j, n_l at the nodes,
    u_rel,i = sum_j D_ij u_j - sum_l M_il u_l + (omega_i(u_s) + omega_i(u_m)) x d_i / 2,
    omega_i(u) = J_i^-1 sum_l a_il r_l x u_l,   r_l = x_l - xbar_i,
    J_i = sum_l a_il (|r_l|^2 I - r_l r_l^T),

where a_il of the master is the area over which the slave facets around the point see the master
facets around the node, and of the slave the area of those of these facets that are around the node.
All areas are multiplied by the measure of the slave, 2 pi r of a body of revolution: rings of both
sides that meet have one area, and opposite forces.  With the rotation omega the map is zero on
every joint rigid motion, so that forces and moments of both sides balance; they act half-way
between both.

The frame is half-way between both sides, too: with the normal or the rotation of one side alone,
bodies that are mirror images of each other would show shear, of the order a / (2 F R) of friction
over a contact of width 2 a.  P projects along the mean normals as well, which a first projection
along those of the slave finds.  Where sides are nominally in contact, or tied, what is between them
is due to their meshes alone.  There the frame is that of the slave, and the rotation that of the
master, omega_i(u_m) x d_i: with D = 1 a ring of facets turns freely in another one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Flags, Ints, inner, quotient
from signorini_fx.machine import parallel
from signorini_fx.mechanics.pairs.dual_functions import (
    carried,
    constrained,
    dual_coefficients,
    extended,
)
from signorini_fx.mechanics.pairs.overlap import plane_overlap, space_overlap, turned
from signorini_fx.mechanics.pairs.pair_side import (
    ALONE,
    Overlap,
    PairSurface,
    Sharing,
    in_rows,
    turning_of,
    without_round_off,
)
from signorini_fx.mechanics.pairs.search import Parts, default_reach
from signorini_fx.tuned import (
    CERTIFICATE_TOLERANCE,
    DEEPEST_OVERLAP,
    NEGLIGIBLE,
    SAME_LENGTH,
    SAME_NUMBER,
)


class PairingError(ValueError):
    """Two sides do not fit together; the message says why and where."""


@dataclass(frozen=True)
class Coupling:
    """The contact points of a pair on this rank, n of them, and the map to their relative
    displacements.

    Attributes:
        nodes: the slave node of each point, shape (n,).
        here: indices of these points among the points of all ranks, shape (n,).
        weight: w_i, area (in 2D: length) times the measure, shape (n,).
        normal: n_i, from the slave to the master, of length one, shape (n, d).
        distance: d_i, length, shape (n, d).
        both: D and - M, nodes of the slave first, sparse, shape (n, m).
        mean: maps integrals over the pairs of facets of this rank, see ``Tested``, to means at the
            points of all ranks; sparse.
        first: number of nodes of the slave, which precede those of the master in ``both``.
        turning: (omega_i(u_s) + omega_i(u_m)) x d_i / 2, for sides that are nominally in contact
            omega_i(u_m) x d_i, as a map of the displacements of all nodes, slave first; in blocks,
            sparse, shape (n d, d m).
        centre: point of action of the forces, the same on both sides, length, shape (n, d).
        covered: area (in 2D: length) of the slave where both sides meet and at least one can move,
            times the measure, summed over the ranks.
        met: the same area including the parts where nothing can move, see ``Tested.moving``.
    """

    nodes: Ints
    here: Ints
    weight: Array
    normal: Array
    distance: Array
    both: sp.csr_array
    mean: sp.csr_array
    first: int
    turning: sp.bsr_array
    centre: Array
    covered: float
    met: float

    @property
    def slave(self) -> sp.csr_array:
        """D, shape (n, nodes of the slave)."""
        return self.both[:, : self.first]

    @property
    def master(self) -> sp.csr_array:
        """M, shape (n, nodes of the master)."""
        return -self.both[:, self.first :]

    def lift(self, slave: PairSurface) -> sp.csr_array:
        """Return displacements of slave nodes, all along one direction, that displace each contact
        point by one: D times them is the identity, except for hats.  Sparse, shape (nodes of the
        slave, n).
        """
        # A test function meets the function of its own node, on quadratic triangles the hat, and no
        # other one.
        values = slave.functions.tests.values(slave.functions.places)
        met = sp.lil_array((len(slave.x), len(slave.x)))
        rows = np.repeat(slave.nodes, values.shape[1], axis=1)
        columns = np.tile(slave.points, len(values))
        met[rows, columns] = np.broadcast_to(values.ravel(), rows.shape)
        points = sp.csr_array(met.tocsc()[:, self.nodes])
        diagonal = (self.slave @ points).diagonal()
        return sp.csr_array(points @ sp.diags_array(1.0 / diagonal))

    @property
    def gap(self) -> Array:
        """n_i . d_i, length, shape (n,)."""
        return inner(self.normal, self.distance)


@dataclass(frozen=True)
class Tested:
    """The overlap of two sides, with the test functions of the points on the covered part.

    Each rank has the pieces on its share of the facets of the slave.  Values at nodes and facets
    are summed over all ranks; to compute them is collective.

    Attributes:
        bonded: whether the sides are tied, see ``couple``.
    """

    slave: PairSurface
    master: PairSurface
    overlap: Overlap
    bonded: bool = False
    sharing: Sharing = ALONE

    def chosen(self, pieces: Flags) -> Tested:
        """Return this object restricted to some of its pieces, chosen by flags of shape (p,);
        collective.
        """
        if not parallel.any_rank(self.sharing.comm, ~pieces):
            return self
        return replace(self, overlap=self.overlap.chosen(pieces))

    def within(self, reach: float) -> Tested:
        """Return this object restricted to the pairs of facets whose mean distance, averaged over
        their pieces, is at most ``reach``, length.
        """
        weight = self.overlap.weight
        moment = self.overlap.of_pairs((weight[:, None] @ self.distance)[:, 0])
        area = self.overlap.of_pairs(weight.sum(axis=1))
        near = np.linalg.norm(moment, axis=1) <= (1.0 + SAME_LENGTH) * reach * area
        return self.chosen(near[self.overlap.pair])

    @property
    def moving(self) -> Tested:
        """Return this object without the pieces where nothing can move, as supports hold all nodes
        of both facets.
        """
        sides = (self.slave, self.overlap.slave), (self.master, self.overlap.master)
        on_slave, on_master = (
            np.asarray(side.held[side.nodes[facets]].all(axis=1)) for side, facets in sides
        )
        return self.chosen(~(on_slave & on_master))

    @cached_property
    def tests(self) -> Array:
        """The test functions at the points of the overlap, shape (p, q, t), from which the
        functions of the contact points are combined.
        """
        return self.slave.functions.tests.values(self.overlap.at)

    @cached_property
    def coefficients(self) -> Array:
        """The coefficients of the dual functions on each facet of the slave, shape (f, t, t)."""
        if self.bonded and self.tests.shape[2] < self.slave.nodes.shape[1]:
            return np.tile(np.eye(self.tests.shape[2]), (len(self.slave.nodes), 1, 1))
        return dual_coefficients(self.tests, self.overlap, len(self.slave.nodes))

    @cached_property
    def area(self) -> Array:
        """The covered area of each facet of the slave, shape (f,)."""
        areas = self.overlap.weight.sum(axis=1)[:, None]
        count = len(self.slave.nodes)
        return parallel.sums_by(self.sharing.comm, self.overlap.slave, areas, count)[:, 0]

    @property
    def twice(self) -> Ints:
        """Facets of the slave that face more than one sheet of the master somewhere: their covered
        area exceeds their own.
        """
        return np.flatnonzero(self.area > (1.0 + NEGLIGIBLE) * self.slave.facet_areas)

    @property
    def of_nearest_sheets(self) -> Tested:
        """Return this object with only the nearest sheet of the master for each slave facet that
        faces several.
        """
        overlap = self.overlap
        several = np.flatnonzero(np.isin(overlap.slave, self.twice))
        weight = overlap.weight[several].sum(axis=1)
        moment = np.einsum("pq,pqd->pd", overlap.weight[several], self.distance[several])
        distance = np.linalg.norm(moment, axis=1) / weight
        kept = np.ones(len(overlap.slave), dtype=bool)
        for facet in np.unique(overlap.slave[several]):
            pieces = np.flatnonzero(overlap.slave[several] == facet)
            seen = overlap.master[several[pieces]]
            _, sheet = connected_components(self.master.neighbours[seen][:, seen])
            mean = np.bincount(sheet, (weight * distance)[pieces]) / np.bincount(
                sheet, weight[pieces]
            )
            kept[several[pieces[sheet != mean.argmin()]]] = False
        return self.chosen(kept)

    @cached_property
    def weighted(self) -> Array:
        """The dual functions times the areas of the points of the overlap, shape (p, q, t)."""
        coefficients = self.coefficients[self.overlap.slave]
        return self.tests @ coefficients.swapaxes(1, 2) * self.overlap.weight[..., None]

    @cached_property
    def areas(self) -> Array:
        """Integrals of the dual functions of the slave nodes, shape (N,)."""
        points = self.slave.points[self.overlap.slave].ravel()
        integrals = self.weighted.sum(axis=1).reshape(-1, 1)
        return parallel.sums_by(self.sharing.comm, points, integrals, len(self.slave.x))[:, 0]

    @cached_property
    def shapes(self) -> tuple[Array, Array]:
        """The shape functions of slave and master at the points of the overlap, shapes (p, q, k)
        and (p, q, l).
        """
        slave = self.slave.functions
        master = self.master.functions
        on_slave = self.tests if slave.tests is slave else slave.values(self.overlap.at)
        return on_slave, master.values(self.overlap.over)

    @cached_property
    def distance(self) -> Array:
        """The vector from each slave point to the opposite master point, length, shape (p,
        q, d).
        """
        on_slave = self.slave.corners[self.overlap.slave]
        on_master = self.master.corners[self.overlap.master]
        return self.shapes[1] @ on_master - self.shapes[0] @ on_slave

    def mean(self, shares: sp.csr_array) -> sp.csr_array:
        """Return the matrix that turns integrals of the functions over all pairs of facets into
        means at the contact points, sparse, shape (n, f t).

        Args:
            shares: share of the function of each slave node in each point, shape (n, N).
        """
        facets = self.overlap.slave[self.overlap.first]
        mean = shares[:, self.slave.points[facets].ravel()]
        mean.data /= np.repeat(shares @ self.areas, np.diff(mean.indptr))
        return mean

    def products(self) -> sp.csr_array:
        """Return integrals over all pairs of facets, sparse, shape (f t, 2 m + d).

        The columns are: the dual functions times the shape functions of both sides (m), the area
        over which the pair meets, at each of its nodes (m), and the dual functions times the
        distance (d).
        """
        overlap = self.overlap
        products = overlap.of_pairs(
            self.weighted.swapaxes(1, 2) @ np.concatenate(self.shapes, axis=2)
        )
        first = len(self.slave.x)
        areas = overlap.of_pairs(overlap.weight.sum(axis=1))[:, None, None]
        areas = np.broadcast_to(areas, products.shape)
        on_slave = self.slave.nodes[overlap.slave[overlap.first]]
        on_master = self.master.nodes[overlap.master[overlap.first]]
        nodes = np.hstack((on_slave, first + on_master))
        count = first + len(self.master.x)
        distance = overlap.of_pairs(self.weighted.swapaxes(1, 2) @ self.distance)
        components = np.broadcast_to(
            2 * count + np.arange(dim := distance.shape[2]), (len(nodes), dim)
        )
        return in_rows(
            np.concatenate((products, areas, distance), axis=2),
            np.hstack((nodes, count + nodes, components)),
            2 * count + dim,
        )

    @property
    def movable(self) -> Array:
        """The degree to which each slave node can move, or faces master nodes that can, from 0 to
        1, shape (N,).

        A slave node that supports hold still carries a point, as its function moves the master.
        Where most of the master opposite it is held, too, nothing can move the point, and
        neighbouring nodes take over its function.
        """
        held = self.master.held[self.master.nodes[self.overlap.master]].astype(np.float64)
        of_held = self.moments(self.shapes[1] @ held[..., None])[:, 0]
        # On a part of a facet a quadratic function may have a negative weight, which says nothing.
        seen = quotient(of_held, self.areas)
        return np.where(self.slave.held, 1.0 - np.clip(seen, 0.0, 1.0), 1.0)

    @property
    def covered(self) -> Ints:
        """The numbers of the slave facets that overlap the other side."""
        return np.flatnonzero(self.area)

    def moments(self, values: Array) -> Array:
        """Return integrals of the dual functions times ``values``, by slave nodes, shape (N, k);
        collective.

        Args:
            values: values at the points of the overlap, shape (p, q, k).
        """
        integrals = np.zeros((len(self.slave.x), values.shape[2]))
        np.add.at(
            integrals, self.slave.points[self.overlap.slave], self.weighted.swapaxes(1, 2) @ values
        )
        return parallel.global_sum(self.sharing.comm, integrals)


def couple(
    slave: PairSurface,
    master: PairSurface,
    *,
    bonded: bool = False,
    nominal: bool = False,
    reach: float | None = None,
    sharing: Sharing = ALONE,
) -> Coupling:
    """Return the map of a pair; collective.

    Args:
        slave: the side with the contact points.
        master: the opposite side.
        bonded: whether the sides are tied; quadratic triangles then use the hats of the vertices.
        nominal: whether the sides are nominally in contact, so that their normals differ by their
            meshes only.
        reach: distance beyond which facets are not paired, length; None: ``default_reach``.
        sharing: division of the pair between the ranks; the other arguments are the same on all
            ranks.

    Raises:
        PairingError: no facet finds a partner, one finds two sheets of the master, the bodies lie
            inside each other, supports or other contacts leave no node that can carry a point, or
            no point takes over the functions of some facets.
    """
    if reach is None:
        reach = default_reach(slave.x, master.x)
    whole, _ = projected(slave, master, reach, sharing, bonded=bonded, nominal=nominal)
    tested = whole.moving
    fixed = constrained(tested.movable)
    nodes, shares = carried(slave, tested.covered, tested.areas, slave.unable | fixed)
    if not nodes.size:
        raise PairingError(
            "supports of both sides, or other contacts, hold all nodes of the covered part"
        )
    # Facets whose nodes are all constrained and not connected to any point: no point takes over
    # their functions.
    carried_nodes = shares.sum(axis=0).ravel() > 0.0
    nobody = (fixed & ~carried_nodes)[slave.points].all(axis=1)
    tested = tested.chosen(~nobody[tested.overlap.slave])
    _refuse_bare(tested, shares)
    coupling = coupled(tested, nodes, shares, nominal=nominal)
    size = min(float(np.linalg.norm(np.ptp(x, axis=0))) for x in (slave.x, master.x))
    if (deepest := parallel.largest(sharing.comm, -coupling.gap, -np.inf)) > DEEPEST_OVERLAP * size:
        raise PairingError(
            f"its facets lie up to {deepest:.3g} behind those of the other side, of a size of "
            f"{size:.3g}: check the "
            "facets, and that the bodies do not lie inside each other"
        )
    return replace(coupling, met=float(whole.area.sum()))


def coupled(
    tested: Tested, nodes: Ints, shares: sp.csr_array, *, nominal: bool = False
) -> Coupling:
    """Return the map of both sides at the points of this rank; collective.

    Args:
        tested: the overlap with its functions.
        nodes: the slave node of each point, on all ranks.
        shares: share of the function of each slave node in each point; a point with an empty row is
            unpaired and moves with its node.
        nominal: see ``couple``.
    """
    slave = tested.slave
    master = tested.master
    count = len(slave.x) + len(master.x)
    mean = tested.mean(shares)
    half = 0.0 if nominal else 0.5
    products = tested.sharing.rows(mean @ tested.products(), nodes)
    here = tested.sharing.own(nodes)
    nodes = nodes[here]
    alone = np.diff(shares.indptr)[here] == 0
    ends = np.append(0, np.cumsum(alone))
    itself = sp.csr_array((np.ones(ends[-1]), nodes[alone], ends), shape=(nodes.size, count))
    distance = products[:, 2 * count :].toarray()
    both = without_round_off(products[:, :count]) + itself
    arms = products[:, count : 2 * count]
    centre = both @ np.concatenate((slave.x, np.zeros_like(master.x))) + half * distance
    turning = turning_of(arms, (slave.x, master.x), (half * distance, (1.0 - half) * distance))
    weight = (shares @ tested.areas)[here]
    first = len(slave.x)
    covered = float(tested.area.sum())
    both.data[both.indices >= first] *= -1.0
    directions = np.concatenate((slave.directions, master.directions))
    normal = slave.nodal_normals[nodes] if nominal else slave.in_planes(both @ directions, nodes)
    found = nodes, here, weight, normal, distance, both, mean, first, turning, centre
    return Coupling(*found, covered, covered)


def _refuse_bare(tested: Tested, shares: sp.csr_array) -> None:
    """Raise a PairingError if no point takes over any function of some covered facets."""
    slave = tested.slave
    carried_nodes = abs(shares).sum(axis=0).ravel() > 0.0
    area = np.where(carried_nodes[slave.points].any(axis=1), 0.0, tested.area)
    bare = np.flatnonzero(area)
    if area.sum() <= CERTIFICATE_TOLERANCE * tested.area.sum():  # slivers
        return
    size = float(np.abs(slave.x).max())
    middle = slave.corners[area.argmax()].mean(axis=0)
    place = ", ".join(f"{component:.4g}" for component in size * np.round(middle / size, 9) + 0.0)
    raise PairingError(
        f"other contacts own all nodes of {bare.size} facets opposite the other side, such as "
        f"that at ({place}), so that no node transmits a force there: give these facets to "
        "another contact, or remove the facets around them"
    )


def projected(
    slave: PairSurface,
    master: PairSurface,
    reach: float,
    sharing: Sharing,
    *,
    bonded: bool = False,
    nominal: bool = False,
    apart: bool = False,
) -> tuple[Tested, Array | None]:
    """Return the overlap of both sides with its functions, and the directions of projection at the
    slave nodes, shape (N, d), or None where these are the slave's normals; collective.

    ``apart``: whether the sides may be apart, so that no facet has a partner; for the other
    arguments
        see ``couple``.
    """
    facets = sharing.part(len(slave.nodes))
    parts = Parts.of(slave, facets), Parts.of(master, np.arange(len(master.nodes)))
    project = plane_overlap if slave.dimension == 2 else space_overlap

    def found(directions: Array | None) -> Tested:
        overlap = project(*parts, reach, directions, sharing.comm)
        overlap = overlap.chosen(np.lexsort((overlap.master, overlap.slave)))
        tested = Tested(slave, master, overlap, bonded, sharing).within(reach)
        return tested.of_nearest_sheets if apart and tested.twice.size else tested

    tested = found(None)
    directions = None
    if tested.area.any() and not nominal:
        _check(tested, reach)
        directions = _mean_normals(tested)
        if turned(parts[0], directions, sharing.comm) > SAME_NUMBER:
            tested = found(directions)
    if apart and not tested.area.any():
        return tested, slave.nodal_normals
    _check(tested, reach)
    return tested, directions


def _mean_normals(tested: Tested) -> Array:
    """Return the directions of projection N_i at the slave nodes, shape (N, d): slave minus master
    normals, averaged with the function of the node.

    A node without a point takes its own normal and the extension of the mean master normals.
    """
    slave = tested.slave
    master = tested.master
    overlap = tested.overlap
    slave_normals = tested.shapes[0] @ slave.directions[slave.nodes[overlap.slave]]
    master_normals = tested.shapes[1] @ master.directions[master.nodes[overlap.master]]
    moments = tested.moments(np.concatenate((slave_normals, master_normals), axis=2))
    dim = slave.dimension
    unable = np.zeros(len(slave.x), dtype=bool)
    nodes, shares = carried(slave, tested.covered, tested.areas, unable)
    means = shares @ moments / (shares @ tested.areas)[:, None]
    directions = slave.nodal_normals - extended(slave, nodes, means[:, dim:])
    directions[nodes] = means[:, :dim] - means[:, dim:]
    return slave.in_planes(directions, np.arange(len(directions)))


def _check(tested: Tested, reach: float) -> None:
    """Raise a PairingError if the sides do not meet, or if some slave facet faces several
    sheets.
    """
    slave = tested.slave
    if not tested.area.any():
        nearest = _nearest(slave, tested.master)
        raise PairingError(
            f"no facet faces the other side within {reach:.3g}; {nearest}: check the "
            "facets, and that the bodies do not lie inside each other; of bodies that meet later "
            "move one (in a scene by its shift) to where these sides face each other, or, if they "
            "are nonlinear and slide, give a reach, which is larger than any distance on the way"
        )
    twice = tested.twice
    if twice.size:
        point = ", ".join(f"{c:g}" for c in slave.corners[twice[0]].mean(axis=0))
        raise PairingError(
            f"the other surface is folded at {twice.size} facets within {reach:.3g}, such as that "
            f"at ({point}): give a smaller reach"
        )


def _nearest(slave: PairSurface, master: PairSurface) -> str:
    """Return a text that states where the sides are nearest, their distance there, and the angle
    between their normals.
    """
    first, second = (Parts.of(side, np.arange(len(side.nodes))) for side in (slave, master))
    away, partners = cKDTree(second.centre).query(first.centre)
    nearest = int(away.argmin())
    cosine = first.normal[nearest] @ second.normal[partners[nearest]]
    size = float(np.abs(first.centre).max())
    point = ", ".join(f"{c:.4g}" for c in size * np.round(first.centre[nearest] / size, 9))
    angle = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return (
        f"both are nearest at ({point}), {away[nearest]:.3g} apart, where their normals enclose "
        f"{angle:.0f} degrees, "
        "of sides that face each other about 180"
    )
