"""The contact surface of a body in 3D, seen along its normal: pressure, shear, states and slip."""

from __future__ import annotations

import math
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.tri import Triangulation

from signorini_fx.addons.pictures import view
from signorini_fx.addons.pictures.boundary_profiles import (
    STATES,
    ContactColumns,
    by_boundary,
    state_legend,
)
from signorini_fx.addons.pictures.fields import Field
from signorini_fx.addons.pictures.marks import Tones, spaced, usual_range
from signorini_fx.addons.pictures.style import (
    IN_DATA_UNITS,
    INK,
    MUTED,
    STYLE,
    TIMES,
    VALUES,
    largest_of,
    number,
    plain,
    readable,
)
from signorini_fx.arrays import Array, Columns, Flags, Ints
from signorini_fx.mechanics.statement.units import bracketed, unit
from signorini_fx.tuned import CLOSED_IN_PICTURE, LONGEST_ARROW, MOST_ARROWS, SURFACE_MARGIN

# The rows of a facet in the order of VTK, as polygons of vertices.
_POLYGONS = {
    3: [[0, 1, 2]],
    4: [[0, 1, 2, 3]],
    9: [[0, 4, 8, 7], [4, 1, 5, 8], [8, 5, 2, 6], [7, 8, 6, 3]],
}
_UNTOUCHED = "#f0f0f0"
_WIDTH = 5.4  # inches
_LONG_NAME = 40  # letters of the name of a boundary behind which its title goes on in another line


@dataclass(frozen=True)
class VisibleSide(ContactColumns):
    """The part of one contact boundary that is visible from one side."""

    # of its facets that face the foundation along the direction of sight, rows of ``columns``, (m,
    # 3 or 4)
    polygons: Ints
    view: view.View  # along the outward normal, so from within the body

    def flat(self, begin: str) -> Array:
        """Return vectors at the nodes, projected onto the picture, shape (n, 2)."""
        return self.view.flat(self.vectors(begin))

    @property
    def nodes(self) -> Array:
        """Positions of the nodes in the picture, shape (n, 2)."""
        return self.flat("")

    @property
    def shown(self) -> Flags:
        """Which nodes belong to the polygons, shape (n,)."""
        seen = np.zeros(len(self.columns["x"]), dtype=bool)
        seen[self.polygons.ravel()] = True
        return seen


def sides_of(table: Columns, facets: Ints) -> list[VisibleSide]:
    """Return the contact boundaries in their order, each as seen along the mean normal of its
    facets in contact.

    If parts of a curved boundary face the other way, as on the wall of a hole, it is seen from a
    second side as well, provided anything is in contact there.
    """
    polygons = facets[:, _POLYGONS[facets.shape[1]]].reshape(-1, len(_POLYGONS[facets.shape[1]][0]))
    sides = []
    for boundary, of_boundary in by_boundary(table, polygons):
        columns = boundary.columns
        normal = boundary.vectors("n_")
        weight = boundary.floats("weight")
        touching = weight * boundary.touching
        sights = [by @ normal / by.sum() for by in (touching, weight) if by.sum() > 0]
        # Practically closed: the coordinate axis that it faces most.
        sights.append(np.eye(3)[np.argmax(weight @ normal**2)])
        sight = next(sight for sight in sights if np.linalg.norm(sight) > CLOSED_IN_PICTURE)
        forth = normal[of_boundary].mean(axis=1) @ -view.along(sight).toward >= -1e-6
        sides.append(VisibleSide(boundary.name, columns, of_boundary[forth], view.along(sight)))
        if np.any(touching[of_boundary[~forth]] > 0):
            sides.append(
                VisibleSide(boundary.name, columns, of_boundary[~forth], view.along(-sight))
            )
    return sides


