"""What a friction law says.  All that solves, judges and tells of friction asks these methods and
knows no kind.

A law is |mu| <= g(lambda): the shear mu, a stress, is at most a bound that the contact pressure
lambda >= 0 decides, and where it is less, nothing slips.  The fields of its class are its
parameters: numbers, expressions, callables, UFL. At points they are arrays, and ``limit`` is plain
NumPy on them, as in ``demos/extensions/law.py``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, WithJsonSchema

from signorini_fx.errors import FormError, SceneError
from signorini_fx.mechanics.statement.base import Table
from signorini_fx.mechanics.statement.effect import is_zero
from signorini_fx.mechanics.statement.values import not_negative, timed

Array = npt.NDArray[np.float64]

# A parameter of a law: not negative, a number, an expression of position and time, a callable f(x)
# of points of shape (3, n), or in forms UFL.
Parameter = Annotated[
    Any,
    BeforeValidator(lambda value: not_negative(timed(value))),
    WithJsonSchema({"type": ["number", "string"]}),
]


class Envelope(NamedTuple):
    """min(given + coefficient lambda, cap), which is convex and which statics knows: no bound of
    the law exceeds it.

    Attributes:
        given: stress, a number or shape (n,).
        coefficient: without unit, of the same kinds.
        cap: stress; None: there is none.
    """

    given: Any
    coefficient: Any
    cap: Any = None


class FrictionLaw(Table):
    """A friction law; a user's own derives from it, see above; ``directed.DirectedLaw`` may depend
    on the direction.

    Attributes:
        law: its name.

    Examples:
        >>> law = sfx.Coulomb(0.3, cohesion="0.1*x[0]")
        >>> print(isinstance(law, sfx.FrictionLaw), law.parameters["coefficient"])
        True 0.3
    """

    # Whether the bound depends on the pressure; where it does not the problem is convex, and the
    # derivative zero.
    follows_pressure: ClassVar[bool] = True
    # Whether the bound grows with the pressure, ever less: then it is below its tangent at zero and
    # its limit.
    concave: ClassVar[bool] = False
    error: ClassVar[type[SceneError]] = FormError
    # Keys that are no parameters.
    apart: ClassVar[tuple[str, ...]] = ("law",)

    law: str

    # --- what a law must say ---

    def limit(self, pressure: Array) -> Array:
        """The largest shear, stress, at a pressure that is not negative, both with shape (n,);
        parameters are arrays of this shape.
        """
        raise NotImplementedError

    def derivative(self, pressure: Array) -> Array:
        """Derivative of the bound by the pressure, at zero that towards larger ones, without unit,
        shape (n,).
        """
        if self.follows_pressure:
            raise NotImplementedError
        return np.zeros_like(pressure)

    # --- what it may say ---

    def envelope(self, zero: Array) -> Envelope:
        """What bounds its bound, for statics; ``zero`` has the shape of the parameters.

        Of a concave law it follows, and of one that the pressure leaves as it is; of others nothing
        is known, and friction has no limit.
        """
        if not self.follows_pressure:
            return Envelope(self.limit(zero), zero)
        if not self.concave:
            return Envelope(zero + np.inf, zero)
        with np.errstate(
            invalid="ignore"
        ):  # what is a quotient, or of a parameter that is zero, is no number there
            limit = self.limit(zero + np.inf)
        cap = np.where(np.isnan(limit), np.inf, limit)
        given = self.limit(zero)
        slope = self.derivative(zero)
        vertical = np.isinf(slope)
        lines = np.where(vertical, np.inf, given), np.where(vertical, 0.0, slope)
        return Envelope(*lines, None if np.isinf(cap).all() else cap)

    @property
    def ends_open(self) -> bool:
        """Whether the bound of its envelope ends with a jump where contact opens."""
        return False

    @property
    def unknown(self) -> str:
        """Why its bound is not its envelope, so that nothing is proved of it but equilibrium; "":
        it is.
        """
        return (
            f"of the friction law {self.law} only the bound is known"
            if self.follows_pressure
            else ""
        )

    @property
    def acts(self) -> bool:
        """Whether it can transmit shear."""
        return True

    # --- what follows ---

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        """In Python its parameters may be given in their order, before the other keys."""
        super().__pydantic_init_subclass__(**options)
        cls.positional = tuple(
            key for key in sorted(cls.model_fields, key=cls.apart.__contains__) if key != "law"
        )

    @property
    def parameters(self) -> dict[str, Any]:
        """Those that are not None by their names."""
        values = {
            key: getattr(self, key) for key in type(self).model_fields if key not in self.apart
        }
        return {key: value for key, value in values.items() if value is not None}

    def with_values(self, of: Callable[[str, Any], Any]) -> Self:
        """The same with other parameters, made from their names and values."""
        return self.model_copy(
            update={key: of(key, value) for key, value in self.parameters.items()}
        )

    def at(self, points: Any) -> Self:
        """A law whose parameters are arrays at some of their entries."""
        return self.with_values(lambda _, values: values[points])

    @property
    def directed(self) -> bool:
        """Whether it depends on the direction of slip."""
        return False


def acting(*values: Any) -> bool:
    """Whether a value is there and not the number zero."""
    return any(value is not None and not is_zero(value) for value in values)
