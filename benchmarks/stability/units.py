"""Units and scale: the same scene in other units takes the same linear solves to the same answer."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from typing import Any

from benchmarks.stability.case import Case, Finding
from benchmarks.stability.measure import apart, counts, found, solved
from benchmarks.stability.scenes import LAWS, example1
from signorini_fx.results.solution import Solution

# (length, stress): one unit of the paper in the other units.
UNITS = {
    "mm, N, MPa": (1e3, 1e-6),
    "km, GN": (1e-3, 1e-3),
    "E = 1e-3": (1.0, 1e-3 / 5000),
    "E = 1e15": (1.0, 1e15 / 5000),
    "3e-9 long": (1e-9, 1.0),
    "3e6 long": (1e6, 1.0),
    "3e-9 long, E = 1e15": (1e-9, 1e15 / 5000),
    "3e6 long, E = 1e-3": (1e6, 1e-3 / 5000),
}
_GMSH = {"generator": "block", "parameters": {"layout": "unstructured"}}
# Methods, each with the settings that select it.
WAYS: dict[str, dict[str, Any]] = {
    **{law: {"law": law} for law in LAWS},
    "Coulomb, monolithic": {"law": "Coulomb", "coulomb": "newton"},
    "path-following": {"algorithm": "path-following"},
    "continuation": {"algorithm": "continuation"},
    "ALM": {"algorithm": "alm"},
    "ALM-FP": {"law": "Coulomb", "algorithm": "alm"},
    "nested": {"law": "Coulomb", "levels": 3},
    "full": {"linear_algebra": "full"},
    "Krylov": {"linear_algebra": "krylov"},
    "P2": {"element": {"degree": 2}, "mesh": {"generator": "rectangle", "parameters": {"cell": "triangle"}}},
    "gmsh": {"mesh": _GMSH},
}


def cases(*, short: bool) -> Iterator[Case]:
    """Every method in every unit; the short form has the extreme units only."""
    for way in ("Tresca", "Coulomb", "ALM-FP") if short else WAYS:
        for unit in ("3e-9 long, E = 1e15", "3e6 long, E = 1e-3") if short else UNITS:
            yield Case(
                f"{way}, {unit}",
                partial(_scaled, way, *UNITS[unit]),
                target=1e-8,
                reference="the scene in the paper's units, same sets in every solve",
            )


@cache
def _reference(way: str) -> Solution:
    return solved(_scene(way))


def _scene(way: str, **units: float) -> dict[str, Any]:
    return example1(**{"nx": 36, "ny": 12, **WAYS[way], **units})


def _scaled(way: str, length: float, stress: float) -> Finding:
    here, there = _reference(way), solved(_scene(way, length=length, stress=stress))
    if counts(there) != counts(here):
        return found(there, float("inf"), f"other sets than in the paper's units ({here.history.linear_solves} solves)")
    return found(there, apart(there, here, length, stress))
