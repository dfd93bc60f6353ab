"""The arguments of a ``ContactProblem``, checked: forms, stress, materials, contact with its
facets, and the same as a named statement with boundaries and contact entries like those of a scene.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypedDict, Unpack, get_args

import basix
import numpy as np
import ufl
from dolfinx import default_scalar_type, fem, la
from dolfinx import mesh as dmesh
from pydantic import BaseModel

from signorini_fx.arrays import Indices
from signorini_fx.errors import FormError, SceneError
from signorini_fx.extensions import CONTACT_PARTS, load_class, names_of
from signorini_fx.machine import compat, parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.interfaces import Facets, Foundation, Pair
from signorini_fx.mechanics.kinematics import of_components
from signorini_fx.mechanics.laws.coulomb import NoFriction
from signorini_fx.mechanics.laws.protocol import FrictionLaw
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, is_section, outer_facets, tagged_mesh
from signorini_fx.mechanics.statement.effect import ContactPart
from signorini_fx.mechanics.statement.load_path import LoadSteps
from signorini_fx.mechanics.statement.settings import Element, SolverSettings
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.mechanics.statement.values import kind_of

if TYPE_CHECKING:
    from ufl.core.expr import Expr

UflOrCompiled: TypeAlias = "ufl.Form | fem.Form"
Law: TypeAlias = "Callable[[Expr], Expr]"  # the stress as a function of the displacement
Energy: TypeAlias = (
    "Callable[[Expr, Expr], Expr]"  # an energy density as a function of two displacements
)
Density: TypeAlias = "float | Expr | ufl.Form | None"
SettingValue = str | float | None
PetscOptions = Mapping[str, str | float | None]
CompilerOptions = dict[str, str | float | Path | list[str]] | None


class FormOptions(TypedDict, total=False):
    """Options for the compilation of forms."""

    form_compiler_options: CompilerOptions
    jit_options: CompilerOptions


@dataclass(frozen=True)
class GivenForms:
    """The arguments of a ``ContactProblem`` that never change, checked and compiled."""

    space: fem.FunctionSpace  # the space of the displacement
    original: tuple[UflOrCompiled | None, UflOrCompiled]  # a and L as the user gave them
    compiled: tuple[fem.Form, fem.Form]  # compiled a and L
    stress: Law | None  # the stress as a function of the displacement; None: not given
    parts: Sequence[Indices]  # the cells of each material
    contact: tuple[Foundation | Pair, ...]
    facets: Sequence[Indices]  # facets of each contact
    masters: Mapping[int, Indices]  # facets of the other side of each pair, by contact number
    boundaries: Mapping[str, Indices]  # facets of each named part of the boundary

    @property
    def mesh(self) -> dmesh.Mesh:
        """The mesh of the body."""
        return self.space.mesh

    @property
    def measures(self) -> set[Expr]:
        """The measures that multiply contacts, which error estimates do not account for."""
        return {getattr(contact, "measure", None) for contact in self.contact} - {None}


def given_forms(
    a: UflOrCompiled,
    L: UflOrCompiled,
    contact: Foundation | Pair | Iterable[Foundation | Pair] | None,
    u: fem.Function | None,
    *,
    stress: Expr | Law | None = None,
    materials: dmesh.MeshTags | None = None,
    boundaries: Mapping[str, Facets] | None = None,
    **compiler_options: Unpack[FormOptions],
) -> tuple[GivenForms, fem.Function]:
    """Return the checked and compiled arguments of a ``ContactProblem``, and the Function for its
    solution; collective.
    """
    space = space_of(a, L, u)
    entries = foundations_of(contact)
    facets, masters = facets_of(entries, space.mesh)
    with compiling():
        compiled = [
            form if isinstance(form, fem.Form) else fem.form(form, **compiler_options)
            for form in (a, L)
        ]
    solution = fem.Function(space, name="displacement") if u is None else u
    forms = GivenForms(
        space,
        (a, L),
        (compiled[0], compiled[1]),
        law_of(stress, solution),
        parts_of(materials, space.mesh),
        entries,
        facets,
        masters,
        boundaries_of(boundaries, space.mesh),
    )
    return forms, solution


def named_parts(
    forms: GivenForms, settings: SolverSettings, arguments: Sequence[str] = ()
) -> tuple[Statement, TaggedMesh]:
    """Return the statement and the tagged mesh of forms; collective.

    The statement has the contact and the settings with a single load step and does not depend on
    Constants. A contact, or the other side of a pair, is named after the boundary part with the
    same facets, otherwise by its number.

    Args:
        forms: the forms.
        settings: settings of the solver.
        arguments: names of the arguments that state the body; empty: those of the forms given.
    """

    def name(part: Indices, otherwise: str) -> str:
        for known, facets in forms.boundaries.items():
            if not parallel.any_rank(forms.mesh.comm, not np.array_equal(facets, part)):
                return known
        return otherwise

    names = [name(part, f"contact {k}") for k, part in enumerate(forms.facets)]
    opposite = {k: name(part, f"other side of contact {k}") for k, part in forms.masters.items()}
    parts = {**forms.boundaries, **dict(zip(names, forms.facets, strict=True))}
    parts |= {name: forms.masters[k] for k, name in opposite.items()}
    contact = list[Contact]()
    for k, (entry, part) in enumerate(zip(forms.contact, names, strict=True)):
        described: dict[str, Any] = {
            "boundary": part,
            "friction": entry.friction or NoFriction(),
            "kind": entry.kind,
            "gap": float(entry.gap) if isinstance(entry.gap, int | float) else entry.gap,
        }
        if isinstance(entry, Pair):
            described |= {"distance": entry.distance, "adjust": entry.adjust}
            described["against"] = opposite[k]
        else:
            shape = entry.shape if isinstance(entry.shape, BaseModel) else None
            described |= {"direction": entry.direction, "foundation": shape}
        described |= {part.key: part for part in entry.parts}
        contact.append(Contact.model_construct(**described))
    listed = [
        "a",
        "L",
        *(["stress"] * (forms.stress is not None)),
        *(["materials"] * (len(forms.parts) > 1)),
    ]
    tagged = tagged_mesh(forms.mesh, parts)
    statement = Statement(
        title="",
        effects={"contact": tuple(contact)},
        kinematics=of_components(tagged.dimension, forms.mesh.geometry.dim),
        element=Element(degree=int(forms.space.element.basix_element.degree)),
        load_steps=LoadSteps(),
        steps=1,
        solver=settings,
        origin={"forms": tuple(arguments or listed), "mesh": tagged},
    )
    return statement, tagged


_NOT_A_SETTING = "is no setting of a contact problem"
# Settings that only scenes have (meshes, first load step), and arguments of dolfinx's own problem
# classes.
_NOT_HERE = {
    "levels": _NOT_A_SETTING,
    "initial_contact": _NOT_A_SETTING,
    "solver": "is no argument: give each setting by its name, such as tolerance=1e-8",
    "P": "is not used: the preconditioner follows from linear_algebra",
    "kind": "is not used: the kind of the matrix follows from linear_algebra",
    "entity_maps": "is not possible yet: all arguments are on one mesh",
}


def law_of(stress: Expr | Law | None, u: fem.Function) -> Law | None:
    """Return the given stress as a function of the displacement, or None if there is none."""
    if stress is not None and is_section(u.function_space.mesh):
        raise FormError.at(
            "stress", "stresses and their estimates are not possible yet on a plane mesh in 3D"
        )
    if stress is None or (callable(stress) and not hasattr(stress, "ufl_shape")):
        return stress
    return lambda y: ufl.replace(
        stress, {u: y, **dict.fromkeys(ufl.algorithms.extract_arguments(stress), y)}
    )


def space_of(a: UflOrCompiled, L: UflOrCompiled, u: fem.Function | None) -> fem.FunctionSpace:
    """Return the space of the displacements, which all arguments of the forms must share."""
    if np.issubdtype(default_scalar_type, np.complexfloating):
        raise FormError.at("a", "PETSc is built for complex numbers; contact needs a real build")
    if not isinstance(u, fem.Function | None):
        raise FormError.at("u", f"must be a Function, not {kind_of(u)}")
    spaces: list[tuple[str, fem.FunctionSpace]] = []
    for name, form, rank in (("a", a, 2), ("L", L, 1)):
        if not isinstance(form, ufl.Form | fem.Form):
            raise FormError.at(name, f"must be a UFL form or a compiled form, not {kind_of(form)}")
        if isinstance(form, fem.Form):
            of_form = form.function_spaces
        elif arguments := form.arguments():
            of_form = [one.ufl_function_space() for one in arguments]
        else:
            raise FormError.at(name, "the form is identically zero")
        if len(of_form) != rank:
            raise FormError.at(
                name, f"must have {rank} argument{'s' * (rank > 1)}, not {len(of_form)}"
            )
        spaces += [(name, space) for space in of_form]
    known = [space for _, space in spaces if isinstance(space, fem.FunctionSpace)]
    if u is not None:
        known.insert(0, u.function_space)
    elif not known:
        raise FormError.at(
            "u", "must be given where both forms are compiled: their space is that of this Function"
        )
    space = supported(known[0], "a")
    for name, candidate in spaces:
        inner = compat.wrapped(candidate) if isinstance(candidate, fem.FunctionSpace) else candidate
        if inner != compat.wrapped(space):
            raise FormError.at(
                name,
                "its arguments are on another space than those of a" + " or u" * (u is not None),
            )
    return space


def supported(space: fem.FunctionSpace, name: str) -> fem.FunctionSpace:
    """Return the space if contact is possible in it, otherwise raise a FormError.

    Args:
        space: the space of the displacement.
        name: name of the argument that has the space, for the error.
    """
    mesh = space.mesh
    wanted = "a vector Lagrange space of degree 1 or 2 is needed, with one component per coordinate"
    dim = mesh.topology.dim
    try:
        element = space.element.basix_element
        fits = (
            element.family == basix.ElementFamily.P
            and not element.discontinuous
            and element.degree in (1, 2)
        )
    except RuntimeError:  # a mixed element
        fits = False
    if not fits or dim not in (2, 3) or space.dofmap.index_map_bs != mesh.geometry.dim:
        raise FormError.at(name, f"its space is {space.ufl_element()}: {wanted}")
    if mesh.topology.cell_name() not in ("triangle", "quadrilateral", "tetrahedron", "hexahedron"):
        raise FormError.at(
            name, f"its mesh has {mesh.topology.cell_name()} cells, which are not supported"
        )
    if is_section(mesh) and parallel.any_rank(mesh.comm, mesh.geometry.x[:, 2]):
        raise FormError.at(name, "its mesh of plane cells in 3D must lie in 2D x[2] = 0")
    return space


def conditions_of(
    bcs: fem.DirichletBC | Sequence[fem.DirichletBC] | None, space: fem.FunctionSpace
) -> list[fem.DirichletBC]:
    """Return the Dirichlet conditions as a list; raise a FormError if one is on another space."""
    bcs = [bcs] if isinstance(bcs, fem.DirichletBC) else bcs or []
    for k, condition in enumerate(bcs):
        if not isinstance(condition, fem.DirichletBC):
            raise FormError.at(
                f"bcs[{k}]", f"must be a DirichletBC of dolfinx, not {kind_of(condition)}"
            )
        if not compat.wrapped(space).contains(condition.function_space):
            raise FormError.at(
                f"bcs[{k}]", "is on another space than a, and on none of its components"
            )
    return list(bcs)


def settings_of(options: dict[str, SettingValue]) -> SolverSettings:
    """Return the settings of the solver from the keyword arguments of a problem."""
    known: dict[str, Any] = {
        name: value for name, value in options.items() if value is not None or name not in _NOT_HERE
    }
    if wrong := [(name, reason) for name, reason in _NOT_HERE.items() if name in known]:
        raise FormError(wrong)
    try:
        settings = SolverSettings(**known)
    except SceneError as error:
        raise FormError(error.problems) from None
    if (settings.algorithm, settings.regularisation_error) == ("path-following", "auto"):
        raise FormError.at(
            "regularisation_error",
            "must be a number: there is no estimate of the discretisation error",
        )
    return settings


def foundations_of(
    contact: Foundation | Pair | Iterable[Foundation | Pair] | None,
) -> tuple[Foundation | Pair, ...]:
    """Return the foundations and pairs after the checks of their arguments that need no mesh."""
    problems = list[tuple[str, str]]()
    if isinstance(contact, Foundation | Pair):
        contacts = [contact]
    elif isinstance(contact, str | np.ndarray) or not isinstance(contact, Iterable | None):
        reason = f"must be Foundations and Pairs, not {kind_of(contact)}: Foundation(facets)"
        raise FormError.at("contact", reason)
    else:
        contacts = list(contact or [])
    for k, entry in enumerate(contacts):
        if not isinstance(entry, Foundation | Pair):
            problems.append(
                (f"contact[{k}]", f"must be a Foundation or a Pair, not {kind_of(entry)}")
            )
            continue
        if isinstance(entry.gap, str):
            reason = "is text, as scenes have it: give a number, a callable f(x), or UFL"
            problems.append((f"contact[{k}].gap", f"{reason}, not {entry.gap!r}"))
        for key in ("kind", "distance", "sliding"):
            choices = get_args(Contact.model_fields[key].annotation)
            if (value := getattr(entry, key, choices[0])) not in choices:
                listed = " or ".join(map(repr, choices))
                problems.append((f"contact[{k}].{key}", f"must be {listed}, not {value!r}"))
        if not isinstance(entry.friction, FrictionLaw | None):
            wrong = (
                "must be Coulomb(...), Tresca(...), a law of your own or None, not "
                f"{kind_of(entry.friction)}"
            )
            problems.append((f"contact[{k}].friction", wrong))
        elif entry.friction is not None and entry.friction.timed:
            problems.append(
                (
                    f"contact[{k}].friction",
                    "depends on t: give numbers, and change them between steps",
                )
            )
        for key in names_of(CONTACT_PARTS):
            if (part := getattr(entry, key, None)) is None:
                continue
            if not isinstance(part, wanted := load_class(CONTACT_PARTS, key, ContactPart)):
                wrong = f"must be {wanted.__name__}(...), not {kind_of(part)}"
                problems.append((f"contact[{k}].{key}", wrong))
    if problems:
        raise FormError(problems)
    return tuple(contacts)


def facets_of(
    contact: Sequence[Foundation | Pair], mesh: dmesh.Mesh
) -> tuple[list[Indices], dict[int, Indices]]:
    """Return the facets of each contact, and those of the masters of pairs by contact number;
    collective.

    Facets are the exterior ones that this rank owns, ascending. A facet may be given on any rank
    that has it.
    """
    pairs = [k for k, entry in enumerate(contact) if entry.against is not None]
    if is_section(mesh) and pairs:
        text = (
            "contact of two bodies is not possible yet on a plane mesh in 3D: model the stiffer "
            "body as a Foundation, or both in 3D"
        )
        raise FormError([(f"contact[{k}]", text) for k in pairs])
    dim = mesh.topology.dim - 1
    outer = outer_facets(mesh)
    facet_map = mesh.topology.index_map(dim)
    owned = slice(facet_map.size_local)
    exterior = np.zeros(facet_map.size_local, dtype=bool)
    exterior[outer] = True
    listed = [(f"contact[{k}].facets", entry.facets) for k, entry in enumerate(contact)]
    listed += [
        (f"contact[{k}].against", entry.against)
        for k, entry in enumerate(contact)
        if entry.against is not None
    ]
    problems = []
    marks = [la.vector(facet_map, 1, dtype=np.int32) for _ in listed]
    for (name, selection), mark in zip(listed, marks, strict=True):
        try:
            mark.array[
                _listed(selection, mesh, dim, facet_map.size_local + facet_map.num_ghosts)
            ] = 1
        except (ValueError, TypeError) as error:
            problems.append((name, str(error)))
    parallel.raise_together(mesh.comm, FormError(problems) if problems else None)
    taken = np.zeros(facet_map.size_local, dtype=bool)
    for k, ((name, _), mark) in enumerate(zip(listed, marks, strict=True)):
        mark.scatter_reverse(la.InsertMode.add)
        marked = mark.array[owned] > 0
        number = k if k < len(contact) else pairs[k - len(contact)]
        other = marked != (marks[number].array[owned] > 0)
        sets = (marked, marked & ~exterior, marked & taken, other)
        sizes = np.array([flags.sum() for flags in sets])
        count, inside, twice, differing = parallel.global_sum(mesh.comm, sizes)
        if k != number and not differing:  # a side that may touch itself
            twice = 0
        if k < len(contact):  # facets of a master may be those of several
            taken |= marked
        if not count:
            problems.append((name, "are empty: give at least one"))
        if inside:
            problems.append(
                (name, f"{inside} of its {count} facets are not on the boundary of the mesh")
            )
        if twice:
            counterpart = "foundation" if name.endswith("facets") and not pairs else "partner"
            problems.append(
                (name, f"shares {twice} facets with another contact: a facet has one {counterpart}")
            )
    if problems:
        raise FormError(problems)
    facets = [np.flatnonzero(mark.array[owned] > 0).astype(np.int32) for mark in marks]
    return facets[: len(contact)], dict(zip(pairs, facets[len(contact) :], strict=True))


def parts_of(materials: dmesh.MeshTags | None, mesh: dmesh.Mesh) -> list[Indices]:
    """Return the cells of each material, ghosts included; without tags, one material with all
    cells; collective.
    """
    dim = mesh.topology.dim
    error = None
    cells = mesh.topology.index_map(dim)
    all_cells = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    if materials is None:
        return [all_cells]
    if not isinstance(materials, dmesh.MeshTags):
        error = f"must be MeshTags of dolfinx, not {kind_of(materials)}"
    elif materials.dim != dim or compat.topology(materials) != compat.topology(mesh):
        error = "must be tags on the cells of the mesh"
    elif materials.indices.size < all_cells.size:
        error = f"has no tag on {all_cells.size - materials.indices.size} cells of this rank"
    parallel.raise_together(mesh.comm, None if error is None else FormError.at("materials", error))
    tags = parallel.gather_rows(mesh.comm, np.unique(materials.values)[:, None])
    return [materials.find(int(tag)).astype(np.int32) for tag in np.unique(tags)]


def _listed(selection: Facets, mesh: dmesh.Mesh, dim: int, count: int) -> Indices:
    """Return local facet numbers, ghosts included, from such numbers or from tags."""
    if (
        isinstance(selection, tuple)
        and len(selection) == 2
        and isinstance(selection[0], dmesh.MeshTags)
    ):
        tags, wanted = selection
        if tags.dim != dim:
            raise ValueError(f"the tags are on entities of dimension {tags.dim}, not {dim}")
        if compat.topology(tags) != compat.topology(mesh):
            raise ValueError("the tags are of another mesh")
        return tags.indices[np.isin(tags.values, wanted)]
    facets = np.asarray(selection)
    if facets.ndim != 1 or not (facets.size == 0 or np.issubdtype(facets.dtype, np.integer)):
        raise TypeError("local numbers of facets are expected, shape (n,), or (meshtags, tag)")
    if facets.size and not (facets.min() >= 0 and facets.max() < count):
        raise ValueError(f"local numbers of facets are below {count} on this rank")
    return facets.astype(np.int32)


def boundaries_of(given: Mapping[str, Facets] | None, mesh: dmesh.Mesh) -> dict[str, Indices]:
    """Return the owned facets of each named part of the boundary; collective."""
    facets = dict[str, Indices]()
    problems = list[tuple[str, str]]()
    for name, selection in (given or {}).items():
        try:
            (facets[str(name)],), _ = facets_of((Foundation(selection),), mesh)
        except FormError as error:
            problems += [(f"boundaries[{name!r}]", wrong) for _, wrong in error.problems]
    if problems:
        raise FormError(problems)
    return facets
