"""The load steps of a ramp and of a path: how large they are, and what their arguments may be."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
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
    """A way through load steps: one without a solution is halved, and after an easy one the next is larger.

    Attributes:
        apply: changes a problem to what it is at a place.
        named: gives the result of a step that ends there its place and time.
        reached: where the last step has ended, or the way begins.
        step: the size of the next step.
        largest: that any step may have.
        smallest: below which no step is halved.
        last: where the way ends.
        beyond: where a step of a size ends that begins at a place.
        shown: the load or time where a step ends, for messages.
        to: the load that is to be reached; None: ends are places on a path.
        announce: called before a step is solved with where it ends.
    """

    apply: Callable[[float], object]
    named: Callable[[float, StepResult], StepResult]
    reached: float
    step: float
    largest: float
    smallest: float
    last: float
    beyond: Callable[[float, float], float]
    shown: Callable[[float], float] = lambda end: end
    to: float | None = None
    announce: Callable[[float], object] = lambda end: None

    def back(self) -> None:
        """Change the problem to what it is where the last step has ended."""
        self.apply(self.reached)

    @property
    def ended(self) -> bool:
        """Whether the way has ended."""
        return self.reached == self.last

    @property
    def next(self) -> float:
        """Where the next step ends."""
        return self.beyond(self.reached, self.step)

    @property
    def size(self) -> float:
        """That of the next step, which may have another sign."""
        return abs(self.next - self.reached)

    @property
    def may_halve(self) -> bool:
        """Whether a smaller step than the next one may be tried."""
        return self.size / 2 >= self.smallest

    def halve(self) -> None:
        """The next step has no solution."""
        self.step = self.size / 2

    def accept(self, iterations: int) -> None:
        """The next step has a solution, after so many iterations."""
        self.reached = self.next
        if iterations <= FEW_NEWTON_ITERATIONS:
            self.step *= STEP_GROWTH
        self.step = min(max(self.step, self.smallest), self.largest)


def way_on_path(
    path: LoadPath,
    apply: Callable[[float], object],
    named: Callable[[float, StepResult], StepResult],
    announce: Callable[[float], object],
) -> Way:
    """One step for each time of a path, or as many as its ramp has; ``reached`` is -1 before the first one, which
    begins at time 0 if it is halved.
    """
    whole = 1.0 / (path.steps or 1)
    first, last = whole if path.from_nothing else 1.0, len(path.times) - 1.0
    sizes = -1.0, first, whole, SMALLEST_STEP * whole, last
    return Way(apply, named, *sizes, next_place, path.time_at, announce=announce)


def way_to_load(
    to: float,
    first: float | None,
    largest: float | None,
    smallest: float,
    apply: Callable[[float], object],
    named: Callable[[float, StepResult], StepResult],
) -> Way:
    """The steps from 0 to a load, see ``NonlinearContactProblem.ramp``.

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
    if not problems:
        load = float(to)
        whole = abs(load)
        least = smallest * whole
        sizes = {name: whole if (value := given[name]) is None else float(value) for name in ("first", "largest")}
        problems += [
            (name, f"is below the smallest step, {least:g}") for name in sizes if given[name] and sizes[name] < least
        ]
    if problems:
        raise FormError(problems, "ramp")

    def beyond(reached: float, step: float) -> float:
        is_last = whole - abs(reached) - step <= SAME_NUMBER * whole
        return load if is_last else reached + math.copysign(step, load)

    first_step = min(sizes["first"], sizes["largest"])
    return Way(apply, named, 0.0, first_step, sizes["largest"], least, load, beyond, to=load)
