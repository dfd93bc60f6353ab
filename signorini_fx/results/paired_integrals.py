"""The integrals of a pair of bodies, computed again at some points and nodes, for the certificate.

Points are drawn at random.  Other code than the solver's does it: facets of the mesh are evaluated by basix, in the
plane rays from the slave find the master, in space the slave is cut by each master in turn, and polygons are integrated
by collapsed rules (``paired_facets``).

Functions of a node without a point are taken over by points beside it, so that a facet with such a node, and with a
point that has taken over nothing, must not be covered.  All functions together are one where the slave is covered,
whoever has taken them over:

    sum_i w_i D_ij = integral of N_j over the covered part,

which is tried at some nodes too: of those that no point sees, and of points that have taken over functions.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx import parallel
from signorini_fx.results.paired_claim import Claim
from signorini_fx.results.paired_facets import Facet, Facets, Piece, interpolated_normals, pieces_of

Array = npt.NDArray[np.float64]
# A facet of the slave and the pieces of the other side over it.
_Overlap = tuple[Facet, list[Piece]]

# Points whose integrals are computed again, by the dimension.
_SAMPLED = {2: 16, 3: 6}
# A facet that is covered by less than this share is not among them: its dual functions have few digits.
_COVERED = 0.05


def largest(values: Array) -> float:
    """The largest magnitude."""
    return float(np.max(np.abs(values), initial=0.0))


def sampled(claim: Claim, space: fem.FunctionSpace, slave: Facets, master: Facets, reach: float) -> float:
    """The largest error of the integrals of some points of this rank, relative to their weights and the sizes of
    facets, with partners up to a distance; collective.
    """
    names = claim.points + space.dofmap.index_map.local_range[0]
    every = np.unique(np.concatenate((claim.reached, slave.nodes.ravel(), master.nodes.ravel())))
    most = -(-_SAMPLED[space.mesh.geometry.dim] // claim.comm.size)
    draw = np.random.default_rng(len(claim.points))
    choice = draw.permutation(np.flatnonzero(claim.alone))[:most]
    bare, worst = _bare(claim, slave.points, names)
    bare = draw.permutation(bare)[:most]
    nodes, areas = _areas(claim, slave, master)
    around = [slave.around(names[[point]]) for point in choice]
    beside = [slave.around(nodes[[k]]) for k in range(len(nodes))]
    overlaps = _overlaps(claim, slave, master, reach, np.unique(np.concatenate([bare, *around, *beside])))
    errors = [
        worst,
        *(
            _error_of_area(int(node), area, [overlaps[number] for number in numbers])
            for node, area, numbers in zip(nodes, areas, beside, strict=True)
        ),
        *(float(_is_covered(*overlaps[number])) for number in bare),
        *(
            _error_at(claim, int(point), int(names[point]), every, [overlaps[number] for number in numbers])
            for point, numbers in zip(choice, around, strict=True)
        ),
    ]
    return max(errors)


def _overlaps(
    claim: Claim, slave: Facets, master: Facets, reach: float, numbers: npt.NDArray[np.int64]
) -> dict[int, _Overlap]:
    """Facets of the slave, by their numbers, and what is over each."""
    normals = None
    if slave.x.shape[1] == 2:
        normals = interpolated_normals([slave[k] for k in slave.around(slave.nodes[numbers].ravel())])
        for node in normals.keys() & claim.planes.keys():
            normal = normals[node] - claim.planes[node] @ normals[node]
            normals[node] = normal / np.linalg.norm(normal)
    facets = {int(number): slave[int(number)] for number in numbers}
    return {
        number: (facet, pieces_of(facet, [master[k] for k in master.near(facet, reach)], reach, normals))
        for number, facet in facets.items()
    }


def _is_covered(facet: Facet, pieces: list[Piece]) -> bool:
    return bool(sum(piece.weight.sum() for piece in pieces) > _COVERED * facet.area)


def _error_of_area(node: int, area: float, overlaps: Iterable[_Overlap]) -> float:
    """The error of the integral of the shape function of a node over the covered part of the facets around it, relative
    to their area.
    """
    left, size = float(area), 0.0
    for facet, pieces in overlaps:
        size += facet.area
        row = int(np.flatnonzero(facet.nodes == node)[0])
        left -= float(sum(facet.shape(piece.at)[:, row] @ piece.weight for piece in pieces))
    return abs(left) / size


def _error_at(claim: Claim, point: int, node: int, every: npt.NDArray[np.int64], overlaps: Iterable[_Overlap]) -> float:
    """The error of the integrals of a point; zero where some facet around it is hardly covered.

    Args:
        claim: what is claimed.
        point: its number on this rank.
        node: its global node.
        every: global nodes that integrals may be of, ascending.
        overlaps: the facets around it.
    """
    total, own, others = 0.0, np.zeros(every.size), np.zeros(every.size)
    distance, size, clear = np.zeros(claim.distance.shape[1]), 0.0, True
    for facet, pieces in overlaps:
        if not pieces:
            continue
        clear &= _is_covered(facet, pieces)
        psi = _functions(facet, pieces, claim.hats)
        row = int(np.flatnonzero(facet.points == node)[0])
        size = max(size, facet.size)
        for piece, values in zip(pieces, psi, strict=True):
            weighted = values[:, row] * piece.weight
            total += weighted.sum()
            for integrals, side, at in ((own, facet, piece.at), (others, piece.master, piece.over)):
                np.add.at(integrals, np.searchsorted(every, side.nodes), weighted @ side.shape(at))
            distance += weighted @ (piece.master.place(piece.over) - facet.place(piece.at))
    if not clear or total <= 0:
        return 0.0
    weight, place = claim.weight[point], np.searchsorted(every, claim.reached)
    errors = [abs(total / weight - 1.0), largest(distance / weight - claim.distance[point]) / size]
    for integrals, shares in ((own, claim.own), (others, claim.others)):
        integrals /= weight
        integrals[place] -= shares[[point]].toarray().ravel()
        errors.append(largest(integrals))
    return float(max(errors))


def _bare(claim: Claim, nodes: npt.NDArray[np.int64], names: npt.NDArray[np.int64]) -> tuple[Any, float]:
    """Facets of the slave that must not be covered: they have a node without a point, and a point that has taken over
    no function; collective.

    Args:
        claim: what is claimed.
        nodes: those of the facets that have test functions, global numbers, shape (f, t).
        names: of the nodes of the points of this rank.

    Returns:
        The share of this rank of these facets, and 1 if a point has taken over functions where no node is without.
    """
    pointed, alone = parallel.gather_rows(claim.comm, np.column_stack((names, claim.alone)).astype(np.int64)).T
    without = ~np.isin(nodes, pointed).all(axis=1)
    found = np.flatnonzero(without & np.isin(nodes, pointed[alone > 0]).any(axis=1))
    needless = ~np.isin(pointed[alone == 0], nodes[without])
    return found[claim.comm.rank :: claim.comm.size], float(needless.any())


def _areas(claim: Claim, slave: Facets, master: Facets) -> tuple[npt.NDArray[np.int64], Array]:
    """Some nodes of the slave, the share of this rank, and what the functions of all points make the integrals of the
    shape functions of these nodes over the covered part; collective.

    A third each are nodes that no point sees, those nearest to the other side; nodes that points see which have taken
    over functions; and any.

    Args:
        claim: what is claimed.
        slave: its facets.
        master: those of the other side.
    """
    comm, draw = claim.comm, np.random.default_rng(len(slave.nodes))
    nodes, first = np.unique(slave.nodes.ravel(), return_index=True)
    away = cKDTree(master.middle).query(slave.x[first])[0]
    rows = claim.own, claim.own[~claim.alone]
    seen, taken = (claim.reached[np.unique(one.indices)] for one in rows)
    seen, taken = (np.unique(parallel.gather_rows(comm, one[:, None])) for one in (seen, taken))
    without = np.flatnonzero(~np.isin(nodes, seen))
    groups = nodes[without[np.argsort(away[without], kind="stable")]], draw.permutation(taken), draw.permutation(nodes)
    each = -(-_SAMPLED[slave.x.shape[1]] // len(groups))
    chosen = np.unique(np.concatenate([group[:each] for group in groups]))
    sums, areas = claim.own.T @ claim.weight, np.zeros(chosen.size)
    mine = np.isin(chosen, claim.reached)
    areas[mine] = sums[np.searchsorted(claim.reached, chosen[mine])]
    here = slice(comm.rank, None, comm.size)
    return chosen[here], parallel.global_sum(comm, areas)[here]


def _functions(facet: Facet, pieces: list[Piece], hats: bool) -> list[Array]:
    """Values of the test functions at the points of the pieces, shape (q, t) each."""
    values = [facet.hats(piece.at) for piece in pieces]
    if hats:
        return values
    mass = sum(one.T @ (piece.weight[:, None] * one) for one, piece in zip(values, pieces, strict=True))
    dual: Array = np.diag(np.sum(mass, axis=1)) @ np.linalg.inv(mass)
    return [one @ dual.T for one in values]
