"""A stiffness of compact blocks, one for each pair of nodes, and the tangent A + C with a separate
C, as PETSc matrices.

The entries stay in the arrays into which the body was assembled.  A ``python`` matrix of PETSc
computes products, with a kernel that has a copy with one block for both orders of two nodes.  No
tangent copies A: what contact adds, C = B^T D B, is a separate sparse matrix with few rows that are
not empty.  Where rows or entries are needed, for products of matrices or factors, they are copied
from the blocks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.linalg import (
    DIFFERENT_PATTERN,
    SAME_PATTERN,
    SUBSET_PATTERN,
    is_by_blocks,
    petsc_options,
    row_by_row,
)
from signorini_fx.algebra.linalg.petsc_calls import called_back
from signorini_fx.arrays import Array, Indices, Ints

if TYPE_CHECKING:
    from signorini_fx.algebra.linalg.kernels import BlockProduct


@dataclass(frozen=True)
class BlockRows:
    """The owned rows of a symmetric matrix of blocks.

    Attributes:
        starts: where the rows of blocks begin, shape (n + 1,).
        columns: local numbers of the nodes of the blocks, those of other ranks last, shape (m,).
        blocks: shape (m, d, d).
        diagonal: of the matrix, shape (n d,).
        names: global numbers of the nodes by their local numbers.
        multiply: computes the product with a vector.
        extended: a vector at the nodes of this rank and at those of other ranks that columns need.
        fill: fills the latter entries with the values of the other ranks, collective; None: there
            is one rank.
    """

    starts: Ints
    columns: Indices
    blocks: Array
    diagonal: Array
    names: Ints
    multiply: BlockProduct
    extended: Array
    fill: Callable[[], None] | None

    @property
    def size(self) -> int:
        """The size of the blocks, the spatial dimension d."""
        return int(self.blocks.shape[1])

    def rows_at(self, unknowns: Ints) -> tuple[Ints, Ints, Array]:
        """Return row starts, global columns and entries of the rows of some unknowns, given by
        local numbers.
        """
        node, component = np.divmod(unknowns, self.size)
        counts = np.diff(self.starts)[node]
        ends = np.cumsum(counts)
        block = np.arange(ends[-1] if ends.size else 0) + np.repeat(
            self.starts[node] - ends + counts, counts
        )
        starts = np.concatenate(([0], self.size * ends))
        row = np.repeat(component, counts)
        columns = self.size * self.names[self.columns[block]][:, None] + np.arange(self.size)
        values = self.blocks[block, row]
        return starts.astype(PETSc.IntType), columns.ravel().astype(PETSc.IntType), values.ravel()


class BlockMatrix:
    """Context of a ``python`` matrix: A by blocks, or A + C with a sparse C."""

    def __init__(self, rows: BlockRows, added: PETSc.Mat | None = None) -> None:
        self.rows = rows
        self.added = None if added is None else row_by_row(added)
        # Requested rows of A, with room for C, by the handles of the index sets of rows and of
        # columns, 0: all; the index sets are kept so that their handles stay unique.
        self._parts: dict[tuple[int, int], tuple[PETSc.Mat, PETSc.IS, PETSc.IS]] = {}

    @called_back
    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Compute y = A x + C x."""
        rows = self.rows
        values = x.getArray(readonly=True)
        if rows.fill is not None:
            rows.extended[: values.size] = values
            rows.fill()
            values = rows.extended
        rows.multiply(values, y.getArray())
        if self.added is not None:
            self.added.multAdd(x, y, y)

    def getDiagonal(self, matrix: PETSc.Mat, diagonal: PETSc.Vec) -> None:  # PETSc calls these so
        """Write the diagonal into a vector."""
        diagonal.getArray()[:] = self.rows.diagonal
        if self.added is not None:
            diagonal.axpy(1.0, self.added.getDiagonal())

    def createSubMatrix(
        self, matrix: PETSc.Mat, rows: PETSc.IS, columns: PETSc.IS, into: PETSc.Mat | None = None
    ) -> PETSc.Mat:
        """Return some rows as a sparse matrix, with all columns or some."""
        if self.added is None:
            return self._elastic(matrix, rows, columns)
        added = self.added.createSubMatrix(rows, columns)
        every = columns.getSize() == matrix.getSize()[1]
        key = (rows.handle, 0 if every else columns.handle)
        if key not in self._parts:
            part = self._elastic(matrix, rows, columns)
            pattern = added.copy()
            pattern.zeroEntries()
            part.axpy(1.0, pattern, structure=DIFFERENT_PATTERN)
            self._parts[key] = row_by_row(part), rows, columns
        part = self._parts[key][0]
        if into is None:
            into = part.copy()
        else:
            part.copy(into, SAME_PATTERN)
        into.axpy(1.0, added, structure=SUBSET_PATTERN)
        return into

    def _elastic(self, matrix: PETSc.Mat, rows: PETSc.IS, columns: PETSc.IS) -> PETSc.Mat:
        """Return some rows of A as a sparse matrix; collective."""
        unknowns = rows.getIndices().astype(np.int64) - matrix.getOwnershipRange()[0]
        sizes = ((unknowns.size, None), matrix.getSizes()[1])
        csr = self.rows.rows_at(unknowns)
        found = PETSc.Mat().createAIJ(sizes, csr=csr, comm=matrix.comm)
        if columns.getSize() == matrix.getSize()[1]:
            return found
        begin, end = found.getOwnershipRange()
        return found.createSubMatrix(
            PETSc.IS().createStride(end - begin, begin, 1, comm=matrix.comm), columns
        )

    def norm(self, matrix: PETSc.Mat, kind: int) -> float:
        """Return a norm of the matrix, which is requested after a failed solve."""
        return float(by_entries(matrix).norm(kind))


