"""Which facets of both sides can meet: they are near, and face each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

# Of two sides that face each other the product of the normals is below this.
_FACING = -0.2
# Share of the size of the smaller side within which facets are partners, beyond the smallest distance of both sides.
_REACH = 0.2


@dataclass(frozen=True)
class Patches:
    """Flat pictures of pieces of a surface, p of them.

    Attributes:
        corners: positions, length, shape (p, c, d).
        normal: outward unit normals, shape (p, d).
    """

    corners: Array
    normal: Array

    @property
    def centre(self) -> Array:
        """Shape (p, d)."""
        return np.asarray(self.corners.mean(axis=1))

    @property
    def radius(self) -> Array:
        """Of a ball around the centre, shape (p,)."""
        return np.asarray(np.linalg.norm(self.corners - self.centre[:, None], axis=2).max(axis=1))


def default_reach(slave: Array, master: Array) -> float:
    """A distance beyond which facets cannot come into contact, length: the smallest distance of both sides, and a share
    of the size of the smaller one, because displacements are small.

    Args:
        slave: positions of the nodes of the one side, shape (n, d).
        master: those of the other one.
    """
    nearest = float(cKDTree(master).query(slave)[0].min())
    sizes = [float(np.linalg.norm(np.ptp(x, axis=0))) for x in (slave, master)]
    return nearest + _REACH * min(sizes)


def candidates(slave: Patches, master: Patches, reach: float, turning: float) -> tuple[Indices, Indices]:
    """Pairs of patches that face each other, one over the other as the slave's normal sees it, and within reach.

    Args:
        slave: patches of the one side.
        master: those of the other one.
        reach: length.
        turning: tangent of the angle between the directions of projection and the normal of a patch.

    Returns:
        Numbers of the slave and of the master patch of each pair, ascending, shape (m,) each.
    """
    tree, centre, radius = cKDTree(master.centre), slave.centre, slave.radius
    largest = float(master.radius.max())
    near = tree.query_ball_point(centre, radius + largest + reach)
    counts = np.array([len(found) for found in near], dtype=np.int64)
    here = np.repeat(np.arange(len(centre)), counts)
    there = np.concatenate([np.sort(np.asarray(found, dtype=np.int64)) for found in near]) if counts.any() else here
    normal = slave.normal[here]
    apart = master.centre[there] - centre[here]
    beyond = radius[here] + master.radius[there]
    along = np.einsum("md,md->m", apart, normal)
    across = np.linalg.norm(apart - along[:, None] * normal, axis=1) - turning * np.abs(along)
    facing = np.einsum("md,md->m", normal, master.normal[there]) < _FACING
    kept = facing & (across <= beyond) & (np.abs(along) <= reach + beyond)
    return here[kept], there[kept]
