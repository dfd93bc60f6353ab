"""Quadrature degrees of products of two strains, which the solver and the certificate share."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx import mesh as dmesh

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.kinematics.cartesian import Kinematics
from signorini_fx.mechanics.kinematics.space import SPACE
from signorini_fx.mechanics.materials.isotropic import elastic_degree
from signorini_fx.tuned import AFFINE_CELL

# The positions of the nodes of each mesh that still exists, and whether its cells on this rank are so.
_affine_meshes: WeakKeyDictionary[dmesh.Mesh, tuple[npt.NDArray[Any], bool]] = WeakKeyDictionary()


def strain_degree(space: fem.FunctionSpace, kinematics: Kinematics = SPACE) -> int:
    """Quadrature degree of a(., .) for displacements in ``space``, see ``elastic_degree``; collective."""
    mesh, element = space.mesh, space.element.basix_element.degree
    geometry = compat.geometry_degree(mesh)
    further = kinematics.further_degrees
    if not further and parallelepipeds(mesh):
        geometry = 0
    return elastic_degree(mesh.topology.cell_name(), element, geometry) + further


def has_affine_parts(mesh: dmesh.Mesh, *, in_body: bool) -> bool:
    """Whether the map of every facet, or of every cell, is affine, so that loads can be cut where they jump;
    collective.
    """
    plane = mesh.topology.dim == 2 and not in_body
    straight = plane or mesh.topology.cell_name() in ("triangle", "tetrahedron")
    return (straight and compat.geometry_degree(mesh) == 1) or parallelepipeds(mesh)


def parallelepipeds(mesh: dmesh.Mesh) -> bool:
    """Whether all cells of all ranks are quadrilaterals or hexahedra with affine maps: parallelograms in the plane;
    collective.

    A rank looks at its cells again only if somebody has moved their nodes.
    """
    if mesh.topology.cell_name() not in ("quadrilateral", "hexahedron") or compat.geometry_degree(mesh) > 1:
        return False
    entry = _affine_meshes.get(mesh)
    if entry is None or not np.array_equal(entry[0], mesh.geometry.x):
        entry = _affine_meshes[mesh] = mesh.geometry.x.copy(), _affine(mesh)
    return not parallel.any_rank(mesh.comm, not entry[1])


def _affine(mesh: dmesh.Mesh) -> bool:
    """The same of the cells of this rank."""
    dim = mesh.topology.dim
    cells, x = compat.geometry_cells(mesh), mesh.geometry.x[:, :dim]
    first = x[cells[:, 0]]
    edges = [x[cells[:, 2**k]] - first for k in range(dim)]  # vertices in the order of basix: along x[0] first
    shortest = np.min([np.einsum("ci,ci->c", edge, edge) for edge in edges], axis=0)
    affine = True
    for vertex in range(3, 2**dim):
        along = [edges[k] for k in range(dim) if vertex >> k & 1]
        if len(along) > 1:
            away = x[cells[:, vertex]] - first - sum(along)
            affine &= bool((np.einsum("ci,ci->c", away, away) <= AFFINE_CELL**2 * shortest).all())
    return affine
