"""Solves for many values of one parameter on the same body, with a single elimination of the elastic system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algorithms.strategy import solve_task
from signorini_fx.algorithms.task import Start, Task
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.discretisation import Discretisation, discretise
from signorini_fx.body.mesh_levels import MeshLevel
from signorini_fx.body.rigid_bodies import RigidBodyMotion
from signorini_fx.check.refusals import refuse_beforehand
from signorini_fx.errors import SceneError
from signorini_fx.interfaces.protocol import LoadStepStart, solve_step
from signorini_fx.laws.protocol import FrictionLaw
from signorini_fx.linalg.choice import krylov_from
from signorini_fx.mesh.hierarchy import coarser_scenes
from signorini_fx.mesh.tagged import load_mesh
from signorini_fx.records import History, Status, Timings
from signorini_fx.results.certificate import Certificate, certify
from signorini_fx.results.promised_law import Law, Tractions
from signorini_fx.scene.expressions import sample
from signorini_fx.scene.model import Scene
from signorini_fx.scene.reading import as_scene
from signorini_fx.solving.first_start import begin_at_coarse
from signorini_fx.solving.nested import carry_over
from signorini_fx.solving.one_mesh import contact_task
from signorini_fx.solving.solver import refuse_other_than_comm

if TYPE_CHECKING:
    from signorini_fx.results.sections import SectionForce


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

    value: float
    status: Status
    contact: ContactState
    linear_solves: int
    _scene: Scene
    _law: Law
    _discretisation: Discretisation
    _task: Task
    _x: PETSc.Vec
    _load: float

    def __repr__(self) -> str:
        return f"<SweepPoint {self.value:g}: {self.status.value}, {self.linear_solves} linear solves>"

    def displacement(self) -> fem.Function:
        """The displacement of the whole body; collective, one back substitution."""
        return self._discretisation.from_rest(self._task.rest, self._unknowns())

    def tools(self) -> tuple[RigidBodyMotion, ...]:
        """How rigid bodies have moved; collective."""
        d = self._discretisation
        return d.rigid.moved(d.driven(self._unknowns(), self._task.rest)) if d.rigid.bodies else ()

    def preloads(self) -> list[SectionForce]:
        """The forces through sections that are tightened; collective."""
        from signorini_fx.results.sections import section_forces

        return section_forces(self._scene, self._discretisation.tagged, self.displacement(), 0, self._load)

    def _unknowns(self) -> PETSc.Vec:
        d, system = self._discretisation, self._task.system
        for interface in d.scene.interfaces:
            interface.recalled(d, self._task, 0, *interface.stored(d, 0, self.contact))
        system.set_load(self._load * d.factors(0))
        return system.displacement(self._x)

    def certificate(self) -> Certificate:
        """The check of the conditions of the problem on the whole body; collective."""
        d, displacement, contact = self._discretisation, self.displacement(), self.contact
        if contact.joint is not None:  # what the loads of the scene, one by one, are judged by
            contact = replace(contact, joint=contact.joint.times(1 / self._load))
        law, rigid, tractions = self._law, self.tools(), Tractions.of(contact)
        return certify(
            self._scene, d.tagged, displacement, tractions, law=law, scale=self._load, pairs=d.pairs, rigid=rigid
        )


def _start_at(start: Start, discretisation: Discretisation, value: float, *, of_loads: bool) -> Start:
    """The start with a multiple of the loads, or another friction coefficient where the law has one."""
    factors, law = discretisation.factors(0), start.law
    if of_loads or law is None:
        return replace(start, factors=value * factors if of_loads else factors)
    return replace(start, factors=factors, law=replace(law, coefficient=np.where(law.coefficient > 0, value, 0.0)))


def _coarser(
    scene: Scene, discretisation: Discretisation, first: Sequence[float], *, of_loads: bool
) -> tuple[MeshLevel | None, ContactState | None]:
    """The coarser meshes that ``levels`` asks for, as levels of multigrid where it is used, and the contact state there
    for the first value, if there is one, unless an interface solves the load step; collective.
    """
    coarser: MeshLevel | None = None
    state: ContactState | None = None
    large = discretisation.dofs >= krylov_from(discretisation.system_size, scene.solver.linear_algebra)
    if large and scene.generated:
        for coarse in coarser_scenes(scene, scene.solver.levels):
            body = discretise(coarse, load_mesh(coarse, discretisation.tagged.mesh.comm), Timings())
            solved = None
            for value in () if scene.sought_at(0) else first:
                task = contact_task(body, History(), coarser)
                start = _start_at(_begun(task, body, coarser, state), body, value, of_loads=of_loads)
                outcome = solve_task(task, start)
                state = body.state(task, outcome, start) if outcome.status is Status.CONVERGED else None
                solved = None if state is None else body.from_rest(task.rest, outcome.displacement())
            coarser = body.level(coarser, solved)
    return coarser, state


def _begun(task: Task, discretisation: Discretisation, coarser: MeshLevel | None, state: ContactState | None) -> Start:
    """The start of a task, from the contact state on the next coarser mesh if there is one; collective."""
    if state is None or discretisation.boundary is None:
        return task.start
    if coarser is not None:
        begin_at_coarse(task, coarser, discretisation)
    return task.start.begin_from(*carry_over(state, discretisation.boundary))


def sweep(
    scene: Scene | str | Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    coefficients: Sequence[float] | None = None,
    loads: Sequence[float] | None = None,
) -> list[SweepPoint]:
    """Solve a scene for many friction coefficients, or many multiples of all its loads.

    Every value is a separate problem (the static law, no history); the previous one only provides the start.  All are
    solved on the mesh of the scene; where that is large enough for multigrid, the coarser meshes that ``levels`` asks
    for are its levels, and give the first value its start.

    Args:
        scene: the scene, or the path of its file, with one load step.
        comm: the ranks that share the work; the call is collective.
        coefficients: values that replace all coefficients of Coulomb friction in the scene.
        loads: factors for all tractions, body forces, prescribed displacements, and what drives rigid bodies.

    Raises:
        TypeError: an argument is of the wrong kind.
        SceneError: not exactly one parameter, load steps, no contact, or coefficients without Coulomb friction.
    """
    scene = as_scene(scene)
    refuse_other_than_comm(comm)
    if (coefficients is None) == (loads is None):
        raise SceneError([("sweep", "give either coefficients or loads")])
    if scene.several_steps or not scene.contact:
        raise SceneError([("sweep", "needs a scene with contact and one load step")])
    for clause in scene.sought_at(0).values():
        if loads is not None and min(loads, default=1.0) <= 0:
            raise SceneError([("sweep", f"loads must be positive where {clause}")])
    if coefficients is not None and not scene.has_coulomb:
        raise SceneError([("sweep", "coefficients need a scene with Coulomb friction")])
    unknown = [contact.friction.unknown for contact in scene.contact if contact.friction.unknown]
    if coefficients is not None and unknown:
        raise SceneError([("sweep", f"coefficients are those of Coulomb friction: {unknown[0]}")])
    values, of_loads = [*(coefficients or loads or ())], loads is not None
    discretisation = discretise(scene, load_mesh(scene, comm), Timings())
    refuse_beforehand(discretisation)
    history = History()
    scene = discretisation.scene
    coarser, state = _coarser(scene, discretisation, values[:1], of_loads=of_loads)
    task = contact_task(discretisation, history, coarser)
    begin = _begun(task, discretisation, coarser, state)
    points: list[SweepPoint] = []
    for value in values:
        solves_before, load = history.linear_solves, value if of_loads else 1.0
        start = _start_at(begin, discretisation, value, of_loads=of_loads)
        end = solve_step(LoadStepStart(discretisation, task, start, scale=load))
        d, start, outcome = end.d, end.start, end.outcome
        joint = None if end.joint is None else end.joint.times(load)
        contact, promised = replace(d.state(task, outcome, start), joint=joint), Law(*task.promised(outcome))
        x = outcome.newton.x.copy()
        solves = history.linear_solves - solves_before
        point_scene = d.scene if of_loads else _with_coefficient(d.scene, value)
        points.append(SweepPoint(value, outcome.status, contact, solves, point_scene, promised, d, task, x, load))
        if outcome.status is Status.CONVERGED:
            begin = begin.begin_from(outcome.problem.sets, outcome.newton.multipliers())
    return points


def _with_coefficient(scene: Scene, value: float) -> Scene:
    """The scene with another friction coefficient where Coulomb friction acts."""

    def replaced(friction: FrictionLaw) -> FrictionLaw:
        old = friction.parameters.get("coefficient")
        if old is None:
            return friction
        return friction.model_copy(update={"coefficient": lambda x: np.where(sample(old, x) > 0, value, 0.0)})

    contact = tuple(effect.model_copy(update={"friction": replaced(effect.friction)}) for effect in scene.contact)
    return scene.model_copy(update={"contact": contact})
