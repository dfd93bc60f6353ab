"""Cells distributed anew over the ranks where local refinement has left most of them on a few."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from dolfinx.graph import adjacencylist
from dolfinx.io import distribute_entity_data

from signorini_fx import compat, parallel
from signorini_fx.mesh.tagged import TaggedMesh

# A rank with more cells than this times the mean makes the others wait for longer than a new distribution takes.
UNEVEN = 1.2


def unevenness(mesh: dmesh.Mesh) -> float:
    """The largest number of cells of a rank over the mean of all ranks, at least 1; collective."""
    cells = mesh.topology.index_map(mesh.topology.dim)
    return parallel.global_max(mesh.comm, cells.size_local) * mesh.comm.size / cells.size_global


def balanced(tagged: TaggedMesh) -> TaggedMesh:
    """The same straight simplices, nodes and names in equal shares on the ranks; no rank gathers the mesh.

    Returns:
        The mesh itself if no rank has more than ``UNEVEN`` times the mean; otherwise a new one, with other numbers of
        cells and nodes.
    """
    mesh = tagged.mesh
    if unevenness(mesh) <= UNEVEN:
        return tagged
    dim = mesh.topology.dim
    nodes = mesh.geometry.index_map()
    cells = _global_nodes(mesh, compat.geometry_cells(mesh)[: mesh.topology.index_map(dim).size_local])
    points = mesh.geometry.x[: nodes.size_local, : mesh.geometry.dim]
    even = dmesh.create_mesh(mesh.comm, cells=cells, x=np.ascontiguousarray(points), e=mesh.ufl_domain())
    facets = _moved(mesh, tagged.facet_tags, even)
    regions = None if tagged.cell_tags is None else _moved(mesh, tagged.cell_tags, even)
    return TaggedMesh(even, facets, tagged.boundaries, regions, tagged.regions)


def _global_nodes(mesh: dmesh.Mesh, rows: npt.NDArray[np.int32]) -> npt.NDArray[np.int64]:
    """Global numbers of geometry nodes, of the same shape."""
    found: npt.NDArray[np.int64] = mesh.geometry.index_map().local_to_global(np.ascontiguousarray(rows).ravel())
    return found.reshape(rows.shape)


def _moved(old: dmesh.Mesh, tags: dmesh.MeshTags, new: dmesh.Mesh) -> dmesh.MeshTags:
    """The tags of the same entities in the new mesh, whose nodes were the global ones of the old mesh."""
    owned = tags.indices < old.topology.index_map(tags.dim).size_local
    entities = tags.indices[owned]
    old.topology.create_connectivity(tags.dim, old.topology.dim)
    # dolfinx divides by the number of entities, and a rank may have none.
    rows = (
        dmesh.entities_to_geometry(old, tags.dim, entities) if entities.size else np.empty((0, tags.dim + 1), np.int32)
    )
    local, values = distribute_entity_data(new, tags.dim, _global_nodes(old, rows), tags.values[owned])
    new.topology.create_connectivity(tags.dim, 0)
    new.topology.create_connectivity(tags.dim, new.topology.dim)
    return dmesh.meshtags_from_entities(new, tags.dim, adjacencylist(local), values.astype(np.int32, copy=False))
