"""The independent check on distances that supports of both sides of a pair fix, which points beside do not count.

Where a held node of one side has its place on the other, held nodes there have a share of what is there, and as much of
its distance is fixed; the functions of held nodes carry that on to facets beside.  Of two facets over each other that
side counts more whose functions of held nodes have less squares.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.tuned import HELD_LESS, NO_ARM, SAME_DIRECTION, SAME_PLACE_IN_CELL, SINGULAR

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]


class DisplacedSide(NamedTuple):
    """A side at one displacement.

    Attributes:
        facets: nodes of each, shape (f, k).
        x: positions of the nodes, length, shape (N, d).
        undeformed: of those of a deformed body, likewise; None: these are.
        normals: of the nodes, undeformed and now, shape (N, d) each; None: of an undeformed body.
        held: nodes that supports hold along their normals, shape (N,).
        loose: projectors onto the directions in which nodes move, shape (N, d, d); None: held ones do not move.
        hats: functions of the nodes of facets at places, shape (r, k).
    """

    facets: Numbers
    x: Array
    undeformed: Array | None
    normals: tuple[Array, Array] | None
    held: npt.NDArray[np.bool_]
    loose: Array | None
    hats: Callable[[Array], Array]

    def still(self, nodes: Numbers, ways: Array) -> npt.NDArray[np.bool_]:
        """Which nodes, shape (m, k), stay where they are along ways, shape (m, d)."""
        still = np.array(self.held[nodes])
        if self.loose is not None:
            still &= np.linalg.norm(np.einsum("mkij,mj->mki", self.loose[nodes], ways), axis=2) <= SAME_DIRECTION
        return np.asarray(still)

    @property
    def turn(self) -> Array:
        """How held nodes have turned, and where these do not say it, normals there, shape (d, d)."""
        dim = self.x.shape[1]
        if self.undeformed is None or self.normals is None or not self.held.any():
            return np.eye(dim)
        start_arms, arms = (x[self.held] - x[self.held].mean(axis=0) for x in (self.undeformed, self.x))
        start_normals, normals = (vectors[self.held] for vectors in self.normals)
        size = np.ptp(self.undeformed, axis=0).max()
        products = start_arms.T @ arms / size**2 + SINGULAR * (start_normals.T @ normals + SINGULAR * np.eye(dim))
        if dim == 2:
            angle = np.arctan2(products[0, 1] - products[1, 0], np.trace(products))
            return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        # The rotation is the quaternion that makes a quadratic form largest (Horn 1987).
        across = np.array([products[i, j] - products[j, i] for i, j in ((1, 2), (2, 0), (0, 1))])
        form = np.block(
            [
                [np.array([[np.trace(products)]]), across[None]],
                [across[:, None], products + products.T - np.trace(products) * np.eye(3)],
            ]
        )
        w, x, y, z = np.linalg.eigh(form)[1][:, -1]
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return np.asarray(np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross)


class HeldDistances(NamedTuple):
    """Distances that supports fix, k of them.

    Attributes:
        slave: shares of the held nodes of the slave in their places, scipy sparse, shape (k, N).
        master: those of the master, scipy sparse, shape (k, M).
        ways: from slave to master, of length one, shape (k, d).
        offset: what their distances have more than those of held nodes, length, shape (k,).
        turning: what changes as held nodes of undeformed sides turn, from displacements of all nodes of both sides,
            slave first, scipy sparse, shape (k, d (N + M)).
        of_nodes: shares by which the places of the nodes of the slave are held, zero where there are none, shape (N,).
        at_rays: of each of them in what rays do not count, scipy sparse, shape (r, k).
    """

    slave: Any
    master: Any
    ways: Array
    offset: Array
    turning: Any
    of_nodes: Array
    at_rays: Any

    def distance(self, x: Array, y: Array) -> Array:
        """From places of the slave to those of the master, whose nodes are at x and y, length, shape (k,)."""
        return np.asarray(self.offset + np.sum((self.master @ y - self.slave @ x) * self.ways, axis=1))


# Of places that points see along ways: facets' nodes at places, the ways there, and the points.
Seeing = Callable[[Array, Array, Array], tuple[Array, npt.NDArray[np.bool_]]]


def held_distances(
    sides: tuple[DisplacedSide, DisplacedSide],
    ways: Array,
    partners: tuple[Numbers, Numbers],
    rays: tuple[Numbers, Array, Numbers, Array, Array],
    seeing: tuple[Seeing, Seeing],
) -> HeldDistances:
    """Those of two sides.

    Args:
        sides: slave and master.
        ways: directions of rays at the nodes of the slave, shape (N, d).
        partners: facets of both sides that see each other, shape (p,) each.
        rays: facets and places of the slave, and of the master, shape (r,) or (r, d - 1) each, and areas, shape (r,).
        seeing: the place on a facet of the master, shape (m, k, d), that the end of a ray is on, from points and ways,
            and that on a facet of the slave from which a point is seen, from the ways at its nodes, and the points; and
            whether it is on the facet.
    """
    slave, master = sides
    pairs = np.unique(np.column_stack(partners), axis=0).reshape(-1, 2)
    # From nodes of the slave.
    row, local = np.nonzero(slave.held[slave.facets[pairs[:, 0]]])
    nodes, over = slave.facets[pairs[row, 0], local], master.facets[pairs[row, 1]]
    along = ways[nodes] / np.linalg.norm(ways[nodes], axis=1, keepdims=True)
    at, inside = seeing[0](master.x[over], slave.x[nodes], along)
    of_slave = _held_most((slave, master), nodes, over, master.hats(at), along, inside)
    # From nodes of the master.
    row, local = np.nonzero(master.held[master.facets[pairs[:, 1]]])
    nodes, under = master.facets[pairs[row, 1], local], slave.facets[pairs[row, 0]]
    at, inside = seeing[1](slave.x[under], ways[under], master.x[nodes])
    shares = slave.hats(at)
    back = np.einsum("mk,mkd->md", shares, ways[under])
    back /= np.linalg.norm(back, axis=1, keepdims=True)
    of_master = _held_most((master, slave), nodes, under, shares, -back, inside)
    both_distances = [_distances(sides, of_slave, master=True), _distances(sides, of_master, master=False)]
    # What rays have of them.
    facet, start, opposite, end, areas = rays
    values, seen = (slave.hats(start), master.hats(end)), (slave.facets[facet], master.facets[opposite])
    _, pair = np.unique(facet * len(master.facets) + opposite, return_inverse=True)
    squares = [
        np.bincount(pair, areas * np.sum(part * side.held[numbers], axis=1) ** 2)
        for part, side, numbers in zip(values, sides, seen, strict=True)
    ]
    covered = np.bincount(pair, areas)
    odds = [
        (square * np.maximum(covered - other, 0.0)) ** HELD_LESS
        for square, other in zip(squares, squares[::-1], strict=True)
    ]
    total = odds[0] + odds[1]
    of_slave_side = np.where(total > 0.0, odds[1] / np.where(total > 0.0, total, 1.0), 0.5)[pair]
    counts = of_slave_side, 1.0 - of_slave_side
    parts = []
    for part, numbers, listed, factor in zip(values, seen, (of_slave.nodes, of_master.nodes), counts, strict=True):
        at_ray, local = np.nonzero(np.isin(numbers, listed))
        columns = np.searchsorted(listed, numbers[at_ray, local])
        entries = factor[at_ray] * part[at_ray, local], (at_ray, columns)
        parts.append(sp.csr_array(sp.coo_array(entries, shape=(len(facet), listed.size))))
    side_shares = [sp.csr_array(sp.vstack([distances[side] for distances in both_distances])) for side in range(2)]
    ways, offset = (np.concatenate([distances[k] for distances in both_distances]) for k in (2, 3))
    turning = sp.csr_array(sp.vstack([distances[4] for distances in both_distances]))
    of_nodes = np.zeros(len(slave.x))
    of_nodes[of_slave.nodes] = of_slave.held.sum(axis=1)
    at_rays = sp.csr_array(sp.hstack(parts))
    all_distances = HeldDistances(side_shares[0], side_shares[1], ways, offset, turning, of_nodes, at_rays)
    return all_distances if slave.undeformed is not None else _turning_with(sides, all_distances)


class _SeenPlaces(NamedTuple):
    """Nodes of one side, ascending, m of them, with their places on the other.

    Attributes:
        nodes: shape (m,).
        facets: nodes of those of the places, shape (m, k).
        shares: of these in the places, likewise.
        held: what held ones of these have, likewise.
        ways: from the nodes to the places, of length one, shape (m, d).
    """

    nodes: Numbers
    facets: Numbers
    shares: Array
    held: Array
    ways: Array


def _held_most(
    sides: tuple[DisplacedSide, DisplacedSide],
    nodes: Numbers,
    facets: Numbers,
    shares: Array,
    ways: Array,
    inside: npt.NDArray[np.bool_],
) -> _SeenPlaces:
    """Of each held node of the first side the first of the places that are held most.

    Args:
        sides: that of the nodes, and that of their places.
        nodes: of the rows, shape (m,).
        facets: nodes of the facets of the places, shape (m, k).
        shares: of these, likewise.
        ways: from the nodes to the places, of length one, shape (m, d).
        inside: whether the place is on the facet, shape (m,).
    """
    held = np.where(sides[1].still(facets, ways), shares, 0.0)
    sums = np.minimum(held.sum(axis=1), 1.0)
    sums[~(inside & sides[0].still(nodes[:, None], ways)[:, 0])] = 0.0
    rows = []
    for node in np.unique(nodes):
        own = np.flatnonzero(nodes == node)
        best = own[np.argmax(sums[own] >= sums[own].max() - SAME_PLACE_IN_CELL)]
        if sums[best] > SAME_PLACE_IN_CELL:
            rows.append(best)
    chosen = np.array(rows, dtype=np.int64)
    parts = held[chosen] * (sums[chosen] / held[chosen].sum(axis=1))[:, None]
    return _SeenPlaces(nodes[chosen], facets[chosen], shares[chosen], parts, ways[chosen])


def _distances(
    sides: tuple[DisplacedSide, DisplacedSide], places: _SeenPlaces, *, master: bool
) -> tuple[Any, Any, Array, Array, Any]:
    """Of places on the master, or on the slave: the first attributes of ``HeldDistances``, in this order."""
    node_side, place_side = sides if master else sides[::-1]
    theta = places.held.sum(axis=1)
    itself = at_nodes(places.nodes[:, None], theta[:, None], len(node_side.x))
    of_held = at_nodes(places.facets, places.held, len(place_side.x))
    undeformed_x = place_side.x if place_side.undeformed is None else place_side.undeformed
    corners = undeformed_x[places.facets]
    ahead = np.einsum("mk,mkd->md", theta[:, None] * places.shares - places.held, corners)
    near = np.linalg.norm(ahead, axis=1) <= SINGULAR * np.ptp(undeformed_x, axis=0).max()
    ahead[near] = 0.0
    offset = np.sum(places.ways * (ahead @ place_side.turn.T), axis=1)
    turned = sp.csr_array((places.nodes.size, place_side.x.size))
    if place_side.undeformed is None:
        turned = _turned(place_side, ahead, places.ways)
    nothing = sp.csr_array((places.nodes.size, node_side.x.size))
    turning = sp.hstack((nothing, turned) if master else (turned, nothing))
    ways = places.ways if master else -places.ways
    of_sides = (itself, of_held) if master else (of_held, itself)
    return (*of_sides, ways, offset, turning)


def _turned(side: DisplacedSide, ahead: Array, ways: Array) -> Any:
    """What vectors change along ways as held nodes turn, from displacements of nodes, scipy sparse, shape (m, d N)."""
    dim = side.x.shape[1]
    held, listed = np.flatnonzero(side.held), np.flatnonzero(ahead.any(axis=1))
    if held.size < 2 or not listed.size:
        return sp.csr_array((len(ahead), side.x.size))
    ahead, ways, count = ahead[listed], ways[listed], len(ahead)
    axes = [(i, j) for i in range(dim) for j in range(i)]
    arm = (side.x[held] - side.x[held].mean(axis=0)) / np.ptp(side.x, axis=0).max()
    design: Array = np.zeros((held.size, dim, dim + len(axes)))
    design[:, np.arange(dim), np.arange(dim)] = 1.0
    for k, (i, j) in enumerate(axes):
        design[:, i, dim + k], design[:, j, dim + k] = arm[:, j], -arm[:, i]
    motions = np.linalg.pinv(design.reshape(-1, dim + len(axes)), rcond=NO_ARM)[dim:] / np.ptp(side.x, axis=0).max()
    places = (dim * held[:, None] + np.arange(dim)).ravel()
    rates = np.column_stack([ways[:, i] * ahead[:, j] - ways[:, j] * ahead[:, i] for i, j in axes]) @ motions
    entries = rates.ravel(), (np.repeat(listed, places.size), np.tile(places, listed.size))
    return sp.csr_array(sp.coo_array(entries, shape=(count, side.x.size)))


def _turning_with(sides: tuple[DisplacedSide, DisplacedSide], distances: HeldDistances) -> HeldDistances:
    """Those that do not change as all turns."""
    x = np.concatenate([side.x for side in sides])
    dim, middle = x.shape[1], x.mean(axis=0)
    stays = np.ones(len(distances.ways), dtype=bool)
    for i in range(dim):
        for j in range(i):
            turned = np.zeros_like(x)
            turned[:, i], turned[:, j] = x[:, j] - middle[j], middle[i] - x[:, i]
            apart = distances.master @ turned[len(sides[0].x) :] - distances.slave @ turned[: len(sides[0].x)]
            change = np.sum(apart * distances.ways, axis=1) + distances.turning @ turned.ravel()
            stays &= np.abs(change) <= SINGULAR * np.ptp(x, axis=0).max()
    rows = np.flatnonzero(stays)
    return HeldDistances(
        distances.slave[rows],
        distances.master[rows],
        distances.ways[rows],
        distances.offset[rows],
        distances.turning[rows],
        distances.of_nodes,
        distances.at_rays[:, rows],
    )


def at_nodes(nodes: Numbers, values: Array, count: int) -> Any:
    """Values of nodes at points, shape (m, k), scipy sparse, shape (m, count)."""
    rows = np.broadcast_to(np.arange(len(nodes))[:, None], values.shape)
    entries = values.ravel(), (rows.ravel(), nodes.ravel())
    return sp.csr_array(sp.coo_array(entries, shape=(len(nodes), count)))
