"""A mesh and its tags distributed over the ranks, from cells and nodes that some or all of them hold."""

from __future__ import annotations

from dataclasses import dataclass

import basix.ufl
import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import mesh as dmesh
from dolfinx.graph import adjacencylist
from dolfinx.io import distribute_entity_data
from dolfinx.io.utils import cell_perm_gmsh
from mpi4py import MPI

from signorini_fx.machine import compat
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.mesh.files.cells import CELLS, Cell
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints


@dataclass(frozen=True)
class Tagged:
    """Entities of one dimension and their tags, as this rank knows them.

    Attributes:
        nodes: numbers of the nodes of each entity in the input, in dolfinx's order, shape (n, nodes of each).
        tags: shape (n,).
    """

    nodes: npt.NDArray[np.int64]
    tags: npt.NDArray[np.int32]


def distributed(
    comm: MPI.Comm,
    domain: ufl.Mesh,
    cells: npt.NDArray[np.int64],
    points: npt.NDArray[np.float64],
    tagged: dict[int, Tagged],
) -> tuple[dmesh.Mesh, dict[int, dmesh.MeshTags]]:
    """The mesh with its cells in about equal shares on the ranks; collective.

    Args:
        comm: the ranks that share the mesh.
        domain: kind, degree and dimension of the cells.
        cells: the nodes of those cells that this rank brings, in dolfinx's order, shape (m, k).
        points: those nodes that this rank brings, shape (n, d); nodes are numbered through the ranks.
        tagged: dimension -> entities that this rank brings; the same dimensions on all ranks.

    Returns:
        The mesh, and the tags of each dimension.
    """
    mesh = dmesh.create_mesh(comm, cells=cells, x=points, e=domain)
    mesh_tags = {}
    for dim, entities in tagged.items():
        local, values = distribute_entity_data(mesh, dim, entities.nodes, entities.tags)
        mesh.topology.create_connectivity(dim, 0)
        mesh.topology.create_connectivity(dim, mesh.topology.dim)
        mesh_tags[dim] = dmesh.meshtags_from_entities(
            mesh, dim, adjacencylist(local), values.astype(np.int32, copy=False)
        )
    return mesh, mesh_tags


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
    tagged = {
        entity_dim: Tagged(nodes[entity_dim][values > 0], values[values > 0].astype(np.int32))
        for entity_dim, values in tags.items()
    }
    even = domain(_word(kind), kind.degree, dim, int(basix.LagrangeVariant.equispaced))
    mesh, mesh_tags = distributed(comm, even, nodes[dim], points, tagged)
    return mesh, mesh_tags[dim - 1], mesh_tags[dim]


def _word(kind: Cell) -> str:
    """The word of dolfinx for a shape."""
    four = "quadrilateral" if kind.dim == 2 else "tetrahedron"
    return {2: "interval", 3: "triangle", 4: four, 8: "hexahedron"}[len(kind.corners)]


def kind_of_mesh(mesh: dmesh.Mesh) -> Cell | None:
    """The kind of the cells of a mesh of dolfinx; None for a geometry of a degree above 2."""
    word, degree = mesh.topology.cell_name(), compat.geometry_degree(mesh)
    return next((cell for cell in CELLS.values() if (_word(cell), cell.degree) == (word, degree)), None)


def order_of_nodes(kind: Cell) -> npt.NDArray[np.int64]:
    """Node k of dolfinx is the node with this number here."""
    of_gmsh = np.asarray(kind.gmsh_order)
    return of_gmsh[cell_perm_gmsh(dmesh.to_type(_word(kind)), len(kind.nodes))]


def domain(word: str, degree: int, dim: int, variant: int) -> ufl.Mesh:
    """Cells of a shape, by dolfinx's word for it, with nodes at places that ``basix.LagrangeVariant`` numbers."""
    return ufl.Mesh(basix.ufl.element("Lagrange", word, degree, basix.LagrangeVariant(variant), shape=(dim,)))
