"""Springs between a boundary and the ground: an elastic foundation (Winkler), a rubber mount, a soft clamp."""

from __future__ import annotations

from typing import Any, Self

from pydantic import model_validator

from signorini_fx.mechanics.statement.effect import Coefficients, Resistance
from signorini_fx.mechanics.statement.values import NonNegativeValue


class Springs(Resistance):
    """Springs on a boundary, which pull with the stiffness per area times the displacement, and push as well.

    Attributes:
        boundary: its name.
        normal: stiffness per area along the normal, stress / length.
        tangential: stiffness per area in every direction along the boundary, stress / length.
        x: stiffness per area along x[0], instead of the two, stress / length.
        y: stiffness per area along x[1], stress / length.
        z: stiffness per area along x[2], stress / length; only in 3D.
    """

    boundary: str
    normal: NonNegativeValue = 0.0
    tangential: NonNegativeValue = 0.0
    x: NonNegativeValue = 0.0
    y: NonNegativeValue = 0.0
    z: NonNegativeValue = 0.0

    @model_validator(mode="after")
    def _one_frame(self) -> Self:
        named = self.model_fields_set - {"boundary"}
        if not named or (named & {"x", "y", "z"} and named & {"normal", "tangential"}):
            raise ValueError("give either normal and tangential or x and y, or one of them")
        return self

    @property
    def given(self) -> dict[str, Any]:
        keys = ("normal", "tangential", "x", "y", "z")
        return {key: getattr(self, key) for key in keys if key in self.model_fields_set}

    def reaction(self, y: Any, on: Coefficients) -> Any:
        """K y with K = k_n n n^T + k_t (I - n n^T), or diagonal, see ``Resistance``."""
        import ufl

        if self.model_fields_set & {"x", "y", "z"}:
            stiffness = on.vector((self.x, self.y, self.z))
            return ufl.as_vector([stiffness[k] * y[k] for k in range(len(y))])
        across = ufl.inner(y, on.normal) * on.normal
        return on.value(self.normal) * across + on.value(self.tangential) * (y - across)


Entry = Springs
