"""The scene: its effects and their data.  No mesh, no forms; nothing here imports dolfinx.

A scene is read from a TOML file (``read_scene``) or built in Python (``Scene(...)``), and validated in the same way:
unknown keys are refused, and all errors are reported at once, each with its path.

A *value* is a number, an expression of ``x[0]``, ``x[1]`` and, in space, ``x[2]`` (``expressions.Expression``), or in
Python also a callable ``f(x)`` that maps points of shape (3, n) to values of shape (n,), or (tractions and body forces)
a UFL expression.
Any consistent units may be used: forces, lengths and stresses of one system.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar, get_origin

from pydantic import BaseModel, BeforeValidator, Field, InstanceOf, field_validator, model_validator

from signorini_fx.kinematics import of_materials
from signorini_fx.kinematics.cartesian import Kinematics
from signorini_fx.kinematics.space import SPACE
from signorini_fx.scene.base import Table, refused
from signorini_fx.scene.effect import (
    Effect,
    Entries,
    Force,
    JointLoad,
    Load,
    OneEntry,
    described,
    keys,
    with_every_effect,
)
from signorini_fx.scene.features import refused_features
from signorini_fx.scene.load_steps import LoadPath, LoadSteps, factor_at, time_at
from signorini_fx.scene.rigid_motion import RigidBody, rigid_bodies
from signorini_fx.scene.rigid_table import Rigid, with_shapes
from signorini_fx.scene.settings import Accuracy, SolverSettings, TitleBlock, Units
from signorini_fx.scene.values import Finite, Positive, Selection, kind_of

_Effect = TypeVar("_Effect", bound=Effect)


class MeshFile(Table):
    """A mesh from a file, with the names that the file gives to its boundaries and regions, or that are given here.

    Attributes:
        file: .msh or .geo of gmsh, .step, .stp or .brep of a CAD program, .inp, .med, .vtu or .xdmf.
        boundaries: names for boundaries: a number in the cell data, a list of numbers, or a condition at all vertices
            of exterior facets.
        regions: names for parts of the body: a number, a list of numbers, or a condition at all vertices of cells.
        data: the cell data that the numbers refer to; None: there is only one.
        size: length of the cells of a .step, .stp or .brep; None: a fraction of the size of the body.
    """

    file: Path
    boundaries: dict[str, Selection] = Field(default={})
    regions: dict[str, Selection] = Field(default={})
    data: str | None = None
    size: Positive | None = None


class MeshGenerator(Table):
    """A mesh from one of the generators in ``meshes/``.

    Attributes:
        generator: its name.
        parameters: its keyword arguments; default: none.
    """

    generator: str
    parameters: dict[str, float | int | str | bool] = Field(default={})


class Discretised(Table):
    """The finite element: Lagrange of this degree on the cells that the mesh has.

    Attributes:
        degree: polynomial degree of the displacement.
        volumetric: ``full``: all terms are integrated exactly; ``reduced``: the volumetric term with fewer points,
            which does not lock as nu -> 0.5 (it equals the mixed displacement-pressure element with the pressure
            eliminated); ``auto``: reduced where some nu is at least 0.45 in plane strain and the element has a reduced
            form; ``mixed``: a pressure of degree 1 is an unknown of its own (Taylor-Hood, with degree 2), which does
            not lock either, and allows for nu = 0.5.
    """

    degree: Annotated[int, Field(ge=1, le=2, strict=True)] = 1
    volumetric: Literal["full", "reduced", "auto", "mixed"] = "full"


class TaggedMeshBase:
    """The base class of ``mesh.TaggedMesh``, so that a scene can hold one without importing dolfinx."""


def _one_mesh(entry: Any) -> Any:
    """Decide by the key, so that errors are reported for the kind of mesh that was meant."""
    if isinstance(entry, Mapping):
        if ("file" in entry) == ("generator" in entry):
            raise ValueError("give either file or generator")
        return (MeshFile if "file" in entry else MeshGenerator).model_validate(entry)
    if not isinstance(entry, MeshFile | MeshGenerator | TaggedMeshBase):
        message = "a table with file or generator is expected"
        if isinstance(entry, str | Path):
            message += f": for a mesh file write MeshFile(file={str(entry)!r}), in TOML [mesh] with file = ..."
        elif hasattr(entry, "topology"):
            message += ", or a mesh with named boundaries: tag_boundaries(mesh, {name: rule, ...}) makes one"
        else:
            message += f", not {kind_of(entry)}"
        raise ValueError(message)
    return entry


def _listed(entry: Any) -> Any:
    """A single table stands for a list of one."""
    return [entry] if isinstance(entry, Mapping | Table) else entry


class Body(Table):
    """One of several bodies, with a mesh of its own, which is turned and then moved to its place.

    Attributes:
        name: of the region of all of its cells; with a dot it stands before the names of its boundaries and regions.
        mesh: a generator with its parameters, a file, or a ``TaggedMesh``.
        shift: by which it is moved, lengths; None: not at all.
        rotation: by which it is turned, degrees, counterclockwise; in space about the axis [a, b, c] by the length of
            this vector; None: not at all.
        pivot: the point that it is turned about, length; None: the origin.
    """

    name: str
    mesh: MeshGenerator | MeshFile | InstanceOf[TaggedMeshBase]
    shift: Annotated[tuple[Finite, ...], Field(min_length=2, max_length=3)] | None = None
    rotation: Annotated[tuple[Finite, ...], Field(min_length=3, max_length=3)] | Finite | None = None
    pivot: Annotated[tuple[Finite, ...], Field(min_length=2, max_length=3)] | None = None

    @field_validator("mesh", mode="before")
    @classmethod
    def _one_mesh(cls, entry: Any) -> Any:
        return _one_mesh(entry)

    @field_validator("name")
    @classmethod
    def _plain(cls, name: str) -> str:
        if not name or "." in name or name != name.strip():
            raise ValueError("must be a name without dots")
        return name


@with_every_effect
class Scene(Table):
    """An elastic body, its loads, its supports and its contact with a rigid foundation.

    Attributes:
        title: any text.
        incomplete: what is missing of what was meant, such as what a draft of a deck of another program has lost;
            results say so until it is removed; default: nothing.
        mesh: a generator with its parameters, a file, or a ``TaggedMesh``; its dimension is that of the scene; None:
            that of ``body``.
        body: several bodies in place of ``mesh``; default: none.
        element: degree and volumetric integration; default: degree 1, full.
        material: one for the body, or one for each named region.
        displacement: prescribed displacements, lengths; default: none.
        traction: tractions and pressures, forces per area; default: none.
        body_force: force per volume; default: none.
        contact: contact with a rigid foundation, one entry for each boundary; default: none.
        rigid: rigid bodies that forces move, to which contacts refer by their names; default: none.
        load_steps: names and times of load steps, and an automatic ramp; default: one load step per factor.
        solver: algorithms, their parameters and limits.
        accuracy: the accuracy to be reached by refinement; None: no refinement.
        units: names of units for labels.
        title_block: project, author, date and revision for the report.
    """

    title: str = ""
    incomplete: tuple[str, ...] = ()
    mesh: MeshGenerator | MeshFile | InstanceOf[TaggedMeshBase] | None
    body: Annotated[tuple[Body, ...], BeforeValidator(_listed)] = ()
    element: Discretised = Discretised()
    material: Entries
    displacement: Entries = ()
    traction: Entries = ()
    body_force: OneEntry = None
    contact: Entries = ()
    rigid: Annotated[tuple[Rigid, ...], BeforeValidator(_listed)] = ()
    load_steps: LoadSteps = LoadSteps()
    solver: SolverSettings = SolverSettings()
    accuracy: Accuracy | None = None
    units: Units = Units()
    title_block: TitleBlock = TitleBlock()

    @field_validator("mesh", mode="before")
    @classmethod
    def _one_mesh(cls, entry: Any) -> Any:
        return None if entry is None else _one_mesh(entry)

    @model_validator(mode="before")
    @classmethod
    def _mesh_of_bodies(cls, entry: Any) -> Any:
        without = isinstance(entry, Mapping) and entry.get("body") and "mesh" not in entry
        return {**entry, "mesh": None} if without else entry

    @model_validator(mode="before")
    @classmethod
    def _shapes_of_rigid_bodies(cls, entry: Any) -> Any:
        return with_shapes(entry)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if problems := list(self._contradictions()):
            raise refused("Scene", problems)
        return self

    def _contradictions(self) -> Iterator[tuple[tuple[str | int, ...], str]]:
        """Entries that do not go together, each alone fine: the place of the later one, and why."""
        regions = [material.region for material in self.material]
        if not regions or len(set(regions)) < len(regions) or (None in regions and len(regions) > 1):
            yield ("material",), "give one material, or several, each with the name of its own region"
        for entries in self.effects.values():
            for number, effect in enumerate(entries):
                yield from effect.contradictions(self, number)
        yield from refused_features(self)
        if (self.mesh is None) != bool(self.body):
            missing = "a table with file or generator is expected" if self.mesh is None else "leave it out"
            yield ("mesh",), missing + ("" if self.mesh is None else ": each [[body]] has its own")
        names = [body.name for body in self.body]
        for number, name in enumerate(names):
            if name in names[:number]:
                yield ("body", number, "name"), f"two bodies are called {name!r}"
        if self.accuracy is not None and not self.contact:
            yield ("accuracy",), "needs a scene with contact"
        if len({len(load.factors) for load in self.loads if load.factors is not None}) > 1:
            counts = [
                f"{path} has {len(load.factors)}" for path, load in self.listed() if getattr(load, "factors", None)
            ]
            yield (), f"the lists of factors differ in length: {', '.join(counts)}"
            return  # how many load steps there are is not known
        for name in ("names", "times"):
            entries = getattr(self.load_steps, name)
            if entries is not None and len(entries) != self.steps:
                wanted = f"one for each of {self.steps} factors is expected"
                yield ("load_steps", name), f"has {len(entries)} entries, {wanted}"
        if self.grows_from_nothing and self.time_at(0) <= 0:
            yield ("load_steps", "times"), "must be positive: without factors the loads begin to grow at time 0"

    @classmethod
    def described(cls) -> type[BaseModel]:
        """See ``Table``: this imports the files of all effects."""
        return described(cls)

    @property
    def unstated(self) -> tuple[str, ...]:
        """Keys of which nothing is known, so that results do not list them: none of a scene."""
        return ()

    @cached_property
    def effects(self) -> dict[str, tuple[Any, ...]]:
        """All entries by their keys, in the order of the keys of a scene; a key without entries is there as well."""
        fields = ((key, getattr(self, key)) for key in type(self).model_fields if key in keys())
        return {
            key: entries if isinstance(entries, tuple) else () if entries is None else (entries,)
            for key, entries in fields
        }

    def heading(self, key: str) -> str:
        """How a TOML file writes a table of this key: ``[key]`` if there can be one only, else ``[[key]]``."""
        return f"[[{key}]]" if get_origin(type(self).model_fields[key].annotation) is tuple else f"[{key}]"

    def listed(self) -> list[tuple[str, Any]]:
        """All entries with their paths in the scene."""
        return [
            (f"{key}[{number}]" if self.heading(key).startswith("[[") else key, effect)
            for key, entries in self.effects.items()
            for number, effect in enumerate(entries)
        ]

    def of(self, kind: type[_Effect]) -> tuple[_Effect, ...]:
        """All entries of a kind, such as ``scene.effect.Force``."""
        return tuple(effect for entries in self.effects.values() for effect in entries if isinstance(effect, kind))

    @cached_property
    def loads(self) -> tuple[Load, ...]:
        """All that load steps multiply."""
        return self.of(Load)

    @property
    def forces_at(self) -> str:
        """The keys of its forces, for messages; ``traction, body_force`` where it lists no others."""
        listed = [key for key, entries in self.effects.items() if any(isinstance(entry, Force) for entry in entries)]
        return ", ".join(listed) if {*listed} - {"traction", "body_force"} else "traction, body_force"

    @property
    def generated(self) -> bool:
        """Whether all of its cells are made by generators."""
        meshes: list[Any] = [body.mesh for body in self.body] or [self.mesh]
        return all(isinstance(mesh, MeshGenerator) for mesh in meshes)

    @cached_property
    def steps(self) -> int:
        """Number of factors of each load; that of the load steps, unless there is a ramp between them.

        Loads that depend on the time need no factors: there is one for each of the times.
        """
        timed = self.load_steps.times is not None and any(entry.timed for entry in (*self.loads, *self.contact))
        timed |= self.load_steps.times is not None and any(body.motion.driven_in_time for body in self.rigid_bodies)
        count = len(self.load_steps.times or ()) if timed else 1
        return max((len(load.factors) for load in self.loads if load.factors is not None), default=count)

    @property
    def rigid_bodies(self) -> tuple[RigidBody, ...]:
        """Those whose motion is an unknown, with their contacts."""
        return rigid_bodies([contact.tool for contact in self.contact], self.sides[0])

    @property
    def joint_loads(self) -> dict[str, JointLoad]:
        """The loads that enter contact as it opens, by their paths in the scene."""
        return {path: load for path, load in self.listed() if isinstance(load, JointLoad) and load.enters}

    @property
    def sections(self) -> tuple[str, ...]:
        """The names of facets inside its mesh that it uses."""
        return tuple(name for _, effect in self.listed() for name in effect.inner_facets)

    def sections_of(self, body: str) -> tuple[str, ...]:
        """The same, as one of its bodies calls them."""
        return tuple(name.removeprefix(f"{body}.") for name in self.sections)

    @property
    def interfaces(self) -> list[Any]:
        """Those of its entries, one ``interfaces.protocol.Interface`` for each kind."""
        kinds: dict[str, dict[str, Any]] = {}
        for path, effect in self.listed():
            if effect.interface:
                kinds.setdefault(effect.interface, {})[path] = effect
        return [import_module(f"signorini_fx.interfaces.{kind}").Kind(self, kinds[kind]) for kind in kinds]

    def sought_at(self, step: float) -> dict[str, str]:
        """What is known only with the solution at a place in the lists of factors: clauses by the paths of entries."""
        words = {path: effect.sought_at(self, step) for path, effect in self.listed()}
        return {path: clause for path, clause in words.items() if clause}

    @property
    def assumed(self) -> list[str]:
        """What stays as it is in statements about a solution, in words, each once."""
        return [*dict.fromkeys(effect.assumed for _, effect in self.listed() if effect.assumed)]

    def drives(self, dimension: int, step: float, scale: float) -> list[tuple[Any, Any]]:
        """What drives each rigid body at a place in the lists of factors, see ``now``: forces and moments, and the
        components that are prescribed, nan where they are free, shapes (m,); ``scale``: a factor more of all of it.
        """
        drives, given = [], ~self.kinematics_in(dimension).unbalanced
        for body in self.rigid_bodies:
            factor = scale * (1.0 if body.motion.driven_in_time else factor_at((1.0,) * self.steps, step))
            load, prescribed = body.motion.drive(dimension, self.time_at(step))
            prescribed[given] = 0.0
            drives.append((factor * load, factor * prescribed))
        return drives

    @property
    def automatic_steps(self) -> int | None:
        """Into how many load steps a ramp divides each interval; None: there is no ramp."""
        return self.load_steps.steps

    @property
    def grows_from_nothing(self) -> bool:
        """Whether all loads grow together in a ramp, because none of them has factors."""
        return self.automatic_steps is not None and all(load.factors is None for load in self.loads)

    @property
    def expected_steps(self) -> int:
        """Number of load steps, if none of a ramp has to be divided."""
        if self.automatic_steps is None:
            return self.steps
        intervals = self.steps if self.grows_from_nothing else self.steps - 1
        return intervals * self.automatic_steps + (not self.grows_from_nothing)

    @property
    def several_steps(self) -> bool:
        """Whether there may be more than one load step."""
        return self.steps > 1 or self.automatic_steps is not None

    def factors_of(self, effect: Effect) -> tuple[float, ...]:
        """The factors of a load; those of an effect that load steps do not change are 1."""
        return getattr(effect, "factors", None) or (1.0,) * self.steps

    def now(self, effect: _Effect, step: float) -> tuple[float, _Effect]:
        """The factor of an effect at a place in the lists of factors, and the effect at the time of that place.

        What depends on the time and has no factors does not grow with the other loads of a ramp.
        """
        if not effect.timed:
            return factor_at(self.factors_of(effect), step), effect
        factors = getattr(effect, "factors", None)
        return 1.0 if factors is None else factor_at(factors, step), effect.at_time(self.time_at(step))

    def placed(self, step: float) -> Self:
        """The scene with foundations and friction of a place in the lists of factors; itself if no time is in them."""
        if not any(effect.timed for effect in self.contact):
            return self
        return self.model_copy(
            update={"contact": tuple(contact.at_time(self.time_at(step)) for contact in self.contact)}
        )

    def time_at(self, step: float) -> float:
        """The time of a place in the lists of factors, see ``scene.load_steps``."""
        return time_at(self._times, step)

    @cached_property
    def _times(self) -> tuple[float, ...]:
        return self.load_steps.times or tuple(map(float, range(1, self.steps + 1)))

    @property
    def path(self) -> LoadPath:
        """The load steps, without the loads."""
        names = self.load_steps.names or ()
        return LoadPath(self._times, names, self.automatic_steps, from_nothing=self.grows_from_nothing)

    @property
    def sides(self) -> tuple[list[str], list[str | None] | None]:
        """The boundary of each contact, and that of the other body of each; None: there is no other body."""
        against = [effect.against for effect in self.contact]
        return [effect.boundary for effect in self.contact], against if any(against) else None

    @property
    def touching(self) -> list[str]:
        """The boundaries with which bodies touch each other."""
        return [name for contact in self.contact if contact.against for name in (contact.boundary, contact.against)]

    @property
    def young(self) -> float:
        """Young's modulus of the stiffest material, the natural unit of stress."""
        return max(material.natural_modulus for material in self.material)

    @cached_property
    def kinematics(self) -> Kinematics:
        """That of its body, if the mesh is plane."""
        return of_materials((material.hypothesis, material.torsion) for material in self.material)

    def kinematics_in(self, dimension: int) -> Kinematics:
        """That of its body on a mesh of this dimension."""
        return self.kinematics if dimension == 2 else SPACE

    @cached_property
    def has_friction(self) -> bool:
        """Whether any contact boundary has a friction law that can act; a law with bound or coefficient 0 cannot."""
        return any(effect.friction.acts for effect in self.contact)

    @cached_property
    def has_coulomb(self) -> bool:
        """Whether any friction bound depends on the contact pressure."""
        return any(effect.coulomb for effect in self.contact)
