"""A program written by hand: stiffness assembled once in dolfinx, active sets in NumPy, refactorised by CHOLMOD.

Algorithm (SSN) and (FP) of the paper on all unknowns, with the usual optimisations: the contact terms are
diagonal (the bottom is straight), so that they are written into the diagonal of the stiffness; the symbolic
factorisation is kept; where no set has changed the factor is kept; FP starts from what it has.
"""

from __future__ import annotations

from dataclasses import dataclass

import example1
import linear
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from example1 import Answer, Floats
from petsc4py import PETSc

from signorini_fx.mechanics.mesh.tagged import TaggedMesh

# The fastest sequences of one symbolic and many numeric factorisations: CHOLMOD's own nested dissection, tried beside
# AMD where that takes little time.
_OPTIONS = {"mat_cholmod_default_nesdis": "1"}
_CHEAP, _BOTH = 300_000, {"mat_cholmod_nmethods": "3"}


Sets = tuple[npt.NDArray[np.bool_], npt.NDArray[np.int8]]


@dataclass
class _Iterate:
    """Traces, sets and multipliers at the bottom nodes."""

    u_n: Floats
    u_t: Floats
    sets: Sets
    pressure: Floats
    shear: Floats


class Rival:
    """Example 1, assembled.

    Args:
        tagged: the mesh in memory.
    """

    def __init__(self, tagged: TaggedMesh) -> None:
        self.body = body = linear.assemble(tagged, {"left": 0, "right": 0})
        bottom = tagged.facets("bottom")
        nodes = fem.locate_dofs_topological(body.space, 1, bottom)
        x = body.space.tabulate_dof_coordinates()[nodes, 0]
        order = np.argsort(x)
        nodes, self.x = nodes[order], x[order]
        edges = np.diff(self.x)
        self.weight = np.zeros_like(self.x)
        self.weight[:-1] += edges / 2
        self.weight[1:] += edges / 2
        # tau_N y = -y_2 and tau_T y = y_1; the corners cannot move sideways.
        self.normal, self.tangential = (2 * nodes + 1).astype(np.int32), (2 * nodes).astype(np.int32)
        self.movable = np.ones(self.x.size)
        self.movable[[0, -1]] = 0.0
        self.gap = example1.gap(self.x)
        self.matrix = body.matrix
        self.rows = np.concatenate((self.normal, self.tangential))
        self.elastic = self.matrix.getDiagonal().getArray()[self.rows]
        self.right, self.y = body.load.copy(), body.load.duplicate()
        self.options = _OPTIONS | (_BOTH if body.load.getSize() < _CHEAP else {})
        self.ksp = linear.direct_solver(self.matrix, "cholmod")
        self.factorised: Floats | None = None
        self.solves = 0

    def _step(self, sets: Sets, bound: Floats | None) -> _Iterate:
        """Step 4 with given sets."""
        (contact, slip), gamma, w = sets, example1.GAMMA, self.weight
        # A bound of zero transmits no shear: such a node neither sticks nor slips.
        stick = np.zeros_like(contact) if bound is None else (slip == 0) & (bound > 0)
        springs = np.concatenate((np.where(contact, gamma * w, 0.0), np.where(stick, gamma * w * self.movable, 0.0)))
        diagonal = self.elastic + springs
        if self.factorised is None or not np.array_equal(diagonal, self.factorised):
            columns = np.arange(self.rows.size + 1, dtype=PETSc.IntType)
            self.matrix.setValuesIJV(columns, self.rows, diagonal, rowmap=self.rows)
            self.matrix.assemble()
            self.matrix.setOption(PETSc.Mat.Option.SPD, True)
            self.factorised = diagonal
        self.body.load.copy(self.right)
        right = self.right.getArray()
        right[self.normal] -= np.where(contact, gamma * w * self.gap, 0.0)
        if bound is not None:
            right[self.tangential] -= w * slip * bound * self.movable
        with linear.petsc_options(self.options):
            self.ksp.solve(self.right, self.y)
        self.solves += 1
        y = self.y.getArray(readonly=True)
        u_n, u_t = -y[self.normal], y[self.tangential]
        pressure = np.where(contact, gamma * (u_n - self.gap), 0.0)
        shear = np.zeros_like(u_t) if bound is None else np.where(stick, gamma * u_t, slip * bound)
        return _Iterate(u_n, u_t, sets, pressure, shear)

    def next_sets(self, last: _Iterate, bound: Floats | None) -> Sets:
        """Step 2 with sigma infinite: a node passes through stick between the slip sets."""
        contact, slip = last.u_n > self.gap, last.sets[1]
        if bound is None:
            return contact, np.zeros_like(slip)
        elastic = example1.GAMMA * last.u_t
        sign = np.where(slip == 0, np.sign(elastic), slip)
        return contact, np.where((sign * elastic > bound) & (bound > 0), sign, 0).astype(np.int8)

    def ssn(self, sets: Sets, bound: Floats | None, limit: int = 100) -> _Iterate:
        """Algorithm (SSN)."""
        for _ in range(limit):
            last = self._step(sets, bound)
            sets = self.next_sets(last, bound)
            if all(np.array_equal(a, b) for a, b in zip(sets, last.sets, strict=True)):
                return last
        raise RuntimeError(f"the rival has no solution after {limit} solves")

    def everywhere(self) -> Sets:
        """Contact and stick at all nodes, with which section 7 starts."""
        return np.ones(self.x.size, dtype=bool), np.zeros(self.x.size, dtype=np.int8)

    def answer(self, last: _Iterate) -> Answer:
        """The answer in the common form."""
        contact, slip = last.sets
        return Answer(self.x, last.pressure, last.shear, contact, slip, self.solves)


def tresca(tagged: TaggedMesh) -> Answer:
    """Tresca friction by (SSN), contact and stick everywhere at the start."""
    rival = Rival(tagged)
    bound = np.full(rival.x.size, example1.BOUND)
    return rival.answer(rival.ssn(rival.everywhere(), bound))


def coulomb(tagged: TaggedMesh) -> Answer:
    """Coulomb friction by (FP), from the pure contact problem; each problem starts in the sets of the last iterate."""
    rival = Rival(tagged)
    last = rival.ssn(rival.everywhere(), None)
    sets, g = last.sets, last.pressure
    for _ in range(100):
        bound = example1.COEFFICIENT * g
        last = rival.ssn(sets, bound)
        change, g = last.pressure - g, last.pressure
        if np.sqrt(rival.weight @ change**2) <= example1.TOLERANCE * np.sqrt(rival.weight @ g**2):
            return rival.answer(last)
        sets = rival.next_sets(last, example1.COEFFICIENT * g)
    raise RuntimeError("the rival has no fixed point")
