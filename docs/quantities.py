"""The table of the documentation with all results of a summary."""

from __future__ import annotations

from typing import Any, get_args

from signorini_fx.quantities.summary import Row, Run, Summary, own_quantities


def markdown() -> str:
    """A row of the documentation for each result, those of others included."""
    rows = [("key", "unit", "what"), ("---", "---", "---")]
    for key in [
        key for key in Summary.model_fields if key not in Run.model_fields and key != "steps"
    ]:
        field = Summary.model_fields[key]
        inner = _keys_of(field.annotation)
        what = (field.description or "").rstrip(".")
        rows.append((f"`{key}`", _unit_of(key), f"{what}: {', '.join(inner)}" if inner else what))
    rows += [(f"`{own.key}`", own.unit, own.title.rstrip(".")) for own in own_quantities()]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _keys_of(annotation: Any) -> list[str]:
    """The keys of the table, or of the rows of the list, that a value is."""
    kinds = [kind for kind in (annotation, *get_args(annotation)) if isinstance(kind, type)]
    return [f"`{name}`" for kind in kinds if issubclass(kind, Row) for name in kind.model_fields]


def _unit_of(key: str) -> str:
    """What a figure of the summary is measured in, a word of ``units.names_of``; "": it has no
    unit, or several.
    """
    extra = Summary.model_fields[key].json_schema_extra
    return str(extra["unit"]) if isinstance(extra, dict) else ""
