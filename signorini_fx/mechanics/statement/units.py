"""Names of units for labels.  Nothing is converted: the numbers of a scene are in any consistent
units.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from types import MappingProxyType
from typing import Any

from signorini_fx.mechanics.kinematics import Kinematics, of_data

# The unit of a force that is a stress times the square of a length, where it has a name.
_FORCES = {
    ("m", "Pa"): "N",
    ("m", "kPa"): "kN",
    ("m", "MPa"): "MN",
    ("m", "GPa"): "GN",
    ("mm", "kPa"): "mN",
    ("mm", "MPa"): "N",
    ("mm", "GPa"): "kN",
    ("um", "MPa"): "uN",
    ("in", "psi"): "lbf",
    ("in", "ksi"): "kip",
}

_NAMES: ContextVar[Mapping[str, str]] = ContextVar("_NAMES", default=MappingProxyType({}))


def names_of(scene: Mapping[str, Any], dimension: int) -> dict[str, str]:
    """Return the unit of each quantity of a scene given as plain data, see ``unit_names``."""
    return unit_names(scene.get("units") or {}, of_data(scene, dimension))


def unit_names(units: Mapping[str, str | None], kinematics: Kinematics) -> dict[str, str]:
    """Return the unit of each quantity: ``length``, ``stress``, ``area``, ``force``, ``moment`` and
    ``energy``; unknown units are left out.

    The last four are per unit thickness in 2D.
    """
    names = {name: unit for name, unit in units.items() if unit}
    length = names.get("length")
    stress = names.get("stress")
    whole = kinematics.whole
    force = names.get("force") or _FORCES.get((length or "", stress or ""))
    if length:
        names["area"] = f"{length}\N{SUPERSCRIPT TWO}" if whole else length
    if force:
        names["force"] = force if whole else f"{force}/{length}" if length else ""
        names["moment"] = names["energy"] = (
            (f"{force} {length}" if length else "") if whole else force
        )
    return {name: unit for name, unit in names.items() if unit}


@contextmanager
def labelled(names: Mapping[str, str]) -> Iterator[None]:
    """Use these units in labels that are made within the context."""
    token = _NAMES.set(names)
    try:
        yield
    finally:
        _NAMES.reset(token)


def unit(quantity: str) -> str:
    """Return the name of the unit of a quantity; empty if unknown."""
    return _NAMES.get().get(quantity, "")


def bracketed(quantity: str) -> str:
    """Return the unit at the end of a label, such as `` (mm)``; empty if unknown."""
    return f" ({unit(quantity)})" if unit(quantity) else ""


def with_unit(figure: str, quantity: str) -> str:
    """Return a number, given as text, with its unit, such as ``0.3 MPa``."""
    return f"{figure} {unit(quantity)}".rstrip() if figure else figure
