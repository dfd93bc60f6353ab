"""The verdict on stability: whether displacements that contact admits raise the energy, by the derivative of F."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx.algebra.linalg.condensed import CondensedSystem
from signorini_fx.errors import FormError
from signorini_fx.forms.arguments import conditions_of
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.forms.nonlinear.moving_shapes import turning_of
from signorini_fx.forms.nonlinear.residual import Residual
from signorini_fx.forms.nonlinear.tangent import Tangents, is_derivative
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness, NodalStiffness
from signorini_fx.mechanics.rigid.rigid_bodies import with_more_unknowns
from signorini_fx.records import Status
from signorini_fx.tuned import HOLDING_STIFFNESS, NEGLIGIBLE, NO_FORCE, ORDER_IN_PLANE

Array = npt.NDArray[np.float64]


@dataclass
class Stability:
    """What the inertia of the tangent says of a displacement.

    Attributes:
        u: the displacement.
        linear: the contact problem of the last iteration of Newton's method.
        tangents: the user's and the derivative of F.
        residual: F.
        where: an instability that was found begins, in words.
    """

    u: fem.Function
    linear: LinearisedProblem
    tangents: Tangents
    residual: Residual
    where: str = ""

    def verdict(self) -> Status:
        """Whether an equilibrium is stable, by the derivative of F; collective."""
        if not self.linear.factor_fits or (tangent := self._derivative()) is None:
            return Status.STABILITY_UNKNOWN
        if tangent is self.tangents.leading and self._is_definite:
            return Status.CONVERGED
        self.linear.bend()
        negative, direction = self._negative(tangent)
        if not negative:
            return Status.CONVERGED
        self.where = self._most_moved(direction)
        # Without an energy a symmetric part that is not definite proves nothing.
        return Status.UNSTABLE if self.linear.symmetric else Status.STABILITY_UNKNOWN

    @property
    def _is_definite(self) -> bool:
        """Whether the last tangent is known to be positive definite without contact, and so it is with it.

        A matrix has as many negative eigenvalues as what is eliminated and what is left together (E. V. Haynsworth,
        Linear Algebra and its Applications 1 (1968) 73-81).
        """
        linear, system = self.linear, self.linear.task.system
        plain = linear.can_keep_stiffness and self.u.function_space.mesh.comm.size == 1
        if not plain or not isinstance(system, CondensedSystem) or not system.schur.positive_inside:
            return False
        try:
            np.linalg.cholesky(system.schur.dense)
        except np.linalg.LinAlgError:
            return False
        return True

    def reason_for_none(self, before: Array, tried: Array | None = None) -> str:
        """Why there may be no solution, at an iterate; empty: nothing says so; collective.

        Args:
            before: the last solution, values of ``u``.
            tried: where the tangent leads to, and no part of the way is possible, likewise; None: not so.
        """
        comm, size = self.u.function_space.mesh.comm, self.linear.extent
        farthest = self.u.x.array if tried is None else tried
        away = float(parallel.largest(comm, np.abs(farthest - before), 0.0))
        if not away <= max(size, float(parallel.largest(comm, np.abs(before), 0.0))):
            return "the displacement runs away" if self.leads(before) else ""
        with suppress(FormError):
            forces = self.residual.at(self.u.x.array.copy())
            known = forces is not None and self.linear.outcome is not None and self.linear.factor_fits
            if known and (tangent := self._derivative()) is not None:
                self.linear.bend()
                if self._negative(tangent)[0]:
                    return "the tangent has lost its stiffness in some direction"
        return ""

    def leads(self, values: Array) -> bool:
        """Whether the tangent that leads Newton's method is the derivative of F at values of ``u``; collective.

        Another one may lead away from any equilibrium.
        """
        if not self.tangents.given or self.tangents.trusted:
            return True
        self.residual.go_to(values)
        fits = is_derivative(self.tangents.leading, self.u, self.residual.at, ~self._fixed)
        self.residual.go_to(values)
        return fits

    @property
    def _fixed(self) -> npt.NDArray[np.bool_]:
        """Which of the owned unknowns are prescribed."""
        dofmap = self.u.function_space.dofmap
        return self.linear.prescribed[0][: dofmap.index_map.size_local * dofmap.index_map_bs]

    def _derivative(self) -> fem.Form | None:
        """The user's tangent if it is the derivative of F at ``u``, else that of UFL; None: neither is; collective."""
        if self.tangents.trusted:
            return self.tangents.leading
        free, values = ~self._fixed, self.u.x.array.copy()
        for given in (True, False) if self.tangents.given else (False,):
            tangent = self.tangents.leading if given else self.tangents.derivative
            fits = is_derivative(tangent, self.u, self.residual.at, free)
            self.residual.go_to(values)
            if fits:
                return tangent
        return None

    def _most_moved(self, direction: Array) -> str:
        """Where a displacement of the owned nodes is largest, in words; collective."""
        space, dim = self.u.function_space, self.u.function_space.mesh.geometry.dim
        sizes = np.linalg.norm(direction.reshape(-1, dim), axis=1)
        places = node_positions(space)[: sizes.size, :dim]
        rows = np.column_stack((sizes, places))[np.argsort(-sizes, kind="stable")[:1]]
        farthest = max(map(tuple, parallel.gather_rows(space.mesh.comm, rows)))
        return f"it begins at ({', '.join(f'{x:.4g}' for x in farthest[1:])})"

    def _negative(self, tangent: fem.Form) -> tuple[int, Array]:
        """See ``negative_directions``: of a tangent, or its symmetric part, with the curvature of now; collective."""
        linear = self.linear
        bcs = conditions_of(linear.bcs, self.u.function_space)
        nodes = linear.state.boundary.nodes
        turning, relative = turning_of(linear.state, linear.scales.size), linear.relative
        if relative is None:
            at_points, tools = turning, None
        else:  # at the nodes is what a tool that stands still does
            dim, blocks = turning.shape[1], relative.blocks.copy()
            at_points = turning + blocks[:, :dim, :dim]
            blocks[:, :dim, :dim] += np.where((relative.tool >= 0)[:, None, None], turning, 0.0)
            tools = self._tools(relative.tool, blocks)
        curvature, blocks = linear.curvature, np.concatenate((linear.curvature.blocks, at_points))
        beside = NodalStiffness.summed(np.concatenate((curvature.nodes, nodes)), blocks, curvature.joint)
        judged = linear.holding, tools, linear.symmetric, bool(linear.loose)
        return negative_directions(tangent, bcs, self._fixed, beside, nodes, linear.held, *judged)

    def _tools(self, tool: npt.NDArray[np.int64], blocks: Array) -> ToolsAtPoints:
        """The tools, of which each point touches one or none, with what their relative displacements meet."""
        bodies, moving = self.linear.moving_tools.bodies, self.linear.state.boundary.moving
        assert moving is not None
        shape = len(bodies.bodies), blocks.shape[2]
        each = moving.modes.reshape(*moving.modes.shape[:2], *shape)
        modes = each[np.arange(len(tool)), :, tool]
        return ToolsAtPoints(tool, modes, blocks, bodies.fixed.reshape(shape), bodies.stiffness.reshape(shape))


