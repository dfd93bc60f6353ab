"""Boxes made on all ranks at once: the cells of dolfinx in its order, in blocks of equal size."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.mesh.grid import _blocks, create_box

WORLD = MPI.COMM_WORLD
SIZE = (3.0, 1.0, 2.0)


def corners(mesh):
    """Corners of all cells, sorted within each, in the order of the input; the same on all ranks."""
    owned = mesh.topology.index_map(3).size_local
    x = mesh.geometry.x[compat.geometry_cells(mesh)[:owned]].round(9)
    x = np.stack([cell[np.lexsort(cell.T)] for cell in x]) if owned else x
    numbers = np.asarray(mesh.topology.original_cell_index[:owned])
    every, order = parallel.gather_rows(mesh.comm, x), parallel.gather_rows(mesh.comm, numbers)
    return every[np.argsort(order)]


@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize("counts", [(6, 5, 4), (1, 1, 7), (1, 1, 1)], ids=str)
def test_cells(cell, counts):
    """The order of the input does not depend on the ranks, so that a checkpoint fits; ranks have equal shares."""
    mesh = create_box(WORLD, np.array(SIZE), counts, cell)
    whole = dmesh.create_box(MPI.COMM_SELF, [np.zeros(3), np.array(SIZE)], list(counts), dmesh.CellType[cell])
    cells = np.prod(counts) * (6 if cell == "tetrahedron" else 1)
    assert mesh.topology.index_map(3).size_global == cells
    if min(np.array(counts) - _blocks(WORLD.size, counts)) >= 0:  # otherwise dolfinx makes it
        np.testing.assert_allclose(corners(mesh), corners(whole), atol=1e-8)
        most = parallel.global_max(WORLD, mesh.topology.index_map(3).size_local)
        layers = [-(-count // part) for count, part in zip(counts, _blocks(WORLD.size, counts), strict=True)]
        assert most <= np.prod(layers) * (6 if cell == "tetrahedron" else 1)
    assert mesh.geometry.index_map().size_global == np.prod(np.array(counts) + 1)


@pytest.mark.parametrize(
    ("size", "counts", "blocks"),
    [
        (1, (3, 1, 1), (1, 1, 1)),
        (2, (30, 10, 10), (2, 1, 1)),
        (3, (30, 10, 10), (3, 1, 1)),
        (8, (10, 10, 10), (2, 2, 2)),
        (12, (30, 10, 10), (3, 2, 2)),
        (7, (5, 5, 40), (1, 1, 7)),
    ],
)
def test_blocks(size, counts, blocks):
    """As cubic as may be."""
    assert sorted(_blocks(size, counts)) == sorted(blocks)
    assert _blocks(size, counts)[int(np.argmax(counts))] == max(blocks)
