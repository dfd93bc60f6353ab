"""The error of the pressure under cells that are much longer than the facets in contact near them.

Where cells are about as long as the facets near them, the kinks of the pressure from facet to facet
show its error.  Under a cell that is as long as many facets the pressure is smooth from facet to
facet, and wrong by the error of the stress in that cell, to first order.
"""

from __future__ import annotations

import math

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Indices, extents
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_vertices
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.tuned import FEW_NODES

# A cell is long if its length is this many times that of a facet, and its distance from the facet.
_LONG = FEW_NODES // 2


def under_long_cells(tagged: TaggedMesh, facets: Indices, squares: Array) -> Array:
    """Return the squared error of the pressure times area that each long cell causes, shape
    (cells,); collective.

    At each facet it is the largest squared error of the stress in cells that are longer than a few
    times the facet and than a few times their distance from it.

    Args:
        tagged: the mesh.
        facets: the facets of this rank on which a pressure acts.
        squares: squared error of the stress times the volume of each owned cell, shape (cells,).
    """
    mesh = tagged.mesh
    dim = tagged.dimension
    comm = mesh.comm
    found = np.zeros(len(squares))
    corners = facet_vertices(mesh, facets)[:, :, :dim]
    lengths = extents(corners)
    near = parallel.gather_rows(comm, np.column_stack((corners.mean(axis=1), lengths)))
    if not len(near):
        return found
    middles = near[:, :dim]
    lengths = near[:, dim]
    x = mesh.geometry.x[compat.geometry_cells(mesh)[: len(squares)]][:, :, :dim]
    low = x.min(axis=1, initial=np.inf)
    high = x.max(axis=1, initial=-np.inf)
    sizes = np.linalg.norm(high - low, axis=1)
    long = np.flatnonzero(sizes > _LONG * lengths.min())
    tree = cKDTree(middles)
    distance, _ = tree.query((low[long] + high[long]) / 2)
    long = long[distance <= sizes[long] * (0.5 + 1 / _LONG)]
    simplex = mesh.topology.cell_name() in ("triangle", "tetrahedron")
    edges = x[long][:, [1, 2, 3 if simplex else 4][:dim]] - x[long][:, :1]
    volumes = np.abs(np.linalg.det(edges)) / (math.factorial(dim) if simplex else 1)
    largest = np.zeros(len(middles))
    above = np.zeros(len(middles), dtype=np.int64)
    for cell, volume in zip(long, volumes, strict=True):
        reach = sizes[cell] * (0.5 + 1 / _LONG)
        at = np.array(tree.query_ball_point((low[cell] + high[cell]) / 2, reach), dtype=np.int64)
        outside = np.maximum(np.maximum(low[cell] - middles[at], middles[at] - high[cell]), 0.0)
        away = np.maximum(np.linalg.norm(outside, axis=1), lengths[at])
        at = at[sizes[cell] > _LONG * away]
        density = squares[cell] / volume
        at = at[density > largest[at]]
        largest[at] = density
        above[at] = cell
    everywhere = largest.copy()
    comm.Allreduce(MPI.IN_PLACE, everywhere, MPI.MAX)
    mine = np.flatnonzero((largest > 0) & (largest == everywhere))
    np.add.at(found, above[mine], largest[mine] * lengths[mine] ** (dim - 1))
    return found
