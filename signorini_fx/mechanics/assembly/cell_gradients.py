"""Gradients of displacements at points of the reference cell, in NumPy, for all cells of this rank at once."""

from __future__ import annotations

from collections.abc import Iterator

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.machine import compat
from signorini_fx.mechanics.assembly.mesh_entities import adjugates

Array = npt.NDArray[np.float64]


def gradients(displacement: fem.Function, points: Array) -> Iterator[tuple[Array, Array]]:
    """Of each point, shape (points, d), of the reference cell du_i/dx_j in all owned cells, shape (d, d, cells), and
    the size of the determinant of the map from the reference cell, shape (cells,).
    """
    for of_place, of_displacement in CellSlopes(displacement.function_space, points).along_reference(displacement):
        adjugate, determinant = adjugates(of_place)
        yield np.einsum("ikc,kjc->ijc", of_displacement, adjugate) / determinant, np.abs(determinant)


class CellSlopes:
    """Derivatives along the reference cell at some of its points, shape (points, d), in all owned cells."""

    def __init__(self, space: fem.FunctionSpace, points: Array) -> None:
        mesh = self._mesh = space.mesh
        self._dimension = mesh.topology.dim
        cell, owned = mesh.topology.cell_name(), slice(mesh.topology.index_map(self._dimension).size_local)

        def slopes(degree: int) -> Array:
            """Derivatives of the scalar basis functions, shape (points, d, functions)."""
            element = compat.lagrange(cell, degree, basix.LagrangeVariant.equispaced)
            return np.asarray(element.tabulate(1, points)[1:, :, :, 0]).transpose(1, 0, 2).copy()

        self._nodes, self._seen = space.dofmap.list[owned], mesh.geometry.x.copy()
        x = mesh.geometry.x[compat.geometry_cells(mesh)[owned], : self._dimension]
        self._x = _by_function(x.astype(np.float64))
        self._slopes = slopes(compat.geometry_degree(mesh)), slopes(space.element.basix_element.degree)

    @property
    def fits(self) -> bool:
        """Whether the mesh is where it was, on this rank."""
        return np.array_equal(self._mesh.geometry.x, self._seen)

    def of_places(self) -> Iterator[Array]:
        """Of each point the derivatives of places, shape (d, d, cells), the direction in the reference cell last."""
        dim = self._dimension
        for slopes in self._slopes[0]:
            yield (slopes @ self._x).reshape(dim, dim, -1).transpose(1, 0, 2)

    def along_reference(self, displacement: fem.Function) -> Iterator[tuple[Array, Array]]:
        """Of each point the derivatives of places, and of displacements likewise."""
        dim, components = self._dimension, self._mesh.geometry.dim
        y = _by_function(displacement.x.array.reshape(-1, components)[self._nodes])
        for of_place, slopes in zip(self.of_places(), self._slopes[1], strict=True):
            yield of_place, (slopes @ y).reshape(dim, components, -1).transpose(1, 0, 2)


def _by_function(values: Array) -> Array:
    """Of nodal values, shape (cells, functions, d): shape (functions, d cells), the cells next to each other."""
    return np.ascontiguousarray(values.transpose(1, 2, 0)).reshape(values.shape[1], -1)
