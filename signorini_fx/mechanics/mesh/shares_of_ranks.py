"""Cells of several bodies cut into equal shares for the ranks, so that a rank gets both sides of its part of a contact.

Recursive coordinate bisection (Berger and Bokhari, IEEE Transactions on Computers C-36, 1987): the cells of all bodies
are halved by a plane across an axis, then each half, and so on.  The graph of the cells, which dolfinx divides, does
not know that bodies touch, and dividing it takes several times as long as making the mesh on one rank.
"""

from __future__ import annotations

from typing import Any

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
from dolfinx.graph import adjacencylist
from mpi4py import MPI

from signorini_fx.machine import parallel
from signorini_fx.tuned import SLENDER_BODY, TILTED_CUT

Floats = npt.NDArray[np.float64]

_HALVINGS = 64  # of an interval, until no number is inside


def shares(comm: MPI.Comm, middles: Floats, sides: Floats) -> npt.NDArray[np.int32]:
    """The rank of each cell, for equal numbers of cells but for one or two; collective.

    Args:
        comm: the ranks.
        middles: of the cells that this rank brings, shape (m, d).
        sides: corners of the facets of this rank on which bodies touch, shape (f, corners, d).  Cuts are across the
            direction in which the cells extend most, along the contact rather than away from it.

    Returns:
        Shape (m,); it does not depend on which rank brings which cell.
    """
    owner, at = np.zeros(len(middles), dtype=np.int32), np.zeros(len(sides), dtype=np.int32)
    places, squares = sides.mean(axis=1), _squared_normals(sides)
    parts = np.array([[0, comm.size]])  # the ranks from ... to, of each part
    while (parts[:, 1] - parts[:, 0] > 1).any():
        ends = parts[parts[:, 1] - parts[:, 0] > 1]
        middle = ends.sum(axis=1) // 2
        cells, facets = ([np.flatnonzero(part_of == first) for first in ends[:, 0]] for part_of in (owner, at))
        low, weights = _directions(comm, [middles[rows] for rows in cells], [squares[rows] for rows in facets])
        keys = [(middles[rows] - low[k]) @ weights[k] for k, rows in enumerate(cells)]
        limits = _quantiles(comm, keys, (middle - ends[:, 0]) / (ends[:, 1] - ends[:, 0]))
        for k, limit in enumerate(limits):
            owner[cells[k][keys[k] > limit]] = middle[k]
            at[facets[k][(places[facets[k]] - low[k]) @ weights[k] > limit]] = middle[k]
        halves = [np.stack([ends[:, 0], middle], axis=1), np.stack([middle, ends[:, 1]], axis=1)]
        parts = np.concatenate([*halves, parts[parts[:, 1] - parts[:, 0] == 1]])
    return owner


def partitioner(owner: npt.NDArray[np.integer[Any]]) -> Any:
    """What ``dolfinx.mesh.create_mesh`` asks for the rank of each cell of its input; there are no ghost cells.

    Args:
        owner: the rank of each cell that this rank brings, shape (m,).
    """

    def partition(*_: Any) -> Any:
        graph = adjacencylist(owner.astype(np.int32)[:, None])
        return getattr(graph, "_cpp_object", graph)

    return partition


def _squared_normals(sides: Floats) -> Floats:
    """The squares of the components of the unit normals of facets, shape (f, corners, d) -> (f, d)."""
    along = sides[:, 1] - sides[:, 0]
    normals = along[:, ::-1] if sides.shape[2] == 2 else np.cross(along, sides[:, 2] - sides[:, 0])
    squares = np.square(normals)
    total = squares.sum(axis=1, keepdims=True)
    return np.divide(squares, total, out=np.zeros_like(squares), where=total > 0)


def _directions(comm: MPI.Comm, middles: list[Floats], squares: list[Floats]) -> tuple[Floats, Floats]:
    """Where each part begins along each axis, and the direction to cut it across, shape (parts, d) each.

    Args:
        comm: the ranks.
        middles: of the cells of each part on this rank, shape (m, d) each.
        squares: of the components of the normals of the contact in each part, shape (f, d) each.
    """
    bounds = np.stack([parallel.global_bounds(comm, entries) for entries in middles])
    sums = parallel.global_sum(comm, np.stack([np.append(entries.sum(axis=0), len(entries)) for entries in squares]))
    away = sums[:, :-1] / np.maximum(sums[:, -1:], 1.0)
    extent = np.maximum(bounds[:, 1] - bounds[:, 0], 0.0)
    suited = extent / np.maximum(extent.max(axis=1, keepdims=True), np.finfo(float).tiny)
    suited *= np.sqrt(np.maximum(1 - away, SLENDER_BODY**-2))
    # Round-off, which depends on the ranks that bring the facets, must not choose among axes that are alike.
    order = np.argsort(-np.round(suited, 9), axis=1, kind="stable")
    weights = np.empty_like(extent)
    np.put_along_axis(weights, order, np.broadcast_to(TILTED_CUT ** np.arange(extent.shape[1]), extent.shape), axis=1)
    return np.where(np.isfinite(bounds[:, 0]), bounds[:, 0], 0.0), weights


def _quantiles(comm: MPI.Comm, keys: list[Floats], portions: Floats) -> Floats:
    """For each part a limit that a portion of the keys of all ranks does not exceed.

    Args:
        comm: the ranks.
        keys: of each part on this rank, at least 0 but for round-off.
        portions: shape (parts,).
    """
    ordered = [np.sort(part_keys) for part_keys in keys]
    high = np.array([part_keys[-1] if part_keys.size else 0.0 for part_keys in ordered])
    comm.Allreduce(MPI.IN_PLACE, high, op=MPI.MAX)
    wanted = np.rint(parallel.global_sum(comm, np.array([float(part_keys.size) for part_keys in ordered])) * portions)
    low = -1e-9 * high
    for _ in range(_HALVINGS):  # no rank needs the keys of another
        limit = (low + high) / 2
        below = np.array(
            [np.searchsorted(part_keys, x, side="right") for part_keys, x in zip(ordered, limit, strict=True)]
        )
        below = parallel.global_sum(comm, below)
        if (below == wanted).all():
            return limit
        low, high = np.where(below < wanted, limit, low), np.where(below >= wanted, limit, high)
    return high
