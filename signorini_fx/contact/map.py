"""The contact map B: from the unknowns of an elastic system to the relative displacement at the contact points.

Its rows are the components of the relative displacement in the frame (n, T) of each point, d rows per point with the
normal one first; its columns are the unknowns of the system that it belongs to.  It expresses all effects of contact on
a system: traces ``B x``, forces ``B^T (w t)`` and the tangent ``A + B^T D B`` with a block D of shape (d, d) per point.
With the nodal rule of a rigid foundation B selects and rotates, on quadratic tetrahedra it averages and rotates; a
condensed, rotated or coarsened
system has the product of B with its own change of unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.body.contact_boundary import ContactBoundary

Nodal = npt.NDArray[np.float64]
# Below it a component of a unit vector is round-off.
_ROUND_OFF = 1e-14


@dataclass(frozen=True)
class ContactMap:
    """B of one elastic system, distributed like its matrix.

    Attributes:
        operator: B, d rows for each of the n contact points of this rank.
        dimension: d.
        weight: w, the area (per unit thickness: length) of a point, shape (n,).
        fixed: the prescribed unknowns of this rank; contact forces on them go into the supports.
        averaging: whether points average over unknowns, which need not be in the pattern of the matrix, nor on the rank
            of the point.
    """

    operator: PETSc.Mat
    dimension: int
    weight: Nodal
    fixed: npt.NDArray[np.bool_]
    averaging: bool = False

    @classmethod
    def of_points(
        cls,
        boundary: ContactBoundary | None,
        position: npt.NDArray[np.integer[Any]] | None,
        fixed: npt.NDArray[np.bool_],
        matrix: PETSc.Mat,
    ) -> ContactMap:
        """Select, or average, and rotate: what points reach are nodes of the system; collective.

        Args:
            boundary: the contact points; None: there are none.
            position: number of each node that points reach (``ContactBoundary.reached``) among those of the system, on
                one rank, shape (m,); None: as in the function space.
            fixed: the prescribed unknowns of this rank.
            matrix: of the system, for the layout of x.
        """
        (columns, _), _ = matrix.getSizes()
        if boundary is None:
            operator = PETSc.Mat().createAIJ(((0, None), (columns, None)), nnz=0, comm=matrix.comm)
            operator.assemble()
            return cls(operator, 1, np.empty(0), fixed)
        count, dim = boundary.normal.shape
        nodes = (boundary.reached if position is None else position).astype(np.int64)
        point, values = np.arange(count), boundary.frames.transpose(0, 2, 1)
        room: Any = (dim, 0)
        if boundary.averages is not None:
            shares = boundary.averages.shares.tocoo()
            point, nodes = shares.row, nodes[shares.col]
            values = shares.data[:, None, None] * values[point]
            most = dim * int(np.bincount(point, minlength=count).max(initial=1))
            room = (min(most, columns), most)
        operator = PETSc.Mat().createAIJ(((count * dim, None), (columns, None)), nnz=room, comm=matrix.comm)
        if point.size:
            rows = operator.getOwnershipRange()[0] + dim * point[:, None] + np.arange(dim)
            unknowns = dim * nodes[:, None] + np.arange(dim)
            values = np.ascontiguousarray(values)
            operator.setValuesRCV(rows.astype(PETSc.IntType), unknowns.astype(PETSc.IntType), values)
        operator.assemble()
        return cls(operator, dim, boundary.weight, fixed, boundary.averages is not None)

    def traces(self, x: PETSc.Vec) -> tuple[Nodal, Nodal]:
        """(tau_N y, tau_T y), lengths, shapes (n,) and (n, d - 1); collective."""
        self.operator.mult(x, self._relative)
        relative = self._relative.getArray(readonly=True).reshape(-1, self.dimension)
        return relative[:, 0].copy(), relative[:, 1:].copy()

    def add_forces(self, pressure: Nodal, shear: Nodal, force: PETSc.Vec) -> None:
        """Add (lambda, tau_N .) + (mu, tau_T .) to a residual, prescribed unknowns left out; collective."""
        traction = np.column_stack((pressure, shear)) * self.weight[:, None]
        self._relative.getArray()[:] = traction.ravel()
        self.operator.multTranspose(self._relative, self._force)
        self._force.getArray()[self.fixed] = 0.0
        force.axpy(1.0, self._force)

    def after(self, change: PETSc.Mat, fixed: npt.NDArray[np.bool_]) -> ContactMap:
        """The map of a system in other unknowns x~ with x = ``change`` x~; collective."""
        return ContactMap(self.operator.matMult(change), self.dimension, self.weight, fixed, self.averaging)

    def turned(self, rotation: PETSc.Mat, fixed: npt.NDArray[np.bool_]) -> ContactMap:
        """The map in unknowns x~ with y = Q x~, in which supports along no axis are components; collective.

        What a tangent or a normal has of a component across it is round-off, and gamma makes a shear of it: it is zero.
        """
        found = self.after(rotation, fixed)
        found.operator.chop(_ROUND_OFF)
        return found

    def admitted(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """The matrix with room for B^T D B: itself where its pattern has that, else a copy; collective."""
        if not self.averaging:
            return matrix
        pattern = self.operator.transposeMatMult(self.operator)
        pattern.zeroEntries()
        wider = matrix.copy()
        wider.axpy(1.0, pattern, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        wider.setOption(PETSc.Mat.Option.SPD, True)
        return wider

    def stiffness(self, diagonal: PETSc.Vec) -> Nodal:
        """What a relative displacement meets at each point if only the diagonal of A resists: 1 / (w B diag(A)^-1 B^T),
        the stiffest component that is not prescribed, stress per length, shape (n,); collective.

        Args:
            diagonal: of A.
        """
        scale = diagonal.copy()
        scale.reciprocal()
        scale.sqrtabs()
        scale.getArray()[self.fixed] = 0.0
        scaled = self.operator.copy()
        scaled.diagonalScale(R=scale)
        starts, _, values = scaled.getValuesCSR()
        rows = np.repeat(np.arange(self.weight.size * self.dimension), np.diff(starts))
        compliance = np.bincount(rows, values**2, minlength=self.weight.size * self.dimension)
        compliance = np.where(compliance == 0.0, np.inf, compliance)  # which bincount counts where a rank has no points
        return 1.0 / (self.weight * compliance.reshape(-1, self.dimension).min(axis=1))

    def entries(self) -> tuple[npt.NDArray[np.int64], Nodal]:
        """The unknowns that each point touches, and B there.

        Returns:
            Positions in the local part of x, shape (n, m), and B, shape (n, d, m); m is the most that a point
            touches, and a point that touches fewer repeats its first one with zeros.
        """
        first, last = self.operator.getOwnershipRangeColumn()
        starts, columns, values = self.operator.getValuesCSR()
        count = self.weight.size
        point = np.repeat(np.arange(count * self.dimension) // self.dimension, np.diff(starts))
        pairs, place = np.unique(np.column_stack((point, columns)), axis=0, return_inverse=True)
        size = np.bincount(pairs[:, 0], minlength=count)
        begin = np.concatenate(([0], np.cumsum(size)[:-1])) if count else np.zeros(0, dtype=np.int64)
        rank = np.arange(len(pairs)) - begin[pairs[:, 0]]
        width = int(size.max(initial=self.dimension))  # also on a rank without contact points
        touched = np.repeat(pairs[begin, 1][:, None], width, axis=1) if count else np.zeros((0, width), dtype=np.int64)
        touched[pairs[:, 0], rank] = pairs[:, 1]
        blocks = np.zeros((count, self.dimension, width))
        component = np.repeat(np.arange(count * self.dimension) % self.dimension, np.diff(starts))
        blocks[point, component, rank[place.ravel()]] = values
        assert np.all((touched >= first) & (touched < last)), "a contact point touches unknowns of another rank"
        return touched - first, blocks

    @cached_property
    def _relative(self) -> PETSc.Vec:
        return self.operator.createVecLeft()

    @cached_property
    def _force(self) -> PETSc.Vec:
        return self.operator.createVecRight()
