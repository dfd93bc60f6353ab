"""The body of a solution as arrays for its picture, from all ranks on the first one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import basix
import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx import mesh as dmesh

from signorini_fx.addons.pictures.body import DrawnBody, tiling
from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import ROOT_OF_EPS

Floats = npt.NDArray[np.float64]
Cells = npt.NDArray[np.int32]
# Of reference points in cells of this rank, shape (cells, points, ...).
Values = Callable[[Floats, Cells], Floats]
# Corners of a triangle and of a quadrilateral as basix numbers them, in order along the perimeter.
_PERIMETER = {3: [0, 1, 2], 4: [0, 1, 3, 2]}
# Straight pieces that stand for a side that may be curved; and of a whole picture, to the square.
_PIECES = 4
_MOST_POINTS = 100_000
# Name of a field of the stress -> the function of ``StressFields`` that it follows from.
_OF_STRESS = {"von_mises": "von_mises", "density": "shear_energy_density", "pressure": "tensor"}


def outer_facets(solution: Solution) -> int:
    """How many facets the outer surface of a body in 3D has; collective."""
    mesh = solution.model.tagged.mesh
    mesh.topology.create_connectivity(2, 3)
    return int(parallel.global_sum(solution.comm, np.array(dmesh.exterior_facet_indices(mesh.topology).size)))


def gather_cells(solution: Solution, fields: Sequence[str] = ()) -> DrawnBody:
    """The cells of a body in 2D of all ranks, on the first one; collective; ``fields``: names in ``FIELDS``."""
    mesh, comm = solution.model.tagged.mesh, solution.comm
    cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    kind = getattr(basix.CellType, mesh.topology.cell_name())
    corners = basix.geometry(kind)
    order = _PERIMETER[len(corners)]
    tiles = tiling(len(corners), _pieces(solution))
    inside = tiles.within(*corners[[order[0], order[1], order[-1]]])
    x, u = (values(inside, cells).reshape(-1, 2) for values in (_positions(solution), _displacement(solution, 2)))
    functions, recovered = _fields(solution, fields)

    mesh.topology.create_connectivity(1, 2)
    entities = facet_entities(mesh, dmesh.exterior_facet_indices(mesh.topology))
    # Of each side of the reference cell the point of the perimeter at which it begins.
    sides = [{order[k], order[(k + 1) % len(order)]} for k in range(len(order))]
    first = np.array([tiles.count * sides.index(set(facet)) for facet in basix.topology(kind)[1]], dtype=np.int64)
    along = first[entities[:, 1]][:, None] + np.arange(tiles.count + 1)
    ahead = along % tiles.rim + len(inside) * entities[:, :1].astype(np.int64)
    outline = np.stack((ahead[:, :-1], ahead[:, 1:]), axis=-1).reshape(-1, 2) + parallel.rows_before(comm, len(x))
    points = parallel.rows_on_root(comm, x)
    return DrawnBody(
        points,
        np.arange(len(points), dtype=np.int64).reshape(-1, len(inside)),
        tiles,
        parallel.rows_on_root(comm, u),
        {name: parallel.rows_on_root(comm, values(inside, cells)) for name, values in functions.items()},
        recovered,
        parallel.rows_on_root(comm, outline),
    )


def gather_outer_surface(solution: Solution, fields: Sequence[str] = ()) -> DrawnBody:
    """The outer surface of a body in 3D of all ranks, on the first one, and an empty one on the others; collective."""
    comm, mesh = solution.comm, solution.model.tagged.mesh
    mesh.topology.create_connectivity(2, 3)
    entities = facet_entities(mesh, dmesh.exterior_facet_indices(mesh.topology))
    cells = entities[:, 0]
    kind = getattr(basix.CellType, mesh.topology.cell_name())
    corners, sides = basix.geometry(kind), basix.topology(kind)[2]
    tiles = tiling(len(sides[0]), _pieces(solution, outer_facets(solution)))
    order = _PERIMETER[tiles.corners]
    places = [tiles.within(*corners[[vertices[order[k]] for k in (0, 1, -1)]]) for vertices in sides]

    def within(values: Values) -> Floats:
        """Values at the points of each facet, which is a side of its cell."""
        of_sides = [values(points, cells[entities[:, 1] == side]) for side, points in enumerate(places)]
        sampled = np.zeros((len(cells), *of_sides[0].shape[1:]))
        for side, rows in enumerate(of_sides):
            sampled[entities[:, 1] == side] = rows
        return sampled

    functions, recovered = _fields(solution, fields)
    x, u = within(_positions(solution)), within(_displacement(solution, 3))
    fields_at = {name: within(values) for name, values in functions.items()}
    middle = _positions(solution)(corners.mean(axis=0)[None], cells)[:, 0]
    a, b, c = (x[:, k] for k in tiles.vertices[:3])
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), x.mean(axis=1) - middle) < 0
    for rows in (x, u, *fields_at.values()):
        rows[inwards] = rows[inwards][:, tiles.mirrored]
    gathered, within_points = _joined(solution, x, u, cells)
    return DrawnBody(
        gathered[:, :3],
        within_points,
        tiles,
        gathered[:, 3:6],
        {name: parallel.rows_on_root(comm, rows) for name, rows in fields_at.items()},
        recovered,
    )


def _joined(solution: Solution, x: Floats, u: Floats, cells: Cells) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Points of all ranks with displacements, one row each, and the rows of each facet; bodies that touch have points
    of their own; collective.
    """
    pieces = np.broadcast_to(solution.model.motions.pieces.of_cell[cells][:, None], x.shape[:2])
    columns = np.concatenate((x, u, pieces[..., None]), axis=2)
    rows = parallel.rows_on_root(solution.comm, columns.reshape(-1, columns.shape[2]))
    size = float(np.ptp(rows[:, :3], axis=0).max()) or 1.0 if len(rows) else 1.0
    grid = np.round(np.column_stack((rows[:, :3] / size / ROOT_OF_EPS, rows[:, 6]))).astype(np.int64)
    _, first, number = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    return rows[first], number.reshape(-1, x.shape[1]).astype(np.int64)


