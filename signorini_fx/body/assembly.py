"""Tools for all forms: facets as integration entities, measures, assembled vectors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc


def facet_entities(mesh: dmesh.Mesh, facets: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """(cell, facet of the cell) of exterior facets, shape (facets, 2)."""
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    mesh.topology.create_connectivity(dim, dim - 1)
    facet_cells = mesh.topology.connectivity(dim - 1, dim)
    cell_facets = mesh.topology.connectivity(dim, dim - 1)
    if facets.size == 0:  # a rank may have no cells at all
        return np.empty((0, 2), dtype=np.int32)
    cells = facet_cells.array[facet_cells.offsets[facets]]
    per_cell = cell_facets.array.reshape(cell_facets.num_nodes, -1)
    return np.column_stack((cells, np.argmax(per_cell[cells] == facets[:, None], axis=1))).astype(np.int32)


def facet_vertices(mesh: dmesh.Mesh, facets: npt.NDArray[np.int32]) -> npt.NDArray[np.float64]:
    """The vertices of each facet, m of them, shape (facets, m, 3)."""
    if facets.size == 0:  # dolfinx divides by their number
        return np.empty((0, mesh.topology.dim, 3))
    return mesh.geometry.x[dmesh.entities_to_geometry(mesh, mesh.topology.dim - 1, facets)].astype(np.float64)


def measure(mesh: dmesh.Mesh, parts: Sequence[npt.NDArray[np.int32]], metadata: dict[str, Any]) -> Any:
    """Integration over lists of facets, which may overlap, numbered from 1.

    The numbers do not depend on the mesh's own tags, so that forms on different boundaries are compiled once.
    """
    data = [(number, facet_entities(mesh, facets).ravel()) for number, facets in enumerate(parts, start=1)]
    return ufl.Measure("ds", domain=mesh, subdomain_data=data, metadata=metadata)


def assemble(form: fem.Form) -> PETSc.Vec:
    """A linear form as a vector, summed over the ranks; collective."""
    vector = fem_petsc.assemble_vector(form)
    vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
    return vector


def action(elastic: tuple[fem.Form, ...], function: fem.Function, blocks: npt.NDArray[np.int32]) -> PETSc.Vec:
    """a(function, .) with the values at the nodes ``blocks`` only: the lifting of a displacement prescribed there.

    dolfinx lifts prescribed values by assembling the same form cell by cell, so that no further form is compiled.
    """
    result = fem.Function(function.function_space)
    vector = result.x.petsc_vec
    for form in elastic:
        fem_petsc.apply_lifting(vector, [form], bcs=[[fem.dirichletbc(function, blocks)]])
    vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
    vector.scale(-1.0)
    return vector.copy()


def adjugates(matrices: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Adjugate (inverse times determinant) and determinant of many matrices, by hand, because there are many.

    Args:
        matrices: shape (d, d, ...), d = 2 or 3.

    Returns:
        Shapes (d, d, ...) and (...).
    """
    if len(matrices) == 2:
        (a, b), (c, d) = matrices
        return np.array([[d, -b], [-c, a]]), a * d - b * c
    columns = matrices.swapaxes(0, 1)
    rows = [np.cross(columns[k - 2], columns[k - 1], axis=0) for k in range(3)]
    return np.array(rows), np.asarray((rows[0] * columns[0]).sum(axis=0))
