"""The deformed body on its foundation, with the elastic shear energy density in gray tones."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from signorini_fx.report.style import INK, STYLE, Floats, decimal_power, finish, math_number, readable, times_power

_VISIBLE_CELL = 2.5  # size from which on the edges of a cell are drawn, in 1/72 inch
_EDGE = "#9a9a9a"
_GRAYS = LinearSegmentedColormap.from_list("shear energy", ["#ffffff", "#0d0d0d"])


def magnification(points: Floats, displacement: Floats) -> float:
    """A factor that makes a displacement visible: the largest becomes about 8 % of the body's diagonal.

    Args:
        points: positions, shape (n, d).
        displacement: at the points, shape (n, d).

    Returns:
        1, 2 or 5 times a power of ten; 1 for a body that does not move.
    """
    largest = float(np.hypot.reduce(np.asarray(displacement, dtype=np.float64), axis=1).max(initial=0.0))
    if not (math.isfinite(largest) and largest > 0):
        return 1.0
    ideal = 0.08 * _diagonal(points) / largest
    return readable(ideal) if ideal > 0 else 1.0


def _diagonal(points: Floats) -> float:
    return float(np.hypot.reduce(np.ptp(points, axis=0))) if len(points) else 0.0


def deformed_mesh(
    path_stem: str | Path,
    points: Floats,
    cells: npt.NDArray[Any],
    displacement: Floats,
    density: Floats,
    *,
    gap: tuple[Floats, Floats] | None = None,
    factor: float | None = None,
    title: str = "",
) -> None:
    """Draw the deformed mesh, the elastic shear energy density in gray tones, as in Figures 2 and 6 of the paper.

    The edges of the cells are drawn if the mesh is coarse enough to see them; the body's outline always is.  If a
    singular corner would leave the rest of the body white, the gray scale ends at the density that is not exceeded on
    99 % of the area; an arrow at the colour bar indicates that black includes larger values.

    Args:
        path_stem: where to write, without suffix.
        points: positions, length, shape (n, 2); a point may appear several times, once for each rank that has it.
        cells: triangles or quadrilaterals, their points in order along the perimeter, shape (m, 3) or (m, 4).
        displacement: y at the points, length, shape (n, 2).
        density: elastic shear energy density, energy per volume, one value per cell, shape (m,).
        gap: contact nodes and the vector d n from each to the rigid foundation, lengths, both of shape (k, 2), nodes in
            order along each boundary; like the displacement, d n is multiplied by the factor.
        factor: None: ``magnification(points, displacement)``; the title says it.
        title: title of the picture.

    Raises:
        ValueError: there are no cells.
    """
    points, displacement = np.asarray(points, dtype=np.float64), np.asarray(displacement, dtype=np.float64)
    cells, density = np.asarray(cells).astype(np.int64), np.asarray(density, dtype=np.float64)
    if not cells.size:
        raise ValueError("the mesh has no cells")
    factor = magnification(points, displacement) if factor is None else factor
    moved = points + factor * displacement
    moved = np.where(np.isfinite(moved), moved, points)  # a failed solve may give any values
    corners, foundations = moved[cells], _foundations(gap, factor)

    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    # A foundation is not drawn beyond this distance.
    around = 0.3 * float(max(high - low))
    seen = [np.clip(line, low - around, high + around) for _, line in foundations]
    everything = np.concatenate([np.stack((low, high)), *seen])
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = 0.035 * float(max(high - low))
    low, high = low - margin, high + margin
    aspect = (high[1] - low[1]) / (high[0] - low[0])
    width = min(6.2, 6.2 / aspect)
    area = _areas(corners)
    cell_size = math.sqrt(float(np.median(area))) * 72 * width / (high[0] - low[0])
    edged = cell_size >= _VISIBLE_CELL
    top = upper_tone(density, area)
    power = decimal_power(top)

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(max(width, 3.0) + 0.8, width * aspect + 1.3), layout="constrained")
        axes = figure.add_subplot()
        # Vector cells without edges show seams in print, and a million of them take a viewer minutes.
        body = PolyCollection(
            corners,
            array=density * 10.0**power,
            cmap=_GRAYS,
            clim=(0.0, top * 10.0**power),
            edgecolors=_EDGE if edged else "none",
            linewidths=min(0.4, 0.045 * cell_size) if edged else 0.0,
            antialiaseds=edged,
            rasterized=not edged,
            zorder=1,
        )
        axes.add_collection(body, autolim=False)
        edges = moved[_outline(moved, cells)]
        axes.add_collection(LineCollection(list(edges), colors=INK, linewidths=0.8, capstyle="round"), autolim=False)
        centres = points[cells].mean(axis=1)
        for nodes, line in foundations:
            _draw_foundation(axes, line, _side_of_body(nodes, centres), margin)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="$x_1$", ylabel="$x_2$")
        axes.spines[:].set_visible(False)
        axes.locator_params(axis="x", nbins=max(2, min(7, round(1.4 * width))))
        axes.locator_params(axis="y", nbins=max(2, min(7, round(2.5 * width * aspect))))
        bar = figure.colorbar(
            body,
            ax=axes,
            orientation="horizontal",
            extend="max" if float(density.max()) > 1.001 * top else "neither",
            shrink=0.6,
            aspect=45,
            pad=0.02,
        )
        bar.ax.locator_params(nbins=6)
        bar.set_label(f"elastic shear energy density{times_power(power)}")
        remark = f"displacement $\\times\\,{math_number(factor)}$"
        finish(figure, path_stem, f"{title}   ({remark})" if title else remark)


def _foundations(gap: tuple[Floats, Floats] | None, factor: float) -> list[tuple[Floats, Floats]]:
    """Connected pieces of the contact boundary: nodes and points of the foundation as drawn, both of shape (k, 2)."""
    if gap is None:
        return []
    rows = np.column_stack([np.asarray(part, dtype=np.float64) for part in gap])
    rows = rows[np.isfinite(rows).all(axis=1)]
    nodes, offset = rows[:, :2], rows[:, 2:]
    # From one boundary to the next the step is zero or much longer than those before and after.
    steps = np.concatenate(([0.0], np.hypot(*np.diff(nodes, axis=0).T), [0.0]))
    usual = np.maximum(steps[:-2], steps[2:])
    inner = steps[1:-1]
    breaks = np.flatnonzero((inner == 0) | ((inner > 4 * usual) & (usual > 0))) + 1
    pieces = zip(np.split(nodes, breaks), np.split(nodes + factor * offset, breaks), strict=True)
    return [piece for piece in pieces if len(piece[0]) > 1]


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


def upper_tone(density: Floats, area: Floats) -> float:
    """The density drawn black: the largest or, if that is far above, the value not exceeded on 99 % of the area."""
    finite = np.isfinite(density)
    density, area = density[finite], area[finite]
    largest = float(density.max(initial=0.0))
    if not largest > 0:
        return 1.0
    order = np.argsort(density)
    share = np.cumsum(area[order])
    usual = float(density[order][np.searchsorted(share, 0.99 * share[-1])])
    return usual if 0 < 1.5 * usual < largest else largest


def _outline(points: Floats, cells: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Edges that belong to one cell only, shape (e, 2); points at the same place count as one."""
    grid = np.round((points - points.min(axis=0)) / (1e-9 * _diagonal(points) or 1.0)).astype(np.int64)
    _, first, same = np.unique(grid[:, 0] * 2**32 + grid[:, 1], return_index=True, return_inverse=True)
    cells = first[same.ravel()[cells]]
    a, b = cells.ravel(), np.roll(cells, -1, axis=1).ravel()
    _, where, count = np.unique(
        np.minimum(a, b) * len(points) + np.maximum(a, b), return_index=True, return_counts=True
    )
    once = where[count == 1]
    return np.column_stack((a[once], b[once]))


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
