"""The body with its result as plain arrays, from which its pictures are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.pictures.tiling import Tiling
from signorini_fx.tuned import SAME_LENGTH

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]


def with_mirrored(vectors: Floats) -> Floats:
    """Vectors in 2D, shape (n, 2), and behind them those with the other sign of x[0]."""
    return np.concatenate((vectors, vectors * (-1.0, 1.0)))


def _mirrored(field: Floats) -> Floats:
    """Scalars as they are, and tensors with the other sign of what x[0] shears."""
    if field.shape[-2:] != (3, 3):
        return field
    signs = np.array([-1.0, 1.0, 1.0])
    return np.asarray(field * np.outer(signs, signs))


@dataclass(frozen=True)
class DrawnBody:
    """The cells of a body in 2D, or the outer facets of one in 3D.

    Attributes:
        points: positions, length, shape (n, d); in 2D each cell has its own.
        within: points of each cell or facet, shape (m, p): those of ``tiles``, of facets counterclockwise as seen from
            outside.
        tiles: how a cell or facet is divided: its corners, more points along sides that may be curved, and some within.
        displacement: at the points, length, shape (n, d).
        values: fields at the midpoint of each cell, or of the cell behind each facet, shape (m,), a stress (m, 3, 3);
            or, if ``recovered``, at the points of each cell or facet, shape (m, p) or (m, p, 3, 3): those of two
            materials may have different values at the points that they share.
        recovered: whether the values are at points, the stress recovered.
        outline: in 2D pairs of points along the boundary of the body, shape (e, 2).
        pieces: in 3D the connected piece that each point is of, shape (n,); None: there is one.
        parted: in 3D the largest gap that has closed between two bodies, length, see ``magnification``.
    """

    points: Floats
    within: Rows
    tiles: Tiling
    displacement: Floats
    values: Mapping[str, Floats]
    recovered: bool
    outline: Rows | None = None
    pieces: Rows | None = None
    parted: float = 0.0

    def with_mirror_image(self) -> DrawnBody:
        """The section of an axisymmetric body with that on the other side of the axis, which is x[0] = 0."""
        assert self.outline is not None
        values = {name: np.concatenate((field, _mirrored(field))) for name, field in self.values.items()}
        size = float(np.ptp(self.points, axis=0).max())
        on_axis = (np.abs(self.points[self.outline, 0]) <= SAME_LENGTH * size).all(axis=1)
        outline = self.outline[~on_axis]
        return replace(
            self,
            points=with_mirrored(self.points),
            within=np.concatenate((self.within, self.within + len(self.points))),
            displacement=with_mirrored(self.displacement),
            values=values,
            outline=np.concatenate((outline, outline + len(self.points))),
        )

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
    """The cells of a body in 3D, for a section.

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
