"""The lengths of cells as one background field of gmsh, on a mesh that exists already, by which it
makes the next one.

gmsh interpolates the lengths at the corners of that mesh: its size field ``PostView``.  That mesh
also tells where a boundary in contact is, so that it may be a part of a surface, or several.  No
dolfinx here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from signorini_fx.arrays import Array, Ints
from signorini_fx.errors import SceneError
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.mesh.files.cells import CELLS, order_in
from signorini_fx.mechanics.statement.mesh_sources import ContactSize
from signorini_fx.tuned import LONGEST_FACET, SIZE_GROWTH

# gmsh's words for the elements of a view.
_VIEWS = {"triangle": "ST", "quad": "SQ", "tetra": "SS", "hexahedron": "SH"}


@dataclass(frozen=True, eq=False)
class SizeField:
    """Lengths of cells at the corners of a mesh."""

    points: Array  # positions, shape (n, d)
    cells: Ints  # corners of each cell, shape (m, c)
    sizes: Array  # length of the cells at each point, shape (n,)

    def apply(self, gmsh: ModuleType, unit: float = 1.0) -> None:
        """Let the current model of gmsh, which has a unit of this length, have cells of these
        lengths alone, whatever its own settings are.
        """
        dim = self.points.shape[1]
        kind = next(
            cell for cell in CELLS.values() if cell.corners.shape == (self.cells.shape[1], dim)
        )
        cells = self.cells[:, np.argsort(order_in("gmsh", kind))]
        x = np.zeros((len(self.points), 3))
        x[:, :dim] = self.points / unit
        # Cells that are divided in the end are twice as long before.
        halved = gmsh.option.getNumber("Mesh.SubdivisionAlgorithm") > 0
        values = self.sizes / unit * (2.0 if halved else 1.0)
        rows = np.concatenate(
            [x[cells].transpose(0, 2, 1).reshape(len(cells), -1), values[cells]], 1
        )
        view = gmsh.view.add("sizes")
        gmsh.view.addListData(view, _VIEWS[kind.kind], len(cells), rows.ravel())
        fields = gmsh.model.mesh.field
        number = fields.add("PostView")
        fields.setNumber(number, "ViewTag", view)
        fields.setAsBackgroundMesh(number)
        for option in (
            "ExtendFromBoundary",
            "FromPoints",
            "FromCurvature",
            "FromParametricPoints",
            "Min",
        ):
            gmsh.option.setNumber(f"Mesh.MeshSize{option}", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFactor", 1)
        gmsh.option.setNumber("Mesh.MeshSizeMax", float(values.max()))


# Lengths of the facets of some boundaries, or of all cells.
Sizes = Sequence[ContactSize] | SizeField


def with_sizes(
    gmsh: ModuleType,
    before: Callable[[], MeshArrays],
    make: Callable[[], MeshArrays],
    sizes: Sizes,
    cure: str,
    unit: float = 1.0,
) -> MeshArrays | None:
    """Return the mesh of the current model with cells of some lengths, or None if its boundaries
    are to have no others.

    Args:
        gmsh: the module.
        before: gives the mesh with straight cells that the model has of itself.
        make: makes the mesh that is wanted, whose facets may be shorter.
        sizes: the lengths.
        cure: what to change where gmsh cannot make them.
        unit: length of the model's unit.

    Raises:
        SceneError: no facet of a boundary is longer than it is to be, or gmsh cannot make such
            facets.
    """
    field = sizes
    wanted = list[ContactSize]()
    if not isinstance(field, SizeField):
        if not field:
            return None
        own = before()
        wanted = [size for size in field if own.boundaries.get(size.boundary, np.empty(0)).size]
        for size in wanted:
            longest = float(_longest_edges(own, size.boundary).max())
            if longest < size.size:
                message = (
                    f"the facets of {size.boundary!r} are no longer than {longest:.3g} "
                    "without it: give less"
                )
                raise SceneError.at(size.path, message)
        if not wanted:
            return None
        field = _graded_at(own, wanted)
    gmsh.model.mesh.clear()
    field.apply(gmsh, unit)
    mesh = make()
    for size in wanted:
        length = float(np.median(_longest_edges(mesh, size.boundary)))
        if length > LONGEST_FACET * size.size:
            raise SceneError.at(
                size.path, f"gmsh has made facets of {length:.3g} of {size.boundary!r}: {cure}"
            )
    return mesh


def _graded_at(mesh: MeshArrays, wanted: Sequence[ContactSize]) -> SizeField:
    """Return the lengths of cells around each corner; shorter at some boundaries, growing by
    ``SIZE_GROWTH`` per length.
    """
    from scipy.spatial import cKDTree

    points = mesh.points
    ends = np.concatenate([mesh.cells[:, pair] for pair in mesh.cell.edges])
    lengths = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    sizes = np.bincount(ends.ravel(), np.repeat(lengths, 2)) / np.bincount(ends.ravel())
    for size in wanted:
        facets = np.unique(mesh.facet_corners[mesh.boundaries[size.boundary]])
        distance, _ = cKDTree(points[facets]).query(points)
        sizes = np.minimum(sizes, size.size + SIZE_GROWTH * distance)
    return SizeField(points, mesh.cells, sizes)


def _longest_edges(mesh: MeshArrays, boundary: str) -> Array:
    """Return the longest edge of each facet of a boundary, shape (f,)."""
    x = mesh.points[mesh.facet_corners[mesh.boundaries[boundary]]]
    return np.max([np.linalg.norm(x[:, a] - x[:, b], axis=1) for a, b in mesh.facet.edges], axis=0)
