"""Files that meshio reads, within the process that reads them: ``reading_process``.

The readers of meshio are called format by format, because ``meshio.read`` ends the process if it cannot read a file.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.mesh.files.cells import CELLS, Cell, completed
from signorini_fx.mechanics.mesh.files.raw import RawMesh, rows_of
from signorini_fx.mechanics.mesh.files.shape import Ints

# Prefixes of the names of cell data that represent sets if the format has none: 1 for members.
_PREFIXES = ("boundary:", "region:")
# meshio stores sets there as one number per element, under the joined names of the sets.
_JOINTS = "-#+/"
_HEXAHEDRON_27 = "hexahedron27"


def load_libraries(suffix: str) -> None:
    """Load meshio's reader and what it needs for this format; h5py may be missing if the file does not need it."""
    importlib.import_module(f"meshio.{suffix[1:].lower()}")
    # meshio 5.3 reads these, but does not know that they are solid.
    importlib.import_module("meshio._mesh").topological_dimension.update(wedge15=3, pyramid13=3)
    if suffix.lower() == ".med":  # and it does not know these
        types = importlib.import_module("meshio.med._med").med_to_meshio_type
        types.update(H27=_HEXAHEDRON_27, QU9="quad9", TR7="triangle7")
    with contextlib.suppress(ModuleNotFoundError):
        importlib.import_module("h5py")


def files_of(file: Path) -> list[Path]:
    """The file, and those beside it that contain its data.

    Raises:
        ValueError: it refers to files elsewhere.
    """
    files = {file: ""}
    if file.suffix.lower() == ".xdmf":
        for item in ElementTree.parse(file).getroot().iter():
            form = item.get("Format", item.get("format", "XML")).upper()
            if item.tag.endswith("DataItem") and form != "XML":
                files[_beside(file, (item.text or "").strip().partition(":")[0])] = form
            elif item.tag.endswith("include") and item.get("href"):
                raise ValueError("it includes another file: put everything into one")
    return list(files)


def _beside(file: Path, name: str) -> Path:
    if not name or Path(name).name != name:
        raise ValueError(f"it names the file {name!r}: its data must be in a file beside it")
    path = file.with_name(name)
    if not os.path.isfile(path):
        raise ValueError(f"there is no regular file {name!r} beside it, which it names")
    if path.resolve().parent != file.resolve().parent:
        raise ValueError(f"{name!r} is a link to a file elsewhere: its data must be in a file beside it")
    return path


def read(file: Path, kind: str) -> RawMesh:
    """The content of a file of a format of meshio.

    Raises:
        ValueError: it cannot be read.
    """
    try:
        return _read(file, kind)
    except (Exception, SystemExit) as error:  # meshio passes on whatever its parsers raise
        reason = str(error) or type(error).__name__
        raise ValueError(f"meshio cannot read it as {kind}: {reason}") from None


def _read(file: Path, kind: str) -> RawMesh:
    for path in files_of(file):
        if kind == "med" or (path != file and _is_hdf5(path)):
            _check_hdf5(path)
    if kind == "xdmf" and (several := _grids(file)):
        return _read_grids(file, several)
    try:
        source = _with_dimension(file) if kind == "med" else str(file)
        mesh = importlib.import_module(f"meshio.{kind}").read(source)
    except KeyError as error:
        names = importlib.import_module("meshio.xdmf.common").xdmf_idx_to_meshio_type if kind == "xdmf" else {}
        if error.args[0] not in names:
            raise
        raise ValueError(
            f"cells of kind {names[error.args[0]]} in a topology of type Mixed; write .vtu or .msh, or one kind alone"
        ) from None
    blocks = [(block.type, np.asarray(block.data, dtype=np.int64)) for block in mesh.cells]
    raw = RawMesh(np.asarray(mesh.points), blocks)
    if kind == "med":
        raw.blocks[:] = [
            (kind, in_order(raw.points, nodes) if kind == _HEXAHEDRON_27 else nodes) for kind, nodes in blocks
        ]
    for name, arrays in mesh.cell_data.items():
        if name.startswith(_PREFIXES):
            label = name.partition(":")[2]
            rows = [np.flatnonzero(np.asarray(values)) for values in arrays]
            raw.sets[label] = _union(raw.sets.get(label), rows)
        elif all(np.ndim(values) == 1 and np.issubdtype(np.asarray(values).dtype, np.integer) for values in arrays):
            raw.data[name] = [np.asarray(values, dtype=np.int64) for values in arrays]
    for name in list(raw.data):
        _split_joined(raw, name)
    if kind == "med":
        _name_families(mesh, raw, source)
    return raw


