"""The elastic system with all unknowns as it was assembled: what the kinds share, and the one with a sparse factor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.algebra.linalg import ElasticSystem, row_by_row
from signorini_fx.algebra.linalg.blocks import is_by_blocks
from signorini_fx.algebra.linalg.elasticity import Elasticity, LoadCase
from signorini_fx.algebra.linalg.factorisation import FACTOR_DEFAULTS, use_factorisation


@dataclass
class AssembledSystem(ElasticSystem):
    """x holds the unknowns of the stiffness themselves, on any number of ranks."""

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
        matrix = e.matrix if is_by_blocks(e.matrix) else row_by_row(e.contact.admitted(e.matrix))
        if e.definite:
            matrix.setOption(PETSc.Mat.Option.SPD, True)
        system = cls(matrix, load, start, np.zeros(e.free), e.contact, e, list(e.cases))
        system.set_load(np.ones(len(e.cases)))
        return system

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


@dataclass
class FullSystem(AssembledSystem):
    """Factorised by a package, on any number of ranks."""

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """A direct factorisation, Cholesky if the matrix is symmetric."""
        use_factorisation(ksp, symmetric=symmetric and self.elasticity.symmetric, definite=self.definite)

    @property
    def solver_defaults(self) -> dict[str, str]:
        """For MUMPS and CHOLMOD, which read their options when they factorise."""
        return FACTOR_DEFAULTS
