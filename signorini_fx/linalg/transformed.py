"""An elastic system in other unknowns, x = T x~, which delegates to the inner system."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.contact.map import ContactMap
from signorini_fx.linalg import ElasticSystem
from signorini_fx.linalg.elasticity import LoadCase


@dataclass
class TransformedSystem:
    """See ``ElasticSystem``: A~ = T^T A T, b~ = T^T b; solved in the same way as the inner system.

    Attributes:
        inner: the system with A and b.
    """

    comm: MPI.Comm
    matrix: PETSc.Mat
    load: PETSc.Vec
    start: PETSc.Vec
    fixed: npt.NDArray[np.bool_]
    contact: ContactMap
    inner: ElasticSystem

    @property
    def resultant(self) -> npt.NDArray[np.float64]:
        """As the inner system: rigid motions do not depend on the unknowns."""
        return self.inner.resultant

    @property
    def solver_defaults(self) -> dict[str, str]:
        """As the inner system."""
        return self.inner.solver_defaults

    @property
    def inexact(self) -> bool:
        """As the inner system."""
        return self.inner.inexact

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool, turned: PETSc.Mat | None = None) -> None:
        """As the inner system."""
        self.inner.configure(ksp, symmetric=symmetric, turned=turned)

    def keep_factor(self, ksp: PETSc.KSP, moved: int | None, forces: float, *, exact: bool = False) -> bool:
        """As the inner system."""
        return self.inner.keep_factor(ksp, moved, forces, exact=exact)

    def set_case(self, number: int, case: LoadCase) -> None:
        """As the inner system."""
        self.inner.set_case(number, case)
