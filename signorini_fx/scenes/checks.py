"""The check of a scene before it is solved: its loads and supports, its cost and its mistakes.

No stiffness is assembled.  Loads and contact boundaries are assembled as in the solver, so that
every error that it would find in the scene or its mesh is found here.
"""

from __future__ import annotations

import textwrap
from dataclasses import asdict, dataclass, field, replace

import numpy as np
from mpi4py import MPI

from signorini_fx.algebra.linalg import petsc_options
from signorini_fx.arrays import Plain
from signorini_fx.machine import parallel
from signorini_fx.machine.display import storage
from signorini_fx.machine.terminal import COLUMNS, printable
from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.mechanics.mesh.tagged import arrays_of
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.base import Table
from signorini_fx.records import Finding, History, Timings
from signorini_fx.results.accuracy.convergence_table import Cost, estimated_cost
from signorini_fx.results.accuracy.next_accuracy import between
from signorini_fx.scenes.found_contacts import without_contact
from signorini_fx.scenes.mesh import coarser_scenes, load_mesh, scene_on
from signorini_fx.scenes.reading import as_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.solving.findings import nonlinear_findings, refuse_beforehand, scene_findings
from signorini_fx.solving.uniqueness import uniqueness_findings
from signorini_fx.tuned import MEMORY_SHARE, NEXT_ERROR, NO_FORCE

# Number of list entries or characters of an expression that are shown; width of labels.
_MOST_SHOWN, _LABEL = 30, 12


