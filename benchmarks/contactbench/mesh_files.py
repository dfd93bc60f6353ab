"""Writes meshes as ``.msh`` (gmsh, version 2.2) and ``.inp`` (Abaqus, CalculiX)."""

from __future__ import annotations

from pathlib import Path

from benchmarks.contactbench.grids import Grid

# Types of gmsh by corners, of cells and of facets.
_CELLS = {(2, 4): 3, (3, 8): 5}
_FACETS = {2: 1, 4: 3}
ABAQUS = {
    ("plane strain", 4): "CPE4",
    ("plane stress", 4): "CPS4",
    ("axisymmetric", 4): "CAX4",
    ("space", 8): "C3D8",
}
# Faces of elements of Abaqus by their corners.
FACES = {
    4: ((0, 1), (1, 2), (2, 3), (3, 0)),
    8: ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
}


def write_msh(grid: Grid, path: Path) -> None:
    """Write a mesh of gmsh; boundaries and bodies are physical groups with their names."""
    dimension, boundaries = grid.dimension, sorted(grid.facets)
    groups = [(dimension - 1, name) for name in boundaries] + [(dimension, name) for name in grid.names]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(groups))]
    lines += [f'{dim} {tag} "{name}"' for tag, (dim, name) in enumerate(groups, 1)]
    lines += ["$EndPhysicalNames", "$Nodes", str(len(grid.points))]
    for number, point in enumerate(grid.points.tolist(), 1):
        lines.append(" ".join([str(number), *(repr(c) for c in [*point, 0.0][:3])]))
    rows = [
        (_FACETS[nodes.shape[1]], tag, row)
        for tag, name in enumerate(boundaries, 1)
        for nodes in [grid.facets[name]]
        for row in (nodes + 1).tolist()
    ]
    kind = _CELLS[dimension, grid.cells.shape[1]]
    owners = (grid.body + len(boundaries) + 1).tolist()
    rows += [(kind, tag, row) for tag, row in zip(owners, (grid.cells + 1).tolist(), strict=True)]
    lines += ["$EndNodes", "$Elements", str(len(rows))]
    for number, (kind, tag, row) in enumerate(rows, 1):
        lines.append(f"{number} {kind} 2 {tag} {tag} {' '.join(map(str, row))}")
    path.write_text("\n".join([*lines, "$EndElements"]) + "\n", encoding="utf-8")


def field(number: float) -> str:
    """A number in the 20 characters that Abaqus and CalculiX read."""
    return f"{number:.12g}"


def inp_lines(grid: Grid, hypothesis: str) -> list[str]:
    """Nodes, elements, node sets (N_ and the name) and surfaces (S_ and the name) of a deck."""
    lines = ["*NODE"]
    lines += [f"{n}, {', '.join(map(field, point))}" for n, point in enumerate(grid.points.tolist(), 1)]
    element = ABAQUS[hypothesis, grid.cells.shape[1]]
    for number, name in enumerate(grid.names):
        lines.append(f"*ELEMENT, TYPE={element}, ELSET={name.upper()}")
        own = [k for k, body in enumerate(grid.body.tolist()) if body == number]
        lines += [f"{k + 1}, {', '.join(str(node + 1) for node in grid.cells[k].tolist())}" for k in own]
    faces = {
        frozenset(row[list(face)].tolist()): (number, side)
        for number, row in enumerate(grid.cells, 1)
        for side, face in enumerate(FACES[grid.cells.shape[1]], 1)
    }
    for name, facets in sorted(grid.facets.items()):
        lines.append(f"*NSET, NSET=N_{name.upper()}")
        lines += [f"{node + 1}," for node in grid.nodes(name).tolist()]
        lines.append(f"*SURFACE, NAME=S_{name.upper()}, TYPE=ELEMENT")
        lines += ["{}, S{}".format(*faces[frozenset(row)]) for row in facets.tolist()]
    return lines


def write_inp(grid: Grid, hypothesis: str, path: Path) -> None:
    """Write a mesh as Abaqus and CalculiX read it."""
    path.write_text("\n".join(inp_lines(grid, hypothesis)) + "\n", encoding="utf-8")
