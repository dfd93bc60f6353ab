"""The problem that a result is judged against, from an input file or a scene."""

from __future__ import annotations

import re
import shutil
import tempfile
import weakref
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np
from dolfinx import mesh as dmesh
from dolfinx.io.utils import cell_perm_vtk
from mpi4py import MPI
from scipy.sparse import csr_array

from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.deck import read_deck
from signorini_fx.addons.decks.draft import draft_of
from signorini_fx.addons.decks.tagged_arrays import tagged
from signorini_fx.addons.decks.text import DeckBlock
from signorini_fx.addons.judging.adjusted_nodes import adjusted_points
from signorini_fx.addons.judging.problem_data import (
    JudgedContact,
    JudgedMaterial,
    JudgedMesh,
    JudgedProblem,
    JudgedStrain,
    facet_points,
)
from signorini_fx.addons.judging.soft_contact import law_of_deck, law_of_scene
from signorini_fx.addons.judging.stated_loads import loads_by_degree, loads_of, prescribed_of, springs_of
from signorini_fx.addons.judging.stated_strains import strains_by_reading, strains_of
from signorini_fx.errors import SceneError
from signorini_fx.machine import compat
from signorini_fx.mechanics.materials.protocol import PAIRS
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, sides_of
from signorini_fx.mechanics.mesh.files.cells import CELLS, Cell, completed, dimension
from signorini_fx.mechanics.mesh.files.raw import row_keys, rows_of
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, check_fits
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.statement.mesh_sources import MeshFile
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import as_scene, read_scene
from signorini_fx.scenes.solver import solves
from signorini_fx.tuned import HARD_OF_CALCULIX, SAME_LENGTH

# Elements of the serendipity family by the complete ones that they are read as.
_SERENDIPITY = {"quad9": ("quad8", 8, 3), "hexahedron27": ("hexahedron20", 20, 8)}


def judged_problem(problem: object) -> tuple[JudgedProblem, list[str]]:
    """The problem as arrays, and what it has that cannot be judged.

    Args:
        problem: the path of an input file (.inp) or of a scene, a ``Scene``, or its mapping.

    Raises:
        MeshError: the file is no such input file.
        SceneError: the scene is wrong, or what was drafted from the input file.
    """
    if isinstance(problem, str | Path) and Path(problem).suffix.lower() == ".inp":
        return _of_deck(Path(problem))
    scene = as_scene(problem)
    tagged = load_mesh(scene, MPI.COMM_SELF)
    check_fits(scene.statement, tagged)
    mesh = _mesh_of_tagged(tagged, scene.element.degree)
    judged, reasons = _problem(scene.statement, solves(scene, MPI.COMM_SELF), mesh, None, ())
    return judged, reasons


def _of_deck(file: Path) -> tuple[JudgedProblem, list[str]]:
    deck = read_deck(file, at_nodes=True)  # where programs have them
    mesh = _mesh_of_deck(deck)
    points, unclear = adjusted_points(deck, mesh)
    moved = not np.array_equal(points, mesh.points)
    if moved:
        mesh = replace(mesh, points=points)
        deck = replace(deck, mesh=_with_points(deck.mesh, mesh))
    # ADJUST would close distances in the scene.
    deck = replace(deck, pairs=[replace(pair, adjust=None) for pair in deck.pairs])
    folder = tempfile.mkdtemp()
    weakref.finalize(deck, shutil.rmtree, folder, ignore_errors=True)
    target = Path(folder) / f"{file.stem}.toml"
    drafted = draft_of(deck, file, target)
    target.write_text(drafted.text, encoding="utf-8")
    try:
        scene = read_scene(target)
    except SceneError as error:
        raise error.of(file) from None
    source = tagged(deck.mesh, straight=False) if moved else MeshFile(file=file.resolve())
    scene = scene.model_copy(update={"mesh": source})
    solve = solves(scene, MPI.COMM_SELF)
    problem, reasons = _problem(scene.statement, solve, mesh, drafted.deck, tuple(drafted.lost))
    return problem, _of_other_cells(deck) + unclear + reasons


def _of_other_cells(deck: Deck) -> list[str]:
    """Why a file cannot be judged whose cells are not those of its mesh here."""
    kinds = {kind for kind, nodes in deck.model.raw.blocks if len(nodes) and dimension(kind) == deck.mesh.dim}
    shapes = {kind.rstrip("0123456789") for kind in kinds}
    if len(kinds) == 1 and not shapes & {"wedge", "pyramid"}:
        return []
    words = ", ".join(sorted(kinds))
    return [f"it has cells of kinds that are not judged yet, or not together: {words}"]