@dataclass(frozen=True)
class ToolsAtPoints:
    """Tools whose motions are unknowns, as the contact points see them; m of each, rotations times L.

    Attributes:
        tool: of each contact point, -1: none, shape (n,).
        modes: what its unknowns do at the point, shape (n, d, m).
        blocks: forces of displacements relative to it, and of its rotations, force per length, shape (n, m, m).
        fixed: which unknowns are prescribed, shape (t, m).
        stiffness: of springs to the ground, force per length, shape (t, m).
    """

    tool: npt.NDArray[np.int64]
    modes: Array
    blocks: Array
    fixed: npt.NDArray[np.bool_]
    stiffness: Array

    def added_to(
        self,
        matrix: PETSc.Mat,
        fixed: npt.NDArray[np.bool_],
        nodes: npt.NDArray[np.int32],
        held: Array,
        penalty: float,
    ) -> tuple[PETSc.Mat, npt.NDArray[np.bool_]]:
        """A matrix of the body with what its points hold in it, and the motions of tools as further unknowns, the last
        ones of the last rank; and which unknowns of this rank are prescribed; collective.

        Args:
            matrix: of the body, which has what the points do to each other.
            fixed: see ``negative_directions``.
            nodes: see ``negative_directions``.
            held: see ``negative_directions``.
            penalty: stiffness of what is held.
        """
        dim, first = held.shape[2], matrix.getOwnershipRange()[0]
        last = matrix.comm.rank == matrix.comm.size - 1
        tools = matrix.getSize()[0] + np.arange(self.fixed.size).reshape(self.fixed.shape)
        wider = with_more_unknowns(matrix, self.stiffness.ravel() if last else np.zeros(0))
        touched = self.tool >= 0
        of, at = self.tool[touched], nodes[touched]
        free, loose = ~fixed.reshape(-1, dim)[at], ~self.fixed[of]
        stiffness = self.blocks[touched].copy()
        stiffness[:, :dim, :dim] += penalty * np.einsum("nki,nkj->nij", held[touched], held[touched])
        # Displacements relative to the tool are -R q of its unknowns, its rotations are the last of these.
        moves = np.tile(np.eye(self.fixed.shape[1]), (len(of), 1, 1))
        moves[:, :dim] = -self.modes[touched]
        moves *= loose[:, None, :]
        across = free[:, :, None] * (stiffness[:, :dim] @ moves)
        along = moves.transpose(0, 2, 1) @ stiffness @ moves
        rows, columns = (first + at[:, None] * dim + np.arange(dim)), tools[of]
        wider.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
        for row, column, coupling, block in zip(rows, columns, across, along, strict=True):
            row, column = row.astype(PETSc.IntType), column.astype(PETSc.IntType)
            wider.setValues(row, column, coupling, addv=PETSc.InsertMode.ADD_VALUES)
            wider.setValues(column, row, coupling.T, addv=PETSc.InsertMode.ADD_VALUES)
            wider.setValues(column, column, block, addv=PETSc.InsertMode.ADD_VALUES)
        wider.assemble()
        return wider, np.concatenate((fixed, self.fixed.ravel())) if last else fixed


