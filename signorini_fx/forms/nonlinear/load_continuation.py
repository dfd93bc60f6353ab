"""The way of a nonlinear body through load steps: how large they are, and where they begin again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from dolfinx import fem

from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import MatrixError
from signorini_fx.forms.nonlinear.displaced_certificate import ResidualMechanics
from signorini_fx.forms.nonlinear.linearised import State
from signorini_fx.forms.nonlinear.newton import FINAL, EquilibriumSolver, NoEquilibrium, advice_on
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.mechanics.statement.load_path import LoadPath, next_place
from signorini_fx.records import Status, StepRecord, Timings
from signorini_fx.results.mechanics import StepResult
from signorini_fx.results.restart_files import Figures
from signorini_fx.solving.checkpointed_steps import MeshCheckpoint
from signorini_fx.solving.load_steps import Marks, Stepping
from signorini_fx.tuned import FEW_NEWTON_ITERATIONS, SMALLEST_STEP, STEP_GROWTH

_SOLUTION, _TANGENT = "solution", "tangent"


@dataclass
class Way:
    """A way along a path: a step without a solution is halved, and after an easy one the next is larger.

    To begin with there is one step for each time of the path, or as many as its ramp has.  The first step begins at
    time 0 if it is halved.

    Attributes:
        path: with whose places steps end.
        apply: changes a problem to what it is at a place.
        largest: size of any step.
        step: size of the next step.
        reached: where the last step has ended, or the way begins.
    """

    path: LoadPath
    apply: Callable[[float], object]
    largest: float = field(init=False)
    step: float = field(init=False)
    reached: float = -1.0

    def __post_init__(self) -> None:
        self.largest = 1.0 / (self.path.steps or 1)
        self.step = self.largest if self.path.from_nothing else 1.0

    def named(self, end: float, step: StepResult) -> StepResult:
        """The result of a step that ends at a place."""
        return replace(step, place=end, time=self.path.time_at(end), name=self.path.name_at(end))

    def shown(self, place: float) -> str:
        """The time of a place, in words."""
        return f"time {self.path.time_at(place):g}"

    @property
    def ended(self) -> bool:
        """Whether the way has ended."""
        return self.reached == len(self.path.times) - 1.0

    @property
    def next(self) -> float:
        """Where the next step ends."""
        return next_place(self.reached, self.step)

    @property
    def _smallest(self) -> float:
        """Size below which no step is halved."""
        return SMALLEST_STEP * self.largest

    @property
    def may_halve(self) -> bool:
        """Whether a smaller step than the next one may be tried."""
        return (self.next - self.reached) / 2 >= self._smallest

    def halve(self) -> None:
        """The next step has no solution."""
        self.step = (self.next - self.reached) / 2

    def accept(self, iterations: int) -> None:
        """The next step has a solution, after so many iterations."""
        self.reached = self.next
        if iterations <= FEW_NEWTON_ITERATIONS:
            self.step *= STEP_GROWTH
        self.step = min(max(self.step, self._smallest), self.largest)


@dataclass
class Continuation:
    """Goes through load steps, each of which an ``EquilibriumSolver`` attempts.

    Attributes:
        solver: of one step.
        steps: those with a solution.
        mechanics: their displacements and what the residual says of them.
    """

    solver: EquilibriumSolver
    steps: list[StepResult] = field(default_factory=list)
    mechanics: list[tuple[fem.Function, ResidualMechanics]] = field(default_factory=list)
    _solves_before: int = 0

    def forget(self) -> None:
        """The steps before the next solve, and a first step that had no solution."""
        solver = self.solver
        solver.linear.several = False
        self.steps, self.mechanics, solver.timings = [], [], Timings()
        self._solves_before = len(solver.linear.history.iterations)
        if solver.solved is not None and solver.solved.step.status is not Status.CONVERGED:
            solver.solved = None

    def follow(
        self, way: Way, on_step: Callable[[StepResult], object], checkpoint: MeshCheckpoint | None = None
    ) -> None:
        """Solve the steps of a way, see ``Stepping``; collective.

        Raises NoEquilibrium or FormError: one has no solution, and no smaller one is to be tried.
        """
        self.forget()
        solver = self.solver
        solver.linear.several = way.path.several
        stepping = Stepping[StepResult](
            solver.linear.history,
            solver.timings,
            ended=lambda: way.ended,
            solved=partial(self._next_step, way),
            recalled=partial(self._recall, way),
            store=partial(self._store, way),
        )
        stepping.all(on_step, checkpoint)

    def _next_step(self, way: Way) -> StepResult | None:
        """Solve the next step of a way; None: it has no solution and will be another one; collective."""
        begun, history = self.solver.snapshot(), self.solver.linear.history
        end, number = way.next, len(self.steps) + 1
        if way.path.several:
            history.add(StepRecord(number, way.path.name_at(end), way.path.time_at(end)))
        try:
            way.apply(end)
            self.solver.attempt(final=not way.may_halve)
            self.solver.take()
        except Exception as error:
            self._give_up(way, begun, error)
            return None
        way.accept(self.solver.iterations)
        return self.end_step(way, end)

    def _give_up(self, way: Way, begun: State, error: Exception) -> None:
        """Go back to where a step has begun that has no solution, and say where it is to end instead, or raise why
        there is none; collective.
        """
        solver = self.solver
        history, status = solver.linear.history, solver.status
        final = not way.may_halve or status in FINAL
        if status is not None and solver.without:
            status = Status.LIMIT
        if final and isinstance(error, NoEquilibrium) and solver.solved is None:
            assert status is not None
            solver.take_before(status, len(history.iterations) - self._solves_before)
            if (before := solver.solved) is not None:
                solver.solved = replace(before, step=way.named(way.next, before.step))
        solver.begin_again(begun, lambda: way.apply(way.reached))
        end, reached = way.shown(way.next), way.shown(way.reached)
        history.add(f"{end} is given up, back at {reached}: {error}")
        if not isinstance(error, NoEquilibrium | FormError):
            raise error
        if not final:
            way.halve()
        else:
            last = f"there is a solution at {reached}" if self.steps else "there is no solution before it"
            if isinstance(error, FormError):
                reasons = [(key, f"{reason} (at {end}; {last})") for key, reason in error.problems]
                raise FormError(reasons, error.source) from error.__cause__
            assert status is not None
            solver.status, advice = status, advice_on(status)
            text = f"{solver.failure}: at {end}; {last}"
            if status is Status.LIMIT:
                text = f"{status.value}: {last}; a step to {end} ends with: {solver.failure}"
            raise NoEquilibrium(f"{text}. {advice[0].upper()}{advice[1:]}") from error.__cause__

    def end_step(self, way: Way, end: float) -> StepResult:
        """Make the last solution that of a step, and begin the next one; ``end``: where the step ends; collective."""
        solved = self.solver.solved
        assert solved is not None
        step = way.named(end, replace(solved.step, step=len(self.steps) + 1))
        self.solver.solved = replace(solved, step=step)
        self.steps.append(step)
        self.mechanics.append((step.displacement, solved.mechanics))
        self.solver.advance()
        return step

    def _store(self, way: Way, checkpoint: MeshCheckpoint, step: StepResult, marks: Marks) -> None:
        """Store a load step in a checkpoint; for the arguments see ``Stepping``; collective.

        Stored are its displacement, that at which its last tangent was formed, and the iterate of the contact problem
        of that.  All else follows as load steps are gone through again.
        """
        solver, linear = self.solver, self.solver.linear
        assert linear.outcome is not None
        values, coordinates = solver.tangent_at
        figures = {
            "newton": solver.iterations,
            "path": {"reached": way.reached, "step": way.step},
            "linear_solves": step.linear_solves,
            "coordinates": {_SOLUTION: linear.moving_tools.coordinates.tolist(), _TANGENT: coordinates.tolist()},
            "definite": bool(linear.definite),
            "symmetric": bool(linear.symmetric),
        }
        at, start = fem.Function(linear.space), replace(linear.begun, place=step.place)
        at.x.array[:] = values
        beside, result = {_SOLUTION: step.displacement, _TANGENT: at}, replace(step, displacement=linear.u.copy())
        solved = linear.task, start, linear.outcome, result
        checkpoint.store(linear.elastic, solver.timings, *solved, marks, figures, beside)

    def _recall(self, way: Way, checkpoint: MeshCheckpoint) -> StepResult | None:
        """Go to the next step as an earlier run has left it, and certify it anew; None: it is not there, or is solved
        again; collective.
        """
        solver, number = self.solver, self.solver.linear.step
        history, timings = solver.linear.history, solver.timings
        figures = checkpoint.figures(number)
        if figures is None:
            return None
        begun, end = solver.snapshot(), float(figures["place"])
        with timings.phase("restart"):
            way.apply(end)
            fits = self._fits(checkpoint, figures)
        if fits:
            if (status := solver.certify(begun)) is Status.CONVERGED:
                solver.status, solver.iterations = status, figures["newton"]
                solver.linear_solves = figures["linear_solves"]
                solver.take()
                checkpoint.recall_history(figures, history, timings)
                way.reached, way.step = (figures["path"][name] for name in ("reached", "step"))
                return self.end_step(way, end)
            history.add(f"restart: load step {number + 1}: {status.value}: it is solved again")
            checkpoint.forget(number)
        solver.begin_again(begun, lambda: way.apply(way.reached))
        return None

    def _fits(self, checkpoint: MeshCheckpoint, figures: Figures) -> bool:
        """Give the body the displacement and the contact of its next load step, with loads and shapes of it; whether
        they fit; collective.
        """
        linear, residual = self.solver.linear, self.solver.residual
        number, tools = linear.step, linear.moving_tools
        fields = checkpoint.beside(number, linear.space, (_SOLUTION, _TANGENT))
        if fields is None:
            checkpoint.forget(number)
            return False
        (solution, tangent), shape = fields, tools.coordinates.shape
        at_solution, at_tangent = (
            np.array(figures["coordinates"][name], dtype=np.float64).reshape(shape) for name in (_SOLUTION, _TANGENT)
        )
        try:
            if residual.at(tangent.x.array.copy()) is None:
                return False
            tools.carry_to(at_tangent)
            linear.begin_at_tangent(definite=figures["definite"], symmetric=figures["symmetric"])
            start = replace(linear.begun, place=float(figures["place"]), factors=np.ones(1))
            outcome = checkpoint.recall(linear.elastic, linear.scales.size, linear.task, start)
        except (FormError, MatrixError, PairingError):
            return False
        if outcome is None:
            return False
        linear.accept(outcome)
        tools.carry_to(at_solution)
        residual.u.x.array[:] = solution.x.array
        return True
