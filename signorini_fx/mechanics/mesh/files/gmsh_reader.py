"""gmsh files, within the process that reads them: ``reading_process``."""

from __future__ import annotations

import importlib
import resource
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.mechanics.mesh.files.cells import CELLS
from signorini_fx.mechanics.mesh.files.cutting import BETWEEN, CORNERS, shape_of
from signorini_fx.mechanics.mesh.files.raw import RawMesh
from signorini_fx.mechanics.mesh.files.shape import Ints
from signorini_fx.mechanics.mesh.files.size_field import SizeField
from signorini_fx.tuned import BYTES_PER_CELL, DIGITS_OF_FILES, TETRAHEDRON_VOLUME

# Drawings of CAD programs, by what OpenCASCADE calls them.
CAD = {".step": "step", ".stp": "step", ".brep": "brep"}
# A body's diagonal is so many cells long where no size is given.
_CELLS_ALONG = 25
# The length, area and volume of a line, a triangle and a tetrahedron with edges of length 1.
_CONTENT = {1: 1.0, 2: 0.43, 3: TETRAHEDRON_VOLUME}
# Where the surface is curved, so many cells are a full turn.
_TO_A_TURN = 16
# More triangles or lines than this are many.
_FEW = 5_000
# Elements by gmsh's number, in meshio's words.
_TYPES = {1: "line", 2: "triangle", 3: "quad", 8: "line3", 9: "triangle6", 10: "quad9", 15: "vertex", 16: "quad8"}
_TYPES |= {4: "tetra", 5: "hexahedron", 6: "wedge", 7: "pyramid", 11: "tetra10", 12: "hexahedron27"}
_TYPES |= {13: "wedge18", 14: "pyramid14", 17: "hexahedron20", 18: "wedge15", 19: "pyramid13"}


def load_libraries(_suffix: str) -> None:
    """Load gmsh, which reads none of its files of options."""
    gmsh = importlib.import_module("gmsh")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.RandomSeed", 1)


def files_of(file: Path) -> list[Path]:
    """The files that are opened."""
    return [file]


def read(
    file: Path, halvings: int, degree: int, size: float, *, skin: bool = False, sizes: SizeField | None = None
) -> RawMesh:
    """The content of a mesh, or of a drawing after gmsh has meshed it; physical groups are sets.

    Args:
        file: what it is, its suffix says.
        halvings: how often the cells that gmsh makes of a drawing are divided.
        degree: 2: they get nodes between their corners; 1: they get none; 0: as the drawing asks for.
        size: length of the cells of a CAD drawing; 0: a fraction of the size of the body.
        skin: of a CAD drawing only its ``_skin``.
        sizes: lengths of the cells of a drawing that take the place of its own; None: there are none.

    Raises:
        ValueError: gmsh cannot read it.
    """
    gmsh = importlib.import_module("gmsh")
    corners: dict[int, Any] = {}
    try:
        suffix = file.suffix.lower()
        if skin:
            return _skin(gmsh, str(file), CAD[suffix], size)
        if suffix in CAD:
            corners = _import(gmsh, str(file), CAD[suffix], size)
        else:
            gmsh.merge(str(file))
        if suffix in CAD or suffix == ".geo":
            if sizes is not None:
                sizes.apply(gmsh)
            _mesh(gmsh, halvings, degree)
    except Exception as error:
        reason = str(error).replace(f"'{file}', ", "")
        raise ValueError(f"gmsh cannot read it: {reason}") from None
    return content(gmsh, corners)


def content(gmsh: Any, corners: dict[int, Any] | None = None) -> RawMesh:
    """The mesh of the current model; physical groups are sets.

    Args:
        gmsh: the module.
        corners: see ``RawMesh``.

    Raises:
        ValueError: two nodes have the same number.
    """
    tags, x, _ = gmsh.model.mesh.getNodes()
    tags = np.asarray(tags, dtype=np.int64)
    order = np.argsort(tags)
    if (np.diff(tags[order]) == 0).any():
        raise ValueError("two nodes have the same number")
    grouped = {dim for dim, _ in gmsh.model.getPhysicalGroups()}
    # Boundaries have one dimension less than the body.
    top = 3 if len(gmsh.model.mesh.getElementTypes(3)) else 2
    blocks: list[Any] = []
    physical: list[Any] = []
    members: dict[str, list[int]] = {}
    for dim, entity in gmsh.model.getEntities():
        numbers = [int(tag) for tag in gmsh.model.getPhysicalGroupsForEntity(dim, entity)]
        if dim < top - 1 or ((dim in grouped or dim < top) and not numbers):
            continue
        types, _, nodes = gmsh.model.mesh.getElements(dim, entity)
        for kind, flat in zip(types, nodes, strict=True):
            name, _, _, count, local, _ = gmsh.model.mesh.getElementProperties(kind)
            for tag in numbers:
                label = gmsh.model.getPhysicalName(dim, tag) or f"{'boundary' if dim < top else 'region'}_{tag}"
                members.setdefault(label, []).append(len(blocks))
            rows = _places(tags, order, np.asarray(flat, dtype=np.int64)).reshape(-1, count)
            order_here = _order(_TYPES.get(int(kind), name), np.reshape(local, (count, -1)))
            blocks.append((_TYPES.get(int(kind), name), rows[:, order_here]))
            physical.append(np.tile(np.array(numbers or [-1], dtype=np.int64), (len(rows), 1)))
    all_rows: list[Ints] = [np.arange(len(nodes)) for _, nodes in blocks]
    no_rows: Ints = np.empty(0, dtype=np.int64)
    sets = {
        name: [rows if k in numbers else no_rows for k, rows in enumerate(all_rows)]
        for name, numbers in members.items()
    }
    return RawMesh(np.asarray(x).reshape(-1, 3), blocks, sets, {}, {"gmsh:physical": physical}, corners or {})


