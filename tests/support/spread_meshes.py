"""Scenes whose mesh one rank has made, on all ranks."""

from dataclasses import replace

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.machine import compat
from signorini_fx.mechanics.mesh.distribution import Tagged, distributed, domain
from signorini_fx.mechanics.mesh.tagged import TaggedMesh

WORLD = MPI.COMM_WORLD


def on_all_ranks(scene):
    """The scene with its mesh, which each rank has alone, shared by all of them; other meshes are made when needed."""
    if not isinstance(scene.mesh, TaggedMesh):
        return scene
    return scene.model_copy(update={"mesh": spread(scene.mesh)})


def spread(tagged):
    """A mesh that each rank has alone, with its cells in the same order, shared by all ranks."""
    mesh, dim, element = tagged.mesh, tagged.dimension, compat.geometry_element(tagged.mesh)
    names, order = np.asarray(mesh.geometry.input_global_indices), np.argsort(mesh.topology.original_cell_index)
    at = np.argsort(names)
    corners = np.searchsorted(names, names[compat.geometry_cells(mesh)], sorter=at).astype(np.int64)
    points = mesh.geometry.x[at, :dim].astype(np.float64)
    sides = dmesh.entities_to_geometry(mesh, dim - 1, tagged.facet_tags.indices)
    tags = {dim - 1: (np.searchsorted(names, names[sides], sorter=at).astype(np.int64), tagged.facet_tags.values)}
    if tagged.cell_tags is not None:
        tags[dim] = corners[tagged.cell_tags.indices], tagged.cell_tags.values
    mine = slice(None) if WORLD.rank == 0 else slice(0)
    shared, made = distributed(
        WORLD,
        domain(mesh.topology.cell_name(), element.degree, dim, int(element.lagrange_variant)),
        corners[order][mine],
        points[mine],
        {entity_dim: Tagged(nodes[mine], values[mine]) for entity_dim, (nodes, values) in tags.items()},
    )
    return replace(tagged, mesh=shared, facet_tags=made[dim - 1], cell_tags=made.get(dim))
