"""One number of a problem with several values: a solve for each of them, and a table.

The problem is an entry of a scene, or forms, or a residual with another value of a Constant: each is a function that
solves it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.errors import SceneError
from signorini_fx.machine.csv_text import write_csv
from signorini_fx.mechanics.statement.changes import Changes, parsed_change
from signorini_fx.records import Status
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import ZERO_IN_SOLUTION

# The figures of a row.
FIGURES = (
    "contact_force",
    "friction_force",
    "max_pressure",
    "max_shear",
    "contact_area",
    "stick_area",
    "strain_energy",
)
# Everything that a study writes.
FILES = ("sweep.csv",)
_COMMA = re.compile(r",(?![^()]*\))")  # between values, and not between the arguments of a function
_RANGE = re.compile(r"\s*([-+.\deE]+)\s*:\s*([-+.\deE]+)\s*:\s*(\d{1,5})\s*")


@dataclass(frozen=True)
class ParameterStudy:
    """What came out.

    Attributes:
        entry: the path of the entry of the scene that has several values, or its name.
        rows: of each value in order: ``value``, ``status``, ``linear_solves``, ``certificate_holds`` and ``FIGURES``:
            sizes of the contact and friction force (per thickness in 2D), between bodies the sum of those of all
            boundaries, areas in contact and of what sticks (in 2D lengths); not a number where there is no
            solution.  With several load steps also ``solved_until``, the time of the last one with a solution: where a
            ramp ends without one, its limit.
    """

    entry: str
    rows: tuple[dict[str, Any], ...]

    @property
    def solved(self) -> bool:
        """Whether every value has a solution."""
        return all(row["status"] == Status.CONVERGED.value for row in self.rows)


def several(changes: Changes) -> tuple[str, list[Any]]:
    """The one entry that has several values, its path and the values: ``0.1:0.8:8``, from, to, and how many of them at
    equal distances, or ``0.1,0.2,0.4``.

    Raises:
        SceneError: none has, or more than one, or a range is wrong.
    """
    ranges = {path: values for path, value in changes.items() if len(values := _values(path, value)) > 1}
    if len(ranges) != 1:
        reason = f"these have: {', '.join(ranges)}" if ranges else "none has"
        example = "such as --set contact[0].friction.coefficient=0.1:0.8:8 or 0.1,0.2,0.4"
        raise SceneError([("sweep", f"one entry must have several values, {example}; {reason}")])
    return ranges.popitem()


def _values(path: str, value: Any) -> list[Any]:
    if not isinstance(value, str):
        return [value]
    if match := _RANGE.fullmatch(value):
        try:
            first, last = float(match[1]), float(match[2])
        except ValueError:
            raise SceneError([(path, f"{value!r} is no range: FROM:TO:COUNT is expected, such as 0.1:0.8:8")]) from None
        return [float(f"{entry:.12g}") for entry in np.linspace(first, last, int(match[3]))]
    return [parsed_change(f"value={entry}")[1] for entry in _COMMA.split(value)]


def run(
    entry: str, problems: Sequence[tuple[Any, Callable[[], Solution]]], report: Callable[[str], object]
) -> ParameterStudy:
    """Solve each problem; collective.

    Args:
        entry: the name of what has several values.
        problems: each value, and what solves the problem that has it, to the last iterate if there is no solution.
        report: told a line of text at each one.
    """
    names = "  ".join(f"{name:>14s}" for name in FIGURES).replace("_", " ")
    report(f"{entry}\n{'value':>12s}  {names}  outcome")
    rows = []
    for value, solved in problems:
        solution = solved()
        rows.append({"value": value, **figures_of(solution)})
        row = rows[-1]
        # Without contact there are no figures of it.
        figures = "  ".join(f"{row[name]:14.6g}" if name in row else f"{'-':>14s}" for name in FIGURES)
        limit = f" after time {row['solved_until']:g}" if "solved_until" in row and not solution.converged else ""
        report(f"{value!s:>12s}  {figures}  {solution.status.value}{limit}")
    return ParameterStudy(entry, tuple(rows))


def figures_of(solution: Solution) -> dict[str, Any]:
    """The row of a solution, with no figure without one; collective."""
    # That of a nonlinear body nobody knows.
    energy = solution.last_step.strain_energy
    figures = {"strain_energy": float("nan") if energy is None else energy}
    if solution.contact is not None:
        columns = solution.table.columns
        touching = columns["state"] != "open"
        # Between bodies each force acts on another one, so that their sum says nothing.
        between = any(effect.against for effect in solution.statement.contact)
        forces = solution.contact.forces_of_each if between else np.array([solution.contact.forces])
        contact, friction = map(float, np.linalg.norm(forces, axis=2).sum(axis=0))
        figures |= {
            "contact_force": contact,
            "friction_force": friction if friction > ZERO_IN_SOLUTION * contact else 0.0,
        }
        figures["max_pressure"] = float(columns["pressure"].max(initial=0.0))
        figures["max_shear"] = float(np.abs(columns["shear"]).max(initial=0.0))
        figures["contact_area"] = float(columns["weight"][touching].sum())
        figures["stick_area"] = float(columns["weight"][touching & (columns["friction"] == "stick")].sum())
    if not solution.converged:
        figures = dict.fromkeys(figures, float("nan"))
    history, recorded = solution.history, solution.contact is not None  # without contact there are no iterations
    solves = history.linear_solves if recorded else sum(step.linear_solves for step in solution.steps)
    outcome: dict[str, Any] = {"status": solution.status.value, "linear_solves": solves}
    if solution.statement.several_steps:
        times = [step.time for step in solution.steps if step.status is Status.CONVERGED]
        outcome["solved_until"] = times[-1] if times else float("nan")
    return {**outcome, "certificate_holds": solution.certificate.holds, **figures}


def write(study: ParameterStudy, folder: Path) -> None:
    """Write sweep.csv."""
    write_csv(folder / "sweep.csv", study.rows)
