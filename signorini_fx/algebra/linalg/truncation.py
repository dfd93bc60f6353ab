"""The levels of a hierarchy truncated where contact holds the body: the matrices A_1', A_2', ... of
``multigrid``.

With E the projections onto the directions that contact holds, a block for each point, and C' the
soft rest of its stiffness, X = S E G.  On a rigid foundation points are nodes, S = 1 and G = P_c.
For two bodies S goes from relative displacements at the points back to the unknowns of the side
with the points, B S = 1, and G = B P_c: then contact does no work on P - X as far as it is stiff,
while truncation of both sides would clamp the interface in 3D.  As C' is zero where E is not,

    A_1' = A_1 + G^T (E K E + C') G - G^T E V - V^T E G,   K = S^T A_cc S,   V = S^T (A P)_c.

From one tangent to the next only the blocks change that contact matrices have at the nodes. So the
pattern of each product is found once, which takes five to ten times as long as its numbers.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.linalg import (
    DIFFERENT_PATTERN,
    SAME_PATTERN,
    SUBSET_PATTERN,
    is_by_blocks,
    row_by_row,
)
from signorini_fx.algebra.linalg.blocks import with_added
from signorini_fx.arrays import Array, Flags, Ints, quotient
from signorini_fx.tuned import NOTHING_LEFT


def stiff_and_soft(added: Array, scale: Array) -> tuple[Array, Array]:
    """Return projections E onto the directions that contact holds, and the rest of its stiffness,
    blocks of shape (n, d, d).

    Args:
        added: stiffness of contact relative to ``scale``, shape (n, d, d).
        scale: force per length, shape (n,).
    """
    # The blocks of the monolithic method are not symmetric: the held directions are those that they
    # do not map to nearly zero.
    _, stiffness, directions = np.linalg.svd(added)
    stiff = directions * (stiffness >= 1.0)[:, :, None]
    held = stiff.transpose(0, 2, 1) @ stiff
    free = np.eye(held.shape[1]) - held
    soft = free @ (added + added.transpose(0, 2, 1)) @ free * (scale / 2)[:, None, None]
    return held, soft


class NodalBlocks:
    """The diagonal blocks that contact matrices have at the nodes of this rank.

    Only some of the ``size`` unknowns of a node may be contact unknowns; blocks have shape (nodes,
    size, size), with zeros for the others.

    Attributes:
        shape: of the blocks.
        starts: row starts of a sparse matrix with these blocks.
        columns: its columns, as positions in ``unknowns``.
        scale: mean stiffness of each node, force per length.

    Args:
        elastic: A_cc, the elastic matrix of the contact unknowns.
        unknowns: the contact unknowns in the local part of x, ascending.
        size: unknowns of a node.
    """

    def __init__(self, elastic: PETSc.Mat, unknowns: Ints, size: int) -> None:
        self._comm = elastic.comm
        self._sizes = elastic.getSizes()
        self._first = elastic.getOwnershipRange()[0]
        nodes, node = np.unique(unknowns // size, return_inverse=True)
        self.shape: tuple[int, ...] = (nodes.size, size, size)
        self._node = node.ravel()
        self._component = unknowns % size
        counts = np.bincount(self._node, minlength=nodes.size)[self._node]
        self.starts = np.concatenate(([0], np.cumsum(counts)))
        begins = np.searchsorted(self._node, self._node)
        self._rows = np.repeat(np.arange(unknowns.size), counts)
        self.columns = np.repeat(begins - self.starts[:-1], counts) + np.arange(self._rows.size)
        self._elastic = self._blocks(elastic)
        trace = np.trace(self._elastic, axis1=1, axis2=2)
        self.scale = quotient(trace, self._components().sum(axis=1), trace > 0, otherwise=1.0)

    def _components(self) -> Flags:
        present = np.zeros(self.shape[:2], dtype=bool)
        present[self._node, self._component] = True
        return present

    def values(self, blocks: Array) -> Array:
        """Return the entries of blocks in the order of ``columns``."""
        node = self._node[self._rows]
        row = self._component[self._rows]
        column = self._component[self.columns]
        return blocks[node, row, column]

    def matrix(self, blocks: Array, into: PETSc.Mat | None = None) -> PETSc.Mat:
        """Return the sparse matrix with these blocks; collective.

        Args:
            blocks: shape (nodes, size, size).
            into: an earlier matrix to fill again; None: a new one is made.
        """
        empty_rows = self._sizes[0][0] - self._node.size
        csr = (
            np.pad(self.starts, (0, empty_rows), "edge").astype(PETSc.IntType),
            (self._first + self.columns).astype(PETSc.IntType),
            self.values(blocks),
        )
        if into is None:
            return PETSc.Mat().createAIJ(self._sizes, csr=csr, comm=self._comm)
        into.setValuesCSR(*csr)
        into.assemble()
        return into

    def _blocks(self, matrix: PETSc.Mat) -> Array:
        """Return the nodal blocks of a matrix with the unknowns of A_cc."""
        starts, columns, values = matrix.getValuesCSR()
        row = np.repeat(np.arange(self._node.size), np.diff(starts[: self._node.size + 1]))
        column = columns[: row.size] - self._first
        values = values[: row.size]
        local = (column >= 0) & (column < self._node.size)
        row = row[local]
        column = column[local]
        values = values[local]
        on_block = self._node[row] == self._node[column]
        row = row[on_block]
        column = column[on_block]
        blocks = np.zeros(self.shape)
        blocks[self._node[row], self._component[row], self._component[column]] = values[on_block]
        return blocks

    def split(self, contact: PETSc.Mat, rows: PETSc.Mat | None = None) -> tuple[Array, Array]:
        """Return what contact adds to A at each node: projections E onto the directions that it
        holds, and the rest of its stiffness, shape (n, d, d) each.

        Args:
            contact: (A + C)_cc, where the row and column of a constraint are empty except for the
                diagonal.
            rows: the rows of A + C at the contact unknowns; None: there are no constraints.
        """
        added = (self._blocks(contact) - self._elastic) / self.scale[:, None, None]
        if rows is None:
            return stiff_and_soft(added, self.scale)
        starts, _, values = rows.getValuesCSR()
        starts = starts[: self._node.size + 1]
        values = values[: starts[-1]]
        constrained = np.zeros(self.shape[:2], dtype=bool)
        entries = (
            np.add.reduceat(np.append(values != 0, False), starts[:-1])
            if self._node.size
            else np.zeros(0)
        )
        constrained[self._node, self._component] = entries <= 1
        added[constrained[:, :, None] | constrained[:, None, :]] = 0.0
        node, component = np.nonzero(constrained)
        added[node, component, component] = 1.0 / np.finfo(float).eps
        return stiff_and_soft(added, self.scale)

    def inverse(self, held: Array) -> Array:
        """Return the inverse of the diagonal of A on the directions that are not held.

        Including the soft part of contact would save no iterations.
        """
        size = self.shape[1]
        present = self._components()
        diagonal = np.diagonal(self._elastic, axis1=1, axis2=2)
        diagonal = np.where(present, diagonal, self.scale[:, None])
        free = np.eye(size) - held
        block = free @ (diagonal[:, :, None] * free)
        scale = self.scale[:, None, None]
        return np.linalg.inv(block + scale * held) - held / scale


class TruncatedLevels:
    """The truncated interpolation (I - E) P_0 and the coarse matrices A_1', A_2', ..., which change
    in place.

    Attributes:
        interpolation: (I - E) P_0.
        coarse: A_1', A_2', ....

    Args:
        blocks: the nodal blocks of contact.
        lift: S; None: the unit matrix.
        functions: G.
        elastic: A_cc.
        product: (A P)_c.
        interpolations: P_0, P_1, ... of the hierarchy.
        coarse: A_1, A_2, ... of the hierarchy.
        places: c, numbers of the contact unknowns of this rank.
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
        self._blocks = blocks
        self._lift = lift
        self._functions = functions
        self._below = interpolations[1:]
        self._places = places
        zero_blocks = np.zeros(blocks.shape)
        self._held = blocks.matrix(zero_blocks)
        self._soft = blocks.matrix(zero_blocks)
        self._stiffness = elastic.copy() if lift is None else elastic.ptap(lift)
        self._stiffness.axpy(1.0, self._soft, structure=DIFFERENT_PATTERN)
        self._product = product if lift is None else lift.transposeMatMult(product)
        # All products are computed once with no direction held, for their patterns.
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
        self._changes = [change]
        self._products = list[PETSc.Mat]()
        for interpolation in self._below:
            self._products.append(self._changes[-1].matMult(interpolation))
            self._changes.append(interpolation.transposeMatMult(self._products[-1]))
        # For a level by blocks only the matrix that is added to it changes.
        self._untruncated = list[PETSc.Mat]()
        self._truncated = list[PETSc.Mat]()
        self.coarse = list[PETSc.Mat]()
        for level, change in zip(coarse, self._changes, strict=True):
            # A small multiple of the diagonal is added, and room is made for the change.
            diagonal = level.getDiagonal()
            by_blocks = is_by_blocks(level)
            wider = (
                PETSc.Mat().createAIJ(level.getSizes(), nnz=1, comm=level.comm)
                if by_blocks
                else level.copy()
            )
            diagonal.scale(NOTHING_LEFT)
            wider.setDiagonal(diagonal, addv=PETSc.InsertMode.ADD_VALUES)
            wider.axpy(1.0, change, structure=DIFFERENT_PATTERN)
            self._untruncated.append(wider)
            self._truncated.append(row_by_row(wider.copy()))
            self.coarse.append(
                with_added(level, self._truncated[-1]) if by_blocks else self._truncated[-1]
            )
        for level in self.coarse:
            level.setOption(PETSc.Mat.Option.SPD, True)

    def _in_all_rows(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Return a matrix with rows at the contact unknowns as a matrix with rows at all unknowns;
        collective.
        """
        first, last = self.interpolation.getOwnershipRange()
        starts, columns, values = matrix.getValuesCSR()
        counts = np.zeros(last - first, dtype=PETSc.IntType)
        counts[self._places.getIndices() - first] = np.diff(starts)
        csr = (np.concatenate(([0], np.cumsum(counts))).astype(PETSc.IntType), columns, values)
        return PETSc.Mat().createAIJ(self.interpolation.getSizes(), csr=csr, comm=matrix.comm)

    def truncate(self, held: Array, soft: Array) -> None:
        """Truncate the levels again for E, ``held``, and C', ``soft``, force per length;
        collective.
        """
        self._blocks.matrix(held, self._held)
        self._blocks.matrix(soft, self._soft)
        self._held.matMult(self._functions, result=self._along)
        if self._lift is not None:
            self._lift.matMult(self._along, result=self._moved)
        self._contact_rows.copy(self._kept_rows, SAME_PATTERN)
        self._kept_rows.axpy(-1.0, self._moved, structure=SUBSET_PATTERN)
        starts, columns, values = self._kept_rows.getValuesCSR()
        if len(starts) > 1:
            self.interpolation.setValuesIJV(
                starts, columns, values, rowmap=self._places.getIndices()
            )
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
        levels = zip(self.coarse, self._truncated, self._untruncated, self._changes, strict=True)
        for level, truncated, untruncated, change in levels:
            untruncated.copy(truncated, SAME_PATTERN)
            truncated.axpy(1.0, change, structure=SUBSET_PATTERN)
            level.stateIncrease()
