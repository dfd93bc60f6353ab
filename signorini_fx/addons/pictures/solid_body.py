"""The deformed body in 3D on its foundation: its outer surface, a field in colours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from signorini_fx.addons.pictures import solid as drawing
from signorini_fx.addons.pictures import view
from signorini_fx.addons.pictures.body import DrawnBody, Volume
from signorini_fx.addons.pictures.deformed_body import magnification
from signorini_fx.addons.pictures.fields import FIELDS, Field, values_of
from signorini_fx.addons.pictures.foundation import FoundationSurface, normals_of
from signorini_fx.addons.pictures.marks import Largest, draw_lengths, mark_largest
from signorini_fx.addons.pictures.solid import Cut, Lines, Solid
from signorini_fx.addons.pictures.style import BLUE, ORANGE, SCREEN, STYLE, Floats, finish, math_number
from signorini_fx.addons.pictures.tones import STROKES, Tones, strokes, thinned
from signorini_fx.machine.display import clean
from signorini_fx.tuned import (
    NARROWEST,
    PIXELS_PER_INCH,
    PREFERRED_GAIN,
    SAME_LENGTH,
    SEEN_FROM_THE_SIDE,
    SOLID_INCHES,
    STROKES_ABOVE,
    VISIBLE_FACET,
)

Rows = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Skin:
    """The outer surface of a body with a field.

    Attributes:
        points: positions, length, shape (n, 3).
        displacement: at the points, length, shape (n, 3).
        triangles: their points, counterclockwise as seen from outside, shape (t, 3).
        values: the field at their corners, shape (t, 3).
        perimeters: points along the perimeter of each facet, shape (m, k).
        at_points: whether the field varies within a facet.
        pieces: the connected piece that each point is of, shape (n,); None: there is one.
        parted: see ``magnification``.
    """

    points: Floats
    displacement: Floats
    triangles: Rows
    values: Floats
    perimeters: Rows
    at_points: bool
    pieces: Rows | None = None
    parted: float = 0.0

    @classmethod
    def of(cls, body: DrawnBody, field: str) -> Skin:
        """A body in 3D with one of its fields, see ``FIELDS``."""
        if not body.within.size:
            raise ValueError("the body has no facets")
        values, inside = values_of(field, body.values), body.tiles.triangles
        at = (
            values[:, inside]
            if body.recovered
            else np.broadcast_to(values[:, None, None], (len(values), *inside.shape))
        )
        return cls(
            body.points,
            body.displacement,
            body.within[:, inside].reshape(-1, 3),
            at.reshape(-1, 3),
            body.perimeters,
            body.recovered,
            body.pieces,
            body.parted,
        )

    @property
    def factor(self) -> float:
        """Which makes its displacement visible."""
        return magnification(self.points, self.displacement, self.parted)

    @property
    def size(self) -> float:
        """Of the body, length."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @property
    def edges(self) -> Rows:
        """Pairs of points along the perimeters of all facets, each once, shape (e, 2)."""
        pairs = np.stack((self.perimeters, np.roll(self.perimeters, -1, axis=1)), axis=2).reshape(-1, 2)
        return np.unique(np.sort(pairs, axis=1), axis=0)

    def moved(self, factor: float) -> Floats:
        """The points with the displacement times a factor; a failed solve may have left anything behind."""
        moved = self.points + factor * self.displacement
        return np.where(np.isfinite(moved), moved, self.points)


def deformed_solid(
    path_stem: str | Path, skin: Skin, *, title: str = "", suffixes: Sequence[str] = SCREEN, **options: Any
) -> None:
    """Write the picture that ``solid_figure`` draws.

    Args:
        path_stem: where to write, without suffix.
        skin: the body.
        title: title of the picture.
        suffixes: of the files to write.
        options: of ``solid_figure``.

    Raises:
        PictureError: PyVista is missing.
    """
    with mpl.rc_context(STYLE):
        figure, remark = solid_figure(skin, **options)
        finish(figure, path_stem, f"{title}   ({remark})" if title else remark, suffixes)


