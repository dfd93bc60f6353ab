"""The cells of a body in the plane with its result on one rank, for a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh

from signorini_fx import parallel
from signorini_fx.body.assembly import facet_entities
from signorini_fx.results import sampling
from signorini_fx.results.solution import Solution

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GatheredCells:
    """The whole mesh with its result on one rank, for a picture; nothing on the others.

    Attributes:
        points: positions, length, shape (n, 2); each cell has its own.
        cells: points of each cell along its perimeter, shape (m, k): its corners, and more along sides that may be
            curved.
        displacement: at the points, length, shape (n, 2).
        outline: pairs of points along the boundary of the body, shape (e, 2).
        values: fields at the midpoints of the cells, see ``sampling.cell_values``.
    """

    points: Floats
    cells: npt.NDArray[np.int64]
    displacement: Floats
    outline: npt.NDArray[np.int64]
    values: Mapping[str, Floats]


def gather_cells(solution: Solution, fields: Sequence[str] = ()) -> GatheredCells:
    """Cells and their values from all ranks, on the first one; collective.

    Args:
        solution: where from.
        fields: names of the fields to compute beside von Mises stress and shear energy density.
    """
    mesh, comm = solution.discretisation.tagged.mesh, solution.comm
    cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    kind = getattr(basix.CellType, mesh.topology.cell_name())
    order = sampling.PERIMETER[len(basix.geometry(kind))]
    count = sampling.pieces(solution)
    around = sampling.perimeter(basix.geometry(kind)[order], count)
    x = sampling.positions(solution, around, cells).reshape(-1, 2)
    u = sampling.values_at(solution.displacement, around, cells).reshape(-1, 2)

    mesh.topology.create_connectivity(1, 2)
    entities = facet_entities(mesh, dmesh.exterior_facet_indices(mesh.topology))
    starts = _first_points(kind, order, count)[entities[:, 1]]
    ahead = starts[:, None] + np.arange(count + 1)
    ahead = ahead % len(around) + len(around) * entities[:, :1].astype(np.int64)
    outline = np.stack((ahead[:, :-1], ahead[:, 1:]), axis=-1).reshape(-1, 2)

    outline = outline + parallel.rows_before(comm, len(x))
    values = {
        name: parallel.rows_on_root(comm, rows) for name, rows in sampling.cell_values(solution, cells, fields).items()
    }
    points = parallel.rows_on_root(comm, x)
    numbers = np.arange(len(points), dtype=np.int64).reshape(-1, len(around))
    return GatheredCells(points, numbers, parallel.rows_on_root(comm, u), parallel.rows_on_root(comm, outline), values)


def _first_points(kind: basix.CellType, order: Sequence[int], count: int) -> npt.NDArray[np.int64]:
    """For each facet of the reference cell the point of the perimeter at which it begins."""
    sides = [{order[k], order[(k + 1) % len(order)]} for k in range(len(order))]
    return np.array([count * sides.index(set(facet)) for facet in basix.topology(kind)[1]], dtype=np.int64)
