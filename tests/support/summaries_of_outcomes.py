"""Summaries of all outcomes, put together without a solve, with all products of what may be known
beside them.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

from signorini_fx.records import SHORT_OF_ACCURACY, Status

_LAW = "the regularised law, gamma_n = 3.16e+04, gamma_t = 3.16e+04"
_DIFFERS = (
    f"a fall-back has solved {_LAW} in place of 'alm'; raise solver.gamma_n "
    "and solver.gamma_t to "
    "reduce penetration and elastic slip, or change the loads in smaller steps"
)
_CERTIFICATE = {"holds": True, "law": "the unregularised law", "checked": 1e-6}
_STRESS = {"value": 96.0, "place": [1.25, 0.0], "region": None, "no_limit": None}
_PRICE = {"predicted": False, "energy": 0.031, "pressure": 0.012, "force": 0.0004, "seconds": 0.8}

# A summary of which everything is known, by the keys that the first lines look at.
BASE: dict[str, Any] = {
    "title": "block",
    "status": Status.CONVERGED.value,
    "converged": True,
    "advice": Status.CONVERGED.advice,
    "incomplete": [],
    "findings": [],
    "certificate": _CERTIFICATE,
    "contact_force": [0.0, 20.0],
    "friction_force": [-3.0, 0.0],
    "contact_nodes": 121,
    "touching_nodes": 61,
    "max_pressure": 31.8,
    "linear_solves": 9,
    "factorisations": 4,
    "dofs": 9922,
    "ranks": 1,
    "timings": {"iterate": 0.8},
    "scene": {
        "contact": [{"boundary": "bottom", "friction": {"law": "coulomb"}}],
        "material": [{"yield_stress": 235.0}],
    },
    "stress": {
        "von_mises": _STRESS,
        "recovered": {"von_mises": {**_STRESS, "value": 93.0}},
        "error": 0.08,
    },
    "utilisation": {"value": 0.41, "place": [1.25, 0.0], "region": None, "no_limit": None},
    "friction_used": 0.37,
    "cost": {
        **{"of": "energy", "error": 0.08, "seconds": 0.8, "dofs": 9922},
        **{"next_error": 0.008, "next_seconds": [3.0, 12.0], "next_dofs": 14_000.0},
        **{"command": "--accuracy 1.1%", "local": True},
        "statement": "8 % error of the stress took 0.8 s; 0.8 %: 3 to 12 s with --accuracy 1.1%",
    },
}


def known(**changes: Any) -> dict[str, Any]:
    """The base with some entries changed; None: that entry is not known."""
    return {key: value for key, value in (BASE | changes).items() if value is not None}


def ended(status: Status, *, step: bool = False) -> dict[str, Any]:
    """The entries of an outcome: of a single load, or of load steps of which the last one ended
    so.
    """
    changes: dict[str, Any] = {
        "status": status.value,
        "converged": status is Status.CONVERGED,
        "advice": status.advice,
    }
    solved = status is Status.CONVERGED or status in SHORT_OF_ACCURACY
    if not solved and not step:
        changes["certificate"] = {"holds": False, "law": _LAW}
    if step:
        of = {"step": 3, "name": "", "time": 0.75, "status": Status.CONVERGED.value}
        last = {"step": 4, "name": "pull", "time": 0.8125, "status": status.value}
        changes |= {"results_of": last if solved else of, "steps": [of] * 3 + [last]}
        if solved:
            changes["results_of"] = {**last, "status": Status.CONVERGED.value}
    if status in SHORT_OF_ACCURACY:
        changes["convergence_table"] = [_PRICE]
        changes["scene"] = {**BASE["scene"], "accuracy": {"target": 0.01, "of": "energy"}}
    return changes


_SINGULAR = {"no_limit": "at a reentrant corner of the body"}
# What may be known beside the outcome, by the key that says it.
STRENGTHS: dict[str, dict[str, Any]] = {
    "41 % of the yield stress": {},
    "125 % of the yield stress": {"utilisation": {**BASE["utilisation"], "value": 1.25}},
    "41 % at a corner": {
        "utilisation": {**BASE["utilisation"], **_SINGULAR},
        "stress": {**BASE["stress"], "von_mises": {**_STRESS, **_SINGULAR}},
    },
    "far above it at a corner": {
        "utilisation": {**BASE["utilisation"], "value": 280.0, **_SINGULAR},
        "stress": {**BASE["stress"], "von_mises": {**_STRESS, **_SINGULAR}},
    },
    "28 times the yield stress": {"utilisation": {**BASE["utilisation"], "value": 28.0}},
    "no yield stress": {
        "utilisation": None,
        "scene": {**BASE["scene"], "material": [{"yield_stress": None}]},
    },
    "no fields": {"utilisation": None, "stress": None},
}
STATICS: dict[str, dict[str, Any]] = {"friction used": {}, "nothing": {"friction_used": None}}
ERRORS: dict[str, dict[str, Any]] = {
    "of the stress": {},
    "none": {"stress": {"error": None}, "cost": None},
    "estimated": {"convergence_table": [_PRICE]},
    "guaranteed": {"error_bound": {"relative_error": 0.043, "guaranteed": True}},
}
LAWS: dict[str, dict[str, Any]] = {
    "as asked": {},
    "another one": {
        "findings": [{"level": "warning", "path": "solver.algorithm", "message": _DIFFERS}],
        "certificate": {"holds": True, "law": _LAW, "checked": 1e-6},
    },
}
COMPLETE: dict[str, dict[str, Any]] = {
    "whole": {},
    "incomplete": {"incomplete": ["*FILM on the surface hot"]},
}


def all_products() -> Iterator[tuple[Status, bool, tuple[str, ...], dict[str, Any]]]:
    """Every outcome, of one load and of load steps, with everything that may be known: names and
    summaries.
    """
    parts = (STRENGTHS, STATICS, ERRORS, LAWS, COMPLETE)
    for status, step, *names in product(Status, (False, True), *parts):
        changes = ended(status, step=step)
        for part, name in zip(parts, names, strict=True):
            for key, entry in part[name].items():
                before = changes.get(key, BASE.get(key))
                lost = (
                    key in changes and before is None
                )  # what is not known is not known in part either
                both = isinstance(entry, dict) and isinstance(before, dict)
                changes[key] = None if lost else {**before, **entry} if both else entry
        yield status, step, tuple(names), known(**changes)
