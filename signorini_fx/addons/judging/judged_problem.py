"""The problem that a result is judged against, our solution of it, and results of other programs.

The nodes of its mesh have the numbers of the result.

"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import mpi4py.MPI  # noqa: F401
import numpy as np
import scipy.sparse as sp
from dolfinx import fem
from mpi4py import MPI
from scipy.sparse.linalg import lsqr, splu
from scipy.spatial import cKDTree

from signorini_fx.addons.decks.reading import draft
from signorini_fx.addons.decks.results import READERS, ForeignResult
from signorini_fx.arrays import Array, Flags, Ints, inner
from signorini_fx.errors import MeshError
from signorini_fx.machine import compat
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, Numbering, plain
from signorini_fx.mechanics.mesh.halving import halved, quadratic
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, arrays_of, check_fits, from_arrays
from signorini_fx.mechanics.model import sum_of
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.certificate.contact_nodes import PreviousStep, Tractions
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import as_scene, parse_scene_text
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve
from signorini_fx.tuned import DIGITS_OF_FILES, JUDGED_SAME_PLACE

# Elements with all nodes and points.  CalculiX makes solids of plane stress, which are others.
_LIKE_OURS = re.compile(r"(CPE|CAX)[346]|C3D(4|8|10)")


@dataclass(frozen=True)
class JudgedProblem:
    """A scene on a mesh that has all nodes of its elements."""

    scene: Scene
    arrays: MeshArrays
    # the numbers of the nodes that a result has, which are the first ones of the mesh, shape (n,)
    names: Ints
    lost: tuple[str, ...] = ()  # what the scene lacks of its input file
    time: float | None = None  # at the end of the last load step; None: not known
    alike: bool = True  # whether elements like ours have made the result, as far as it is known

    @property
    def unjudged(self) -> str:
        """The features of the problem that cannot be judged, in words; "" without any."""
        scene = self.scene
        element = self.scene.element
        reasons = {
            "materials that are not linear are not judged": scene.statement.nonlinear,
            "elements with a pressure of their own are not judged": element.volumetric == "mixed",
            "elements of degree 1 on cells of degree 2 are not judged: set element.degree = 2": (
                element.degree < self.arrays.degree
            ),
            "displacements out of the section are not "
            "judged": scene.statement.kinematics.out_of_section,
            "sections inside a body, such as those of bolts, are not "
            "judged": scene.statement.sections,
            "rigid bodies that forces move are not judged": any(
                entry.driven is not None for entry in scene.contact
            ),
        }
        return "; ".join(reason for reason, there in reasons.items() if there)

    @property
    def points(self) -> Array:
        """Positions of the nodes of a result, length, shape (n, d)."""
        return self.arrays.points[: len(self.names)]

    @property
    def cells(self) -> Ints:
        """The nodes of a result in each cell, shape (m, k)."""
        cells = self.arrays.cells
        return cells[:, (cells < len(self.names)).all(axis=0)]


def judged_problem(problem: object) -> JudgedProblem:
    """Return the problem of an input file or of a scene, in any form that ``judge`` takes."""
    if isinstance(problem, str | Path) and Path(problem).suffix.lower() == ".inp":
        file = Path(problem)
        drafted = draft(file, file)
        scene = parse_scene_text(drafted.text, file)
        deck = drafted.deck
        alike = all(
            _LIKE_OURS.fullmatch(block.parameters["TYPE"].upper()) is not None
            for block in deck.model.blocks
            if block.keyword == "ELEMENT"
        )
        end = deck.time + deck.period
        return JudgedProblem(scene, deck.mesh, deck.names, tuple(drafted.lost), end, alike)
    scene = as_scene(problem, MPI.COMM_SELF)
    mesh = load_mesh(scene, MPI.COMM_SELF)
    check_fits(scene.statement, mesh)
    arrays = arrays_of(mesh)
    if scene.element.degree > arrays.degree:
        arrays = quadratic(arrays)
    names = np.arange(1, len(arrays.points) + 1)
    contacts = [
        contact.model_copy(update={"contact_size": None}) for contact in scene.contact
    ]  # cells are made
    solver = scene.solver.model_copy(update={"levels": 1})  # it is solved on this mesh and the next
    scene = scene.model_copy(update={"contact": contacts, "solver": solver})
    return JudgedProblem(scene, arrays, names)


# --- our solution ---------------------------------------------------------------------------------


class NotJudgedError(Exception):
    """A result cannot be judged; the message says why."""


@dataclass(frozen=True)
class SolutionOnMesh:
    """Our solution on a mesh.  Displacements are in the order of its nodes, length, shape
    (n, d).
    """

    problem: JudgedProblem
    arrays: MeshArrays
    mesh: TaggedMesh  # the same for the solver
    solution: Solution
    block: Ints  # of each node, the number of its unknowns, shape (n,)

    @classmethod
    def of(cls, problem: JudgedProblem, arrays: MeshArrays) -> SolutionOnMesh:
        """Solve a problem on a mesh given as arrays."""
        mesh = from_arrays(MPI.COMM_SELF, lambda: arrays)
        solution = _solved(problem, mesh)
        space = solution.displacement.function_space
        block = np.empty(len(arrays.points), dtype=np.int64)
        numbers = np.asarray(space.mesh.geometry.input_global_indices)[
            compat.geometry_cells(space.mesh)
        ]
        block[numbers.ravel()] = space.dofmap.list.ravel()
        return cls(problem, arrays, mesh, solution, block)

    def on_finer(self, u: Array) -> Array:
        """Return a displacement interpolated to the nodes of the mesh with all sides halved, shape
        (n, d).
        """
        # What is done to positions, which the shape functions of the cells interpolate, is done to
        # displacements, too.
        return halved(replace(self.arrays, points=u)).points

    def from_finer(self, finer: SolutionOnMesh) -> Array:
        """Return the displacement of a finer mesh at the nodes of this one, shape (n, d)."""
        # A node of both meshes keeps its marks.
        marks = np.random.default_rng(0).random(self.arrays.points.shape)
        return finer.displacement[cKDTree(self.on_finer(marks)).query(marks)[1]]

    def with_entries(self, entries: Mapping[str, Any]) -> Array:
        """Return the displacement that solves the problem with other entries of its scene."""
        return self._at_nodes(_solved(self.problem, self.mesh, **entries).displacement)

    @cached_property
    def displacement(self) -> Array:
        """Our displacement at the end of the last load step."""
        return self._at_nodes(self.solution.displacement)

    @cached_property
    def steps(self) -> list[Array]:
        """Our displacements at the ends of the load steps before the last one."""
        return [self._at_nodes(step.displacement) for step in self.solution.shown_steps[:-1]]

    def _at_nodes(self, u: fem.Function) -> Array:
        return u.x.array.reshape(-1, self.arrays.dim)[self.block]

    @cached_property
    def unknowns(self) -> Ints:
        """The unknowns of the nodes, shape (n, d)."""
        return self.arrays.dim * self.block[:, None] + np.arange(self.arrays.dim)

    @cached_property
    def stiffness(self) -> sp.csr_array:
        """The stiffness of the components of the nodes, force per length, shape (n d, n d)."""
        model = self.solution.model
        matrix = sum_of(model.forms, [])
        if model.beside is not None:
            model.beside.add_to(matrix)
        starts, columns, values = matrix.getValuesCSR()
        of_unknowns = sp.csr_array((values, columns, starts), shape=matrix.getSize())
        order = self.unknowns.ravel()
        return sp.csr_array(of_unknowns[order][:, order])

    def product(self, a: Array, b: Array) -> float:
        """Return the energy product a(a, b) of two displacements."""
        return float(a.ravel() @ (self.stiffness @ b.ravel()))

    def norm(self, u: Array) -> float:
        """Return the energy norm of a displacement."""
        return float(np.sqrt(max(self.product(u, u), 0.0)))

    def round_off(self, half_unit: float) -> float:
        """Return the energy norm of random errors in the last printed digit of a displacement."""
        return half_unit * float(
            np.sqrt(self.stiffness.diagonal()[: self.problem.points.size].sum() / 3)
        )

    def completed(self, v: Array) -> Array:
        """Return a displacement with its nan replaced by the values that minimise its distance to
        ours in the energy norm, shape (n, d).
        """
        v = np.where(self.held & np.isnan(v), self.displacement, v)
        missing = np.isnan(v).ravel()
        if not missing.any():
            return v
        difference = np.where(missing, 0.0, (v - self.displacement).ravel())
        within = sp.csc_array(self.stiffness[missing][:, missing])
        difference[missing] = splu(within).solve(-(self.stiffness @ difference)[missing])
        return np.where(np.isnan(v), self.displacement + difference.reshape(v.shape), v)

    @cached_property
    def held(self) -> Flags:
        """Which components supports prescribe, shape (n, d)."""
        return self.solution.model.fixed.reshape(-1, self.arrays.dim)[self.block]

    @cached_property
    def points_of_contact(self) -> sp.csr_array:
        """The matrix from displacements of the nodes to relative displacements of the contact
        points, shape (points d, n d).
        """
        if self.solution.contact is None:
            return sp.csr_array((0, self.unknowns.size))
        averages = self.solution.contact.boundary.averages
        dim = self.arrays.dim
        columns = (dim * averages.nodes[:, None] + np.arange(dim)).ravel()
        of_unknowns = sp.csr_array(
            averages.operator @ sp.eye_array(self.unknowns.size, format="csr")[columns]
        )
        return of_unknowns[:, self.unknowns.ravel()]

    def tractions(self, v: Array) -> tuple[Tractions | None, Array]:
        """Return the contact tractions of a displacement, None without contact, and the nodal
        forces that they leave unbalanced, shape (n, d).
        """
        left = -(self.stiffness @ (v - self.displacement).ravel())
        state = self.solution.contact
        free = ~self.held.ravel()
        tractions = None
        if state is not None:
            boundary = state.boundary
            ours = Tractions.of(state)
            # What supports take of a point's own node is not told by the forces on the other side.
            own = self.held.ravel()[self.points_of_contact.argmax(axis=1)]
            weight = np.where(own, 0.0, np.repeat(boundary.weight, v.shape[1]))
            spread = sp.csr_array(self.points_of_contact.T @ sp.diags_array(weight))
            change = lsqr(spread[free], left[free], atol=0.0, btol=1e-14)[0]
            left = left - spread @ change
            change = change.reshape(-1, v.shape[1])
            pressure = inner(change, boundary.normal)
            shear = change - pressure[:, None] * boundary.normal
            tractions = replace(ours, pressure=ours.pressure + pressure, shear=ours.shear + shear)
        return tractions, np.where(self.held, 0.0, left.reshape(v.shape))

    def unbalanced(self, left: Array) -> tuple[float, int]:
        """Return how far a displacement is from equilibrium outside contact, in the energy norm,
        and the worst node.

        Args:
            left: unbalanced forces at the nodes, shape (n, d).
        """
        inside = ~self.held.ravel()
        inside[self.points_of_contact.nonzero()[1]] = False
        rows = np.flatnonzero(inside)
        within = self.stiffness[rows][:, rows]
        # Bodies that nothing holds would make it singular.
        shifted = within + sp.diags_array(
            np.full(rows.size, np.finfo(float).eps * abs(within.diagonal()).max())
        )
        correction = splu(sp.csc_array(shifted)).solve(left.ravel()[rows])
        works = np.abs(left.ravel()[rows] * correction)
        return float(np.sqrt(works.sum())), int(np.bincount(rows // left.shape[1], works).argmax())

    def moved_alone(self, v: Array, enough: float) -> list[int]:
        """Return one or two nodes without which a displacement is at most ``enough`` from ours, and
        [] if there are none.
        """
        dim = v.shape[1]
        nodes = list[int]()
        numbers = np.arange(len(v))[:, None]
        own = np.array(
            [[self.stiffness[a::dim, b::dim].diagonal() for b in range(dim)] for a in range(dim)]
        ).T
        while len(nodes) < 2:
            forces = (self.stiffness @ (v - self.displacement).ravel()).reshape(v.shape)
            gained = np.where(
                self.held, 0.0, forces * np.linalg.solve(own, forces[..., None])[..., 0]
            ).sum(axis=1)
            nodes.append(int(gained[: len(self.problem.names)].argmax()))
            v = self.completed(
                np.where(np.isin(numbers, nodes) | (numbers >= len(self.problem.names)), np.nan, v)
            )
            if self.norm(v - self.displacement) <= enough:
                return nodes
        return []

    def certificate(self, v: Array, tractions: Tractions) -> Certificate:
        """Return the certificate of a displacement of the last load step with its tractions."""
        solution = self.solution
        u = fem.Function(self.solution.displacement.function_space)
        u.x.array[self.unknowns] = v
        steps = solution.shown_steps
        law = solution.certificate.law
        last = None
        if len(steps) > 1 and steps[-2].contact is not None:
            begun = Tractions.of(steps[-2].contact)
            elastic = np.asarray(begun.shear / law.gamma_t)
            last = PreviousStep(steps[-2].displacement, begun, elastic)
        return solution.mechanics.certified(
            u, tractions, law=law, step=steps[-1].place, last=last, rigid=()
        )

    def force(self, tractions: Tractions | None = None) -> float:
        """Return the sum of the pressures times areas at the contact points, a force; that of our
        solution without tractions.
        """
        contact = self.solution.contact
        assert contact is not None
        return float(contact.boundary.weight @ (tractions or Tractions.of(contact)).pressure)


def _solved(problem: JudgedProblem, mesh: TaggedMesh, **entries: Any) -> Solution:
    """Return the solution on a mesh with other entries of the scene."""
    scene = problem.scene.remade(mesh=mesh, body=(), accuracy=None, **entries)
    solution = solve(scene, MPI.COMM_SELF, check=False)
    if not solution.converged:
        raise NotJudgedError(f"our own solve of the problem ended as {solution.status.value}")
    return solution


def read_result(result: object, problem: JudgedProblem) -> ForeignResult:
    """Return a result, in any form that ``judge`` takes, at the nodes of a problem."""
    if isinstance(result, str | Path):
        return _read(Path(result), problem)
    nodes, dim = problem.points.shape
    values = np.asarray(result)
    if values.dtype.kind not in "iuf" or values.shape not in ((nodes, dim), (nodes, 3)):
        raise MeshError(
            f"the result: real numbers of shape {(nodes, dim)} are expected, not of {values.shape}"
        )
    return ForeignResult(_finite(values[:, :dim].astype(np.float64)))


def _read(file: Path, problem: JudgedProblem) -> ForeignResult:
    """Return the result of a file; nodes are matched by their numbers, or without numbers by their
    positions.
    """
    kind = file.suffix.lower()
    if kind not in READERS:
        raise MeshError(f"{file}: results are read from {', '.join(READERS)}")
    printed = READERS[kind](file)
    dim = problem.arrays.dim
    positions = printed.points if printed.numbers is None else None
    if any(
        table is not None and table.shape[1] < dim for table in (printed.displacement, positions)
    ):
        raise MeshError(
            f"{file}: displacements and positions with {dim} components are expected, as of the "
            "problem"
        )
    rows = (
        _rows_at(file, printed, problem)
        if printed.numbers is None
        else _rows_of(file, printed, problem)
    )
    displacement = _finite(printed.displacement[rows, :dim])
    displacement[rows < 0] = np.nan
    return replace(
        printed, displacement=displacement, numbers=None, points=None, cells=(), name=file.name
    )


def _finite(values: Array) -> Array:
    """Return values with infinity in place of nan, because nan stands for missing values."""
    return np.where(np.isnan(values), np.inf, values)


def _rows_of(file: Path, table: ForeignResult, problem: JudgedProblem) -> Ints:
    """Return the row of the table for the number of each node, shape (n,), and -1 where it has
    none.
    """
    assert table.numbers is not None
    numbering = Numbering(table.numbers)
    again = numbering.again
    if (
        table.displacement[again] != table.displacement[numbering.rows(table.numbers[again])]
    ).any():
        raise MeshError(f"{file}: a node is there several times, with different displacements")
    rows = numbering.rows(problem.names)
    if table.points is not None:
        dim = min(problem.arrays.dim, table.points.shape[1])
        away = np.linalg.norm(table.points[rows, :dim] - problem.points[:, :dim], axis=1)
        if (wrong := (rows >= 0) & (away > JUDGED_SAME_PLACE * problem.arrays.diagonal)).any():
            node = problem.names[np.argmax(wrong)]
            raise MeshError(
                f"{file}: node {node} is at another place in the problem: it is the result of "
                "another mesh"
            )
    return rows


def _rows_at(file: Path, table: ForeignResult, problem: JudgedProblem) -> Ints:
    """Return the row of the table at the position of each node, shape (n,), and -1 where it has
    none.

    Nodes at one position are distinguished by the middles of their cells.
    """
    near = JUDGED_SAME_PLACE * problem.arrays.diagonal
    if table.points is None:
        raise MeshError(
            f"{file}: has neither numbers nor positions of nodes: give columns node, or x and y"
        )
    x = np.pad(problem.points, ((0, 0), (0, table.points.shape[1] - problem.arrays.dim)))
    nodes: Ints = np.arange(len(x))
    rows: Ints = np.arange(len(table.points))
    points = table.points
    if table.cells and all(cKDTree(places).query_pairs(near) for places in (points, x)):
        nodes, x = _in_cells(x, (problem.cells,))
        rows, points = _in_cells(points, table.cells)
    tree = cKDTree(points)
    away, nearest = tree.query(x)
    alike = DIGITS_OF_FILES * float(np.abs(table.displacement).max())
    for place, at_place in zip(plain(x), tree.query_ball_point(x, near), strict=True):
        if (
            len(at_place) > 1
            and not np.ptp(table.displacement[rows[at_place]], axis=0).max() <= alike
        ):
            cure = "give a table with a column node, the numbers of the problem"
            raise MeshError(
                f"{file}: several points are at {tuple(place[:3])}, with different displacements: "
                f"{cure}"
            )
    row_of_node = np.full(len(problem.points), -1)
    row_of_node[nodes[away <= near]] = rows[nearest[away <= near]]
    return row_of_node


def _in_cells(x: Array, tables: Sequence[Ints]) -> tuple[Ints, Array]:
    """Return the node of each corner of each cell, shape (k,), and its position followed by the
    middle of its cell, length, shape (k, 2 d).
    """
    middles = [np.broadcast_to(x[cells].mean(axis=1)[:, None], x[cells].shape) for cells in tables]
    numbers = np.concatenate([cells.ravel() for cells in tables])
    return numbers, np.hstack(
        (x[numbers], np.concatenate([middle.reshape(-1, x.shape[1]) for middle in middles]))
    )
