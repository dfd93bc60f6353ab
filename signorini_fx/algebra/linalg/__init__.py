"""Linear algebra: interchangeable kinds of elastic systems with one base.

This package knows matrices, factorisations and PETSc's options.  It must not know forms, active
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

# How the entries of a matrix that is added lie beside those of the sum.
DIFFERENT_PATTERN = PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN
SUBSET_PATTERN = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
SAME_PATTERN = PETSc.Mat.Structure.SAME_NONZERO_PATTERN


@dataclass(frozen=True)
class LoadCase:
    """Loads and prescribed displacements that change by a common factor.

    Attributes:
        load: b minus what the prescribed displacements contribute; in their rows their value times
            the diagonal entry.
        start: the prescribed displacements; elsewhere anything, such as the rigid motion nearest to
            them.
        resultant: work of the loads on the free rigid motions; what strains cause does no work on
            them.
    """

    load: PETSc.Vec
    start: PETSc.Vec
    resultant: RigidLoad


class Level(Protocol):
    """The unknowns of an elastic system on one mesh, and on a coarser one: a level of multigrid."""

    @property
    def coarser(self) -> Level | None:
        """The next coarser level, or None if there is none."""

    @property
    def block(self) -> int:
        """Unknowns per node."""

    @property
    def interpolation(self) -> PETSc.Mat | None:
        """Return the matrix from the unknowns on the coarser level, without prescribed ones; None
        if there is no coarser level.
        """

    @property
    def positions(self) -> Array:
        """Return the positions of the unknowns of this rank, shape (n, 3)."""

    @property
    def stiffness(self) -> PETSc.Mat | None:
        """The matrix on this mesh, or None if it has other unknowns as well."""

    def modes(self) -> PETSc.NullSpace:
        """Rigid motions, orthonormal: what multigrid must not forget on its coarse levels."""


@dataclass(frozen=True)
class FarPoints:
    """Contact points of the one rank that are not expected to touch, shape (n,), and unknowns that
    tell where they are, as long as no others are known.
    """

    points: Flags
    at: PETSc.Vec


@dataclass(frozen=True)
class Elasticity:
    """An elastic body without contact, and where contact is.

    Attributes:
        matrix: A, symmetric; prescribed rows and columns are empty but for the diagonal.
        contact: B, from the unknowns to the relative displacement at the contact points.
        free: number of rigid motions that are free.
        level: for multigrid; None: it has smoothed aggregation alone, with the near null space of
            the matrix.
        definite: whether the matrix is positive semi-definite; with a pressure it is symmetric and
            indefinite, whose Schur complement on the unknowns of contact is positive semi-definite.
        rigid: how many unknowns of this rank are motions of rigid bodies, the last ones of the last
            rank.
        symmetric: whether the matrix is; else it is not definite, and only a full system takes it.
        far: points that a condensed system need not reach; None: there are none.
        eliminated: what an earlier condensed system has made of the same matrix; None: there is
            none.
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
        """Return the positions of the displacements of this rank, its first unknowns; None:
        unknown.
        """
        return None if self.level is None else self.level.positions


@dataclass
class ElasticSystem:
    """A x = b for the elastic body without contact, and the contact map in its unknowns: all those
    of the stiffness, and a factorisation by a package on any number of ranks, unless another kind
    says something else.

    Attributes:
        matrix: A, symmetric; the contact iteration adds B^T D B to it.
        contact: B, from x to the relative displacement at the contact points, and which entries of
            x are prescribed.
        definite: whether A is positive semi-definite.
        load: b, the load cases times their current factors.
        start: a vector x that satisfies the prescribed displacements times the same factors,
            elsewhere the rigid motion that is nearest to them.
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
        """Return the system of an elasticity, with all load cases once."""
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
        """Return the Schur complement of the stiffness that other contact points can use; None:
        nothing.
        """
        return None

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """Set the default linear solver for A plus contact blocks, symmetric or not; options of the
        user are applied later.  ``ksp`` has its operators already, so far A alone.
        """
        use_factorisation(
            ksp, symmetric=symmetric and self.elasticity.symmetric, definite=self.definite
        )

    def factorise(self, ksp: PETSc.KSP, *, symmetric: bool) -> bool:
        """Make a factorisation of another linear solver with the same operators as that of
        ``configure``, which has failed; whether there is one: not if the default, or the choice of
        the user, is a factorisation or another solver already, or if the memory is too small;
        collective.
        """
        return False

    def keep_factor(
        self, ksp: PETSc.KSP, unchanged: bool, forces: float, *, exact: bool = False
    ) -> bool:
        """Decide whether the last factorisation is that of the new matrix too, which is the same if
        ``unchanged``, and set the solver accordingly.

        ``forces``: size of the acting ones, which the tolerance of a solve is relative to.
        ``exact``: whether it must have full accuracy.
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
        """Make ``load`` and ``start`` those of the load cases times their factors, one for each."""
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
        """Replace a load case from the next ``set_load`` on, or add one; nothing is factorised
        again.
        """
        self.cases[number : number + 1] = [case]

    def with_load(self, load: PETSc.Vec) -> Self:
        """Return the same matrix with a load of all unknowns of the stiffness alone."""
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
    """Return the sparse matrix itself, multiplied row by row: PETSc's products for several rows
    with the same pattern, such as those of a node, take more time than they save.
    """
    matrix.setOption(PETSc.Mat.Option.USE_INODES, False)
    return matrix
