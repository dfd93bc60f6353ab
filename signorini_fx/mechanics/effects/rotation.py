"""Centrifugal force of a body that rotates about a fixed axis."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from signorini_fx.mechanics.statement.effect import Coefficients, Contradictions, Force, without_density
from signorini_fx.mechanics.statement.values import Direction, TimedValue, Vector


class Rotation(Force):
    """Centrifugal force rho omega^2 r of a body that rotates steadily, in the frame that rotates with it; r is the
    displaced radius where materials know finite strains.

    Attributes:
        speed: angular speed omega, radians / time.
        about: a point of the axis, length; None: the origin.
        axis: its direction, any length; None: perpendicular to the plane, in 3D along x[2].
        factors: one number per load step, which multiplies the force; None: 1 in every step.
    """

    vectors: ClassVar[tuple[str, ...]] = ("about", "axis")
    carried: ClassVar[bool] = True

    speed: TimedValue
    about: Vector | None = None
    axis: Direction | None = None

    @property
    def given(self) -> dict[str, Any]:
        return {"speed": self.speed}

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        yield from without_density(statement, "rotation") if self.acts else ()
        if reason := statement.kinematics.refused_axis(self.axis, self.about):
            yield ("rotation", number, "axis"), reason

    def density(self, on: Coefficients) -> Any:
        dimension = len(on.position)  # displacements out of a section have one more than its point and axis
        about, axis = np.zeros(dimension), np.zeros(dimension)
        about[: len(self.about or ())] = self.about or ()
        given = np.array((0.0, 0.0, 1.0) if self.axis is None else self.axis)
        unit = (given / np.linalg.norm(given))[:dimension]  # in the plane it has no part along x[2]
        axis[: len(unit)] = unit
        arm = on.position - on.vector(tuple(about.tolist()))
        along = sum(component * part for component, part in zip(axis.tolist(), arm, strict=True))
        return on.density * on.value(self.speed) ** 2 * (arm - along * on.vector(tuple(axis.tolist())))


Entry = Rotation
