"""Which scenes have a guaranteed bound of their error."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from signorini_fx.extensions import is_of_package
from signorini_fx.machine import compat
from signorini_fx.mechanics.effects.contact import Contact, UnilateralContact
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.laws.tresca import Tresca
from signorini_fx.mechanics.materials.protocol import Material
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.shapes.plane import Plane
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.quantities.proved_statements import Refused

# What a guaranteed bound is for; what else a scene has is named behind it.
BOUNDED = (
    "a guaranteed bound is for bodies of triangles or tetrahedra with constant moduli, under loads that are linear on "
    "each of these, with contact that opens on planes or between flat or matching sides, without friction or with "
    "Tresca friction"
)


def refused(*names: str) -> Refused:
    """That there is no bound of a scene with these parts."""
    return Refused(f"{BOUNDED}; this scene has {', '.join(dict.fromkeys(names))}")


def refuse_unknown(model: Model) -> None:
    """Raise where the scene has something without a bound, which the statement or the mesh tells; collective.

    Raises:
        Refused: with the names of all of it.
    """
    if names := list(_unbounded(model)):
        raise refused(*names)


def _is_polynomial(value: Any, degree: int) -> bool:
    """Whether a value of a scene is a polynomial of the position of a degree at most."""
    return isinstance(value, float) or (isinstance(value, Expression) and value.is_smooth and value.degree <= degree)


def _is_linear_between(value: Any) -> bool:
    """Whether it is linear between places, which are known, where it jumps or has a kink: these may be at nodes."""
    return isinstance(value, float) or (isinstance(value, Expression) and value.cuts_exactly and value.degree <= 1)


def _unbounded(model: Model) -> Iterator[str]:
    """The names of what has no bound."""
    mesh, statement = model.tagged.mesh, model.statement
    if "guaranteed bound" in model.kinematics.refuses:
        yield model.kinematics.words
    if mesh.topology.cell_name() not in ("triangle", "tetrahedron"):
        yield f"{mesh.topology.cell_name()} cells"
    if compat.geometry_degree(mesh) > 1:
        yield "curved cells"
    if model.elastic.pressed:
        yield "the mixed element"
    if model.pieces.pins.size > 0:
        yield "parts that share a point"
    for material in statement.material:
        if material.varies:
            yield "moduli or axes that vary"
        if not np.isfinite(material.lame).all():
            yield "a material without a change of volume"
    for _, entry in statement.listed():
        if isinstance(entry, Contact):
            yield from _of_contact(entry, several_steps=statement.several_steps)
        elif isinstance(entry, PrescribedDisplacement):
            yield from _of_support(entry, model)
        elif isinstance(entry, Force):
            by_density = entry.density_tells_all and not (entry.strains or entry.nodal or entry.interface)
            if not (by_density and all(map(_is_linear_between, profile_of(entry, model.tagged.dimension)))):
                yield f"a {entry.label} that is not linear"
            elif not isinstance(entry.weighting, float | None):
                yield f"a {entry.label} that is not spread evenly"
        elif not isinstance(entry, Material):
            yield entry.label


def _of_contact(entry: Contact, *, several_steps: bool) -> Iterator[str]:
    """What of a contact has no bound."""
    if not isinstance(entry, UnilateralContact):
        yield f"{getattr(entry, 'kind', 'another')} contact"
    elif entry.overclosure is not None:
        yield "soft contact"
    if entry.foundation is not None and (not isinstance(entry.foundation, Plane) or entry.moves or entry.tool):
        yield "a foundation that is no plane at rest"
    if entry.adjust is not None:
        yield "contact that adjust closes"
    if not _is_polynomial(entry.gap, 2):
        yield f"a gap of {entry.boundary!r} that is no polynomial of degree 2"
    if not entry.friction.acts:
        return
    if not isinstance(entry.friction, Tresca) or entry.friction.directed:
        yield f"{entry.friction.law} friction{' with axes' * entry.friction.directed}"
    elif not _is_linear_between(entry.friction.bound):
        yield f"a friction bound of {entry.boundary!r} that is not linear"
    if several_steps:
        yield "friction in several load steps"


def _of_support(entry: PrescribedDisplacement, model: Model) -> Iterator[str]:
    """What of a support has no bound."""
    degree = model.space.element.basix_element.degree
    if entry.at is not None:
        yield "a support of a point"
    elif entry.rotation is not None:
        yield "a prescribed rotation"
    elif not all(_is_polynomial(value, degree) for value in entry.given.values()):
        yield f"a displacement of {entry.boundary!r} that is no polynomial of the elements"


def profile_of(load: Force, dimension: int) -> tuple[Any, ...]:
    """``Force.profile``, if the class that says it is not an older one than that which says the density."""
    first, second = (
        next(base for base in type(load).__mro__ if name in vars(base)) for name in ("profile", "density_at")
    )
    return load.profile(dimension) if is_of_package(second) or issubclass(first, second) else (load.density_at,)