def solid_figure(
    skin: Skin,
    *,
    field: Field = FIELDS["von_mises"],
    stress: Floats | None = None,
    foundations: Sequence[FoundationSurface] = (),
    factor: float | None = None,
    seen: view.View | None = None,
    largest: Largest | None = None,
) -> tuple[Figure, str]:
    """Draw the outer surface of a deformed body in 3D on its foundation, in perspective.

    The colour is a field.  Values at points of the facets are drawn with colours that vary within each facet; the label
    of the colour bar says whether it is so.  If a singular edge would leave the rest without colour, the scale ends at
    the value that is not exceeded on 99 % of the visible area.  Dark lines on the body are its sharp edges, gray ones
    those of the undeformed body; the edges of the facets are drawn if they are large enough to see them.  Arrows show
    the axes, and how long the undeformed body is along each.  A circle marks the largest value; it is open where it is
    behind the surface that is seen.  A foundation is gray, and seen from the side of the body
    only.

    As in 2D the gap is magnified with the displacement.  Where that would bend the foundation visibly, as the
    plane under a sphere, there are two panels: body and foundation as they are; and the body with its displacement
    magnified, without foundation.

    Args:
        skin: the body.
        field: what its values are.
        stress: tensors at the facets, shape (m, 3, 3): their principal stresses are drawn as strokes.
        foundations: of each contact boundary.
        factor: of displacement and gap, in one panel; None: one that makes the displacement visible, in two panels
            where one would not be true.
        seen: the view; None: ``telling_view(skin)``.
        largest: what the circle marks; None: no circle.

    Returns:
        The figure, and what it magnifies.

    Raises:
        PictureError: PyVista is missing.
    """
    chosen = skin.factor if factor is None else factor
    true = factor is not None or all(entry.looks_like_itself(chosen, skin.size) for entry in foundations)
    scaling = f"displacement $\\times\\,{math_number(chosen)}$"
    if true:
        remark = scaling if chosen == 1 or not foundations else scaling.replace("displacement", "displacement and gap")
    else:
        remark = f"left: as it is; right: {scaling}"
    seen = telling_view(skin) if seen is None else seen
    tones = tones_of(skin, seen, field)
    factors = [chosen] if true else [1.0, chosen]
    shown = [solid_of(skin, tones, at, foundations if true or at == 1 else ()) for at in factors]
    # Whole foundations end near the body.
    ends = [entry.surface[0] for entry in foundations if entry.surface is not None and not entry.is_plane]
    reaches = [np.concatenate(ends) if ends and at == 1 else None for at in factors]
    cameras = [view.Camera.on(seen, _extent(entry, far)) for entry, far in zip(shown, reaches, strict=True)]
    inch = (SOLID_INCHES if true else 0.75 * SOLID_INCHES) / max(2 * float(camera.half.max()) for camera in cameras)
    widths, heights = (2 * inch * np.array([camera.half[k] for camera in cameras]) for k in (0, 1))
    figure = Figure(figsize=(max(float(widths.sum()), NARROWEST), float(heights.max()) + 0.9), layout="constrained")
    grid = figure.subplots(1, len(shown), squeeze=False, width_ratios=list(map(float, widths)))[0]
    for axes, solid, camera, at in zip(grid, shown, cameras, factors, strict=True):
        if math.sqrt(float(np.median(_areas(solid.points, skin.perimeters)))) * 72 * inch >= VISIBLE_FACET:
            solid = replace(solid, edges=skin.edges)
        if stress is not None:
            solid = replace(solid, lines=_strokes(skin, at, stress, camera))
        show(axes, solid, camera, inch)
        if axes is grid[0]:
            draw_lengths(axes, skin.points, camera.flat, inch=inch)
            if largest is not None:
                point = largest.nearest(skin.points)
                place = largest.place + solid.points[point] - skin.points[point]
                inside = np.linalg.norm(largest.place - skin.points[point]) > SAME_LENGTH * skin.size
                behind = bool(inside) or _hidden(skin, point, camera)
                mark_largest(axes, camera.flat(place[None])[0], largest.text, behind=behind)
    tones.bar(figure, list(grid))
    return figure, remark


def section(
    path_stem: str | Path,
    skin: Skin,
    volume: Volume,
    origin: Floats,
    across: Floats,
    *,
    foundations: Sequence[FoundationSurface] = (),
    seen: view.View,
    title: str = "",
    suffixes: Sequence[str] = SCREEN,
) -> None:
    """Draw the von Mises stress within a body that is cut by a coordinate plane.

    It is magnified like its surface, or as it is where that would bend a foundation.

    Args:
        path_stem: where to write, without suffix.
        skin: the surface of the body.
        volume: its cells.
        origin: a point of the undeformed body that the plane goes through, shape (3,).
        across: a direction that the plane contains, such as the normal of the contact boundary, shape (3,).
        foundations: see ``deformed_solid``.
        seen: the view.
        title: title of the picture.
        suffixes: of the files to write.
    """
    chosen = skin.factor
    factor = chosen if all(foundation.looks_like_itself(chosen, skin.size) for foundation in foundations) else 1.0
    # Of the coordinate planes that contain the direction, as far as one does, the one that the viewer sees best.
    facing = np.abs(seen.toward) * (1 - np.abs(across) / (float(np.linalg.norm(across)) or 1.0))
    axis = int(np.argmax(facing))
    normal = math.copysign(1.0, seen.toward[axis]) * np.eye(3)[axis]
    moved = volume.points + factor * volume.displacement
    at = origin + factor * volume.displacement[np.argmin(np.linalg.norm(volume.points - origin, axis=1))]
    field = FIELDS["von_mises"].told(at_points=True)
    tones = Tones(field, volume.values, np.ones(len(volume.values)))
    cut = Cut(moved, volume.values, volume.cells, at, normal)
    solid = replace(solid_of(skin, tones, factor, foundations), cut=cut, at_rest=None)
    camera = view.Camera.on(seen, _extent(solid, None))
    inch = SOLID_INCHES / (2 * float(camera.half.max()))
    with mpl.rc_context(STYLE):
        figure = Figure(
            figsize=(max(2 * inch * camera.half[0], NARROWEST), 2 * inch * camera.half[1] + 0.9),
            layout="constrained",
        )
        axes = figure.subplots()
        show(axes, solid, camera, inch)
        tones.bar(figure, axes)
        at_plane = math_number(float(f"{clean([float(origin[axis])], skin.size)[0]:.4g}"))
        remark = f"cut at ${'xyz'[axis]} = {at_plane}$, displacement $\\times\\,{math_number(factor)}$"
        finish(figure, path_stem, f"{title}   ({remark})" if title else remark, suffixes)


