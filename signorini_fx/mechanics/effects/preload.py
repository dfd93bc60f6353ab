"""Preload of a bolt: a section across it is tightened by a force, and its length is kept from then on."""

from __future__ import annotations

from typing import Any, ClassVar, Self

from pydantic import PrivateAttr, model_validator

from signorini_fx.mechanics.statement.effect import Contradictions, Features, Load
from signorini_fx.mechanics.statement.expressions import number
from signorini_fx.mechanics.statement.rigid_motion import Timed
from signorini_fx.mechanics.statement.values import Count, Direction, Vector


class Preload(Load):
    """A section across a bolt, whose two sides are moved towards each other along one direction, and else are joined.

    In Abaqus and CalculiX it is a ``*PRE-TENSION SECTION``.

    Attributes:
        section: name of facets inside the mesh that cut the bolt through in a plane; None: a plane does.
        region: instead: name of the part of the mesh that a plane cuts; None: all of the body.
        point: of that plane, length.
        axis: across that plane, along which the sides move, any length.
        force: tension through the section, force; a number or an expression of the time t.
        shortening: instead, how far the sides are moved towards each other, length; of the same kinds.
        locked_after: number of the factors, from 1, after which the length that the force has led to is kept.
        factors: one number per load step, by which force or shortening are multiplied; None: 1 in every step.
    """

    value_keys: ClassVar[tuple[str, ...]] = ("force", "shortening")
    vectors: ClassVar[tuple[str, ...]] = ("point", "axis")
    strains: ClassVar[bool] = True
    grouped: ClassVar[bool] = False

    section: str | None = None
    region: str | None = None
    point: Vector | None = None
    axis: Direction | None = None
    force: Timed | None = None
    shortening: Timed | None = None
    locked_after: Count = 1

    # The shortenings that forces have led to, by their places in the lists of factors.
    _shortenings: dict[float, float] = PrivateAttr(default_factory=dict)

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        plane = self.point is not None and self.axis is not None
        if (self.section is None) != plane or (self.section is not None and (self.region or self.point or self.axis)):
            raise ValueError("give either section, a name of facets inside the mesh, or point and axis of a plane")
        if (self.force is None) == (self.shortening is None):
            raise ValueError("give either force or shortening")
        if isinstance(self.force, float) and self.force <= 0:
            raise ValueError("force must be positive: a tension; give shortening for anything else")
        if self.force is None and "locked_after" in self.model_fields_set:
            raise ValueError("locked_after is that of a force, which is missing")
        return self

    @property
    def place(self) -> str:
        if self.section is not None:
            return self.section
        return f"at ({', '.join(f'{x:g}' for x in self.point or ())})" if self.region is None else self.region

    @property
    def features(self) -> Features:
        return (*super().features, *((("shortening by force", ("force",)),) if self.force is not None else ()))

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        path = ("preload", number)
        if self.axis is not None and (reason := statement.kinematics.refused_axis(self.axis)):
            yield (*path, "axis"), reason
        if self.force is None:
            return
        if self.factors is not None and min(self.factors[: self.locked_after]) <= 0:
            yield (*path, "factors"), "must be positive while the force acts"

    def force_at(self, statement: Any, step: float) -> float | None:
        """The tension that determines its shortening, at a place in the lists of factors; None: that is known."""
        if self.force is None or step > self.locked_after - 1:
            return None
        return self._value_at(statement, step)

    def shortening_at(self, statement: Any, step: float) -> float:
        """By how much it is shortened there, length; of a force zero until it is found."""
        if self.force is not None:
            places = [found_step for found_step in self._shortenings if found_step <= step]
            return self._shortenings[max(places)] if places else 0.0
        return self._value_at(statement, step)

    def _value_at(self, statement: Any, step: float) -> float:
        """What is given, at a place in the lists of factors."""
        factor, current = statement.now(self, step)
        (value,) = current.given.values()
        return factor * number(value)

    def tightened(self, step: float, shortening: float) -> Self:
        """The same with the shortening that its force has led to at a place."""
        preload = self.model_copy()
        preload._shortenings = {**self._shortenings, step: shortening}
        return preload
