"""The quadrature on the overlap of both sides: triples of a slave point, the master point over it, and an area."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI

from signorini_fx.machine import parallel
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.tuned import SAME_LENGTH

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Overlap:
    """Pieces of the overlap, p of them, each on one facet of either side, with q points each.

    Attributes:
        slave, master: numbers of the facets, shape (p,).
        at: the points in the reference facet of the slave, shape (p, q, d - 1).
        over: those in the reference facet of the master, shape (p, q, d - 1).
        weight: area (in 2D: length) of the slave side that a point stands for, times its measure, shape (p, q).
    """

    slave: Indices
    master: Indices
    at: Array
    over: Array
    weight: Array

    def distance(self, slave: PairSurface, master: PairSurface) -> Array:
        """From each slave point to the master point over it, length, shape (p, q, d)."""
        return master.positions(self.master, self.over) - slave.positions(self.slave, self.at)

    def measured(self, slave: PairSurface) -> Overlap:
        """With areas times the measure of the slave."""
        return replace(self, weight=slave.measured(self.slave, self.at, self.weight))

    def within(self, reach: float, slave: PairSurface, master: PairSurface) -> Overlap:
        """The pieces of the pairs of facets whose mean distance, of all pieces, is at most ``reach``, length."""
        _, pair = np.unique(self.slave * len(master.nodes) + self.master, return_inverse=True)
        moment = np.einsum("pq,pqd->pd", self.weight, self.distance(slave, master))
        mean = np.stack([np.bincount(pair, column) for column in moment.T], axis=1)
        near = np.linalg.norm(mean, axis=1) <= (1.0 + SAME_LENGTH) * reach * np.bincount(pair, self.weight.sum(axis=1))
        return self.chosen(near[pair])

    def chosen(self, pieces: npt.NDArray[np.bool_]) -> Overlap:
        """Some of the pieces, shape (p,)."""
        return Overlap(self.slave[pieces], self.master[pieces], self.at[pieces], self.over[pieces], self.weight[pieces])


def over_ranks(comm: MPI.Comm, matrix: sp.csr_array) -> sp.csr_array:
    """The sum of the matrices of all ranks, on every rank."""
    if comm.size == 1:
        return matrix
    part = matrix.tocoo()
    at = parallel.gather_rows(comm, np.column_stack((part.row, part.col)))
    return sp.csr_array((parallel.gather_rows(comm, part.data), tuple(at.T)), shape=matrix.shape)