def show(axes: Axes, solid: Solid, camera: view.Camera, inch: float) -> None:
    """The picture of a body in axes without ticks."""
    picture = drawing.image(solid, camera, round(2 * inch * float(camera.half[0]) * PIXELS_PER_INCH))
    right, top = camera.half
    axes.imshow(picture, extent=(-right, right, -top, top), aspect="equal")
    axes.set_axis_off()


def solid_of(skin: Skin, tones: Tones, factor: float, foundations: Sequence[FoundationSurface]) -> Solid:
    """What is drawn of a body with its displacement and the gaps times a factor."""
    return Solid(
        skin.moved(factor),
        skin.triangles,
        skin.values,
        tones.colours,
        (tones.low, tones.high),
        np.empty((0, 2), dtype=np.int64),
        None if factor == 1 else skin.points,
        [foundation.shape(factor) for foundation in foundations],
    )


def tones_of(skin: Skin, seen: view.View, field: Field) -> Tones:
    """The scale of the field, by what faces the viewer."""
    area = normals_of(skin.points, skin.triangles) @ seen.toward
    facing = area > 0
    labelled = field.told(at_points=skin.at_points)
    return Tones(labelled, skin.values[facing].ravel(), area[facing].repeat(3) / 3)


def telling_view(skin: Skin) -> view.View:
    """Of the views from above onto the four corners the one that shows most of a field: the cut of a symmetric body
    rather than its back; from the front and the right if that makes no difference.
    """
    area = normals_of(skin.points, skin.triangles)
    size = np.abs(np.nan_to_num(skin.values)).mean(axis=1)
    views = [view.oblique(azimuth) for azimuth in (-58.0, -122.0, 58.0, 122.0)]
    shown = [float(np.maximum(area @ sight.toward, 0.0) @ size) for sight in views]
    # Of sides that show as much but for round-off the first.
    best = int(np.argmax(np.asarray(shown) >= (1 - 1e-6) * np.max(shown)))
    return views[best] if shown[best] > PREFERRED_GAIN * shown[0] else views[0]


def _hidden(skin: Skin, point: int, camera: view.Camera) -> bool:
    """Whether all facets at a point face away from the viewer."""
    around = skin.triangles[(skin.triangles == point).any(axis=1)]
    return bool((normals_of(skin.points, around) @ camera.view.toward <= 0).all())


def _extent(solid: Solid, reach: Floats | None) -> Floats:
    """Points that a picture shows; of a foundation that runs far away only the part next to the body."""
    body = np.concatenate([solid.points, *([solid.at_rest] if solid.at_rest is not None else [])])
    body = body if reach is None else np.concatenate((body, reach))
    low, high = body.min(axis=0), body.max(axis=0)
    far = 0.4 * float(max(high - low))
    return np.concatenate([body, *(np.clip(points, low - far, high + far) for points, _ in solid.grounds)])


def _areas(points: Floats, facets: Rows) -> Floats:
    return np.linalg.norm(normals_of(points, facets), axis=1)


def _strokes(skin: Skin, factor: float, stress: Floats, camera: view.Camera) -> list[Lines]:
    """Along principal stresses at the middles of some facets that are seen, not too much from the side."""
    points = skin.moved(factor)
    area = normals_of(points, skin.perimeters)
    normals = area / np.maximum(np.linalg.norm(area, axis=1), 1e-300)[:, None]
    front = normals @ camera.view.toward > SEEN_FROM_THE_SIDE
    middles = points[skin.perimeters].mean(axis=1)[front]
    spacing = 2 * float(camera.half.max()) / STROKES
    rows = thinned(camera.flat(middles), spacing)
    above = middles[rows] + STROKES_ABOVE * skin.size * normals[front][rows]
    pressed, drawn_out = strokes(above, stress[front][rows], spacing)
    return [Lines(pressed, BLUE, 5.0), Lines(drawn_out, ORANGE, 3.5)]
