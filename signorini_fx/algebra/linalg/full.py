"""The elastic system with all displacement dofs and a sparse factorisation, on any number of ranks."""

from __future__ import annotations

from dataclasses import dataclass

from petsc4py import PETSc

from signorini_fx.algebra.linalg import petsc_options
from signorini_fx.algebra.linalg.assembled import AssembledSystem
from signorini_fx.algebra.linalg.factorisation import factor_defaults, use_factorisation
from signorini_fx.tuned import LAGGED_NODES, LAGGED_SHARE, LAGGED_STEPS


@dataclass
class FullSystem(AssembledSystem):
    """See ``ElasticSystem``: factorised by a package, on any number of ranks."""

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """A direct factorisation, Cholesky if the matrix is symmetric."""
        use_factorisation(ksp, symmetric=symmetric and self.elasticity.symmetric, definite=self.definite)

    @property
    def solver_defaults(self) -> dict[str, str]:
        """For MUMPS and CHOLMOD, which read their options when they factorise."""
        return factor_defaults(self.comm)

    def keep_factor(self, ksp: PETSc.KSP, moved: int | None, forces: float, *, exact: bool = False) -> bool:
        """For the same matrix, and as a preconditioner if only a few contact nodes have changed their state."""
        if petsc_options.user_sets("ksp_", "pc_"):
            return moved == 0
        lagging = self.definite and not exact  # of an indefinite matrix CG would break down
        retained = moved == 0 or (lagging and moved is not None and moved <= LAGGED_NODES)
        if retained and moved != 0:
            symmetric = ksp.getPC().getType() == PETSc.PC.Type.CHOLESKY  # one system serves methods of both kinds
            ksp.setType(PETSc.KSP.Type.CG if symmetric else PETSc.KSP.Type.GMRES)
            # The residual itself, relative to the forces: the preconditioned norm does not decide whether Newton ends.
            if not symmetric:
                ksp.setPCSide(PETSc.PC.Side.RIGHT)
            ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
            ksp.setTolerances(rtol=1e-15, atol=LAGGED_SHARE * forces, max_it=LAGGED_STEPS)
        else:
            ksp.setType(PETSc.KSP.Type.PREONLY)
            ksp.setNormType(PETSc.KSP.NormType.NONE)
        return retained
