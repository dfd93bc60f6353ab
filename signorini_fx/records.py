"""Outcomes and records of a solve: plain data without solver types."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from typing import Literal

import numpy as np

from signorini_fx.machine.compilation import seconds_compiled


def _on_first_rank(_: logging.LogRecord) -> bool:
    """Return whether this rank writes the log."""
    from signorini_fx.machine.terminal import started_as_root

    return started_as_root()


# The log of solves: linear solves at level DEBUG, all else at INFO.
_LOG = logging.getLogger("signorini_fx")
_LOG.addFilter(_on_first_rank)

# The beginning of events about a requested accuracy.
ACCURACY = "accuracy: "
# The beginning of the reason why an accuracy cannot be requested.
NO_ACCURACY = "a requested accuracy "
# The beginnings of events about the length of load steps with friction that falls with the speed:
# of a failed step, and of one whose solution may not be unique.
TOO_SHORT = "friction falls faster than the body gives way in a load step: "
MAY_JUMP = "friction falls with the speed, so that sliding may jump within a load step: "

# The figures of a certificate that decide whether it holds.
JUDGED = (
    "equilibrium",
    "supports",
    "negative_pressure",
    "friction_cone",
    "wrong_way_slip",
    "entered",
    "pressure_at_distance",
    "slip_below_bound",
    "coupling",
)
# The text of a note if the error of load steps in time is not estimated.
STEPS_UNESTIMATED = "the error of the load steps is not estimated"

# The other figures: the regularisation error, and how far the body moves.
REPORTED = ("displacement", "penetration", "complementarity", "stick_slip")


class Status(Enum):
    """The outcome of a solve; each has an ``advice``.

    Examples:
        >>> print(solution.status is sfx.Status.CONVERGED, solution.status.value)
        True converged
    """

    CONVERGED = "converged"
    MAX_ITERATIONS = "maximum iterations reached"
    OUTER_MAX_ITERATIONS = "maximum outer iterations reached"
    CYCLING = "active sets cycle"
    NOT_HELD = "body not held"
    OPEN = "contact opens, no static equilibrium"
    TIPS = "tips over, no static equilibrium"
    SLIDES = "slides, no static equilibrium"
    SLIDES_AT_PRESSURES = "slides at the contact pressures found"
    JUMPS = "sliding jumps"
    SINGULAR = "linear system singular"
    NOT_FINITE = "numbers not finite"
    LINEAR_SOLVER = "linear solver failed"
    NO_MEMORY = "memory ends before a solution"
    ROUND_OFF = "residual stagnates"
    TOO_LARGE = "deformation too large for linear elasticity"
    INVERTED = "cells turned inside out"
    INSIDE = "rigid shape inside the body"
    CORNER = "corner of a foundation inside the body"
    PASSED = "bodies inside each other"
    CROSSED = "body passes through itself"
    FOLDED = "contact partner ambiguous"
    AT_END = "slid off the end of the other surface"
    WORN = "worn too deep for the mesh"
    RUNS_AWAY = "heat runs away"
    UNSTABLE = "unstable equilibrium"
    STABILITY_UNKNOWN = "stability unknown"
    LIMIT = "no equilibrium found beyond a load"
    NOT_SOLVED = "not solved"
    NO_DIGIT = "result below round-off"
    NOT_CERTIFIED = "certificate does not hold"
    BUDGET = "budget ends before the accuracy"
    MEMORY = "memory ends before the accuracy"
    OUT_OF_REACH = "accuracy out of reach"
    COARSER = "solved on a coarser mesh only"

    @property
    def advice(self) -> str:
        """What to do about this outcome."""
        return _ADVICE[self]


_LESS_ACCURATE = (
    "this is a certified solution on the last mesh that has one, less accurate than required"
)
_ADVICE = {
    Status.CONVERGED: "the active sets repeat and the residual is small",
    Status.MAX_ITERATIONS: "raise solver.max_iterations, or lower solver.gamma_n and "
    "solver.gamma_t",
    Status.OUTER_MAX_ITERATIONS: (
        "the friction iteration does not converge for this coefficient: set solver.coulomb = "
        "'newton', lower loads that friction cannot hold, or raise solver.max_outer_iterations"
    ),
    Status.CYCLING: "set solver.sigma = 'auto' (a node then passes through stick), or lower "
    "solver.gamma_n, gamma_t",
    Status.NOT_HELD: "neither supports nor contact resist a rigid motion: prescribe a "
    "displacement or add friction",
    Status.OPEN: (
        "the load moves the body off its foundation and nothing else holds it: check the "
        "direction of the loads and "
        "the gap, or prescribe a displacement"
    ),
    Status.TIPS: (
        "the load turns the body about the edge of its contact, which no friction can prevent: "
        "lower the load, let it "
        "act closer to the contact, or prescribe a displacement"
    ),
    Status.SLIDES: (
        "friction cannot balance the tangential load, the whole contact slips: lower the load, "
        "raise the friction, or "
        "prescribe a displacement"
    ),
    Status.SLIDES_AT_PRESSURES: (
        "friction at the contact pressures that were found cannot carry the loads (the events "
        "list the share; nothing is proved of other pressures): lower the load, raise friction "
        "or pressure, or find the limit by load_steps"
    ),
    Status.JUMPS: (
        "take longer load steps, hold the sliding part more stiffly, lower friction or let it fall "
        "over a larger range of speeds; inertia follows the motion during a jump"
    ),
    Status.SINGULAR: "check that supports and contact hold the body, and that no cell of the mesh "
    "is degenerate",
    Status.NOT_FINITE: "matrix or forces contain infinite or undefined numbers: check "
    "expressions, units, flat cells",
    Status.LINEAR_SOLVER: (
        "the Krylov method did not converge: set solver.linear_algebra = 'full', which takes the "
        "memory for a factor, "
        "or look with -- -sfx_ksp_monitor -sfx_ksp_converged_reason"
    ),
    Status.NO_MEMORY: (
        "the memory was used up by the factor of the matrix: use a larger machine, a coarser "
        "mesh, or in 3D "
        "solver.linear_algebra = 'krylov'; ulimit -a shows limits, and signorini-fx check what a "
        "scene needs"
    ),
    Status.TOO_LARGE: (
        "strains, rotations or displacements are too large for small strains: check the units of "
        "E, of the "
        "loads and of the lengths, the gap, the supports, and whether friction can hold the body; "
        "solver.largest_deformation is the limit"
    ),
    Status.INVERTED: (
        "the displacement that was tried has no finite residual, or is on the other side of one "
        "that has none: take smaller steps, a finer mesh where the body is squeezed, or an energy "
        "that grows without limit as the volume vanishes"
    ),
    Status.UNSTABLE: (
        "this equilibrium is unstable: the body would snap away. Round off a sharp corner where "
        "it begins; give a slender body an imperfection, such as a small traction across it; "
        "take a material that keeps its stiffness; prescribe a displacement in place of a force"
    ),
    Status.INSIDE: (
        "a rigid shape is inside the body, or has passed through it: start with the shape outside "
        "the body (reverse the points of a polyline if it is on the wrong side), move it in "
        "smaller steps, and take facets that are not wider than the shape"
    ),
    Status.CORNER: (
        "a corner between two nodes has no contact point: round it off with a radius of two "
        "facets or more, or take smaller facets"
    ),
    Status.RUNS_AWAY: (
        "the contact becomes hotter than it can lose: less speed, friction or expansion, or more "
        "conduction out of the body"
    ),
    Status.WORN: (
        "the depth is added to the gap, and cells keep their shape: take larger cells along the "
        "contact, less slip, or remesh the worn body"
    ),
    Status.PASSED: (
        "a body is inside another one, or has passed through it, outside the named contacts: "
        "start with the bodies apart, move them in smaller steps, name all sides that may touch, "
        "and give a larger reach"
    ),
    Status.CROSSED: (
        "a part of the body is inside another part of it, where no contact is named: stop before "
        "they meet, or name both as the sides of a contact (against), which may be the same"
    ),
    Status.FOLDED: "the other surface folds over, so that a point has two partners: take smaller "
    "steps, or give a smaller reach",
    Status.AT_END: (
        "the bilateral contact has left the other surface: stop earlier, take smaller steps, or "
        "name more of the other side"
    ),
    Status.STABILITY_UNKNOWN: (
        "the result is an equilibrium whose stability is unknown: J is not the derivative of F, "
        "loads that follow the body have no energy, or the memory is too small for a factor of "
        "J. Give the derivative of F as J, or set stability=False"
    ),
    Status.LIMIT: (
        "where a force acts prescribe its displacement, to follow the body beyond a limit point; "
        "else refine the mesh, allow a smaller step, or take a material that keeps its stiffness "
        "under compression, as neo-Hooke does"
    ),
    Status.NOT_SOLVED: (
        "Newton's method fails, which does not prove that there is no solution: take smaller load "
        "steps, prescribe a displacement instead of a force, or refine the mesh"
    ),
    Status.NO_DIGIT: (
        "round-off of the residual is as large as the effect of the loads: evaluate strains from "
        "grad u, without the difference of numbers near one such as I + grad u, or take a linear "
        "body"
    ),
    Status.NOT_CERTIFIED: (
        "conditions of the problem are violated in the check after the solve: see the "
        "certificate in the summary; lower solver.gamma_n and solver.gamma_t, with Coulomb "
        "friction solver.tolerance, or mend flat cells"
    ),
    Status.BUDGET: f"raise the budget, or require less: {_LESS_ACCURATE}",
    Status.MEMORY: f"use a larger machine, or require less: {_LESS_ACCURATE}",
    Status.OUT_OF_REACH: (
        "require less, or the accuracy of the energy or of a force: no finer mesh would help; "
        f"{_LESS_ACCURATE}"
    ),
    Status.COARSER: "the finer mesh did not converge: see the events, or require less: "
    f"{_LESS_ACCURATE}",
    Status.ROUND_OFF: "gamma is too large for double precision: lower solver.gamma_n and "
    "solver.gamma_t",
}


# The outcomes of a certified solution that is less accurate than required.
SHORT_OF_ACCURACY = (Status.BUDGET, Status.MEMORY, Status.OUT_OF_REACH, Status.COARSER)
# Outcomes that hold for the body itself: statics excludes a solution, or its deformation is too
# large. A solution on a coarser mesh does not refute them.
OF_THE_BODY = (Status.NOT_HELD, Status.OPEN, Status.TIPS, Status.SLIDES, Status.TOO_LARGE)


@dataclass(frozen=True)
class IterationRecord:
    """A linear solve of the semi-smooth Newton iteration (Algorithm SSN, step 4).

    Attributes:
        step: number of the load step, from 1.
        solve: running number of the linear solve, from 1.
        outer: running number of the outer iteration, from 0.
        iteration: number k of the inner iteration, from 1.
        active_contact: number of nodes in A_c of this solve.
        slip_plus: number of nodes in A_f,+ of this solve.
        slip_minus: number of nodes in A_f,- of this solve.
        changed: number of nodes whose state changes in this solve, i.e. between sets k and k + 1.
        residual: Euclidean norm of the residual after this solve with the new sets, relative to the
            acting forces.
        factorised: whether the matrix was factorised again.
        seconds: wall time since the solve began, on this rank.
    """

    step: int
    solve: int
    outer: int
    iteration: int
    active_contact: int
    slip_plus: int
    slip_minus: int
    changed: int
    residual: float
    factorised: bool
    seconds: float

    def __str__(self) -> str:
        """Return a row of the table of iterations."""
        return (
            f"{self.solve:5d}  {self.outer:5d} {self.iteration:5d} {self.active_contact:8d} "
            f"{self.slip_plus:7d} {self.slip_minus:7d} {self.changed:8d}   {self.residual:8.1e}  "
            f"{self.seconds:8.3f}"
        )


@dataclass(frozen=True)
class OuterRecord:
    """An outer iteration, that is, the solution of one regularised problem.

    Attributes:
        step: number of the load step, from 1.
        outer: running number from 0.
        linear_solves: number of its linear solves.
        gamma_n: gamma_1 of the problem, stress per length; infinite where it is not regularised.
        change: the quantity in the stopping criterion of the outer algorithm (FP: d_g of section
            7); None: not defined yet.
        status: how the inner solve ended.
    """

    step: int
    outer: int
    linear_solves: int
    gamma_n: float
    change: float | None
    status: str

    def __str__(self) -> str:
        change = "" if self.change is None else f", change of the friction bound {self.change:.2e}"
        solves = f"{self.linear_solves} linear solve{'s' * (self.linear_solves != 1)}"
        return f"{self.outer:5d}  {self.status} after {solves}{change}"


@dataclass
class Timings:
    """Wall seconds by phase on this rank, of this run and of the run that it continues."""

    seconds: dict[str, float] = field(
        default_factory=dict
    )  # ``parallel.largest_timings`` reduces them

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the time spent inside the ``with`` block to the phase ``name``; time spent on
        compilation is added to ``compile`` instead.
        """
        start = time.perf_counter()
        compiled = seconds_compiled()
        try:
            yield
        finally:
            compiled = seconds_compiled() - compiled
            elapsed = time.perf_counter() - start - compiled
            for phase, seconds in ((name, elapsed), ("compile", compiled)):
                if seconds or phase == name:
                    self.seconds[phase] = self.seconds.get(phase, 0.0) + seconds


