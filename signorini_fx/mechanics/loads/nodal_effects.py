"""Forces at single nodes, beside what forms say."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la

from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.nodal_table import NodalTable
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
    table = load.table(tagged.dimension)
    nodes, index_map = nodes_of(table, path, space, tagged), space.dofmap.index_map
    first, last = index_map.local_range
    mine = (nodes >= first) & (nodes < last)
    forces = np.zeros((index_map.size_local, space.dofmap.index_map_bs))
    np.add.at(forces[:, : tagged.dimension], nodes[mine] - first, table.vectors[mine])
    return forces.ravel()
