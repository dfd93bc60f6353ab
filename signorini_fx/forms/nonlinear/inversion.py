"""Whether cells are turned inside out: det(I + grad u) at quadrature points."""

from __future__ import annotations

import basix
from dolfinx import fem

from signorini_fx.machine import parallel
from signorini_fx.mechanics.body.assembly import determinants
from signorini_fx.mechanics.body.cell_gradients import along_reference


def turned_inside_out(u: fem.Function) -> bool:
    """Whether det(I + grad u) is not positive at a quadrature point of some cell; collective.

    The points are those of a rule of twice the degree of ``u``.  Sections of bodies of revolution are looked at in
    their plane.
    """
    mesh, degree = u.function_space.mesh, u.function_space.element.basix_element.degree
    points = basix.make_quadrature(getattr(basix.CellType, mesh.topology.cell_name()), 2 * degree)[0]
    # The determinant of the product I + grad u = (x + u)' / x', with derivatives along the reference cell.
    inverted = any(
        bool((determinants(place + moved[: len(place)]) * determinants(place) <= 0).any())
        for place, moved in along_reference(u, points)
    )
    return parallel.any_rank(mesh.comm, inverted)
