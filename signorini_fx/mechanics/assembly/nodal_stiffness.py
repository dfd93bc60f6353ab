"""Stiffness that is added to that of forms: between the components of single nodes, as from curved
foundations, and between the nodes of two sides that slide on each other.

It also assembles the stiffness of a body in nodal blocks, for ``linalg.blocks``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem, jit, la
from petsc4py import PETSc

from signorini_fx.algebra.linalg.blocks import BlockRows, block_matrix
from signorini_fx.arrays import Array, Flags, Ints, matvec
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners, to_owners


@dataclass(frozen=True)
class JointStiffness:
    """A stiffness between the components of some nodes; the contributions of all ranks are
    added.
    """

    nodes: Ints  # global numbers, shape (m,)
    matrix: sp.csr_array  # force per length, shape (m d, m d)

    @classmethod
    def of_nodes(cls, nodes: Ints, matrix: sp.csr_array, dim: int) -> JointStiffness:
        """Return the stiffness, given with nodes that may be repeated; their rows and columns are
        added.
        """
        each, place = np.unique(nodes, return_inverse=True)
        once = sp.csr_array((np.ones(nodes.size), (place, np.arange(nodes.size))))
        spread = sp.csr_array(sp.kron(once, sp.eye_array(dim), format="csr"))
        return cls(each, sp.csr_array(spread @ matrix @ spread.T))

    def times(self, displacement: Array, space: fem.FunctionSpace) -> Array:
        """Return the forces of the stiffness at the owned nodes, shape (owned nodes * d,);
        collective.
        """
        index_map = space.dofmap.index_map
        dim = space.dofmap.index_map_bs
        owned = displacement.reshape(-1, dim)[: index_map.size_local]
        comm = space.mesh.comm
        forces = self.matrix @ from_owners(owned, self.nodes, comm).ravel()
        return to_owners(forces.reshape(-1, dim), self.nodes, comm, len(owned)).ravel()

    def add_to(self, matrix: PETSc.Mat, dim: int, fixed: Flags | None) -> None:
        """Add the stiffness to a matrix, except at fixed unknowns; the matrix gets new entries as
        needed; collective.

        Args:
            matrix: of a form on the space of the nodes.
            dim: components of each node.
            fixed: which owned dofs are fixed, shape (owned dofs,); None: none.
        """
        comm = matrix.comm.tompi4py()
        unknowns = (dim * self.nodes[:, None] + np.arange(dim)).astype(PETSc.IntType)
        if fixed is not None:
            free = from_owners((~fixed).reshape(-1, dim).astype(np.float64), self.nodes, comm)
            unknowns[free == 0.0] = -1  # PETSc skips entries with negative indices
        unknowns = unknowns.ravel()
        count, total = matrix.getSizes()[0]
        entries = np.diff(self.matrix.indptr).reshape(-1, dim).astype(np.float64)
        room = to_owners(entries, self.nodes, comm, count // dim).ravel().astype(PETSc.IntType)
        nnz = np.minimum(room, count), np.minimum(room, total - count)
        more = PETSc.Mat().createAIJ(matrix.getSizes(), nnz=nnz, comm=comm)
        more.setValuesIJV(
            self.matrix.indptr.astype(PETSc.IntType),
            unknowns[self.matrix.indices],
            self.matrix.data,
            addv=PETSc.InsertMode.ADD_VALUES,
            rowmap=unknowns,
        )
        more.assemble()
        matrix.axpy(1.0, more, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        more.destroy()


@dataclass(frozen=True)
class NodalStiffness:
    """A stiffness block for each of some nodes, with stiffness between nodes if there is any."""

    nodes: Ints  # owned nodes of this rank, local numbers, each once, shape (n,)
    blocks: Array  # force per length, symmetric, shape (n, d, d)
    joint: tuple[JointStiffness, ...] = ()  # added stiffness between nodes

    @classmethod
    def none(cls, dimension: int) -> NodalStiffness:
        """Return a stiffness without any node."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros((0, dimension, dimension)))

    @classmethod
    def summed(
        cls, nodes: npt.NDArray[np.integer], blocks: Array, joint: tuple[JointStiffness, ...] = ()
    ) -> NodalStiffness:
        """Return the stiffness from blocks of contact points; those of the same node are added."""
        each, position = np.unique(nodes, return_inverse=True)
        sums = np.zeros((each.size, *blocks.shape[1:]))
        np.add.at(sums, position, blocks)
        return cls(each.astype(np.int64), sums, joint)

    def times(self, displacement: Array, space: fem.FunctionSpace) -> Array:
        """Return the forces of the stiffness at a displacement, shape (owned dofs,); collective."""
        dim = self.blocks.shape[1]
        owned = space.dofmap.index_map.size_local
        forces = np.zeros((owned, dim))
        forces[self.nodes] = matvec(self.blocks, displacement.reshape(-1, dim)[self.nodes])
        return sum((joint.times(displacement, space) for joint in self.joint), forces.ravel())

    def add_to(self, matrix: PETSc.Mat, fixed: Flags | None = None) -> None:
        """Add the stiffness to the assembled matrix of a form on the same space; collective.

        Args:
            matrix: the assembled matrix.
            fixed: dofs whose rows and columns are skipped, shape (owned dofs,); None: none.
        """
        dim = self.blocks.shape[1]
        blocks = self.blocks
        if fixed is not None:
            free = ~fixed.reshape(-1, dim)[self.nodes]
            blocks = blocks * (free[:, :, None] & free[:, None, :])
        first = matrix.getOwnershipRange()[0]
        rows = (first + self.nodes[:, None] * dim + np.arange(dim)).astype(PETSc.IntType)
        if rows.size:
            ends = np.arange(0, blocks.size + 1, dim, dtype=PETSc.IntType)
            columns = np.repeat(rows, dim, axis=0)
            matrix.setValuesIJV(
                ends,
                columns.ravel(),
                blocks.ravel(),
                addv=PETSc.InsertMode.ADD_VALUES,
                rowmap=rows.ravel(),
            )
        matrix.assemble()
        for joint in self.joint:
            joint.add_to(matrix, dim, fixed)


