"""Meshes as code_aster writes them as text, .mail.  No dolfinx here."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.raw import RawMesh

# Kinds of elements: that of meshio, and where each of its nodes stands in a row of the file.
_KINDS: dict[str, tuple[str, tuple[int, ...]]] = {
    "POI1": ("vertex", (0,)),
    "SEG2": ("line", (0, 1)),
    "SEG3": ("line3", (0, 1, 2)),
    "TRIA3": ("triangle", (0, 1, 2)),
    "TRIA6": ("triangle6", tuple(range(6))),
    "TRIA7": ("triangle7", tuple(range(7))),
    "QUAD4": ("quad", (0, 1, 2, 3)),
    "QUAD8": ("quad8", tuple(range(8))),
    "QUAD9": ("quad9", tuple(range(9))),
    "TETRA4": ("tetra", (0, 1, 2, 3)),
    "TETRA10": ("tetra10", tuple(range(10))),
    "PYRAM5": ("pyramid", tuple(range(5))),
    "PENTA6": ("wedge", tuple(range(6))),
    # The sides along the axis stand before those of the second end there, behind them in meshio.
    "PENTA15": ("wedge15", (*range(9), 12, 13, 14, 9, 10, 11)),
    "HEXA8": ("hexahedron", tuple(range(8))),
    "HEXA20": ("hexahedron20", (*range(12), 16, 17, 18, 19, 12, 13, 14, 15)),
}
_END = "FINSF"


def read_mail(file: Path) -> RawMesh:
    """A mesh with its groups.

    Raises:
        MeshError: it cannot be read, or an element has a node that is not there.
    """
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror}") from None
    nodes: dict[str, int] = {}
    points: list[list[float]] = []
    elements: dict[str, list[tuple[str, list[int]]]] = {}
    cells: dict[str, tuple[str, int]] = {}
    groups: dict[str, dict[str, list[str]]] = {"GROUP_NO": {}, "GROUP_MA": {}}
    for line, keyword, words in _sections(text):
        try:
            if keyword in ("COOR_2D", "COOR_3D"):
                size = int(keyword[-2]) + 1
                for k in range(0, len(words), size):
                    name, *x = words[k : k + size]
                    nodes[name] = len(points)
                    points.append([float(value.replace("D", "E").replace("d", "e")) for value in (*x, "0")[:3]])
                    if len(x) < size - 1:
                        raise ValueError(f"node {name} has too few coordinates")
            elif keyword in _KINDS:
                size = len(_KINDS[keyword][1]) + 1
                for k in range(0, len(words), size):
                    name, *corners = words[k : k + size]
                    if len(corners) < size - 1:
                        raise ValueError(f"element {name} has too few nodes")
                    block = elements.setdefault(keyword, [])
                    cells[name] = (keyword, len(block))
                    block.append((name, [nodes[corner] for corner in corners]))
            elif keyword in groups and words:
                name, *members = words
                groups[keyword].setdefault(name, []).extend(members)
            elif keyword not in ("TITRE", "GROUP_NO", "GROUP_MA"):
                raise ValueError(f"{keyword} is not known; known are COOR_2D, COOR_3D, {', '.join(_KINDS)} and groups")
        except KeyError as error:
            raise MeshError(f"{file}: line {line}: {keyword}: there is no node {error}") from None
        except ValueError as error:
            raise MeshError(f"{file}: line {line}: {keyword}: {error}") from None
    if not points or not elements:
        raise MeshError(f"{file}: it has no nodes or no elements: is it a mesh of code_aster?")
    kinds = list(elements)
    blocks = []
    for keyword in kinds:
        table = np.array([row for _, row in elements[keyword]], dtype=np.int64)
        blocks.append((_KINDS[keyword][0], table[:, _KINDS[keyword][1]]))
    raw = RawMesh(np.array(points), blocks)
    for name, members in groups["GROUP_MA"].items():
        rows: list[list[int]] = [[] for _ in kinds]
        for member in members:
            if member not in cells:
                raise MeshError(f"{file}: GROUP_MA {name}: there is no element {member}")
            keyword, row = cells[member]
            rows[kinds.index(keyword)].append(row)
        raw.sets[name] = [np.unique(np.array(part, dtype=np.int64)) for part in rows]
    for name, members in groups["GROUP_NO"].items():
        missing = next((member for member in members if member not in nodes), None)
        if missing is not None:
            raise MeshError(f"{file}: GROUP_NO {name}: there is no node {missing}")
        raw.node_sets[name] = np.unique(np.array([nodes[member] for member in members], dtype=np.int64))
    return raw


def _sections(text: str) -> Iterator[tuple[int, str, list[str]]]:
    """Line, keyword and words of each section."""
    begun, keyword, words = 0, "", list[str]()
    for number, full_line in enumerate(text.splitlines(), 1):
        line = full_line.partition("%")[0]
        parts = line.split()
        if not parts:
            continue
        if keyword == "TITRE" and parts[0] != _END:
            continue
        for k, part in enumerate(parts):
            if part.upper() == "FIN" and not keyword:
                return
            if part.upper() == _END:
                yield begun, keyword, words
                keyword, words = "", []
            elif not keyword:
                begun, keyword = number, part.upper()
                attributes = [word.partition("=")[2] for word in parts[k:] if word.upper().startswith("NOM=")]
                words = [name for name in attributes if name]
                if any("=" in word for word in parts[k:]):  # NOM=, NBOBJ= and so on fill the line
                    break
            elif "=" not in part:
                words.append(part)
