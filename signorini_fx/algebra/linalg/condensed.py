"""The elastic system condensed onto the contact nodes: a small dense Schur complement.

The elastic operator never changes, and the nonlinearity is confined to the contact boundary.  So
the interior is eliminated once; all Newton steps of all outer iterations, load steps and values of
gamma use the dense matrix, and the interior is recovered at the end with the same factor.  The
interior matrix is regular for a floating body too.

The unknowns of contact points that are far from touching may be eliminated, too.  Such points keep
their displacements while the problem is solved; ``find_far_points`` computes how the solution moves
them, and the caller that has declared them far must check whether they touch there.

Several ranks eliminate their own unknowns, see ``schur``.  Each has the rows of the dense matrix
whose unknowns it owns, as contact points are on the rank of their unknowns; the dense computations
are so small that every rank does all of them.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.linalg import Elasticity, ElasticSystem, LoadCase
from signorini_fx.algebra.linalg.factorisation import factor_type
from signorini_fx.algebra.linalg.schur import SchurComplement
from signorini_fx.arrays import Array
from signorini_fx.machine import parallel


@dataclass
class CondensedSystem(ElasticSystem):
    """The condensed system; x holds the unknowns that B touches.

    Attributes:
        schur: the Schur complement.
        condensed: the load cases, see ``SchurComplement.condense``.
        factors: current factors of the load cases.
        recovered: x of this rank, and its displacement, of the last recovery; None: there is none.
    """

    schur: SchurComplement
    condensed: list[tuple[Array, Array]]
    factors: Array = field(init=False)
    recovered: tuple[Array, PETSc.Vec] | None = None  # x of this rank, and its displacement

    @classmethod
    def of(cls, elasticity: Elasticity) -> Self:
        """Eliminate the interior and condense every load case.

        Raises:
            PETSc.Error: PETSc has no MUMPS, or the factorisation broke down.
        """
        e = elasticity
        comm = elasticity.contact.points.comm
        first, last = e.matrix.getOwnershipRange()
        reaching = e.contact if e.far is None else e.contact.near(e.far.points, e.far.at)
        touched = np.unique(
            parallel.gather_rows(comm, np.unique(reaching.operator.getValuesCSR()[1]))
        )
        retained = touched[(first <= touched) & (touched < last)] - first
        schur = e.eliminated
        if schur is None or parallel.any_rank(comm, not np.array_equal(schur.retained, retained)):
            loads = [case.load.getArray(readonly=True) for case in e.cases]
            schur = SchurComplement(e.matrix, retained, loads, e.positions, definite=e.definite)
            condensed = list(zip(schur.loads, schur.between, strict=True))
        else:
            condensed = [schur.condense(case.load) for case in e.cases]
        before = parallel.rows_before(comm, retained.size)
        columns = np.ascontiguousarray(schur.dense[:, before : before + retained.size])
        sizes = (retained.size, None)
        matrix = PETSc.Mat().createDense((sizes, sizes), array=columns.T, comm=comm)
        matrix.assemble()
        # The condensed matrix is definite, even if the matrix of all unknowns is not.
        return cls(matrix, reaching.among(retained), e, list(e.cases), True, schur, condensed)

    def configure(self, ksp: PETSc.KSP, *, symmetric: bool) -> None:
        """Set a dense factorisation by LAPACK, on every rank."""
        ksp.setType(PETSc.KSP.Type.PREONLY)
        alone = self.comm.size == 1
        ksp.getPC().setType(factor_type(symmetric=symmetric) if alone else PETSc.PC.Type.REDUNDANT)

    def is_definite(self, matrix: PETSc.Mat) -> bool:
        try:
            np.linalg.cholesky(parallel.gather_rows(self.comm, matrix.getDenseArray()))
        except np.linalg.LinAlgError:
            return False
        return True

    def find_far_points(self, x: PETSc.Vec) -> None:
        """Compute the displacements of the far points for x by one back substitution."""
        far = self.elasticity.far
        elsewhere = self.contact.elsewhere
        if far is not None and elsewhere is not None:
            displacement = self.displacement(x)
            relative = np.column_stack(self.elasticity.contact.traces(displacement))
            elsewhere[far.points] = relative[far.points]
            self.recovered = np.array(x.getArray(readonly=True)), displacement

    @property
    def eliminated(self) -> SchurComplement:
        return self.schur

    def set_load(self, factors: Array) -> None:
        """Set the condensed loads and the prescribed displacements to those of the load cases times
        their factors.
        """
        self.factors = factors
        self.recovered = None
        self._set_resultant(factors)
        shape = (len(self.cases), self.contact.fixed.size)
        here = slice(*self.matrix.getOwnershipRange())
        starts = [case.start.getArray(readonly=True)[self.schur.retained] for case in self.cases]
        self.load.getArray()[:] = factors @ np.reshape(
            [load[here] for load, _ in self.condensed], shape
        )
        self.start.getArray()[:] = factors @ np.reshape(starts, shape)

    def set_case(self, number: int, case: LoadCase) -> None:
        """Replace or add a load case and condense it by one back substitution."""
        super().set_case(number, case)
        self.condensed[number : number + 1] = [self.schur.condense(case.load)]
        self.recovered = None

    def with_load(self, load: PETSc.Vec) -> Self:
        """Return the condensed system with another load only, by one back substitution."""
        system = copy(self)
        system.cases = [replace(self.cases[0], load=load)]
        system.condensed = [self.schur.condense(load)]
        system.factors = np.ones(1)
        system.load = self.load.duplicate()
        system.recovered = None
        system.load.getArray()[:] = system.condensed[0][0][slice(*self.matrix.getOwnershipRange())]
        return system

    def displacement(self, x: PETSc.Vec) -> PETSc.Vec:
        """Return all unknowns, with the interior recovered: x_i = A_ii^-1 (b_i - A_ic x_c)."""
        values = np.asarray(x.getArray(readonly=True))
        if self.recovered is not None and np.array_equal(values, self.recovered[0]):
            return self.recovered[1].copy()
        load = self.schur.matrix.createVecRight()
        load.set(0.0)
        for factor, case in zip(self.factors, self.cases, strict=True):
            load.axpy(factor, case.load)
        return self.schur.recover(
            load, self.factors @ [between for _, between in self.condensed], values
        )

    def unknowns(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """Return the entries of all unknowns that contact touches."""
        x = self.load.duplicate()
        x.getArray()[:] = displacement.getArray(readonly=True)[self.schur.retained]
        return x
