"""Quadrature degrees of products of two strains, which the solver and the certificate share."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx import mesh as dmesh

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.kinematics.cartesian import SPACE
from signorini_fx.mechanics.kinematics.protocol import Kinematics
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


def parallelepipeds(mesh: dmesh.Mesh) -> bool:
    """Whether all cells of all ranks are quadrilaterals or hexahedra with affine maps: parallelograms in 2D;
    collective.
    """
    if mesh.topology.cell_name() not in ("quadrilateral", "hexahedron") or compat.geometry_degree(mesh) > 1:
        return False
    return _has_affine_cells(mesh)


def _has_affine_cells(mesh: dmesh.Mesh) -> bool:
    """Whether all cells of all ranks have affine maps, also those with nodes between their corners; collective.

    A rank looks at its cells again only if somebody has moved their nodes.
    """
    entry = _affine_meshes.get(mesh)
    if entry is None or not np.array_equal(entry[0], mesh.geometry.x):
        entry = _affine_meshes[mesh] = mesh.geometry.x.copy(), _affine(mesh)
    return not parallel.any_rank(mesh.comm, not entry[1])


def _affine(mesh: dmesh.Mesh) -> bool:
    """The same of the cells of this rank."""
    dim = mesh.topology.dim
    cells, x = compat.geometry_cells(mesh), mesh.geometry.x[:, :dim]
    element = compat.geometry_element(mesh)
    first = x[cells[:, 0]]
    simplex = mesh.topology.cell_name() in ("interval", "triangle", "tetrahedron")
    # Vertices are in the order of basix, of cells that are no simplices along x[0] first.
    edges = np.stack([x[cells[:, k + 1 if simplex else 2**k]] - first for k in range(dim)], axis=1)
    shortest = np.min(np.einsum("cki,cki->ck", edges, edges), axis=1)
    affine = True
    for node, place in enumerate(element.points):
        away = x[cells[:, node]] - first - place @ edges
        affine &= bool((np.einsum("ci,ci->c", away, away) <= AFFINE_CELL**2 * shortest).all())
    return affine
