"""What a scene is before it is solved: its effects and what each of them adds, an estimate of its cost, what will hurt.

Nothing is solved and no stiffness is assembled.  The forms of the loads and of the contact boundaries are compiled and
assembled as the solver does, so that every mistake that the solver would find in the scene or its mesh is found here.

What is said of equilibrium is proved: a linear body that is in equilibrium with its foundation is in equilibrium
against every rigid motion that its supports leave free.  What is said of costs, of gaps and of uniqueness is a rule of
thumb, and says so.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any, Literal, cast

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI

from signorini_fx import contact_data, loads, parallel
from signorini_fx import discretisation as build
from signorini_fx.accuracy import planned
from signorini_fx.assembly import assemble
from signorini_fx.boundary import ContactBoundary, contact_part, join, unit_contact_form
from signorini_fx.complementarity import FrictionLaw, RegularisedData
from signorini_fx.discretisation import LOCKING_POISSON, Discretisation
from signorini_fx.linalg import choice
from signorini_fx.linalg.rotated import check_rotation
from signorini_fx.loads import LoadCase
from signorini_fx.mesh import TaggedMesh, load_mesh
from signorini_fx.nested import coarser_scenes
from signorini_fx.results import Inventory
from signorini_fx.rigid import RigidMotions, rigid_motions
from signorini_fx.scene import (
    BodyForce,
    CoulombFriction,
    Friction,
    LinearElastic,
    PrescribedDisplacement,
    Scene,
    SurfaceTraction,
    TrescaFriction,
    friction_acts,
)
from signorini_fx.strategy import LARGEST_GAMMA, START_GAMMA
from signorini_fx.supports import check_overlap, dirichlet_conditions, fixed_dofs

_Rows = npt.NDArray[np.float64]
# What ``estimators.StressRecovery`` compiles.
_RECOVERY = ("stress moments", "stress recovery error", "stress mass", "boundary residual")
# Forces and motions below this share of their scale are round-off.
_ZERO = 1e-8
# Friction above this is taken for as much as is wanted.
_ROUGH = 1e6
# A gap this many times larger than the estimated displacements is called out.
_FAR = 10.0


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
class Finding:
    """Something to know before the scene is solved.

    Attributes:
        level: a warning hurts, a note does not.
        path: key of the scene that it is about.
        message: what is the matter, and what to do.
    """

    level: Literal["warning", "note"]
    path: str
    message: str


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
    """
    for coarse in coarser_scenes(scene, scene.solver.levels):
        _validated(coarse, comm)
    d, law, data = _validated(scene, comm)
    cost = _cost(d)
    findings = [*_locking(d), *_memory(cost, comm), *_equilibrium(d, law), *_large_displacements(d)]
    if d.boundary is not None and data is not None:
        findings += [
            *_gaps(d, data),
            *_uniqueness(scene, d.boundary, law),
            *_regularisation(scene, data, scene.young / d.tagged.size),
            *_monolithic(scene),
        ]
    return Check(scene.title, tuple(_effects(d)), tuple(d.inventory.forms), cost, tuple(findings))


def _validated(scene: Scene, comm: MPI.Comm) -> tuple[_Body, FrictionLaw | None, RegularisedData | None]:
    """The body, the friction law and the contact data of a scene, after everything that the solver looks at."""
    d = _body(scene, load_mesh(scene, comm))
    if scene.accuracy is not None:
        planned(scene, scene.accuracy, comm)
    if d.boundary is None:
        return d, None, None
    law = contact_data.friction_law(scene, d.boundary)
    if scene.solver.algorithm == "exact":
        check_rotation(d.boundary)
    contact_data.first_sets(scene, d.boundary)
    return d, law, contact_data.regularised_data(scene, cast(Discretisation, d), d.boundary, law)


# --- what the solver would set up, but for the stiffness -------------------------------------------------------------


@dataclass(frozen=True)
class _Body:
    """What ``discretise`` makes of a scene, as far as it needs no stiffness; see ``Discretisation``.

    The loads of the cases are not lifted: they are L itself.
    """

    scene: Scene
    tagged: TaggedMesh
    space: fem.FunctionSpace
    reduced: int | None
    supports: list[tuple[PrescribedDisplacement, fem.DirichletBC]]
    fixed: npt.NDArray[np.bool_]
    cases: tuple[LoadCase, ...]
    load_forms: dict[tuple[float, ...], str]
    boundary: ContactBoundary | None
    motions: RigidMotions
    inventory: Inventory

    @property
    def comm(self) -> MPI.Comm:
        comm: MPI.Comm = self.tagged.mesh.comm
        return comm

    @property
    def dofs(self) -> int:
        index_map = self.space.dofmap.index_map
        return int(index_map.size_global * self.space.dofmap.index_map_bs)

    @property
    def x(self) -> npt.NDArray[np.float64]:
        """Positions of the nodes of this rank."""
        x: npt.NDArray[np.float64] = self.space.tabulate_dof_coordinates()
        return x[: self.space.dofmap.index_map.size_local, :2]


