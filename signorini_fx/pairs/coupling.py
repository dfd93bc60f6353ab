"""The map of a pair: relative displacement at the contact points from the displacements of both sides.

For the function psi_i of a point and its weight w_i = int psi_i over the covered part of the slave,

    D_ij = int psi_i N_j / w_i,   M_il = int psi_i (N_l o P) / w_i,   d_i = int psi_i (x_m - x_s) / w_i,
    u_rel,i = sum_j D_ij u_j - sum_l M_il u_l + omega_i(u_m) x d_i,
    omega_i(u) = J_i^-1 sum_l a_il r_l x u_l,   r_l = x_l - xbar_i,   J_i = sum_l a_il (|r_l|^2 I - r_l r_l^T),

where a_il is the area over which the slave facets around the point see the master facets around the node.  With their
rotation omega the map is zero on every joint rigid motion, so that forces and moments of both sides balance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI
from scipy.spatial import cKDTree

from signorini_fx import parallel
from signorini_fx.pairs.functions import carried, dual_coefficients, hats
from signorini_fx.pairs.overlap import Overlap
from signorini_fx.pairs.overlap_plane import plane_overlap
from signorini_fx.pairs.overlap_space import space_overlap
from signorini_fx.pairs.search import default_reach
from signorini_fx.pairs.surface import Surface

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

# Resistance of the seen nodes to a rotation, relative to the best resisted one, below which there is none.
_NO_ARM = 1e-12
# Shares below it are round-off.
_ROUND_OFF = 1e-14
# Share of the size of a side by which the bodies may overlap.
_DEEP = 0.2
# Share of its area by which a facet may be covered too much by round-off.
_TWICE = 1e-3


class PairingError(ValueError):
    """Two sides do not fit together; the message says why and where."""


@dataclass(frozen=True)
class Coupling:
    """The contact points of a pair on this rank, n of them.

    Attributes:
        nodes: the slave node of each, shape (n,).
        weight: w_i, area (in the plane: length), shape (n,).
        normal: n_i, outward unit normal of the slave, shape (n, d).
        distance: d_i, length, shape (n, d).
        slave: D, sparse, shape (n, nodes of the slave).
        master: M, sparse, shape (n, nodes of the master).
        turning: omega_i(u_m) x d_i, sparse, shape (n d, d nodes of the master).
        overlap: where both sides meet, as far as this rank has found it.
        covered: area (in the plane: length) of the slave where they meet, of all ranks.
        alone: points that have taken over no function of another node, shape (n,).
        hats: whether the functions are hats, not dual ones.
        reach: distance beyond which facets were no partners, length.
    """

    nodes: Indices
    weight: Array
    normal: Array
    distance: Array
    slave: sp.csr_array
    master: sp.csr_array
    turning: sp.csr_array
    overlap: Overlap
    covered: float
    alone: npt.NDArray[np.bool_]
    hats: bool
    reach: float

    def lift(self, slave: Surface) -> sp.csr_array:
        """Displacements of slave nodes, all along one direction, that move the points by one each: D times them is
        one, but for hats.  Sparse, shape (nodes of the slave, n).
        """
        # A test function meets the function of its own node, on quadratic triangles the hat, and no other one.
        count = len(slave.tests.places)
        values = slave.tests.values(slave.functions.places)
        rows, columns = (np.repeat(slave.nodes, count, axis=1), np.tile(slave.points, (1, slave.nodes.shape[1])))
        shape = (len(slave.x), len(slave.x))
        entries = np.tile(values.ravel(), len(slave.nodes)), (rows.ravel(), columns.ravel())
        met = sp.csr_array(sp.coo_array(entries, shape=shape))
        met.data /= np.asarray(sp.csr_array(sp.coo_array((np.ones(rows.size), entries[1]), shape=shape)).data)
        points = sp.csr_array(met[:, self.nodes])
        own = np.asarray((self.slave @ points).diagonal())
        return sp.csr_array(points @ sp.diags_array(1.0 / own))

    @property
    def gap(self) -> Array:
        """n_i . d_i, length, shape (n,)."""
        return np.einsum("nd,nd->n", self.normal, self.distance)


def couple(
    slave: Surface,
    master: Surface,
    unable: npt.NDArray[np.bool_],
    *,
    bonded: bool = False,
    reach: float | None = None,
    comm: MPI.Comm = MPI.COMM_SELF,
    mine: npt.NDArray[np.bool_] | None = None,
) -> Coupling:
    """The map of a pair; collective.

    Args:
        slave: the side with the points.
        master: the other one.
        unable: nodes of the slave that cannot carry a point, because supports or another contact own them.
        bonded: whether the sides are tied, which on quadratic triangles takes the hats of the vertices.
        reach: distance beyond which facets are no partners, length; None: a default.
        comm: the ranks that share the work; the other arguments are the same on all of them.
        mine: nodes of the slave whose points this rank takes; None: all.

    Raises:
        PairingError: no facet finds a partner, one finds two sheets of them, or the bodies lie inside each other.
    """
    used = [side.x[np.unique(side.nodes)] for side in (slave, master)]
    if reach is None:
        reach = default_reach(*used)
    ends = len(slave.nodes) * comm.rank // comm.size, len(slave.nodes) * (comm.rank + 1) // comm.size
    some = np.arange(*ends)
    overlap = (plane_overlap if slave.dimension == 2 else space_overlap)(slave, master, reach, some)
    overlap = overlap.within(reach, slave, master)
    found_here = np.bincount(overlap.slave, overlap.weight.sum(axis=1), minlength=len(slave.nodes))
    area: Array = parallel.global_sum(comm, found_here.astype(np.float64))
    covered = np.flatnonzero(area)
    _check(slave, master, area, reach)
    whole = bonded and len(slave.tests.places) < len(slave.functions.places)
    coefficients = hats(slave) if whole else dual_coefficients(slave, overlap)
    tests = slave.tests.values(overlap.at)
    psi = np.einsum("pij,pqj->pqi", coefficients[overlap.slave], tests)
    weighted = psi * overlap.weight[..., None]

    points = slave.points[overlap.slave]
    count = len(slave.x)
    weight = parallel.global_sum(comm, _gather(points, weighted.sum(axis=1), count))
    own = _products(points, slave.nodes[overlap.slave], weighted, slave.functions.values(overlap.at), count, count)
    seen = master.nodes[overlap.master]
    others = _products(points, seen, weighted, master.functions.values(overlap.over), count, len(master.x))
    moment = np.einsum("pqi,pqd->pid", weighted, overlap.distance(slave, master))
    distance = parallel.global_sum(comm, _gather(points, moment, count))
    spread = np.broadcast_to(overlap.weight.sum(axis=1)[:, None, None], (*points.shape, seen.shape[1]))
    arms = _sparse(points, seen, spread, count, len(master.x))
    own, others, arms = (_over_ranks(comm, matrix) for matrix in (own, others, arms))

    nodes, shares = carried(slave, covered, weight, unable)
    if not nodes.size:
        raise PairingError("supports or other contacts own all nodes of its covered part")
    if mine is not None:
        nodes, shares = nodes[mine[nodes]], sp.csr_array(shares[mine[nodes]])
    weight = shares @ weight
    scale = sp.diags_array(1.0 / weight)
    distance = (shares @ distance) / weight[:, None]
    own, others = (_clean(sp.csr_array(scale @ shares @ matrix)) for matrix in (own, others))
    turning = _turning(sp.csr_array(shares @ arms), master.x, distance)
    normal, alone = slave.nodal_normals[nodes], np.diff(shares.indptr) == 1
    total = float(area.sum())
    found = Coupling(nodes, weight, normal, distance, own, others, turning, overlap, total, alone, whole, reach)
    size = min(float(np.linalg.norm(np.ptp(x, axis=0))) for x in used)
    if (deepest := parallel.largest(comm, -found.gap, -np.inf)) > _DEEP * size:
        raise PairingError(
            f"its facets lie up to {deepest:.3g} behind those of the other side, of a size of {size:.3g}: check the "
            "facets, and that the bodies do not lie inside each other"
        )
    return found


def _check(slave: Surface, master: Surface, covered: Array, reach: float) -> None:
    """Whether both sides meet, and every facet has one partner at most at each of its points.

    Args:
        slave: the side with the points.
        master: the other side.
        covered: area (in the plane: length) of each facet that is under the other side, shape (f,).
        reach: length.
    """
    if not covered.any():
        raise PairingError(
            f"none of its facets finds one of the other side that faces it within {reach:.3g}; "
            f"{_nearest(slave, master)}: check the facets, and that the bodies do not lie inside each other"
        )
    twice = np.flatnonzero(covered > (1.0 + _TWICE) * slave.facet_areas)
    if twice.size:
        place = ", ".join(f"{c:g}" for c in slave.corners[twice[0]].mean(axis=0))
        raise PairingError(
            f"{twice.size} of its facets see more than one sheet of the other side within {reach:.3g}, such as that at "
            f"({place}): give a smaller reach"
        )


def _nearest(slave: Surface, master: Surface) -> str:
    """Where both sides are nearest to each other, how far apart, and which way they face there, in words."""
    middles = [side.corners.mean(axis=1) for side in (slave, master)]
    away, others = cKDTree(middles[1]).query(middles[0])
    here = int(away.argmin())
    center = np.full((1, 1, slave.dimension - 1), 1.0 / 3.0)
    normals = [
        side.normals(np.array([facet]), center)[0, 0] for side, facet in ((slave, here), (master, int(others[here])))
    ]
    cosine = normals[0] @ normals[1] / np.prod([np.linalg.norm(normal) for normal in normals])
    size = float(np.abs(middles[0]).max())
    place = ", ".join(f"{c:.4g}" for c in size * np.round(middles[0][here] / size, 9))
    angle = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return (
        f"both are nearest at ({place}), {away[here]:.3g} apart, where their normals enclose {angle:.0f} degrees, of "
        "sides that face each other about 180"
    )


def _gather(points: Indices, values: Array, count: int) -> Array:
    found = np.zeros((count, *values.shape[2:]))
    np.add.at(found, points, values)
    return found


def _products(points: Indices, nodes: Indices, weighted: Array, shape: Array, rows: int, columns: int) -> sp.csr_array:
    """Integrals of test times shape functions."""
    return _sparse(points, nodes, np.einsum("pqi,pqj->pij", weighted, shape), rows, columns)


def _sparse(points: Indices, nodes: Indices, values: Array, rows: int, columns: int) -> sp.csr_array:
    here, there = (np.broadcast_to(at, values.shape) for at in (points[:, :, None], nodes[:, None]))
    return sp.csr_array(sp.coo_array((values.ravel(), (here.ravel(), there.ravel())), shape=(rows, columns)))


def _over_ranks(comm: MPI.Comm, matrix: sp.csr_array) -> sp.csr_array:
    """The sum of the matrices of all ranks, on every rank."""
    if comm.size == 1:
        return matrix
    part = matrix.tocoo()
    at = parallel.gather_rows(comm, np.column_stack((part.row, part.col)))
    return sp.csr_array(sp.coo_array((parallel.gather_rows(comm, part.data), tuple(at.T)), shape=matrix.shape))


def _clean(matrix: sp.csr_array) -> sp.csr_array:
    """Without the round-off of what is zero; entries have no unit."""
    matrix.data[np.abs(matrix.data) < _ROUND_OFF] = 0.0
    matrix.eliminate_zeros()
    return matrix


def _turning(arms: sp.csr_array, x: Array, distance: Array) -> sp.csr_array:
    """Omega_i(u_m) x d_i as a matrix, see ``Coupling.turning``; ``arms``: a_il, shape (n, nodes)."""
    arms.sort_indices()
    count, dim = distance.shape
    row = np.repeat(np.arange(count), np.diff(arms.indptr))
    a, seen = arms.data, x[arms.indices]
    middle = np.zeros((count, dim))
    np.add.at(middle, row, a[:, None] * seen)
    middle /= np.bincount(row, a, minlength=count)[:, None]
    r, d = seen - middle[row], distance[row]
    if dim == 2:
        polar = np.bincount(row, a * np.einsum("ld,ld->l", r, r), minlength=count)[row]
        omega = (a / polar)[:, None] * np.stack((-r[:, 1], r[:, 0]), axis=1)
        blocks = np.stack((-d[:, 1], d[:, 0]), axis=1)[:, :, None] * omega[:, None, :]
    else:
        inertia: Array = np.zeros((count, 3, 3))
        squares = np.einsum("ld,ld->l", r, r)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None, :]
        np.add.at(inertia, row, a[:, None, None] * squares)
        inverse = np.asarray(np.linalg.pinv(inertia, rcond=_NO_ARM, hermitian=True), dtype=np.float64)
        blocks = -_crossing(d) @ inverse[row] @ (a[:, None, None] * _crossing(r))
    of_rows = row[:, None, None] * dim + np.arange(dim)[:, None]
    of_columns = arms.indices[:, None, None] * dim + np.arange(dim)
    at = tuple(np.broadcast_to(places, blocks.shape).ravel() for places in (of_rows, of_columns))
    return _clean(sp.csr_array(sp.coo_array((blocks.ravel(), at), shape=(count * dim, len(x) * dim))))


def _crossing(vectors: Array) -> Array:
    """The matrices of v x ., shape (n, 3, 3)."""
    found = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    found[:, 0, 1], found[:, 0, 2], found[:, 1, 2] = -z, y, -x
    return found - found.transpose(0, 2, 1)