@dataclass(frozen=True)
class Check:
    """The result of ``check_scene``."""

    title: str  # title of the scene
    acts: tuple[str, ...]  # loads, supports and contacts, each as text
    cost: Cost  # estimated cost
    findings: tuple[Finding, ...] = field(default=())  # warnings and notes

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings that are warnings."""
        return tuple(finding for finding in self.findings if finding.level == "warning")

    def as_dict(self) -> dict[str, Plain]:
        """Return everything as a dictionary, ready for JSON."""
        return asdict(self)


def check_scene(
    scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD, *, uniqueness: bool = False
) -> Check:
    """Validate a scene together with its mesh, and report what acts; collective, with the same
    result on every rank.

    Args:
        scene: the scene.
        comm: the ranks that share the work.
        uniqueness: whether to find also below which friction coefficient there is only one
            solution, which takes a factorisation.
    """
    petsc_options.refuse_exchanged()
    scene = as_scene(scene, comm)
    if scene.statement.nonlinear:
        from signorini_fx.scenes.nonlinear import ProblemOfScene, linear_body

        model = linear_body(scene, comm, Timings())
        compared = False
        ProblemOfScene(scene.statement, model, History())
        model = replace(model.with_statement(scene.statement), contacts=scene.contact)
        findings = [*nonlinear_findings(model.statement, model)]
    else:
        coarser = coarser_scenes(scene, scene.solver.levels)
        for coarse in coarser:
            _validated(coarse, comm)
        model = _validated(scene, comm)
        compared = scene.accuracy is not None or bool(coarser)
        findings = [*scene_findings(model), *(uniqueness_findings(model) if uniqueness else [])]
    if scene.contact and model.motions.pieces.count > 1:
        arrays = arrays_of(model.tagged)
        entries = scene.contact
        findings += parallel.on_root(comm, lambda: [*without_contact(entries, arrays)])
    cost = estimated_cost(model)
    available = parallel.machine_memory(comm)
    if cost.memory_bytes >= MEMORY_SHARE * available:
        needed = (
            f"about {cost.memory_bytes / 1e9:.0f} GB are needed, this machine has "
            f"{available / 1e9:.0f}"
        )
        findings.insert(0, Finding("warning", "mesh", f"{needed}: use a coarser mesh"))
    return Check(scene.title, _acting(model, compared=compared), cost, tuple(findings))


def _validated(scene: Scene, comm: MPI.Comm) -> Model:
    """Return the model of a scene, with the cells and elements that its solve begins with, after
    all checks of the solver.
    """
    first = scene
    if scene.accuracy is not None:
        from signorini_fx.scenes.mesh_sequence import planned

        first = planned(scene, scene.accuracy, comm).scene
        # Refinement begins with a coarser generated mesh.
        first = scene_on(first, 1.0) if first.statement.generated else first
    model = prepare(first.statement, load_mesh(first, comm), Timings())
    refuse_beforehand(model)
    return model


def _acting(model: Model, *, compared: bool) -> tuple[str, ...]:
    """Return the loads, supports and contacts of a model as text; collective.

    Args:
        model: the model.
        compared: whether several meshes are compared.
    """
    statement = model.statement
    first, reduced = _body(model)
    acting = [first]
    if len(statement.material) > 1:
        acting.append(
            "several materials "
            f"({', '.join(str(material.region) for material in statement.material)})"
        )
    for one in statement.material:
        if not isinstance(one, LinearElastic):
            acting.append(f"{one.words} ({one.region or 'everywhere'}: {given_in_words(one)})")
    acting += ["reduced integration"] * reduced
    acting += ["pressure of the mixed element"] * model.scene_law.pressed
    acting += _contacts(model)
    if statement.path.expected > 1:
        automatic = statement.path.steps is not None
        acting.append(f"{'about ' if automatic else ''}{statement.path.expected} load steps")
    for key, entries in statement.effects.items():
        if key not in ("material", "contact"):
            acting += [
                f"{effect.name} ({given_in_words(effect)})" for effect in entries if effect.acts
            ]
    solver = statement.solver
    if model.boundary is not None:
        to_stop = solver.algorithm == "path-following" and solver.regularisation_error == "auto"
        acting += ["error estimate"] * (to_stop or compared)
        acting += [f"nested iteration (levels = {solver.levels})"] * (solver.levels > 1)
    return tuple(acting)


def _body(model: Model) -> tuple[str, bool]:
    """Return the description of the body, and whether its volume terms are integrated with fewer
    points.
    """
    statement = model.statement
    if not statement.nonlinear:
        return f"elasticity ({model.kinematics.words})", model.scene_law.reduced is not None
    from signorini_fx.mechanics.body.nonlinear_law import volume_degree

    inner = (
        " with the contact problem of its tangent in each iteration" if statement.contact else ""
    )
    kind = statement.kinematics_in(model.tagged.dimension).words
    strains = "finite" if statement.finite_strains else "small"
    body = f"nonlinear body ({kind}, {strains} strains, Newton's method{inner})"
    return body, volume_degree(statement, model.tagged) is not None


def _contacts(model: Model) -> list[str]:
    """Return descriptions of the contact boundaries with their nodes, gaps and friction."""
    if model.boundary is None:
        return []
    acting = []
    for index, effect in enumerate(model.contacts):
        count = int(parallel.total(model.boundary.comm, model.boundary.part == index))
        law = effect.friction
        against = "" if effect.against is None else f"against {effect.against}, "
        if effect.itself:
            against = "may touch itself, "
        description = f"{effect.kind}, {against}{count} nodes"
        if effect.foundation is not None:
            shape = f"{effect.foundation.shape}, {given_in_words(effect.foundation)}"
            description += f"; {shape}; at a distance of {_gaps(model, index)}"
        if effect.driven is not None:
            description += "; gap and normals are those of the initial position"
        acting.append(f"contact {effect.boundary} ({description})")
        acting += [f"friction {effect.boundary} ({law.law}, {given_in_words(law)})"] * law.acts
    return acting


# Keys that name an entry or its load steps and are not listed as values.
_NAMES = ("boundary", "at", "region", "section", "law", "shape", "hypothesis", "torsion", "factors")


def given_in_words(table: Table) -> str:
    """Return the values that an entry of a scene sets, as text."""
    keys = [
        key
        for key in type(table).model_fields
        if key in table.model_fields_set and key not in _NAMES
    ]
    return ", ".join(
        f"{key} = {_in_words(value)}" for key in keys if (value := getattr(table, key)) is not None
    )


def _in_words(value: Plain) -> str:
    """Return a value as text, shortened if it is long."""
    match value:
        case bool():
            return "yes" if value else "no"
        case float():
            return f"{value:g}"
        case Table():
            return f"{{{given_in_words(value)}}}"
        case tuple() if len(value) > _MOST_SHOWN:
            return f"{len(value)} entries"
        case tuple():
            return f"[{', '.join(map(_in_words, value))}]"
    words = str(getattr(value, "text", f"<{type(value).__name__}>" if callable(value) else value))
    return words if len(words) <= _MOST_SHOWN else f"{words[: _MOST_SHOWN - 3]}..."


def _gaps(model: Model, index: int) -> str:
    """Return the smallest and the largest gap of one contact as text; collective."""
    assert model.boundary is not None
    assert model.data is not None
    gaps = model.data.gap[model.boundary.part == index]
    smallest = -parallel.largest(model.comm, -gaps, -np.inf)
    largest = parallel.largest(model.comm, gaps, -np.inf)
    tiny = NO_FORCE * model.tagged.size
    extremes = [f"{0.0 if abs(gap) < tiny else gap:.4g}" for gap in (smallest, largest)]
    return " to ".join(dict.fromkeys(extremes))


def text_of(check: Check, *, verbose: bool) -> str:
    """Return the report of a check as text in 80 columns: what acts, the cost, and the findings.

    Args:
        check: the check.
        verbose: whether to add the linear algebra.
    """
    cost = check.cost
    low, high = cost.linear_solves
    solves = f"{low}" if low == high else f"{low} to {high}"
    share = "a tenth" if cost.next_error == NEXT_ERROR[2] else "a third"
    how = "with --accuracy" if cost.next_local else "with all cells smaller"
    smaller = f"; {share} of the error: {between(cost.next_seconds)} {how}"
    if cost.next_refused:
        smaller = ""
    estimate = (
        f"{cost.unknowns} unknowns, {solves} solves, {between(cost.seconds)}, "
        f"{storage(cost.memory_bytes)}, estimated{smaller}"
    )
    count = len(check.warnings)
    verdict = "fine" if count == 0 else f"{count} warning{'s' * (count > 1)}"
    lines = [f"{check.title or 'scene'}: {verdict}", *_paragraph("acts", "; ".join(check.acts))]
    lines += _paragraph("cost", estimate)
    if verbose:
        lines += _paragraph("solver", cost.linear_algebra)
    for finding in sorted(check.findings, key=lambda finding: finding.level != "warning"):
        lines += _paragraph(finding.level, f"{finding.path}: {finding.message}")
    return "\n".join(lines)


def _paragraph(label: str, text: str) -> list[str]:
    """Return a labelled text in lines of 80 columns."""
    lines = textwrap.wrap(printable(text), COLUMNS - _LABEL)
    return [f"  {label if k == 0 else '':{_LABEL - 2}s}{line}" for k, line in enumerate(lines)]
