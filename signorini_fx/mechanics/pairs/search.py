"""Search for the facets of both sides that can meet: those that are near and face each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Ints, inner
from signorini_fx.mechanics.pairs.pair_side import PairSurface, across
from signorini_fx.tuned import DEEPEST_OVERLAP, FACING_SIDES, SAME_LENGTH

# At most so many balls reach from a patch to its farthest partners: few, for time, and enough, for
# memory.
_BALLS = 16


@dataclass(frozen=True)
class Patches:
    """Flat pieces of a surface, p of them.

    Attributes:
        corners: positions, length, shape (p, c, d).
        normal: outward unit normals at their middles, shape (p, d).
    """

    corners: Array
    normal: Array

    @cached_property
    def centre(self) -> Array:
        """The mean of the corners of each patch, length, shape (p, d)."""
        return self.corners.mean(axis=1)

    @cached_property
    def radius(self) -> Array:
        """The radius of a ball around the centre that contains the patch, length, shape (p,)."""
        return np.linalg.norm(self.corners - self.centre[:, None], axis=2).max(axis=1)

    @cached_property
    def tree(self) -> cKDTree:
        """The search tree of the centres."""
        return cKDTree(self.centre)

    @property
    def focus(self) -> Array:
        """Return one over the distance at which normals meet in front of each patch, shape (p,);
        zero here: flat.
        """
        return np.zeros(len(self.corners))

    @property
    def wall(self) -> Array:
        """The thickness of the body behind each patch, length, shape (p,); infinite here."""
        return np.full(len(self.corners), np.inf)


@dataclass(frozen=True)
class Parts(Patches):
    """The linear parts of the facets of a side.

    ``facet``: number of the facet of each part, shape (p,); ``reference``: the corners of each part
    in
        its reference facet, shape (p, c, d - 1).
    """

    side: PairSurface
    facet: Ints
    reference: Array

    @property
    def focus(self) -> Array:
        """How concave a deformed side is at each part, see ``PairSurface.focus``; zero if
        undeformed.
        """
        return super().focus if self.side.undeformed is None else self.side.focus[self.facet]

    @property
    def wall(self) -> Array:
        """The thickness of the body behind each part, see ``PairSurface.wall``."""
        return super().wall if self.side.wall is None else self.side.wall[self.facet]

    @classmethod
    def of(cls, side: PairSurface, facets: Ints) -> Parts:
        """Return the parts of some facets."""
        parts = side.functions.parts
        facet = np.repeat(facets, len(parts))
        reference = np.tile(parts, (len(facets), 1, 1))
        corners = (side.functions.values(parts) @ side.corners[facets, None]).reshape(
            facet.size, parts.shape[1], side.dimension
        )
        linear = side.functions.linear
        normal = across(linear.slopes(linear.places.mean(axis=0)[None])[:, None] @ corners)[:, 0]
        normal *= (side.sign[facet] / np.linalg.norm(normal, axis=1))[:, None]
        return cls(corners, normal, side, facet, reference)


def default_reach(slave: Array, master: Array) -> float:
    """Return a distance beyond which facets cannot come into contact, length.

    It is the smallest distance between the nodes of both sides plus a fraction of the size of the
    smaller side.  The size is twice the largest distance from its mean, which does not depend on
    the axes.

    Args:
        slave: positions of the nodes of one side, shape (n, d).
        master: positions of the nodes of the other side.
    """
    nearest = float(cKDTree(master).query(slave)[0].min())
    sizes = [2.0 * float(np.linalg.norm(x - x.mean(axis=0), axis=1).max()) for x in (slave, master)]
    return nearest + DEEPEST_OVERLAP * min(sizes)


def candidates(slave: Patches, master: Patches, reach: float, turning: Array) -> tuple[Ints, Ints]:
    """Return the pairs of patches that can meet: they face each other, overlap as seen along the
    slave's normal, and lie within ``reach``, length.

    Both arrays of numbers have shape (m,), in ascending order.  A partner is nearer than the point
    where normals of a concave side cross, and not behind the middle of the slave's own wall.

    ``turning``: tangent of the angle between the direction of projection and the normal of each
    slave
        patch, shape (p,).
    """
    if not len(slave.corners) or not len(master.corners):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    # How much further away across the normal a partner may be whose ball is met along a direction
    # aslant.
    aslant = 1.0 + turning**2 / np.sqrt(1.0 + turning**2)
    tree = master.tree
    count = len(master.centre)
    largest = float(master.radius.max())
    farthest = slave.radius + largest + reach
    balls = min(int(np.ceil(farthest.max() / largest)), _BALLS)
    height = farthest / balls  # of balls around the normal of each patch, over it and under it
    middle = height * np.arange(1 - balls, balls, 2)[:, None]
    across = aslant * (slave.radius + largest) + turning * (np.abs(middle) + height)
    middles = slave.centre + middle[..., None] * slave.normal
    radii = (1.0 + SAME_LENGTH) * np.hypot(across, height)
    number, patch = np.nonzero(
        np.maximum(tree.mins - middles, middles - tree.maxes).max(axis=2) <= radii
    )
    found = tree.query_ball_point(middles[number, patch], radii[number, patch])
    first = np.repeat(patch, [len(numbers) for numbers in found])
    second = np.fromiter(chain.from_iterable(found), dtype=np.int64)
    first, second = np.divmod(np.unique(first * count + second), count)
    normal = slave.normal[first]
    apart = master.centre[second] - slave.centre[first]
    beyond = slave.radius[first] + master.radius[second]
    along = inner(apart, normal)
    across = np.linalg.norm(apart - along[:, None] * normal, axis=1) - turning[first] * np.abs(
        along
    )
    near = inner(normal, master.normal[second]) < FACING_SIDES
    near &= (across <= aslant[first] * beyond) & (np.abs(along) <= reach + beyond)
    near &= np.linalg.norm(apart, axis=1) <= farthest[first]
    near &= np.abs(along) * np.maximum(slave.focus[first], master.focus[second]) < 1.0
    near &= 2.0 * along > -slave.wall[first]
    return first[near], second[near]
