"""Uniform and adaptive refinement of triangles and tetrahedra.

The names of boundaries and regions are kept.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.errors import MeshError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, arrays_of, from_arrays
from signorini_fx.tuned import UNEVEN


def mark(comm: MPI.Comm, squares: npt.NDArray[np.float64], share: float = 0.5) -> npt.NDArray[np.int32]:
    """The smallest number of cells with a given share of the squared error (Doerfler), over all ranks; collective.

    Args:
        comm: the ranks that share the mesh.
        squares: squared error of each owned cell, shape (cells,).
        share: the share of the squared error in all marked cells together.

    Returns:
        Marked cells of this rank (local numbers).
    """
    total = float(parallel.global_sum(comm, squares.sum()))
    low, high = 0.0, parallel.largest(comm, squares)
    for _ in range(60):  # bisection for the threshold: no rank needs the cells of another
        middle = (low + high) / 2
        held = float(parallel.global_sum(comm, squares[squares >= middle].sum()))
        low, high = (middle, high) if held >= share * total else (low, middle)
    return np.flatnonzero(squares >= low).astype(np.int32)


def check_divisible(tagged: TaggedMesh) -> None:
    """Refuse a mesh that ``refine`` cannot divide.

    Raises:
        MeshError: the cells are neither triangles nor tetrahedra, or not straight.
    """
    simplex = {2: "triangle", 3: "tetrahedron"}[tagged.mesh.topology.dim]
    if tagged.mesh.topology.cell_name() != simplex:
        plural = {"triangle": "triangles", "tetrahedron": "tetrahedra"}[simplex]
        raise MeshError(f"only {plural} can be refined: use cell = '{simplex}', or a generator and uniform refinement")
    if compat.geometry_degree(tagged.mesh) > 1:
        raise MeshError("only cells with straight sides can be refined: use a mesh whose geometry has degree 1")


def refine(tagged: TaggedMesh, cells: npt.NDArray[np.int32] | None = None) -> TaggedMesh:
    """Bisect triangles or tetrahedra; the mesh stays conforming.

    Children stay on the rank of their parent, unless one rank has many more cells than the others by then.

    Args:
        tagged: the mesh.
        cells: the cells of this rank that must be divided; None: all.

    Raises:
        MeshError: the cells are neither triangles nor tetrahedra, or not straight.
    """
    check_divisible(tagged)
    mesh = tagged.mesh
    dim = mesh.topology.dim
    pairs = ((1, 0), (1, dim), (dim, 1), (dim - 1, dim), (dim, dim - 1))
    for pair in pairs:
        mesh.topology.create_connectivity(*pair)
    edges = None if cells is None else dmesh.compute_incident_entities(mesh.topology, cells, dim, 1)
    fine, parent_cell, parent_facet = dmesh.refine(
        mesh, edges, partitioner=None, option=dmesh.RefinementOption.parent_cell_and_facet
    )
    for pair in pairs:
        fine.topology.create_connectivity(*pair)
    # dolfinx's own transfer refuses meshes with ghost cells.  A child knows its parent by its place before reordering.
    original = fine.topology.original_cell_index
    first = parallel.rows_before(mesh.comm, len(parent_cell))
    children = np.arange(len(parent_cell), dtype=np.int32)
    parents = parent_cell[original[children] - first]
    sides = parent_facet.reshape(-1, dim + 1)[original[children] - first]
    cell_tags = None
    if tagged.cell_tags is not None:
        kinds = _table(tagged.cell_tags, mesh.topology.index_map(dim))[parents]
        has_tag = kinds != _NO_TAG
        cell_tags = dmesh.meshtags(fine, dim, children[has_tag], kinds[has_tag])
    old, new = (m.topology.connectivity(dim, dim - 1).array.reshape(-1, dim + 1) for m in (mesh, fine))
    on_side = sides >= 0
    facets = new[: len(children)][on_side]
    origin = old[np.repeat(parents, dim + 1).reshape(-1, dim + 1)[on_side], sides[on_side]]
    kinds = _table(tagged.facet_tags, mesh.topology.index_map(dim - 1))[origin]
    facets, index = np.unique(facets[kinds != _NO_TAG], return_index=True)
    facet_tags = dmesh.meshtags(fine, dim - 1, facets.astype(np.int32), kinds[kinds != _NO_TAG][index])
    refined = TaggedMesh(fine, facet_tags, tagged.boundaries, cell_tags, tagged.regions, tagged.origin)
    counts = fine.topology.index_map(dim)
    if parallel.global_max(mesh.comm, counts.size_local) * mesh.comm.size <= UNEVEN * counts.size_global:
        return refined
    arrays = arrays_of(refined)
    return replace(from_arrays(mesh.comm, lambda: arrays), origin=tagged.origin)


_NO_TAG = np.iinfo(np.int32).min


def _table(tags: dmesh.MeshTags, index_map: Any) -> npt.NDArray[np.int32]:
    """The tag of every entity of this rank, ghosts included; _NO_TAG where there is none."""
    table = np.full(index_map.size_local + index_map.num_ghosts, _NO_TAG, dtype=np.int32)
    table[tags.indices] = tags.values
    return table
