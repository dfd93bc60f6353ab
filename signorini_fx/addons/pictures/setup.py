"""What a scene prescribes and where: the mesh, boundaries with their names, loads, supports and contact."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation, Text

from signorini_fx.addons.pictures.marks import draw_lengths
from signorini_fx.addons.pictures.style import (
    BLUE,
    INK,
    MUTED,
    ORANGE,
    SCREEN,
    STYLE,
    Floats,
    finish,
    math_number,
    plain,
)
from signorini_fx.addons.pictures.tones import spaced
from signorini_fx.mechanics.statement.units import bracketed, labelled, unit
from signorini_fx.tuned import (
    ARROWS_ALONG,
    COLOURS_ABOVE,
    LIGHTER_COLOURS,
    LONGEST_ARROW_OF_SETUP,
    MOST_ARROWS,
    MOST_STROKES,
    MOST_SUPPORTS,
    PIXELS_PER_INCH,
    SETUP_INCHES,
    SMALLEST_ARROW,
)

_BODY, _NAMED, _LOAD_COLOUR = "#e4e4e4", "#8a8a8a", "#cc79a7"
# By the label of an effect; another effect has the last colour above.
_COLOURS = {"contact": ORANGE, "traction": BLUE, "displacement": "#009e73"}
_FEW = 12  # facets of a boundary: each has an arrow
_MOVES = 6  # a name is moved by so many of its heights at most
_ON_ANOTHER = 3  # a name is moved by less than so many of its heights if it lies on another boundary
_ALONG = 120  # points along a facet as long as the body, by which it is found whether a name lies on it
_MOST_EDGES = 60_000  # of cells: more would be a black body


@dataclass(frozen=True)
class NamedBoundary:
    """A named boundary; it may have no facets.

    Attributes:
        name: in the mesh.
        kinds: labels of the effects that act on it, such as ``traction``.
        corners: of each facet, along its perimeter, length, shape (f, k, d).
        normals: outward unit normals, shape (f, d).
        load: force per area at the middle of each facet, with a load factor of 1, shape (f, d).
        moved: the same of the prescribed displacement, length; nought where it is free.
        held: names of the components of the displacement that are prescribed: x, y, z or normal.
        grounded: whether it may touch a rigid foundation.
    """

    name: str
    kinds: tuple[str, ...]
    corners: Floats
    normals: Floats
    load: Floats
    moved: Floats
    held: tuple[str, ...] = ()
    grounded: bool = False

    @property
    def middles(self) -> Floats:
        """Of its facets, shape (f, d)."""
        return np.asarray(self.corners.mean(axis=1))

    @property
    def colour(self) -> str:
        """Of the effect that says most about it."""
        first = [_COLOURS[kind] for kind in _COLOURS if kind in self.kinds]
        return (first or [_LOAD_COLOUR if self.kinds else _NAMED])[0]


@dataclass(frozen=True)
class Setup:
    """A body with its boundaries, as a scene or a mesh file has them.

    Attributes:
        title: any text.
        polygons: corners of cells in 2D, or of facets of the outer surface in 3D, counterclockwise as seen
            from outside, shape (m, k, d).
        boundaries: those with a name.
        units: for labels, see ``signorini_fx.mechanics.statement.units``.
        foundations: in 2D, lines of the foundations that have shapes, lengths, each of shape (k, 2).
    """

    title: str
    polygons: Floats
    boundaries: Sequence[NamedBoundary]
    units: Mapping[str, str] = field(default_factory=dict)
    foundations: Sequence[Floats] = ()

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return int(self.polygons.shape[2])

    def draw(self, path_stem: str | Path, suffixes: Sequence[str] = SCREEN) -> None:
        """Write the picture.

        Boundaries have the colour of what acts on them: orange contact, blue loads, green supports.  Arrows are loads
        by their size, and prescribed displacements that are not nought, pale on hidden sides; triangles point along the
        components that are held, and strokes say that all are.

        Args:
            path_stem: where to write, without suffix.
            suffixes: of the files to write.

        Raises:
            PictureError: in 3D, PyVista is missing.
        """
        with labelled(self.units), mpl.rc_context(STYLE):
            figure, axes, flat, toward = self._plane() if self.dimension == 2 else self._space()
            names = self._marks(axes, flat, toward)
            self._legend(figure)
            obstacles = self._obstacles(axes) if self.dimension == 2 else []
            _spread(figure, names, obstacles)
            finish(figure, path_stem, plain(self.title), suffixes)

    # --- the body ----------------------------------------------------------------------------------------------------

    def _plane(self) -> tuple[Figure, Axes, Callable[[Any], Any], None]:
        points = self.polygons.reshape(-1, 2)
        low, high = points.min(axis=0), points.max(axis=0)
        size = high - low
        aside = (0.17 if any(boundary.kinds for boundary in self.boundaries) else 0.05) * float(size.max())
        low, high = low - aside, high + aside
        width, height = (high - low) * SETUP_INCHES / float((high - low).max())
        figure = Figure(figsize=(max(width, 3.4), height + 0.8), layout="constrained")
        axes = figure.subplots()
        thin = 0.3 if len(self.polygons) <= _MOST_EDGES else 0.0
        axes.add_collection(
            PolyCollection(list(self.polygons), facecolor=_BODY, edgecolor="white" if thin else _BODY, linewidth=thin)
        )
        for boundary in self.boundaries:
            if boundary.kinds:
                axes.add_collection(
                    LineCollection(list(boundary.corners), colors=boundary.colour, linewidths=2.2, zorder=4)
                )
            else:
                axes.add_collection(LineCollection(list(boundary.corners), colors=_NAMED, linewidths=1.2, zorder=3))
        axes.add_collection(LineCollection(list(self.foundations), colors=ORANGE, linewidths=1.2, zorder=2))
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set(xlabel=f"$x${bracketed('length')}", ylabel=f"$y${bracketed('length')}")
        axes.spines[:].set_visible(False)
        return figure, axes, np.asarray, None

    def _space(self) -> tuple[Figure, Axes, Callable[[Any], Any], Floats]:
        """In perspective; the colours of the boundaries are those of their facets."""
        from signorini_fx.addons.pictures import view
        from signorini_fx.addons.pictures.solid import Solid, image

        colours = list(dict.fromkeys((_BODY, *(entry.colour for entry in self.boundaries if entry.kinds))))
        size = float(np.linalg.norm(np.ptp(self.polygons.reshape(-1, 3), axis=0)))
        patches = [(self.polygons, 0)]
        patches += [
            (entry.corners + COLOURS_ABOVE * size * entry.normals[:, None], colours.index(entry.colour))
            for entry in self.boundaries
            if entry.kinds
        ]
        points = np.concatenate([corners for corners, _ in patches])
        k = points.shape[1]
        polygons = np.arange(points.shape[0] * k).reshape(-1, k)
        fan = np.concatenate([polygons[:, [0, j, j + 1]] for j in range(1, k - 1)])
        colour = np.concatenate([np.full(len(corners), number) for corners, number in patches])
        points = points.reshape(-1, 3)
        body = Solid(
            points,
            fan,
            np.repeat(np.tile(colour, k - 2)[:, None], 3, axis=1).astype(np.float64),
            ListedColormap([_BODY, *(_lighter(entry) for entry in colours[1:]), _BODY]),
            (-0.5, len(colours) + 0.5),
            np.stack((polygons, np.roll(polygons, -1, axis=1)), axis=2).reshape(-1, 2)
            if len(polygons) <= _MOST_EDGES
            else np.empty((0, 2), dtype=np.int64),
        )
        seen = view.oblique()
        around = 0.1 * np.ptp(self.polygons.reshape(-1, 3), axis=0).max()
        shown = np.concatenate([points + around * step for step in (*np.eye(3), *-np.eye(3))])
        camera = view.Camera.on(seen, shown)
        inch = SETUP_INCHES / (2 * float(camera.half.max()))
        figure = Figure(figsize=(2 * inch * camera.half[0], 2 * inch * camera.half[1] + 0.8), layout="constrained")
        axes = figure.subplots()
        picture = image(body, camera, round(2 * inch * float(camera.half[0]) * PIXELS_PER_INCH))
        right, top = camera.half
        axes.imshow(picture, extent=(-right, right, -top, top), aspect="equal")
        axes.set_axis_off()
        draw_lengths(axes, self.polygons.reshape(-1, 3), camera.flat, inch=inch)
        return figure, axes, camera.flat, seen.toward

    # --- what is on it -----------------------------------------------------------------------------------------------

    def _marks(self, axes: Axes, flat: Callable[[Any], Any], toward: Floats | None) -> list[Annotation]:
        """Arrows, supports and names, on the sides that face the viewer; the names are returned."""
        names = []
        (left_edge, right_edge), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        side = max(right_edge - left_edge, top - bottom)
        points = self.polygons.reshape(-1, self.dimension)
        size = float(np.ptp(points, axis=0).max())
        largest = max(
            (float(np.linalg.norm(boundary.load, axis=1).max(initial=0.0)) for boundary in self.boundaries), default=0
        )
        farthest = max(
            (float(np.linalg.norm(boundary.moved, axis=1).max(initial=0.0)) for boundary in self.boundaries), default=0
        )
        middle = flat(0.5 * (points.min(axis=0) + points.max(axis=0)))
        self._hatch(axes, size)
        for boundary in self.boundaries:
            front = np.full(len(boundary.corners), True) if toward is None else boundary.normals @ toward > 0
            hidden = not front.any()
            front |= hidden
            at, normals = boundary.middles[front], boundary.normals[front]
            if not len(at):
                continue
            rows = _spaced_rows(flat(at), side / MOST_ARROWS) if len(at) > _FEW else np.arange(len(at))
            for vectors, longest, colour in (
                (boundary.load, largest, BLUE),
                (boundary.moved, farthest, _COLOURS["displacement"]),
            ):
                if longest > 0:
                    arrows = np.asarray(vectors[front][rows] / longest)
                    self._arrows(axes, flat, at[rows], normals[rows], arrows, size, colour, hidden=hidden)
            if boundary.held and not hidden and not boundary.moved.any():
                rows = _spaced_rows(flat(at), side / MOST_SUPPORTS)
                _supports(axes, flat, at[rows], normals[rows], boundary.held, size)
            color, line = INK if boundary.kinds else MUTED, ":" if hidden else "-"
            names.append(self._name(axes, flat, boundary.name, at, normals, middle, side, color=color, linestyle=line))
        return names

    def _arrows(
        self,
        axes: Axes,
        flat: Callable[[Any], Any],
        at: Floats,
        normals: Floats,
        vectors: Floats,
        size: float,
        colour: str,
        *,
        hidden: bool,
    ) -> None:
        """Of vectors of length 1 at most; those into the body end at it, and the others begin there.

        Those on a hidden boundary are pale with hollow heads, because they are drawn on what hides it.
        """
        style = {"arrowstyle": "-|>", "linewidth": 1.1, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 8}
        style |= {"edgecolor": colour, "facecolor": "white" if hidden else colour, "alpha": 0.6 if hidden else 1.0}
        into = np.einsum("ij,ij->i", vectors, normals) < -1e-12
        along = np.abs(np.einsum("ij,ij->i", vectors, normals)) < 0.3 * np.linalg.norm(vectors, axis=1)
        at = at + ARROWS_ALONG * size * along[:, None] * normals
        for point, vector, inwards in zip(at, LONGEST_ARROW_OF_SETUP * size * vectors, into, strict=True):
            if np.linalg.norm(vector) < SMALLEST_ARROW * LONGEST_ARROW_OF_SETUP * size:
                continue
            start, end = (point - vector, point) if inwards else (point, point + vector)
            axes.annotate("", flat(end), flat(start), arrowprops=style, annotation_clip=False, zorder=6)

    def _name(
        self,
        axes: Axes,
        flat: Callable[[Any], Any],
        name: str,
        at: Floats,
        normals: Floats,
        middle: Floats,
        side: float,
        *,
        color: str,
        linestyle: str,
    ) -> Annotation:
        """Next to the facet in the middle of the boundary: in 2D within the body, where there are no arrows."""
        places = flat(at)
        row = int(np.argmin(np.linalg.norm(at - at.mean(axis=0), axis=1)))
        away = flat(at[row] + 1e-3 * normals[row] * side) - places[row]
        if np.linalg.norm(away) < 3e-4 * side:
            away = places[row] - middle
        away = away / (float(np.linalg.norm(away)) or 1.0) * (-1 if self.dimension == 2 else 1)
        line = {"color": MUTED, "linewidth": 0.6, "linestyle": linestyle, "shrinkA": 1, "shrinkB": 0}
        return axes.annotate(
            plain(name),
            places[row],
            (8.0 if self.dimension == 2 else 30.0) * away,
            textcoords="offset points",
            ha="right" if away[0] < -0.5 else "left" if away[0] > 0.5 else "center",
            va="top" if away[1] < -0.5 else "bottom" if away[1] > 0.5 else "center",
            fontsize=8.5,
            color=color,
            arrowprops={"arrowstyle": "-", **line, "visible": self.dimension == 3},
            bbox={"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.75},
            annotation_clip=False,
            zorder=8,
        )

    def _obstacles(self, axes: Axes) -> list[Callable[[], tuple[Floats, bool]]]:
        """Of each name in 2D: points along the other boundaries, in pixels, and whether nothing acts on its own
        one, whose name may be on the outer side then; the pixels are known when the figure has been laid out.
        """
        shown = [boundary for boundary in self.boundaries if len(boundary.corners)]
        size = float(np.ptp(self.polygons.reshape(-1, self.dimension), axis=0).max())

        def of(target: NamedBoundary) -> Callable[[], tuple[Floats, bool]]:
            bare = not target.kinds
            outlines = [_along(boundary.corners, size) for boundary in shown if boundary is not target]
            points = np.concatenate(outlines) if outlines else np.empty((0, 2))
            return lambda: (np.asarray(axes.transData.transform(points)), bare)

        return [of(boundary) for boundary in shown]

    def _hatch(self, axes: Axes, size: float) -> None:
        """In 2D, strokes on the outer side of boundaries, where the foundation is."""
        for boundary in self.boundaries:
            if self.dimension == 3 or not boundary.grounded or not len(boundary.corners):
                continue
            rows = (
                _spaced_rows(boundary.middles, size / MOST_STROKES)
                if len(boundary.corners) > _FEW
                else np.arange(len(boundary.corners))
            )
            start, out = boundary.middles[rows], boundary.normals[rows]
            end = start + 0.025 * size * (out + 0.8 * np.column_stack((out[:, 1], -out[:, 0])))
            strokes = LineCollection(list(np.stack((start, end), axis=1)), colors=ORANGE, linewidths=0.8, zorder=4)
            axes.add_collection(strokes)

    def _largest(self, vectors: str) -> float:
        """The length of the largest of all vectors."""
        sizes = [np.linalg.norm(getattr(boundary, vectors), axis=1).max(initial=0.0) for boundary in self.boundaries]
        return float(max(sizes, default=0.0))

    def _legend(self, figure: Figure) -> None:
        """What the colours mean, and how large the longest arrows are."""
        colours = {}
        for boundary in self.boundaries:
            for kind in boundary.kinds:
                colours[kind] = _COLOURS.get(kind, _LOAD_COLOUR)
        handles: list[Any] = [
            Line2D([], [], color=colour, linewidth=2.2, label=kind) for kind, colour in colours.items()
        ]
        for vectors, kind, quantity in (("load", "traction", "stress"), ("moved", "displacement", "length")):
            if largest := self._largest(vectors):
                text = f"longest arrow: ${math_number(float(f'{largest:.3g}'))}$ {plain(unit(quantity))}".rstrip()
                line = Line2D([], [], color=_COLOURS[kind], linewidth=1.1, marker=">", markersize=4, label=text)
                handles.append(line)
        if handles:
            figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 3))


def _lighter(colour: str) -> tuple[float, ...]:
    return tuple(LIGHTER_COLOURS + (1 - LIGHTER_COLOURS) * share for share in to_rgb(colour))


def _spread(
    figure: Figure, names: Sequence[Annotation], obstacles: Sequence[Callable[[], tuple[Floats, bool]]] = ()
) -> None:
    """Move names that cover others up or down, to the nearest free place.

    In 2D a name that lies across another boundary is taken for its name: then it is moved too, to the outer side
    of its own one if nothing acts there, and one that has left its place has a line to its boundary.

    Args:
        figure: with the names.
        names: of boundaries.
        obstacles: in 2D, of each name, see ``Setup._obstacles``.
    """
    figure.draw_without_rendering()
    ticks = [tick for axes in figure.axes for tick in (*axes.get_xticklabels(), *axes.get_yticklabels())]
    taken = [tick.get_window_extent() for tick in ticks if obstacles and tick.get_text()]
    shifts = sorted(range(-_MOVES, _MOVES + 1), key=abs)
    for k, name in enumerate(names):
        box = Text.get_window_extent(name)
        others, bare = obstacles[k]() if obstacles else (np.empty((0, 2)), False)
        anchor = figure.axes[0].transData.transform(name.xy) if obstacles else np.zeros(2)
        outside = box.translated(*_across(box, anchor, name.xyann))

        def cost(option: tuple[Any, int, bool], others: Floats = others) -> float:
            """Of covering other names, of lying on another boundary, and of rows away from its place."""
            within = np.all((others > option[0].min) & (others < option[0].max), axis=1).any()
            covers = any(option[0].overlaps(cover) for cover in taken)
            return float(1000.0 * covers + _ON_ANOTHER * within + option[2] + abs(option[1]))

        places = [(box.translated(0.0, m * (box.height + 2)), m, False) for m in shifts]
        places += [(outside.translated(0.0, m * (outside.height + 2)), m, True) for m in shifts if bare]
        free = min(places, key=cost)
        taken.append(free[0])
        moved = (np.array(free[0].min) - box.min) * 72.0 / figure.dpi
        right, up = name.xyann
        name.xyann = right + moved[0], up + moved[1]
        if obstacles and abs(free[1]) > 1 and name.arrow_patch is not None:
            name.arrow_patch.set_visible(True)


def _across(box: Any, anchor: Floats, away: tuple[float, float]) -> Floats:
    """How far a name is moved to the other side of its boundary, in pixels, shape (2,).

    Args:
        box: of the name.
        anchor: the place of the boundary that the name is beside, pixels, shape (2,).
        away: from there to the name.
    """
    back = -2 * (np.array([(box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2]) - anchor)
    return np.where(np.abs(away) > 0.5 * np.abs(away).max(initial=0.0), back, 0.0)


def _along(corners: Floats, size: float) -> Floats:
    """Points along facets of the plane, of shape (f, 2, 2), so close that no name of a body of this size, length, lies
    between them.
    """
    longest = float(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1).max())
    share = np.linspace(0.0, 1.0, 2 + int(_ALONG * longest / size))[:, None, None]
    return np.asarray(corners[:, 0] + share * (corners[:, 1] - corners[:, 0])).reshape(-1, 2)


def _spaced_rows(points: Floats, spacing: float) -> npt.NDArray[np.intp]:
    """Rows of points of shape (m, 2) so far apart, from one end of them to the other."""
    return spaced(points, np.lexsort(np.round(points.T / spacing, 6)), spacing)


def _supports(
    axes: Axes, flat: Callable[[Any], Any], at: Floats, normals: Floats, held: Sequence[str], size: float
) -> None:
    """A triangle along each component that is held, outside of the body; strokes where all are."""
    long, wide = 0.028 * size, 0.011 * size
    clamped = len(held) == at.shape[1]
    point: Any
    normal: Any
    for point, normal in zip(at, normals, strict=True):
        for name in held[:1] if clamped else held:
            along = -normal if clamped or name == "normal" else np.eye(len(normal))["xyz".index(name)]
            if along @ normal > 0:
                along = -along
            ends = np.stack([flat(point), flat(point - long * along)])
            back = ends[1] - ends[0]
            across = np.array([-back[1], back[0]])
            if not (far := float(np.linalg.norm(across))) > 0:
                continue
            across *= wide / far
            if clamped:
                ends[1] += 2.0 * across
                axes.plot(*ends.T, color=_COLOURS["displacement"], linewidth=0.9, zorder=5)
            else:
                triangle = np.stack((ends[0], ends[1] + across, ends[1] - across))
                axes.fill(*triangle.T, facecolor="white", edgecolor=_COLOURS["displacement"], linewidth=0.9, zorder=5)
