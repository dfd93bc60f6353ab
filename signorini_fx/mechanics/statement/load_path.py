"""Load steps: their names and times, the path through them, and the factors of loads along it.

A *place* on the path is a number: 0 for the first entry of the lists of factors, 0.5 for halfway to
the second, -1 for the body without any load.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, inf, isfinite, log10
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from signorini_fx.arrays import Array
from signorini_fx.errors import FormError, SceneError
from signorini_fx.mechanics.statement.base import Table, refused
from signorini_fx.mechanics.statement.values import Count, Entries, Finite, Positive
from signorini_fx.tuned import SAME_NUMBER


class LoadSteps(Table):
    """The names and times of load steps, and an automatic ramp between them.

    Attributes:
        steps: into how many equal load steps each interval between two factors is divided to begin
            with; where one of them has no solution a smaller one is tried, and after easy ones the
            next is twice as large. Without any factors all loads grow together from nothing. None:
            one load step per factor.
        names: one name per factor, such as press and push; None: no names.
        times: one number per factor, increasing, for tables and ParaView; None: 1, 2, 3 and so on.
        time_accuracy: error in time that is allowed in displacement and tractions, relative to the
            largest ones; steps are divided as it asks for, and the error is estimated. None: steps
            are as they are given.
        jump: how many load steps of its kind each one stands for, whose wear adds up; a list has
            one number per load step.
        cycles: how many times the load steps follow each other: the first time they stand for
            themselves, from then on for so many as ``jump`` says; None: once.

    Examples:
        >>> steps = sfx.LoadSteps(names=["press", "release"], times=[1.0, 2.0])
        >>> half = sfx.Traction(boundary="top", pressure=2.0, factors=[1.0, 0.5])
        >>> result = sfx.solve(scene.model_copy(update={"traction": half, "load_steps": steps}))
        >>> print([float(round(step.contact.forces[0][1], 6)) for step in result.steps])
        [4.0, 2.0]
    """

    steps: Count | None = None
    names: Annotated[Entries[str], Field(min_length=1)] | None = None
    times: Annotated[Entries[Finite], Field(min_length=1)] | None = None
    time_accuracy: Positive | None = None
    jump: Count | Annotated[Entries[Count], Field(min_length=1)] = 1
    cycles: Count | None = None

    @model_validator(mode="after")
    def _cycles(self) -> Self:
        wrong = []
        if self.cycles is not None and (not isinstance(self.jump, int) or self.cycles % self.jump):
            wrong.append((("jump",), f"must be a number that divides the {self.cycles} cycles"))
        if self.cycles is not None and self.steps is not None:
            wrong.append((("cycles",), "are not possible yet with a ramp: leave out steps"))
        if self.cycles is not None and self.times is not None and self.times[0] <= 0:
            wrong.append((("times",), "must be positive: a cycle begins at time 0"))
        if wrong:
            raise refused(type(self).__name__, wrong)
        return self

    def repeated(self, count: int) -> tuple[Self, int]:
        """Return the load steps of all cycles in sequence, and the number of cycles that are
        computed.

        ``count``: the number of load steps in one cycle.
        """
        if self.cycles is None or not isinstance(self.jump, int):
            return self, 1
        jumps = [self.jump] * (self.cycles // self.jump)
        if self.jump > 1:
            jumps[:1] = [1, self.jump - 1]
        changed: dict[str, tuple[float | str, ...] | None] = {"cycles": None}
        if self.jump > 1:
            changed["jump"] = tuple(jump for jump in jumps for _ in range(count))
        if self.times is not None:
            ends = [k * self.times[-1] for k in range(len(jumps))]
            changed["times"] = tuple(end + time for end in ends for time in self.times)
        if self.names is not None:
            changed["names"] = tuple(self.names) * len(jumps)
        return self.model_copy(update=changed), len(jumps)


def factor_at(factors: Sequence[float], step: float) -> float:
    """Return the factor of a load at a place: linear between load steps, and from 0 at the unloaded
    body.
    """
    if step == int(step) and step >= 0:
        return factors[int(step)]
    return float(np.interp(step, np.arange(-1, len(factors)), (0.0, *factors)))


class Place(float):
    """A place on the load path, with fields that effects have computed for the step that ends
    there.

    Attributes:
        computed: nodal values of a rank for initial strains, by names, shape (nodes,).
    """

    computed: Mapping[str, Array]

    @classmethod
    def of(cls, place: float, computed: Mapping[str, Array]) -> Self:
        """Return a place with computed fields."""
        new = cls(place)
        new.computed = computed
        return new


@dataclass(frozen=True)
class LoadPath:
    """The times at which a problem is solved one after the other, each from the last solution.

    Without a ramp there is one load step for each time.  A ramp divides the intervals between them,
    and takes smaller increments where there is no solution and larger ones after easy load steps.

    Attributes:
        times: increasing.
        names: one for each of them; empty: they have none.
        steps: into how many equal load steps a ramp divides each interval to begin with; None:
            there is no ramp.
        from_nothing: whether the ramp begins at time 0 without any load, else at the first time.
        time_accuracy: see ``LoadSteps``.
        jump: see ``LoadSteps``.

    Raises:
        FormError: one of these is wrong.

    Examples:
        >>> path = sfx.LoadPath((1.0, 2.0), names=("press", "push"), steps=4)
        >>> print(path.times, path.steps)
        (1.0, 2.0) 4
    """

    times: Sequence[float]
    names: Sequence[str] = ()
    steps: int | None = None
    from_nothing: bool = False
    time_accuracy: float | None = None
    jump: int | Sequence[int] = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", tuple(map(float, self.times)))
        object.__setattr__(self, "names", tuple(self.names))
        problems = []
        if not self.times or not all(map(isfinite, self.times)) or (np.diff(self.times) <= 0).any():
            problems.append(
                (
                    "times",
                    f"must be finite and increase, and there must be one, got {list(self.times)}",
                )
            )
        if self.names and len(self.names) != len(self.times):
            problems.append(
                (
                    "names",
                    f"has {len(self.names)} entries, one for each of {len(self.times)} load steps "
                    "is expected",
                )
            )
        if self.steps is not None and (not isinstance(self.steps, int) or self.steps < 1):
            problems.append(("steps", f"must be a whole number from 1, got {self.steps!r}"))
        if self.from_nothing and self.steps is None:
            problems.append(("from_nothing", "is for a ramp: give steps"))
        if self.from_nothing and self.times and self.times[0] <= 0:
            problems.append(
                ("times", "must be positive: from nothing the loads begin to grow at time 0")
            )
        if self.time_accuracy is not None and not 0 < self.time_accuracy < inf:
            problems.append(("time_accuracy", f"must be positive, got {self.time_accuracy!r}"))
        if problems:
            raise FormError(problems, "LoadPath")

    @property
    def several(self) -> bool:
        """Whether there may be more than one load step."""
        return len(self.times) > 1 or self.steps is not None

    @property
    def expected(self) -> int:
        """The number of load steps if no step of a ramp has to be divided."""
        if self.steps is None:
            return len(self.times)
        first = not self.from_nothing
        return (len(self.times) - first) * self.steps + first

    def time_at(self, step: float) -> float:
        """Return the time at a place."""
        time = factor_at(self.times, step)
        if step == int(step):
            return time
        # Places have twelve digits: thirds that add up leave the last two uncertain.
        span = self.times[-1] - min(self.times[0], 0.0)
        return round(time, 10 - floor(log10(span)) if span > 0 else 10)

    def jump_at(self, number: int) -> int:
        """Return for how many load steps the step ``number``, counted from 0, stands."""
        jumps = (self.jump,) if isinstance(self.jump, int) else self.jump
        return jumps[min(number, len(jumps) - 1)]

    def place_of(self, time: float) -> float:
        """Return the place at a time: the inverse of ``time_at``.

        Raises:
            SceneError: no load step ends at this time.
        """
        stations = self.times if self.times[0] <= 0.0 else (0.0, *self.times)
        first = len(self.times) - len(stations)
        if self.steps is None:  # a load step for each time, and no other one
            place = float(np.argmin(np.abs(np.array(self.times) - time)))
            size = max(map(abs, self.times))
            within = abs(self.times[int(place)] - time) <= SAME_NUMBER * size
        else:
            place = float(np.interp(time, stations, range(first, len(self.times))))
            within = stations[0] <= time <= stations[-1]
        if not within:
            ends = ", ".join(f"{each:g}" for each in self.times)
            raise SceneError.at("time", f"no load step ends at time {time:g}: they end at {ends}")
        return place

    def name_at(self, step: float) -> str:
        """Return the name of the load step that ends at or after a place; empty without names."""
        return self.names[ceil(step)] if self.names else ""


def counted_path(number: int) -> LoadPath:
    """Return the load steps of a user's own loop, at times 1, 2, 3 and so on.

    Args:
        number: how many load steps precede the last.
    """
    return LoadPath(tuple(map(float, range(1, number + 2))))
