"""What a scene is before it is solved: its effects, what each of them adds, and an estimate of its cost.

Nothing is solved and no stiffness is assembled.  The forms of the loads and of the contact boundaries are compiled and
assembled as the solver does, so that every mistake that the solver would find in the scene or its mesh is found here.

What may go wrong is said by ``findings``.  The estimate of the cost is a rule of thumb, and says so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.accuracy.plan import planned
from signorini_fx.body import loads
from signorini_fx.body.discretisation import LOCKING_POISSON, Body, prepare
from signorini_fx.check.findings import scene_findings
from signorini_fx.contact import data as contact_data
from signorini_fx.contact.laws import FrictionLaw, RegularisedData
from signorini_fx.linalg import choice
from signorini_fx.linalg.options import refuse_mistyped
from signorini_fx.linalg.rotated import check_rotation
from signorini_fx.mesh.hierarchy import coarser_scenes
from signorini_fx.mesh.tagged import load_mesh
from signorini_fx.records import Finding, Timings
from signorini_fx.scene.model import (
    BodyForce,
    Contact,
    CoulombFriction,
    Friction,
    PrescribedDisplacement,
    Scene,
    SurfaceTraction,
    TrescaFriction,
    friction_acts,
)
from signorini_fx.tuned import (
    BACK_SUBSTITUTION,
    BASE_BYTES,
    BYTES_PER_DOF,
    CONDENSING,
    DENSE_SPEED,
    DENSE_STEP_SECONDS,
    FACTOR_ENTRIES,
    FACTOR_SECONDS,
    KRYLOV_SECONDS,
    MEMORY_SHARE,
    MORE_SOLVES,
    ROW_ENTRIES,
    SOLVES_OF_FINER_MESH,
    SOLVES_OF_LATER_STEP,
    SOLVES_PER_DOUBLING,
)

# What ``estimators.StressRecovery`` compiles.
_RECOVERY = ("stress moments", "stress recovery error", "stress mass", "boundary residual")


@dataclass(frozen=True)
class Effect:
    """One effect that a scene can list.

    Attributes:
        name: what it is and where.
        on: whether it takes part.
        why: the reason, in the scene's words.
        forms: the compiled forms that it has a term in.
        unknowns: what it adds to the unknowns; a support takes away.
        solves: linear solves that it adds: an estimate, from and to.
    """

    name: str
    on: bool
    why: str
    forms: tuple[str, ...] = ()
    unknowns: int = 0
    solves: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class Cost:
    """A rough estimate, good to a factor of about three, for one core of a machine of the 2020s.

    Attributes:
        unknowns: displacement components that are not prescribed.
        contact_nodes: nodes of all contact boundaries.
        linear_algebra: ``full`` or ``condensed``, and why.
        linear_solves: from and to, of all load steps.
        factorisation_seconds: of one sparse factorisation.
        factorisation_bytes: its factor.
        seconds: linear algebra of the whole solve, from and to.
        memory_bytes: of the whole process.
    """

    unknowns: int
    contact_nodes: int
    linear_algebra: str
    linear_solves: tuple[int, int]
    factorisation_seconds: float
    factorisation_bytes: float
    seconds: tuple[float, float]
    memory_bytes: float


@dataclass(frozen=True)
class Check:
    """What ``check_scene`` found out.

    Attributes:
        title: of the scene.
        effects: every kind of effect, on or off.
        forms: what will be compiled, in order.
        cost: an estimate.
        findings: warnings and notes.
    """

    title: str
    effects: tuple[Effect, ...]
    forms: tuple[str, ...]
    cost: Cost
    findings: tuple[Finding, ...] = field(default=())

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings whose level is warning."""
        return tuple(finding for finding in self.findings if finding.level == "warning")

    def as_dict(self) -> dict[str, Any]:
        """Everything, ready for JSON."""
        return asdict(self)


