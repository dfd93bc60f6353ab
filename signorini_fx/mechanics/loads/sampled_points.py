"""Single points on facets at which the values of a scene are looked at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.statement.effect import Effect
from signorini_fx.mechanics.statement.expressions import in_space, sample


@dataclass(frozen=True)
class SampledPoints:
    """Single points on facets, for pictures and corners, ``statement.effect.Points``.

    UFL expressions, which only a compiled form could evaluate, are not known there.

    Attributes:
        at: the points, shape (f, d).
        normal: outward unit normals, shape (f, 1, d), or zero, which leaves pressures out.
        whole: from an effect to the integral of its ``spread``.
        unknown: what a UFL expression counts as.
    """

    at: npt.NDArray[np.float64]
    normal: npt.NDArray[np.float64]
    whole: Callable[[Effect], float]
    unknown: float = 0.0

    @property
    def position(self) -> npt.NDArray[np.float64]:
        """Shape (f, 1, d)."""
        return self.at[:, None]

    @property
    def displacement(self) -> npt.NDArray[np.float64]:
        """None, shape (f, 1, d)."""
        return np.zeros_like(self.position)

    @property
    def density(self) -> npt.NDArray[np.float64]:
        """Of no meaning on facets."""
        return np.zeros((len(self.at), 1))

    def total(self, effect: Effect) -> float:
        """See ``Coefficients``."""
        return self.whole(effect)

    def value(self, value: Any) -> npt.NDArray[np.float64]:
        """Shape (f, 1)."""
        if hasattr(value, "ufl_shape"):
            return np.full((len(self.at), 1), self.unknown)
        return sample(value, in_space(self.at))[:, None]

    def vector(self, values: tuple[Any, ...]) -> npt.NDArray[np.float64]:
        """Shape (f, 1, d)."""
        return np.stack([self.value(value) for value in values[: self.at.shape[1]]], axis=2)
