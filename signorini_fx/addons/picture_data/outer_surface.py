"""The outer surface of a body in 3D with its result on one rank, for a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh

from signorini_fx.addons.picture_data import sampling
from signorini_fx.addons.pictures.body import DrawnBody, Volume
from signorini_fx.addons.pictures.tiling import tiling
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import SAME_POSITION

Floats = npt.NDArray[np.float64]
# Corners of a cell as basix numbers them, in the order of VTK.
_ORDER_OF_VTK = {"tetrahedron": [0, 1, 2, 3], "hexahedron": [0, 1, 3, 2, 4, 5, 7, 6]}


def outer_facets(solution: Solution) -> int:
    """How many facets the outer surface has; collective."""
    mesh = solution.model.tagged.mesh
    mesh.topology.create_connectivity(2, 3)
    local_count = dmesh.exterior_facet_indices(mesh.topology).size
    return int(parallel.global_sum(solution.comm, np.array(local_count)))


def gather_outer_surface(solution: Solution, fields: Sequence[str] = (), *, recovered: bool = False) -> DrawnBody:
    """The outer surface of all ranks, on the first one, and an empty one on the others; collective.

    Args:
        solution: where from.
        fields: names of the fields to compute; without recovery beside von Mises stress and shear energy density.
        recovered: values at points of the facets instead of one value per facet, if there is a solution.
    """
    comm, mesh = solution.comm, solution.model.tagged.mesh
    mesh.topology.create_connectivity(2, 3)
    entities = facet_entities(mesh, dmesh.exterior_facet_indices(mesh.topology))
    cells = entities[:, 0]
    kind = getattr(basix.CellType, mesh.topology.cell_name())
    corners, sides = basix.geometry(kind), basix.topology(kind)[2]
    tiles = tiling(len(sides[0]), sampling.pieces(solution, outer_facets(solution)))
    order = sampling.PERIMETER[tiles.corners]
    places = [tiles.within(*corners[[vertices[order[k]] for k in (0, 1, -1)]]) for vertices in sides]
    functions = sampling.recovered_fields(solution, fields) if recovered else None

    def within(values: Callable[[Floats, npt.NDArray[np.int32]], Floats]) -> Floats:
        """Values at the points of each facet, which is a side of its cell."""
        sampled: Floats | None = None
        for side, points in enumerate(places):
            on_side = entities[:, 1] == side
            rows = values(points, cells[on_side])
            sampled = np.zeros((len(cells), *rows.shape[1:])) if sampled is None else sampled
            sampled[on_side] = rows
        assert sampled is not None
        return sampled

    x, u = within(partial(sampling.positions, solution)), within(partial(sampling.values_at, solution.displacement))
    middle = sampling.positions(solution, corners.mean(axis=0)[None], cells)[:, 0]
    a, b, c = (x[:, k] for k in tiles.vertices[:3])
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), x.mean(axis=1) - middle) < 0
    if functions is None:
        values = sampling.cell_values(solution, cells, fields)
    else:
        values = {name: within(partial(sampling.values_within, name, function)) for name, function in functions.items()}
    for rows in (x, u, *(values.values() if functions is not None else ())):
        rows[inwards] = rows[inwards][:, tiles.mirrored]

    of_piece = _repeated(solution.model.motions.pieces.of_cell[cells], x)
    gathered = parallel.rows_on_root(comm, np.concatenate((x, u, of_piece), axis=2).reshape(-1, 7))
    size = float(np.ptp(gathered[:, :3], axis=0).max()) if len(gathered) else 1.0
    # Bodies that touch have points of their own.
    grid = np.round(np.column_stack((gathered[:, :3] / (SAME_POSITION * size), gathered[:, 6]))).astype(np.int64)
    _, first, number = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    return DrawnBody(
        gathered[first, :3],
        number.reshape(-1, len(tiles.points)).astype(np.int64),
        tiles,
        gathered[first, 3:6],
        {name: parallel.rows_on_root(comm, rows) for name, rows in values.items()},
        functions is not None,
        pieces=gathered[first, 6].astype(np.int64),
    )


def _repeated(pieces: npt.NDArray[np.int64], points: Floats) -> Floats:
    """The piece of each cell at its points of shape (cells, points, d), shape (cells, points, 1)."""
    return np.broadcast_to(pieces[:, None, None], (*points.shape[:2], 1)).astype(np.float64)


def gather_volume(solution: Solution) -> Volume | None:
    """The cells of all ranks with the recovered von Mises stress, on the first one; None without one; collective."""
    comm, mesh = solution.comm, solution.model.tagged.mesh
    functions = sampling.recovered_fields(solution, ["von_mises"])
    if functions is None:
        return None
    cells = np.arange(mesh.topology.index_map(3).size_local, dtype=np.int32)
    corners = basix.geometry(getattr(basix.CellType, mesh.topology.cell_name()))[
        _ORDER_OF_VTK[mesh.topology.cell_name()]
    ]
    x = sampling.positions(solution, corners, cells)
    u = sampling.values_at(solution.displacement, corners, cells)
    values = sampling.values_within("von_mises", functions["von_mises"], corners, cells)
    of_piece = _repeated(solution.model.motions.pieces.of_cell[cells], x)
    rows = parallel.rows_on_root(comm, np.concatenate((x, u, values[..., None], of_piece), axis=2).reshape(-1, 8))
    size, top = (float(np.ptp(part, axis=0).max()) or 1.0 if len(rows) else 1.0 for part in (rows[:, :3], rows[:, 6:7]))
    places = np.column_stack((rows[:, :3] / size, rows[:, 6] / top)) / SAME_POSITION
    grid = np.round(np.column_stack((places, rows[:, 7]))).astype(np.int64)
    _, first, number = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    number = number.reshape(-1, len(corners)).astype(np.int64)
    return Volume(rows[first, :3], rows[first, 3:6], rows[first, 6], number)
