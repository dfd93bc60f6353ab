r"""A cylinder in 3D that stands on the origin, with a structured mesh by gmsh.

::

               top                    seen from above: a core of nt by nt cells,
        +---------------+             and nr rings of 4 nt cells around it
        |               |
        |               |                   .-------.
   side |     body      |  height         .' \     / `.
        |               |                /    +---+    \
        |               |                |    |   |    |       x[1]
        +-------+-------+                \    +---+    /        |
             (0,0,0)                      `. /     \ .'         |
              bottom                        `-------'           +--- x[0]
                |radius |
"""

from __future__ import annotations

import math
from typing import Any, Literal

from mpi4py import MPI

from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Count, Length, generator, refuse_too_large
from signorini_fx.meshes._drawing import Drawing, around, mesh_extruded

# Corners of the core, as a share of the radius: cells in the core and around it are of one size
# there.
_CORE = 0.55


@generator(counts=("nr", "nt", "nz"))
def generate(
    comm: MPI.Comm,
    /,
    *,
    radius: Length = 1.0,
    height: Length = 1.0,
    nr: Count = 4,
    nt: Count = 6,
    nz: Count = 8,
    cell: Literal["hexahedron", "tetrahedron"] = "hexahedron",
    order: Literal[1, 2] = 1,
) -> Any:
    """A cylinder with a core of nt by nt cells and nr rings of 4 nt cells around it, in nz layers.

    Args:
        comm: the ranks that share the mesh.
        radius: of the cylinder, around the axis x[2].
        height: extent along x[2], from 0.
        nr: cells from the core to the side.
        nt: cells along each quarter of the circle.
        nz: cells along x[2].
        cell: shape of the cells.
        order: degree of the geometry: 1: the facets of the side are plane, only their corners are
            on the cylinder.

    Returns:
        The mesh with the boundaries bottom, side, top.
    """
    unit = radius  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        geo = gmsh.model.geo
        turns = [math.radians(45 + 90 * k) for k in range(4)]
        centre = drawing.point(0.0, 0.0)
        inner, outer = (
            [drawing.point(r * math.cos(turn), r * math.sin(turn)) for turn in turns]
            for r in (_CORE * radius, radius)
        )
        after = [1, 2, 3, 0]
        core = [geo.addLine(inner[k], inner[after[k]]) for k in range(4)]
        arcs = [geo.addCircleArc(outer[k], centre, outer[after[k]]) for k in range(4)]
        spokes = [geo.addLine(inner[k], outer[k]) for k in range(4)]
        loops = [core] + [[spokes[k], arcs[k], -spokes[after[k]], -core[k]] for k in range(4)]
        sections = [geo.addPlaneSurface([geo.addCurveLoop(loop)]) for loop in loops]
        counts = ((core + arcs, nt), (spokes, nr))
        names = {"side": around(1.0)}
        mesh_extruded(drawing, sections, counts, names, height, nz, cell=cell, order=order)

    refuse_too_large(comm, nt * (nt + 4 * nr) * nz, cell)
    return gmsh_mesh(comm, draw, name="cylinder", unit=unit)