def _body(scene: Scene, tagged: TaggedMesh) -> _Body:
    """Compile and assemble loads and contact boundaries, and raise what ``discretise`` would raise."""
    facets = build.boundary_facets(scene, tagged)
    space = fem.functionspace(tagged.mesh, ("Lagrange", scene.element.degree, (2,)))
    z = ufl.TestFunction(space)
    build.lame_coefficients(scene, tagged)
    reduced = build.reduced_degree(scene, tagged.mesh)
    inventory = Inventory(["elasticity", *(["reduced volumetric elasticity"] if reduced is not None else [])])
    supports = dirichlet_conditions(scene, space, facets, tagged)
    fixed = fixed_dofs(space, [support for _, support in supports])
    cases, load_forms = [], {}
    for factors, group in loads.load_groups(scene).items():
        form = loads.compile_load(group, space, z, facets, inventory)
        if form is not None:
            load_forms[factors] = inventory.forms[-1]
        cases.append(_load_case(factors, group, form, supports, space))
    parts = []
    for index, effect in enumerate(scene.contact):
        where = facets[effect.boundary]
        form = inventory.compile(f"contact {effect.boundary}", partial(unit_contact_form, space, z, where))
        parts.append(contact_part(space, form, where, index, fixed, effect.direction))
    boundary = join(parts) if parts else None
    if boundary is not None and _estimates_error(scene):
        inventory.forms += _estimated(scene)
    loads.check_finite(tuple(cases))
    if boundary is not None:
        check_overlap(scene, boundary, facets, tagged)
    x = space.tabulate_dof_coordinates()[: space.dofmap.index_map.size_local, :2]
    motions = rigid_motions(tagged.mesh.comm, x, fixed.reshape(-1, 2), tagged.size)
    return _Body(
        scene,
        tagged,
        space,
        reduced,
        supports,
        fixed,
        tuple(cases),
        load_forms,
        boundary,
        motions,
        inventory,
    )


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


def _load_case(
    factors: tuple[float, ...],
    loads: list[Any],
    form: fem.Form | None,
    supports: list[tuple[PrescribedDisplacement, fem.DirichletBC]],
    space: fem.FunctionSpace,
) -> LoadCase:
    """L and the prescribed displacements of loads that share their factors."""
    prescribed = fem.Function(space)
    load = prescribed.x.petsc_vec.copy() if form is None else assemble(form)
    for effect, support in supports:
        dofs, _ = support.dof_indices()
        prescribed.x.array[dofs] = 0.0
        if any(effect is one for one in loads):
            fem_petsc.set_bc(prescribed.x.petsc_vec, [support])
    return LoadCase(factors, form, load, prescribed.x.petsc_vec.copy())


# --- effects ---------------------------------------------------------------------------------------------------------


def _effects(d: _Body) -> list[Effect]:
    scene = d.scene
    found = [_elasticity(d), *_materials(scene), _reduced(d), *_displacements(d)]

    def form_of(load: Any) -> tuple[str, ...]:
        return (d.load_forms[load.factors or (1.0,) * scene.steps],)

    body = scene.body_force
    if body is None or loads.is_zero(body.x, body.y):
        found.append(Effect("body force", False, "it is 0" if body is not None else "no [body_force]"))
    else:
        found.append(Effect("body force", True, f"({_text(body.x)}, {_text(body.y)})", form_of(body)))
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


def _elasticity(d: _Body) -> Effect:
    hypothesis = d.scene.material[0].hypothesis
    return Effect("elasticity", True, f"always; {hypothesis}", ("elasticity",), d.dofs, (1, 1))


def _materials(scene: Scene) -> list[Effect]:
    if len(scene.material) == 1:
        return [Effect("several materials", False, "one [[material]]")]
    return [Effect("several materials", True, ", ".join(str(m.region) for m in scene.material))]


