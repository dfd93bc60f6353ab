"""Materials by their keys: those of this folder, and those of other packages, by entry points.

A package that says in its pyproject.toml

    [project.entry-points."signorini_fx.materials"]
    "transversely isotropic" = "its.module:TransverselyIsotropic"

has scenes with [material] law = "transversely isotropic" and the keys of this class.  Linear materials of this folder
are known by their keys alone, nonlinear ones by their law.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import TypeAdapter, WrapValidator

from signorini_fx.extensions import MATERIALS, load_class, names_of
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.mechanics.materials.j2 import J2
from signorini_fx.mechanics.materials.mooney_rivlin import MooneyRivlin
from signorini_fx.mechanics.materials.neo_hooke import NeoHooke
from signorini_fx.mechanics.materials.ogden import Ogden
from signorini_fx.mechanics.materials.orthotropic import OrthotropicElastic
from signorini_fx.mechanics.materials.protocol import Material
from signorini_fx.mechanics.materials.saint_venant_kirchhoff import SaintVenantKirchhoff

NONLINEAR: Mapping[str, type[Material]] = {
    "j2": J2,
    "mooney-rivlin": MooneyRivlin,
    "neo-hooke": NeoHooke,
    "ogden": Ogden,
    "saint-venant-kirchhoff": SaintVenantKirchhoff,
}


def _named(entry: Any, kinds: Any) -> Any:
    """A material from a table; itself if it is one.

    Raises:
        InstallationError: that of another package is none.
        ValueError: there is no such material.
    """
    if isinstance(entry, Material) or not isinstance(entry, Mapping):
        return entry if isinstance(entry, Material) else kinds(entry)
    material: Any = OrthotropicElastic if "orthotropic" in entry else LinearElastic
    name = entry.get("law")
    if isinstance(name, str) and name in NONLINEAR:
        material = NONLINEAR[name]
    elif name is not None:
        if name not in (known := names_of(MATERIALS)):
            added = f", those of other packages: {', '.join(known)}" if known else ""
            cure = f"leave law out, or take another one: {', '.join(NONLINEAR)}{added}"
            raise ValueError(f"there is no material {name!r}: {cure}")
        material = load_class(MATERIALS, name, Material)
    return TypeAdapter(material).validate_python(entry)


OneMaterial = Annotated[
    LinearElastic | OrthotropicElastic | NeoHooke | SaintVenantKirchhoff | MooneyRivlin | Ogden | J2,
    WrapValidator(_named),
]
