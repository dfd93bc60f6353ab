"""The deformed body in 3D on its foundation: its outer surface with a field in colours, drawn by
PyVista.
"""

from __future__ import annotations

import atexit
import math
import os
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from signorini_fx.addons.pictures import view
from signorini_fx.addons.pictures.body import DrawnBody, normals_of
from signorini_fx.addons.pictures.fields import FIELDS, Field
from signorini_fx.addons.pictures.foundation import Foundation, magnification, magnified
from signorini_fx.addons.pictures.marks import (
    Largest,
    Tones,
    draw_lengths,
    mark_largest,
    usual_range,
)
from signorini_fx.addons.pictures.style import INK, MUTED, PNG_DPI, STYLE, VALUES
from signorini_fx.addons.pictures.view import Camera, View
from signorini_fx.arrays import Array, Ints, sides_of
from signorini_fx.errors import PYVISTA, PictureError
from signorini_fx.tuned import (
    AMBIENT_LIGHT,
    BODY_INCHES,
    NARROWEST,
    PREFERRED_GAIN,
    SHARP_EDGE,
    SURFACE_MARGIN,
    VISIBLE_FACET,
)

if TYPE_CHECKING:
    from matplotlib.colors import Colormap
    from pyvista import Actor, Plotter, PolyData

GROUND = "#dcdcdc"
_LABELS = 0.8  # inches beside the body
# Pixels across a picture in which parts are looked for, and least ones from the rim of a part.
_SEEN, _LEAST_SEEN = 400, 3
_WITHOUT_DISPLAY = (
    9,
    4,
)  # the first VTK that draws without a display; an older one ends the process


@dataclass(frozen=True)
class Solid:
    """The surface of a body with a field, and its surroundings."""

    points: Array  # where they are drawn, shape (n, 3)
    triangles: Ints  # of the surface, counterclockwise as seen from outside, shape (t, 3)
    values: Array  # the field at their corners, shape (t, 3)
    limits: tuple[float, float]  # values of the first and the last colour
    colours: Colormap | None = None  # a colour map of matplotlib; None: that of all fields
    edges: Ints | None = None  # lines of the mesh to draw, pairs of points, shape (e, 2)
    # points and triangles of a body whose outline is drawn; None: there is none
    around: tuple[Array, Ints] | None = None
    # points and polygons of each foundation, seen from the side of the body only
    grounds: Sequence[tuple[Array, Ints]] = ()


@mpl.rc_context(STYLE)
def deformed_solid(
    body: DrawnBody,
    name: str,
    *,
    seen: View,
    foundations: Sequence[Foundation] = (),
    largest: Largest | None = None,
    pressed: tuple[Array, Ints, Array] | None = None,
) -> tuple[Figure, str]:
    """Draw the outer surface of a deformed body in 3D on its foundation; return the figure, and
    what is magnified, in words.

    Beside it are the contact surfaces ``pressed``: their points, facets, and pressure.  Dark lines
    on the body are its sharp edges, gray ones those of the undeformed body; the edges of the facets
    are drawn if they are large enough to see them.  Arrows show the axes, and the length of the
    undeformed body along each. A circle marks the largest value; it is open where it is behind the
    visible surface.  A foundation is gray, and seen from the side of the body only.

    Raises:
        PictureError: PyVista is missing.
    """
    factor = magnification(body, foundations)
    rigid = [foundation for foundation in foundations if foundation.rigid]
    area = normals_of(body.points[body.triangles]) @ seen.toward
    facing = area > 0
    field = FIELDS[name].labelled(recovered=body.recovered)
    corners = body.at_corners(name)
    seen_values = corners[facing].ravel()
    tones = Tones(
        field,
        seen_values,
        *usual_range(seen_values, area[facing].repeat(3) / 3, signed=field.signed),
    )
    moved = body.moved(factor)
    grounds = [ground_of(foundation, factor) for foundation in rigid]
    solid = Solid(moved, body.triangles, corners, (tones.low, tones.high), grounds=grounds)
    ends = [
        ground[0] for ground, part in zip(grounds, rigid, strict=True) if ground is part.surface
    ]
    camera = Camera.on(seen, _extent(solid, body.points, ends))
    inch = BODY_INCHES / (2 * float(camera.half.max()))
    facets = np.linalg.norm(normals_of(moved[body.perimeters]), axis=1)
    visible = math.sqrt(float(np.median(facets))) * 72 * inch >= VISIBLE_FACET
    rest = body.points, body.triangles
    around = None if factor == 1 else rest
    solid = replace(solid, around=around, edges=_edges(body) if visible else None)
    shown = [solid]
    if pressed is not None:
        places, polygons, pressure = pressed
        fan = np.concatenate([polygons[:, [0, k, k + 1]] for k in range(1, polygons.shape[1] - 1)])
        values = pressure[fan]
        values[(values == 0.0).all(axis=1)] = np.nan
        limits = usual_range(values.ravel(), np.ones(values.size))
        of_contact = Tones(Field("contact pressure"), values, *limits)
        shown.append(Solid(places, fan, values, limits, around=rest))
    figure, (axes, *beside) = figure_of(shown, [camera] * len(shown), inch=inch)
    draw_lengths(axes, body.points, camera)
    if largest is not None:
        around = body.triangles[(body.triangles == largest.point).any(axis=1)]
        behind = bool((normals_of(body.points[around]) @ seen.toward <= 0).all())
        mark_largest(axes, camera.flat(moved[largest.point]), largest.text, behind=behind)
    tones.bar(figure, axes)
    if beside:
        of_contact.bar(figure, beside[0])
    # the layout needs a second pass if equal axes do not fill their place
    figure.draw_without_rendering()
    return figure, magnified(foundations, factor)


