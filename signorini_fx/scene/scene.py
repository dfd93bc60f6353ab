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
from pathlib import Path
from typing import Annotated, Any, Self, get_origin

from pydantic import BaseModel, BeforeValidator, Field, InstanceOf, field_validator, model_validator

from signorini_fx.kinematics import of_materials
from signorini_fx.scene.base import Table, refused
from signorini_fx.scene.effect import Entries, Load, OneEntry, described, keys, with_every_effect
from signorini_fx.scene.features import refused_features
from signorini_fx.scene.load_steps import LoadSteps
from signorini_fx.scene.rigid_motion import rigid_bodies
from signorini_fx.scene.rigid_table import Rigid, with_shapes
from signorini_fx.scene.settings import Accuracy, Discretised, SolverSettings, TitleBlock, Units
from signorini_fx.scene.values import Finite, Positive, Selection, kind_of
from signorini_fx.statement import Statement

# The generators of bodies without arcs.
WITHOUT_ARCS = ("rectangle", "block", "box")


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
        if problems := list(self._contradictions(self.statement)):
            raise refused("Scene", problems)
        return self

    def _contradictions(self, stated: Statement) -> Iterator[tuple[tuple[str | int, ...], str]]:
        """Entries that do not go together, each alone fine: the place of the later one, and why."""
        regions = [material.region for material in self.material]
        if not regions or len(set(regions)) < len(regions) or (None in regions and len(regions) > 1):
            yield ("material",), "give one material, or several, each with the name of its own region"
        for entries in stated.effects.values():
            for number, effect in enumerate(entries):
                yield from effect.contradictions(stated, number)
        yield from refused_features(stated)
        if (self.mesh is None) != bool(self.body):
            missing = "a table with file or generator is expected" if self.mesh is None else "leave it out"
            yield ("mesh",), missing + ("" if self.mesh is None else ": each [[body]] has its own")
        names = [body.name for body in self.body]
        for number, name in enumerate(names):
            if name in names[:number]:
                yield ("body", number, "name"), f"two bodies are called {name!r}"
        if self.accuracy is not None and not self.contact:
            yield ("accuracy",), "needs a scene with contact"
        if len({len(load.factors) for load in stated.loads if load.factors is not None}) > 1:
            counts = [
                f"{path} has {len(load.factors)}" for path, load in stated.listed() if getattr(load, "factors", None)
            ]
            yield (), f"the lists of factors differ in length: {', '.join(counts)}"
            return  # how many load steps there are is not known
        for name in ("names", "times"):
            entries = getattr(self.load_steps, name)
            if entries is not None and len(entries) != stated.steps:
                wanted = f"one for each of {stated.steps} factors is expected"
                yield ("load_steps", name), f"has {len(entries)} entries, {wanted}"
        if stated.grows_from_nothing and stated.time_at(0) <= 0:
            yield ("load_steps", "times"), "must be positive: without factors the loads begin to grow at time 0"

    @classmethod
    def described(cls) -> type[BaseModel]:
        """See ``Table``: this imports the files of all effects."""
        return described(cls)

    @cached_property
    def statement(self) -> Statement:
        """The same without its mesh, as all that solves and judges reads it."""
        effects = {
            key: entries if isinstance(entries, tuple) else () if entries is None else (entries,)
            for key, entries in self
            if key in keys()
        }
        fields, origin = type(self).model_fields, ("mesh", "body", "rigid", "title_block")
        meshes: list[Any] = [body.mesh for body in self.body] or [self.mesh]
        return Statement(
            title=self.title,
            incomplete=self.incomplete,
            effects=effects,
            kinematics=of_materials((material.hypothesis, material.torsion) for material in self.material),
            element=self.element,
            load_steps=self.load_steps,
            steps=_count(effects, self.load_steps),
            solver=self.solver,
            accuracy=self.accuracy,
            units=self.units,
            bodies=tuple(body.name for body in self.body),
            generated=all(isinstance(mesh, MeshGenerator) for mesh in meshes),
            arcs=not all(getattr(mesh, "generator", None) in WITHOUT_ARCS for mesh in meshes),
            single=frozenset(key for key in effects if get_origin(fields[key].annotation) is not tuple),
            origin={key: getattr(self, key) for key in origin},
        )

    def sections_of(self, body: str) -> tuple[str, ...]:
        """The names of facets inside the mesh that it uses, as one of its bodies calls them."""
        return tuple(name.removeprefix(f"{body}.") for name in self.statement.sections)


def _count(effects: Mapping[str, tuple[Any, ...]], load_steps: LoadSteps) -> int:
    """Number of factors of each load; without factors one for each of the times, if anything depends on the time."""
    entries = [entry for several in effects.values() for entry in several]
    loads, times = [entry for entry in entries if isinstance(entry, Load)], load_steps.times
    timed = times is not None and any(entry.timed for entry in (*loads, *effects["contact"]))
    tools = [contact.tool for contact in effects["contact"]] if times is not None else []
    timed |= any(body.motion.driven_in_time for body in rigid_bodies(tools, [""] * len(tools)))
    count = len(times or ()) if timed else 1
    return max((len(load.factors) for load in loads if load.factors is not None), default=count)
