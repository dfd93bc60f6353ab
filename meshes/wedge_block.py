r"""A wedge in 3D for a straight groove, with a structured mesh by gmsh.

::

                  top
        +---------------------+
         \                   /
     left \       body      / right     height     x[2]
           \        :angle /                        |
            +-------+-----+                         |    length along x[1],
          tip     (0,0,0)                           +--- x[0]     front to back
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from mpi4py import MPI
from pydantic import Field

from signorini_fx.mechanics.mesh.drawing import Drawing, mesh_extruded
from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Length, generator, refuse_too_large
from signorini_fx.meshes.wedge import Angle, draw_section

Count = Annotated[int, Field(gt=0, le=2_000)]


@generator(counts=("nx", "ny", "nz"), simplices="tetrahedron")
def generate(
    comm: MPI.Comm,
    /,
    *,
    tip: Length = 1.0,
    length: Length = 2.0,
    height: Length = 2.0,
    angle: Angle = 15.0,
    nx: Count = 8,
    ny: Count = 8,
    nz: Count = 12,
    cell: Literal["hexahedron", "tetrahedron"] = "hexahedron",
) -> Any:
    """A wedge that points down.

    Args:
        comm: the ranks that share the mesh.
        tip: width of the tip, along x[0].
        length: extent along x[1], from 0.
        height: extent along x[2], from 0.
        angle: of each flank, from the vertical, degrees; with friction in a groove the wedge sticks by itself where
            its tangent is less than the coefficient.
        nx: facets across tip and top.
        ny: facets along x[1].
        nz: facets up the flanks.
        cell: shape of the cells.

    Returns:
        The mesh with the boundaries tip, right, top, left, front, back.
    """
    unit = height / 2.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit, upright=True)
        section, sides = draw_section(drawing, tip, height, angle, (nx, nz))
        mesh_extruded(drawing, [section], sides, (0.0, length, 0.0), ny, ("front", "back"), cell=cell)

    refuse_too_large(comm, nx * ny * nz * (6 if cell == "tetrahedron" else 1))
    return gmsh_mesh(comm, draw, name="wedge_block", unit=unit)
