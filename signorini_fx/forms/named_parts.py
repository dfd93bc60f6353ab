"""What a ``ContactProblem`` knows by name: parts of its boundary, and its contact as the entries of a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from pydantic import BaseModel

from signorini_fx import parallel
from signorini_fx.body.foundation import Foundation, Pair
from signorini_fx.effects.contact import BilateralContact, BondedContact, Contact, UnilateralContact
from signorini_fx.errors import FormError
from signorini_fx.forms.arguments import facets_of
from signorini_fx.forms.parts import ProblemParts
from signorini_fx.kinematics import of_components
from signorini_fx.laws.none import NoFriction
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.model import Model
from signorini_fx.scene.load_steps import LoadPath, LoadSteps
from signorini_fx.scene.settings import Discretised
from signorini_fx.statement import Statement

Facets = npt.NDArray[np.int32]


def boundaries_of(given: Mapping[str, Any] | None, mesh: dmesh.Mesh) -> dict[str, Facets]:
    """The facets of each part of the boundary that has a name; collective.

    Raises:
        FormError: with all that are wrong.
    """
    facets, problems = dict[str, Facets](), list[tuple[str, str]]()
    for name, selection in (given or {}).items():
        try:
            (facets[str(name)],), _ = facets_of((Foundation(selection),), mesh)
        except FormError as error:
            problems += [(f"boundaries[{name!r}]", wrong) for _, wrong in error.problems]
    if problems:
        raise FormError(problems)
    return facets


def names_of(
    boundaries: Mapping[str, Facets], facets: Sequence[Facets], masters: Mapping[int, Facets], mesh: dmesh.Mesh
) -> tuple[list[str], dict[int, str]]:
    """The name of each contact, and of the other side of each pair by its number: that of the part of the boundary with
    the same facets, or its number; collective.
    """

    def name(part: Facets, otherwise: str) -> str:
        equal = (
            candidate
            for candidate, named in boundaries.items()
            if not parallel.any_rank(mesh.comm, not np.array_equal(named, part))
        )
        return next(equal, otherwise)

    names = [name(part, f"contact {k}") for k, part in enumerate(facets)]
    return names, {k: name(part, f"other side of contact {k}") for k, part in masters.items()}


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


def path_of(problem: ProblemParts) -> LoadPath:
    """The load steps of ``run``, or those of a loop of the user's own so far, at the times 1, 2, 3 and so on."""
    if problem._path is not None:
        return problem._path.path
    return LoadPath(tuple(map(float, range(1, problem._begun.step + 2))))


def named_body(problem: ProblemParts, title: str = "") -> Model:
    """The body of a problem with what is known of it by name; collective.

    Args:
        problem: solved.
        title: of its results.
    """
    space, (facets, masters) = problem._space, problem._named
    names, opposite = names_of(problem._boundaries, facets, masters, space.mesh)
    parts = problem._boundaries | dict(zip(names, facets, strict=True))
    parts |= {name: masters[k] for k, name in opposite.items()}
    entries = zip(problem.contact, names, strict=True)
    contact = [contact_entry(entry, name, opposite.get(k)) for k, (entry, name) in enumerate(entries)]
    forms = ["a", "L", *(["stress"] if problem._law is not None else []), *(["materials"] * (len(problem._parts) > 1))]
    path, tagged = path_of(problem), tagged_mesh(space.mesh, parts)
    steps = LoadSteps(times=path.times, names=path.names or None, steps=path.steps) if path.several else LoadSteps()
    statement = Statement(
        title=title,
        effects={"contact": tuple(contact)},
        kinematics=of_components(tagged.dimension, space.mesh.geometry.dim),
        element=Discretised(degree=int(space.element.basix_element.degree)),
        load_steps=steps,
        steps=len(steps.times or (1.0,)),
        solver=problem.settings,
        origin={"forms": tuple(forms), "mesh": tagged},
    )
    elastic = {field.name: getattr(problem._elastic, field.name) for field in fields(problem._elastic)}
    return Model(
        **elastic,
        statement=statement,
        tagged=tagged,
        lame=(None, None),
        moduli=None,
        law=problem._begun.law,
        pairs=problem._foundations.pairs,
        rigid=problem._rigid,
    )
