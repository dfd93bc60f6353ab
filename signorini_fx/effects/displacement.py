"""Prescribed displacement: supports, symmetry, and boundaries that move."""

from __future__ import annotations

from typing import Any, Self

from pydantic import model_validator

from signorini_fx.scene.effect import Coefficients, Contradictions, Load, text
from signorini_fx.scene.values import SampledValue


class PrescribedDisplacement(Load):
    """Displacement prescribed on a boundary; a component that is not named stays free.

    Attributes:
        boundary: its name.
        x: component along x[0], length.
        y: component along x[1], length.
        z: component along x[2], length; only in space.
        normal: component along the outward normal, length, on a flat boundary (0: symmetry).
        factors: one number per load step; None: 1 in every step.
    """

    boundary: str
    x: SampledValue | None = None
    y: SampledValue | None = None
    z: SampledValue | None = None
    normal: SampledValue | None = None

    @model_validator(mode="after")
    def _something(self) -> Self:
        named = any(component is not None for component in self.components)
        if named == (self.normal is not None):
            none = "names no component: give x, y, both, or normal"
            raise ValueError("give either normal or x and y" if named else none)
        return self

    @property
    def components(self) -> tuple[Any, Any, Any]:
        """Along x[0], x[1] and x[2]; None where the displacement is free."""
        return self.x, self.y, self.z

    @property
    def given(self) -> dict[str, Any]:
        """See ``Effect``."""
        every = {"x": self.x, "y": self.y, "z": self.z, "normal": self.normal}
        return {key: value for key, value in every.items() if value is not None}

    @property
    def acts(self) -> bool:
        """A displacement that is zero acts as well."""
        return True

    @property
    def said(self) -> str:
        """See ``Effect``."""
        return ", ".join(f"{key} = {text(value)}" for key, value in self.given.items())

    def contradictions(self, scene: Any, place: int) -> Contradictions:
        """See ``Effect``."""
        touching = any(contact.boundary == self.boundary for contact in scene.contact)
        if touching and (self.normal is not None or None not in self.components):
            yield ("displacement", place), f"{self.boundary!r} is prescribed, and in contact as well: choose one"

    def free(self, vector: Any, on: Coefficients) -> Any:
        """See ``Effect``."""
        import ufl

        if self.normal is not None:
            return vector - ufl.inner(vector, on.normal) * on.normal
        free = [component is None for component in self.components]
        return ufl.as_vector([vector[k] if free[k] else 0.0 for k in range(len(vector))])

    def away(self, y: Any, factor: Any, on: Coefficients) -> list[Any]:
        """Expressions may be missed between the nodes, component by component, see ``Effect``."""
        import ufl

        pairs = [*zip(self.components, y, strict=False), (self.normal, ufl.inner(y, on.normal))]
        return [
            factor * on.value(value) - component
            for value, component in pairs
            if value is not None and not isinstance(value, float)
        ]


Entry = PrescribedDisplacement
