"""The surface of a solid from a file: STL, a CAD drawing, or a mesh; in 2D the boundary of
a mesh.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from signorini_fx.arrays import Array, Ints, diagonal, inner, sides_of
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mechanics.shapes.analytic import StraightPieces
from signorini_fx.mechanics.statement.rigid_shape import Corners, Shape
from signorini_fx.mechanics.statement.values import Positive
from signorini_fx.tuned import CORNER_ANGLE, INRADIUS_GRID, ROOT_OF_EPS, SAME_NUMBER


class ClosedSurface(Shape):
    """A closed surface of flat triangles; in 2D a closed line of straight pieces.

    Attributes:
        file: .stl, or the drawing or mesh of a solid, in 2D of an area, in any format that a mesh
            may have.
        size: length of the cells of a .step, .stp or .brep; None: a fraction of the size of the
            solid.
        scale: by which the lengths of the file are multiplied.
    """

    shape: Literal["surface"] = "surface"
    file: Path
    size: Positive | None = None
    scale: Positive = 1.0

    def contradictions(self, dimension: int, *, turns: bool = True) -> Iterator[tuple[str, str]]:
        yield from super().contradictions(dimension, turns=turns)
        try:
            file_dimension = self._surface.dimension
        except (MeshError, SceneError) as error:
            yield "file", str(error)
            return
        if file_dimension != dimension:
            words = {2: "plane", 3: "in 3D"}
            yield (
                "file",
                f"{self.file}: it is {words[file_dimension]}, and the mesh of the body "
                f"{words[dimension]}",
            )

    def initial(self, x: Array) -> tuple[Array, Array]:
        signed, normal = self._surface(np.asarray(x / self.scale))
        return self.scale * signed, normal

    def initial_corners(self, dimension: int) -> Corners:
        found = self._surface.corners(hollow=self.hollow)
        return replace(found, places=self.scale * found.places, edges=self.scale * found.edges)

    @property
    def facets(self) -> tuple[float, float]:
        """Width of the facets of curved parts, and their distance from the curved surface, lengths;
        zero in 2D.
        """
        width, off = self._surface.facets
        return self.scale * width, self.scale * off

    @property
    def inradius(self) -> float:
        return math.inf if self.hollow else self.scale * self._surface.inradius

    @property
    def _surface(self) -> CachedSurface:
        """The surface, which is read once for each version of the file."""
        changed = self.file.stat().st_mtime_ns if self.file.is_file() else 0
        return surface_of(self.file, self.size, changed)


@lru_cache(maxsize=8)
def surface_of(file: Path, size: float | None, _changed: int) -> CachedSurface:
    """Return the surface in a file; cached for each modification time of the file."""
    return CachedSurface(_read(file, size))


class CachedSurface:
    """A surface that keeps its last distances, as gap, direction and certificate evaluate it at the
    same points.
    """

    def __init__(self, surface: InThePlane | InSpace) -> None:
        self._surface = surface
        self.dimension = surface.dimension
        self._last: dict[bytes, tuple[Array, Array]] = {}
        self._corners: dict[bool, Corners] = {}

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Return signed distances and normals, shapes (n,) and (n, d)."""
        points = x.tobytes()
        if points not in self._last:
            self._last = {points: self._surface(x)}
        signed, normal = self._last[points]
        return signed.copy(), normal.copy()

    def corners(self, *, hollow: bool) -> Corners:
        """Return the convex corners of the solid, or of its surroundings if ``hollow``."""
        if hollow not in self._corners:
            self._corners[hollow] = self._surface.convex_corners(hollow=hollow)
        return self._corners[hollow]

    @property
    def facets(self) -> tuple[float, float]:
        """Width of facets and their distance from the curved surface, see ``InSpace.facets``; zero
        in 2D.
        """
        return getattr(self._surface, "facets", (0.0, 0.0))

    @cached_property
    def inradius(self) -> float:
        """Estimate of the radius of the largest ball inside, length.

        It is the largest distance of grid points from the surface, or, if larger, volume over area
        (in 2D area over perimeter), which suits thin solids.
        """
        bounds, thickness = self._surface.extent
        axes = [np.linspace(low, high, INRADIUS_GRID) for low, high in bounds.T]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, self.dimension)
        return max(thickness, -float(self._surface(grid)[0].min()))


