"""Plane sections in space, whose points also move out of their plane: torsion, and slip along a cylinder."""

from __future__ import annotations

import basix.ufl
import numpy as np
from dolfinx import mesh as dmesh

from signorini_fx import compat


def section_in_space(mesh: dmesh.Mesh) -> dmesh.Mesh:
    """The same mesh in the plane x[2] = 0 of space, where displacements have three components; collective.

    It is distributed and numbered anew, and has no tags.  In forms of a body of revolution about x[1] whose
    displacement turns with the section, the gradient of y along x[2] is (-y[2], 0, y[0]) / x[0], and moments of contact
    about x[1] are torques.

    Args:
        mesh: of the plane.
    """
    geometry, element = mesh.geometry, compat.geometry_element(mesh)
    nodes, cells = geometry.index_map(), compat.geometry_cells(mesh)
    own = cells[: mesh.topology.index_map(mesh.topology.dim).size_local]
    numbers = nodes.local_to_global(own.ravel()).reshape(-1, cells.shape[1])
    place = basix.ufl.element(
        "Lagrange",
        mesh.topology.cell_name(),
        element.degree,
        element.lagrange_variant,
        shape=(3,),
        dtype=geometry.x.dtype,
    )
    return dmesh.create_mesh(mesh.comm, cells=numbers, x=np.array(geometry.x[: nodes.size_local]), e=place)


def is_section(mesh: dmesh.Mesh) -> bool:
    """Whether it has plane cells in space."""
    return bool(mesh.geometry.dim > mesh.topology.dim)
