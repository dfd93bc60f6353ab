r"""The lower half of a disk that stands on the origin, meshed by gmsh, with small cells at the
point of first contact.

::

       (-R,R)     top      (R,R)              (0,R) top (R,R)
          +--------+--------+                    +--------+
           \      :       /                     |       /
            \    body    /  arc        symmetry |      /  arc
              `-. : .-'                          |  .-'
                 `+'                             +'
                 (0,0)                         (0,0)

             whole                             symmetric
"""

from __future__ import annotations

from typing import Any, Literal

from mpi4py import MPI

from signorini_fx.mechanics.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Length, generator
from signorini_fx.meshes._drawing import Drawing, Sizes, mesh_surface


@generator(sizes=("size", "contact_size"))
def generate(
    comm: MPI.Comm,
    /,
    *,
    radius: Length = 8.0,
    size: Length = 1.0,
    contact_size: Length = 0.02,
    contact_zone: Length = 0.5,
    symmetric: bool = False,
    cell: Literal["triangle", "quadrilateral"] = "triangle",
    order: Literal[1, 2] = 1,
) -> Any:
    """Half a disk whose cells are small near the origin and grow with the distance from there.

    Args:
        comm: the ranks that share the mesh.
        radius: R, a length.
        size: length of the facets at the distance ``radius`` from the origin and beyond.
        contact_size: length of the facets at the origin.
        contact_zone: distance from the origin up to which cells are of that size.
        symmetric: only the right half of it.
        cell: shape of the cells.
        order: degree of the geometry: 1: the facets of the arc are straight, only their ends are on
            the circle.

    Returns:
        The mesh with the boundaries arc, top and, if it is symmetric, symmetry.
    """
    unit = radius / 8.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        geo = gmsh.model.geo
        lowest, centre, right = (
            drawing.point(x, y) for x, y in ((0.0, 0.0), (0.0, radius), (radius, radius))
        )
        arcs = [geo.addCircleArc(lowest, centre, right)]
        if symmetric:
            top = [geo.addLine(right, centre)]
            rest = [geo.addLine(centre, lowest)]
        else:
            left = drawing.point(-radius, radius)
            top = [geo.addLine(right, left)]
            rest = [geo.addCircleArc(left, centre, lowest)]
            arcs += rest
        body = geo.addPlaneSurface([geo.addCurveLoop([arcs[0], *top, *rest])])
        names = {"arc": arcs, "top": top} | ({"symmetry": rest} if symmetric else {})
        mesh_surface(drawing, [body], names, sizes, points=[lowest], cell=cell, order=order)

    sizes = Sizes(contact_size, size, zone=min(contact_zone, 0.99 * radius), reach=radius)
    return gmsh_mesh(comm, draw, name="half_disk", unit=unit)
