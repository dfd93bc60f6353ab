"""What all elastic systems share: their matrix, the current load, and the contact map."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.linalg.elasticity import LoadCase


@dataclass
class PlainSystem:
    """See ``ElasticSystem``: x holds the unknowns of the matrix themselves, and there is one load, which stays."""

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

    def factorise(self, ksp: PETSc.KSP, *, symmetric: bool) -> bool:
        """None: it is the default."""
        return False

    def set_load(self, factors: npt.NDArray[np.float64]) -> None:
        """Nothing: the load stays as it is."""

    def set_case(self, number: int, case: LoadCase) -> None:
        """Nothing, likewise."""

    def with_load(self, load: PETSc.Vec) -> Self:
        """The same with this load alone."""
        system = copy(self)
        system.load = load.copy()
        return system

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """X itself."""
        return x

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """A copy."""
        return displacement.copy()
