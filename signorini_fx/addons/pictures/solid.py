"""Surfaces in 3D, drawn by PyVista without a window."""

from __future__ import annotations

import atexit
import math
import os
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.pictures.view import Camera
from signorini_fx.errors import PYVISTA, PictureError
from signorini_fx.tuned import AMBIENT_LIGHT, LAMPS, SHARP_EDGE

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]

# The first VTK that draws without a display.  An older one ends the process.
_WITHOUT_DISPLAY = (9, 4)
GROUND, INK, MUTED = "#dcdcdc", "#1a1a1a", "#6b6b6b"


@dataclass(frozen=True)
class Lines:
    """Straight lines of one colour: their ends, shape (k, 2, 3), and their width in pixels."""

    ends: Floats
    colour: str
    width: float


@dataclass(frozen=True)
class Cut:
    """The cells of a body, of which what is before a plane is left out.

    Attributes:
        points: where they are drawn, shape (n, 3).
        values: the field at them, shape (n,).
        cells: in the order of VTK, shape (m, 4) for tetrahedra, (m, 8) for hexahedra.
        origin: a point of the plane, shape (3,).
        normal: towards what is left out, shape (3,).
    """

    points: Floats
    values: Floats
    cells: Rows
    origin: Floats
    normal: Floats


@dataclass(frozen=True)
class Solid:
    """The surface of a body with a field, and what is around it.

    Attributes:
        points: where they are drawn, shape (n, 3).
        triangles: of the surface, counterclockwise as seen from outside, shape (t, 3).
        values: the field at their corners, shape (t, 3).
        colours: a colour map of matplotlib, or its name.
        limits: values of its first and its last colour.
        edges: lines of the mesh to draw, pairs of points, shape (e, 2).
        at_rest: the undeformed points, shape (n, 3), whose outline is drawn; None: it is not.
        grounds: points and polygons of each foundation, seen from the side of the body only.
        lines: more lines.
        cut: drawn in place of the whole surface.
    """

    points: Floats
    triangles: Rows
    values: Floats
    colours: Any
    limits: tuple[float, float]
    edges: Rows
    at_rest: Floats | None = None
    grounds: Sequence[tuple[Floats, Rows]] = ()
    lines: Sequence[Lines] = ()
    cut: Cut | None = None


def draw(plotter: Any, solid: Solid, camera: Camera) -> None:
    """Into a plotter of PyVista, with its light."""
    import pyvista

    if solid.cut is not None:
        solid = _behind(solid, solid.cut)
    skin = _surface(solid.points, solid.triangles)
    # Points with a normal each where the surface turns smoothly; several at sharp edges, and at jumps of the field.
    smooth = skin.compute_normals(
        cell_normals=False,
        split_vertices=True,
        feature_angle=SHARP_EDGE,
        consistent_normals=False,
        non_manifold_traversal=False,
    )
    corners = smooth.faces.reshape(-1, 4)[:, 1:].ravel()
    body = _surface(smooth.points[corners], np.arange(len(corners)).reshape(-1, 3))
    body.point_data["field"] = solid.values.ravel()
    body.point_data.active_normals = smooth.point_data["Normals"][corners]
    actor = plotter.add_mesh(
        body,
        scalars="field",
        cmap=solid.colours,
        clim=solid.limits,
        nan_color=GROUND,
        show_scalar_bar=False,
        ambient=AMBIENT_LIGHT,
        diffuse=1 - AMBIENT_LIGHT,
    )
    actor.prop.interpolation = "Phong"
    _draw_lines(plotter, solid.points[solid.edges], INK, 1.0, opacity=0.25)
    plotter.add_silhouette(skin, color=INK, line_width=2.5, feature_angle=SHARP_EDGE)
    if solid.at_rest is not None:
        undeformed = _surface(solid.at_rest, solid.triangles)
        plotter.add_silhouette(undeformed, color=MUTED, line_width=1.5, feature_angle=SHARP_EDGE, opacity=0.6)
    for points, polygons in solid.grounds:
        ground = _surface(points, polygons)
        plotter.add_mesh(ground, color=GROUND, culling="back", ambient=AMBIENT_LIGHT, diffuse=1 - AMBIENT_LIGHT)
        rim = ground.extract_feature_edges(boundary_edges=True, feature_edges=False, manifold_edges=False)
        plotter.add_mesh(rim, color=MUTED, line_width=1.5)
    for lines in solid.lines:
        _draw_lines(plotter, lines.ends, lines.colour, lines.width)
    plotter.remove_all_lights()
    for position, bright in LAMPS:
        plotter.add_light(pyvista.Light(position=position, intensity=bright, light_type="camera light"))
    plotter.camera.position = camera.position
    plotter.camera.focal_point = camera.centre
    plotter.camera.up = camera.view.up
    plotter.camera.view_angle = 2 * math.degrees(math.atan(camera.half[1] / camera.distance))
    plotter.renderer.ResetCameraClippingRange()