def negative_directions(
    tangent: fem.Form,
    bcs: Sequence[fem.DirichletBC],
    fixed: npt.NDArray[np.bool_],
    curvature: NodalStiffness,
    nodes: npt.NDArray[np.int32],
    held: Array,
    joint: Sequence[JointStiffness] = (),
    tools: ToolsAtPoints | None = None,
    symmetric: bool = True,
    loose: bool = False,
) -> tuple[int, Array]:
    """The number of negative eigenvalues of the tangent where contact points stay in contact, and if there are any an
    unstable direction, displacements of the owned nodes, shape (owned dofs,); collective.

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
        tools: those that forces move, which contact points keep their distance from; None: there are none.
        symmetric: whether the tangent is.
        loose: whether bodies may move without resistance, so that a small stiffness must hold them.
    """
    matrix, owned = fem_petsc.assemble_matrix(tangent, list(bcs), 0.0), fixed.size
    matrix.assemble()
    if not symmetric:
        matrix.axpy(1.0, matrix.transpose(PETSc.Mat()))
        matrix.scale(0.5)
    diagonal = matrix.getDiagonal()
    values = diagonal.getArray()
    largest = parallel.largest(matrix.comm.tompi4py(), np.abs(values)) or 1.0
    curvature.add_to(matrix, fixed)
    if loose:
        matrix.shift(NO_FORCE * largest)
    # What is prescribed cannot move: only what is left of a direction is held by contact.
    left = held * ~fixed.reshape(-1, held.shape[2])[nodes][:, None, :]
    holding = HOLDING_STIFFNESS * largest * np.einsum("nki,nkj->nij", left, left)
    NodalStiffness.summed(nodes, holding).add_to(matrix)
    for rows in joint:
        rows.scaled(HOLDING_STIFFNESS * largest).add_to(matrix, held.shape[2], fixed)
    if tools is not None:
        matrix, fixed = tools.added_to(matrix, fixed, nodes, held, HOLDING_STIFFNESS * largest)
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
    if tangent.mesh.topology.dim == 2:  # where MUMPS takes as long to find its own order as to factorise
        preconditioner.getFactorMatrix().setMumpsIcntl(*ORDER_IN_PLANE)
    preconditioner.setUp()
    negative = int(preconditioner.getFactorMatrix().getInertia()[0])
    direction = _unstable_direction(matrix, preconditioner)[:owned] if negative else np.zeros(owned)
    preconditioner.destroy()
    matrix.destroy()
    return negative, direction


def _unstable_direction(matrix: PETSc.Mat, factor: PETSc.PC) -> Array:
    """The eigenvector of the negative eigenvalue of a symmetric matrix that is nearest to zero, shape (rows of this
    rank,): that of the lowest one of its inverse, to which Lanczos' method converges first; collective.
    """
    from scipy.sparse.linalg import LinearOperator, eigsh  # imported by what needs it alone

    comm, (x, y), own = matrix.comm.tompi4py(), matrix.createVecs(), slice(*matrix.getOwnershipRange())

    def solved(values: Array) -> Array:
        x.getArray()[:] = values[own]
        factor.apply(x, y)
        return parallel.gather_rows(comm, np.array(y.getArray(readonly=True)))

    inverse, begin = LinearOperator(matrix.getSize(), matvec=solved), np.random.default_rng(0)
    _, vectors = eigsh(inverse, k=1, which="SA", v0=begin.standard_normal(inverse.shape[0]), tol=NEGLIGIBLE)
    return np.asarray(vectors[own, 0])
