"""The lengths of cells as one background field of gmsh, on a mesh that exists already, by which it makes the next one.

gmsh interpolates the lengths at the corners of that mesh: its size field ``PostView``.  That mesh also tells where a
boundary in contact is, so that it may be a part of a surface, or several.  No dolfinx here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.mesh.files.cells import Cell, Floats, Ints
from signorini_fx.mechanics.statement.mesh_sources import ContactSize
from signorini_fx.tuned import LONGEST_FACET, SIZE_GROWTH

# gmsh's words for the elements of a view, by their dimension and the number of their corners.
_VIEWS = {(2, 3): "ST", (2, 4): "SQ", (3, 4): "SS", (3, 8): "SH"}


@dataclass(frozen=True, eq=False)
class SizeField:
    """Lengths of cells at the corners of a mesh."""

    points: Floats  # positions, shape (n, d)
    cells: Ints  # corners of each cell in gmsh's order, shape (m, c)
    sizes: Floats  # length of the cells at each point, shape (n,)

    def apply(self, gmsh: Any, unit: float = 1.0) -> None:
        """Let the current model of gmsh have cells of these lengths alone, whatever its own settings are.

        Args:
            gmsh: the module.
            unit: length of the model's unit.
        """
        dim = self.points.shape[1]
        x = np.zeros((len(self.points), 3))
        x[:, :dim] = self.points / unit
        # Cells that are divided in the end are twice as long before.
        halved = gmsh.option.getNumber("Mesh.SubdivisionAlgorithm") > 0
        values = self.sizes / unit * (2.0 if halved else 1.0)
        rows = np.concatenate([x[self.cells].transpose(0, 2, 1).reshape(len(self.cells), -1), values[self.cells]], 1)
        view = gmsh.view.add("sizes")
        gmsh.view.addListData(view, _VIEWS[dim, self.cells.shape[1]], len(self.cells), rows.ravel())
        fields = gmsh.model.mesh.field
        number = fields.add("PostView")
        fields.setNumber(number, "ViewTag", view)
        fields.setAsBackgroundMesh(number)
        for option in ("ExtendFromBoundary", "FromPoints", "FromCurvature", "FromParametricPoints", "Min"):
            gmsh.option.setNumber(f"Mesh.MeshSize{option}", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFactor", 1)
        gmsh.option.setNumber("Mesh.MeshSizeMax", float(values.max()))


# Lengths of the facets of some boundaries, or of all cells.
Sizes = Sequence[ContactSize] | SizeField


def with_sizes(
    gmsh: Any,
    make: Callable[[], MeshArrays],
    finish: Callable[[], MeshArrays],
    sizes: Sizes,
    cure: str,
    unit: float = 1.0,
) -> MeshArrays:
    """The mesh of the current model with cells of some lengths.

    Args:
        gmsh: the module.
        make: meshes the model with straight cells.
        finish: makes the mesh that is wanted, whose facets may be shorter.
        sizes: the lengths; none: as the model has them.
        cure: what to change where gmsh cannot make them.
        unit: length of the model's unit.

    Raises:
        SceneError: no facet of a boundary is longer than it is to be, or gmsh cannot make such facets.
    """

    def anew(field: SizeField, mesh: Callable[[], MeshArrays]) -> MeshArrays:
        gmsh.model.mesh.clear()
        field.apply(gmsh, unit)
        return mesh()

    if isinstance(sizes, SizeField):
        return anew(sizes, finish)
    if not sizes:
        return finish()
    before = make()
    wanted = [size for size in sizes if before.boundaries.get(size.boundary, np.empty(0)).size]
    for size in wanted:
        longest = float(_longest_edges(before, size.boundary).max())
        if longest < size.size:
            message = f"the facets of {size.boundary!r} are no longer than {longest:.3g} without it: give less"
            raise SceneError([(size.path, message)])
    if not wanted:
        return finish()
    mesh = anew(_graded_at(before, wanted), finish)
    for size in wanted:
        length = float(np.median(_longest_edges(mesh, size.boundary)))
        if length > LONGEST_FACET * size.size:
            raise SceneError([(size.path, f"gmsh has made facets of {length:.3g} of {size.boundary!r}: {cure}")])
    return mesh


def _graded_at(mesh: MeshArrays, wanted: Sequence[ContactSize]) -> SizeField:
    """The lengths that cells have, at each corner the mean of the edges around it; at some boundaries shorter, and from
    there on no more than ``SIZE_GROWTH`` per length larger.
    """
    from scipy.spatial import cKDTree

    used, corners = np.unique(mesh.corners, return_inverse=True)
    cells, points = corners.reshape(mesh.corners.shape), mesh.points[used]
    ends = np.concatenate([cells[:, pair] for pair in edges_of(mesh.cell)])
    lengths = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    total = np.bincount(ends.ravel(), np.repeat(lengths, 2), minlength=used.size)
    sizes = total / np.bincount(ends.ravel(), minlength=used.size)
    for size in wanted:
        facets = np.unique(mesh.facet_corners[mesh.boundaries[size.boundary]])
        distance, _ = cKDTree(mesh.points[facets]).query(points)
        sizes = np.minimum(sizes, size.size + SIZE_GROWTH * distance)
    return SizeField(points, cells, sizes)


def edges_of(cell: Cell) -> list[list[int]]:
    """The ends of each edge of a cell, by the numbers of its corners."""
    pairs = combinations(range(len(cell.corners)), 2)
    ends = np.array(cell.corners)
    return [list(pair) for pair in pairs if cell.simplex or np.abs(ends[pair[0]] - ends[pair[1]]).sum() == 1]


def _longest_edges(mesh: MeshArrays, boundary: str) -> Floats:
    """The longest edge of each facet of a boundary, shape (f,)."""
    x = mesh.points[mesh.facet_corners[mesh.boundaries[boundary]]]
    return np.asarray(np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(axis=1))
