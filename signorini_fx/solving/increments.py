"""The position of a problem on its load path, and the size of the next step."""

from __future__ import annotations

from collections.abc import Mapping
from math import floor, inf
from typing import ClassVar

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
from dolfinx import fem

from signorini_fx.algebra import step_limit
from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import Status
from signorini_fx.tuned import (
    EASY_STEP,
    ENCLOSED,
    FAILED_STEP,
    FEW_NEWTON_ITERATIONS,
    LARGEST_INCREMENT,
    SAME_LENGTH,
    SMALLEST_INCREMENT,
)

# Places are rounded to these digits, so that ten tenths are one.
_DIGITS = 12


class PathIncrements:
    """The position of a problem on its load path.

    Positions (places) are those of ``statement.load_path``.

    Attributes:
        stored_names: names of the attributes that a restart needs.
        path: the load path.
        nominal: the initial increment, that of a ramp if there is one.
        reached: the position that is reached.
        increment: the distance to the next position.
    """

    stored_names: ClassVar[tuple[str, ...]] = ("reached", "increment")

    def __init__(self, path: LoadPath) -> None:
        self.path = path
        self.nominal = 1.0 / (path.steps or 1)
        # A list of several load factors starts with one step to the first of them, in which slip
        # counts from the body without loads.
        self.reached = -1.0
        self.increment = self.nominal if path.from_nothing else 1.0

    @property
    def ended(self) -> bool:
        """Whether the last load step has been solved."""
        return self.reached >= len(self.path.times) - 1

    @property
    def next(self) -> float:
        """The position at the end of the next load step; a step never passes the next load
        factor.
        """
        station = floor(self.reached + SAME_LENGTH) + 1.0
        end = round(self.reached + self.increment, _DIGITS)
        return station if end > station - SAME_LENGTH else end

    def begin_at(self, place: float) -> None:
        """Continue from a position with the initial increment."""
        self.reached = place
        self.increment = self.nominal if self.path.steps is not None else 1.0

    def halve(self, place: float) -> None:
        """Halve the increment after a step to ``place`` without a solution."""
        self.increment = (place - self.reached) / 2

    def resume(self, position: Mapping[str, float]) -> None:
        """Continue from the position of an earlier run, see ``stored``."""
        for name in self.stored_names:
            setattr(self, name, position[name])

    def stored(self) -> dict[str, float]:
        """Return the data that ``resume`` needs."""
        return {name: getattr(self, name) for name in self.stored_names}


# Outcomes that another increment of the load does not change if nothing has been reached before.
# Afterwards the same linear solver has solved the same body, and fails because the tangents near a
# limit load are nearly singular.
_HOPELESS_AT_FIRST = (Status.NOT_HELD, Status.LINEAR_SOLVER, Status.NO_MEMORY)


class Increments(PathIncrements):
    """The position of a linear problem on its path.

    In a ramp the increment of a load step without a solution is halved until the limit load is
    enclosed.  The number of linear solves of the last load step limits that of the next attempt.

    Attributes:
        easy: number of the last load steps with a solution that took few linear solves.
        last: linear solves of the last load step.
    """

    stored_names = (*PathIncrements.stored_names, "easy", "last")

    def __init__(self, path: LoadPath, settings: SolverSettings) -> None:
        super().__init__(path)
        self._iterations = settings.max_iterations
        self._divided = path.steps is not None
        self.easy = self.last = 0

    @property
    def _divisible(self) -> bool:
        return self._divided and (self.path.from_nothing or self.reached >= 0)

    @property
    def _encloses(self) -> bool:
        """Whether the limit load is enclosed, so that the increment is not divided further."""
        reached = self.reached
        begun = reached - floor(reached + SAME_LENGTH) if reached >= 0 else reached + 1.0
        return self.next - reached <= max(ENCLOSED * begun, SMALLEST_INCREMENT * self.nominal)

    @property
    def allowed(self) -> int:
        """Number of linear solves that the next load step may take."""
        if not self._divisible:
            return step_limit(self._iterations)
        # A step in which no set changes takes two solves, too few as a measure for one that fails.
        before_smaller = FAILED_STEP * (
            max(self.last, EASY_STEP) if self.last else self._iterations
        )
        return FAILED_STEP * before_smaller if self._encloses else before_smaller

    def bracket(self, status: Status | None) -> str | None:
        """Return the loads between which a ramp has ended, as a message; None if the status is not
        due to the load, or if there is no ramp.
        """
        if self._is_final(status):
            return None
        nothing = self.reached == (-1.0 if self.path.from_nothing else 0.0)
        held = "without any load" if nothing else f"at time {self.path.time_at(self.reached):.6g}"
        return f"there is a solution {held}, and none at time {self.path.time_at(self.next):.6g}"

    def _is_final(self, status: Status | None) -> bool:
        """Return whether a load step that ended with ``status`` has no solution with any smaller
        increment.
        """
        return (
            not self._divisible
            or status in (Status.CORNER, Status.JUMPS)  # which shorter steps do not avoid
            or (self.reached < 0 and status in _HOPELESS_AT_FIRST)
        )

    def advance(self, place: float, linear_solves: int, iterations: int = 0) -> None:
        """Advance to ``place`` after a step with a solution that took ``linear_solves``."""
        divisible = self._divisible
        enclosed = self._encloses
        self.reached = place
        self.last = linear_solves
        if not self._divided:
            return
        if not divisible:
            self.increment = self.nominal
            return
        self.easy = self.easy + 1 if linear_solves <= EASY_STEP else 0
        if (self.easy > 1 or enclosed) and self.increment < LARGEST_INCREMENT * self.nominal:
            self.increment = 2 * self.increment
            self.easy = 0

    def shorten(self, status: Status | None, place: float) -> bool:
        """Halve the increment after a step to ``place`` that ended with ``status``; return whether
        a smaller one may be tried.
        """
        if self._is_final(status) or self._encloses:
            return False
        self.halve(place)
        self.easy = 0
        return True