def _with_points(arrays: MeshArrays, mesh: JudgedMesh) -> MeshArrays:
    """A mesh whose nodes of the file are elsewhere, and with them those that complete its cells."""
    points = arrays.points.copy()
    points[: len(mesh.points)] = mesh.points
    if arrays.cells.shape[1] > mesh.cells.shape[1]:
        full_cell = completed(mesh.kind)
        assert full_cell is not None
        points[arrays.cells] = np.einsum("qk,mkd->mqd", full_cell[1], mesh.points[mesh.cells])
    return replace(arrays, points=points)


def _mesh_of_deck(deck: Deck) -> JudgedMesh:
    """The nodes and cells of the file itself, without nodes that complete cells."""
    arrays, count = deck.mesh, len(deck.numbers)
    kind, width, facet_width = arrays.kind, arrays.cells.shape[1], arrays.facets.shape[1]
    names = deck.names
    serendipity = _SERENDIPITY.get(kind)
    # Cells of degree 1 beside those of degree 2 have got nodes on their edges, too.
    if len(arrays.points) > count and serendipity is not None and arrays.cells[:, : serendipity[1]].max() < count:
        kind, width, facet_width = serendipity
    elif len(arrays.points) > count:  # such a mesh is not judged: ``_of_other_cells``
        names = np.pad(names, (0, len(arrays.points) - count), constant_values=-1)
        count = len(arrays.points)
    facets = arrays.facets[:, :facet_width]
    boundaries = {name: facets[rows] for name, rows in arrays.boundaries.items()}
    return JudgedMesh(arrays.points[:count], kind, arrays.cells[:, :width], boundaries, dict(arrays.regions), names)


def _mesh_of_tagged(tagged: TaggedMesh, element_degree: int) -> JudgedMesh:
    """The mesh of a scene, with the nodes between corners that its elements have where its cells have none."""
    mesh, dim = tagged.mesh, tagged.dimension
    degree, name = compat.geometry_degree(mesh), mesh.topology.cell_name()
    kind = next(
        kind
        for kind, cell in CELLS.items()
        if cell.dim == dim and cell.degree == degree and len(cell.corners) == _corners(name)
    )
    width = len(CELLS[kind].nodes)
    order = np.argsort(cell_perm_vtk(mesh.topology.cell_type, width))
    cells = compat.geometry_cells(mesh)[:, order].astype(np.int64)
    points = mesh.geometry.x[:, :dim].astype(np.float64)
    if element_degree > degree:
        kind, cells, points = _with_nodes_between(CELLS[kind], cells, points)
    sides = sides_of(cells, CELLS[kind])
    corner_count = len(CELLS[CELLS[kind].facet].corners)
    boundaries = {}
    for label in tagged.boundaries:
        facets = tagged.facets(label)
        ends = dmesh.entities_to_geometry(mesh, dim - 1, facets)[:, :corner_count] if facets.size else facets
        _, first = np.unique(np.sort(sides[:, :corner_count], axis=1), axis=0, return_index=True)
        rows = rows_of(ends.astype(np.int64), sides[first, :corner_count]) if facets.size else facets
        boundaries[label] = sides[first[rows]]
    regions = {label: tagged.cells(label).astype(np.int64) for label in tagged.regions}
    return JudgedMesh(points, kind, cells, boundaries, regions, np.arange(1, len(points) + 1))


def _with_nodes_between(cell: Cell, cells: Ints, points: Floats) -> tuple[str, Ints, Floats]:
    """Kind, nodes and points of the cells of degree 2 with the corners, and the shape, of some of degree 1."""
    full_cell = next(c for c in CELLS.values() if c.corners == cell.corners and c.degree == 2)
    columns, further = [cells], [points]
    count = len(points)
    for size in sorted({len(members) for members in full_cell.nodes} - {1}):
        between = np.array([members for members in full_cell.nodes if len(members) == size])
        rows = cells[:, between].reshape(-1, size)
        _, first, numbers = np.unique(row_keys(rows), return_index=True, return_inverse=True)
        columns.append(count + numbers.reshape(len(cells), -1))
        further.append(points[rows[first]].mean(axis=1))
        count += len(first)
    return full_cell.kind, np.hstack(columns), np.concatenate(further)


def _corners(cell: str) -> int:
    return {"triangle": 3, "quadrilateral": 4, "tetrahedron": 4, "hexahedron": 8}[cell]


