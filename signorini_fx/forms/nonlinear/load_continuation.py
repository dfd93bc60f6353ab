"""The way of a nonlinear body through load steps: how large they are, and where they begin again."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np
from dolfinx import fem

from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import MatrixError
from signorini_fx.forms.nonlinear.linearised import State
from signorini_fx.forms.nonlinear.newton import FINAL, EquilibriumSolver
from signorini_fx.forms.nonlinear.results import ResidualMechanics
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.records import Status, StepRecord
from signorini_fx.results.mechanics import StepResult
from signorini_fx.solving.checkpointed_steps import Figures, MeshCheckpoint
from signorini_fx.solving.load_steps import Marks, PathIncrements, Stepping
from signorini_fx.tuned import ENCLOSED, FEW_NEWTON_ITERATIONS

_SOLUTION, _TANGENT = "solution", "tangent"


class Continuation(Stepping[StepResult]):
    """Goes through the load steps of a path, each of which an ``EquilibriumSolver`` attempts.  One without a solution
    is halved, the first one from time 0; after an easy one the next is larger.  One that cannot be shortened
    ends it with a ``failure`` in words or a FormError.

    ``apply`` changes the problem to what it is at a place.  ``ends`` are the load steps with a solution, with what the
    residual says of them.
    """

    def __init__(self, solver: EquilibriumSolver, path: LoadPath, apply: Callable[[float], object]) -> None:
        solver.begin_path(several=path.several)
        self.solver, self.way, self._apply = solver, PathIncrements(path), apply
        self.history, self.timings = solver.linear.history, solver.timings
        self.ends, self.failure = list[tuple[StepResult, ResidualMechanics]](), ""
        self._solves_before = len(self.history.iterations)

    @property
    def through(self) -> bool:
        return self.way.ended or bool(self.failure)

    @property
    def _may_halve(self) -> bool:
        """Whether a smaller step than the next one may be tried."""
        return (self.way.next - self.way.reached) / 2 >= ENCLOSED * self.way.nominal

    def solved(self) -> StepResult | None:
        begun, solver, way = self.solver.snapshot(), self.solver, self.way
        if (path := way.path).several:
            self.history.add(StepRecord(len(self.ends) + 1, path.name_at(way.next), path.time_at(way.next)))
        why: Exception | str
        try:
            self._apply(way.next)
            if not (why := solver.attempt(final=not self._may_halve)):
                solver.take()
        except Exception as error:
            why = error
        if why:
            self._give_up(begun, why)
            return None
        end = way.reached = way.next
        increment = way.increment * (2 if solver.iterations <= FEW_NEWTON_ITERATIONS else 1)
        way.increment = min(max(increment, ENCLOSED * way.nominal), way.nominal)
        return self._end_step(end)

    def _give_up(self, begun: State, why: Exception | str) -> None:
        """Go back to where a failed step has begun, and halve it, or end with why there is no solution; collective."""
        solver, way, status = self.solver, self.way, self.solver.status
        final = not self._may_halve or status in FINAL
        if status is not None and solver.without:
            status = Status.LIMIT
        if final and isinstance(why, str) and solver.solved is None:
            assert status is not None
            solver.take_before(status, len(self.history.iterations) - self._solves_before)
            if (before := solver.solved) is not None:
                solver.solved = replace(before, step=self._named(way.next, before.step))
        self._begin_again(begun)
        end, reached = (f"time {way.path.time_at(place):g}" for place in (way.next, way.reached))
        self.history.add(f"{end} is given up, back at {reached}: {why}")
        if not isinstance(why, str | FormError):
            raise why
        if not final:
            way.halve()
            return
        last = f"there is a solution at {reached}" if self.ends else "there is no solution before it"
        if isinstance(why, FormError):
            reasons = [(key, f"{reason} (at {end}; {last})") for key, reason in why.problems]
            raise FormError(reasons, why.source) from why.__cause__
        assert status is not None
        solver.status, advice = status, status.advice
        text = f"{solver.failure}: at {end}; {last}"
        if status is Status.LIMIT:
            text = f"{status.value}: {last}; a step to {end} ends with: {solver.failure}"
        self.failure = f"{text}. {advice[0].upper()}{advice[1:]}"

    def _begin_again(self, begun: State) -> None:
        """Go back to where a step has begun, with its load and its shapes; collective."""
        self._apply(self.way.reached)
        for number, shape in begun.shapes.items():
            self.solver.linear.foundations.moving[number].shape = shape
        self.solver.go_back(begun)

    def _named(self, end: float, step: StepResult) -> StepResult:
        path = self.way.path
        return replace(step, place=end, time=path.time_at(end), name=path.name_at(end))

    def _end_step(self, end: float) -> StepResult:
        """Make the last solution that of a step, and begin the next one; ``end``: where the step ends; collective."""
        solved = self.solver.solved
        assert solved is not None
        step = self._named(end, replace(solved.step, step=len(self.ends) + 1))
        self.solver.solved = replace(solved, step=step)
        self.ends.append((step, solved.mechanics))
        self.solver.advance()
        return step

    def store(self, checkpoint: MeshCheckpoint, step: StepResult, marks: Marks) -> None:
        """Its displacement, that of its last tangent, and the iterate of the contact problem of that are stored."""
        solver, linear = self.solver, self.solver.linear
        assert linear.outcome is not None
        values, coordinates = solver.tangent_at
        figures = {
            "newton": solver.iterations,
            "path": self.way.stored(),
            "linear_solves": step.linear_solves,
            "coordinates": {_SOLUTION: linear.foundations.coordinates.tolist(), _TANGENT: coordinates.tolist()},
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
        solver, number, history = self.solver, self.solver.linear.step, self.history
        figures = checkpoint.figures(number)
        if figures is None:
            return None
        begun, end = solver.snapshot(), float(figures["place"])
        with self.timings.phase("restart"):
            self._apply(end)
            fits = self._fits(checkpoint, figures)
        if fits and (status := solver.certify(begun)) is Status.CONVERGED:
            solver.status, solver.iterations = status, figures["newton"]
            solver.linear_solves = figures["linear_solves"]
            solver.take()
            checkpoint.recall_history(figures, history, self.timings)
            self.way.resume(figures["path"])
            return self._end_step(end)
        if fits:
            history.add(f"restart: load step {number + 1}: {status.value}: it is solved again")
            checkpoint.forget(number)
        self._begin_again(begun)
        return None

    def _fits(self, checkpoint: MeshCheckpoint, figures: Figures) -> bool:
        """Take the displacement and the contact of the next load step from a checkpoint, if they fit; collective."""
        linear, residual = self.solver.linear, self.solver.residual
        fields = checkpoint.beside(linear.step, linear.space, (_SOLUTION, _TANGENT))
        if fields is None:
            checkpoint.forget(linear.step)
            return False
        solution, tangent = fields
        at_solution, at_tangent = (np.array(figures["coordinates"][name]) for name in (_SOLUTION, _TANGENT))
        outcome = None
        with suppress(FormError, MatrixError, PairingError):
            if residual.at(tangent.x.array.copy()) is not None:
                linear.foundations.carry_to(at_tangent)
                linear.begin_at_tangent(definite=figures["definite"], symmetric=figures["symmetric"])
                start = replace(linear.begun, place=float(figures["place"]), factors=np.ones(1))
                outcome = checkpoint.recall(linear.elastic, linear.scales.size, linear.task, start)
        if outcome is None:
            return False
        data = replace(linear.begun.data, slip_origin=outcome.data.slip_origin)
        linear.begun = replace(linear.begun, data=data)
        linear.show(outcome, None)
        linear.foundations.carry_to(at_solution)
        residual.u.x.array[:] = solution.x.array
        return True
