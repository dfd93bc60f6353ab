"""A condensed elastic system with fewer contact nodes, by Galerkin projection: the other nodes are interpolated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.contact.points import ContactPoints
from signorini_fx.linalg import ElasticSystem
from signorini_fx.linalg.transformed import TransformedSystem


@dataclass
class CoarsenedSystem(TransformedSystem):
    """See ``ElasticSystem``: x = P x_c, A_c = P^T A P, b_c = P^T b; dense, one rank."""

    prolongation: Any
    retained: npt.NDArray[np.int64]

    @classmethod
    def of(
        cls,
        system: ElasticSystem,
        prolongation: Any,
        retained: npt.NDArray[np.int64],
        points: ContactPoints,
        rows: npt.NDArray[np.int64],
    ) -> CoarsenedSystem:
        """Coarsen a system with a dense matrix.

        Args:
            system: the finer one.
            prolongation: P, scipy sparse, shape (fine dofs, coarse dofs).
            retained: the fine dof that each coarse one is, shape (coarse dofs,).
            points: the contact points of the coarse system.
            rows: number of each of them among those of the finer one, shape (n,).
        """
        # A is symmetric, so that both are products of a sparse and a dense matrix.
        half = prolongation.T @ system.matrix.getDenseArray(readonly=True)
        dense = np.asfortranarray(prolongation.T @ half.T)
        matrix = PETSc.Mat().createDense(dense.shape, array=dense, comm=system.comm)
        matrix.assemble()
        load, start = matrix.createVecRight(), matrix.createVecRight()
        fixed = system.fixed[retained]
        contact = system.contact.among(retained, fixed, rows, points)
        coarse = cls(system.comm, matrix, load, start, fixed, contact, system, prolongation.tocsr(), retained)
        coarse._restrict()
        return coarse

    def _restrict(self) -> None:
        self.load.getArray()[:] = self.prolongation.T @ self.inner.load.getArray(readonly=True)
        self.start.getArray()[:] = self.inner.start.getArray(readonly=True)[self.retained]

    def set_load(self, factors: npt.NDArray[np.float64]) -> None:
        """As the finer system, restricted."""
        self.inner.set_load(factors)
        self._restrict()

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """That of the finer system at P x_c."""
        fine = self.inner.load.duplicate()
        fine.getArray()[:] = self.prolongation @ x.getArray(readonly=True)
        return self.inner.displacement(fine)

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """Those of the nodes that stay."""
        x = self.load.duplicate()
        x.getArray()[:] = self.inner.unknowns(displacement).getArray(readonly=True)[self.retained]
        return x
