"""Prescribed displacement: supports, symmetry, and boundaries that move."""

from __future__ import annotations

from math import ceil
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from signorini_fx.arrays import Array, Value
from signorini_fx.mechanics.statement.effect import Contradictions, Features, Load, Stated
from signorini_fx.mechanics.statement.expressions import sample
from signorini_fx.mechanics.statement.values import Direction, Entries, TimedSampledValue, Vector


class Displacement(Load):
    """A displacement that is prescribed on a boundary or at a point; components that are not listed
    are free.

    Attributes:
        boundary: its name; None: it is prescribed at a point.
        at: the point, which must be a node of the mesh, length.
        region: part of the body to which the node at the point belongs; None: there is only one
            node.
        x: component along x[0], length.
        y: component along x[1], length.
        z: component along x[2], length; only in 3D, and around the axis of a body that turns about
            it.
        normal: component along the outward normal, length, on a flat boundary (0: symmetry).
        rotation: angle of a small rotation, radians; w x (x - c) is added to the components that it
            moves, which are prescribed.
        about: a point c of its axis, length; None: the origin.
        axis: the direction of w, any length; only in 3D; None: x[2]; of a section that turns about
            its axis this one, (0, 1).
        holds: for each load step, whether the displacement is prescribed in it; None: in all.
        factors: one number per load step; None: 1 in every step.

    Examples:
        >>> down = sfx.Displacement(boundary="top", y=-0.001)
        >>> changes = {"traction": (), "displacement": (left, down)}
        >>> result = sfx.solve(scene.model_copy(update=changes))
        >>> print(np.round(result.contact.forces[0], 4))
        [0.     2.1977]
    """

    key = "displacement"
    value_keys = ("x", "y", "z", "normal", "rotation")
    vectors = ("at", "about")

    boundary: str | None = None
    at: Vector | None = None
    region: str | None = None
    x: TimedSampledValue | None = None
    y: TimedSampledValue | None = None
    z: TimedSampledValue | None = None
    normal: TimedSampledValue | None = None
    rotation: TimedSampledValue | None = None
    about: Vector | None = None
    axis: Direction | None = None
    holds: Annotated[Entries[bool], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _something(self) -> Self:
        if (self.boundary is None) == (self.at is None):
            raise ValueError("give either a boundary or at, a point")
        named = any(component is not None for component in self.components)
        if named == (self.normal is not None):
            message = "no component is given: give x, y, both, or normal"
            raise ValueError("give either normal or x and y" if named else message)
        if self.at is not None and self.normal is not None:
            raise ValueError("a point has no normal: give x and y")
        if self.at is None and self.region is not None:
            raise ValueError("region needs a point: give at")
        if self.rotation is None and (self.about or self.axis):
            raise ValueError("about and axis need a rotation")
        return self

    def holds_at(self, step: float) -> bool:
        """Return whether the support acts at a place in the lists of factors; between two load
        steps it acts as in the later one.
        """
        return self.holds is None or self.holds[max(0, ceil(step))]

    @property
    def components(self) -> tuple[Value | None, ...]:
        """The prescribed values along x[0], x[1] and x[2]; None where the displacement is free."""
        if self.rotation is None:
            return self.x, self.y, self.z
        a = np.zeros(3)
        centre = np.zeros(3)
        rotation = self.rotation
        along = self.axis or (0.0, 0.0, 1.0)
        a[: len(along)] = np.array(along) / np.linalg.norm(along)
        centre[: len(self.about or ())] = self.about or ()
        across = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
        if len(along) == 2:  # in a section, where x[2] = 0
            across[:, 2] = 0.0

        def moved(component: Value | None, row: Array) -> Value | None:
            if not row.any():
                return component
            return lambda x: (
                sample(component or 0.0, x) + sample(rotation, x) * (row @ (x - centre[:, None]))
            )

        return tuple(map(moved, (self.x, self.y, self.z), across))

    @property
    def acts(self) -> bool:
        """Always true: a zero displacement is a support as well."""
        return True

    @property
    def features(self) -> Features:
        return () if self.rotation is None else (("prescribed rotation", ("rotation",)),)

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        if self.rotation is not None and "prescribed rotation" not in statement.kinematics.refuses:
            reason = statement.kinematics.refused_axis(self.axis, self.about)
            if reason:
                yield ("displacement", number, "axis"), reason
        yield from self._twice(statement, number)
        if self.holds is not None:
            path = ("displacement", number, "holds")
            if len(self.holds) != statement.steps:
                yield (
                    path,
                    f"has {len(self.holds)} entries, one for each of {statement.steps} load steps "
                    "is expected",
                )
            elif not statement.contact:
                yield path, "is for scenes with contact: solve the others step by step"
            elif not any(self.holds):
                yield path, "is false in all load steps: remove the entry"
        touching = self.at is None and any(
            contact.boundary == self.boundary for contact in statement.contact
        )
        if touching and (self.normal is not None or None not in self.components):
            yield (
                ("displacement", number),
                f"{self.boundary!r} is prescribed, and in contact as well: choose one",
            )

    def _twice(self, statement: Stated, number: int) -> Contradictions:
        """Yield the earlier entries that prescribe a component of this one differently."""
        place = self.boundary, self.at, self.region
        always = (True,) * statement.steps
        for earlier, other in enumerate(statement.effects["displacement"][:number]):
            assert isinstance(other, Displacement)
            both = zip(self.holds or always, other.holds or always, strict=False)
            if (
                place != (other.boundary, other.at, other.region)
                or other == self
                or not any(map(all, both))
            ):
                continue
            ours, theirs = ((*one.components, one.normal) for one in (self, other))
            for name, value, before in zip(("x", "y", "z", "normal"), ours, theirs, strict=True):
                differ = (value, self.factors) != (before, other.factors)
                if value is not None and before is not None and differ:
                    where = "at this point" if self.boundary is None else f"on {self.boundary!r}"
                    yield (
                        ("displacement", number, name),
                        f"displacement[{earlier}] prescribes {name} {where} as well, otherwise: "
                        "remove one",
                    )
