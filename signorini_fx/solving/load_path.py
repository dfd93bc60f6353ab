"""The way through the load steps: the next place, smaller increments where there is no solution, larger ones after."""

from __future__ import annotations

from math import floor

from signorini_fx.records import Status
from signorini_fx.scene.model import Scene
from signorini_fx.tuned import EASY_STEP, ENCLOSED, LARGEST_INCREMENT, SMALLEST_INCREMENT

# Outcomes that another increment of the load does not change, and those that it does not change if nothing has been
# reached before.
_HOPELESS, _HOPELESS_AT_FIRST = (Status.LINEAR_SOLVER,), (Status.NOT_HELD,)
# Places are rounded to these digits, so that ten tenths are one; those that differ by less are the same.
_DIGITS, _SAME_PLACE = 12, 1e-9


class LoadPath:
    """Where a scene is on its way through its load steps; places are those of ``scene.load_steps``.

    Without a ramp every factor is a load step, and one without a solution ends the way.  In a ramp its increment is
    halved, until the load is enclosed between one with and one without a solution.

    Args:
        scene: the scene.

    Attributes:
        reached: the place of the last load step with a solution; -1 before the first one.
        increment: from there to the next one.
    """

    def __init__(self, scene: Scene) -> None:
        self._last = scene.steps - 1
        self._divided = scene.automatic_steps
        # The first of several factors is reached in one step, whose law is static.
        self._divisible = self._divided is not None and scene.grows_from_nothing
        self.reached = -1.0
        self._nominal = 1.0 if self._divided is None else 1.0 / self._divided
        self.increment = self._nominal if scene.grows_from_nothing else 1.0
        self._easy = 0

    @property
    def ended(self) -> bool:
        """Whether the last load step has been solved."""
        return self.reached >= self._last

    @property
    def next(self) -> float:
        """The place of the next load step; none goes beyond the next factor."""
        station = floor(self.reached + _SAME_PLACE) + 1.0
        place = round(self.reached + self.increment, _DIGITS)
        return station if place > station - _SAME_PLACE else place

    def advance(self, linear_solves: int) -> None:
        """The next load step has a solution, which took this many linear solves."""
        self.reached = self.next
        if self._divided is None:
            return
        if not self._divisible:
            self._divisible, self.increment = True, self._nominal
            return
        self._easy = self._easy + 1 if linear_solves <= EASY_STEP else 0
        if self._easy > 1 and self.increment < LARGEST_INCREMENT * self._nominal:
            self.increment, self._easy = 2 * self.increment, 0

    def resume(self, reached: float, increment: float) -> None:
        """Go on from a place that an earlier run has reached."""
        self.reached, self.increment = reached, increment
        self._divisible = self._divided is not None

    def shorten(self, status: Status) -> bool:
        """Whether a smaller increment is to be tried, because the next load step ended with ``status``."""
        if not self._divisible or status in _HOPELESS or (self.reached < 0 and status in _HOPELESS_AT_FIRST):
            return False
        failed = self.next - self.reached
        begun = self.reached - floor(self.reached + _SAME_PLACE) if self.reached >= 0 else self.reached + 1.0
        if failed <= max(ENCLOSED * begun, SMALLEST_INCREMENT * self._nominal):
            return False
        self.increment, self._easy = failed / 2, 0
        return True
