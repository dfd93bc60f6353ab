"""The schema of summary.json, and the table of its results in the documentation."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, get_args

from signorini_fx.quantities.quantity import own_quantities
from signorini_fx.quantities.summary import Row, Run, Summary, unit_of


def schema_of_summary(tables: Iterable[str]) -> dict[str, Any]:
    """The JSON schema of summary.json with the quantities of others; ``tables``: those of a scene."""
    schema = Summary.model_json_schema()
    schema["properties"]["scene"] |= {
        "properties": {name: {} for name in tables}
        | {"forms": {"description": "Of a `ContactProblem` the forms that it was given, in place of what they hold."}},
        "additionalProperties": False,
    }
    number = {"$ref": "#/$defs/number"}
    for quantity in own_quantities():
        schema["properties"][quantity.key] = {
            "anyOf": [number, {"type": "array", "items": number}],
            "description": quantity.title,
        }
        schema["$defs"]["RowOfSteps"]["properties"][quantity.key] = number
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "summary.json of signorini_fx",
        **schema,
    }


def markdown() -> str:
    """A row of the documentation for each result, those of others included."""
    rows = [("key", "unit", "what"), ("---", "---", "---")]
    for key in [key for key in Summary.model_fields if key not in Run.model_fields and key != "steps"]:
        field = Summary.model_fields[key]
        inner = _keys_of(field.annotation)
        what = (field.description or "").rstrip(".")
        rows.append((f"`{key}`", unit_of(key), f"{what}: {', '.join(inner)}" if inner else what))
    rows += [(f"`{own.key}`", own.unit, own.title.rstrip(".")) for own in own_quantities()]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _keys_of(annotation: Any) -> list[str]:
    """The keys of the table, or of the rows of the list, that a value is."""
    kinds = [kind for kind in (annotation, *get_args(annotation)) if isinstance(kind, type)]
    return [f"`{name}`" for kind in kinds if issubclass(kind, Row) for name in kind.model_fields]
