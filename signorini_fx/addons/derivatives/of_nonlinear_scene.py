"""Derivatives of results of a scene with nonlinear materials by its numbers.

An equilibrium at finite displacements has the derivative of its last linearised problem, formed anew at the solution,
and the sets of it: so the adjoint states are those of ``gradient``, with contact forces that turn with the body.  Load
steps are linearised from the last one to the first, each with the debts of the one after it.  What a material or a load
changes of the residual is a difference of the residual that the certificate evaluates in NumPy: nothing is compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.derivatives.adjoint import Explicit
from signorini_fx.addons.derivatives.entries import varied
from signorini_fx.addons.derivatives.gradient import By, ChangedStep, SolvedStep, difference, explicit
from signorini_fx.mechanics.body.discretisation import held_at, prepare
from signorini_fx.mechanics.body.nonlinear_law import at_rest
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.features import refuse
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.quantities.differentiable import Functional
from signorini_fx.records import History, Timings
from signorini_fx.results.solution import ConvergenceError, Solution
from signorini_fx.scenes.nonlinear import ProblemOfScene, ReachedStep

Array = npt.NDArray[np.float64]
# Features of a scene with nonlinear materials that have no derivatives.
REFUSES = {
    "contact of two bodies": "derivatives are not possible yet where two nonlinear bodies touch",
    "driven foundation": "derivatives are not possible yet where a force moves it on a nonlinear body",
}


@dataclass(frozen=True)
class NonlinearSteps:
    """The load steps of a scene, and the problem that has solved them."""

    problem: ProblemOfScene
    reached: list[ReachedStep]
    solution: Solution

    @classmethod
    def solved(cls, statement: Statement, problem_of: Callable[[], ProblemOfScene]) -> NonlinearSteps:
        """Solve a scene; collective."""
        refuse(statement, REFUSES)
        reached = list[ReachedStep]()
        problem = problem_of()
        solution = problem.solved(on_step=lambda step: reached.append(problem.reached()))
        if not solution.converged:
            raise ConvergenceError(solution)
        return cls(problem, reached, solution)

    def by(self, path: str, change: float) -> By:
        """The derivatives by the number at a path, from its change for a difference; collective."""
        statement, dimension = self.statement, self.problem.model.dimension
        above, below = (
            ChangedScene(self, statement.changed(**varied(statement, path, sign * change, dimension)), path)
            for sign in (1.0, -1.0)
        )

        def evaluated(step: LinearisedStep, quantities: Sequence[Functional]) -> Explicit:
            high, low = (step.explicit(scene.at(step), quantities, scene.values) for scene in (above, below))
            return difference(high, low, change)

        return evaluated

    @property
    def models(self) -> list[Model]:
        """Of the load steps, which is the same."""
        return [self.problem.model] * len(self.reached)

    @property
    def statement(self) -> Statement:
        """The scene, with contact points on the sides that were chosen."""
        return self.problem.statement

    def at(self, number: int) -> LinearisedStep:
        """A load step as it was solved; collective."""
        step, preceding = self.reached[number], self.reached[number - 1] if number else None
        solved = SolvedStep.of(*self.problem.linearised(step))
        solved = replace(solved, displacement=solved.displacement.copy())
        return LinearisedStep(self.problem, step.path_step, solved, preceding)


@dataclass(frozen=True)
class LinearisedStep:
    """A load step of a scene with its linearised problem; ``preceding``: how the load step before it ended."""

    problem: ProblemOfScene
    path_step: float
    solved: SolvedStep
    preceding: ReachedStep | None

    @cached_property
    def usual(self) -> ChangedStep:
        """Its data; collective."""
        problem = self.problem
        forces = problem.forces_anew(problem.statement, self.solved.displacement)
        return replace(ChangedStep(*problem.linear.data_now()), forces=forces)

    @cached_property
    def earlier(self) -> SolvedStep | None:
        """The load step before as far as slips of this one need it; None: there is none."""
        if self.preceding is None:
            return None
        displacement, state = self.solved.displacement.copy(), self.preceding.end.contact
        displacement.x.array[:] = self.preceding.end.displacement
        assert state is not None
        body, supported = self.solved.body, held_at(self.problem.model, self.preceding.path_step)
        if supported is not self.problem.model:  # other unknowns are prescribed
            body = replace(body, fixed=supported.fixed, of_contact={})
        return replace(self.solved, body=body, displacement=displacement, state=state)

    def explicit(
        self, data: ChangedStep, quantities: Sequence[Functional], earlier_values: Callable[[float], Array]
    ) -> Explicit:
        """``earlier_values``: the prescribed displacements of a load step at the owned dofs by its place."""
        if self.preceding is None or self.earlier is None:
            return explicit(self.solved, data, quantities)
        boundary, values = self.earlier.state.boundary, earlier_values(self.preceding.path_step)
        earlier = ChangedStep((), np.zeros_like(values), values, boundary, data.gap, None)
        return explicit(self.solved, data, quantities, (self.earlier, earlier))


class ChangedScene:
    """A scene in which one number is another."""

    def __init__(self, steps: NonlinearSteps, statement: Statement, path: str) -> None:
        self._problem, self._statement = steps.problem, statement
        self._model = self._supported() if path.startswith("displacement") else None
        touching = path.startswith("contact") or self._model is not None  # supports move contact points, too
        model = self._model or steps.problem.model
        self._touching = ProblemOfScene.of(statement, model, History()) if touching else None

    def _supported(self) -> Model:
        """The body with other supports; collective."""
        return prepare(at_rest(self._statement), self._problem.model.tagged, Timings(), path_step=-1)

    def values(self, path_step: float) -> Array:
        """The prescribed displacements at the owned dofs; collective."""
        model = held_at(self._problem.model if self._model is None else self._model, path_step)
        zero = np.zeros(model.fixed.size)
        return np.asarray(
            sum((factor * load.prescribed.x.array[: zero.size] for factor, load in model.applied_at(path_step)), zero)
        )

    def at(self, step: LinearisedStep) -> ChangedStep:
        """A load step with that number; collective."""
        usual, y, problem = step.usual, step.solved.displacement.copy(), self._problem
        if self._touching is None:
            return replace(usual, forces=problem.forces_anew(self._statement, y))
        if self._model is not None:
            values, fixed = self.values(step.path_step), step.solved.body.fixed
            y.x.array[: fixed.size][fixed] = values[fixed]
            y.x.scatter_forward()
            usual = replace(usual, prescribed=values, forces=problem.forces_anew(problem.statement, y))
        touching = self._touching
        touching.begin_at(-1.0 if step.preceding is None else step.preceding.path_step)
        touching.go_to(step.path_step)
        touching.u.x.array[:] = y.x.array
        begun = np.zeros_like(y.x.array) if step.earlier is None else step.earlier.displacement.x.array.copy()
        if self._model is not None and step.earlier is not None and step.preceding is not None:
            fixed = step.earlier.body.fixed
            begun[: fixed.size][fixed] = self.values(step.preceding.path_step)[fixed]
        *_, boundary, gap, law, _, drift = touching.linear.data_now(problem.linear, begun)
        spin = touching.linear.foundations.spin_at(boundary)
        return replace(usual, boundary=boundary, gap=gap, law=law, drift=drift, spin=spin)
