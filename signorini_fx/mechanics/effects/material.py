"""The materials of a scene: finds the class of each by its keys, in ``materials`` or another
package.

Linear materials of ``materials`` are recognised by their keys, all others by their law.  Only the
files of the materials in use are imported.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from importlib import import_module
from operator import or_
from types import UnionType
from typing import Annotated, Any

from pydantic import BeforeValidator, TypeAdapter

from signorini_fx.extensions import MATERIALS, load_class, names_of
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.mechanics.materials.protocol import Material

# Files and classes of nonlinear materials, by law.
NONLINEAR = {
    "j2": ("path_dependent", "J2"),
    "maxwell": ("path_dependent", "Maxwell"),
    "mooney-rivlin": ("hyperelastic", "MooneyRivlin"),
    "neo-hooke": ("hyperelastic", "NeoHooke"),
    "ogden": ("hyperelastic", "Ogden"),
    "saint-venant-kirchhoff": ("hyperelastic", "SaintVenantKirchhoff"),
}
_ORTHOTROPIC = "orthotropic", "OrthotropicElastic"


def _of_file(file: str, name: str) -> type[Material]:
    """Import a file of ``materials`` and return one of its classes."""
    kind: type[Material] = getattr(import_module(f"signorini_fx.mechanics.materials.{file}"), name)
    return kind


def _class_of(entry: Mapping[str, Any]) -> type[Material]:
    """Return the material class for a table."""
    name = entry.get("law")
    if name is None:
        return _of_file(*_ORTHOTROPIC) if "orthotropic" in entry else LinearElastic
    if name in NONLINEAR:
        return _of_file(*NONLINEAR[name])
    if name not in (known := names_of(MATERIALS)):
        added = f", those of other packages: {', '.join(known)}" if known else ""
        cure = f"leave law out, or take another one: {', '.join(NONLINEAR)}{added}"
        raise ValueError(f"there is no material {name!r}: {cure}")
    return load_class(MATERIALS, name, Material)


def read_material(entry: object) -> Material:
    """Return the material that a table describes; a material is returned unchanged."""
    if isinstance(entry, Material):
        return entry
    return TypeAdapter(
        _class_of(entry) if isinstance(entry, Mapping) else LinearElastic
    ).validate_python(entry)


def every_entry() -> type[Material] | UnionType:
    """Return the union type of all materials of this package, for help and messages.

    It imports all of them.
    """
    return reduce(
        or_, (_of_file(*place) for place in (_ORTHOTROPIC, *NONLINEAR.values())), LinearElastic
    )


Entry = Annotated[Any, BeforeValidator(read_material)]
