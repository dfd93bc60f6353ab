"""What a scene is before it is solved: its effects and what each of them adds, an estimate of its cost, what will hurt.

Nothing is solved and no stiffness is assembled.  The forms of the loads and of the contact boundaries are compiled and
assembled as the solver does, so that every mistake that the solver would find in the scene or its mesh is found here.

What will hurt is said by ``findings``.  What is said of costs is a rule of thumb, and says so.
"""

from __future__ import annotations

import math
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
    CoulombFriction,
    Friction,
    PrescribedDisplacement,
    Scene,
    SurfaceTraction,
    TrescaFriction,
    friction_acts,
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
        """The findings that hurt."""
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
    one, every = (_linear_solves(scene, nodes, steps=steps, levels=1) for steps in (1, scene.steps))
    numbers = {len(load.factors) for load in scene.loads if load.factors is not None}
    why = f"factors: {', '.join(map(str, numbers))} each" if numbers else "no factors"
    found.append(Effect("load steps", scene.steps > 1, why, solves=_minus(every, one)))
    nested = scene.solver.levels > 1 and d.boundary is not None
    solves = _minus(_linear_solves(scene, nodes), every)
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
    wanted = d.scene.element.volumetric
    on = d.reduced is not None
    why = f"volumetric = {wanted!r}"
    if wanted == "auto":
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
    found = []
    nodes = _contact_nodes(d)
    previous = (1, 1)
    for index, effect in enumerate(scene.contact):
        count = int(parallel.global_sum(d.boundary.comm, np.array(np.count_nonzero(d.boundary.part == index))))
        name = f"contact {effect.boundary}"
        without = scene.model_copy(update={"contact": _frictionless(scene.contact[: index + 1])})
        total = _linear_solves(without, nodes, steps=1, levels=1)
        why = f"{effect.kind}, {count} nodes"
        found.append(Effect(name, True, why, (name,), solves=_minus(total, previous)))
        previous = total
    for index, effect in enumerate(scene.contact):
        law = effect.friction
        with_it = (*scene.contact[: index + 1], *_frictionless(scene.contact[index + 1 :]))
        total = _linear_solves(scene.model_copy(update={"contact": with_it}), nodes, steps=1, levels=1)
        name = f"friction {effect.boundary}"
        found.append(Effect(name, friction_acts(law), _friction(law), solves=_minus(total, previous)))
        previous = total
    return found


def _frictionless(contacts: Any) -> tuple[Any, ...]:
    return tuple(contact.model_copy(update={"friction": TrescaFriction(bound=0.0)}) for contact in contacts)


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

# Linear solves of one load step per log2 of the number of contact nodes, from and to, as a sweep over Example 1 with
# 25 to 241 contact nodes showed them.
_SOLVES = {"none": (0.6, 2.0), "tresca": (0.8, 3.0), "fp": (1.5, 6.0), "newton": (1.4, 4.5)}
_MORE_SOLVES = {"continuation": (1, 3), "alm": (1, 5), "exact": (1, 3)}
# What a process holds before it has a mesh, and what the mesh, the forms and the vectors need per unknown.
_BASE_BYTES, _BYTES_PER_DOF = 1.4e8, 1.0e3
# Dense Cholesky, operations per second; a solve by CG with algebraic multigrid, seconds per unknown.
_DENSE_SPEED, _KRYLOV_SECONDS = 2e10, 1e-5


def _contact_nodes(d: Body) -> int:
    if d.boundary is None:
        return 0
    return int(parallel.global_sum(d.boundary.comm, np.array(np.unique(d.boundary.nodes).size)))


def _linear_solves(scene: Scene, nodes: int, *, steps: int | None = None, levels: int | None = None) -> tuple[int, int]:
    """Linear solves to expect, from and to."""
    steps, levels = steps or scene.steps, levels or scene.solver.levels
    if not scene.contact:
        return steps * levels, steps * levels
    kind = "tresca" if scene.has_friction else "none"
    if scene.has_coulomb:
        kind = "newton" if scene.solver.coulomb == "newton" else "fp"
    more = _MORE_SOLVES.get(scene.solver.algorithm, (0, 0))
    size = math.log2(max(nodes / 2 ** (levels - 1), 4))
    low, high = (round(factor * size) + extra for factor, extra in zip(_SOLVES[kind], more, strict=True))
    # A later load step starts from the sets of the one before, a finer mesh from those of the coarser one.
    low, high = low + 2 * (steps - 1), high * steps
    return low + 2 * (levels - 1) * steps, high + 5 * (levels - 1) * steps


def _cost(d: Body) -> Cost:
    """Nested dissection as measured with CHOLMOD and MUMPS: n log n entries and n^1.5 operations in two dimensions,
    n^(4/3) and n^2 in three.
    """
    comm = d.comm
    n = d.dofs
    nodes = _contact_nodes(d)
    dim = d.tagged.dimension
    entries = n * max(15.0, 7.6 * (math.log2(n) - 5.1)) if dim == 2 else n * max(40.0, 9.0 * n ** (1 / 3))
    factorisation = 1e-6 * n + (3e-9 * n**1.5 if dim == 2 else 4e-10 * n**2)
    solves = _linear_solves(d.scene, nodes)
    wanted, dense = d.scene.solver.linear_algebra, 0
    reason, once, each = "one factorisation for all load steps", factorisation, 0.1 * factorisation
    if wanted == "krylov":
        reason, once, each, entries = "Krylov", 0.0, _KRYLOV_SECONDS * n, 0.0
    elif d.boundary is not None:
        against = choice.against_condensing(d, dim * nodes)
        if comm.size == 1 and wanted != "full" and (against is None or wanted == "condensed"):
            dense = dim * nodes
            reason, once, each = "condensed", 1.4 * factorisation, dense**3 / 3 / _DENSE_SPEED + 1e-4
        else:
            reason, once, each = f"full: {against or 'as asked for'}", 0.0, factorisation
    free = int(parallel.global_sum(comm, np.array(np.count_nonzero(~d.fixed))))
    matrix = 12.0 * (18 if dim == 2 else 81) * n
    return Cost(
        unknowns=free,
        contact_nodes=nodes,
        linear_algebra=reason,
        linear_solves=solves,
        factorisation_seconds=factorisation,
        factorisation_bytes=9.0 * entries,
        seconds=(once + solves[0] * each, once + solves[1] * each),
        memory_bytes=_BASE_BYTES * comm.size + _BYTES_PER_DOF * n + 2 * matrix + 12.0 * entries + 24.0 * dense**2,
    )


def _memory(cost: Cost, comm: MPI.Comm) -> list[Finding]:
    there = parallel.machine_memory(comm)
    if cost.memory_bytes < 0.8 * there:
        return []
    message = (
        f"about {cost.memory_bytes / 1e9:.0f} GB are needed, this machine has {there / 1e9:.0f}: use a coarser mesh"
    )
    return [Finding("warning", "mesh", message)]
