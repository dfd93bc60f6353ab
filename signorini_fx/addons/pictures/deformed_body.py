"""The deformed body in 2D on its foundation, with a field in colours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection, TriMesh
from matplotlib.figure import Figure
from matplotlib.patheffects import withTickedStroke
from matplotlib.tri import Triangulation

from signorini_fx.addons.pictures.body import DrawnBody
from signorini_fx.addons.pictures.boundary_profiles import PlaneBoundary, draw_pressures
from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.addons.pictures.foundation import Foundation, magnification, magnified
from signorini_fx.addons.pictures.marks import Largest, Tones, mark_largest, usual_range
from signorini_fx.addons.pictures.style import INK, MUTED, STYLE, VALUES
from signorini_fx.arrays import Array
from signorini_fx.mechanics.statement.units import bracketed
from signorini_fx.tuned import SMALL_ZONE, VISIBLE_CELL

if TYPE_CHECKING:
    from typing import Any

_TRIANGLES = 15_000  # of which a field is made up at least
_FAINT = (0.0, 0.0, 0.0, 0.22)
_PROFILE = 1.3  # inches of the pressure below them
_WIDEST = {1: 4.8, 2: 2.6}  # inches of a panel, by their number
Window = tuple[Array, Array]


@mpl.rc_context(STYLE)
def deformed_mesh(
    body: DrawnBody,
    name: str,
    *,
    foundations: Sequence[Foundation] = (),
    largest: Largest | None = None,
    pressed: Sequence[PlaneBoundary] = (),
) -> tuple[Figure, str]:
    """Draw the deformed mesh on its foundation with a field in colours; return the figure, and what
    is magnified, in words.

    Below it is the pressure along the contact boundaries ``pressed``.  Where contact is on a small
    part of the body, a second panel shows that part without magnification.  Colours vary within
    each cell, and jump between cells only where the values do.  The edges of the cells are drawn if
    the mesh is coarse enough to see them; the body's outline always is.  A circle marks the largest
    value, and a gray line is the outline of the undeformed body, to which the coordinates at the
    axes belong.  ``name`` is the name of the field in ``FIELDS``.
    """
    factor = magnification(body, foundations)
    seen = _window(body, factor, _lines(foundations, factor))
    panels = [(factor, seen)]
    remark = magnified(foundations, factor)
    zone = _small_zone(foundations, body.size)
    moved = body.moved(factor)
    field = FIELDS[name].labelled(recovered=body.recovered)
    values = body.at_corners(name).ravel()
    if zone is None:
        ends = usual_range(values, _areas(moved[body.triangles]).repeat(3) / 3, signed=field.signed)
    else:  # the colour scale is that of the enlarged part
        panels.append((1.0, zone))
        remark = f"left: {remark}; right: the contact zone as it is"
        places = body.moved(1.0)[body.within]
        inside = np.all((places >= zone[0]) & (places <= zone[1]), axis=2)
        areas = np.broadcast_to(_areas(body.moved(1.0)[body.perimeters])[:, None], inside.shape)
        ends = usual_range(body.values[name][inside], areas[inside], signed=field.signed)
    tones = Tones(field, values, *ends)
    aspects = [float((high[1] - low[1]) / (high[0] - low[0])) for _, (low, high) in panels]
    widest = _WIDEST[len(panels)]
    widths = [min(widest, widest / aspect) for aspect in aspects]
    height = max(width * aspect for width, aspect in zip(widths, aspects, strict=True))
    rows = [height, _PROFILE] if pressed else [height]
    beside = 2.0 if pressed else 1.3  # title, axes and bar: too little of it makes bodies narrower
    size = max(sum(widths), 3.0) + 0.7 * len(panels), sum(rows) + beside
    figure = Figure(figsize=size, layout="constrained")
    layout = figure.add_gridspec(len(rows), len(panels), width_ratios=widths, height_ratios=rows)
    grid = [figure.add_subplot(layout[0, k]) for k in range(len(panels))]
    for axes, (scale, (low, high)), width in zip(grid, panels, widths, strict=True):
        _draw_body(axes, body, name, tones, scale, inch=width / float(high[0] - low[0]))
        for line in _lines(foundations, scale):
            _draw_foundation(axes, line)
        undeformed = "" if scale == 1 else ", undeformed"
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set(
            xlabel=f"x{undeformed}{bracketed('length')}",
            ylabel=f"y{undeformed}{bracketed('length')}",
        )
        axes.spines[:].set_visible(False)
        axes.locator_params(axis="x", nbins=max(2, min(7, round(1.4 * width))))
        axes.locator_params(axis="y", nbins=max(2, min(7, round(2.5 * height))))
    if pressed:
        below = figure.add_subplot(layout[1, :])
        draw_pressures(below, pressed)
        if len(panels) == 1 and all(boundary.label == "x" for boundary in pressed):
            below.set_xlim(grid[0].get_xlim())  # below the points that press
    if largest is not None:
        mark_largest(grid[0], moved[largest.point], largest.text)
    tones.bar(figure, grid)
    return figure, remark


@mpl.rc_context(STYLE)
def draw_on_axes(axes: Axes, body: DrawnBody, name: str) -> None:
    """Draw the deformed body with a field and its colour bar on axes, magnified as in a picture."""
    factor = magnification(body, ())
    moved = body.moved(factor)
    field = FIELDS[name].labelled(recovered=body.recovered)
    values = body.at_corners(name).ravel()
    areas = _areas(moved[body.triangles]).repeat(3) / 3
    tones = Tones(field, values, *usual_range(values, areas, signed=field.signed))
    low, high = _window(body, factor, [])
    figure: Any = axes.figure
    width = axes.get_position().width * figure.get_figwidth()
    _draw_body(axes, body, name, tones, factor, inch=width / float(high[0] - low[0]))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set_title(magnified((), factor))
    tones.bar(figure, axes)


def _small_zone(foundations: Sequence[Foundation], size: float) -> Window | None:
    """Return the lowest and highest coordinates around the nodes in contact; None if these are not
    on a small part of the body.
    """
    nodes = np.concatenate([np.empty((0, 2)), *(part.nodes[part.touching] for part in foundations)])
    low = nodes.min(axis=0, initial=np.inf)
    high = nodes.max(axis=0, initial=-np.inf)
    if not 0 < np.hypot(*(high - low)) < SMALL_ZONE * size or not len(nodes):
        return None
    around = 0.8 * float(max(high - low))
    return low - around, high + around


def _lines(foundations: Sequence[Foundation], factor: float) -> list[Array]:
    """Return the lines of the rigid foundations, with the body on the left; the whole surface of a
    shape if nothing is magnified.
    """
    lines: list[Array] = []
    for part in foundations:
        if part.rigid:
            lines += [part.drawn(factor)] if factor != 1 or part.surface is None else part.surface
    return lines


def _window(body: DrawnBody, factor: float, lines: Sequence[Array]) -> Window:
    """Return the visible window: the body, and foundations up to a short distance from it."""
    points = np.concatenate((body.moved(factor), body.points))
    low = points.min(axis=0)
    high = points.max(axis=0)
    around = 0.3 * float(max(high - low))
    everything = np.concatenate(
        [points, *(np.clip(line, low - around, high + around) for line in lines)]
    )
    low = everything.min(axis=0)
    high = everything.max(axis=0)
    margin = 0.035 * float(max(high - low))
    return low - margin, high + margin


def _draw_body(
    axes: Axes, body: DrawnBody, name: str, tones: Tones, factor: float, *, inch: float
) -> None:
    """Draw the body in colours and its outlines.

    Args:
        axes: where to draw.
        body: the body.
        name: the field, in ``FIELDS``.
        tones: the colour scale.
        factor: magnification of the displacement.
        inch: inches per unit of length.
    """
    assert body.outline is not None
    moved = body.moved(factor)
    # matplotlib interpolates red, green and blue instead of the field, which only small triangles
    # do not show.
    values = body.at_corners(name) * 10.0**tones.power
    corners = _refined(np.dstack((moved[body.triangles], values)), _TRIANGLES)
    parts = Triangulation(
        *corners[..., :2].reshape(-1, 2).T, np.arange(3 * len(corners)).reshape(-1, 3)
    )
    axes.add_collection(
        TriMesh(
            parts,
            rasterized=True,
            zorder=1,
            array=corners[..., 2].ravel(),
            cmap=VALUES,
            norm=tones.norm,
        ),
        autolim=False,
    )
    cells = moved[body.perimeters]
    cell_size = math.sqrt(float(np.median(_areas(cells)))) * 72 * inch
    if cell_size >= VISIBLE_CELL:
        width = min(0.4, 0.045 * cell_size)
        edges = PolyCollection(
            list(cells), zorder=1, facecolors="none", edgecolors=_FAINT, linewidths=width
        )
        axes.add_collection(edges, autolim=False)
    if factor != 1:
        rest = LineCollection(
            list(body.points[body.outline]), colors=MUTED, linewidths=0.6, zorder=3, alpha=0.7
        )
        axes.add_collection(rest, autolim=False)
    outline = LineCollection(
        list(moved[body.outline]), colors=INK, linewidths=0.8, capstyle="round"
    )
    axes.add_collection(outline, autolim=False)


def _refined(corners: Array, enough: int) -> Array:
    """Return triangles cut into four repeatedly until there are ``enough``, shape (t, 3, ...);
    values are linear between corners.
    """
    while 0 < len(corners) < enough:
        ahead = 0.5 * (corners + np.roll(corners, -1, axis=1))
        outer = np.stack((corners, ahead, np.roll(ahead, 1, axis=1)), axis=2)
        corners = np.concatenate((outer.reshape(-1, *corners.shape[1:]), ahead))
    return corners


def _areas(corners: Array) -> Array:
    """Return the areas of polygons with corners of shape (m, k, 2)."""
    x = corners[..., 0]
    y = corners[..., 1]
    twice = np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1))
    return 0.5 * twice


def _draw_foundation(axes: Axes, line: Array) -> None:
    """Draw a line of shape (k, 2) with short strokes on its right; the body is on its left."""
    strokes = withTickedStroke(spacing=5, angle=-135, length=0.8, linewidth=0.5)
    axes.plot(
        *line.T, color=INK, linewidth=1.2, zorder=5, path_effects=[strokes], solid_capstyle="round"
    )
