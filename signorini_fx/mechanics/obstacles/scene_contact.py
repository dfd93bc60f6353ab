"""The contact of a scene as foundations and pairs, which forms of a user's own have too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.interfaces import Foundation, Pair
from signorini_fx.mechanics.kinematics.protocol import Kinematics
from signorini_fx.mechanics.statement.expressions import sample
from signorini_fx.mechanics.statement.statement import Statement


def foundations_of(
    statement: Statement, facets: Sequence[npt.NDArray[np.int32]], masters: Mapping[int, npt.NDArray[np.int32]]
) -> list[Foundation | Pair]:
    """The contact of a scene as foundations, on the facets of each, and as pairs, by their places the masters."""
    foundations: list[Foundation | Pair] = []
    kinematics = statement.kinematics
    around = None if kinematics.uniform else partial(_measure, kinematics)
    for number, (effect, on) in enumerate(zip(statement.contact, facets, strict=True)):
        friction = effect.friction if effect.friction.acts else None
        bonded, bilateral = effect.bonded, not effect.opens and not effect.bonded
        if number in masters:
            gap = _evaluable(effect.gap)
            choice = {"gap": gap} if effect.distance == "nominal" else {"allowance": gap, "adjust": effect.adjust}
            foundations.append(
                Pair(
                    on,
                    masters[number],
                    friction=friction,
                    bilateral=bilateral,
                    bonded=bonded,
                    measure=around,
                    sliding=effect.sliding == "finite",
                    **choice,
                )
            )
            continue
        gap, shape = _evaluable(effect.gap), shape_at_points(effect.surface, kinematics)
        direction = effect.direction
        if direction is not None:
            direction = (*direction, *[0.0] * kinematics.out_of_section)
        foundations.append(Foundation(on, gap, direction, friction, bilateral, around, shape, bonded))
    return foundations


def shape_at_points(shape: Any, kinematics: Kinematics) -> Any:
    """A shape of a scene as it is asked at points of the body; None: there is none."""
    return shape if shape is None or not kinematics.out_of_section else _ShapeOfSection(shape)


@dataclass(frozen=True)
class _ShapeOfSection:
    """A shape of the plane for points of a section in 3D, whose displacements have three components."""

    shape: Any

    def distance(self, x: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """The signed distance and its gradient at points of shape (n, 3), shapes (n,) and (n, 3)."""
        away, normal = self.shape.distance(np.ascontiguousarray(x[:, :2]))
        return away, np.pad(normal, ((0, 0), (0, 1)))

    @property
    def inradius(self) -> float:
        """Radius of the largest ball in the shape, length; infinite where the shape does not say it."""
        return float(getattr(self.shape, "inradius", np.inf))


def _measure(kinematics: Kinematics, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """At points of shape (3, n); where it is zero it may be below by round-off."""
    return np.maximum(kinematics.measure(x), 0.0)


def _evaluable(value: Any) -> Any:
    """A value of a scene as a foundation takes it."""
    return value if isinstance(value, int | float) else partial(sample, value)
