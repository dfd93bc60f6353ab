"""Coarser meshes of the same body as levels of geometric multigrid: interpolation from one mesh to the next finer one.

The meshes of a nested iteration are there anyway.  They need not be nested themselves: each node of the finer mesh lies
in a cell of the coarser one, or close to it where the boundary is curved, and takes its shape functions there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
import scipy.sparse
from dolfinx import fem
from dolfinx import mesh as dmesh
from petsc4py import PETSc

from signorini_fx import compat, parallel
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.rigid import RigidMotions, rigid_modes
from signorini_fx.tuned import FINER_LEVELS

Array = npt.NDArray[np.float64]
# Nodes of the finer mesh are looked for this share of a coarse cell's size outside the coarser mesh.
_OUTSIDE = 0.25
_NEWTON_STEPS, _ROUND_OFF = 10, 1e-10


@dataclass(eq=False)
class MeshLevel:
    """The displacements of a body on one mesh, and on a coarser one.

    Attributes:
        space: of the displacement.
        fixed: the prescribed unknowns of this rank.
        rotation: from the unknowns to displacements; None: they are the same.
        motions: the rigid motions.
        coarser: the same on the next coarser mesh; None: there is none.
        solved: a displacement to begin with on a finer mesh; None: there is none.
    """

    space: fem.FunctionSpace
    fixed: npt.NDArray[np.bool_]
    rotation: PETSc.Mat | None
    motions: RigidMotions
    coarser: MeshLevel | None
    solved: fem.Function | None = None

    @classmethod
    def of(
        cls, discretisation: Discretisation, coarser: MeshLevel | None = None, solved: fem.Function | None = None
    ) -> MeshLevel:
        """A mesh over coarser ones, of which those are left out that are hardly coarser, or far too coarse."""
        d, (least, most) = discretisation, FINER_LEVELS
        dimension = d.tagged.dimension
        while coarser is not None and d.dofs < least**dimension * coarser.dofs:
            coarser = coarser.coarser
        if coarser is not None and d.dofs > most**dimension * coarser.dofs:
            coarser = None
        return cls(d.space, d.fixed, d.rotation, d.motions, coarser, solved)

    @property
    def dofs(self) -> int:
        """Global number of unknowns."""
        return int(self.space.dofmap.index_map.size_global) * self.block

    @property
    def block(self) -> int:
        """Unknowns per node."""
        return int(self.space.dofmap.index_map_bs)

    @property
    def _owned(self) -> int:
        return int(self.space.dofmap.index_map.size_local)

    def modes(self) -> PETSc.NullSpace:
        """Translations and rotations, orthonormal: what multigrid must not forget on its coarse levels.

        Multigrid coarsens locally, where the motions of a piece are those of the whole body.
        """
        motions, comm = self.motions, self.space.mesh.comm
        modes = rigid_modes(motions.x[: self._owned], motions.centre[0], motions.length[0])
        vectors = [self._vector() for _ in range(modes.shape[2])]
        for k, vector in enumerate(vectors):
            vector.getArray()[:] = modes[:, :, k].ravel()
            if self.rotation is not None:
                self.rotation.multTranspose(vector.copy(), vector)
            vector.getArray()[self.fixed] = 0.0
            for other in vectors[:k]:
                vector.axpy(-vector.dot(other), other)
            vector.normalize()
        return PETSc.NullSpace().create(vectors=vectors, comm=comm)

    def _vector(self) -> PETSc.Vec:
        return PETSc.Vec().createMPI((self._owned * self.block, None), comm=self.space.mesh.comm)

    def _free(self) -> PETSc.Vec:
        """One where an unknown is not prescribed, else zero."""
        vector = self._vector()
        vector.getArray()[:] = ~self.fixed
        return vector

    @cached_property
    def interpolation(self) -> PETSc.Mat | None:
        """From the unknowns on the coarser mesh to those on this one, prescribed ones left out; collective.

        None: there is no coarser mesh, or it does not cover this one.
        """
        if self.coarser is None:
            return None
        shares = self._shares(self.coarser)
        if shares is None:
            return None
        # One share for all components of a node.
        spread = scipy.sparse.kron(shares, scipy.sparse.eye(self.block), format="csr")
        spread.sort_indices()
        rows, columns = self._owned * self.block, self.coarser._owned * self.block
        csr = (spread.indptr.astype(PETSc.IntType), spread.indices.astype(PETSc.IntType), spread.data)
        matrix = PETSc.Mat().createAIJ(((rows, None), (columns, None)), csr=csr, comm=self.space.mesh.comm)
        if self.coarser.rotation is not None:
            matrix = matrix.matMult(self.coarser.rotation)
        if self.rotation is not None:
            matrix = self.rotation.transposeMatMult(matrix)
        matrix.diagonalScale(self._free(), self.coarser._free())
        return matrix

    def start(self) -> PETSc.Vec | None:
        """The displacement of the coarser mesh in the unknowns of this one, prescribed ones zero; collective."""
        coarse, interpolation = self.coarser, self.interpolation
        if coarse is None or coarse.solved is None or interpolation is None:
            return None
        x = coarse._vector()
        x.getArray()[:] = coarse.solved.x.array[: x.getLocalSize()]
        if coarse.rotation is not None:
            coarse.rotation.multTranspose(x.copy(), x)
        found = self._vector()
        interpolation.mult(x, found)
        return found

    def _shares(self, coarse: MeshLevel) -> Any | None:
        """Shares of the coarse nodes (global numbers) in each owned node, scipy sparse; None: some node is nowhere."""
        comm, mesh = self.space.mesh.comm, coarse.space.mesh
        x = self.space.tabulate_dof_coordinates()[: self._owned]
        cells = mesh.topology.index_map(mesh.topology.dim).size_global
        box = parallel.global_bounds(comm, mesh.geometry.x.astype(np.float64))
        size = float(np.prod(np.ptp(box, axis=0)[: mesh.topology.dim]) / cells) ** (1 / mesh.topology.dim)
        owners, askers, points, found = compat.cells_of_points(mesh, x, _OUTSIDE * size)
        if parallel.any_rank(comm, bool((owners < 0).any())):
            return None
        shape = coarse.space.ufl_element().sub_elements[0]
        place = reference_points(mesh, found, points)
        own = shape.tabulate(0, place)[0].reshape(len(found), -1)
        own[np.abs(own) < _ROUND_OFF] = 0.0
        nodes = coarse.space.dofmap.list[found]
        numbers = coarse.space.dofmap.index_map.local_to_global(nodes.ravel().astype(np.int32)).reshape(nodes.shape)
        # The rank that has the cell answers the one that has the node; both keep the order of the nodes.
        answers = np.ascontiguousarray(np.hstack((numbers, own))[np.argsort(askers, kind="stable")])
        width = shape.dim * 2
        received = np.empty((self._owned, width))
        send, receive = (width * np.bincount(ranks, minlength=comm.size) for ranks in (askers, owners))
        comm.Alltoallv([answers, send], [received, receive])
        every = np.empty_like(received)
        every[np.argsort(owners, kind="stable")] = received
        row = np.repeat(np.arange(self._owned), shape.dim)
        columns, values = every[:, : shape.dim].ravel().astype(np.int64), every[:, shape.dim :].ravel()
        used = values != 0
        total = coarse.space.dofmap.index_map.size_global
        return scipy.sparse.csr_matrix((values[used], (row[used], columns[used])), shape=(self._owned, total))


def reference_points(mesh: dmesh.Mesh, cells: npt.NDArray[np.int32], x: Array) -> Array:
    """The points of the reference cell that cells map to points in space, by Newton's method.

    Args:
        mesh: the mesh.
        cells: a cell of this rank for each point, shape (n,).
        x: the points, shape (n, 3).

    Returns:
        Shape (n, d); outside the reference cell for points outside their cells.
    """
    dim = mesh.topology.dim
    element = compat.geometry_element(mesh)
    corners = mesh.geometry.x[compat.geometry_cells(mesh)[cells]][:, :, :dim]
    place = np.tile(basix.geometry(element.cell_type).mean(axis=0), (len(cells), 1))
    for _ in range(_NEWTON_STEPS if len(cells) else 0):
        table = element.tabulate(1, place)[..., 0]
        away = x[:, :dim] - np.einsum("nk,nkc->nc", table[0], corners)
        slope = np.einsum("dnk,nkc->ncd", table[1:], corners)
        step = np.linalg.solve(slope, away[:, :, None])[:, :, 0]
        place += step
        if np.abs(step).max() < _ROUND_OFF:
            break
    return place
