"""The points of pairs of bodies for the certificate: the map of the pair, made anew at the displacement of the result.

A wrong map is the same in each run: the oracle and tests compare it to integrals of their own.  Here its identities
are tried, which ranks, restarts or a changed entry would break.  At all points

    D 1 = M 1 = 1,   D x - M x + d = 0,   B R = 0 for every joint rigid motion R,

so that forces and moments of both sides balance, and the weights add up to the area where both sides meet.  Where
normals follow deformed sides, a rotation R leaves B R = - R d, as the distance turns with the sides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners, to_owners
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.obstacles.paired_points import PairedSides
from signorini_fx.mechanics.obstacles.sliding_sides import SlidingSides
from signorini_fx.mechanics.pairs.mortar_coupling import closed_within
from signorini_fx.mechanics.pairs.sliding import SlidingCoupling
from signorini_fx.mechanics.pairs.sparse_maps import beside
from signorini_fx.mechanics.rigid.rigid_motions import rigid_modes
from signorini_fx.tuned import NEGLIGIBLE

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int32]


@dataclass(frozen=True, kw_only=True)
class PairPoints:
    """The n contact points of a pair on this rank, made of m nodes of all ranks; methods are collective.

    Attributes:
        space: of the displacement.
        points: local node of each point, shape (n,).
        weight: area (in 2D: length) of each point times the measure, shape (n,).
        normal: of length one, shape (n, d).
        facing: which points see the other side, and may have tractions, shape (n,).
        across: projectors onto the directions across planes of symmetry, shape (n, d, d).
        reached: global numbers of the m nodes.
        own: D, sparse, shape (n, m).
        others: M, likewise.
        operator: the relative displacement from displacements of these nodes, sparse, shape (n d, m d).
        displaced: whether the points are where the displacement has moved the sides.
    """

    space: fem.FunctionSpace
    points: npt.NDArray[np.int64]
    weight: Array
    normal: Array
    facing: Flags
    across: Array
    reached: npt.NDArray[np.int64]
    own: Any
    others: Any
    operator: Any
    displaced: ClassVar[bool] = False

    @property
    def comm(self) -> MPI.Comm:
        """The ranks."""
        comm: MPI.Comm = self.space.mesh.comm
        return comm

    def gap(self, adjust: float | None) -> Array:
        """The distance of both sides along the normals, zero up to ``adjust``, length, shape (n,)."""
        raise NotImplementedError

    def relative(self, owned: Array) -> Array:
        """The relative displacement at the points from that of the owned nodes, shape (owned nodes, d)."""
        raise NotImplementedError

    def error(self) -> float:
        """The largest error of the identities of the map, relative to one, to weights, or to the size of the sides."""
        raise NotImplementedError

    def _identities(self, x: Array, covered: float, left: Array | None, counted: Flags) -> list[float]:
        """Errors on this rank of shares, weights and joint rigid motions.

        Args:
            x: places of the m nodes, length, shape (m, d).
            covered: the area where both sides meet.
            left: what joint rotations leave of relative displacements, per size of the sides, shape (k, n, d); None:
                nothing.
            counted: the points at which rotations leave nothing else, shape (n,).
        """
        facing, dim = self.facing, self.normal.shape[1]
        total = float(parallel.global_sum(self.comm, self.weight[facing].sum()))
        errors = [abs(total / covered - 1.0), parallel.local_max(-self.weight, -np.inf) / covered]
        errors += [_largest(shares.sum(axis=1)[facing] - 1.0) for shares in (self.own, self.others)]
        for number, motion in enumerate(self._rigid(x)[0]):
            moved = (self.operator @ motion.ravel()).reshape(self.normal.shape)
            if number >= dim and left is not None:
                moved = moved - left[number - dim]
            errors.append(_largest(moved[facing & counted if number >= dim else facing]))
        return errors

    def terms(self, owned: Array) -> Array:
        """The sums of the magnitudes of what relative displacements are added up of, shape (n, d)."""
        reached_values = from_owners(np.abs(owned), self.reached, self.comm)
        return np.asarray(abs(self.operator) @ reached_values.ravel()).reshape(self.normal.shape)

    def forces(self, traction: Array, owned: int) -> tuple[npt.NDArray[np.int64], Array, Array]:
        """What tractions at the points, shape (n, d), do to both bodies: owned nodes, forces on them, and their areas;
        ``owned``: how many nodes this rank owns.
        """
        acting = np.where(self.facing[:, None], self.weight[:, None] * traction, 0.0)
        forces = (self.operator.T @ acting.ravel()).reshape(-1, traction.shape[1])
        nodal_rows = to_owners(np.column_stack((forces, self._areas())), self.reached, self.comm, owned)
        nodes = np.flatnonzero(nodal_rows[:, -1] > 0)
        return nodes, nodal_rows[nodes, :-1], nodal_rows[nodes, -1]

    def on_other_side(self, of_node: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Numbers that the owned nodes have, at a node of the other side that each point meets most, -1 where it meets
        none, shape (n,).
        """
        numbers = from_owners(of_node[:, None].astype(np.float64), self.reached, self.comm)[:, 0].astype(np.int64)
        shares = abs(self.others).tocsr()
        opposite = np.full(shares.shape[0], -1, dtype=np.int64)
        for row in np.flatnonzero(np.diff(shares.indptr)):
            span = slice(shares.indptr[row], shares.indptr[row + 1])
            opposite[row] = numbers[shares.indices[span][np.argmax(shares.data[span])]]
        return opposite

    def moved(self, flags: Flags) -> Flags:
        """Whether a node that a point depends on has a flag, from shape (owned nodes, d) to shape (n, d)."""
        reached_flags = from_owners(flags.astype(np.float64), self.reached, self.comm)
        met = np.asarray((abs(self.own) + abs(self.others)) @ reached_flags > 0)
        return np.asarray(met & self.facing[:, None])

    def _areas(self) -> Array:
        """Areas of the m nodes, shape (m,); a node that moves a point by turning facets alone has a small one."""
        dim, entries = self.normal.shape[1], self.operator.tocoo()
        places = entries.row // dim, entries.col // dim
        moving = sp.csr_array(sp.coo_array((entries.data != 0, places), shape=self.own.shape))
        moves = moving.astype(bool).astype(np.float64)
        return np.asarray((abs(self.own) + abs(self.others)).maximum(NEGLIGIBLE * moves).T @ self.weight)

    def _rigid(self, x: Array) -> tuple[Array, float]:
        """Joint rigid motions of the m nodes at places x, shape (k, m, d): translations first, and rotations that move
        the ends of the sides by about one; and the size of the sides, length.
        """
        low, high = parallel.global_bounds(self.comm, x)
        size = float(np.linalg.norm(high - low))
        return rigid_modes(x, (low + high) / 2, np.array(size)).transpose(2, 0, 1), size


