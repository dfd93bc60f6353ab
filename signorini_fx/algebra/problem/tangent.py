"""A + B^T D B: the Jacobian of the regularised problem, put into a copy of A, or beside blocks, where D changes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.linalg.blocks import change_added, is_by_blocks, with_added
from signorini_fx.machine import parallel


class ContactTangent:
    """The Jacobians of one problem, by their handles: ``inserted`` blocks D, and those of the last factorisation. Of A,
    by blocks or with a pattern that has that of B^T D B (``ContactMap.admitted``), only the entries that contact adds
    to are set.
    """

    def __init__(self, matrix: PETSc.Mat, contact: ContactMap) -> None:
        self._comm = contact.points.comm
        self._weight = contact.points.weight[:, None, None]
        self.inserted: dict[int, Nodal] = {}
        self.factorised: dict[int, Nodal] = {}
        free = contact.operator.createVecRight()
        free.getArray()[:] = ~contact.fixed
        self._operator = contact.operator.copy()
        self._operator.diagonalScale(R=free)
        self._law = contact.law
        self._blocks = contact.law(np.ones(contact.points.movable.shape))
        # By two products: where rigid bodies move, B has dense columns, with which ``ptap`` takes quadratic time.
        self._half = self._blocks.matMult(self._operator)
        self._product = self._operator.transposeMatMult(self._half)
        starts, self._columns, _ = self._product.getValuesCSR()
        touched = np.flatnonzero(np.diff(starts))
        self._matrix = matrix
        self._rows = (matrix.getOwnershipRange()[0] + touched).astype(PETSc.IntType)
        self._starts = np.append(starts[touched], starts[-1]).astype(PETSc.IntType)
        if is_by_blocks(matrix):
            return
        if matrix.getType() == PETSc.Mat.Type.SEQDENSE:
            row = np.repeat(touched, np.diff(self._starts))
            self._elastic = np.asarray(matrix.getDenseArray(readonly=True)[row, self._columns])
            return
        elastic = [
            matrix.getValues([row], self._columns[a:b]).ravel()
            for row, (a, b) in zip(self._rows, pairwise(self._starts), strict=True)
        ]
        self._elastic = np.concatenate([np.empty(0), *elastic])

    def create(self) -> PETSc.Mat:
        """A matrix to insert blocks into, so far A; collective."""
        if not is_by_blocks(self._matrix):
            return self._matrix.duplicate(copy=True)
        added = self._product.copy()
        added.zeroEntries()
        return with_added(self._matrix, added)

    def insert(self, matrix: PETSc.Mat, blocks: Nodal) -> bool:
        """Put A + B^T D B into a matrix that ``create`` made, or a copy of A, if it is not there; D: stress per length,
        shape (n, d, d); whether it is that of the last factorisation; collective.
        """
        earlier_blocks = [table.get(matrix.handle) for table in (self.inserted, self.factorised)]
        differ = [old is None or bool((old != blocks).any()) for old in earlier_blocks]
        changed, since = [int(count) for count in parallel.global_sum(self._comm, np.array(differ, dtype=np.int64))]
        if changed > 0:
            self.inserted[matrix.handle] = blocks
            self._law(self._weight * blocks, self._blocks).matMult(self._operator, result=self._half)
            self._operator.transposeMatMult(self._half, result=self._product)
            if is_by_blocks(matrix):
                change_added(matrix, self._product)
                return since == 0
            _, _, added = self._product.getValuesCSR()
            if self._rows.size:
                matrix.setValuesIJV(self._starts, self._columns, self._elastic + added, rowmap=self._rows)
            matrix.assemble()
        return since == 0
