"""Plane sections in 3D, whose points also move out of their plane, by turning about its axis or along a cylinder."""

from __future__ import annotations

from typing import Any

import basix.ufl
import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import ufl
from dolfinx import mesh as dmesh

from signorini_fx.machine import compat


def section_in_space(mesh: dmesh.Mesh) -> dmesh.Mesh:
    """The same mesh in 2D x[2] = 0 of space, where displacements have three components; collective.

    It shares the topology, so that its cells and facets have the same numbers, and tags of the one are tags of the
    other.  In forms of a body of revolution about x[1] whose displacement turns with the section, the gradient of y
    along x[2] is (-y[2], 0, y[0]) / x[0], and moments of contact about x[1] are torques.

    Args:
        mesh: of the plane.
    """
    element = compat.geometry_element(mesh)
    domain = basix.ufl.element(
        "Lagrange",
        mesh.topology.cell_name(),
        element.degree,
        element.lagrange_variant,
        shape=(3,),
        dtype=mesh.geometry.x.dtype,
    )
    made: Any = type(compat.wrapped(mesh))(mesh.comm, compat.topology(mesh), compat.geometry_in_space(mesh))
    return dmesh.Mesh(made, ufl.Mesh(domain))


def is_section(mesh: dmesh.Mesh) -> bool:
    """Whether it has plane cells in 3D."""
    return bool(mesh.geometry.dim > mesh.topology.dim)
