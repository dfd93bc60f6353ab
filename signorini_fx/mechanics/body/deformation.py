"""How much a body is deformed, compared with the range of linear elasticity.

Linear elasticity uses sym(grad u) for the strain, while Green's strain is sym(grad u) + grad u^T grad u / 2: the
relative size of the neglected part is that of grad u, strain and rotation.  It also measures the gap along the normal
of the undeformed body: if a point moves the distance d along a normal that rotates by an angle, it meets the foundation
off by d times this angle, as much as a body of size d is deformed by it.
"""

from __future__ import annotations

from dataclasses import dataclass

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem, la

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.cell_gradients import gradients
from signorini_fx.mechanics.body.elastic_body import ElasticBody
from signorini_fx.tuned import LOST_UNITS


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
    slopes, areas = _gradients(body, displacement)
    squares = np.einsum("ijc,ijc->c", slopes, slopes)
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


def added_stiffness(displacement: fem.Function) -> float:
    """By which share cells of degree 1 make a body stiffer than it is, an estimate; 0: of another degree; collective.

    Green's strain is averaged at the vertices (O. C. Zienkiewicz, J. Z. Zhu, Int. J. Numer. Meth. Engng. 24 (1987)
    337-357).  With the share s of its square by which it differs from the interpolated averages this is s / (1 - s).
    In a plank that bends s is .03 to .55, and forces are too large by 6 to 150 %; the estimate is 7 to 150 %.
    """
    space, mesh = displacement.function_space, displacement.function_space.mesh
    if space.element.basix_element.degree != 1:
        return 0.0
    name, dim = mesh.topology.cell_name(), mesh.geometry.dim
    cell = getattr(basix.CellType, name)
    points, weights = basix.make_quadrature(cell, 3)
    vertices = space.dofmap.list[: mesh.topology.index_map(mesh.topology.dim).size_local]

    def strains(at: npt.NDArray[np.float64]) -> list[tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]]:
        """Green's strain in all owned cells, shape (cells, d d), and the sizes of these, at each point."""
        found = []
        for slopes, sizes in gradients(displacement, at):
            strain = slopes + slopes.swapaxes(0, 1) + np.einsum("kic,kjc->ijc", slopes, slopes)
            found.append((strain.reshape(dim * dim, -1).T / 2, sizes))
        return found

    sums = la.vector(space.dofmap.index_map, dim * dim + 1)
    rows = sums.array.reshape(-1, dim * dim + 1)
    for corner, (strain, sizes) in enumerate(strains(basix.geometry(cell))):
        np.add.at(rows, vertices[:, corner], sizes[:, None] * np.column_stack((strain, np.ones(len(sizes)))))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    averages = (rows[:, :-1] / rows[:, -1:])[vertices]
    shares = compat.lagrange(name, 1, basix.LagrangeVariant.equispaced).tabulate(0, points)[0, :, :, 0]
    missed, whole, volume, smallest = 0.0, 0.0, 0.0, np.inf
    for share, weight, (strain, sizes) in zip(shares, weights, strains(points), strict=True):
        missed += weight * float(sizes @ ((np.einsum("v,cvm->cm", share, averages) - strain) ** 2).sum(axis=1))
        whole += weight * float(sizes @ (strain**2).sum(axis=1))
        volume, smallest = volume + weight * float(sizes.sum()), min(smallest, float(sizes.min(initial=np.inf)))
    missed, whole, volume = parallel.global_sum(mesh.comm, np.array([missed, whole, volume]))
    cell_size = (-parallel.largest(mesh.comm, np.array([-smallest]), -np.inf)) ** (1 / dim)
    moved = parallel.largest(mesh.comm, np.abs(displacement.x.array), 0.0)
    round_off = LOST_UNITS * float(np.finfo(float).eps) * moved / cell_size
    if whole <= round_off**2 * volume:
        return 0.0
    return float(missed / (whole - missed)) if missed < whole else np.inf


def _gradients(
    body: ElasticBody, displacement: fem.Function
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Grad u at the middle of each owned cell, shape (d, d, cells), and the sizes of these cells, shape (cells,)."""
    middle = basix.geometry(getattr(basix.CellType, body.space.mesh.topology.cell_name())).mean(axis=0, keepdims=True)
    return next(gradients(displacement, middle))
