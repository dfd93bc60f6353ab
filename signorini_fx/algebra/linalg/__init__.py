"""Linear algebra: interchangeable kinds of elastic systems with one base.

This package knows matrices, factorisations and PETSc's options.  It must not know forms, active sets or algorithms.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.linalg.elasticity import LoadCase

# How the entries of a matrix that is added lie beside those of the sum.
DIFFERENT_PATTERN = PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN
SUBSET_PATTERN = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
SAME_PATTERN = PETSc.Mat.Structure.SAME_NONZERO_PATTERN


@dataclass
class ElasticSystem(ABC):
    """A x = b for the elastic body without contact, and the contact map in its unknowns.

    Attributes:
        matrix: A, symmetric; the contact iteration adds B^T D B to it.
        load: b, the load cases times their current factors.
        start: a vector x that satisfies the prescribed displacements times the same factors, elsewhere the rigid motion
            that is nearest to them.
        resultant: the work of the current loads on the free rigid motions, the same on all ranks, shape (k,);
            zero for an assembly whose loads balance each other to round-off.
        contact: B, from x to the relative displacement at the contact points, and which entries of x are prescribed.
        inexact: whether the linear solver was last set to less than full accuracy, because the matrix was about to
            change.
    """

    matrix: PETSc.Mat
    load: PETSc.Vec
    start: PETSc.Vec
    resultant: npt.NDArray[np.float64]
    contact: ContactMap

    inexact = False

    @property
    def comm(self) -> MPI.Comm:
        """The ranks that share the system."""
        return self.contact.points.comm

    @property
    @abstractmethod
    def definite(self) -> bool:
        """Whether A is positive semi-definite."""

    @property
    def solver_defaults(self) -> dict[str, str]:
        """PETSc options (without prefix) that apply during the solve unless the user has set them."""
        return {}

    @abstractmethod
    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """Set the default linear solver for A plus contact blocks.

        The user's options are applied later and take precedence.

        Args:
            ksp: the linear solver; it has its operators already, so far A alone.
            symmetric: whether they will be.
        """

    def factorise(self, ksp: PETSc.KSP, *, symmetric: bool) -> bool:
        """Set a factorisation in place of the default solver, where that has failed; collective.

        Args:
            ksp: another linear solver than that of ``configure``, with the same operators.
            symmetric: whether they are.

        Returns:
            Whether there is one: not if the default, or the choice of the user, is a factorisation or another solver
            already, or if the memory is too small.
        """
        return False

    def keep_factor(self, ksp: PETSc.KSP, unchanged: bool, forces: float, *, exact: bool = False) -> bool:
        """Decide whether the last factorisation is that of the new matrix too, and set the solver accordingly.

        Args:
            ksp: the linear solver.
            unchanged: whether the matrix is the same as in that factorisation.
            forces: size of the acting forces, which the tolerance of a solve is relative to.
            exact: whether the solve must have full accuracy.
        """
        return unchanged

    @abstractmethod
    def set_load(self, factors: npt.NDArray[np.float64]) -> None:
        """Make ``load`` and ``start`` those of the load cases times their factors, one for each."""

    @abstractmethod
    def set_case(self, number: int, case: LoadCase) -> None:
        """Replace a load case from the next ``set_load`` on; nothing is factorised again."""

    def with_load(self, load: PETSc.Vec) -> Self:
        """The same matrix with this load of all unknowns of the stiffness alone."""
        system = copy(self)
        system.load = load.copy()
        return system

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """All unknowns of the stiffness from x."""
        return x

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """A new x from all unknowns of the stiffness."""
        return displacement.copy()


def finite(values: PETSc.Mat | PETSc.Vec) -> bool:
    """Whether all entries are finite; collective."""
    return bool(np.isfinite(values.norm(PETSc.NormType.NORM_INFINITY)))


def row_by_row(matrix: PETSc.Mat) -> PETSc.Mat:
    """The sparse matrix itself, multiplied row by row: PETSc's products for several rows with the same pattern, such as
    those of a node, take more time than they save.
    """
    matrix.setOption(PETSc.Mat.Option.USE_INODES, False)
    return matrix
