"""The numbers of a statement that derivatives are taken by: found by their paths, and changed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.laws.protocol import FrictionLaw
from signorini_fx.mechanics.statement.effect import Load, Resistance
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.scenes.reading import PATH, way_of
from signorini_fx.tuned import DIFFERENCE_STEP

_EXAMPLE = "such as contact[0].friction.coefficient, material[0].young, or traction[0], a load as a whole"


def entry_of(statement: Statement, path: str, extent: float, dimension: int) -> tuple[float, float]:
    """The number at a path, 1 for a load as a whole and nan for an expression, and the step for a difference;
    ``extent``: of the body, length.

    Raises:
        SceneError: there is no such entry, or none that a derivative can be taken by.
    """
    if path.startswith("material") and not all(material.isotropic for material in statement.material):
        raise SceneError([(path, "is possible where all materials are isotropic")])
    if any(part in path for part in (".friction.ratio", ".friction.along", ".foundation.spring")):
        raise SceneError([(path, "is none that a derivative can be taken by")])
    if path.endswith("grading"):
        raise SceneError([(path, "is none that a derivative can be taken by: take young, which it multiplies")])
    value, parent = _entry_and_table(statement, path, dimension)
    if isinstance(value, Load):
        return 1.0, 1e-3
    if isinstance(parent, FrictionLaw | Resistance) and value == 0.0:
        raise SceneError([(path, "is zero, so that nothing acts: give a small number to begin with")])
    root = path.partition("[")[0].partition(".")[0]
    if ".foundation.force" in path or ".foundation.moment" in path:
        force = statement.young * extent ** (dimension - 1) * (extent if ".moment" in path else 1.0)
        unit = abs(value) if not isinstance(value, Expression) and value != 0.0 else force
    elif isinstance(value, Expression) or value == 0.0 or (root == "contact" and ".friction" not in path):
        unit = extent if root in ("contact", "displacement") else statement.young
        if any(part in path for part in ("rotation", "direction", ".friction.coefficient", ".poisson")):
            unit = 1.0
    else:
        unit = abs(value)
    return (float("nan") if isinstance(value, Expression) else float(value)), DIFFERENCE_STEP * unit


def varied(statement: Statement, path: str, change: float, dimension: int) -> dict[str, Any]:
    """What ``statement.changed`` takes for a number larger by ``change``; an expression gets it as another term, a load
    as a part of it.
    """
    key, *way = _way(path)
    entries = _changed(statement, statement.tables[str(key)], way, change, dimension)
    return {str(key): entries if isinstance(entries, tuple) else (entries,)}


def _way(path: str) -> list[str | int]:
    if not PATH.fullmatch(path):
        raise SceneError([(path, f"is no path of an entry, {_EXAMPLE}")])
    return way_of(path)


def _single_entry(value: Any, key: str | int) -> Any:
    """What a key leads to; a list of one stands for what is in it."""
    if isinstance(key, str) and isinstance(value, tuple) and len(value) == 1:
        value = value[0]
    if isinstance(key, int) and isinstance(value, BaseModel) and key == 0:
        return value
    if isinstance(key, int):
        return value[key] if isinstance(value, tuple | list) and key < len(value) else None
    if isinstance(value, Mapping):
        return value.get(key)
    return getattr(value, key) if isinstance(value, BaseModel) and key in type(value).model_fields else None


def _entry_and_table(statement: Statement, path: str, dimension: int) -> tuple[Any, Any]:
    """The entry and what it is in."""
    parent: Any = None
    value: Any = statement.tables
    way = _way(path)
    if way[0] not in statement.effects:
        raise SceneError([(path, f"is no datum of the problem that a derivative can be taken by, {_EXAMPLE}")])
    for key in way:
        parent, value = value, _single_entry(value, key)
        if value is None and key == "shift" and isinstance(way[-1], int):
            value = (0.0,) * dimension
        if value is None:
            raise SceneError([(path, f"there is no such entry, or it has no value; {_EXAMPLE}")])
    if isinstance(value, bool) or not isinstance(value, int | float | Expression | Load):
        raise SceneError([(path, f"is no number; {_EXAMPLE}")])
    return value, parent


def _changed(statement: Statement, value: Any, way: list[str | int], change: float, dimension: int) -> Any:
    if not way:
        if isinstance(value, Load):
            return value.model_copy(
                update={"factors": tuple((1 + change) * factor for factor in statement.factors_of(value))}
            )
        if isinstance(value, Expression):
            return Expression(f"({value.text}) + ({float(change)!r})", value.time, value.allows_time)
        return value + change
    key, *inner_way = way
    if isinstance(key, str) and isinstance(value, tuple) and len(value) == 1:
        return (_changed(statement, value[0], way, change, dimension),)
    if isinstance(key, int) and isinstance(value, BaseModel):
        return _changed(statement, value, inner_way, change, dimension)
    inner = _single_entry(value, key)
    if inner is None:
        inner = (0.0,) * dimension
    changed = _changed(statement, inner, inner_way, change, dimension)
    if isinstance(key, int):
        return (*value[:key], changed, *value[key + 1 :])
    return {**value, key: changed} if isinstance(value, Mapping) else value.model_copy(update={key: changed})
