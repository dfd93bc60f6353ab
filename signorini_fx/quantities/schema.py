"""The summary as a pydantic model, and the JSON schema that is made from it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pydantic import Field, create_model
from pydantic.json_schema import GenerateJsonSchema

from signorini_fx.quantities.kinds import DESCRIPTIONS, ExtremeOfStress, Number
from signorini_fx.quantities.quantity import Quantity
from signorini_fx.quantities.registry import quantities
from signorini_fx.quantities.summary_schema import RowOfSteps, Run

TITLE = "summary.json of signorini_fx"
# Definitions that stand beside the table of the summary.
_NAMED = (*DESCRIPTIONS, ExtremeOfStress.__name__)
_DRAFT = "https://json-schema.org/draft/2020-12/schema"


def summary_model() -> type[Run]:
    """A model with a field for each quantity; None: it is not there."""
    in_summary = [quantity for quantity in quantities() if quantity.stage != "never"]
    in_steps = [quantity for quantity in quantities() if quantity.steps == "number" and quantity.kind is Number]
    row = create_model("StepOfSummary", __base__=RowOfSteps, __doc__=RowOfSteps.__doc__, **_fields(in_steps))
    steps = Field(default=None, description=Run.model_fields["steps"].description)
    fields: dict[str, Any] = {**_fields(in_summary), "steps": (list[row], steps)}  # type: ignore[valid-type]
    return create_model("SummaryOfSolve", __base__=Run, **fields)


def _fields(shown: list[Quantity]) -> dict[str, Any]:
    """Without a value a field is None, which the schema does not allow for: the key is absent."""
    fields = {}
    for quantity in shown:
        default: Any = ... if quantity.scope == "all" else None
        fields[quantity.key] = (quantity.kind, Field(default, description=quantity.title))
    return fields


class _PlainSchema(GenerateJsonSchema):
    """Without defaults, which say that a key is absent."""

    def default_schema(self, schema: Any) -> Any:
        """See pydantic."""
        return self.generate_inner(schema["schema"])


def schema_of_summary(tables: Iterable[str]) -> dict[str, Any]:
    """The JSON schema of summary.json with all quantities; ``tables``: those of a scene."""
    raw = summary_model().model_json_schema(schema_generator=_PlainSchema)
    definitions = raw.pop("$defs")
    schema: dict[str, Any] = _plain(raw, definitions)
    schema["properties"]["scene"] |= {
        "properties": {name: {} for name in tables}
        | {"forms": {"description": "Of a `ContactProblem` the forms that it was given, in place of what they hold."}},
        "additionalProperties": False,
    }
    components = "|".join(sorted(quantity.key for quantity in quantities() if quantity.steps == "components"))
    schema["properties"]["steps"]["items"]["patternProperties"] = {
        f"^({components})(_[xyz])?( .+)?$": {
            "$ref": "#/$defs/number",
            "description": "Of several contacts between bodies with the boundary behind a blank.",
        }
    }
    first, *others = [quantity.key for quantity in quantities() if quantity.scope == "contact"]
    named = {_name(name): _plain(definitions[name], definitions) for name in _NAMED}
    for name, description in DESCRIPTIONS.items():
        named[name]["description"] = description
    return {
        "$schema": _DRAFT,
        **schema,
        "title": TITLE,
        "dependentRequired": {first: sorted(others)},
        "$defs": named,
    }


def _name(definition: str) -> str:
    """Of a definition in the schema."""
    return "extreme" if definition == ExtremeOfStress.__name__ else definition


def _plain(node: Any, definitions: dict[str, Any]) -> Any:
    """Without titles, and with tables where they are used but for those that are named."""
    if isinstance(node, list):
        return [_plain(item, definitions) for item in node]
    if not isinstance(node, dict):
        return node
    name = str(node.get("$ref", "")).rpartition("/")[2]
    if name in _NAMED:
        return {**node, "$ref": f"#/$defs/{_name(name)}"}
    if name:
        inner = {key: value for key, value in node.items() if key != "$ref"}
        return _plain({**definitions[name], **inner}, definitions)
    plain = {
        key: {name: _plain(value, definitions) for name, value in entry.items()}
        if key == "properties"
        else _plain(entry, definitions)
        for key, entry in node.items()
        if key != "title" or not isinstance(entry, str)
    }
    if "properties" in plain:
        plain |= {"additionalProperties": False, "required": sorted(plain.get("required", []))}
    return plain
