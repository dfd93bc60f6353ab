"""The verdict on stability: whether displacements that contact admits raise the energy, by the derivative of F."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from petsc4py import PETSc

from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import elastic_body
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.forms.nonlinear.moving_shapes import turning_of
from signorini_fx.forms.nonlinear.residual import Residual, Tangents, is_derivative
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.contact_points.contact_boundary import block_diagonal
from signorini_fx.records import Status
from signorini_fx.tuned import HOLDING_STIFFNESS, NEGLIGIBLE, NO_FORCE

Array = npt.NDArray[np.float64]


@dataclass
class Stability:
    """What the inertia of the tangent says of a displacement.

    Attributes:
        linear: the contact problem of the last iteration of Newton's method.
        where: an instability that was found begins, in words.
    """

    linear: LinearisedProblem
    tangents: Tangents
    residual: Residual
    where: str = ""

    def verdict(self) -> Status:
        """Whether an equilibrium is stable, by the derivative of F; collective."""
        if (found := self._inertia()) is None:
            return Status.STABILITY_UNKNOWN
        negative, direction = found
        if not negative:
            return Status.CONVERGED
        self.where = self._most_moved(direction)
        # Without an energy a symmetric part that is not definite proves nothing.
        return Status.UNSTABLE if self.linear.symmetric else Status.STABILITY_UNKNOWN

    def _inertia(self) -> tuple[int, Array] | None:
        """See ``negative_directions``, of the derivative of F at ``u``; None: it is not known; collective."""
        if not self.linear.factor_fits or (tangent := self._derivative()) is None:
            return None
        self.linear.bend()
        return self._negative(tangent)

    def reason_for_none(self, before: Array, tried: Array | None = None) -> str:
        """Why there may be no solution, at an iterate; empty: nothing says so; ``before``: values of ``u`` of the last
        solution; ``tried``: of where the tangent leads to, if no part of the way is possible; collective.
        """
        u, comm = self.residual.u, self.linear.space.mesh.comm
        farthest = u.x.array if tried is None else tried
        away, so_far = (parallel.largest(comm, np.abs(values), 0.0) for values in (farthest - before, before))
        if not away <= max(self.linear.extent, so_far):
            return "the displacement runs away" if self.leads(before) else ""
        with suppress(FormError):
            known = self.residual.at(u.x.array.copy()) is not None and self.linear.outcome is not None
            if known and (found := self._inertia()) is not None and found[0]:
                return "the tangent has lost its stiffness in some direction"
        return ""

    def leads(self, values: Array) -> bool:
        """Whether the tangent that leads Newton's method is the derivative of F at values of ``u``; collective.

        Another one may lead away from any equilibrium.
        """
        tangents = self.tangents
        known = not tangents.given or tangents.trusted
        return known or is_derivative(tangents.leading, self.residual, values, ~self.linear.elastic.fixed)

    def _derivative(self) -> fem.Form | None:
        """The user's tangent if it is the derivative of F at ``u``, else that of UFL; None: neither is; collective."""
        tangents, values = self.tangents, self.residual.u.x.array.copy()
        if tangents.given and self.leads(values):
            return tangents.leading
        fits = is_derivative(tangents.derivative, self.residual, values, ~self.linear.elastic.fixed)
        return tangents.derivative if fits else None

    def _most_moved(self, direction: Array) -> str:
        """Where a displacement of the owned nodes is largest, in words; collective."""
        space, dim = self.linear.space, self.linear.space.mesh.geometry.dim
        sizes = np.linalg.norm(direction.reshape(-1, dim), axis=1)
        places = node_positions(space)[: sizes.size, :dim]
        rows = np.column_stack((sizes, places))[np.argsort(-sizes, kind="stable")[:1]]
        farthest = max(map(tuple, parallel.gather_rows(space.mesh.comm, rows)))
        return f"it begins at ({', '.join(f'{x:.4g}' for x in farthest[1:])})"

    def _negative(self, tangent: fem.Form) -> tuple[int, Array]:
        """``negative_directions`` of the symmetric part of a tangent where points stay in contact; collective.

        Points in contact keep their distance, and those that stick their place, by springs.  The verdict does not
        depend on units: all entries that are no stiffness of the body are shares of its largest one.
        """
        linear, space, fixed = self.linear, self.linear.space, self.linear.elastic.fixed
        diagonal = np.abs(linear.elastic.stiffness.getDiagonal().getArray(readonly=True)[: fixed.size])
        largest = parallel.largest(space.mesh.comm, diagonal, 0.0) or 1.0
        body = elastic_body(
            space,
            tangent,
            linear.bcs,
            fixed,
            linear.state.boundary if linear.contact else None,
            linear.settings.model_copy(update={"linear_algebra": "full"}),
            beside=linear.curvature,
            relative=linear.relative,
            definite=False,
            symmetric=False,
            of_body=linear.elastic.of_supports,
        )
        matrix, rows = body.stiffness, body.contact.operator
        if linear.contact:
            springs, held = turning_of(linear.state, linear.scales.size), linear.held
            components = np.arange(held.shape[1])
            springs[:, components, components] += HOLDING_STIFFNESS * largest * held
            acts = np.flatnonzero(springs.any(axis=(1, 2)))
            kept = (held.shape[1] * acts[:, None] + components).ravel() + rows.getOwnershipRange()[0]
            rows = rows.createSubMatrix(PETSc.IS().createGeneral(kept.astype(PETSc.IntType), comm=matrix.comm))
            added = rows.transposeMatMult(block_diagonal(rows, springs[acts]).matMult(rows))
            held_rows = added.getOwnershipRange()[0] + np.flatnonzero(body.prescribed)
            added.zeroRowsColumns(held_rows.astype(PETSc.IntType), diag=0.0)
            matrix.axpy(1.0, added, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        if not linear.symmetric:
            matrix.axpy(1.0, matrix.transpose(PETSc.Mat()))
            matrix.scale(0.5)
        if linear.loose:  # bodies may move without resistance, so that a small stiffness must hold them
            matrix.shift(NO_FORCE * largest)
        negative, direction = negative_directions(matrix)
        return negative, direction[: fixed.size]


def negative_directions(matrix: PETSc.Mat) -> tuple[int, Array]:
    """The number of negative eigenvalues of a symmetric matrix of a body, by one LDL^T factorisation with MUMPS, and if
    there are any an unstable direction, shape (rows of this rank,); it is destroyed; collective.
    """
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
    direction = _unstable_direction(matrix, preconditioner) if negative else np.zeros(matrix.getLocalSize()[0])
    preconditioner.destroy()
    matrix.destroy()
    return negative, direction


def _unstable_direction(matrix: PETSc.Mat, factor: PETSc.PC) -> Array:
    """The eigenvector of the lowest eigenvalue of the inverse, shape (rows of this rank,); collective."""
    from scipy.sparse.linalg import LinearOperator, eigsh  # imported by what needs it alone

    comm, (x, y), own = matrix.comm.tompi4py(), matrix.createVecs(), slice(*matrix.getOwnershipRange())

    def solved(values: Array) -> Array:
        x.getArray()[:] = values[own]
        factor.apply(x, y)
        return parallel.gather_rows(comm, np.array(y.getArray(readonly=True)))

    inverse, begin = LinearOperator(matrix.getSize(), matvec=solved), np.random.default_rng(0)
    _, vectors = eigsh(inverse, k=1, which="SA", v0=begin.standard_normal(inverse.shape[0]), tol=NEGLIGIBLE)
    return np.asarray(vectors[own, 0])
