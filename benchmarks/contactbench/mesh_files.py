"""Meshes as ``.msh`` (gmsh) and ``.inp`` (Abaqus, CalculiX)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .grids import Grid

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
    import meshio

    kinds = {2: ("line", "quad"), 3: ("quad", "hexahedron")}[grid.dimension]
    blocks = [(kinds[0], grid.facets[name]) for name in grid.facets]
    blocks += [(kinds[1], grid.cells[grid.body == number]) for number in range(len(grid.names))]
    tags = [np.full(len(nodes), tag) for tag, (_, nodes) in enumerate(blocks, 1)]
    names = {name: np.array([tag, grid.dimension - 1]) for tag, name in enumerate(grid.facets, 1)}
    names |= {
        name: np.array([tag, grid.dimension]) for tag, name in enumerate(grid.names, len(names) + 1)
    }
    points = np.pad(grid.points, ((0, 0), (0, 3 - grid.dimension)))
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    meshio.Mesh(points, blocks, cell_data=data, field_data=names).write(
        path, file_format="gmsh22", binary=False
    )


def field(number: float) -> str:
    """A number in the 20 characters that Abaqus and CalculiX read."""
    return f"{number:.12g}"


def inp_lines(grid: Grid, hypothesis: str) -> list[str]:
    """Nodes, elements, node sets (N_ and the name) and surfaces (S_ and the name) of a deck."""
    lines = ["*NODE"]
    lines += [
        f"{n}, {', '.join(map(field, point))}" for n, point in enumerate(grid.points.tolist(), 1)
    ]
    element = ABAQUS[hypothesis, grid.cells.shape[1]]
    for number, name in enumerate(grid.names):
        lines.append(f"*ELEMENT, TYPE={element}, ELSET={name.upper()}")
        own = [k for k, body in enumerate(grid.body.tolist()) if body == number]
        lines += [
            f"{k + 1}, {', '.join(str(node + 1) for node in grid.cells[k].tolist())}" for k in own
        ]
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
