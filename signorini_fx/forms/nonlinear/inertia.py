"""The inertia of the tangent with contact: whether an equilibrium is stable for displacements that contact admits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness, NodalStiffness
from signorini_fx.mechanics.rigid.rigid_bodies import with_more_unknowns
from signorini_fx.tuned import HOLDING_STIFFNESS, NO_FORCE, ORDER_IN_PLANE, UNSTABLE_DIRECTION

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ToolsAtPoints:
    """Tools whose motions are unknowns, as the contact points see them; m of each, rotations times L.

    Attributes:
        tool: of each contact point, -1: none, shape (n,).
        modes: what its unknowns do at the point, shape (n, d, m).
        blocks: forces of displacements relative to it, and of its rotations, force per length, shape (n, m, m).
        fixed: which unknowns are prescribed, shape (t, m).
        stiffness: of springs to the ground, force per length, shape (t, m).
    """

    tool: npt.NDArray[np.int64]
    modes: Array
    blocks: Array
    fixed: npt.NDArray[np.bool_]
    stiffness: Array

    def added_to(
        self,
        matrix: PETSc.Mat,
        fixed: npt.NDArray[np.bool_],
        nodes: npt.NDArray[np.int32],
        held: Array,
        penalty: float,
    ) -> tuple[PETSc.Mat, npt.NDArray[np.bool_]]:
        """A matrix of the body with what its points hold in it, and the motions of tools as further unknowns, the last
        ones of the last rank; and which unknowns of this rank are prescribed; collective.

        Args:
            matrix: of the body, which has what the points do to each other.
            fixed: see ``negative_directions``.
            nodes: see ``negative_directions``.
            held: see ``negative_directions``.
            penalty: stiffness of what is held.
        """
        dim, first = held.shape[2], matrix.getOwnershipRange()[0]
        last = matrix.comm.rank == matrix.comm.size - 1
        tools = matrix.getSize()[0] + np.arange(self.fixed.size).reshape(self.fixed.shape)
        wider = with_more_unknowns(matrix, self.stiffness.ravel() if last else np.zeros(0))
        touched = self.tool >= 0
        of, at = self.tool[touched], nodes[touched]
        free, loose = ~fixed.reshape(-1, dim)[at], ~self.fixed[of]
        stiffness = self.blocks[touched].copy()
        stiffness[:, :dim, :dim] += penalty * np.einsum("nki,nkj->nij", held[touched], held[touched])
        # Displacements relative to the tool are -R q of its unknowns, its rotations are the last of these.
        moves = np.tile(np.eye(self.fixed.shape[1]), (len(of), 1, 1))
        moves[:, :dim] = -self.modes[touched]
        moves *= loose[:, None, :]
        across = free[:, :, None] * (stiffness[:, :dim] @ moves)
        along = moves.transpose(0, 2, 1) @ stiffness @ moves
        rows, columns = (first + at[:, None] * dim + np.arange(dim)), tools[of]
        wider.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
        for row, column, coupling, block in zip(rows, columns, across, along, strict=True):
            row, column = row.astype(PETSc.IntType), column.astype(PETSc.IntType)
            wider.setValues(row, column, coupling, addv=PETSc.InsertMode.ADD_VALUES)
            wider.setValues(column, row, coupling.T, addv=PETSc.InsertMode.ADD_VALUES)
            wider.setValues(column, column, block, addv=PETSc.InsertMode.ADD_VALUES)
        wider.assemble()
        return wider, np.concatenate((fixed, self.fixed.ravel())) if last else fixed


def negative_directions(
    tangent: fem.Form,
    bcs: Sequence[fem.DirichletBC],
    fixed: npt.NDArray[np.bool_],
    curvature: NodalStiffness,
    nodes: npt.NDArray[np.int32],
    held: Array,
    joint: Sequence[JointStiffness] = (),
    tools: ToolsAtPoints | None = None,
    symmetric: bool = True,
    loose: bool = False,
) -> tuple[int, Array]:
    """The number of negative eigenvalues of the tangent where contact points stay in contact, and if there are any an
    unstable direction, displacements of the owned nodes, shape (owned dofs,); collective.

    Points in contact keep their distance, and those that stick their place.  The symmetric part of the tangent is
    judged, by one LDL^T factorisation with MUMPS.  The verdict does not depend on units: all entries that are no
    stiffness of the body are shares of its largest one.

    Args:
        tangent: a bilinear form, compiled, whose coefficients are those of the equilibrium.
        bcs: the prescribed displacements.
        fixed: which of the owned unknowns they prescribe, shape (owned dofs,).
        curvature: what the foundations add to the tangent, and friction where slips turn.
        nodes: of the contact points, local numbers of owned nodes, shape (n,).
        held: directions that contact holds at each of them, zero where it holds none, shape (n, directions, d).
        joint: what contact holds between nodes, products of the rows of relative displacements that do not change.
        tools: those that forces move, which contact points keep their distance from; None: there are none.
        symmetric: whether the tangent is.
        loose: whether bodies may move without resistance, so that a small stiffness must hold them.
    """
    matrix, owned = fem_petsc.assemble_matrix(tangent, list(bcs), 0.0), fixed.size
    matrix.assemble()
    if not symmetric:
        matrix.axpy(1.0, matrix.transpose(PETSc.Mat()))
        matrix.scale(0.5)
    diagonal = matrix.getDiagonal()
    values = diagonal.getArray()
    largest = parallel.largest(matrix.comm.tompi4py(), np.abs(values)) or 1.0
    curvature.add_to(matrix, fixed)
    if loose:
        matrix.shift(NO_FORCE * largest)
    # What is prescribed cannot move: only what is left of a direction is held by contact.
    left = held * ~fixed.reshape(-1, held.shape[2])[nodes][:, None, :]
    holding = HOLDING_STIFFNESS * largest * np.einsum("nki,nkj->nij", left, left)
    NodalStiffness.summed(nodes, holding).add_to(matrix)
    for rows in joint:
        rows.scaled(HOLDING_STIFFNESS * largest).add_to(matrix, held.shape[2], fixed)
    if tools is not None:
        matrix, fixed = tools.added_to(matrix, fixed, nodes, held, HOLDING_STIFFNESS * largest)
    diagonal = matrix.getDiagonal()
    diagonal.getArray()[fixed] = largest
    matrix.setDiagonal(diagonal)
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    preconditioner = PETSc.PC().create(matrix.comm)
    preconditioner.setOperators(matrix)
    preconditioner.setType("cholesky")
    preconditioner.setFactorSolverType("mumps")
    preconditioner.setFactorSetUpSolverType()
    for option in (13, 24):  # the inertia needs the root on one rank, and null pivots told from others
        preconditioner.getFactorMatrix().setMumpsIcntl(option, 1)
    if tangent.mesh.topology.dim == 2:  # where MUMPS takes as long to find its own order as to factorise
        preconditioner.getFactorMatrix().setMumpsIcntl(*ORDER_IN_PLANE)
    preconditioner.setUp()
    negative = int(preconditioner.getFactorMatrix().getInertia()[0])
    direction = _unstable_direction(matrix, preconditioner)[:owned] if negative else np.zeros(owned)
    preconditioner.destroy()
    matrix.destroy()
    return negative, direction


def _unstable_direction(matrix: PETSc.Mat, factor: PETSc.PC) -> Array:
    """The eigenvector of the negative eigenvalue of a symmetric matrix that is nearest to zero, shape (rows of this
    rank,): that of the lowest one of its inverse, to which Lanczos' method converges first; collective.
    """
    from scipy.sparse.linalg import LinearOperator, eigsh  # imported by what needs it alone

    comm, (x, y), own = matrix.comm.tompi4py(), matrix.createVecs(), slice(*matrix.getOwnershipRange())

    def solved(values: Array) -> Array:
        x.getArray()[:] = values[own]
        factor.apply(x, y)
        return parallel.gather_rows(comm, np.array(y.getArray(readonly=True)))

    inverse, begin = LinearOperator(matrix.getSize(), matvec=solved), np.random.default_rng(0)
    _, vectors = eigsh(inverse, k=1, which="SA", v0=begin.standard_normal(inverse.shape[0]), tol=UNSTABLE_DIRECTION)
    return np.asarray(vectors[own, 0])
