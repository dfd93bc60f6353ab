"""The contact map B: from the unknowns of an elastic system to the relative displacement at the
contact points.

Its rows are the components of the relative displacement in the frame (n, T) of each point, d rows
per point with the normal one first; its columns are the unknowns of its system.  It expresses all
effects of contact on a system: traces ``B x``, forces ``B^T (w t)`` and the tangent ``A + B^T D B``
with a block D of shape (d, d) per point.  With the nodal rule of a rigid foundation B selects and
rotates, on quadratic tetrahedra it averages and rotates; a condensed system, or one with rotated
unknowns, has the product of B with its change of unknowns.
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
        points: the contact points.
        fixed: the prescribed unknowns of this rank; contact forces on them go into the supports.
        lift: S with B S = 1, from relative displacements to unknowns of one of two bodies, for
            multigrid; None: contact with a rigid foundation, no such unknowns, or a condensed
            system.
        paired: whether points are those of two bodies, or of rigid bodies that move, so that B
            takes differences of displacements.
        elsewhere: relative displacements of points without unknowns here, zero at the others,
            length, shape (n, d); None: there are none.
    """

    operator: PETSc.Mat
    points: ContactPoints
    fixed: Flags
    lift: PETSc.Mat | None = None
    paired: bool = False
    elsewhere: Array | None = None

    def traces(self, x: PETSc.Vec) -> tuple[Array, Array]:
        """Return (tau_N y, tau_T y), lengths, shapes (n,) and (n, d - 1); collective."""
        self.operator.mult(x, self._relative)
        relative = self._relative.getArray(readonly=True).reshape(-1, self.points.dimension)
        if self.elsewhere is not None:
            relative = relative + self.elsewhere
        return relative[:, 0].copy(), relative[:, 1:].copy()

    def add_forces(self, pressure: Array, shear: Array, force: PETSc.Vec) -> None:
        """Add (lambda, tau_N .) + (mu, tau_T .) to a residual, except at prescribed unknowns;
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
        """The unknowns of this rank on which contact can act; collective."""
        _, columns, values = self.operator.getValuesCSR()
        mark = self.operator.createVecRight()
        mark.setValues(columns[values != 0], np.ones(np.count_nonzero(values)))
        mark.assemble()
        return mark.getArray(readonly=True) > 0

    def after(self, change: PETSc.Mat, fixed: Flags) -> ContactMap:
        """Return the map of a system in other unknowns x~ with x = ``change`` x~; collective."""
        lift = (
            None if self.lift is None else change.transposeMatMult(self.lift)
        )  # as the change is orthogonal
        return ContactMap(self.operator.matMult(change), self.points, fixed, lift, self.paired)

    def among(self, unknowns: Integers) -> ContactMap:
        """Return the map of a system with only these unknowns, given by local numbers;
        collective.
        """
        rows = np.arange(*self.operator.getOwnershipRange())
        sets = [
            PETSc.IS().createGeneral(indices.astype(PETSc.IntType), comm=self.operator.comm)
            for indices in (rows, self.operator.getOwnershipRangeColumn()[0] + unknowns)
        ]
        operator = self.operator.createSubMatrix(*sets)
        return replace(self, operator=operator, fixed=self.fixed[unknowns], lift=None)

    def near(self, far: Flags, x: PETSc.Vec) -> ContactMap:
        """Return the map without the rows of ``far`` points, which stay at their displacements for
        ``x``; one rank only.
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
        """Return the block-diagonal matrix D with one block of shape (d, d) for each point;
        collective.

        Args:
            blocks: shape (n, d, d).
            into: an earlier matrix to fill again; None: a new one is made.
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
        """B without prescribed unknowns, and matrices to hold D, D B and B^T D B; collective.

        Two products are used: where rigid bodies move, B has dense columns, with which ``ptap``
        takes quadratic time.
        """
        free = self.operator.createVecRight()
        operator = self.operator.copy()
        free.getArray()[:] = ~self.fixed
        operator.diagonalScale(R=free)
        blocks = self.law(np.ones(self.points.movable.shape))
        half = blocks.matMult(operator)
        return operator, blocks, half, operator.transposeMatMult(half)

    def admitted(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Return a copy of the matrix with room for the entries of B^T D B; collective."""
        wider = matrix.copy()
        room = self.products[-1]
        room.zeroEntries()  # it holds the values of the last tangent
        wider.axpy(1.0, room, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        return wider

    def stiffness(self, diagonal: PETSc.Vec) -> Array:
        """Return the stiffness at each contact point if only the diagonal of A resists; collective.

        It is 1 / (w B diag(A)^-1 B^T) for the stiffest component that is not prescribed, stress per
        length, shape (n,).
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
        # Round-off of normals may leave a small compliance in a prescribed direction.
        free = compliance > np.finfo(float).eps * compliance.max(axis=1, initial=0.0)[:, None]
        least = np.where(free, compliance, np.inf).min(axis=1, initial=np.inf)
        return 1.0 / (self.points.weight * least)

    def natural_stiffness(self, diagonal: PETSc.Vec) -> float:
        """Return the stiffness of the stiffest contact point, scaled by the share of its side in
        that of the contact boundary, stress per length; collective.

        For a uniform body it is about its modulus over its size.

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
