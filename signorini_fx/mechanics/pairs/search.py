"""Which facets of both sides can meet: they are near, and face each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from signorini_fx.tuned import DEEPEST_OVERLAP, FACING_SIDES, SAME_LENGTH

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

# Pairs that are tested at once: few, for memory, and enough, for time.
_AT_ONCE = 4096
# Bounds are widened by this factor against round-off.
_WIDENED = 1 + SAME_LENGTH


@dataclass(frozen=True)
class Patches:
    """Flat pictures of pieces of a surface, p of them.

    Attributes:
        corners: positions, length, shape (p, c, d).
        normal: outward unit normals, shape (p, d).
    """

    corners: Array
    normal: Array

    @cached_property
    def centre(self) -> Array:
        """Shape (p, d)."""
        return np.asarray(self.corners.mean(axis=1))

    @cached_property
    def radius(self) -> Array:
        """Of a ball around the centre, shape (p,)."""
        return np.asarray(np.linalg.norm(self.corners - self.centre[:, None], axis=2).max(axis=1))


def default_reach(slave: Array, master: Array) -> float:
    """A distance beyond which facets cannot come into contact, length: the smallest distance of both sides, and a share
    of the size of the smaller one, twice the largest distance from its middle, which does not depend on the axes.

    Args:
        slave: positions of the nodes of the one side, shape (n, d).
        master: those of the other one.
    """
    nearest = float(cKDTree(master).query(slave)[0].min())
    sizes = [2.0 * float(np.linalg.norm(x - x.mean(axis=0), axis=1).max()) for x in (slave, master)]
    return nearest + DEEPEST_OVERLAP * min(sizes)


def candidates(slave: Patches, master: Patches, reach: float, turning: Array) -> tuple[Indices, Indices]:
    """Pairs of patches that face each other, one over the other as the slave's normal sees it, and within reach.

    The slave is halved again and again.  Each part keeps those patches of the master that may belong to some patch of
    it, so that neither time nor memory grow with the product of both sides.

    Args:
        slave: patches of the one side.
        master: those of the other one.
        reach: length.
        turning: tangent of the angle between the directions of projection and the normal of each patch of the slave,
            shape (p,).

    Returns:
        Numbers of the slave and of the master patch of each pair, ascending, shape (m,) each.
    """
    search = _Search(slave, master, reach, turning)
    pairs: list[tuple[Indices, Indices]] = []
    parts: list[tuple[Indices, Indices]] = []
    if len(slave.corners) and len(master.corners):
        parts.append((np.arange(len(slave.corners)), np.arange(len(master.corners))))
    while parts:
        part, master_part = parts.pop()
        master_part = search.near(part, master_part)
        if part.size > 1 and part.size * master_part.size > _AT_ONCE:
            parts += [(half, master_part) for half in search.halves(part)]
        elif master_part.size:
            pairs += search.tested(part, master_part)
    slave_numbers, master_numbers = np.concatenate(pairs, axis=1) if pairs else np.zeros((2, 0), dtype=np.int64)
    order = np.lexsort((master_numbers, slave_numbers))
    return slave_numbers[order], master_numbers[order]


@dataclass(frozen=True)
class _Search:
    """What pairs of patches are tested with, by balls around them.

    Attributes:
        slave: the patches of the one side.
        master: those of the other one.
        reach: length.
        turning: of each patch of the slave, shape (p,).
    """

    slave: Patches
    master: Patches
    reach: float
    turning: Array

    @cached_property
    def away(self) -> Array:
        """Distance from its centre beyond which a patch of the slave has no partner, length, shape (p,)."""
        return np.asarray(self.slave.radius + float(self.master.radius.max(initial=0.0)) + self.reach)

    def tested(self, part: Indices, master_part: Indices) -> list[tuple[Indices, Indices]]:
        """The pairs of a part of the slave with some patches of the master, some at a time."""
        pairs = []
        for chunk in np.array_split(master_part, -(-part.size * master_part.size // _AT_ONCE)):
            slave_numbers, master_numbers = np.repeat(part, chunk.size), np.tile(chunk, part.size)
            normal = self.slave.normal[slave_numbers]
            apart = self.master.centre[master_numbers] - self.slave.centre[slave_numbers]
            beyond = self.slave.radius[slave_numbers] + self.master.radius[master_numbers]
            along = np.einsum("md,md->m", apart, normal)
            turning = self.turning[slave_numbers]
            across = np.linalg.norm(apart - along[:, None] * normal, axis=1) - turning * np.abs(along)
            facing = np.einsum("md,md->m", normal, self.master.normal[master_numbers]) < FACING_SIDES
            near = facing & (across <= _aslant(turning) * beyond) & (np.abs(along) <= self.reach + beyond)
            near &= np.linalg.norm(apart, axis=1) <= self.away[slave_numbers]
            pairs.append((slave_numbers[near], master_numbers[near]))
        return pairs

    def halves(self, part: Indices) -> tuple[Indices, Indices]:
        """A part of the slave, cut across where it is longest."""
        centre = self.slave.centre[part]
        order = np.argpartition(centre[:, np.ptp(centre, axis=0).argmax()], part.size // 2)
        return part[order[: part.size // 2]], part[order[part.size // 2 :]]

    def near(self, part: Indices, master_part: Indices) -> Indices:
        """Those patches of the master that may be in a pair with some patch of a part of the slave, and a few more.

        Let the normals of the part enclose angles up to t with their mean n.  From a patch of the part to a partner of
        it the way has a along the patch's own normal and b across it, at most.  Then it has at most b + a sin t across
        n, and a + b sin t along n; conversely a is at most what it has along n plus sin t times what it has across n.
        The part is in a cylinder around n, which is as much larger.
        """
        centre = self.slave.centre[part].mean(axis=0)
        arms, apart = self.slave.centre[part] - centre, self.master.centre[master_part] - centre
        size = float(np.linalg.norm(arms, axis=1).max())
        near = np.linalg.norm(apart, axis=1) <= _WIDENED * (size + float(self.away[part].max()))
        mean = self.slave.normal[part].mean(axis=0)
        length = float(np.linalg.norm(mean))
        axis = mean / length if length > 0 else mean
        cosine = min(1.0, float((self.slave.normal[part] @ axis).min()))
        if cosine <= 0:
            return master_part[near]
        master_part, apart = master_part[near], apart[near]
        sine = np.sqrt(1.0 - cosine**2)
        facing = (
            self.master.normal[master_part] @ axis
            < FACING_SIDES * cosine + np.sqrt(1.0 - FACING_SIDES**2) * sine + _WIDENED - 1.0
        )
        height, arms_height = apart @ axis, arms @ axis
        width = np.linalg.norm(apart - height[:, None] * axis, axis=1)
        own_width = float(np.linalg.norm(arms - arms_height[:, None] * axis, axis=1).max())
        own_height = float(np.abs(arms_height).max())
        beyond = float(self.slave.radius[part].max()) + self.master.radius[master_part]
        turning = float(self.turning[part].max())
        along = np.minimum(self.reach + beyond, np.abs(height) + own_height + (width + own_width) * sine)
        across = turning * along + float(_aslant(np.array(turning))) * beyond
        near = facing & (width <= _WIDENED * (own_width + across + along * sine))
        near &= np.abs(height) <= _WIDENED * (own_height + along + across * sine)
        return master_part[near]


def _aslant(turning: Array) -> Array:
    """By how much further away across the normal a partner may be whose ball is met along a direction that encloses an
    angle with this normal; ``turning``: its tangent.
    """
    return np.asarray(1.0 + turning**2 / np.sqrt(1.0 + turning**2))
