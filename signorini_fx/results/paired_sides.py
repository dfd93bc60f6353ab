"""The second opinion on the map of a pair of bodies: identities at all points, integrals at some.

What the solver claims of a pair are weights, distances, and shares of the nodes of both sides.  At all points

    D 1 = M 1 = 1,   D x - M x + d = 0,   B R = 0 for every joint rigid motion R,

and forces and moments balance because of the latter.  At some points, drawn at random, the integrals are computed again
by other code: facets of the mesh are evaluated by basix, in the plane rays from the slave find the master, in space the
slave is cut by each master in turn, and polygons are integrated by collapsed rules.

Both sides consist of the facets that the problem names, no fewer and no others.  Functions of a node without a point
are taken over by points beside it, so that a facet with such a node, and with a point that has taken over nothing, must
not be covered.  All functions together are one where the slave is covered, whoever has taken them over:

    sum_i w_i D_ij = integral of N_j over the covered part,

which is tried at some nodes too: of those without a point, and of points that have taken over functions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI
from scipy.spatial import cKDTree

from signorini_fx import parallel
from signorini_fx.body.averages import from_owners, to_owners
from signorini_fx.body.node_positions import node_positions
from signorini_fx.results.paired_facets import Facet, Facets, Piece, interpolated_normals, pieces_of, usual_reach

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]

# Points whose integrals are computed again, by the dimension.
_SAMPLED = {2: 16, 3: 6}
# A facet that is covered by less than this share is not among them: its dual functions have few digits.
_COVERED = 0.05
# A node that lies under a sliver of a point stands for at least this share of it: a stress is a force over an area.
_SLIVER = 1e-3


@dataclass(frozen=True)
class Claim:
    """What the solver claims of a pair with n contact points on this rank, made of m nodes of all ranks.

    Attributes:
        comm: the ranks; methods that take or give values at nodes are collective.
        slave: owned facets of the side with the points, local numbers, as the problem names them.
        master: those of the other side.
        paired: the facets of both sides that the solver has paired.
        points: local node of each point, shape (n,).
        weight: area (in the plane: length), shape (n,).
        distance: d_i, length, shape (n, d).
        reached: global numbers of the m nodes, ascending.
        own: D, scipy sparse, shape (n, m).
        others: M, scipy sparse, shape (n, m).
        operator: the relative displacement from displacements of these nodes, scipy sparse, shape (n d, m d).
        alone: points that have taken over no function of another node, shape (n,).
        covered: area of the overlap, of all ranks.
        hats: whether functions are the hats of the vertices themselves.
        reach: distance beyond which facets were no partners, length.
        allowed: the same as the problem names it; None: the usual one.
        across: projectors onto the directions across planes of symmetry, of which ``operator``, traction and normal
            have no component, shape (n, d, d).
        planes: the same by the global numbers of all nodes of the slave on such planes.
    """

    comm: MPI.Comm
    slave: Indices
    master: Indices
    paired: tuple[Indices, Indices]
    points: npt.NDArray[np.int64]
    weight: Array
    distance: Array
    reached: npt.NDArray[np.int64]
    own: Any
    others: Any
    operator: Any
    alone: npt.NDArray[np.bool_]
    covered: float
    hats: bool
    reach: float
    allowed: float | None
    across: Array
    planes: Mapping[int, Array]

    def gap(self, normal: Array) -> Array:
        """The distance of both sides along normals at the points, length, shape (n,)."""
        return np.asarray(np.sum(normal * self.distance, axis=1))

    def relative(self, owned: Array) -> Array:
        """The relative displacement at the points from that of the owned nodes, shape (owned nodes, d)."""
        there = from_owners(owned, self.reached, self.comm)
        return np.asarray(self.operator @ there.ravel()).reshape(self.distance.shape)

    def terms(self, owned: Array) -> Array:
        """The sums of the magnitudes of what ``relative`` adds up, shape (n, d)."""
        there = from_owners(np.abs(owned), self.reached, self.comm)
        return np.asarray(abs(self.operator) @ there.ravel()).reshape(self.distance.shape)

    def forces(self, traction: Array, owned: int) -> tuple[npt.NDArray[np.int64], Array, Array]:
        """What tractions at the points, shape (n, d), do to both bodies: owned nodes, forces on them, and their areas;
        ``owned``: how many nodes this rank owns.
        """
        dim = self.distance.shape[1]
        forces = (self.operator.T @ (self.weight[:, None] * traction).ravel()).reshape(-1, dim)
        shares = abs(self.own) + abs(self.others)
        shares.data = np.maximum(shares.data, _SLIVER)
        area = shares.T @ self.weight
        found = to_owners(np.column_stack((forces, area)), self.reached, self.comm, owned)
        nodes = np.flatnonzero(found[:, -1] > 0)
        return nodes, found[nodes, :-1], found[nodes, -1]

    def moved(self, flags: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Whether a node that a point depends on has a flag, from shape (owned nodes, d) to shape (n, d)."""
        there = from_owners(flags.astype(np.float64), self.reached, self.comm)
        return np.asarray((abs(self.own) + abs(self.others)) @ there > 0)


