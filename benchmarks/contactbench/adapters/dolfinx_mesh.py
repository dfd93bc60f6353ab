"""A mesh of dolfinx from one of the problems', and the numbers of its nodes."""

from __future__ import annotations

from typing import Any

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import mesh
from mpi4py import MPI

from ..grids import Grid

_CELLS = {4: "quadrilateral", 8: "hexahedron"}
# Corners in dolfinx's order.
_ORDER = {4: [0, 1, 3, 2], 8: [0, 1, 3, 2, 4, 5, 7, 6]}


def make_mesh(grid: Grid) -> tuple[Any, npt.NDArray[np.int64]]:
    """The mesh, on this rank alone, and the node of the grid that each of its nodes is, shape
    (n,).
    """
    corners = grid.cells.shape[1]
    element = basix.ufl.element("Lagrange", _CELLS[corners], 1, shape=(grid.dimension,))
    cells = grid.cells[:, _ORDER[corners]].astype(np.int64)
    made = mesh.create_mesh(MPI.COMM_SELF, cells=cells, x=grid.points, e=ufl.Mesh(element))
    return made, np.asarray(made.geometry.input_global_indices)


def tag_facets(made: Any, nodes: npt.NDArray[np.int64], grid: Grid) -> tuple[Any, dict[str, int]]:
    """Tags of the facets, and the tag of each boundary."""
    across = grid.dimension - 1
    made.topology.create_connectivity(across, grid.dimension)
    outer = np.asarray(mesh.exterior_facet_indices(made.topology), dtype=np.int32)
    corners = np.sort(nodes[mesh.entities_to_geometry(made, across, outer)], axis=1)
    numbers = {tuple(row): int(facet) for row, facet in zip(corners.tolist(), outer, strict=True)}
    tags = {name: tag for tag, name in enumerate(sorted(grid.facets), 1)}
    pairs = sorted(
        (numbers[tuple(sorted(row))], tags[name])
        for name in tags
        for row in grid.facets[name].tolist()
    )
    facets, values = (np.array(part, dtype=np.int32) for part in zip(*pairs, strict=True))
    return mesh.meshtags(made, across, facets, values), tags


def tag_cells(made: Any, grid: Grid) -> Any:
    """Tags of the cells: the numbers of their bodies, from 1."""
    owner = grid.body[np.asarray(made.topology.original_cell_index)] + 1
    return mesh.meshtags(
        made, grid.dimension, np.arange(len(owner), dtype=np.int32), owner.astype(np.int32)
    )
