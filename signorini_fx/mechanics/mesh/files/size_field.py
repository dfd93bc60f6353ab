"""Cell sizes as one background field of gmsh, given on an existing mesh, for making the next mesh.

gmsh interpolates the sizes at the corners of the existing mesh: its size field ``PostView``.  That
mesh also gives the place of a boundary in contact, which may thus be a part of a surface, or
several.  This module does not use dolfinx.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from signorini_fx.arrays import Array, Ints
from signorini_fx.errors import SceneError
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.mesh.files.cells import CELLS, measures, order_in
from signorini_fx.mechanics.statement.mesh_sources import ContactSize
from signorini_fx.tuned import BYTES_PER_DOF, LONGEST_FACET, MEMORY_SHARE, SIZE_GROWTH

# gmsh's codes for the elements of a view (scalar values).
_VIEWS = {"triangle": "ST", "quad": "SQ", "tetra": "SS", "hexahedron": "SH"}


@dataclass(frozen=True, eq=False)
class SizeField:
    """The lengths of cells at the corners of a mesh."""

    points: Array  # positions, shape (n, d)
    cells: Ints  # corners of each cell, shape (m, c)
    sizes: Array  # length of the cells at each point, shape (n,)

    def apply(self, gmsh: ModuleType, unit: float = 1.0) -> None:
        """Make this field the only source of cell sizes in the current gmsh model, overriding its
        own settings.

        ``unit``: length of the model's unit.
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
    """Return the mesh of the current model with cells of the given lengths; None if none of its
    boundaries is to have any.

    Args:
        gmsh: the module.
        before: returns the model's own mesh with straight cells.
        make: makes the requested mesh, whose facets may be shorter.
        sizes: the lengths.
        cure: advice for the message if gmsh cannot make them.
        unit: length of the model's unit.

    Raises:
        SceneError: all facets of a boundary are shorter than the given length already, or gmsh
            cannot make such facets.
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
        for size in wanted:  # the integral of 1 / length^d, whose length grows with the distance
            facets = own.facets[own.boundaries[size.boundary]]
            area = float(measures(own.points, facets, own.facet).sum())
            cubes = area / (SIZE_GROWTH * (own.dim - 1) * size.size ** (own.dim - 1))
            check_memory(cubes, own.dim, size.path, size.size)
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


def least_bytes(dim: int) -> float:
    """Return the least memory for each unknown, bytes: mesh, forms, vectors and two matrices."""
    return BYTES_PER_DOF + 24.0 * dim * 3**dim


def check_memory(cubes: float, dim: int, path: str, size: float) -> None:
    """Check that a mesh of simplices fits into the memory of this machine, before it is made.

    Args:
        cubes: the volume in cubes, in 2D the area in squares, of the length of the cells.
        dim: dimension of the body.
        path: the key that gives the length of the cells.
        size: its value.

    Raises:
        SceneError: its matrices alone need more.
    """
    from mpi4py import MPI

    from signorini_fx.machine import parallel

    # Regular simplices fill squares and cubes of their edge, and a node is in six or about 22.
    cells = cubes * (2.3 if dim == 2 else 8.5)
    needed = least_bytes(dim) * dim * cubes * (1.15 if dim == 2 else 1.5)
    available = parallel.machine_memory(MPI.COMM_SELF)
    if needed > MEMORY_SHARE * available:
        raise SceneError.at(
            path,
            f"cells of {size:g} would be about {cells:.0e}, which need {needed / 1e9:.2g} GB, and "
            f"this machine has {available / 1e9:.2g}: give a larger one, in the unit of the mesh "
            "(gmsh reads .step in mm)",
        )


def _graded_at(mesh: MeshArrays, wanted: Sequence[ContactSize]) -> SizeField:
    """Return the mean length of the cells around each corner, reduced near some boundaries, and
    growing from there by ``SIZE_GROWTH`` per length.
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
    """Return the length of the longest edge of each facet of a boundary, shape (f,)."""
    x = mesh.points[mesh.facet_corners[mesh.boundaries[boundary]]]
    return np.max([np.linalg.norm(x[:, a] - x[:, b], axis=1) for a, b in mesh.facet.edges], axis=0)
