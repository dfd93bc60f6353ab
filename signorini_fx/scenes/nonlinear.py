"""A scene with nonlinear materials: its residual, its load steps and its solution.

Supports, loads and contact are assembled for the linear body that it is at small strains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import mpi4py.MPI
import numpy as np
from dolfinx import fem

from signorini_fx.arrays import Array, Indices
from signorini_fx.errors import FormError, SceneError
from signorini_fx.forms.nonlinear.moving_shapes import fitting
from signorini_fx.forms.nonlinear.problem import NonlinearContactProblem, linearised_at
from signorini_fx.forms.nonlinear.results import NonlinearMechanics, SolvedBody
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import prescribed
from signorini_fx.mechanics.body.deformation import deformation_of
from signorini_fx.mechanics.body.discretisation import boundary_facets, held_at, prepare
from signorini_fx.mechanics.body.nonlinear_law import BodyResidual, at_rest, body_residual
from signorini_fx.mechanics.materials.trial import check_materials
from signorini_fx.mechanics.mesh.tagged import check_fits
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.obstacles.scene_contact import foundations_of
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.effect import ForceDensity
from signorini_fx.mechanics.statement.expressions import sample
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.statement.rigid_body import COMPONENTS
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.mechanics.step_effect import StepEffect, stated_effects
from signorini_fx.records import Finding, History, Status, Timings
from signorini_fx.results.limit import motion_in_words
from signorini_fx.results.mechanics import StepResult, acting_on
from signorini_fx.results.nonlinear_stresses import NonlinearForces, nonlinear_stresses
from signorini_fx.results.resultants import ActingForces
from signorini_fx.results.solution import ConvergenceError, Solution, factors_held
from signorini_fx.results.stresses import RawStresses
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.scene import Scene
from signorini_fx.solving.findings import (
    errors_of_steps,
    facets_in_result,
    nonlinear_findings,
    refuse_beforehand,
    untouched,
)
from signorini_fx.solving.increments import HalvedIncrements, check_step
from signorini_fx.solving.restart import StoredStates

if TYPE_CHECKING:
    from signorini_fx.mechanics.effects.contact import Contact
    from signorini_fx.mechanics.laws.protocol import FrictionLaw

# Settings that nonlinear problems do not have, with their neutral values.
_LEFT_OUT = {"initial_contact": "auto", "error_bound": False}


# Advice for inverted cells or a diverging displacement with small-strain materials.
_RAN_AWAY = (
    "the displacement that was tried is far beyond small strains, as where all of a section "
    "yields and carries no larger load: take smaller load steps, prescribe a displacement where a "
    "force acts, or take a material that hardens"
)


def build_problem(
    scene: Scene,
    comm: mpi4py.MPI.Comm,
    history: History,
    effects: Sequence[StepEffect] = (),
) -> ProblemOfScene:
    """Return the problem of a scene on its mesh, with the effects of its entries and further ones;
    collective.
    """
    timings = Timings()
    model = linear_body(scene, comm, timings)
    with timings.phase("compile"):
        effects = *effects, *stated_effects(scene.statement)
        return ProblemOfScene(scene.statement, model, history, effects, timings)


def linear_body(scene: Scene, comm: mpi4py.MPI.Comm, timings: Timings) -> Model:
    """Return the linear body of a scene at small strains, on its mesh, after all checks;
    collective.
    """
    with timings.phase("mesh"):
        tagged = load_mesh(scene, comm)
    check_materials(scene.statement.material)
    check_fits(scene.statement, tagged)
    model = prepare(at_rest(scene.statement), tagged, timings, path_step=-1)
    refuse_beforehand(model)
    if model.turned is not None:
        number = next(
            k
            for k, support in enumerate(scene.statement.displacement)
            if support.normal is not None
        )
        reason = (
            "along no axis is not possible yet with a nonlinear material: turn the mesh, or "
            "take bilateral contact"
        )
        raise SceneError.at(f"displacement[{number}].normal", reason)
    return model


class ProblemOfScene(NonlinearContactProblem):
    """The nonlinear problem of a scene on its mesh."""

    statement: Statement  # the scene
    model: Model  # the linear body at small strains, with loads and supports
    body: BodyResidual  # the residual of the body
    path_step = -1.0  # the present place in the lists of factors
    _named_residual = "material"
    _held: fem.Function  # prescribed displacements
    _first: State  # the state before the first load step

    def __init__(
        self,
        statement: Statement,
        model: Model,
        history: History,
        effects: Sequence[StepEffect] = (),
        timings: Timings | None = None,
    ) -> None:
        """Build the problem of a statement; collective.

        Args:
            statement: the scene.
            model: its linear body at small strains.
            history: records of solves, which are continued.
            effects: effects from load step to load step.
            timings: times of the preceding work.
        """
        space = model.space
        tagged = model.tagged
        # The contact points of pairs are on the sides that the linear body has chosen.
        sides = zip(statement.contact, model.contacts, strict=True)
        chosen = [entry.on_sides_of(one) for entry, one in sides]
        statement = statement.changed(contact=tuple(chosen))
        facets = boundary_facets(statement, tagged)
        on = [facets[entry.boundary] for entry in statement.contact]
        masters = {
            k: facets[entry.against]
            for k, entry in enumerate(statement.contact)
            if entry.against is not None
        }
        drives = _drives_at(
            statement, tagged.dimension, statement.steps - 1
        )  # some of which may not be possible
        begins = foundations_of(statement.contacts_at(0), statement.kinematics, on, masters)
        contact = [
            replace(entry, shape=drives[k]) if k in drives else entry
            for k, entry in enumerate(begins)
        ]
        timed = [k for k, entry in enumerate(statement.contact) if entry.friction.timed]
        for k in timed:
            contact[k] = replace(contact[k], friction=_at_its_time(contact[k].friction))
        u = fem.Function(space, name="displacement")
        body = body_residual(statement, tagged, u)
        held, bcs = _conditions(model)
        settings = {
            key: value
            for key, value in statement.solver
            if key != "levels" and _LEFT_OUT.get(key) != value
        }
        moves = any(effect.moves_bodies for effect in effects)
        try:
            super().__init__(
                body.form,
                u,
                bcs=bcs,
                contact=contact,
                J=body.tangent,
                update=body.update if body.points else None,
                commit=body.commit if body.points else None,
                boundaries=facets,
                effects=effects,
                density=model.density and model.density() if moves else None,
                **settings,
            )
        except FormError as error:
            raise _of_scene(error) from None
        self.statement = statement
        self.model = model
        self.body = body
        self.timings = timings or Timings()
        self._held = held
        self.linear.take_scene(model, history)
        self._solver = replace(
            self._solver,
            remembers=body if body.points else None,
            extrapolates=any(one.flows for one in statement.material),
            too_large=self._too_large,
            cures=_cures(statement),
            held=partial(factors_held, statement),
        )
        self.linear.trusted = body.tangent is not None
        self.begin_at(-1.0)
        self._first = self._solver.initial()

    @property
    def path(self) -> LoadPath:
        return self.statement.path

    def initial(self) -> State:
        """Return the state before the first load step, without loads."""
        return self._first

    def _step_to(self, state: State, time: float) -> tuple[float, float]:
        place = self.path.place_of(time)
        reached = self.path.place_of(state.time) if state.number else place - 1.0
        self._solver.go_through(self.path, self.go_to)
        return reached, place

    def solved(
        self,
        stored: StoredStates | None = None,
        on_step: Callable[[StepResult], None] = lambda step: None,
        begin: State | None = None,
    ) -> Solution:
        """Return the solution of all load steps after a state; collective.

        If a step fails, it has the load steps before; if the first one fails, the body before it.

        Args:
            stored: the checkpoint; None: there is none.
            on_step: called with the result of each load step that has a solution.
            begin: the state after which load steps begin; None: the state before the first one.

        Raises:
            ConvergenceError: the first step fails, and the body cannot be shown either.
            SceneError: the problem is wrong.
        """
        failures = list[Finding]()
        way = HalvedIncrements(self.path)
        if begin is None:
            begin = self._first
        else:
            check_step(begin, self.path.times[-1], self.model.space)
        if begin.number:
            way.begin_at(self.path.place_of(begin.time))
        try:
            self._solver.go_through(self.path, self.go_to, way)
            why, advice = self._solver.solve_path(begin, on_step, stored)
        except FormError as error:
            raise _of_scene(error) from None
        if why:
            if self._solver.solved is None:  # the body before the first step cannot be shown either
                raise ConvergenceError(self, f"{why}: {advice}")
            ended = motion_in_words(self._solver.verdict.cause)
            failures.append(Finding("warning", "load_steps", why, ended))
        self.timings.seconds.update(self._solver.timings.seconds)
        solution = self._titled("")
        said: Any = solution.mechanics
        statement = self.statement
        model = replace(
            solution.model,
            title=statement.title,
            path=statement.path,
            contacts=statement.contact,
            materials=statement.material,
            coefficients=self.model.with_statement(statement).coefficients,
            held=self.model.held,
            modulus=statement.young,
            tagged=self.model.tagged,
        )
        forces = NonlinearForces(statement, model.tagged, model.space)
        known = nonlinear_findings(statement, self.model)
        of_result = list[Finding]()
        if not failures:
            of_result += facets_in_result(self.model, solution.contact)
            of_result += untouched(self.model.comm, solution.steps)
        shown = solution.shown_steps
        of_result += errors_of_steps(model.comm, statement, self.path, shown)
        findings = (*failures, *known, *self.findings, *of_result)
        named = tuple(map(self._named, solution.steps))
        mechanics = SceneMechanics(
            model, statement, said.ends, said.boundaries, said.errors_now, forces=forces
        )
        return replace(
            solution,
            mechanics=mechanics,
            steps=named,
            timings=self.timings,
            found=lambda: findings,
            remedy=advice,
        )

    def _named(self, step: StepResult) -> StepResult:
        """Return the load step with the scene's names for its rigid bodies."""
        named = zip(step.rigid_bodies, self.statement.rigid_bodies, strict=True)
        return replace(
            step, rigid_bodies=tuple(replace(motion, body=body) for motion, body in named)
        )

    def go_to(self, path_step: float) -> None:
        """Set loads, supports and foundations to a place in the lists of factors; collective."""
        self.path_step = path_step
        held = held_at(self.model, path_step)
        if held is not self.model:
            self.model = held
            self._held, self.linear.bcs = _conditions(held)
        loads = self.model.loads_at(path_step, pushing=True)  # initial strains are in the residual
        self.linear.evaluated.loads = loads.forces
        self.body.move_to(path_step)
        self._held.x.array[:] = loads.prescribed
        self._move(self.statement.contacts_at(path_step))
        for number, shape in _drives_at(
            self.statement, self.model.tagged.dimension, path_step
        ).items():
            moving = self.shapes[number]
            dimension = self.model.tagged.dimension
            carried = {"shift": moving.shape.shift, "rotation": moving.shape.rotation}
            moving.shape = fitting(
                number, shape.model_copy(update=carried), dimension, turns=moving.turns
            )

    def reached(self) -> SolvedBody:
        """Return the load step that has just ended."""
        assert self._solver.solved is not None
        return self._solver.solved

    def linearised(self, step: SolvedBody) -> tuple[Any, ...]:
        """Return an earlier load step with its linearised problem, see ``linearised_at``;
        collective.
        """
        self.go_to(step.result.place)
        self._solver.solved = step
        self._solver.show_last(self.u.x.array)
        return linearised_at(self._solver, self.linear)

    def begin_at(self, path_step: float) -> None:
        """Go to a place on the load path, and count slips from there; collective."""
        self.go_to(path_step)
        self.linear.begin = self.linear.initial()

    def forces_anew(self, statement: Statement, displacement: fem.Function) -> Array:
        """Return minus the residual of the body with another statement, at the present place and
        without material history, forces of shape (owned dofs,).
        """
        anew = NonlinearForces(statement, self.model.tagged, self.model.space)
        return -anew.residual(displacement, self.path_step)

    def _too_large(self) -> str:
        """Return by how much the deformation is too large for materials of small strains, as text,
        or "".
        """
        if self.statement.finite_strains:
            return ""
        assert self.linear.now is not None
        elastic = self.linear.now.elastic
        size = deformation_of(elastic, self.u, elastic.scales.size).largest
        limit = self.statement.solver.largest_deformation
        return "" if size <= limit else f"it is {size:.3g}, of small strains at most {limit:g}"

    def _loaded(self) -> Indices:
        """Return the loaded facets, including those of loads with a fixed direction, which are not
        in F.
        """
        named = [
            load.where
            for load in self.statement.of(ForceDensity)
            if load.where is not None and not load.nodal
        ]
        return np.concatenate([super()._loaded(), *map(self.model.tagged.facets, named)])

    def _move(self, contacts: Sequence[Contact]) -> None:
        """Set foundations, gaps and friction to those of the contacts."""
        for number, (entry, given) in enumerate(zip(contacts, self.statement.contact, strict=True)):
            if given.gap_timed:
                gap = entry.gap if isinstance(entry.gap, float) else partial(sample, entry.gap)
                self.linear.foundations.change(number, gap=gap)
            if given.friction.timed:
                self.linear.foundations.change(number, friction=_at_its_time(entry.friction))
            moving = self.shapes.get(number)
            if moving is not None and not moving.shape.driven and entry is not given:
                moving.shape = entry.foundation


