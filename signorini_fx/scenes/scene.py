"""The scene: its effects and their data.  It has no forms, and nothing here imports dolfinx.

A *value* is a number, an expression of ``x[0]``, ``x[1]`` and, in 3D, ``x[2]``
(``expressions.Expression``), or in Python also a callable ``f(x)`` that maps points of shape (3, n)
to values of shape (n,), or (tractions and body forces) a UFL expression. Any consistent units may
be used: forces, lengths and stresses of one system.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar, cast, get_origin

from pydantic import BeforeValidator, model_validator

from signorini_fx.errors import FormError
from signorini_fx.mechanics.effects import loads
from signorini_fx.mechanics.effects.contact import Contact, GeneralContact
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.effects.material import Entry as MaterialEntry
from signorini_fx.mechanics.kinematics import of_materials
from signorini_fx.mechanics.statement.base import Table, refused
from signorini_fx.mechanics.statement.effect import Load, listed, with_every_effect
from signorini_fx.mechanics.statement.features import refused_features
from signorini_fx.mechanics.statement.load_path import LoadSteps
from signorini_fx.mechanics.statement.mesh_sources import WITHOUT_ARCS, Body, MeshGenerator, OneMesh
from signorini_fx.mechanics.statement.rigid_body import rigid_bodies
from signorini_fx.mechanics.statement.settings import Accuracy, Element, SolverSettings, Units
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.mechanics.statement.values import Accepts, Entries

if TYPE_CHECKING:
    pass

_Table = TypeVar("_Table")
One = Accepts[_Table | Mapping[str, Any], _Table]
Maybe = Accepts[_Table | Mapping[str, Any] | None, _Table | None]
# A list of tables, or a single table.
Many = Annotated[
    Accepts[_Table | Mapping[str, Any] | Sequence[_Table | Mapping[str, Any]], tuple[_Table, ...]],
    BeforeValidator(listed),
]
_NO_TABLE: Any = None
_NO_TABLES: Any = ()
# Keys that are not effects but fields of a statement.
_SETTINGS = (
    "title",
    "incomplete",
    "general_contact",
    "element",
    "load_steps",
    "solver",
    "accuracy",
    "units",
)


def _may_be_remade(mesh: OneMesh | None) -> bool:
    """Return whether the mesh may be made with other cell sizes; for most generators only their
    modules can tell.
    """
    return (
        mesh.generator not in WITHOUT_ARCS
        if isinstance(mesh, MeshGenerator)
        else getattr(mesh, "drawn", False)
    )


@with_every_effect
class Scene(Table):
    """An elastic body, its loads, its supports and its contact with a rigid foundation.

    Attributes:
        title: any text.
        incomplete: missing parts of the intended model, for example those that a draft from another
            program's deck has lost; results say so until it is removed; default: nothing.
        mesh: a generator with its parameters, a file, or a ``TaggedMesh``, which sets the dimension
            of the scene; None: each ``body`` has its own.
        body: several bodies in place of ``mesh``; default: none.
        element: degree and volumetric integration; default: degree 1, full.
        material: one for the body, or one for each named region.
        displacement: prescribed displacements, lengths; default: none.
        traction: tractions and pressures, forces per area; default: none.
        body_force: force per volume; default: none.
        contact: contact with a rigid foundation, one entry for each boundary; default: none.
        general_contact: contact of all bodies that are near each other, see ``GeneralContact``;
            None: only that of ``contact``.
        fluid: pressures of fluids at rest, see ``Fluid``; default: none.
        force: total forces, each spread over a boundary, see ``Force``; default: none.
        gravity: accelerations, see ``Gravity``; default: none.
        heat: temperatures, fluxes, films and sources, see ``Heat``; default: none.
        initial_temperature: see ``InitialTemperature``; default: the temperature without strain.
        inertia: inertia of all bodies, with the time step, see ``Inertia``; default: none.
        initial_velocity: velocities at the first time, see ``InitialVelocity``; default: none.
        point_force: forces at nodes, see ``PointForce``; default: none.
        preload: tightened sections of bolts, see ``Preload``; default: none.
        rotation: centrifugal forces of steady rotations, see ``Rotation``; default: none.
        springs: springs between boundaries and the ground, see ``Springs``; default: none.
        temperature: changes of temperature, see ``Temperature``; default: none.
        load_steps: names and times of load steps, and an automatic ramp; default: one load step per
            factor.
        solver: algorithms, their parameters and limits.
        accuracy: the accuracy to reach by refinement; None: no refinement.
        units: names of units for labels.

    Examples:
        >>> cubic = sfx.Scene(
        ...     mesh=cube,
        ...     material=steel,
        ...     displacement=[left, sfx.Displacement(boundary="front", y=0.0)],
        ...     traction=sfx.Traction(boundary="top", pressure=2.0),
        ...     contact=sfx.Contact(boundary="bottom"),
        ... )
        >>> print(np.round(sfx.solve(cubic).contact.forces[0], 6))
        [0. 0. 6.]
    """

    title: str = ""
    incomplete: Entries[str] = ()
    mesh: Maybe[OneMesh] = _NO_TABLE
    body: Many[Body] = _NO_TABLES
    element: One[Element] = cast("Any", Element())
    material: Many[MaterialEntry]
    displacement: Many[Displacement] = _NO_TABLES
    traction: Many[loads.Traction] = _NO_TABLES
    body_force: Maybe[loads.BodyForce] = _NO_TABLE
    contact: Many[Contact] = _NO_TABLES
    general_contact: Maybe[GeneralContact] = _NO_TABLE
    fluid: Many[loads.Fluid] = _NO_TABLES
    force: Many[loads.Force] = _NO_TABLES
    gravity: Many[loads.Gravity] = _NO_TABLES
    point_force: Many[loads.PointForce] = _NO_TABLES
    preload: Many[loads.Preload] = _NO_TABLES
    rotation: Many[loads.Rotation] = _NO_TABLES
    springs: Many[loads.Springs] = _NO_TABLES
    temperature: Many[loads.Temperature] = _NO_TABLES
    load_steps: One[LoadSteps] = cast("Any", LoadSteps())
    solver: One[SolverSettings] = cast("Any", SolverSettings())
    accuracy: Maybe[Accuracy] = _NO_TABLE
    units: One[Units] = cast("Any", Units())

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if problems := list(self._contradictions(self.statement)):
            raise refused("Scene", problems)
        return self

    def _contradictions(self, stated: Statement) -> Iterator[tuple[tuple[str | int, ...], str]]:
        """Yield contradictions between entries that are each valid: the path of the later one, and
        the reason.
        """
        regions = [material.region for material in self.material]
        if (
            not regions
            or len(set(regions)) < len(regions)
            or (None in regions and len(regions) > 1)
        ):
            yield (
                ("material",),
                "give one material, or several, each with the name of its own region",
            )
        for entries in stated.effects.values():
            for number, effect in enumerate(entries):
                yield from effect.contradictions(stated, number)
        yield from refused_features(stated)
        if (self.mesh is None) != bool(self.body):
            if self.mesh is None:
                yield (), "mesh is missing: a table with file or generator is expected"
            else:
                yield ("mesh",), "leave it out: each [[body]] has its own"
        names = [body.name for body in self.body]
        for number, name in enumerate(names):
            if name in names[:number]:
                yield ("body", number, "name"), f"two bodies are called {name!r}"
        if len({len(load.factors) for load in stated.loads if load.factors is not None}) > 1:
            counts = [
                f"{path} has {len(load.factors)}"
                for path, load in stated.listed()
                if getattr(load, "factors", None)
            ]
            yield (), f"the lists of factors differ in length: {', '.join(counts)}"
            return  # the number of load steps is unknown
        if stated.load_steps.jump != 1 and not any(
            part.adds_up for contact in stated.contact for part in contact.parts
        ):
            yield ("load_steps", "jump"), "is for contact that wears: nothing here adds up"
        if (times := stated.load_steps.times) is not None and len(times) != stated.steps:
            wanted = f"one for each of {stated.steps} load steps is expected"
            yield ("load_steps", "times"), f"has {len(times)} entries, {wanted}"
            return
        try:
            _ = stated.path  # it checks its times and names
        except FormError as error:
            yield from ((("load_steps", key), reason) for key, reason in error.problems)

    @property
    def meshes(self) -> list[Any]:
        """The sources of the meshes, one for each body."""
        return [body.mesh for body in self.body] or [self.mesh]

    def with_meshes(self, meshes: Iterable[Any]) -> Self:
        """Return the scene with other sources of its meshes, one for each body."""
        if not self.body:
            return self.model_copy(update={"mesh": next(iter(meshes))})
        bodies = zip(self.body, meshes, strict=True)
        return self.model_copy(
            update={"body": tuple(body.model_copy(update={"mesh": mesh}) for body, mesh in bodies)}
        )

    @cached_property
    def statement(self) -> Statement:
        """The entries without the mesh, in the form that solvers and checks use."""
        fields = type(self).model_fields
        origin = ("mesh", "body")
        given = {key: getattr(self, key) for key in fields if key not in (*origin, *_SETTINGS)}
        effects = {
            key: entries if isinstance(entries, tuple) else () if entries is None else (entries,)
            for key, entries in given.items()
        }
        kinematics = of_materials(
            (material.hypothesis, material.torsion) for material in self.material
        )
        if kinematics.axis is not None:
            effects["rotation"] = tuple(
                entry.model_copy(update={"axis": kinematics.axis}) if entry.axis is None else entry
                for entry in effects["rotation"]
            )
        load_steps, cycles = self.load_steps.repeated(_count(effects, self.load_steps))
        if cycles > 1:
            effects = {
                key: tuple(_repeated(entry, cycles) for entry in entries)
                for key, entries in effects.items()
            }
        meshes = self.meshes
        return Statement(
            title=self.title,
            incomplete=self.incomplete,
            effects=effects,
            kinematics=kinematics,
            element=self.element,
            load_steps=load_steps,
            steps=_count(effects, load_steps),
            solver=self.solver,
            accuracy=self.accuracy,
            units=self.units,
            bodies=tuple(body.name for body in self.body),
            generated=all(isinstance(mesh, MeshGenerator) for mesh in meshes),
            remade=all(_may_be_remade(mesh) for mesh in meshes),
            arcs=not all(getattr(mesh, "generator", None) in WITHOUT_ARCS for mesh in meshes),
            single=frozenset(
                key for key in effects if get_origin(fields[key].annotation) is not tuple
            ),
            origin={key: getattr(self, key) for key in origin},
        )


def _repeated(entry: Any, times: int) -> Any:
    """Return an entry whose lists for one cycle are repeated."""
    lists = {
        key: tuple(given) * times
        for key in ("factors", "holds")
        if (given := getattr(entry, key, None)) is not None
    }
    return entry.model_copy(update=lists) if lists else entry


def _count(effects: Mapping[str, tuple[Any, ...]], load_steps: LoadSteps) -> int:
    """Return the number of factors of each load.

    Without factors it is the number of times, if anything depends on the time, otherwise the
    largest number of ``holds``, otherwise one.
    """
    entries = [entry for several in effects.values() for entry in several]
    loads = [entry for entry in entries if isinstance(entry, Load)]
    times = load_steps.times
    lasting = (*loads, *effects["contact"], *effects.get("inertia", ()))
    timed = times is not None and any(entry.timed for entry in lasting)
    driven = [contact.driven for contact in effects["contact"]] if times is not None else []
    timed |= any(body.motion.driven_in_time for body in rigid_bodies(driven, [""] * len(driven)))
    count = len(times or ()) if timed else 1
    holds = (entry.holds for entry in effects.get("displacement", ()))
    count = (
        max((len(entries) for entries in holds if entries is not None), default=count)
        if count == 1
        else count
    )
    return max((len(load.factors) for load in loads if load.factors is not None), default=count)
