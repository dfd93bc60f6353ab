"""The numbers of a statement that derivatives are taken by: found by their paths, and changed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

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
    *_, (parent, _), (value, _) = _way(statement, path, dimension)
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
    *way, (value, _) = _way(statement, path, dimension)
    if isinstance(value, Load):
        value = value.model_copy(update={"factors": tuple((1 + change) * f for f in statement.factors_of(value))})
    elif isinstance(value, Expression):
        value = Expression(f"({value.text}) + ({float(change)!r})", value.time, value.allows_time)
    else:
        value = value + change
    for table, key in way[:0:-1]:
        if isinstance(key, int):
            value = (*table[:key], value, *table[key + 1 :])
        else:
            value = {**table, key: value} if isinstance(table, Mapping) else table.model_copy(update={key: value})
    return {str(way[0][1]): value}


def _way(statement: Statement, path: str, dimension: int) -> list[tuple[Any, str | int]]:
    """The tables on the way to a number, each with the key that leads on, and the number."""
    keys: list[str | int] = way_of(path) if PATH.fullmatch(path) else []
    if not keys or keys[0] not in statement.effects:
        raise SceneError([(path, f"is no datum of the problem that a derivative can be taken by, {_EXAMPLE}")])
    value: Any = statement.effects
    way: list[tuple[Any, str | int]] = []
    for key in keys:
        if isinstance(key, str) and isinstance(value, tuple) and len(value) == 1:  # a list of one is what is in it
            way, value = [*way, (value, 0)], value[0]
        way.append((value, key))
        if isinstance(key, int):
            value = value[key] if isinstance(value, tuple | list) and key < len(value) else None
        elif isinstance(value, Mapping):
            value = value.get(key)
        else:
            value = getattr(value, key) if key in getattr(type(value), "model_fields", ()) else None
        if value is None and key == "shift" and isinstance(keys[-1], int):
            value = (0.0,) * dimension
        if value is None:
            raise SceneError([(path, f"there is no such entry, or it has no value; {_EXAMPLE}")])
    if isinstance(value, tuple) and len(value) == 1:
        way, value = [*way, (value, 0)], value[0]
    if isinstance(value, bool) or not isinstance(value, int | float | Expression | Load):
        raise SceneError([(path, f"is no number; {_EXAMPLE}")])
    return [*way, (value, "")]
