"""The body with its result as plain arrays, from which its pictures are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signorini_fx.pictures.tiling import Tiling

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]


@dataclass(frozen=True)
class DrawnBody:
    """The cells of a body in the plane, or the outer facets of one in space.

    Attributes:
        points: positions, length, shape (n, d); in the plane each cell has its own.
        within: points of each cell or facet, shape (m, p): those of ``tiles``, of facets counterclockwise as seen from
            outside.
        tiles: how a cell or facet is divided: its corners, more points along sides that may be curved, and some within.
        displacement: at the points, length, shape (n, d).
        values: fields at the midpoint of each cell, or of the cell behind each facet, shape (m,), a stress (m, 3, 3);
            or, if ``recovered``, at the points of each cell or facet, shape (m, p) or (m, p, 3, 3): those of two
            materials may have different values at the points that they share.
        recovered: whether the values are at points, the stress recovered.
        outline: in the plane pairs of points along the boundary of the body, shape (e, 2).
        pieces: in space the connected piece that each point is of, shape (n,); None: there is one.
    """

    points: Floats
    within: Rows
    tiles: Tiling
    displacement: Floats
    values: Mapping[str, Floats]
    recovered: bool
    outline: Rows | None = None
    pieces: Rows | None = None

    @property
    def perimeters(self) -> Rows:
        """The points along the perimeter of each cell or facet, in order, shape (m, k)."""
        return self.within[:, : self.tiles.rim]

    @property
    def polygons(self) -> Rows:
        """The points of each cell or facet that have values, along its perimeter if there is one value only."""
        return self.within if self.recovered else self.perimeters

    @property
    def divided(self) -> Tiling | None:
        """How each cell or facet is divided; None: it has one value."""
        return self.tiles if self.recovered else None

    def stress_in_the_middle(self) -> Floats:
        """The stress at the midpoint of each cell or facet, shape (m, 3, 3)."""
        stress = self.values["stress"]
        return np.asarray(stress[:, self.tiles.vertices].mean(axis=1)) if self.recovered else stress


@dataclass(frozen=True)
class Volume:
    """The cells of a body in space, for a section.

    Attributes:
        points: positions, length, shape (n, 3); where the field jumps there is one for each value.
        displacement: at the points, length, shape (n, 3).
        values: von Mises stress at the points, shape (n,).
        cells: points of each cell in the order of VTK, shape (m, 4) for tetrahedra, (m, 8) for hexahedra.
    """

    points: Floats
    displacement: Floats
    values: Floats
    cells: Rows


@dataclass(frozen=True)
class Moment:
    """The body at a load step.

    Attributes:
        name: of the load step.
        displacement: at the points, length, shape (n, d).
        values: von Mises stress of each cell, in space of each facet, shape (m,); or at its points, shape (m, p).
        touching: the contact nodes that touch, shape (k,); None: without contact.
    """

    name: str
    displacement: Floats
    values: Floats
    touching: npt.NDArray[np.bool_] | None = None
