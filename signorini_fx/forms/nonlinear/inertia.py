"""The inertia of the tangent with contact: whether an equilibrium is stable for displacements that contact admits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx.machine import parallel
from signorini_fx.mechanics.body.nodal_stiffness import JointStiffness, NodalStiffness
from signorini_fx.tuned import HOLDING_STIFFNESS

Array = npt.NDArray[np.float64]


def negative_directions(
    tangent: fem.Form,
    bcs: Sequence[fem.DirichletBC],
    fixed: npt.NDArray[np.bool_],
    curvature: NodalStiffness,
    nodes: npt.NDArray[np.int32],
    held: Array,
    joint: Sequence[JointStiffness] = (),
) -> int:
    """The number of negative eigenvalues of the tangent where contact points stay in contact; collective.

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
    """
    matrix = fem_petsc.assemble_matrix(tangent, list(bcs), 0.0)
    matrix.assemble()
    diagonal = matrix.getDiagonal()
    values = diagonal.getArray()
    largest = parallel.largest(matrix.comm.tompi4py(), np.abs(values)) or 1.0
    curvature.add_to(matrix, fixed)
    # What is prescribed cannot move: only what is left of a direction is held by contact.
    left = held * ~fixed.reshape(-1, held.shape[2])[nodes][:, None, :]
    holding = HOLDING_STIFFNESS * largest * np.einsum("nki,nkj->nij", left, left)
    NodalStiffness.summed(nodes, holding).add_to(matrix)
    for rows in joint:
        rows.scaled(HOLDING_STIFFNESS * largest).add_to(matrix, held.shape[2], fixed)
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
    preconditioner.setUp()
    negative = int(preconditioner.getFactorMatrix().getInertia()[0])
    preconditioner.destroy()
    matrix.destroy()
    return negative
