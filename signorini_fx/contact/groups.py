"""Which contact points are judged together: how much one body carries says nothing of when another one is settled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.contact.laws import Nodal
from signorini_fx.contact.points import ContactPoints

# What is below this share of the largest of all groups is round-off of the system that they are solved in together.
ROUND_OFF = 1e-8


@dataclass(frozen=True)
class PointGroups:
    """The contact points of this rank in groups that reach the same pieces of bodies, g groups; methods are collective.

    Attributes:
        points: the contact points, n of them.
        number: of the group of each point, shape (n,).
        pieces: which pieces each group reaches, shape (g, p); the same on every rank.
    """

    points: ContactPoints
    number: npt.NDArray[np.int64]
    pieces: npt.NDArray[np.bool_]

    @classmethod
    def of(cls, points: ContactPoints, reached: npt.NDArray[np.bool_]) -> PointGroups:
        """The groups of points whose relative displacements are those of the pieces ``reached``, shape (n, pieces)."""
        every = np.unique(parallel.gather_rows(points.comm, np.unique(reached, axis=0)), axis=0)
        if len(every) < 2:
            return cls(points, np.zeros(points.size, dtype=np.int64), np.ones((1, 1), dtype=bool))
        number = (reached[:, None] == every).all(axis=2).argmax(axis=1)
        return cls(points, number, every)

    def some(self, points: ContactPoints, rows: npt.NDArray[np.signedinteger[Any]]) -> PointGroups:
        """The same groups with ``points``, which are those in these rows."""
        return PointGroups(points, self.number[rows], self.pieces)

    @cached_property
    def count(self) -> int:
        """Number of groups, g."""
        return len(self.pieces)

    def norms(self, values: Nodal) -> Nodal:
        """The norms of ``ContactPoints.norm`` over each group, shape (g,)."""
        if self.count == 1:
            return np.array([self.points.norm(values)])
        columns = values[:, None] if values.ndim == 1 else values  # a rank may have no point
        squares = (self.points.weight[:, None] * columns**2).sum(axis=1)
        sums = parallel.sums_by(self.points.comm, self.number, squares[:, None], self.count)
        return np.asarray(np.sqrt(sums[:, 0]))

    def largest(self, values: Nodal) -> Nodal:
        """The largest of values that are not below zero, shape (n,), in each group, shape (g,)."""
        found, total = np.zeros(self.count), np.empty(self.count)
        np.maximum.at(found, self.number, values)
        self.points.comm.Allreduce(found, total, op=MPI.MAX)
        return total

    def scales(self, sizes: Nodal, *, lengths: bool = False) -> Nodal:
        """What each group is judged by, shape (g,), at least what is round-off of the largest of all sizes.

        The size of a piece is the largest of the groups that reach it.  Of two pieces the smaller one counts: the other
        one may be pressed elsewhere by forces that say nothing of this contact.  Lengths are relative ones of both, of
        which the larger one counts.
        """
        of_pieces = np.where(self.pieces, sizes[:, None], 0.0).max(axis=0)
        counting = np.where(self.pieces, of_pieces, 0.0 if lengths else np.inf)
        scales = counting.max(axis=1) if lengths else counting.min(axis=1)
        return np.asarray(np.maximum(scales, ROUND_OFF * sizes.max()))


def shares(parts: Nodal, wholes: Nodal, of_nothing: float | Nodal = 0.0) -> Nodal:
    """Parts over wholes, ``of_nothing`` where a whole is zero, shape (g,)."""
    found = np.array(np.broadcast_to(of_nothing, parts.shape), dtype=np.float64)
    return np.divide(parts, wholes, out=found, where=wholes > 0)