def _pieces(solution: Solution, polygons: int = 1) -> int:
    """How many straight pieces a side of a deformed cell is drawn with: 1 if it stays straight, or of very many."""
    model = solution.model
    curved = compat.geometry_degree(model.tagged.mesh) > 1 or model.space.element.basix_element.degree > 1
    return max(1, min(_PIECES, math.isqrt(_MOST_POINTS // max(polygons, 1)))) if curved else 1


def _positions(solution: Solution) -> Values:
    mesh = solution.model.tagged.mesh

    def at(points: Floats, cells: Cells) -> Floats:
        basis = _basis(compat.geometry_element(mesh), points)
        nodes = compat.geometry_cells(mesh)[cells]
        return np.asarray(np.einsum("pk,ckx->cpx", basis, mesh.geometry.x[nodes][..., : mesh.topology.dim]))

    return at


def _displacement(solution: Solution, dimension: int) -> Values:
    return lambda points, cells: _values_at(solution.displacement, points, cells)[..., :dimension]


def _values_at(function: fem.Function, points: Floats, cells: Cells) -> Floats:
    """A function at reference points in cells of this rank, shape (cells, points, components)."""
    space = function.function_space
    basis = _basis(space.element.basix_element, points)
    nodal = function.x.array.reshape(-1, space.dofmap.bs)[space.dofmap.list[cells]]
    return np.asarray(np.einsum("pk,ckx->cpx", basis, nodal))


def _basis(element: Any, points: Floats) -> Floats:
    return np.asarray(element.tabulate(0, np.ascontiguousarray(points))[0]).reshape(len(points), element.dim)


def _fields(solution: Solution, fields: Sequence[str]) -> tuple[dict[str, Values], bool]:
    """Fields by name, and whether stresses are the recovered ones, which jump between materials alone; collective.

    Those of nonlinear materials, and of a solution that is not finite, are raw.
    """
    known = solution.known_stress
    finite = not parallel.any_rank(solution.comm, not np.isfinite(solution.displacement.x.array).all())
    recovered = known is not None and known.recovers and finite
    functions = {name: solution.displacement for name in fields if not FIELDS[name].of_stress}
    if known is not None:
        stress = known.recovered if recovered else known
        functions |= {name: getattr(stress, _OF_STRESS[name]) for name in fields if FIELDS[name].of_stress}
    return {name: partial(_field_at, name, function) for name, function in functions.items()}, recovered


def _field_at(name: str, function: fem.Function, points: Floats, cells: Cells) -> Floats:
    """A field at reference points of cells, shape (cells, points)."""
    values = _values_at(function, points, cells)
    if name == "displacement":
        return np.asarray(np.linalg.norm(values, axis=2))
    if name == "pressure":
        return np.asarray(-values[..., [0, 4, 8]].sum(axis=2) / 3)
    return values[..., 2 if name == "around" else 0]
