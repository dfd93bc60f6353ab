"""What reads a file of gmsh for ``gmsh_files``, as a program of its own: it may end badly, and imports nothing of ours.

python3 -P _gmsh_process.py FILE ARRAYS COMPLAINT SECONDS BYTES HALVINGS DEGREE

The cells of a script are divided HALVINGS times, and get nodes between their corners if DEGREE is 2, none if it is 1.
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
OUT_OF_TIME, KILLED = int(signal.SIGXCPU), int(signal.SIGKILL)
# Elements by gmsh's number, in meshio's words.
_TYPES = {1: "line", 2: "triangle", 3: "quad", 8: "line3", 9: "triangle6", 10: "quad9", 15: "vertex", 16: "quad8"}


def main(arguments: Sequence[str]) -> int:
    """Read a file within limits, and write what is in it as arrays, or what is wrong."""
    file, arrays, complaint, seconds, memory, halvings, degree = arguments
    _limit(resource.RLIMIT_CORE, 0, 0)
    _limit(resource.RLIMIT_CPU, int(seconds), int(seconds) + 5)
    _limit(resource.RLIMIT_AS, int(memory), int(memory))
    try:
        _read(file, arrays, int(halvings), int(degree))
    except Exception as error:
        reason = str(error) or f"gmsh cannot read it: {type(error).__name__}"
        Path(complaint).write_text(reason.replace(f"'{file}', ", ""), encoding="utf-8")
        return REFUSED
    return 0


def _limit(which: int, soft: int, hard: int) -> None:
    """Set a limit, or keep the one that there is where it is tighter and may not be raised."""
    _, there = resource.getrlimit(which)
    if there != resource.RLIM_INFINITY:
        soft, hard = min(soft, there), min(hard, there)
    resource.setrlimit(which, (soft, hard))


def _read(file: str, arrays: str, halvings: int, degree: int) -> None:
    import gmsh
    import numpy as np

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.RandomSeed", 1)
    try:
        gmsh.merge(file)  # open would also run what lies beside it as FILE.opt
        if file.lower().endswith(".geo"):
            if degree and halvings:  # the script's own order would be in the way of dividing
                gmsh.option.setNumber("Mesh.ElementOrder", 1)
            gmsh.model.mesh.generate(2)
            for _ in range(halvings):
                gmsh.model.mesh.refine()
            if degree:
                gmsh.model.mesh.setOrder(degree)
    except Exception as error:
        raise ValueError(f"gmsh cannot read it: {error}") from None
    tags, x, _ = gmsh.model.mesh.getNodes()
    tags = np.asarray(tags, dtype=np.int64)
    order = np.argsort(tags)
    if (np.diff(tags[order]) == 0).any():
        raise ValueError("two nodes have one number")
    grouped = {dim for dim, _ in gmsh.model.getPhysicalGroups()}
    blocks: list[Any] = []
    kinds: list[str] = []
    physical: list[list[int]] = []
    sets: dict[str, list[int]] = {}
    for dim, entity in gmsh.model.getEntities():
        own = [int(tag) for tag in gmsh.model.getPhysicalGroupsForEntity(dim, entity)]
        if dim == 0 or ((dim in grouped or dim == 1) and not own):
            continue
        types, _, nodes = gmsh.model.mesh.getElements(dim, entity)
        for kind, flat in zip(types, nodes, strict=True):
            name, _, _, count, _, _ = gmsh.model.mesh.getElementProperties(kind)
            for tag in own:
                label = gmsh.model.getPhysicalName(dim, tag) or f"{'boundary' if dim == 1 else 'region'}_{tag}"
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
        **{f"block_{k}": nodes for k, nodes in enumerate(blocks)},
    )


def _places(tags: Any, order: Any, wanted: Any) -> Any:
    """Where the nodes with these numbers are; -1 for one that is not there."""
    import numpy as np

    if not len(tags):
        return np.full(len(wanted), -1)
    places = order[np.searchsorted(tags, wanted, sorter=order).clip(max=len(tags) - 1)]
    return np.where(tags[places] == wanted, places, -1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
