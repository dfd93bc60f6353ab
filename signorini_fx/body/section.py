"""Sections across the body: which cells are beyond them, and which of their nodes lie on them.

Beyond a section cells move against the nodes that they share with those before it, as if these nodes were there twice:
with the unit vector n across the section the displacement in a cell beyond it is that of its nodes minus s n at those
on the section, where s is the shortening.  So no node is added, and nothing but the strain of these cells changes.  The
section need not be flat: it may consist of any facets, here of those closest to a plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la
from dolfinx import mesh as dmesh

from signorini_fx import compat, parallel
from signorini_fx.body.assembly import facet_nodes
from signorini_fx.body.node_positions import node_positions
from signorini_fx.errors import SceneError
from signorini_fx.mesh.tagged import TaggedMesh

_Floats = npt.NDArray[np.float64]
_Flags = npt.NDArray[np.bool_]
# Cells whose middle is this share of the body before a plane lie on it, and count as beyond it, on all ranks alike; a
# named section that is not flat to this share is no plane.
_ON_PLANE, _FLAT = 1e-9, 1e-6


@dataclass(frozen=True)
class Section:
    """A section on this rank.

    Attributes:
        axis: n, shape (d,).
        nodes: which nodes lie on it, ghosts included, shape (nodes,).
        cells: the cells beyond it with such nodes, ghosts included, shape (c,).
        held: which of their nodes these are, shape (c, nodes of a cell).
    """

    axis: _Floats
    nodes: _Flags
    cells: npt.NDArray[np.int32]
    held: _Flags

    @property
    def jump(self) -> _Floats:
        """What a shortening of one adds to the displacement of the nodes of cells, shape (c, nodes of a cell, d)."""
        return np.where(self.held[:, :, None], -self.axis, 0.0)


def section_of(effect: Any, path: str, tagged: TaggedMesh, space: fem.FunctionSpace) -> Section:
    """The section of a preload; collective.

    Args:
        effect: of the scene.
        path: of it there.
        tagged: the mesh.
        space: of the displacement.

    Raises:
        SceneError: there is no such section, or it does not cut the body through.
    """
    mesh, dim = tagged.mesh, tagged.dimension
    of_cells, corners = space.dofmap.list, compat.geometry_cells(mesh)
    middle = mesh.geometry.x[corners, :dim].mean(axis=1)
    inside: _Flags = np.ones(len(middle), dtype=bool)
    nodes: _Flags = np.zeros(len(node_positions(space)), dtype=bool)
    key = "section"
    if effect.section is not None:
        facets = _inner_facets(effect.section, path, tagged)
        nodes = _marked(space, facet_nodes(space, facets).ravel())
        point, axis = _plane(space, nodes, tagged, path)
    else:
        key = "point"
        point, axis = np.array(effect.point), np.array(effect.axis) / np.linalg.norm(effect.axis)
        if effect.region is not None:
            inside[:] = False
            inside[tagged.cells(effect.region)] = True
    beyond = (middle - point) @ axis > -_ON_PLANE * tagged.size
    if effect.section is None:
        nodes = _marked(space, of_cells[inside & beyond].ravel()) & _marked(space, of_cells[inside & ~beyond].ravel())
    touching = nodes[of_cells].any(axis=1)
    far_nodes, near_nodes = (_marked(space, of_cells[touching & side].ravel()) for side in (beyond, ~beyond))
    where = "the mesh" if effect.region is None else f"region {effect.region!r}"
    for wrong, reason in (
        (not parallel.any_rank(mesh.comm, bool(nodes.any())), f"the plane does not cut {where}"),
        (bool((touching & ~inside).any()), f"cells outside {where} share nodes with the section: move it"),
        (bool((far_nodes & near_nodes & ~nodes).any()), "the section ends inside the body: it must cut it through"),
    ):
        if parallel.any_rank(mesh.comm, wrong):
            raise SceneError([(f"{path}.{key}", reason)])
    cells = np.flatnonzero(touching & beyond).astype(np.int32)
    return Section(axis, nodes, cells, nodes[of_cells[cells]])


def unit_jump(section: Section, space: fem.FunctionSpace) -> fem.Function:
    """``Section.jump`` as a function without continuity."""
    mesh, dim = space.mesh, space.mesh.geometry.dim
    jump = fem.Function(fem.functionspace(mesh, ("DG", space.element.basix_element.degree, (dim,))))
    jump.x.array.reshape(-1, dim)[jump.function_space.dofmap.list[section.cells]] = section.jump
    return jump


def _inner_facets(name: str, path: str, tagged: TaggedMesh) -> npt.NDArray[np.int32]:
    """The facets inside the mesh with a name, those of this rank."""
    mesh = tagged.mesh
    if name not in tagged.boundaries:
        boundary_names = ", ".join(sorted(tagged.boundaries)) or "none"
        raise SceneError([(f"{path}.section", f"the mesh has no facets {name!r}; it has: {boundary_names}")])
    mesh.topology.create_connectivity(mesh.topology.dim - 1, mesh.topology.dim)
    tags = tagged.boundaries[name]
    tagged_facets = tagged.facet_tags.indices[np.isin(tagged.facet_tags.values, tags)]
    inner_facets = np.setdiff1d(tagged_facets, dmesh.exterior_facet_indices(mesh.topology)).astype(np.int32)
    if not parallel.any_rank(mesh.comm, inner_facets.size > 0):
        raise SceneError([(f"{path}.section", f"{name!r} has no facets inside the mesh: it is on its boundary")])
    return inner_facets


def _plane(space: fem.FunctionSpace, nodes: _Flags, tagged: TaggedMesh, path: str) -> tuple[_Floats, _Floats]:
    """A point and the unit normal of the plane through nodes.

    Raises:
        SceneError: there is none.
    """
    comm, owned = space.mesh.comm, space.dofmap.index_map.size_local
    x = node_positions(space)[:owned, : tagged.dimension][nodes[:owned]]
    sums = parallel.global_sum(comm, np.append(x.sum(axis=0), len(x)))
    point = sums[:-1] / sums[-1]
    spread, directions = np.linalg.eigh(parallel.global_sum(comm, (x - point).T @ (x - point)))
    if np.sqrt(max(spread[0], 0.0) / sums[-1]) > _FLAT * tagged.size:
        raise SceneError([(f"{path}.section", "its facets are not in one plane: give point and axis instead")])
    return point, directions[:, 0]


def _marked(space: fem.FunctionSpace, nodes: npt.NDArray[np.int32]) -> _Flags:
    """Which nodes of this rank, ghosts included, any rank has named."""
    mark = la.vector(space.dofmap.index_map, 1, dtype=np.int32)
    mark.array[nodes] = 1
    mark.scatter_reverse(la.InsertMode.add)
    mark.scatter_forward()
    return np.asarray(mark.array > 0)
