"""Sources of meshes: a generator, a file, or the caller; several bodies with their own meshes; and
prescribed lengths of the facets of boundaries in contact.  This module does not use dolfinx.
"""

from __future__ import annotations

import inspect
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

from pydantic import (
    BeforeValidator,
    Field,
    InstanceOf,
    TypeAdapter,
    ValidationError,
    field_validator,
)

from signorini_fx.errors import SceneError
from signorini_fx.extensions import GENERATORS, load, names_of
from signorini_fx.mechanics.statement.base import JOIN, Table, TaggedMeshBase, plain_message
from signorini_fx.mechanics.statement.rigid_shape import Placed
from signorini_fx.mechanics.statement.values import (
    Accepts,
    Finite,
    Positive,
    Selection,
    Vector,
    kind_of,
)

# Files that gmsh meshes: its scripts, and CAD drawings.
DRAWN = (".geo", ".step", ".stp", ".brep")
MESH_FORMATS = (*DRAWN, ".inp", ".med", ".msh", ".vtu", ".xdmf")
# Programs whose meshes are taken as they are in memory, by the modules of their classes.
_PROGRAMS = ("gmsh", "meshio", "pyvista")
# The generators of bodies without arcs.
WITHOUT_ARCS = ("rectangle", "block", "box", "wedge")


class MeshFile(Table):
    """A mesh from a file, with the names that the file gives to its boundaries and regions, or that
    are given here.

    Attributes:
        file: .msh or .geo of gmsh, .step, .stp or .brep of a CAD program, .inp, .med, .vtu or
            .xdmf.
        boundaries: names for boundaries: a number in the cell data, a list of numbers, or a
            condition at all vertices of exterior facets.
        regions: names for parts of the body: a number, a list of numbers, or a condition at all
            vertices of cells.
        data: the cell data that the numbers refer to; None: there is only one.
        size: length of the cells of a .step, .stp or .brep; None: a fraction of the size of the
            body.

    Examples:
        >>> names = {"sole": 5, "head": "x[2] > 31.9"}
        >>> part = sfx.MeshFile(file="part.step", size=2.0, boundaries=names)
        >>> print(part.file.suffix, part.size)
        .step 2.0
    """

    file: Accepts[str | Path, Path]
    boundaries: Mapping[str, Selection] = Field(default={})
    regions: Mapping[str, Selection] = Field(default={})
    data: str | None = None
    size: Positive | None = None

    @property
    def drawn(self) -> bool:
        """Whether gmsh makes the cells, from a script or a CAD drawing."""
        return self.file.suffix.lower() in DRAWN


class MeshGenerator(Table):
    """A mesh from one of the generators in ``meshes/``.

    Attributes:
        generator: its name.
        parameters: its keyword arguments; default: none.

    Examples:
        >>> mesh = sfx.MeshGenerator(generator="box", parameters={"nx": 3, "ny": 3, "nz": 3})
        >>> print(mesh.generator, mesh.parameters["nx"])
        box 3
    """

    generator: str
    parameters: Mapping[str, float | int | str | bool] = Field(default={})

    def _generate(self) -> Generate:
        return found_generator(self.generator, self.parameters)[0]

    @property
    def sized(self) -> bool:
        """Whether the generator can grade its cells, so that it accepts prescribed lengths."""
        return bool(getattr(self._generate(), "sized", False))

    @property
    def cells(self) -> tuple[str, ...]:
        """The kinds of cells that the generator can make, the present one first; empty if it has no
        such parameter.
        """
        accepted = inspect.signature(generate := self._generate()).parameters
        own = self.parameters.get("cell", accepted["cell"].default) if "cell" in accepted else None
        return (
            ()
            if own is None
            else (str(own), *(cell for cell in get_args(types_of(generate)["cell"]) if cell != own))
        )

    @property
    def of_simplices(self) -> MeshGenerator | None:
        """Return the same generator with triangles or tetrahedra, which can be bisected; None if
        there is none.
        """
        cell = getattr(self._generate(), "simplices", None)
        return None if cell is None else self.having(cell=cell)

    @property
    def curved(self) -> MeshGenerator | None:
        """Return the same generator with cells of degree 2 on arcs; None if it has no arcs."""
        return (
            self.having(order=2)
            if "order" in inspect.signature(self._generate()).parameters
            else None
        )

    def having(self, **parameters: float | str) -> MeshGenerator:
        """Return the generator with changed parameters."""
        return self.model_copy(update={"parameters": {**self.parameters, **parameters}})

    def coarser(self, factor: float) -> MeshGenerator:
        """Return the generator with elements ``factor`` times as large.

        Raises:
            SceneError: the generator does not support it.
        """
        coarser = getattr(self._generate(), "coarser", None)
        if coarser is None:
            message = f"the generator {self.generator!r} makes no coarser meshes: use levels = 1"
            raise SceneError.at("solver.levels", message)
        return self.model_copy(update={"parameters": coarser(self.parameters, factor)})

    def coarsest(self, factor: float) -> float:
        """Return the largest power of 2, up to ``factor``, by which elements can be coarsened such
        that halving restores them.
        """
        if getattr(self._generate(), "coarser", None) is None:
            return 1.0
        while factor > 1 and self.coarser(factor).coarser(1 / factor) != self.coarser(1.0):
            factor /= 2
        return factor


