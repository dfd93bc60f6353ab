"""Mesh files, read into arrays by gmsh, by meshio and by the add-on for decks.  No dolfinx here."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping
from pathlib import Path

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.extensions import add_on
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, Selection, from_raw
from signorini_fx.mechanics.mesh.files.gmsh_reader import CAD, read_gmsh
from signorini_fx.mechanics.mesh.files.meshio_reader import read_meshio
from signorini_fx.mechanics.mesh.files.raw import RawMesh
from signorini_fx.mechanics.mesh.files.shape import is_straight
from signorini_fx.mechanics.mesh.files.size_field import SizeField, Sizes
from signorini_fx.mechanics.mesh.halving import halved, straightened
from signorini_fx.mechanics.statement.mesh_sources import DRAWN

# Name of a boundary or region -> its tags.
Tags = dict[str, tuple[int, ...]]


def read_file(
    file: Path,
    boundaries: Mapping[str, Selection] | None = None,
    regions: Mapping[str, Selection] | None = None,
    data: str | None = None,
    halvings: int = 0,
    degree: int | None = None,
    size: float | None = None,
    sections: Collection[str] = (),
    sizes: Sizes = (),
    *,
    joined: bool = False,
) -> MeshArrays:
    """A mesh in 2D or in 3D from a file, the format by its suffix.

    A drawing (.geo, .step, .stp, .brep) is meshed again, on the true shape; the cells of other meshes are divided, on
    their own curved sides.  With ``joined`` solids of a CAD drawing that touch or overlap share faces; the other
    arguments are those of ``read_mesh``.

    Raises:
        MeshError: there is no such file, it cannot be read, or it is not a mesh of one kind of cell.
        SceneError: a selection is empty, or a length cannot be had.
    """
    suffix = file.suffix.lower()
    if suffix not in _FORMATS:
        raise MeshError(f"{file}: unknown mesh format {file.suffix!r}; known are {', '.join(sorted(_FORMATS))}")
    if not os.path.isfile(file):  # a name may be of any length
        raise MeshError(f"{file}: no such file")
    if size is not None and not 0 < size < math.inf:
        raise SceneError([("mesh.size", f"a positive length is expected, got {size:g}")])
    if size is not None and suffix not in CAD:
        suffixes = ", ".join(CAD)
        raise SceneError(
            [("mesh.size", f"a {file.suffix} file determines the size of its cells; a size is for {suffixes}")]
        )
    if suffix not in DRAWN and not isinstance(sizes, SizeField) and sizes:
        message = (
            f"a {file.suffix} file has its cells already: give its drawing ({', '.join(DRAWN)}), or let "
            "[accuracy] with refinement = 'adaptive' divide straight triangles or tetrahedra"
        )
        raise SceneError([(sizes[0].path, message)])

    def named(raw: RawMesh) -> MeshArrays:
        return from_raw(raw, str(file), boundaries, regions, data, sections)

    if suffix in DRAWN:
        drawn = read_gmsh(file, named, halvings, degree, size, sizes, joined=joined)
        # Nodes between the corners are for curves.
        return straightened(drawn) if degree == 2 and is_straight(drawn.points, drawn.cells, drawn.cell) else drawn
    if suffix == ".msh":
        mesh = read_gmsh(file, named)
    else:
        mesh = named(add_on("deck_files").read_mesh(file) if suffix == ".inp" else read_meshio(file, suffix[1:]))
    if degree == 1:
        mesh = straightened(mesh)
    for _ in range(halvings):
        mesh = halved(mesh)
    return mesh


def files_of(file: Path) -> list[Path]:
    """A file of a mesh or of anything else, and what it includes as an Abaqus input file.

    Raises:
        MeshError: what it includes cannot be read.
    """
    return list(add_on("deck_files").files_of(file)) if file.suffix.lower() == ".inp" else [file]


_FORMATS = (*DRAWN, ".inp", ".med", ".msh", ".vtu", ".xdmf")