def not_held(claim: Claim, held: Array, y: Array) -> float:
    """How far the directions across planes of symmetry are from being held where they are at the nodes of the points,
    and for each at some node of the other side that a point sees; collective.

    Args:
        claim: what is claimed.
        held: projectors onto the directions that supports prescribe, shape (owned nodes, d, d).
        y: displacements of the owned nodes relative to the largest one, shape (owned nodes, d).
    """
    if not parallel.any_rank(claim.comm, bool(claim.across.any())):
        return 0.0
    known = np.column_stack((held.reshape(len(held), -1), y))
    there, dim, worst = from_owners(known, claim.reached, claim.comm), y.shape[1], 0.0
    for point in np.flatnonzero(claim.across.any(axis=(1, 2))):
        nodes = claim.others.indices[claim.others.indptr[point] : claim.others.indptr[point + 1]]
        rows = [known[claim.points[[point]]], there[nodes]]
        values, ways = np.linalg.eigh(claim.across[point])
        for way in ways[:, values > 0.5].T:
            worst = max(
                worst,
                *(
                    np.min(
                        np.linalg.norm(one[:, :-dim].reshape(-1, dim, dim) @ way - way, axis=1)
                        + abs(one[:, -dim:] @ way)
                    )
                    for one in rows
                ),
            )
    return parallel.global_max(claim.comm, float(worst))


def defect(claim: Claim, space: fem.FunctionSpace) -> float:
    """The largest error of what is claimed, relative to one, to weights, or to sizes of facets; collective."""
    dim, comm = space.mesh.geometry.dim, claim.comm
    x = np.array(node_positions(space)[: space.dofmap.index_map.size_local, :dim], dtype=np.float64)
    used = from_owners(x, claim.reached, comm)
    low, high = parallel.global_bounds(comm, used)
    size, middle = float(np.linalg.norm(high - low)), (low + high) / 2
    arm = (used - middle) / size
    total = float(parallel.global_sum(comm, claim.weight.sum()))
    found = [abs(total / claim.covered - 1.0), parallel.local_max(-claim.weight, -np.inf) / claim.covered]
    found += [_largest(shares @ np.ones(len(used)) - 1.0) for shares in (claim.own, claim.others)]
    found.append(_largest(claim.own @ arm - claim.others @ arm + claim.distance / size))
    for motion in _rigid((x - middle) / size):
        found.append(_largest(claim.relative(motion)))
    named = claim.slave, claim.master
    found.append(float(any(np.setxor1d(*both).size for both in zip(claim.paired, named, strict=True))))
    slave, master = (Facets(space, own) for own in named)
    reach = usual_reach(slave, master) if claim.allowed is None else claim.allowed
    found.append(float(not np.isclose(claim.reach, reach, atol=0.0)))  # which may be zero, or infinite
    found.append(_sampled(claim, space, slave, master, reach))
    return parallel.global_max(comm, float(max(found)))


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))


def _rigid(arm: Array) -> list[Array]:
    dim = arm.shape[1]
    found = [np.tile(row, (len(arm), 1)) for row in np.eye(dim)]
    for first in range(dim):
        for second in range(first):
            turned = np.zeros_like(arm)
            turned[:, first], turned[:, second] = -arm[:, second], arm[:, first]
            found.append(turned)
    return found


