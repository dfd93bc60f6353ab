"""The elastic system with all displacement dofs and a sparse factorisation, on any number of ranks."""

from __future__ import annotations

from dataclasses import dataclass

from petsc4py import PETSc

from signorini_fx.algebra.linalg.assembled import AssembledSystem
from signorini_fx.algebra.linalg.factorisation import FACTOR_DEFAULTS, use_factorisation


@dataclass
class FullSystem(AssembledSystem):
    """See ``ElasticSystem``: factorised by a package, on any number of ranks."""

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """A direct factorisation, Cholesky if the matrix is symmetric."""
        use_factorisation(ksp, symmetric=symmetric and self.elasticity.symmetric, definite=self.definite)

    @property
    def solver_defaults(self) -> dict[str, str]:
        """For MUMPS and CHOLMOD, which read their options when they factorise."""
        return FACTOR_DEFAULTS
