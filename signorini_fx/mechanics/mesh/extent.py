"""The diameter of a body, from the corners of convex hulls."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.distance import cdist

from signorini_fx.errors import MeshError

Array = npt.NDArray[np.float64]


def extremes(x: Array) -> Array:
    """The corners of the convex hull of points of one rank; all of them where they have none, as in a plane."""
    if len(x) <= x.shape[1] + 1:
        return x
    try:
        return x[ConvexHull((x - x.min(axis=0)) / np.ptp(x, axis=0).max()).vertices]
    except QhullError:
        return x


def diameter(x: Array) -> float:
    """Largest distance of two of the points of a body.

    Raises:
        MeshError: they lie in a plane, in two dimensions on a line.
    """
    low, high = x.min(axis=0), x.max(axis=0)
    try:
        corners = x[ConvexHull((x - low) / (high - low).max()).vertices]
    except QhullError:
        extents = " by ".join(f"{extent:g}" for extent in high - low)
        raise MeshError(f"the body is too thin to be meshed: it measures {extents}") from None
    return max(float(cdist(chunk, corners).max()) for chunk in np.array_split(corners, 1 + len(corners) // 1000))
