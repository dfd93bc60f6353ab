"""The deformed body in space: its outer surface with the von Mises stress in colour."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from signorini_fx.report import view
from signorini_fx.report.deformed_body import magnification
from signorini_fx.report.fields import FIELDS, Field
from signorini_fx.report.style import (
    BOTH,
    INK,
    MUTED,
    STYLE,
    Floats,
    finish,
    math_number,
)
from signorini_fx.report.tones import Tones, draw_principal

Rows = npt.NDArray[np.int64]

MOST_FACETS = 40_000  # of a picture: matplotlib takes seconds for them
_GROUND = "#e3e3e3"
_SHADE = 0.25  # how much darker a facet parallel to the light is than one perpendicular to it
_SHARP = math.cos(math.radians(40.0))  # facets that turn by more than this meet in an edge
_VISIBLE_FACET = 4.0  # size from which on the edges of a facet are drawn, in 1/72 inch
_LARGEST = 4.8  # width and height of the body, inches


def deformed_solid(
    path_stem: str | Path,
    points: Floats,
    facets: Rows,
    displacement: Floats,
    values: Floats,
    *,
    field: Field = FIELDS["von_mises"],
    stress: Floats | None = None,
    foundations: Sequence[tuple[Floats, Floats]] = (),
    factor: float | None = None,
    top: float | None = None,
    frame: tuple[Floats, Floats] | None = None,
    title: str = "",
    suffixes: Sequence[str] = BOTH,
) -> None:
    """Draw the outer surface of a deformed body in space, seen from the front, the right and above.

    The colour is a field, slightly darker where the surface turns away from the light.  If a singular edge would
    leave the rest pale, the scale ends at the value that is not exceeded on 99 % of the visible area.  Thin
    lines on the body are its sharp edges, dashed ones those of the undeformed body.  A flat foundation is drawn as a
    gray plane if it is behind the body, otherwise as a frame.  The projection is parallel, without perspective.

    Args:
        path_stem: where to write, without suffix.
        points: positions, length, shape (n, 3).
        facets: their points along the perimeter, counterclockwise as seen from outside, shape (m, k); more than their
            corners if they are curved.
        displacement: at the points, length, shape (n, 3).
        values: the field at each facet, shape (m,).
        field: what it is.
        stress: tensors at the facets, shape (m, 3, 3): their principal stresses are drawn as strokes.
        foundations: of each contact boundary nodes and the vector d n from each to the foundation, lengths, both of
            shape (k, 3); like the displacement, d n is multiplied by the magnification.
        factor: of the displacement; None: one that makes it visible.
        top: the value where the colours end; None: see above.
        frame: lowest and highest coordinates of the projection that are seen; None: as far as body and planes reach.
        title: title of the picture.
        suffixes: of the files to write.

    Raises:
        ValueError: there are no facets.
    """
    with mpl.rc_context(STYLE):
        figure, factor = solid_figure(
            points, facets, displacement, values, foundations, field, stress, factor, top, frame
        )
        remark = f"displacement $\\times\\,{math_number(factor)}$"
        finish(figure, path_stem, f"{title}   ({remark})" if title else remark, suffixes)


def solid_figure(
    points: Floats,
    facets: Rows,
    displacement: Floats,
    values: Floats,
    foundations: Sequence[tuple[Floats, Floats]],
    field: Field = FIELDS["von_mises"],
    stress: Floats | None = None,
    factor: float | None = None,
    top: float | None = None,
    frame: tuple[Floats, Floats] | None = None,
) -> tuple[Figure, float]:
    """The figure that ``deformed_solid`` writes, and the magnification."""
    if not facets.size:
        raise ValueError("the body has no facets")
    factor = magnification(points, displacement) if factor is None else factor
    moved = points + factor * displacement
    moved = np.where(np.isfinite(moved), moved, points)  # a failed solve may give any values
    seen = view.oblique()
    planes = [plane for nodes, gap in foundations if (plane := _plane(nodes + factor * gap)) is not None]
    every = seen.flat(np.concatenate([points, moved, *(corners for corners, _ in planes)]))
    low, high = every.min(axis=0), every.max(axis=0)
    margin = 0.05 * float(max(high - low))
    low, high = (low - margin, high + margin) if frame is None else frame
    size = high - low
    inch = _LARGEST / float(max(size))
    figure = Figure(figsize=(max(float(size[0]) * inch, 3.4), float(size[1]) * inch + 0.9), layout="constrained")
    axes = figure.add_subplot()
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set_axis_off()

    outside = np.asarray(np.mean(moved[facets], axis=(0, 1)))
    for corners, normal in planes:
        normal = normal if (corners.mean(axis=0) - outside) @ normal > 0 else -normal  # away from the body
        _draw_plane(axes, seen.flat(corners), in_front=bool(normal @ seen.toward > 1e-9))
    normals, areas = _normals(moved, facets)
    facing = normals @ seen.toward > 0
    tones = Tones(field, values[facing], areas[facing], top)
    _draw_body(axes, seen, moved, facets, values, tones, 72 * inch)
    tones.bar(figure, axes)
    if stress is not None:
        front = normals @ seen.toward > 0.2
        middles = seen.flat(moved[facets[front]].mean(axis=1))
        draw_principal(axes, middles, stress[front], np.stack((seen.right, seen.up)), float(max(size)))
    at_rest = [seen.flat(points[line]) for line in view.lines_of(_edges(points, facets, seen))]
    rest = LineCollection(at_rest, colors=MUTED, linewidths=0.6, linestyles=[(0, (4, 2.5))], zorder=3, alpha=0.8)
    axes.add_collection(rest, autolim=False)
    _draw_coordinates(axes, seen, points, low, high)
    return figure, factor


def _draw_body(
    axes: Axes, seen: view.View, moved: Floats, facets: Rows, values: Floats, tones: Tones, inch: float
) -> None:
    """Facets that face the viewer, the farthest first, with sharp edges between them."""
    normals, areas = _normals(moved, facets)
    front = np.flatnonzero(normals @ seen.toward > 0)
    light = seen.toward + 0.5 * seen.up - 0.6 * seen.right
    shade = 1 - _SHADE * (1 - np.clip(normals[front] @ (light / np.linalg.norm(light)), 0.0, 1.0))
    colours = mpl.colormaps.get_cmap(tones.field.colours)(tones.norm(np.nan_to_num(values[front]) * 10.0**tones.power))
    colours[:, :3] *= shade[:, None]
    edged = math.sqrt(float(np.median(areas))) * inch >= _VISIBLE_FACET
    lines = _edges(moved, facets, seen)
    nearness = np.concatenate((seen.depth(moved[facets[front]]).mean(axis=1), seen.depth(moved[lines]).mean(axis=1)))
    # An edge is drawn right after the facets that meet there.
    nearness[len(front) :] += 1.5 * math.sqrt(float(np.median(areas)))
    order = np.argsort(nearness, kind="stable")
    corners = [*seen.flat(moved[facets[front]]), *seen.flat(moved[lines])]
    none = np.tile(to_rgba("none"), (len(lines), 1))
    rims = np.concatenate(
        (0.75 * colours + [0, 0, 0, 0.25] if edged else colours, np.tile(to_rgba(INK), (len(lines), 1)))
    )
    widths = np.concatenate((np.full(len(front), 0.3), np.full(len(lines), 0.8)))
    body = PolyCollection(
        [corners[k] for k in order],
        facecolors=np.concatenate((colours, none))[order],
        edgecolors=rims[order],
        linewidths=widths[order],
        joinstyle="round",
        zorder=2,
        rasterized=len(front) > 5000,
    )
    axes.add_collection(body, autolim=False)


def _normals(points: Floats, facets: Rows) -> tuple[Floats, Floats]:
    """Outward unit normals, shape (m, 3), and areas, shape (m,)."""
    corners = points[facets] - points[facets].mean(axis=1, keepdims=True)
    twice = np.cross(corners, np.roll(corners, -1, axis=1)).sum(axis=1)
    size = np.linalg.norm(twice, axis=1)
    return twice / np.maximum(size, 1e-300)[:, None], 0.5 * size


def _edges(points: Floats, facets: Rows, seen: view.View) -> Rows:
    """Edges to draw, shape (e, 2): visible sharp edges, and those where the surface turns away."""
    normals, _ = _normals(points, facets)
    a, b = facets.ravel(), np.roll(facets, -1, axis=1).ravel()
    owner = np.arange(len(facets))[:, None].repeat(facets.shape[1], axis=1).ravel()
    key = np.minimum(a, b) * len(points) + np.maximum(a, b)
    order = np.argsort(key, kind="stable")
    pair = np.flatnonzero(np.diff(key[order]) == 0)
    front = normals @ seen.toward > 0
    one, other = owner[order[pair]], owner[order[pair + 1]]
    sharp = np.einsum("ij,ij->i", normals[one], normals[other]) < _SHARP
    wanted = order[pair[np.where(sharp, front[one] | front[other], front[one] != front[other])]]
    return np.column_stack((a[wanted], b[wanted]))


def _plane(points: Floats) -> tuple[Floats, Floats] | None:
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


def _draw_plane(axes: Axes, corners: Floats, *, in_front: bool) -> None:
    face = "none" if in_front else _GROUND
    dashes = (0, (6, 3)) if in_front else "solid"
    plane = PolyCollection([corners], facecolors=face, edgecolors=MUTED, linewidths=0.6, linestyles=[dashes])
    plane.set_zorder(4 if in_front else 1)
    axes.add_collection(plane, autolim=False)


def _draw_coordinates(axes: Axes, seen: view.View, points: Floats, low: Floats, high: Floats) -> None:
    """The three axes in the corner, and the length of the body along each."""
    extent = points.max(axis=0) - points.min(axis=0)
    length = 0.09 * float(np.max(high - low))
    corner = low + np.array([1.0, 1.0]) * 0.9 * length
    for axis in range(3):
        tip = corner + length * seen.flat(np.eye(3)[axis])
        style = {"arrowstyle": "-|>", "color": INK, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7}
        axes.annotate("", (tip[0], tip[1]), (corner[0], corner[1]), arrowprops=style, zorder=5)
        x, y = corner + 1.3 * (tip - corner)
        axes.text(x, y, f"$x_{axis + 1}$", ha="center", va="center", zorder=5)
    told = r"\times".join(math_number(float(f"{size:.4g}")) for size in extent)
    axes.annotate(
        f"body: ${told}$ along $x_1$, $x_2$, $x_3$", (1.0, 0.0), xycoords="axes fraction", ha="right", color=MUTED
    )
