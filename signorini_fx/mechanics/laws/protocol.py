"""The interface of friction laws; all other code uses it without distinguishing laws.

A law is |mu| <= g(lambda, s, dt): the shear mu, a stress, is at most a bound that depends on the
contact pressure lambda >= 0, and perhaps on the slip s of the load step and its duration dt; where
it is less, nothing slips.  The fields of its class are its parameters: numbers, expressions,
callables, UFL.  At points they are arrays, and ``evaluate`` is plain NumPy on them, as in
``demos/extensions/law.py``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import BeforeValidator, WithJsonSchema

from signorini_fx.arrays import Array, Flags, Integers, Plain, Value
from signorini_fx.errors import FormError
from signorini_fx.mechanics.statement.base import Table
from signorini_fx.mechanics.statement.effect import is_zero
from signorini_fx.mechanics.statement.values import not_negative, timed

# A parameter of a law: not negative, a number, an expression of position and time, a callable f(x)
# of points of shape (3, n), or in forms UFL.
Parameter = Annotated[
    Any,
    BeforeValidator(lambda value: not_negative(timed(value))),
    WithJsonSchema({"type": ["number", "string"]}),
]


class Envelope(NamedTuple):
    """The envelope min(given + coefficient lambda, cap) of a friction law, for limit analysis: the
    bound of the law never exceeds it.

    Attributes:
        given: stress, a number or shape (n,).
        coefficient: without unit, of the same kinds.
        cap: stress; None: there is none.
    """

    given: Array
    coefficient: Array
    cap: Array | None = None


class FrictionLaw(Table):
    """A friction law; derive a law of your own from it, or from ``directed.DirectedLaw`` if it may
    depend on the direction.

    Attributes:
        law: its name.

    Examples:
        >>> law = sfx.Coulomb(0.3, cohesion="0.1*x[0]")
        >>> print(isinstance(law, sfx.FrictionLaw), law.parameters["coefficient"])
        True 0.3
    """

    # Whether the bound depends on the pressure; if not, the problem is convex.
    follows_pressure: ClassVar[bool] = True
    # Whether the bound is a concave, growing function of the pressure; then it is below its tangent
    # at zero and its limit.
    concave: ClassVar[bool] = False
    error = FormError
    # Whether the bound depends on the slip, by its length or its speed slip / dt; then
    # ``follows_pressure`` must stay True.
    follows_slip: ClassVar[bool] = False
    # Keys that are not parameters.
    apart: ClassVar[tuple[str, ...]] = ("law",)

    law: str

    # --- what a law must define ---

    def evaluate(
        self, pressure: Array, slip: Array, dt: float
    ) -> tuple[Array, Array | float, Array | float]:
        """Return the largest shear at points where parameters are arrays of shape (n,).

        Args:
            pressure: not negative, stress, shape (n,).
            slip: length of the slip in the load step, its elastic part included, shape (n,).
            dt: duration of the load step, time, above 0, so that slip / dt is the speed.

        Returns:
            The bound, stress, shape (n,); its derivative by the pressure, without unit (at zero the
            derivative from the right), and by the slip, stress per length, shapes (n,) or numbers.
        """
        if type(self).envelope is FrictionLaw.envelope:
            raise NotImplementedError
        # Here, because reading a scene needs neither MPI nor PETSc.
        from signorini_fx.algebra.contact.friction import envelope_at

        size = np.asarray(pressure, dtype=np.float64)
        return envelope_at(*self.envelope(np.zeros_like(size)), size)

    # --- what it may define ---

    def envelope(self, zero: Array) -> Envelope:
        """Return an upper bound of the bound, for limit analysis.

        For concave laws, and for those that do not depend on the pressure, it follows from
        ``evaluate``.  For others, and for laws that depend on the slip, it is infinite by default.

        Args:
            zero: zeros with the shape of the parameters.
        """
        if self.follows_slip or (self.follows_pressure and not self.concave):
            return Envelope(zero + np.inf, zero)
        given, slope, _ = self.evaluate(zero, zero, 1.0)
        if not self.follows_pressure:
            return Envelope(given, zero)
        # The limit may be nan, for quotients or parameters that are zero: then there is no cap.
        with np.errstate(invalid="ignore"):
            limit = self.limit(zero + np.inf)
        cap = np.where(np.isnan(limit), np.inf, limit)
        vertical = np.isinf(slope)
        lines = np.where(vertical, np.inf, given), np.where(vertical, 0.0, slope)
        return Envelope(*lines, None if np.isinf(cap).all() else cap)

    @property
    def ends_open(self) -> bool:
        """Whether the bound of the envelope jumps to zero where contact opens."""
        return False

    @property
    def unknown(self) -> str:
        """The reason why the bound differs from its envelope, so that only equilibrium can be
        proved; "" if they are equal.
        """
        return (
            f"of the friction law {self.law} it has only the bound" if self.follows_pressure else ""
        )

    @property
    def acts(self) -> bool:
        """Whether the law can transmit shear."""
        return True

    # --- what follows ---

    def limit(self, pressure: Array) -> Array:
        """Return the largest shear without slip, stress, at pressures of shape (n,)."""
        return self.evaluate(pressure, np.zeros_like(pressure), 1.0)[0]

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Plain) -> None:
        """Allow parameters as positional arguments in Python, in their order, before the other
        keys.
        """
        super().__pydantic_init_subclass__(**options)
        cls.positional = tuple(
            key for key in sorted(cls.model_fields, key=cls.apart.__contains__) if key != "law"
        )

    @property
    def parameters(self) -> dict[str, Value]:
        """The parameters that are not None, by name."""
        values = {
            key: getattr(self, key) for key in type(self).model_fields if key not in self.apart
        }
        return {key: value for key, value in values.items() if value is not None}

    def with_values(self, of: Callable[[str, Any], Value | Array]) -> Self:
        """Return the law with parameters replaced by ``of(name, value)``."""
        return self.model_copy(
            update={key: of(key, value) for key, value in self.parameters.items()}
        )

    def at(self, points: Flags | Integers | slice) -> Self:
        """Return the law at some of its points; its parameters are arrays."""
        return self.with_values(lambda _, values: values[points])

    @property
    def directed(self) -> bool:
        """Whether the friction depends on the direction of slip."""
        return False


def acting(*values: Value | None) -> bool:
    """Return whether any value is given and not zero."""
    return any(value is not None and not is_zero(value) for value in values)
