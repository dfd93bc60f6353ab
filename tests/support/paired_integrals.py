"""An oracle: the integrals of a pair of bodies, computed again at some points and nodes.

Points are drawn at random.  Other code than the solver's does it: facets of the mesh are evaluated by basix, in the
plane rays from the slave find the master, in 3D the slave is cut by each master in turn, and polygons are integrated
by collapsed rules (``paired_facets``).

Functions of a node without a point are taken over by points beside it, so that a facet with such a node, and with a
point that has taken over nothing, must not be covered.  All functions together are one where the slave is covered,
whoever has taken them over:

    sum_i w_i D_ij = integral of N_j over the covered part,

which is tried at some nodes too: of those that no point sees, and of points that have taken over functions.  Which
facets over each other are left out because supports hold both is what the solver says.

What is projected along are the mean normals that a projection along those of the slave gives.  They are tried at some
nodes, whose facets are covered, and so are half the rotations of both sides at the points, on displacements drawn at
random.  Of sides that are nominally in contact it is the normals of the slave, and the rotation of the master.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from paired_facets import Facet, OverlapPiece, PairFacets, mean_normals, pieces_of, usual_reach
from scipy.spatial import cKDTree

from signorini_fx.machine import parallel
from signorini_fx.results.certificate import paired_sides
from signorini_fx.results.certificate.paired_claim import Claim
from signorini_fx.results.certificate.paired_sides import largest

Array = npt.NDArray[np.float64]
# A facet of the slave and the pieces of the other side over it.
_Overlap = tuple[Facet, list[OverlapPiece]]

# Points whose integrals are computed again, by the dimension.
_SAMPLED = {2: 16, 3: 6}
# A facet that is covered by less than this share is not among them: its dual functions have few digits.
_COVERED = 0.05
# One that is covered by this share has no node without a function; nodes of such facets at which directions are tried.
_WHOLLY_COVERED, _TRIED = 0.99, {2: 8, 3: 3}
# Displacements on which rotations are tried, and share of the best resisted one below which nothing resists a rotation.
_DISPLACEMENTS, _NO_ARM = 3, 1e-12


def tried_by(monkeypatch):
    """Let certificates contain the largest error of these integrals, in ``coupling``, beside that of the identities."""
    identities = paired_sides.defect

    def defect(claim, space):
        measure = None
        if claim.measure is not None:
            measure = dict(zip(claim.pair.slave.nodes.tolist(), claim.measure.tolist(), strict=True))
        slave, master = PairFacets(space, claim.slave, measure), PairFacets(space, claim.master)
        reach = usual_reach(slave, master) if claim.allowed is None else claim.allowed
        reach *= 1.0 + 1e-9  # facets exactly as far apart are partners
        integrated = parallel.global_max(claim.comm, sampled(claim, space, slave, master, reach))
        return max(identities(claim, space), integrated)

    monkeypatch.setattr(paired_sides, "defect", defect)


def sampled(claim: Claim, space: fem.FunctionSpace, slave: PairFacets, master: PairFacets, reach: float) -> float:
    """The largest error of the integrals of some points of this rank, relative to their weights and the sizes of
    facets, with partners up to a distance; collective.
    """
    names = claim.points + space.dofmap.index_map.local_range[0]
    all_nodes = np.unique(np.concatenate((claim.reached, slave.nodes.ravel(), master.nodes.ravel())))
    sample_size = -(-_SAMPLED[space.mesh.geometry.dim] // claim.comm.size)
    draw = np.random.default_rng(len(claim.points))
    choice = draw.permutation(np.flatnonzero(claim.pair.coupling.alone))[:sample_size]
    bare, worst = _bare(claim, slave.points, names)
    bare = draw.permutation(bare)[:sample_size]
    nodes, areas = _areas(claim, slave, master)
    around = [slave.around(names[[point]]) for point in choice]
    beside = [slave.around(nodes[[k]]) for k in range(len(nodes))]
    # Directions are claimed, and tried where they come from.
    claimed = np.unique(np.concatenate([bare, *around, *beside])).astype(np.int64)
    needed = np.unique(slave.points[claimed])
    if claim.pair.coupling.directions is None:
        directions = _normals(claim, slave, needed) if slave.x.shape[1] == 2 else None
        worst = max(worst, float(not claim.nominal))
    else:
        rows = np.searchsorted(claim.pair.slave.nodes, needed)
        directions = dict(zip(needed.tolist(), claim.pair.coupling.directions[rows], strict=True))
        tried = draw.permutation(needed)[: -(-_TRIED[space.mesh.geometry.dim] // claim.comm.size)]
        errors = [_error_of_direction(claim, int(node), slave, master, reach) for node in tried]
        worst = max([worst, float(claim.nominal), *errors])
    still = _still(claim)
    overlaps = {
        number: (facet, [piece for piece in pieces if (_name(facet), _name(piece.master)) not in still])
        for number, (facet, pieces) in _overlaps(slave, master, reach, claimed, directions).items()
    }
    errors = [
        worst,
        *(
            _error_of_area(int(node), area, [overlaps[number] for number in numbers])
            for node, area, numbers in zip(nodes, areas, beside, strict=True)
        ),
        *(float(_is_covered(*overlaps[number])) for number in bare),
        *(
            _error_at(claim, int(point), int(names[point]), all_nodes, [overlaps[number] for number in numbers])
            for point, numbers in zip(choice, around, strict=True)
        ),
    ]
    return max(errors)


def _overlaps(
    slave: PairFacets,
    master: PairFacets,
    reach: float,
    numbers: npt.NDArray[np.int64],
    directions: dict[int, Array] | None,
) -> dict[int, _Overlap]:
    """Facets of the slave, by their numbers, and what is over each; ``directions``: see ``pieces_of``."""
    facets = {int(number): slave[int(number)] for number in numbers}
    return {
        number: (facet, pieces_of(facet, [master[k] for k in master.near(facet, reach)], reach, directions))
        for number, facet in facets.items()
    }


def _name(facet: Facet) -> tuple[int, ...]:
    """The global numbers of the nodes of a facet, ascending."""
    return tuple(np.sort(facet.nodes).tolist())


def _still(claim: Claim) -> set[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Facets of both sides over each other that the solver leaves out, by their names, as supports hold both;
    collective.
    """
    pair, still = claim.pair, claim.pair.coupling.still
    columns = [
        np.sort(side.nodes[side.surface.nodes[facets]], axis=1)
        for side, facets in ((pair.slave, still.slave), (pair.master, still.master))
    ]
    split = columns[0].shape[1]
    rows = parallel.gather_rows(claim.comm, np.concatenate(columns, axis=1)).tolist()
    return {(tuple(row[:split]), tuple(row[split:])) for row in rows}


