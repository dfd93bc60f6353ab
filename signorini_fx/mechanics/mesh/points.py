"""Location of points in the cells of a mesh, or next to them, and evaluation there on the rank that
owns the cell.

Meshes of one body need not be nested: points of one lie in cells of another, or next to them where
the boundary is curved.  Cells are found by their bounding boxes, and by Newton's method for the
coordinates in the reference cell, which takes curved cells as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import basix
import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
from basix.finite_element import FiniteElement
from dolfinx import geometry
from dolfinx import mesh as dmesh

from signorini_fx.arrays import Array, Indices, Ints, extents
from signorini_fx.machine import compat, parallel
from signorini_fx.tuned import MANY_STEPS, NOTHING_LEFT

_SIMPLICES = (basix.CellType.triangle, basix.CellType.tetrahedron)
# So many pairs of a point and a cell are treated at once: they and their shape functions fit into
# 100 megabytes.
_PAIRS = 100_000


def at_points(
    mesh: dmesh.Mesh,
    x: Array,
    outside: float,
    evaluate: Callable[[Indices, Array], Array],
    pieces: tuple[Ints, Ints] | None = None,
) -> Array | None:
    """Return the values at points that the ranks with the nearest cells evaluate; collective.

    Args:
        mesh: the mesh.
        x: the points that this rank asks for, shape (n, 3), length.
        outside: how far outside a cell a point may be, in sizes of the cell.
        evaluate: gives a row for each of m owned cells, shape (m,), and place in the reference
            cell, shape (m, d); rows have the same length on all ranks.  Not called where there are
            no cells; it may not fail on one rank alone.
        pieces: the pieces that the points, shape (n,), and the cells of this rank, shape (cells,),
            are of, which must be the same; None: any cell will do.

    Returns:
        The rows, shape (n, length of a row), or (0, 0) without points; None on all ranks: some
        point of some rank is outside of all cells.
    """
    comm = mesh.comm
    dim = mesh.topology.dim
    nodes = _nodes(mesh)
    reach = outside * _sizes(nodes).max(initial=0.0)
    low = nodes.min(axis=(0, 1), initial=np.inf) - reach
    high = nodes.max(axis=(0, 1), initial=-np.inf) + reach
    asked = [
        np.flatnonzero(((x[:, :dim] >= low) & (x[:, :dim] <= high)).all(axis=1))
        for low, high in comm.allgather((low, high))
    ]
    received = comm.alltoall([x[points] for points in asked])
    of = (
        None
        if pieces is None
        else (np.concatenate(comm.alltoall([pieces[0][points] for points in asked])), pieces[1])
    )
    cells, reference, gap = cells_of_points(mesh, np.concatenate(received), outside, of)
    hits = np.flatnonzero(cells >= 0)
    values = evaluate(cells[hits], reference[hits]) if hits.size else np.empty((0, 0))
    answers = []
    for begin, end in pairwise(np.cumsum([0, *(len(points) for points in received)])):
        share = slice(*np.searchsorted(hits, (begin, end)))
        answers.append((hits[share] - begin, gap[hits[share]], values[share]))
    replies = comm.alltoall(answers)
    least = np.full(len(x), np.inf)
    rows = np.empty((len(x), max(values.shape[1] for *_, values in replies)))
    for points, (hits, gap, values) in zip(asked, replies, strict=True):
        numbers = points[hits]
        nearer = gap < least[numbers]
        if nearer.any():
            least[numbers[nearer]] = gap[nearer]
            rows[numbers[nearer]] = values[nearer]
    return None if parallel.any_rank(comm, np.isinf(least)) else rows


def cells_of_points(
    mesh: dmesh.Mesh,
    x: Array,
    outside: float,
    pieces: tuple[Ints, Ints] | None = None,
) -> tuple[Indices, Array, Array]:
    """Return the cell of this rank that each point is in, or else least outside.

    Args:
        mesh: the mesh.
        x: the points, shape (n, 3), length.
        outside: how far outside a cell a point may be, in sizes of the cell.
        pieces: as for ``at_points``.

    Returns:
        The owned cells, -1 for none, shape (n,); the places in the reference cell, which cells
        continue outside themselves, shape (n, d); how far outside the points are, a length that is
        zero but for round-off inside and infinite without a cell, shape (n,).
    """
    dim = mesh.topology.dim
    nodes = _nodes(mesh)
    element = compat.geometry_element(mesh)
    size = _sizes(nodes)
    middle = basix.geometry(element.cell_type).mean(axis=0)
    table = element.tabulate(1, middle[None])[:, 0, :, 0]
    scaled = nodes / size[:, None, None]
    centre = np.einsum("k,nkc->nc", table[0], scaled)
    edges = np.einsum("dk,nkc->cdn", table[1:], scaled)
    # How the place moves with the point, in sizes of the cell, where cells are taken for
    # parallelepipeds or simplices.
    turned = inverses(edges)
    flat = centre[:, None] + np.einsum("kd,cdn->nkc", element.points - middle, edges)
    curved = np.abs(scaled - flat).max(axis=(1, 2)) > NOTHING_LEFT
    cells = np.full(len(x), -1, dtype=np.int32)
    reference = np.zeros((len(x), dim))
    gap = np.full(len(x), np.inf)
    # Cells that differ much in size are apart from each other, because a tree pads all its boxes
    # alike.
    groups = np.floor(np.log2(size))
    for share in (NOTHING_LEFT, outside):
        open_points = (
            np.flatnonzero((cells < 0) | (gap > NOTHING_LEFT * size[cells]))
            if len(size)
            else cells[:0]
        )
        for group in np.unique(groups) if len(open_points) else ():
            entities = np.flatnonzero(groups == group).astype(np.int32)
            if (
                len(entities) == 1
            ):  # of a tree with one box dolfinx 0.9 reads children, which are not there
                entities = np.repeat(entities, 2)
            tree = geometry.bb_tree(
                mesh, dim, entities=entities, padding=float(share * 2 ** (group + 1))
            )
            near = geometry.compute_collisions_points(tree, np.ascontiguousarray(x[open_points]))
            point_numbers = np.repeat(open_points, np.diff(near.offsets))
            for begin in range(0, len(point_numbers), _PAIRS):
                point = point_numbers[begin : begin + _PAIRS]
                cell = near.array[begin : begin + _PAIRS]
                if pieces is not None:
                    same_piece = pieces[0][point] == pieces[1][cell]
                    point = point[same_piece]
                    cell = cell[same_piece]
                    if not len(point):  # of no points basix's tables of hexahedra end the process
                        continue
                # Lengths of the cell, so that no unit matters.
                away = centre[cell] - x[point, :dim] / size[cell, None]
                trial = middle - np.einsum("cdn,nd->nc", turned[..., cell], away)
                distance = np.zeros(len(cell))
                beside = np.abs(_clipped(element, trial) - trial).max(axis=1) > NOTHING_LEFT
                rest = np.flatnonzero(curved[cell] | beside)
                if len(rest):
                    corners = (nodes[cell[rest]] - x[point[rest], None, :dim]) / size[
                        cell[rest], None, None
                    ]
                    trial[rest] = _pull_back(element, corners, trial[rest])
                    # At most: the distance of the point of the cell next to the place in the
                    # reference cell.
                    shares = element.tabulate(0, _clipped(element, trial[rest]))[0, :, :, 0]
                    distance[rest] = np.linalg.norm(
                        np.einsum("nk,nkc->nc", shares, corners), axis=1
                    )
                far = distance * size[cell]
                order = np.lexsort((far, point))
                order = order[(distance <= outside)[order]]
                best = order[np.unique(point[order], return_index=True)[1]]
                best = best[far[best] < gap[point[best]]]
                best_points = point[best]
                cells[best_points] = cell[best]
                reference[best_points] = trial[best]
                gap[best_points] = far[best]
    return cells, reference, gap


def _nodes(mesh: dmesh.Mesh) -> Array:
    """Return the geometry nodes of the owned cells, shape (cells, nodes of each, d)."""
    count = mesh.topology.index_map(mesh.topology.dim).size_local
    dim = mesh.topology.dim
    return np.asarray(
        mesh.geometry.x[:, :dim][compat.geometry_cells(mesh)[:count]], dtype=np.float64
    )


def _sizes(nodes: Array) -> Array:
    """Return the diagonals of the bounding boxes of cells, length."""
    return extents(nodes)


def determinants(matrices: Array) -> Array:
    """Return the determinants of many matrices, shape (d, d, ...) -> (...), d = 2 or 3, by explicit
    formulas.
    """
    if len(matrices) == 2:
        (a, b), (c, d) = matrices
        return a * d - b * c
    (a, b, c), (d, e, f), (g, h, i) = matrices
    return a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)


def inverses(matrices: Array) -> Array:
    """Return the inverses of many matrices, shape (d, d, ...), d = 2 or 3, by explicit formulas;
    the identity for singular ones.
    """
    if len(matrices) == 2:
        (a, b), (c, d) = matrices
        adjugates = np.array([[d, -b], [-c, a]])
    else:
        first, second, third = matrices.swapaxes(0, 1)
        pairs = (second, third), (third, first), (first, second)
        adjugates = np.array([np.cross(*pair, axis=0) for pair in pairs])
    determinant = determinants(matrices)
    singular = determinant == 0
    adjugates /= np.where(singular, 1.0, determinant)
    adjugates[..., singular] = np.eye(len(matrices))[..., None]
    return adjugates


def _pull_back(element: FiniteElement, corners: Array, reference: Array) -> Array:
    """Return the reference coordinates that cells map to the origin, by Newton's method.

    ``corners``: nodes relative to the sought point, in sizes of the cell; ``reference``: initial
    guess, changed in place.
    """
    moving = np.arange(len(corners))
    for _ in range(MANY_STEPS):
        if not moving.size:
            break
        table = element.tabulate(1, reference[moving])[..., 0]
        away = np.einsum("nk,nkc->nc", table[0], corners[moving])
        turned = inverses(np.einsum("dnk,nkc->cdn", table[1:], corners[moving]))
        step = np.einsum("cdn,nd->nc", turned, away)
        reference[moving] -= np.clip(
            step, -1.0, 1.0
        )  # at most from one side of the cell to the other
        moving = moving[np.abs(step).max(axis=1) >= NOTHING_LEFT]
    return reference


def _clipped(element: FiniteElement, reference: Array) -> Array:
    """Return the coordinates moved into the reference cell where they are outside."""
    inside = np.clip(reference, 0.0, None)
    if element.cell_type in _SIMPLICES:
        inside /= np.maximum(inside.sum(axis=1, keepdims=True), 1.0)
    return np.minimum(inside, 1.0)
