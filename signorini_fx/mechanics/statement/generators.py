"""The mesh generators that a scene can name.  This module does not use dolfinx."""

from __future__ import annotations

import inspect
import pkgutil
from collections.abc import Callable, Mapping
from functools import cache, partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any, get_type_hints

from pydantic import TypeAdapter, ValidationError

from signorini_fx.errors import SceneError
from signorini_fx.extensions import GENERATORS, load, names_of
from signorini_fx.mechanics.statement.base import TaggedMeshBase, plain_message

# A generator of meshes, with parameters of its own.
Generate = Callable[..., TaggedMeshBase]
GENERATORS_PACKAGE = "signorini_fx.meshes"  # the package of this one's


def known_generators(name: str | None = None) -> dict[str, Callable[[], Generate]]:
    """Return the loaders of the generators that a scene can name, sorted by name; generators of
    this package take precedence.

    Searching all packages takes milliseconds: if ``name`` is in this package, only its generators
    are returned.
    """
    package = find_spec(GENERATORS_PACKAGE)
    folders = (
        [] if package is None else package.submodule_search_locations
    )  # the generators are an add-on
    own_names = [
        module.name for module in pkgutil.iter_modules(folders) if not module.name.startswith("_")
    ]
    others = () if name in own_names else names_of(GENERATORS)
    generators = {key: partial(load, GENERATORS, key) for key in others}
    generators |= {key: partial(_of_this_package, key) for key in own_names}
    return dict(sorted(generators.items()))


def _of_this_package(name: str) -> Generate:
    return import_module(f"{GENERATORS_PACKAGE}.{name}").generate


def found_generator(name: str, parameters: Mapping[str, Any]) -> tuple[Generate, dict[str, Any]]:
    """Return the generator of this name, and its parameters validated by its annotations.

    Raises:
        SceneError: unknown generator, or invalid parameters.
    """
    generators = known_generators(name)
    if name not in generators:
        message = f"no generator {name!r}; there are: {', '.join(generators) or 'none'}"
        raise SceneError.at("mesh.generator", message)
    try:
        generate = generators[name]()
        types_of(generate)
    except Exception as error:  # of the code of the user
        message = f"{name!r} cannot be imported: {type(error).__name__}: {error}"
        raise SceneError.at("mesh.generator", message) from error
    names = [
        key for key, p in inspect.signature(generate).parameters.items() if p.kind is p.KEYWORD_ONLY
    ]
    values = {}
    problems: list[tuple[str, str]] = []
    for key, value in parameters.items():
        path = f"mesh.parameters.{key}"
        if key not in names:
            problems.append((path, f"unknown key; there are: {', '.join(names)}"))
            continue
        try:
            values[key] = _adapter(generate, key).validate_python(value)
        except ValidationError as error:
            problems += [(path, plain_message(detail)) for detail in error.errors()]
    if problems:
        raise SceneError(problems)
    return generate, values


@cache
def types_of(generate: Generate) -> dict[str, Any]:
    """Return the annotations of a generator."""
    return get_type_hints(generate, include_extras=True)


@cache
def _adapter(generate: Generate, key: str) -> TypeAdapter[Any]:
    """Return the validator of a parameter of a generator; cached, because pydantic takes longer to
    make it than gmsh to make a mesh.
    """
    return TypeAdapter(types_of(generate).get(key, Any))
