"""The pressure of a fluid at rest up to a level."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from signorini_fx.mechanics.statement.effect import Array, Coefficients, Contradictions, JointLoad, Points
from signorini_fx.mechanics.statement.expressions import Expression, in_space, product_of, sample
from signorini_fx.mechanics.statement.values import NonNegative, TimedSampledValue

_ENTERS = "is not possible yet where a fluid enters contact"


class Fluid(JointLoad):
    """Pressure of a fluid at rest on a boundary: its weight times the depth below its level, and none above.

    Attributes:
        boundary: its name.
        level: height of the surface of the fluid along ``up``, length.
        weight: of the fluid, force per volume.
        up: the axis against gravity, ``x``, ``y`` or ``z``; None: y in the plane, z in space.
        factors: one number per load step; None: 1 in every step.
        live: whether the safety factor multiplies it; a permanent load is not live.
        enters: boundaries in contact that it enters from this one, as far as they are open.
        closed: what contact carries that it has not entered: none, linear, from its pressure where it ends to zero at
            the other end of the contact, in the plane, or full, its whole pressure.
    """

    refuses: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "entering load": {
            "requested accuracy": f"a requested accuracy {_ENTERS}",
        }
    }

    level: TimedSampledValue
    weight: NonNegative
    up: Literal["x", "y", "z"] | None = None

    @property
    def given(self) -> dict[str, Any]:
        """See ``Effect``."""
        return {"level": self.level, "weight": self.weight}

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        """See ``Effect``."""
        if self.up == "x" and statement.kinematics.refused_axis((1.0, 0.0)):
            yield ("fluid", number, "up"), "must be along the axis of the body: y"
        if statement.kinematics.out_of_section and self.up is None:
            yield ("fluid", number, "up"), "say along which axis of the section it rises: up = 'y'"
        if self.enters:
            yield from self._cannot_enter(statement, number)
        elif self.closed != "none":
            yield ("fluid", number, "closed"), "is of a fluid that enters contact: say which in enters"

    def _cannot_enter(self, statement: Any, number: int) -> Contradictions:
        """Why it cannot enter contact in a scene."""
        enters_path, contacts = (
            ("fluid", number, "enters"),
            {contact.boundary: contact for contact in statement.contact},
        )
        for name in self.enters:
            if name not in contacts:
                yield (
                    enters_path,
                    f"{name!r} is no boundary in contact; these are: {', '.join(map(repr, contacts)) or 'none'}",
                )
            elif contacts[name].kind != "unilateral":
                yield enters_path, f"contact of {name!r} cannot open: a fluid enters unilateral contact"
            elif contacts[name].points == "against":
                yield (
                    enters_path,
                    f"the contact points of {name!r} are on the other body: exchange boundary and against",
                )
            for fluid in statement.effects["fluid"][:number]:
                for entry in ("closed", "live"):
                    if name in fluid.enters and getattr(fluid, entry) != getattr(self, entry):
                        yield ("fluid", number, entry), f"must be the same for all fluids that enter {name!r}"

    @property
    def remarks(self) -> Iterator[tuple[Literal["note", "warning"], str, str]]:
        """See ``Effect``."""
        if not self.enters:
            return
        where = " and ".join(map(repr, self.enters))
        message = f"it presses on what is open of {where}, found with the contact: "
        yield "note", "enters", message + "statics and costs here are without this load"
        if self.closed == "none":
            message = (
                f"what is closed of {where} carries no uplift, which is not on the safe side: rules for dams ask for "
                "closed = 'linear' or 'full'"
            )
            yield "warning", "closed", message

    @property
    def acts(self) -> bool:
        """See ``Effect``."""
        return self.weight > 0

    @cached_property
    def varies(self) -> bool:
        """See ``Effect``."""
        return True

    def profile(self, dimension: int) -> tuple[Any, ...]:
        """See ``Force``: its depth, which has a kink where it is zero."""
        depth = product_of(self.level, Expression("1"))
        if not isinstance(depth, Expression):
            return (depth,)
        up = range(dimension)[self._axis]
        text = f"max(0, {depth.text} - x[{up}])"
        return (Expression(text, depth.time, depth.allows_time, len(text)),)

    @property
    def _axis(self) -> int:
        return -1 if self.up is None else "xyz".index(self.up)

    def density(self, on: Coefficients) -> Any:
        """See ``Force``."""
        import ufl

        depth = on.value(self.level) - on.position[len(on.position) - 1 if self.up is None else self._axis]
        return -on.value(self.weight) * ufl.max_value(0, depth) * on.normal

    def density_at(self, at: Points) -> Array:
        """See ``Force``."""
        depth = at.value(self.level) - at.position[..., self._axis]
        return np.asarray(-self.weight * np.maximum(depth, 0.0)[..., None] * at.normal)

    def pressure(self, x: Array) -> Array:
        """The pressure at points of shape (n, d), stress, shape (n,)."""
        depth = sample(self.level, in_space(x)) - x[:, self._axis]
        return np.asarray(self.weight * np.maximum(depth, 0.0))


Entry = Fluid

# How ``signorini-fx new`` explains it.
EXAMPLE = """
# Pressure of a fluid at rest up to a level.  As many [[fluid]] as you like; they add up.
[[fluid]]
boundary = "left"
level = "10*t"                             # VALUE, height of its surface, length; here it rises
weight = 0.0                               # of the fluid, force per volume
#up = "y"                                  # the axis that points upwards; without: y in the plane, z in space
#factors = [0.5, 1.0]                      # load steps, as above
live = true                                # whether the safety factor multiplies it
#enters = ["bottom"]                       # boundaries in contact that it enters from here, as far as they open
closed = "none"                            # its pressure where they are closed: "none", "linear" or "full"
"""