@dataclass(frozen=True, eq=False)
class MeshInMemory(TaggedMeshBase):
    """A mesh that another program has in memory: gmsh.model, a mesh of meshio, or a grid of
    PyVista.
    """

    source: Any

    @property
    def program(self) -> str:
        """The name of the program; empty if its meshes are not supported."""
        module = getattr(self.source, "__module__", None) or ""
        first = module.partition(".")[0]
        return first if first in _PROGRAMS else ""


def one_mesh(entry: object) -> MeshFile | MeshGenerator | TaggedMeshBase:
    """Return the source of a mesh from an entry; its keys determine the kind, so that errors refer
    to the intended kind.

    Raises:
        ValueError: the entry is no source of a mesh.
    """
    if isinstance(entry, Mapping):
        if ("file" in entry) == ("generator" in entry):
            raise ValueError("give either file or generator")
        if "generator" in entry and {"boundaries", "regions"} & entry.keys():
            raise ValueError(
                "boundaries and regions belong to file: a generator names its own (meshes.md)"
            )
        return (MeshFile if "file" in entry else MeshGenerator).model_validate(entry)
    if not isinstance(entry, MeshFile | MeshGenerator | TaggedMeshBase):
        held = MeshInMemory(entry)
        if held.program:
            return held
        wanted = (
            "a table with file or generator, or a mesh with named boundaries, see tag_boundaries,"
        )
        raise ValueError(f"{wanted} is expected, not {kind_of(entry)}")
    return entry


OneMesh = Annotated[
    MeshGenerator | MeshFile | InstanceOf[TaggedMeshBase], BeforeValidator(one_mesh)
]


class Body(Placed):
    """A body with a mesh of its own, which is rotated and then shifted to its place.

    Attributes:
        name: of the region of all of its cells; with a dot it stands before the names of its
            boundaries and regions.
        mesh: a generator with its parameters, a file, or a ``TaggedMesh``.
        shift: by which it is moved, lengths; None: not at all.
        rotation: by which it is turned, degrees, counterclockwise; in 3D about the axis [a, b, c]
            by the length of this vector; None: not at all.
        pivot: the point that it is turned about, length; None: the origin.

    Examples:
        >>> mesh = sfx.MeshGenerator(generator="rectangle", parameters={"nx": 8, "ny": 4})
        >>> upper = sfx.Body(name="upper", mesh=mesh, shift=[0.0, 1.0])
        >>> print(upper.name, upper.shift[1])
        upper 1.0
    """

    name: str
    mesh: OneMesh
    shift: Vector | None = None
    rotation: Annotated[tuple[Finite, ...], Field(min_length=3, max_length=3)] | Finite | None = (
        None
    )
    pivot: Vector | None = None

    @field_validator("name")
    @classmethod
    def _plain(cls, name: str) -> str:
        if not name or "." in name or name != name.strip():
            raise ValueError("must be a name without dots")
        return name


@dataclass(frozen=True)
class ContactSize:
    """The length of the facets of one boundary of a mesh."""

    boundary: str  # its name in the mesh
    size: float
    path: str  # the key of the scene that asks for it


