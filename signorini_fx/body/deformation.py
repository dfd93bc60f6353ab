"""How much a body is deformed, compared with the range of linear elasticity.

Linear elasticity uses sym(grad u) for the strain, while Green's strain is sym(grad u) + grad u^T grad u / 2: the
relative size of the neglected part is that of grad u, strain and rotation.  It also measures the gap along the normal
of the undeformed body: if a point moves the distance d along a normal that rotates by an angle, it meets the foundation
off by d times this angle, as much as a body of size d is deformed by it.
"""

from __future__ import annotations

from dataclasses import dataclass

import basix
import basix.ufl
import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx import compat, parallel
from signorini_fx.body.assembly import adjugates
from signorini_fx.body.elastic import ElasticBody


@dataclass(frozen=True)
class Deformation:
    """The deformation of the most deformed piece of a body.

    Attributes:
        gradient: mean over the piece of the size of grad u (strain and rotation): the root of the mean square of its
            Frobenius norm; finite where single points are singular.
        displacement: largest displacement of a node, relative to the size of the pieces that are joined to its own.
    """

    gradient: float
    displacement: float

    @property
    def largest(self) -> float:
        """The larger of the two."""
        return max(self.gradient, self.displacement)


def deformation_of(body: ElasticBody, displacement: fem.Function, size: float) -> Deformation:
    """How much a displacement deforms a body of a size; collective.

    grad u is evaluated at the midpoint of each cell.
    """
    pieces = body.motions.pieces
    squares, areas = _squares(body, displacement)
    of_cell = pieces.of_cell[: areas.size]
    total = parallel.sums_by(body.comm, of_cell, np.column_stack((squares * areas, areas)), pieces.count)
    gradient = float(np.sqrt(total[:, 0] / total[:, 1]).max())
    moved = np.linalg.norm(displacement.x.array.reshape(-1, body.dimension), axis=1)
    assembly = pieces.assembly[body.motions.piece]
    share = 0.0
    for number in range(int(pieces.assembly.max()) + 1):
        corners = pieces.bounds[pieces.assembly == number].reshape(-1, body.dimension)
        extent = min(size, float(np.hypot.reduce(np.ptp(corners, axis=0))))
        furthest = parallel.largest(body.comm, moved[assembly == number])
        share = max(share, furthest / extent)
    return Deformation(gradient, share)


def _squares(body: ElasticBody, displacement: fem.Function) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """|grad u|^2 at the middle of each owned cell, and the sizes of these cells, shape (cells,)."""
    mesh, space = body.space.mesh, body.space
    cell = mesh.topology.cell_name()
    middle = basix.geometry(getattr(basix.CellType, cell)).mean(axis=0, keepdims=True)
    owned = slice(mesh.topology.index_map(mesh.topology.dim).size_local)

    def slopes(degree: int) -> npt.NDArray[np.float64]:
        """Derivatives of the scalar basis functions in the middle of the reference cell, shape (d, functions)."""
        element = basix.ufl.element("Lagrange", cell, degree, lagrange_variant=basix.LagrangeVariant.equispaced)
        derivatives: npt.NDArray[np.float64] = element.tabulate(1, middle)[1:, 0]
        return derivatives

    dim = mesh.topology.dim
    x = mesh.geometry.x[compat.geometry_cells(mesh)[owned], :dim].astype(np.float64)
    y = displacement.x.array.reshape(-1, body.dimension)[space.dofmap.list[owned]]

    def along_cell(values: npt.NDArray[np.float64], degree: int) -> npt.NDArray[np.float64]:
        """Derivatives of nodal values, shape (cells, functions, d), along the reference cell, shape (d, d, cells)."""
        return np.array([[values[:, :, i] @ slope for slope in slopes(degree)] for i in range(values.shape[2])])

    adjugate, determinant = adjugates(along_cell(x, compat.geometry_degree(mesh)))
    gradient = np.einsum("ikc,kjc->ijc", along_cell(y, space.element.basix_element.degree), adjugate)
    return np.einsum("ijc,ijc->c", gradient, gradient) / determinant**2, np.abs(determinant)
