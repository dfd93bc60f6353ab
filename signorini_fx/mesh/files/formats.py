"""Mesh files: read into arrays and written from them, by gmsh, by meshio, and by ``abaqus``.  No dolfinx here.

The readers of meshio are called format by format, because ``meshio.read`` ends the process if it cannot read a file.
"""

from __future__ import annotations

import importlib
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mesh.files import abaqus, gmsh_files
from signorini_fx.mesh.files.arrays import (
    MeshArrays,
    RawMesh,
    Selection,
    combinations,
    from_raw,
    plain,
    rows_of,
)
from signorini_fx.mesh.files.cells import CELLS, Cell
from signorini_fx.mesh.files.gmsh_session import gmsh_session
from signorini_fx.mesh.files.shape import Floats, Ints
from signorini_fx.mesh.halving import halved, straightened

# Name of a boundary or region -> its tags.
Tags = dict[str, tuple[int, ...]]
# Prefixes of the names of cell data that represent sets if the format has none: 1 for members.
_PREFIXES = ("boundary:", "region:")
# meshio stores sets there as one number per element, under the joined names of the sets.
_JOINTS = "-#+/"


def read_file(
    file: Path,
    boundaries: Mapping[str, Selection] | None = None,
    regions: Mapping[str, Selection] | None = None,
    data: str | None = None,
    halvings: int = 0,
    degree: int | None = None,
    size: float | None = None,
) -> MeshArrays:
    """A mesh in the plane or in space from a file, the format by its suffix.

    A drawing (.geo, .step, .stp, .brep) is meshed again, on the true shape; the cells of other meshes are divided, on
    their own curved sides.

    Args:
        file: .msh or .geo (gmsh), .step, .stp or .brep (CAD), .inp (Abaqus), .med (Salome), .vtu, .xdmf.
        boundaries: names for boundaries, by a number in the cell data or by a rule (see ``from_raw``).
        regions: the same for parts of the body.
        data: the cell data that numbers refer to.
        halvings: how often the sides of all cells are halved.
        degree: of the geometry: 1: straight sides; 2 (drawings only): nodes between the corners as well; None: as the
            file has it, 1 for a drawing of a CAD program.
        size: length of the cells of a .step, .stp or .brep; None: a fraction of the size of the body.

    Raises:
        MeshError: there is no such file, it cannot be read, or it is not a mesh of one kind of cell.
        SceneError: a selection is empty.
    """
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise MeshError(f"{file}: unknown mesh format {file.suffix!r}; known are {', '.join(sorted(_READERS))}")
    if not os.path.isfile(file):  # a name may be of any length
        raise MeshError(f"{file}: no such file")
    if size is not None and not 0 < size < math.inf:
        raise SceneError([("mesh.size", f"a positive length is expected, got {size:g}")])
    if size is not None and file.suffix.lower() not in gmsh_files.CAD:
        known = ", ".join(gmsh_files.CAD)
        raise SceneError(
            [("mesh.size", f"a {file.suffix} file determines the size of its cells; a size is for {known}")]
        )
    if file.suffix.lower() in gmsh_files.DRAWN:
        raw = gmsh_files.read_gmsh(file, halvings, degree, size)
        return from_raw(raw, str(file), boundaries, regions, data)
    mesh = from_raw(reader(file), str(file), boundaries, regions, data)
    if degree == 1:
        mesh = straightened(mesh)
    for _ in range(halvings):
        mesh = halved(mesh)
    return mesh


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


def _meshio(kind: str) -> Any:
    """A format of meshio.

    Raises:
        MeshError: meshio, or h5py which it needs for HDF5, is not installed.
    """
    try:
        if kind == "med":
            importlib.import_module("h5py")
        return importlib.import_module(f"meshio.{kind}")
    except ModuleNotFoundError as error:
        raise MeshError(f".{kind} needs the Python package {error.name}: apt install python3-{error.name}") from None


def _by_meshio(kind: str) -> Callable[[Path], RawMesh]:
    def read(file: Path) -> RawMesh:
        module = _meshio(kind)
        try:
            _check_data_files(file, kind)
            if kind == "xdmf" and (several := _grids(file)):
                return _read_grids(file, several)
            found = module.read(str(file))
            blocks = [(block.type, np.asarray(block.data, dtype=np.int64)) for block in found.cells]
        except (Exception, SystemExit) as error:  # meshio passes on whatever its parsers raise
            reason = str(error) or type(error).__name__
            raise MeshError(f"{file}: meshio cannot read it as {kind}: {reason}") from None
        raw = RawMesh(np.asarray(found.points), blocks)
        for name, arrays in found.cell_data.items():
            if name.startswith(_PREFIXES):
                label = name.partition(":")[2]
                rows = [np.flatnonzero(np.asarray(values)) for values in arrays]
                raw.sets[label] = _union(raw.sets.get(label), rows)
            elif all(np.ndim(values) == 1 and np.issubdtype(np.asarray(values).dtype, np.integer) for values in arrays):
                raw.data[name] = [np.asarray(values, dtype=np.int64) for values in arrays]
        for name in list(raw.data):
            _split_joined(raw, name)
        if kind == "med":
            _name_families(found, raw)
        return raw

    return read


