"""Where a problem is on its path through load steps, and how large the next step is."""

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
    """The position of a problem on its path through load steps: at the place ``reached``, by an
    ``increment`` from the next, ``nominal`` if it is that of a ramp; places are those of
    ``statement.load_path``.
    """

    stored_names: ClassVar[tuple[str, ...]] = ("reached", "increment")

    def __init__(self, path: LoadPath) -> None:
        self.path = path
        self.nominal = 1.0 / (path.steps or 1)
        # A list of several factors begins with one step to the first of them, in which slip is
        # counted from rest.
        self.reached = -1.0
        self.increment = self.nominal if path.from_nothing else 1.0

    @property
    def ended(self) -> bool:
        """Whether the last load step has been solved."""
        return self.reached >= len(self.path.times) - 1

    @property
    def next(self) -> float:
        """The place of the next load step; none goes beyond the next factor."""
        station = floor(self.reached + SAME_LENGTH) + 1.0
        end = round(self.reached + self.increment, _DIGITS)
        return station if end > station - SAME_LENGTH else end

    def begin_at(self, place: float) -> None:
        """Go on from a place with steps as large as they begin."""
        self.reached = place
        self.increment = self.nominal if self.path.steps is not None else 1.0

    def halve(self, place: float) -> None:
        """The next step, to a place, has no solution."""
        self.increment = (place - self.reached) / 2

    def resume(self, position: Mapping[str, float]) -> None:
        """Go on from where an earlier run has come to, see ``stored``."""
        for name in self.stored_names:
            setattr(self, name, position[name])

    def stored(self) -> dict[str, float]:
        """Return what ``resume`` needs, as plain data."""
        return {name: getattr(self, name) for name in self.stored_names}


# Outcomes that another increment of the load does not change if nothing has been reached before.
# Afterwards the same linear solver has solved the same body, and fails because the tangents near a
# limit load are nearly singular.
_HOPELESS_AT_FIRST = (Status.NOT_HELD, Status.LINEAR_SOLVER, Status.NO_MEMORY)


class Increments(PathIncrements):
    """The position of a linear problem on its path. In a ramp the increment of a load step without
    a solution is halved, until the load is enclosed; the linear solves of the last load step set
    how many an attempt without one may take.
    """

    # ``easy``: how many of the last load steps with a solution were easy; ``last``: linear solves
    # of the last one.
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
        """Whether the increment is not divided any more."""
        reached = self.reached
        begun = reached - floor(reached + SAME_LENGTH) if reached >= 0 else reached + 1.0
        return self.next - reached <= max(ENCLOSED * begun, SMALLEST_INCREMENT * self.nominal)

    @property
    def allowed(self) -> int:
        """Linear solves that the next load step may take."""
        if not self._divisible:
            return step_limit(self._iterations)
        # One at which nothing changes takes two, which is no measure for one that fails.
        before_smaller = FAILED_STEP * (
            max(self.last, EASY_STEP) if self.last else self._iterations
        )
        return FAILED_STEP * before_smaller if self._encloses else before_smaller

    def bracket(self, status: Status | None) -> str | None:
        """Between which loads a ramp has ended with this status; None where no ramp or no load is
        the reason.
        """
        if self._is_final(status):
            return None
        nothing = self.reached == (-1.0 if self.path.from_nothing else 0.0)
        held = "without any load" if nothing else f"at time {self.path.time_at(self.reached):.6g}"
        return f"there is a solution {held}, and none at time {self.path.time_at(self.next):.6g}"

    def _is_final(self, status: Status | None) -> bool:
        """Return whether a load step that ended with ``status`` has no solution for any
        increment.
        """
        return (
            not self._divisible
            or status in (Status.CORNER, Status.JUMPS)  # in a shorter one all the more
            or (self.reached < 0 and status in _HOPELESS_AT_FIRST)
        )

    def advance(self, place: float, linear_solves: int, iterations: int = 0) -> None:
        """The next step, to a place, has a solution, which took this many linear solves."""
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
        """Halve the increment, as the step to a place ended with ``status``; whether a smaller one
        may be tried.
        """
        if self._is_final(status) or self._encloses:
            return False
        self.halve(place)
        self.easy = 0
        return True


# What smaller steps of a nonlinear body do not change.
FINAL = (
    Status.CORNER,
    Status.STABILITY_UNKNOWN,
    Status.NO_DIGIT,
    Status.NO_MEMORY,
    Status.NOT_HELD,
    Status.OPEN,
)


class HalvedIncrements(PathIncrements):
    """The position of a nonlinear problem on its path. Any load step without a solution is halved,
    the first one from time 0; after an easy one the next is larger.
    """

    # ``last``: linear solves of the last load step, 0: there was none.
    stored_names = (*PathIncrements.stored_names, "last")
    last = 0
    cut = inf  # the shortest time step that effects have asked for and that has failed

    @property
    def _least(self) -> float:
        return ENCLOSED * min(self.nominal, self.cut)

    @property
    def may_halve(self) -> bool:
        """Whether a smaller step than the next one may be tried."""
        return (self.next - self.reached) / 2 >= self._least

    @property
    def allowed(self) -> int | None:
        """Linear solves that the next step may take, before a smaller one is tried; None: those of
        the settings.
        """
        if not (self.last and self.may_halve):
            return None
        return FAILED_STEP**2 * max(self.last, EASY_STEP)

    def bracket(self, status: Status | None) -> str | None:
        """See ``Increments``: a failure says it in its own words."""
        return None

    def advance(self, place: float, linear_solves: int, iterations: int) -> None:
        """The next step, to a place, has a solution, after this many linear solves, and iterations
        of Newton's method.
        """
        self.reached = place
        self.last = linear_solves
        increment = self.increment * (2 if iterations <= FEW_NEWTON_ITERATIONS else 1)
        self.increment = min(max(increment, self._least), self.nominal)

    def shorten(self, status: Status | None, place: float) -> bool:
        """Halve the increment, as the next step, to a place, ended with ``status``, None: with an
        error; whether a smaller one may be tried.
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
        SceneError: it is one of these.
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
