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
from dolfinx import fem

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.cell_gradients import gradients
from signorini_fx.mechanics.body.elastic_body import ElasticBody


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
    """How much a displacement deforms a body of a size, from grad u at the midpoint of each cell; collective."""
    pieces = body.motions.pieces
    cell = getattr(basix.CellType, body.space.mesh.topology.cell_name())
    slopes, areas = next(gradients(displacement, basix.geometry(cell).mean(axis=0, keepdims=True)))
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
