"""The effects of a scene, its cost and its mistakes, before the scene is solved.

Nothing is solved and no stiffness is assembled.  The forms of the loads and of the contact boundaries are compiled and
assembled as the solver does, so that every error that the solver would find in the scene or its mesh is found here.

``findings`` determines what may go wrong, ``cost`` estimates the cost.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from signorini_fx.machine import parallel
from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import Finding, Timings
from signorini_fx.scenes.hierarchy import coarser_scenes, scene_on
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.plan import planned
from signorini_fx.scenes.scene import Scene
from signorini_fx.solving.check.cost import Cost, estimated_cost, memory_finding
from signorini_fx.solving.check.findings import nonlinear_findings, scene_findings
from signorini_fx.solving.check.petsc_options import refuse_mistyped
from signorini_fx.solving.check.planned import attempts_for
from signorini_fx.solving.check.refusals import refuse_beforehand
from signorini_fx.solving.check.uniqueness import uniqueness_findings
from signorini_fx.tuned import LOCKING_POISSON, NO_FORCE


@dataclass(frozen=True)
class ListedEffect:
    """One effect that a scene can list.

    Attributes:
        name: what it is and where.
        on: whether it is active.
        why: the reason, in the terms of the scene.
    """

    name: str
    on: bool
    why: str


@dataclass(frozen=True)
class Check:
    """The result of ``check_scene``.

    Attributes:
        title: of the scene.
        effects: every kind of effect, on or off.
        cost: an estimate.
        findings: warnings and notes.
        plan: what will be tried for what, in order, and how many linear solves that may take, see ``attempts_for``.
    """

    title: str
    effects: tuple[ListedEffect, ...]
    cost: Cost
    findings: tuple[Finding, ...] = field(default=())
    plan: tuple[tuple[str, tuple[str, ...], str], ...] = ()

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings that are warnings."""
        return tuple(finding for finding in self.findings if finding.level == "warning")

    def as_dict(self) -> dict[str, Any]:
        """Everything, ready for JSON."""
        return asdict(self)


def check_scene(scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD, *, uniqueness: bool = False) -> Check:
    """Validate a scene together with its mesh, and report its effects; collective, the same on every rank.

    Args:
        scene: the scene.
        comm: who takes part.
        uniqueness: whether to say below which friction coefficient there is one solution, which takes a factorisation.

    Raises:
        SceneError: the scene does not fit its mesh.
        MeshError: the mesh cannot be read or generated.
        OptionsError: PETSc does not accept an option that the user has set.
    """
    refuse_mistyped(comm)
    if scene.statement.nonlinear:
        return _nonlinear(scene, comm)
    coarser = coarser_scenes(scene, scene.solver.levels)
    for coarse in coarser:
        _validated(coarse, comm)
    compared = scene.accuracy is not None or bool(coarser)
    model = _validated(scene, comm)
    cost = estimated_cost(model)
    findings = [*memory_finding(cost, comm), *scene_findings(model)]
    findings += uniqueness_findings(model) if uniqueness else []
    return Check(
        scene.title,
        tuple(_effects(model, compared=compared)),
        cost,
        tuple(findings),
        attempts_for(scene.statement),
    )


def _nonlinear(scene: Scene, comm: MPI.Comm) -> Check:
    """See ``check_scene``: of a scene with nonlinear materials, whose modules are imported for it alone."""
    from signorini_fx.scenes.nonlinear import linear_body
    from signorini_fx.scenes.nonlinear_check import newton_cost, newton_effects, newton_plan

    timings = Timings()
    model = linear_body(scene, comm, timings)
    cost, statement = newton_cost(estimated_cost(model), scene.statement.expected_steps), scene.statement
    listed = _effects(replace(model, statement=statement), compared=False)
    effects = newton_effects(statement, model, listed)
    findings = (*memory_finding(cost, comm), *nonlinear_findings(statement, model))
    return Check(scene.title, effects, cost, findings, newton_plan())