def _sampled(claim: Claim, space: fem.FunctionSpace, slave: Facets, master: Facets, reach: float) -> float:
    """The largest error of the integrals of some points of this rank, relative to their weights and the sizes of
    facets, with partners up to a distance; collective.
    """
    dim = space.mesh.geometry.dim
    names = claim.points + space.dofmap.index_map.local_range[0]
    every = np.unique(np.concatenate((claim.reached, slave.nodes.ravel(), master.nodes.ravel())))
    place = np.searchsorted(every, claim.reached)
    choice = np.flatnonzero(claim.alone)
    most = -(-_SAMPLED[dim] // claim.comm.size)
    draw = np.random.default_rng(len(claim.points))
    choice = draw.permutation(choice)[:most]
    around = {int(point): slave.around(names[[point]]) for point in choice}
    bare, worst = _bare(claim, slave.points, names)
    bare = draw.permutation(bare)[:most]
    mine, claimed = _areas(claim, slave, master, names)
    beside = {int(node): slave.around(np.array([node])) for node in mine}
    numbers = np.unique(np.concatenate([bare, *around.values(), *beside.values()]))
    normals = None
    if dim == 2:
        normals = interpolated_normals([slave[k] for k in slave.around(slave.nodes[numbers].ravel())])
        for node in normals.keys() & claim.planes.keys():
            normal = normals[node] - claim.planes[node] @ normals[node]
            normals[node] = normal / np.linalg.norm(normal)
    facets = {int(number): slave[number] for number in numbers}
    known = {
        number: pieces_of(facet, [master[k] for k in master.near(facet, reach)], reach, normals)
        for number, facet in facets.items()
    }
    for k, area in enumerate(claimed):
        left, size = float(area), 0.0
        for number in beside[int(mine[k])]:
            facet = facets[int(number)]
            size += facet.area
            row = int(np.flatnonzero(facet.nodes == mine[k])[0])
            left -= float(sum(facet.shape(piece.at)[:, row] @ piece.weight for piece in known[int(number)]))
        worst = max(worst, abs(left) / size)
    for number in bare:
        if sum(piece.weight.sum() for piece in known[int(number)]) > _COVERED * facets[int(number)].area:
            worst = 1.0
    for point in choice:
        node = int(names[point])
        total, own, others = 0.0, np.zeros(every.size), np.zeros(every.size)
        distance, size, clear = np.zeros(dim), 0.0, True
        for number in around[int(point)]:
            facet, pieces = facets[int(number)], known[int(number)]
            if not pieces:
                continue
            clear &= sum(piece.weight.sum() for piece in pieces) > _COVERED * facet.area
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
            continue
        weight = claim.weight[point]
        errors = [abs(total / weight - 1.0), _largest(distance / weight - claim.distance[point]) / size]
        for integrals, shares in ((own, claim.own), (others, claim.others)):
            integrals /= weight
            integrals[place] -= shares[[point]].toarray().ravel()
            errors.append(_largest(integrals))
        worst = max(worst, *errors)
    return worst


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


def _areas(
    claim: Claim, slave: Facets, master: Facets, names: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.int64], Array]:
    """Some nodes of the slave, the share of this rank, and what the functions of all points make the integrals of the
    shape functions of these nodes over the covered part; collective.

    A third each are nodes that no point of theirs stands for, those nearest to the other side; nodes that points see
    which have taken over functions; and any.

    Args:
        claim: what is claimed.
        slave: its facets.
        master: those of the other side.
        names: of the nodes of the points of this rank.
    """
    comm, draw = claim.comm, np.random.default_rng(len(slave.nodes))
    nodes, first = np.unique(slave.nodes.ravel(), return_index=True)
    away = cKDTree(master.middle).query(slave.x[first])[0]
    taken = claim.reached[np.unique(claim.own[~claim.alone].indices)]
    pointed, taken = (np.unique(parallel.gather_rows(comm, one[:, None])) for one in (names, taken))
    without = np.flatnonzero(~np.isin(nodes, pointed))
    groups = nodes[without[np.argsort(away[without], kind="stable")]], draw.permutation(taken), draw.permutation(nodes)
    each = -(-_SAMPLED[slave.x.shape[1]] // len(groups))
    chosen = np.unique(np.concatenate([group[:each] for group in groups]))
    sums, areas = claim.own.T @ claim.weight, np.zeros(chosen.size)
    seen = np.isin(chosen, claim.reached)
    areas[seen] = sums[np.searchsorted(claim.reached, chosen[seen])]
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
