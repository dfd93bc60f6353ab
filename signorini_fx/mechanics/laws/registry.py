"""Friction laws by their names: those of this folder, and those of other packages, by entry points.

A package that says in its pyproject.toml

    [project.entry-points."signorini_fx.laws"]
    saturating = "its.module:Saturating"

has scenes with friction = { law = "saturating", coefficient = 0.3, largest = 2.0 }.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Discriminator, TypeAdapter, WrapValidator

from signorini_fx.extensions import LAWS, load_class, names_of
from signorini_fx.mechanics.laws.coulomb import Coulomb
from signorini_fx.mechanics.laws.none import NoFriction
from signorini_fx.mechanics.laws.protocol import FrictionLaw
from signorini_fx.mechanics.laws.tresca import Tresca

_BUILT_IN = ("none", "tresca", "coulomb")


def _named(entry: Any, kinds: Any) -> Any:
    """A law from a table; itself if it is one.

    Raises:
        InstallationError: a law of another package is none.
    """
    if isinstance(entry, FrictionLaw):
        return entry
    name = law_of(entry)
    if name not in _BUILT_IN and name in names_of(LAWS):
        return TypeAdapter(load_class(LAWS, name, FrictionLaw)).validate_python(entry)
    return kinds(entry)


def law_of(entry: Any) -> str:
    """The name of the law of a table."""
    return entry.get("law") if isinstance(entry, Mapping) else getattr(entry, "law", None)  # type: ignore[return-value]


OneLaw = Annotated[NoFriction | Tresca | Coulomb, Discriminator("law"), WrapValidator(_named)]
