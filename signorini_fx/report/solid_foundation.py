"""The foundation of a body in space, where it is and where it is drawn."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from signorini_fx.report import view
from signorini_fx.report.rendering import fans, normals_of
from signorini_fx.report.style import MUTED, Floats

Rows = npt.NDArray[np.int64]

GROUND = "#e3e3e3"
_BENT = math.cos(math.radians(30.0))  # a foundation whose direction the magnified gap turns further is another one
_AWAY = 0.5  # of the diagonal of the body: a gap that is magnified to more leaves the picture


@dataclass(frozen=True)
class FoundationSurface:
    """A contact boundary in space and what it may touch.

    Attributes:
        nodes: positions of the contact nodes, length, shape (k, 3).
        normals: towards the foundation, shape (k, 3).
        gap: d from each node along its normal to the foundation, length, shape (k,).
        facets: nodes of each facet of the boundary, in order along its perimeter, shape (m, 3) or (m, 4).
    """

    nodes: Floats
    normals: Floats
    gap: Floats
    facets: Rows

    def drawn(self, factor: float) -> Floats:
        """The foundation at the nodes with the gap times a factor, shape (k, 3)."""
        return np.asarray(self.nodes + factor * self.gap[:, None] * self.normals)

    def facing(self, seen: view.View, factor: float) -> Floats:
        """Triangles that show the viewer the side that the body is on, counterclockwise, shape (t, 3, 3)."""
        triangles = fans(self.facets)
        corners = self.drawn(factor)[triangles]
        upward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        inwards = np.einsum("ij,ij->i", upward, self.normals[triangles].sum(axis=1)) > 0
        corners[inwards], upward[inwards] = corners[inwards][:, ::-1], -upward[inwards]
        return np.asarray(corners[upward @ seen.toward > 0])

    def looks_like_itself(self, factor: float, size: float) -> bool:
        """Whether it keeps its shape where its gap is magnified.

        Args:
            factor: of the gap.
            size: of the body, length.
        """
        if not (factor - 1) * float(np.abs(self.gap).max(initial=0.0)) <= _AWAY * size:
            return False
        real, drawn = (normals_of(self.drawn(scale), self.facets) for scale in (1.0, factor))
        along = np.einsum("ij,ij->i", real, drawn)
        return bool((along >= _BENT * np.linalg.norm(real, axis=1) * np.linalg.norm(drawn, axis=1)).all())


def plane_of(points: Floats) -> tuple[Floats, Floats] | None:
    """Corners of a rectangle around points that lie in a plane, shape (4, 3), and its normal, shape (3,)."""
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
    margin = 0.12 * float(max(high - low))
    (left, bottom), (right, top) = low - margin, high + margin
    height = float(middle @ seen.toward)
    corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
    return np.array([r * seen.right + u * seen.up + height * seen.toward for r, u in corners]), seen.toward


def draw_plane(axes: Axes, corners: Floats, *, in_front: bool) -> None:
    """A foundation with corners in the picture of shape (4, 2): gray, or a dashed frame in front of the body."""
    face = "none" if in_front else GROUND
    dashes = (0, (6, 3)) if in_front else "solid"
    plane = PolyCollection([corners], facecolors=face, edgecolors=MUTED, linewidths=0.6, linestyles=[dashes])
    plane.set_zorder(4 if in_front else 1)
    axes.add_collection(plane, autolim=False)
