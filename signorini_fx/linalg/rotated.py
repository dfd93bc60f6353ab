"""An elastic system with the displacement of each contact node in normal and tangential components."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.errors import SceneError
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

    def set_step(self, step: float, scale: float = 1.0) -> None:
        """As the inner system, rotated."""
        self.inner.set_step(step, scale)
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


def off_axes(boundary: ContactBoundary) -> npt.NDArray[np.bool_]:
    """Nodes whose normal or tangents are along no axis, shape (n,)."""
    return np.asarray((1.0 - np.abs(boundary.frames_in_axes).max(axis=1)).max(axis=1, initial=0.0) >= _ALONG_AXIS)


def check_rotation(boundary: ContactBoundary) -> None:
    """Check that every contact node can be rotated into its normal and tangents; collective.

    Raises:
        SceneError: contact points average, a contact node has two normals, or a prescribed component along neither its
            normal nor a tangent.
    """
    if boundary.averages is not None:
        reason = "contact points of quadratic tetrahedra average over several nodes, of which none can be tied"
        raise SceneError([("solver.algorithm", f"exact cannot be used here: {reason}; use ssn, alm or path-following")])
    nodes, counts = np.unique(boundary.nodes, return_counts=True)
    crossed = parallel.any_rank(boundary.comm, nodes[counts > 1].size > 0)
    # A prescribed component may stay an unknown of its own: then it is along the normal or a tangent.
    apart = (~boundary.free & (1.0 - np.abs(boundary.frames_in_axes).max(axis=2) >= _ALONG_AXIS)).any(axis=1)
    mixed = parallel.any_rank(boundary.comm, bool((off_axes(boundary) & apart).any()))
    if crossed or mixed:
        reason = "a contact node has two normals" if crossed else "a contact node is prescribed askew to its normal"
        raise SceneError([("solver.algorithm", f"exact cannot be used here: {reason}; use ssn, alm or path-following")])


def rotate(system: ElasticSystem, boundary: ContactBoundary) -> ElasticSystem:
    """The system in which each component of a relative displacement is an unknown; itself if that is so already.

    Raises:
        SceneError: see ``check_rotation``.
    """
    check_rotation(boundary)
    off = off_axes(boundary)
    if not parallel.any_rank(boundary.comm, bool(off.any())):
        return system
    sizes = system.matrix.getSizes()
    rotation = PETSc.Mat().createAIJ(sizes, nnz=(system.contact.dimension, 0), comm=system.comm)
    first, last = rotation.getOwnershipRange()
    rotation.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
    for row in range(first, last):
        rotation.setValue(row, row, 1.0)
    rotation.assemble()
    unknowns, blocks = system.contact.entries()
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