def _read(file: Path, size: float | None) -> InThePlane | InSpace:
    """Return the surface in a file.

    Raises:
        MeshError: the file does not exist or contains no valid surface.
    """
    if not file.is_file():
        raise MeshError(f"{file}: no such file")
    if file.suffix.lower() == ".stl":
        return InSpace(file, *_stl(file))
    from signorini_fx.mechanics.mesh.files.formats import read_file
    from signorini_fx.mechanics.statement.mesh_sources import MeshFile

    mesh = read_file(MeshFile(file=file, size=size), degree=1, joined=True)
    if mesh.dim == 2:
        around = (0, 1, 2) if mesh.cell.word == "triangles" else (0, 1, 3, 2)
        return InThePlane(mesh.points, _rim(mesh.points, mesh.corners[:, around]))
    faces = mesh.facet_corners
    return InSpace(
        file, mesh.points, faces if faces.shape[1] == 3 else np.vstack((faces[:, :3], faces[:, 1:]))
    )


def _stl(file: Path) -> tuple[Array, Ints]:
    """Return the points and triangles of an STL file; equal points are merged."""
    from signorini_fx.mechanics.mesh.files.formats import read_meshio

    raw = read_meshio(file, "stl")
    blocks = [nodes for kind, nodes in raw.blocks if kind == "triangle" and len(nodes)]
    if not blocks or not np.isfinite(raw.points).all():
        raise MeshError(f"{file}: it has no triangles, or points that are not finite")
    points, joined = np.unique(raw.points, axis=0, return_inverse=True)
    triangles = joined.reshape(-1)[np.concatenate(blocks)]
    flat = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)  # two corners are one: no area
    return points, triangles[~flat]


def _rim(points: Array, cells: Ints) -> Ints:
    """Return the sides of cells, counterclockwise around each, as numbers of their ends.

    ``cells``: the corners of each cell in order around it, shape (m, 3 or 4).
    """
    x, y = points[cells].transpose(2, 0, 1)
    turning = (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
    cells = np.where((turning < 0)[:, None], cells[:, ::-1], cells)
    return sides_of(cells).reshape(-1, 2)


class InThePlane(StraightPieces):
    """The boundary of an area, from points, shape (n, 2), and the ends of the sides of its cells,
    counterclockwise around each of them, shape (m, 2).
    """

    dimension = 2

    def __init__(self, points: Array, sides: Ints) -> None:
        outer = ~np.isin(
            sides[:, 0] * len(points) + sides[:, 1], sides[:, 1] * len(points) + sides[:, 0]
        )
        super().__init__(points, sides[outer][:, ::-1])  # clockwise: outside is on the left
        ends = points[sides[outer]]
        area = float(np.linalg.det(ends - ends.mean(axis=(0, 1))).sum()) / 2
        perimeter = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())
        # The least and the greatest coordinates, and the area over the perimeter; in 3D the volume
        # over the area.
        self.extent = np.stack((ends.min(axis=(0, 1)), ends.max(axis=(0, 1)))), area / perimeter


