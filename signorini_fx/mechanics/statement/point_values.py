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
    """The points without those at the place of another one, which must have its value."""
    places = same_places(points)
    first = np.unique(places, return_index=True)[1]
    at_place = values[first][places]
    unequal = np.abs(values - at_place) > DIGITS_OF_FILES * np.abs(values).max(initial=0.0)
    if unequal.any():
        row = int(np.argmax(unequal))
        place = ", ".join(f"{c:g}" for c in points[row])
        both = f"{at_place[row]:g} and {values[row]:g}"
        message = f"has several values at one place, {both} at ({place}): give each body a file of its own, with region"
        raise _wrong(file, message)
    return points[first], values[first]


def same_places(points: Array) -> npt.NDArray[np.int64]:
    """The number of the place of each of n points of shape (n, d), from 0, in the order of the points."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    near = ROOT_OF_EPS * float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
    first, second = cKDTree(points).query_pairs(near, output_type="ndarray").reshape(-1, 2).T
    links = coo_array((np.ones(len(first), dtype=bool), (first, second)), shape=(len(points), len(points)))
    return connected_components(links, directed=False)[1].astype(np.int64)


def _wrong(file: Path, message: str) -> SceneError:
    return SceneError([("temperature.file", f"{file}: it {message}")])