@mpl.rc_context(STYLE)
def contact_surface(table: Columns, facets: Ints) -> Figure:
    """Draw each contact boundary of a body in 3D, seen along its outward normal through the body.

    Contact pressure is shown in colour where a facet is in contact, linear between the nodes, and
    the shear stress mu by arrows. Beside it are the state of each node in the area halfway to its
    neighbours, and the slip as arrows, magnified as stated in the panel.  If there are many arrows,
    some are left out.  If little of the boundary is in contact, the picture shows that part, and
    says so.  Without friction only the pressure is drawn.

    Args:
        table: columns of ``contact.csv``.
        facets: its rows at each facet in the order of VTK, shape (m, 3), (m, 4) or (m, 9).
    """
    every = [side for side in sides_of(table, facets) if side.polygons.size]
    closed = [bool(side.touching[side.shown].any()) for side in every]
    sides = [side for side, shown in zip(every, closed, strict=True) if shown] or every[:1]
    apart = [side.name for side, shown in zip(every, closed, strict=True) if not shown]
    windows = [_window(side) for side in sides]
    heights = [
        float(np.clip((_WIDTH - 0.9) * (high[1] - low[1]) / (high[0] - low[0]), 0.9, 3.8)) + 0.9
        for low, high, _ in windows
    ]
    columns = 1 + any(side.has_friction for side in sides)
    size = columns * _WIDTH, sum(heights) + 0.1 * len(sides) + 0.4
    figure = Figure(figsize=size, layout=ConstrainedLayoutEngine(h_pad=0.05))
    grid = figure.subplots(len(sides), columns, squeeze=False, height_ratios=heights)
    seen: set[str] = set()
    for row, side, (low, high, part) in zip(grid, sides, windows, strict=True):
        sight = f"seen along {view.combination(-side.view.toward)}" + (
            ", the part in contact" if part else ""
        )
        between = "\n" if len(side.name) > _LONG_NAME else " "
        _frame(row[0], side, low, high)
        _pressure_panel(figure, row[0], side, low, high, f"{side.name},{between}{sight}")
        if side.has_friction:
            _frame(row[1], side, low, high)
            seen.update(_state_panel(row[1], side, low, high, f"{side.name}: state"))
        for axes in row[1 + side.has_friction :]:
            axes.set_axis_off()
    if any(closed) and apart:
        title = f"nothing in contact: {plain(', '.join(dict.fromkeys(apart)))}"
        grid[0, 0].set_title(f"{title}\n{grid[0, 0].get_title('left')}", loc="left", fontsize=8)
    if seen:
        state_legend(figure, seen)
    # the layout needs a second pass if equal axes do not fill their place
    figure.draw_without_rendering()
    return figure


def _window(side: VisibleSide) -> tuple[Array, Array, bool]:
    """Return the lower and upper corner of the visible part, each of shape (2,), and whether it is
    only a part of the boundary.
    """
    visible = side.nodes[side.shown]
    low = visible.min(axis=0)
    high = visible.max(axis=0)
    size = _size(low, high) or 1.0
    margin = (SURFACE_MARGIN if side.has_friction else 0.5 * SURFACE_MARGIN) * size
    closed = side.nodes[side.shown & side.touching]
    if len(closed):
        first = closed.min(axis=0)
        last = closed.max(axis=0)
        spacing = math.sqrt(float(np.median(side.floats("weight")[side.shown & side.touching])))
        around = 0.3 * float(max(last - first)) + 2 * spacing
        first = np.maximum(first - around, low - margin)
        last = np.minimum(last + around, high + margin)
        if max(last - first) < 0.5 * size:
            return first, last, True
    return low - margin, high + margin, False


def _size(low: Array, high: Array) -> float:
    """Return the length of the longer side."""
    return float(np.max(high - low))


def _frame(axes: Axes, side: VisibleSide, low: Array, high: Array) -> None:
    """Set up equal axes, labelled with the coordinates in 3D."""
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    for kind, direction in (("x", side.view.right), ("y", side.view.up)):
        label, falls = view.coordinate(direction)
        axis = axes.xaxis if kind == "x" else axes.yaxis
        axis.set_label_text(f"{label}{bracketed('length')}")
        if falls:  # the picture is drawn along the view, its numbers are those of the coordinate
            axis.set_major_formatter(
                lambda value, _: f"{-value + 0.0:g}".replace("-", "\N{MINUS SIGN}")
            )
        axis.set_major_locator(mpl.ticker.MaxNLocator(nbins=6, steps=[1, 2, 2.5, 5, 10]))


def _pressure_panel(
    figure: Figure, axes: Axes, side: VisibleSide, low: Array, high: Array, heading: str
) -> None:
    pressure = np.nan_to_num(side.floats("pressure"), posinf=0.0, neginf=0.0)
    nodes = side.nodes
    closed = side.touching
    inside = side.shown & closed
    ends = usual_range(pressure[inside], side.floats("weight")[inside], signed=True)
    tones = Tones(Field("contact pressure", signed=True), pressure[inside], *ends)
    ground = PolyCollection(
        list(nodes[side.polygons]),
        facecolors=_UNTOUCHED,
        edgecolors=_UNTOUCHED,
        linewidths=0.4,
        zorder=1,
        rasterized=True,
    )
    axes.add_collection(ground, autolim=False)
    points, triangles, values = _triangles(
        side.polygons[closed[side.polygons].any(axis=1)], nodes, pressure
    )
    if len(triangles):
        axes.tripcolor(
            Triangulation(*points.T, triangles),
            values * 10.0**tones.power,
            shading="gouraud",
            cmap=VALUES,
            norm=tones.norm,
            rasterized=True,
            zorder=2,
        )
        tones.bar(figure, axes)
    axes.add_collection(_rim(side), autolim=False)
    text = heading if len(triangles) else f"{heading}: nothing in contact"
    if side.has_friction:
        shear = side.flat("shear_")
        longest = largest_of(side.floats("shear"))
        drawn = _arrows(
            axes, side, shear, side.shown & (side.floats("shear") > 1e-6 * longest), low, high
        )
        if drawn > 0:
            length = f"{number(float(f'{drawn:.3g}'))} {plain(unit('stress'))}".rstrip()
            text += f"\narrows: shear stress, the longest {length}"
    axes.set_title(text, loc="left", fontsize=8)


