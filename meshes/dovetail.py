r"""The dovetail foot of a turbine blade, for its groove, meshed by gmsh, with small cells along the flanks.

::

                 top
              +-------+
              |       |
              | body  |         stem: neck wide
              |       |
      fillet  )       (  fillet
             /         \
       left /           \ right         flanks, angle: from the horizontal
           /             \
          (               )
           `------+------'
               (0,0)  bottom
           |-- width ---|

The sides of the stem, the fillets and the rounded edges of the foot have no name.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from mpi4py import MPI
from pydantic import Field

from signorini_fx.mechanics.mesh.drawing import Corner, Drawing, Sizes, draw_outline, mesh_surface
from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Length, generator, refuse

Angle = Annotated[float, Field(ge=10, le=80, allow_inf_nan=False)]


@generator(sizes=("size", "contact_size"))
def generate(
    comm: MPI.Comm,
    /,
    *,
    width: Length = 30.0,
    neck: Length = 14.0,
    angle: Angle = 50.0,
    edge: Length = 5.0,
    stem: Length = 14.0,
    fillet: Length = 2.0,
    size: Length = 1.0,
    contact_size: Length = 0.25,
    contact_zone: Length = 0.5,
    cell: Literal["triangle", "quadrilateral"] = "triangle",
    order: Literal[1, 2] = 1,
) -> Any:
    """A blade foot that stands on the origin and points up.

    Args:
        comm: the ranks that share the mesh.
        width: of the foot, more than the neck.
        neck: width of the stem.
        angle: of the flanks, from the horizontal, degrees.
        edge: height of the upright side of the foot, below the flank.
        stem: length of the stem above the flanks.
        fillet: radius of the fillets between flank and stem, and of the edges of the foot.
        size: length of the facets far from the flanks.
        contact_size: length of the facets of the flanks.
        contact_zone: distance from the flanks up to which cells are of that size.
        cell: shape of the cells.
        order: degree of the geometry: 1: the facets of the arcs are straight.

    Returns:
        The mesh with the boundaries bottom, right and left (the flanks), top.
    """
    slope = math.tan(math.radians(angle))
    shoulder = edge + (width - neck) / 2 * slope
    flank = math.hypot((width - neck) / 2, shoulder - edge)
    # The lengths that the arcs take from the sides: the corners turn by the angle of the flank, or by its complement.
    above, beside = math.radians(90 - angle) / 2, math.radians(90 - angle) / 2
    if neck >= width:
        refuse("neck", f"neck must be less than width, got {neck:g} and {width:g}")
    if fillet * (math.tan(above) + math.tan(beside)) >= flank or fillet * (1 + math.tan(beside)) >= edge:
        refuse("fillet", f"fillet {fillet:g} does not fit on the flanks or the edge")
    if 2 * fillet >= width or fillet * math.tan(above) >= stem:
        refuse("fillet", f"fillet {fillet:g} does not fit on the bottom or the stem")

    unit = width / 30.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        half, slim, top = width / 2, neck / 2, shoulder + stem
        right = [
            Corner(half, 0.0, "", fillet),
            Corner(half, edge, "right", fillet),
            Corner(slim, shoulder, "", fillet),
            Corner(slim, top, "top"),
        ]
        left = [
            Corner(-slim, top, ""),
            Corner(-slim, shoulder, "left", fillet),
            Corner(-half, edge, "", fillet),
            Corner(-half, 0.0, "bottom", fillet),
        ]
        body, names = draw_outline(drawing, right + left)
        sizes = Sizes(contact_size, size, zone=contact_zone, reach=width / 2)
        mesh_surface(drawing, [body], names, sizes, curves=names["left"] + names["right"], cell=cell, order=order)

    return gmsh_mesh(comm, draw, name="dovetail", unit=unit)
