"""The load steps of a ramp and of a path: how large they are, and what their arguments may be."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Protocol

from signorini_fx.errors import FormError
from signorini_fx.mechanics.statement.load_steps import LoadPath
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.tuned import FEW_NEWTON_ITERATIONS, SAME_LENGTH, SAME_NUMBER, SMALLEST_STEP, STEP_GROWTH

# Places are rounded to these digits, so that ten tenths are one.
_DIGITS = 12


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


class StepEnds(Protocol):
    """Where the steps of a way end, one after the other."""

    @property
    def reached(self) -> float:
        """Where the last step has ended."""

    @property
    def done(self) -> bool:
        """Whether the way has ended."""

    @property
    def next(self) -> float:
        """Where the next step ends."""

    @property
    def may_halve(self) -> bool:
        """Whether a smaller step than the next one may be tried."""

    def halve(self) -> None:
        """The next step has no solution."""

    def reach(self, end: float) -> None:
        """The next step ends there, farther on."""

    def accept(self, iterations: int, *, grows: bool = True) -> None:
        """The next step has a solution, after so many iterations; ``grows``: whether the one after it may be larger."""


class PathSizes:
    """The places of the steps along a path, see ``statement.load_steps``: one for each of its times, or as many as its
    ramp has.

    A step without a solution is halved, the one to the first time, too, which begins at time 0.  After an easy one the
    next is larger again, but not beyond what the path asks for.

    Attributes:
        reached: the place of the last step; -1 before the first one.
    """

    def __init__(self, path: LoadPath) -> None:
        self._last, self._whole = len(path.times) - 1, 1.0 / (path.steps or 1)
        self.reached, self._step = -1.0, self._whole if path.from_nothing else 1.0

    def stored(self) -> dict[str, float]:
        """What ``resume`` needs, as plain data."""
        return {"reached": self.reached, "step": self._step}

    def resume(self, position: Mapping[str, float]) -> None:
        """Go on from where an earlier run has come to, see ``stored``."""
        self.reached, self._step = position["reached"], position["step"]

    @property
    def done(self) -> bool:
        """See ``StepEnds``."""
        return self.reached >= self._last

    @property
    def next(self) -> float:
        """See ``StepEnds``: no step goes beyond the next time."""
        station = math.floor(self.reached + SAME_LENGTH) + 1.0
        end = round(self.reached + self._step, _DIGITS)
        return station if end > station - SAME_LENGTH else end

    @property
    def may_halve(self) -> bool:
        """See ``StepEnds``."""
        return (self.next - self.reached) / 2 >= SMALLEST_STEP * self._whole

    def halve(self) -> None:
        """See ``StepEnds``."""
        self._step = (self.next - self.reached) / 2

    def reach(self, end: float) -> None:
        """See ``StepEnds``."""
        self._step = end - self.reached

    def accept(self, iterations: int, *, grows: bool = True) -> None:
        """See ``StepEnds``."""
        self.reached = self.next
        if grows and iterations <= FEW_NEWTON_ITERATIONS:
            self._step = self._step * STEP_GROWTH
        self._step = min(max(self._step, SMALLEST_STEP * self._whole), self._whole)


class StepSizes:
    """The sizes of the steps from 0 to a load, which may be negative.

    Args:
        to: the load to reach.
        first: size of the first step; None: all of it.
        largest: size that any step may have; None: there is none.
        smallest: share of ``to`` below which no step is halved.

    Attributes:
        reached: how far the last step went.

    Raises:
        FormError: an argument is none of these.
    """

    def __init__(self, to: float, first: float | None, largest: float | None, smallest: float) -> None:
        problems = list[tuple[str, str]]()

        def number(name: str, value: object, wanted: str, *, positive: bool) -> float:
            fits = isinstance(value, Real) and not isinstance(value, bool)
            if not fits:
                problems.append((name, f"must be {wanted}, not {kind_of(value)}"))
                return 1.0
            size = float(value)  # type: ignore[arg-type]
            if not math.isfinite(size) or (size <= 0 if positive else size == 0):
                problems.append((name, f"must be {wanted}, not {value}"))
            return size

        self._to = number("to", to, "a number other than 0", positive=False)
        whole, size = abs(self._to), "a positive number, the size of a step"
        self._largest = whole if largest is None else number("largest", largest, size, positive=True)
        step = whole if first is None else number("first", first, size, positive=True)
        share = number("smallest", smallest, f"a share of the load from {SAME_NUMBER:g} to 1", positive=True)
        if not problems and not SAME_NUMBER <= share <= 1:
            problems.append(("smallest", f"must be a share of the load from {SAME_NUMBER:g} to 1, not {smallest}"))
        self._smallest = share * whole
        sizes = (("first", first, step), ("largest", largest, self._largest))
        if not problems:
            problems += [
                (name, f"is below the smallest step, {self._smallest:g}")
                for name, given, value in sizes
                if given is not None and value < self._smallest
            ]
        if problems:
            raise FormError(problems, "ramp")
        self.reached, self._step = 0.0, min(step, self._largest)

    @property
    def done(self) -> bool:
        """Whether the load is reached."""
        return self.reached == self._to

    @property
    def next(self) -> float:
        """How far the next step goes."""
        left = abs(self._to) - abs(self.reached)
        if left - self._step <= SAME_NUMBER * abs(self._to):
            return self._to
        return self.reached + math.copysign(self._step, self._to)

    @property
    def may_halve(self) -> bool:
        """Whether a smaller step than the next one may be tried."""
        return abs(self.next - self.reached) / 2 >= self._smallest

    def halve(self) -> None:
        """The next step has no solution."""
        self._step = abs(self.next - self.reached) / 2

    def reach(self, end: float) -> None:
        """See ``StepEnds``."""
        self._step = abs(end - self.reached)

    def accept(self, iterations: int, *, grows: bool = True) -> None:
        """The next step has a solution, after so many iterations; ``grows``: whether the one after it may be larger."""
        self.reached = self.next
        if grows and iterations <= FEW_NEWTON_ITERATIONS:
            self._step = min(self._step * STEP_GROWTH, self._largest)
        self._step = max(self._step, self._smallest)
