"""Points at places where a regular division of cells has its nodes, found by looking up their coordinates.

Where a mesh was refined by halving cells its nodes are there, and no search for cells and places in them is needed.
"""

from __future__ import annotations

import basix
import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh

from signorini_fx.machine import compat
from signorini_fx.tuned import DIGITS_OF_FILES

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
# Odd factors without a pattern, which make one number of the coordinates in units of a small length, and of the piece.
_FACTORS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0xD6E8FEB86659FD93], dtype=np.uint64)
# Round coordinates are not at the borders between units.
_SHIFT = 1 / np.pi


def at_lattice(
    mesh: dmesh.Mesh, x: Array, degree: int, pieces: tuple[Indices, Indices] | None = None
) -> tuple[Indices, Indices, Array]:
    """A cell of this rank that each point is a lattice point of.

    Args:
        mesh: the mesh.
        x: the points, shape (n, 3), length.
        degree: of the lattice: into how many parts each edge of a cell is divided.
        pieces: the pieces that the points, shape (n,), and the cells of this rank, shape (cells,), are of, which must
            be the same; None: any cell will do.

    Returns:
        The owned cells, -1 where the search has found none, shape (n,); numbers of the lattice points, shape (n,); the
        lattice in the reference cell, shape (q, d).
    """
    element, dim = compat.geometry_element(mesh), mesh.topology.dim
    lattice = basix.create_lattice(element.cell_type, degree, basix.LatticeType.equispaced, True)
    count = mesh.topology.index_map(dim).size_local
    cells, numbers = np.full(len(x), -1, dtype=np.int64), np.zeros(len(x), dtype=np.int64)
    if count == 0 or not len(x):
        return cells, numbers, lattice
    nodes = mesh.geometry.x[:, :dim][compat.geometry_cells(mesh)[:count]]
    places = (element.tabulate(0, lattice)[0, :, :, 0] @ nodes).reshape(-1, dim)
    unit = DIGITS_OF_FILES * float(np.ptp(nodes, axis=1).max(axis=1).min())
    low = places.min(axis=0)
    of_points, of_places = (None, None) if pieces is None else (pieces[0], np.repeat(pieces[1][:count], len(lattice)))
    names, wanted = _names((places - low) / unit, of_places), _names((x[:, :dim] - low) / unit, of_points)
    order = np.argsort(names, kind="stable")
    found = order[np.minimum(np.searchsorted(names, wanted, sorter=order), len(order) - 1)]
    # Different places have the same name once in a long time.
    hit = (names[found] == wanted) & (np.abs(places[found] - x[:, :dim]) <= unit).all(axis=1)
    if of_points is not None and of_places is not None:
        hit &= of_places[found] == of_points
    cells[hit], numbers[hit] = np.divmod(found[hit], len(lattice))
    return cells, numbers, lattice


def _names(coordinates: Array, pieces: Indices | None) -> npt.NDArray[np.uint64]:
    """The same number for places within the same unit, else others, shape (n,)."""
    whole = np.floor(coordinates + _SHIFT).astype(np.int64).view(np.uint64)
    names = np.zeros(len(whole), dtype=np.uint64) if pieces is None else pieces.astype(np.uint64) * _FACTORS[3]
    for axis, column in enumerate(whole.T):
        names ^= (column + np.uint64(axis)) * _FACTORS[axis]
        names ^= names >> np.uint64(29)
    return names
