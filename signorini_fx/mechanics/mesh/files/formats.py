"""Mesh files: read into arrays and written, by gmsh, by meshio, and by the add-on for decks.  No dolfinx here."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Collection, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.extensions import add_on
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, Selection, combinations, from_raw, plain
from signorini_fx.mechanics.mesh.files.gmsh_reader import CAD, read_gmsh
from signorini_fx.mechanics.mesh.files.gmsh_session import gmsh_session
from signorini_fx.mechanics.mesh.files.meshio_reader import meshio_format, read_meshio
from signorini_fx.mechanics.mesh.files.raw import RawMesh
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints, is_straight
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
    their own curved sides.

    Args:
        file: .msh or .geo (gmsh), .step, .stp or .brep (CAD), .inp (Abaqus), .med (Salome), .vtu, .xdmf.
        boundaries: names for boundaries, by a number in the cell data or by a rule (see ``from_raw``).
        regions: the same for parts of the body.
        data: the cell data that numbers refer to.
        halvings: how often the sides of all cells are halved.
        degree: of the geometry: 1: straight sides; 2 (drawings only): nodes between the corners as well, if there are
            curves; None: as the file has it, 1 for a drawing of a CAD program.
        size: length of the cells of a .step, .stp or .brep; None: a fraction of the size of the body.
        sections: names of the file whose facets inside the body are wanted, too.
        sizes: of a drawing the lengths of facets of some boundaries, or of all cells.
        joined: whether solids of a CAD drawing that touch or overlap share faces.

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


def write_file(mesh: MeshArrays, file: Path) -> None:
    """Write a mesh with its names, the format by its suffix.

    Raises:
        MeshError: the format is unknown or cannot hold the mesh, or the file cannot be written.
    """
    writer = _WRITERS.get(file.suffix.lower())
    if writer is None:
        raise MeshError(f"{file}: cannot write {file.suffix!r}; can write {', '.join(sorted(_WRITERS))}")
    try:
        writer(mesh, file)
    except OSError as error:
        raise MeshError(f"{file}: cannot be written: {error.strerror or error}") from None


# --- gmsh ------------------------------------------------------------------------------------------------------------


def _draw(gmsh: Any, mesh: MeshArrays) -> None:
    """Draw a mesh in the current gmsh model: one entity for each combination of names, which are physical groups."""
    sides, boundaries = combinations(mesh.boundaries, len(mesh.facets))
    parts, regions = combinations(mesh.regions, len(mesh.cells))
    parts = parts + 1  # cells without a name belong to the body too
    regions = {name: tuple(tag + 1 for tag in tags) for name, tags in regions.items()}
    x = _in_space(mesh.points)
    where = int(parts.min())
    for cell, nodes, tags in ((mesh.cell, mesh.cells, parts), (mesh.facet, mesh.facets, sides)):
        for tag in plain(np.unique(tags[tags > 0])):
            gmsh.model.addDiscreteEntity(cell.dim, tag)
            if (cell.dim, tag) == (mesh.dim, where):
                gmsh.model.mesh.addNodes(mesh.dim, tag, np.arange(1, len(x) + 1), x.ravel())
            of_gmsh = nodes[tags == tag][:, cell.gmsh_order] + 1
            gmsh.model.mesh.addElementsByType(tag, cell.gmsh, [], of_gmsh.ravel())
    named_parts = regions or {"body": tuple(plain(np.unique(parts)))}
    for dim, named in ((mesh.dim - 1, boundaries), (mesh.dim, named_parts)):
        for name, entities in named.items():
            if entities:
                gmsh.model.addPhysicalGroup(dim, list(entities), name=name)


def _in_space(points: Floats) -> Floats:
    """Points with three coordinates."""
    x = np.zeros((len(points), 3))
    x[:, : points.shape[1]] = points
    return x


def _write_gmsh(mesh: MeshArrays, file: Path) -> None:
    with gmsh_session() as gmsh:
        _draw(gmsh, mesh)
        try:
            # Cells without any physical group would be left out.
            gmsh.option.setNumber("Mesh.SaveAll", 0 if _all_named(mesh) else 1)
            gmsh.write(str(file))
        except Exception as error:
            raise MeshError(f"{file}: cannot be written: {error}") from None


def _all_named(mesh: MeshArrays) -> bool:
    covered = np.zeros(len(mesh.cells), dtype=bool)
    for rows in mesh.regions.values():
        covered[rows] = True
    return bool(covered.all()) or not mesh.regions


# --- meshio ----------------------------------------------------------------------------------------------------------


def _write_meshio(kind: str, mesh: MeshArrays, file: Path) -> None:
    module = meshio_format(kind)
    import meshio

    if kind == "xdmf" and mesh.degree > 1:  # meshio cannot read it again
        raise MeshError(f"{file}: xdmf cannot hold cells of kind {mesh.kind} beside their facets: use .vtu or .msh")
    sides, boundaries = combinations(mesh.boundaries, len(mesh.facets))
    families, regions = combinations(mesh.regions, len(mesh.cells))
    named_facets = np.flatnonzero(sides)
    blocks = [(mesh.kind, mesh.cells)] + ([(mesh.facet.kind, mesh.facets[named_facets])] if named_facets.size else [])
    out = meshio.Mesh(mesh.points, blocks)
    if kind == "med":  # families count down from -1
        top = int(families.max(initial=0))
        numbers = [-families, -(sides[named_facets] + top)]
        out.cell_data = {"cell_tags": numbers[: len(blocks)]}
        groups: dict[int, list[str]] = {}
        for shift, named in ((0, regions), (top, boundaries)):
            for name, tags in named.items():
                for tag in tags:
                    groups.setdefault(-(tag + shift), []).append(name)
        out.cell_tags = groups
    else:
        columns: dict[str, list[Ints]] = {}
        for name, rows in mesh.regions.items():
            columns[f"region:{name}"] = [
                _marked(len(mesh.cells), rows),
                np.zeros(len(named_facets), dtype=np.int64),
            ]
        for name, rows in mesh.boundaries.items():
            columns[f"boundary:{name}"] = [
                np.zeros(len(mesh.cells), dtype=np.int64),
                _marked(len(sides), rows)[named_facets],
            ]
        out.cell_data = {name: values[: len(blocks)] for name, values in columns.items()}
        if kind == "vtu":
            out.points = _in_space(mesh.points)
    try:
        module.write(str(file), out)
    except (KeyError, meshio.WriteError) as error:
        raise MeshError(f"{file}: {kind} cannot hold cells of kind {mesh.kind} ({error})") from None


def _marked(count: int, rows: Ints) -> Ints:
    marks = np.zeros(count, dtype=np.int64)
    marks[rows] = 1
    return marks


_FORMATS = (*DRAWN, ".inp", ".med", ".msh", ".vtu", ".xdmf")
_WRITERS: dict[str, Callable[[MeshArrays, Path], None]] = {
    ".inp": lambda mesh, file: add_on("deck_files").write_mesh(mesh, file),
    ".med": partial(_write_meshio, "med"),
    ".msh": _write_gmsh,
    ".vtu": partial(_write_meshio, "vtu"),
    ".xdmf": partial(_write_meshio, "xdmf"),
}
