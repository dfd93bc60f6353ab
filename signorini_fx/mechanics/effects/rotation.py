"""Centrifugal force of a body that rotates about a fixed axis."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from signorini_fx.mechanics.statement.effect import Array, Coefficients, Contradictions, Force, Points, without_density
from signorini_fx.mechanics.statement.expressions import Expression, product_of
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

    def profile(self, dimension: int) -> tuple[Any, ...]:
        """See ``Force``: the square of the speed times a distance."""
        return (product_of(self.speed, self.speed, Expression("x[0]")),)

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        yield from without_density(statement, "rotation") if self.acts else ()
        if reason := statement.kinematics.refused_axis(self.axis, self.about):
            yield ("rotation", number, "axis"), reason

    def _about(self, dimension: int) -> tuple[float, ...]:
        """A point of the axis, shape (d,)."""
        return tuple(self.about or ()) + (0.0,) * (dimension - len(self.about or ()))

    def _across(self, dimension: int) -> Array:
        """The projection across the axis, shape (d, d)."""
        if self.axis is None:
            return np.diag([1.0, 1.0, 0.0][:dimension])
        along = np.zeros(dimension)  # displacements out of a section have one more
        along[: len(self.axis)] = np.array(self.axis) / np.linalg.norm(self.axis)
        return np.asarray(np.eye(dimension) - np.outer(along, along))

    def density(self, on: Coefficients) -> Any:
        import ufl

        dim = len(on.position)
        arm = on.position - on.vector(self._about(dim))
        across = [on.vector(tuple(map(float, row))) for row in self._across(dim)]
        return on.density * on.value(self.speed) ** 2 * ufl.as_vector([ufl.inner(row, arm) for row in across])

    def density_at(self, at: Points) -> Array:
        dim = at.position.shape[-1]
        arm = (at.position - np.array(self._about(dim))) @ self._across(dim)
        return np.asarray((at.density * at.value(self.speed) ** 2)[..., None] * arm)


Entry = Rotation

# How ``signorini-fx new`` explains it.
EXAMPLE = """
# Centrifugal force of a body that rotates about a fixed axis.
[[rotation]]
speed = 0.0                                # VALUE, radians / time; needs the density of the materials
#about = [0.0, 0.0]                        # a point on the axis, length; without: the origin
#axis = [0.0, 1.0]                         # its direction; without: across the plane, in 3D x[2]
#factors = [0.5, 1.0]                      # load steps, as above; they multiply the force
"""
