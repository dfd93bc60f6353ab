"""Values at points from a table, interpolated between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.errors import SceneError
from signorini_fx.tuned import DIGITS_OF_FILES, OUTSIDE_HULL, ROOT_OF_EPS, SAME_LENGTH

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PointValues:
    """A function of the position from a .csv with the columns x, y, in 3D z, and change; linear between the points,
    whose triangulation is that of Delaunay.

    Attributes:
        file: the table.
    """

    file: Path

    def __call__(self, x: Array) -> Array:
        """Values at points of shape (3, n), shape (n,).

        Raises:
            SceneError: the file cannot be read, or a point is outside of the hull of those of the file.
        """
        changed = self.file.stat().st_mtime_ns if self.file.is_file() else 0
        middle, function = _table(self.file, changed)
        at = x[: middle.size].T
        values = np.asarray(function(at), dtype=np.float64)
        for share in (SAME_LENGTH, OUTSIDE_HULL):
            outside = np.isnan(values)
            values[outside] = function(middle + (1 - share) * (at[outside] - middle))
        if np.isnan(values).any():
            point = ", ".join(f"{c:g}" for c in at[np.argmax(np.isnan(values))])
            raise _wrong(self.file, f"has no points around ({point}) of the body; check its unit of lengths")
        return values


@lru_cache(maxsize=8)
def _table(file: Path, _changed: int) -> tuple[Array, Any]:
    """The middle of the points, shape (d,), and the interpolation."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError

    points, values = _distinct(file, *_rows(file))
    try:
        function = LinearNDInterpolator(points, values)
    except (QhullError, ValueError):
        raise _wrong(file, "has points that span no area, in 3D no volume") from None
    return points.mean(axis=0), function


def _rows(file: Path) -> tuple[Array, Array]:
    """The points of a table and the values at them, shapes (n, d) and (n,)."""
    if file.suffix.lower() != ".csv":
        raise _wrong(file, "is no .csv: write the nodes and their values to one")
    try:
        table = np.atleast_1d(np.genfromtxt(file, delimiter=",", names=True, encoding="utf-8-sig"))
    except (OSError, ValueError, IndexError, StopIteration) as error:
        raise _wrong(file, f"cannot be read: {error}") from None
    names = table.dtype.names or ()
    axes = [name for name in "xyz" if name in names]
    if axes not in (["x", "y"], ["x", "y", "z"]) or "change" not in names:
        raise _wrong(file, f"has the columns {', '.join(names)}; it needs x, y, in 3D z, and change")
    points, values = np.column_stack([table[name] for name in axes]), np.asarray(table["change"], dtype=np.float64)
    if not (np.isfinite(points).all() and np.isfinite(values).all()):
        raise _wrong(file, "has an entry that is not one number, or not a finite one")
    return points, values


def _distinct(file: Path, points: Array, values: Array) -> tuple[Array, Array]:
    """The points without those at the place of an earlier one, which must have its value."""
    from scipy.spatial import cKDTree

    near = ROOT_OF_EPS * float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
    earlier, later = cKDTree(points).query_pairs(near, output_type="ndarray").reshape(-1, 2).T
    unequal = np.abs(values[earlier] - values[later]) > DIGITS_OF_FILES * np.abs(values).max(initial=0.0)
    if unequal.any():
        one, other = earlier[unequal][0], later[unequal][0]
        place = ", ".join(f"{c:g}" for c in points[other])
        both = f"{values[one]:g} and {values[other]:g}"
        message = f"has several values at one place, {both} at ({place}): give each body a file of its own, with region"
        raise _wrong(file, message)
    first = np.setdiff1d(np.arange(len(points)), later)
    return points[first], values[first]


def _wrong(file: Path, message: str) -> SceneError:
    return SceneError([("temperature.file", f"{file}: it {message}")])
