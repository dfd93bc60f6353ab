"""Unknowns of rigid bodies for multigrid: the last k of the system, on its last rank, on which only
contact acts.

They are on every level.  Where contact holds the nodes, a coarse function moves a rigid body and
these nodes with it: with E of ``multigrid`` and motions G of the contact unknowns for which B (G,
1) = 0, the finest interpolation is

    [P - E P_c, E G; 0, 1].
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.arrays import Array, Flags
from signorini_fx.machine import parallel
from signorini_fx.tuned import KRYLOV_STEPS, SAME_NUMBER


def embedding(rotation: PETSc.Mat | None, own: PETSc.Mat, whole: PETSc.Mat) -> PETSc.Mat:
    """Return [Q 0], from the unknowns of ``whole`` to displacements.

    Args:
        rotation: Q, from the unknowns of ``own``; None: the identity.
        own: matrix of the displacements, whose unknowns come first on each rank.
        whole: matrix of all unknowns.
    """
    rows = own.getSizes()[0]
    first = own.getOwnershipRange()[0]
    if rotation is None:
        starts = np.arange(rows[0] + 1, dtype=PETSc.IntType)
        columns = first + starts[:-1]
        values = np.ones(rows[0])
    else:
        rows = rotation.getSizes()[0]
        starts, columns, values = rotation.getValuesCSR()  # Q rotates only nodes of the same rank
    csr = (starts, (columns + whole.getOwnershipRange()[0] - first).astype(PETSc.IntType), values)
    return PETSc.Mat().createAIJ((rows, whole.getSizes()[1]), csr=csr, comm=own.comm)


def bordered(matrix: PETSc.Mat, free: Flags, entries: Array) -> PETSc.Mat:
    """Return [A 0; 0 D] with one more row for each unknown of a rigid body and one more column for
    each free one; collective.

    Args:
        matrix: A.
        free: which unknowns of rigid bodies are free.
        entries: of D, for the free ones.
    """
    (rows, _), (columns, total_columns) = matrix.getSizes()
    starts, names, values = matrix.getValuesCSR()
    count = np.count_nonzero(free)
    csr = (
        np.append(starts, starts[-1] + np.cumsum(free)).astype(PETSc.IntType),
        np.append(names, total_columns + np.arange(count)).astype(PETSc.IntType),
        np.append(values, entries),
    )
    return PETSc.Mat().createAIJ(
        ((rows + free.size, None), (columns + count, None)), csr=csr, comm=matrix.comm
    )


def relative_to_rigid_bodies(contact: ContactMap, places: PETSc.IS, rigid: int) -> PETSc.Mat:
    """Return [1, -G; 0, 0] on the contact unknowns of this rank: the motion of nodes relative to
    the rigid bodies; collective.

    Args:
        contact: the contact map.
        places: numbers of the contact unknowns, those of rigid bodies last.
        rigid: number of unknowns of rigid bodies on this rank.
    """
    comm = places.comm
    unknowns = places.getIndices()
    nodes = unknowns.size - rigid
    count = int(parallel.total(comm.tompi4py(), rigid))
    first, last = contact.operator.getOwnershipRange()
    rows = PETSc.IS().createStride(last - first, first, 1, comm=comm)
    operator = contact.operator.createSubMatrix(
        rows, PETSc.IS().createGeneral(unknowns[:nodes], comm=comm)
    )
    ksp = PETSc.KSP().create(comm)
    ksp.setType(PETSc.KSP.Type.LSQR)
    ksp.getPC().setType(PETSc.PC.Type.NONE)
    ksp.setOperators(operator)
    ksp.setTolerances(rtol=SAME_NUMBER, max_it=KRYLOV_STEPS)
    motion, moved = operator.createVecs()
    unit = contact.operator.createVecRight()
    numbers = parallel.gather_rows(comm.tompi4py(), unknowns[nodes:])
    motions = np.empty((nodes, count))
    for column, number in enumerate(numbers):
        unit.set(0.0)
        if unit.getOwnershipRange()[0] <= number < unit.getOwnershipRange()[1]:
            unit.setValue(number, 1.0)
        unit.assemble()
        contact.operator.mult(unit, moved)
        ksp.solve(moved, motion)  # B_u (-G) = B_q
        motions[:, column] = motion.getArray(readonly=True)
    layout = PETSc.Vec().createMPI((unknowns.size, None), comm=comm)
    begin = layout.getOwnershipRange()[0]
    total = layout.getSize()
    names = np.column_stack(
        (begin + np.arange(nodes), np.tile(np.arange(total - count, total), (nodes, 1)))
    )
    starts = np.minimum(np.arange(unknowns.size + 1), nodes) * (1 + count)
    values = np.column_stack((np.ones(nodes), motions))
    csr = (starts.astype(PETSc.IntType), names.ravel().astype(PETSc.IntType), values.ravel())
    sizes = (unknowns.size, None)
    return PETSc.Mat().createAIJ((sizes, sizes), csr=csr, comm=comm)
