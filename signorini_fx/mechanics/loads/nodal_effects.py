"""What acts at single nodes: which node a point is, and the forces at it beside what forms say."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la

from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.tuned import ROOT_OF_EPS


def node_at(
    space: fem.FunctionSpace, effect: Any, path: str, tagged: TaggedMesh, bodies: Sequence[str] = ()
) -> npt.NDArray[np.int64]:
    """The node of this rank at the point ``at`` of an effect, of its region if it names one, ghosts included, shape
    (1,) or (0,); ``path`` and ``bodies``, regions with meshes of their own, are for errors; collective.

    Raises:
        SceneError: there is none on any rank, or there are several.
    """
    point, x = np.array(effect.at), node_positions(space)[:, : tagged.dimension]
    away = np.linalg.norm(x - point, axis=1)
    near = away <= ROOT_OF_EPS * tagged.size
    if effect.region is not None:
        near &= _of_region(space, tagged, effect.region)
    candidates = np.flatnonzero(near)
    if not parallel.any_rank(tagged.mesh.comm, candidates.size > 0):
        nearest = parallel.gather_rows(tagged.mesh.comm, np.column_stack((away, x))[np.argsort(away)[:1]])
        nearest_point = np.round(nearest[np.argmin(nearest[:, 0]), 1:] / tagged.size, 9) * tagged.size
        at = ", ".join(f"{value:.6g}" for value in nearest_point)
        raise SceneError([(f"{path}.at", f"no node of the mesh is at {effect.place}; near is ({at})")])
    owned = candidates[candidates < space.dofmap.index_map.size_local]
    count = int(parallel.global_sum(tagged.mesh.comm, np.array(owned.size)))
    if count > 1:
        nodes = {body: bool(np.isin(owned, space.dofmap.list[tagged.cells(body)]).any()) for body in bodies}
        touching = [repr(body) for body, has_node in nodes.items() if parallel.any_rank(tagged.mesh.comm, has_node)]
        of = f" of the bodies {' and '.join(touching)}" if touching else " of parts that do not share their nodes"
        message = (
            f"{count} nodes of the mesh are at {effect.place},{of}: which one is meant is not known; name its region, "
            "or choose a point at which there is one node, or a boundary of one of them"
        )
        raise SceneError([(f"{path}.at", message)])
    return candidates


def _of_region(space: fem.FunctionSpace, tagged: TaggedMesh, region: str) -> npt.NDArray[np.bool_]:
    """Which nodes of this rank, ghosts included, belong to cells of a region, shape (nodes,); collective."""
    mark = fem.Function(space)
    at = mark.x.array.reshape(-1, space.dofmap.index_map_bs)
    at[space.dofmap.list[tagged.cells(region)].ravel()] = 1.0
    mark.x.scatter_reverse(la.InsertMode.add)
    mark.x.scatter_forward()
    return np.asarray(mark.x.array.reshape(at.shape)[:, 0] > 0)


def forces_at_nodes(load: Any, path: str, space: fem.FunctionSpace, tagged: TaggedMesh) -> npt.NDArray[np.float64]:
    """A ``PointForce`` as the part of L that it is, shape (owned dofs,); collective.

    Raises:
        SceneError: see ``node_at``.
    """
    node, owned = node_at(space, load, path, tagged), space.dofmap.index_map.size_local
    at, forces = in_space(np.array([load.at])), np.zeros((owned, space.dofmap.index_map_bs))
    forces[node[node < owned], : tagged.dimension] = [sample(c, at)[0] for c in load.components[: tagged.dimension]]
    return forces.ravel()
