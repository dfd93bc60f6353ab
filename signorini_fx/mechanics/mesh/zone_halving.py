"""The mesh of a body with the cells around some points halved: what is near them is seen more finely.

Straight facets of a curved boundary are divided on a smooth curve or surface through their nodes, as those of a finer
mesh of it would be; curved cells are divided on their own geometry.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from itertools import pairwise

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.distribution import kind_of_mesh
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.mesh.files.shape import Floats, check_shape
from signorini_fx.mechanics.mesh.halving import edges_of, halved_in_part
from signorini_fx.mechanics.mesh.smooth_middles import pairs_of, sides_of_facets, smooth_middles
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, arrays_of, from_arrays
from signorini_fx.tuned import SAME_LENGTH


def has_divisible_zone(tagged: TaggedMesh) -> bool:
    """Whether ``halved_around`` can divide its cells: those of bodies in the plane or in space, of degree 1 or 2."""
    return tagged.mesh.topology.dim == tagged.mesh.geometry.dim and kind_of_mesh(tagged.mesh) is not None


def halved_around(
    tagged: TaggedMesh,
    points: Floats,
    reach: float,
    curved: Collection[str] = (),
    *,
    times: int = 1,
    everywhere: bool = False,
) -> TaggedMesh:
    """The mesh with all cells halved that come nearer to some points than ``reach``; collective.

    Args:
        tagged: a mesh that ``has_divisible_zone``.
        points: the same on all ranks, length, shape (n, d).
        reach: length.
        curved: boundaries whose straight facets stand for a curve or a curved surface.
        times: how often: each time with half the reach, and only those cells that come so near.
        everywhere: whether the first time all cells are.
    """
    gathered = arrays_of(tagged)

    def make() -> MeshArrays:
        arrays = gathered
        for time in range(times):
            near = cKDTree(points).query(arrays.points, distance_upper_bound=reach / 2**time)[0] < np.inf
            chosen = near[arrays.corners].any(axis=1) | (everywhere and time == 0)
            divided = halved_in_part(arrays, chosen)
            arrays = divided if arrays.degree > 1 else _on_curves(arrays, divided, curved)
        return arrays

    return replace(from_arrays(tagged.mesh.comm, make), origin=tagged.origin)


def _on_curves(coarse: MeshArrays, fine: MeshArrays, curved: Collection[str]) -> MeshArrays:
    """The divided mesh with the new nodes of some boundaries on a smooth curve or surface through the nodes before.

    Raises:
        MeshError: it would turn a cell inside out.
    """
    x, points = coarse.points, fine.points.copy()
    for name in curved:
        facets = coarse.facets[coarse.boundaries[name]]
        boundary_nodes = np.unique(fine.facets[fine.boundaries[name]])  # another body may have a node at the same place
        tree, sides = cKDTree(fine.points[boundary_nodes]), sides_of_facets(facets)
        length = SAME_LENGTH * float(np.linalg.norm(np.diff(x[sides], axis=1), axis=2).max(initial=0.0))
        far, at = tree.query(x[sides].mean(axis=1))
        halved_ones = far <= length
        middles = np.full((len(sides), x.shape[1]), np.nan)
        middles[halved_ones] = smooth_middles(x, facets, sides[halved_ones])
        points[boundary_nodes[at[halved_ones]]] = middles[halved_ones]
        if facets.shape[1] == 4:
            far, at = tree.query(x[facets].mean(axis=1))
            number = {pair: k for k, pair in enumerate(pairs_of(sides))}
            for facet in np.flatnonzero(far <= length):
                around = [int(node) for node in facets[facet]]
                rows = [number[min(a, b), max(a, b)] for a, b in pairwise([*around, around[0]])]
                # The patch of Coons whose sides are the smooth ones.
                points[boundary_nodes[at[facet]]] = middles[rows].sum(axis=0) / 2 - x[around].sum(axis=0) / 4
    _check_not_turned(fine, points)
    return replace(fine, points=points)


def _check_not_turned(mesh: MeshArrays, points: Floats) -> None:
    """Refuse positions of nodes that turn straight cells inside out.

    Raises:
        MeshError: where they do.
    """
    cell = mesh.cell
    at_first = [b for a, b in edges_of(cell) if a == 0]
    straight, smooth = (
        np.sign(np.linalg.det(x[mesh.corners[:, at_first]] - x[mesh.corners[:, :1]])) for x in (mesh.points, points)
    )
    if (straight != smooth).any():
        raise MeshError("cells at a curved boundary cannot be halved: they would turn inside out")
    check_shape(points, mesh.cells, cell, "halved cells in contact")
