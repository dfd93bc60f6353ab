"""A mesh and its tags distributed over the ranks, from the arrays that the first one has."""

from __future__ import annotations

import basix.ufl
import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import ufl
from dolfinx import mesh as dmesh
from dolfinx.graph import adjacencylist
from dolfinx.io import distribute_entity_data
from mpi4py import MPI

from signorini_fx.machine import compat
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.mesh.files.cells import CELLS, Cell, Floats, Ints, order_of_nodes


def from_root(
    comm: MPI.Comm, kind: Cell, held: tuple[MeshArrays, Ints, Ints] | None
) -> tuple[dmesh.Mesh, dmesh.MeshTags, dmesh.MeshTags]:
    """The mesh that the first rank has as arrays; collective.

    Args:
        comm: the ranks that share the mesh.
        kind: of the cells.
        held: on the first rank the mesh, the tag of each of its facets and of each of its cells, 0 for none; None on
            the others.

    Returns:
        The mesh, and the tags of its facets and cells.
    """
    dim, facet = kind.dim, CELLS[kind.facet]
    points: Floats = np.empty((0, dim))
    nodes: dict[int, Ints] = {
        dim: np.empty((0, len(kind.nodes)), np.int64),
        dim - 1: np.empty((0, len(facet.nodes)), np.int64),
    }
    tags: dict[int, Ints] = {dim: np.empty(0, np.int64), dim - 1: np.empty(0, np.int64)}
    if held is not None:
        arrays, of_side, of_cell = held
        points = arrays.points
        nodes = {dim: arrays.cells[:, order_of_nodes(kind)], dim - 1: arrays.facets[:, order_of_nodes(facet)]}
        tags = {dim: of_cell, dim - 1: of_side}
    even = basix.ufl.element(
        "Lagrange", kind.basix_type.name, kind.degree, basix.LagrangeVariant.equispaced, shape=(dim,)
    )
    mesh = dmesh.create_mesh(comm, cells=nodes[dim], x=points, e=ufl.Mesh(even))
    mesh_tags = {}
    for entity_dim, values in tags.items():
        has_tag = values > 0
        tagged_nodes, tagged_values = nodes[entity_dim][has_tag], values[has_tag].astype(np.int32)
        local, of_local = distribute_entity_data(mesh, entity_dim, tagged_nodes, tagged_values)
        mesh.topology.create_connectivity(entity_dim, 0)
        mesh.topology.create_connectivity(entity_dim, dim)
        mesh_tags[entity_dim] = dmesh.meshtags_from_entities(
            mesh, entity_dim, adjacencylist(local), of_local.astype(np.int32, copy=False)
        )
    return mesh, mesh_tags[dim - 1], mesh_tags[dim]


def kind_of_mesh(mesh: dmesh.Mesh) -> Cell | None:
    """The kind of the cells of a mesh of dolfinx; None for a geometry of a degree above 2."""
    word, degree = mesh.topology.cell_name(), compat.geometry_degree(mesh)
    return next((cell for cell in CELLS.values() if (cell.basix_type.name, cell.degree) == (word, degree)), None)
