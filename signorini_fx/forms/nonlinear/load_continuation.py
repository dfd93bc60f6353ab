"""The way of a nonlinear body through load steps: how large they are, and where they begin again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from dolfinx import fem

from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import MatrixError
from signorini_fx.forms.nonlinear.displaced_certificate import ResidualMechanics
from signorini_fx.forms.nonlinear.linearised import State
from signorini_fx.forms.nonlinear.newton import FINAL, EquilibriumSolver, NoEquilibrium
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.records import Status, StepRecord
from signorini_fx.results.mechanics import StepResult
from signorini_fx.results.restart_files import Figures
from signorini_fx.solving.checkpointed_steps import MeshCheckpoint
from signorini_fx.solving.load_steps import Marks, PathIncrements, Stepping
from signorini_fx.tuned import ENCLOSED, FEW_NEWTON_ITERATIONS

_SOLUTION, _TANGENT = "solution", "tangent"


class Way(PathIncrements):
    """A way along a path: a step without a solution is halved, and after an easy one the next is larger.

    To begin with there is one step for each time of the path, or as many as its ramp has.  The first step begins at
    time 0 if it is halved.  ``apply``: changes a problem to what it is at a place.
    """

    def __init__(self, path: LoadPath, apply: Callable[[float], object]) -> None:
        super().__init__(path)
        self.apply = apply

    def named(self, end: float, step: StepResult) -> StepResult:
        """The result of a step that ends at a place."""
        return replace(step, place=end, time=self.path.time_at(end), name=self.path.name_at(end))

    def shown(self, place: float) -> str:
        """The time of a place, in words."""
        return f"time {self.path.time_at(place):g}"

    @property
    def _smallest(self) -> float:
        """Size below which no step is halved."""
        return ENCLOSED * self.nominal

    @property
    def may_halve(self) -> bool:
        """Whether a smaller step than the next one may be tried."""
        return (self.next - self.reached) / 2 >= self._smallest

    def accept(self, iterations: int) -> None:
        """The next step has a solution, after so many iterations."""
        self.reached = self.next
        if iterations <= FEW_NEWTON_ITERATIONS:
            self.increment *= 2
        self.increment = min(max(self.increment, self._smallest), self.nominal)


class Continuation(Stepping[StepResult]):
    """Goes through the load steps of a way, each of which an ``EquilibriumSolver`` attempts.

    What has no solution, and cannot be shortened any more, ends it with NoEquilibrium or FormError.

    Attributes:
        steps: those with a solution.
        mechanics: the same with what the residual says of them.
    """

    def __init__(self, solver: EquilibriumSolver, way: Way) -> None:
        solver.begin_path(several=way.path.several)
        self.solver, self.way = solver, way
        self.history, self.timings = solver.linear.history, solver.timings
        self.steps = list[StepResult]()
        self.mechanics = list[tuple[StepResult, ResidualMechanics]]()
        self._solves_before = len(self.history.iterations)

    @property
    def through(self) -> bool:
        return self.way.ended

    def solved(self) -> StepResult | None:
        begun, history, way = self.solver.snapshot(), self.history, self.way
        end, number = way.next, len(self.steps) + 1
        if way.path.several:
            history.add(StepRecord(number, way.path.name_at(end), way.path.time_at(end)))
        try:
            way.apply(end)
            self.solver.attempt(final=not way.may_halve)
            self.solver.take()
        except Exception as error:
            self._give_up(begun, error)
            return None
        way.accept(self.solver.iterations)
        return self.end_step(end)

    def _give_up(self, begun: State, error: Exception) -> None:
        """Go back to where a failed step has begun, and halve it, or raise why there is no solution; collective."""
        solver, way, history = self.solver, self.way, self.history
        status = solver.status
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
            solver.status, advice = status, status.advice
            text = f"{solver.failure}: at {end}; {last}"
            if status is Status.LIMIT:
                text = f"{status.value}: {last}; a step to {end} ends with: {solver.failure}"
            raise NoEquilibrium(f"{text}. {advice[0].upper()}{advice[1:]}") from error.__cause__

    def end_step(self, end: float) -> StepResult:
        """Make the last solution that of a step, and begin the next one; ``end``: where the step ends; collective."""
        solved = self.solver.solved
        assert solved is not None
        step = self.way.named(end, replace(solved.step, step=len(self.steps) + 1))
        self.solver.solved = replace(solved, step=step)
        self.steps.append(step)
        self.mechanics.append((step, solved.mechanics))
        self.solver.advance()
        return step

    def store(self, checkpoint: MeshCheckpoint, step: StepResult, marks: Marks) -> None:
        """Its displacement, that at which its last tangent was formed, and the iterate of the contact problem of that
        are stored.  All else follows as load steps are gone through again.
        """
        solver, linear = self.solver, self.solver.linear
        assert linear.outcome is not None
        values, coordinates = solver.tangent_at
        figures = {
            "newton": solver.iterations,
            "path": self.way.stored(),
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

    def recalled(self, checkpoint: MeshCheckpoint) -> StepResult | None:
        """It is certified anew."""
        solver, way, number = self.solver, self.way, self.solver.linear.step
        history, timings = self.history, self.timings
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
                way.resume(figures["path"])
                return self.end_step(end)
            history.add(f"restart: load step {number + 1}: {status.value}: it is solved again")
            checkpoint.forget(number)
        solver.begin_again(begun, lambda: way.apply(way.reached))
        return None

    def _fits(self, checkpoint: MeshCheckpoint, figures: Figures) -> bool:
        """Take the displacement and the contact of the next load step from a checkpoint, if they fit; collective."""
        linear, residual = self.solver.linear, self.solver.residual
        number, tools = linear.step, linear.foundations
        fields = checkpoint.beside(number, linear.space, (_SOLUTION, _TANGENT))
        if fields is None:
            checkpoint.forget(number)
            return False
        solution, tangent = fields
        at_solution, at_tangent = (np.array(figures["coordinates"][name]) for name in (_SOLUTION, _TANGENT))
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