def block_matrix(rows: BlockRows, comm: MPI.Comm, added: PETSc.Mat | None = None) -> PETSc.Mat:
    """Return the symmetric positive definite matrix of the rows of all ranks; collective.

    Args:
        rows: the rows of this rank.
        comm: the ranks.
        added: C, with all the entries it may have, which becomes part of the matrix; None: there is
            none.
    """
    size = ((rows.starts.size - 1) * rows.size, None)
    matrix = PETSc.Mat().create(comm)
    matrix.setSizes((size, size))
    matrix.setBlockSize(rows.size)  # before it is set up
    matrix.setType(PETSc.Mat.Type.PYTHON)
    matrix.setPythonContext(BlockMatrix(rows, added))
    matrix.setUp()
    matrix.assemble()
    return matrix


def with_added(stiffness: PETSc.Mat, added: PETSc.Mat) -> PETSc.Mat:
    """Return A + C for A by blocks, see ``block_matrix``; collective."""
    return block_matrix(stiffness.getPythonContext().rows, stiffness.comm, added)


def change_added(tangent: PETSc.Mat, added: PETSc.Mat) -> None:
    """Replace C in A + C by another one with the same pattern; collective."""
    added.copy(tangent.getPythonContext().added, SAME_PATTERN)
    tangent.stateIncrease()  # otherwise PETSc would keep the factor of the earlier one


def by_entries(matrix: PETSc.Mat) -> PETSc.Mat:
    """Return a matrix by blocks copied to a sparse matrix; any other matrix is returned itself.
    Collective.
    """
    if not is_by_blocks(matrix):
        return matrix
    context = matrix.getPythonContext()
    rows = context.rows
    added = context.added
    csr = (
        rows.starts.astype(PETSc.IntType),
        rows.names[rows.columns].astype(PETSc.IntType),
        rows.blocks,
    )
    copied = PETSc.Mat().createBAIJ(matrix.getSizes(), rows.size, csr=csr, comm=matrix.comm)
    entries = copied.convert(PETSc.Mat.Type.AIJ)
    if added is not None:
        entries.axpy(1.0, added, structure=DIFFERENT_PATTERN)
    return row_by_row(entries)


class PreconditionerByEntries:
    """Context of a ``python`` preconditioner that uses another preconditioner for the entries of a
    matrix by blocks.

    Args:
        configure: sets the type of the inner preconditioner, which has its matrix already.
    """

    def __init__(self, configure: Callable[[PETSc.PC], None]) -> None:
        self._configure = configure
        self._inner: PETSc.PC | None = None

    @called_back
    def setUp(self, pc: PETSc.PC) -> None:
        """Set up the inner preconditioner for the present matrix; collective."""
        inner = PETSc.PC().create(pc.comm)
        inner.setOptionsPrefix(petsc_options.PREFIX)
        inner.setOperators(by_entries(pc.getOperators()[0]))
        self._configure(inner)
        inner.setUp()
        pc.setFailedReason(
            inner.getFailedReason()
        )  # by which a singular matrix is told from a lack of memory
        self._inner = inner

    @called_back
    def apply(self, pc: PETSc.PC, right: PETSc.Vec, x: PETSc.Vec) -> None:
        """Apply the inner preconditioner."""
        assert self._inner is not None
        self._inner.apply(right, x)


def use_entries(pc: PETSc.PC, configure: Callable[[PETSc.PC], None]) -> None:
    """Make a preconditioner of a matrix by blocks work on its entries, see
    ``PreconditionerByEntries``.
    """
    pc.setType(PETSc.PC.Type.PYTHON)
    pc.setPythonContext(PreconditionerByEntries(configure))
