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
    space = displacement.function_space
    mesh, dim = space.mesh, space.mesh.topology.dim
    cell = mesh.topology.cell_name()
    owned = slice(mesh.topology.index_map(dim).size_local)

    def slopes(degree: int) -> Array:
        """Derivatives of the scalar basis functions, shape (d, points, functions)."""
        element = compat.lagrange(cell, degree, basix.LagrangeVariant.equispaced)
        return np.asarray(element.tabulate(1, points)[1:, :, :, 0])

    x = mesh.geometry.x[compat.geometry_cells(mesh)[owned], :dim].astype(np.float64)
    y = displacement.x.array.reshape(-1, mesh.geometry.dim)[space.dofmap.list[owned]]
    of_place, of_displacement = slopes(compat.geometry_degree(mesh)), slopes(space.element.basix_element.degree)

    def along_cell(values: Array, slope: Array) -> Array:
        """Derivatives of nodal values, shape (cells, functions, d), along the reference cell, shape (d, d, cells)."""
        return np.array([[values[:, :, i] @ along for along in slope] for i in range(values.shape[2])])

    for number in range(len(points)):
        adjugate, determinant = adjugates(along_cell(x, of_place[:, number]))
        gradient = np.einsum("ikc,kjc->ijc", along_cell(y, of_displacement[:, number]), adjugate)
        yield gradient / determinant, np.abs(determinant)