def _reduced(d: _Body) -> Effect:
    wanted = d.scene.element.volumetric
    on = d.reduced is not None
    why = f"volumetric = {wanted!r}"
    if wanted == "auto":
        why += f", some nu >= {LOCKING_POISSON:g}" if on else f", no nu >= {LOCKING_POISSON:g}, or linear triangles"
    return Effect("reduced integration", on, why, tuple(d.inventory.forms[1:2]) if on else ())


def _displacements(d: _Body) -> list[Effect]:
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


def _contacts(d: _Body) -> list[Effect]:
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
    parts = (("x", effect.x), ("y", effect.y), ("normal", effect.normal))
    return ", ".join(f"{name} = {_text(value)}" for name, value in parts if value is not None)


def _traction(effect: SurfaceTraction) -> str:
    """What acts, empty if nothing does."""
    parts = (("x", effect.x), ("y", effect.y), ("pressure", effect.pressure))
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


def _contact_nodes(d: _Body) -> int:
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


def _cost(d: _Body) -> Cost:
    """Nested dissection in two dimensions: n log n entries, n^1.5 operations, as measured with CHOLMOD and MUMPS."""
    comm = d.comm
    n = d.dofs
    nodes = _contact_nodes(d)
    entries = n * max(15.0, 7.6 * (math.log2(n) - 5.1))
    factorisation = 1e-6 * n + 3e-9 * n**1.5
    solves = _linear_solves(d.scene, nodes)
    wanted, dense = d.scene.solver.linear_algebra, 0
    reason, once, each = "one factorisation for all load steps", factorisation, 0.1 * factorisation
    if wanted == "krylov":
        reason, once, each, entries = "Krylov", 0.0, _KRYLOV_SECONDS * n, 0.0
    elif d.boundary is not None:
        against = choice._against_condensing(cast(Discretisation, d), 2 * nodes)
        if comm.size == 1 and wanted != "full" and (against is None or wanted == "condensed"):
            dense = 2 * nodes
            reason, once, each = "condensed", 1.4 * factorisation, dense**3 / 3 / _DENSE_SPEED + 1e-4
        else:
            reason, once, each = f"full: {against or 'as asked for'}", 0.0, factorisation
    free = int(parallel.global_sum(comm, np.array(np.count_nonzero(~d.fixed))))
    matrix = 12.0 * 18 * n
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


# --- what will hurt --------------------------------------------------------------------------------------------------


def _memory(cost: Cost, comm: MPI.Comm) -> list[Finding]:
    there = parallel.machine_memory(comm)
    if cost.memory_bytes < 0.8 * there:
        return []
    message = (
        f"about {cost.memory_bytes / 1e9:.0f} GB are needed, this machine has {there / 1e9:.0f}: use a coarser mesh"
    )
    return [Finding("warning", "mesh", message)]


def _locking(d: _Body) -> list[Finding]:
    scene = d.scene
    if d.reduced is not None or scene.element.degree > 1:
        return []
    triangles = d.tagged.mesh.topology.cell_name() == "triangle"
    cure = (
        "set element.degree = 2, or use quadrilaterals with element.volumetric = 'reduced'"
        if triangles
        else "set element.volumetric = 'auto', or element.degree = 2"
    )
    return [
        Finding(
            "warning",
            f"material[{index}].poisson",
            f"linear elements lock as nu -> 0.5 (nu = {material.poisson:g}): the body comes out too stiff; {cure}",
        )
        for index, material in enumerate(scene.material)
        if material.hypothesis == "plane strain" and material.poisson >= LOCKING_POISSON
    ]


def _equilibrium(d: _Body, law: FrictionLaw | None) -> list[Finding]:
    """Rigid motions that the supports leave free: whether contact can resist them, and balance the loads."""
    motions, boundary = d.motions, d.boundary
    free = motions.free
    if free.shape[1] == 0:
        return []
    cone, given, directions = _reactions(d, law)
    loose = _null_space(directions)
    if loose.shape[1]:
        names = _motions(free @ loose, motions)
        who, advice = "the supports do not resist", "prescribe a displacement"
        if boundary is not None:
            who, advice = "neither the supports nor the contact resists", f"{advice}, or add friction"
        return [Finding("warning", "displacement", f"nothing holds the body: {who} {names}; {advice}")]
    warnings: list[Finding] = []
    pushed = False
    for step in range(d.scene.steps):
        load, size = _load_on(d, step)
        pushed = pushed or float(np.linalg.norm(load)) > _ZERO * size
        away = _unbalanced(cone, load)
        left = float(np.linalg.norm(away))
        if left <= _ZERO * size or left**2 <= np.abs(given @ away).sum():
            continue
        when = f"load step {step + 1}: " if d.scene.steps > 1 else ""
        warnings.append(
            Finding(
                "warning",
                "traction, body_force",
                f"{when}there is no static equilibrium: the loads drive {_motions(free @ away[:, None], motions)}, "
                "which neither the supports nor the contact can stop: turn the loads, prescribe a displacement, or "
                "raise the friction",
            )
        )
    if warnings:
        return warnings
    alone = "the contact alone" if law is None or _normal_alone(d) else "friction"
    text = f"the supports do not hold {_motions(free, motions)}: {alone} must"
    if not pushed and np.linalg.matrix_rank(given) < free.shape[1] and not _has_bilateral(d):
        message = f"{text}, but no load presses the body on its foundation: its position is not determined"
        return [Finding("warning", "traction, body_force", message)]
    return [Finding("note", "displacement", f"{text}, and the loads press the body on")]


