"""Boxes made on all ranks at once: each makes an equal share of the cells, and knows without a graph whose they are."""

from __future__ import annotations

import basix.ufl
import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.mechanics.mesh.shares_of_ranks import partitioner

# Places of the corners of a hexahedron along the axes, in the order of dolfinx.
_CORNERS = np.array([(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1)])
# Tetrahedra of a hexahedron, by its corners: those of ``dolfinx.mesh.create_box``.
_TETRAHEDRA = np.array([(0, 1, 3, 7), (0, 1, 7, 5), (0, 5, 7, 4), (0, 3, 2, 7), (0, 6, 4, 7), (0, 2, 6, 7)])


def create_box(comm: MPI.Comm, ends: npt.NDArray[np.float64], counts: tuple[int, int, int], cell: str) -> dmesh.Mesh:
    """The mesh of ``dolfinx.mesh.create_box`` from the origin; on several ranks without one that makes or divides it.

    Args:
        comm: the ranks that share the mesh; each gets a block of the box.
        ends: the corner opposite to the origin, lengths, shape (3,).
        counts: hexahedra along each axis.
        cell: hexahedron, or tetrahedron: each hexahedron is cut into six.
    """
    blocks = _blocks(comm.size, counts)
    if comm.size == 1 or (np.array(blocks) > counts).any():
        unit = 2.0 ** np.floor(np.log2(ends))  # dolfinx refuses lengths below a number that has no unit
        mesh = dmesh.create_box(comm, [np.zeros(3), ends / unit], list(counts), dmesh.CellType[cell])
        mesh.geometry.x[:] *= unit
        return mesh
    nodes = np.array(counts) + 1
    hexahedra = np.stack(np.unravel_index(_share(comm, int(np.prod(counts))), counts[::-1]), axis=1)[:, ::-1]
    cells = _number(hexahedra[:, None] + _CORNERS, nodes)
    owner = _number(hexahedra * blocks // counts, np.array(blocks))
    if cell == "tetrahedron":
        cells, owner = cells[:, _TETRAHEDRA].reshape(-1, 4), np.repeat(owner, len(_TETRAHEDRA))
    at = np.stack(np.unravel_index(_share(comm, int(np.prod(nodes))), nodes[::-1]), axis=1)[:, ::-1]
    points = at * (ends / counts)

    domain = ufl.Mesh(basix.ufl.element("Lagrange", cell, 1, shape=(3,)))
    return dmesh.create_mesh(comm, cells=cells, x=points, e=domain, partitioner=partitioner(owner))


def _share(comm: MPI.Comm, total: int) -> npt.NDArray[np.int64]:
    """The numbers from 0 to total - 1 that this rank makes."""
    return np.arange(comm.rank * total // comm.size, (comm.rank + 1) * total // comm.size)


def _number(places: npt.NDArray[np.int64], counts: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The numbers of places in a grid, along x[0] first, shape (..., 3) -> (...)."""
    return places[..., 0] + counts[0] * (places[..., 1] + counts[1] * places[..., 2])


def _blocks(size: int, counts: tuple[int, int, int]) -> tuple[int, int, int]:
    """Into how many blocks the box is divided along each axis, ``size`` in all, as cubic as may be."""
    blocks, quotient, factor = [1, 1, 1], size, 2
    factors = []
    while quotient > 1:
        while quotient % factor == 0:
            factors.append(factor)
            quotient //= factor
        factor += 1
    for prime in reversed(factors):
        longest = 2 - int(np.argmax((np.array(counts) / blocks)[::-1]))
        blocks[longest] *= prime
    return blocks[0], blocks[1], blocks[2]