def ground_of(foundation: Foundation, factor: float) -> tuple[Array, Ints]:
    """Return points and polygons of a foundation, counterclockwise as seen from the body.

    A plane becomes a rectangle around the points opposite the nodes, a shape without a magnified
    gap its own surface, and any other foundation the facets between these points.
    """
    points = foundation.drawn(factor)
    polygons = foundation.facets
    assert polygons is not None
    # The sum of the normals at the corners: from the body into the foundation.
    away = foundation.normals[polygons].sum(axis=1)
    if (rectangle := _plane_of(points)) is not None:
        points = rectangle
        polygons = np.arange(4)[None]
        away = foundation.normals.sum(axis=0)
    elif factor == 1 and foundation.surface is not None:
        return foundation.surface
    clockwise = np.sum(normals_of(points[polygons]) * away, axis=1) > 0
    return points, np.where(clockwise[:, None], polygons[:, ::-1], polygons)


def _plane_of(points: Array) -> Array | None:
    """Return the corners of a rectangle around points that lie in a plane, in order along its
    perimeter, shape (4, 3); None if they do not.
    """
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
    low = flat.min(axis=0)
    high = flat.max(axis=0)
    margin = SURFACE_MARGIN * float(max(high - low))
    left, bottom = low - margin
    right, top = high + margin
    corners = np.array([(left, bottom), (right, bottom), (right, top), (left, top)])
    return np.array(corners @ np.stack((seen.right, seen.up)) + middle @ seen.toward * seen.toward)


def telling_view(body: DrawnBody, name: str) -> View:
    """Return the oblique view from above that shows most of a field, out of those onto the four
    corners.

    It shows the cut of a symmetric body rather than its back.  If views hardly differ, it is that
    from the front and the right.
    """
    area = normals_of(body.points[body.triangles])
    size = np.abs(np.nan_to_num(body.at_corners(name))).mean(axis=1)
    views = [view.oblique(azimuth) for azimuth in (-58.0, -122.0, 58.0, 122.0)]
    shown = [float(np.maximum(area @ sight.toward, 0.0) @ size) for sight in views]
    # Of sides that show as much but for round-off the first.
    best = int(np.argmax(np.asarray(shown) >= (1 - 1e-6) * np.max(shown)))
    return views[best] if shown[best] > PREFERRED_GAIN * shown[0] else views[0]