@dataclass(frozen=True, kw_only=True)
class FrozenPoints(PairPoints):
    """Those of a pair whose points keep the partners that they have where both sides are undeformed; ``named``: the
    facets of both sides as the problem names them.
    """

    pair: PairedSides
    named: tuple[Indices, Indices]

    @classmethod
    def of(
        cls, pair: PairedSides, space: fem.FunctionSpace, named: tuple[Indices, Indices], moved: Array | None = None
    ) -> FrozenPoints:
        """Those of a pair as the solver has paired it; ``moved``: displacements of the owned nodes, with which normals
        turn as the master does; None: they are those of the undeformed sides; collective.
        """
        pair = replace(pair, coupling=replace(pair.coupling, normal=pair.undeformed_normals))
        if moved is not None:
            pair = pair.deformed(moved)
        coupling = pair.coupling
        return cls(
            space=space,
            points=pair.local(coupling.nodes).astype(np.int64),
            weight=coupling.weight,
            normal=coupling.normal,
            facing=np.ones(coupling.nodes.size, dtype=bool),
            across=pair.across,
            reached=pair.nodes,
            own=beside(coupling.slave, sp.csr_array(coupling.master.shape)),
            others=beside(sp.csr_array(coupling.slave.shape), coupling.master),
            operator=pair.relative,
            pair=pair,
            named=named,
        )

    def gap(self, adjust: float | None) -> Array:
        return closed_within(self.pair.coupling.gap, adjust)

    def relative(self, owned: Array) -> Array:
        reached_values = from_owners(owned, self.reached, self.comm).ravel()
        return np.asarray(self.operator @ reached_values).reshape(self.normal.shape)

    def error(self) -> float:
        """Both sides consist of the facets that the problem names, no fewer and no others."""
        dim, coupling = self.normal.shape[1], self.pair.coupling
        x = np.array(node_positions(self.space)[: self.space.dofmap.index_map.size_local, :dim], dtype=np.float64)
        used, left = from_owners(x, self.reached, self.comm), None
        size = self._rigid(used)[1]
        if self.pair.followed:
            turned = -rigid_modes(coupling.distance, np.zeros(dim), np.array(size)).transpose(2, 0, 1)[dim:]
            left = turned - np.einsum("nij,knj->kni", self.across, turned)
        errors = self._identities(used, coupling.covered, left, self.facing)
        errors.append(_largest(self.own @ used - self.others @ used + coupling.distance) / size)
        paired = self.pair.slave.facets, self.pair.master.facets
        errors.append(float(any(np.setxor1d(*facets).size for facets in zip(paired, self.named, strict=True))))
        return parallel.global_max(self.comm, float(max(errors)))


