"""What a ``ContactProblem`` is given: its forms, what they say of stresses, its contact with its facets, and what it
knows by name: parts of its boundary, and its contact as the entries of a scene.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx import mesh as dmesh
from pydantic import BaseModel

from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.forms.arguments import boundaries_of, facets_of, foundations_of, parts_of, space_of
from signorini_fx.forms.stress import Law, law_of
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.body.elastic_body import ElasticBody
from signorini_fx.mechanics.interfaces import Foundation, Pair
from signorini_fx.mechanics.kinematics import of_components
from signorini_fx.mechanics.laws.coulomb import NoFriction
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodies
from signorini_fx.mechanics.statement.load_path import LoadPath, LoadSteps
from signorini_fx.mechanics.statement.settings import Discretised, SolverSettings

if TYPE_CHECKING:
    from signorini_fx.mechanics.effects.contact import Contact
    from signorini_fx.mechanics.obstacles.paired_points import PairedSides
    from signorini_fx.mechanics.statement.statement import Statement

Facets = npt.NDArray[np.int32]


@dataclass(frozen=True)
class GivenForms:
    """The arguments of a ``ContactProblem`` that stay as they are, checked and compiled.

    Attributes:
        space: of the displacement.
        original: a and L as they were given, UFL or compiled.
        compiled: the same, compiled.
        stress: the stress of a displacement; None: none was given.
        parts: the cells of each material.
        contact: the foundations and pairs.
        facets: of each contact.
        masters: of the other side of each pair, by its number.
        boundaries: the facets of each part of the boundary that was given a name.
    """

    space: fem.FunctionSpace
    original: tuple[Any, Any]
    compiled: tuple[fem.Form, fem.Form]
    stress: Law | None
    parts: Sequence[npt.NDArray[np.int32]]
    contact: tuple[Foundation | Pair, ...]
    facets: Sequence[Facets]
    masters: Mapping[int, Facets]
    boundaries: Mapping[str, Facets]

    @property
    def mesh(self) -> dmesh.Mesh:
        """Of the body."""
        return self.space.mesh

    @property
    def touching(self) -> list[Facets]:
        """The facets that are in contact, of pairs on both sides."""
        return [*self.facets, *self.masters.values()]

    @property
    def names(self) -> list[str]:
        """Those of the contacts by their numbers."""
        return [f"contact {number}" for number in range(len(self.facets))]

    @property
    def weighted(self) -> bool:
        """Whether some contact is multiplied by a measure, which estimates of errors do not know."""
        return any(getattr(contact, "measure", None) is not None for contact in self.contact)

    @property
    def has_coulomb(self) -> bool:
        """Whether some friction follows the pressure."""
        return any(contact.friction is not None and contact.friction.follows_pressure for contact in self.contact)


def given_forms(
    a: Any,
    L: Any,
    contact: Any,
    u: fem.Function | None,
    *,
    stress: Any = None,
    materials: dmesh.MeshTags | None = None,
    boundaries: Mapping[str, Any] | None = None,
    **compiler_options: Any,
) -> tuple[GivenForms, fem.Function]:
    """What a ``ContactProblem`` is given, and the Function that takes its solution; collective."""
    space, entries = space_of(a, L, u), foundations_of(contact)
    facets, masters = facets_of(entries, space.mesh)
    with compiling():
        compiled = [form if isinstance(form, fem.Form) else fem.form(form, **compiler_options) for form in (a, L)]
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


def names_of(forms: GivenForms) -> tuple[list[str], dict[int, str]]:
    """The name of each contact, and of the other side of each pair by its number: that of the part of the boundary with
    the same facets, or its number; collective.
    """

    def name(part: Facets, otherwise: str) -> str:
        equal = (
            candidate
            for candidate, named in forms.boundaries.items()
            if not parallel.any_rank(forms.mesh.comm, not np.array_equal(named, part))
        )
        return next(equal, otherwise)

    names = [name(part, otherwise) for part, otherwise in zip(forms.facets, forms.names, strict=True)]
    return names, {k: name(part, f"other side of contact {k}") for k, part in forms.masters.items()}


def tagged_mesh(mesh: dmesh.Mesh, boundaries: Mapping[str, Facets]) -> TaggedMesh:
    """A mesh with these names, of which a facet may have several."""
    facets = np.unique(np.concatenate([np.empty(0, dtype=np.int32), *boundaries.values()]))
    held = (
        np.array([np.isin(facets, part) for part in boundaries.values()], dtype=bool)
        .reshape(len(boundaries), facets.size)
        .T
    )
    kinds, tag = np.unique(held, axis=0, return_inverse=True)
    tags = {name: tuple(int(k) + 1 for k in np.flatnonzero(kinds[:, number])) for number, name in enumerate(boundaries)}
    values = (tag.ravel() + 1).astype(np.int32)
    return TaggedMesh(mesh, dmesh.meshtags(mesh, mesh.topology.dim - 1, facets, values), tags)


def contact_entry(entry: Foundation | Pair, name: str, against: str | None) -> Contact:
    """A foundation or a pair as a scene lists it."""
    from signorini_fx.mechanics.effects.contact import BilateralContact, BondedContact, UnilateralContact

    kind = BondedContact if entry.bonded else BilateralContact if entry.bilateral else UnilateralContact
    described: dict[str, Any] = {"boundary": name, "friction": entry.friction or NoFriction()}
    if isinstance(entry, Pair):
        by_geometry = isinstance(entry.gap, str)
        described |= {"against": against, "gap": entry.allowance if by_geometry else entry.gap}
        described |= {"distance": "geometry" if by_geometry else "nominal", "adjust": entry.adjust}
    else:
        shape = entry.shape if isinstance(entry.shape, BaseModel) else None
        gap = float(entry.gap) if isinstance(entry.gap, int | float) else entry.gap
        described |= {"gap": gap, "direction": entry.direction, "foundation": shape}
    return partial(kind.model_construct, **described)()


@dataclass(frozen=True)
class NamedParts:
    """What is known of forms by name, whatever their Constants are: contact, load steps and settings, and the mesh with
    the names of its boundaries.
    """

    statement: Statement
    tagged: TaggedMesh

    def along(self, path: LoadPath, title: str) -> NamedParts:
        """The same with load steps, and with a title of results."""
        steps = LoadSteps(times=path.times, names=path.names or None, steps=path.steps) if path.several else LoadSteps()
        count = len(steps.times or (1.0,))
        return replace(self, statement=replace(self.statement, title=title, load_steps=steps, steps=count))

    def model(
        self, elastic: ElasticBody, law: PointFriction | None, pairs: Mapping[int, PairedSides], rigid: RigidBodies
    ) -> Model:
        """An elastic body of these forms."""
        return Model(
            **{field.name: getattr(elastic, field.name) for field in fields(elastic)},
            statement=replace(self.statement, solver=elastic.settings),
            tagged=self.tagged,
            law=law,
            pairs=pairs,
            rigid=rigid,
        )


def named_parts(forms: GivenForms, settings: SolverSettings, arguments: Sequence[str] = ()) -> NamedParts:
    """What is known of forms by name, with a single load step; ``arguments``: what they were stated by, else the forms;
    collective.
    """
    from signorini_fx.mechanics.statement.statement import Statement

    names, opposite = names_of(forms)
    parts = {**forms.boundaries, **dict(zip(names, forms.facets, strict=True))}
    parts |= {name: forms.masters[k] for k, name in opposite.items()}
    entries = zip(forms.contact, names, strict=True)
    contact = [contact_entry(entry, name, opposite.get(k)) for k, (entry, name) in enumerate(entries)]
    listed = ["a", "L", *(["stress"] * (forms.stress is not None)), *(["materials"] * (len(forms.parts) > 1))]
    tagged = tagged_mesh(forms.mesh, parts)
    statement = Statement(
        title="",
        effects={"contact": tuple(contact)},
        kinematics=of_components(tagged.dimension, forms.mesh.geometry.dim),
        element=Discretised(degree=int(forms.space.element.basix_element.degree)),
        load_steps=LoadSteps(),
        steps=1,
        solver=settings,
        origin={"forms": tuple(arguments or listed), "mesh": tagged},
    )
    return NamedParts(statement, tagged)
