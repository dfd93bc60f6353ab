"""What reads a file of gmsh for ``mesh_files``, as a program of its own: it may end badly, and imports nothing of ours.

python3 -P _gmsh_process.py FILE CLEAN COMPLAINT SECONDS BYTES
"""

from __future__ import annotations

import resource
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

REFUSED = 3
OUT_OF_TIME, KILLED = int(signal.SIGXCPU), int(signal.SIGKILL)
# Cells that dolfinx knows, by gmsh's number: triangles and quadrilaterals of degree 1 to 3.
_CELLS = {2: "triangle", 3: "quadrilateral", 9: "triangle", 10: "quadrilateral", 21: "triangle", 36: "quadrilateral"}
_FLAT = 1e-9


def main(arguments: Sequence[str]) -> int:
    """Read a file within limits, and write a mesh that has nothing wrong with it, or what is wrong."""
    file, clean, complaint, seconds, memory = arguments
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5))
    resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
    try:
        _read(file, clean)
    except Exception as error:
        reason = str(error) or f"gmsh cannot read it: {type(error).__name__}"
        Path(complaint).write_text(reason.replace(f"'{file}', ", ""), encoding="utf-8")
        return REFUSED
    return 0


def _read(file: str, clean: str) -> None:
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    for name, value in (
        ("General.Terminal", 0),
        ("Mesh.RandomSeed", 1),
        ("Mesh.MshFileVersion", 4.1),
        ("Mesh.Binary", 1),
    ):
        gmsh.option.setNumber(name, value)
    try:
        gmsh.merge(file)
        if file.lower().endswith(".geo"):
            gmsh.model.mesh.generate(2)
    except Exception as error:
        raise ValueError(f"gmsh cannot read it: {error}") from None
    # A script may have set options of its own.
    gmsh.option.setNumber("Mesh.SaveAll", 0)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.option.setNumber("Mesh.ScalingFactor", 1)
    others = [(dim, tag) for dim, tag in gmsh.model.getPhysicalGroups() if dim not in (1, 2)]
    if any(dim == 3 for dim, _ in others):
        raise ValueError("the mesh has a physical group of dimension 3: a plane body is wanted")
    if others:  # gmsh takes an empty list for all
        gmsh.model.removePhysicalGroups(others)
    for dim, kind in ((2, "region"), (1, "boundary")):
        for tag in [tag for _, tag in gmsh.model.getPhysicalGroups(dim)]:
            _check_group(gmsh, dim, tag, f"{kind} {gmsh.model.getPhysicalName(dim, tag) or tag!r}")
    for dim, kind in ((2, "region"), (1, "boundary")):
        _check_shared(gmsh, dim, kind)
    _check_geometry(gmsh)
    _rebuild(gmsh)
    gmsh.write(clean)
    gmsh.clear()
    gmsh.merge(clean)  # what breaks gmsh must break it here


def _check_group(gmsh: Any, dim: int, tag: int, name: str) -> None:
    """Every group has cells of one kind on every piece; pieces without any are taken out."""
    entities = [int(e) for e in gmsh.model.getEntitiesForPhysicalGroup(dim, tag)]
    kinds = {e: [int(k) for k in gmsh.model.mesh.getElementTypes(dim, e)] for e in entities}
    full = [e for e in entities if kinds[e]]
    if not full:
        raise ValueError(f"{name} has no cells")
    if any(len(kinds[e]) > 1 for e in full):
        raise ValueError("the mesh mixes cell types or orders; use one")
    unknown = {kinds[e][0] for e in full} - set(_CELLS)
    if dim == 2 and unknown:
        what = gmsh.model.mesh.getElementProperties(unknown.pop())[0]
        raise ValueError(f"{name} has cells of type {what}; triangles or quadrilaterals are wanted")
    if len(full) < len(entities):
        label = gmsh.model.getPhysicalName(dim, tag)
        gmsh.model.removePhysicalGroups([(dim, tag)])
        gmsh.model.addPhysicalGroup(dim, full, tag, name=label)


def _check_shared(gmsh: Any, dim: int, kind: str) -> None:
    """A piece has one name: dolfinx would give its cells one tag, and the other name would silently lose them."""
    owners: dict[int, int] = {}
    for _, tag in gmsh.model.getPhysicalGroups(dim):
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, tag):
            other = owners.setdefault(int(entity), tag)
            if other != tag:
                one, two = (gmsh.model.getPhysicalName(dim, t) or str(t) for t in (other, tag))
                raise ValueError(f"{kind} {one!r} and {kind} {two!r} share cells: give every piece one physical group")


