"""The picture of a problem: the mesh, boundaries with their names, loads, supports and contact."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from signorini_fx.addons.pictures import view
from signorini_fx.addons.pictures.marks import draw_lengths, spaced
from signorini_fx.addons.pictures.style import (
    BLUE,
    IN_DATA_UNITS,
    INK,
    ORANGE,
    SCREEN,
    STYLE,
    finish,
    number,
    plain,
)
from signorini_fx.arrays import Array, diagonal, inner, sides_of
from signorini_fx.mechanics.statement.units import bracketed, labelled, unit
from signorini_fx.tuned import (
    BODY_INCHES,
    COLOURS_ABOVE,
    LONGEST_ARROW_OF_SETUP,
    MOST_ARROWS,
    MOST_STROKES,
    SMALLEST_ARROW,
)

_BODY = "#e4e4e4"
_COLOURS = (
    ORANGE,
    BLUE,
    "#009e73",
    "#cc79a7",
    "#56b4e9",
    "#d55e00",
    "#8c6d1f",
    "#6a51a3",
    "#7a7a7a",
    "#b2a800",
)
_LINES = (
    "-",
    (0, (4, 1.5)),
    (0, (1, 1)),
)  # of the first ten boundaries, of the next ten, and of all others
_LETTERS, _ROW = 14.0, 0.17  # of a legend: letters in an inch, inches of a row
# How the names of boundaries begin that are numbers, which stand on the faces in 3D.
_NUMBERED = "boundary_"
_ON_FACE: dict[str, Any] = {
    "ha": "center",
    "va": "center",
    "fontsize": 8,
    "color": INK,
    "zorder": 7,
    "bbox": {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.8},
}
_MOST_EDGES = 60_000  # of cells: more would be a black body


@dataclass(frozen=True)
class NamedBoundary:
    """A named boundary; it may have no facets."""

    name: str  # in the mesh
    kinds: tuple[str, ...]  # labels of the effects that act on it, such as ``traction``
    corners: Array  # of each facet, along its perimeter, length, shape (f, k, d)
    normals: Array  # outward unit normals, shape (f, d)
    load: Array  # force per area at the middle of each facet, with a load factor of 1, shape (f, d)
    moved: Array  # the same of the prescribed displacement, length; nought where it is free
    held: tuple[
        str, ...
    ] = ()  # names of the components of the displacement that are prescribed: x, y, z or normal
    grounded: bool = False  # whether it may touch a rigid foundation
    partners: tuple[str, ...] = ()  # names of the boundaries that it may touch

    @property
    def middles(self) -> Array:
        """The middles of the facets, shape (f, d)."""
        return self.corners.mean(axis=1)

    @property
    def label(self) -> str:
        """The name of the boundary with its loads and supports, as in ``left: displacement (x,
        y)``.
        """
        more = {"displacement": f" ({', '.join(self.held)})"}
        if self.partners:
            more["contact"] = f" with {', '.join(self.partners)}"
        acting = [f"{kind}{more.get(kind, '')}" for kind in self.kinds]
        return plain(f"{self.name}: {', '.join(acting)}" if acting else self.name)

    @property
    def marker(self) -> str:
        """The marker of supports: a square if all components of the displacement are prescribed, a
        circle if some are, otherwise "".
        """
        return "" if not self.held else "s" if len(self.held) == self.corners.shape[2] else "o"


@dataclass(frozen=True)
class Setup:
    """A body with its boundaries, as a scene or a mesh file has them."""

    title: str  # any text
    # corners of cells in 2D, or of facets of the outer surface in 3D, counterclockwise as seen from
    # outside, shape (m, k, d)
    polygons: Array
    boundaries: Sequence[NamedBoundary]  # those with a name
    units: Mapping[str, str] = field(
        default_factory=dict
    )  # for labels, see ``signorini_fx.mechanics.statement.units``
    # in 2D, lines of the foundations that have shapes, lengths, each of shape (k, 2)
    foundations: Sequence[Array] = ()
    # what acts on no boundary: its name, the point where it does, length, shape (d,), None: in all
    # of the body, and its direction, shape (d,)
    arrows: Sequence[tuple[str, Array | None, Array]] = ()

    def draw(self, path_stem: str | Path, suffixes: Sequence[str] = SCREEN) -> None:
        """Write the picture.

        Each boundary has a colour, and the legend names what acts on it.  Arrows show loads to
        scale, and prescribed displacements that are not zero, pale on hidden sides.  Squares and
        circles are supports.

        Raises:
            PictureError: in 3D, PyVista is missing.
        """
        with labelled(self.units), mpl.rc_context(STYLE):
            if self.polygons.shape[2] == 2:
                figure, flat, toward = self._plane()
            else:
                figure, flat, toward = self._space()
            self._mark(figure.axes[0], flat, toward)
            self._legend(figure)
            # the layout needs a second pass if equal axes do not fill their place
            figure.draw_without_rendering()
            finish(figure, path_stem, plain(self.title), suffixes)

    @property
    def _coloured(self) -> list[tuple[NamedBoundary, str, str | tuple[float, tuple[float, ...]]]]:
        """Each boundary with facets, its colour, and its line style; both sides of a pair are
        alike.
        """
        shown = [boundary for boundary in self.boundaries if len(boundary.corners)]
        count = len(_COLOURS)
        styles = _LINES if self.polygons.shape[2] == 2 else _LINES[:1]  # in 3D facets are coloured
        places = {boundary.name: k for k, boundary in enumerate(shown)}
        first = [
            min([k, *(places[name] for name in boundary.partners if name in places)])
            for k, boundary in enumerate(shown)
        ]
        # Of more boundaries than colours those on which something acts have their own.
        order = list(dict.fromkeys(sorted(first, key=lambda k: not shown[k].kinds)))
        found = list[tuple[NamedBoundary, str, str | tuple[float, tuple[float, ...]]]]()
        for boundary, k in zip(shown, map(order.index, first), strict=True):
            found.append((boundary, _COLOURS[k % count], styles[min(k // count, len(styles) - 1)]))
        return found

    @property
    def _size(self) -> float:
        """The longest side of the body."""
        return float(np.ptp(self.polygons.reshape(-1, self.polygons.shape[2]), axis=0).max())

    def _plane(self) -> tuple[Figure, Callable[[Array], Array], None]:
        points = self.polygons.reshape(-1, 2)
        aside = (0.17 if self._acts else 0.05) * self._size
        low = points.min(axis=0) - aside
        high = points.max(axis=0) + aside
        width, height = (high - low) * BODY_INCHES / float((high - low).max())
        figure = Figure(figsize=(max(width, 3.4), height + 0.6), layout="constrained")
        axes = figure.subplots()
        edges: dict[str, Any] = (
            {"edgecolor": "white", "linewidth": 0.3}
            if len(self.polygons) <= _MOST_EDGES
            else {"edgecolor": _BODY}
        )
        axes.add_collection(PolyCollection(list(self.polygons), facecolor=_BODY, **edges))
        for boundary, colour, line in self._coloured:
            axes.add_collection(
                LineCollection(
                    list(boundary.corners),
                    colors=colour,
                    linewidths=2.4,
                    linestyles=[line],
                    zorder=4,
                )
            )
            if boundary.grounded:  # strokes on the side where the foundation is
                rows = _spaced_rows(boundary.middles, self._size / MOST_STROKES)
                start = boundary.middles[rows]
                out = boundary.normals[rows]
                end = start + 0.025 * self._size * (
                    out + 0.8 * np.column_stack((out[:, 1], -out[:, 0]))
                )
                strokes = list(np.stack((start, end), axis=1))
                axes.add_collection(
                    LineCollection(strokes, colors=colour, linewidths=0.8, zorder=4)
                )
        axes.add_collection(
            LineCollection(list(self.foundations), colors=ORANGE, linewidths=1.2, zorder=2)
        )
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set(xlabel=f"x{bracketed('length')}", ylabel=f"y{bracketed('length')}")
        axes.spines[:].set_visible(False)
        return figure, np.asarray, None

    def _space(self) -> tuple[Figure, Callable[[Array], Array], Array]:
        """Return the figure of a body in 3D with its facets in the colours of their boundaries, the
        projection onto the picture, and the direction towards the viewer.
        """
        from signorini_fx.addons.pictures.solid import Solid, figure_of, seen_parts

        above = COLOURS_ABOVE * diagonal(self.polygons.reshape(-1, 3))
        patches = [self.polygons]
        patches += [
            boundary.corners + above * boundary.normals[:, None] for boundary, *_ in self._coloured
        ]
        number = np.concatenate([np.full(len(corners), k) for k, corners in enumerate(patches)])
        points = np.concatenate(patches)
        k = points.shape[1]
        polygons = np.arange(len(points) * k).reshape(-1, k)
        fan = np.concatenate([polygons[:, [0, j, j + 1]] for j in range(1, k - 1)])
        edges = sides_of(polygons).reshape(-1, 2)
        body = Solid(
            points.reshape(-1, 3),
            fan,
            np.repeat(np.tile(number, k - 2)[:, None], 3, axis=1).astype(np.float64),
            (-0.5, len(patches) - 0.5),
            ListedColormap([_BODY, *(colour for _, colour, _ in self._coloured)]),
            edges if len(polygons) <= _MOST_EDGES else None,
        )
        seen = view.oblique()
        steps = 0.1 * self._size * np.concatenate((np.eye(3), -np.eye(3)))
        around = np.concatenate([body.points + step for step in steps])
        sights = [seen] if self._acts else [seen, view.oblique(122.0, -24.0)]
        cameras = [view.Camera.on(sight, around) for sight in sights]
        inch = BODY_INCHES / (2 * float(cameras[0].half.max()))
        figure, every = figure_of([body] * len(cameras), cameras, inch=inch)
        spread = replace(
            body,
            points=body.points[fan].reshape(-1, 3),
            triangles=np.arange(fan.size).reshape(-1, 3),
        )
        for axes, camera in zip(every, cameras, strict=True):
            draw_lengths(axes, self.polygons.reshape(-1, 3), camera)
            for part, place in seen_parts(spread, camera, len(patches)).items():
                if part and (name := self._coloured[part - 1][0].name).startswith(_NUMBERED):
                    x, y = place
                    axes.text(x, y, name.removeprefix(_NUMBERED), **_ON_FACE)
        return figure, cameras[0].flat, seen.toward

    @property
    def _acts(self) -> bool:
        """Whether something acts on a boundary."""
        return any(boundary.kinds for boundary in self.boundaries)

    def _mark(self, axes: Axes, flat: Callable[[Array], Array], toward: Array | None) -> None:
        """Draw arrows and supports on the sides that face the viewer, or on hidden sides if there
        are no others.
        """
        side = max(float(np.ptp(axes.get_xlim())), float(np.ptp(axes.get_ylim())))
        for boundary, colour, _ in self._coloured:
            front = (
                np.full(len(boundary.corners), True)
                if toward is None
                else boundary.normals @ toward > 0
            )
            hidden = not front.any()
            front |= hidden
            at = boundary.middles[front]
            normals = boundary.normals[front]
            rows = _spaced_rows(flat(at), side / MOST_ARROWS)
            alpha = 0.5 if hidden else 1.0
            drawn = colour if toward is None else INK  # on facets of this colour
            for vectors in ("load", "moved"):
                if longest := self._largest(vectors):
                    arrows = getattr(boundary, vectors)[front][rows] / longest
                    self._arrows(
                        axes, flat, at[rows], normals[rows], arrows, color=drawn, alpha=alpha
                    )
            if boundary.held and not boundary.moved.any():
                axes.plot(
                    *flat(at[rows]).T,
                    linestyle="none",
                    marker=boundary.marker,
                    markersize=4.5,
                    markerfacecolor="white",
                    markeredgecolor=colour,
                    alpha=alpha,
                    zorder=5,
                )

        self._draw_others(axes, flat)

    def _draw_others(self, axes: Axes, flat: Callable[[Array], Array]) -> None:
        """Draw a named arrow for each load that acts on no boundary, to its point, or from the
        middle of the body.
        """
        x = self.polygons.reshape(-1, self.polygons.shape[2])
        for name, point, vector in self.arrows:
            along = 1.5 * LONGEST_ARROW_OF_SETUP * self._size * vector / np.linalg.norm(vector)
            start = 0.5 * (x.min(axis=0) + x.max(axis=0)) if point is None else point - along
            ends = flat(np.stack((start, start + along)))
            if point is None and len(self.arrows) > 1:  # beside an arrow of the same axis
                ends = ends + 0.3 * (ends[1] - ends[0])[::-1] * (1.0, -1.0)
            tail, tip = ends
            style = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.6}
            axes.annotate("", tuple(tip), tuple(tail), arrowprops=style, annotation_clip=False)
            axes.text(tail[0], tail[1], plain(name), **_ON_FACE)

    def _arrows(
        self,
        axes: Axes,
        flat: Callable[[Array], Array],
        at: Array,
        normals: Array,
        vectors: Array,
        **style: str | float,
    ) -> None:
        """Draw arrows of vectors of length 1 at most; arrows into the body end at their point,
        others begin there.
        """
        lengths = np.linalg.norm(vectors, axis=1)
        outwards = inner(vectors, normals)
        along = np.abs(outwards) < 0.3 * lengths
        start = at + SMALLEST_ARROW * self._size * along[:, None] * normals
        steps = LONGEST_ARROW_OF_SETUP * self._size * vectors
        start = np.where((outwards < -1e-12)[:, None], start - steps, start)[
            lengths >= SMALLEST_ARROW
        ]
        ends = start + steps[lengths >= SMALLEST_ARROW]
        tails = flat(start)
        tips = flat(ends)
        arrows = axes.quiver(
            *tails.T, *(tips - tails).T, clip_on=False, zorder=6, **IN_DATA_UNITS, **style
        )
        arrows.set_in_layout(False)  # matplotlib takes their lengths for decorations of the axes

    def _largest(self, vectors: str) -> float:
        """Return the length of the longest vector, of ``load`` or ``moved``, on all boundaries."""
        sizes = [
            np.linalg.norm(getattr(boundary, vectors), axis=1).max(initial=0.0)
            for boundary in self.boundaries
        ]
        return float(max(sizes, default=0.0))

    def _legend(self, figure: Figure) -> None:
        """Draw a legend with the names of the boundaries, what acts on them, and the size of the
        longest arrows.
        """
        handles = []
        for boundary, colour, line in self._coloured:
            on_face = self.polygons.shape[2] == 3 and boundary.name.startswith(_NUMBERED)
            if on_face and not boundary.kinds:
                continue
            handles.append(
                Line2D(
                    [],
                    [],
                    color=colour,
                    linewidth=2.4,
                    linestyle=line,
                    marker=boundary.marker,
                    markersize=4.5,
                    markerfacecolor="white",
                    label=boundary.label,
                )
            )
        for vectors, kind, quantity in (
            ("load", "load", "stress"),
            ("moved", "displacement", "length"),
        ):
            if largest := self._largest(vectors):
                size = f"{number(float(f'{largest:.3g}'))} {plain(unit(quantity))}".rstrip()
                handles.append(
                    Line2D([], [], linestyle="none", label=f"longest arrow of a {kind}: {size}")
                )
        if handles:
            wide = max(len(str(handle.get_label())) for handle in handles)
            columns = max(1, min(len(handles), int(_LETTERS * figure.get_figwidth() / (wide + 8))))
            rows = -(-len(handles) // columns)
            figure.set_figheight(figure.get_figheight() + _ROW * rows)
            figure.legend(handles=handles, loc="outside lower center", ncols=columns)


def _spaced_rows(points: Array, spacing: float) -> npt.NDArray[np.intp]:
    """Return rows of points, shape (m, 2), that are at least ``spacing`` apart, chosen from one end
    of the points to the other.
    """
    return spaced(points, np.lexsort(np.round(points.T / spacing, 6)), spacing)
