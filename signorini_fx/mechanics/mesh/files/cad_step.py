"""Names of faces in a STEP file, which gmsh ignores; faces are identified by their vertices."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from signorini_fx.tuned import DIGITS_OF_FILES

_ENTITY = re.compile(r"#(\d+)\s*=\s*([A-Z_0-9]+)\s*\(((?:[^;']|'(?:[^']|'')*')*)\)\s*;")
_REFERENCE = re.compile(r"#(\d+)")
_NAME = re.compile(r"\s*'((?:[^']|'')*)'")
_NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
# Entities between a face and its vertices: edges, not the curves and surfaces that they are on.
_ON_THE_WAY = ("FACE_BOUND", "FACE_OUTER_BOUND", "EDGE_LOOP", "VERTEX_LOOP", "ORIENTED_EDGE", "EDGE_CURVE")


def names_of_faces(file: Path, corners: Mapping[int, Sequence[Sequence[float]]]) -> dict[int, str]:
    """Which surfaces have a name in a STEP file.

    A face and a surface are the same if they have the same vertices; several that share all of them, as the halves of
    a hole do, are taken in the order of the file.  In a file whose parts are moved into place, as in an assembly,
    the vertices differ from those of its faces, and no names are found.

    Args:
        file: the file.
        corners: surface -> its vertices, in any unit.
    """
    entities = {
        int(number): (kind, text)
        for number, kind, text in _ENTITY.findall(file.read_text(encoding="utf-8", errors="replace"))
    }
    faces = [
        (label.group(1).replace("''", "'"), _vertices(entities, number))
        for number, (kind, text) in entities.items()
        if kind == "ADVANCED_FACE" and (label := _NAME.match(text))
    ]
    everything = [x for _, vertices in faces for x in vertices], [x for points in corners.values() for x in points]
    if not all(everything):
        return {}
    theirs, ours = (float(np.abs(np.array(x)).max()) for x in everything)
    surfaces_at: dict[frozenset[tuple[int, ...]], list[int]] = {}
    for surface in sorted(corners):
        surfaces_at.setdefault(_rounded(corners[surface], ours), []).append(surface)
    names = {}
    for name, vertices in faces:
        candidates = surfaces_at.get(_rounded(vertices, theirs), [])
        if candidates and (surface := candidates.pop(0)) and name.strip():
            names[surface] = name.strip()
    return names


def _rounded(places: Sequence[Sequence[float]], size: float) -> frozenset[tuple[int, ...]]:
    return frozenset(
        tuple(int(value) for value in np.rint(np.array(x) / (DIGITS_OF_FILES * (size or 1.0)))) for x in places
    )


def _vertices(entities: Mapping[int, tuple[str, str]], face: int) -> list[list[float]]:
    """Positions of the vertices of a face, in the file's unit."""
    vertices: list[list[float]] = []
    todo, seen = [face], {face}
    while todo:
        for reference in map(int, _REFERENCE.findall(entities[todo.pop()][1])):
            if reference in seen or reference not in entities:
                continue
            seen.add(reference)
            kind, text = entities[reference]
            if kind in _ON_THE_WAY:
                todo.append(reference)
            elif kind == "VERTEX_POINT":
                point = next((int(r) for r in _REFERENCE.findall(text) if int(r) in entities), None)
                _, _, coordinates = entities[point][1].partition(",") if point is not None else ("", "", "")
                vertices.append([float(value) for value in _NUMBER.findall(coordinates)[:3]])
    return [x for x in vertices if len(x) == 3]
