"""Points at which the values of a scene are arrays, and no forms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.statement.expressions import in_space, sample


@dataclass(frozen=True)
class SampledPoints:
    """Points for pictures and bounds, ``statement.effect.Coefficients`` as arrays.

    Attributes:
        position: length, shape (d, n).
        normal: outward unit normals, shape (d, n), or zero, which leaves pressures out.
        total: from an effect to the integral of its ``spread``.
        density: of the material, mass per volume, shape (n,), or one for all.
    """

    position: npt.NDArray[np.float64]
    normal: npt.NDArray[np.float64]
    total: Callable[[Any], float]
    density: Any = 0.0

    def value(self, value: Any) -> npt.NDArray[np.float64]:
        """Shape (n,); zero of expressions of UFL, which only a compiled form could evaluate."""
        if hasattr(value, "ufl_shape"):
            return np.zeros(self.position.shape[1])
        return sample(value, in_space(self.position.T))

    def vector(self, values: tuple[Any, ...]) -> npt.NDArray[np.float64]:
        """Shape (d, n)."""
        return np.stack([self.value(value) for value in values[: len(self.position)]])
