r"""A flat ring in 3D that lies on the plane through the origin, with a structured mesh by gmsh.

::

               radius
                 |------------|
                    inner_radius
                 |------|
        +------+ - - - - +----top---+
        | body |   |     |   body   | outer     height
        +------+ - + - - +--bottom--+
                (0,0,0)  inner
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from mpi4py import MPI
from pydantic import Field

from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Count, Length, generator, refuse, refuse_too_large
from signorini_fx.meshes._drawing import Drawing, around, mesh_extruded

# A curved cell that turns by a right angle may be inverted.
Around = Annotated[Count, Field(gt=1)]


@generator(counts=("nr", "nt", "nz"), least={"nt": 2})
def generate(
    comm: MPI.Comm,
    /,
    *,
    radius: Length = 2.0,
    inner_radius: Length = 1.0,
    height: Length = 0.5,
    nr: Count = 6,
    nt: Around = 10,
    nz: Count = 4,
    cell: Literal["hexahedron", "tetrahedron"] = "hexahedron",
    order: Literal[1, 2] = 1,
) -> Any:
    """A ring of nr by 4 nt cells, in nz layers, as a washer or the ring of a thrust bearing.

    Args:
        comm: the ranks that share the mesh.
        radius: outer radius, around the axis x[2].
        inner_radius: of the hole, less than ``radius``.
        height: extent along x[2], from 0.
        nr: cells from the hole to the outer side.
        nt: cells along each quarter of the ring, at least 2.
        nz: cells along x[2].
        cell: shape of the cells.
        order: degree of the geometry: 1: the facets of the round sides are plane, only their
            corners are on them.

    Returns:
        The mesh with the boundaries bottom, inner, outer, top.
    """
    if inner_radius >= radius:
        refuse(
            "inner_radius",
            f"inner_radius must be less than radius, got {inner_radius:g} and {radius:g}",
        )

    unit = radius / 2.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        geo = gmsh.model.geo
        centre = drawing.point(0.0, 0.0)
        corners = ((1, 0), (0, 1), (-1, 0), (0, -1))
        rims = [[drawing.point(r * x, r * y) for x, y in corners] for r in (inner_radius, radius)]
        after = [1, 2, 3, 0]
        inner, outer = (
            [geo.addCircleArc(rim[k], centre, rim[after[k]]) for k in range(4)] for rim in rims
        )
        spokes = [geo.addLine(a, b) for a, b in zip(*rims, strict=True)]
        loops = [[spokes[k], outer[k], -spokes[after[k]], -inner[k]] for k in range(4)]
        sections = [geo.addPlaneSurface([geo.addCurveLoop(loop)]) for loop in loops]
        counts = (inner + outer, nt), (spokes, nr)
        names = {"inner": around(inner_radius / unit), "outer": around(2.0)}
        mesh_extruded(drawing, sections, counts, names, height, nz, cell=cell, order=order)

    refuse_too_large(comm, 4 * nt * nr * nz, cell)
    return gmsh_mesh(comm, draw, name="ring", unit=unit)