def block_stiffness(
    forms: Sequence[fem.Form], fixed: Flags, beside: NodalStiffness | None = None
) -> PETSc.Mat:
    """Return the matrix of a sum of bilinear forms of a vector Lagrange space in nodal blocks;
    collective.

    Args:
        forms: the bilinear forms.
        fixed: which dofs of this rank are prescribed, shape (owned dofs,); their rows and columns
            are zero, with the largest diagonal entry on the diagonal.
        beside: nodal stiffness to add; only its blocks are.  None: nothing.
    """
    from signorini_fx.algebra.linalg import kernels

    folder = Path(jit.get_options()["cache_dir"])  # of compiled forms
    kernels.load(forms[0].mesh.comm, folder)
    entries = fem.create_matrix(forms[0], la.BlockMode.compact)
    for form in forms:
        fem.assemble_matrix(entries, form)  # type: ignore[arg-type]
    entries.scatter_reverse()
    size = entries.block_size[0]
    comm = forms[0].mesh.comm
    nodes = entries.index_map(1)
    owned = entries.index_map(0).size_local
    starts = np.asarray(entries.indptr[: owned + 1], dtype=np.int64)
    data = np.asarray(entries.data, dtype=np.float64)
    columns = entries.indices[: starts[-1]]
    blocks = data.reshape(-1, size, size)[: starts[-1]]
    of_row = np.repeat(np.arange(owned, dtype=columns.dtype), np.diff(starts))
    on_diagonal = np.flatnonzero(of_row == columns)
    if beside is not None:
        blocks[on_diagonal[beside.nodes]] += beside.blocks
    extended = la.vector(nodes, size)
    extended.array[: fixed.size] = fixed
    extended.scatter_forward()
    held = extended.array.reshape(-1, size) > 0
    some = np.asarray(held.any(axis=1))
    block = np.flatnonzero(some[of_row] | some[columns])
    blocks[block] = np.where(
        held[of_row[block], :, None] | held[columns[block], None, :], 0.0, blocks[block]
    )
    node, component = np.nonzero(held[:owned])
    largest = parallel.largest(comm, np.diagonal(blocks[on_diagonal], axis1=1, axis2=2)) or 1.0
    blocks[on_diagonal[node], component, component] = largest
    rows = BlockRows(
        starts,
        columns,
        blocks,
        np.diagonal(blocks[on_diagonal], axis1=1, axis2=2).ravel(),
        nodes.local_to_global(np.arange(nodes.size_local + nodes.num_ghosts, dtype=np.int32)),
        kernels.BlockProduct(folder, starts, columns, blocks),
        extended.array,
        extended.scatter_forward if comm.size > 1 else None,
    )
    return block_matrix(rows, comm)
