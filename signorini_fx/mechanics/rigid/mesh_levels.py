"""Coarser meshes of the same body as levels of geometric multigrid: interpolation from one mesh to
the next finer one.

A nested iteration has these meshes already.  They need not be nested themselves: each node of the
finer mesh lies in a cell of the coarser one, or close to it where the boundary is curved, and is
interpolated by the shape functions of that cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse
from dolfinx import fem
from petsc4py import PETSc

from signorini_fx.algebra.linalg import row_by_row
from signorini_fx.arrays import Array, Flags, Indices
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.rigid.rigid_motions import RigidMotions, rigid_modes
from signorini_fx.tuned import NOTHING_LEFT, OUTSIDE_COARSER_MESH


@dataclass(eq=False)
class MeshLevel:
    """The displacements of a body on one mesh, linked to the next coarser mesh.

    Attributes:
        space: the space of displacements.
        fixed: flags of the prescribed unknowns of this rank.
        rotation: map from the unknowns to displacements; None: they are the same.
        motions: the rigid motions.
        coarser: the level of the next coarser mesh; None: there is none.
        stiffness: the matrix of these unknowns; None: the system has other unknowns as well.
        solved: the solution on this mesh, from which a finer mesh starts; None: it starts from
            zero.
    """

    space: fem.FunctionSpace
    fixed: Flags
    rotation: PETSc.Mat | None
    motions: RigidMotions
    coarser: MeshLevel | None
    stiffness: PETSc.Mat | None = None
    solved: fem.Function | None = None

    @property
    def dofs(self) -> int:
        """Global number of unknowns."""
        return int(self.space.dofmap.index_map.size_global) * self.block

    @property
    def block(self) -> int:
        """Unknowns per node."""
        return int(self.space.dofmap.index_map_bs)

    @property
    def positions(self) -> Array:
        """The positions of the unknowns of this rank, length, shape (n, 3)."""
        return np.repeat(self.motions.x[: self.owned], self.block, axis=0)

    @property
    def owned(self) -> int:
        """Number of nodes that this rank owns."""
        return int(self.space.dofmap.index_map.size_local)

    def modes(self) -> PETSc.NullSpace:
        """Return translations and rotations, orthonormalised, as the near-null space of multigrid.

        Multigrid coarsens locally, where the motions of a piece are those of the whole body.
        """
        motions = self.motions
        modes = rigid_modes(motions.x[: self.owned], motions.centre[0], motions.length[0])
        vectors = [self.vector() for _ in range(modes.shape[2])]
        for k, vector in enumerate(vectors):
            vector.getArray()[:] = modes[:, :, k].ravel()
            if self.rotation is not None:
                self.rotation.multTranspose(vector.copy(), vector)
            vector.getArray()[self.fixed] = 0.0
            for earlier in vectors[:k]:
                vector.axpy(-vector.dot(earlier), earlier)
            vector.normalize()
        return PETSc.NullSpace().create(vectors=vectors, comm=self.space.mesh.comm)

    def vector(self) -> PETSc.Vec:
        """Return a zero vector of displacements; collective."""
        return PETSc.Vec().createMPI((self.owned * self.block, None), comm=self.space.mesh.comm)

    def free_components(self) -> PETSc.Vec:
        """Return a vector with one for each free unknown and zero for each prescribed one."""
        vector = self.vector()
        vector.getArray()[:] = ~self.fixed
        return vector

    @cached_property
    def interpolation(self) -> PETSc.Mat | None:
        """The matrix from the unknowns of the coarser mesh to those of this one, zero for
        prescribed ones; collective.

        None: there is no coarser mesh, or it does not cover this one.
        """
        if self.coarser is None or (shares := self._shares(self.coarser)) is None:
            return None
        # One share for all components of a node.
        spread = scipy.sparse.kron(shares, scipy.sparse.eye(self.block), format="csr")
        spread.sort_indices()
        sizes = (self.owned * self.block, None), (self.coarser.owned * self.block, None)
        csr = (
            spread.indptr.astype(PETSc.IntType),
            spread.indices.astype(PETSc.IntType),
            spread.data,
        )
        matrix = PETSc.Mat().createAIJ(sizes, csr=csr, comm=self.space.mesh.comm)
        if self.coarser.rotation is not None:
            matrix = matrix.matMult(self.coarser.rotation)
        if self.rotation is not None:
            matrix = self.rotation.transposeMatMult(matrix)
        matrix.diagonalScale(self.free_components(), self.coarser.free_components())
        return row_by_row(matrix)

    def start(self) -> PETSc.Vec | None:
        """Return the solution on the coarser mesh interpolated to the unknowns of this one,
        prescribed ones zero; collective.

        Returns None if there is no coarser solution or interpolation.
        """
        coarse = self.coarser
        interpolation = self.interpolation
        if coarse is None or coarse.solved is None or interpolation is None:
            return None
        x = coarse.vector()
        start = self.vector()
        x.getArray()[:] = coarse.solved.x.array[: x.getLocalSize()]
        if coarse.rotation is not None:
            coarse.rotation.multTranspose(x.copy(), x)
        interpolation.mult(x, start)
        return start

    def _shares(self, coarse: MeshLevel) -> scipy.sparse.csr_matrix | None:
        """Return the shares of the coarse nodes (global numbers) in each owned node; None if a node
        lies outside the coarser mesh.
        """
        from signorini_fx.mechanics.mesh.points import at_points

        shape = coarse.space.ufl_element().sub_elements[0]
        dofmap = coarse.space.dofmap
        pieces = None
        # Bodies in contact touch or overlap: a node belongs to its own one.  Pieces are in the
        # order of their places.
        if coarse.motions.pieces.count == self.motions.pieces.count > 1:
            pieces = self.motions.piece[: self.owned], coarse.motions.pieces.of_cell

        def at(cells: Indices, points: Array) -> Array:
            """Return the nodes of cells, and their shares in points there."""
            nodes = dofmap.index_map.local_to_global(dofmap.list[cells].ravel()).reshape(
                len(cells), -1
            )
            shares = shape.tabulate(0, points)[0].reshape(len(points), -1)
            return np.hstack((nodes, np.where(np.abs(shares) < NOTHING_LEFT, 0.0, shares)))

        x = node_positions(self.space)[: self.owned]
        if (located := at_points(coarse.space.mesh, x, OUTSIDE_COARSER_MESH, at, pieces)) is None:
            return None
        columns, values = np.split(located.reshape(self.owned, 2 * shape.dim), 2, axis=1)
        row, used = np.nonzero(values)
        entries = values[row, used], (row, columns[row, used].astype(np.int64))
        return scipy.sparse.csr_matrix(entries, shape=(self.owned, dofmap.index_map.size_global))