def _order(kind: str, places: Any) -> Any:
    """Node k of an element here is the node with this number in gmsh, whose nodes are at these places of its cell."""
    if kind in CELLS:
        return np.argsort(CELLS[kind].gmsh_order)
    if (shape := shape_of(kind)) not in BETWEEN:
        return np.arange(len(places))
    corners = CORNERS[shape]
    middles = [places[list(between)].mean(axis=0) for between in BETWEEN[shape][: len(places) - corners]]
    return [*range(corners), *(int(np.argmin(np.linalg.norm(places - x, axis=1))) for x in middles)]


def _import(gmsh: Any, file: str, form: str, size: float) -> dict[int, Any]:
    """Import a CAD drawing; each surface is a physical group with its number, and so is each solid.

    Returns:
        Surface -> its vertices, by which names of the file can be assigned.
    """
    top, length, _ = _drawn(gmsh, file, form, size, 0)
    _set_sizes(gmsh, length, 1)
    for dim in (top, top - 1):
        for _, tag in gmsh.model.getEntities(dim):
            name = gmsh.model.getEntityName(dim, tag).rpartition("/")[2]
            if name.startswith("Open CASCADE STEP translator"):  # what the library writes for a part without a name
                name = ""
            gmsh.model.addPhysicalGroup(dim, [tag], tag, name if dim == top else "")
    corners = {}
    for _, tag in gmsh.model.getEntities(2):
        ends = gmsh.model.getBoundary([(2, tag)], combined=False, oriented=False, recursive=True)
        corners[tag] = [list(gmsh.model.getValue(0, point, [])) for point in sorted({end for _, end in ends})]
    return corners


def _drawn(gmsh: Any, file: str, form: str, size: float, codimension: int) -> tuple[int, float, float]:
    """Import a CAD drawing.

    Args:
        gmsh: the module.
        file: the drawing.
        form: its format.
        size: length of the cells; 0: a fraction of the size of the body.
        codimension: 0: the body is to be meshed; 1: its skin, which has one dimension less, and where its solids (or
            faces in a plane) that touch or overlap are divided into ones that share faces (or curves).

    Returns:
        The dimension of the body, the length of the cells, and about how many there will be.

    Raises:
        ValueError: there is no body, or too many cells for the memory.
    """
    shapes = gmsh.model.occ.importShapes(file, highestDimOnly=True, format=form)
    gmsh.model.occ.synchronize()
    top = max((dim for dim, _ in shapes), default=0)
    if codimension and len(shapes) > 1:
        gmsh.model.occ.removeAllDuplicates()
        gmsh.model.occ.synchronize()
        if not any(_is_inner(gmsh, top - 1, tag) for _, tag in gmsh.model.getEntities(top - 1)):
            # Solids that have only a line in common stay apart: their surfaces would not be closed along it.
            gmsh.clear()
            gmsh.model.occ.importShapes(file, highestDimOnly=True, format=form)
            gmsh.model.occ.synchronize()
    if top < 2:
        raise ValueError("it has neither solids nor faces")
    low, high = (gmsh.model.getBoundingBox(-1, -1)[k : k + 3] for k in (0, 3))
    length = size or sum((b - a) ** 2 for a, b in zip(low, high, strict=True)) ** 0.5 / _CELLS_ALONG
    sizes = [(gmsh.model.occ.getMass(dim, tag), dim) for dim, tag in gmsh.model.getEntities(top - codimension)]
    with np.errstate(over="ignore"):
        cells = sum((np.float64(abs(mass)) ** (1 / dim) / length) ** dim / _CONTENT[dim] for mass, dim in sizes)
    if BYTES_PER_CELL * cells > resource.getrlimit(resource.RLIMIT_AS)[0]:
        raise ValueError(
            f"cells of size {length:g} would be about {cells:.2g}, too many for the memory: use larger ones"
        )
    return top, length, cells