@dataclass(frozen=True)
class StepRecord:
    """The beginning of a load step.

    Attributes:
        step: its number, from 1.
        name: its name; "": it has none.
        time: its time.
    """

    step: int
    name: str
    time: float

    def __str__(self) -> str:
        return (
            f"load step {self.step} ({self.name + ', ' if self.name else ''}time {self.time:.6g})"
        )


Record = IterationRecord | OuterRecord | StepRecord | str
Observer = Callable[[Record], None]


@dataclass(repr=False)
class History:
    """The records of a solve, in order.

    Attributes:
        iterations: one record per linear solve.
        outer: one record per regularised problem.
        events: messages about decisions of the solver, such as a fall-back.
        observers: functions that are called with each new record or event, and when a load step
            begins, to show progress.
        limit: the number of linear solves at which all methods end; infinite: no limit.
        is_late: returns whether the time limit of the solve has passed, the same on all ranks;
            collective.
        late: whether the time limit has passed; then all methods end as well.
        step: number of the present load step, from 1.
    """

    iterations: list[IterationRecord] = field(default_factory=list)
    outer: list[OuterRecord] = field(default_factory=list)
    events: list[str] = field(default_factory=list)
    observers: list[Observer] = field(default_factory=list)
    limit: float = np.inf
    is_late: Callable[[], bool] = lambda: False
    late: bool = False
    step: int = 1

    @property
    def linear_solves(self) -> int:
        """The number of linear solves so far."""
        return len(self.iterations)

    def overdue(self) -> bool:
        """Return whether the time limit has passed; called before each linear solve; collective."""
        self.late = self.late or self.is_late()
        return self.late

    @property
    def exhausted(self) -> bool:
        """Whether the limit of linear solves or of time is reached; collective."""
        return self.linear_solves >= self.limit or self.overdue()

    @contextmanager
    def at_most(self, solves: float) -> Iterator[None]:
        """Limit the linear solves inside the ``with`` block, in addition to any limit around it."""
        outer = self.limit
        self.limit = min(outer, self.linear_solves + solves)
        try:
            yield
        finally:
            self.limit = outer

    def add(self, record: Record) -> None:
        """Store a record or an event, log it, and pass it to the observers."""
        match record:
            case IterationRecord():
                self.iterations.append(record)
            case OuterRecord():
                self.outer.append(record)
            case str():
                self.events.append(record)
            case StepRecord():  # results have their own table of load steps
                self.step = record.step
        level = logging.DEBUG if isinstance(record, IterationRecord) else logging.INFO
        _LOG.log(level, "%s", record)
        for observer in self.observers:
            observer(record)


@dataclass(frozen=True)
class Finding:
    """A warning or a note about a scene or its result.

    Attributes:
        level: a warning needs attention, a note does not.
        path: key of the scene that it concerns.
        message: what is wrong, and what to do.
        ended: for a load step without equilibrium, how it ends in a few words, such as: upper
            slides on lower; "": there is an equilibrium, or nothing moves.
    """

    level: Literal["warning", "note"]
    path: str
    message: str
    ended: str = ""

    def as_row(self) -> dict[str, str]:
        """Return the row of the summary."""
        return {"level": self.level, "path": self.path, "message": self.message}
