"""The contact map B: from the unknowns of an elastic system to the relative displacement at the
contact points.

Its rows are the components of the relative displacement in the frame (n, T) of each point, d rows
per point with the normal one first; its columns are the unknowns of the system that it belongs to.
It expresses all effects of contact on a system: traces ``B x``, forces ``B^T (w t)`` and the
tangent ``A + B^T D B`` with a block D of shape (d, d) per point. With the nodal rule of a rigid
foundation B selects and rotates, on quadratic tetrahedra it averages and rotates; a condensed
system, or one with turned unknowns, has the product of B with its own change of unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.contact.points import ContactPoints
from signorini_fx.arrays import Array, Flags, Integers
from signorini_fx.machine import parallel


@dataclass(frozen=True)
class ContactMap:
    """B of one elastic system, distributed like its matrix.

    Attributes:
        operator: B, d rows for each of the n contact points of this rank.
        fixed: the prescribed unknowns of this rank; contact forces on them go into the supports.
        lift: S with B S = 1, unknowns of one of two bodies from relative displacements, for
            multigrid; None: contact is with a rigid foundation, or no such unknowns are known, or a
            condensed system has no need of it.
        paired: whether points are those of two bodies, or of rigid ones that move, so that B takes
            differences of displacements.
        elsewhere: relative displacements of points that have no unknowns here, zero at the others,
            length, shape (n, d); None: there are none.
    """

    operator: PETSc.Mat
    points: ContactPoints
    fixed: Flags
    lift: PETSc.Mat | None = None
    paired: bool = False
    elsewhere: Array | None = None

    def traces(self, x: PETSc.Vec) -> tuple[Array, Array]:
        """(tau_N y, tau_T y), lengths, shapes (n,) and (n, d - 1); collective."""
        self.operator.mult(x, self._relative)
        relative = self._relative.getArray(readonly=True).reshape(-1, self.points.dimension)
        if self.elsewhere is not None:
            relative = relative + self.elsewhere
        return relative[:, 0].copy(), relative[:, 1:].copy()

    def add_forces(self, pressure: Array, shear: Array, force: PETSc.Vec) -> None:
        """Add (lambda, tau_N .) + (mu, tau_T .) to a residual, prescribed unknowns left out;
        collective.
        """
        traction = self._relative.getArray().reshape(-1, self.points.dimension)
        weight = self.points.weight
        np.multiply(pressure, weight, out=traction[:, 0])
        np.multiply(shear, weight[:, None], out=traction[:, 1:])
        self.operator.multTranspose(self._relative, self._force)
        self._force.getArray()[self.fixed] = 0.0
        force.axpy(1.0, self._force)

    @property
    def touched(self) -> Flags:
        """Which unknowns of this rank contact can act on; collective."""
        _, columns, values = self.operator.getValuesCSR()
        mark = self.operator.createVecRight()
        mark.setValues(columns[values != 0], np.ones(np.count_nonzero(values)))
        mark.assemble()
        return mark.getArray(readonly=True) > 0

    def after(self, change: PETSc.Mat, fixed: Flags) -> ContactMap:
        """Return the map of a system in other unknowns x~ with x = ``change`` x~; collective."""
        lift = (
            None if self.lift is None else change.transposeMatMult(self.lift)
        )  # of an orthogonal change
        return ContactMap(self.operator.matMult(change), self.points, fixed, lift, self.paired)

    def among(self, unknowns: Integers) -> ContactMap:
        """Return the map of a system that has some of the unknowns only, by their local numbers on
        this rank; collective.
        """
        rows = np.arange(*self.operator.getOwnershipRange())
        sets = [
            PETSc.IS().createGeneral(indices.astype(PETSc.IntType), comm=self.operator.comm)
            for indices in (rows, self.operator.getOwnershipRangeColumn()[0] + unknowns)
        ]
        operator = self.operator.createSubMatrix(*sets)
        return replace(self, operator=operator, fixed=self.fixed[unknowns], lift=None)

    def near(self, far: Flags, x: PETSc.Vec) -> ContactMap:
        """Return the map without the rows of points that are ``far``, which stay where ``x`` tells;
        one rank.
        """
        dim = self.points.dimension
        starts, columns, values = self.operator.getValuesCSR()
        kept_entries = np.repeat(np.repeat(~far, dim), np.diff(starts))
        ends = np.concatenate(([0], np.cumsum(kept_entries)))[starts].astype(PETSc.IntType)
        csr = (ends, columns[kept_entries], values[kept_entries])
        operator = PETSc.Mat().createAIJ(self.operator.getSizes(), csr=csr, comm=self.operator.comm)
        elsewhere = np.where(far[:, None], np.column_stack(self.traces(x)), 0.0)
        return replace(self, operator=operator, elsewhere=elsewhere)

    def law(self, blocks: Array, into: PETSc.Mat | None = None) -> PETSc.Mat:
        """Return the matrix with a block of shape (d, d) for each point on its diagonal;
        collective.

        ``into``: an earlier one, which is filled again.
        """
        first = self.operator.getOwnershipRange()[0]
        rows = self.operator.getSizes()[0]
        if into is None:
            into = PETSc.Mat().createAIJ(
                (rows, rows), nnz=(self.points.dimension, 0), comm=self.operator.comm
            )
        numbers = (first + np.arange(rows[0]).reshape(-1, self.points.dimension)).astype(
            PETSc.IntType
        )
        if numbers.size:
            into.setValuesRCV(numbers, numbers, np.ascontiguousarray(blocks))
        into.assemble()
        return into

    @cached_property
    def products(self) -> tuple[PETSc.Mat, PETSc.Mat, PETSc.Mat, PETSc.Mat]:
        """B without what is prescribed, and room for D, D B and B^T D B; collective.  By two
        products: where rigid bodies move, B has dense columns, with which ``ptap`` takes quadratic
        time.
        """
        free = self.operator.createVecRight()
        operator = self.operator.copy()
        free.getArray()[:] = ~self.fixed
        operator.diagonalScale(R=free)
        blocks = self.law(np.ones(self.points.movable.shape))
        half = blocks.matMult(operator)
        return operator, blocks, half, operator.transposeMatMult(half)

    def admitted(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Return a copy of the matrix with room for B^T D B; collective."""
        wider = matrix.copy()
        room = self.products[-1]
        room.zeroEntries()  # it has what the last tangent has left
        wider.axpy(1.0, room, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        return wider

    def stiffness(self, diagonal: PETSc.Vec) -> Array:
        """Return what a relative displacement meets at each point if only the diagonal of A
        resists: 1 / (w B diag(A)^-1 B^T), the stiffest component that is not prescribed, stress per
        length, shape (n,); collective.
        """
        scale = diagonal.copy()
        scale.reciprocal()
        scale.sqrtabs()
        scale.getArray()[self.fixed] = 0.0
        scaled = self.operator.copy()
        scaled.diagonalScale(R=scale)
        starts, _, values = scaled.getValuesCSR()
        components = self.points.weight.size * self.points.dimension
        rows = np.repeat(np.arange(components), np.diff(starts))
        compliance = np.bincount(rows, values**2, minlength=components)
        compliance = compliance.reshape(-1, self.points.dimension)
        # Of a prescribed direction the round-off of normals may leave something.
        free = compliance > np.finfo(float).eps * compliance.max(axis=1, initial=0.0)[:, None]
        least = np.where(free, compliance, np.inf).min(axis=1, initial=np.inf)
        return 1.0 / (self.points.weight * least)

    def natural_stiffness(self, diagonal: PETSc.Vec) -> float:
        """Return the stiffness of the stiffest contact point, times the share of its side in that
        of the contact boundary: of a uniform body its modulus over its size, stress per length;
        collective.

        Args:
            diagonal: of A.
        """
        points = self.points
        weight = self.points.weight
        side = (weight / parallel.global_sum(points.comm, weight.sum())) ** (
            1.0 / (points.dimension - 1)
        )
        return float(parallel.largest(points.comm, self.stiffness(diagonal) * side))

    @cached_property
    def _relative(self) -> PETSc.Vec:
        return self.operator.createVecLeft()

    @cached_property
    def _force(self) -> PETSc.Vec:
        return self.operator.createVecRight()
