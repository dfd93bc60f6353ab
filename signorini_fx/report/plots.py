"""Pictures from plain arrays: deformed mesh, curves along the contact boundary, course of the iteration.

Nothing here knows of dolfinx or ranks: call it on one rank.  Every picture is written twice, ``stem.png`` to look at
and ``stem.pdf`` to print, unless ``suffixes`` asks for others, as a page does for ``.svg``.  It stays readable in black
and white: line styles and lightness carry what the colours do.
"""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from signorini_fx.csv_text import as_name

Floats = npt.NDArray[np.float64]
Table = Mapping[str, npt.NDArray[Any]]

# Columns of our files that are text even if every entry looks like a number: a boundary may be called "1".
_TEXT_COLUMNS = frozenset({"boundary", "friction", "state", "status"})

_PNG_DPI = 160
_PDF_DPI = 300  # of what is rasterised in the PDF
_BOTH = (".png", ".pdf")
_VISIBLE_CELL = 2.5  # size from which on the edges of a cell are drawn, in 1/72 inch
_INK, _MUTED, _RULE = "#1a1a1a", "#6b6b6b", "#c8c8c8"
_BLUE, _ORANGE = "#0072b2", "#e69f00"
_MULTIPLIER: dict[str, Any] = {"color": _INK, "linewidth": 1.5}
_LIMIT: dict[str, Any] = {"color": _MUTED, "linewidth": 1.3, "linestyle": (0, (1, 1.4))}
_MOTION: dict[str, Any] = {"color": _BLUE, "linewidth": 1.3, "linestyle": (0, (4.5, 1.8))}
# Lightness falls from open to stick, so that the order of the states survives a gray printer.
_STATES = {
    "open": ("#f0f0f0", "open"),
    "slip+": (_ORANGE, r"slip $+$"),
    "slip-": (_BLUE, r"slip $-$"),
    "stick": ("#262626", "stick"),
    "contact": ("#8c8c8c", "in contact, no friction"),
}
_EDGE = "#9a9a9a"
_GRAYS = LinearSegmentedColormap.from_list("shear energy", ["#ffffff", "#0d0d0d"])
_STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8,
    "mathtext.fontset": "dejavusans",
    "axes.titlesize": 9,
    "axes.labelsize": 8,
    "axes.edgecolor": _MUTED,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.labelcolor": _INK,
    "axes.formatter.use_mathtext": True,
    "xtick.color": _MUTED,
    "ytick.color": _MUTED,
    "xtick.labelcolor": _INK,
    "ytick.labelcolor": _INK,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "legend.handlelength": 2.4,
    "legend.borderaxespad": 0.2,
    "legend.labelspacing": 0.3,
    "pdf.fonttype": 42,
    "svg.hashsalt": "signorini_fx",  # the same data give the same identifiers
    "text.color": _INK,
}


def read_csv(path: str | Path) -> dict[str, npt.NDArray[Any]]:
    """The columns of a CSV file with a header line, in order.

    Returns:
        Name -> one entry a row: floats where every entry is a number (an empty one is nan), strings elsewhere.

    Raises:
        ValueError: a row has more or fewer entries than the header, or it is no CSV file.
    """
    with Path(path).open(newline="", encoding="utf-8") as file:
        reader = csv.reader(file)
        rows: list[list[str]] = []
        try:
            names = next(reader, [])
            for row in reader:
                if row and len(row) != len(names):
                    raise ValueError(f"{path}, line {reader.line_num}: {len(row)} entries under {len(names)} names")
                if row:
                    rows.append(row)
        except csv.Error as error:
            raise ValueError(f"{path}, line {reader.line_num}: {error}") from None
    return {name: _column(name, [row[k] for row in rows]) for k, name in enumerate(names)}


def _column(name: str, entries: list[str]) -> npt.NDArray[Any]:
    if name not in _TEXT_COLUMNS:
        try:
            return np.array([float(entry) if entry.strip() else math.nan for entry in entries], dtype=np.float64)
        except ValueError:
            pass
    return np.array(list(map(as_name, entries)), dtype=np.str_)


