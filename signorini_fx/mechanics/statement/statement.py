"""The data of a problem before it has a mesh: effects by name, kinematics, load steps and settings.

Scenes and forms of a user both make this record.  Everything that assembles, solves, judges and
reports a problem reads it, alone or as a part of ``model.Model``, independent of its origin.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self, TypeVar

from signorini_fx.arrays import Array
from signorini_fx.mechanics.kinematics import SPACE, Kinematics
from signorini_fx.mechanics.statement.base import Table
from signorini_fx.mechanics.statement.effect import Effect, ForceDensity, Load, Stated
from signorini_fx.mechanics.statement.load_path import LoadPath, factor_at
from signorini_fx.mechanics.statement.rigid_body import RigidBody, rigid_bodies
from signorini_fx.mechanics.statement.units import unit_names

_Effect = TypeVar("_Effect", bound=Effect)


@dataclass(frozen=True, kw_only=True)
class Statement(Stated):
    """A problem without its mesh, with derived quantities."""

    def changed(self, **entries: tuple[Any, ...]) -> Self:
        """Return the statement with other entries for some keys of effects."""
        return replace(self, effects={**self.effects, **entries})

    @property
    def finite_strains(self) -> bool:
        """Whether some material has finite strains."""
        return any(material.finite for material in self.material)

    @property
    def tables(self) -> dict[str, Any]:
        """The given entries by the keys of a scene, for the summary."""
        entries = {
            key: next(iter(several), None) if key in self.single else several
            for key, several in self.effects.items()
        }
        settings: dict[str, Table | None] = {"load_steps": self.load_steps, "solver": self.solver}
        if self.units is not None:
            settings |= {"accuracy": self.accuracy, "units": self.units}
        element = {"degree": self.element.degree} if self.units is None else self.element
        named = {"title": self.title, "incomplete": self.incomplete}
        return {**named, **self.origin, "element": element, **entries, **settings}

    def unit_names(self, dimension: int) -> dict[str, str]:
        """Return the unit of each quantity on a mesh of this dimension, see
        ``units.unit_names``.
        """
        return unit_names(
            {} if self.units is None else dict(self.units), self.kinematics_in(dimension)
        )

    def listed(self) -> list[tuple[str, Any]]:
        """Return all entries with their paths in the scene, including the parts of contacts."""
        entries = [
            (key if key in self.single else f"{key}[{number}]", effect)
            for key, entries in self.effects.items()
            for number, effect in enumerate(entries)
        ]
        return entries + [
            (f"contact[{number}].{part.key}", part)
            for number, contact in enumerate(self.contact)
            for part in contact.parts
        ]

    def of(self, kind: type[_Effect]) -> tuple[_Effect, ...]:
        """Return all entries of a class, such as ``statement.effect.ForceDensity``."""
        return tuple(
            effect
            for entries in self.effects.values()
            for effect in entries
            if isinstance(effect, kind)
        )

    @cached_property
    def loads(self) -> tuple[Load, ...]:
        """All entries that load steps multiply by factors."""
        return self.of(Load)

    @property
    def forces_at(self) -> str:
        """The keys of the given forces, for messages; ``traction, body_force`` if there are no
        others.
        """
        listed = [
            key
            for key, entries in self.effects.items()
            if any(isinstance(entry, ForceDensity) for entry in entries)
        ]
        return (
            ", ".join(listed) if {*listed} - {"traction", "body_force"} else "traction, body_force"
        )

    @property
    def rigid_bodies(self) -> tuple[RigidBody, ...]:
        """The rigid bodies whose motion is an unknown, with their contacts."""
        return rigid_bodies([contact.driven for contact in self.contact], self.sides[0])

    @property
    def sections(self) -> tuple[str, ...]:
        """The names of the interior facets of the mesh that effects use."""
        names = (getattr(effect, "section", None) for _, effect in self.listed())
        return tuple(name for name in names if name is not None)

    @property
    def preloads(self) -> tuple[Any, ...]:
        """The bolt preloads that act, each at a section across a bolt."""
        return tuple(entry for entry in self.effects.get("preload", ()) if entry.acts)

    def drives(self, dimension: int, step: float) -> list[tuple[Array, Array]]:
        """Return the loads of each rigid body at a place on the load path, see ``now``: forces and
        moments, and prescribed components, nan where they are free, shapes (m,).
        """
        drives = []
        given = ~self.kinematics_in(dimension).unbalanced
        for body in self.rigid_bodies:
            factor = 1.0 if body.motion.driven_in_time else factor_at((1.0,) * self.steps, step)
            load, prescribed = body.motion.drive(dimension, self.time_at(step))
            prescribed[given] = 0.0
            drives.append((factor * load, factor * prescribed))
        return drives

    def factors_of(self, effect: Effect) -> tuple[float, ...]:
        """Return the factors of a load, one for each step; 1 for an effect without factors."""
        return getattr(effect, "factors", None) or (1.0,) * self.steps

    def now(self, effect: _Effect, step: float) -> tuple[float, _Effect]:
        """Return the factor of an effect at a place on the load path, and the effect at the time
        there.

        Effects that depend on the time and have no factors do not grow with the other loads of a
        ramp.
        """
        constant = effect.timed and getattr(effect, "factors", None) is None
        factor = 1.0 if constant else factor_at(self.factors_of(effect), step)
        return factor, effect.at_time(self.time_at(step))

    def contacts_at(self, step: float) -> tuple[Any, ...]:
        """Return the contacts with foundations and friction at a place on the load path;
        ``contact`` itself if none changes with time.

        Before the first load step friction is that of the first step.
        """
        if not any(effect.timed for effect in self.contact):
            return self.contact
        # Where no load step ends nothing asks for friction, such as 0.1/t.
        time = self.time_at(step)
        of_friction = self.time_at(0 if step == -1 else step)
        return tuple(
            contact.at_time(time).model_copy(
                update={"friction": contact.friction.at_time(of_friction)}
            )
            for contact in self.contact
        )

    def held_at(self, step: float) -> tuple[Any, ...]:
        """Return the supports that are active at a place on the load path."""
        return tuple(entry for entry in self.displacement if entry.holds_at(step))

    def time_at(self, step: float) -> float:
        """Return the time at a place on the load path, see ``statement.load_path``."""
        return self.path.time_at(step)

    @cached_property
    def path(self) -> LoadPath:
        """The load path; a ramp starts from the unloaded body if no load has factors."""
        steps = self.load_steps
        alone = steps.steps is not None and all(load.factors is None for load in self.loads)
        times = steps.times or map(float, range(1, self.steps + 1))
        named = tuple(times), steps.names or (), steps.steps
        return LoadPath(*named, alone, steps.time_accuracy, steps.jump)

    @property
    def sides(self) -> tuple[list[str], list[str | None] | None]:
        """The boundary of each contact, and the boundary of the opposite body for each; None in
        place of the latter if there are no pairs.
        """
        against = [effect.against for effect in self.contact]
        return [effect.boundary for effect in self.contact], against if any(against) else None

    @property
    def young(self) -> float:
        """Young's modulus of the stiffest material, the natural scale of stress."""
        return max(material.natural_modulus for material in self.material)

    def kinematics_in(self, dimension: int) -> Kinematics:
        """Return the kinematics of the body on a mesh of this dimension."""
        return self.kinematics if dimension == 2 else SPACE
