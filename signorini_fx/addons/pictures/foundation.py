"""The foundation of a body in 3D, where it is and where it is drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.pictures import view
from signorini_fx.addons.pictures.deformed_body import keeps_shape
from signorini_fx.addons.pictures.style import Floats
from signorini_fx.addons.pictures.view import normals_of
from signorini_fx.tuned import SURFACE_MARGIN

Rows = npt.NDArray[np.int64]


@dataclass(frozen=True)
class FoundationSurface:
    """A contact boundary in 3D and what it may touch."""

    nodes: Floats  # positions of the contact nodes, length, shape (k, 3)
    normals: Floats  # towards the foundation, shape (k, 3)
    gap: Floats  # d from each node along its normal to the foundation, length, shape (k,)
    facets: Rows  # nodes of each facet of the boundary, in order along its perimeter, shape (m, 3) or (m, 4)
    # points and polygons of the whole foundation near the body, counterclockwise as seen from there; None: only what is
    # opposite of the nodes is known
    surface: tuple[Floats, Rows] | None = None

    def drawn(self, factor: float) -> Floats:
        """The foundation at the nodes with the gap times a factor, shape (k, 3)."""
        return np.asarray(self.nodes + factor * self.gap[:, None] * self.normals)

    @property
    def is_plane(self) -> bool:
        """Whether what is opposite of the nodes lies in a plane."""
        return plane_of(self.drawn(1.0)) is not None

    def shape(self, factor: float) -> tuple[Floats, Rows]:
        """Points and polygons to draw, counterclockwise as seen from the body; of a plane a rectangle around it.

        The whole foundation is drawn where it is only, with a factor of 1.
        """
        points = self.drawn(factor)
        rectangle = plane_of(points)
        if rectangle is None and factor == 1 and self.surface is not None:
            return self.surface
        if rectangle is None:
            return points, self._towards_body(points)
        inwards = -self.normals.mean(axis=0)
        order = np.arange(4)[:: 1 if normals_of(rectangle, np.arange(4)[None])[0] @ inwards > 0 else -1]
        return rectangle, order[None].astype(np.int64)

    def _towards_body(self, points: Floats) -> Rows:
        """The facets in the order in which they face the body."""
        outwards = np.einsum("ij,ij->i", normals_of(points, self.facets), self.normals[self.facets].sum(axis=1)) > 0
        return np.where(outwards[:, None], self.facets[:, ::-1], self.facets)

    def looks_like_itself(self, factor: float, size: float) -> bool:
        """Whether it keeps its shape where its gap is times a factor; ``size``: of the body, length."""
        real, drawn = (normals_of(self.drawn(scale), self.facets) for scale in (1.0, factor))
        return keeps_shape((factor - 1) * float(np.abs(self.gap).max(initial=0.0)), size, real, drawn)


def plane_of(points: Floats) -> Floats | None:
    """Corners of a rectangle around points that lie in a plane, in order along its perimeter, shape (4, 3)."""
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 3:
        return None
    middle = points.mean(axis=0)
    _, size, axes = np.linalg.svd(points - middle, full_matrices=False)
    if size[2] > 1e-3 * size[1] or not size[1] > 0:
        return None
    seen = view.along(axes[2])
    if abs(seen.toward @ axes[2]) < 1 - 1e-6:  # next to a coordinate axis, and not along it
        seen = view.View(axes[0], axes[1], axes[2])
    flat = seen.flat(points)
    low, high = flat.min(axis=0), flat.max(axis=0)
    margin = SURFACE_MARGIN * float(max(high - low))
    (left_edge, bottom), (right_edge, top) = low - margin, high + margin
    height = float(middle @ seen.toward)
    corners = [(left_edge, bottom), (right_edge, bottom), (right_edge, top), (left_edge, top)]
    return np.array([r * seen.right + u * seen.up + height * seen.toward for r, u in corners])
