"""What the systems with all unknowns share: the stiffness as it was assembled, and its loads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.algebra.linalg import ElasticSystem, row_by_row
from signorini_fx.algebra.linalg.blocks import is_by_blocks
from signorini_fx.algebra.linalg.elasticity import Elasticity, LoadCase


@dataclass
class AssembledSystem(ElasticSystem):
    """See ``ElasticSystem``: x holds the unknowns of the stiffness themselves, on any number of ranks."""

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