def contact_sizes(scene: Any, number: int | None = None) -> tuple[ContactSize, ...]:
    """Return the lengths of contact facets that a scene prescribes for one of its meshes.

    ``number``: the number of the body; None if there is one mesh.
    """
    body = None if number is None else scene.body[number]
    wanted = []
    for index, contact in enumerate(scene.contact):
        if contact.contact_size is not None:
            listed = [contact.boundary, *(contact.against or "").split(JOIN)]
            names = [_in_body(name, body) for name in listed if name]
            path = f"contact[{index}].contact_size"
            wanted += [ContactSize(name, contact.contact_size, path) for name in names if name]
    return tuple(wanted)


def _in_body(name: str, body: Body | None) -> str:
    """Return the name in the mesh of ``body`` of a boundary of the scene; empty for a boundary of
    another body.
    """
    if body is None:
        return name
    first, dot, rest = name.partition(".")
    return name if not dot else rest if first == body.name else ""


def with_larger_contact_sizes(contacts: tuple[Any, ...], factor: float) -> tuple[Any, ...]:
    """Return the contacts with prescribed facet lengths ``factor`` times as large."""
    sizes = (contact.contact_size and factor * contact.contact_size for contact in contacts)
    return tuple(
        c.model_copy(update={"contact_size": size}) for c, size in zip(contacts, sizes, strict=True)
    )


# A generator of meshes, with parameters of its own.
Generate = Callable[..., TaggedMeshBase]
GENERATORS_PACKAGE = "signorini_fx.meshes"  # the package of this one's


def known_generators(name: str | None = None) -> dict[str, Callable[[], Generate]]:
    """Return the loaders of the generators that a scene can name, sorted by name; generators of
    this package take precedence.

    Searching all packages takes milliseconds: if ``name`` is in this package, only its generators
    are returned.
    """
    package = find_spec(GENERATORS_PACKAGE)
    folders = (
        [] if package is None else package.submodule_search_locations
    )  # the generators are an add-on
    own_names = [
        module.name for module in pkgutil.iter_modules(folders) if not module.name.startswith("_")
    ]
    others = () if name in own_names else names_of(GENERATORS)
    generators = {key: partial(load, GENERATORS, key) for key in others}
    generators |= {key: partial(_of_this_package, key) for key in own_names}
    return dict(sorted(generators.items()))


def _of_this_package(name: str) -> Generate:
    return import_module(f"{GENERATORS_PACKAGE}.{name}").generate


def found_generator(name: str, parameters: Mapping[str, Any]) -> tuple[Generate, dict[str, Any]]:
    """Return the generator of this name, and its parameters validated by its annotations.

    Raises:
        SceneError: unknown generator, or invalid parameters.
    """
    generators = known_generators(name)
    if name not in generators:
        message = f"no generator {name!r}; there are: {', '.join(generators) or 'none'}"
        raise SceneError.at("mesh.generator", message)
    try:
        generate = generators[name]()
        types_of(generate)
    except Exception as error:  # of the code of the user
        message = f"{name!r} cannot be imported: {type(error).__name__}: {error}"
        raise SceneError.at("mesh.generator", message) from error
    names = [
        key for key, p in inspect.signature(generate).parameters.items() if p.kind is p.KEYWORD_ONLY
    ]
    values = {}
    problems: list[tuple[str, str]] = []
    for key, value in parameters.items():
        path = f"mesh.parameters.{key}"
        if key not in names:
            problems.append((path, f"unknown key; there are: {', '.join(names)}"))
            continue
        try:
            values[key] = _adapter(generate, key).validate_python(value)
        except ValidationError as error:
            problems += [(path, plain_message(detail)) for detail in error.errors()]
    if problems:
        raise SceneError(problems)
    return generate, values


@cache
def types_of(generate: Generate) -> dict[str, Any]:
    """Return the annotations of a generator."""
    return get_type_hints(generate, include_extras=True)


@cache
def _adapter(generate: Generate, key: str) -> TypeAdapter[Any]:
    """Return the validator of a parameter of a generator; cached, because pydantic takes longer to
    make it than gmsh to make a mesh.
    """
    return TypeAdapter(types_of(generate).get(key, Any))
