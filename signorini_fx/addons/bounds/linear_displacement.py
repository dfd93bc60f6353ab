"""Displacements that are linear on cells: those of the smallest energy with given components, and
the rigid motions that supports leave free.

Cells transmit forces through the edges or faces that they share, so that each connected piece has
its own free motions, its own balance of forces and its own bound.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.addons.bounds.simplices import COLUMNS, ROWS, TWICE, Simplices, motions_of
from signorini_fx.algebra.linalg import petsc_options
from signorini_fx.algebra.linalg.factorisation import use_factorisation
from signorini_fx.arrays import Array, Flags, Ints, matvec, rmatvec
from signorini_fx.tuned import NOTHING_LEFT, ZERO_IN_SOLUTION

# Facets, projectors onto directions in which their vertices have a given displacement, and that,
# length, shapes (m,), (m, d, d) and (d,).
Given = tuple[Ints, Array, Array]


def smallest_energy(t: Simplices, given: list[Given]) -> tuple[Array, float]:
    """Return the displacement of least energy with given components, at the vertices, length, shape
    (v, d), and its largest difference from the given values, length.

    The given components must leave no rigid motion free.
    """
    count, d = t.x.shape
    weight = np.zeros((count, d, d))
    value = np.zeros((count, d))
    for facets, projectors, displacement in given:
        for column in t.facets[facets].T:
            np.add.at(weight, column, projectors)
            np.add.at(value, column, projectors @ displacement)
    sizes, turn = np.linalg.eigh(weight)
    fixed = sizes > ZERO_IN_SOLUTION
    along = rmatvec(turn, value) / np.where(fixed, sizes, 1.0)
    start = matvec(turn, np.where(fixed, along, 0.0))
    matrix = _stiffness(t)
    basis = free_basis(turn, fixed)
    if basis.shape[1]:
        force = -(matrix @ start.ravel())
        start += (basis @ solved(basis.T @ matrix @ basis, basis.T @ force)).reshape(-1, d)
    missed = [
        np.einsum("fij,faj->fai", projectors, start[t.facets[facets]] - displacement)
        for facets, projectors, displacement in given
    ]
    return start, max(float(np.abs(vectors).max(initial=0.0)) for vectors in missed)


def free_basis(turn: Array, fixed: Flags) -> sp.csr_matrix:
    """Return the matrix from free components to displacements of v vertices, shape (d v,
    components).

    Args:
        turn: directions of components, one per column, shape (v, d, d).
        fixed: which components are not free, shape (v, d).
    """
    count, d = fixed.shape
    numbers = (d * np.arange(count)[:, None, None] + np.arange(d)[:, None]).repeat(d, axis=2)
    size = (d * count, d * count)
    basis = sp.csr_matrix(
        (turn.ravel(), (numbers.ravel(), numbers.transpose(0, 2, 1).ravel())), shape=size
    )
    basis.eliminate_zeros()
    return sp.csr_matrix(basis[:, np.flatnonzero(~fixed.ravel())])


def _stiffness(t: Simplices) -> sp.csr_matrix:
    """Return the stiffness matrix of displacements that are linear on the cells, force per length,
    shape (d v, d v).
    """
    d = t.x.shape[1]
    rows = ROWS[d]
    columns = COLUMNS[d]
    twice = TWICE[d]
    gradient = np.einsum("nci,kj->nckji", t.gradients, np.eye(d)).reshape(len(t.corners), -1, d, d)
    strain = (gradient[:, :, rows, columns] + gradient[:, :, columns, rows]) / 2
    local = t.volume[:, None, None] * t.moduli.stress(strain) @ (strain * twice).transpose(0, 2, 1)
    dofs = (d * t.corners[:, :, None] + np.arange(d)).reshape(len(t.corners), -1)
    places = (
        np.repeat(dofs, dofs.shape[1], axis=1).ravel(),
        np.tile(dofs, (1, dofs.shape[1])).ravel(),
    )
    return sp.csr_matrix((local.ravel(), places), shape=(t.x.size, t.x.size))


def free_motions(t: Simplices, held: Array) -> Array:
    """Return an orthonormal basis of the rigid motions that held facets leave free, each of one
    piece, shape (d v, k).

    Args:
        t: the cells.
        held: projectors onto the directions in which facets are held, shape (f, d, d).
    """
    d = t.x.shape[1]
    held_facets = np.flatnonzero(held.any(axis=(1, 2)))
    of_facet = t.piece_of_vertex[t.facets[held_facets, 0]]
    bases = []
    for piece in range(int(t.piece.max(initial=-1)) + 1):
        inside = t.piece_of_vertex == piece
        arm = t.x[inside] - t.x[inside].mean(axis=0)
        modes = np.zeros((len(t.x), d, d * (d + 1) // 2))
        modes[inside] = motions_of(arm / np.abs(arm).max())
        facets = held_facets[of_facet == piece]
        rows = np.einsum("fij,fajk->faik", held[facets], modes[t.facets[facets]]).reshape(
            -1, modes.shape[2]
        )
        values, vectors = np.linalg.eigh(rows.T @ rows / max(len(rows), 1))
        free = vectors[:, values <= NOTHING_LEFT * max(values[-1], 1.0)]
        bases.append(np.linalg.qr(modes.reshape(-1, modes.shape[2]) @ free)[0])
    return np.concatenate(bases, axis=1)


def solved(symmetric: sp.csr_matrix, right: Array) -> Array:
    """Return the solution of a symmetric system, by the fastest factorisation of this PETSc, shape
    (n,).

    Raises:
        PETSc.Error: the factorisation broke down.
    """
    upper = sp.triu(symmetric, format="csr")
    upper.sort_indices()
    rows = upper.indptr.astype(PETSc.IntType)
    columns = upper.indices.astype(PETSc.IntType)
    matrix = PETSc.Mat().createSBAIJ(
        upper.shape, 1, csr=(rows, columns, upper.data), comm=MPI.COMM_SELF
    )
    solver = PETSc.KSP().create(MPI.COMM_SELF)
    solver.setOperators(matrix)
    solver.setOptionsPrefix(petsc_options.PREFIX)
    use_factorisation(solver, symmetric=True)
    solver.setErrorIfNotConverged(True)
    vector, solution = matrix.createVecs()
    vector.setArray(right)
    with petsc_options.defaults():
        solver.solve(vector, solution)
    return np.array(solution.getArray(readonly=True), dtype=np.float64)
