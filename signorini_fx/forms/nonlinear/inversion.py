"""Whether cells are turned inside out: det(I + grad u) at quadrature points."""

from __future__ import annotations

from dataclasses import dataclass, field

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.cell_gradients import CellSlopes
from signorini_fx.mechanics.assembly.mesh_entities import determinants


@dataclass
class InsideOut:
    """Looks for cells of a body that are turned inside out.

    Attributes:
        u: the displacement.
    """

    u: fem.Function
    _undeformed: CellSlopes | None = field(default=None, init=False)
    _signs: list[npt.NDArray[np.int8]] = field(default_factory=list, init=False)  # of det x' at each point

    def found(self) -> bool:
        """Whether det(I + grad u) is not positive at a quadrature point of some cell; collective.

        The points are those of a rule of twice the degree of ``u``.  Sections of bodies of revolution are looked at in
        their plane.
        """
        slopes = self._slopes
        # The determinant of the product I + grad u = (x + u)' / x', with derivatives along the reference cell.
        inverted = any(
            bool((determinants(place + moved[: len(place)]) * sign <= 0).any())
            for sign, (place, moved) in zip(self._signs, slopes.along_reference(self.u), strict=True)
        )
        return parallel.any_rank(self.u.function_space.mesh.comm, inverted)

    @property
    def _slopes(self) -> CellSlopes:
        """Of the mesh as it is, which is looked at again where it has been moved."""
        if self._undeformed is None or not self._undeformed.fits:
            space = self.u.function_space
            mesh, degree = space.mesh, space.element.basix_element.degree
            points = basix.make_quadrature(getattr(basix.CellType, mesh.topology.cell_name()), 2 * degree)[0]
            self._undeformed = CellSlopes(space, points)
            self._signs = [np.sign(determinants(place)).astype(np.int8) for place in self._undeformed.of_places()]
        return self._undeformed