def _normals(claim: Claim, side: PairFacets, nodes: npt.NDArray[np.int64]) -> dict[int, Array]:
    """The normals of a side at some of its nodes with test functions, global numbers."""
    normals = mean_normals([side[k] for k in side.around(nodes)])
    return {int(node): claim.in_planes(np.array([node]), normals[int(node)][None])[0] for node in nodes}


def _interpolated(facet: Facet, normals: dict[int, Array], at: Array) -> Array:
    """The normal at places of a facet, which interpolates those at its nodes, shape (q, d)."""
    at_nodes = np.array([normals[int(node)] for node in facet.points])
    if len(facet.points) < len(facet.nodes):  # nodes between vertices are opposite to the third one
        between = at_nodes.sum(axis=0) - at_nodes
        at_nodes = np.concatenate((at_nodes, between / np.linalg.norm(between, axis=1, keepdims=True)))
    return np.asarray(facet.shape(at) @ at_nodes)


def _error_of_direction(claim: Claim, node: int, slave: PairFacets, master: PairFacets, reach: float) -> float:
    """The error of the direction of projection at a node of the slave.

    It is zero where some facet around it is not covered, or where its function has no area.

    Args:
        claim: what is claimed.
        node: its global number.
        slave: facets of the slave.
        master: those of the other side.
        reach: distance beyond which facets are no partners, length.
    """
    numbers = slave.around(np.array([node]))
    slave_normals = _normals(claim, slave, np.unique(slave.points[numbers]))
    overlaps = list(_overlaps(slave, master, reach, numbers, slave_normals if slave.x.shape[1] == 2 else None).values())
    if not all(_is_covered(facet, pieces, _WHOLLY_COVERED) for facet, pieces in overlaps):
        return 0.0
    if any(facet.without_area(node) for facet, _ in overlaps):
        return 0.0
    seen = np.unique(np.concatenate([piece.master.points for _, pieces in overlaps for piece in pieces]))
    master_normals, total = _normals(claim, master, seen), np.zeros(slave.x.shape[1])
    for facet, pieces in overlaps:
        row = int(np.flatnonzero(facet.points == node)[0])
        for piece, values in zip(pieces, _functions(facet, pieces, claim.pair.coupling.hats), strict=True):
            apart = _interpolated(facet, slave_normals, piece.at) - _interpolated(
                piece.master, master_normals, piece.over
            )
            total += (values[:, row] * piece.weight) @ apart
    direction = claim.in_planes(np.array([node]), total[None])[0]
    return largest(direction - claim.pair.coupling.directions[np.searchsorted(claim.pair.slave.nodes, node)])