def plain(text: str) -> str:
    """A user's text for a picture: dollar signs are no mathematics."""
    return text.replace("$", r"\$")


def magnification(points: Floats, displacement: Floats) -> float:
    """A factor that makes a displacement visible: the largest becomes about 8 % of the body's diagonal.

    Args:
        points: positions, shape (n, 2).
        displacement: at the points, shape (n, 2).

    Returns:
        1, 2 or 5 times a power of ten; 1 for a body that does not move.
    """
    largest = float(np.hypot(*np.asarray(displacement, dtype=np.float64).T).max(initial=0.0))
    if not (math.isfinite(largest) and largest > 0):
        return 1.0
    wanted = 0.08 * _diagonal(points) / largest
    if not wanted > 0:
        return 1.0
    decade = math.floor(math.log10(wanted))
    steps = [m * 10.0**k for k in (decade, decade + 1) for m in (1, 2, 5)]
    return float(f"{min(steps, key=lambda step: abs(math.log(step / wanted))):.0e}")


def _diagonal(points: Floats) -> float:
    return float(np.hypot(*np.ptp(points, axis=0))) if len(points) else 0.0


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

    The edges of the cells are drawn if the mesh is coarse enough to see them; the body's outline always is.  Where a
    singular corner would leave the rest of the body white, the gray scale ends at the density that 99 % of the area
    stays below; an arrow at the colour bar says that black means more.

    Args:
        path_stem: where to write, without suffix.
        points: positions, length, shape (n, 2); a point may appear several times, once for each rank that has it.
        cells: triangles or quadrilaterals, their points in order along the perimeter, shape (m, 3) or (m, 4).
        displacement: y at the points, length, shape (n, 2).
        density: elastic shear energy density, energy per volume, one value a cell, shape (m,).
        gap: contact nodes and the vector d n from each to the rigid foundation, lengths, both of shape (k, 2), nodes in
            order along each boundary; like the displacement, d n is multiplied by the factor.
        factor: None: ``magnification(points, displacement)``; the title says it.
        title: what to say above the picture.

    Raises:
        ValueError: there are no cells.
    """
    points, displacement = np.asarray(points, dtype=np.float64), np.asarray(displacement, dtype=np.float64)
    cells, density = np.asarray(cells).astype(np.int64), np.asarray(density, dtype=np.float64)
    if not cells.size:
        raise ValueError("the mesh has no cells")
    factor = magnification(points, displacement) if factor is None else factor
    moved = points + factor * displacement
    moved = np.where(np.isfinite(moved), moved, points)  # a solve that failed may leave anything behind
    corners, foundations = moved[cells], _foundations(gap, factor)

    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    # A foundation that runs far away is not followed further than this.
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
    top = _upper_tone(density, area)
    power = _readable(top)

    with mpl.rc_context(_STYLE):
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
        axes.add_collection(LineCollection(list(edges), colors=_INK, linewidths=0.8, capstyle="round"), autolim=False)
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
        bar.set_label(f"elastic shear energy density{_times(power)}")
        remark = f"displacement $\\times\\,{_number(factor)}$"
        _finish(figure, path_stem, f"{title}   ({remark})" if title else remark)


def _foundations(gap: tuple[Floats, Floats] | None, factor: float) -> list[tuple[Floats, Floats]]:
    """Connected pieces of the contact boundary: nodes and points of the foundation as drawn, both of shape (k, 2)."""
    if gap is None:
        return []
    rows = np.column_stack([np.asarray(part, dtype=np.float64) for part in gap])
    rows = rows[np.isfinite(rows).all(axis=1)]
    nodes, offset = rows[:, :2], rows[:, 2:]
    # From one boundary to the next the step is nought or much longer than those before and after.
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


def _upper_tone(density: Floats, area: Floats) -> float:
    """The density to draw black: the largest, or what 99 % of the area stays below if the largest is far above."""
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
    strokes = LineCollection(list(np.stack((feet, tips), axis=1)), colors=_INK, linewidths=0.5, zorder=4)
    axes.add_collection(strokes, autolim=False)
    axes.plot(*line.T, color=_INK, linewidth=1.2, zorder=5, solid_capstyle="round")


@dataclass(frozen=True)
class _Boundary:
    """One contact boundary: its columns, the coordinate to draw against, and where its connected pieces start."""

    name: str
    columns: Table
    coordinate: Floats
    label: str
    starts: list[int]

    def floats(self, name: str) -> Floats:
        """A numeric column, shape (n,)."""
        return np.asarray(self.columns[name], dtype=np.float64)

    def draw(self, axes: Axes, values: Floats, **style: Any) -> None:
        """A line that is interrupted between the pieces."""
        axes.plot(
            np.insert(self.coordinate, self.starts[1:], np.nan), np.insert(values, self.starts[1:], np.nan), **style
        )

    @property
    def has_friction(self) -> bool:
        """Whether a friction law acts anywhere on it."""
        return bool(np.any(self.columns["friction"] != "none") or np.any(self.floats("bound") != 0))

    def states(self, *, of_friction: bool) -> list[str]:
        """Keys of ``_STATES``, n of them: the state in the contact, or that of the friction law wherever it acts."""
        state, friction = self.columns["state"], self.columns["friction"]
        without = np.where(state == "open", "open", "contact")
        acts = friction != "none"
        return [str(key) for key in np.where(acts, friction if of_friction else state, without)]


def boundary_profiles(
    path_stem: str | Path,
    table: Table,
    *,
    title: str = "",
    sides: Sequence[str] = ("friction", "contact"),
    suffixes: Sequence[str] = _BOTH,
) -> None:
    """Draw the curves along the contact boundary, as in Figures 3 and 4 of the paper, one row a boundary.

    Left: shear stress mu, its bounds and the tangential displacement.  Right: contact pressure lambda, rigid foundation
    and normal displacement.  Lengths are multiplied by a power of ten that the legend names.  Foundation and bounds are
    cut off where they lie far beyond the other curves.  The strip below shows by colour, on the left, the state of the
    friction law wherever it acts (Tresca friction acts on open nodes too), on the right the state in the contact.
    Frictionless: only the right panel.

    Args:
        path_stem: where to write, without suffix.
        table: columns of ``contact.csv``, each of shape (n,), nodes in order along each boundary: s, x, y, gap, u_n,
            u_t, pressure, shear, bound as floats, state, friction, boundary as strings.
        title: what to say above the picture.
        sides: which of the two panels to draw.
        suffixes: of the files to write.

    Raises:
        ValueError: the table has no rows.
    """
    boundaries = _boundaries(table)
    if not boundaries:
        raise ValueError("the contact table has no rows")
    if not any(boundary.has_friction for boundary in boundaries):
        sides = ["contact"]
    with mpl.rc_context(_STYLE):
        size = (7.2 if len(sides) == 2 else 4.4, 2.95 * len(boundaries) + 0.4)
        figure = Figure(figsize=size, layout=ConstrainedLayoutEngine(hspace=0.0, h_pad=0.03, wspace=0.05))
        grid = figure.add_gridspec(2 * len(boundaries), len(sides), height_ratios=[1, 0.055] * len(boundaries))
        seen: set[str] = set()
        for i, boundary in enumerate(boundaries):
            for j, side in enumerate(sides):
                name = boundary.name if len(boundaries) > 1 else ""
                panel = figure.add_subplot(grid[2 * i, j])
                if side == "friction" and not boundary.has_friction:
                    panel.set_axis_off()
                    panel.text(0.5, 0.5, f"{name}: no friction", color=_MUTED, ha="center", transform=panel.transAxes)
                    continue
                strip = figure.add_subplot(grid[2 * i + 1, j], sharex=panel)
                (_tangential_panel if side == "friction" else _normal_panel)(panel, boundary, name)
                states = boundary.states(of_friction=side == "friction")
                seen.update(states)
                _state_strip(strip, boundary, states, side)
        patches = [
            Patch(facecolor=color, edgecolor=_MUTED, linewidth=0.5, label=label)
            for state, (color, label) in _STATES.items()
            if state in seen
        ]
        figure.legend(handles=patches, loc="outside lower center", ncols=len(patches), handlelength=1.6)
        _finish(figure, path_stem, title, suffixes)


def _boundaries(table: Table) -> list[_Boundary]:
    """The boundaries in the order in which they appear."""
    names = [str(name) for name in table["boundary"]]
    found = []
    for name in dict.fromkeys(names):
        here = np.array([other == name for other in names])
        columns = {key: np.asarray(column)[here] for key, column in table.items()}
        x, y, s = (np.asarray(columns[key], dtype=np.float64) for key in ("x", "y", "s"))
        # The arc length starts again at 0 with each connected piece.
        starts = [0, *(int(k) + 1 for k in np.flatnonzero(np.diff(s) <= 0))]
        if np.ptp(y) <= 1e-9 * np.ptp(x):
            found.append(_Boundary(plain(name), columns, x, "$x_1$", starts))
        else:
            before = np.zeros_like(s)
            for start in starts[1:]:
                before[start:] += s[start - 1]
            found.append(_Boundary(plain(name), columns, s + before, "arc length $s$", starts))
    return found


def _tangential_panel(axes: Axes, boundary: _Boundary, name: str) -> None:
    stresses, motion = boundary.floats("shear"), boundary.floats("u_t")
    # A bound that is never reached, or given as good as infinite, shall not flatten the other curves.
    bound, reach = boundary.floats("bound"), 10 * _largest(stresses)
    stress = min(_largest(stresses, bound), reach) if reach > 0 else _largest(bound)
    up, out = _powers(stress, motion, boundary)
    shear, bound, motion = stresses * 10.0**up, bound * 10.0**up, motion * 10.0**out
    boundary.draw(axes, bound, **_LIMIT, label=rf"friction bounds $\pm\,\mathfrak{{F}}\,g${_times(up)}")
    boundary.draw(axes, -bound, **_LIMIT)
    boundary.draw(axes, motion, **_MOTION, label=rf"tangential displacement $\tau_T\,\mathbf{{y}}${_times(out)}")
    boundary.draw(axes, shear, **_MULTIPLIER, label=rf"shear stress $\mu${_times(up)}")
    reach = max(10 * _largest(shear), 2.5 * _largest(motion)) or _largest(bound)
    _finish_panel(axes, boundary, name, [shear, motion, bound, -bound], reach)
    axes.set_ylabel(f"stress{_times(up)},  length{_times(out)}")


def _normal_panel(axes: Axes, boundary: _Boundary, name: str) -> None:
    pressure, gap, motion = boundary.floats("pressure"), boundary.floats("gap"), boundary.floats("u_n")
    up, out = _powers(_largest(pressure), motion, boundary)
    pressure, gap, motion = pressure * 10.0**up, gap * 10.0**out, motion * 10.0**out
    boundary.draw(axes, gap, **_LIMIT, label=f"rigid foundation $d${_times(out)}")
    boundary.draw(axes, motion, **_MOTION, label=rf"normal displacement $\tau_N\,\mathbf{{y}}${_times(out)}")
    boundary.draw(axes, pressure, **_MULTIPLIER, label=rf"contact pressure $\lambda${_times(up)}")
    # The foundation is followed as far as it is near, and its nearest point is always seen.
    reach = max(2.5 * _largest(pressure, motion), 1.2 * float(np.abs(gap).min(initial=np.inf, where=np.isfinite(gap))))
    _finish_panel(axes, boundary, name, [pressure, motion, gap], reach)
    axes.set_ylabel(f"stress{_times(up)},  length{_times(out)}")


def _largest(*curves: Floats) -> float:
    values = np.abs(np.concatenate(curves))
    return float(values[np.isfinite(values)].max(initial=0.0))


def _readable(largest: float) -> int:
    """The k with which figures up to ``largest``, times 10^k, need no exponent at an axis."""
    return 0 if largest == 0 or 1e-3 <= largest < 1e4 else -math.floor(math.log10(largest))


def _powers(stress: float, motion: Floats, boundary: _Boundary) -> tuple[int, int]:
    """Powers of ten for stresses and lengths: alike in size within a factor of about 3, and readable.

    A motion that is next to nothing beside the displacement as a whole (stick everywhere) shall look like nothing.
    """
    up = _readable(stress)
    length = max(_largest(motion), 1e-4 * _largest(boundary.floats("u_n"), boundary.floats("u_t")))
    if length == 0:
        return up, 0
    return up, round(math.log10(stress / length)) + up if stress > 0 else _readable(length)


def _times(power: int) -> str:
    return rf" $\times\,10^{{{power}}}$" if power else ""


def _finish_panel(axes: Axes, boundary: _Boundary, name: str, curves: list[Floats], reach: float) -> None:
    """Axes and legend; what lies further from zero than ``reach`` is cut off."""
    values = np.concatenate(curves)
    values = np.clip(values[np.isfinite(values)], -reach, reach)
    low, high = float(values.min(initial=0.0)), float(values.max(initial=0.0))
    margin = 0.05 * (high - low) or 1.0
    axes.set_ylim(low - margin, high + margin)
    low, high = float(boundary.coordinate.min()), float(boundary.coordinate.max())
    axes.set_xlim(low, high if high > low else low + 1.0)
    axes.axhline(0.0, color=_RULE, linewidth=0.6, zorder=0)
    axes.tick_params(axis="x", length=0, labelbottom=False)
    axes.spines["bottom"].set_visible(False)
    axes.locator_params(axis="y", nbins=6)
    handles, labels = axes.get_legend_handles_labels()
    legend = axes.legend(
        handles[::-1], labels[::-1], title=name or None, alignment="left", loc="lower left", bbox_to_anchor=(0.0, 1.01)
    )
    legend.get_title().set_fontweight("bold")


def _state_strip(axes: Axes, boundary: _Boundary, states: list[str], name: str) -> None:
    """Every node colours the boundary up to half way to its neighbours; nodes of equal state are one rectangle."""
    for first, end in itertools.pairwise([*boundary.starts, len(states)]):
        x = boundary.coordinate[first:end]
        borders = np.concatenate((x[:1], 0.5 * (x[1:] + x[:-1]), x[-1:]))
        start = 0
        for state, run in itertools.groupby(states[first:end]):
            stop = start + len(list(run))
            axes.axvspan(borders[start], borders[stop], color=_STATES[state][0], linewidth=0)
            start = stop
    axes.set(ylim=(0, 1), yticks=[], xlabel=boundary.label)
    axes.spines[:].set_visible(True)
    axes.spines[:].set_linewidth(0.5)
    axes.set_ylabel(name, rotation=0, ha="right", va="center")


def iteration_history(
    path_stem: str | Path,
    rows: Sequence[Mapping[str, Any]] | Table,
    *,
    title: str = "",
    suffixes: Sequence[str] = _BOTH,
) -> None:
    """Draw the course of the iteration against the linear solves: sizes of the active sets, changed nodes, residual.

    Args:
        path_stem: where to write, without suffix.
        rows: one mapping a linear solve with the columns of ``history.csv`` (solve, outer, active_contact, slip_plus,
            slip_minus, changed, residual), or these columns as arrays of shape (n,), as ``read_csv`` gives them.
        title: what to say above the picture.
        suffixes: of the files to write.

    Raises:
        ValueError: there are no rows.
    """
    names = ("solve", "outer", "active_contact", "slip_plus", "slip_minus", "changed", "residual")
    data: dict[str, Floats] = {
        name: np.asarray(rows[name] if isinstance(rows, Mapping) else [row[name] for row in rows], dtype=np.float64)
        for name in names
    }
    solve = data["solve"]
    if not solve.size:
        raise ValueError("the history has no linear solves")
    size = min(3.5, max(1.2, 240 / solve.size))
    firsts = np.flatnonzero(np.diff(data["outer"])) + 1
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(min(7.2, max(4.4, 2.5 + 0.12 * solve.size)), 4.4), layout="constrained")
        grid = figure.add_gridspec(2, 1, height_ratios=(1.25, 1))
        upper = figure.add_subplot(grid[0])
        lower = figure.add_subplot(grid[1], sharex=upper)
        upper.bar(solve, data["changed"], width=0.8, color=_RULE, linewidth=0, label="nodes that change state")
        curves: list[tuple[str, str, dict[str, Any]]] = [
            ("active_contact", r"contact $|\mathcal{A}_c|$", {"color": _INK, "marker": "o", "lw": 1.3})
        ]
        if np.any(data["slip_plus"]) or np.any(data["slip_minus"]):
            plus: dict[str, Any] = {"color": _ORANGE, "marker": "^", "lw": 2.2}
            minus: dict[str, Any] = {"color": _BLUE, "marker": "v", "lw": 1.1, "ls": (0, (3, 1.5)), "mfc": "white"}
            curves.append(("slip_plus", r"slip $+$  $|\mathcal{A}_{f,+}|$", plus))
            curves.append(("slip_minus", r"slip $-$  $|\mathcal{A}_{f,-}|$", minus))
        for name, label, style in curves:
            upper.plot(solve, data[name], label=label, markersize=size, **style)
        upper.set(ylabel="number of nodes", ylim=(0, None))
        upper.tick_params(axis="x", length=0, labelbottom=False)
        residual = np.where(data["residual"] > 0, data["residual"], np.nan)
        # A new outer iteration is a new problem: its residuals are a line of their own.
        broken = [np.insert(values, firsts, np.nan) for values in (solve, residual)]
        lower.semilogy(*broken, color=_INK, marker="o", markersize=size, lw=1.3)
        lower.set(ylabel="relative residual", xlabel="linear solve", xlim=(solve[0] - 0.6, solve[-1] + 0.6))
        lower.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        _mark_outer(upper, lower, solve, data["outer"], firsts)
        figure.legend(*upper.get_legend_handles_labels(), loc="outside lower center", ncols=2, columnspacing=3)
        _finish(figure, path_stem, title, suffixes)


_QUANTITIES = {
    "energy": ("displacement (energy)", _INK, "o", "-"),
    "pressure": ("contact pressure", _BLUE, "s", "--"),
    "peak": ("largest pressure", _ORANGE, "^", "-."),
    "zone": ("ends of the contact zone", _MUTED, "D", ":"),
}


def price_list(
    path_stem: str | Path, rows: Sequence[Mapping[str, Any]], *, title: str = "", suffixes: Sequence[str] = _BOTH
) -> None:
    """Estimated errors against the time that they cost, one point a mesh; the next mesh as an open marker.

    Args:
        path_stem: the files without their ending.
        rows: the rows of price_list.csv, coarsest mesh first, the predicted one last.
        title: what was solved.
        suffixes: of the files to write.
    """
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(4.6, 3.3), layout=ConstrainedLayoutEngine())
        axes = figure.add_subplot()
        for name, (label, colour, marker, style) in _QUANTITIES.items():
            points = [(row["seconds"], row[name], row["predicted"]) for row in rows if row[name]]
            if not points:
                continue
            seconds, errors, _ = zip(*points, strict=True)
            axes.plot(seconds, errors, style, color=colour, linewidth=1.2, label=label)
            for second, error, predicted in points:
                face = "white" if predicted else colour
                axes.plot([second], [error], marker, color=colour, markerfacecolor=face, markersize=4.5)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("seconds for the mesh (open: the next one, predicted)")
        axes.set_ylabel("estimated relative error")
        axes.grid(visible=True, which="major", color=_RULE, linewidth=0.4)
        axes.legend()
        _finish(figure, path_stem, title, suffixes)


def load_steps(path_stem: str | Path, steps: Table, *, title: str = "", suffixes: Sequence[str] = _BOTH) -> None:
    """Draw the forces of the foundation on the body step by step, and the friction force against the motion.

    Args:
        path_stem: where to write, without suffix.
        steps: columns of ``steps.csv`` of a scene with contact, each of shape (n,).
        title: what to say above the picture.
        suffixes: of the files to write.
    """
    names = ("contact_force_x", "contact_force_y", "friction_force_x", "friction_force_y")
    forces = {name: np.asarray(steps[name], dtype=np.float64) for name in names}
    scale = _largest(*forces.values())
    power = _readable(scale)
    styles = (_MULTIPLIER, _MULTIPLIER | {"color": _MUTED}, _MOTION, _MOTION | {"color": _ORANGE})
    friction = max(names[2:], key=lambda name: _largest(forces[name]))
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(4.4, 4.6), layout="constrained")
        upper, lower = figure.subplots(2, 1)
        for name, style in zip(names, styles, strict=True):
            if _largest(forces[name]) > 1e-6 * scale:  # what is left by symmetry and round-off is not shown
                kind, _, axis = name.rpartition("_")
                label = f"{kind.replace('_', ' ')}, {'first' if axis == 'x' else 'second'} component"
                upper.plot(steps["step"], forces[name] * 10.0**power, marker="o", markersize=2.5, label=label, **style)
        upper.set(xlabel="load step", ylabel=f"force per thickness{_times(power)}")
        upper.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        upper.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0))
        motion = np.asarray(steps["mean_tangential_displacement"], dtype=np.float64)
        out = _readable(_largest(motion))
        lower.plot(motion * 10.0**out, forces[friction] * 10.0**power, marker="o", markersize=2.5, **_MULTIPLIER)
        lower.set(
            xlabel=f"mean tangential displacement{_times(out)}", ylabel=f"{friction.replace('_', ' ')}{_times(power)}"
        )
        lower.locator_params(axis="x", nbins=6)
        for axes in (upper, lower):
            axes.axhline(0.0, color=_RULE, linewidth=0.6, zorder=0)
        _finish(figure, path_stem, title, suffixes)


_MOST_FRAMES = 120
_GIF_DPI = 110
_FRAMES_A_SECOND = 4


def step_animation(path: str | Path, table: Table, *, title: str = "") -> None:
    """Write a GIF of pressure, shear and states along the contact boundary, one frame a load step.

    Scales stay the same from frame to frame.  Of more than 120 steps every second, third, ... is shown, and the last.

    Args:
        path: the file.
        table: columns of ``contact_steps.csv``, each of shape (n,): those of ``contact.csv`` that
            ``boundary_profiles`` needs but for the lengths, and ``step``.
        title: what to say above the picture.

    Raises:
        ValueError: the table has no rows.
    """
    numbers = np.asarray(table["step"], dtype=np.float64)
    steps = np.unique(numbers)
    if not steps.size:
        raise ValueError("the table has no load steps")
    stride = math.ceil(steps.size / _MOST_FRAMES)
    stresses = [np.asarray(table[name], dtype=np.float64) for name in ("pressure", "shear")]
    power = _readable(_largest(*stresses))
    every = np.concatenate([column[np.isfinite(column)] for column in stresses]) * 10.0**power
    low, high = float(every.min(initial=0.0)), float(every.max(initial=0.0))
    margin = 0.06 * (high - low) or 1.0
    with mpl.rc_context(_STYLE):
        count = len(dict.fromkeys(table["boundary"]))
        figure = Figure(figsize=(4.4, 2.5 * count + 0.5), layout=ConstrainedLayoutEngine(hspace=0.0, h_pad=0.03))
        grid = figure.add_gridspec(2 * count, 1, height_ratios=[1, 0.07] * count)
        panels = []
        for i in range(count):
            panel = figure.add_subplot(grid[2 * i])
            panels.append((panel, figure.add_subplot(grid[2 * i + 1], sharex=panel)))
        used = {key for boundary in _boundaries(table) for key in boundary.states(of_friction=False)}
        patches = [
            Patch(facecolor=color, edgecolor=_MUTED, linewidth=0.5, label=label)
            for key, (color, label) in _STATES.items()
            if key in used
        ]
        figure.legend(handles=patches, loc="outside lower center", ncols=max(1, len(patches)), handlelength=1.6)
        heading = figure.suptitle(" ", fontsize=9)
        writer = PillowWriter(fps=_FRAMES_A_SECOND)
        with writer.saving(figure, str(path), _GIF_DPI):
            for step in (*steps[:-1:stride], steps[-1]):
                here = {name: np.asarray(column)[numbers == step] for name, column in table.items()}
                for (panel, strip), boundary in zip(panels, _boundaries(here), strict=True):
                    panel.clear()
                    strip.clear()
                    _stress_panel(panel, boundary, power, boundary.name if count > 1 else "")
                    panel.set_ylim(low - margin, high + margin)
                    _state_strip(strip, boundary, boundary.states(of_friction=False), "")
                heading.set_text(f"{title + ', ' if title else ''}step {step:.0f} of {steps[-1]:.0f}")
                writer.grab_frame()
                figure.set_layout_engine("none")  # the first frame has placed everything, and it is slow


def _stress_panel(axes: Axes, boundary: _Boundary, power: int, name: str) -> None:
    """Pressure, shear and its bounds, one scale for all."""
    pressure, shear, bound = (boundary.floats(key) * 10.0**power for key in ("pressure", "shear", "bound"))
    if boundary.has_friction:
        boundary.draw(axes, bound, **_LIMIT, label=r"friction bounds $\pm\,\mathfrak{F}\,g$")
        boundary.draw(axes, -bound, **_LIMIT)
        boundary.draw(axes, shear, **_MOTION, label=r"shear stress $\mu$")
    boundary.draw(axes, pressure, **_MULTIPLIER, label=r"contact pressure $\lambda$")
    _finish_panel(axes, boundary, name, [pressure, shear], math.inf)
    axes.set_ylabel(f"stress{_times(power)}")


def _mark_outer(upper: Axes, lower: Axes, solve: Floats, outer: Floats, firsts: npt.NDArray[np.intp]) -> None:
    """Lines between outer iterations, their numbers on top as far as they have room."""
    if not firsts.size:
        return
    borders = [solve[0] - 0.6, *(0.5 * (solve[firsts - 1] + solve[firsts])), solve[-1] + 0.6]
    for axes in (upper, lower):
        for border in borders[1:-1]:
            axes.axvline(border, color=_MUTED, linewidth=0.5 if firsts.size < 30 else 0.25, zorder=0)
    room = 0.03 * (borders[-1] - borders[0])
    ticks, labels, free_from = [], [], -math.inf
    for (left, right), number in zip(itertools.pairwise(borders), outer[[0, *firsts]], strict=True):
        middle = 0.5 * (left + right)
        if middle >= free_from:
            ticks.append(middle)
            labels.append(f"{number:.0f}")
            free_from = middle + room
    top = upper.secondary_xaxis("top")
    top.set_ticks(ticks, labels)
    top.tick_params(length=0, pad=1)
    top.spines["top"].set_visible(False)
    top.set_xlabel("outer iteration")


def _number(value: float) -> str:
    """A factor for mathtext: plain digits if they are few, else m x 10^k."""
    if value == 0 or 0.01 <= abs(value) < 1e5:
        return f"{value:.6g}"
    digits, power = f"{value:.5e}".split("e")
    digits = f"{float(digits):g}"
    return rf"10^{{{int(power)}}}" if digits == "1" else rf"{digits}\cdot 10^{{{int(power)}}}"


def _finish(figure: Figure, path_stem: str | Path, title: str, suffixes: Sequence[str] = _BOTH) -> None:
    """Title the figure and write it; without dates, so that the same data give the same files."""
    if title:
        figure.suptitle(title, x=0.012, ha="left", fontsize=9)
    stem = Path(path_stem)
    stem.parent.mkdir(parents=True, exist_ok=True)
    dateless = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    for suffix in suffixes:
        dpi = _PNG_DPI if suffix == ".png" else _PDF_DPI
        figure.savefig(stem.with_name(f"{stem.name}{suffix}"), dpi=dpi, metadata=dateless.get(suffix))
