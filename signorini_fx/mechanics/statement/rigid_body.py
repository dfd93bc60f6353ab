"""The input of a rigid motion that is an unknown: driving forces and moments, and prescribed
components.

It has m components: in 2D translations along x[0] and x[1] and a small rotation about the reference
point, counterclockwise; in 3D three of each kind, rotations about axes along x[0], x[1] and x[2]
through that point.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator

from signorini_fx.arrays import Array, Value
from signorini_fx.mechanics.statement.base import Table, at_time
from signorini_fx.mechanics.statement.expressions import Expression, number
from signorini_fx.mechanics.statement.values import (
    Entries,
    NonNegative,
    Positive,
    TimedSampledValue,
    shown,
)

Component = Literal["x", "y", "z", "rotation", "rotation_x", "rotation_y", "rotation_z"]
COMPONENTS: dict[int, tuple[Component, ...]] = {
    2: ("x", "y", "rotation"),
    3: ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z"),
}


MESH_IS = {2: "the mesh is plane", 3: "the mesh is in 3D"}


def _of_time(entry: Value) -> Value:
    if not isinstance(entry, float) and not (
        isinstance(entry, Expression) and entry.coordinates == 0
    ):
        raise ValueError(
            "a number or an expression of the time t is expected, got "
            f"{shown(getattr(entry, 'text', entry))}"
        )
    return entry


def _of_length(*lengths: int) -> AfterValidator:
    def check(numbers: tuple[Value, ...]) -> tuple[Value, ...]:
        if len(numbers) not in lengths:
            raise ValueError(f"{' or '.join(map(str, lengths))} numbers are expected")
        return numbers

    return AfterValidator(check)


# A number, or an expression of the time t.
Timed = Annotated[TimedSampledValue, AfterValidator(_of_time)]
TimedVector = Annotated[Entries[Timed], _of_length(2, 3)]
# A number in 2D, three in 3D.
TimedAngle = Annotated[Entries[Timed], _of_length(3)] | Timed


class RigidMotion(Table):
    """The loads, springs and prescribed components of a rigid motion; without any of them the
    motion is no unknown.

    Attributes:
        force: on the rigid body at its reference point, force, in 2D per thickness; numbers or
            expressions of the time t; None: none.
        moment: about that point, in 2D a number, counterclockwise, in 3D three; of the same kinds.
        prescribed: the components of the motion that are not free, by their names: translations x,
            y, in 3D z, lengths, and rotation, in 3D rotation_x, rotation_y, rotation_z, radians,
            small except with a nonlinear body; of the same kinds.
        spring: between its reference point and the ground, by the same names: force / length, and
            moment per radian; None: there is none.
        mass: where it has inertia, in 2D per thickness; its centre is the reference point.
        moment_of_inertia: about that point, mass times length squared; in 3D three, about axes
            along x[0], x[1] and x[2].
        velocity: at the first time, by the names of ``prescribed``, length or radians / time.
    """

    force: TimedVector | None = None
    moment: TimedAngle | None = None
    prescribed: Mapping[Component, Timed] | None = None
    spring: Mapping[Component, NonNegative] | None = None
    mass: Positive | None = None
    moment_of_inertia: Positive | Annotated[Entries[Positive], _of_length(3)] | None = None
    velocity: Mapping[Component, float] | None = None

    def prescribes(self, component: Component) -> Value | None:
        """Return the prescribed value of a component of the motion, or None if it is free."""
        return (self.prescribed or {}).get(component)

    def reference(self, dimension: int) -> Array:
        """Return the position of the reference point, length, shape (d,)."""
        raise NotImplementedError

    @property
    def drives(self) -> bool:
        """Whether the table has any key of a rigid motion: a load, a prescribed component, a
        spring, inertia or a velocity.
        """
        return any(getattr(self, key) is not None for key in RigidMotion.model_fields)

    @property
    def driven_in_time(self) -> bool:
        """Whether a load or a prescribed component depends on the time."""
        driving = (*(self.force or ()), *entries_of(self.moment), *(self.prescribed or {}).values())
        return any(isinstance(value, Expression) for value in driving)

    def drive(self, dimension: int, time: float) -> tuple[Array, Array]:
        """Return forces and moments at a time, and the prescribed components, nan where they are
        free, shapes (m,).
        """
        force = self.force or (0.0,) * dimension
        moment = entries_of(self.moment) or (0.0,) * (2 * dimension - 3)
        motion = map(self.prescribes, COMPONENTS[dimension])
        return (
            np.array([number(at_time(value, time)) for value in (*force, *moment)]),
            np.array(
                [np.nan if value is None else number(at_time(value, time)) for value in motion]
            ),
        )

    def stiffness(self, dimension: int) -> Array:
        """Return the stiffness of the springs for each component of the motion, shape (m,)."""
        return np.array([(self.spring or {}).get(name, 0.0) for name in COMPONENTS[dimension]])

    def masses(self, dimension: int) -> Array:
        """Return mass or moment of inertia of each component of the motion, shape (m,)."""
        moments = entries_of(self.moment_of_inertia) or (0.0,) * (2 * dimension - 3)
        return np.array([*(self.mass or 0.0,) * dimension, *moments])

    def velocities(self, dimension: int) -> Array:
        """Return the velocity of each component at the first time, shape (m,)."""
        return np.array([(self.velocity or {}).get(name, 0.0) for name in COMPONENTS[dimension]])

    def motion_contradictions(self, dimension: int) -> Iterator[tuple[str, str]]:
        """Yield the keys that do not fit the dimension of the mesh, with reasons."""
        where = MESH_IS[dimension]
        for key in ("moment", "moment_of_inertia"):
            value = getattr(self, key)
            if value is not None and isinstance(value, tuple) != (dimension == 3):
                yield key, f"{where}: give " + ("a number" if dimension == 2 else "three numbers")
        springs = {key: value for key, value in (self.spring or {}).items() if value}
        velocities = self.velocity or {}
        given = ("prescribed", self.prescribed or {}), ("spring", springs), ("velocity", velocities)
        for table, keys in given:
            for key in keys:
                if key not in COMPONENTS[dimension]:
                    yield (
                        f"{table}.{key}",
                        f"{where}: the components are {', '.join(COMPONENTS[dimension])}",
                    )
                elif table != "prescribed" and self.prescribes(key) is not None:
                    yield f"{table}.{key}", "has no effect on a component that is prescribed"


@dataclass(frozen=True)
class RigidBody:
    """A rigid body whose motion is an unknown.

    ``name``: its name in results; ``motion``: its loads, constraints and pivot; ``parts``: the
    numbers of its contacts.
    """

    name: str
    motion: RigidMotion
    parts: tuple[int, ...]

    def pivot(self, dimension: int) -> Array:
        """Return the point about which it rotates, length, shape (d,)."""
        return self.motion.reference(dimension)

    @property
    def called(self) -> str:
        """The name of the rigid body in messages."""
        return f"the foundation of {' and '.join(f'contact[{part}]' for part in self.parts)}"


def rigid_bodies(
    shapes: Sequence[RigidMotion | None], names: Sequence[str]
) -> tuple[RigidBody, ...]:
    """Return the rigid bodies to which the shapes of contacts belong.

    ``shapes``: the shape of each contact, None if it is not driven; those with the same ``rigid``
    form one body.  ``names``: the name of each contact, used for bodies without their own.
    """
    groups: dict[int | str, dict[int, RigidMotion]] = {}
    for part, shape in enumerate(shapes):
        if shape is not None:
            name = getattr(shape, "rigid", None)
            groups.setdefault(part if name is None else name, {})[part] = shape
    return tuple(
        RigidBody(
            key if isinstance(key, str) else names[key],
            next(
                (shape for shape in parts.values() if getattr(shape, "drives", True)),
                next(iter(parts.values())),
            ),
            tuple(parts),
        )
        for key, parts in groups.items()
    )


def driven_twice(shapes: Sequence[RigidMotion | None], number: int) -> str:
    """Return why a contact does not fit the others of its rigid body (loads in none or in several
    of them), see ``rigid_bodies``; else an empty string.
    """
    if (name := getattr(shapes[number], "rigid", None)) is None:
        return ""
    drivers = [
        shape
        for shape in shapes
        if shape is not None and getattr(shape, "rigid", None) == name and shape.drives
    ]
    if len(drivers) == 1:
        return ""
    free = "" if drivers else "; prescribed = {} leaves it free"
    return (
        f"give force, moment, prescribed or spring in one contact of {name!r}, not in "
        f"{len(drivers)}{free}"
    )


def entries_of(
    value: Value | Sequence[Value] | None,
) -> Sequence[Value]:
    """Return the components of a vector, or a number as a single component; empty for None."""
    return () if value is None else value if isinstance(value, tuple) else (value,)
