"""A box in 3D with a uniform structured mesh.

::

              top
            +-----------+
           /           /|
          /   back    / |          x[2]
         +-----------+  | right     |  x[1]
    left |           |  +           | /
         |   front   | /  width     |/
         +-----------+              +---- x[0]
      (0,0,0) length      bottom below, height upwards
"""

from __future__ import annotations

from typing import Any, Literal

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.meshes import Count, Length, generator, refuse_too_large


@generator(counts=("nx", "ny", "nz"), simplices="tetrahedron")
def generate(
    comm: MPI.Comm,
    /,
    *,
    length: Length = 3.0,
    width: Length = 1.0,
    height: Length = 1.0,
    nx: Count = 24,
    ny: Count = 8,
    nz: Count = 8,
    cell: Literal["hexahedron", "tetrahedron"] = "hexahedron",
) -> Any:
    """Nx by ny by nz hexahedra, or each of them cut into six tetrahedra.

    Args:
        comm: the ranks that share the mesh.
        length: extent along x[0].
        width: extent along x[1].
        height: extent along x[2].
        nx: cells along x[0].
        ny: cells along x[1].
        nz: cells along x[2].
        cell: shape of the cells.

    Returns:
        The mesh with the boundaries left, right, front, back, bottom, top.
    """
    refuse_too_large(comm, nx * ny * nz, cell)
    ends = np.array([length, width, height])
    unit = 2.0 ** np.floor(np.log2(ends))  # dolfinx refuses lengths below a number that has no unit
    opposite = [np.zeros(3), ends / unit]
    whole = dmesh.GhostMode.none
    mesh = dmesh.create_box(comm, opposite, [nx, ny, nz], dmesh.CellType[cell], ghost_mode=whole)
    mesh.geometry.x[:] *= unit
    near = 1e-9 * ends.max()

    def at(axis: int, value: float) -> Any:
        return lambda x: np.abs(x[axis] - value) < near

    names = (("left", "right"), ("front", "back"), ("bottom", "top"))
    return tag_boundaries(
        mesh,
        {
            name: at(axis, value)
            for axis, pair in enumerate(names)
            for name, value in zip(pair, (0.0, ends[axis]), strict=True)
        },
    )
