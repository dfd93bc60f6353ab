"""The checks of what a user gives to ``NonlinearContactProblem``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import ufl
from dolfinx import fem

from signorini_fx.errors import FormError
from signorini_fx.forms.arguments import space_of
from signorini_fx.mechanics.assembly.averages import averaging
from signorini_fx.mechanics.interfaces import Foundation, Pair
from signorini_fx.mechanics.shapes.simple import Plane
from signorini_fx.mechanics.statement.values import kind_of


def checked(F: Any, u: Any, J: Any, contact: Sequence[Foundation | Pair]) -> tuple[Foundation | Pair, ...]:
    """The foundations and pairs, if the arguments fit each other.

    Raises:
        FormError: they do not.
    """
    problems = list[tuple[str, str]]()
    problems += [fault for k, entry in enumerate(contact) if slides(entry) for fault in _faults(k, entry)]
    instead = "prescribe the displacement of this boundary, or tie it to a stiff body (against, sliding = False)"
    problems += [
        (f"contact[{k}].bonded", f"is not possible yet: nonlinear bodies are not tied to rigid ones: {instead}")
        for k, entry in enumerate(contact)
        if entry.bonded and entry.against is None
    ]
    if not isinstance(u, fem.Function):
        problems.append(("u", f"must be a Function, not {kind_of(u)}"))
    if not isinstance(F, ufl.Form) or F.empty() or len(F.arguments()) != 1:
        problems.append(("F", "must be a UFL form with one test function; what is 0 times a form has none"))
    elif J is None and u not in F.coefficients():
        problems.append(("F", "does not contain u, so that its derivative is zero: form it with u, or give J"))
    if problems:
        raise FormError(problems)
    try:
        if J is None:
            space_of(ufl.inner(ufl.TrialFunction(u.function_space), ufl.TestFunction(u.function_space)) * ufl.dx, F, u)
        else:
            space_of(J, F, u)
    except FormError as error:
        names = {"a": "u" if J is None or _unsupported(error) else "J", "L": "F"}
        raise FormError([(names.get(key, key), reason) for key, reason in error.problems]) from None
    space = u.function_space
    if averaging(space):
        problems += [
            (f"contact[{k}].shape", "on quadratic tetrahedra a shape must be a plane: take hexahedra, or degree 1")
            for k, entry in enumerate(contact)
            if entry.shape is not None and not _flat(entry.shape)
        ]
    if space.mesh.geometry.dim != 2 and space.element.basix_element.degree > 1:
        reason = (
            "in 3D two bodies slide on each other with degree 1 only, as curved facets are not worked out there: "
            "take degree 1, or, where sides slide by little of a facet, sliding = False"
        )
        problems += [(f"contact[{k}]", reason) for k, entry in enumerate(contact) if slides(entry)]
    if problems:
        raise FormError(problems)
    return tuple(contact)


def slides(entry: Any) -> bool:
    """Whether a contact is one of two sides that slide on each other."""
    return entry.against is not None and entry.sliding


def _faults(number: int, pair: Any) -> list[tuple[str, str]]:
    """What of a pair is not possible where its sides slide on each other."""
    path, kept = f"contact[{number}]", "give sliding = False"
    return [
        (f"{path}.{key}", reason)
        for key, wrong, reason in (
            ("gap", pair.gap != "geometry", f'must be "geometry" where sides slide, as partners change: or {kept}'),
            ("bonded", pair.bonded, f"is not possible where sides slide: {kept}"),
            ("adjust", pair.adjust is not None, f"is not possible where sides slide: move the meshes, or {kept}"),
        )
        if wrong
    ]


def _unsupported(error: FormError) -> bool:
    """Whether it is the space of the displacement that is wrong."""
    return any(reason.startswith("its space") for _, reason in error.problems)


def _flat(shape: Any) -> bool:
    """Whether a shape has the same normal everywhere."""
    return isinstance(shape, Plane) or (isinstance(shape, Mapping) and shape.get("shape") == "plane")