def _with_dimension(file: Path) -> Any:
    """A MED file, or where it does not say how many coordinates a node has, what its nodes say, in memory."""
    import h5py

    with h5py.File(file) as data:
        ensemble = data["ENS_MAA"]
        name = next(iter(ensemble))
        mesh = ensemble[name]
        if len(ensemble) != 1 or "ESP" in mesh.attrs:
            return str(file)
        nodes = mesh["NOE"] if "NOE" in mesh else mesh[next(iter(mesh))]["NOE"]
        count, size = int(nodes["COO"].attrs["NBR"]), int(nodes["COO"].size)
    if count < 1 or size % count or size // count not in (2, 3):
        raise ValueError(f"{size} coordinates of {count} nodes")
    image = io.BytesIO(file.read_bytes())
    with h5py.File(image, "r+") as data:
        data["ENS_MAA"][name].attrs["ESP"] = size // count
    return image


def in_order(points: npt.NDArray[np.float64], cells: Ints) -> Ints:
    """Hexahedra of 27 nodes in the order of VTK: the nodes in the middle of faces are known by their place, because
    programs number them differently.

    Raises:
        ValueError: a node is in the middle of no face.
    """
    full_cell = completed("hexahedron20")
    assert full_cell is not None
    middles = np.einsum("nk,ckd->cnd", full_cell[1][20:], points[cells[:, :20]])
    away = np.linalg.norm(points[cells[:, 20:]][:, :, None] - middles[:, None], axis=3)
    nearest = away.argmin(axis=1)  # which of the seven nodes is in the middle of each face, and of the cell
    if not (np.sort(nearest, axis=1) == np.arange(7)).all():
        raise ValueError("hexahedra of 27 nodes, some of which are in the middle of no face")
    ordered: Ints = np.column_stack((cells[:, :20], np.take_along_axis(cells[:, 20:], nearest, axis=1)))
    return ordered


def _is_hdf5(file: Path) -> bool:
    """Whether a library may take it for HDF5, whatever the file that names it says."""
    import h5py

    return bool(h5py.is_hdf5(file))


# Limits on arrays in an HDF5 file: bytes, and bytes for each byte of the file (they may be compressed).
_BASE_BYTES, _BYTES_PER_BYTE = 1 << 30, 200


def _check_hdf5(file: Path) -> None:
    import h5py

    largest = _BASE_BYTES + _BYTES_PER_BYTE * file.stat().st_size
    with h5py.File(file) as data:
        groups, seen = [data["/"]], set()
        while groups:
            group = groups.pop()
            if (address := h5py.h5o.get_info(group.id).addr) in seen:  # links may be circular
                continue
            seen.add(address)
            for name in group:
                if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
                    raise ValueError(f"{file.name}: {name!r} is in another file")
                member = group.get(name)
                if isinstance(member, h5py.Group):
                    groups.append(member)
                elif isinstance(member, h5py.Dataset):
                    if member.external or member.is_virtual:
                        raise ValueError(f"{file.name}: {name!r} is in another file")
                    if member.nbytes > largest:
                        raise ValueError(f"{file.name}: {name!r} would take {member.nbytes / 1e9:.3g} GB")


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


def _name_families(mesh: Any, raw: RawMesh, source: Any) -> None:
    """The groups of a MED file: an element has the number of a family, and a family belongs to groups."""
    numbers = raw.data.pop("cell_tags", None)
    for family, groups in _groups_of_families(source, "ELEME").items():
        for name in groups if numbers is not None else ():
            rows = [np.flatnonzero(values == family) for values in numbers or ()]
            raw.sets[name] = _union(raw.sets.get(name), rows)
    nodes = mesh.point_data.get("point_tags")
    for family, groups in _groups_of_families(source, "NOEUD").items():
        for name in groups if nodes is not None else ():
            members = np.flatnonzero(np.asarray(nodes) == family)
            raw.node_sets[name] = np.union1d(raw.node_sets.get(name, members), members)


_MED_NAME = 80  # bytes of the name of a group


def _groups_of_families(source: Any, kind: str) -> dict[int, list[str]]:
    """The names of the groups of each family of a MED file.

    Since version 3 they are rows of numbers; before that they are one sequence of characters, of which meshio takes
    each for a name.

    Args:
        source: the file.
        kind: ELEME for those of elements, NOEUD for those of nodes.
    """
    import h5py

    if isinstance(source, io.BytesIO):
        source.seek(0)
    with h5py.File(source) as data:
        name = next(iter(data["ENS_MAA"]))
        mesh = data["ENS_MAA"][name]
        mesh = mesh if "NOE" in mesh else mesh[next(iter(mesh))]
        families = mesh["FAS"] if "FAS" in mesh else data["FAS"][name]
        groups: dict[int, list[str]] = {}
        for family in families.get(kind, {}).values():
            if "GRO" in family:
                text = family["GRO"]["NOM"][()].tobytes()
                count = int(family["GRO"].attrs["NBR"])
                names = [text[k * _MED_NAME : (k + 1) * _MED_NAME] for k in range(count)]
                words = (part.partition(b"\0")[0].decode("latin-1").strip() for part in names)
                groups[int(family.attrs["NUM"])] = list(words)
        return groups
