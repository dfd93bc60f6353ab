"""Equilibria beyond a limit point: a translation of a tool that a force moves is prescribed, and the load is what holds
the tool there, so that it may fall while the tool moves on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.errors import FormError
from signorini_fx.forms.nonlinear import outcomes
from signorini_fx.forms.nonlinear.leaps import SnapThrough
from signorini_fx.forms.nonlinear.load_continuation import Continuation
from signorini_fx.forms.nonlinear.moving_shapes import MovingShape, place
from signorini_fx.forms.nonlinear.newton import EquilibriumSolver, NoEquilibrium
from signorini_fx.forms.nonlinear.step_sizes import LoadSizes, RampStep, StepSizes, Way
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.statement.rigid_motion import COMPONENTS
from signorini_fx.records import Status
from signorini_fx.results.solution import StepResult
from signorini_fx.solving.load_steps import Stepping
from signorini_fx.tuned import (
    JUMP,
    LARGEST_LOAD_ERROR,
    LEFT_LOAD_ERROR,
    LOAD_DIFFERENCE,
    LOADS_TRIED,
    SMALLEST_STEP,
)

Array = npt.NDArray[np.float64]


def alike(start: tuple[float, float], half: tuple[float, float] | None, whole: tuple[float, float] | None) -> bool:
    """Whether a tool gives way in both halves of a step alike.

    Args:
        start: where it is before, and the force that drives it there.
        half: the same after half of the step; None: there is no solution.
        whole: the same after all of it.
    """
    if half is None or whole is None:
        return False
    moved, driven = np.abs(np.diff([start, half, whole], axis=0)).T
    first, second = moved * driven[::-1]  # compliances, each times both changes of the force
    return bool(first <= JUMP * second and second <= JUMP * first)


@dataclass(frozen=True)
class Control:
    """The translation of a tool that is prescribed beyond a limit point.

    Attributes:
        number: of a foundation that a force moves.
        component: of its translation, from 0.
        key: the name of this component.
        parts: the foundations of the same rigid body.
    """

    number: int
    component: int
    key: str
    parts: tuple[int, ...]

    @classmethod
    def of(cls, control: Any, shapes: dict[int, MovingShape], dimension: int) -> Control:
        """From what a user gives.

        Raises:
            FormError: it is no foundation and component, or no force moves this one freely.
        """
        names = COMPONENTS[dimension][:dimension]
        number, key = control if isinstance(control, tuple) and len(control) == 2 else (None, None)
        moving = shapes.get(number) if isinstance(number, int) else None
        if moving is None or key not in names:
            text = "must be the number of a foundation that a force moves and one of its components, such as (0, 'y')"
            raise FormError([("control", text)], "ramp")
        if moving.shape.force is None or getattr(moving.shape.prescribed, str(key), None) is not None:
            raise FormError([("control", f"{key} of contact[{number}] is not moved by a force")], "ramp")
        body = moving.shape.rigid
        parts = tuple(k for k, at in shapes.items() if k == number or (body and at.shape.rigid == body))
        return cls(int(str(number)), names.index(key), str(key), parts)

    def position(self, shapes: dict[int, MovingShape]) -> float:
        """Where the component is, length."""
        return float(shapes[self.number].translation[self.component])

    def drive(self, shapes: dict[int, MovingShape]) -> float:
        """The force along it that drives the tool now."""
        return float(shapes[self.number].shape.force[self.component])

    def missing(self, shapes: dict[int, MovingShape], state: ContactState) -> tuple[float, float]:
        """What the drive has more than contact and springs take of it, and the size of these; forces; collective."""
        boundary, shape = state.boundary, shapes[self.number].shape
        forces = boundary.nodal_forces(state.pressure, state.shear)[np.isin(boundary.part, self.parts), self.component]
        taken = float(boundary.comm.allreduce(float(forces.sum())))
        stiffness = float(shape.stiffness(boundary.x.shape[1])[self.component])
        springs = stiffness * self.position(shapes)
        return self.drive(shapes) + taken - springs, max(abs(taken), abs(springs))

    @contextmanager
    def held_at(self, position: float, shapes: dict[int, MovingShape]) -> Iterator[None]:
        """The component is prescribed within, and no spring acts along it; then all drives the tool as before, from
        where it is.
        """
        moving = shapes[self.number]
        driven = moving.shape
        others = {
            name: {key: value for key, value in getattr(driven, name) or () if value is not None and key != self.key}
            for name in ("prescribed", "spring")
        }
        fixed, springs = others["prescribed"] | {self.key: position}, others["spring"] or None
        place(moving, self.number, {"prescribed": fixed, "spring": springs})
        try:
            yield
        finally:
            carried = {"shift": moving.shape.shift, "rotation": moving.shape.rotation}
            moving.put(driven.model_copy(update=carried))


def load_that_holds(
    control: Control,
    shapes: dict[int, MovingShape],
    apply: Callable[[float], object],
    solve: Callable[[], ContactState],
    load: float,
    difference: float,
    largest: float,
) -> float | None:
    """The load with which the drive holds a tool where ``solve`` puts it; None: none is found; collective.

    It is found by Newton's method, with the slope of the drive, and the secant of what contact and springs take of it
    where other loads change, too.

    Args:
        control: what is prescribed.
        shapes: of the foundations.
        apply: changes the problem to what it is at a load.
        solve: solves at the load of now with the component prescribed.
        load: to begin with.
        difference: of loads, for the slope of the drive.
        largest: load so far.

    Raises:
        NoEquilibrium: see ``solve``.
        FormError: the force of the tool does not depend on the load.
    """
    before: tuple[float, float] | None = None  # a load, and what was taken there
    apply(largest)
    most, least = abs(control.drive(shapes)), np.inf
    for _ in range(LOADS_TRIED):
        apply(load + difference)
        ahead = control.drive(shapes)
        apply(load)
        drive = control.drive(shapes)
        slope = (ahead - drive) / difference
        if slope == 0.0:
            reason = f"the force on contact[{control.number}] along {control.key} does not change with the load"
            raise FormError([("control", reason)], "ramp")
        missing, size = control.missing(shapes, solve())
        accurate = abs(missing) <= LARGEST_LOAD_ERROR * size
        if accurate or least / 2 <= abs(missing) <= LEFT_LOAD_ERROR * max(size, most):
            return load
        least = min(least, abs(missing))
        if before is not None:
            slope += (missing - drive - before[1]) / (load - before[0])
            if slope == 0.0:
                return None
        before = load, missing - drive
        load -= missing / slope
    return None


class ControlSteps(StepSizes):
    """The steps of a translation beyond a limit point, on the way that steps before it have gone, and as far at once as
    the longest of them.

    Args:
        places: where these have begun and ended, lengths; each further step adds to it.
        farthest: how far beyond the limit point the way may go, length.
    """

    def __init__(self, places: list[float], farthest: float) -> None:
        increments = np.diff(places)
        moved = increments[increments != 0.0]
        self._sign = float(np.sign(moved[-1])) if moved.size else 0.0
        self._places, self._limit, self._farthest = places, places[-1], farthest
        longest = float(np.abs(increments).max(initial=0.0))
        super().__init__(places[-1], longest, longest, SMALLEST_STEP * longest)

    @property
    def ended(self) -> bool:
        """Whether the way cannot go on."""
        return self._sign == 0.0 or not abs(self._places[-1] - self._limit) <= self._farthest

    @property
    def next(self) -> float:
        """See ``StepSizes``."""
        return self._places[-1] + self._sign * self._step

    @property
    def size(self) -> float:
        """See ``StepSizes``."""
        return self._step


def ramped(
    continuation: Continuation,
    sizes: LoadSizes,
    apply: Callable[[float], object],
    control: tuple[int, str] | None,
    on_step: Callable[[RampStep], object],
) -> list[RampStep]:
    """The steps of a ramp, for the arguments see ``NonlinearContactProblem.ramp``; collective.

    Raises:
        NoEquilibrium, SnapThrough: it does not reach its load.
        FormError: likewise, or an argument is wrong.
    """
    solver, steps, to = continuation.solver, list[RampStep](), sizes.to
    assert to is not None
    shapes, dimension = solver.linear.shapes, solver.u.function_space.mesh.geometry.dim
    tool = None if control is None else Control.of(control, shapes, dimension)
    places = [] if tool is None else [begins_to_move(tool, solver, apply, sizes, LOAD_DIFFERENCE * to)]
    gone = [0.0]  # how far the load has gone, up and down

    def named(load: float, step: StepResult) -> StepResult:
        gone.append(gone[-1] + abs(load - (steps[-1].load if steps else 0.0)))
        steps.append(RampStep(load, solver.iterations, step.linear_solves))
        if tool is not None:
            places.append(tool.position(shapes))
        return replace(step, place=float(step.step - 1), time=gone[-1])

    way = Way(sizes, apply, named, controlled=tool is not None)
    try:
        continuation.follow(way, lambda step: on_step(steps[-1]))
    except (NoEquilibrium, SnapThrough):
        if tool is None or not continuation.steps or solver.status in outcomes.NOT_A_LIMIT:
            raise
        beyond_limit(continuation, tool, way, to, places, lambda step: on_step(steps[-1]))
    return steps


def begins_to_move(
    tool: Control, solver: EquilibriumSolver, apply: Callable[[float], object], sizes: LoadSizes, slightest: float
) -> float:
    """Where a tool is under hardly any load, once it has come to the body; collective.

    The first step, which no other tells from a jump, is halved until the tool gives way in both of its halves alike.

    Args:
        tool: whose translation will be prescribed.
        solver: of one step.
        apply: see ``NonlinearContactProblem.ramp``.
        sizes: of the steps.
        slightest: hardly any load.
    """
    begun, ended, shapes = solver.snapshot(), solver.status, solver.linear.shapes

    def tried(load: float) -> tuple[float, float] | None:
        """Where the tool is, and what drives it there; None: there is no solution."""
        try:
            apply(load)
            solver.attempt(damps=False)
            return tool.position(shapes), tool.drive(shapes)
        except (NoEquilibrium, FormError):
            return None
        finally:
            solver.begin_again(begun, partial(apply, 0.0))
            solver.status = ended

    start = tried(slightest) or (tool.position(shapes), 0.0)
    whole = tried(sizes.next)
    while sizes.may_halve:
        half = tried(sizes.next / 2)
        if alike(start, half, whole):
            break
        solver.linear.history.add(f"load {sizes.next:g} may be beyond a limit point: the first step is halved")
        sizes.halve()
        whole = half
    return start[0]


def beyond_limit(
    continuation: Continuation,
    tool: Control,
    way: Way,
    to: float,
    places: list[float],
    on_step: Callable[[StepResult], object],
) -> None:
    """Steps of a ramp beyond a limit point, see ``NonlinearContactProblem.ramp``; collective.

    Args:
        continuation: through the steps before it.
        tool: whose translation is prescribed.
        way: of the ramp.
        to: the load to reach.
        places: where the tool was at the beginning and after each step, which ``way.named`` adds to.
        on_step: see ``Stepping``.

    Raises:
        NoEquilibrium: an increment cannot be shortened any more, or the load is not reached.
        FormError: likewise, see ``load_that_holds``.
    """
    solver, load = continuation.solver, float(continuation.steps[-1].time) * float(np.sign(to))
    linear, history, largest = solver.linear, solver.linear.history, load
    steps = ControlSteps(places, linear.extent)
    history.add(f"beyond the limit point at load {load:g} {tool.key} of contact[{tool.number}] is prescribed")

    def solve() -> ContactState:
        with tool.held_at(steps.next, linear.shapes):
            solver.attempt(damps=not steps.may_halve)
            solver.take()
        return linear.state

    def load_at_next() -> float:
        holds = load_that_holds(tool, linear.shapes, way.apply, solve, load, LOAD_DIFFERENCE * to, largest)
        if holds is None:
            solver.status = Status.OUTER_MAX_ITERATIONS
            raise NoEquilibrium(f"no load is found that holds contact[{tool.number}] at {steps.next:g}")
        if abs(holds) < abs(to) or holds * to <= 0:
            return holds
        way.apply(to)  # on a branch that carries it
        solver.attempt()
        solver.take()
        return to

    def solved() -> StepResult | None:
        nonlocal load
        begun, taken = solver.snapshot(), (solver.last, solver.solved)
        try:
            load = load_at_next()
        except Exception as error:
            solver.begin_again(begun, partial(way.apply, load))
            solver.last, solver.solved = taken
            history.add(f"{tool.key} {steps.next:g} is given up, back at {places[-1]:g}: {error}")
            wrong = isinstance(error, FormError) and error.source == "ramp"  # an argument
            if wrong or not (isinstance(error, NoEquilibrium | FormError) and steps.may_halve):
                raise
            steps.halve()
            return None
        steps.accept(solver.iterations)
        return continuation.end_step(way, load)

    Stepping(history, solver.timings, lambda: load == to or steps.ended, solved).all(on_step)
    if load != to:
        solver.status = Status.LIMIT
        reached = f"{tool.key} of contact[{tool.number}] was moved to {places[-1]:g}, where load {load:g} holds it"
        raise NoEquilibrium(f"{Status.LIMIT.value}: {reached}; load {to:g} is not reached")