def _normal_alone(d: _Body) -> bool:
    """Whether contact without friction resists every free motion."""
    assert d.boundary is not None
    everywhere: npt.NDArray[np.bool_] = np.ones(d.boundary.size, dtype=bool)
    return d.motions.held_by(d.boundary, everywhere, ~everywhere)


def _has_bilateral(d: _Body) -> bool:
    return any(contact.kind == "bilateral" for contact in d.scene.contact)


def _reactions(d: _Body, law: FrictionLaw | None) -> tuple[_Rows, _Rows, _Rows]:
    """Contact reactions against the free motions, gathered from all ranks, one a row.

    Returns:
        Generators, of length 1, of the cone that pressure and Coulomb friction can balance (a cap is not counted); what
        given friction balances at most, in either direction; the directions in which there is any reaction.
    """
    boundary, free = d.boundary, d.motions.free
    if boundary is None:
        none = np.empty((0, free.shape[1]))
        return none, none, none
    modes = d.motions.at(boundary.x) * boundary.free[:, :, None]
    normal = np.einsum("ij,ijk->ik", boundary.normal, modes) @ free
    tangent = np.einsum("ij,ijk->ik", boundary.tangent, modes) @ free
    zero = np.zeros(boundary.size)
    coefficient, given = (zero, zero) if law is None else (law.coefficient, boundary.weight * law.given)
    edges = [normal + coefficient[:, None] * tangent, normal - coefficient[:, None] * tangent, normal]
    rough = coefficient > _ROUGH
    edges += [tangent[rough], -tangent[rough]]
    bilateral = contact_data.bilateral_nodes(d.scene, boundary)
    if bilateral is not None:
        edges += [-edge[bilateral] for edge in edges[:3]]
    directions = np.concatenate([normal, tangent[(coefficient > 0) | (given > 0)]])
    cone, friction, directions = (
        parallel.gather_rows(boundary.comm, rows)
        for rows in (np.concatenate(edges), given[:, None] * tangent, directions)
    )
    sizes = np.linalg.norm(cone, axis=1)
    return cone[sizes > _ZERO] / sizes[sizes > _ZERO, None], friction, directions


def _load_on(d: _Body, step: int) -> tuple[npt.NDArray[np.float64], float]:
    """L of the free motions, and the sum of the sizes of the nodal forces."""
    forces = sum((case.factors[step] * case.load.getArray(readonly=True) for case in d.cases), np.zeros(d.fixed.size))
    nodal = np.asarray(forces).reshape(-1, 2)
    work = np.einsum("ij,ijk->k", nodal, d.motions.at(d.x)) @ d.motions.free
    total = parallel.global_sum(d.comm, np.append(work, np.linalg.norm(nodal, axis=1).sum()))
    return total[:-1], float(total[-1])


def _null_space(rows: _Rows) -> _Rows:
    """Directions, one a column, across all the rows."""
    values, vectors = np.linalg.eigh(rows.T @ rows)
    return vectors[:, values <= _ZERO**2 * max(float(values[-1]), 1e-300)]


