"""What acts at single nodes: forces, and links between them, beside what forms say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la
from petsc4py import PETSc
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.assembly.pieces import BodyPieces
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.effect import Resistance
from signorini_fx.mechanics.statement.nodal_table import NodalTable
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import SAME_POSITION

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


def nodes_of(table: NodalTable, path: str, space: fem.FunctionSpace, tagged: TaggedMesh) -> Ints:
    """The global numbers of the nodes that a table lists, shape (n,); the same on every rank; collective.

    Raises:
        SceneError: there is no node at one of its places, or several are, or its mesh has another dimension.
    """
    from scipy.spatial import cKDTree

    comm, owned = tagged.mesh.comm, space.dofmap.index_map.size_local
    if table.points.shape[1] != tagged.dimension:
        raise SceneError([(path, f"has {table.points.shape[1]} coordinates, the mesh has {tagged.dimension}")])
    x = node_positions(space)[:owned, : tagged.dimension]
    inside = {region: _marked(space, tagged, region, path) for region in {*table.regions} - {""}}
    near = cKDTree(table.points).query_ball_point(x, SAME_POSITION * tagged.size) if len(x) else []
    count, number = np.zeros(len(table)), np.zeros(len(table))
    first = space.dofmap.index_map.local_range[0]
    for node, rows in enumerate(near):
        for row in rows:
            region = table.regions[row]
            if not region or inside[region][node]:
                count[row] += 1
                number[row] = first + node
    count, number = parallel.global_sum(comm, np.array([count, number]))
    if (wrong := np.flatnonzero(count != 1)).size:
        row = int(wrong[0])
        point = f"({', '.join(f'{value:g}' for value in table.points[row])})"
        where = f"{point} of {table.regions[row]!r}" if table.regions[row] else point
        several = f"{int(count[row])} nodes of the mesh are at {where}: name the region of the one that is meant"
        raise SceneError([(path, several if count[row] else f"no node of the mesh is at {where}")])
    return number.astype(np.int64)


def _marked(space: fem.FunctionSpace, tagged: TaggedMesh, region: str, path: str) -> npt.NDArray[np.bool_]:
    """Which owned nodes belong to cells of a region, shape (owned nodes,); collective."""
    if region not in tagged.regions:
        listed = ", ".join(sorted(tagged.regions)) or "none"
        raise SceneError([(path, f"the mesh has no region {region!r}; it has: {listed}")])
    mark = fem.Function(space)
    at = mark.x.array.reshape(-1, space.dofmap.index_map_bs)
    at[space.dofmap.list[tagged.cells(region)].ravel()] = 1.0
    mark.x.scatter_reverse(la.InsertMode.add)
    return np.asarray(at[: space.dofmap.index_map.size_local, 0] > 0)


def forces_at_nodes(load: Any, path: str, space: fem.FunctionSpace, tagged: TaggedMesh) -> Array:
    """A ``PointForce`` as the part of L that it is, shape (owned dofs,); collective.

    Raises:
        SceneError: see ``nodes_of``.
    """
    table = load.table(path, tagged.dimension)
    nodes, index_map = nodes_of(table, path, space, tagged), space.dofmap.index_map
    first, last = index_map.local_range
    mine = (nodes >= first) & (nodes < last)
    forces = np.zeros((index_map.size_local, space.dofmap.index_map_bs))
    np.add.at(forces[:, : tagged.dimension], nodes[mine] - first, table.vectors[mine])
    return forces.ravel()


@dataclass(frozen=True)
class LinkStiffness:
    """The stiffness of links, beside that of forms.

    Attributes:
        matrix: with a row for each unknown of the space, force per length.
        joined: pairs of nodes in one link, by their global numbers, shape (m, 2).
    """

    matrix: PETSc.Mat
    joined: Ints

    def times(self, displacement: fem.Function) -> Array:
        """The forces of a displacement at the unknowns of this rank, shape (owned dofs,); collective."""
        x, forces = self.matrix.createVecs()
        x.getArray()[:] = displacement.x.array[: x.getLocalSize()]
        self.matrix.mult(x, forces)
        return np.array(forces.getArray(readonly=True))

    def added_to(self, matrix: PETSc.Mat, fixed: npt.NDArray[np.bool_] | None = None) -> PETSc.Mat:
        """A matrix of a form on the same space with it; collective.

        Args:
            matrix: of the form; it may change.
            fixed: whose rows and columns are left out, shape (owned dofs,); None: none are.
        """
        links = self.matrix
        if fixed is not None:
            links = self.matrix.copy()
            rows = (links.getOwnershipRange()[0] + np.flatnonzero(fixed)).astype(PETSc.IntType)
            links.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
            links.zeroRowsColumns(rows, diag=0.0)
        size = matrix.getBlockSize()
        wider = matrix.copy()
        wider.axpy(1.0, links, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        wider.setBlockSize(size)
        return wider

    def assemblies(self, pieces: BodyPieces, space: fem.FunctionSpace) -> BodyPieces:
        """Pieces of a body, of which those that a link joins are one assembly; collective."""
        if pieces.count == 1:
            return pieces
        cells = space.dofmap.list
        piece = np.zeros((len(node_positions(space)), 1))
        piece[cells.ravel(), 0] = np.repeat(pieces.of_cell, cells.shape[1])
        owned_pieces = piece[: space.dofmap.index_map.size_local]
        ends = [from_owners(owned_pieces, ends, space.mesh.comm)[:, 0].astype(np.int64) for ends in self.joined.T]
        links = pieces.assembly[np.array(ends)]
        count = int(pieces.assembly.max()) + 1
        graph = coo_array((np.ones(links.shape[1]), tuple(links)), shape=(count, count))
        number = connected_components(graph, directed=False)[1].astype(np.int64)
        return replace(pieces, assembly=number[pieces.assembly])


def links_of(statement: Statement, space: fem.FunctionSpace, tagged: TaggedMesh) -> LinkStiffness | None:
    """The stiffness of all links; None: there are none; collective.

    Raises:
        SceneError: see ``nodes_of``.
    """
    resisting = [(path, entry) for path, entry in statement.listed() if isinstance(entry, Resistance)]
    links = [(path, entry) for path, entry in resisting if entry.nodal and entry.acts]
    if not links:
        return None
    index_map, block, comm = space.dofmap.index_map, space.dofmap.index_map_bs, space.mesh.comm
    rows, columns, joined = ([np.empty(0, dtype=np.int64)] for _ in range(3))
    values = [np.empty(0)]
    entry: Any
    for path, entry in links:
        table = entry.table(path, tagged.dimension)
        nodes = nodes_of(table, path, space, tagged)
        first, second = _pairs(table.groups)
        joined.append(np.column_stack((nodes[first], nodes[second])).ravel())
        dim = tagged.dimension
        products = entry.stiffness * table.vectors[first][:, :, None] * table.vectors[second][:, None, :]
        unknowns = block * nodes[:, None] + np.arange(dim)
        rows.append(np.repeat(unknowns[first], dim, axis=1).ravel())
        columns.append(np.tile(unknowns[second], dim).ravel())
        values.append(products.ravel())
    low, high = (block * bound for bound in index_map.local_range)
    row, column, value = np.concatenate(rows), np.concatenate(columns), np.concatenate(values)
    mine = (row >= low) & (row < high) & (value != 0)
    size = index_map.size_local * block
    local = coo_array(
        (value[mine], (row[mine] - low, column[mine])),
        shape=(size, index_map.size_global * block),
    ).tocsr()
    csr = (local.indptr.astype(PETSc.IntType), local.indices.astype(PETSc.IntType), local.data)
    matrix = PETSc.Mat().createAIJ(((size, None), (size, None)), csr=csr, comm=comm)
    return LinkStiffness(matrix, np.concatenate(joined).reshape(-1, 2))


def _pairs(groups: Ints) -> tuple[Ints, Ints]:
    """All ordered pairs of rows with the same number, shape (m,) each."""
    order = np.argsort(groups, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(groups[order])) + 1)
    pairs: Sequence[Any] = [(np.repeat(part, part.size), np.tile(part, part.size)) for part in parts]
    first, second = (np.concatenate(ends) for ends in zip(*pairs, strict=True))
    return first, second
