"""The program that reads a gmsh file for ``gmsh_files``: it may crash, and imports nothing from this package.

python3 -P gmsh_process.py FILE ARRAYS COMPLAINT SECONDS BYTES HALVINGS DEGREE SIZE

The cells that gmsh makes of a drawing are divided HALVINGS times, and get nodes between their corners if DEGREE is 2,
none if it is 1.  Those of a CAD drawing are SIZE long; 0: a fraction of the size of the body.
"""

from __future__ import annotations

import json
import resource
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

REFUSED = 3
# Drawings of CAD programs, by what OpenCASCADE calls them.
CAD = {".step": "step", ".stp": "step", ".brep": "brep"}
# A body's diagonal is so many cells long where no size is given.
_CELLS_ALONG = 25
OUT_OF_TIME, KILLED = int(signal.SIGXCPU), int(signal.SIGKILL)
# Elements by gmsh's number, in meshio's words.
_TYPES = {1: "line", 2: "triangle", 3: "quad", 8: "line3", 9: "triangle6", 10: "quad9", 15: "vertex", 16: "quad8"}
_TYPES |= {4: "tetra", 5: "hexahedron", 6: "wedge", 7: "pyramid", 11: "tetra10", 12: "hexahedron27"}
_TYPES |= {13: "wedge18", 14: "pyramid14", 17: "hexahedron20"}


def main(arguments: Sequence[str]) -> int:
    """Read a file within limits, and write what is in it as arrays, or what is wrong."""
    file, arrays, complaint, seconds, memory, halvings, degree, size = arguments
    _limit(resource.RLIMIT_CORE, 0, 0)
    _limit(resource.RLIMIT_CPU, int(seconds), int(seconds) + 5)
    _limit(resource.RLIMIT_AS, int(memory), int(memory))
    try:
        _read(file, arrays, int(halvings), int(degree), float(size))
    except Exception as error:
        reason = str(error) or f"gmsh cannot read it: {type(error).__name__}"
        Path(complaint).write_text(reason.replace(f"'{file}', ", ""), encoding="utf-8")
        return REFUSED
    return 0


def _limit(which: int, soft: int, hard: int) -> None:
    """Set a limit, or keep the current one if it is tighter and may not be raised."""
    _, there = resource.getrlimit(which)
    if there != resource.RLIM_INFINITY:
        soft, hard = min(soft, there), min(hard, there)
    resource.setrlimit(which, (soft, hard))


def _read(file: str, arrays: str, halvings: int, degree: int, size: float) -> None:
    import gmsh
    import numpy as np

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.RandomSeed", 1)
    try:
        suffix = Path(file).suffix.lower()
        corners: dict[int, Any] = {}
        if suffix in CAD:
            corners = _import(gmsh, file, CAD[suffix], size)
        else:
            gmsh.merge(file)  # open would also run a file FILE.opt next to it
        if suffix in CAD or suffix == ".geo":
            _mesh(gmsh, halvings, degree)
    except Exception as error:
        raise ValueError(f"gmsh cannot read it: {error}") from None
    tags, x, _ = gmsh.model.mesh.getNodes()
    tags = np.asarray(tags, dtype=np.int64)
    order = np.argsort(tags)
    if (np.diff(tags[order]) == 0).any():
        raise ValueError("two nodes have the same number")
    grouped = {dim for dim, _ in gmsh.model.getPhysicalGroups()}
    # Boundaries have one dimension less than the body.
    top = 3 if len(gmsh.model.mesh.getElementTypes(3)) else 2
    blocks: list[Any] = []
    kinds: list[str] = []
    physical: list[list[int]] = []
    sets: dict[str, list[int]] = {}
    for dim, entity in gmsh.model.getEntities():
        own = [int(tag) for tag in gmsh.model.getPhysicalGroupsForEntity(dim, entity)]
        if dim < top - 1 or ((dim in grouped or dim < top) and not own):
            continue
        types, _, nodes = gmsh.model.mesh.getElements(dim, entity)
        for kind, flat in zip(types, nodes, strict=True):
            name, _, _, count, _, _ = gmsh.model.mesh.getElementProperties(kind)
            for tag in own:
                label = gmsh.model.getPhysicalName(dim, tag) or f"{'boundary' if dim < top else 'region'}_{tag}"
                sets.setdefault(label, []).append(len(blocks))
            blocks.append(_places(tags, order, np.asarray(flat, dtype=np.int64)).reshape(-1, count))
            kinds.append(_TYPES.get(int(kind), name))
            physical.append(own)
    np.savez(
        arrays,
        points=np.asarray(x).reshape(-1, 3),
        kinds=json.dumps(kinds),
        sets=json.dumps(sets),
        physical=json.dumps(physical),
        corners=json.dumps(corners),
        **{f"block_{k}": nodes for k, nodes in enumerate(blocks)},
    )