def _unbalanced(generators: npt.NDArray[np.float64], load: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """What is left of a load when the cone has taken all that it can: load minus its projection onto the cone.

    The non-negative least squares method of Lawson and Hanson, for a few rows of the matrix, hence few positive
    coefficients at a time.  The rest r satisfies generators r <= 0: a motion that every reaction lets happen.
    """
    count = generators.shape[0]
    coefficients = np.zeros(count)
    positive = np.zeros(count, dtype=bool)
    rest = load.copy()
    scale = float(np.linalg.norm(load))
    for _ in range(3 * count + 10):
        gain = np.where(positive, -np.inf, generators @ rest)
        if scale == 0.0 or gain.max(initial=-np.inf) <= _ZERO * scale:
            break
        positive[np.argmax(gain)] = True
        while True:
            trial = np.zeros(count)
            trial[positive] = np.linalg.lstsq(generators[positive].T, load, rcond=None)[0]
            bad = positive & (trial <= 0)
            if not bad.any():
                break
            shares = coefficients[bad] / np.maximum(coefficients[bad] - trial[bad], 1e-300)
            coefficients += shares.min() * (trial - coefficients)
            positive &= coefficients > 1e-14 * max(float(coefficients.max()), 1e-300)
            coefficients[~positive] = 0.0
        coefficients = trial
        rest = load - coefficients @ generators
    return rest


def _motions(motions: npt.NDArray[np.float64], frame: RigidMotions) -> str:
    """Names of rigid motions (translation x, translation y, rotation), one a column."""
    _, values, rows = np.linalg.svd(motions[2:3], full_matrices=True)
    turning = values.size > 0 and values[0] > 1e-6
    shifts = motions @ (rows[1:].T if turning else np.eye(motions.shape[1]))
    names = []
    if shifts.shape[1] == 2:
        names.append("translations")
    if shifts.shape[1] == 1:
        along = shifts[:2, 0] / np.linalg.norm(shifts[:2, 0])
        along = along * np.sign(along[np.argmax(np.abs(along))]) if motions.shape[1] > 1 else along
        names.append(f"the translation along ({_round(along[0])}, {_round(along[1])})")
    if turning and motions.shape[1] > 1:
        names.append("rotations")
    elif turning:
        shift_x, shift_y, angle = motions[:, 0]
        x, y = frame.centre + frame.length / angle * np.array([-shift_y, shift_x])
        names.append(f"the rotation about ({_round(x)}, {_round(y)})")
    return " and ".join(names)


def _round(value: float) -> str:
    return f"{round(float(value), 6) + 0.0:.4g}"


def _gaps(d: _Body, data: RegularisedData) -> list[Finding]:
    boundary = d.boundary
    assert boundary is not None
    comm, size = boundary.comm, d.tagged.size
    unilateral = np.ones(boundary.size, dtype=bool) if data.bilateral is None else ~data.bilateral
    smallest = -parallel.global_max(comm, parallel.local_max(-data.gap, -np.inf))
    found = []
    if smallest < -_ZERO * size:
        level: Literal["warning", "note"] = "warning" if -smallest > 0.01 * size else "note"
        found.append(
            Finding(
                level,
                "contact.gap",
                f"the gap is negative, down to {smallest:g}: the body penetrates its foundation before it is loaded",
            )
        )
    if d.motions.free.shape[1] > 0 or parallel.global_sum(comm, np.array(np.count_nonzero(~unilateral))) > 0:
        return found
    moved = max(_displacement_scale(d, step) for step in range(d.scene.steps))
    if smallest >= -_ZERO * size and moved == 0.0:
        message = "there is no load, and every prescribed displacement is 0: the solution is 0"
        found.append(Finding("warning", "traction, body_force, displacement", message))
    elif smallest > _FAR * moved:
        found.append(
            Finding(
                "warning",
                "contact.gap",
                f"the smallest gap is {smallest:g}, while prescribed displacements and loads move the body by about "
                f"{moved:.1g} (an estimate): contact will hardly ever close; check the gap and the units",
            )
        )
    return found


def _large_displacements(d: _Body) -> list[Finding]:
    """Loads under which linear elasticity is not what is wanted; as a rule two units do not agree."""
    moved, size = max(_displacement_scale(d, step) for step in range(d.scene.steps)), d.tagged.size
    if moved < size:
        return []
    message = (
        f"loads and prescribed displacements move the body by about {moved:.1g} (an estimate), its size is {size:.3g}: "
        "no small deformation; check the units of E and of the loads"
    )
    return [Finding("warning", "material, traction, body_force, displacement", message)]


def _displacement_scale(d: _Body, step: int) -> float:
    """Largest prescribed displacement, and what a beam of the body's outline would bend under the loads, a length."""
    comm = d.comm
    owned = np.sum([case.factors[step] * case.start.getArray(readonly=True) for case in d.cases] or [[0.0]], axis=0)
    prescribed = parallel.global_max(comm, parallel.local_max(np.abs(owned)))
    _, force = _load_on(d, step)
    x = d.tagged.mesh.geometry.x[:, :2].astype(np.float64)
    low, high = parallel.global_bounds(comm, x)
    softest = min(material.young for material in d.scene.material)
    return prescribed + 4 * force / softest * float(d.tagged.size / (high - low).min()) ** 3


def friction_indication(material: LinearElastic) -> float:
    """The friction coefficient above which several solutions are to be reckoned with: sqrt(3 - 4 nu) / (2 - 2 nu).

    An indication, no theorem.  On a half-plane a wave exp(i k s) of the pressure changes the tangential displacement,
    and this the pressure; for every k, the fixed point that Coulomb friction is contracts below this coefficient
    (1 / sqrt(S_NN C_TT), with the stiffness S and the compliance C of the surface, does not depend on k).  A bound for
    uniqueness that is both proved and independent of the mesh is not known: a solution exists for every coefficient in
    two dimensions (Ballard and Iurlano, arXiv:2303.16298), the discrete one is unique below a bound that falls to zero
    with the mesh size (Hild, Int. J. Appl. Math. Comput. Sci. 12 (2002) 41-50), and examples with several solutions
    are known.
    """
    nu = material.poisson
    if material.hypothesis == "plane stress":
        nu = nu / (1 + nu)
    return math.sqrt(3 - 4 * nu) / (2 - 2 * nu)


def _uniqueness(scene: Scene, boundary: ContactBoundary, law: FrictionLaw | None) -> list[Finding]:
    limit = min(friction_indication(material) for material in scene.material)
    found = []
    for index, _ in enumerate(scene.contact):
        here = np.zeros(0) if law is None else law.coefficient[boundary.part == index]
        largest = parallel.global_max(boundary.comm, parallel.local_max(here))
        if largest > limit:
            found.append(
                Finding(
                    "warning",
                    f"contact[{index}].friction.coefficient",
                    f"F = {largest:g} is above {limit:.3g} (an indication from the half-plane, no proven bound): the "
                    "problem may have several solutions and the fixed point may not contract; compare solutions from "
                    "different solver.initial_contact, and try solver.coulomb = 'newton'",
                )
            )
    return found


def _regularisation(scene: Scene, data: RegularisedData, natural: float) -> list[Finding]:
    """Gamma and sigma against E over the size of the body."""
    settings, found = scene.solver, []
    gammas = {"gamma_n": data.gamma_n, "gamma_t": data.gamma_t}
    if not scene.has_friction:
        del gammas["gamma_t"]
    # Path-following looks for gamma itself; exact ends without.
    for name, gamma in gammas.items() if settings.algorithm not in ("path-following", "exact") else ():
        if gamma > LARGEST_GAMMA * natural:
            message = (
                f"{gamma:g} is above {LARGEST_GAMMA * natural:.1g}, {LARGEST_GAMMA:g} times E over the size of the "
                "body: round-off takes the digits of the pressures; set 'auto', or algorithm = 'alm' or 'exact'"
            )
            found.append(Finding("warning", f"solver.{name}", message))
        if gamma < START_GAMMA * natural and settings.algorithm != "alm":
            error = "a penetration" if name == "gamma_n" else "an elastic slip"
            message = (
                f"{gamma:g} is below {START_GAMMA * natural:.1g}, {START_GAMMA:g} times E over the size of the body: "
                f"{error} of about {min(1.0, natural / gamma):.0%} of the displacements is to be expected; set "
                "'auto', or algorithm = 'alm'"
            )
            found.append(Finding("warning", f"solver.{name}", message))
    if scene.has_friction and data.sigma * data.gamma_t <= 1.0 + 1e-9 and data.gamma_t > START_GAMMA * natural:
        message = f"{data.sigma:g} is not above 1 / gamma_t: the slip sets cycle where gamma_t is large; set 'auto'"
        found.append(Finding("warning", "solver.sigma", message))
    return found


def _monolithic(scene: Scene) -> list[Finding]:
    """Where coulomb = newton is not what will be done."""
    if scene.solver.coulomb != "newton" or not scene.has_coulomb:
        return []
    capped = any(isinstance(c.friction, CoulombFriction) and c.friction.cap is not None for c in scene.contact)
    reasons = {
        "a cap": capped,
        "bilateral contact": any(contact.kind == "bilateral" for contact in scene.contact),
    }
    given = [reason for reason, holds in reasons.items() if holds]
    if not given:
        return []
    return [
        Finding("note", "solver.coulomb", f"newton does not go with {' and '.join(given)}: the fixed point is used")
    ]
