"""Gradients of displacements at points of the reference cell, in NumPy, for all cells of this rank at once."""

from __future__ import annotations

from collections.abc import Iterator

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.machine import compat
from signorini_fx.mechanics.body.assembly import adjugates

Array = npt.NDArray[np.float64]


def gradients(displacement: fem.Function, points: Array) -> Iterator[tuple[Array, Array]]:
    """Of each point the gradient in all owned cells and how much larger these are than the reference cell there.

    Args:
        displacement: in a vector Lagrange space of degree 1 or 2.
        points: of the reference cell, shape (points, d).

    Yields:
        du_i/dx_j, shape (d, d, cells), and the size of the determinant of the map from the reference cell, shape
        (cells,).
    """
    for of_place, of_displacement in along_reference(displacement, points):
        adjugate, determinant = adjugates(of_place)
        yield np.einsum("ikc,kjc->ijc", of_displacement, adjugate) / determinant, np.abs(determinant)


def along_reference(displacement: fem.Function, points: Array) -> Iterator[tuple[Array, Array]]:
    """Of each point the derivatives of places and displacements along the reference cell.

    Args:
        displacement: see ``gradients``.
        points: see ``gradients``.

    Yields:
        In all owned cells, shapes (d, d, cells), the direction in the reference cell last.
    """
    space = displacement.function_space
    mesh, dim = space.mesh, space.mesh.topology.dim
    cell = mesh.topology.cell_name()
    owned = slice(mesh.topology.index_map(dim).size_local)

    def slopes(degree: int) -> Array:
        """Derivatives of the scalar basis functions, shape (d, points, functions)."""
        element = compat.lagrange(cell, degree, basix.LagrangeVariant.equispaced)
        return np.asarray(element.tabulate(1, points)[1:, :, :, 0])

    def by_function(values: Array) -> Array:
        """Of nodal values, shape (cells, functions, d): shape (functions, d cells), the cells next to each other."""
        return np.ascontiguousarray(values.transpose(1, 2, 0)).reshape(values.shape[1], -1)

    x = by_function(mesh.geometry.x[compat.geometry_cells(mesh)[owned], :dim].astype(np.float64))
    y = by_function(displacement.x.array.reshape(-1, mesh.geometry.dim)[space.dofmap.list[owned]])
    of_place, of_displacement = slopes(compat.geometry_degree(mesh)), slopes(space.element.basix_element.degree)
    for number in range(len(points)):
        yield (
            (of_place[:, number] @ x).reshape(dim, dim, -1).transpose(1, 0, 2),
            (of_displacement[:, number] @ y).reshape(dim, mesh.geometry.dim, -1).transpose(1, 0, 2),
        )
