"""Two bodies in contact for multigrid: what contact holds is the relative displacement, and both may move together.

With B from unknowns to relative displacements at the points, S back to the unknowns of the side with the points
(B S = 1), and E the projections onto the directions that contact holds at each point, the finest interpolation P
becomes P - X, X = S E B P, on which contact as far as it is stiff does no work: E B (P - X) = 0.  Truncation of both
sides would clamp the interface in space.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.contact.map import ContactMap
from signorini_fx.tuned import HELD_STIFFNESS

Array = npt.NDArray[np.float64]


class JoinedBodies:
    """S E B and B^T D B at the contact unknowns c, D without what E holds.

    Args:
        contact: the map, with S.
        places: the contact unknowns.
        elastic: A_cc.
    """

    def __init__(self, contact: ContactMap, places: PETSc.IS, elastic: PETSc.Mat) -> None:
        assert contact.lift is not None
        self._contact, self._elastic = contact, elastic
        first, last = contact.operator.getOwnershipRange()
        rows = PETSc.IS().createStride(last - first, first, 1, comm=contact.operator.comm)
        self._operator = contact.operator.createSubMatrix(rows, places)
        self._lift = contact.lift.createSubMatrix(places, None)
        stiffness = self._blocks(elastic.ptap(self._lift))
        self._scale = np.trace(stiffness, axis1=1, axis2=2) / stiffness.shape[1]
        self._scale[self._scale <= 0] = 1.0  # where supports prescribe all of a point

    def _blocks(self, matrix: PETSc.Mat) -> Array:
        """The blocks on the diagonal of a matrix with rows for the points, shape (n, d, d)."""
        shape = self._contact.points.movable.shape
        starts, columns, values = matrix.getValuesCSR()
        row = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        column = columns - matrix.getOwnershipRange()[0]
        same = row // shape[1] == column // shape[1]
        found = np.zeros(shape)
        found[row[same] // shape[1], row[same] % shape[1], column[same] % shape[1]] = values[same]
        return found

    def moved(self, held: Array) -> PETSc.Mat:
        """S E B from projections E of shape (n, d, d); collective."""
        return self._lift.matMult(self._contact.law(held)).matMult(self._operator)

    def split(self, tangent: PETSc.Mat | None) -> tuple[PETSc.Mat, PETSc.Mat]:
        """S E B, and B^T D B of what E does not hold; collective.

        Args:
            tangent: (A + C)_cc.
        """
        assert tangent is not None
        added = tangent.copy()
        added.axpy(-1.0, self._elastic, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        laws = self._blocks(added.ptap(self._lift)) / self._scale[:, None, None]
        _, stiffness, directions = np.linalg.svd(laws)
        stiff = directions * (stiffness > HELD_STIFFNESS)[:, :, None]
        held = stiff.transpose(0, 2, 1) @ stiff
        free = np.eye(held.shape[1]) - held
        soft = free @ (laws + laws.transpose(0, 2, 1)) @ free * (self._scale / 2)[:, None, None]
        rest = self._contact.law(soft).matMult(self._operator)
        return self.moved(held), self._operator.transposeMatMult(rest)
