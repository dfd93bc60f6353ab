"""Quadrature of products of two strains, and of contact, whose rule has the contact nodes as its points."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.kinematics.protocol import SPACE, Kinematics
from signorini_fx.tuned import ROOT_OF_EPS


def strain_degree(space: fem.FunctionSpace, kinematics: Kinematics = SPACE) -> int:
    """Quadrature degree of a(., .) for displacements in ``space``; collective.

    The degree of epsilon(y) : epsilon(z) times the Jacobian's determinant on simplices and along each axis of
    parallelepipeds; on other quadrilaterals and hexahedra, where the integrand is rational, that of the products of all
    polynomials in it.  UFL estimates the same on these in 2D.
    """
    mesh, degree, further = space.mesh, space.element.basix_element.degree, kinematics.further_degrees
    cell, geometry = mesh.topology.cell_name(), compat.geometry_degree(mesh)
    if cell in ("triangle", "tetrahedron"):
        return 2 * (degree - 1) + (2 if cell == "triangle" else 3) * (geometry - 1) + further
    return 2 * (degree if not further and parallelepipeds(mesh) else degree + geometry) + further


def parallelepipeds(mesh: dmesh.Mesh) -> bool:
    """Whether all cells are quadrilaterals or hexahedra with affine maps; collective."""
    if mesh.topology.cell_name() not in ("quadrilateral", "hexahedron") or compat.geometry_degree(mesh) > 1:
        return False
    dim = mesh.topology.dim
    corners = mesh.geometry.x[compat.geometry_cells(mesh), :dim]  # in the order of basix: along x[0] first
    edges = np.stack([corners[:, 2**k] - corners[:, 0] for k in range(dim)], axis=1)
    shortest = np.min(np.einsum("cki,cki->ck", edges, edges), axis=1)
    away = corners - corners[:, :1] - compat.geometry_element(mesh).points @ edges
    apart = np.einsum("cni,cni->cn", away, away) > ROOT_OF_EPS**2 * shortest[:, None]
    return not parallel.any_rank(mesh.comm, bool(apart.any()))


def nodal_rule(degree: int, geometry: int = 1, dimension: int = 2) -> dict[str, Any]:
    """Quadrature metadata of the unit contact form, which gives the weights of the nodes of a Lagrange element.

    In 2D the points of the rule are the nodes.  Degree 1: the vertex (trapezoidal) rule; degree 2:
    Gauss-Lobatto-Legendre (Simpson's rule).  All weights are positive, and those of the integrals of the basis
    functions.  On a surface the integrals of the basis functions stand for themselves, exactly: the vertex rule has
    them on triangles, but not on quadrilaterals that are no parallelograms.
    """
    if dimension == 3:
        return {"quadrature_degree": lumped_degree(degree, geometry)}
    if degree == 1:
        return {"quadrature_rule": "vertex", "quadrature_degree": 1}
    return {"quadrature_rule": "GLL", "quadrature_degree": 2 * degree - 1}


def lumped_degree(degree: int, geometry: int) -> int:
    """Quadrature degree that integrates a basis function of ``degree`` times the normal of a surface exactly."""
    return 2 * (degree + geometry)
