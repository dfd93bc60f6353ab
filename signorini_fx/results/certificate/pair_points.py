"""The points of pairs of bodies for the certificate: identities of the map of the pair at the displacement of a result.

A wrong map is the same in each run: the oracle and tests compare it to integrals of their own.  Here its identities
are tried, which ranks, restarts or a changed entry would break.  At all points

    D 1 = M 1 = 1,   D x - M x + d = 0,   B R = 0 for every joint rigid motion R,

so that forces and moments of both sides balance, and the weights add up to the area where both sides meet.  Where
normals follow deformed sides, a rotation R leaves B R = - R d, as the distance turns with the sides.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.obstacles.paired_points import FacingSides, MovingPair, PairedSides, SlidingSides
from signorini_fx.mechanics.rigid.rigid_motions import rigid_modes

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.int64]


class PairPoints(Protocol):
    """The n contact points of a pair on this rank; methods are collective; ``displaced``: whether they are where the
    displacement has moved the sides.
    """

    displaced: ClassVar[bool]

    @property
    def across(self) -> Array:
        """Projectors onto the directions across planes of symmetry, shape (n, d, d)."""

    def relative(self, owned: Array, normal: Array) -> Array | None:
        """The relative displacement from that of the owned nodes, shape (n, d); None: it is that of the boundary."""

    def on_other_side(self, of_node: Numbers) -> Numbers:
        """Numbers that the owned nodes have, at a node of the other side that each point meets most, shape (n,)."""

    def least_area(self) -> Array:
        """Areas of the owned nodes of the space on which the pair may act beside its points."""

    def error(self) -> float:
        """The largest error of the identities of the map, relative to one, to weights, or to the size of the sides."""


@dataclass(frozen=True)
class FrozenPoints(PairPoints):
    """Those of a pair whose points keep the partners that they have where both sides are undeformed."""

    pair: PairedSides
    displaced: ClassVar[bool] = False

    @property
    def across(self) -> Array:
        return self.pair.across

    def relative(self, owned: Array, normal: Array) -> Array | None:
        return None

    def on_other_side(self, of_node: Numbers) -> Numbers:
        return _met_most(self.pair.coupling.master, self.pair, of_node)

    def least_area(self) -> Array:
        return np.zeros(self.pair.space.dofmap.index_map.size_local)

    def error(self) -> float:
        coupling, slave, master = self.pair.coupling, self.pair.slave.surface.x, self.pair.master.surface.x
        x, left, dim = np.concatenate((slave, master)), None, slave.shape[1]
        size = _size_of(x)
        if self.pair.followed:
            turned = -rigid_modes(coupling.distance, np.zeros(dim), np.array(size)).transpose(2, 0, 1)[dim:]
            left = turned - np.einsum("nij,knj->kni", self.across, turned)
        everywhere = np.ones(coupling.weight.size, dtype=bool)
        joined = self.pair.relative, coupling.weight, coupling.covered
        errors = _identities(self.pair, x, joined, left, (everywhere, everywhere))
        errors += [_largest(part.sum(axis=1) - 1.0) for part in (coupling.slave, coupling.master)]
        errors.append(_largest(coupling.slave @ slave - coupling.master @ master + coupling.distance) / size)
        return parallel.global_max(self.pair.space.mesh.comm, float(max(errors)))


@dataclass(frozen=True)
class SlidingPoints(PairPoints):
    """Those of sides that slide on each other, where the displacement has moved them."""

    pair: MovingPair
    displaced: ClassVar[bool] = True

    @property
    def sides(self) -> SlidingSides:
        """Both, undeformed."""
        return self.pair.sides

    @property
    def across(self) -> Array:
        return self.sides.across[self.sides.mine]

    def relative(self, owned: Array, normal: Array) -> Array:
        """Along the normal the distance, negative, and across it the slip since the step began."""
        pair, sides = copy(self.pair), self.sides
        pair.move(owned)
        slip = sides.sliding_along(pair.coupling, pair.slip)
        return np.where(pair.alone[:, None], 0.0, slip) - pair.gap[sides.mine][:, None] * normal

    def on_other_side(self, of_node: Numbers) -> Numbers:
        return _met_most(self.pair.coupling.frames.master[self.sides.mine], self.sides, of_node)

    def least_area(self) -> Array:
        """What turns directions acts on the neighbours of points on the slave, too."""
        sides, area = self.sides, np.zeros(self.sides.space.dofmap.index_map.size_local)
        mine = np.flatnonzero(sides.slave.owned(sides.space))
        area[sides.local(mine)] = 0.5 * sides.slave.surface.area[mine]
        return area

    def error(self) -> float:
        """A plane of symmetry that holds the direction of rays takes a moment, too."""
        coupling, mine, in_plane = self.pair.coupling, self.sides.mine, np.zeros(len(self.sides.nodes))
        frames, dim = coupling.frames, coupling.slave.x.shape[1]
        facing = frames.partnered[mine]
        if not frames.partnered.any():
            return 0.0
        averages = self.sides.boundary(coupling).averages
        in_plane[: len(coupling.slave.x)] = self.sides.slave.surface.across.any(axis=(1, 2))
        held = (abs(averages.operator) @ np.repeat(in_plane, dim)).reshape(-1, dim).any(axis=1)
        x = np.concatenate((coupling.slave.x, coupling.master.x))
        weight = np.where(facing, coupling.weight[mine], 0.0)
        errors = _identities(
            self.sides, x, (averages.operator, weight, coupling.covered), None, (facing, facing & ~held)
        )
        errors += [_largest(part[mine].sum(axis=1)[facing] - 1.0) for part in (frames.slave, frames.master)]
        return parallel.global_max(self.sides.space.mesh.comm, float(max(errors)))


def _identities(
    sides: FacingSides, x: Array, joined: tuple[Any, Array, float], left: Array | None, counted: tuple[Flags, Flags]
) -> list[float]:
    """Errors on this rank of weights and joint rigid motions.

    Args:
        sides: both.
        x: places of their m nodes, length, shape (m, d).
        joined: the relative displacement from that of the nodes, sparse, shape (n d, m d), the weights of the points,
            shape (n,), and the area where both sides meet.
        left: what joint rotations leave of relative displacements, per size of the sides, shape (k, n, d); None:
            nothing.
        counted: the points at which translations leave nothing, and those at which rotations leave nothing else, of
            shape (n,).
    """
    (operator, weight, covered), dim = joined, x.shape[1]
    total = float(parallel.global_sum(sides.space.mesh.comm, weight.sum()))
    errors = [abs(total / covered - 1.0), parallel.local_max(-weight, -np.inf) / covered]
    middle = (x.min(axis=0) + x.max(axis=0)) / 2
    # Translations, and rotations that move the ends of the sides by about one.
    for number, motion in enumerate(rigid_modes(x, middle, np.array(_size_of(x))).transpose(2, 0, 1)):
        moved = (operator @ motion.ravel()).reshape(-1, dim)
        if number >= dim and left is not None:
            moved = moved - left[number - dim]
        errors.append(_largest(moved[counted[number >= dim]]))
    return errors


def _met_most(master: Any, sides: FacingSides, of_node: Numbers) -> Numbers:
    """Numbers of the nodes that points meet most, shape (n,); ``master``: M, sparse, shape (n, nodes of the master)."""
    numbers = from_owners(of_node[:, None].astype(np.float64), sides.master.nodes, sides.space.mesh.comm)[:, 0]
    shares = abs(master).tocsr()
    opposite = np.full(shares.shape[0], -1, dtype=np.int64)
    for row in np.flatnonzero(np.diff(shares.indptr)):
        span = slice(shares.indptr[row], shares.indptr[row + 1])
        opposite[row] = numbers[shares.indices[span][np.argmax(shares.data[span])]]
    return opposite


def _size_of(x: Array) -> float:
    """The diagonal of the box around places, which are those of all ranks."""
    return float(np.linalg.norm(np.ptp(x, axis=0)))


def _largest(values: Array) -> float:
    """The largest magnitude."""
    return float(np.max(np.abs(values), initial=0.0))
