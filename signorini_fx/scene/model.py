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
from math import ceil, floor, log10
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    Discriminator,
    Field,
    InstanceOf,
    Tag,
    field_validator,
    model_validator,
)

from signorini_fx.scene.base import Table, refused
from signorini_fx.scene.load_steps import LoadSteps, factor_at
from signorini_fx.scene.settings import Accuracy, SolverSettings
from signorini_fx.scene.values import (
    Finite,
    NonNegativeValue,
    Positive,
    SampledValue,
    Selection,
    Value,
    kind_of,
    shown,
)


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
            form.
    """

    degree: Annotated[int, Field(ge=1, le=2, strict=True)] = 1
    volumetric: Literal["full", "reduced", "auto"] = "full"


class LinearElastic(Table):
    """Isotropic linear elasticity.

    Attributes:
        young: Young's modulus E > 0, stress.
        poisson: Poisson's ratio nu in (-1, 0.5).
        hypothesis: plane strain or plane stress, if the mesh has two dimensions.
        region: name of the part of the body that is made of this material; None: all of it.
    """

    young: Positive
    poisson: Annotated[float, Field(gt=-1, lt=0.5, allow_inf_nan=False, strict=True)]
    hypothesis: Literal["plane strain", "plane stress"] = "plane strain"
    region: str | None = None


class _Load(Table):
    """Loads that load steps multiply by a factor."""

    factors: Annotated[tuple[Finite, ...], Field(min_length=1)] | None = None


class _Vector(_Load):
    """Loads with components along x[0], x[1] and, in space, x[2]."""

    x: Value = 0.0
    y: Value = 0.0
    z: Value = 0.0

    @property
    def components(self) -> tuple[Any, Any, Any]:
        """Along x[0], x[1] and x[2], which is not used in the plane; None where a displacement is free."""
        return self.x, self.y, self.z


class BodyForce(_Vector):
    """Force per volume, f of (1.1a).

    Attributes:
        x: component along x[0], stress / length.
        y: component along x[1], stress / length.
        z: component along x[2], stress / length; only in space.
        factors: one number per load step; None: 1 in every step.
        live: whether the safety factor multiplies it, as it does tractions.
    """

    live: bool = False


class SurfaceTraction(_Vector):
    """Traction on a boundary, h of (1.1c); it adds to others on the same boundary.

    Attributes:
        boundary: its name.
        x: component along x[0], stress.
        y: component along x[1], stress.
        z: component along x[2], stress; only in space.
        pressure: pressure on the boundary, which acts along the inward normal, stress.
        factors: one number per load step; None: 1 in every step.
        live: whether the safety factor multiplies it; a preload is not live.
    """

    boundary: str
    pressure: Value = 0.0
    live: bool = True


class PrescribedDisplacement(_Vector):
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


class NoFriction(Table):
    """Frictionless contact.

    Attributes:
        law: its name.
    """

    law: Literal["none"] = "none"


class TrescaFriction(Table):
    """Tresca friction: |mu| <= bound (2.3d').

    Attributes:
        law: its name.
        bound: largest shear, stress.
    """

    law: Literal["tresca"] = "tresca"
    bound: NonNegativeValue


class CoulombFriction(Table):
    """Coulomb friction: |mu| <= min(coefficient * lambda, cap), (1.1e) and (1.1f).

    Attributes:
        law: its name.
        coefficient: F, without unit.
        cap: largest shear that the contact can transmit, stress; None: no such limit.
    """

    law: Literal["coulomb"] = "coulomb"
    coefficient: NonNegativeValue
    cap: NonNegativeValue | None = None


Friction = NoFriction | TrescaFriction | CoulombFriction


class _Contact(Table):
    """Contact of a boundary with a rigid foundation."""

    boundary: str
    gap: SampledValue = 0.0
    direction: Annotated[tuple[Finite, ...], Field(min_length=2, max_length=3)] | None = None
    friction: Annotated[Friction, Field(discriminator="law")] = NoFriction()

    @field_validator("direction")
    @classmethod
    def _not_zero(cls, given: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if given is not None and not any(given):
            raise ValueError("must not be zero")
        return given


class UnilateralContact(_Contact):
    """Signorini contact (1.1d): the boundary may leave the foundation, but not enter it.

    Attributes:
        boundary: name of the boundary where contact may occur.
        gap: distance d to the foundation along ``direction``, a length; negative: initial penetration.
        direction: from the body to the foundation, any length; None: the outward normal of the body.
        friction: the friction law.
        kind: its name.
    """

    kind: Literal["unilateral"] = "unilateral"


class BilateralContact(_Contact):
    """Contact that cannot open: tau_N y = d; only the friction is unknown.

    Attributes:
        boundary: name of the boundary where contact may occur.
        gap: distance d to the foundation along ``direction``, a length; negative: initial penetration.
        direction: from the body to the foundation, any length; None: the outward normal of the body.
        friction: the friction law.
        kind: its name.
    """

    kind: Literal["bilateral"]


Contact = UnilateralContact | BilateralContact


def _contact_kind(given: Any) -> str:
    """Contact is unilateral unless specified otherwise."""
    kind = given.get("kind", "unilateral") if isinstance(given, Mapping) else getattr(given, "kind", "unilateral")
    return kind if isinstance(kind, str) else shown(kind)


class TaggedMeshBase:
    """The base class of ``mesh.TaggedMesh``, so that a scene can hold one without importing dolfinx."""


def _one_or_many(given: Any) -> Any:
    return [given] if isinstance(given, Mapping | BaseModel) else given


class Scene(Table):
    """An elastic body, its loads, its supports and its contact with a rigid foundation.

    Attributes:
        title: any text.
        mesh: a generator with its parameters, a file, or a ``TaggedMesh``; its dimension is that of the scene.
        element: degree and volumetric integration; default: degree 1, full.
        material: one for the body, or one for each named region.
        displacement: prescribed displacements, lengths; default: none.
        traction: tractions and pressures, forces per area; default: none.
        body_force: force per volume; default: none.
        contact: contact with a rigid foundation, one entry for each boundary; default: none.
        load_steps: names and times of load steps, and an automatic ramp; default: one load step per factor.
        solver: algorithms, their parameters and limits.
        accuracy: the accuracy to be reached by refinement; None: no refinement.
    """

    title: str = ""
    mesh: MeshGenerator | MeshFile | InstanceOf[TaggedMeshBase]
    element: Discretised = Discretised()
    material: tuple[LinearElastic, ...]
    displacement: tuple[PrescribedDisplacement, ...] = ()
    traction: tuple[SurfaceTraction, ...] = ()
    body_force: BodyForce | None = None
    contact: tuple[
        Annotated[
            Annotated[UnilateralContact, Tag("unilateral")] | Annotated[BilateralContact, Tag("bilateral")],
            Discriminator(_contact_kind),
        ],
        ...,
    ] = ()
    load_steps: LoadSteps = LoadSteps()
    solver: SolverSettings = SolverSettings()
    accuracy: Accuracy | None = None

    _lists = field_validator("material", "displacement", "traction", "contact", mode="before")(_one_or_many)

    @field_validator("mesh", mode="before")
    @classmethod
    def _one_mesh(cls, given: Any) -> Any:
        """Decide by the key, so that errors are reported for the kind of mesh that was meant."""
        if isinstance(given, Mapping):
            if ("file" in given) == ("generator" in given):
                raise ValueError("give either file or generator")
            return (MeshFile if "file" in given else MeshGenerator).model_validate(given)
        if not isinstance(given, MeshFile | MeshGenerator | TaggedMeshBase):
            message = "a table with file or generator is expected"
            if isinstance(given, str | Path):
                message += f": for a mesh file write MeshFile(file={str(given)!r}), in TOML [mesh] with file = ..."
            elif hasattr(given, "topology"):
                message += ", or a mesh with named boundaries: tag_boundaries(mesh, {name: rule, ...}) makes one"
            else:
                message += f", not {kind_of(given)}"
            raise ValueError(message)
        return given

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if problems := list(self._contradictions()):
            raise refused("Scene", problems)
        return self

    def _contradictions(self) -> Iterator[tuple[tuple[str | int, ...], str]]:
        """Entries that do not go together, each alone fine: the place of the later one, and why."""
        names = [effect.boundary for effect in self.contact]
        for place, name in enumerate(names):
            if name in names[:place]:
                yield ("contact", place), f"boundary {name!r} is in contact twice: describe it in one [[contact]]"
        for place, effect in enumerate(self.displacement):
            if effect.boundary in names and (effect.normal is not None or None not in effect.components):
                yield ("displacement", place), f"{effect.boundary!r} is prescribed, and in contact as well: choose one"
        regions = [material.region for material in self.material]
        if not regions or len(set(regions)) < len(regions) or (None in regions and len(regions) > 1):
            yield ("material",), "give one material, or several, each with the name of its own region"
        for place, material in enumerate(self.material):
            if material.hypothesis != self.material[0].hypothesis:
                yield ("material", place), "all materials must have the same hypothesis"
        if self.solver.levels > 1 and not isinstance(self.mesh, MeshGenerator):
            yield ("solver", "levels"), "needs a mesh from a generator, which can make the coarser ones"
        if self.accuracy is not None and not self.contact:
            yield ("accuracy",), "needs a scene with contact"
        if len({len(load.factors) for load in self.loads if load.factors is not None}) > 1:
            lists = {"displacement": self.displacement, "traction": self.traction}
            places = [(f"{name}[{k}]", load) for name, loads in lists.items() for k, load in enumerate(loads)]
            given = [*places, ("body_force", self.body_force)]
            said = [f"{place} has {len(load.factors)}" for place, load in given if load is not None and load.factors]
            yield (), f"the lists of factors differ in length: {', '.join(said)}"
            return  # how many load steps there are is not known
        for name in ("names", "times"):
            entries = getattr(self.load_steps, name)
            if entries is not None and len(entries) != self.steps:
                wanted = f"one for each of {self.steps} factors is expected"
                yield ("load_steps", name), f"has {len(entries)} entries, {wanted}"
        if self.grows_from_nothing and self.time_at(0) <= 0:
            yield ("load_steps", "times"), "must be positive: without factors the loads begin to grow at time 0"

    @property
    def loads(self) -> tuple[BodyForce | SurfaceTraction | PrescribedDisplacement, ...]:
        """All loads that load steps multiply."""
        return (*self.displacement, *self.traction, *([self.body_force] if self.body_force is not None else []))

    @property
    def steps(self) -> int:
        """Number of factors of each load; that of the load steps, unless there is a ramp between them."""
        return max((len(load.factors) for load in self.loads if load.factors is not None), default=1)

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
        return self.automatic_steps if self.grows_from_nothing else 1 + (self.steps - 1) * self.automatic_steps

    @property
    def several_steps(self) -> bool:
        """Whether there may be more than one load step."""
        return self.steps > 1 or self.automatic_steps is not None

    def factors_of(self, load: BodyForce | SurfaceTraction | PrescribedDisplacement) -> tuple[float, ...]:
        """The factors of a load."""
        return load.factors or (1.0,) * self.steps

    def time_at(self, place: float) -> float:
        """The time of a place in the lists of factors, see ``scene.load_steps``."""
        times = self.load_steps.times or tuple(map(float, range(1, self.steps + 1)))
        time = factor_at(times, place)
        if place == int(place):
            return time
        # Places have twelve digits: thirds that add up leave the last two uncertain.
        span = times[-1] - min(times[0], 0.0)
        return round(time, 10 - floor(log10(span)) if span > 0 else 10)

    def name_at(self, place: float) -> str:
        """The name of the load step that a place belongs to or that a ramp leads to; "" without names."""
        return self.load_steps.names[ceil(place)] if self.load_steps.names else ""

    @property
    def young(self) -> float:
        """Young's modulus of the stiffest material, the natural unit of stress."""
        return max(material.young for material in self.material)

    @property
    def has_friction(self) -> bool:
        """Whether any contact boundary has a friction law that can act; a law with bound or coefficient 0 cannot."""
        return any(friction_acts(effect.friction) for effect in self.contact)

    @property
    def has_coulomb(self) -> bool:
        """Whether any friction bound depends on the contact pressure."""
        return any(isinstance(e.friction, CoulombFriction) and friction_acts(e.friction) for e in self.contact)


def friction_acts(friction: Friction) -> bool:
    """Whether a law can transmit shear: F = 0 or g = 0 is frictionless contact and treated as such."""
    if isinstance(friction, TrescaFriction):
        return friction.bound != 0.0
    return isinstance(friction, CoulombFriction) and friction.coefficient != 0.0 and friction.cap != 0.0