def _problem(
    statement: Statement, solve: Callable[..., Solution], mesh: JudgedMesh, deck: Deck | None, lost: tuple[str, ...]
) -> tuple[JudgedProblem, list[str]]:
    position = float(statement.steps - 1)
    placed = statement.placed(position)
    hypothesis = "space" if mesh.dim == 3 else statement.kinematics.words
    revolved = hypothesis == "axisymmetric"
    reasons: list[str] = []
    if hypothesis not in ("plane strain", "plane stress", "axisymmetric", "space"):
        reasons.append(f"{hypothesis} is not judged yet")
    if statement.element.degree != mesh.element.degree:
        reasons.append("elements of degree 1 on cells of degree 2 are not judged yet: take those of degree 2")
    if statement.element.volumetric == "mixed":
        reasons.append("elements with a pressure of their own are not judged yet")
    materials, misfits = _materials(statement, mesh)
    reasons += misfits
    stated = statement, position, mesh, materials
    loads, misfits = loads_of(*stated, revolved=revolved)
    reasons += misfits
    springs, misfits = springs_of(statement, position, mesh, revolved=revolved)
    reasons += misfits
    strains = strains_of(statement, position, mesh, materials)
    unjudged = {"preload"}
    reasons += [
        f"{entry.name} is not judged yet"
        for _, entry in statement.listed()
        if entry.label in unjudged or entry.interface not in ("", "overclosures")
    ]
    prescribed, misfits = prescribed_of(statement, position, mesh)
    reasons += misfits
    no_links = csr_array((0, mesh.points.size))
    contacts = tuple(_contact(entry, mesh, deck) for entry in placed.contact)
    for entry in placed.contact:
        if entry.tool:
            reasons.append(f"the foundation of {entry.boundary} is driven, which is not judged yet")
        if entry.kind == "bilateral":
            reasons.append(f"contact of {entry.boundary} cannot open, which is not judged yet")
    return JudgedProblem(
        mesh=mesh,
        hypothesis=hypothesis,
        thickness=1.0 if deck is None else deck.thickness,
        materials=materials,
        prescribed=prescribed,
        loads=loads,
        contacts=contacts,
        element="" if deck is None else _element(deck),
        hard=0.0 if deck is None else HARD_OF_CALCULIX,
        printed_share=1.0 if deck is None else deck.printed_share * (2 * np.pi if revolved else 1.0),
        several_steps=statement.several_steps,
        time=None if deck is None else deck.ends.get(len(deck.steps) - 1, float(max(1, len(deck.steps)))),
        statement=statement,
        solve=solve,
        deck=deck,
        lost=lost,
        links=no_links,
        bonds=no_links,
        begun=None if deck is None else deck.ends.get(len(deck.steps) - 2),
        strains=strains,
        springs=springs,
        other_readings=lambda: _other_readings(stated, strains, revolved=revolved, loads=deck is None),
        prescribed_before=prescribed_of(statement, position - 1, mesh)[0] if position > 0 else None,
    ), reasons


def _other_readings(
    stated: tuple[Any, float, JudgedMesh, tuple[JudgedMaterial, ...]],
    strains: tuple[JudgedStrain, ...],
    *,
    revolved: bool,
    loads: bool,
) -> dict[str, dict[str, Any]]:
    """See ``JudgedProblem.other_readings``; ``stated`` is as for ``loads_of``.

    Args:
        stated: statement, position, mesh and materials.
        strains: initial strains as they are stated.
        revolved: whether the mesh is a section of a body of revolution.
        loads: whether loads may be integrated otherwise.
    """
    integrated = loads_by_degree(*stated, revolved=revolved) if loads else {}
    return {words: {"loads": forces} for words, forces in integrated.items()} | {
        words: {"strains": read} for words, read in strains_by_reading(stated[2].element, strains).items()
    }


def _element(deck: Deck) -> str:
    """How most of its elements are called."""
    counts: dict[str, int] = {}
    rigid = deck.mesh.dim
    for block in deck.model.blocks:
        if block.keyword == "ELEMENT" and re.match(r"C3D|CPE|CPS|CAX|[SM]\d", kind := block.parameters["TYPE"].upper()):
            counts[kind] = counts.get(kind, 0) + len(block.rows)
    return max(counts, key=lambda kind: counts[kind]) if counts and rigid else ""


def _materials(statement: Any, mesh: JudgedMesh) -> tuple[tuple[JudgedMaterial, ...], list[str]]:
    everything = np.arange(len(mesh.cells))
    reasons = []
    materials = []
    owner = np.full(len(mesh.cells), -1)
    for number, entry in enumerate(statement.material):
        owner[everything if entry.region is None else mesh.regions[entry.region]] = number
    for number, entry in enumerate(statement.material):
        name = "" if entry.region is None else str(entry.region)
        if not entry.linear:
            reasons.append(f"the material {name or 'of the body'} is not linear, which is not judged yet")
            continue
        cells = np.flatnonzero(owner == number)
        stiffness = _stiffness(entry, mesh, cells)
        if not entry.varies:
            stiffness = stiffness[0]
        materials.append(JudgedMaterial(name, cells, stiffness, entry.natural_modulus, entry.density, entry.expansion))
    return tuple(materials), reasons