def _edges(body: DrawnBody) -> Ints:
    """Return pairs of points along the perimeters of all facets, each pair once, shape (e, 2)."""
    pairs = sides_of(body.perimeters).reshape(-1, 2)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _extent(solid: Solid, at_rest: Array, ends: Sequence[Array]) -> Array:
    """Return the points that a picture must show; of a large foundation only the part next to the
    body.
    """
    body = np.concatenate((solid.points, at_rest, *ends))
    low = body.min(axis=0)
    high = body.max(axis=0)
    far = 0.4 * float(max(high - low))
    return np.concatenate(
        [body, *(np.clip(points, low - far, high + far) for points, _ in solid.grounds)]
    )


def figure_of(
    solids: Sequence[Solid], cameras: Sequence[Camera], *, inch: float
) -> tuple[Figure, list[Axes]]:
    """Return a figure with a picture of each body by its camera, side by side in axes without
    ticks.

    Args:
        solids: the bodies.
        cameras: their cameras.
        inch: inches per unit of length.
    """
    halves = np.array([camera.half for camera in cameras])
    wide = 2 * inch * halves[:, 0] + _LABELS
    size = max(float(wide.sum()), NARROWEST), 2 * inch * float(halves[:, 1].max()) + 0.9
    figure = Figure(figsize=size, layout="constrained")
    every = figure.subplots(1, len(cameras), squeeze=False, width_ratios=list(wide))[0]
    for axes, solid, camera in zip(every, solids, cameras, strict=True):
        right, top = camera.half
        picture = image(solid, camera, round(2 * inch * float(right) * PNG_DPI))
        axes.imshow(picture, extent=(-right, right, -top, top), aspect="equal")
        axes.set_axis_off()
    return figure, list(every)


