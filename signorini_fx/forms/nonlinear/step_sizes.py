"""The load steps of a ramp and of a path: how large they are, and what the arguments of a ramp may be."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

from signorini_fx.errors import FormError
from signorini_fx.mechanics.statement.load_path import LoadPath, next_place
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.results.mechanics import StepResult
from signorini_fx.tuned import FEW_NEWTON_ITERATIONS, SAME_NUMBER, SMALLEST_STEP, STEP_GROWTH


@dataclass(frozen=True)
class RampStep:
    """One step of a ramp.

    Attributes:
        load: how far it goes.
        iterations: of Newton's method.
        linear_solves: all of them, those of the contact included.
    """

    load: float
    iterations: int
    linear_solves: int


@dataclass
class Way:
    """A way along a path: a step without a solution is halved, and after an easy one the next is larger.

    The first step begins at time 0 if it is halved.

    Attributes:
        path: with whose places steps end.
        apply: changes a problem to what it is at a place.
        step: the size of the next step.
        largest: that any step may have.
        smallest: below which no step is halved.
        kind: what times are called.
        sign: times it they are shown.
        reached: where the last step has ended, or the way begins.
    """

    path: LoadPath
    apply: Callable[[float], object]
    step: float
    largest: float
    smallest: float
    kind: str = "time"
    sign: float = 1.0
    reached: float = -1.0

    @classmethod
    def along(cls, path: LoadPath, apply: Callable[[float], object]) -> Way:
        """One step for each time of a path, or as many as its ramp has."""
        whole = 1.0 / (path.steps or 1)
        return cls(path, apply, whole if path.from_nothing else 1.0, whole, SMALLEST_STEP * whole)

    def named(self, end: float, step: StepResult) -> StepResult:
        """The result of a step that ends at a place."""
        return replace(step, place=end, time=self.path.time_at(end), name=self.path.name_at(end))

    def shown(self, place: float) -> str:
        """The time of a place, in words."""
        return f"{self.kind} {self.sign * self.path.time_at(place):g}"

    @property
    def ended(self) -> bool:
        """Whether the way has ended."""
        return self.reached == len(self.path.times) - 1.0

    @property
    def next(self) -> float:
        """Where the next step ends."""
        return next_place(self.reached, self.step)

    @property
    def may_halve(self) -> bool:
        """Whether a smaller step than the next one may be tried."""
        return (self.next - self.reached) / 2 >= self.smallest

    def halve(self) -> None:
        """The next step has no solution."""
        self.step = (self.next - self.reached) / 2

    def accept(self, iterations: int) -> None:
        """The next step has a solution, after so many iterations."""
        self.reached = self.next
        if iterations <= FEW_NEWTON_ITERATIONS:
            self.step *= STEP_GROWTH
        self.step = min(max(self.step, self.smallest), self.largest)


def way_to_load(
    to: float, first: float | None, largest: float | None, smallest: float, apply: Callable[[float], object]
) -> Way:
    """The steps from 0 to a load, see ``NonlinearContactProblem.ramp``; ``apply`` takes loads.

    Raises FormError: an argument is wrong.
    """
    size, share = "a positive number, the size of a step", f"a share of the load from {SAME_NUMBER:g} to 1"
    given: dict[str, Any] = {"to": to, "first": first, "largest": largest, "smallest": smallest}
    wanted = {"to": "a number other than 0", "first": size, "largest": size, "smallest": share}
    problems = list[tuple[str, str]]()
    for name, value in given.items():
        if value is None and name in ("first", "largest"):
            continue
        if not isinstance(value, Real) or isinstance(value, bool):
            problems.append((name, f"must be {wanted[name]}, not {kind_of(value)}"))
        elif not math.isfinite(value) or value == 0 or (value < 0 and name != "to"):
            problems.append((name, f"must be {wanted[name]}, not {value}"))
    if not problems and not SAME_NUMBER <= smallest <= 1:
        problems.append(("smallest", f"must be {share}, not {smallest}"))
    if problems:
        raise FormError(problems, "ramp")
    whole, sign = abs(float(to)), math.copysign(1.0, to)
    begin, most = (1.0 if value is None else float(value) / whole for value in (first, largest))
    problems += [
        (name, f"is below the smallest step, {smallest * whole:g}")
        for name, part in (("first", begin), ("largest", most))
        if part < smallest
    ]
    if problems:
        raise FormError(problems, "ramp")
    path = LoadPath((whole,), steps=1, from_nothing=True)
    sizes = min(begin, most), most, float(smallest)
    return Way(path, lambda place: apply(sign * path.time_at(place)), *sizes, "load", sign)
