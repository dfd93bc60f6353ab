"""The inertia of the tangent with contact: whether an equilibrium is stable for displacements that contact admits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx.tuned import HOLDING_STIFFNESS


def negative_directions(
    tangent: fem.Form,
    bcs: Sequence[fem.DirichletBC],
    nodes: npt.NDArray[np.int32],
    held: npt.NDArray[np.float64],
) -> int:
    """The number of negative eigenvalues of the tangent where contact points stay in contact; collective.

    Points in contact keep their distance, and those that stick their place.  The symmetric part of the tangent is
    judged, by one LDL^T factorisation with MUMPS.

    Args:
        tangent: a bilinear form, compiled, whose coefficients are those of the equilibrium.
        bcs: the prescribed displacements.
        nodes: of the contact points, local numbers of owned nodes, shape (n,).
        held: sum of the dyads of the directions that contact holds at each of them, shape (n, d, d).
    """
    matrix = fem_petsc.assemble_matrix(tangent, bcs=list(bcs))
    matrix.assemble()
    largest = float(matrix.getDiagonal().max()[1])
    dimension = held.shape[1]
    numbering = tangent.function_spaces[0].dofmap.index_map.local_to_global(nodes)
    for node, dyad in zip(numbering, held, strict=True):
        rows = (node * dimension + np.arange(dimension)).astype(PETSc.IntType)
        matrix.setValues(rows, rows, HOLDING_STIFFNESS * largest * dyad, addv=PETSc.InsertMode.ADD_VALUES)
    matrix.assemble()
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
