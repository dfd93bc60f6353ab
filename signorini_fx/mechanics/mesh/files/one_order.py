"""Nodes that cells lack: those in the middle of faces, and those of bodies that are straight beside quadratic ones.

A mesh here has one kind of cell.  Where another body, without a common node, has cells with nodes on their edges,
straight cells get such nodes in the middle of their edges: they keep their shape, and their displacement is quadratic.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from signorini_fx.mechanics.mesh.files.cells import Cell, completed
from signorini_fx.mechanics.mesh.files.cutting import BETWEEN, CORNERS, WORDS, shape_of
from signorini_fx.mechanics.mesh.files.raw import RawMesh, row_keys
from signorini_fx.mechanics.mesh.files.shape import Floats


def of_one_order(raw: RawMesh) -> tuple[RawMesh, str]:
    """A mesh whose bodies are all quadratic, if some are and the others have no node in common with them.

    Returns:
        The mesh, or any other one as it is, and in words what was done.
    """
    kinds = {kind for kind, nodes in raw.blocks if len(nodes) and shape_of(kind) in CORNERS}
    body = {kind for kind in kinds if shape_of(kind) not in ("triangle", "quad")} or kinds
    straight = {kind for kind in body if kind == shape_of(kind)}
    if not straight or straight == body:
        return raw, ""
    present = np.zeros((2, len(raw.points)), dtype=bool)
    for kind, nodes in raw.blocks:
        if kind in body and nodes.size:
            if not 0 <= nodes.min() <= nodes.max() < len(raw.points):
                return raw, ""
            present[int(kind in straight), nodes] = True
    if present.all(axis=0).any():
        return raw, ""
    changed = [n for n, (kind, nodes) in enumerate(raw.blocks) if kind in straight and len(nodes)]
    edges = {kind: np.array([pair for pair in BETWEEN[kind] if len(pair) == 2]) for kind in straight}
    ends = np.concatenate([raw.blocks[n][1][:, edges[raw.blocks[n][0]]].reshape(-1, 2) for n in changed])
    _, first, number = np.unique(row_keys(ends), return_index=True, return_inverse=True)
    points = np.concatenate((raw.points, raw.points[ends[first]].mean(axis=1)))
    blocks, start = list(raw.blocks), 0
    counts: dict[str, int] = {}
    for n in changed:
        kind, nodes = raw.blocks[n]
        count = len(nodes) * len(edges[kind])
        middles = len(raw.points) + number.reshape(-1)[start : start + count].reshape(len(nodes), -1)
        start += count
        blocks[n] = (f"{kind}{nodes.shape[1] + middles.shape[1]}", np.column_stack((nodes, middles)))
        counts[kind] = counts.get(kind, 0) + len(nodes)
    # Where others have nodes in the middle of faces as well, these get them, too.
    raw = replace(raw, points=points, blocks=blocks)
    kinds = {kind for kind, nodes in blocks if len(nodes)}
    for kind in sorted(kinds):
        full_cell = completed(kind)
        if full_cell is not None and full_cell[0].kind in kinds:
            raw, _ = complete(
                raw,
                [n for n, (block_kind, nodes) in enumerate(raw.blocks) if block_kind == kind and len(nodes)],
                *full_cell,
            )
    description = " and ".join(f"{count} {WORDS[kind]}" for kind, count in counts.items())
    return raw, f"{description} get nodes in the middle of their edges, as another body has them"


def complete(raw: RawMesh, body: list[int], cell: Cell, weights: Floats) -> tuple[RawMesh, str]:
    """The raw mesh with the nodes that its cells lack, those on a face joined where cells meet."""
    incomplete = np.concatenate([raw.blocks[n][1] for n in body])
    node_count = incomplete.shape[1]
    new = cell.nodes[node_count:]
    # A face is identified by its corners, a cell by its number.
    faces = np.concatenate([np.empty((0, 4), np.int64), *(incomplete[:, list(corners)] for corners in new[:-1])])
    first, number = np.unique(row_keys(faces), return_index=True, return_inverse=True)[1:]
    inside = len(first) + np.arange(len(incomplete))
    count = len(raw.points)
    added = np.column_stack((number.reshape(len(new) - 1, len(incomplete)).T, inside)) + count
    x = np.einsum("nt,ctd->cnd", weights[node_count:], np.asarray(raw.points, dtype=np.float64)[incomplete])
    points = np.concatenate((raw.points, x[:, :-1].transpose(1, 0, 2).reshape(-1, x.shape[2])[first], x[:, -1]))
    blocks, start = list(raw.blocks), 0
    for n in body:
        rows = slice(start, start := start + len(raw.blocks[n][1]))
        blocks[n] = (cell.kind, np.column_stack((incomplete[rows], added[rows])))
    return replace(raw, points=points, blocks=blocks), cell.kind
