"""Inertia in a scene: its time steps, and initial velocities.

The time step itself is in ``mechanics.body.inertia``, which is imported only when one is solved.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from signorini_fx.arrays import Array
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.statement.effect import Contradictions, Effect, Stated, not_yet
from signorini_fx.mechanics.statement.expressions import sample
from signorini_fx.mechanics.statement.values import Direction, Positive, SampledValue, Vector
from signorini_fx.tuned import SAME_NUMBER


class InitialVelocity(Effect):
    """Velocity of a body, or of a part of it, at the first time; several add up.

    Attributes:
        body: name of the part of the mesh; None: all of it.
        x: component along x[0], length / time.
        y: component along x[1], length / time.
        z: component along x[2], length / time; only in 3D.
        rotation: angular velocity, radians / time.
        about: a point of its axis, length; None: the origin.
        axis: its direction, only in 3D; None: x[2].

    Examples:
        >>> falling = sfx.InitialVelocity(y=-2.0)
        >>> print(falling.velocities(np.zeros((3, 1)))[:, 0])
        [ 0. -2.  0.]
    """

    key = "initial_velocity"
    value_keys = ("x", "y", "z", "rotation")
    vectors = ("about",)

    body: str | None = None
    x: SampledValue = 0.0
    y: SampledValue = 0.0
    z: SampledValue = 0.0
    rotation: SampledValue | None = None
    about: Vector | None = None
    axis: Direction | None = None

    @model_validator(mode="after")
    def _axis_of_rotation(self) -> Self:
        if self.rotation is None and (self.about or self.axis):
            raise ValueError("about and axis need a rotation")
        return self

    @property
    def region(self) -> str | None:
        """The part of the mesh, under the name that other entries use."""
        return self.body

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        if not statement.effects.get("inertia"):
            yield ("initial_velocity", number), "needs inertia = { time_step = ... }"

    def velocities(self, x: Array) -> Array:
        """Return the velocities at points of shape (3, n), length / time, shape (3, n)."""
        given = {"x": self.x, "y": self.y, "z": self.z}
        moved = Displacement(
            boundary="", **given, rotation=self.rotation, about=self.about, axis=self.axis
        )
        return np.array([sample(component or 0.0, x) for component in moved.components])


class Inertia(Effect):
    """Inertia of all bodies; load steps are divided into time steps.

    Attributes:
        time_step: longest duration of a step, time; load steps are divided into equal ones; None:
            steps are as long as ``load_steps.time_accuracy`` allows.
        start: how the first time begins: ``static`` with the equilibrium of its loads, or
            ``undeformed``; None: the former where loads act and no initial velocity is given.

    Examples:
        >>> thrown = sfx.Scene(
        ...     mesh=block,
        ...     material=sfx.LinearElastic(young=1000.0, poisson=0.3, density=1.0),
        ...     inertia=sfx.Inertia(time_step=0.5),
        ...     initial_velocity=sfx.InitialVelocity(y=2.0),
        ...     load_steps=sfx.LoadSteps(times=[0.0, 1.0]),
        ... )
        >>> print(round(float(sfx.solve(thrown).state.displacement.max()), 6))
        2.0
    """

    key = "inertia"
    step_effect = "inertia"
    value_keys = ("time_step",)
    refuses = not_yet(
        "inertia",
        "nested iteration",
        "mixed element",
        "preload",
        "axisymmetric, torsion",
        "material with a state",
        more={
            "requested accuracy": "is not possible yet with inertia: its mesh is given; errors in "
            "time alone are those of load_steps.time_accuracy",
        },
    )

    time_step: Positive | None = None
    start: Literal["static", "undeformed"] | None = None

    @property
    def timed(self) -> bool:
        """Always true: inertia needs the times of load steps."""
        return True

    def at_time(self, time: float) -> Self:
        """Return the entry unchanged, which has the same values at all times."""
        return self

    def time_steps(self, times: Sequence[float]) -> int:
        if self.time_step is None:
            return 0
        return int(np.ceil(np.diff(times) / self.time_step * (1 - SAME_NUMBER)).sum())

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        path = ("inertia",)
        times = statement.load_steps.times
        if number:
            yield path, "give one table with a time_step"
            return
        if times is None or len(times) < 2:
            yield (
                ("load_steps", "times"),
                "must be given with inertia, two or more: the first one is where motion begins",
            )
            return
        if statement.load_steps.steps is not None:
            yield ("load_steps", "steps"), "is no ramp with inertia: give inertia.time_step alone"
        shortest = float(np.diff(times).min())
        if self.time_step is None:
            if statement.load_steps.time_accuracy is None:
                yield path, "needs a time_step, or load_steps.time_accuracy, which chooses steps"
        elif self.time_step > shortest * (1 + SAME_NUMBER):
            reason = f"is {self.time_step:g}, longer than a load step of {shortest:g}"
            yield (*path, "time_step"), reason
        for number, material in enumerate(statement.material):
            if material.density is None:
                yield ("material", number), "has no density, which inertia needs"
