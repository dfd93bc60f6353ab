"""Cells of a drawing that are shorter where bodies touch: a mesh as it is without them, and the lengths on it.

The mesh tells where a boundary is, so that it may be a part of a surface, or several.  No dolfinx here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.mesh.files.cells import Cell
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.mechanics.mesh.files.size_field import SizeField
from signorini_fx.mechanics.statement.contact_sizes import ContactSize
from signorini_fx.tuned import FACET_SAMPLES, LONGEST_FACET, MOST_MESHINGS, SIZE_GROWTH


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
    present = [size for size in wanted if mesh.boundaries.get(size.boundary, np.empty(0)).size]
    for size in present:
        longest = float(_longest_edges(mesh, size.boundary).max())
        if longest < size.size:
            message = f"the facets of {size.boundary!r} are no longer than {longest:.3g} without it: give less"
            raise SceneError([(size.path, message)])
    return _graded_at(mesh, present) if present else None


def _graded_at(mesh: MeshArrays, wanted: Sequence[ContactSize]) -> SizeField:
    """The lengths that cells have, and shorter ones at the boundaries that the mesh has."""
    field = lengths_of(mesh)
    for size in wanted:
        if mesh.boundaries.get(size.boundary, np.empty(0)).size:
            field = graded(field, _sampled(mesh, size.boundary), size.size)
    return field


def with_contact_sizes(
    make: Callable[[SizeField | None], MeshArrays],
    finish: Callable[[SizeField | None], MeshArrays],
    wanted: Sequence[ContactSize],
    cure: str,
) -> MeshArrays:
    """A mesh with short facets at those boundaries in contact that it has.

    The chords of a coarse mesh may be far from a curved side, by many of the short facets: then the mesh that was made
    with them is the better one to begin from.

    Args:
        make: makes a mesh of straight cells of these lengths, None: as it is without.
        finish: makes the mesh that is wanted, whose facets may be shorter.
        wanted: the lengths of facets.
        cure: what to change where gmsh cannot make them.

    Raises:
        SceneError: no facet of a boundary is longer than it is to be, or gmsh cannot make such facets.
    """
    field = contact_field(make(None), wanted)
    for attempt in range(MOST_MESHINGS):
        mesh = finish(field)
        longer = None if field is None else _longer_than_asked(mesh, wanted)
        if longer is None:
            return mesh
        if attempt + 1 < MOST_MESHINGS:
            field = _graded_at(make(field), wanted)
    assert longer is not None
    size, middle = longer
    raise SceneError([(size.path, f"gmsh has made facets of {middle:.3g} of {size.boundary!r}: {cure}")])


def _longer_than_asked(mesh: MeshArrays, wanted: Sequence[ContactSize]) -> tuple[ContactSize, float] | None:
    """A boundary half of whose facets are much longer than asked for, and their length; None: there is none."""
    for size in wanted:
        if mesh.boundaries.get(size.boundary, np.empty(0)).size:
            middle = float(np.median(_longest_edges(mesh, size.boundary)))
            if middle > LONGEST_FACET * size.size:
                return size, middle
    return None


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
