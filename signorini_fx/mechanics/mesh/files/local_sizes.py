"""Cells of a drawing that are shorter where bodies touch: a mesh as it is without them, and the lengths on it.

The mesh tells where a boundary is, so that it may be a part of a surface, or several.  No dolfinx here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.mesh.files.cells import Cell
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.mechanics.mesh.files.size_field import SizeField
from signorini_fx.mechanics.statement.contact_sizes import ContactSize
from signorini_fx.tuned import FACET_SAMPLES, LONGEST_FACET, SIZE_GROWTH


def lengths_of(mesh: MeshArrays) -> SizeField:
    """The lengths that the cells of a mesh have: at each corner the mean of the edges around it."""
    used, corners = np.unique(mesh.corners, return_inverse=True)
    cells, points = corners.reshape(mesh.corners.shape), mesh.points[used]
    ends = np.concatenate([cells[:, pair] for pair in edges_of(mesh.cell)])
    lengths = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    total = np.bincount(ends.ravel(), np.repeat(lengths, 2), minlength=used.size)
    return SizeField(points, cells, total / np.bincount(ends.ravel(), minlength=used.size))


def graded(field: SizeField, places: Floats, size: float) -> SizeField:
    """The same with ``size`` at some places, and from there on no more than ``SIZE_GROWTH`` per length larger."""
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(places).query(field.points)
    return replace(field, sizes=np.minimum(field.sizes, size + SIZE_GROWTH * distance))


def edges_of(cell: Cell) -> list[list[int]]:
    """The ends of each edge of a cell, by the numbers of its corners."""
    pairs = combinations(range(len(cell.corners)), 2)
    ends = np.array(cell.corners)
    return [list(pair) for pair in pairs if cell.simplex or np.abs(ends[pair[0]] - ends[pair[1]]).sum() == 1]


def contact_field(mesh: MeshArrays, wanted: Sequence[ContactSize]) -> SizeField | None:
    """The lengths that cells have, and shorter ones at boundaries in contact; None if the mesh has none of these.

    Args:
        mesh: as it is without them.
        wanted: the lengths of facets.

    Raises:
        SceneError: no facet of a boundary is longer than it is to be.
    """
    field = lengths_of(mesh)
    present = [size for size in wanted if mesh.boundaries.get(size.boundary, np.empty(0)).size]
    for size in present:
        longest = float(_longest_edges(mesh, size.boundary).max())
        if longest < size.size:
            message = f"the facets of {size.boundary!r} are no longer than {longest:.3g} without it: give less"
            raise SceneError([(size.path, message)])
        field = graded(field, _sampled(mesh, size.boundary), size.size)
    return field if present else None


def check_contact_sizes(mesh: MeshArrays, wanted: Sequence[ContactSize], cure: str) -> None:
    """Refuse a mesh whose boundaries do not have the facets that were asked for.

    Args:
        mesh: made by ``contact_field``.
        wanted: the lengths of facets.
        cure: what to change where gmsh could not do it.

    Raises:
        SceneError: half of the facets of a boundary are much longer.
    """
    for size in wanted:
        if mesh.boundaries.get(size.boundary, np.empty(0)).size:
            middle = float(np.median(_longest_edges(mesh, size.boundary)))
            if middle > LONGEST_FACET * size.size:
                message = f"gmsh has made facets of {middle:.3g} of {size.boundary!r}: {cure}"
                raise SceneError([(size.path, message)])


def _longest_edges(mesh: MeshArrays, boundary: str) -> Floats:
    """The longest edge of each facet of a boundary, shape (f,)."""
    x = mesh.points[mesh.facet_corners[mesh.boundaries[boundary]]]
    return np.asarray(np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(axis=1))


def _sampled(mesh: MeshArrays, boundary: str) -> Floats:
    """Places on the facets of a boundary, from corner to corner, shape (n, d)."""
    facet = mesh.facet
    steps = [np.linspace(0.0, 1.0, FACET_SAMPLES + 1)] * facet.dim
    x = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, facet.dim)
    if facet.simplex:
        x = x[x.sum(axis=1) < 1 + 1e-9]
    corners = mesh.points[mesh.facet_corners[mesh.boundaries[boundary]]]
    return np.asarray(np.einsum("pc,fcd->fpd", facet.weights(x), corners).reshape(-1, mesh.dim))
