"""The way through the load steps, up to the limit load where there is one: the next place, smaller increments where
there is no solution, larger ones after.

``Increments`` also decides about fall-backs, which a linear body has; ``forms.nonlinear.step_sizes`` is the simpler one
of nonlinear bodies.  That no load beyond a limit can be held is proved by statics, see ``algebra.contact.statics``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
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
# Outcomes that are proved: no start of the iteration changes them.
_PROVED = (Status.SLIDES, Status.TIPS, Status.OPEN)


@dataclass(frozen=True)
class Position:
    """What a way through load steps has come to: all that decides about the rest of it.

    Attributes:
        reached: the place of the last load step with a solution; -1 before the first one.
        increment: from there to the next one.
        easy: how many of the last ones were easy.
        failed: the lowest place beyond ``reached`` without a solution; None: there is none.
        limit: whether no other start leads to that place, or to one beyond it: statics proves that it has no solution,
            or two different starts have failed there.
        last: linear solves of the last load step with a solution.
        hard: whether a load step was solved by fall-backs where no increment was small enough without them.
    """

    reached: float = -1.0
    increment: float = 1.0
    easy: int = 0
    failed: float | None = None
    limit: bool = False
    last: int = 0
    hard: bool = False


class Increments:
    """Where a problem is on its path through load steps; places are those of ``statement.load_path``.

    Without a ramp every time is a load step, and one without a solution ends the way.  In a ramp its increment is
    halved, until the load is enclosed between one with and one without a solution.  The linear solves of the last load
    step set how many an attempt without one may take.

    Args:
        path: the load steps.
        settings: of the solver.

    Attributes:
        at: where it is.
    """

    def __init__(self, path: LoadPath, settings: SolverSettings) -> None:
        self._last, self._time = len(path.times) - 1, path.time_at
        self._iterations = settings.max_iterations
        self._step_limit = step_limit(self._iterations)
        self._divided = path.steps
        # A list of several factors begins with one step to the first of them, in which slip is counted from rest.
        self._from_nothing = path.from_nothing
        self._nominal = 1.0 if self._divided is None else 1.0 / self._divided
        self._begin = Position(increment=self._nominal if self._from_nothing else 1.0)
        self.at = self._begin

    @property
    def reached(self) -> float:
        """The place of the last load step with a solution; -1 before the first one."""
        return self.at.reached

    @property
    def ended(self) -> bool:
        """Whether the last load step has been solved."""
        return self.at.reached >= self._last

    @property
    def next(self) -> float:
        """The place of the next load step; none goes beyond the next factor.

        Below a limit it is halfway there, and the limit itself only once it is enclosed: it has failed before.
        """
        at = self.at
        step = next_place(at.reached, at.increment)
        if not at.limit or at.failed is None or step < at.failed - SAME_LENGTH:
            return step
        width = at.failed - at.reached
        return at.failed if width <= self._enclosed else next_place(at.reached, width / 2)

    @property
    def _divisible(self) -> bool:
        return self._divided is not None and (self._from_nothing or self.at.reached >= 0)

    @property
    def _enclosed(self) -> float:
        """The increment that is not divided any more."""
        reached = self.at.reached
        begun = reached - floor(reached + SAME_LENGTH) if reached >= 0 else reached + 1.0
        return max(ENCLOSED * begun, SMALLEST_INCREMENT * self._nominal)

    @property
    def allowed(self) -> int:
        """Linear solves that the next load step may take."""
        if not self._divisible:
            return self._step_limit
        # One at which nothing changes takes two, which is no measure for one that fails.
        before_smaller = FAILED_STEP * (max(self.at.last, EASY_STEP) if self.at.last else self._iterations)
        return before_smaller if self.without_fall_backs else FAILED_RAMP * before_smaller

    @property
    def without_fall_backs(self) -> bool:
        """Whether only the methods themselves are tried at the next load step, because a smaller increment may do: that
        at an increment which is not divided any more has all fall-backs.
        """
        return self._divisible and not (self.at.hard or self.next - self.at.reached <= self._enclosed)

    @property
    def bracket(self) -> str | None:
        """Between which loads a ramp has ended without a solution; None where no ramp or no load is the reason."""
        at = self.at
        if not self._divisible or at.failed is None:
            return None
        held = "without any load" if at.reached == self._begin.reached else f"at time {self._time(at.reached):.6g}"
        return f"there is a solution {held}, and none at time {self._time(at.failed):.6g}"

    def advance(self, linear_solves: int) -> None:
        """The next load step has a solution, which took this many linear solves."""
        at, step = self.at, self.next
        done = replace(at, reached=step, last=linear_solves)
        if self._divided is not None and not self._divisible:
            done = replace(done, increment=self._nominal)
        elif self._divided is not None:
            easy = at.easy + 1 if linear_solves <= EASY_STEP else 0
            grows = easy > 1 and at.increment < LARGEST_INCREMENT * self._nominal
            done = replace(done, increment=2 * at.increment if grows else at.increment, easy=0 if grows else easy)
        if self._divisible and at.failed is not None and not self.without_fall_backs:
            done = replace(done, hard=True, increment=self._nominal)
        if at.failed is not None and step >= at.failed - SAME_LENGTH:
            done = replace(done, failed=None, limit=False)
        self.at = done

    def resume(self, position: Mapping[str, float]) -> None:
        """Go on from where an earlier run has come to, see ``stored``."""
        self.at = Position(**position)  # type: ignore[arg-type]

    def stored(self) -> dict[str, float]:
        """What ``resume`` needs, as plain data."""
        return asdict(self.at)

    def shorten(self, status: Status) -> bool:
        """Halve the increment, because the next load step ended with ``status``; whether a smaller one may be tried:
        not where the load is enclosed.
        """
        if not self._divisible:
            return False
        at, step, with_all = self.at, self.next, not self.without_fall_backs
        if at.reached < 0 and status in _HOPELESS_AT_FIRST:
            return False
        fails_again = at.failed is not None and step >= at.failed - SAME_LENGTH
        increment = step - at.reached
        self.at = at = replace(at, failed=step, limit=at.limit or fails_again or status in _PROVED)
        if increment <= self._enclosed or (with_all and not at.hard):
            return False
        self.at = replace(at, increment=increment / 2, easy=0)
        return True
