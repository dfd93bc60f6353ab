"""The groups of cases, in the order of the table."""

from __future__ import annotations

import importlib
from collections.abc import Iterable

from benchmarks.stability.case import Case

# Name -> what it tests; each is a module of this package.
GROUPS = {
    "regularisation": "gamma from too small to beyond round-off",
    "incompressible": "Poisson's ratio close to 1/2",
    "starts": "first sets, first multipliers, first iterates",
    "bodies": "how the body is held",
    "friction": "friction laws",
    "geometry": "foundations and meshes",
    "units": "units and scale",
    "space": "bodies in 3D",
    "scatter": "random scenes",
    "ranks": "numbers of ranks",
    "faults": "kills, interruptions, full disks, missing packages",
    "fuzz": "random scenes and mesh files",
}
# Groups whose cases run on several numbers of ranks name them here.
_RANKS: dict[str, tuple[int, ...]] = {"ranks": (1, 2, 3, 5)}
_IN_SHORT: dict[str, tuple[int, ...]] = {"ranks": (2,)}


def ranks_of(group: str, *, short: bool) -> tuple[int, ...]:
    """The numbers of ranks that cases of the group run on."""
    return (_IN_SHORT if short else _RANKS).get(group, (1,))


def cases_of(group: str, *, short: bool) -> list[Case]:
    """The cases of a group; imports its module, and with it dolfinx.

    Raises:
        ValueError: two cases have one name, or a number of ranks that the group does not have.
    """
    found: Iterable[Case] = importlib.import_module(f"benchmarks.stability.{group}").cases(short=short)
    cases = list(found)
    names = [case.name for case in cases]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ValueError(f"group {group!r} has two cases named {', '.join(sorted(twice))}")
    if lost := {case.ranks for case in cases} - set(ranks_of(group, short=short)):
        raise ValueError(f"group {group!r} has cases on {lost} ranks, which nothing runs")
    return cases
