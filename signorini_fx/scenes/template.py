"""Help for writing scene files: a scene to start from, and the JSON schemas of scenes and of
results. It does not import dolfinx.
"""

from __future__ import annotations

import inspect
import re
from importlib import resources
from types import GenericAlias
from typing import Any, get_origin
from warnings import catch_warnings, simplefilter

from pydantic import BaseModel, create_model
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from signorini_fx.extensions import EFFECTS, load_class, names_of
from signorini_fx.mechanics.effects.contact import BY_SPEED, law_by_speed
from signorini_fx.mechanics.effects.material import every_entry
from signorini_fx.mechanics.statement.base import tables
from signorini_fx.mechanics.statement.effect import Effect
from signorini_fx.mechanics.statement.mesh_sources import known_generators
from signorini_fx.mechanics.statement.settings import known_linear_algebra
from signorini_fx.quantities.summary import Summary, own_quantities
from signorini_fx.scenes.scene import Scene


def starting_scene(*, full: bool = True) -> str:
    """Return a scene file that can be solved as it is; with ``full`` it explains every key."""
    name = "template.toml" if full else "short.toml"
    return resources.files("signorini_fx.scenes").joinpath(name).read_text(encoding="utf-8")


def described() -> type[BaseModel]:
    """Return ``Scene`` with the types of all materials and of the effects of other packages, which
    are imported.
    """
    kinds = {"material": every_entry()} | {
        key: load_class(EFFECTS, key, Effect) for key in names_of(EFFECTS)
    }
    fields = {key: GenericAlias(tuple, (kind, ...)) for key, kind in kinds.items()}
    typed: dict[str, Any] = {
        key: (kind, ... if key == "material" else ()) for key, kind in fields.items()
    }
    with catch_warnings():  # these keys shadow attributes of the base class
        simplefilter("ignore", UserWarning)
        return create_model("Scene", __base__=Scene, __doc__=Scene.__doc__, **typed)


class _ForEditors(GenerateJsonSchema):
    """A generator of JSON schemas of draft 7, which editors support best, without null, which TOML
    lacks.
    """

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        described = super().default_schema(schema)
        if not isinstance(described.get("default"), str | int | float):
            described.pop("default", None)
        return described

    def tagged_union_schema(self, schema: core_schema.TaggedUnionSchema) -> JsonSchemaValue:
        described = super().tagged_union_schema(schema)
        described.pop("discriminator", None)
        return described

    def tuple_schema(self, schema: core_schema.TupleSchema) -> JsonSchemaValue:
        described = super().tuple_schema(schema)
        return described | {"items": described.pop("prefixItems", [described.get("items")])[0]}


def scene_schema() -> dict[str, Any]:
    """Return the JSON schema of scene files, with descriptions from the docstrings."""
    model = described()
    schema = model.model_json_schema(schema_generator=_ForEditors)
    by_name = {table.__name__: table for table in tables(model)}
    for name, definition in schema["$defs"].items():
        _describe(definition, by_name[name])
    laws = schema["$defs"]["Contact"]["properties"]["friction"]["oneOf"]
    for kind in map(law_by_speed, BY_SPEED):
        name = kind.__name__
        schema["$defs"][name] = kind.model_json_schema(schema_generator=_ForEditors)
        _describe(schema["$defs"][name], kind)
        laws.append({"$ref": f"#/$defs/{name}"})
    for name in (law["$ref"].rpartition("/")[2] for law in laws):
        definition = schema["$defs"][name]
        definition["required"] = ["law", *definition.get("required", [])]
    schema["$defs"]["MeshGenerator"]["properties"]["generator"]["enum"] = list(known_generators())
    schema["$defs"]["SolverSettings"]["properties"]["linear_algebra"]["enum"] = list(
        known_linear_algebra()
    )
    for name, field in model.model_fields.items():
        one_or_many = schema["properties"][name]
        if get_origin(field.annotation) is not tuple:
            continue
        schema["properties"][name] = {"anyOf": [one_or_many["items"], one_or_many]}
    _describe(schema, model)
    schema["title"] = "signorini-fx scene"
    return {"$schema": "http://json-schema.org/draft-07/schema#", **schema}


def summary_schema() -> dict[str, Any]:
    """Return the JSON schema of summary.json in result folders, with the quantities of other
    packages.
    """
    schema = Summary.model_json_schema()
    schema["properties"]["scene"] |= {
        "properties": {name: {} for name in Scene.model_fields}
        | {
            "forms": {
                "description": "Of a `ContactProblem` the forms that it was given, in place of "
                "what they hold."
            }
        },
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


def _describe(definition: dict[str, Any], model: type[BaseModel]) -> None:
    """Add the descriptions of a class and of its keys, from the docstrings, to a schema."""
    meanings: dict[str, str] = {}
    for ancestor in reversed(model.__mro__):
        meanings |= (
            _attributes(inspect.getdoc(ancestor) or "") if issubclass(ancestor, BaseModel) else {}
        )
    definition["description"] = _plain((inspect.getdoc(model) or "").split("\n\n")[0])
    for key, entry in definition["properties"].items():
        if key in meanings and "$ref" not in entry:
            entry["description"] = meanings[key]


def _attributes(doc: str) -> dict[str, str]:
    """Return the entries of the section Attributes of a Google docstring."""
    _, _, section = doc.partition("Attributes:\n")
    entries = re.findall(r"^    (\w+): (.*(?:\n {5,}.*)*)", section, flags=re.MULTILINE)
    return {name: _plain(meaning) for name, meaning in entries}


def _plain(text: str) -> str:
    return " ".join(text.replace("``", "'").split())