def _validated(scene: Scene, comm: MPI.Comm) -> Model:
    """The body of a scene with the cells and elements that its solve takes, after all checks of the solver."""
    first = scene
    if scene.accuracy is not None:
        first = planned(scene, scene.accuracy, comm).scene
        # Generated meshes are coarser ones to begin with.
        first = scene_on(first, 1.0) if first.statement.generated else first
    model = prepare(first.statement, load_mesh(first, comm), Timings())
    refuse_beforehand(model)
    return model


# --- effects ---------------------------------------------------------------------------------------------------------


def _effects(model: Model, *, compared: bool) -> list[ListedEffect]:
    """Every kind of effect, on or off; ``compared``: whether there are several meshes; collective."""
    statement = model.statement
    effects = [
        ListedEffect("elasticity", True, f"always; {model.kinematics.words}"),
        *_materials(statement),
        _reduced(model),
    ]
    if model.elastic.pressed:
        why = f"volumetric = {statement.element.volumetric!r}"
        effects.append(ListedEffect("pressure of the mixed element", True, why))
    for key, entries in statement.effects.items():
        if key not in ("material", "contact"):
            effects += [ListedEffect(effect.name, effect.acts, effect.said or "it is 0") for effect in entries] or [
                ListedEffect(key.replace("_", " "), False, f"no {statement.heading(key)}")
            ]
    effects += _contacts(model)
    numbers = {len(load.factors) for load in statement.loads if load.factors is not None}
    why = f"factors: {', '.join(map(str, numbers))} each" if numbers else "no factors"
    if statement.automatic_steps is not None:
        why += f", about {statement.expected_steps} load steps"
    solver, contact = statement.solver, model.boundary is not None
    to_stop = solver.algorithm == "path-following" and solver.regularisation_error == "auto"
    levels = f"levels = {solver.levels}"
    return [
        *effects,
        ListedEffect("load steps", statement.expected_steps > 1, why),
        ListedEffect(
            "error estimate", contact and (to_stop or compared), f"algorithm = {solver.algorithm!r}, {levels}"
        ),
        ListedEffect("nested iteration", contact and solver.levels > 1, levels),
    ]


def _materials(statement: Statement) -> list[ListedEffect]:
    several = len(statement.material) > 1
    why = ", ".join(str(m.region) for m in statement.material) if several else "one [[material]]"
    return [ListedEffect("several materials", several, why)] + [
        ListedEffect(material.words, True, f"{material.region or 'everywhere'}: {material.said}")
        for material in statement.material
        if material.said
    ]


def _reduced(model: Model) -> ListedEffect:
    setting = model.statement.element.volumetric
    on = model.elastic.reduced is not None
    why = f"volumetric = {setting!r}"
    if setting == "auto":
        why += f", some nu >= {LOCKING_POISSON:g}" if on else f", no nu >= {LOCKING_POISSON:g}, or linear triangles"
    return ListedEffect("reduced integration", on, why)


def _contacts(model: Model) -> list[ListedEffect]:
    contacts = model.statement.contact
    if model.boundary is None:
        return [ListedEffect("contact", False, "no [[contact]]"), ListedEffect("friction", False, "no [[contact]]")]
    effects = []
    for index, effect in enumerate(contacts):
        count = int(parallel.global_sum(model.boundary.comm, np.array(np.count_nonzero(model.boundary.part == index))))
        against = "" if effect.against is None else f"against {effect.against}, "
        description = f"{effect.kind}, {against}{count} nodes"
        if effect.foundation is not None:
            description += f"; {effect.foundation.said}; at a distance from {_gaps(model, index)}"
        if effect.tool is not None:
            description += "; gap and normals stay where it is given"
        effects.append(ListedEffect(f"contact {effect.boundary}", True, description))
    return effects + [
        ListedEffect(f"friction {effect.boundary}", effect.friction.acts, effect.friction.said) for effect in contacts
    ]


def _gaps(model: Model, index: int) -> str:
    """The smallest and the largest gap of one contact in words; collective."""
    assert model.boundary is not None
    assert model.data is not None
    gaps = model.data.gap[model.boundary.part == index]
    low, high = (parallel.largest(model.comm, sign * gaps, -np.inf) for sign in (-1.0, 1.0))
    extremes = (0.0 if abs(gap) < NO_FORCE * model.tagged.size else gap for gap in (-low, high))
    return " to ".join(f"{gap:.4g}" for gap in extremes)