def _stiffness(entry: Any, mesh: JudgedMesh, cells: Ints) -> Floats:
    """Of a material in cells, in the middle of the corners of each if it varies, else of any one, shape (m, 6, 6)."""
    cells = cells if entry.varies else np.zeros(1, dtype=np.int64)
    middles = in_space(mesh.points[mesh.cells[cells, : mesh.element.corner_count]].mean(axis=1))
    share = np.ones(len(cells)) if entry.grading is None else sample(entry.grading, middles)
    if not entry.isotropic:
        return np.array([share[row] * turned(entry, axes) for row, axes in enumerate(entry.axes(middles))])
    of_poisson = np.ones(len(cells)) if entry.poisson_grading is None else sample(entry.poisson_grading, middles)
    return isotropic_stiffness(entry.young * share, entry.poisson * of_poisson)


def isotropic_stiffness(young: float | Floats, poisson: float | Floats) -> Floats:
    """Stresses from strains, xx, yy, zz, xy, xz, yz, of shear twice the tensor's, stress, shape (..., 6, 6)."""
    shear = np.asarray(young / (2 * (1 + poisson)))
    dilatation = np.asarray(young * poisson / ((1 + poisson) * (1 - 2 * poisson)))
    stiffness = shear[..., None, None] * np.diag([2.0, 2.0, 2.0, 1.0, 1.0, 1.0])
    stiffness[..., :3, :3] += dilatation[..., None, None]
    return stiffness


def turned(material: Any, axes: Floats) -> Floats:
    """The stiffness of a material along the axes of the mesh; ``axes`` has its own as columns, shape (3, 3)."""
    first = np.array([pair[0] for pair in PAIRS])
    second = np.array([pair[1] for pair in PAIRS])
    twice = np.where(first == second, 1.0, 2.0)
    # Strains along its axes from those along the axes of the mesh, both of shear twice the tensor's.
    change = np.empty((6, 6))
    for row, (i, j) in enumerate(PAIRS):
        for column, (k, m) in enumerate(PAIRS):
            mean = (axes[k, i] * axes[m, j] + axes[m, i] * axes[k, j]) / 2
            change[row, column] = twice[row] * mean
    return np.asarray(change.T @ material.stiffness @ change)


def _contact(entry: Any, mesh: JudgedMesh, deck: Deck | None) -> JudgedContact:
    facets = mesh.boundaries[entry.boundary]
    opposite = mesh.boundaries[entry.against] if entry.against else facets[:0]
    nodal, law = False, law_of_scene(entry)
    stiffness, stick = (None if law is None else law.stiffness), None
    if deck is not None:
        for names, interaction, block in _interactions(deck):
            if entry.boundary in names:
                stated = deck.interactions.get(interaction)
                stiffness, stick = (None, None) if stated is None else (stated.stiffness, stated.sticking)
                kind = block.parameters.get("TYPE", "NODE TO SURFACE").upper()
                nodal = kind.replace(" ", "").startswith("NODE")
                law = law_of_deck(deck, interaction, nodal=nodal)
    sides = entry.boundary, entry.against or "", facets, opposite
    return JudgedContact(*sides, entry, entry.bonded, stiffness, stick, nodal, law)


def _interactions(deck: Deck) -> list[tuple[tuple[str | None, str | None], str, DeckBlock]]:
    """The boundaries of each pair of a deck, its interaction and its keyword."""
    return [
        ((deck.boundary(pair.slave), deck.boundary(pair.master)), pair.interaction, pair.block)
        for pair in deck.pairs
        if pair.interaction
    ]


def rigid_planes(problem: JudgedProblem) -> Mapping[str, tuple[Floats, Floats]]:
    """Of contacts with a body that is held everywhere, and whose surface is flat, a point and the outward normal of it,
    by the name of the contact.
    """
    planes = {}
    for contact in problem.contacts:
        nodes = np.unique(contact.opposite)
        if not nodes.size or not np.isin(problem.mesh.bodies[nodes], problem.rigid_bodies).all():
            continue
        normals = facet_points(problem.mesh, contact.opposite, 2, revolved=False).normal.reshape(-1, problem.mesh.dim)
        normal = normals.mean(axis=0)
        flat = (np.abs(normals - normal) <= SAME_LENGTH).all()
        points: Floats = problem.mesh.points[nodes]
        if flat and (np.abs((points - points[0]) @ normal) <= SAME_LENGTH * problem.mesh.size).all():
            planes[contact.name] = (points[0], normal)
    return planes