@dataclass(frozen=True, kw_only=True)
class SceneMechanics(NonlinearMechanics):
    """The mechanics of a nonlinear scene, whose loads and supports have names, and whose materials
    give the stress.
    """

    forces: NonlinearForces  # evaluates internal forces, stresses and loads

    def stress(self, y: fem.Function, step: float) -> RawStresses:
        path = [(load_step.displacement, load_step.place) for load_step, _ in self.ends]
        last = next(
            (number for number, (displacement, _) in enumerate(path) if displacement is y), None
        )
        return nonlinear_stresses(
            self, self.forces, [(y, step)] if last is None else path[: last + 1]
        )

    def acting(self, y: fem.Function, step: float) -> ActingForces:
        """Return the forces that act at a place on the load path; at small strains moments are
        taken about undeformed points.
        """
        anew = self.forces
        displaced = self.statement.finite_strains
        balance = replace(self.balance(y, step), supports=anew.prescribed(step))
        return acting_on(anew, balance, y, step, anew.of_followers(y, step), displaced=displaced)


def _cures(statement: Statement) -> dict[Status, str]:
    """Return advice on outcomes that depends on the materials and loads of a scene."""
    laws = {getattr(material, "law", "") for material in statement.material}
    ways = ["allow smaller load steps", "refine the mesh"]
    if any(isinstance(load, ForceDensity) for _, load in statement.listed()):
        ways.insert(0, "prescribe a displacement where a force acts, to follow the body beyond it")
    if "saint-venant-kirchhoff" in laws:
        kept = "take a material that keeps its stiffness under compression, as neo-hooke does"
        ways.append(kept)
    cures = {
        Status.LIMIT: ", or ".join(ways),
        Status.NO_DIGIT: (
            "round-off of the strains is as large as the effect of the loads: take a linear "
            "material, which suffices for such small strains"
        ),
    }
    if not statement.finite_strains:
        cures |= dict.fromkeys((Status.INVERTED, Status.LIMIT), _RAN_AWAY)
    return cures


