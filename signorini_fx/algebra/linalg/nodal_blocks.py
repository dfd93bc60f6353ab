"""The blocks that contact matrices have at the nodes, and what contact holds at each of them; for ``multigrid``."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

Array = npt.NDArray[np.float64]


def stiff_and_soft(added: Array, scale: Array) -> tuple[Array, Array]:
    """Projections E onto the directions that contact holds, and the rest of what it adds to the stiffness, blocks of
    shape (n, d, d); ``added``: relative to ``scale``, force per length, shape (n,).
    """
    # The blocks of the monolithic method are not symmetric: what they hold is what they do not map to nearly zero.
    _, stiffness, directions = np.linalg.svd(added)
    stiff = directions * (stiffness >= 1.0)[:, :, None]
    held = stiff.transpose(0, 2, 1) @ stiff
    free = np.eye(held.shape[1]) - held
    soft = free @ (added + added.transpose(0, 2, 1)) @ free * (scale / 2)[:, None, None]
    return held, soft


class NodalBlocks:
    """The blocks that contact matrices have at the nodes of this rank, which have those of their ``size`` unknowns that
    are contact unknowns, ``unknowns`` in the local part of x, ascending; blocks are of shape (nodes, size, size), with
    zeros for the others. ``starts``, ``columns``: the rows of a matrix with these blocks, columns by their place in
    ``unknowns``; ``scale``: mean stiffness of each node, force per length.
    """

    def __init__(self, elastic: PETSc.Mat, unknowns: npt.NDArray[np.int64], size: int) -> None:
        self._comm, self._sizes = elastic.comm, elastic.getSizes()
        self._first = elastic.getOwnershipRange()[0]
        nodes, node = np.unique(unknowns // size, return_inverse=True)
        self.shape: tuple[int, ...] = (nodes.size, size, size)
        self._node, self._component = node.ravel(), unknowns % size
        counts = np.bincount(self._node, minlength=nodes.size)[self._node]
        self.starts = np.concatenate(([0], np.cumsum(counts)))
        begins = np.searchsorted(self._node, self._node)
        self._rows = np.repeat(np.arange(unknowns.size), counts)
        self.columns = np.repeat(begins - self.starts[:-1], counts) + np.arange(self._rows.size)
        self._elastic = self._blocks(elastic)
        trace = np.trace(self._elastic, axis1=1, axis2=2)
        self.scale = np.divide(trace, self._components().sum(axis=1), out=np.ones_like(trace), where=trace > 0)

    def _components(self) -> npt.NDArray[np.bool_]:
        present = np.zeros(self.shape[:2], dtype=bool)
        present[self._node, self._component] = True
        return present

    def values(self, blocks: Array) -> Array:
        """The entries of blocks in the order of ``columns``."""
        node, row, column = self._node[self._rows], self._component[self._rows], self._component[self.columns]
        return np.asarray(blocks[node, row, column])

    def matrix(self, blocks: Array, into: PETSc.Mat | None = None) -> PETSc.Mat:
        """The matrix with these blocks; ``into``: an earlier one, which is filled again; collective."""
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
        """Those of a matrix like A_cc."""
        starts, columns, values = matrix.getValuesCSR()
        row = np.repeat(np.arange(self._node.size), np.diff(starts[: self._node.size + 1]))
        column, values = columns[: row.size] - self._first, values[: row.size]
        local = (column >= 0) & (column < self._node.size)
        row, column, values = row[local], column[local], values[local]
        on_block = self._node[row] == self._node[column]
        row, column = row[on_block], column[on_block]
        blocks = np.zeros(self.shape)
        blocks[self._node[row], self._component[row], self._component[column]] = values[on_block]
        return blocks

    def split(self, contact: PETSc.Mat, rows: PETSc.Mat | None = None) -> tuple[Array, Array]:
        """What contact adds to A at each node: projections E onto the directions that it holds, and the rest of it;
        ``contact``: (A + C)_cc, where the row and column of a constraint are empty but for the diagonal; ``rows``: of A
        + C at the contact unknowns, None: there are no constraints.
        """
        added = (self._blocks(contact) - self._elastic) / self.scale[:, None, None]
        if rows is None:
            return stiff_and_soft(added, self.scale)
        starts, _, values = rows.getValuesCSR()
        starts, values = starts[: self._node.size + 1], values[: starts[self._node.size]]
        constrained = np.zeros(self.shape[:2], dtype=bool)
        entries = np.add.reduceat(np.append(values != 0, False), starts[:-1]) if self._node.size else np.zeros(0)
        constrained[self._node, self._component] = entries <= 1
        added[constrained[:, :, None] | constrained[:, None, :]] = 0.0
        node, component = np.nonzero(constrained)
        added[node, component, component] = 1.0 / np.finfo(float).eps
        return stiff_and_soft(added, self.scale)

    def inverse(self, held: Array) -> Array:
        """Of the diagonal of A, on the directions that are not held; what contact adds softly takes no fewer steps."""
        size = self.shape[1]
        present = self._components()
        diagonal = np.diagonal(self._elastic, axis1=1, axis2=2)
        diagonal = np.where(present, diagonal, self.scale[:, None])
        free = np.eye(size) - held
        block = free @ (diagonal[:, :, None] * free)
        scale = self.scale[:, None, None]
        return np.asarray(np.linalg.inv(block + scale * held) - held / scale)