def _state_panel(axes: Axes, side: VisibleSide, low: Array, high: Array, heading: str) -> set[str]:
    states = side.states
    nodes = side.nodes
    where, owner = _around_nodes(nodes, side.polygons)
    colours = np.array([to_rgba(STATES[state][0]) for state in states])[owner]
    regions = PolyCollection(
        list(where),
        facecolors=colours,
        edgecolors=colours,
        linewidths=0.4,
        zorder=1,
        rasterized=True,
    )
    axes.add_collection(regions, autolim=False)
    axes.add_collection(_rim(side), autolim=False)
    moving = side.shown & (side.columns["friction"] == "slip")
    slip = side.flat("slip_")
    text = heading
    longest = float(np.linalg.norm(slip[moving], axis=1).max(initial=0.0))
    if longest > 0:
        factor = readable(0.8 * LONGEST_ARROW * _size(low, high) / longest)
        _arrows(axes, side, slip, moving, low, high, factor)
        text += f"\narrows: slip {TIMES} {number(factor)}"
    elif np.any(side.touching):
        text += "\nno slip"
    axes.set_title(text, loc="left", fontsize=8)
    return {states[k] for k in np.flatnonzero(side.shown)}


def _rim(side: VisibleSide) -> LineCollection:
    """Return the lines where the contact boundary ends."""
    edges = side.nodes[view.outline(side.nodes, side.polygons)]
    return LineCollection(list(edges), colors=MUTED, linewidths=0.8, zorder=3)


def _triangles(polygons: Ints, nodes: Array, values: Array) -> tuple[Array, Ints, Array]:
    """Return points, triangles and values of polygons; quadrilaterals are cut through their middle,
    because a diagonal would not be symmetric.
    """
    if polygons.shape[1] == 3:
        return nodes, polygons, values
    centre = np.broadcast_to(len(nodes) + np.arange(len(polygons))[:, None], polygons.shape)
    triangles = np.stack((polygons, np.roll(polygons, -1, axis=1), centre), axis=2).reshape(-1, 3)
    points = np.concatenate((nodes, nodes[polygons].mean(axis=1)))
    return points, triangles, np.concatenate((values, values[polygons].mean(axis=1)))


def _around_nodes(nodes: Array, polygons: Ints) -> tuple[Array, Ints]:
    """Return each polygon cut into one quadrilateral for each of its nodes, shape (., 4, 2), and
    the node of each.
    """
    corners = nodes[polygons]
    ahead = 0.5 * (corners + np.roll(corners, -1, axis=1))
    behind = np.roll(ahead, 1, axis=1)
    centre = np.broadcast_to(corners.mean(axis=1, keepdims=True), corners.shape)
    return np.stack((corners, ahead, centre, behind), axis=2).reshape(-1, 4, 2), polygons.ravel()


def _arrows(
    axes: Axes,
    side: VisibleSide,
    vectors: Array,
    where: Flags,
    low: Array,
    high: Array,
    factor: float | None = None,
) -> float:
    """Draw vectors at the nodes ``where``, times a factor, and return the length of the longest
    one.

    Without a factor the longest arrow gets the length that fits the picture.
    """
    inside = np.all((side.nodes >= low) & (side.nodes <= high), axis=1) & np.isfinite(vectors).all(
        axis=1
    )
    size = _size(low, high)
    rows = np.flatnonzero(where & inside)
    lengths = np.linalg.norm(vectors[rows], axis=1)
    longest = float(lengths.max(initial=0.0))
    if longest == 0:
        return 0.0
    # The longest one first, so that it is never left out.
    order = np.lexsort((*np.round(side.nodes[rows] / size, 9).T[::-1], lengths < longest))
    rows = spaced(side.nodes, rows[order], size / MOST_ARROWS)
    scaled = vectors[rows] * (LONGEST_ARROW * size / longest if factor is None else factor)
    axes.quiver(
        *side.nodes[rows].T,
        *scaled.T,
        **IN_DATA_UNITS,
        headwidth=3.2,
        headlength=4.2,
        headaxislength=3.8,
        minlength=0.4,
        facecolor="white",
        edgecolor=INK,
        linewidth=0.35,
        zorder=4,
    )
    return longest
