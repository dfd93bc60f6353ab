"""The way through the load steps, up to the limit load where there is one: the next place, smaller increments where
there is no solution, larger ones after.

``forms.nonlinear.step_sizes`` is that of nonlinear bodies.  That no load beyond a limit can be held is proved by
statics, see ``algebra.contact.statics``.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import floor

from signorini_fx.algebra.attempts import step_limit
from signorini_fx.mechanics.statement.load_path import LoadPath, next_place
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import Status
from signorini_fx.tuned import (
    EASY_STEP,
    ENCLOSED,
    FAILED_RAMP,
    FAILED_STEP,
    LARGEST_INCREMENT,
    SAME_LENGTH,
    SMALLEST_INCREMENT,
)

# Outcomes that another increment of the load does not change if nothing has been reached before.  Afterwards the same
# linear solver has solved the same body, and fails because the tangents near a limit load are nearly singular.
_HOPELESS_AT_FIRST = (Status.NOT_HELD, Status.LINEAR_SOLVER, Status.NO_MEMORY)


class Increments:
    """Where a problem is on its path through load steps; places are those of ``statement.load_path``.

    Without a ramp every time is a load step, and one without a solution ends the way.  In a ramp its increment is
    halved, until the load is enclosed between one with and one without a solution.  The linear solves of the last load
    step set how many an attempt without one may take.

    Args:
        path: the load steps.
        settings: of the solver.

    Attributes:
        reached: the place of the last load step with a solution; -1 before the first one.
        increment: from there to the next one.
        easy: how many of the last ones were easy.
        last: linear solves of the last load step with a solution.
    """

    def __init__(self, path: LoadPath, settings: SolverSettings) -> None:
        self._last, self._time = len(path.times) - 1, path.time_at
        self._iterations = settings.max_iterations
        self._divided, self._from_nothing = path.steps is not None, path.from_nothing
        self._nominal = 1.0 / (path.steps or 1)
        # A list of several factors begins with one step to the first of them, in which slip is counted from rest.
        self.reached, self.increment = -1.0, self._nominal if path.from_nothing else 1.0
        self.easy = self.last = 0

    @property
    def ended(self) -> bool:
        """Whether the last load step has been solved."""
        return self.reached >= self._last

    @property
    def next(self) -> float:
        """The place of the next load step; none goes beyond the next factor."""
        return next_place(self.reached, self.increment)

    @property
    def _divisible(self) -> bool:
        return self._divided and (self._from_nothing or self.reached >= 0)

    @property
    def _encloses(self) -> bool:
        """Whether the increment is not divided any more."""
        reached = self.reached
        begun = reached - floor(reached + SAME_LENGTH) if reached >= 0 else reached + 1.0
        return self.next - reached <= max(ENCLOSED * begun, SMALLEST_INCREMENT * self._nominal)

    @property
    def allowed(self) -> int:
        """Linear solves that the next load step may take."""
        if not self._divisible:
            return step_limit(self._iterations)
        # One at which nothing changes takes two, which is no measure for one that fails.
        before_smaller = FAILED_STEP * (max(self.last, EASY_STEP) if self.last else self._iterations)
        return FAILED_RAMP * before_smaller if self._encloses else before_smaller

    def bracket(self, status: Status) -> str | None:
        """Between which loads a ramp has ended whose last load step has this status; None where no ramp or no load is
        the reason.
        """
        if self._is_final(status):
            return None
        nothing = self.reached == (-1.0 if self._from_nothing else 0.0)
        held = "without any load" if nothing else f"at time {self._time(self.reached):.6g}"
        return f"there is a solution {held}, and none at time {self._time(self.next):.6g}"

    def _is_final(self, status: Status) -> bool:
        """Whether a load step that ended with ``status`` has no solution for any increment."""
        return not self._divisible or (self.reached < 0 and status in _HOPELESS_AT_FIRST)

    def advance(self, linear_solves: int) -> None:
        """The next load step has a solution, which took this many linear solves."""
        divisible, enclosed = self._divisible, self._encloses
        self.reached, self.last = self.next, linear_solves
        if not self._divided:
            return
        if not divisible:
            self.increment = self._nominal
            return
        self.easy = self.easy + 1 if linear_solves <= EASY_STEP else 0
        if (self.easy > 1 or enclosed) and self.increment < LARGEST_INCREMENT * self._nominal:
            self.increment, self.easy = 2 * self.increment, 0

    def resume(self, position: Mapping[str, float]) -> None:
        """Go on from where an earlier run has come to, see ``stored``."""
        self.reached, self.increment = position["reached"], position["increment"]
        self.easy, self.last = int(position["easy"]), int(position["last"])

    def stored(self) -> dict[str, float]:
        """What ``resume`` needs, as plain data."""
        return {name: getattr(self, name) for name in ("reached", "increment", "easy", "last")}

    def shorten(self, status: Status) -> bool:
        """Halve the increment, because the next load step ended with ``status``; whether a smaller one may be tried:
        not where the load is enclosed.
        """
        if self._is_final(status) or self._encloses:
            return False
        self.increment, self.easy = (self.next - self.reached) / 2, 0
        return True