def check_scene(scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD) -> Check:
    """Validate a scene together with its mesh, and say what it will do; collective, the same on every rank.

    Raises:
        SceneError: the scene does not fit its mesh.
        MeshError: the mesh cannot be had.
        OptionsError: PETSc does not take an option that the user has set.
    """
    refuse_mistyped(comm)
    for coarse in coarser_scenes(scene, scene.solver.levels):
        _validated(coarse, comm)
    d, law, data = _validated(scene, comm)
    cost = _cost(d)
    findings = [*_memory(cost, comm), *scene_findings(d, law, data)]
    return Check(scene.title, tuple(_effects(d)), _forms(d), cost, tuple(findings))


def _validated(scene: Scene, comm: MPI.Comm) -> tuple[Body, FrictionLaw | None, RegularisedData | None]:
    """The body, the friction law and the contact data of a scene, after everything that the solver looks at."""
    d = prepare(scene, load_mesh(scene, comm), Timings())
    if scene.accuracy is not None:
        planned(scene, scene.accuracy, comm)
    if d.boundary is None:
        return d, None, None
    law = contact_data.friction_law(scene, d.boundary)
    if scene.solver.algorithm == "exact":
        check_rotation(d.boundary)
    contact_data.first_sets(scene, d.boundary)
    return d, law, contact_data.regularised_data(scene, d, d.boundary, law)


def _estimates_error(scene: Scene) -> bool:
    to_stop = scene.solver.algorithm == "path-following" and scene.solver.regularisation_error == "auto"
    return to_stop or _compares_meshes(scene)


def _compares_meshes(scene: Scene) -> bool:
    return scene.accuracy is not None or bool(coarser_scenes(scene, scene.solver.levels))


def _estimated(scene: Scene) -> tuple[str, ...]:
    """What the error estimate compiles."""
    forces = [load for load in scene.loads if isinstance(load, BodyForce | SurfaceTraction)]
    missed = _compares_meshes(scene) and any(loads.varies(load) for load in forces)
    return (*_RECOVERY, *(["missed loads"] if missed else []))


def _forms(d: Body) -> tuple[str, ...]:
    """What the solver will compile, in order."""
    recovery = _estimated(d.scene) if d.boundary is not None and _estimates_error(d.scene) else ()
    return (*d.inventory.forms, *recovery)


# --- effects ---------------------------------------------------------------------------------------------------------


def _effects(d: Body) -> list[Effect]:
    scene = d.scene
    found = [_elasticity(d), *_materials(scene), _reduced(d), *_displacements(d)]

    names = {load.factors: load.name for load in d.applied}

    def form_of(load: Any) -> tuple[str, ...]:
        return (names[load.factors or (1.0,) * scene.steps],)

    body = scene.body_force
    if body is None or loads.is_zero(*body.components):
        found.append(Effect("body force", False, "it is 0" if body is not None else "no [body_force]"))
    else:
        components = ", ".join(map(_text, body.components[: d.tagged.dimension]))
        found.append(Effect("body force", True, f"({components})", form_of(body)))
    for traction in scene.traction:
        name, why = f"traction {traction.boundary}", _traction(traction)
        found.append(Effect(name, bool(why), why or "it is 0", form_of(traction) if why else ()))
    if not scene.traction:
        found.append(Effect("traction", False, "no [[traction]]"))
    found += _contacts(d)
    nodes = _contact_nodes(d)
    kind = _friction_kind(scene, scene.contact)
    one, every = (_linear_solves(scene, kind, nodes, steps=steps) for steps in (1, scene.steps))
    numbers = {len(load.factors) for load in scene.loads if load.factors is not None}
    why = f"factors: {', '.join(map(str, numbers))} each" if numbers else "no factors"
    found.append(Effect("load steps", scene.steps > 1, why, solves=_minus(every, one)))
    nested = scene.solver.levels > 1 and d.boundary is not None
    solves = _minus(_linear_solves(scene, kind, nodes, steps=scene.steps, levels=scene.solver.levels), every)
    estimate = d.boundary is not None and _estimates_error(scene)
    why = f"algorithm = {scene.solver.algorithm!r}, levels = {scene.solver.levels}"
    found.append(Effect("error estimate", estimate, why, _estimated(d.scene) if estimate else ()))
    return [*found, Effect("nested iteration", nested, f"levels = {scene.solver.levels}", solves=solves)]