def seen_parts(solid: Solid, camera: Camera, count: int) -> dict[int, Array]:
    """Return a visible point of each part of a body: the place in the picture that is farthest from
    the rim of the visible part, length, shape (2,).

    Args:
        solid: the body; its field is the number of the part.
        camera: the camera.
        count: number of parts.
    """
    from scipy.ndimage import distance_transform_edt

    shades = np.arange(1, count + 1) * (2**24 // (count + 1))
    bytes_of = np.column_stack((shades >> 16, shades >> 8 & 255, shades & 255))
    plain = replace(solid, colours=ListedColormap(bytes_of / 255.0), edges=None)
    picture = image(plain, camera, _SEEN, plain=True).astype(np.int64)
    found = {}
    for number, colour in enumerate(bytes_of):
        within = distance_transform_edt((np.abs(picture - colour) <= 1).all(axis=2))
        row, column = np.unravel_index(within.argmax(), within.shape)
        if within[row, column] >= _LEAST_SEEN:
            share = np.array([column + 0.5, row + 0.5]) / picture.shape[1::-1]
            found[number] = (2.0 * share - 1.0) * (1.0, -1.0) * camera.half
    return found


def ready_pyvista(*, draws: bool = True) -> ModuleType:
    """Return the module PyVista; if it ``draws``, ensure that it can.

    Raises:
        PictureError: it is missing, or its VTK needs a display and there is none.
    """
    try:
        import pyvista
    except ImportError:
        raise PictureError(f"this is drawn by {PYVISTA}") from None
    if draws and not can_draw():
        version = ".".join(map(str, pyvista.vtk_version_info))
        raise PictureError(f"VTK {version} needs a display: install Xvfb, or {PYVISTA}")
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # of the displays that it tries
    return pyvista


def image(
    solid: Solid, camera: Camera, width: int, *, plain: bool = False
) -> npt.NDArray[np.uint8]:
    """Return a picture with ``width`` pixels across on white ground, shape (h, w, 3).

    Args:
        solid: the body.
        camera: the camera.
        width: pixels across.
        plain: whether to draw the colours alone, without light and lines.

    Raises:
        PictureError: see ``ready_pyvista``.
    """
    pyvista = ready_pyvista()
    size = (width, round(width * float(camera.half[1] / camera.half[0])))
    plotter = pyvista.Plotter(off_screen=True, window_size=size, lighting="none")
    try:
        plotter.set_background("white")
        if plain:
            plotter.render_window.SetMultiSamples(0)
            _add_body(plotter, _surface(solid.points, solid.triangles), solid, lighting=False)
        else:
            plotter.enable_anti_aliasing("ssaa")
            _draw(plotter, solid)
        plotter.add_light(pyvista.Light(light_type="headlight"))
        plotter.camera.position = (
            camera.centre + 4 * float(np.linalg.norm(camera.half)) * camera.view.toward
        )
        plotter.camera.focal_point = camera.centre
        plotter.camera.up = camera.view.up
        plotter.camera.parallel_projection = True
        plotter.camera.parallel_scale = float(camera.half[1])
        plotter.renderer.ResetCameraClippingRange()
        return np.array(plotter.screenshot(return_img=True))
    finally:
        plotter.close()


def _draw(plotter: Plotter, solid: Solid) -> None:
    """Add the body and its surroundings to a plotter."""
    import pyvista

    light = {"ambient": AMBIENT_LIGHT, "diffuse": 1 - AMBIENT_LIGHT}
    skin = _surface(solid.points, solid.triangles)
    # Points with a normal each where the surface turns smoothly; several at sharp edges, and at
    # jumps of the field.
    smooth = skin.compute_normals(
        cell_normals=False,
        split_vertices=True,
        feature_angle=SHARP_EDGE,
        consistent_normals=False,
        non_manifold_traversal=False,
    )
    corners = smooth.faces.reshape(-1, 4)[:, 1:].ravel()
    body = _surface(smooth.points[corners], np.arange(len(corners)).reshape(-1, 3))
    body.point_data.active_normals = smooth.point_data["Normals"][corners]
    actor = _add_body(plotter, body, solid, **light)
    actor.prop.interpolation = "Phong"
    if solid.edges is not None and len(solid.edges):
        lines = pyvista.line_segments_from_points(solid.points[solid.edges].reshape(-1, 3))
        actor = plotter.add_mesh(lines, color=INK, line_width=1.0, opacity=0.25, lighting=False)
        # in front of the surface that they are on
        actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    plotter.add_silhouette(skin, color=INK, line_width=2.5, feature_angle=SHARP_EDGE)
    if solid.around is not None:
        undeformed = _surface(*solid.around)
        plotter.add_silhouette(
            undeformed, color=MUTED, line_width=1.5, feature_angle=SHARP_EDGE, opacity=0.6
        )
    for points, polygons in solid.grounds:
        ground = _surface(points, polygons)
        plotter.add_mesh(ground, color=GROUND, culling="back", **light)
        rim = ground.extract_feature_edges(
            boundary_edges=True, feature_edges=False, manifold_edges=False
        )
        plotter.add_mesh(rim, color=MUTED, line_width=1.5)


def _add_body(plotter: Plotter, body: PolyData, solid: Solid, **light: float) -> Actor:
    """Add triangles, each with its own points, in the colours of the field."""
    body.point_data["field"] = solid.values.ravel()
    colours = {"cmap": solid.colours or VALUES, "clim": solid.limits, "nan_color": GROUND}
    return plotter.add_mesh(body, show_scalar_bar=False, scalars="field", **colours, **light)


def _surface(points: Array, polygons: Ints) -> PolyData:
    import pyvista

    faces = np.column_stack((np.full(len(polygons), polygons.shape[1]), polygons))
    return pyvista.PolyData(np.asarray(points, dtype=np.float64), faces.ravel())


def can_draw() -> bool:
    """Return whether VTK needs no display or has one; without a display Xvfb is started, which ends
    with this process.
    """
    import pyvista

    if pyvista.vtk_version_info >= _WITHOUT_DISPLAY or os.environ.get("DISPLAY"):
        return True
    if shutil.which("Xvfb") is None:
        return False
    number, answer = os.pipe()
    with open(number, encoding="ascii") as text:
        server = subprocess.Popen(
            [
                "Xvfb",
                "-displayfd",
                str(answer),
                "-screen",
                "0",
                "64x64x24",
                "-nolisten",
                "tcp",
                "-noreset",
            ],
            pass_fds=[answer],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # an interrupt from the keyboard is for the solve
        )
        atexit.register(server.wait)
        atexit.register(server.terminate)  # before it is waited for
        atexit.register(pyvista.close_all)  # windows end before the display
        os.close(answer)
        name = text.readline().strip()  # nothing if the server has ended
    if name:
        os.environ["DISPLAY"] = f":{name}"
    return bool(name)
