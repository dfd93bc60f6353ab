"""Keys that are not allowed in 2D or in 3D.  The mesh decides which of the two the scene is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from pydantic import BaseModel

from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.mechanics.statement.statement import Statement

_PLANE = "the mesh is plane"
_SPACE = "the mesh is in 3D"
# The tables whose component z is out of the section of a body that moves there, see ``Kinematics.out_of_section``.
_AROUND = ("displacement", "traction", "force", "body_force", "springs")


def dimension_problems(statement: Statement, dimension: int) -> list[tuple[str, str]]:
    """Every key that has no meaning on a mesh of this dimension, and why.

    Args:
        statement: what is stated of the problem.
        dimension: 2 or 3.
    """
    return [*_everywhere(statement, dimension), *(_in_the_plane(statement) if dimension == 2 else _in_space(statement))]


def _everywhere(statement: Statement, dimension: int) -> Iterator[tuple[str, str]]:
    where = _PLANE if dimension == 2 else _SPACE
    for path, effect in statement.listed():
        for key in effect.vectors:
            vector = getattr(effect, key)
            if vector is not None and len(vector) != dimension:
                yield f"{path}.{key}", f"{where}: give {dimension} numbers, not {len(vector)}"
    for index, material in enumerate(statement.material):
        for path, reason in material.dimension_problems(dimension):
            yield ".".join((f"material[{index}]", *map(str, path))), reason
    for index, effect in enumerate(statement.contact):
        if effect.foundation is not None:
            turns = statement.kinematics.unbalanced[-1]
            turning = effect.foundation.turning_contradictions(dimension) if turns else ()
            for key, reason in (*effect.foundation.contradictions(dimension), *turning):
                yield f"contact[{index}].foundation.{key}", reason
        for support in statement.displacement:
            components = support.components[: dimension + statement.kinematics.out_of_section]
            if support.boundary == effect.boundary and None not in components:
                yield "scene", f"boundary {effect.boundary!r} is in contact, and all of its displacement is prescribed"


def _in_the_plane(statement: Statement) -> Iterator[tuple[str, str]]:
    for index, effect in enumerate(statement.displacement):
        if effect.axis is not None and not statement.kinematics.out_of_section:
            yield f"displacement[{index}].axis", f"{_PLANE}: a rotation is about x[2]"
    for path, table in _tables(statement.tables, ""):
        if "z" in table.model_fields_set and getattr(table, "z", None) is not None:
            if not statement.kinematics.out_of_section:
                yield f"{path}.z", f"{_PLANE}: there is nothing along x[2]"
            elif path.partition("[")[0] not in _AROUND:
                yield f"{path}.z", f"{_PLANE}: nothing of this kind is along x[2]"
        if getattr(table, "up", None) == "z":
            yield f"{path}.up", f"{_PLANE}: there is nothing along x[2]"
        for name in _keys(type(table)):
            value = getattr(table, name)
            if isinstance(value, Expression) and value.coordinates > 2:
                yield f"{path}.{name}".lstrip("."), f"{_PLANE}: there is no x[2]"


def _in_space(statement: Statement) -> Iterator[tuple[str, str]]:
    for index, material in enumerate(statement.material):
        if "hypothesis" in material.model_fields_set:
            reason = f"{_SPACE}: plane stress and plane strain have no meaning, leave the hypothesis out"
            yield f"material[{index}].hypothesis", reason
    for index, effect in enumerate(statement.displacement):
        if effect.axis is not None and len(effect.axis) != 3:
            yield f"displacement[{index}].axis", f"{_SPACE}: give 3 numbers, not {len(effect.axis)}"


@cache
def _keys(kind: type[BaseModel]) -> tuple[str, ...]:
    """The keys of a kind of table; pydantic takes ten times as long."""
    return tuple(kind.model_fields)


def _tables(node: Any, path: str) -> Iterator[tuple[str, BaseModel]]:
    """All tables of a scene with their paths."""
    if isinstance(node, BaseModel):
        yield path, node
        for name in _keys(type(node)):
            yield from _tables(getattr(node, name), f"{path}.{name}".lstrip("."))
    elif isinstance(node, list | tuple):
        for index, item in enumerate(node):
            yield from _tables(item, f"{path}[{index}]")
    elif isinstance(node, Mapping):
        for name, item in node.items():
            yield from _tables(item, f"{path}.{name}".lstrip("."))
