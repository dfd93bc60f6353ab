"""Multigrid for the tangent of contact: one hierarchy for each mesh, truncated where contact holds
the body.

The hierarchy of A, the stiffness without contact, consists of coarser meshes as far as there are
any, see ``mechanics.rigid.mesh_levels``, and of smoothed aggregation below them; it never changes.
Contact adds C = B^T D B, which acts on the contact unknowns c and is as large as gamma.  The
directions that contact holds, in which C is no smaller than A, must not move on coarse levels
either.  With E the projection onto these directions, the finest interpolation P becomes (I - E) P
and the smoother leaves them alone: truncation, as in monotone multigrid (Kornhuber 1994; Graeser &
Kornhuber 2009).  The coarse matrices follow by products of the size of the contact boundary
(``truncation``),

    A_1' = A_1 - X^T W - W^T X + X^T A_cc X + Y^T C Y,   X = E P_c,  Y = P_c - X,  W = (A P)_c,

and A_l+1' = A_l+1 + P_l^T (A_l' - A_l) P_l below.  So gamma does not enter a V-cycle V.  Before and
after it the contact unknowns are solved for exactly, F = (A + C)_cc^-1, which makes a symmetric
multiplicative preconditioner: AMG with filtering (Petrides et al. 2025, arXiv:2505.18576).  The
residual is zero on c from then on.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.linalg import Level, is_by_blocks, petsc_options, row_by_row
from signorini_fx.algebra.linalg.blocks import by_entries
from signorini_fx.algebra.linalg.factorisation import use_direct
from signorini_fx.algebra.linalg.petsc_calls import call, called_back
from signorini_fx.algebra.linalg.rigid_unknowns import bordered, relative_to_rigid_bodies
from signorini_fx.algebra.linalg.truncation import NodalBlocks, TruncatedLevels
from signorini_fx.arrays import Array, Flags, Ints
from signorini_fx.machine import parallel
from signorini_fx.tuned import FEWEST_BLOCK_UNKNOWNS, NEGLIGIBLE, NOTABLE, NOTHING_LEFT, SAME_NUMBER

_ESTIMATING_STEPS = 10
_FEW = (
    300  # unknowns for which PETSc's own factor is good enough, without the overhead of a package
)


@dataclass(frozen=True)
class Hierarchy:
    """Levels of A, the finest first: coarser meshes as far as there are any, then smoothed
    aggregation.

    Attributes:
        interpolations: P_0, P_1, ..., each from a level to the next finer one.
        coarse: A_1 = P_0^T A P_0, ....
        largest: the largest eigenvalue of diag(A)^-1 A, estimated by a few steps of CG.
    """

    interpolations: tuple[PETSc.Mat, ...]
    coarse: tuple[PETSc.Mat, ...]
    largest: float

    @classmethod
    def of(cls, matrix: PETSc.Mat, level: Level | None = None) -> Hierarchy:
        """Set up the hierarchy of A; collective.

        Args:
            matrix: A, with its block size and near null space.
            level: its mesh and the coarser ones; None: there are none.
        """
        interpolations = list[PETSc.Mat]()
        coarse = list[PETSc.Mat]()
        at = None if petsc_options.user_sets("pc_gamg") else level
        while at is not None and at.interpolation is not None and at.coarser is not None:
            interpolations.append(at.interpolation)
            at = at.coarser
            coarse.append(_coarse_matrix(coarse[-1] if coarse else matrix, interpolations[-1], at))
        if at is None or not coarse:
            return cls._aggregated(matrix, level)
        coarse[-1] = by_entries(coarse[-1])
        row_by_row(coarse[-1]).setBlockSize(at.block)
        if coarse[-1].getSize()[0] > FEWEST_BLOCK_UNKNOWNS:
            coarse[-1].setNearNullSpace(at.modes())
            below = cls._aggregated(coarse[-1])
            interpolations += below.interpolations
            coarse += below.coarse
        return cls(tuple(interpolations), tuple(coarse), _largest_eigenvalue(matrix))

    def with_rigid_bodies(self, free: Flags, stiffness: Array) -> Hierarchy:
        """Return the hierarchy with the unknowns of rigid bodies on each level, on coarse levels
        only the free ones, see ``rigid_unknowns``; collective.

        Args:
            free: which unknowns of rigid bodies of this rank are free.
            stiffness: of their springs.
        """
        springs = stiffness[free]
        ones = np.ones(np.count_nonzero(free))
        all_free = ones.astype(bool)
        coarse = tuple(
            bordered(
                by_entries(matrix),
                all_free,
                np.maximum(springs, NOTHING_LEFT * matrix.getDiagonal().max()[1]),
            )
            for matrix in self.coarse
        )
        borders = [all_free if level else free for level in range(len(self.interpolations))]
        interpolations = tuple(
            bordered(*each, ones) for each in zip(self.interpolations, borders, strict=True)
        )
        return replace(self, interpolations=interpolations, coarse=coarse)

    @classmethod
    def _aggregated(cls, matrix: PETSc.Mat, level: Level | None = None) -> Hierarchy:
        """Set up GAMG and return its levels; collective."""
        largest = _largest_eigenvalue(matrix)
        if is_by_blocks(matrix):
            matrix = by_entries(matrix)
            if level is not None:
                matrix.setNearNullSpace(level.modes())
        gamg = PETSc.PC().create(matrix.comm)
        gamg.setOptionsPrefix(petsc_options.PREFIX)
        gamg.setOperators(matrix)
        gamg.setType(PETSc.PC.Type.GAMG)
        gamg.setFromOptions()
        gamg.setUp()
        finest = gamg.getMGLevels() - 1
        interpolations = tuple(gamg.getMGInterpolation(level) for level in range(finest, 0, -1))
        solvers = [gamg.getMGSmoother(level) for level in range(finest - 1, 0, -1)]
        if finest:
            solvers.append(gamg.getMGCoarseSolve())
        return cls(interpolations, tuple(solver.getOperators()[0] for solver in solvers), largest)


def _coarse_matrix(matrix: PETSc.Mat, interpolation: PETSc.Mat, level: Level) -> PETSc.Mat:
    """Return P^T A P; collective.

    This is the stiffness of the coarser mesh if one product with a vector shows that they are
    equal, as on nested meshes.
    """
    stiffness = level.stiffness
    if stiffness is not None and stiffness.getSizes() == (interpolation.getSizes()[1],) * 2:
        coarse, wanted = stiffness.createVecs()
        fine, forces = matrix.createVecs()
        interpolation.multTranspose(_irregular(fine), coarse)  # zero where unknowns are prescribed
        free = coarse.getArray(readonly=True) != 0
        interpolation.mult(coarse, fine)
        matrix.mult(fine, forces)
        interpolation.multTranspose(forces, wanted)
        given = coarse.duplicate()
        coarse.getArray()[~free] = _irregular(given).getArray(readonly=True)[
            ~free
        ]  # which must not act on the others
        stiffness.mult(coarse, given)
        given.getArray()[~free] = 0.0
        size = wanted.norm()
        given.axpy(-1.0, wanted)
        if given.norm() <= NOTHING_LEFT * size:
            return stiffness
    product = by_entries(matrix).ptap(interpolation)
    # Unknowns that interpolate to nothing, such as prescribed ones, get a diagonal entry.
    diagonal = product.getDiagonal()
    values = diagonal.getArray()
    largest = diagonal.max()[1]
    values[values <= 0] = largest
    product.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
    product.setDiagonal(diagonal)
    return product


def _irregular(x: PETSc.Vec) -> PETSc.Vec:
    """Fill a vector with values that do not depend on the number of ranks and are no smooth
    function of position; return it.
    """
    first, last = x.getOwnershipRange()
    x.getArray()[:] = np.sin(1e4 * np.arange(first + 1, last + 1))
    return x


def _largest_eigenvalue(matrix: PETSc.Mat) -> float:
    """Return the largest eigenvalue of diag(A)^-1 A as estimated by CG; collective."""
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setOperators(matrix)
    ksp.setType(PETSc.KSP.Type.CG)
    ksp.getPC().setType(PETSc.PC.Type.JACOBI)
    ksp.setTolerances(rtol=SAME_NUMBER, max_it=_ESTIMATING_STEPS)
    ksp.setComputeEigenvalues(True)
    x, b = matrix.createVecs()
    ksp.solve(_irregular(b), x)
    return float(np.max(ksp.computeEigenvalues().real, initial=1.0))


class ContactLevels:
    """The part that all preconditioners of one system share; it depends on A and on the truncation
    of the levels.

    Attributes:
        hierarchy: the hierarchy of A.
        unknowns: contact unknowns of this rank in the local part of x, ascending; those of rigid
            bodies are last.
        places: global numbers of the contact unknowns.
        diagonal: of A, infinite for motions of rigid bodies.
        nodes: nodal blocks of the contact unknowns.
        joined: nodal blocks of two bodies at the contact points; None with a rigid foundation.
        lift: S of ``truncation``; None with a rigid foundation.
        truncated: the truncated levels.
        inverse: D^-1, zero in directions that contact holds.
        times: how often the levels have been truncated.
    """

    def __init__(
        self,
        hierarchy: Hierarchy,
        matrix: PETSc.Mat,
        unknowns: Ints,
        contact: ContactMap,
        *,
        rigid: int = 0,
    ) -> None:
        self._comm = matrix.comm.tompi4py()
        self.hierarchy = hierarchy
        self.unknowns = unknowns
        first = matrix.getOwnershipRange()[0]
        self.places = PETSc.IS().createGeneral(
            (first + unknowns).astype(PETSc.IntType), comm=matrix.comm
        )
        # Of A only the rows at the contact unknowns and the diagonal are needed.
        rows = matrix.createSubMatrix(self.places, None)
        elastic = matrix.createSubMatrix(self.places, self.places)
        self.diagonal = matrix.getDiagonal()
        self.diagonal.getArray()[unknowns[unknowns.size - rigid :]] = (
            np.inf
        )  # which no smoother moves
        self.nodes = NodalBlocks(
            elastic, unknowns[: unknowns.size - rigid], contact.points.dimension
        )
        functions = hierarchy.interpolations[0].createSubMatrix(self.places, None)
        self.lift: PETSc.Mat | None = None
        self.joined: NodalBlocks | None = None
        if contact.lift is not None:
            self.lift = contact.lift.createSubMatrix(self.places, None)
            at_points = elastic.ptap(self.lift)
            dimension = contact.points.dimension
            self.joined = NodalBlocks(
                at_points, np.arange(dimension * contact.points.size), dimension
            )
            first, last = contact.operator.getOwnershipRange()
            rows_of_points = PETSc.IS().createStride(last - first, first, 1, comm=self._comm)
            functions = contact.operator.createSubMatrix(rows_of_points, self.places).matMult(
                functions
            )
        elif parallel.any_rank(self._comm, rigid > 0):
            functions = relative_to_rigid_bodies(contact, self.places, rigid).matMult(functions)
        self.truncated = TruncatedLevels(
            self.joined or self.nodes,
            self.lift,
            functions,
            elastic,
            rows.matMult(hierarchy.interpolations[0]),
            hierarchy.interpolations,
            hierarchy.coarse,
            self.places,
        )
        self.inverse = self._inverse_diagonal()
        self.times = 0
        self._truncated_at: tuple[Array, Array] | None = None

    def truncate(self, held: Array, soft: Array, reduced: PETSc.Mat | None) -> None:
        """Truncate the levels again if the held directions have changed; collective.

        Args:
            held: see ``NodalBlocks.split``.
            soft: see ``NodalBlocks.split``.
            reduced: S^T (A + C)_cc S of two bodies; None: a rigid foundation.
        """
        if not parallel.any_rank(self._comm, self._differs(held, soft)):
            return
        self._truncated_at = held, soft
        self.times += 1
        if self.joined is None or reduced is None:
            self.truncated.truncate(held, soft)
        else:
            self.truncated.truncate(*self.joined.split(reduced))
        nodes = self.nodes
        first = self.diagonal.getOwnershipRange()[0]
        names = (first + self.unknowns).astype(PETSc.IntType)
        if nodes.columns.size:
            values = nodes.values(nodes.inverse(held))
            starts = nodes.starts.astype(PETSc.IntType)
            self.inverse.setValuesIJV(
                starts, names[nodes.columns], values, rowmap=names[: starts.size - 1]
            )
        self.inverse.assemble()

    def _differs(self, held: Array, soft: Array) -> bool:
        """Return whether the directions on this rank require a new truncation."""
        if self._truncated_at is None:
            return True
        truncated = self._truncated_at
        near = NOTABLE * np.abs(truncated[1]) + NEGLIGIBLE * self.nodes.scale[:, None, None]
        return bool(
            (np.abs(held - truncated[0]) > NEGLIGIBLE).any()
            or (np.abs(soft - truncated[1]) > near).any()
        )

    def _inverse_diagonal(self) -> PETSc.Mat:
        """Return D^-1, with room for the free directions of the nodes in contact; collective."""
        nodes = self.nodes
        first = self.diagonal.getOwnershipRange()[0]
        diagonal = self.diagonal.getArray(readonly=True)
        unknowns = self.unknowns[: self.nodes.starts.size - 1]
        interior = np.setdiff1d(np.arange(diagonal.size), unknowns)
        row = np.concatenate((interior, np.repeat(unknowns, np.diff(nodes.starts))))
        column = np.concatenate((interior, unknowns[nodes.columns]))
        values = np.concatenate((1.0 / diagonal[interior], np.zeros(nodes.columns.size)))
        rows = sp.csr_array((values, (row, column)), shape=(diagonal.size,) * 2)
        csr = (
            rows.indptr.astype(PETSc.IntType),
            (first + rows.indices).astype(PETSc.IntType),
            rows.data,
        )
        sizes = self.diagonal.getSizes()
        return row_by_row(PETSc.Mat().createAIJ((sizes, sizes), csr=csr, comm=self._comm))


class ContactPreconditioner:
    """The preconditioner F, V-cycle, F for a tangent of contact, as a context of PETSc's ``python``
    type.

    Args:
        levels: the levels of the system.
        fixed: the prescribed unknowns of this rank.
        symmetric: whether the tangent is symmetric.
    """

    def __init__(self, levels: ContactLevels, fixed: Flags, *, symmetric: bool) -> None:
        self._levels = levels
        self._fixed = fixed
        self._symmetric = symmetric
        self._places = levels.places
        self._unknowns = levels.unknowns
        self._prescribed = levels.diagonal.getArray(readonly=True)[fixed]
        self._contact_rows: PETSc.Mat | None = None
        self._contact: PETSc.Mat | None = None
        self._reduced: PETSc.Mat | None = None
        self._solver = PETSc.PC().create(self._places.comm)  # solves for the contact unknowns
        use_direct(self._solver, self._places.getSize(), symmetric=symmetric)
        # A V-cycle with Chebyshev's iteration on each level, Jacobi inside.
        hierarchy = levels.hierarchy
        truncated = levels.truncated
        depth = len(hierarchy.interpolations)
        cycle = PETSc.PC().create(self._places.comm)
        cycle.setOptionsPrefix(petsc_options.PREFIX)
        cycle.setType(PETSc.PC.Type.MG)
        cycle.setMGLevels(depth + 1)
        for level, interpolation in enumerate(
            (truncated.interpolation, *hierarchy.interpolations[1:])
        ):
            cycle.setMGInterpolation(depth - level, interpolation)
        self._smoothers = [cycle.getMGSmoother(level) for level in range(depth - 1, 0, -1)]
        self._smoothers.append(cycle.getMGCoarseSolve())
        coarsest = hierarchy.coarse[-1].getSize()[0]
        if coarsest > _FEW:
            use_direct(self._smoothers[-1].getPC(), coarsest, symmetric=symmetric)
        for smoother in self._smoothers[:-1]:
            smoother.getPC().setType(PETSc.PC.Type.JACOBI)
        for smoother, matrix in zip(self._smoothers, truncated.coarse, strict=True):
            smoother.setOperators(matrix)
        # On the finest level D^-1 is a matrix of its own, zero where contact holds; no option may
        # change that.
        finest = cycle.getMGSmoother(depth)
        finest.setOptionsPrefix(f"{petsc_options.PREFIX}mg_finest_")
        finest.setType(PETSc.KSP.Type.CHEBYSHEV)
        finest.getPC().setType(PETSc.PC.Type.MAT)
        low = ctypes.c_double(0.1 * hierarchy.largest)  # the part of the spectrum that PETSc damps
        high = ctypes.c_double(1.1 * hierarchy.largest)
        call("KSPChebyshevSetEigenvalues", finest, high, low)
        self._finest = finest
        self._cycle = cycle

    @called_back
    def setUp(self, pc: PETSc.PC) -> None:
        """Factorise a new tangent at the contact unknowns, and truncate the levels if the held
        directions have changed; collective.
        """
        tangent = pc.getOperators()[0]
        self._contact_rows = tangent.createSubMatrix(self._places, None, self._contact_rows)
        self._contact = tangent.createSubMatrix(self._places, self._places, self._contact)
        if self._symmetric:
            self._contact.setOption(PETSc.Mat.Option.SPD, True)
        self._solver.setOperators(self._contact)
        self._solver.setUp()
        self._right, self._product = self._contact.createVecs()
        self._residual = tangent.createVecLeft()
        if (lift := self._levels.lift) is not None:
            self._reduced = self._contact.ptap(lift, result=self._reduced)
        self._held = self._levels.nodes.split(self._contact, self._contact_rows)
        self._truncate()
        self._finest.setOperators(tangent, self._levels.inverse)
        self._cycle.setOperators(tangent)
        self._cycle.setUp()

    def _truncate(self) -> None:
        """Truncate the levels for this tangent; collective."""
        self._levels.truncate(*self._held, self._reduced)
        self._times = self._levels.times

    def solve_contact(self, right: PETSc.Vec, x: PETSc.Vec) -> None:
        """Set x to F b, zero elsewhere, with which a solve starts; collective."""
        if self._times != self._levels.times:  # for another tangent
            self._truncate()
            for smoother in self._smoothers:
                smoother.setUp()
        self._right.getArray()[:] = right.getArray(readonly=True)[self._unknowns]
        self._solver.apply(self._right, self._product)
        x.set(0.0)
        x.getArray()[self._unknowns] = self._product.getArray(readonly=True)

    @called_back
    def apply(self, pc: PETSc.PC, right: PETSc.Vec, x: PETSc.Vec) -> None:
        """Apply F, a V-cycle, and F.

        For an unsymmetric tangent the first F uses the rows in place of the columns.  This does not
        matter, as the right-hand sides of a Krylov method that starts with F are zero at the
        contact unknowns.
        """
        assert self._contact_rows is not None
        unknowns = self._unknowns
        self._right.getArray()[:] = right.getArray(readonly=True)[unknowns]
        self._solver.apply(self._right, self._product)
        self._contact_rows.multTranspose(self._product, self._residual)
        self._residual.aypx(-1.0, right)
        self._cycle.apply(self._residual, x)
        # Prescribed unknowns are solved exactly: any correction by the coarse levels would be a
        # motion there.
        x.getArray()[self._fixed] = right.getArray(readonly=True)[self._fixed] / self._prescribed
        self._contact_rows.mult(x, self._product)
        self._right.getArray()[:] = right.getArray(readonly=True)[
            unknowns
        ] - self._product.getArray(readonly=True)
        self._solver.apply(self._right, self._product)
        x.getArray()[unknowns] += self._product.getArray(readonly=True)