# Limits on arrays in an HDF5 file: bytes, and bytes for each byte of the file (they may be compressed).
_BASE_BYTES, _BYTES_PER_BYTE = 1 << 30, 200


def _check_data_files(file: Path, kind: str) -> None:
    """Check that a file and those that it names contain their data themselves, and not too much of it.

    Raises:
        ValueError: one does not.
    """
    named = {file.name: "HDF"} if kind == "med" else dict[str, str]()
    if kind == "xdmf":
        for item in ElementTree.parse(file).getroot().iter():
            form = item.get("Format", item.get("format", "XML")).upper()
            if item.tag.endswith("DataItem") and form != "XML":
                named[(item.text or "").strip().partition(":")[0]] = form
            elif item.tag.endswith("include") and item.get("href"):
                raise ValueError("it includes another file: put everything into one")
    for name, form in named.items():
        if not name or Path(name).name != name:
            raise ValueError(f"it names the file {name!r}: its data must be in a file beside it")
        if not os.path.isfile(file.with_name(name)):
            raise ValueError(f"there is no regular file {name!r} beside it, which it names")
        if form == "HDF":
            _check_hdf5(file.with_name(name))


def _check_hdf5(file: Path) -> None:
    import h5py

    largest = _BASE_BYTES + _BYTES_PER_BYTE * file.stat().st_size
    with h5py.File(file) as data:
        groups, seen = [data["/"]], set()
        while groups:
            group = groups.pop()
            if (place := h5py.h5o.get_info(group.id).addr) in seen:  # links may be circular
                continue
            seen.add(place)
            for name in group:
                if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
                    raise ValueError(f"{file.name}: {name!r} is in another file")
                found = group.get(name)
                if isinstance(found, h5py.Group):
                    groups.append(found)
                elif isinstance(found, h5py.Dataset):
                    if found.external or found.is_virtual:
                        raise ValueError(f"{file.name}: {name!r} is in another file")
                    if found.nbytes > largest:
                        raise ValueError(f"{file.name}: {name!r} would take {found.nbytes / 1e9:.3g} GB")


def _grids(file: Path) -> list[ElementTree.Element]:
    """The grids of an XDMF file if there are several, as dolfinx writes a mesh and its tags; meshio reads one only."""
    grids = ElementTree.parse(file).getroot().findall("./Domain/Grid")
    return grids if len(grids) > 1 else []


def _read_grids(file: Path, grids: list[ElementTree.Element]) -> RawMesh:
    """The first grid is the mesh; the others have elements of it or of its boundary, each with a number."""
    import h5py

    def values(item: ElementTree.Element | None) -> Any:
        if item is None or not item.text or item.get("Format") != "HDF":
            raise ValueError("a grid has no topology, geometry or numbers in HDF5")
        name, _, path = item.text.strip().partition(":")
        with h5py.File(file.parent / name) as data:
            return data[path][()]

    def topology(grid: ElementTree.Element) -> Ints:
        return np.asarray(values(grid.find("./Topology/DataItem")), dtype=np.int64)

    mesh, *others = grids
    cells, cell = topology(mesh), _xdmf_cell(mesh)
    if cell is None or cells.shape[1] != len(cell.nodes):
        raise ValueError(f"cells of {cells.shape[1]} nodes")
    raw = RawMesh(np.asarray(values(mesh.find("./Geometry/DataItem"))), [(cell.kind, cells)])
    for grid in others:
        elements = topology(grid)
        numbers: Ints = np.asarray(values(grid.find("./Attribute/DataItem")), dtype=np.int64).ravel()
        name = grid.get("Name", "tags")
        absent: list[Ints] = [np.full(len(nodes), -1) for _, nodes in raw.blocks]
        if _xdmf_cell(grid) == cell:
            rows = rows_of(elements, cells)
            if (rows < 0).any():
                raise ValueError(f"{name!r} has cells that the mesh does not have")
            absent[0][rows] = numbers
            raw.data[name] = absent
        else:
            raw.blocks.append((cell.facet, elements))
            raw.data[name] = [*absent, numbers]
    for arrays in raw.data.values():
        arrays += [np.full(len(nodes), -1) for _, nodes in raw.blocks[len(arrays) :]]
    return raw


