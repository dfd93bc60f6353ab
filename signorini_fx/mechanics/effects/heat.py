"""Heat in a scene: sources and temperatures of bodies, ``[[heat]]``, and heat transfer through
contact, tables within ``[[contact]]``.

How heat is conducted is in ``mechanics.body.heat``, which is imported only when such a step is
solved.
"""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from signorini_fx.arrays import Array, FieldValue, Flags
from signorini_fx.mechanics.statement.effect import (
    BodyCoefficients,
    ContactPart,
    Contradictions,
    Effect,
    InitialStrain,
    Stated,
    not_yet,
)
from signorini_fx.mechanics.statement.values import (
    Finite,
    NonNegative,
    NonNegativeValue,
    Positive,
    SampledValue,
    TimedSampledValue,
)

_Share = Annotated[Finite, Field(ge=0.0, le=1.0)]


class Heat(InitialStrain):
    """A source of heat, or a prescribed temperature; conduction determines it elsewhere, and the
    body expands with it.

    Attributes:
        boundary: name of the boundary where it acts; None: in the body.
        region: name of the part of the body, for a source or a temperature; None: all of it.
        temperature: the prescribed temperature.
        flux: heat flux into the body, power per area.
        film: film coefficient, power per area and difference of the temperature to ``ambient``.
        ambient: temperature outside of a film.
        source: power per volume.
        factors: must be left out; give values that depend on t.

    Examples:
        >>> warm = sfx.LinearElastic(young=1e3, poisson=0.3, expansion=1e-5, conductivity=2.0)
        >>> ends = [
        ...     sfx.Heat(boundary="top", temperature=100.0),
        ...     sfx.Heat(boundary="bottom", temperature=0.0),
        ... ]
        >>> result = sfx.solve(scene.model_copy(update={"material": warm, "heat": ends}))
        >>> print(np.round(result.steps[0].figures["heat_in"], 6))
        400.0
    """

    key = "heat"
    step_effect = "heat"
    value_keys = ("temperature", "flux", "film", "ambient", "source")
    refuses = not_yet(
        "heat",
        "inertia",
        "wear",
        "cohesion",
        "preload",
        "axisymmetric, torsion",
        "requested accuracy",
        "nested iteration",
        "nonlinear material",
        "statement of an error bound",
        more={"temperature": "stays a change that is given: leave it out, or [[heat]]"},
    )

    boundary: str | None = None
    region: str | None = None
    temperature: TimedSampledValue | None = None
    flux: TimedSampledValue | None = None
    film: NonNegativeValue | None = None
    ambient: TimedSampledValue | None = None
    source: TimedSampledValue | None = None

    @model_validator(mode="after")
    def _one_of_all(self) -> Self:
        kinds = ("temperature", "flux", "film", "source")
        if sum(getattr(self, key) is not None for key in kinds) != 1:
            raise ValueError(f"give one of {', '.join(kinds)}")
        if (self.film is None) != (self.ambient is None):
            raise ValueError("film and ambient go together")
        if self.boundary is None and (self.flux is not None or self.film is not None):
            raise ValueError("flux and film need a boundary")
        if self.boundary is not None and (self.source is not None or self.region is not None):
            raise ValueError("a boundary has no source and no region")
        return self

    @property
    def timed(self) -> bool:
        """Always true: the temperature changes from step to step."""
        return True

    @property
    def acts(self) -> bool:
        return True

    def degree(self, element: int) -> int:
        """Return the quadrature degree for strains of a temperature that has the degree of an
        element.
        """
        return 2 * element + 2

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        if self.factors is not None:
            yield ("heat", number, "factors"), "leave it out: give values that depend on t"
        if number:
            return
        stores = [material.specific_heat is not None for material in statement.material]
        times = statement.load_steps.times
        for at, material in enumerate(statement.material):
            if material.conductivity is None:
                yield ("material", at), "has no conductivity, which heat needs"
            if any(stores) and not (stores[at] and material.density):
                reason = "needs specific_heat and density: heat takes time in all bodies or in none"
                yield ("material", at), reason
        if any(stores) and (times is None or times[0] <= 0):
            reason = "needs load_steps.times, the first above 0, where heat begins"
            yield ("material", stores.index(True), "specific_heat"), reason

    def strain(self, on: BodyCoefficients) -> FieldValue | float:
        """Return the thermal strain, UFL.

        All entries cause one temperature; the first entry returns its strain, the others return 0.
        """
        if on.entries("heat")[0] is not self:
            return 0.0
        expansion, reference = on.of_material("expansion"), on.of_material("reference_temperature")
        return expansion * (on.computed("temperature") - reference)


