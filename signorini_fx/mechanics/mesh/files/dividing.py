"""Quadrilaterals beside triangles, divided into smaller quadrilaterals.

A mesh here has one kind of cell.  Where most cells in the plane are straight quadrilaterals, all become such: bodies
without a triangle keep their cells; in others each quadrilateral becomes four and each triangle three, by lines from
the middle of the cell to those of its sides.  Triangles of degree 1 in their place would make bodies too stiff, and
their stress at a corner is off by several percent.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.mesh.files.raw import RawMesh, row_keys, rows_of
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

_SHAPES = ("triangle", "quad")


def divided(raw: RawMesh) -> tuple[RawMesh, Ints, str]:
    """A mesh of quadrilaterals in place of one in the plane that has triangles, too, but not more; any other as it is.

    Returns:
        The mesh, whose new points come last; the nodes between which each of these is, shape (k, 4), -1: none; and in
        words what was divided.
    """
    none = np.empty((0, 4), dtype=np.int64)
    counts = dict.fromkeys(_SHAPES, 0)
    for kind, nodes in raw.blocks:
        counts[kind] = counts.get(kind, 0) + len(nodes)
    kinds = {kind for kind, count in counts.items() if count and not kind.startswith(("line", "vertex", "polygon"))}
    valid = all(0 <= nodes.min() <= nodes.max() < len(raw.points) for _, nodes in raw.blocks if nodes.size)
    if not valid or kinds != {*_SHAPES} or counts["triangle"] > counts["quad"]:
        return raw, none, ""
    mixed = _with_triangles(raw)
    chosen = [kind in _SHAPES and bool(nodes.size) for kind, nodes in raw.blocks]
    taken = [mixed[nodes[:, 0]] if of_body else None for of_body, (_, nodes) in zip(chosen, raw.blocks, strict=True)]
    cells = [nodes[rows] for (_, nodes), rows in zip(raw.blocks, taken, strict=True) if rows is not None]
    sides = np.concatenate([np.stack((c, np.roll(c, -1, axis=1)), axis=2).reshape(-1, 2) for c in cells])
    _, first, number = np.unique(row_keys(sides), return_index=True, return_inverse=True)
    edges, of_side = sides[first], len(raw.points) + number.reshape(-1)
    start, middle = 0, len(raw.points) + len(edges)
    parents = [np.column_stack((edges, np.full_like(edges, -1)))]
    blocks: list[tuple[str, Ints]] = []
    origins: list[Ints] = []  # of each block the row of the file that each row is a part of
    for (kind, nodes), rows in zip(raw.blocks, taken, strict=True):
        if rows is None:
            block, origin = _halves(nodes, edges, len(raw.points)) if kind == "line" else (nodes, np.arange(len(nodes)))
            blocks.append((kind, block))
            origins.append(origin)
            continue
        own, width = nodes[rows], nodes.shape[1]
        between = of_side[start : start + own.size].reshape(-1, width)
        centres = np.broadcast_to((middle + np.arange(len(own)))[:, None], own.shape)
        parts = np.stack((own, between, centres, np.roll(between, 1, axis=1)), axis=2).reshape(-1, 4)
        start, middle = start + own.size, middle + len(own)
        parents.append(np.pad(own, ((0, 0), (0, 4 - width)), constant_values=-1))
        blocks.append(("quad", np.concatenate((nodes[~rows].reshape(-1, 4) if width == 4 else parts[:0], parts))))
        origins.append(np.concatenate((np.flatnonzero(~rows), np.flatnonzero(rows).repeat(width))))
    ends = np.concatenate(parents)
    mesh = replace(
        raw,
        points=np.concatenate((raw.points, _middles(raw.points, ends))),
        blocks=blocks,
        sets={name: _rows(members, origins) for name, members in raw.sets.items()},
        node_sets={name: _with_middles(nodes, edges, len(raw.points)) for name, nodes in raw.node_sets.items()},
        data={name: [v[k] for v, k in zip(values, origins, strict=True)] for name, values in raw.data.items()},
    )
    return mesh, ends, _words(cells)


def _words(cells: list[Ints]) -> str:
    """What was divided."""
    counts = {width: sum(len(nodes) for nodes in cells if nodes.shape[1] == width) for width in (4, 3)}
    parts = [
        f"{count} {word} into {pieces} each"
        for count, word, pieces in ((counts[4], "quadrilaterals", "four"), (counts[3], "triangles", "three"))
        if count
    ]
    return f"{' and '.join(parts)} are divided, as a mesh has one kind of cell: all are quadrilaterals"


def _with_triangles(raw: RawMesh) -> npt.NDArray[np.bool_]:
    """Which points are of a body, cells that share nodes, that has a triangle."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(raw.points)
    pairs = [
        np.column_stack((np.repeat(nodes[:, 0], nodes.shape[1] - 1), nodes[:, 1:].ravel()))
        for kind, nodes in raw.blocks
        if kind in _SHAPES and nodes.size
    ]
    i, j = np.concatenate(pairs).T
    body = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(count, count)), directed=False)[1]
    corners = [nodes[:, 0] for kind, nodes in raw.blocks if kind == "triangle" and nodes.size]
    return np.isin(body, np.unique(body[np.concatenate(corners)]))


def _halves(lines: Ints, edges: Ints, first: int) -> tuple[Ints, Ints]:
    """The halves of lines that are sides of divided cells, the other ones, and the row of each of both before."""
    if not lines.size:
        return lines, np.arange(len(lines))
    at = rows_of(lines, edges)
    split = np.flatnonzero(at >= 0)
    between = first + at[split]
    halves = np.stack((lines[split, 0], between, between, lines[split, 1]), axis=1).reshape(-1, 2)
    return np.concatenate((lines[at < 0], halves)), np.concatenate((np.flatnonzero(at < 0), split.repeat(2)))


def _middles(points: Floats, ends: Ints) -> Floats:
    """The places midway between some of the points, shape (k, d or 3); ``ends``: see ``divided``."""
    x = np.where((ends >= 0)[:, :, None], np.asarray(points, dtype=np.float64)[ends], 0.0)
    return np.asarray(x.sum(axis=1) / (ends >= 0).sum(axis=1)[:, None])


def _rows(members: list[Ints], origins: list[Ints]) -> list[Ints]:
    """The rows of each block that are parts of some rows of it before."""
    return [np.flatnonzero(np.isin(rows, chosen)) for rows, chosen in zip(origins, members, strict=True)]


def _with_middles(nodes: Ints, edges: Ints, first: int) -> Ints:
    """A set of nodes with the middles of the sides both of whose ends it has."""
    return np.concatenate((nodes, first + np.flatnonzero(np.isin(edges, nodes).all(axis=1))))
