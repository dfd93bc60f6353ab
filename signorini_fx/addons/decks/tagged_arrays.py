"""Meshes of arrays for the solver."""

from __future__ import annotations

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
from mpi4py import MPI

from signorini_fx.mechanics.mesh.distribution import from_root
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, combinations
from signorini_fx.mechanics.mesh.files.cells import CELLS
from signorini_fx.mechanics.mesh.halving import straightened
from signorini_fx.mechanics.mesh.tagged import TaggedMesh


def tagged(arrays: MeshArrays, *, straight: bool = True) -> TaggedMesh:
    """A mesh for the solver; ``straight``: without the nodes between corners, so that cells are straight."""
    arrays = straightened(arrays) if straight else arrays
    of_side, sides = combinations(arrays.boundaries, len(arrays.facets))
    of_cell, parts = combinations(arrays.regions, len(arrays.cells))
    mesh, facet_tags, cell_tags = from_root(MPI.COMM_SELF, CELLS[arrays.kind], (arrays, of_side, of_cell))
    return TaggedMesh(mesh, facet_tags, sides, cell_tags if parts else None, parts)
