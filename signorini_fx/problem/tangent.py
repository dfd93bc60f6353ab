"""A + B^T D B: the Jacobian of the regularised problem, put into a copy of A where the blocks D have changed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from itertools import pairwise

import numpy as np
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.contact.laws import Nodal
from signorini_fx.contact.map import ContactMap


class ContactTangent(ABC):
    """What the Jacobians of one problem hold, by their handles.

    Attributes:
        inserted: the blocks D of each.
        factorised: those of its last factorisation.
    """

    def __init__(self, matrix: PETSc.Mat) -> None:
        self._comm = matrix.comm.tompi4py()
        self.inserted: dict[int, Nodal] = {}
        self.factorised: dict[int, Nodal] = {}

    def insert(self, matrix: PETSc.Mat, blocks: Nodal) -> int | None:
        """Put A + B^T D B into a copy of A, if it is not there; collective.

        Args:
            matrix: a matrix with the pattern and, elsewhere, the values of A.
            blocks: D of each point, stress per length, shape (n, d, d).

        Returns:
            How many points differ from the last factorisation, None if there is none; the same on all ranks.
        """
        known = [table.get(matrix.handle) for table in (self.inserted, self.factorised)]
        differ = [
            1 + blocks.size if old is None else np.count_nonzero((old != blocks).any(axis=(1, 2))) for old in known
        ]
        changed, moved = (int(count) for count in parallel.global_sum(self._comm, np.array(differ)))
        since = None if known[1] is None else moved
        if changed > 0:
            self.inserted[matrix.handle] = blocks
            self._put(matrix, blocks)
        return since

    @abstractmethod
    def _put(self, matrix: PETSc.Mat, blocks: Nodal) -> None:
        """Make the matrix A + B^T D B."""


def contact_tangent(matrix: PETSc.Mat, contact: ContactMap) -> ContactTangent:
    """The one that fits the contact map; collective."""
    return (_AveragedTangent if contact.averaging else _NodalTangent)(matrix, contact)


class _NodalTangent(ContactTangent):
    """Points and what they touch are on one rank, within the pattern of A: only these entries are set."""

    def __init__(self, matrix: PETSc.Mat, contact: ContactMap) -> None:
        super().__init__(matrix)
        unknowns, blocks = contact.entries()
        self._blocks = np.where(contact.fixed[unknowns][:, None, :], 0.0, blocks)
        self._weighted = contact.weight[:, None, None] * self._blocks
        # Pairs of unknowns that some point joins: the rows of B^T D B, each with its columns in order.
        first, columns = matrix.getOwnershipRange()[0], contact.fixed.size
        pairs = unknowns[:, :, None] * columns + unknowns[:, None, :]
        keys, place = np.unique(pairs, return_inverse=True)
        self._place = place.ravel()
        row, column = keys // max(columns, 1), keys % max(columns, 1)
        rows, counts = np.unique(row, return_counts=True)
        self._starts = np.concatenate(([0], np.cumsum(counts))).astype(PETSc.IntType)
        self._rows = (first + rows).astype(PETSc.IntType)
        self._columns = (first + column).astype(PETSc.IntType)
        spans = list(pairwise(self._starts))
        elastic = [
            matrix.getValues([number], self._columns[a:b]).ravel()
            for number, (a, b) in zip(self._rows, spans, strict=True)
        ]
        self._elastic = np.concatenate([np.empty(0), *elastic])

    def _put(self, matrix: PETSc.Mat, blocks: Nodal) -> None:
        added = np.einsum("nia,nij,njb->nab", self._weighted, blocks, self._blocks)
        values = self._elastic + np.bincount(self._place, added.ravel(), minlength=self._elastic.size)
        if self._rows.size:
            matrix.setValuesIJV(self._starts, self._columns, values, rowmap=self._rows)
        matrix.assemble()


class _AveragedTangent(ContactTangent):
    """Points touch unknowns of other cells and ranks: the product of the matrices themselves."""

    def __init__(self, matrix: PETSc.Mat, contact: ContactMap) -> None:
        super().__init__(matrix)
        self._elastic = matrix
        self._weight = contact.weight[:, None, None]
        free, _ = contact.operator.createVecs()
        free.getArray()[:] = ~contact.fixed
        self._operator = contact.operator.copy()
        self._operator.diagonalScale(R=free)
        rows = contact.operator.getSizes()[0]
        self._law = PETSc.Mat().createAIJ((rows, rows), nnz=(contact.dimension, 0), comm=matrix.comm)
        first = contact.operator.getOwnershipRange()[0]
        places = first + np.arange(contact.weight.size * contact.dimension)
        self._places = places.reshape(-1, contact.dimension).astype(PETSc.IntType)
        self._product: PETSc.Mat | None = None

    def _put(self, matrix: PETSc.Mat, blocks: Nodal) -> None:
        if self._places.size:
            self._law.setValuesRCV(self._places, self._places, np.ascontiguousarray(self._weight * blocks))
        self._law.assemble()
        self._product = self._law.ptap(self._operator, result=self._product)
        self._elastic.copy(matrix, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        matrix.axpy(1.0, self._product, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
