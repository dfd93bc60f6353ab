"""The cells of a body in 2D with its result on one rank, for a picture."""

from __future__ import annotations

from collections.abc import Sequence

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh

from signorini_fx.addons.picture_data import sampling
from signorini_fx.addons.pictures.body import DrawnBody
from signorini_fx.addons.pictures.tiling import tiling
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.results.solution import Solution

Floats = npt.NDArray[np.float64]


def gather_cells(solution: Solution, fields: Sequence[str] = (), *, recovered: bool = False) -> DrawnBody:
    """Cells and their values from all ranks, on the first one; collective.

    Args:
        solution: where from.
        fields: names of the fields to compute; without recovery beside von Mises stress and shear energy density.
        recovered: values at points of the cells instead of one value per cell, if there is a solution.
    """
    mesh, comm = solution.model.tagged.mesh, solution.comm
    cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    kind = getattr(basix.CellType, mesh.topology.cell_name())
    corners = basix.geometry(kind)
    order = sampling.PERIMETER[len(corners)]
    tiles = tiling(len(corners), sampling.pieces(solution))
    inside = tiles.within(*corners[[order[0], order[1], order[-1]]])
    x = sampling.positions(solution, inside, cells).reshape(-1, 2)
    u = sampling.values_at(solution.displacement, inside, cells)
    u = u.reshape(-1, u.shape[-1])[:, :2]

    mesh.topology.create_connectivity(1, 2)
    entities = facet_entities(mesh, dmesh.exterior_facet_indices(mesh.topology))
    starts = _first_points(kind, order, tiles.count)[entities[:, 1]]
    ahead = (starts[:, None] + np.arange(tiles.count + 1)) % tiles.rim + len(inside) * entities[:, :1].astype(np.int64)
    outline = np.stack((ahead[:, :-1], ahead[:, 1:]), axis=-1).reshape(-1, 2)

    outline = outline + parallel.rows_before(comm, len(x))
    functions = sampling.recovered_fields(solution, fields) if recovered else None
    if functions is None:
        local_values = sampling.cell_values(solution, cells, fields)
    else:
        local_values = {
            name: sampling.values_within(name, function, inside, cells) for name, function in functions.items()
        }
    values = {name: parallel.rows_on_root(comm, rows) for name, rows in local_values.items()}
    points = parallel.rows_on_root(comm, x)
    numbers = np.arange(len(points), dtype=np.int64).reshape(-1, len(inside))
    return DrawnBody(
        points,
        numbers,
        tiles,
        parallel.rows_on_root(comm, u),
        values,
        functions is not None,
        parallel.rows_on_root(comm, outline),
    )


def _first_points(kind: basix.CellType, order: Sequence[int], count: int) -> npt.NDArray[np.int64]:
    """For each facet of the reference cell the point of the perimeter at which it begins."""
    sides = [{order[k], order[(k + 1) % len(order)]} for k in range(len(order))]
    return np.array([count * sides.index(set(facet)) for facet in basix.topology(kind)[1]], dtype=np.int64)
