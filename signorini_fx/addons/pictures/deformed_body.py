"""The deformed body in 2D on its foundation, a field in colours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection, TriMesh
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from signorini_fx.addons.pictures.body import DrawnBody
from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.addons.pictures.marks import Largest, Tones, mark_largest, usual_range
from signorini_fx.addons.pictures.style import INK, MUTED, STYLE, VALUES, Floats, math_number
from signorini_fx.mechanics.statement.units import bracketed
from signorini_fx.tuned import SHARP_EDGE, SMALL_PART, SMALL_ZONE, VISIBLE_CELL

_BENT = math.cos(math.radians(SHARP_EDGE))
_TRIANGLES = 15_000  # of which a field is made up at least
_FAINT = (0.0, 0.0, 0.0, 0.22)
_WIDEST = {1: 4.8, 2: 2.6}  # inches of a panel, by their number
Window = tuple[Floats, Floats]


def keeps_shape(added: float, size: float, real: Floats, drawn: Floats) -> bool:
    """Whether a foundation keeps its shape where its gap is magnified: it is drawn so much farther away, and its pieces
    have directions, along or perpendicular to them, shape (m, d).
    """
    lengths = np.linalg.norm(real, axis=1) * np.linalg.norm(drawn, axis=1)
    return added <= SMALL_PART * size and bool((np.einsum("ij,ij->i", real, drawn) >= _BENT * lengths).all())


@dataclass(frozen=True)
class DrawnFoundation:
    """The contact boundary and what it may touch."""

    nodes: Floats  # positions of the contact nodes, length, in order along each boundary, shape (k, 2)
    offset: Floats  # the vector d n from each to the rigid foundation, or to the other body, length, shape (k, 2)
    touching: npt.NDArray[np.bool_]  # nodes in contact, shape (k,)
    other: npt.NDArray[np.bool_]  # nodes that may touch another body, which is drawn itself, shape (k,)
    shaped: npt.NDArray[np.bool_]  # nodes whose foundation is among ``lines``, shape (k,)
    # whole foundations where they are, each of shape (k, 2), the body on its left: they are drawn instead of what is
    # opposite of the nodes where nothing is magnified
    lines: Sequence[Floats] = ()

    def pieces(self) -> list[DrawnFoundation]:
        """Connected parts of the boundary."""
        finite = np.isfinite(self.nodes).all(axis=1) & np.isfinite(self.offset).all(axis=1)
        parts = [part[finite] for part in (self.nodes, self.offset, self.touching, self.other, self.shaped)]
        # From one boundary to the next the step is nought or much longer than those before and after.
        steps = np.concatenate(([0.0], np.hypot(*np.diff(parts[0], axis=0).T), [0.0]))
        usual, inner = np.maximum(steps[:-2], steps[2:]), steps[1:-1]
        apart = (inner == 0) | ((inner > 4 * usual) & (usual > 0)) | np.diff(parts[3]) | np.diff(parts[4])
        split = zip(*(np.split(part, np.flatnonzero(apart) + 1) for part in parts), strict=True)
        return [DrawnFoundation(*piece) for piece in split if len(piece[0]) > 1]

    def with_mirror_image(self) -> DrawnFoundation:
        """Behind that on the other side of the axis, which is x[0] = 0, in the other order: the body is on the left."""
        nodes, offset = (np.concatenate((part[::-1] * (-1.0, 1.0), part)) for part in (self.nodes, self.offset))
        touching, other, shaped = (np.append(part[::-1], part) for part in (self.touching, self.other, self.shaped))
        lines = [*self.lines, *(line[::-1] * (-1.0, 1.0) for line in self.lines)]
        return DrawnFoundation(nodes, offset, touching, other, shaped, lines)

    def looks_like_itself(self, factor: float, size: float) -> bool:
        """Whether a connected part keeps its shape where its gap is times a factor; ``size``: of the body, length."""
        real, drawn = (np.diff(self.nodes + scale * self.offset, axis=0) for scale in (1.0, factor))
        return keeps_shape((factor - 1) * float(np.hypot(*self.offset.T).max()), size, real, drawn)


@mpl.rc_context(STYLE)
def deformed_mesh(
    body: DrawnBody, name: str, *, foundation: DrawnFoundation | None = None, largest: Largest | None = None
) -> tuple[Figure, str]:
    """Draw the deformed mesh on its foundation, a field in colours; and say what is magnified.

    A displacement that is magnified needs a gap that is magnified alike, or the body would seem to enter the
    foundation.  That is a true picture as long as the gap hardly varies.  Where the magnified gap would bend the
    foundation visibly, as under a disk on a plane, body and foundation are drawn as they are.  Where contact is on a
    small part of the body, a second panel shows that part as it is.

    Colours vary within each cell, and jump between cells only where the values do.  The edges of the cells are drawn if
    the mesh is coarse enough to see them; the body's outline always is.  Where a singular corner would leave the rest
    of the body without colour, the scale ends at the value that 99 % of the area stays below; an arrow at the colour
    bar says that there is more.  A circle marks the largest value, and a gray line is the outline of the undeformed
    body, whose coordinates stand at the axes.  ``name``: of the field, in ``FIELDS``.
    """
    pieces = [] if foundation is None else foundation.pieces()
    factor = body.factor
    if not all(piece.looks_like_itself(factor, body.size) for piece in pieces):
        factor = 1.0
    shapes = () if foundation is None else foundation.lines
    seen = _window(body, factor, _foundations(body, pieces, shapes, factor))
    panels, remark = [(factor, seen)], _remark(pieces, factor)
    zone, moved = _small_zone(pieces, body.size), body.moved(factor)
    field, ends = FIELDS[name].labelled(recovered=body.recovered), None
    if zone is not None:  # the scale is that of what is enlarged
        panels.append((1.0, zone))
        remark = f"left: {remark}; right: the contact zone as it is"
        places = body.moved(1.0)[body.within]
        inside = np.all((places >= zone[0]) & (places <= zone[1]), axis=2)
        areas = np.broadcast_to(_areas(body.moved(1.0)[body.perimeters])[:, None], inside.shape)
        ends = usual_range(body.values[name][inside], areas[inside], signed=field.signed)
    share = _areas(moved[body.triangles]).repeat(3) / 3
    tones = Tones(field, body.at_corners(name).ravel(), share, ends)
    aspects = [float((high[1] - low[1]) / (high[0] - low[0])) for _, (low, high) in panels]
    widest = _WIDEST[len(panels)]
    widths = [min(widest, widest / aspect) for aspect in aspects]
    height = max(width * aspect for width, aspect in zip(widths, aspects, strict=True))
    figure = Figure(figsize=(max(sum(widths), 3.0) + 0.7 * len(panels), height + 1.3), layout="constrained")
    grid = figure.subplots(1, len(panels), squeeze=False, width_ratios=widths)[0]
    for axes, (scale, (low, high)), width in zip(grid, panels, widths, strict=True):
        _draw_body(axes, body, name, tones, scale, inch=width / float(high[0] - low[0]))
        for line, side in _foundations(body, pieces, shapes, scale):
            _draw_foundation(axes, line, side, 0.035 * float(np.max(high - low)))
        undeformed = "" if scale == 1 else ", undeformed"
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set(xlabel=f"$x${undeformed}{bracketed('length')}", ylabel=f"$y${undeformed}{bracketed('length')}")
        axes.spines[:].set_visible(False)
        axes.locator_params(axis="x", nbins=max(2, min(7, round(1.4 * width))))
        axes.locator_params(axis="y", nbins=max(2, min(7, round(2.5 * height))))
    if largest is not None:
        mark_largest(grid[0], largest.moved(body, name, factor), largest.text)
    tones.bar(figure, list(grid))
    return figure, remark


def _remark(pieces: Sequence[DrawnFoundation], factor: float) -> str:
    """What is magnified."""
    gap = " and gap" if factor != 1 and any(not piece.other.any() for piece in pieces) else ""
    return f"displacement{gap} $\\times\\,{math_number(factor)}$"


def _small_zone(pieces: Sequence[DrawnFoundation], size: float) -> Window | None:
    """Lowest and highest coordinates around what is in contact; None if that is no small part of the body."""
    nodes = np.concatenate([np.empty((0, 2)), *(piece.nodes[piece.touching] for piece in pieces)])
    low, high = nodes.min(axis=0, initial=np.inf), nodes.max(axis=0, initial=-np.inf)
    if not 0 < np.hypot(*(high - low)) < SMALL_ZONE * size or not len(nodes):
        return None
    around = 0.8 * float(max(high - low))
    return low - around, high + around


def _foundations(
    body: DrawnBody, pieces: Sequence[DrawnFoundation], shapes: Sequence[Floats], factor: float
) -> list[tuple[Floats, float]]:
    """The lines of rigid foundations, and on which side of each the body is, see ``_side_of_body``."""
    shapes = shapes if factor == 1 else ()
    centres = body.points[body.perimeters].mean(axis=1)
    opposite = [piece for piece in pieces if not (piece.other.any() or (shapes and piece.shaped.all()))]
    lines = [(piece.nodes + factor * piece.offset, _side_of_body(piece.nodes, centres)) for piece in opposite]
    return [*lines, *((line, 1.0) for line in shapes)]


def _window(body: DrawnBody, factor: float, lines: Sequence[tuple[Floats, float]]) -> Window:
    """What is seen: the body, and a foundation that runs far away not much further than that."""
    points = np.concatenate((body.moved(factor), body.points))
    low, high = points.min(axis=0), points.max(axis=0)
    around = 0.3 * float(max(high - low))
    everything = np.concatenate([points, *(np.clip(line, low - around, high + around) for line, _ in lines)])
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = 0.035 * float(max(high - low))
    return low - margin, high + margin


def _draw_body(axes: Axes, body: DrawnBody, name: str, tones: Tones, factor: float, *, inch: float) -> None:
    """The body in colours and its outlines; ``inch``: how many a unit of length is."""
    assert body.outline is not None
    moved = body.moved(factor)
    # matplotlib interpolates red, green and blue instead of the field, which only small triangles do not show.
    values = body.at_corners(name) * 10.0**tones.power
    corners = _refined(np.dstack((moved[body.triangles], values)), _TRIANGLES)
    parts = Triangulation(*corners[..., :2].reshape(-1, 2).T, np.arange(3 * len(corners)).reshape(-1, 3))
    colours = {"array": corners[..., 2].ravel(), "cmap": VALUES, "norm": tones.norm}
    axes.add_collection(TriMesh(parts, rasterized=True, zorder=1, **colours), autolim=False)
    cells = moved[body.perimeters]
    cell_size = math.sqrt(float(np.median(_areas(cells)))) * 72 * inch
    if cell_size >= VISIBLE_CELL:
        width = min(0.4, 0.045 * cell_size)
        edges = PolyCollection(list(cells), zorder=1, facecolors="none", edgecolors=_FAINT, linewidths=width)
        axes.add_collection(edges, autolim=False)
    if factor != 1:
        rest = LineCollection(list(body.points[body.outline]), colors=MUTED, linewidths=0.6, zorder=3, alpha=0.7)
        axes.add_collection(rest, autolim=False)
    outline = LineCollection(list(moved[body.outline]), colors=INK, linewidths=0.8, capstyle="round")
    axes.add_collection(outline, autolim=False)


def _refined(corners: Floats, enough: int) -> Floats:
    """Triangles that are cut into four until there are at least so many, shape (t, 3, ...).

    Between their corners they are linear in all that ``corners`` has, shape (m, 3, ...), and stay so.
    """
    while 0 < len(corners) < enough:
        ahead = 0.5 * (corners + np.roll(corners, -1, axis=1))
        outer = np.stack((corners, ahead, np.roll(ahead, 1, axis=1)), axis=2)
        corners = np.concatenate((outer.reshape(-1, *corners.shape[1:]), ahead))
    return corners


def _side_of_body(nodes: Floats, centres: Floats) -> float:
    """+1 if the body, cells with centres of shape (m, 2), lies to the left of a piece of its boundary, else -1."""
    votes = 0.0
    for k in np.unique(np.linspace(0, len(nodes) - 2, 9).astype(int)):
        ahead, middle = nodes[k + 1] - nodes[k], 0.5 * (nodes[k + 1] + nodes[k])
        towards = centres[np.argmin(((centres - middle) ** 2).sum(axis=1))] - middle
        votes += math.copysign(1.0, ahead[0] * towards[1] - ahead[1] * towards[0])
    return math.copysign(1.0, votes)


def _areas(corners: Floats) -> Floats:
    """Areas of polygons of shape (m, k, 2)."""
    x, y = corners[..., 0], corners[..., 1]
    twice: Floats = np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1))
    return 0.5 * twice


def _draw_foundation(axes: Axes, line: Floats, side: float, length: float) -> None:
    """A line of shape (k, 2), with short strokes on its right (``side`` 1: the body is on its left) or left (-1)."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
    if not along[-1] > 0:
        return
    count = int(np.clip(along[-1] / (0.5 * length), 2, 5000))
    at = (np.arange(count) + 0.5) * along[-1] / count
    step = 0.1 * along[-1] / count
    feet, behind, ahead = (
        np.column_stack([np.interp(where, along, line[:, axis]) for axis in (0, 1)])
        for where in (at, at - step, at + step)
    )
    tangent = (ahead - behind) / np.maximum(np.hypot(*(ahead - behind).T), 1e-300)[:, None]
    away = side * np.column_stack((tangent[:, 1], -tangent[:, 0]))
    tips = feet + 0.45 * length * (away - side * tangent)
    strokes = LineCollection(list(np.stack((feet, tips), axis=1)), colors=INK, linewidths=0.5, zorder=4)
    axes.add_collection(strokes, autolim=False)
    axes.plot(*line.T, color=INK, linewidth=1.2, zorder=5, solid_capstyle="round")
