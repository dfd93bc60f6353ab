"""How much a body is deformed, to judge whether linear elasticity is still accurate.

Linear elasticity neglects grad u^T grad u / 2 in Green's strain, whose relative size is that of
grad u (strain and rotation).  The error of a gap along the normal of the undeformed body, which
rotates, has the same relative size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import basix
import numpy as np
from dolfinx import fem

from signorini_fx.arrays import Array
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.mesh.points import determinants, inverses
from signorini_fx.mechanics.model import Model


@dataclass(frozen=True)
class Deformation:
    """The deformation of the most deformed piece of a body.

    Attributes:
        gradient: mean over the piece of the size of grad u (strain and rotation): the root of the
            mean square of its Frobenius norm; finite where single points are singular.
        displacement: largest displacement of a node, relative to the size of the pieces that are
            joined to its own.
    """

    gradient: float
    displacement: float

    @property
    def largest(self) -> float:
        """The larger of the two measures."""
        return max(self.gradient, self.displacement)


def deformation_of(
    body: Model, displacement: fem.Function, size: float, *, moves: bool = False
) -> Deformation:
    """Return how much a displacement deforms a body, from grad u at the midpoint of each cell;
    collective.

    Args:
        body: the body.
        displacement: its displacement.
        size: largest extent of the body, length.
        moves: whether to subtract the mean displacement of each piece.
    """
    pieces = body.motions.pieces
    cell = getattr(basix.CellType, body.space.mesh.topology.cell_name())
    at_middle = CellSlopes(
        displacement.function_space, basix.geometry(cell).mean(axis=0, keepdims=True)
    )
    of_place, of_displacement = next(at_middle.along_reference(displacement.x.array))
    areas = np.abs(determinants(of_place))
    slopes = np.einsum("ijc,jkc->ikc", of_displacement, inverses(of_place))
    squares = np.einsum("ikc,ikc->c", slopes, slopes)
    of_cell = pieces.of_cell[: areas.size]
    total = parallel.sums_by(
        body.comm, of_cell, np.column_stack((squares * areas, areas)), pieces.count
    )
    gradient = float(np.sqrt(total[:, 0] / total[:, 1]).max())
    y = displacement.x.array.reshape(-1, body.dimension)
    if moves:
        owned = body.fixed.size // body.dimension
        piece = body.motions.piece
        rows = np.column_stack((np.ones(owned), y[:owned]))
        sums = parallel.sums_by(body.comm, piece[:owned], rows, pieces.count)
        y = y - (sums[:, 1:] / np.maximum(sums[:, :1], 1.0))[piece]
    moved = np.linalg.norm(y, axis=1)
    assembly = pieces.assembly[body.motions.piece]
    share = 0.0
    for number in range(int(pieces.assembly.max()) + 1):
        corners = pieces.bounds[pieces.assembly == number].reshape(-1, body.dimension)
        extent = min(size, float(np.hypot.reduce(np.ptp(corners, axis=0))))
        furthest = parallel.largest(body.comm, moved[assembly == number])
        share = max(share, furthest / extent)
    return Deformation(gradient, share)


class CellSlopes:
    """Derivatives with respect to reference coordinates at some points of the reference cell, shape
    (points, d), in all owned cells.
    """

    def __init__(self, space: fem.FunctionSpace, points: Array) -> None:
        mesh = self._mesh = space.mesh
        self._dimension = mesh.topology.dim
        cell = mesh.topology.cell_name()
        owned = slice(mesh.topology.index_map(self._dimension).size_local)

        def slopes(degree: int) -> Array:
            """Return derivatives of the scalar basis functions, shape (points, d, functions)."""
            element = compat.lagrange(cell, degree, basix.LagrangeVariant.equispaced)
            return np.asarray(element.tabulate(1, points)[1:, :, :, 0]).transpose(1, 0, 2).copy()

        self._nodes = space.dofmap.list[owned]
        self._seen = mesh.geometry.x.copy()
        x = mesh.geometry.x[compat.geometry_cells(mesh)[owned], : self._dimension]
        self._x = _by_function(x.astype(np.float64))
        self._slopes = (
            slopes(compat.geometry_degree(mesh)),
            slopes(space.element.basix_element.degree),
        )

    @property
    def fits(self) -> bool:
        """Whether the coordinates of the mesh on this rank are still those of the time of
        construction.
        """
        return np.array_equal(self._mesh.geometry.x, self._seen)

    def along_reference(self, displacement: Array) -> Iterator[tuple[Array, Array]]:
        """Yield for each point the derivatives of coordinates and of displacements, shapes (d, d,
        cells) and (components, d, cells).

        The second axis is the direction in the reference cell.

        Args:
            displacement: nodal values, ghosts included.
        """
        dim = self._dimension
        components = self._mesh.geometry.dim
        y = _by_function(displacement.reshape(-1, components)[self._nodes])
        for of_place, slopes in zip(*self._slopes, strict=True):
            of_x = (of_place @ self._x).reshape(dim, dim, -1)
            of_y = (slopes @ y).reshape(dim, components, -1)
            yield of_x.transpose(1, 0, 2), of_y.transpose(1, 0, 2)


def _by_function(values: Array) -> Array:
    """Return nodal values of shape (cells, functions, d) as shape (functions, d cells), with the
    cells contiguous in memory.
    """
    return np.ascontiguousarray(values.transpose(1, 2, 0)).reshape(values.shape[1], -1)