def _elasticity(d: Body) -> Effect:
    hypothesis = d.scene.material[0].hypothesis if d.tagged.dimension == 2 else "in space"
    return Effect("elasticity", True, f"always; {hypothesis}", ("elasticity",), d.dofs, (1, 1))


def _materials(scene: Scene) -> list[Effect]:
    if len(scene.material) == 1:
        return [Effect("several materials", False, "one [[material]]")]
    return [Effect("several materials", True, ", ".join(str(m.region) for m in scene.material))]


def _reduced(d: Body) -> Effect:
    setting = d.scene.element.volumetric
    on = d.reduced is not None
    why = f"volumetric = {setting!r}"
    if setting == "auto":
        why += f", some nu >= {LOCKING_POISSON:g}" if on else f", no nu >= {LOCKING_POISSON:g}, or linear triangles"
    return Effect("reduced integration", on, why, tuple(d.inventory.forms[1:2]) if on else ())


def _displacements(d: Body) -> list[Effect]:
    found: list[tuple[PrescribedDisplacement, int]] = []
    taken = np.zeros_like(d.fixed)
    for effect, support in d.supports:
        dofs, owned = support.dof_indices()
        new = np.zeros_like(taken)
        new[dofs[:owned]] = True
        count = int(parallel.global_sum(d.comm, np.array(np.count_nonzero(new & ~taken))))
        taken |= new
        if found and found[-1][0] is effect:
            count += found.pop()[1]
        found.append((effect, count))
    if not found:
        return [Effect("displacement", False, "no [[displacement]]")]
    return [Effect(f"displacement {e.boundary}", True, _prescribed(e), unknowns=-count) for e, count in found]


def _contacts(d: Body) -> list[Effect]:
    scene = d.scene
    if d.boundary is None:
        return [Effect("contact", False, "no [[contact]]"), Effect("friction", False, "no [[contact]]")]
    found, nodes = [], _contact_nodes(d)
    # One effect after the other: the first contact costs the iteration, the first friction of a kind the rest of it.
    previous = (1, 1)
    for index, effect in enumerate(scene.contact):
        count = int(parallel.global_sum(d.boundary.comm, np.array(np.count_nonzero(d.boundary.part == index))))
        name, total = f"contact {effect.boundary}", _linear_solves(scene, "none", nodes)
        found.append(Effect(name, True, f"{effect.kind}, {count} nodes", (name,), solves=_minus(total, previous)))
        previous = total
    for index, effect in enumerate(scene.contact):
        law, total = effect.friction, _linear_solves(scene, _friction_kind(scene, scene.contact[: index + 1]), nodes)
        name = f"friction {effect.boundary}"
        found.append(Effect(name, friction_acts(law), _friction(law), solves=_minus(total, previous)))
        previous = total
    return found


def _minus(after: tuple[int, int], before: tuple[int, int]) -> tuple[int, int]:
    return after[0] - before[0], after[1] - before[1]


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    text = str(getattr(value, "text", f"<{type(value).__name__}>"))
    return text if len(text) <= 30 else text[:27] + "..."


def _prescribed(effect: PrescribedDisplacement) -> str:
    parts = (*zip("xyz", effect.components, strict=True), ("normal", effect.normal))
    return ", ".join(f"{name} = {_text(value)}" for name, value in parts if value is not None)


def _traction(effect: SurfaceTraction) -> str:
    """What acts, empty if nothing does."""
    parts = (*zip("xyz", effect.components, strict=True), ("pressure", effect.pressure))
    return ", ".join(f"{name} = {_text(value)}" for name, value in parts if not loads.is_zero(value))


def _friction(law: Friction) -> str:
    match law:
        case TrescaFriction(bound=bound):
            return f"tresca, bound = {_text(bound)}" + ("" if friction_acts(law) else ": frictionless")
        case CoulombFriction(coefficient=coefficient, cap=cap):
            text = f"coulomb, coefficient = {_text(coefficient)}" + ("" if cap is None else f", cap = {_text(cap)}")
            return text + ("" if friction_acts(law) else ": frictionless")
    return "no friction"


