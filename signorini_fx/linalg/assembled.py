"""What the systems with all unknowns share: the stiffness as it was assembled, and its loads."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.contact.map import ContactMap
from signorini_fx.linalg.elasticity import Elasticity, LoadCase


@dataclass
class AssembledSystem:
    """See ``ElasticSystem``: x holds the unknowns of the stiffness themselves, on any number of ranks."""

    comm: MPI.Comm
    matrix: PETSc.Mat
    load: PETSc.Vec
    start: PETSc.Vec
    resultant: npt.NDArray[np.float64]
    fixed: npt.NDArray[np.bool_]
    contact: ContactMap
    elasticity: Elasticity
    cases: list[LoadCase]

    @property
    def definite(self) -> bool:
        """Whether A is positive semi-definite."""
        return self.elasticity.definite

    @classmethod
    def of(cls, elasticity: Elasticity) -> Self:
        """The system as it was assembled, with all load cases once."""
        e = elasticity
        load, start = e.matrix.createVecRight(), e.matrix.createVecRight()
        matrix = e.contact.admitted(e.matrix)
        if e.definite:
            matrix.setOption(PETSc.Mat.Option.SPD, True)
        system = cls(e.comm, matrix, load, start, np.zeros(e.free), e.fixed, e.contact, e, list(e.cases))
        system.set_load(np.ones(len(e.cases)))
        return system

    def factorise(self, ksp: PETSc.KSP, *, symmetric: bool) -> bool:
        """None: it is the default."""
        return False

    def set_load(self, factors: npt.NDArray[np.float64]) -> None:
        """The loads and prescribed displacements times their factors."""
        self.load.set(0.0)
        self.start.set(0.0)
        self.resultant = self.elasticity.resultant(self.cases, factors)
        for factor, case in zip(factors, self.cases, strict=True):
            self.load.axpy(factor, case.load)
            self.start.axpy(factor, case.start)

    def set_case(self, number: int, case: LoadCase) -> None:
        """Take another right-hand side."""
        self.cases[number] = case

    def with_load(self, load: PETSc.Vec) -> Self:
        """The same with this load alone."""
        other = copy(self)
        other.load = load.copy()
        return other

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """X itself."""
        return x

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """A copy."""
        return displacement.copy()
