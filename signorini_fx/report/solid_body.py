"""The deformed body in space on its foundation: its outer surface, a field in colours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from signorini_fx.report import view
from signorini_fx.report.deformed_body import magnification
from signorini_fx.report.fields import FIELDS, Field
from signorini_fx.report.rendering import Image, fans, normals_of, render, smooth_normals
from signorini_fx.report.solid_foundation import GROUND, FoundationSurface, draw_plane, plane_of
from signorini_fx.report.style import (
    BOTH,
    INK,
    MUTED,
    STYLE,
    Floats,
    finish,
    math_number,
)
from signorini_fx.report.tiling import Tiling
from signorini_fx.report.tones import Tones, draw_principal

Rows = npt.NDArray[np.int64]

MOST_FACETS = 40_000  # of a picture: they take seconds
_SHADE = 0.22  # how much darker a surface parallel to the light is than one perpendicular to it
_RIM = 0.82  # how much darker the edges between facets are
_SHARP = math.cos(math.radians(40.0))  # facets that turn by more than this meet in an edge
_VISIBLE_FACET = 9.0  # size from which on the edges of a facet are drawn, in 1/72 inch
_MORE = 1.15  # how much more of the field another view must show to be preferred to the usual one
_NARROW = 0.8  # width over height of the narrowest picture
_LARGEST = 4.8  # width and height of the body, inches
_PIXELS = 300.0  # per inch


def deformed_solid(
    path_stem: str | Path,
    points: Floats,
    facets: Rows,
    displacement: Floats,
    values: Floats,
    *,
    tiles: Tiling | None = None,
    field: Field = FIELDS["von_mises"],
    stress: Floats | None = None,
    foundations: Sequence[FoundationSurface] = (),
    factor: float | None = None,
    top: float | None = None,
    frame: tuple[Floats, Floats] | None = None,
    seen: view.View | None = None,
    title: str = "",
    suffixes: Sequence[str] = BOTH,
) -> None:
    """Draw the outer surface of a deformed body in space on its foundation.

    The colour is a field, darker where the surface turns away from the light.  Values at points of the facets are drawn
    with colours that vary within each facet; the label of the colour bar says whether it is so.  If a singular edge
    would leave the rest pale, the scale ends at the value that is not exceeded on 99 % of the visible area.  Thin lines
    on the body are its sharp edges, dashed ones those of the undeformed body; the edges of the facets are drawn if they
    are large enough to see them.  A flat foundation is drawn as a gray plane if it is behind the body, otherwise as a
    frame, a curved one as a gray surface.  The projection is parallel, without perspective.

    As in the plane the gap is magnified with the displacement.  Where that would bend the foundation visibly, as the
    plane under a sphere, there are two panels: body and foundation as they are; and the body with its displacement
    magnified, without foundation.

    Args:
        path_stem: where to write, without suffix.
        points: positions, length, shape (n, 3).
        facets: points of each facet, shape (m, p): those along its perimeter, counterclockwise as seen from outside,
            more than its corners if it is curved; with ``tiles`` also those within.
        displacement: at the points, length, shape (n, 3).
        values: the field, one value per facet, shape (m,), or with ``tiles`` at its points, shape (m, p).
        tiles: how each facet is divided; None: it has one value.
        field: what it is.
        stress: tensors at the facets, shape (m, 3, 3): their principal stresses are drawn as strokes.
        foundations: of each contact boundary.
        factor: of displacement and gap, in one panel; None: one that makes the displacement visible, in two panels
            where one would not be true.
        top: the value where the colours end; None: see above.
        frame: lowest and highest coordinates of the projection that are seen, in one panel; None: as far as body and
            foundations reach.
        seen: the view; None: ``telling_view(...)``.
        title: title of the picture.
        suffixes: of the files to write.

    Raises:
        ValueError: there are no facets.
    """
    with mpl.rc_context(STYLE):
        figure, remark = solid_figure(
            points,
            facets,
            displacement,
            values,
            tiles=tiles,
            field=field,
            stress=stress,
            foundations=foundations,
            factor=factor,
            top=top,
            frame=frame,
            seen=seen,
        )
        finish(figure, path_stem, f"{title}   ({remark})" if title else remark, suffixes)


def solid_figure(
    points: Floats,
    facets: Rows,
    displacement: Floats,
    values: Floats,
    *,
    tiles: Tiling | None = None,
    field: Field = FIELDS["von_mises"],
    stress: Floats | None = None,
    foundations: Sequence[FoundationSurface] = (),
    factor: float | None = None,
    top: float | None = None,
    frame: tuple[Floats, Floats] | None = None,
    seen: view.View | None = None,
) -> tuple[Figure, str]:
    """The figure that ``deformed_solid`` writes, and what it magnifies."""
    if not facets.size:
        raise ValueError("the body has no facets")
    chosen = magnification(points, displacement) if factor is None else factor
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    true = factor is not None or all(one.looks_like_itself(chosen, size) for one in foundations)
    what = f"displacement $\\times\\,{math_number(chosen)}$"
    if true:
        remark = what if chosen == 1 or not foundations else what.replace("displacement", "displacement and gap")
    else:
        remark = f"left: as it is; right: {what}"
    seen = telling_view(points, facets, values, tiles) if seen is None else seen
    bodies = [
        _Surface.of(points, facets, displacement, values, tiles, scale)
        for scale in ((chosen,) if true else (1.0, chosen))
    ]
    grounds = [foundations if true or k == 0 else () for k in range(len(bodies))]
    planes = [
        [(one, plane_of(one.drawn(body.factor))) for one in some] for body, some in zip(bodies, grounds, strict=True)
    ]
    frames = [
        frame_of(seen, [points, body.points], some, body.factor) if frame is None else frame
        for body, some in zip(bodies, grounds, strict=True)
    ]
    bottom, top_edge = min(low[1] for low, _ in frames), max(high[1] for _, high in frames)
    frames = [(np.array([low[0], bottom]), np.array([high[0], top_edge])) for low, high in frames]
    inch = (_LARGEST if true else 0.75 * _LARGEST) / max(float(np.max(high - low)) for low, high in frames)
    widths = [float(high[0] - low[0]) * inch for low, high in frames]
    height = max(float(high[1] - low[1]) * inch for low, high in frames)
    figure = Figure(figsize=(max(sum(widths), 3.4), height + 0.9), layout="constrained")
    grid = figure.subplots(1, len(bodies), squeeze=False, width_ratios=widths)[0]
    tones = bodies[0].tones(seen, field.told(at_points=tiles is not None), top)
    for axes, body, some, (low, high) in zip(grid, bodies, planes, frames, strict=True):
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set_axis_off()
        curved = []
        for one, plane in some:
            if plane is None:
                curved.append(one.facing(seen, body.factor))
                continue
            corners, normal = plane
            normal = normal if (corners.mean(axis=0) - body.points.mean(axis=0)) @ normal > 0 else -normal
            draw_plane(axes, seen.flat(corners), in_front=bool(normal @ seen.toward > 1e-9))
        image = body.draw(axes, seen, tones, low, high, inch, curved)
        if stress is not None:
            body.draw_stress(axes, seen, stress, image, float(np.max(high - low)))
        if body.factor != 1:
            at_rest = [_seen(points[line], seen) for line in view.lines_of(_edges(points, body.triangles, seen))]
            dashes = [(0, (4, 2.5))]
            lines = image.visible_parts(at_rest, apart=True)
            rest = LineCollection(lines, colors=MUTED, linewidths=0.6, linestyles=dashes, zorder=3, alpha=0.8)
            axes.add_collection(rest, autolim=False)
        if body is bodies[0]:
            _draw_coordinates(axes, seen, points, low, high, image)
    tones.bar(figure, list(grid))
    return figure, remark


def telling_view(points: Floats, facets: Rows, values: Floats, tiles: Tiling | None = None) -> view.View:
    """Of the views from above onto the four corners the one that shows most of a field: the cut of a symmetric body
    rather than its back; from the front and the right if that makes no difference.
    """
    surface = _Surface.of(points, facets, np.zeros_like(points), values, tiles, 0.0)
    area = normals_of(surface.points, surface.triangles)
    size = np.abs(np.nan_to_num(surface.values)).mean(axis=1)
    views = [view.oblique(azimuth) for azimuth in (-58.0, -122.0, 58.0, 122.0)]
    shown = [float(np.maximum(area @ one.toward, 0.0) @ size) for one in views]
    # Of sides that show as much but for round-off the first.
    best = int(np.argmax(np.asarray(shown) >= (1 - 1e-6) * np.max(shown)))
    return views[best] if shown[best] > _MORE * shown[0] else views[0]


def frame_of(
    seen: view.View, bodies: Sequence[Floats], foundations: Sequence[FoundationSurface], factor: float
) -> tuple[Floats, Floats]:
    """What is seen, with a margin: bodies, points of shape (n, 3), and foundations, but not what runs far away."""
    body = seen.flat(np.concatenate(bodies))
    low, high = body.min(axis=0), body.max(axis=0)
    far = 0.4 * float(max(high - low))
    every = [np.stack((low, high))]
    for one in foundations:
        drawn = one.drawn(factor)
        plane = plane_of(drawn)
        every.append(np.clip(seen.flat(drawn if plane is None else plane[0]), low - far, high + far))
    low, high = np.concatenate(every).min(axis=0), np.concatenate(every).max(axis=0)
    margin = 0.05 * float(max(high - low))
    # Beside a tower there is room for the axes.
    beside = max(margin, 0.5 * float(_NARROW * (high - low)[1] - (high - low)[0]))
    around = np.array([beside, margin])
    return low - around, high + around


@dataclass(frozen=True)
class _Surface:
    """The deformed outer surface as triangles, on each of which the field is linear.

    Attributes:
        points: where they have gone, shape (n, 3).
        perimeters: points along the perimeter of each facet, shape (m, k).
        triangles: their points, shape (t, 3).
        values: the field at the corners of the triangles, shape (t, 3).
        owner: the facet of each triangle, shape (t,).
        factor: of the displacement.
    """

    points: Floats
    perimeters: Rows
    triangles: Rows
    values: Floats
    owner: Rows
    factor: float

    @classmethod
    def of(
        cls, points: Floats, facets: Rows, displacement: Floats, values: Floats, tiles: Tiling | None, factor: float
    ) -> _Surface:
        moved = points + factor * displacement
        moved = np.where(np.isfinite(moved), moved, points)  # a failed solve may give any values
        if tiles is not None:
            triangles = facets[:, tiles.triangles]
            at = values[:, tiles.triangles]
            owner = np.arange(len(facets)).repeat(len(tiles.triangles))
            return cls(moved, facets[:, : tiles.rim], triangles.reshape(-1, 3), at.reshape(-1, 3), owner, factor)
        triangles, owner = fans(facets), np.arange(len(facets)).repeat(max(1, facets.shape[1] - 2))
        return cls(moved, facets, triangles, values[owner][:, None].repeat(3, axis=1), owner, factor)

    def tones(self, seen: view.View, field: Field, top: float | None) -> Tones:
        """The scale of the field, by what faces the viewer."""
        area = normals_of(self.points, self.triangles) @ seen.toward
        facing = area > 0
        return Tones(field, self.values[facing].ravel(), area[facing].repeat(3) / 3, top)

    def draw(
        self,
        axes: Axes,
        seen: view.View,
        tones: Tones,
        low: Floats,
        high: Floats,
        inch: float,
        grounds: Sequence[Floats],
    ) -> Image:
        """The surface and its sharp edges, in front of curved foundations, which are triangles of shape (., 3, 3)."""
        area = normals_of(self.points, self.triangles)
        front = np.flatnonzero(area @ seen.toward > 0)
        ground = np.concatenate([np.empty((0, 3, 3)), *grounds])
        upward = np.cross(ground[:, 1] - ground[:, 0], ground[:, 2] - ground[:, 0])
        upward /= np.maximum(np.linalg.norm(upward, axis=1, keepdims=True), 1e-300)
        pixel = 1.0 / (inch * _PIXELS)
        shape = tuple(int(n) for n in np.ceil((high - low) / pixel))[::-1]
        corners = _seen(np.concatenate((self.points[self.triangles[front]], ground)), seen)
        image = render(corners, low + 0.5 * pixel, pixel, (shape[0], shape[1]))

        normals = smooth_normals(self.points, self.triangles, _SHARP)[front]
        normals = np.concatenate((normals, upward[:, None].repeat(3, axis=1)))
        values = np.concatenate((np.nan_to_num(self.values[front]), np.zeros((len(ground), 3))))
        shown = image.triangle >= 0
        light = seen.toward + 0.5 * seen.up - 0.2 * seen.right
        turned = image.interpolated(normals)
        turned /= np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-300)
        shade = 1 - _SHADE * (1 - np.clip(turned @ (light / np.linalg.norm(light)), 0.0, 1.0))
        colours = mpl.colormaps.get_cmap(tones.field.colours)(
            tones.norm(image.interpolated(values) * 10.0**tones.power)
        )
        colours[image.triangle[shown] >= len(front)] = to_rgba(GROUND)
        colours[:, :3] *= shade[:, None]
        picture = np.zeros((*shape, 4))
        picture[shown] = colours
        if math.sqrt(float(np.median(_areas(self.points, self.perimeters)))) * 72 * inch >= _VISIBLE_FACET:
            owner = np.full(shape, -1)
            owner[shown] = np.concatenate((self.owner[front], np.full(len(ground), -1)))[image.triangle[shown]]
            rims = np.zeros(shape, dtype=bool)
            rims[:, :-1] |= owner[:, :-1] != owner[:, 1:]
            rims[:-1] |= owner[:-1] != owner[1:]
            picture[rims, :3] *= _RIM
        extent = (low[0], low[0] + shape[1] * pixel, low[1], low[1] + shape[0] * pixel)
        axes.imshow(picture, extent=extent, origin="lower", zorder=2, aspect="equal")
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        lines = [_seen(self.points[line], seen) for line in view.lines_of(_edges(self.points, self.triangles, seen))]
        edges = LineCollection(image.visible_parts(lines), colors=INK, linewidths=0.8, capstyle="round", zorder=3)
        axes.add_collection(edges, autolim=False)
        return image

    def draw_stress(self, axes: Axes, seen: view.View, stress: Floats, image: Image, size: float) -> None:
        """Strokes along principal stresses at the middles of facets that are seen, not too much from the side."""
        middles = self.points[self.perimeters].mean(axis=1)
        area = normals_of(self.points, self.perimeters)
        front = area @ seen.toward > 0.2 * np.linalg.norm(area, axis=1)
        front[front] = image.visible(_seen(middles[front], seen))
        draw_principal(axes, seen.flat(middles[front]), stress[front], np.stack((seen.right, seen.up)), size)


def _seen(points: Floats, seen: view.View) -> Floats:
    """Coordinates in the picture, and nearness to the viewer, shape (..., 3)."""
    return np.concatenate((seen.flat(points), seen.depth(points)[..., None]), axis=-1)


def _areas(points: Floats, facets: Rows) -> Floats:
    return np.linalg.norm(normals_of(points, facets), axis=1)


def _edges(points: Floats, facets: Rows, seen: view.View) -> Rows:
    """Edges to draw, shape (e, 2): visible sharp edges, and those where the surface turns away."""
    normals = normals_of(points, facets)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
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


def _draw_coordinates(axes: Axes, seen: view.View, points: Floats, low: Floats, high: Floats, image: Image) -> None:
    """The three axes in a corner where they do not cover the body, and the length of the body along each."""
    extent = points.max(axis=0) - points.min(axis=0)
    length = 0.09 * float(np.max(high - low))
    tips = np.concatenate((1.5 * length * seen.flat(np.eye(3)), np.zeros((1, 2))))
    room = (tips.min(axis=0), tips.max(axis=0))
    covered = []
    for right, up in ((False, False), (False, True), (True, True), (True, False)):
        here = [high[k] - room[1][k] if far else low[k] - room[0][k] for k, far in enumerate((right, up))]
        first, last = (np.rint((here + side - image.low) / image.pixel).astype(int) for side in room)
        first = np.maximum(first, 0)
        box = image.triangle[first[1] : last[1] + 1, first[0] : last[0] + 1] >= 0
        covered.append((int(box.sum()), here))
    corner = np.array(min(covered, key=lambda one: one[0])[1])
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
