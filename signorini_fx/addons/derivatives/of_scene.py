"""Derivatives of results of a scene by its numbers."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.addons.derivatives.entries import default_entries, entry_of, load_of, varied
from signorini_fx.addons.derivatives.gradient import (
    By,
    ChangedStep,
    Explicit,
    SolvedStep,
    adjoints_of,
    central,
    derivatives,
    elastic_forces,
    explicit,
)
from signorini_fx.addons.derivatives.of_nonlinear_scene import NonlinearSteps, columns
from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.body.discretisation import alone, contact_of, law_of, moved_since, placed, prepare
from signorini_fx.mechanics.body.elastic_body import sum_of
from signorini_fx.mechanics.elasticity.moduli import lame_coefficients
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.rigid.rigid_bodies import Driven
from signorini_fx.mechanics.statement.effect import Force, InitialStrain, Resistance
from signorini_fx.mechanics.statement.features import refuse
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.quantities.differentiable import functional_of
from signorini_fx.quantities.functional import Functional
from signorini_fx.records import History, Timings
from signorini_fx.results.solution import ConvergenceError, Solution
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.nonlinear import ProblemOfScene, problem_of
from signorini_fx.scenes.reading import as_scene
from signorini_fx.solving.solve_on_mesh import solve_mesh
from signorini_fx.solving.stepped_body import LoadStep

Array = npt.NDArray[np.float64]
# Features of a scene that have no derivatives.
REFUSES = {
    "material with a state": "derivatives are not possible yet with a material that has a state",
    "mixed element": "derivatives are not possible yet with a pressure of its own: leave 'mixed' out",
    "soft contact": "derivatives are those of contact that gives way as gamma_n says: leave 'overclosure' out",
    "shortening by force": "derivatives are not possible yet where a force shortens a section",
    "requested accuracy": "derivatives are those of one mesh, and meshes of a requested accuracy jump with the data: "
    "leave it out",
}
# Assembling a matrix takes as long as applying its form to the displacements of so many load steps.
_FEW = 2


@dataclass(frozen=True)
class Sensitivity:
    """The derivatives of one result by data of a scene.

    Attributes:
        of: the result, such as ``force bottom y``.
        value: of it.
        by: the paths of the data.
        data: their values; 1 for a load as a whole, nan for an expression, which gets another term.
        derivatives: of the result by each of them.
        between: contact points that stand between two sets: there the derivatives are those of one side.
        solves: linear solves that the adjoint problem took.
        seconds: wall seconds of the adjoint problem, and of the derivatives from it.
        solution: whose derivatives they are.
        solution_seconds: wall seconds of its solve.
    """

    of: str
    value: float
    by: tuple[str, ...]
    data: tuple[float, ...]
    derivatives: tuple[float, ...]
    between: int
    solves: int
    seconds: float
    solution: Solution
    solution_seconds: float

    def __repr__(self) -> str:
        return f"<Sensitivity of {self.of}: {dict(zip(self.by, self.derivatives, strict=True))}>"

    def __getitem__(self, path: str) -> float:
        """The derivative by the entry at a path."""
        return self.derivatives[self.by.index(path)]

    def __str__(self) -> str:
        """A table: value of each datum, derivative, and by how many per cent 1 % of the datum changes the result."""
        wide = max(len(path) for path in self.by)
        lines = [
            f"{self.of} = {self.value:.8g}",
            f"{'by':{wide}s}  {'value':>12s}  {'derivative':>14s}  {'relative':>10s}",
        ]
        for path, datum, slope in zip(self.by, self.data, self.derivatives, strict=True):
            share = f"{slope * datum / self.value:10.4g}" if self.value != 0 and math.isfinite(datum) else f"{'-':>10s}"
            datum_text = f"{datum:12.6g}" if math.isfinite(datum) else f"{'expression':>12s}"
            lines.append(f"{path:{wide}s}  {datum_text}  {slope:14.7g}  {share}")
        if self.between:
            lines.append(f"{self.between} contact points stand between two sets: there the derivatives are one-sided")
        return "\n".join(lines)


def sensitivity(
    scene: object, of: str | Sequence[str], by: Sequence[str] | None = None, comm: MPI.Comm = MPI.COMM_WORLD
) -> Sensitivity | list[Sensitivity]:
    """Solve a scene, and differentiate results of it by its data; collective.

    gamma and the choice of the contact sets do not change: derivatives are those of the discrete solution.

    Args:
        scene: on one mesh: a ``Scene``, the path of its file, or its mapping.
        of: the result or several: see ``functional_of``; of the last load step, or of another one with
            its number behind it, as in ``force bottom x step 2``.
        by: paths of numbers of the scene, such as ``contact[0].friction.coefficient``; of an expression a term that is
            added to it; the path of a load itself, such as ``traction[0]``: a factor of all of it.  None: friction and
            gap of each contact, the materials, and each load as a whole.
        comm: the ranks that share the work.

    Raises:
        SceneError: a result or a datum is not known, or has no derivative.
        ConvergenceError: the scene has no solution.
    """
    scene = as_scene(scene)
    _check(scene.statement)
    wanted = [of] if isinstance(of, str) else list(of)
    if scene.statement.nonlinear:
        of_bodies = _of_nonlinear(scene.statement, partial(problem_of, scene, comm, History()), wanted, by)
        return of_bodies[0] if isinstance(of, str) else of_bodies
    # Coarser meshes give a start, and change nothing of the solution.
    scene = scene.model_copy(update={"solver": scene.solver.model_copy(update={"levels": 1})})
    solved: list[_Step] = []

    def keep(step: LoadStep) -> None:
        if step.result.step == 1:  # a ramp may begin again
            solved.clear()
        solved.append(_Step.of(step))

    begin = time.perf_counter()
    solution, *_ = solve_mesh(scene.statement, partial(load_mesh, scene, comm), History(), None, keep)
    seconds = parallel.global_max(comm, time.perf_counter() - begin)
    if not solution.converged:
        raise ConvergenceError(solution)
    # Contact points may be on the other side than the scene says.
    statement = scene.statement.changed(contact=solution.statement.contact)
    sensitivities = _sensitivities(statement, solved, wanted, by, solution, seconds)
    return sensitivities[0] if isinstance(of, str) else sensitivities


@dataclass(frozen=True)
class _Step:
    """A load step of a scene.

    Attributes:
        model: the scene with its foundations where they are in this step.
        place: in the lists of factors.
        solved: its solution.
    """

    model: Model
    place: float
    solved: SolvedStep

    @cached_property
    def data(self) -> ChangedStep:
        """What derivatives leave out where a datum does not change it; collective."""
        model = self.model
        assert model.boundary is not None
        assert model.data is not None
        return ChangedStep(
            forms=(), boundary=model.boundary, gap=model.data.gap, law=model.law, **_loads(model, self.place)
        )

    @classmethod
    def of(cls, step: LoadStep) -> _Step:
        """One that has just been solved; collective."""
        model, state = step.body.model, step.result.contact
        assert state is not None
        of = model, step.task, step.outcome, step.start, state, step.result.displacement, step.start.law
        return cls(model, step.result.place, SolvedStep.of(*of))


def _check(statement: Statement) -> None:
    """Whether derivatives of the problem are known."""
    if not statement.contact:
        raise SceneError([("contact", "there is none: a problem without contact is linear")])
    if reason := statement.kinematics.refuses.get("derivatives"):
        raise SceneError([("material.hypothesis", reason)])
    refuse(statement, REFUSES)


def _sensitivities(
    statement: Statement,
    steps: list[_Step],
    of: list[str],
    by: Sequence[str] | None,
    solution: Solution,
    seconds: float,
) -> list[Sensitivity]:
    model = steps[-1].model
    paths = tuple(default_entries(statement) if by is None else by)
    entries = [entry_of(statement, path, model.tagged.size, model.dimension) for path in paths]
    begin = time.perf_counter()
    quantities = [_at_step([step.model for step in steps], text) for text in of]
    adjoints = adjoints_of([step.solved for step in steps], quantities if paths else [])
    columns = [
        derivatives(adjoints, quantities, _by(statement, steps, path, step, quantities))
        for path, (_, step) in zip(paths, entries, strict=True)
    ]
    end = time.perf_counter()
    return [
        Sensitivity(
            text,
            _value(steps[at].solved, quantity),
            paths,
            tuple(value for value, _ in entries),
            tuple(column[k] for column in columns),
            sum(step.solved.law.between for step in steps[: at + 1]),
            sum(
                adjoint.solves
                for step_adjoints in adjoints
                for adjoint in step_adjoints[k : k + 1]
                if adjoint is not None
            ),
            parallel.global_max(model.comm, (end - begin)),
            solution,
            seconds,
        )
        for k, (text, (at, quantity)) in enumerate(zip(of, quantities, strict=True))
    ]


def _of_nonlinear(
    statement: Statement, problem: Callable[[Timings], ProblemOfScene], of: list[str], by: Sequence[str] | None
) -> list[Sensitivity]:
    """Those of a scene with a nonlinear material; ``problem``: makes its problem; collective."""
    steps = NonlinearSteps.solved(statement, problem)
    statement, model = steps.statement, steps.solution.model
    paths = tuple(default_entries(statement) if by is None else by)
    entries = [entry_of(statement, path, model.tagged.size, model.dimension) for path in paths]
    begin = time.perf_counter()
    quantities = [_at_step([model] * len(steps.reached), text) for text in of]
    totals = columns(steps, quantities, [(path, step) for path, (_, step) in zip(paths, entries, strict=True)])
    seconds = parallel.global_max(model.comm, time.perf_counter() - begin)
    data = tuple(value for value, _ in entries)
    return [
        Sensitivity(
            text,
            float(totals.values[k]),
            paths,
            data,
            tuple(totals.slopes[k].tolist()),
            sum(totals.between[: at + 1]),
            int(totals.solves[k]),
            seconds,
            steps.solution,
            steps.seconds,
        )
        for k, (text, (at, _)) in enumerate(zip(of, quantities, strict=True))
    ]


def _value(solved: SolvedStep, quantity: Functional) -> float:
    state = solved.state
    return quantity.value(solved.displacement, state.boundary, state.pressure, state.shear)


def _at_step(models: Sequence[Model], text: str) -> tuple[int, Functional]:
    """The number of the load step of a result, and the result; ``models``: of all load steps."""
    words = text.rpartition(" step ")
    if not words[1]:
        return len(models) - 1, functional_of(models[-1], text)
    number = int(words[2]) if words[2].strip().isdecimal() else 0
    if not 1 <= number <= len(models):
        raise SceneError([(f"of {text!r}", f"there are load steps 1 to {len(models)}")])
    return number - 1, functional_of(models[number - 1], words[0])


def _by(
    statement: Statement, steps: list[_Step], path: str, step: float, quantities: Sequence[tuple[int, Functional]]
) -> By:
    """The derivatives of what depends on a number of the problem; collective.

    Args:
        statement: what is stated of it.
        steps: its load steps.
        path: of the number.
        step: by how much it is changed.
        quantities: each with the number of its load step.
    """
    changes = (varied(statement, path, change, steps[0].model.dimension) for change in (step, -step))
    above, below = (statement.changed(**entries) for entries in changes)
    load = load_of(statement, path)
    step_quantities = [[quantity for number, quantity in quantities if number == k] for k in range(len(steps))]
    if path.startswith("material") and path.rpartition(".")[2] in ("young", "poisson"):
        residual = _by_modulus(above, below, step, steps)
    elif isinstance(load, Force | InitialStrain) and load.acts:
        residual = _by_load(above, below, step, steps, path)
    else:

        def at(changed: Statement) -> By:
            data = cache(_data(changed, steps, path))

            def evaluated(k: int) -> Explicit:
                previous = (steps[k - 1].solved, data(k - 1)) if k else None
                return explicit(steps[k].solved, data(k), step_quantities[k], previous)

            return evaluated

        return central(at(above), at(below), step)
    return lambda k: Explicit([0.0] * len(step_quantities[k]), residual(k))


def _by_modulus(above: Statement, below: Statement, step: float, steps: list[_Step]) -> Callable[[int], PETSc.Vec]:
    """R_p of each load step, where p is a modulus: the forms of the body are linear in the Lame parameters, and are
    assembled with the derivatives of these in their place.
    """
    model, twice = steps[0].model, 2 * step
    forms: Sequence[fem.Form] | PETSc.Mat = model.forms[: len(model.forms) - len(model.resists or ())]
    high, low = (lame_coefficients(entry, model.tagged) for entry in (above, below))
    slopes = [(_values(entry) - _values(lower)) / twice for entry, lower in zip(high, low, strict=True)]
    if len(steps) > _FEW:
        with _lame(model, slopes):
            forms = sum_of(forms, [])
    strained = any(entry.strains for _, entry in above.listed())
    prepared = [prepare(entry, model.tagged, Timings()) for entry in (above, below)] if strained else []

    def residual(k: int) -> PETSc.Vec:
        body = steps[k].model
        with _lame(body, slopes):
            slope = elastic_forces(body, forms, steps[k].solved.displacement)
        if prepared:
            forces = [_loads(changed, steps[k].place)["forces"] for changed in prepared]
            slope.axpy(-1 / twice, body.vector(forces[0] - forces[1]))
        slope.getArray()[body.prescribed] = 0.0
        return slope

    return residual


def _by_load(
    above: Statement, below: Statement, step: float, steps: list[_Step], path: str
) -> Callable[[int], PETSc.Vec]:
    """R_p of each load step, where p belongs to a load that prescribes nothing: nothing else is assembled."""
    loads = []
    for statement in (above, below):
        load = load_of(statement, path)
        assert load is not None
        loads.append(alone(steps[0].model, statement, load))

    def residual(k: int) -> PETSc.Vec:
        load_step, body = steps[k].place, steps[k].model
        high, low = (load.factor(load_step) * load.at(load_step).forces for load in loads)
        slope = body.vector(low - high)
        slope.scale(0.5 / step)
        slope.getArray()[body.prescribed] = 0.0
        return slope

    return residual


def _data(statement: Statement, steps: list[_Step], path: str) -> Callable[[int], ChangedStep]:
    """The data of each load step of a scene that differs in contact, loads, or supports."""
    of_contact, of_friction = path.startswith("contact"), path.startswith("contact") and ".friction." in path
    changed = (
        None if of_contact and not statement.rigid_bodies else prepare(statement, steps[0].model.tagged, Timings())
    )
    stated = [statement.placed(step.place) for step in steps]

    @cache
    def contact(k: int) -> dict[str, Any]:
        model, statement_k = steps[k].model, stated[k]
        if k and statement_k is stated[k - 1]:
            return contact(k - 1)
        if of_friction:
            return {"law": law_of(model, statement_k)}
        if changed is not None:
            step_model = placed(changed, steps[k].place)
            assert step_model.data is not None
            return {"boundary": step_model.boundary, "gap": step_model.data.gap, "law": step_model.law}
        parts = contact_of(model, statement_k)
        moving = {"gap": parts["data"].gap, "boundary": parts["boundary"], "law": parts["law"]}
        if any(effect.moves for effect in statement_k.contact):
            step_model = replace(model, statement=statement_k, boundary=parts["boundary"])
            moving["drift"] = moved_since(step_model, stated[k - 1] if k else statement_k.placed(-1))
        return moving

    def data(k: int) -> ChangedStep:
        model, usual = steps[k].model, steps[k].data
        step_data = replace(usual, usual=usual)
        if of_contact:
            step_data = replace(step_data, **contact(k))
        if changed is None:
            return step_data
        loads = _loads(changed, steps[k].place)
        unchanged = not statement.of(Resistance) and np.array_equal(loads["prescribed"], step_data.prescribed)
        if parallel.any_rank(model.comm, not unchanged) or step_data.driven is not None:
            step_data = replace(step_data, forms=changed.forms if statement.of(Resistance) else model.forms)
        return replace(step_data, **loads)

    return data


def _loads(model: Model, load_step: float) -> dict[str, Any]:
    applied = model.applied_at(load_step)
    zero = np.zeros(model.fixed.size)
    return {
        "driven": Driven.together([(factor, load.driven) for factor, load in applied if load.driven is not None]),
        "forces": sum((factor * load.forces for factor, load in applied), zero),
        "prescribed": sum((factor * load.start for factor, load in applied), zero),
    }


@contextmanager
def _lame(model: Model, values: Sequence[Any]) -> Iterator[None]:
    """The forms of the body have other numbers in the place of the Lame parameters."""
    saved = [_values(part).copy() for part in model.elastic.lame]
    try:
        for mine, replacement in zip(model.elastic.lame, values, strict=True):
            _values(mine)[...] = replacement
        yield
    finally:
        for mine, usual in zip(model.elastic.lame, saved, strict=True):
            _values(mine)[...] = usual


def _values(coefficient: Any) -> Array:
    return coefficient.x.array if isinstance(coefficient, fem.Function) else coefficient.value