def _is_inner(gmsh: Any, dim: int, tag: int) -> bool:
    """Whether a face is between two solids, or a curve between two faces."""
    return len(gmsh.model.getAdjacencies(dim, tag)[0]) > 1


def _set_sizes(gmsh: Any, length: float, times: int) -> None:
    """Cells are so many times a length, and smaller where the surface is curved, by a factor of 8 at most."""
    gmsh.option.setNumber("Mesh.MeshSizeMax", times * length)
    gmsh.option.setNumber("Mesh.MeshSizeMin", times * length / 8)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", _TO_A_TURN / times)


def _skin(gmsh: Any, file: str, form: str, size: float) -> RawMesh:
    """Triangles on the surface of the solids of a CAD drawing, or lines around its plane faces, counterclockwise.

    Where they are many, triangles are made of a coarse mesh, whose cells gmsh divides on the true shape, and the lines
    of a curve are of one length: this takes a tenth of the time.

    Raises:
        ValueError: it has neither solids nor faces in a plane.
    """
    top, length, cells = _drawn(gmsh, file, form, size, 1)
    extents = np.diff(np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3)), axis=0)[0]
    if top == 2 and extents[2] > DIGITS_OF_FILES * max(extents):
        raise ValueError("it has no solids, and its faces are in no plane x[2] = constant")
    halvings = 0 if top == 2 else int(np.clip(np.log2(max(cells / _FEW, 1.0)) / 2, 0, 3))
    _set_sizes(gmsh, length, 2**halvings)
    if top == 2 and cells > _FEW:
        for _, curve in gmsh.model.getEntities(1):
            least = 1 if gmsh.model.getType(1, curve) == "Line" else _TO_A_TURN
            count = max(int(np.ceil(gmsh.model.occ.getMass(1, curve) / length)), least)
            gmsh.model.mesh.setTransfiniteCurve(curve, count + 1)
    gmsh.model.mesh.generate(top - 1)
    for _ in range(halvings):
        gmsh.model.mesh.refine()
    tags, x, _ = gmsh.model.mesh.getNodes()
    points, order = np.asarray(x).reshape(-1, 3), np.argsort(tags)
    blocks: list[Any] = []
    for face in (tag for _, tag in gmsh.model.getEntities(2)):
        if top == 2:
            around = gmsh.model.getBoundary([(2, face)], combined=False, oriented=True)
            lines = [gmsh.model.mesh.getElementsByType(1, abs(tag))[1].reshape(-1, 2) for _, tag in around]
            turned = [nodes[:, :: 1 if tag > 0 else -1] for (_, tag), nodes in zip(around, lines, strict=True)]
            rows = _places(tags, order, np.concatenate(turned).ravel()).reshape(-1, 2)
            begin, end = points[rows, :2].transpose(1, 0, 2)
            area = np.sum(begin[:, 0] * end[:, 1] - begin[:, 1] * end[:, 0])
            blocks.append(("line", rows if area > 0 else rows[:, ::-1]))
        elif not _is_inner(gmsh, 2, face):
            nodes = gmsh.model.mesh.getElementsByType(2, face)[1]
            blocks.append(("triangle", _places(tags, order, nodes).reshape(-1, 3)))
    return RawMesh(points, blocks)


def _mesh(gmsh: Any, halvings: int, degree: int) -> None:
    """Mesh the drawing."""
    if degree:  # a script's own order would interfere with the division, and with the kinds of cells
        gmsh.option.setNumber("Mesh.ElementOrder", 1)
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 0)
    top = 3 if gmsh.model.getEntities(3) else 2
    gmsh.model.mesh.generate(top)
    for _ in range(halvings):
        gmsh.model.mesh.refine()
    if degree:
        gmsh.model.mesh.setOrder(degree)
    if top == 3:
        _untangle(gmsh)


def _untangle(gmsh: Any) -> None:
    """Move the nodes between the corners where a curved cell has been turned inside out."""
    for kind in gmsh.model.mesh.getElementTypes(3):
        tags, _ = gmsh.model.mesh.getElementsByType(kind)
        if gmsh.model.mesh.getElementProperties(kind)[2] > 1 and not all(
            gmsh.model.mesh.getElementQualities(tags, "minDetJac") > 0
        ):
            gmsh.model.mesh.optimize("HighOrder")


def _places(tags: Any, order: Any, wanted: Any) -> Any:
    """Where the nodes with these numbers are; -1 for one that is not there."""
    if not len(tags):
        return np.full(len(wanted), -1)
    places = order[np.searchsorted(tags, wanted, sorter=order).clip(max=len(tags) - 1)]
    return np.where(tags[places] == wanted, places, -1)
