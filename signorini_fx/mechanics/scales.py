"""What lengths, stresses, stiffnesses and energies of a body are compared with: every formula of
dimension is here.

In 3D a force is a stress times an area, in 2D, per thickness, a stress times a length: the power of
a length depends on the dimension d.  ``tests/scenes/test_units.py`` checks the formulas.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from signorini_fx.arrays import Array
from signorini_fx.tuned import ZERO_COMPONENT

_Size = TypeVar("_Size", float, Array)


@dataclass(frozen=True)
class Scales(Generic[_Size]):
    """The scales of a body, or of each of its pieces: then a size, and all values, are arrays of
    shape (pieces,).
    """

    dimension: int  # d
    modulus: float  # of the stiffest material, stress
    size: _Size  # diameter, length
    # Of a body in 2D, what its areas and lengths of the boundary are multiplied by: 1 per
    # thickness, of a body of revolution a typical length of the circumference, see
    # ``Kinematics.depth``.
    depth: float = 1.0

    def of_pieces(self, sizes: Array) -> Scales[Array]:
        """Return the scales of pieces of these sizes, length, shape (pieces,)."""
        return Scales(self.dimension, self.modulus, sizes, self.depth)

    @property
    def surface(self) -> _Size:
        """Area, in 2D length, of a surface as large as the body."""
        return self.depth * self.size ** (self.dimension - 1)

    @property
    def gamma(self) -> float:
        """The natural unit of gamma, stress per length."""
        return float(self.modulus / self.size)

    @property
    def coordinate_error(self) -> float:
        """The round-off of coordinates, and so of gaps, length."""
        return float(ZERO_COMPONENT * self.size)

    def spacing(self, nodes: _Size) -> _Size:
        """Length between neighbours of so many nodes in a body of this size."""
        return self.size / nodes ** (1.0 / self.dimension)

    def side(self, area: Array) -> Array:
        """Return lengths of the sides of pieces of the surface with these areas (in 2D:
        lengths).
        """
        return (area / self.depth) ** (1.0 / (self.dimension - 1))

    def stiffness(self, spacing: _Size) -> _Size:
        """Force at a node that is moved by a unit of length, at this distance from its
        neighbours.
        """
        return self.modulus * self.depth * spacing ** (self.dimension - 2)

    def stress(self, strain_energy: _Size) -> _Size:
        """Mean stress of a body with this strain energy."""
        return np.sqrt(2 * self.modulus * strain_energy / (self.depth * self.size**self.dimension))

    def deflection(self, stress: _Size) -> _Size:
        """Length by which this stress deforms the body."""
        return stress / self.modulus * self.size
