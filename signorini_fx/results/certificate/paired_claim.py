"""What the solver says of a pair of bodies, for the certificate, which tries it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.mechanics.assembly.averages import from_owners, to_owners
from signorini_fx.mechanics.obstacles.paired_points import PairedSides
from signorini_fx.tuned import SLIVER

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]


@dataclass(frozen=True)
class Claim:
    """What the solver claims of a pair with n contact points on this rank, made of m nodes of all ranks.

    Attributes:
        space: of the displacement; methods that take or give values at nodes are collective.
        pair: both sides as the solver has paired them.
        slave: owned facets of the side with the points, local numbers, as the problem names them.
        master: those of the other side.
        points: local node of each point, shape (n,).
        reached: global numbers of the m nodes, ascending.
        own: D, scipy sparse, shape (n, m).
        others: M, scipy sparse, shape (n, m).
        operator: the relative displacement from displacements of these nodes, scipy sparse, shape (n d, m d).
        fixed_part: what of it supports fix, with the other sign, likewise; None: nothing.
        allowed: distance beyond which facets are no partners, as the problem names it, length; None: the usual one.
        across: projectors onto the directions across planes of symmetry, of which ``operator``, traction and normal
            have no component, shape (n, d, d).
        planes: the same by the global numbers of all nodes of both sides on such planes.
        nominal: whether the problem says that the sides are nominally in contact, or tied.
        bonded: whether it says that they are tied.
        factor: by what it says that areas are multiplied, at the nodes of this rank, shape (nodes,); None: 1.
        measure: by what the problem says that areas are multiplied, at the nodes of the slave, shape (N,); None: 1.
        followed: displacements of the nodes of this rank, which turn the normals as the master turns, length, shape
            (nodes, d); None: the normals are those of the undeformed sides.
        displaced: whether the points of the boundary are where the displacement has moved the sides.
    """

    space: fem.FunctionSpace
    pair: PairedSides
    slave: Indices
    master: Indices
    points: npt.NDArray[np.int64]
    reached: npt.NDArray[np.int64]
    own: Any
    others: Any
    operator: Any
    allowed: float | None
    across: Array
    planes: Mapping[int, Array]
    nominal: bool
    bonded: bool
    factor: Array | None = None
    measure: Array | None = None
    followed: Array | None = None
    fixed_part: Any = None
    displaced: ClassVar[bool] = False

    @property
    def comm(self) -> MPI.Comm:
        """The ranks."""
        comm: MPI.Comm = self.space.mesh.comm
        return comm

    @property
    def weight(self) -> Array:
        """Area (in 2D: length) of each point times the measure, shape (n,)."""
        return self.pair.coupling.weight

    @property
    def facing(self) -> npt.NDArray[np.bool_]:
        """Which points see the other side: all, shape (n,)."""
        return np.ones(self.points.size, dtype=bool)

    @property
    def distance(self) -> Array:
        """The vectors d from one side to the other at the points, length, shape (n, d)."""
        return self.pair.coupling.distance

    def in_planes(self, nodes: npt.NDArray[np.int64], vectors: Array) -> Array:
        """Vectors at nodes of either side, by global numbers, without what they have across planes of symmetry, and of
        length one; zero where they are, shape (m, d).
        """
        projected = np.array(vectors)
        for row in np.flatnonzero(np.isin(nodes, list(self.planes))):
            projected[row] -= self.planes[int(nodes[row])] @ projected[row]
        size = np.linalg.norm(projected, axis=1, keepdims=True)
        return np.divide(projected, size, out=np.zeros_like(projected), where=size > 0)

    def normal(self, slave: Array, master: Array) -> Array:
        """The mean normals at the points, from unit normals of both sides at the owned nodes, shape (owned nodes, d);
        zero where a node is not on the side.
        """
        reached_values = from_owners(np.column_stack((slave, master)), self.reached, self.comm)
        normals, master_normals = np.split(reached_values, 2, axis=1)
        mean_normals = self.own @ normals - self.others @ master_normals
        mean_normals = mean_normals - np.einsum("nij,nj->ni", self.across, mean_normals)
        return np.asarray(mean_normals / np.linalg.norm(mean_normals, axis=1, keepdims=True))

    def turned(self, normal: Array, initial: Array, present: Array) -> Array:
        """Vectors at the points, shape (n, d), turned as the normals of the master turn at the partners, from unit
        normals of the master at the owned nodes, initial and present ones, shape (owned nodes, d): by two reflections.
        Beside a plane of symmetry the mean has nothing across that, as both halves have partners.
        """
        means = (self.others @ from_owners(normals, self.reached, self.comm) for normals in (initial, present))
        means = (vectors - np.einsum("nij,nj->ni", self.across, vectors) for vectors in means)
        initial_unit, unit = (vectors / np.linalg.norm(vectors, axis=1, keepdims=True) for vectors in means)
        return _reflected(_reflected(normal, initial_unit), initial_unit + unit)

    def gap(self, normal: Array) -> Array:
        """The distance of both sides along normals at the points, without what supports fix, length, shape (n,)."""
        return np.asarray(np.sum(normal * self.distance, axis=1) - self.uncounted)

    @property
    def uncounted(self) -> Array:
        """What the points do not count of the distance of both sides, as supports fix it, length, shape (n,)."""
        fixed = self.pair.coupling.fixed
        if fixed is None:
            return np.zeros(self.points.size)
        slave, master = self.pair.slave.surface.x, self.pair.master.surface.x
        uncounted = fixed.offset + np.sum(fixed.direction * (fixed.master @ master - fixed.slave @ slave), axis=1)
        return np.asarray(self.pair.coupling.fixed_shares @ uncounted)

    @property
    def counted(self) -> Array:
        """What share the points count of a distance that is the same all over, shape (n,)."""
        shares, fixed = self.pair.coupling.fixed_shares, self.pair.coupling.fixed
        return np.ones(self.points.size) if fixed is None else 1.0 - shares @ fixed.slave.sum(axis=1)

    def fixed_gap(self, allowance_at: Callable[[Any], Array]) -> Array:
        """What the points do not count, as supports fix it, of a gap that the problem gives at nodes by their local
        numbers, length, shape (n,); collective.
        """
        fixed = self.pair.coupling.fixed
        if fixed is None:
            return np.zeros(self.points.size)
        at_nodes = nodal_allowance(allowance_at, self.pair.slave.nodes, self.space)
        return np.asarray(self.pair.coupling.fixed_shares @ (fixed.slave @ at_nodes))

    def relative(self, owned: Array) -> Array:
        """The relative displacement at the points from that of the owned nodes, shape (owned nodes, d), without what
        supports fix.
        """
        reached_values = from_owners(owned, self.reached, self.comm).ravel()
        moved = np.asarray(self.operator @ reached_values)
        if self.fixed_part is not None:
            moved = moved + self.fixed_part @ reached_values
        return moved.reshape(self.distance.shape)

    def terms(self, owned: Array) -> Array:
        """The sums of the magnitudes of what ``relative`` adds up, shape (n, d)."""
        reached_values = from_owners(np.abs(owned), self.reached, self.comm)
        return np.asarray(abs(self.operator) @ reached_values.ravel()).reshape(self.distance.shape)

    @property
    def _moves(self) -> Any:
        """One where a node moves a point, scipy sparse, shape (n, m): by its share, or by the turning of the facets
        around it alone, as a quadratic node on an axis of revolution, which has no share of any ring.
        """
        dim, entries = self.distance.shape[1], self.operator.tocoo()
        places = entries.row // dim, entries.col // dim
        moving = sp.csr_array(sp.coo_array((entries.data != 0, places), shape=self.own.shape))
        return moving.astype(bool).astype(np.float64)

    def forces(self, traction: Array, owned: int) -> tuple[npt.NDArray[np.int64], Array, Array]:
        """What tractions at the points, shape (n, d), do to both bodies: owned nodes, forces on them, and their areas;
        ``owned``: how many nodes this rank owns.
        """
        dim = self.distance.shape[1]
        forces = (self.operator.T @ (self.weight[:, None] * traction).ravel()).reshape(-1, dim)
        area = (abs(self.own) + abs(self.others)).maximum(SLIVER * self._moves).T @ self.weight
        nodal_rows = to_owners(np.column_stack((forces, area)), self.reached, self.comm, owned)
        nodes = np.flatnonzero(nodal_rows[:, -1] > 0)
        return nodes, nodal_rows[nodes, :-1], nodal_rows[nodes, -1]

    def on_other_side(self, of_node: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Numbers that the owned nodes have, at a node of the other side that each point meets most, -1 where it meets
        none, shape (n,).
        """
        reached_numbers = from_owners(of_node[:, None].astype(np.float64), self.reached, self.comm)[:, 0].astype(
            np.int64
        )
        shares = abs(self.others).tocsr()
        opposite = np.full(shares.shape[0], -1, dtype=np.int64)
        for row in np.flatnonzero(np.diff(shares.indptr)):
            span = slice(shares.indptr[row], shares.indptr[row + 1])
            opposite[row] = reached_numbers[shares.indices[span][np.argmax(shares.data[span])]]
        return opposite

    def moved(self, flags: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Whether a node that a point depends on has a flag, from shape (owned nodes, d) to shape (n, d)."""
        reached_flags = from_owners(flags.astype(np.float64), self.reached, self.comm)
        return np.asarray((abs(self.own) + abs(self.others)) @ reached_flags > 0)


def nodal_allowance(
    allowance_at: Callable[[Any], Array], nodes: npt.NDArray[np.int64], space: fem.FunctionSpace
) -> Array:
    """Values that are given at local nodes, at nodes of all ranks by their global numbers; collective."""
    first, last = space.dofmap.index_map.local_range
    owned, here = np.zeros((last - first, 1)), nodes[(nodes >= first) & (nodes < last)] - first
    owned[here, 0] = allowance_at(here)
    return from_owners(owned, nodes, space.mesh.comm)[:, 0]


def _reflected(vectors: Array, across: Array) -> Array:
    """Mirror images across planes with normals of any length, shape (n, d)."""
    share = np.sum(vectors * across, axis=1) / np.sum(across * across, axis=1)
    return np.asarray(vectors - 2.0 * share[:, None] * across)


def claim_of(
    pair: PairedSides,
    space: fem.FunctionSpace,
    sides: tuple[Indices, Indices],
    reach: float | None = None,
    *,
    nominal: bool,
    bonded: bool,
    factor: Array | None = None,
) -> Claim:
    """What the solver says of a pair on this rank, whose sides are these facets according to the problem, nominally in
    contact or not, tied or not, with partners up to this distance; None: up to the usual one.

    The measure has a ``factor`` at all nodes of this rank, shape (nodes,); None: 1.
    """
    owned, measure = space.dofmap.index_map.size_local, None
    if factor is not None:
        measure = from_owners(np.nan_to_num(factor[:owned, None]), pair.slave.nodes, space.mesh.comm)[:, 0]
    coupling, (slave_shares, master_shares, turning) = pair.coupling, pair.shares()
    return Claim(
        space=space,
        pair=pair,
        slave=sides[0],
        master=sides[1],
        points=pair.slave.nodes[coupling.nodes] - space.dofmap.index_map.local_range[0],
        reached=pair.reached,
        own=slave_shares,
        others=master_shares,
        operator=sp.csr_array(
            sp.kron(slave_shares - master_shares, sp.eye_array(coupling.distance.shape[1])) + turning
        ),
        allowed=reach,
        across=pair.across,
        planes=pair.planes,
        nominal=nominal,
        bonded=bonded,
        factor=factor,
        measure=measure,
        fixed_part=pair.fixed_rows,
    )
