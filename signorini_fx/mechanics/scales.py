"""Reference values of lengths, stresses, stiffnesses and energies of a body.

All formulas that depend on the dimension d are here: in 3D a force is a stress times an area, in
2D, per thickness, a stress times a length.  ``tests/scenes/test_units.py`` checks the formulas.
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
    """The reference values of a body, or of each of its pieces; then sizes and values have the
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
        """Return the scales of pieces with these sizes, length, shape (pieces,)."""
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
        """The round-off of coordinates, and therefore of gaps, length."""
        return float(ZERO_COMPONENT * self.size)

    def spacing(self, nodes: _Size) -> _Size:
        """Return the distance between neighbouring nodes if so many are spread evenly over the
        body, length.
        """
        return self.size / nodes ** (1.0 / self.dimension)

    def side(self, area: Array) -> Array:
        """Return the side lengths of surface pieces with these areas (in 2D: lengths)."""
        return (area / self.depth) ** (1.0 / (self.dimension - 1))

    def stiffness(self, spacing: _Size) -> _Size:
        """Return the force per unit displacement of one node, whose neighbours are at distance
        ``spacing``.
        """
        return self.modulus * self.depth * spacing ** (self.dimension - 2)

    def stress(self, strain_energy: _Size) -> _Size:
        """Return the mean stress of a body with this strain energy."""
        return np.sqrt(2 * self.modulus * strain_energy / (self.depth * self.size**self.dimension))

    def deflection(self, stress: _Size) -> _Size:
        """Return the length by which this stress deforms the body."""
        return stress / self.modulus * self.size
