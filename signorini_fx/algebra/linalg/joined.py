"""Two bodies in contact for multigrid: what contact holds is the relative displacement, and both may move together.

With B from unknowns to relative displacements at the points, S back to the unknowns of the side with the points
(B S = 1), and E the projections onto the directions that contact holds at each point, the finest interpolation P
becomes P - X, X = S E B P, on which contact as far as it is stiff does no work: E B (P - X) = 0.  Truncation of both
sides would clamp the interface in 3D.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.linalg.nodal_blocks import stiff_and_soft

Array = npt.NDArray[np.float64]


class JoinedBodies:
    """What contact holds of two bodies, at each point and in the frame of its relative displacement.

    Args:
        contact: the map, with S.
        places: the contact unknowns c.
        elastic: A_cc.

    Attributes:
        shape: of blocks, (n, d, d).
        operator: B at the contact unknowns.
        lift: S there.
    """

    def __init__(self, contact: ContactMap, places: PETSc.IS, elastic: PETSc.Mat) -> None:
        assert contact.lift is not None
        first, last = contact.operator.getOwnershipRange()
        rows = PETSc.IS().createStride(last - first, first, 1, comm=contact.operator.comm)
        self.operator = contact.operator.createSubMatrix(rows, places)
        self.lift = contact.lift.createSubMatrix(places, None)
        self.shape: tuple[int, ...] = contact.points.movable.shape
        self.matrix = contact.law
        self._elastic = self._blocks(elastic.ptap(self.lift))
        self._scale = np.trace(self._elastic, axis1=1, axis2=2) / self.shape[1]
        self._scale[self._scale <= 0] = 1.0  # where supports prescribe all of a point

    def _blocks(self, matrix: PETSc.Mat) -> Array:
        """The blocks on the diagonal of a matrix with rows for the points, shape (n, d, d)."""
        size = self.shape[1]
        starts, columns, values = matrix.getValuesCSR()
        row = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        column = columns - matrix.getOwnershipRange()[0]
        on_block = row // size == column // size
        blocks = np.zeros(self.shape)
        blocks[row[on_block] // size, row[on_block] % size, column[on_block] % size] = values[on_block]
        return blocks

    def split(self, reduced: PETSc.Mat | None) -> tuple[Array, Array]:
        """E, and D of what E does not hold.

        Args:
            reduced: S^T (A + C)_cc S.
        """
        assert reduced is not None
        return stiff_and_soft((self._blocks(reduced) - self._elastic) / self._scale[:, None, None], self._scale)
