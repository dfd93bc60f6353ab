"""The quadrature on the overlap of both sides: triples of a slave point, the master point over it, and an area."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signorini_fx.pairs.surface import Surface

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Overlap:
    """Pieces of the overlap, p of them, each on one facet of either side, with q points each.

    Attributes:
        slave, master: numbers of the facets, shape (p,).
        at: the points in the reference facet of the slave, shape (p, q, d - 1).
        over: those in the reference facet of the master, shape (p, q, d - 1).
        weight: area (in the plane: length) of the slave side that a point stands for, shape (p, q).
    """

    slave: Indices
    master: Indices
    at: Array
    over: Array
    weight: Array

    def distance(self, slave: Surface, master: Surface) -> Array:
        """From each slave point to the master point over it, length, shape (p, q, d)."""
        return master.positions(self.master, self.over) - slave.positions(self.slave, self.at)