def _check_geometry(gmsh: Any) -> None:
    """Finite positions in the plane, and no cell without area."""
    import numpy as np

    tags, x, _ = gmsh.model.mesh.getNodes()
    x = np.asarray(x).reshape(-1, 3)
    if not np.isfinite(x).all():
        raise ValueError(f"node {tags[np.argmin(np.isfinite(x).all(axis=1))]} has a position that is not finite")
    if not len(x):
        raise ValueError("the mesh has no nodes")
    if len(np.unique(tags)) < len(tags):
        raise ValueError("two nodes have one number")
    size = float(np.ptp(x[:, :2], axis=0).max())
    if np.abs(x[:, 2]).max() > _FLAT * size:
        raise ValueError("the mesh does not lie in the plane z = 0")
    order = np.argsort(tags)
    edges = []
    for _, group in gmsh.model.getPhysicalGroups(2):
        for entity in gmsh.model.getEntitiesForPhysicalGroup(2, group):
            for kind, cells, nodes in zip(*gmsh.model.mesh.getElements(2, int(entity)), strict=True):
                corners = 3 if _CELLS[int(kind)] == "triangle" else 4
                rows = np.asarray(nodes).reshape(len(cells), -1)[:, :corners]
                places = np.searchsorted(tags, rows, sorter=order).clip(max=len(tags) - 1)
                places = order[places]
                if (np.asarray(tags)[places] != rows).any():
                    raise ValueError("a cell has a node that is not there")
                p = x[places][:, :, :2]
                turns = _turns(p)
                bad = (turns.min(axis=1) <= 0) & (turns.max(axis=1) >= 0)
                if bad.any():
                    raise ValueError(f"cell {cells[int(np.argmax(bad))]} has no area, or is not convex")
                edges.append(np.sort(np.stack([rows, np.roll(rows, -1, axis=1)], axis=2).reshape(-1, 2), axis=1))
    if edges:
        found, counts = np.unique(np.concatenate(edges), axis=0, return_counts=True)
        if counts.max() > 2:
            a, b = found[np.argmax(counts)]
            raise ValueError(f"the edge from node {a} to node {b} belongs to {counts.max()} cells")


def _rebuild(gmsh: Any) -> None:
    """A model with nothing but the groups: nodes that no cell has, and facets of such nodes, are left behind."""
    import numpy as np

    tags, x, _ = gmsh.model.mesh.getNodes()
    pieces = []
    for dim in (2, 1):
        for _, group in gmsh.model.getPhysicalGroups(dim):
            name = gmsh.model.getPhysicalName(dim, group)
            for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, group):
                (kind,), (cells,), (nodes,) = gmsh.model.mesh.getElements(dim, int(entity))
                pieces.append((dim, int(group), name, int(kind), np.asarray(nodes).reshape(len(cells), -1)))
    bodies = [rows.ravel() for dim, _, _, _, rows in pieces if dim == 2]
    used = np.unique(np.concatenate(bodies)) if bodies else np.empty(0, dtype=np.uint64)
    order = np.argsort(tags)
    places = order[np.searchsorted(tags, used, sorter=order)]
    gmsh.model.add("clean")
    groups: dict[tuple[int, int, str], list[int]] = {}
    for number, (dim, group, name, kind, rows) in enumerate(pieces, start=1):
        kept = rows[np.isin(rows, used).all(axis=1)]
        if not len(kept):
            continue
        gmsh.model.addDiscreteEntity(dim, number)
        if number == 1:
            positions = np.asarray(x).reshape(-1, 3)[places]
            gmsh.model.mesh.addNodes(dim, number, np.arange(1, len(used) + 1), positions.ravel())
        gmsh.model.mesh.addElementsByType(number, kind, [], np.searchsorted(used, kept).ravel() + 1)
        groups.setdefault((dim, group, name), []).append(number)
    for (dim, group, name), entities in groups.items():
        gmsh.model.addPhysicalGroup(dim, entities, group, name=name)


def _turns(p: Any) -> Any:
    """Twice the signed area at each corner of cells with corners p, shape (cells, corners, 2)."""
    import numpy as np

    after, before = np.roll(p, -1, axis=1) - p, p - np.roll(p, 1, axis=1)
    turns = before[:, :, 0] * after[:, :, 1] - before[:, :, 1] * after[:, :, 0]
    scale = np.square(after).sum(axis=2).max(axis=1, keepdims=True)
    return np.where(np.abs(turns) > 1e-14 * scale, turns, 0.0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