def _import(gmsh: Any, file: str, form: str, size: float) -> dict[int, Any]:
    """Import a CAD drawing; each surface is a physical group with its number, and so is each solid.

    Returns:
        Surface -> its vertices, by which names of the file can be assigned.
    """
    found = gmsh.model.occ.importShapes(file, highestDimOnly=True, format=form)
    gmsh.model.occ.synchronize()
    top = max((dim for dim, _ in found), default=0)
    if top < 2:
        raise ValueError("it has neither solids nor faces")
    low, high = (gmsh.model.getBoundingBox(-1, -1)[k : k + 3] for k in (0, 3))
    length = size or sum((b - a) ** 2 for a, b in zip(low, high, strict=True)) ** 0.5 / _CELLS_ALONG
    # Cells are smaller where the surface is curved, this many to a full turn, but not by more than this factor.
    gmsh.option.setNumber("Mesh.MeshSizeMax", length)
    gmsh.option.setNumber("Mesh.MeshSizeMin", length / 8)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 16)
    for dim in (top, top - 1):
        for _, tag in gmsh.model.getEntities(dim):
            name = gmsh.model.getEntityName(dim, tag).rpartition("/")[2]
            if name.startswith("Open CASCADE STEP translator"):  # what the library writes for a part without a name
                name = ""
            gmsh.model.addPhysicalGroup(dim, [tag], tag, name if dim == top else "")
    corners = {}
    for _, tag in gmsh.model.getEntities(2):
        ends = gmsh.model.getBoundary([(2, tag)], combined=False, oriented=False, recursive=True)
        corners[tag] = [list(gmsh.model.getValue(0, point, [])) for point in sorted({end for _, end in ends})]
    return corners


def _mesh(gmsh: Any, halvings: int, degree: int) -> None:
    """Mesh the drawing."""
    if degree and halvings:  # a script's own order would interfere with the division
        gmsh.option.setNumber("Mesh.ElementOrder", 1)
    top = 3 if gmsh.model.getEntities(3) else 2
    gmsh.model.mesh.generate(top)
    for _ in range(halvings):
        gmsh.model.mesh.refine()
    if degree:
        gmsh.model.mesh.setOrder(degree)
    if top == 3:
        _untangle(gmsh)


def _untangle(gmsh: Any) -> None:
    """Move the nodes between the corners where a curved cell has been turned inside out."""
    for kind in gmsh.model.mesh.getElementTypes(3):
        tags, _ = gmsh.model.mesh.getElementsByType(kind)
        if gmsh.model.mesh.getElementProperties(kind)[2] > 1 and not all(
            gmsh.model.mesh.getElementQualities(tags, "minDetJac") > 0
        ):
            gmsh.model.mesh.optimize("HighOrder")


def _places(tags: Any, order: Any, wanted: Any) -> Any:
    """Where the nodes with these numbers are; -1 for one that is not there."""
    import numpy as np

    if not len(tags):
        return np.full(len(wanted), -1)
    places = order[np.searchsorted(tags, wanted, sorter=order).clip(max=len(tags) - 1)]
    return np.where(tags[places] == wanted, places, -1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
