"""Our solution of the problem that a result is judged against, on its mesh and on ones with halved sides.

A second body all of whose nodes are held, and whose surface is flat, is a rigid foundation: programs that have none
mesh one.  Without it a single body is left, whose error has a guaranteed bound.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np
from dolfinx import fem
from dolfinx.io.utils import cell_perm_vtk
from scipy.spatial import cKDTree

from signorini_fx.addons.decks.tagged_arrays import tagged
from signorini_fx.addons.judging.problem_data import JudgedProblem
from signorini_fx.addons.judging.problems import rigid_planes
from signorini_fx.machine import compat
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, plain
from signorini_fx.mechanics.mesh.files.cells import completed
from signorini_fx.mechanics.mesh.files.shape import Floats, is_straight
from signorini_fx.mechanics.mesh.halving import halved
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import SAME_LENGTH

# Nodes of a quadrilateral of degree 2 that are those of the triangles on either side of its diagonal.
HALVES = ((0, 1, 2, 4, 5, 8), (0, 2, 3, 8, 6, 7))


@dataclass(frozen=True)
class CarriedMesh:
    """A mesh of one body with displacements at its nodes.

    Attributes:
        arrays: the mesh.
        displacements: length, one after the other, shape (n, k d).
    """

    arrays: MeshArrays
    displacements: Floats

    def finer(self) -> CarriedMesh:
        """With all sides halved: displacements stay the same functions."""
        dim = self.arrays.dim
        # What is done to positions, which the shape functions of the cells interpolate, is done to displacements, too.
        finer = [
            halved(replace(self.arrays, points=self.displacements[:, first : first + dim])).points
            for first in range(0, self.displacements.shape[1], dim)
        ]
        return CarriedMesh(halved(self.arrays), np.hstack(finer))

    def on_triangles(self) -> CarriedMesh:
        """Of parallelograms of degree 2 the triangles of degree 2 on either side of a diagonal, with the same nodes.

        Displacements are interpolated on them, which changes those that have terms of degree 3 or more.

        Raises:
            Refused: a cell is no parallelogram.
        """
        arrays = self.arrays
        x = arrays.points[arrays.corners]
        away = np.abs(x[:, 0] + x[:, 2] - x[:, 1] - x[:, 3]).max()
        if away > SAME_LENGTH * float(np.ptp(arrays.points, axis=0).max()):
            raise Refused("a guaranteed bound is for quadrilaterals that are parallelograms")
        cells = arrays.cells[:, np.array(HALVES)].reshape(-1, 6)
        regions = {name: np.sort(np.concatenate((2 * rows, 2 * rows + 1))) for name, rows in arrays.regions.items()}
        return CarriedMesh(replace(arrays, kind="triangle6", cells=cells, regions=regions), self.displacements)

    def with_displacement(self, u: Floats) -> CarriedMesh:
        """The same with another displacement, shape (n, d), after the others."""
        return CarriedMesh(self.arrays, np.hstack((self.displacements, u)))


@dataclass(frozen=True)
class OneBody:
    """A problem with rigid foundations alone.

    Attributes:
        mesh: without bodies that are held everywhere; its displacement is the one that is judged.
        solve: solves it, its contact as hard as ours can be, with further entries, such as ``mesh``.
    """

    mesh: CarriedMesh
    solve: Callable[..., Solution]


def one_body(problem: JudgedProblem, v: Floats) -> OneBody:
    """The problem without bodies that are held everywhere.

    Raises:
        Refused: some contact is between two bodies, or with a surface that is not flat.
    """
    deck, statement = problem.deck, problem.statement
    if deck is None:
        raise Refused("an input file is needed, whose mesh can be divided")
    if problem.links.shape[0]:
        raise Refused("a guaranteed bound is for bodies without ties and equations so far")
    planes = rigid_planes(problem)
    contacts = []
    for contact in problem.contacts:
        entry = contact.entry
        if contact.bonded or (entry.against and (contact.name not in planes or entry.adjust is not None)):
            raise Refused("a guaranteed bound is for contact with a flat rigid foundation so far")
        contacts.append(_with_plane(entry, *planes[contact.name]) if entry.against else entry)
    arrays: MeshArrays = deck.mesh
    values = _completed(problem, v)
    deformable = problem.deformable
    cells = np.flatnonzero(deformable[arrays.cells[:, 0]])
    carried = _part(CarriedMesh(arrays, values), cells)
    named = {name for name, rows in carried.arrays.boundaries.items() if rows.size}
    changed: dict[str, Any] = {"contact": tuple(contacts)}
    for key, entries in statement.effects.items():
        if key in ("contact", "body_force"):
            continue
        acting = tuple(entry for entry in entries if _acts_on(entry, named, carried, problem))
        if len(acting) < len(entries):
            changed[key] = acting
    solver = statement.solver.model_copy(update={"gamma_n": "auto", "gamma_t": "auto"})
    if statement.element.degree == 2 and not is_straight(
        carried.arrays.points, carried.arrays.cells, carried.arrays.cell
    ):
        raise Refused("a guaranteed bound is for straight cells so far")
    changed |= {"solver": solver, "mesh": tagged(carried.arrays)}
    return OneBody(carried, lambda **further: problem.solve(**changed | further))


def _acts_on(entry: Any, named: set[str], carried: CarriedMesh, problem: JudgedProblem) -> bool:
    """Whether an entry of a scene is about the body that is left."""
    if (region := getattr(entry, "region", None)) is not None:
        return bool(carried.arrays.regions.get(region, np.empty(0)).size)
    if getattr(entry, "boundary", None) is not None:
        return entry.boundary in named
    if (at := getattr(entry, "at", None)) is not None:
        away = np.linalg.norm(carried.arrays.points - np.array(at), axis=1)
        return float(away.min()) <= SAME_LENGTH * problem.mesh.size
    return True


def _with_plane(entry: Any, point: Floats, normal: Floats) -> Any:
    """A contact with a plane instead of the body that has it."""
    terms = "".join(f" + {float(share)!r}*x[{axis}]" for axis, share in enumerate(normal) if share)
    gap = Expression(f"{-float(point @ normal)!r}{terms}")
    fields = {key: getattr(entry, key) for key in entry.model_fields_set if key not in ("against", "gap", "points")}
    return type(entry)(**fields | {"gap": gap, "direction": tuple(plain(-normal + 0.0))})


def _completed(problem: JudgedProblem, v: Floats) -> Floats:
    """A displacement also at the nodes that complete the cells of the file, shape (n, d)."""
    arrays: MeshArrays = problem.deck.mesh
    values = np.zeros(arrays.points.shape)
    values[: len(v)] = v
    width = problem.mesh.cells.shape[1]
    if arrays.cells.shape[1] > width:
        full_cell = completed(problem.mesh.kind)
        assert full_cell is not None
        values[arrays.cells] = np.einsum("qk,mkd->mqd", full_cell[1], v[problem.mesh.cells])
    return values


def _part(mesh: CarriedMesh, cells: Any) -> CarriedMesh:
    """Some cells of a mesh."""
    arrays = mesh.arrays
    used = np.unique(arrays.cells[cells])
    number = np.full(len(arrays.points), -1)
    number[used] = np.arange(len(used))
    facets = np.flatnonzero((number[arrays.facets] >= 0).all(axis=1))
    row = np.full(len(arrays.facets), -1)
    row[facets] = np.arange(len(facets))
    of_cell = np.full(len(arrays.cells), -1)
    of_cell[cells] = np.arange(len(cells))

    def renumbered(rows: Mapping[str, Any], numbers: Any) -> dict[str, Any]:
        return {name: kept_rows for name, members in rows.items() if (kept_rows := _held(numbers[members])).size}

    part = MeshArrays(
        arrays.points[used],
        arrays.kind,
        number[arrays.cells[cells]],
        number[arrays.facets[facets]],
        renumbered(arrays.boundaries, row),
        renumbered(arrays.regions, of_cell),
    )
    return CarriedMesh(part, mesh.displacements[used])


def _held(rows: Any) -> Any:
    return np.sort(rows[rows >= 0])


def solved(solve: Callable[..., Solution], **entries: Any) -> Solution:
    """The solution of a problem with other entries.

    Raises:
        Refused: there is none.
    """
    solution = solve(**entries)
    if not solution.converged:
        raise Refused(f"our own solve of it ended as {solution.status.value}")
    return solution


def as_functions(solution: Solution, mesh: CarriedMesh) -> list[fem.Function]:
    """The displacements of a mesh in the space of a solution on it."""
    space = solution.displacement.function_space
    dim = mesh.arrays.dim
    away, rows = cKDTree(mesh.arrays.points).query(space.tabulate_dof_coordinates()[:, :dim])
    if away.max() > SAME_LENGTH * float(np.ptp(mesh.arrays.points, axis=0).max()):
        raise Refused("nodes of the mesh are not those of its elements")
    functions = []
    for first in range(0, mesh.displacements.shape[1], dim):
        function = fem.Function(space)
        function.x.array[:] = mesh.displacements[rows, first : first + dim].ravel()
        functions.append(function)
    return functions


def at_points(solution: Solution, points: Floats) -> Floats:
    """The displacement of a solution at nodes of its space, length, shape (n, d)."""
    space = solution.displacement.function_space
    dim = points.shape[1]
    _, rows = cKDTree(space.tabulate_dof_coordinates()[:, :dim]).query(points)
    return np.asarray(solution.displacement.x.array.reshape(-1, dim)[rows], dtype=np.float64)


def at_nodes_of(solution: Solution, problem: JudgedProblem) -> Floats:
    """The displacement of a solution on the mesh of a problem at its nodes, length, shape (n, d)."""
    space = solution.displacement.function_space
    mesh = space.mesh
    of_mesh, of_space = compat.geometry_cells(mesh), space.dofmap.list
    if problem.deck is None and of_space.shape == problem.mesh.cells.shape:
        order = np.argsort(cell_perm_vtk(mesh.topology.cell_type, of_space.shape[1]))
        of_space, numbers = of_space[:, order], np.ravel(problem.mesh.cells)
    elif of_mesh.shape == of_space.shape:
        numbers = np.ravel(np.asarray(mesh.geometry.input_global_indices)[of_mesh])
    else:
        raise Refused("the elements of our solution have other nodes than the mesh")
    dim = problem.mesh.dim
    values = np.zeros((int(numbers.max()) + 1, dim))
    values[numbers] = solution.displacement.x.array.reshape(-1, dim)[of_space.ravel()]
    return values[: len(problem.mesh.points)]
