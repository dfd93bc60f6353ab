"""The levels of a hierarchy truncated where contact holds the body: what ``multigrid`` says of A_1', A_2', ...

With E the projections onto the directions that contact holds, a block for each point, and C' the soft rest of its
stiffness, X = S E G.  On a rigid foundation points are nodes, S = 1 and G = P_c.  Of two bodies S goes from relative
displacements at the points back to the unknowns of the side with the points, B S = 1, and G = B P_c: then contact does
no work on P - X as far as it is stiff, while truncation of both sides would clamp the interface in 3D.  As C' is zero
where E is not,

    A_1' = A_1 + G^T (E K E + C') G - G^T E V - V^T E G,   K = S^T A_cc S,   V = S^T (A P)_c.

Nothing but the blocks changes from one tangent to the next.  So the pattern of each product is found once, which takes
five to ten times as long as its numbers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.algebra.linalg import DIFFERENT_PATTERN, SAME_PATTERN, SUBSET_PATTERN, row_by_row
from signorini_fx.algebra.linalg.blocks import apart, change_added, is_by_blocks, with_added
from signorini_fx.tuned import NOTHING_LEFT

if TYPE_CHECKING:
    from signorini_fx.algebra.linalg.nodal_blocks import NodalBlocks

Array = npt.NDArray[np.float64]


class TruncatedLevels:
    """(I - E) P_0, ``interpolation``, and the coarse matrices A_1', A_2', ..., which change in place; ``lift``: S,
    None: the unit matrix; ``functions``: G; ``elastic``: A_cc; ``product``: (A P)_c; ``places``: c, numbers of the
    contact unknowns of this rank.
    """

    def __init__(
        self,
        blocks: NodalBlocks,
        lift: PETSc.Mat | None,
        functions: PETSc.Mat,
        elastic: PETSc.Mat,
        product: PETSc.Mat,
        interpolations: tuple[PETSc.Mat, ...],
        coarse: tuple[PETSc.Mat, ...],
        places: PETSc.IS,
    ) -> None:
        self._blocks, self._lift, self._functions = blocks, lift, functions
        self._below = interpolations[1:]
        self._places = places
        zero_blocks = np.zeros(blocks.shape)
        self._held, self._soft = blocks.matrix(zero_blocks), blocks.matrix(zero_blocks)
        self._stiffness = elastic.copy() if lift is None else elastic.ptap(lift)
        self._stiffness.axpy(1.0, self._soft, structure=DIFFERENT_PATTERN)
        self._product = product if lift is None else lift.transposeMatMult(product)
        # Everything with no direction held, for its pattern.
        self._along = self._held.matMult(functions)
        self._moved = self._along if lift is None else lift.matMult(self._along)
        self._contact_rows = interpolations[0].createSubMatrix(places, None)
        self._contact_rows.axpy(1.0, self._moved, structure=DIFFERENT_PATTERN)
        self._kept_rows = self._contact_rows.copy()
        self.interpolation = interpolations[0].copy()
        self.interpolation.axpy(1.0, self._in_all_rows(self._moved), structure=DIFFERENT_PATTERN)
        row_by_row(self.interpolation)
        self._law = self._stiffness.ptap(self._held)
        self._by_law = self._law.ptap(functions)
        self._half = self._along.transposeMatMult(self._product)
        self._other_half = self._half.transpose(PETSc.Mat())
        change = self._by_law.copy()
        change.axpy(1.0, self._half, structure=DIFFERENT_PATTERN)
        change.axpy(1.0, self._other_half, structure=DIFFERENT_PATTERN)
        self._changes, self._products = [change], list[PETSc.Mat]()
        for interpolation in self._below:
            self._products.append(self._changes[-1].matMult(interpolation))
            self._changes.append(interpolation.transposeMatMult(self._products[-1]))
        self._untruncated, self.coarse = list[PETSc.Mat](), list[PETSc.Mat]()
        for level, change in zip(coarse, self._changes, strict=True):
            wider = _widened(level, change)
            if is_by_blocks(level):  # what truncation cancels is beside it in double precision
                level, entries = apart(level, change)
                wider.axpy(1.0, entries, structure=SUBSET_PATTERN)
                self.coarse.append(with_added(level, wider.copy()))
            else:
                self.coarse.append(row_by_row(wider.copy()))
            self._untruncated.append(wider)
        for level in self.coarse:
            level.setOption(PETSc.Mat.Option.SPD, True)

    def _in_all_rows(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """A matrix with rows at the contact unknowns as one with rows at all unknowns; collective."""
        first, last = self.interpolation.getOwnershipRange()
        starts, columns, values = matrix.getValuesCSR()
        counts = np.zeros(last - first, dtype=PETSc.IntType)
        counts[self._places.getIndices() - first] = np.diff(starts)
        csr = (np.concatenate(([0], np.cumsum(counts))).astype(PETSc.IntType), columns, values)
        return PETSc.Mat().createAIJ(self.interpolation.getSizes(), csr=csr, comm=matrix.comm)

    def truncate(self, held: Array, soft: Array) -> None:
        """Truncate the levels anew by E, ``held``, and C', ``soft``, force per length; collective."""
        self._blocks.matrix(held, self._held)
        self._blocks.matrix(soft, self._soft)
        self._held.matMult(self._functions, result=self._along)
        if self._lift is not None:
            self._lift.matMult(self._along, result=self._moved)
        self._contact_rows.copy(self._kept_rows, SAME_PATTERN)
        self._kept_rows.axpy(-1.0, self._moved, structure=SUBSET_PATTERN)
        starts, columns, values = self._kept_rows.getValuesCSR()
        if len(starts) > 1:
            self.interpolation.setValuesIJV(starts, columns, values, rowmap=self._places.getIndices())
        self.interpolation.assemble()
        self._stiffness.ptap(self._held, result=self._law)
        self._law.axpy(1.0, self._soft, structure=SUBSET_PATTERN)
        self._law.ptap(self._functions, result=self._by_law)
        self._along.transposeMatMult(self._product, result=self._half)
        self._half.transpose(self._other_half)
        change = self._changes[0]
        change.zeroEntries()
        change.axpy(1.0, self._by_law, structure=SUBSET_PATTERN)
        change.axpy(-1.0, self._half, structure=SUBSET_PATTERN)
        change.axpy(-1.0, self._other_half, structure=SUBSET_PATTERN)
        above = zip(self._changes, self._below, self._products, self._changes[1:], strict=False)
        for change, interpolation, product, below in above:
            change.matMult(interpolation, result=product)
            interpolation.transposeMatMult(product, result=below)
        for level, untruncated, change in zip(self.coarse, self._untruncated, self._changes, strict=True):
            if is_by_blocks(level):
                beside = untruncated.copy()
                beside.axpy(1.0, change, structure=SUBSET_PATTERN)
                change_added(level, beside)
            else:
                untruncated.copy(level, SAME_PATTERN)
                level.axpy(1.0, change, structure=SUBSET_PATTERN)


def _widened(matrix: PETSc.Mat, pattern: PETSc.Mat) -> PETSc.Mat:
    """A coarse matrix, or zero if by blocks, with a little more on its diagonal, and the room of a pattern of zeros."""
    diagonal = matrix.getDiagonal()
    if is_by_blocks(matrix):
        first, last = matrix.getOwnershipRange()
        numbers = np.arange(first, last + 1, dtype=PETSc.IntType)
        csr = numbers - first, numbers[:-1], np.zeros(last - first)
        wider = PETSc.Mat().createAIJ(matrix.getSizes(), csr=csr, comm=matrix.comm)
    else:
        wider = matrix.copy()
    wider.axpy(1.0, pattern, structure=DIFFERENT_PATTERN)
    diagonal.scale(NOTHING_LEFT)
    wider.setDiagonal(diagonal, addv=PETSc.InsertMode.ADD_VALUES)
    return wider