# Outcomes that smaller steps of a nonlinear body do not change.
FINAL = (
    Status.CORNER,
    Status.STABILITY_UNKNOWN,
    Status.NO_DIGIT,
    Status.NO_MEMORY,
    Status.NOT_HELD,
    Status.OPEN,
)


class HalvedIncrements(PathIncrements):
    """The position of a nonlinear problem on its path.

    The increment is halved after any load step without a solution, also after the first one, from
    time 0; after an easy step it grows.

    Attributes:
        last: linear solves of the last load step; 0: there was none.
        cut: the shortest time step that effects have required and that has failed.
    """

    stored_names = (*PathIncrements.stored_names, "last")
    last = 0
    cut = inf  # the shortest failed time step that effects have required

    @property
    def _least(self) -> float:
        return ENCLOSED * min(self.nominal, self.cut)

    @property
    def may_halve(self) -> bool:
        """Whether half of the next step is still long enough to be tried."""
        return (self.next - self.reached) / 2 >= self._least

    @property
    def allowed(self) -> int | None:
        """Number of linear solves that the next step may take before a smaller one is tried; None:
        that of the settings.
        """
        if not (self.last and self.may_halve):
            return None
        return FAILED_STEP**2 * max(self.last, EASY_STEP)

    def bracket(self, status: Status | None) -> str | None:
        """Return None: unlike in ``Increments``, the failure has its own message."""
        return None

    def advance(self, place: float, linear_solves: int, iterations: int) -> None:
        """Advance to ``place`` after a step with a solution.

        Args:
            place: the position at the end of the step.
            linear_solves: linear solves that it took.
            iterations: iterations of Newton's method that it took.
        """
        self.reached = place
        self.last = linear_solves
        increment = self.increment * (2 if iterations <= FEW_NEWTON_ITERATIONS else 1)
        self.increment = min(max(increment, self._least), self.nominal)

    def shorten(self, status: Status | None, place: float) -> bool:
        """Halve the increment after a step to ``place``; return whether a smaller one may be tried.

        Args:
            status: how the step has ended; None: with an error.
            place: the position at the end of the step.
        """
        if place < self.next:
            self.cut = min(self.cut, place - self.reached)
        may_halve = self.may_halve and status not in FINAL
        if may_halve:
            self.halve(place)
        return may_halve


def check_step(state: State, time: float, space: fem.FunctionSpace) -> None:
    """Refuse a state of another mesh, and a time that is not after that of the state; collective.

    Raises:
        SceneError: the state or the time is refused.
    """
    problems = []
    nodes = space.dofmap.index_map
    size = (nodes.size_local + nodes.num_ghosts) * space.dofmap.index_map_bs
    if state.displacement.size != size:
        reason = "is of another mesh, or of another number of ranks: save and load it"
        problems.append(("state", reason))
    if state.number and time <= state.time:
        reason = f"must be after that of the state, {state.time:g}, got {time:g}"
        problems.append(("time", reason))
    parallel.raise_together(space.mesh.comm, SceneError(problems) if problems else None)
