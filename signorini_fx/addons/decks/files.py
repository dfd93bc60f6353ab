"""Meshes in Abaqus input files: read, and written with their names."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from signorini_fx.addons.decks.mesh import faces_of, read_mesh
from signorini_fx.addons.decks.text import files_of
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, plain
from signorini_fx.mechanics.mesh.files.raw import rows_of
from signorini_fx.mechanics.mesh.files.shape import Ints


def write_mesh(mesh: MeshArrays, file: Path) -> None:
    """Write solid or plane strain elements, regions as element sets, boundaries as node sets and as surfaces.

    Raises:
        MeshError: quadrilaterals with nine nodes or hexahedra with 27, which Abaqus does not have.
    """
    if mesh.kind in ("quad9", "hexahedron27"):
        raise MeshError(f"{file}: .inp cannot hold cells of kind {mesh.kind}: use .vtu or .msh")
    lines = ["*HEADING", "*NODE"]
    lines += [f"{n}, {', '.join(map(repr, x))}" for n, x in enumerate(plain(mesh.points), start=1)]
    lines.append(f"*ELEMENT, TYPE={'CPE' if mesh.dim == 2 else 'C3D'}{mesh.cells.shape[1]}")
    lines += [f"{n}, {', '.join(map(str, row))}" for n, row in enumerate(plain(mesh.cells + 1), start=1)]
    for name, cells in mesh.regions.items():
        lines += [f"*ELSET, ELSET={_quoted(name)}", *_wrapped(cells + 1)]
    faces = faces_of(mesh.kind)
    sides = mesh.cells[:, np.array(faces)].reshape(-1, len(faces[0]))
    where = rows_of(mesh.facet_corners, sides)
    for name, rows in mesh.boundaries.items():
        lines += [f"*NSET, NSET={_quoted(name)}", *_wrapped(np.unique(mesh.facets[rows]) + 1)]
        lines.append(f"*SURFACE, TYPE=ELEMENT, NAME={_quoted(name)}")
        lines += [f"{side // len(faces) + 1}, S{side % len(faces) + 1}" for side in plain(where[rows])]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"\w[\w-]*", name) else f'"{name}"'


def _wrapped(numbers: Ints) -> list[str]:
    """Sixteen per line, the most that Abaqus accepts."""
    return [", ".join(map(str, numbers[n : n + 16])) for n in range(0, len(numbers), 16)]


__all__ = ["files_of", "read_mesh", "write_mesh"]
