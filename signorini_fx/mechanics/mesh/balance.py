"""Cells distributed anew over the ranks where local refinement has left most of them on a few."""

from __future__ import annotations

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.mesh.distribution import Tagged, distributed
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.tuned import UNEVEN


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
    cells = global_nodes(mesh, compat.geometry_cells(mesh)[: mesh.topology.index_map(dim).size_local])
    points = mesh.geometry.x[: nodes.size_local, : mesh.geometry.dim].astype(np.float64)
    tags = {mesh_tags.dim: mesh_tags for mesh_tags in (tagged.facet_tags, tagged.cell_tags) if mesh_tags is not None}
    local_tags = {entity_dim: owned_entities(mesh, mesh_tags) for entity_dim, mesh_tags in tags.items()}
    even, even_tags = distributed(mesh.comm, mesh.ufl_domain(), cells, points, local_tags)
    return TaggedMesh(even, even_tags[dim - 1], tagged.boundaries, even_tags.get(dim), tagged.regions, tagged.origin)


def global_nodes(mesh: dmesh.Mesh, rows: npt.NDArray[np.int32]) -> npt.NDArray[np.int64]:
    """Global numbers of geometry nodes, of the same shape."""
    numbers: npt.NDArray[np.int64] = mesh.geometry.index_map().local_to_global(np.ascontiguousarray(rows).ravel())
    return numbers.reshape(rows.shape)


def owned_entities(mesh: dmesh.Mesh, tags: dmesh.MeshTags) -> Tagged:
    """The tagged entities that this rank owns."""
    owned = tags.indices < mesh.topology.index_map(tags.dim).size_local
    entities = tags.indices[owned]
    mesh.topology.create_connectivity(tags.dim, mesh.topology.dim)
    # dolfinx divides by the number of entities, and a rank may have none.
    rows = (
        dmesh.entities_to_geometry(mesh, tags.dim, entities) if entities.size else np.empty((0, tags.dim + 1), np.int32)
    )
    return Tagged(global_nodes(mesh, rows), tags.values[owned])
