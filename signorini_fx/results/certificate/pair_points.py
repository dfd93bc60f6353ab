"""Contact points of two bodies in the certificate, and the identities that their coupling must
satisfy at the displacement of a result.

Faults between ranks, in restarts or in an entry would break them.  At all points

    D 1 = M 1 = 1,   D x - M x + d = 0,   B R = 0 for every joint rigid motion R,

so that forces and moments of both sides balance, and the weights add up to the area where both
sides meet.  Where normals follow deformed sides, a rotation R gives B R = - R d, which follows from
the first two.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from signorini_fx.arrays import Array, Flags, Ints, diagonal
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.obstacles.paired_points import FacingSides, MovingPair, PairedSides
from signorini_fx.mechanics.rigid.rigid_motions import rigid_modes

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


@dataclass(frozen=True)
class PairPoints:
    """The n contact points of a pair of bodies on this rank.  Methods are collective."""

    sides: FacingSides  # both sides, undeformed
    slave: csr_matrix  # D, sparse, shape (n, nodes of the slave)
    master: csr_matrix  # M, sparse, shape (n, nodes of the master)
    across: Array  # projectors onto the directions across planes of symmetry, shape (n, d, d)
    kept: PairedSides | None = None  # the pair, if points keep their partners
    moving: MovingPair | None = None  # the pair with displaced sides, if they slide

    @classmethod
    def of(cls, pair: PairedSides | MovingPair) -> PairPoints:
        """Return the contact points of a pair in its current position."""
        if isinstance(pair, PairedSides):
            return cls(
                pair.sides, pair.coupling.slave, pair.coupling.master, pair.across, kept=pair
            )
        on_slave = pair.sides.slave.nodes.size
        both = pair.coupling.frames.both
        return cls(
            pair.sides,
            both[:, :on_slave],
            -both[:, on_slave:],
            pair.across,
            moving=copy(pair),
        )

    @property
    def displaced(self) -> bool:
        """Whether the points are on the displaced sides, as those of sides that slide are."""
        return self.moving is not None

    @staticmethod
    def relative(moving: MovingPair, owned: Array, normal: Array) -> Array:
        """Return the relative displacement at the points, length, shape (n, d): minus the distance
        along the normal, and the slip since the step began across it.

        Args:
            moving: the pair whose sides slide.
            owned: displacements of the owned nodes.
            normal: normals at the points, shape (n, d).
        """
        pair = copy(moving)
        pair.move(owned)
        slip = np.where(pair.alone[:, None], 0.0, pair.sliding_along(pair.slip))
        return slip - pair.coupling.gap[:, None] * normal

    def on_other_side(self, of_node: Ints) -> Ints:
        """Return for each point the number of the node of the other side with the largest weight,
        shape (n,), and -1 without any.

        Args:
            of_node: a number for each owned node, such as that of its piece.
        """
        of_master = from_owners(
            of_node[:, None].astype(np.float64), self.sides.master.nodes, self.sides.space.mesh.comm
        )
        opposite = np.full(self.master.shape[0], -1, dtype=np.int64)
        for row in np.flatnonzero(np.diff(self.master.indptr)):
            span = slice(*self.master.indptr[row : row + 2])
            opposite[row] = of_master[
                self.master.indices[span][np.abs(self.master.data[span]).argmax()], 0
            ]
        return opposite

    def least_area(self) -> Array:
        """Return areas of the owned nodes of the space on which the pair may act beside its points,
        shape (owned nodes,).

        On sides that slide, forces that turn the normals act on the neighbours of points on the
        slave too.
        """
        sides = self.sides
        area = np.zeros(self.sides.space.dofmap.index_map.size_local)
        if self.displaced:
            mine = np.flatnonzero(sides.slave.owned(sides.space))
            area[sides.local(mine)] = 0.5 * sides.slave.surface.area[mine]
        return area

    def error(self) -> float:
        """Return the largest error of the identities of the coupling, relative to one, to weights,
        or to the size of the sides.
        """
        sides = self.sides
        comm = self.sides.space.mesh.comm
        dim = self.across.shape[2]
        errors = list[float]()
        turning = True
        if self.kept is not None:
            coupling = self.kept.coupling
            operator = self.kept.relative
            x = sides.x
            weight = coupling.weight
            covered = coupling.covered
            facing: Flags = np.ones(weight.size, dtype=bool)
            balanced = facing
            turning = not self.kept.followed
            apart = self.slave @ sides.slave.surface.x - self.master @ sides.master.surface.x
            errors.append(_largest(apart + coupling.distance) / _size_of(x))
        else:
            assert self.moving is not None
            found = self.moving.coupling
            facing = ~self.moving.alone
            if not found.seen:
                return 0.0
            operator = self.moving.boundary().averages.operator
            weight = np.where(facing, found.weight, 0.0)
            covered = found.covered
            x = np.concatenate((found.slave.x, found.master.x))
            # A plane of symmetry that holds the direction of rays takes a moment, too.
            in_plane = np.zeros(len(x))
            in_plane[: len(found.slave.x)] = sides.slave.surface.across.any(axis=(1, 2))
            balanced = facing & ~(abs(operator) @ np.repeat(in_plane, dim)).reshape(-1, dim).any(
                axis=1
            )
        errors += [_largest(part.sum(axis=1)[facing] - 1.0) for part in (self.slave, self.master)]
        total = parallel.total(comm, weight)
        errors += [abs(total / covered - 1.0), np.max(-weight, initial=-np.inf) / covered]
        # Translations, and rotations that move the ends of the sides by about one.
        modes = rigid_modes(x, (x.min(axis=0) + x.max(axis=0)) / 2, np.array(_size_of(x)))
        moved = (operator @ modes.reshape(x.size, -1)).reshape(-1, dim, modes.shape[2])
        errors += [
            _largest(moved[facing, :, :dim]),
            _largest(moved[balanced, :, dim:]) if turning else 0.0,
        ]
        return parallel.global_max(comm, float(max(errors)))


def _size_of(x: Array) -> float:
    """Return the diagonal of the bounding box of points, which are those of all ranks."""
    return diagonal(x)


def _largest(values: Array) -> float:
    """Return the largest magnitude."""
    return float(np.max(np.abs(values), initial=0.0))
