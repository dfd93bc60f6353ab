"""An elastic system with the displacement of each contact node in normal and tangential components."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.contact.map import ContactMap
from signorini_fx.linalg import ElasticSystem
from signorini_fx.linalg.transformed import TransformedSystem

_ALONG_AXIS = 1e-12


@dataclass
class RotatedSystem(TransformedSystem):
    """See ``ElasticSystem``: x = Q x~ with Q orthogonal, A~ = Q^T A Q, b~ = Q^T b."""

    rotation: PETSc.Mat

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool, turned: PETSc.Mat | None = None) -> None:
        """As the inner system, in unknowns that are turned."""
        self.inner.configure(ksp, symmetric=symmetric, turned=self.rotation)

    def set_load(self, factors: npt.NDArray[np.float64]) -> None:
        """As the inner system, rotated."""
        self.inner.set_load(factors)
        self.rotation.multTranspose(self.inner.load, self.load)
        self.rotation.multTranspose(self.inner.start, self.start)

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """Q x~."""
        result = x.duplicate()
        self.rotation.mult(x, result)
        return self.inner.displacement(result)

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """Q^T x."""
        x = self.inner.unknowns(displacement)
        result = x.duplicate()
        self.rotation.multTranspose(x, result)
        return result


def rotate(system: ElasticSystem) -> ElasticSystem:
    """The system in which each component of a relative displacement is an unknown; itself if that is so already.

    Raises:
        ValueError: no rotation of the unknowns does that.
    """
    unknowns, blocks = _frames(system.contact)
    across = 1.0 - np.abs(blocks).max(axis=1) >= _ALONG_AXIS
    off = across.any(axis=1)
    if not parallel.any_rank(system.comm, bool(off.any())):
        return system
    if parallel.any_rank(system.comm, bool((system.fixed[unknowns] & across).any())):
        raise ValueError("a contact point is prescribed askew to its normal")
    sizes = system.matrix.getSizes()
    rotation = PETSc.Mat().createAIJ(sizes, nnz=(system.contact.points.dimension, 0), comm=system.comm)
    first, last = rotation.getOwnershipRange()
    rotation.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
    for row in range(first, last):
        rotation.setValue(row, row, 1.0)
    rotation.assemble()
    blocks = _in_place(blocks, system.fixed[unknowns])
    rows = (first + unknowns[off]).astype(PETSc.IntType)
    if rows.size:
        rotation.setValuesRCV(rows, rows, np.ascontiguousarray(blocks[off].transpose(0, 2, 1)))
    rotation.assemble()
    load, start = system.load.duplicate(), system.start.duplicate()
    rotation.multTranspose(system.load, load)
    rotation.multTranspose(system.start, start)
    matrix = _turned(system.matrix, rotation)
    contact = system.contact.after(rotation, system.fixed)
    turned = RotatedSystem(system.comm, matrix, load, start, system.fixed, contact, system, rotation)
    return turned


def _frames(contact: ContactMap) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    """The unknowns that each point takes its displacement from, shape (n, d), and B there, shape (n, d, d); collective.

    Raises:
        ValueError: some point averages over unknowns, or shares them with another one.
    """
    first, last = contact.operator.getOwnershipRangeColumn()
    starts, columns, values = contact.operator.getValuesCSR()
    count, d = contact.points.movable.shape[:2]
    row = np.repeat(np.arange(count * d), np.diff(starts))
    used = values != 0.0
    pairs, place = np.unique(np.column_stack((row // d, columns))[used], axis=0, return_inverse=True)
    alone = np.array_equal(pairs[:, 0], np.repeat(np.arange(count), d)) and np.unique(pairs[:, 1]).size == count * d
    alone = alone and bool(((pairs[:, 1] >= first) & (pairs[:, 1] < last)).all())
    if parallel.any_rank(contact.points.comm, not alone):
        raise ValueError("a contact point averages over unknowns, or shares them with another one: none can be tied")
    blocks = np.zeros((count, d, d))
    blocks[row[used] // d, row[used] % d, place.ravel() % d] = values[used]
    return pairs[:, 1].reshape(count, d).astype(np.int64) - first, blocks


def _in_place(blocks: npt.NDArray[np.float64], fixed: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64]:
    """The rows of B at each point, shape (n, d, d), in an order that leaves each prescribed unknown where it is."""
    for point, unknown in np.argwhere(fixed):
        row = int(np.abs(blocks[point, :, unknown]).argmax())
        blocks[point, [row, unknown]] = blocks[point, [unknown, row]]
    return blocks


def _turned(matrix: PETSc.Mat, rotation: PETSc.Mat) -> PETSc.Mat:
    """Q^T A Q."""
    if matrix.getType() != PETSc.Mat.Type.SEQDENSE:
        return matrix.ptap(rotation)
    q = rotation.convert(PETSc.Mat.Type.DENSE).getDenseArray()
    result = matrix.duplicate()
    result.getDenseArray()[:] = q.T @ matrix.getDenseArray() @ q
    result.assemble()
    return result
