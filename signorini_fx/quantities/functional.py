"""A scalar result with its derivatives by the displacement and by the contact tractions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt
    from dolfinx import fem

    from signorini_fx.algebra.contact.nodal_vectors import Nodal
    from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary

    Array = npt.NDArray[np.float64]


class Functional:
    """A scalar result J(y, lambda, mu)."""

    def value(self, y: fem.Function, boundary: ContactBoundary, pressure: Nodal, shear: Nodal) -> float:
        """J; collective."""
        raise NotImplementedError

    def by_displacement(self, y: fem.Function) -> Array | None:
        """J_y at the owned dofs; None: it does not depend on the displacement; collective."""
        return None

    def by_traction(self, boundary: ContactBoundary, pressure: Nodal, shear: Nodal) -> Nodal:
        """Derivative by (lambda, mu) at each point over its weight, shape (n, d); collective."""
        return np.zeros((pressure.size, 1 + shear.shape[1]))


@dataclass(frozen=True)
class Gradient:
    """The derivatives of a result by Constants.

    Attributes:
        value: the result.
        derivatives: by each Constant, shape (n,).
        between: contact points that stand between two sets: there the derivatives are those of one side.
    """

    value: float
    derivatives: Array
    between: int
