"""Solves for many values of one parameter, each with what the last one leaves to it.

That is the condensed elastic system where only gaps, friction, forces or a factor of the loads change, all but the
stiffness where Young's modulus or Poisson's ratio does, else the mesh unless the parameter is one of the mesh, and
always the active sets to begin with.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.linalg.choice import krylov_from
from signorini_fx.errors import SceneError
from signorini_fx.mechanics.body.discretisation import discretise, with_forces, with_gap_and_friction, with_moduli
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.laws.protocol import FrictionLaw
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodyMotion
from signorini_fx.mechanics.statement.changes import changed
from signorini_fx.mechanics.statement.effect import Force, InitialStrain
from signorini_fx.mechanics.statement.expressions import sample
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import History, Status, Timings
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.certificate.law_of_method import Law, Tractions
from signorini_fx.results.mechanics import StatedBody
from signorini_fx.scenes.hierarchy import coarser_scenes
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import as_scene, parse_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import refuse_other_than_comm
from signorini_fx.solving.check.refusals import refuse_beforehand
from signorini_fx.solving.first_start import begin_at_coarse
from signorini_fx.solving.iterated_interfaces.protocol import LoadStepStart, solve_step
from signorini_fx.solving.nested import carry_over
from signorini_fx.solving.solve_on_mesh import contact_task

if TYPE_CHECKING:
    from signorini_fx.results.section_forces import SectionForce


@dataclass(frozen=True, repr=False)
class SweepPoint:
    """The solution for one value of the parameter.

    The contact state is stored; displacement and certificate, which need the whole body, are computed on request.

    Attributes:
        value: value of the parameter.
        status: how the iteration ended.
        contact: nodal state of the contact boundary of this rank.
        linear_solves: linear solves for this value, on the mesh of the scene.
    """

    value: Any
    status: Status
    contact: ContactState
    linear_solves: int
    _law: Law
    _model: StatedBody
    _load: float
    _of_body: Callable[[], tuple[fem.Function, tuple[RigidBodyMotion, ...]]]

    def __repr__(self) -> str:
        value = f"{self.value:g}" if isinstance(self.value, float) else self.value
        return f"<SweepPoint {value}: {self.status.value}, {self.linear_solves} linear solves>"

    def displacement(self) -> fem.Function:
        """The displacement of the whole body; collective, one back substitution."""
        return self._of_body()[0]

    def tools(self) -> tuple[RigidBodyMotion, ...]:
        """How rigid bodies have moved; collective."""
        return self._of_body()[1]

    def without_system(self) -> SweepPoint:
        """The same with the displacement computed, and without what it is computed from; collective."""
        of_body, model = self._of_body(), replace(self._model, of_body={}, of_contact={})
        return replace(self, _model=model, _of_body=lambda: of_body)

    def preloads(self) -> list[SectionForce]:
        """The forces through sections that are tightened; collective."""
        from signorini_fx.results.section_forces import section_forces

        return section_forces(self._model.statement, self._model.tagged, self.displacement(), 0, self._load)

    def certificate(self) -> Certificate:
        """The check of the conditions of the problem on the whole body; collective."""
        contact, (displacement, rigid) = self.contact, self._of_body()
        claim = displacement, Tractions.of(contact)
        return self._model.certified(*claim, law=self._law, step=0, last=None, rigid=rigid, scale=self._load)


def _of_body(
    model: Model, task: Task, x: PETSc.Vec, load: float, contact: ContactState
) -> tuple[fem.Function, tuple[RigidBodyMotion, ...]]:
    """The displacement of the body, and how rigid bodies have moved; collective.

    Args:
        model: the model.
        task: its contact problem.
        x: the iterate at the end.
        load: factor of all loads.
        contact: the contact points.
    """
    for interface in model.statement.interfaces:
        interface.recalled(model, task, 0, *interface.stored(model, 0, contact))
    task.system.set_load(load * model.factors(0))
    unknowns = task.system.displacement(x)
    rigid = model.rigid.moved(model.driven(unknowns, task.rest)) if model.rigid.bodies else ()
    return model.from_rest(task.rest, unknowns), rigid


@dataclass(frozen=True)
class _Value:
    """What a value of the parameter sets: the factor of all loads; the friction coefficient, None: as in the scene."""

    load: float = 1.0
    coefficient: float | None = None

    def start(self, start: Start, model: Model) -> Start:
        """The start with it; the friction coefficient where the law has one."""
        start, law = replace(start, factors=self.load * model.factors(0)), start.law
        if law is None or self.coefficient is None:
            return start
        return replace(start, law=replace(law, coefficient=np.where(law.coefficient > 0, self.coefficient, 0.0)))


def _coarser(scene: Scene, model: Model, first: Sequence[_Value]) -> tuple[MeshLevel | None, ContactState | None]:
    """The coarser meshes that ``levels`` asks for, as levels of multigrid where it is used, and the contact state there
    for the first value, if there is one, unless an interface solves the load step; collective.
    """
    coarser: MeshLevel | None = None
    state: ContactState | None = None
    large = model.dofs >= krylov_from(model.system_size, scene.solver.linear_algebra)
    if large and scene.statement.generated:
        for coarse in coarser_scenes(scene, scene.solver.levels):
            body = discretise(coarse.statement, load_mesh(coarse, model.tagged.mesh.comm), Timings())
            solved = None
            for value in () if scene.statement.depends_on_solution_at(0) else first:
                task = contact_task(body, History(), coarser)
                start = value.start(_begun(task, body, coarser, state), body)
                outcome = solve_task(task, start)
                state = body.state(task, outcome, start) if outcome.status is Status.CONVERGED else None
                solved = None if state is None else body.from_rest(task.rest, outcome.displacement())
            coarser = body.level(coarser, solved)
    return coarser, state


def _begun(task: Task, model: Model, coarser: MeshLevel | None, state: ContactState | None) -> Start:
    """The start of a task, from the contact state on the next coarser mesh if there is one; collective."""
    if state is None or model.boundary is None:
        return task.start
    if coarser is not None:
        begin_at_coarse(task, coarser, model)
    return task.start.begin_from(*carry_over(state, model.boundary))


@dataclass(frozen=True)
class _Body:
    """A scene on its mesh, and what its solution leaves to the next one.

    Attributes:
        scene: as it was given.
        tagged: its mesh.
        model: the scene on it.
        task: its contact problem.
        begin: where the next value starts.
        state: the contact points of the last value that has a solution; None: there is none so far.
    """

    scene: Scene
    tagged: TaggedMesh
    model: StatedBody
    task: Task
    begin: Start
    state: ContactState | None

    def solved(self, outcome: Outcome, state: ContactState) -> _Body:
        """The same after a solution."""
        begin = self.begin.begin_from(outcome.problem.sets, outcome.newton.multipliers())
        return replace(self, begin=begin, state=state)

    def with_scene(self, scene: Scene, history: History) -> _Body | None:
        """The same elastic system with gap, friction and forces of another scene; None: they need another one;
        collective.

        Forces are put into the system of this one, which is not to be used any more.
        """
        forces = _other_forces(scene, self.scene)
        if forces is None:
            return None
        body = with_forces(self.model, scene.statement) if forces else self.model
        if body is None:
            return None
        model, system = with_gap_and_friction(body, scene.statement), self.task.system
        refuse_beforehand(model)
        for number, (load, earlier) in enumerate(zip(model.applied, self.model.applied, strict=True)):
            if load is not earlier:
                system.set_case(number, model.cases[number])
        task = contact_task(model, history, choose=lambda *_: (system, self.task.linear_algebra))
        sets, multipliers = self.begin.sets, self.begin.multipliers
        begin = task.start if sets is None or multipliers is None else task.start.begin_from(sets, multipliers)
        return replace(self, scene=scene, model=model, task=task, begin=begin)


def _body(scene: Scene, earlier: _Body | None, comm: MPI.Comm, history: History, first: Sequence[_Value]) -> _Body:
    """A scene with what another one leaves to it; collective.

    Args:
        scene: the scene.
        earlier: the other one; None: there is none.
        comm: the ranks.
        history: records.
        first: the first value, for a start on coarser meshes; nothing: there is no value.
    """
    if earlier is not None and (next_body := earlier.with_scene(scene, history)) is not None:
        return next_body
    tagged = earlier.tagged if earlier is not None and _same_mesh(scene, earlier.scene) else load_mesh(scene, comm)
    body = with_moduli(earlier.model, scene.statement) if earlier and _other_moduli(scene, earlier.scene) else None
    model = body or StatedBody.of(discretise(scene.statement, tagged, Timings()))
    refuse_beforehand(model)
    last = None if earlier is None else earlier.state
    # Contact points may be on the other side than the scene says.
    chosen = scene.model_copy(update={"contact": model.statement.contact})
    coarser, state = _coarser(chosen, model, first if last is None else ())
    task = contact_task(model, history, coarser)
    begin = _begun(task, model, coarser, state)
    if last is not None and model.boundary is not None:
        begin = task.start.begin_from(*carry_over(last, model.boundary))
    return _Body(scene, tagged, model, task, begin, last)


def _same_mesh(scene: Scene, compared: Scene) -> bool:
    """Whether two scenes have the same mesh."""
    keys = ("mesh", "body", "element")
    pairs = [(getattr(scene, key), getattr(compared, key)) for key in keys]
    pairs.append((scene.statement.sections, compared.statement.sections))
    return all(value is compared_value or value == compared_value for value, compared_value in pairs)


def _other_forces(scene: Scene, compared: Scene) -> set[str] | None:
    """The keys of the forces that differ in two scenes; None where anything else does but gaps and friction of rigid
    foundations, which the elastic system does not know, and neither do the contact points.
    """
    differing = {key for key in type(scene).model_fields if getattr(scene, key) != getattr(compared, key)}
    differing.discard("contact")
    entries = [entry for of in (scene, compared) for key in differing for entry in of.statement.effects.get(key, ())]
    steady = all(isinstance(entry, Force) and not entry.timed for entry in entries)
    if differing - {*scene.statement.effects} or not steady:
        return None
    if scene.statement.interfaces or compared.statement.interfaces or len(scene.contact) != len(compared.contact):
        return None
    if any(effect.against is not None or effect.friction.directed for effect in (*scene.contact, *compared.contact)):
        return None
    alike = all(
        type(effect) is type(rival)
        and effect.model_copy(update={"gap": rival.gap, "friction": rival.friction}) == rival
        for effect, rival in zip(scene.contact, compared.contact, strict=True)
    )
    return differing if alike else None


def _other_moduli(scene: Scene, compared: Scene) -> bool:
    """Whether nothing differs in two scenes but Young's moduli and Poisson's ratios of isotropic materials, on which no
    load and no contact of theirs depends.
    """
    differing = {key for key in type(scene).model_fields if getattr(scene, key) != getattr(compared, key)}
    statement = scene.statement
    depends = statement.interfaces or statement.bodies or any(effect.against is not None for effect in scene.contact)
    if differing != {"material"} or depends or any(isinstance(load, InitialStrain) for load in statement.loads):
        return False
    return all(
        isinstance(material, LinearElastic)
        and isinstance(rival, LinearElastic)
        and material.model_copy(update={"young": rival.young, "poisson": rival.poisson}) == rival
        for material, rival in zip(scene.statement.material, compared.statement.material, strict=True)
    )


def sweep(
    scene: Scene | str | Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    coefficients: Sequence[float] | None = None,
    loads: Sequence[float] | None = None,
    path: str | None = None,
    values: Sequence[Any] = (),
) -> list[SweepPoint]:
    """Solve a scene for many friction coefficients, many multiples of all its loads, or many values of an entry.

    Every value is a separate problem (the static law, no history); the previous one only provides the start.  All are
    solved on the mesh of the scene; where that is large enough for multigrid, the coarser meshes that ``levels`` asks
    for are its levels, and give the first value its start.

    Args:
        scene: the scene, or the path of its file, with one load step.
        comm: the ranks that share the work; the call is collective.
        coefficients: values that replace all coefficients of Coulomb friction in the scene.
        loads: factors for all tractions, body forces, prescribed displacements, and what drives rigid bodies.
        path: of an entry, such as ``contact[0].gap``.  The elastic system stays where it is a gap or a key of friction
            of a rigid foundation, or one of a force; of Young's modulus and Poisson's ratio all else; of others the
            mesh, unless it is one of the mesh.
        values: of this entry.

    Raises:
        TypeError: an argument is of the wrong kind.
        SceneError: not exactly one parameter, load steps, no contact, coefficients without Coulomb friction, or an
            entry with a wrong value.
    """
    scene = as_scene(scene)
    refuse_other_than_comm(comm)
    if [coefficients, loads, path].count(None) != 2 or (path is None and len(values) > 0):
        raise SceneError([("sweep", "give either coefficients, or loads, or path and values")])
    _refuse(scene, coefficients, loads)
    runs: list[tuple[Any, Scene, _Value]]
    if path is not None:
        scenes = [parse_scene(changed(scene, {path: value})) for value in values]
        for changed_scene in scenes:
            _refuse(changed_scene, None, None)
        runs = [(value, changed_scene, _Value()) for value, changed_scene in zip(values, scenes, strict=True)]
    elif loads is not None:
        runs = [(load, scene, _Value(load=load)) for load in loads]
    else:
        runs = [(value, scene, _Value(coefficient=value)) for value in coefficients or ()]
    # Systems of their own would fill the memory.
    keeps_system = all(run_scene is scene or _other_forces(run_scene, runs[0][1]) == set() for _, run_scene, _ in runs)
    history, points = History(), list[SweepPoint]()
    body: _Body | None = None
    for value, run_scene, parameter in runs:
        if body is None or run_scene is not body.scene:
            body = _body(run_scene, body, comm, history, [parameter])
        point, body = _solved(value, body, parameter, history)
        points.append(point if keeps_system else point.without_system())
    return points


def _solved(value: Any, body: _Body, parameter: _Value, history: History) -> tuple[SweepPoint, _Body]:
    """The point of a value, and what it leaves to the next one; collective."""
    solves_before, task, load = history.linear_solves, body.task, parameter.load
    for begin in (body.begin, task.start):
        start = parameter.start(begin, body.model)
        end = solve_step(LoadStepStart(body.model, task, start, scale=load))
        # The last value may be too far away to begin there.
        if begin is task.start or not task.gave_up(end.outcome.status):
            break
    model, start, outcome = end.model, end.start, end.outcome
    assert isinstance(model, StatedBody)  # as the body that the step began with
    statement = model.statement
    if parameter.coefficient is not None:
        statement = _with_coefficient(statement, parameter.coefficient)
    contact, promised = model.state(task, outcome, start), Law(*task.promised(outcome))
    point = SweepPoint(
        value,
        outcome.status,
        contact,
        history.linear_solves - solves_before,
        promised,
        model if statement is model.statement else replace(model, statement=statement),
        load,
        partial(_of_body, model, task, outcome.newton.x.copy(), load, contact),
    )
    return point, body.solved(outcome, contact) if outcome.status is Status.CONVERGED else body


def _refuse(scene: Scene, coefficients: Sequence[float] | None, loads: Sequence[float] | None) -> None:
    """Refuse a scene that has no sweep.

    Raises:
        SceneError: it has none.
    """
    if scene.statement.several_steps or not scene.contact:
        raise SceneError([("sweep", "needs a scene with contact and one load step")])
    if not np.isfinite(np.asarray([] if loads is None else loads, dtype=float)).all():
        raise SceneError([("sweep", f"loads must be finite numbers, got {list(loads or ())}")])
    numbers = np.asarray([] if coefficients is None else coefficients, dtype=float)
    if not (np.isfinite(numbers) & (numbers >= 0)).all():
        raise SceneError([("sweep", f"coefficients must be finite numbers from 0 on, got {numbers.tolist()}")])
    for clause in scene.statement.depends_on_solution_at(0).values():
        if loads is not None and min(loads, default=1.0) <= 0:
            raise SceneError([("sweep", f"loads must be positive where {clause}")])
    if coefficients is not None and not scene.statement.has_coulomb:
        raise SceneError([("sweep", "coefficients need a scene with Coulomb friction")])
    unknown = [contact.friction.unknown for contact in scene.contact if contact.friction.unknown]
    if coefficients is not None and unknown:
        raise SceneError([("sweep", f"coefficients are those of Coulomb friction: {unknown[0]}")])


def _with_coefficient(statement: Statement, value: float) -> Statement:
    """The scene with another friction coefficient where Coulomb friction acts."""

    def replaced(friction: FrictionLaw) -> FrictionLaw:
        old = friction.parameters.get("coefficient")
        if old is None:
            return friction
        return friction.model_copy(update={"coefficient": lambda x: np.where(sample(old, x) > 0, value, 0.0)})

    contact = tuple(effect.model_copy(update={"friction": replaced(effect.friction)}) for effect in statement.contact)
    return statement.changed(contact=contact)
