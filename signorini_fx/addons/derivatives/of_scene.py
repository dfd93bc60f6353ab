"""Derivatives of results of a scene by its numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.addons.derivatives.gradient import (
    By,
    ChangedStep,
    SolvedStep,
    columns,
    difference,
    elastic_forces,
    explicit,
)
from signorini_fx.arrays import Array
from signorini_fx.errors import SceneError
from signorini_fx.forms.nonlinear.results import SolvedBody
from signorini_fx.mechanics.body.discretisation import (
    contact_of,
    held_at,
    law_of,
    moved_since,
    placements,
    prepare,
)
from signorini_fx.mechanics.body.nonlinear_law import at_rest
from signorini_fx.mechanics.elasticity.moduli import lame_coefficients
from signorini_fx.mechanics.laws.protocol import FrictionLaw
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Load, Resistance
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.mechanics.statement.features import refused_by
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.quantities.differentiable import Functional, functional_of
from signorini_fx.records import History, Timings
from signorini_fx.results.accuracy.adjoint import REFUSES, Explicit
from signorini_fx.results.solution import ConvergenceError, Solution
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.nonlinear import ProblemOfScene, build_problem
from signorini_fx.scenes.reading import PATH, as_scene, way_of
from signorini_fx.scenes.scene import Scene
from signorini_fx.solving.solve_on_mesh import solve_mesh
from signorini_fx.solving.step import Report
from signorini_fx.tuned import DIFFERENCE_STEP

# A feature of a scene that has adjoint states, but no derivatives.
_OF_ONE_MESH = {
    "requested accuracy": "derivatives are those of one mesh, but the mesh depends on the data: "
    "remove `accuracy`",
}
# Features of a scene with nonlinear materials that have no derivatives.
REFUSES_IF_NONLINEAR = {
    "contact of two bodies": "derivatives are not possible yet where two nonlinear bodies touch",
}
_EXAMPLE = (
    "such as contact[0].friction.coefficient, material[0].young, or traction[0], a load as a whole"
)


@dataclass(frozen=True)
class Sensitivity:
    """The derivatives of one result by data of a scene.

    Attributes:
        of: the result, such as ``force bottom y``.
        value: its value.
        by: the paths of the data.
        data: their values; 1 for a whole load, nan for an expression, to which a constant is added.
        derivatives: derivatives of the result by each of them.
        between: number of contact points between two active sets, where the derivatives are
            one-sided.
        solution: the solution that is differentiated.
    """

    of: str
    value: float
    by: tuple[str, ...]
    data: tuple[float, ...]
    derivatives: tuple[float, ...]
    between: int
    solution: Solution

    def __repr__(self) -> str:
        return f"<Sensitivity of {self.of}: {dict(zip(self.by, self.derivatives, strict=True))}>"

    def __getitem__(self, path: str) -> float:
        """Return the derivative by the datum at a path."""
        return self.derivatives[self.by.index(path)]

    def __str__(self) -> str:
        """Return a table: value of each datum, derivative, and by how many per cent 1 % of the
        datum changes the result.
        """
        wide = max(len(path) for path in self.by)
        lines = [
            f"{self.of} = {self.value:.8g}",
            f"{'by':{wide}s}  {'value':>12s}  {'derivative':>14s}  {'relative':>10s}",
        ]
        for path, datum, slope in zip(self.by, self.data, self.derivatives, strict=True):
            share = (
                f"{slope * datum / self.value:10.4g}"
                if self.value != 0 and math.isfinite(datum)
                else f"{'-':>10s}"
            )
            datum_text = f"{datum:12.6g}" if math.isfinite(datum) else f"{'expression':>12s}"
            lines.append(f"{path:{wide}s}  {datum_text}  {slope:14.7g}  {share}")
        if self.between:
            lines.append(
                f"{self.between} contact points stand between two sets: there the derivatives are "
                "one-sided"
            )
        return "\n".join(lines)


def _refuse(statement: Statement, refuses: Mapping[str, str]) -> None:
    """Refuse a scene with features that have no derivatives, by a ``SceneError``."""
    problems = [
        (
            "".join(
                f"[{part}]" if isinstance(part, int) else f".{part}" for part in path
            ).removeprefix("."),
            reason,
        )
        for path, reason in dict.fromkeys(refused_by(statement, refuses))
    ]
    if problems:
        raise SceneError(problems)


def sensitivity(
    scene: object, of: str | Sequence[str], by: Sequence[str], comm: MPI.Comm = MPI.COMM_WORLD
) -> Sensitivity | list[Sensitivity]:
    """Solve a scene and differentiate its results with respect to its data; collective.

    Derivatives are those of the discrete solution, for fixed gamma and active sets.

    Args:
        scene: a scene on one mesh: a ``Scene``, the path of its file, or its mapping.
        of: the result or several, see ``functional_of``; of the last load step, or of another one
            with its number at the end, as in ``force bottom x step 2``.
        by: paths of numbers of the scene, such as ``contact[0].friction.coefficient``.  The path of
            an expression stands for a constant that is added to it, the path of a load, such as
            ``traction[0]``, for a factor of the whole load.
        comm: the ranks that share the work.

    Raises:
        SceneError: a result or a datum is not known, or has no derivative.
        ConvergenceError: the scene has no solution.

    Examples:
        >>> found = sfx.sensitivity(scene, "force bottom y", ["traction[0]"])
        >>> print(round(found.value, 6), round(found["traction[0]"], 6))
        4.0 4.0
    """
    scene = as_scene(scene, comm)
    statement = scene.statement
    if not statement.contact:
        raise SceneError.at("contact", "there is none: a problem without contact is linear")
    if reason := statement.kinematics.refuses.get("derivatives"):
        raise SceneError.at("material.hypothesis", reason)
    _refuse(statement, REFUSES | _OF_ONE_MESH)
    wanted = [of] if isinstance(of, str) else list(of)
    if statement.nonlinear:
        problem = partial(build_problem, scene, comm, History())
        sensitivities = _sensitivities(_NonlinearSteps.solved(statement, problem), wanted, by)
    else:
        sensitivities = _sensitivities(_Steps.solved(scene, comm), wanted, by)
    return sensitivities[0] if isinstance(of, str) else sensitivities


@dataclass(frozen=True)
class _Step:
    """A load step of a scene with its solution; the foundations of the model have their positions
    in this step.
    """

    model: Model
    place: float
    solved: SolvedStep
    number: int
    earlier: SolvedStep | None

    @cached_property
    def data(self) -> ChangedStep:
        """The data of the step, without forms, whose forces do not change with a datum at the
        solution; collective.
        """
        model = self.model
        assert model.boundary is not None
        assert model.data is not None
        return ChangedStep(
            forms=(),
            boundary=model.boundary,
            gap=model.data.gap,
            law=model.law,
            **_loads(model, self.place),
        )


@dataclass(frozen=True)
class _Steps:
    """The load steps of a scene, and its statement with contact points on the chosen sides."""

    steps: list[_Step]
    statement: Statement
    solution: Solution

    @classmethod
    def solved(cls, scene: Scene, comm: MPI.Comm) -> _Steps:
        """Solve a scene; collective."""
        # Coarser meshes give a start, and change nothing of the solution.
        scene = scene.model_copy(update={"solver": scene.solver.model_copy(update={"levels": 1})})
        solved: list[_Step] = []

        def keep(report: Report) -> None:
            model = report.mechanics.model
            contact = report.result.contact
            start = report.start
            assert contact is not None
            of = (
                model,
                report.posed.task,
                report.outcome,
                start,
                contact,
                report.result.displacement,
                start.law,
            )
            earlier = solved[-1].solved if solved else None
            solved.append(
                _Step(model, report.result.place, SolvedStep.of(*of), len(solved), earlier)
            )

        solution, *_ = solve_mesh(
            scene.statement, partial(load_mesh, scene, comm), History(), None, keep
        )
        if not solution.converged:
            raise ConvergenceError(solution)
        return cls(solved, scene.statement.changed(contact=solution.model.contacts), solution)

    @property
    def models(self) -> list[Model]:
        """The models of the load steps."""
        return [step.model for step in self.steps]

    def at(self, number: int) -> _Step:
        """Return a load step."""
        return self.steps[number]

    def by(self, path: str, change: float) -> By:
        """Return the function that gives the derivatives by the number at a path; collective.

        Args:
            path: path of the number.
            change: half width of the difference.
        """
        changes = (
            varied(self.statement, path, sign * change, self.steps[0].model.dimension)
            for sign in (1.0, -1.0)
        )
        statements = [self.statement.changed(**entries) for entries in changes]
        if path.startswith("material") and path.rpartition(".")[2] in ("young", "poisson"):
            return _by_modulus(self.steps[0].model, statements, change)
        data = [cache(_data(statement, self.steps, path)) for statement in statements]
        at = [lambda step, data=side: data(step.number) for side in data]
        before = [lambda step, data=side: data(step.number - 1) for side in data]
        return _by_difference(at, before, change)


def _by_difference(
    at: Sequence[Callable[[Any], ChangedStep]],
    before: Sequence[Callable[[Any], ChangedStep]],
    change: float,
) -> By:
    """Return the function that gives explicit derivatives by central differences.

    Args:
        at: functions from a load step to its data, with a larger and a smaller number.
        before: the same for the data of the previous step.
        change: half width of the difference.
    """

    def evaluated(step: _Step | _LinearisedStep, quantities: Sequence[Functional]) -> Explicit:
        found = []
        for now, last in zip(at, before, strict=True):
            preceding = None if step.earlier is None else (step.earlier, last(step))
            found.append(explicit(step.solved, now(step), quantities, preceding))
        larger, smaller = found
        return difference(larger, smaller, change)

    return evaluated


def _sensitivities(
    steps: _Steps | _NonlinearSteps, of: list[str], by: Sequence[str]
) -> list[Sensitivity]:
    statement = steps.statement
    model = steps.models[-1]
    entries = [_entry_of(statement, path, model.tagged.size, model.dimension) for path in by]
    quantities = [_at_step(steps.models, text) for text in of]
    data = [steps.by(path, change) for path, (_, change) in zip(by, entries, strict=True)]
    slopes, values, between = columns(len(steps.models), steps.at, quantities, data)
    return [
        Sensitivity(
            text,
            float(values[k]),
            tuple(by),
            tuple(value for value, _ in entries),
            tuple(slopes[k].tolist()),
            sum(between[: at + 1]),
            steps.solution,
        )
        for k, (text, (at, _)) in enumerate(zip(of, quantities, strict=True))
    ]


def _at_step(models: Sequence[Model], text: str) -> tuple[int, Functional]:
    """Return the number of the load step of a result, from 0, and the result.

    Args:
        models: the models of all load steps.
        text: name of the result, perhaps with a number of a load step.
    """
    words = text.rpartition(" step ")
    if not words[1]:
        return len(models) - 1, functional_of(models[-1], text)
    number = int(words[2]) if words[2].strip().isdecimal() else 0
    if not 1 <= number <= len(models):
        raise SceneError.at(f"of {text!r}", f"there are load steps 1 to {len(models)}")
    return number - 1, functional_of(models[number - 1], words[0])


def _by_modulus(model: Model, statements: Sequence[Statement], change: float) -> By:
    """Return the function that gives the derivatives by a modulus, from forms with the derivatives
    of the Lame parameters.

    Differences of forces would be wrong by 1e-4 where a body is slender.
    """
    larger, smaller = statements
    high = lame_coefficients(larger, model.tagged)
    low = lame_coefficients(smaller, model.tagged)
    for upper, lower in zip(high, low, strict=True):
        values = upper.x.array if isinstance(upper, fem.Function) else upper.value
        values -= lower.x.array if isinstance(lower, fem.Function) else lower.value
        values /= 2 * change
    # The forms are linear in the Lame parameters.
    forms = replace(model.scene_law, lame=high).compiled(model.space)
    strained = any(entry.gives_strain for _, entry in statements[0].listed())
    prepared = (
        [prepare(statement, model.tagged, Timings()) for statement in statements]
        if strained
        else []
    )

    def evaluated(step: _Step, quantities: Sequence[Functional]) -> Explicit:
        body = step.model
        residual = elastic_forces(body, forms, step.solved.displacement)
        if prepared:
            above, below = prepared
            forces = _loads(above, step.place)["forces"] - _loads(below, step.place)["forces"]
            residual.axpy(-0.5 / change, body.vector(forces))
        residual.getArray()[body.prescribed] = 0.0
        nothing = np.zeros(step.solved.law.tied.shape)
        return Explicit([0.0] * len(quantities), residual, nothing, nothing[:, 0])

    return evaluated


def _data(statement: Statement, steps: list[_Step], path: str) -> Callable[[int], ChangedStep]:
    """Return a function from the number of a load step to its data, for a statement with another
    number at a path.
    """
    of_contact = path.startswith("contact")
    changed = None if of_contact else prepare(statement, steps[0].model.tagged, Timings())
    at = [statement.contacts_at(step.place) for step in steps]

    @cache
    def contact(k: int) -> dict[str, Any]:
        model = steps[k].model
        if k and at[k] is at[k - 1]:
            return contact(k - 1)
        step_model = replace(model, contacts=at[k])
        if ".friction." in path:
            return {"law": law_of(step_model)}
        parts = contact_of(step_model)
        moving = {"gap": parts["data"].gap, "boundary": parts["boundary"], "law": parts["law"]}
        if any(effect.moves for effect in step_model.contacts):
            before = at[k - 1] if k else statement.contacts_at(-1)
            moving["drift"] = moved_since(
                replace(step_model, boundary=parts["boundary"]), placements(before)
            )
        return moving

    def data(k: int) -> ChangedStep:
        changes = (
            contact(k)
            if changed is None
            else {"forms": changed.forms, **_loads(changed, steps[k].place)}
        )
        return replace(steps[k].data, **changes)

    return data


def _loads(model: Model, load_step: float) -> dict[str, Any]:
    loads = model.loads_at(load_step)
    return {"forces": loads.forces, "prescribed": loads.prescribed[: loads.forces.size]}


# --- scenes with nonlinear materials --------------------------------------------------------------

# An equilibrium at finite displacements has the derivative of its last linearised problem, formed
# anew at the solution, with contact forces that turn with the body.  What a material or a load
# changes of the residual is a difference of the residual that the certificate evaluates: nothing is
# compiled.


@dataclass(frozen=True)
class _NonlinearSteps:
    """The load steps of a scene with nonlinear materials, and the problem that solved them."""

    problem: ProblemOfScene
    reached: list[SolvedBody]
    solution: Solution

    @classmethod
    def solved(
        cls, statement: Statement, build_problem: Callable[[], ProblemOfScene]
    ) -> _NonlinearSteps:
        """Solve a scene; collective."""
        _refuse(statement, REFUSES_IF_NONLINEAR)
        reached = list[SolvedBody]()
        problem = build_problem()
        solution = problem.solved(on_step=lambda step: reached.append(problem.reached()))
        if not solution.converged:
            raise ConvergenceError(solution)
        return cls(problem, reached, solution)

    def by(self, path: str, change: float) -> By:
        """Return the function that gives the derivatives by the number at a path; collective.

        Args:
            path: path of the number.
            change: half width of the difference.
        """
        statement = self.statement
        dimension = self.problem.model.dimension
        changed = [
            _ChangedScene(
                self, statement.changed(**varied(statement, path, sign * change, dimension)), path
            )
            for sign in (1.0, -1.0)
        ]
        return _by_difference(
            [scene.at for scene in changed], [scene.before for scene in changed], change
        )

    @property
    def models(self) -> list[Model]:
        """The model of all load steps, once for each."""
        return [self.problem.model] * len(self.reached)

    @property
    def statement(self) -> Statement:
        """The entries of the scene, with contact points on the chosen sides."""
        return self.problem.statement

    def at(self, number: int) -> _LinearisedStep:
        """Return a load step with its linearised problem; collective."""
        step = self.reached[number]
        preceding = self.reached[number - 1] if number else None
        solved = SolvedStep.of(*self.problem.linearised(step))
        solved = replace(solved, displacement=solved.displacement.copy())
        return _LinearisedStep(self.problem, step.result.place, solved, preceding)


@dataclass(frozen=True)
class _LinearisedStep:
    """A load step of a scene with its linearised problem.

    Attributes:
        preceding: the end of the previous load step; None in the first step.
    """

    problem: ProblemOfScene
    path_step: float
    solved: SolvedStep
    preceding: SolvedBody | None

    @cached_property
    def usual(self) -> ChangedStep:
        """The data of the step; collective."""
        problem = self.problem
        forces = problem.forces_anew(problem.statement, self.solved.displacement)
        return replace(ChangedStep(*problem.linear.data_now()), forces=forces)

    @cached_property
    def earlier(self) -> SolvedStep | None:
        """The previous load step, as far as slips of this one need it, or None without one."""
        if self.preceding is None:
            return None
        displacement = self.solved.displacement.copy()
        end = self.preceding.result
        state = end.contact
        displacement.x.array[:] = end.displacement.x.array
        assert state is not None
        body = self.solved.body
        supported = held_at(self.problem.model, self.preceding.result.place)
        if supported is not self.problem.model:  # other unknowns are prescribed
            body = replace(body, fixed=supported.fixed, of_contact={})
        return replace(self.solved, body=body, displacement=displacement, state=state)


class _ChangedScene:
    """A scene with another value of one number."""

    def __init__(self, steps: _NonlinearSteps, statement: Statement, path: str) -> None:
        self._problem = steps.problem
        self._statement = statement
        self._model = None
        if path.startswith("displacement"):  # other supports
            self._model = prepare(
                at_rest(statement), steps.problem.model.tagged, Timings(), path_step=-1
            )
        touching = (
            path.startswith("contact") or self._model is not None
        )  # supports move contact points, too
        model = self._model or steps.problem.model
        self._touching = ProblemOfScene(statement, model, History()) if touching else None

    def values(self, path_step: float) -> Array:
        """Return the prescribed displacements at the owned dofs; collective."""
        model = held_at(self._problem.model if self._model is None else self._model, path_step)
        return model.loads_at(path_step).prescribed[: model.fixed.size]

    def before(self, step: _LinearisedStep) -> ChangedStep:
        """Return the data of the previous load step with this value; collective."""
        assert step.preceding is not None
        assert step.earlier is not None
        values = self.values(step.preceding.result.place)
        return replace(step.usual, prescribed=values, boundary=step.earlier.state.boundary)

    def at(self, step: _LinearisedStep) -> ChangedStep:
        """Return the data of a load step with this value; collective."""
        usual = step.usual
        y = step.solved.displacement.copy()
        problem = self._problem
        if self._touching is None:
            return replace(usual, forces=problem.forces_anew(self._statement, y))
        if self._model is not None:
            values = self.values(step.path_step)
            fixed = step.solved.body.fixed
            y.x.array[: fixed.size][fixed] = values[fixed]
            y.x.scatter_forward()
            usual = replace(
                usual, prescribed=values, forces=problem.forces_anew(problem.statement, y)
            )
        touching = self._touching
        touching.begin_at(-1.0 if step.preceding is None else step.preceding.result.place)
        touching.go_to(step.path_step)
        touching.u.x.array[:] = y.x.array
        begun = (
            np.zeros_like(y.x.array)
            if step.earlier is None
            else step.earlier.displacement.x.array.copy()
        )
        if self._model is not None and step.earlier is not None and step.preceding is not None:
            fixed = step.earlier.body.fixed
            begun[: fixed.size][fixed] = self.values(step.preceding.result.place)[fixed]
        *_, boundary, gap, law, drift = touching.linear.data_now(
            problem.linear, replace(touching.linear.begin, displacement=begun)
        )
        spin = touching.linear.foundations.spin_at(boundary, touching.linear.begin.placed)
        return replace(usual, boundary=boundary, gap=gap, law=law, drift=drift, spin=spin)


# --- the numbers of a statement, by their paths ---------------------------------------------------


def _entry_of(
    statement: Statement, path: str, extent: float, dimension: int
) -> tuple[float, float]:
    """Return the number at a path, and the half width for a difference.

    The number is 1 for a whole load, nan for an expression.
    """
    if path.startswith("material") and not all(
        material.isotropic for material in statement.material
    ):
        raise SceneError.at(path, "is possible where all materials are isotropic")
    if any(part in path for part in (".friction.ratio", ".friction.along", ".foundation.spring")):
        raise SceneError.at(path, "cannot differentiate with respect to this entry")
    if path.endswith("grading"):
        raise SceneError.at(
            path, "cannot differentiate with respect to this entry: use young instead"
        )
    *_, (parent, _), (value, _) = _way(statement, path, dimension)
    if isinstance(value, Load):
        return 1.0, 1e-3
    if isinstance(parent, FrictionLaw | Resistance) and value == 0.0:
        raise SceneError.at(path, "no derivative at 0: use a small value")
    root = path.partition("[")[0].partition(".")[0]
    if (
        isinstance(value, Expression)
        or value == 0.0
        or (root == "contact" and ".friction" not in path)
    ):
        unit = extent if root in ("contact", "displacement") else statement.young
        if any(
            part in path for part in ("rotation", "direction", ".friction.coefficient", ".poisson")
        ):
            unit = 1.0
    else:
        unit = abs(value)
    return (float("nan") if isinstance(value, Expression) else float(value)), DIFFERENCE_STEP * unit


def varied(statement: Statement, path: str, change: float, dimension: int) -> dict[str, Any]:
    """Return the arguments of ``statement.changed`` that increase the number at a path by
    ``change``.

    It is added to an expression, and a load is multiplied by one plus it.
    """
    *way, (value, _) = _way(statement, path, dimension)
    if isinstance(value, Load):
        value = value.model_copy(
            update={"factors": tuple((1 + change) * f for f in statement.factors_of(value))}
        )
    elif isinstance(value, Expression):
        value = Expression(f"({value.text}) + ({float(change)!r})", value.time, value.allows_time)
    else:
        value = value + change
    for table, key in way[:0:-1]:
        if isinstance(key, int):
            value = (*table[:key], value, *table[key + 1 :])
        else:
            value = (
                {**table, key: value}
                if isinstance(table, Mapping)
                else table.model_copy(update={key: value})
            )
    return {str(way[0][1]): value}


def _way(statement: Statement, path: str, dimension: int) -> list[tuple[Any, str | int]]:
    """Return the tables on the path to a number, each with the key of the next one, and at last the
    number.
    """
    keys: list[str | int] = way_of(path) if PATH.fullmatch(path) else []
    if not keys or keys[0] not in statement.effects:
        raise SceneError.at(path, f"cannot differentiate with respect to this entry, {_EXAMPLE}")
    value: Any = statement.effects
    way: list[tuple[Any, str | int]] = []
    for key in keys:
        if (
            isinstance(key, str) and isinstance(value, tuple) and len(value) == 1
        ):  # a list of one entry stands for this entry
            way = [*way, (value, 0)]
            value = value[0]
        way.append((value, key))
        if isinstance(key, int):
            value = value[key] if isinstance(value, tuple | list) and key < len(value) else None
        elif isinstance(value, Mapping):
            value = value.get(key)
        else:
            value = getattr(value, key) if key in getattr(type(value), "model_fields", ()) else None
        if value is None and key == "shift" and isinstance(keys[-1], int):
            value = (0.0,) * dimension
        if value is None:
            raise SceneError.at(path, f"there is no such entry, or it has no value; {_EXAMPLE}")
    if isinstance(value, tuple) and len(value) == 1:
        way = [*way, (value, 0)]
        value = value[0]
    if isinstance(value, bool) or not isinstance(value, int | float | Expression | Load):
        raise SceneError.at(path, f"is no number; {_EXAMPLE}")
    return [*way, (value, "")]
