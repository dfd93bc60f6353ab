"""Files that meshio reads: .med, .vtu, .xdmf, and the triangles of .stl."""

from __future__ import annotations

import contextlib
import importlib
import io
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.cells import CELLS, Cell
from signorini_fx.mechanics.mesh.files.raw import RawMesh, rows_of
from signorini_fx.mechanics.mesh.files.shape import Ints


def read_meshio(file: Path, kind: str) -> RawMesh:
    """The content of a file of a format of meshio.

    The format is called itself, because ``meshio.read`` ends the process if it cannot read a file.

    Raises:
        MeshError: it cannot be read, or meshio or h5py is not installed.
    """
    form = _format(kind)
    try:
        silent = contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO())
        with silent[0], silent[1], np.errstate(over="ignore"):
            grids = _grids(file) if kind == "xdmf" else []
            return _of_grids(file, grids) if len(grids) > 1 else _of_meshio(form.read(str(file)))
    except (Exception, SystemExit) as error:  # meshio passes on whatever its parsers raise
        reason = str(error) or type(error).__name__
        raise MeshError(f"{file}: meshio cannot read it as {kind}: {reason}") from None


def _format(kind: str) -> Any:
    try:
        if kind == "med":
            importlib.import_module("h5py")
        return importlib.import_module(f"meshio.{kind}")
    except ModuleNotFoundError as error:
        raise MeshError(f".{kind} needs the Python package {error.name}: apt install python3-{error.name}") from None


def _of_meshio(mesh: Any) -> RawMesh:
    raw = RawMesh(np.asarray(mesh.points), [(block.type, np.asarray(block.data, np.int64)) for block in mesh.cells])
    for name, arrays in mesh.cell_data.items():
        if all(np.ndim(values) == 1 and np.issubdtype(np.asarray(values).dtype, np.integer) for values in arrays):
            raw.data[name] = [np.asarray(values, dtype=np.int64) for values in arrays]
    # In MED an element, or a node, has the number of a family, and a family belongs to groups.
    families = raw.data.pop("cell_tags", None) if hasattr(mesh, "cell_tags") else None
    for number, groups in mesh.cell_tags.items() if families is not None else ():
        for name in groups:
            rows = [np.flatnonzero(values == number) for values in families or ()]
            raw.sets[name] = [np.union1d(*pair) for pair in zip(raw.sets.get(name, rows), rows, strict=True)]
    nodes = mesh.point_data.get("point_tags")
    for number, groups in mesh.point_tags.items() if nodes is not None else ():
        for name in groups:
            members = np.flatnonzero(np.asarray(nodes) == number)
            raw.node_sets[name] = np.union1d(raw.node_sets.get(name, members), members)
    return raw


def _grids(file: Path) -> list[ElementTree.Element]:
    """The grids of an XDMF file."""
    root = ElementTree.parse(file).getroot()
    for item in root.iter("DataItem"):
        name = (item.text or "").strip().partition(":")[0]
        if item.get("Format") == "HDF" and not (file.parent / name).is_file():
            raise ValueError(f"there is no regular file {name!r}")
    return root.findall("./Domain/Grid")


def _of_grids(file: Path, grids: list[ElementTree.Element]) -> RawMesh:
    """An XDMF file of dolfinx, of whose grids meshio reads the first alone: this is the mesh; the others have elements
    of it or of its boundary, each with a number.
    """
    import h5py

    def values(item: ElementTree.Element | None) -> Any:
        if item is None or not item.text or item.get("Format") != "HDF":
            raise ValueError("a grid has no topology, geometry or numbers in HDF5")
        name, _, path = item.text.strip().partition(":")
        with h5py.File(file.parent / name) as data:
            return data[path][()]

    def topology(grid: ElementTree.Element) -> Ints:
        return np.asarray(values(grid.find("./Topology/DataItem")), dtype=np.int64)

    mesh, *tag_grids = grids
    cells, cell = topology(mesh), _xdmf_cell(mesh)
    if cell is None or cells.shape[1] != len(cell.nodes):
        raise ValueError(f"cells of {cells.shape[1]} nodes")
    raw = RawMesh(np.asarray(values(mesh.find("./Geometry/DataItem"))), [(cell.kind, cells)])
    for grid in tag_grids:
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
