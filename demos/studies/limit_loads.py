"""Limit loads in 3D with several contacts: what a ramp beyond the limit finds, and what its end costs.

    ./env python3 demos/studies/limit_loads.py

Dead loads press each body into its contacts, a live one pulls it beyond what Coulomb friction holds.  Statics proves
none of these limits: another pressure with the same resultant could hold the body.  The table compares the bracket in
which a ramp ends with a limit that shares no line with the package, and the work of the attempts without a solution
with that of the load steps with one.  The exit code is 1 if a bracket is wider than 1 %, if it is further than that
from the limit, or if the attempts without a solution took more than 5 times the work.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.optimize import linprog

from signorini_fx.records import IterationRecord, OuterRecord, Progress, Record, Status, StepRecord
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve

Values = npt.NDArray[np.float64]
WIDEST, FURTHEST, MOST_WORK = 0.01, 0.01, 5.0
# The bounds of the programme meet to this share; cutting planes at most.
_DIGITS, _CUTS = 1e-4, 500


@dataclass(frozen=True)
class Case:
    """A body, and what is known of its limit without a solution.

    Attributes:
        scene: a ramp of its live load from time 0 to time 1.
        dead, live: forces and the points where they act, both of shape (3,).
        limit: the time at which it slides, by hand; None: by ``limit_by_programme``.
    """

    scene: Scene
    dead: Sequence[tuple[Sequence[float], Sequence[float]]]
    live: tuple[Sequence[float], Sequence[float]]
    limit: float | None = None


def pulled(
    mesh: dict[str, Any], young: float, coefficient: float, contacts: Sequence[str], dead: Any, live: Any
) -> Scene:
    """A body on several contacts: the dead loads first, then the live one in ten increments."""
    friction = {"law": "coulomb", "coefficient": coefficient}
    return parse_scene(
        {
            "mesh": mesh,
            "material": {"young": young, "poisson": 0.3},
            "traction": [*({**load, "live": False} for load in dead), {**live, "factors": [0.0, 1.0]}],
            "contact": [{"boundary": name, "friction": friction} for name in contacts],
            "load_steps": {"steps": 10, "times": [0.0, 1.0]},
        }
    )


def corner(coefficient: float, cells: int = 6, beyond: float = 1.3) -> Case:
    """A cube in a corner of three walls that is pulled away from one of them.

    It slides along the other two, straight away from the first, which has opened.  All friction is then opposite to the
    pull, so that nothing but the loads presses: the limit is F times their sum, and what pressed into the first wall.
    """
    down, side, back = 5.0, 2.0, 1.0
    pull = beyond * (coefficient * (down + side) + back)
    size = {"length": 1.0, "width": 1.0, "height": 1.0, "nx": cells, "ny": cells, "nz": cells}
    dead = ({"boundary": "top", "z": -down}, {"boundary": "back", "y": -side}, {"boundary": "right", "x": -back})
    return Case(
        pulled(
            {"generator": "box", "parameters": size},
            5000.0,
            coefficient,
            ("left", "front", "bottom"),
            dead,
            {"boundary": "right", "x": pull},
        ),
        [((0, 0, -down), (0.5, 0.5, 1)), ((0, -side, 0), (0.5, 1, 0.5)), ((-back, 0, 0), (1, 0.5, 0.5))],
        ((pull, 0, 0), (1, 0.5, 0.5)),
        1 / beyond,
    )


def bracket(contact_size: float = 2.0, size: float = 5.0, pull: float = 12.0) -> Case:
    """A bracket, bolted through its foot, that is pulled against a stop at its toe and along it; N, mm."""
    mesh = {"generator": "bracket", "parameters": {"contact_size": contact_size, "size": size}}
    bolt, ring, leg = 54.76, np.pi * (10.0**2 - 5.5**2), 8.0 * 40.0
    live = {"boundary": "top", "x": 0.5 * pull, "y": pull}
    return Case(
        pulled(mesh, 210000.0, 0.2, ("foot", "toe"), [{"boundary": "seat", "z": -bolt}], live),
        [((0, 0, -bolt * ring), (37, 0, 8))],
        ((0.5 * pull * leg, pull * leg, 0), (4, 0, 50)),
    )


def plate(cells: int = 80, layers: int = 3, beyond: float = 1.3, *, aside: bool = False) -> Case:
    """A plate on a base between two rails, clamped at four places, and pulled off one rail.

    Pulled at its whole side it slides straight along the other rail: the limit is F times the loads that press, as
    that of the cube.  Pulled beside its middle it turns as well.  The clamps end at edges of cells if ``cells`` is a
    multiple of 20.
    """
    size = {"length": 10.0, "width": 10.0, "height": 0.5, "nx": cells, "ny": cells, "nz": layers}
    clamp, side, coefficient = 20.0, 4.0, 0.2
    down, across = 4 * 2.5**2 * clamp, side * 10 * 0.5
    force = beyond * coefficient * (down + across)
    pull = force / (10 * 0.5)
    clamped = f"{-clamp} if 1 <= abs(x[0] - 5) <= 3.5 and 1 <= abs(x[1] - 5) <= 3.5 else 0"
    return Case(
        pulled(
            {"generator": "box", "parameters": size},
            70000.0,
            coefficient,
            ("left", "front", "bottom"),
            ({"boundary": "top", "z": clamped}, {"boundary": "back", "y": -side}),
            {"boundary": "right", "x": f"{2 * pull} if x[1] >= 5 else 0" if aside else pull},
        ),
        [((0, 0, -down), (5, 5, 0.5)), ((0, -across, 0), (5, 10, 0.25))],
        ((force, 0, 0), (10, 7.5 if aside else 5, 0.25)),
        None if aside else 1 / beyond,
    )


CASES: dict[str, Callable[[], Case]] = {
    "corner of three walls, F = 0.3": lambda: corner(0.3),
    "corner of three walls, F = 0.6": lambda: corner(0.6),
    "bracket with bolt and stop": bracket,
    "plate between two rails": plate,
    "plate between two rails, pulled aside": lambda: plate(cells=40, aside=True),
}


# --- the limit for given friction bounds ------------------------------------------------------------------------------


def limit_by_programme(case: Case, solution: Solution) -> float:
    """The time at which the body moves away as a rigid one, with the friction bounds of the last load step.

    It is the least of sum g_i |v_i| - (power of the dead loads) over all rigid motions v that press nothing into the
    foundation and on which the live load has the power 1.  The sum is convex: cutting planes replace it by linear
    programmes, whose values are bounds from below; the sum itself is one from above.
    """
    columns = solution.table.columns
    x = np.column_stack([columns[name] for name in ("x", "y", "z")])
    normal = np.column_stack([columns[name] for name in ("n_x", "n_y", "n_z")])
    centre, size = x.mean(axis=0), float(np.ptp(x, axis=0).max())

    def work(loads: Sequence[tuple[Sequence[float], Sequence[float]]]) -> Values:
        return np.sum(
            [np.asarray(force) @ motions((np.asarray([at]) - centre) / size)[0] for force, at in loads], axis=0
        )

    bound = columns["weight"] * columns["bound"]
    unit = float(bound.sum())
    bound, dead, live = bound / unit, work(case.dead) / unit, work([case.live]) / unit
    modes = motions((x - centre) / size)
    away = np.einsum("ij,ijk->ik", normal, modes)
    along = modes - normal[:, :, None] * away[:, None, :]
    flat = np.column_stack((away, np.zeros(len(x))))
    reach = 1e3 / float(np.linalg.norm(live))
    cuts: list[Values] = []
    lower, upper = 0.0, np.inf
    for _ in range(_CUTS):
        found = linprog(
            np.append(-dead, 1.0),
            A_ub=np.vstack((flat, *(np.append(cut, -1.0) for cut in cuts))),
            b_ub=np.zeros(len(flat) + len(cuts)),
            A_eq=np.append(live, 0.0)[None],
            b_eq=[1.0],
            bounds=[(-reach, reach)] * 6 + [(0, None)],
            method="highs",
        )
        slip = along @ found.x[:6]
        speed = np.linalg.norm(slip, axis=1)
        lower, upper = max(lower, found.fun), min(upper, float(bound @ speed - dead @ found.x[:6]))
        if upper - lower <= _DIGITS * upper:
            return upper
        cuts.append(np.einsum("i,ij,ijk->k", bound / np.maximum(speed, 1e-300), slip, along))
    raise ArithmeticError(f"the bounds {lower} and {upper} do not meet")


def motions(x: Values) -> Values:
    """Three translations and three rotations about the origin at points x, shape (n, 3, 6)."""
    turns = np.cross(np.eye(3)[None], x[:, None, :])
    return np.concatenate((np.broadcast_to(np.eye(3), (len(x), 3, 3)), turns.transpose(0, 2, 1)), axis=2)


# --- what a ramp takes ------------------------------------------------------------------------------------------------


@dataclass
class Work:
    """What load steps, or attempts at them, took.

    Attributes:
        attempts: how many there were.
        problems: regularised problems.
        solves: linear solves, each a step of Newton's method.
        inner: steps of Krylov methods in them.
        seconds: wall time.
    """

    attempts: int = 0
    problems: int = 0
    solves: int = 0
    inner: int = 0
    seconds: float = 0.0

    def __add__(self, other: Work) -> Work:
        return Work(*(one + two for one, two in zip(astuple(self), astuple(other), strict=True)))


class Meter:
    """Notes what each attempt at a load step takes: an observer of a solve, and of its progress."""

    def __init__(self) -> None:
        self.attempts: list[tuple[float, Work]] = []
        self._before, self._krylov = time.perf_counter(), 0

    def __call__(self, record: Record) -> None:
        """An event of the history."""
        if isinstance(record, StepRecord):
            self.attempts.append((record.time, Work(attempts=1)))
        if self.attempts:
            work, now = self.attempts[-1][1], time.perf_counter()
            work.problems += isinstance(record, OuterRecord)
            work.solves += isinstance(record, IterationRecord)
            if isinstance(record, IterationRecord):
                work.inner, self._krylov = work.inner + self._krylov, 0
            work.seconds += now - self._before
        self._before = time.perf_counter()

    def watch(self, progress: Progress) -> None:
        """A step of a Krylov method."""
        self._krylov = max(self._krylov, progress.krylov)


@dataclass(frozen=True)
class Row:
    """A ramp and its end.

    Attributes:
        name: the case.
        dofs: unknowns.
        contacts: contact nodes.
        limit: time at which the body slides, by hand or programme.
        held, failed: the bracket: times with and without a solution.
        status: how the last attempt ended.
        end: what the history says about the end of the ramp.
        below: work of the load steps with a solution.
        beyond: work of the attempts without.
    """

    name: str
    dofs: int
    contacts: int
    limit: float
    held: float
    failed: float
    status: Status
    end: str
    below: Work
    beyond: Work

    @property
    def width(self) -> float:
        """Of the bracket, relative to the limit."""
        return (self.failed - self.held) / self.limit

    @property
    def ratio(self) -> float:
        """The larger one of the work beyond the limit over that below it, in linear solves and in Krylov steps."""
        pairs = ((self.beyond.solves, self.below.solves), (self.beyond.inner, self.below.inner))
        return max(beyond / below for beyond, below in pairs if below)

    @property
    def misses(self) -> list[str]:
        """What is not as it should be."""
        found = []
        if not 0 < self.width <= WIDEST:
            found.append("width")
        if not (1 - FURTHEST) * self.limit <= self.held < self.failed <= (1 + FURTHEST) * self.limit:
            found.append("limit")
        if self.ratio > MOST_WORK:
            found.append("work")
        if not self.end.startswith("the ramp ends: there is a solution"):
            found.append("reason")
        return found


def measured(name: str, case: Case) -> Row:
    """Run a ramp beyond its limit, on this rank."""
    meter = Meter()
    solution = solve(case.scene, MPI.COMM_SELF, check=False, observers=[meter], on_progress=meter.watch)
    held = {step.time for step in solution.steps if step.status is Status.CONVERGED}
    good: dict[float, int] = {time: k for k, (time, _) in enumerate(meter.attempts) if time in held}
    works = [work for _, work in meter.attempts]
    below = sum((works[k] for k in good.values()), Work())
    beyond = sum((work for k, work in enumerate(works) if k not in good.values()), Work())
    return Row(
        name=name,
        dofs=solution.model.dofs,
        contacts=len(case.scene.contact),
        limit=case.limit or limit_by_programme(case, solution),
        held=solution.last_step.time,
        failed=solution.steps[-1].time,
        status=solution.status,
        end=solution.history.events[-1],
        below=below,
        beyond=beyond,
    )


def table(rows: Sequence[Row]) -> str:
    """The rows as a table in Markdown."""
    lines = [
        "| scene | unknowns | contacts | limit | solution at | none at | width | below | beyond | ratio | ends with |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        works = [
            f"{w.attempts} steps, {w.solves} solves, {w.inner} inner, {w.seconds:.1f} s"
            for w in (row.below, row.beyond)
        ]
        missed = f" **missed: {', '.join(row.misses)}**" if row.misses else ""
        cells = (
            row.name,
            f"{row.dofs:,}",
            str(row.contacts),
            f"{row.limit:.4f}",
            f"{row.held:.4f}",
            f"{row.failed:.4f}",
            f"{row.width:.2%}",
            *works,
            f"{row.ratio:.2f}",
            row.status.value + missed,
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--case", choices=CASES, action="append", help="only this one")
    options = parser.parse_args()
    rows = []
    for name in options.case or CASES:
        rows.append(measured(name, CASES[name]()))
        print(f"{name}: {rows[-1].end}", flush=True)
    print(table(rows))
    return int(any(row.misses for row in rows))


if __name__ == "__main__":
    sys.exit(main())
