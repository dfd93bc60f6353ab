"""What an elastic system is made of: a stiffness matrix, load cases, prescribed unknowns, and the contact map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.contact.motions import RigidLoad, total_work

if TYPE_CHECKING:
    from signorini_fx.algebra.linalg.schur import SchurComplement


@dataclass(frozen=True)
class LoadCase:
    """Loads and prescribed displacements that change by a common factor.

    Attributes:
        load: b minus what the prescribed displacements contribute; in their rows their value times the diagonal entry.
        start: the prescribed displacements; elsewhere anything, such as the rigid motion nearest to them.
        resultant: work of the loads on the free rigid motions; what strains cause does no work on them.
    """

    load: PETSc.Vec
    start: PETSc.Vec
    resultant: RigidLoad


class Level(Protocol):
    """The unknowns of an elastic system on one mesh, and on a coarser one: a level of multigrid."""

    @property
    def coarser(self) -> Level | None:
        """The next coarser level; None: there is none."""

    @property
    def block(self) -> int:
        """Unknowns per node."""

    @property
    def interpolation(self) -> PETSc.Mat | None:
        """From the unknowns on the coarser level, prescribed ones left out; None: there is none."""

    @property
    def positions(self) -> npt.NDArray[np.float64]:
        """Of the unknowns of this rank, shape (n, 3)."""

    @property
    def stiffness(self) -> PETSc.Mat | None:
        """The matrix on this mesh; None: it has other unknowns as well."""

    def modes(self) -> PETSc.NullSpace:
        """Rigid motions, orthonormal: what multigrid must not forget on its coarse levels."""


@dataclass(frozen=True)
class FarPoints:
    """Contact points of the one rank that are not expected to touch.

    Attributes:
        points: which of them, shape (n,).
        at: unknowns that tell where they are, as long as no others are known.
    """

    points: npt.NDArray[np.bool_]
    at: PETSc.Vec


@dataclass(frozen=True)
class Elasticity:
    """An elastic body without contact, and where contact is.

    Attributes:
        matrix: A, symmetric; prescribed rows and columns are empty but for the diagonal.
        cases: the load cases.
        contact: B, from the unknowns to the relative displacement at the contact points.
        free: number of rigid motions that are free.
        level: for multigrid; None: it has smoothed aggregation alone, with the near null space of the matrix.
        definite: whether the matrix is positive semi-definite; with a pressure it is symmetric and indefinite, whose
            Schur complement on the unknowns of contact is positive semi-definite.
        rigid: how many unknowns of this rank are motions of rigid bodies, the last ones of the last rank.
        symmetric: whether the matrix is; else it is not definite, and only a full system takes it.
        far: points that a condensed system need not reach; None: there are none.
        eliminated: what an earlier condensed system has made of the same matrix; None: there is none.
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
    def comm(self) -> MPI.Comm:
        """The ranks that share the body."""
        return self.contact.points.comm

    @property
    def positions(self) -> npt.NDArray[np.float64] | None:
        """Of the displacements of this rank, its first unknowns; None: not known."""
        return None if self.level is None else self.level.positions

    def resultant(self, cases: Sequence[LoadCase], factors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """The work of load cases times their factors on the free rigid motions, shape (k,), see ``total_work``."""
        return total_work(list(zip(factors, (case.resultant for case in cases), strict=True)), self.free)
