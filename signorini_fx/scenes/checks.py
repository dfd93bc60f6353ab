"""The effects of a scene, and what each of them adds, before the scene is solved.

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
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.loads.load_vectors import group_of, load_groups
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Force, Load
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import Finding, Timings
from signorini_fx.scenes.hierarchy import coarser_scenes, scene_on
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.plan import planned
from signorini_fx.scenes.scene import Scene
from signorini_fx.solving.check.cost import (
    Cost,
    contact_nodes,
    estimated_cost,
    friction_kind,
    linear_solves,
    memory_finding,
)
from signorini_fx.solving.check.findings import nonlinear_findings, scene_findings
from signorini_fx.solving.check.petsc_options import refuse_mistyped
from signorini_fx.solving.check.planned import attempts_for
from signorini_fx.solving.check.pushed_nodes import pushed_before
from signorini_fx.solving.check.refusals import refuse_beforehand
from signorini_fx.solving.check.uniqueness import uniqueness_findings
from signorini_fx.tuned import LOCKING_POISSON, NO_FORCE

# What ``stress_recovery.StressRecovery`` compiles.
_RECOVERY = ("stress moments", "stress recovery error", "stress mass", "boundary residual")


@dataclass(frozen=True)
class ListedEffect:
    """One effect that a scene can list.

    Attributes:
        name: what it is and where.
        on: whether it is active.
        why: the reason, in the terms of the scene.
        forms: the compiled forms in which it has a term.
        unknowns: the number of unknowns that it adds; negative for a support.
        solves: estimate of the linear solves that it adds, from and to.
    """

    name: str
    on: bool
    why: str
    forms: tuple[str, ...] = ()
    unknowns: int = 0
    solves: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class Check:
    """The result of ``check_scene``.

    Attributes:
        title: of the scene.
        effects: every kind of effect, on or off.
        forms: what will be compiled, in order.
        cost: an estimate.
        findings: warnings and notes.
        plan: what will be tried for what, in order, and how many linear solves that may take, see ``attempts_for``.
    """

    title: str
    effects: tuple[ListedEffect, ...]
    forms: tuple[str, ...]
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
    findings = [*pushed_before(model), *memory_finding(cost, comm), *scene_findings(model)]
    findings += uniqueness_findings(model) if uniqueness else []
    return Check(
        scene.title,
        tuple(_effects(model, compared=compared)),
        _forms(model, compared=compared),
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
    effects, forms = newton_effects(statement, model, listed)
    findings = (*memory_finding(cost, comm), *nonlinear_findings(statement, model))
    return Check(scene.title, effects, forms, cost, findings, newton_plan())


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


def _estimates_error(model: Model, *, compared: bool) -> bool:
    """Whether an error is estimated; ``compared``: whether there are several meshes."""
    solver = model.statement.solver
    to_stop = solver.algorithm == "path-following" and solver.regularisation_error == "auto"
    return model.boundary is not None and (to_stop or compared)


def _estimated(statement: Statement, *, compared: bool) -> tuple[str, ...]:
    """The forms that the error estimate compiles."""
    missed = compared and any(load.varies for load in statement.of(Force))
    return (*_RECOVERY, *(["missed loads"] if missed else []))


def _forms(model: Model, *, compared: bool) -> tuple[str, ...]:
    """The forms that the solver will compile, in order."""
    recovery = _estimated(model.statement, compared=compared) if _estimates_error(model, compared=compared) else ()
    return (*model.inventory.forms, *recovery)


# --- effects ---------------------------------------------------------------------------------------------------------


def _effects(model: Model, *, compared: bool) -> list[ListedEffect]:
    statement = model.statement
    effects = [_elasticity(model), *_materials(statement), _reduced(model), *_pressure(model), *_displacements(model)]

    names = dict(zip(load_groups(statement), (load.names for load in model.applied), strict=False))

    def form_of(effect: Any) -> tuple[str, ...]:
        if not isinstance(effect, Load):
            return (model.resisting,)
        if effect.grouped:
            return names[group_of(statement, effect)]
        return next(load.names for load in model.applied if load.entry is effect)

    for key, entries in statement.effects.items():
        if key not in ("material", "displacement", "contact"):
            effects += [
                ListedEffect(effect.name, effect.acts, effect.said or "it is 0", form_of(effect) if effect.acts else ())
                for effect in entries
            ] or [ListedEffect(key.replace("_", " "), False, f"no {statement.heading(key)}")]
    effects += _contacts(model)
    nodes = contact_nodes(model)
    kind = friction_kind(statement, statement.contact)
    single_step, all_steps = (
        linear_solves(statement, kind, nodes, steps=steps) for steps in (1, statement.expected_steps)
    )
    numbers = {len(load.factors) for load in statement.loads if load.factors is not None}
    why = f"factors: {', '.join(map(str, numbers))} each" if numbers else "no factors"
    if statement.automatic_steps is not None:
        why += f", about {statement.expected_steps} load steps"
    effects.append(ListedEffect("load steps", statement.expected_steps > 1, why, solves=_minus(all_steps, single_step)))
    nested = statement.solver.levels > 1 and model.boundary is not None
    solves = _minus(
        linear_solves(statement, kind, nodes, steps=statement.expected_steps, levels=statement.solver.levels), all_steps
    )
    estimate = _estimates_error(model, compared=compared)
    why = f"algorithm = {statement.solver.algorithm!r}, levels = {statement.solver.levels}"
    effects.append(
        ListedEffect("error estimate", estimate, why, _estimated(statement, compared=compared) if estimate else ())
    )
    return [*effects, ListedEffect("nested iteration", nested, f"levels = {statement.solver.levels}", solves=solves)]


def _elasticity(model: Model) -> ListedEffect:
    return ListedEffect("elasticity", True, f"always; {model.kinematics.words}", ("elasticity",), model.dofs, (1, 1))


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
    return ListedEffect("reduced integration", on, why, tuple(model.inventory.forms[1:2]) if on else ())


def _pressure(model: Model) -> list[ListedEffect]:
    if (listed := model.elastic.listed()) is None:
        return []
    name, forms, unknowns = listed
    return [ListedEffect(name, True, f"volumetric = {model.statement.element.volumetric!r}", forms, unknowns)]


def _displacements(model: Model) -> list[ListedEffect]:
    held: list[tuple[PrescribedDisplacement, int]] = []
    taken = np.zeros_like(model.fixed)
    for effect, support in model.supports:
        dofs, owned = support.dof_indices()
        new = np.zeros_like(taken)
        new[dofs[:owned]] = True
        count = int(parallel.global_sum(model.comm, np.array(np.count_nonzero(new & ~taken))))
        taken |= new
        if held and held[-1][0] is effect:
            count += held.pop()[1]
        held.append((effect, count))
    owned = model.fixed.size // model.tagged.mesh.geometry.dim
    for skew in () if model.turned is None else model.turned.supports:
        held.append((skew.effect, int(parallel.global_sum(model.comm, np.array(np.count_nonzero(skew.nodes < owned))))))
    if not held:
        return [ListedEffect("displacement", False, "no [[displacement]]")]
    return [ListedEffect(e.name, True, e.said, unknowns=-count) for e, count in held]


def _contacts(model: Model) -> list[ListedEffect]:
    scene = model.statement
    if model.boundary is None:
        return [ListedEffect("contact", False, "no [[contact]]"), ListedEffect("friction", False, "no [[contact]]")]
    effects, nodes = [], contact_nodes(model)
    # One effect after the other: the first contact counts for the iteration, the first friction of a kind for the rest.
    previous = (1, 1)
    for index, effect in enumerate(scene.contact):
        count = int(parallel.global_sum(model.boundary.comm, np.array(np.count_nonzero(model.boundary.part == index))))
        name, total = f"contact {effect.boundary}", linear_solves(scene, "none", nodes)
        forms = tuple(form for form in model.inventory.forms if form in (name, f"{name}, averages"))
        description = f"{effect.kind}, {count} nodes"
        if effect.against is not None:
            forms, description = (), f"{effect.kind}, against {effect.against}, {count} nodes"
        if effect.foundation is not None:
            description += f"; {effect.foundation.said}; at a distance from {_gaps(model, index)}"
        moving, added = model.boundary.moving, 0
        if effect.tool is not None and moving is not None:
            first = np.array([body.parts[0] for body in moving.bodies])
            added = int(np.count_nonzero(~moving.fixed & (first[moving.number] == index)))
            description += "; gap and normals stay where it is given"
        effects.append(ListedEffect(name, True, description, forms, unknowns=added, solves=_minus(total, previous)))
        previous = total
    for index, effect in enumerate(scene.contact):
        law, total = effect.friction, linear_solves(scene, friction_kind(scene, scene.contact[: index + 1]), nodes)
        name = f"friction {effect.boundary}"
        effects.append(ListedEffect(name, law.acts, law.said, solves=_minus(total, previous)))
        previous = total
    return effects


def _gaps(model: Model, index: int) -> str:
    """The smallest and the largest gap of one contact in words; collective."""
    assert model.boundary is not None
    assert model.data is not None
    gaps = model.data.gap[model.boundary.part == index]
    low, high = (parallel.largest(model.comm, sign * gaps, -np.inf) for sign in (-1.0, 1.0))
    extremes = (0.0 if abs(gap) < NO_FORCE * model.tagged.size else gap for gap in (-low, high))
    return " to ".join(f"{gap:.4g}" for gap in extremes)


def _minus(later: tuple[int, int], earlier: tuple[int, int]) -> tuple[int, int]:
    return later[0] - earlier[0], later[1] - earlier[1]
