"""Meshes that no generator makes: moved grids with boundaries named at will, and one triangle."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.mechanics.mesh.tagged import TaggedMesh, gmsh_mesh, tag_boundaries

Points = npt.NDArray[np.float64]
Marker = Callable[[Points], npt.NDArray[np.bool_]]
SIDES: dict[str, Marker] = {
    "left": lambda x: x[0] < 1e-9,
    "right": lambda x: x[0] > 1 - 1e-9,
    "bottom": lambda x: x[1] < 1e-9,
    "top": lambda x: x[1] > 1 - 1e-9,
}


def grid(
    nx: int,
    ny: int,
    place: Callable[[Points], Points] = lambda x: x,
    *,
    cell: str = "quadrilateral",
    sides: Mapping[str, Marker] = SIDES,
    comm: MPI.Comm = MPI.COMM_SELF,
) -> TaggedMesh:
    """A grid of the unit square, its boundaries named there, then moved: ``place`` maps points of shape (n, 2)."""
    corners = [np.zeros(2), np.ones(2)]
    tagged = tag_boundaries(dmesh.create_rectangle(comm, corners, [nx, ny], dmesh.CellType[cell]), sides)
    x = tagged.mesh.geometry.x
    x[:, :2] = place(x[:, :2].copy())
    return tagged


def stretched(length: float, height: float) -> Callable[[Points], Points]:
    """The rectangle [0, length] x [0, height]."""
    return lambda x: x * np.array([length, height])


def turned(angle: float, length: float = 3.0, height: float = 1.0) -> Callable[[Points], Points]:
    """That rectangle turned about the origin."""
    c, s = np.cos(angle), np.sin(angle)
    return lambda x: stretched(length, height)(x) @ np.array([[c, s], [-s, c]])


def triangle(points: Any, sides: Mapping[str, tuple[int, int]]) -> TaggedMesh:
    """One triangle, its sides named by the numbers of their ends."""

    def draw(gmsh: Any) -> None:
        geo = gmsh.model.geo
        corners = [geo.addPoint(x, y, 0.0) for x, y in points]
        lines = {(a, b): geo.addLine(corners[a], corners[b]) for a, b in ((0, 1), (1, 2), (2, 0))}
        for line in lines.values():
            geo.mesh.setTransfiniteCurve(line, 2)
        body = geo.addPlaneSurface([geo.addCurveLoop(list(lines.values()))])
        geo.mesh.setTransfiniteSurface(body)
        geo.synchronize()
        gmsh.model.addPhysicalGroup(2, [body], name="body")
        for name, ends in sides.items():
            gmsh.model.addPhysicalGroup(1, [lines[ends]], name=name)
        gmsh.model.mesh.generate(2)

    return gmsh_mesh(MPI.COMM_SELF, draw, name="triangle")
