"""Stiffness between the components of single nodes, beside that of forms, such as curved foundations add."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from petsc4py import PETSc

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class NodalStiffness:
    """A block for each of some nodes.

    Attributes:
        nodes: owned nodes of this rank, local numbers, each once, shape (n,).
        blocks: force per length, symmetric, shape (n, d, d).
    """

    nodes: npt.NDArray[np.int64]
    blocks: Array

    @classmethod
    def none(cls, dimension: int) -> NodalStiffness:
        """At no node."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros((0, dimension, dimension)))

    @classmethod
    def summed(cls, nodes: npt.NDArray[np.integer], blocks: Array) -> NodalStiffness:
        """Blocks of contact points, of which a node may have several."""
        each, position = np.unique(nodes, return_inverse=True)
        sums = np.zeros((each.size, *blocks.shape[1:]))
        np.add.at(sums, position, blocks)
        return cls(each.astype(np.int64), sums)

    def times(self, displacement: fem.Function) -> Array:
        """The forces of a displacement at the unknowns of this rank, shape (owned dofs,)."""
        space = displacement.function_space
        dim, owned = self.blocks.shape[1], space.dofmap.index_map.size_local
        forces = np.zeros((owned, dim))
        forces[self.nodes] = np.einsum("nij,nj->ni", self.blocks, displacement.x.array.reshape(-1, dim)[self.nodes])
        return forces.ravel()

    def add_to(self, matrix: PETSc.Mat, fixed: npt.NDArray[np.bool_] | None = None) -> None:
        """Add it to a matrix with a row for each unknown, which is assembled; collective.

        Args:
            matrix: of a form on the same space.
            fixed: whose rows and columns are left out, shape (owned dofs,); None: none are.
        """
        dim, blocks = self.blocks.shape[1], self.blocks
        if fixed is not None:
            free = ~fixed.reshape(-1, dim)[self.nodes]
            blocks = blocks * (free[:, :, None] & free[:, None, :])
        first = matrix.getOwnershipRange()[0]
        rows = (first + self.nodes[:, None] * dim + np.arange(dim)).astype(PETSc.IntType)
        for numbers, block in zip(rows, blocks, strict=True):
            matrix.setValues(numbers, numbers, block, addv=PETSc.InsertMode.ADD_VALUES)
        matrix.assemble()