class InitialTemperature(Effect):
    """The temperature at time 0 for transient heat conduction.

    Where none is given it is the reference temperature of the material; of several entries at one
    place the last one applies.

    Attributes:
        temperature: its value.
        region: name of the part of the body; None: all of it.

    Examples:
        >>> print(sfx.InitialTemperature(20.0, region="pad").temperature)
        20.0
    """

    key = "initial_temperature"
    value_keys = ("temperature",)
    positional = ("temperature",)

    temperature: SampledValue = Field(kw_only=False)
    region: str | None = None

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        stored = [material.specific_heat for material in statement.material]
        if not statement.effects.get("heat") or None in stored:
            yield ("initial_temperature", number), "needs [[heat]] and material.specific_heat"


class _HeatOfContact(ContactPart):
    """A table within a contact that needs heat."""

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        place = ("contact", number, self.key)
        contact = statement.contact[number]
        if not statement.effects.get("heat"):
            yield place, "needs [[heat]], which gives bodies their temperature"
        if contact.driven is not None:
            yield place, "is not possible yet where a force moves the foundation"


class Conductance(_HeatOfContact):
    """The thermal conductance of a contact, power per area and difference of temperature:
    ``closed * pressure**exponent`` where it is closed, plus ``open / (gap + length)``.

    Attributes:
        closed: conductance of closed contact at the pressure 1 (at any pressure if ``exponent`` is
            0), power per area and temperature.
        exponent: m; 0: closed contact conducts the same at any pressure.
        table: in place of both, rows of pressure and conductance, between which it is linear.
        open: conductivity of the medium in the gap, power per length and temperature.
        length: added to the gap, of the order of the roughness, length.
        temperature: of a rigid foundation, which needs one; must be left out between two bodies.

    Examples:
        >>> joint = sfx.Conductance(20.0, exponent=0.95)
        >>> print(np.round(joint.of(np.array([2.0]), np.zeros(1), np.ones(1, dtype=bool)), 6))
        [38.637453]
    """

    key = "conductance"
    value_keys = ("temperature",)
    positional = ("closed",)

    closed: NonNegative = Field(default=0.0, kw_only=False)
    exponent: NonNegative = 0.0
    table: Annotated[tuple[tuple[NonNegative, NonNegative], ...], Field(min_length=2)] | None = None
    open: NonNegative = 0.0
    length: Positive | None = None
    temperature: TimedSampledValue | None = None

    @model_validator(mode="before")
    @classmethod
    def _short(cls, entry: object) -> object:
        """Read a number as the conductance of closed contact, and a list as a table."""
        if isinstance(entry, int | float) and not isinstance(entry, bool):
            return {"closed": entry}
        return {"table": entry} if isinstance(entry, list | tuple) else entry

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.open and self.length is None:
            raise ValueError("open needs a length, of the order of the roughness")
        if self.table is not None:
            pressures = [row[0] for row in self.table]
            if self.closed or self.exponent:
                raise ValueError("give a table, or closed and exponent")
            if sorted(set(pressures)) != pressures:
                raise ValueError("the pressures of a table must increase")
        return self

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        yield from super().contradictions(statement, number)
        place = ("contact", number, "conductance")
        pair = statement.contact[number].against is not None
        if pair and self.temperature is not None:
            yield (*place, "temperature"), "is for a rigid foundation: both bodies have their own"
        if not pair and self.temperature is None:
            yield place, "needs the temperature of the foundation"

    def of(self, pressure: Array, gap: Array, closed: Flags) -> Array:
        """Return the conductance of n points, power per area and temperature, shape (n,).

        Args:
            pressure: not negative, stress, shape (n,).
            gap: not negative, length, shape (n,).
            closed: which points are in contact, shape (n,).
        """
        import numpy as np

        if self.table is not None:
            at_pressure = np.interp(pressure, *np.transpose(self.table)) * closed
        else:
            at_pressure = self.closed * pressure**self.exponent * closed
        across = self.open / (gap + self.length) if self.length is not None else 0.0
        return np.asarray(at_pressure + across)


class FrictionHeat(_HeatOfContact):
    """The heat from the work of friction, and how both sides share it.

    Attributes:
        fraction: fraction of the work that becomes heat, from 0 to 1.
        share: fraction of this heat that goes into the side with the contact points, from 0 to 1;
            the rest goes into the other body or the foundation.

    Examples:
        >>> print(sfx.FrictionHeat(1.0, share=0.9).share)
        0.9
    """

    key = "friction_heat"
    value_keys = ()
    positional = ("fraction",)

    fraction: _Share = Field(default=1.0, kw_only=False)
    share: _Share = 0.5

    @model_validator(mode="before")
    @classmethod
    def _short(cls, entry: object) -> object:
        return {"fraction": entry} if type(entry) in (int, float) else entry

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        yield from super().contradictions(statement, number)
        if not statement.contact[number].friction.acts:
            yield ("contact", number, "friction_heat"), "needs friction"
        if statement.load_steps.times is None:
            reason = "needs load_steps.times: heat is the work of friction over a duration"
            yield ("contact", number, "friction_heat"), reason