def _xdmf_cell(grid: ElementTree.Element) -> Cell | None:
    """The kind of cell of a grid, which XDMF calls Triangle, Quadrilateral, Tetrahedron_10 ...; None: another one."""
    topology = grid.find("./Topology")
    word, _, count = (topology.get("TopologyType", "") if topology is not None else "").lower().partition("_")
    kind = {"quadrilateral": "quad", "tetrahedron": "tetra"}.get(word, word)
    return CELLS.get(f"{kind}{count}")


def _union(old: list[Ints] | None, new: list[Ints]) -> list[Ints]:
    return new if old is None else [np.union1d(a, b) for a, b in zip(old, new, strict=True)]


def _split_joined(raw: RawMesh, name: str) -> None:
    """Extract sets from the cell data that meshio makes of them."""
    numbers = raw.data[name]
    largest = max((int(values.max()) for values in numbers if values.size), default=-1)
    for joint in _JOINTS:
        labels = name.split(joint)
        if len(labels) > 1 and len(labels) == largest + 1:
            del raw.data[name]
            for k, label in enumerate(labels):
                raw.sets[label] = [np.flatnonzero(values == k) for values in numbers]
            return


def _name_families(found: Any, raw: RawMesh) -> None:
    """The groups of a MED file: an element has the number of a family, and a family belongs to groups."""
    numbers = raw.data.pop("cell_tags", None)
    for family, groups in found.cell_tags.items():
        for name in groups if numbers is not None else ():
            rows = [np.flatnonzero(values == family) for values in numbers or ()]
            raw.sets[name] = _union(raw.sets.get(name), rows)
    nodes = found.point_data.get("point_tags")
    for family, groups in found.point_tags.items():
        for name in groups if nodes is not None else ():
            own = np.flatnonzero(np.asarray(nodes) == family)
            raw.node_sets[name] = np.union1d(raw.node_sets.get(name, own), own)


def _write_meshio(kind: str) -> Callable[[MeshArrays, Path], None]:
    def write(mesh: MeshArrays, file: Path) -> None:
        module = _meshio(kind)
        import meshio

        if kind == "xdmf" and mesh.degree > 1:  # meshio cannot read it again
            raise MeshError(f"{file}: xdmf cannot hold cells of kind {mesh.kind} beside their facets: use .vtu or .msh")
        sides, boundaries = combinations(mesh.boundaries, len(mesh.facets))
        families, regions = combinations(mesh.regions, len(mesh.cells))
        kept = np.flatnonzero(sides)
        blocks = [(mesh.kind, mesh.cells)] + ([(mesh.facet.kind, mesh.facets[kept])] if kept.size else [])
        out = meshio.Mesh(mesh.points, blocks)
        if kind == "med":  # families count down from -1
            top = int(families.max(initial=0))
            numbers = [-families, -(sides[kept] + top)]
            out.cell_data = {"cell_tags": numbers[: len(blocks)]}
            groups: dict[int, list[str]] = {}
            for shift, named in ((0, regions), (top, boundaries)):
                for name, tags in named.items():
                    for tag in tags:
                        groups.setdefault(-(tag + shift), []).append(name)
            out.cell_tags = groups
        else:
            every: dict[str, list[Ints]] = {}
            for name, rows in mesh.regions.items():
                every[f"region:{name}"] = [_marked(len(mesh.cells), rows), np.zeros(len(kept), dtype=np.int64)]
            for name, rows in mesh.boundaries.items():
                every[f"boundary:{name}"] = [np.zeros(len(mesh.cells), dtype=np.int64), _marked(len(sides), rows)[kept]]
            out.cell_data = {name: values[: len(blocks)] for name, values in every.items()}
            if kind == "vtu":
                out.points = _in_space(mesh.points)
        try:
            module.write(str(file), out)
        except (KeyError, meshio.WriteError) as error:
            raise MeshError(f"{file}: {kind} cannot hold cells of kind {mesh.kind} ({error})") from None

    return write


def _marked(count: int, rows: Ints) -> Ints:
    marks = np.zeros(count, dtype=np.int64)
    marks[rows] = 1
    return marks


_READERS: dict[str, Callable[[Path], RawMesh]] = {
    **dict.fromkeys(gmsh_files.DRAWN, gmsh_files.read_gmsh),
    ".inp": abaqus.read,
    ".med": _by_meshio("med"),
    ".msh": gmsh_files.read_gmsh,
    ".vtu": _by_meshio("vtu"),
    ".xdmf": _by_meshio("xdmf"),
}
_WRITERS: dict[str, Callable[[MeshArrays, Path], None]] = {
    ".inp": abaqus.write,
    ".med": _write_meshio("med"),
    ".msh": _write_gmsh,
    ".vtu": _write_meshio("vtu"),
    ".xdmf": _write_meshio("xdmf"),
}