def image(solid: Solid, camera: Camera, width: int) -> npt.NDArray[np.uint8]:
    """A picture with this many pixels across on a white ground, shape (h, w, 3).

    Raises:
        PictureError: PyVista is missing, or its VTK needs a display and there is none.
    """
    try:
        import pyvista
    except ImportError:
        raise PictureError(f"a body in 3D is drawn by {PYVISTA}") from None
    if not can_draw():
        version = ".".join(map(str, pyvista.vtk_version_info))
        raise PictureError(f"VTK {version} needs a display: install Xvfb, or {PYVISTA}")
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # of the displays that it tries
    size = (width, round(width * float(camera.half[1] / camera.half[0])))
    plotter = pyvista.Plotter(off_screen=True, window_size=size)
    try:
        plotter.set_background("white")
        plotter.enable_anti_aliasing("ssaa")
        draw(plotter, solid, camera)
        return np.array(plotter.screenshot(return_img=True))
    finally:
        plotter.close()


def can_draw() -> bool:
    """Whether VTK needs no display or has one: where there is none Xvfb is started, which ends with this process."""
    import pyvista

    if pyvista.vtk_version_info >= _WITHOUT_DISPLAY or os.environ.get("DISPLAY"):
        return True
    if shutil.which("Xvfb") is None:
        return False
    number, answer = os.pipe()
    with open(number, encoding="ascii") as text:
        server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(answer), "-screen", "0", "64x64x24", "-nolisten", "tcp"],
            pass_fds=[answer],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # an interrupt from the keyboard is for the solve
        )
        atexit.register(server.wait)
        atexit.register(server.terminate)  # before it is waited for
        os.close(answer)
        name = text.readline().strip()  # nothing if the server has ended
    if name:
        os.environ["DISPLAY"] = f":{name}"
    return bool(name)


def _behind(solid: Solid, cut: Cut) -> Solid:
    """The surface of what is left of a body."""
    import pyvista
    from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter

    kind = {4: pyvista.CellType.TETRA, 8: pyvista.CellType.HEXAHEDRON}[cut.cells.shape[1]]
    grid = pyvista.UnstructuredGrid({kind: cut.cells}, cut.points)
    grid.point_data["field"] = cut.values
    surface = vtkGeometryFilter()  # PyVista calls it by other names in each of its versions
    surface.SetInputData(grid.clip(normal=cut.normal, origin=cut.origin, invert=True))
    surface.Update()
    remaining = pyvista.wrap(surface.GetOutput()).triangulate()
    triangles = remaining.faces.reshape(-1, 4)[:, 1:]
    return replace(solid, points=remaining.points, triangles=triangles, values=remaining.point_data["field"][triangles])


def _surface(points: Floats, polygons: Rows) -> Any:
    import pyvista

    faces = np.column_stack((np.full(len(polygons), polygons.shape[1]), polygons))
    return pyvista.PolyData(np.asarray(points, dtype=np.float64), faces.ravel())


def _draw_lines(plotter: Any, ends: Floats, colour: str, width: float, opacity: float = 1.0) -> None:
    import pyvista

    if len(ends):
        lines = pyvista.line_segments_from_points(ends.reshape(-1, 3))
        actor = plotter.add_mesh(lines, color=colour, line_width=width, opacity=opacity, lighting=False)
        actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()  # in front of the surface that they are on
