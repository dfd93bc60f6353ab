r"""An angle bracket with a bolt hole, meshed by gmsh, with small cells around the hole.

::

        seen from the front                     seen from above

             +--+  top                                  back
             |  |                           +--+-------------------+
       heel  |  |  inside                   |  |       .--.        |
     height  |  |                           |  |      ( () ) seat  |  toe      width
             |  `-. fillet                  |  |       `--' hole   |
             |     `-----------------+      +--+-------------------+
  thickness  |           :hole:      | toe             front
             +-----------------------+
          (0,0,0)     foot        length

The middle of its width is at x[1] = 0; the foot lies on the foundation, x[2] = 0, and the head of
the bolt on the seat. If it is symmetric, it ends at x[1] = 0, where its boundary is symmetry
instead of front.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from mpi4py import MPI

from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Length, generator, refuse
from signorini_fx.meshes._drawing import Drawing, Sizes, Surface, around, mesh_solid, plane


@generator(sizes=("size", "contact_size"))
def generate(
    comm: MPI.Comm,
    /,
    *,
    length: Length = 60.0,
    width: Length = 40.0,
    height: Length = 50.0,
    thickness: Length = 8.0,
    fillet: Length = 6.0,
    radius: Length = 5.5,
    seat_radius: Length = 10.0,
    size: Length = 6.0,
    contact_size: Length = 2.5,
    contact_zone: Length = 2.0,
    symmetric: bool = False,
    cell: Literal["tetrahedron", "hexahedron"] = "tetrahedron",
    order: Literal[1, 2] = 1,
) -> Any:
    """A bracket that is bolted to the foundation through its foot.

    Args:
        comm: the ranks that share the mesh.
        length: of the foot, along x[0].
        width: along x[1], from minus to plus half of it.
        height: of the upright leg, along x[2].
        thickness: of foot and leg.
        fillet: radius between foot and leg.
        radius: of the hole, in the middle of the flat part of the foot.
        seat_radius: of the ring around the hole that the head of the bolt, or its washer, lies on.
        size: length of the edges of cells far from the seat.
        contact_size: length of the edges of cells under the seat.
        contact_zone: distance from the seat up to which cells are of that size.
        symmetric: only its half with x[1] >= 0.
        cell: shape of the cells; hexahedra are divided tetrahedra, whose shape is not as good.
        order: degree of the geometry: 1: the facets of round surfaces are plane, only their corners
            are on them.

    Returns:
        The mesh with the boundaries foot, heel, toe, top, inside (the upper face of the foot, the
        fillet and the leg's face over the foot), back, hole, seat, and front or, if it is
        symmetric, symmetry.
    """
    flat = length - thickness - fillet
    if thickness + fillet >= min(length, height):
        refuse("thickness", "thickness and fillet together must be less than length and height")
    if 2 * seat_radius >= min(width, flat):
        refuse(
            "seat_radius",
            f"the seat does not fit: 2 seat_radius must be less than {min(width, flat):g}",
        )
    if radius >= seat_radius:
        refuse(
            "radius", f"radius must be less than seat_radius, got {radius:g} and {seat_radius:g}"
        )

    unit = length / 6.0  # the gmsh model measures a few units

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        occ = gmsh.model.occ
        long, wide, high, thick, bend, hole, seat = (
            drawing.length(value)
            for value in (length, width, height, thickness, fillet, radius, seat_radius)
        )
        centre = (thick + bend + long) / 2
        low = 0.0 if symmetric else -wide / 2
        foot = occ.addBox(0.0, low, 0.0, long, wide / 2 - low, thick)
        leg = occ.addBox(0.0, low, 0.0, thick, wide / 2 - low, high)
        ((_, body),) = occ.fuse([(3, foot)], [(3, leg)])[0]
        occ.synchronize()
        # The inner edge, where foot and leg meet.
        (edge,) = (
            tag
            for _, tag in gmsh.model.getEntitiesInBoundingBox(
                thick - _NEAR, low - _NEAR, thick - _NEAR, thick + _NEAR, wide, thick + _NEAR, 1
            )
        )
        ((_, body),) = occ.fillet([body], [edge], [bend])
        ((_, body),) = occ.cut(
            [(3, body)], [(3, occ.addCylinder(centre, 0.0, -thick, 0.0, 0.0, 3 * thick, hole))]
        )[0]
        # The rim of the seat is drawn on the foot, so that facets end at it.
        rim = occ.addCircle(centre, 0.0, thick, seat)
        occ.fragment([(3, body)], [(1, rim)])
        if symmetric:
            outside = [
                entity for entity in occ.getEntities(1) if occ.getCenterOfMass(*entity)[1] < -_NEAR
            ]
            occ.remove(outside)

        def away(x: Any, y: Any) -> Any:
            return np.hypot(x - centre, y)

        names: dict[str, Surface] = {
            "foot": plane(2, 0.0),
            "heel": plane(0, 0.0),
            "toe": plane(0, long),
            "top": plane(2, high),
            "symmetry" if symmetric else "front": plane(1, low),
            "back": plane(1, wide / 2),
            "hole": around(hole, centre),
            "seat": lambda x: (np.abs(x[2] - thick) < 1e-5) & (away(x[0], x[1]) < seat + 1e-5),
            "inside": lambda x: (x[0] > thick - 1e-5) & (x[2] > thick - 1e-5),
        }

        def distance(x: float, y: float, _z: float) -> float:
            return max(math.hypot(x - centre, y) - seat, 0.0)

        mesh_solid(drawing, names, sizes, distance, cell=cell, order=order)

    sizes = Sizes(contact_size, size, zone=contact_zone, reach=max(length, height) / 2)
    return gmsh_mesh(comm, draw, name="bracket", unit=unit)


_NEAR = 1e-6
