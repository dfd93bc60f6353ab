"""What a ``ContactProblem`` is given: its forms, what they say of stresses, and its contact, with their facets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx import mesh as dmesh

from signorini_fx.forms.arguments import boundaries_of, facets_of, foundations_of, parts_of, space_of
from signorini_fx.forms.stress import Law, law_of
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.interfaces import Foundation, Pair

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
    """What a ``ContactProblem`` is given, and the Function that takes its solution; collective.

    Raises:
        FormError: an argument is wrong.
        MachineError: a form cannot be compiled.
    """
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