def _is_covered(facet: Facet, pieces: list[OverlapPiece], share: float = _COVERED) -> bool:
    return bool(sum(piece.weight.sum() for piece in pieces) > share * facet.area)


def _error_of_area(node: int, area: float, overlaps: Iterable[_Overlap]) -> float:
    """The error of the integral of the shape function of a node over the covered part of the facets around it, relative
    to their area.
    """
    missing, size = float(area), 0.0
    for facet, pieces in overlaps:
        size += facet.area
        row = int(np.flatnonzero(facet.nodes == node)[0])
        missing -= float(sum(facet.shape(piece.at)[:, row] @ piece.weight for piece in pieces))
    return abs(missing) / size


def _error_at(
    claim: Claim, point: int, node: int, all_nodes: npt.NDArray[np.int64], overlaps: Iterable[_Overlap]
) -> float:
    """The error of the integrals of a point; zero where some facet around it is hardly covered.

    Args:
        claim: what is claimed.
        point: its number on this rank.
        node: its global node.
        all_nodes: global nodes that integrals may be of, ascending.
        overlaps: the facets around it.
    """
    total, slave_integrals, master_integrals = 0.0, np.zeros(all_nodes.size), np.zeros(all_nodes.size)
    positions, areas = np.zeros((all_nodes.size, claim.distance.shape[1])), np.zeros((2, all_nodes.size))
    distance, size, clear = np.zeros(claim.distance.shape[1]), 0.0, True
    for facet, pieces in overlaps:
        if not pieces:
            continue
        clear &= _is_covered(facet, pieces)
        psi = _functions(facet, pieces, claim.pair.coupling.hats)
        row = int(np.flatnonzero(facet.points == node)[0])
        size = max(size, facet.size)
        for piece, values in zip(pieces, psi, strict=True):
            weighted = values[:, row] * piece.weight
            total += weighted.sum()
            met = (slave_integrals, areas[0], facet, piece.at), (master_integrals, areas[1], piece.master, piece.over)
            for integrals, arms, side, at in met:
                rows = np.searchsorted(all_nodes, side.nodes)
                integrals[rows] += weighted @ side.shape(at)
                arms[rows] += piece.weight.sum()
                positions[rows] = side.corners
            distance += weighted @ (piece.master.place(piece.over) - facet.place(piece.at))
    if not clear or total <= 0:
        return 0.0
    weight, reached_rows = claim.weight[point], np.searchsorted(all_nodes, claim.reached)
    far = float(np.linalg.norm(claim.distance[point])) / size
    errors = [abs(total / weight - 1.0), largest(distance / weight - claim.distance[point]) / size]
    errors.append(
        _error_of_motion(claim, point, (slave_integrals - master_integrals) / weight, areas, positions, reached_rows)
        / (1.0 + far)
    )
    for integrals, shares in ((slave_integrals, claim.own), (master_integrals, claim.others)):
        integrals /= weight
        integrals[reached_rows] -= shares[[point]].toarray().ravel()
        errors.append(largest(integrals))
    return float(max(errors))