@dataclass(frozen=True, kw_only=True)
class SlidingPoints(PairPoints):
    """Those of sides that slide on each other, where the displacement has moved them; ``ends``: displacements of their
    nodes, now and at the beginning of the step, with the maps there.
    """

    sides: SlidingSides
    ends: tuple[tuple[Array, SlidingCoupling], tuple[Array, SlidingCoupling]]
    displaced: ClassVar[bool] = True

    @classmethod
    def of(cls, sides: SlidingSides, ends: tuple[fem.Function, fem.Function | None]) -> SlidingPoints:
        """Those at a displacement; ``ends``: displacements now and at the beginning of the step, None: none;
        collective.
        """
        dim, owned = sides.slave.surface.dimension, sides.space.dofmap.index_map.size_local
        now, begun = (
            np.zeros((sides.nodes.size, dim))
            if function is None
            else sides.gathered(function.x.array.reshape(-1, dim)[:owned])
            for function in ends
        )
        here, before = ((at, sides.at(at)) for at in (now, begun))
        coupling, mine, frames = here[1], sides.mine, here[1].frames
        averages = sides.boundary(coupling).averages
        assert averages is not None
        return cls(
            space=sides.space,
            points=sides.local_points().astype(np.int64),
            weight=coupling.weight[mine],
            normal=coupling.normal[mine],
            facing=frames.partnered[mine],
            across=sides.across[mine],
            reached=sides.nodes,
            own=beside(frames.slave, 0.0 * frames.master)[mine],
            others=beside(0.0 * frames.slave, frames.master)[mine],
            operator=averages.between,
            sides=sides,
            ends=(here, before),
        )

    def gap(self, adjust: float | None) -> Array:
        """Zero: ``relative`` has it."""
        return np.zeros(self.points.size)

    def relative(self, owned: Array) -> Array:
        """Along the normal the distance, negative, and across it the slip since the step began."""
        values, (settled, before) = self.sides.gathered(owned), self.ends[1]
        known = next((coupling for at, coupling in self.ends if np.array_equal(at, values)), None)
        coupling = self.sides.at(values) if known is None else known
        count = self.sides.slave.nodes.size
        places = self.sides.slave.surface.x + settled[:count], self.sides.master.surface.x + settled[count:]
        slip = self.sides.sliding_along(coupling, coupling.slip(coupling.started(before.frames, *places)))
        partnered = coupling.frames.partnered[self.sides.mine]
        gap = np.where(partnered, coupling.gap[self.sides.mine], self.sides.reach)
        return np.where(partnered[:, None], slip, 0.0) - gap[:, None] * self.normal

    def error(self) -> float:
        """A plane of symmetry that holds the direction of rays takes a moment, too."""
        coupling, in_plane = self.ends[0][1], np.zeros(len(self.reached))
        if not coupling.frames.partnered.any():
            return 0.0
        in_plane[: len(coupling.slave.x)] = self.sides.slave.surface.across.any(axis=(1, 2))
        held = (abs(self.operator) @ np.repeat(in_plane, self.normal.shape[1])).reshape(self.normal.shape).any(axis=1)
        x, covered = np.concatenate((coupling.slave.x, coupling.master.x)), float(coupling.overlap.weight.sum())
        return parallel.global_max(self.comm, float(max(self._identities(x, covered, None, ~held))))

    def forces(self, traction: Array, owned: int) -> tuple[npt.NDArray[np.int64], Array, Array]:
        """What turns directions acts on the neighbours of points on the slave, too."""
        nodes, forces, area = super().forces(traction, owned)
        of_nodes = np.zeros((len(self.reached), 1))
        of_nodes[: len(self.sides.slave.nodes), 0] = 0.5 * self.sides.slave.surface.area
        return nodes, forces, np.maximum(area, self.sides.at_owned_nodes(of_nodes)[nodes, 0])


def _largest(values: Array) -> float:
    """The largest magnitude."""
    return float(np.max(np.abs(values), initial=0.0))
