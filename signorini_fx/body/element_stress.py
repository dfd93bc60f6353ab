"""The stress that the elements work with: everything that shows or judges a stress takes it from here."""

from __future__ import annotations

from typing import Any

import basix
import basix.ufl
import ufl
from dolfinx import default_scalar_type, fem

from signorini_fx import compat
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.effects.material import strain
from signorini_fx.machine.compilation import compiling


class ElementStress:
    """Sigma = 2 mu epsilon(y) + lambda theta I, with the volumetric strain theta as the stiffness sees it.

    Without reduced integration theta is tr(epsilon(y)).  A reduced volumetric term sees tr(epsilon(y)) at the points of
    its rule only.  Between them it may have any value, and lambda times it is any multiple of the true stress if
    Poisson's ratio is near 1/2.  There theta is interpolated between these points: constant in a cell with one point,
    bilinear or trilinear with two along each axis.  This is the pressure of the mixed method that reduced integration
    is equivalent to (Malkus and Hughes, Comput. Methods Appl. Mech. Engrg. 15 (1978) 63-81).

    Attributes:
        sigma: the stress, shape (d, d), a UFL expression; of the displacement at the time of the last ``refresh``.
    """

    def __init__(self, body: Discretisation, displacement: fem.Function) -> None:
        self._body, self._displacement = body, displacement
        self._theta: fem.Function | None = None
        theta = volumetric = ufl.tr(strain(displacement))
        if body.reduced is not None:
            mesh = body.tagged.mesh
            space = fem.functionspace(mesh, _at_points(mesh.topology.cell_name(), body.reduced))
            with compiling():
                points = compat.interpolation_points(space.element)
                self._expression = fem.Expression(volumetric, points, dtype=default_scalar_type)
            theta = self._theta = fem.Function(space, name="volumetric strain")
        lame, mu = body.lame
        self._mean = lame * theta
        self.sigma = 2 * mu * strain(displacement) + self._mean * ufl.Identity(len(displacement))
        self.refresh()

    def refresh(self) -> None:
        """Take theta from the displacement anew; on all cells of this rank, ghosts included."""
        if self._theta is not None:
            self._theta.interpolate(self._expression)

    def in_space(self, hypothesis: str) -> Any:
        """Sigma with all components in space, shape (3, 3); in the plane (2, 2) is lambda theta in plane strain."""
        s = self.sigma
        if self._body.tagged.dimension == 3:
            return s
        out = self._mean if hypothesis == "plane strain" else 0 * self._mean
        return ufl.as_tensor([[s[0, 0], s[0, 1], 0 * out], [s[1, 0], s[1, 1], 0 * out], [0 * out, 0 * out, out]])


def _at_points(cell: str, degree: int) -> Any:
    """The discontinuous element whose nodes are the points of a Gauss rule: one point, or two along each axis."""
    if degree == 1:
        return basix.ufl.element("DG", cell, 0)
    return basix.ufl.element("DQ", cell, 1, lagrange_variant=basix.LagrangeVariant.gl_warped, discontinuous=True)
