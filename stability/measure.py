"""What the cases have in common: solving, comparing, and saying what was found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.scene import Scene, parse_scene
from signorini_fx.solution import Solution
from signorini_fx.solver import solve
from stability.case import Finding


def solved(scene: Scene | dict) -> Solution:
    """The scene solved on this rank, whatever the outcome."""
    return solve(parse_scene(scene) if isinstance(scene, dict) else scene, MPI.COMM_SELF, check=False)


def found(solution: Solution, error: float | None = None, note: str = "") -> Finding:
    """The finding of a solve."""
    certificate = solution.certificate.worst
    # A fall-back of the solver is worth a word.
    events = [event for event in solution.history.events if not event.startswith("level ")]
    solves = solution.history.linear_solves or sum(step.linear_solves for step in solution.steps)
    return Finding(solution.status.value, solves, certificate, error, "; ".join([*([note] if note else []), *events]))


def difference(ours: npt.ArrayLike, theirs: npt.ArrayLike) -> float:
    """Largest difference, relative to the largest value of the second; infinite where the shapes differ."""
    a, b = np.asarray(ours, dtype=float), np.asarray(theirs, dtype=float)
    if a.shape != b.shape:
        return np.inf
    largest = np.abs(b).max(initial=0.0)
    change = np.abs(a - b).max(initial=0.0)
    return float(change / largest if largest > 0 else change)


def apart(one: Solution, other: Solution, length: float = 1.0, stress: float = 1.0) -> float:
    """Largest relative difference of displacement, pressure and shear, ``one`` in other units."""
    assert one.contact is not None
    assert other.contact is not None
    pressure = np.stack([one.contact.pressure, one.contact.shear]) / stress
    return max(
        difference(one.displacement.x.array / length, other.displacement.x.array),
        difference(pressure, np.stack([other.contact.pressure, other.contact.shear])),
    )


def counts(solution: Solution) -> list[tuple[int, ...]]:
    """The sets of every linear solve."""
    return [(r.outer, r.active_contact, r.slip_plus, r.slip_minus, r.changed) for r in solution.history.iterations]


def column(solution: Solution, name: str) -> npt.NDArray[np.float64]:
    """A column of the contact table."""
    values: npt.NDArray[np.float64] = solution.table.columns[name]
    return values


def worst(errors: Sequence[float]) -> float:
    """The largest, where NaN is larger than anything."""
    return float(np.max(np.nan_to_num(np.asarray(errors, dtype=float), nan=np.inf)))
