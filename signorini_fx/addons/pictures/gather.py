"""The body of a solution as arrays for its picture, gathered from all ranks on the first one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import basix
import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh

from signorini_fx.addons.pictures.body import DrawnBody, normals_of, tiling
from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.arrays import Array, Indices, Ints, inner
from signorini_fx.machine import compat, parallel, terminal
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.mechanics.mesh.tagged import outer_facets
from signorini_fx.results.fields import computed_fields
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import ROOT_OF_EPS

if TYPE_CHECKING:
    from basix.finite_element import FiniteElement

# Of reference points in cells of this rank, shape (cells, points, ...).
Values = Callable[[Array, Indices], Array]
# Corners of a triangle and of a quadrilateral as basix numbers them, in order along the perimeter.
_PERIMETER = {3: [0, 1, 2], 4: [0, 1, 3, 2]}
# Straight pieces that stand for a side that may be curved; and of a whole picture, to the square.
_PIECES = 4
_MOST_POINTS = 100_000
MOST_FACETS = 40_000  # of a body in 3D: a picture takes seconds, and a page megabytes


def gather_body(solution: Solution, fields: Sequence[str] = ()) -> DrawnBody | None:
    """Return the cells of a body in 2D, or the outer facets of a body in 3D, of all ranks;
    collective.

    The first rank gets them, the others an empty body.  Returns None if the body is too large to be
    drawn.

    Args:
        solution: the solution.
        fields: names in ``FIELDS``.
    """
    mesh = solution.model.tagged.mesh
    comm = solution.comm
    dim = mesh.topology.dim
    outer = facet_entities(mesh, outer_facets(mesh))
    cells, place = outer.T
    if dim == 2:
        cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
        place = np.zeros_like(cells)
    count = int(parallel.total(comm, len(cells)))
    if dim == 3 and count > MOST_FACETS:
        where = f"its surface has {count} facets, more than {MOST_FACETS}: see it in ParaView"
        terminal.say_once(comm, f"the deformed body is not drawn: {where}")
        return None
    kind = getattr(basix.CellType, mesh.topology.cell_name())
    # of a cell in 2D: itself
    corners = basix.geometry(kind)
    sides = basix.topology(kind)[2]
    tiles = tiling(len(sides[0]), _pieces(solution, count))
    order = _PERIMETER[tiles.corners]
    # Of each side of the reference cell, then of each one in the other direction.
    ways = [
        [vertices[order[k]] for k in way] for way in ((0, 1, -1), (0, -1, 1)) for vertices in sides
    ]
    points = [tiles.within(*corners[way]) for way in ways]

    def at(values: Values) -> Array:
        """Return values at the points of each cell or facet."""
        found = [values(where, cells[place == k]) for k, where in enumerate(points)]
        sampled = np.zeros((len(cells), *found[0].shape[1:]))
        for k, rows in enumerate(found):
            sampled[place == k] = rows
        return sampled

    positions = partial(_positions, mesh)
    if dim == 3:  # counterclockwise as seen from outside
        x = at(positions)
        middle = positions(corners.mean(axis=0)[None], cells)[:, 0]
        inwards = inner(normals_of(x[:, tiles.vertices]), x.mean(axis=1) - middle) < 0
        place = place + len(sides) * inwards
    columns = np.concatenate(
        (at(positions), at(partial(_values_at, solution.displacement))[..., :dim]), axis=2
    )
    outline = None
    if dim == 3:
        rows, within = _joined(solution, columns, cells)
    else:
        rows = parallel.rows_on_root(comm, columns.reshape(-1, 4))
        within = np.arange(len(rows), dtype=np.int64).reshape(-1, columns.shape[1])
        # Of each side of the reference cell the point of the perimeter at which it begins.
        edges = [{order[k], order[(k + 1) % len(order)]} for k in range(len(order))]
        first = np.array(
            [tiles.count * edges.index(set(facet)) for facet in basix.topology(kind)[1]],
            dtype=np.int64,
        )
        along = first[outer[:, 1]][:, None] + np.arange(tiles.count + 1)
        ahead = along % tiles.rim + columns.shape[1] * outer[:, :1].astype(np.int64)
        ahead += parallel.rows_before(comm, columns.shape[0] * columns.shape[1])
        outline = parallel.rows_on_root(
            comm, np.stack((ahead[:, :-1], ahead[:, 1:]), axis=-1).reshape(-1, 2)
        )
    functions, recovered = _fields(solution, fields)
    values = {
        name: parallel.rows_on_root(comm, at(function)) for name, function in functions.items()
    }
    return DrawnBody(
        rows[:, :dim], within, tiles, rows[:, dim : 2 * dim], values, recovered, outline
    )


def _joined(solution: Solution, columns: Array, cells: Indices) -> tuple[Array, Ints]:
    """Return the points of all ranks with displacements, each once, and the rows of each facet;
    bodies that touch share no points; collective.
    """
    pieces = np.broadcast_to(
        solution.model.motions.pieces.of_cell[cells][:, None, None], (*columns.shape[:2], 1)
    )
    rows = parallel.rows_on_root(
        solution.comm, np.concatenate((columns, pieces), axis=2).reshape(-1, 7)
    )
    size = float(np.ptp(rows[:, :3], axis=0).max()) or 1.0 if len(rows) else 1.0
    grid = np.round(np.column_stack((rows[:, :3] / size / ROOT_OF_EPS, rows[:, 6]))).astype(
        np.int64
    )
    _, first, number = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    return rows[first], number.reshape(-1, columns.shape[1]).astype(np.int64)


def _pieces(solution: Solution, polygons: int) -> int:
    """Return how many straight pieces are drawn for the side of a deformed cell: 1 if sides stay
    straight, or if there are very many cells.
    """
    model = solution.model
    curved = (
        compat.geometry_degree(model.tagged.mesh) > 1
        or model.space.element.basix_element.degree > 1
    )
    return max(1, min(_PIECES, math.isqrt(_MOST_POINTS // max(polygons, 1)))) if curved else 1


def _positions(mesh: dmesh.Mesh, points: Array, cells: Indices) -> Array:
    basis = _basis(compat.geometry_element(mesh), points)
    nodes = compat.geometry_cells(mesh)[cells]
    return np.einsum("pk,ckx->cpx", basis, mesh.geometry.x[nodes][..., : mesh.topology.dim])


def _values_at(function: fem.Function, points: Array, cells: Indices) -> Array:
    """Return the values of a function at reference points in cells of this rank, shape (cells,
    points, components).
    """
    space = function.function_space
    basis = _basis(space.element.basix_element, points)
    nodal = function.x.array.reshape(-1, space.dofmap.bs)[space.dofmap.list[cells]]
    return np.einsum("pk,ckx->cpx", basis, nodal)


def _basis(element: FiniteElement, points: Array) -> Array:
    return np.asarray(element.tabulate(0, np.ascontiguousarray(points))[0]).reshape(
        len(points), element.dim
    )


def _fields(solution: Solution, fields: Sequence[str]) -> tuple[dict[str, Values], bool]:
    """Return fields by name, and whether stresses are recovered; collective.

    They are not recovered for nonlinear materials, nor if the displacement is not finite.
    """
    known = solution.known_stress
    finite = not parallel.any_rank(
        solution.comm, not np.isfinite(solution.displacement.x.array).all()
    )
    recovered = known is not None and known.recovers and finite
    computed = computed_fields(solution)
    functions = {
        name: computed.get(name, solution.displacement) for name in fields if not FIELDS[name].of
    }
    if known is not None:
        stress = known.recovered if recovered else known
        functions |= {name: getattr(stress, FIELDS[name].of) for name in fields if FIELDS[name].of}
    return {
        name: partial(_field_at, name, function) for name, function in functions.items()
    }, recovered


def _field_at(name: str, function: fem.Function, points: Array, cells: Indices) -> Array:
    """Return a field at reference points of cells, shape (cells, points)."""
    values = _values_at(function, points, cells)
    if name == "displacement":
        return np.linalg.norm(values, axis=2)
    if name == "pressure":
        return -values[..., [0, 4, 8]].sum(axis=2) / 3
    return values[..., 2 if name == "around" else 0]
