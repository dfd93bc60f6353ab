"""The scenes for which a guaranteed bound of the error exists."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator
from itertools import combinations, pairwise

import numpy as np

from signorini_fx.arrays import Array, Value
from signorini_fx.machine import compat
from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.effects.loads import BodyForce, Force, Gravity, Traction
from signorini_fx.mechanics.laws.coulomb import Tresca
from signorini_fx.mechanics.materials.protocol import Material
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.shapes.analytic import Plane
from signorini_fx.mechanics.statement.effect import ForceDensity
from signorini_fx.mechanics.statement.expressions import Expression, in_space
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.tuned import SAME_LENGTH

# What a guaranteed bound is for; what else a scene has is named behind it.
BOUNDED = (
    "a guaranteed bound is for bodies of triangles or tetrahedra with constant moduli, under "
    "loads that are linear on "
    "each of these, with contact that opens on planes or between flat or matching sides, without "
    "friction or with "
    "Tresca friction"
)


def refused(*names: str) -> Refused:
    """Return the error of a scene that has no bound because of the parts with these names."""
    return Refused(f"{BOUNDED}; this scene has {', '.join(dict.fromkeys(names))}")


def _is_polynomial(value: Value, degree: int) -> bool:
    """Return whether a value of a scene is a polynomial of the position up to a degree."""
    if isinstance(value, Expression):
        return not _switches(value.tree) and _degree(value.tree) <= degree
    return isinstance(value, float)


def _is_linear(value: Value) -> bool:
    """Return whether a value is linear between known places, which may be at nodes: the zeros of
    linear switches that do not jump, see ``_switches``.
    """
    if not isinstance(value, Expression):
        return isinstance(value, float)
    known = all(_degree(node) <= 1 and not _jumps(node) for node in _switches(value.tree))
    return known and _degree(value.tree) <= 1


def refuse_jumps(value: Value, x: Array, label: str) -> None:
    """Refuse a value with a jump or a kink inside a simplex.

    It has one if the argument of a switch changes its sign between the corners.  The argument of a
    comparison is the difference of both sides; ``abs``, ``sign``, ``sqrt`` and powers have their
    own argument, ``min`` and ``max`` the differences of theirs.

    Args:
        value: the value.
        x: corners of the simplices, shape (m, k, d).
        label: name of the value in the message.
    """
    if not isinstance(value, Expression) or not x.size:
        return
    places = in_space(x.reshape(-1, x.shape[2]))
    for node in _switches(value.tree):
        at_corners = value.of_part(node, places).reshape(x.shape[:2])
        tiny = SAME_LENGTH * np.abs(at_corners).max()
        if ((at_corners.min(axis=1) < -tiny) & (at_corners.max(axis=1) > tiny)).any():
            raise refused(f"a {label} that jumps or has a kink between nodes")


def _switches(node: ast.expr) -> list[ast.expr]:
    """Return the parts of an expression tree whose sign selects a branch, inner ones first."""
    found = [
        part
        for child in ast.iter_child_nodes(node)
        if isinstance(child, ast.expr)
        for part in _switches(child)
    ]
    match node:
        case ast.Compare(left=left, comparators=comparators):
            found += [
                ast.BinOp(one, ast.Sub(), other) for one, other in pairwise((left, *comparators))
            ]
        case ast.Call(func=ast.Name(id="abs" | "sign" | "sqrt"), args=[argument]):
            found.append(argument)
        case ast.Call(func=ast.Name(id="min" | "max"), args=arguments):
            found += [ast.BinOp(one, ast.Sub(), other) for one, other in combinations(arguments, 2)]
        case ast.BinOp(left=left, op=ast.Pow(), right=right) if (
            not isinstance(right, ast.Constant) or right.value % 1
        ):
            found.append(left)
    return found


def _jumps(node: ast.expr) -> bool:
    """Return whether an expression may jump: it has a comparison or a sign."""
    return any(
        isinstance(part, ast.Compare) or (isinstance(part, ast.Name) and part.id == "sign")
        for part in ast.walk(node)
    )


def _degree(node: ast.expr) -> float:
    """Return the degree of an expression between its switches: infinite if it is no polynomial, 0
    for a condition.
    """
    degrees = [
        _degree(child) for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)
    ]
    match node:
        case ast.Subscript():
            return 1.0
        case ast.Compare() | ast.Call(func=ast.Name(id="sign")):
            return 0.0
        case ast.BinOp(op=ast.Mult()):
            return sum(degrees)
        case ast.BinOp(op=ast.Div()) if degrees[1] == 0:
            return degrees[0]
        case ast.BinOp(op=ast.Pow(), right=ast.Constant(value=int() | float() as power)) if (
            power >= 0 and power % 1 == 0
        ):
            return degrees[0] * power if power else 0.0
        case (
            ast.UnaryOp()
            | ast.IfExp()
            | ast.BinOp(op=ast.Add() | ast.Sub())
            | ast.Call(func=ast.Name(id="abs" | "min" | "max" | "where"))
        ):
            return max(degrees)
    return 0.0 if max(degrees, default=0.0) == 0 else math.inf


def unbounded(model: Model) -> Iterator[str]:
    """Yield the names of the parts of a scene for which there is no bound, as far as the statement
    or the mesh shows them.
    """
    mesh = model.tagged.mesh
    statement = model.statement
    if "guaranteed bound" in model.kinematics.refuses:
        yield model.kinematics.words
    if mesh.topology.cell_name() not in ("triangle", "tetrahedron"):
        yield f"{mesh.topology.cell_name()} cells"
    if compat.geometry_degree(mesh) > 1:
        yield "curved cells"
    if model.scene_law.pressed:
        yield "the mixed element"
    for material in statement.material:
        if material.varies:
            yield "moduli or axes that vary"
        if not np.isfinite(material.lame).all():
            yield "a material without a change of volume"
    for _, entry in statement.listed():
        if isinstance(entry, Contact):
            yield from _of_contact(entry, several_steps=statement.path.several)
        elif isinstance(entry, Displacement):
            yield from _of_support(entry, model)
        elif isinstance(entry, ForceDensity):
            if type(entry) not in (BodyForce, Gravity, Traction, Force):
                yield entry.label
            elif not all(map(_is_linear, entry.given.values())):
                yield f"a {entry.label} that is not linear"
            elif not isinstance(getattr(entry, "spread", 1.0), float):
                yield f"a {entry.label} that is not spread evenly"
        elif not isinstance(entry, Material):
            yield entry.label


def _of_contact(entry: Contact, *, several_steps: bool) -> Iterator[str]:
    """Yield the names of the parts of a contact for which there is no bound."""
    if not entry.opens:
        yield f"{entry.kind} contact"
    elif entry.overclosure is not None:
        yield "soft contact"
    if entry.foundation is not None and (
        not isinstance(entry.foundation, Plane) or entry.moves or entry.driven
    ):
        yield "a foundation that is no plane at rest"
    if entry.adjust is not None:
        yield "contact that adjust closes"
    if not _is_polynomial(entry.gap, 2):
        yield f"a gap of {entry.boundary!r} that is no polynomial of degree 2"
    if not entry.friction.acts:
        return
    if not isinstance(entry.friction, Tresca) or entry.friction.directed:
        yield f"{entry.friction.law} friction{' with axes' * entry.friction.directed}"
    elif not _is_linear(entry.friction.bound):
        yield f"a friction bound of {entry.boundary!r} that is not linear"
    if several_steps:
        yield "friction in several load steps"


def _of_support(entry: Displacement, model: Model) -> Iterator[str]:
    """Yield the names of the parts of a support for which there is no bound."""
    degree = model.space.element.basix_element.degree
    if entry.at is not None:
        yield "a support of a point"
    elif entry.rotation is not None:
        yield "a prescribed rotation"
    elif not all(_is_polynomial(value, degree) for value in entry.given.values()):
        yield f"a displacement of {entry.boundary!r} that is no polynomial of the elements"
