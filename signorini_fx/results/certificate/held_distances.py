"""The second opinion on distances that supports of both sides of a sliding pair fix, which points beside do not count.

Of the solver it takes which nodes supports hold, which is compared with the supports elsewhere (``not_loose``).  Where
a held node of one side has its place on held nodes of the other, its distance is fixed, and the functions of held nodes
carry it on to facets beside.  Of two facets over each other that side counts whose functions of held nodes have less
squares.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.tuned import SAME_DIRECTION, SAME_PLACE_IN_CELL

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]


class DisplacedSide(NamedTuple):
    """A side at one displacement.

    Attributes:
        facets: nodes of each, shape (f, k).
        x: positions of the nodes, length, shape (N, d).
        held: nodes that supports hold along their normals, shape (N,).
        loose: projectors onto the directions in which nodes move, shape (N, d, d); None: held ones do not move.
        hats: functions of the nodes of facets at places, shape (r, k).
    """

    facets: Numbers
    x: Array
    held: npt.NDArray[np.bool_]
    loose: Array | None
    hats: Callable[[Array], Array]

    def fixed(self, nodes: Numbers, shares: Array, ways: Array) -> npt.NDArray[np.bool_]:
        """Whether all nodes with shares in some places, shape (m, k), stay where they are along ways, shape (m, d)."""
        still = np.array(self.held[nodes])
        if self.loose is not None:
            still &= np.linalg.norm(np.einsum("mkij,mj->mki", self.loose[nodes], ways), axis=2) <= SAME_DIRECTION
        return np.asarray((still | (np.abs(shares) <= SAME_PLACE_IN_CELL)).all(axis=1))


class HeldDistances(NamedTuple):
    """Distances that supports fix, k of them.

    Attributes:
        slave: shares of the nodes of the slave in their places, scipy sparse, shape (k, N).
        master: those of the master, scipy sparse, shape (k, M).
        ways: from slave to master, of length one, shape (k, d).
        at_rays: of each of them in what rays do not count, scipy sparse, shape (r, k).
    """

    slave: Any
    master: Any
    ways: Array
    at_rays: Any

    def distance(self, x: Array, y: Array) -> Array:
        """From places of the slave to those of the master, whose nodes are at x and y, length, shape (k,)."""
        return np.asarray(np.sum((self.master @ y - self.slave @ x) * self.ways, axis=1))


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
    at, inside = seeing[0](master.x[over], slave.x[nodes], ways[nodes])
    first = _first_fixed((slave, master), nodes, over, master.hats(at), ways[nodes], inside)
    of_slave = nodes[first]
    along = ways[of_slave]
    slave_shares = _shares(of_slave[:, None], np.ones((first.size, 1)), len(slave.x))
    master_shares = _shares(over[first], master.hats(at[first]), len(master.x))
    # From nodes of the master.
    row, local = np.nonzero(master.held[master.facets[pairs[:, 1]]])
    nodes, under = master.facets[pairs[row, 1], local], slave.facets[pairs[row, 0]]
    at, inside = seeing[1](slave.x[under], ways[under], master.x[nodes])
    shares = slave.hats(at)
    back = np.einsum("mk,mkd->md", shares, ways[under])
    back /= np.linalg.norm(back, axis=1, keepdims=True)
    first = _first_fixed((master, slave), nodes, under, shares, back, inside)
    of_master = nodes[first]
    slave_shares = sp.vstack((slave_shares, _shares(under[first], shares[first], len(slave.x))))
    master_shares = sp.vstack((master_shares, _shares(of_master[:, None], np.ones((first.size, 1)), len(master.x))))
    # What rays have of them.
    facet, start, opposite, end, areas = rays
    values, seen = (slave.hats(start), master.hats(end)), (slave.facets[facet], master.facets[opposite])
    _, pair = np.unique(facet * len(master.facets) + opposite, return_inverse=True)
    squares = [
        np.bincount(pair, areas * np.sum(part * side.held[numbers], axis=1) ** 2)
        for part, side, numbers in zip(values, sides, seen, strict=True)
    ]
    less = squares[0][pair] <= squares[1][pair]
    parts = []
    for part, numbers, listed_nodes, chosen in zip(values, seen, (of_slave, of_master), (less, ~less), strict=True):
        at_ray, local = np.nonzero(np.isin(numbers, listed_nodes) & chosen[:, None])
        columns = np.searchsorted(listed_nodes, numbers[at_ray, local])
        entries = part[at_ray, local], (at_ray, columns)
        parts.append(sp.csr_array(sp.coo_array(entries, shape=(len(facet), listed_nodes.size))))
    ways_there = np.concatenate((along, back[first]))
    return HeldDistances(
        sp.csr_array(slave_shares), sp.csr_array(master_shares), ways_there, sp.csr_array(sp.hstack(parts))
    )


def _first_fixed(
    sides: tuple[DisplacedSide, DisplacedSide],
    nodes: Numbers,
    facets: Numbers,
    shares: Array,
    ways: Array,
    inside: npt.NDArray[np.bool_],
) -> Numbers:
    """Of each node of the first side the first row with a place at which nothing moves, by nodes.

    Args:
        sides: that of the nodes, and that of their places.
        nodes: of the rows, shape (m,).
        facets: nodes of the facets of the places, shape (m, k).
        shares: of these, likewise.
        ways: of rays, shape (m, d).
        inside: whether the place is on the facet, shape (m,).
    """
    still = inside & sides[0].fixed(nodes[:, None], np.ones((nodes.size, 1)), ways)
    rows = np.flatnonzero(still & sides[1].fixed(facets, shares, ways))
    return np.asarray(rows[np.unique(nodes[rows], return_index=True)[1]])


def _shares(nodes: Numbers, values: Array, count: int) -> Any:
    """Values of nodes, shape (m, k), scipy sparse, shape (m, count)."""
    rows = np.broadcast_to(np.arange(len(nodes))[:, None], values.shape)
    entries = values.ravel(), (rows.ravel(), nodes.ravel())
    return sp.csr_array(sp.coo_array(entries, shape=(len(nodes), count)))
