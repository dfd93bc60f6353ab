"""Linear algebra: interchangeable kinds of elastic systems with one base class.

This package works with matrices, factorisations and PETSc's options only, without forms, active
sets or algorithms.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.contact.motions import RigidLoad, total_work
from signorini_fx.algebra.linalg.factorisation import use_factorisation, with_inertia
from signorini_fx.arrays import Array, Flags

if TYPE_CHECKING:
    from signorini_fx.algebra.linalg.schur import SchurComplement

# Pattern of an added matrix relative to that of the sum.
DIFFERENT_PATTERN = PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN
SUBSET_PATTERN = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
SAME_PATTERN = PETSc.Mat.Structure.SAME_NONZERO_PATTERN


@dataclass(frozen=True)
class LoadCase:
    """Loads and prescribed displacements that are scaled by a common factor.

    Attributes:
        load: b minus the contribution of the prescribed displacements; in their rows their value
            times the diagonal entry.
        start: the prescribed displacements; other entries are arbitrary, for example the rigid
            motion nearest to them.
        resultant: work of the loads on the free rigid motions; loads due to strains do no work on
            them.
    """

    load: PETSc.Vec
    start: PETSc.Vec
    resultant: RigidLoad


class Level(Protocol):
    """A level of multigrid: the unknowns of an elastic system on one mesh, with the next coarser
    level.
    """

    @property
    def coarser(self) -> Level | None:
        """The next coarser level, or None if there is none."""

    @property
    def block(self) -> int:
        """Unknowns per node."""

    @property
    def interpolation(self) -> PETSc.Mat | None:
        """The matrix from the unknowns on the coarser level, zero for prescribed ones; None if
        there is no coarser level.
        """

    @property
    def positions(self) -> Array:
        """Positions of the unknowns of this rank, shape (n, 3)."""

    @property
    def stiffness(self) -> PETSc.Mat | None:
        """The stiffness matrix on this mesh; None if the mesh has other unknowns as well."""

    def modes(self) -> PETSc.NullSpace:
        """Return the orthonormal rigid motions, which the coarse levels of multigrid must
        represent.
        """


@dataclass(frozen=True)
class FarPoints:
    """Contact points that are not expected to touch, on one rank.

    Attributes:
        points: the points, shape (n,).
        at: unknowns that determine their displacements until others are known.
    """

    points: Flags
    at: PETSc.Vec


@dataclass(frozen=True)
class Elasticity:
    """An elastic body without contact, and its contact map.

    Attributes:
        matrix: A, symmetric; prescribed rows and columns are empty except for the diagonal.
        cases: the load cases.
        contact: B, from the unknowns to the relative displacement at the contact points.
        free: number of free rigid motions.
        level: for multigrid; None: smoothed aggregation alone, with the near null space of the
            matrix.
        definite: whether the matrix is positive semi-definite.  With a pressure as unknown it is
            symmetric and indefinite, but its Schur complement on the unknowns of contact is
            positive semi-definite.
        rigid: number of unknowns of this rank that are motions of rigid bodies, the last ones of
            the last rank.
        symmetric: whether the matrix is symmetric; an unsymmetric one is not definite, and only a
            full system can use it.
        far: points that a condensed system need not contain; None: there are none.
        eliminated: the Schur complement of the same matrix from an earlier condensed system; None:
            there is none.
    """

    matrix: PETSc.Mat
    cases: Sequence[LoadCase]
    contact: ContactMap
    free: int = 0
    level: Level | None = None
    definite: bool = True
    rigid: int = 0
    symmetric: bool = True
    far: FarPoints | None = None
    eliminated: SchurComplement | None = None

    @property
    def positions(self) -> Array | None:
        """Positions of the displacements of this rank, its first unknowns; None if unknown."""
        return None if self.level is None else self.level.positions


@dataclass
class ElasticSystem:
    """A x = b for the elastic body without contact, with the contact map in its unknowns.

    This base class keeps all unknowns of the stiffness and factorises by a package on any number of
    ranks; other kinds of systems derive from it.

    Attributes:
        matrix: A, symmetric; the contact iteration adds B^T D B to it.
        contact: B, from x to the relative displacement at the contact points, and which entries of
            x are prescribed.
        elasticity: the body without contact.
        cases: the load cases.
        definite: whether A is positive semi-definite.
        load: b, the load cases times their current factors.
        start: a vector x with the prescribed displacements times the same factors; the other
            entries are the rigid motion nearest to them.
        resultant: the work of the current loads on the free rigid motions, the same on all ranks,
            shape (k,); zero for an assembly whose loads balance each other to round-off.
        inexact: whether the linear solver was last set to less than full accuracy, because the
            matrix was about to change.
    """

    matrix: PETSc.Mat
    contact: ContactMap
    elasticity: Elasticity
    cases: list[LoadCase]
    definite: bool

    inexact = False

    def __post_init__(self) -> None:
        self.load = self.matrix.createVecRight()
        self.start = self.matrix.createVecRight()
        self.set_load(np.ones(len(self.cases)))

    @classmethod
    def of(cls, elasticity: Elasticity) -> Self:
        """Return the system of an elasticity, with all load cases at factor one."""
        e = elasticity
        matrix = e.matrix if is_by_blocks(e.matrix) else row_by_row(e.contact.admitted(e.matrix))
        if e.definite:
            matrix.setOption(PETSc.Mat.Option.SPD, True)
        return cls(matrix, e.contact, e, list(e.cases), e.definite)

    @property
    def comm(self) -> MPI.Comm:
        """The ranks that share the system."""
        return self.contact.points.comm

    @property
    def eliminated(self) -> SchurComplement | None:
        """The Schur complement of the stiffness that other contact points can reuse; None: there is
        none.
        """
        return None

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """Set the default linear solver for A plus contact blocks; options of the user are applied
        later.

        Args:
            ksp: has its operators already, at this time A alone.
            symmetric: whether the contact blocks are symmetric.
        """
        use_factorisation(
            ksp, symmetric=symmetric and self.elasticity.symmetric, definite=self.definite
        )

    def factorise(self, ksp: PETSc.KSP, *, symmetric: bool) -> bool:
        """Set a factorisation for the same operators after the solver of ``configure`` has failed;
        return whether there is one.  Collective.

        There is none if the default or the user's choice is a factorisation or another solver, or
        if the memory is too small.

        Args:
            ksp: another linear solver with the same operators.
            symmetric: whether the matrix is symmetric.
        """
        return False

    def keep_factor(
        self, ksp: PETSc.KSP, unchanged: bool, forces: float, *, exact: bool = False
    ) -> bool:
        """Return whether the last factorisation is kept for the new matrix, and set the solver
        accordingly.

        Args:
            ksp: the linear solver.
            unchanged: whether the matrix is unchanged.
            forces: size of the acting forces, to which the tolerance of a solve is relative.
            exact: whether the solve must have full accuracy.
        """
        return unchanged

    def is_definite(self, matrix: PETSc.Mat) -> bool:
        """Return whether a symmetric matrix of the system has no negative eigenvalue;
        collective.
        """
        if is_by_blocks(matrix):
            return False
        factor, negative = with_inertia(matrix)
        factor.destroy()
        return negative == 0

    def set_load(self, factors: Array) -> None:
        """Set ``load`` and ``start`` to the sum of the load cases times their factors."""
        self.load.set(0.0)
        self.start.set(0.0)
        for factor, case in zip(factors, self.cases, strict=True):
            self.load.axpy(factor, case.load)
            self.start.axpy(factor, case.start)
        self._set_resultant(factors)

    def _set_resultant(self, factors: Array) -> None:
        resultants = (case.resultant for case in self.cases)
        self.resultant = total_work(
            list(zip(factors, resultants, strict=True)), self.elasticity.free
        )

    def set_case(self, number: int, case: LoadCase) -> None:
        """Replace or add a load case, effective from the next ``set_load``; nothing is factorised
        again.
        """
        self.cases[number : number + 1] = [case]

    def with_load(self, load: PETSc.Vec) -> Self:
        """Return the same system with this load in place of the load cases, given at all unknowns
        of the stiffness.
        """
        system = copy(self)
        system.load = load.copy()
        return system

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """Return all unknowns of the stiffness from x."""
        return x

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """Return a new x from all unknowns of the stiffness."""
        return displacement.copy()


def finite(values: PETSc.Mat | PETSc.Vec) -> bool:
    """Return whether all entries are finite; collective."""
    return bool(np.isfinite(values.norm(PETSc.NormType.NORM_INFINITY)))


def is_by_blocks(matrix: PETSc.Mat) -> bool:
    """Return whether the entries of a matrix are blocks."""
    return bool(matrix.getType() == PETSc.Mat.Type.PYTHON)


def row_by_row(matrix: PETSc.Mat) -> PETSc.Mat:
    """Return the sparse matrix itself, set to multiply row by row.

    PETSc's products for several rows with the same pattern, such as those of a node, take more time
    than they save.
    """
    matrix.setOption(PETSc.Mat.Option.USE_INODES, False)
    return matrix