def _error_of_motion(
    claim: Claim, point: int, shares: Array, areas: Array, x: Array, reached_rows: npt.NDArray[np.int64]
) -> float:
    """The largest error of the relative displacement at a point for some displacements drawn at random.

    Args:
        claim: what is claimed.
        point: its number on this rank.
        shares: D - M at m nodes, shape (m,).
        areas: in which each side sees them, shape (2, m).
        x: their positions, length, shape (m, d).
        reached_rows: of the nodes that are reached among them.
    """
    dim, distance, draw = x.shape[1], claim.distance[point], np.random.default_rng(point)
    rows, worst = claim.operator[dim * point : dim * (point + 1)], 0.0
    parts = (0.0, 1.0) if claim.nominal else (0.5, 0.5)
    for _ in range(_DISPLACEMENTS):
        u = draw.uniform(-1.0, 1.0, x.shape)
        moved: Array = shares @ u + sum(_turned(a, x, u, part * distance) for a, part in zip(areas, parts, strict=True))
        moved = moved - claim.across[point] @ moved
        worst = max(worst, largest(rows @ u[reached_rows].ravel() - moved))
    return worst


def _turned(a: Any, x: Array, u: Array, way: Array) -> Array:
    """How the mean rotation of nodes with weights a turns a vector, shape (d,)."""
    deep = np.zeros((len(x), 3)), np.zeros((len(x), 3)), np.zeros((1, 3))
    for filled, values in zip(deep, (x, u, way[None]), strict=True):
        filled[:, : x.shape[1]] = values
    arm, moved, along = deep
    arm = arm - a @ arm / a.sum()
    inertia = np.eye(3) * (a @ np.sum(arm**2, axis=1)) - np.einsum("l,li,lj->ij", a, arm, arm)
    turn = np.linalg.pinv(inertia, rcond=_NO_ARM, hermitian=True) @ (a @ np.cross(arm, moved))
    return np.asarray(np.cross(turn, along[0])[: x.shape[1]])


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
    pointed, alone = parallel.gather_rows(
        claim.comm, np.column_stack((names, claim.pair.coupling.alone)).astype(np.int64)
    ).T
    without = ~np.isin(nodes, pointed).all(axis=1)
    bare = np.flatnonzero(without & np.isin(nodes, pointed[alone > 0]).any(axis=1))
    needless = ~np.isin(pointed[alone == 0], nodes[without])
    return bare[claim.comm.rank :: claim.comm.size], float(needless.any())


def _areas(claim: Claim, slave: PairFacets, master: PairFacets) -> tuple[npt.NDArray[np.int64], Array]:
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
    rows = claim.own, claim.own[~claim.pair.coupling.alone]
    seen, taken = (claim.reached[np.unique(part.indices)] for part in rows)
    seen, taken = (np.unique(parallel.gather_rows(comm, part[:, None])) for part in (seen, taken))
    without = np.flatnonzero(~np.isin(nodes, seen))
    groups = nodes[without[np.argsort(away[without], kind="stable")]], draw.permutation(taken), draw.permutation(nodes)
    group_size = -(-_SAMPLED[slave.x.shape[1]] // len(groups))
    chosen = np.unique(np.concatenate([group[:group_size] for group in groups]))
    sums, areas = claim.own.T @ claim.weight, np.zeros(chosen.size)
    mine = np.isin(chosen, claim.reached)
    areas[mine] = sums[np.searchsorted(claim.reached, chosen[mine])]
    rank_share = slice(comm.rank, None, comm.size)
    return chosen[rank_share], parallel.global_sum(comm, areas)[rank_share]


def _functions(facet: Facet, pieces: list[OverlapPiece], hats: bool) -> list[Array]:
    """Values of the test functions at the points of the pieces, shape (q, t) each."""
    values = [facet.hats(piece.at) for piece in pieces]
    if hats:
        return values
    mass = sum(
        functions.T @ (piece.weight[:, None] * functions) for functions, piece in zip(values, pieces, strict=True)
    )
    dual: Array = np.diag(np.sum(mass, axis=1)) @ np.linalg.inv(mass)
    return [functions @ dual.T for functions in values]
