r"""The lower half of a disk that stands on the origin, meshed by gmsh, with small cells at the point of first contact.

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

import numpy as np
from mpi4py import MPI
from pydantic import ConfigDict, validate_call

from signorini_fx.mesh.tagged import gmsh_mesh
from signorini_fx.meshes import Drawing, Length, Sizes, coarser_sizes, mesh_surface, refuse_too_large


@validate_call(config=ConfigDict(arbitrary_types_allowed=True))
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
        order: degree of the geometry: 1: the facets of the arc are straight, only their ends are on the circle.

    Returns:
        The mesh with the boundaries arc, top and, if it is symmetric, symmetry.
    """
    unit = radius / 8.0  # the gmsh model has the size of the default body

    def draw(gmsh: Any) -> None:
        drawing = Drawing(gmsh, unit)
        geo = gmsh.model.geo
        lowest, centre, right = (drawing.point(x, y) for x, y in ((0.0, 0.0), (0.0, radius), (radius, radius)))
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
        sizes = Sizes(contact_size, size, zone=min(contact_zone, 0.99 * radius), reach=radius)
        mesh_surface(drawing, [body], names, sizes, points=[lowest], cell=cell, order=order)

    share = (0.5 if symmetric else 1.0) * (0.5 if cell == "quadrilateral" else 1.0)
    refuse_too_large(comm, share * _cells(radius, size, contact_size, contact_zone))
    return gmsh_mesh(comm, draw, name="half_disk", unit=unit)


def _cells(radius: float, size: float, contact_size: float, contact_zone: float) -> float:
    """The approximate number of triangles: the area around the origin over theirs, h^2 sqrt(3) / 4, ring by ring."""
    near, zone = min(contact_size, size), min(contact_zone, 0.99 * radius)
    r = np.concatenate([[0.0, zone], zone + np.geomspace(1e-9, 1.0, 400) * (radius - zone)])
    h = np.interp(r, [zone, radius], [near, size])
    between = 0.5 * (h[1:] + h[:-1])
    with np.errstate(over="ignore", divide="ignore"):
        return float((np.pi / 2 * np.diff(r**2) / (np.sqrt(3) / 4 * between**2)).sum())


def coarser(parameters: dict[str, Any], factor: float) -> dict[str, Any]:
    """The parameters for cells ``factor`` times as large; see ``generate``."""
    return coarser_sizes(generate, parameters, factor)