# --- cost ------------------------------------------------------------------------------------------------------------


def _contact_nodes(d: Body) -> int:
    if d.boundary is None:
        return 0
    return int(parallel.global_sum(d.boundary.comm, np.array(np.unique(d.boundary.nodes).size)))


def _friction_kind(scene: Scene, contacts: Sequence[Contact]) -> str:
    """The key of ``SOLVES_PER_DOUBLING`` with the friction of these contacts."""
    acting = [contact.friction for contact in contacts if friction_acts(contact.friction)]
    if any(isinstance(law, CoulombFriction) for law in acting):
        return "newton" if scene.solver.coulomb == "newton" else "fp"
    return "tresca" if acting else "none"


def _linear_solves(scene: Scene, kind: str, nodes: int, *, steps: int = 1, levels: int = 1) -> tuple[int, int]:
    """Linear solves to expect, from and to; ``kind`` is a key of ``SOLVES_PER_DOUBLING``."""
    if not scene.contact:
        return steps * levels, steps * levels
    more = MORE_SOLVES.get(scene.solver.algorithm, (0, 0))
    size = math.log2(max(nodes / 2 ** (levels - 1), 4))
    low, high = (round(factor * size) + extra for factor, extra in zip(SOLVES_PER_DOUBLING[kind], more, strict=True))
    # A later load step starts from the sets of the one before, a finer mesh from those of the coarser one.
    low, high = low + SOLVES_OF_LATER_STEP * (steps - 1), high * steps
    least, most = SOLVES_OF_FINER_MESH
    return low + least * (levels - 1) * steps, high + most * (levels - 1) * steps


def _cost(d: Body) -> Cost:
    """Nested dissection in two dimensions: n log n entries, n^1.5 operations."""
    comm = d.comm
    n = d.dofs
    nodes = _contact_nodes(d)
    least, slope, offset = FACTOR_ENTRIES
    entries = n * max(least, slope * (math.log2(n) - offset))
    factorisation = FACTOR_SECONDS[0] * n + FACTOR_SECONDS[1] * n**1.5
    kind = _friction_kind(d.scene, d.scene.contact)
    solves = _linear_solves(d.scene, kind, nodes, steps=d.scene.steps, levels=d.scene.solver.levels)
    setting, dense = d.scene.solver.linear_algebra, 0
    reason, once, each = "one factorisation for all load steps", factorisation, BACK_SUBSTITUTION * factorisation
    if setting == "krylov":
        reason, once, each, entries = "Krylov", 0.0, KRYLOV_SECONDS * n, 0.0
    elif d.boundary is not None:
        against = choice.against_condensing(d, 2 * nodes)
        if comm.size == 1 and setting != "full" and (against is None or setting == "condensed"):
            dense = 2 * nodes
            step = dense**3 / 3 / DENSE_SPEED + DENSE_STEP_SECONDS
            reason, once, each = "condensed", CONDENSING * factorisation, step
        else:
            reason, once, each = f"full: {against or 'as asked for'}", 0.0, factorisation
    free = int(parallel.global_sum(comm, np.array(np.count_nonzero(~d.fixed))))
    matrix = 12.0 * ROW_ENTRIES * n
    return Cost(
        unknowns=free,
        contact_nodes=nodes,
        linear_algebra=reason,
        linear_solves=solves,
        factorisation_seconds=factorisation,
        factorisation_bytes=9.0 * entries,
        seconds=(once + solves[0] * each, once + solves[1] * each),
        memory_bytes=BASE_BYTES * comm.size + BYTES_PER_DOF * n + 2 * matrix + 12.0 * entries + 24.0 * dense**2,
    )


def _memory(cost: Cost, comm: MPI.Comm) -> list[Finding]:
    there = parallel.machine_memory(comm)
    if cost.memory_bytes < MEMORY_SHARE * there:
        return []
    message = (
        f"about {cost.memory_bytes / 1e9:.0f} GB are needed, this machine has {there / 1e9:.0f}: use a coarser mesh"
    )
    return [Finding("warning", "mesh", message)]
