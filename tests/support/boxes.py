"""Bodies of several rectangles, apart or joined at single corners."""

from __future__ import annotations

from dataclasses import dataclass

from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.scenes.reading import parse_scene


@dataclass(frozen=True)
class Box:
    """A rectangle with boundaries ``left NAME``, ``right NAME``, ``bottom NAME``, ``top NAME``, and
    so many cells.
    """

    name: str
    x: float
    y: float
    width: float
    height: float
    nx: int = 4
    ny: int = 4

    @property
    def corners(self):
        return [
            (self.x, self.y),
            (self.x + self.width, self.y),
            (self.x + self.width, self.y + self.height),
            (self.x, self.y + self.height),
        ]


def boxes_mesh(comm, boxes, *, joined=(), quadrilaterals=True):
    """The mesh of several boxes; corners at the points ``joined`` are one node, all others are
    nodes of their own.
    """

    def draw(gmsh):
        geo, shared, lines, surfaces = gmsh.model.geo, {}, {}, []

        def point(x, y):
            if (x, y) not in shared or (x, y) not in joined:
                shared[x, y] = geo.addPoint(x, y, 0.0)
            return shared[x, y]

        for box in boxes:
            corners = [point(*corner) for corner in box.corners]
            sides = [
                geo.addLine(a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)
            ]
            for side, count in zip(sides, (box.nx, box.ny, box.nx, box.ny), strict=True):
                geo.mesh.setTransfiniteCurve(side, count + 1)
            surface = geo.addPlaneSurface([geo.addCurveLoop(sides)])
            geo.mesh.setTransfiniteSurface(surface)
            if quadrilaterals:
                geo.mesh.setRecombine(2, surface)
            surfaces.append(surface)
            lines |= {
                f"{side} {box.name}": line
                for side, line in zip(("bottom", "right", "top", "left"), sides, strict=True)
            }
        geo.synchronize()
        for name, line in lines.items():
            gmsh.model.setPhysicalName(1, gmsh.model.addPhysicalGroup(1, [line]), name)
        gmsh.model.setPhysicalName(2, gmsh.model.addPhysicalGroup(2, surfaces), "body")
        gmsh.model.mesh.generate(2)

    return gmsh_mesh(comm, draw, "boxes")


def scene_on(mesh, **effects):
    """A scene on a mesh of one's own."""
    return parse_scene({"mesh": mesh, "material": {"young": 1000.0, "poisson": 0.3}, **effects})