class InSpace:
    """A closed surface of triangles with VTK's signed distance.

    ``file``: its name in messages; ``points``: length, shape (n, 3); ``triangles``: numbers of
    corners in any order, shape (m, 3).

    Raises:
        MeshError: the surface is not closed or cannot be oriented, or pyvista is missing.
    """

    dimension = 3

    def __init__(self, file: Path, points: Array, triangles: Ints) -> None:
        sides = np.sort(sides_of(triangles).reshape(-1, 2), axis=1)
        _, counts = np.unique(sides[:, 0] * len(points) + sides[:, 1], return_counts=True)
        if (counts != 2).any():
            raise MeshError(
                f"{file}: the surface is not closed: {np.count_nonzero(counts == 1)} sides of its "
                f"{len(triangles)} "
                f"triangles belong to one alone, {np.count_nonzero(counts > 2)} to more than two"
            )
        try:
            import pyvista
            from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance
        except ModuleNotFoundError as error:
            raise MeshError(
                f"{file}: a surface in 3D needs the Python package {error.name}: see pyvista"
            ) from None
        surface = pyvista.PolyData.from_regular_faces(points, triangles)
        faced = surface.compute_normals(
            split_vertices=False, consistent_normals=True, auto_orient_normals=True
        )
        order = faced.regular_faces
        directed = order * len(points) + np.roll(order, -1, axis=1)
        if np.unique(directed).size < directed.size:
            raise MeshError(
                f"{file}: the surface has no inside and outside: its triangles cannot be oriented "
                "alike"
            )
        self._distance = vtkImplicitPolyDataDistance()
        self._distance.SetInput(faced)
        self._size = diagonal(points)
        self.extent = np.reshape(faced.bounds, (3, 2)).T, faced.volume / faced.area
        self._points = np.asarray(faced.points)
        self._triangles = order

    @cached_property
    def _edges(self) -> tuple[Ints, Array, Array, Array, Array]:
        """The e edges of the surface.

        These are their ends, shape (e, 2), the normals of both triangles, shape (e, 3) each, the
        sines of the angles between the normals, positive where the solid is convex, and the mean
        height of both triangles over the edge, length, shape (e,) each.
        """
        x = self._points
        triangles = self._triangles
        normals = np.cross(
            x[triangles[:, 1]] - x[triangles[:, 0]], x[triangles[:, 2]] - x[triangles[:, 0]]
        )
        areas = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)  # twice
        normals /= areas[:, None]
        ends = sides_of(triangles).reshape(-1, 2)
        order = np.lexsort(np.sort(ends, axis=1).T)  # each edge twice, one after the other
        first = order[::2]
        second = order[1::2]
        one = normals[first // 3]
        other = normals[second // 3]
        along = x[ends[first, 1]] - x[ends[first, 0]]
        length = np.linalg.norm(along, axis=1)
        turned = inner(np.cross(one, other), along) / length
        height = (areas[first // 3] + areas[second // 3]) / (2 * length)
        return ends[first], one, other, turned, height

    @cached_property
    def facets(self) -> tuple[float, float]:
        """Median width of the facets of curved parts, and their median distance from the curved
        surface, lengths; zero if all parts are flat.
        """
        *_, turned, height = self._edges
        smooth = (np.abs(turned) > ROOT_OF_EPS) & (np.abs(turned) <= math.sin(CORNER_ANGLE))
        if not smooth.any():
            return 0.0, 0.0
        off = np.abs(turned[smooth]) * height[smooth] / 8
        return float(np.median(height[smooth])), float(np.median(off))

    def convex_corners(self, *, hollow: bool) -> Corners:
        """Return the convex edges, sharper than those between facets of a curved surface, and the
        points where at least three of them meet; of the solid, or if ``hollow`` of its
        surroundings.
        """
        x = self._points
        edges, one, other, turned, _ = self._edges
        turned = turned * (-1.0 if hollow else 1.0)
        sharp = (turned > math.sin(CORNER_ANGLE)) | (inner(one, other) < 0) & (turned >= 0)
        edges = edges[sharp]
        at = np.flatnonzero(np.bincount(edges.ravel(), minlength=len(x)) > 2)
        of_edge = np.stack((one[sharp], other[sharp]), axis=1)
        sides = of_edge[[(edges == k).any(axis=1).argmax() for k in at]].reshape(-1, 2, 3)
        return Corners(x[at], np.zeros(at.size), -sides if hollow else sides, x[edges])

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Return signed distances and normals, shapes (n,) and (n, 3)."""
        closest = np.zeros_like(x)
        signed = np.zeros(len(x))
        for k, point in enumerate(x):
            signed[k] = self._distance.EvaluateFunctionAndGetClosestPoint(point, closest[k])
        far = np.abs(signed) > SAME_NUMBER * self._size
        normal = np.zeros_like(x)
        normal[far] = (x - closest)[far] / signed[far, None]
        for k in np.flatnonzero(~far):
            self._distance.EvaluateGradient(x[k], normal[k])
        return signed, normal / np.linalg.norm(normal, axis=1)[:, None]
