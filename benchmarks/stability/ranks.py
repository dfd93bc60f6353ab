"""Ranks: the same answer and the same named outcome on 1, 2, 3 and 5, some without cells or contact facets; no hang."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.stability.case import Case, Finding
from benchmarks.stability.measure import counts, difference, found
from benchmarks.stability.scenes import LAWS, example1
from signorini_fx.errors import SignoriniError
from signorini_fx.records import Status
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

RANKS = (1, 2, 3, 5)
_TRIANGLES = {"generator": "rectangle", "parameters": {"cell": "triangle"}}
_GMSH = {"generator": "block", "parameters": {"layout": "unstructured", "cell": "triangle"}}
_UP = [{"boundary": "top", "y": 20.0}]
_SIDEWAYS = [{"boundary": "top", "x": 20.0, "y": -20.0}]

# What each scene changes in Example 1 with 60 x 20 cells.
SOLVED: dict[str, dict[str, Any]] = {
    **{law: {"law": law} for law in LAWS},
    "Coulomb, monolithic": {"law": "Coulomb", "coulomb": "newton"},
    "path-following": {"algorithm": "path-following"},
    "continuation": {"algorithm": "continuation"},
    "ALM": {"algorithm": "alm"},
    "ALM-FP": {"law": "Coulomb", "algorithm": "alm"},
    "nested": {"law": "Coulomb", "levels": 3},
    "P2": {"mesh": _TRIANGLES, "element": {"degree": 2}},
    "gmsh": {"mesh": _GMSH},
    "held by friction": {"nx": 30, "ny": 10, "displacement": []},
    "contact on one rank": {"law": "Coulomb", "nx": 2, "ny": 60},
    "rank without contact facets": {"law": "Coulomb", "nx": 3, "ny": 3},
    "rank without cells": {"law": "Coulomb", "nx": 2, "ny": 1},
    "one cell": {"law": "Coulomb", "nx": 1, "ny": 1},
}
# The outcomes of scenes without a solution, and of scenes with an error.
ENDED: dict[str, tuple[str, dict[str, Any]]] = {
    "pulled off": (Status.OPEN.value, {"displacement": [], "traction": _UP}),
    "slides away": (Status.SLIDES.value, {"displacement": [], "traction": _SIDEWAYS}),
    "not held": (Status.NOT_HELD.value, {"displacement": [], "law": "frictionless"}),
    "one iteration": (Status.MAX_ITERATIONS.value, {"max_iterations": 1, "fallbacks": False}),
    "no such boundary": ("SceneError", {"contact": [{"boundary": "foot"}]}),
    "gap not finite on some rank": ("SceneError", {"contact": [{"boundary": "bottom", "gap": "sqrt(x[0] - 0.1)"}]}),
    "no such mesh": ("MeshError", {"mesh": {"file": "/nonexistent.msh"}}),
    "no such generator": ("SceneError", {"mesh": {"generator": "torus"}}),
    "mesh too large": ("SceneError", {"mesh": {"generator": "rectangle", "parameters": {"nx": 20000, "ny": 20000}}}),
}
# On a few cells the residual of the last step is 1e-10 of the forces (up to 1e-8 is accepted), on any number of ranks.
_COARSE, _COARSE_TARGET = ("rank without contact facets",), 1e-9
_TABLES = ("displacement", "traction", "contact", "mesh")


def cases(*, short: bool) -> Iterator[Case]:
    """Every scene on every number of ranks."""
    for ranks in (2,) if short else RANKS:
        for name in ("Coulomb", "one cell") if short else SOLVED:
            yield Case(
                f"{name}, {ranks} rank{'s' * (ranks > 1)}",
                partial(_compared, _scene(SOLVED[name])),
                target=_COARSE_TARGET if name in _COARSE else 1e-10,
                reference="one rank",
                ranks=ranks,
            )
        for name in ("pulled off", "no such boundary") if short else ENDED:
            outcome, changes = ENDED[name]
            yield Case(
                f"{name}, {ranks} rank{'s' * (ranks > 1)}",
                partial(_compared, _scene(changes)),
                wanted=(outcome,),
                ranks=ranks,
            )


def _scene(changes: dict[str, Any]) -> dict[str, Any]:
    tables = {name: value for name, value in changes.items() if name in _TABLES}
    settings = {name: value for name, value in changes.items() if name not in _TABLES or name == "mesh"}
    if "mesh" in tables and not ("cell" in str(tables["mesh"]) or "layout" in str(tables["mesh"])):
        settings.pop("mesh")
    else:
        tables.pop("mesh", None)
    return {**example1(**settings), **tables}


def _attempt(data: dict[str, Any], comm: MPI.Comm) -> Solution | SignoriniError:
    try:
        return solve(parse_scene(data), comm, check=False)
    except SignoriniError as error:
        return error


def _outcome(answer: Solution | SignoriniError) -> str:
    return type(answer).__name__ if isinstance(answer, SignoriniError) else answer.status.value


def _compared(data: dict[str, Any]) -> Finding:
    """All ranks together, and this rank alone."""
    world = MPI.COMM_WORLD
    together, alone = _attempt(data, world), _attempt(data, MPI.COMM_SELF)
    said = [_outcome(alone), *world.allgather(_outcome(together))]
    if len(set(said)) > 1:
        return Finding(f"ranks disagree: {', '.join(dict.fromkeys(said))}")
    if isinstance(together, SignoriniError) or isinstance(alone, SignoriniError):
        texts = set(world.allgather(str(together)))
        return Finding(said[0] if len(texts) == 1 else "ranks disagree in their words", note=str(together)[:80])
    error = _apart(together, alone) if together.converged else None
    same = all(world.allgather(counts(together) == counts(alone)))
    return found(together, error, "" if same else "other sets on the way than on one rank")


def _apart(together: Solution, alone: Solution) -> float:
    """Largest difference in pressure and shear, in displacement of the contact nodes, and in energy."""
    ours, theirs = together.table.columns, alone.table.columns
    pairs = (("pressure", "shear"), ("u_n", "u_t"), ("x", "y"))
    errors = [difference(*(np.stack([table[name] for name in names]) for table in (ours, theirs))) for names in pairs]
    energies = (together.steps[-1].strain_energy, alone.steps[-1].strain_energy)
    return float(MPI.COMM_WORLD.allreduce(max(*errors, difference(*energies)), op=MPI.MAX))