def _at_its_time(friction: Any) -> FrictionLaw:
    """Return a friction law with its expressions evaluated at the present time, as functions of the
    position.
    """
    return friction.with_values(
        lambda _, value: partial(sample, value) if getattr(value, "timed", False) else value
    )


def _drives_at(statement: Statement, dimension: int, path_step: float) -> dict[int, Any]:
    """Return the shapes that forces move, by number of contact, with the numbers that drive them at
    a place on the load path.
    """
    shapes = dict[int, Any]()
    drives = statement.drives(dimension, path_step)
    for body, (load, motion) in zip(statement.rigid_bodies, drives, strict=True):
        named = zip(COMPONENTS[dimension], map(float, motion), strict=True)
        held = {name: value for name, value in named if not np.isnan(value)}
        for part in body.parts:
            shape = statement.contact[part].driven
            loads = tuple(map(float, load))
            moments = loads[dimension:] if dimension == 3 else loads[dimension]
            driven = {"force": loads[:dimension], "moment": moments, "prescribed": held}
            shapes[part] = shape.model_copy(update=driven) if shape.drives else shape
    return shapes


def _conditions(model: Model) -> tuple[fem.Function, list[fem.DirichletBC]]:
    """Return the supports as Dirichlet conditions whose values are those of a Function, and this
    Function; collective.
    """
    space = model.space
    size = model.space.dofmap.index_map_bs
    conditions = list[fem.DirichletBC]()
    fixed, _ = prescribed(space, model.bcs)
    values = fem.Function(space)
    for component in range(size):
        at = np.arange(component, fixed.size, size, dtype=np.int32)[fixed[component::size]]
        if parallel.any_rank(space.mesh.comm, at.size > 0):
            pair: Any = [at, at]  # dofs of the component and of the values
            conditions.append(fem.dirichletbc(values, pair, space.sub(component)))
    return values, conditions


def _of_scene(error: FormError) -> SceneError:
    """Return the error of a form with the keys of a scene."""
    settings = SolverSettings.model_fields
    return SceneError(
        [
            (f"solver.{key}" if key in settings else key.replace("].shape", "].foundation"), why)
            for key, why in error.problems
        ]
    )
