"""gmsh files, within the process that reads them: ``reading_process``."""

from __future__ import annotations

import importlib
import resource
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.mesh.files.cells import CELLS
from signorini_fx.mesh.files.cutting import BETWEEN, CORNERS, shape_of
from signorini_fx.mesh.files.raw import RawMesh
from signorini_fx.mesh.files.shape import Ints

# Drawings of CAD programs, by what OpenCASCADE calls them.
CAD = {".step": "step", ".stp": "step", ".brep": "brep"}
# A body's diagonal is so many cells long where no size is given.
_CELLS_ALONG = 25
# The size of a triangle and of a tetrahedron, of those of length 1; and what a cell takes at least until it is solved.
_SHARE, _BYTES_PER_CELL = {2: 0.43, 3: 0.075}, 1000.0
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


def read(file: Path, halvings: int, degree: int, size: float) -> RawMesh:
    """The content of a mesh, or of a drawing after gmsh has meshed it; physical groups are sets.

    Args:
        file: what it is, its suffix says.
        halvings: how often the cells that gmsh makes of a drawing are divided.
        degree: 2: they get nodes between their corners; 1: they get none; 0: as the drawing asks for.
        size: length of the cells of a CAD drawing; 0: a fraction of the size of the body.

    Raises:
        ValueError: gmsh cannot read it.
    """
    gmsh = importlib.import_module("gmsh")
    corners: dict[int, Any] = {}
    try:
        suffix = file.suffix.lower()
        if suffix in CAD:
            corners = _import(gmsh, str(file), CAD[suffix], size)
        else:
            gmsh.merge(str(file))
        if suffix in CAD or suffix == ".geo":
            _mesh(gmsh, halvings, degree)
    except Exception as error:
        reason = str(error).replace(f"'{file}', ", "")
        raise ValueError(f"gmsh cannot read it: {reason}") from None
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
        own = [int(tag) for tag in gmsh.model.getPhysicalGroupsForEntity(dim, entity)]
        if dim < top - 1 or ((dim in grouped or dim < top) and not own):
            continue
        types, _, nodes = gmsh.model.mesh.getElements(dim, entity)
        for kind, flat in zip(types, nodes, strict=True):
            name, _, _, count, local, _ = gmsh.model.mesh.getElementProperties(kind)
            for tag in own:
                label = gmsh.model.getPhysicalName(dim, tag) or f"{'boundary' if dim < top else 'region'}_{tag}"
                members.setdefault(label, []).append(len(blocks))
            rows = _places(tags, order, np.asarray(flat, dtype=np.int64)).reshape(-1, count)
            order_here = _order(_TYPES.get(int(kind), name), np.reshape(local, (count, -1)))
            blocks.append((_TYPES.get(int(kind), name), rows[:, order_here]))
            physical.append(np.tile(np.array(own or [-1], dtype=np.int64), (len(rows), 1)))
    every: list[Ints] = [np.arange(len(nodes)) for _, nodes in blocks]
    none: Ints = np.empty(0, dtype=np.int64)
    sets = {name: [rows if k in own else none for k, rows in enumerate(every)] for name, own in members.items()}
    return RawMesh(np.asarray(x).reshape(-1, 3), blocks, sets, {}, {"gmsh:physical": physical}, corners)


def _order(kind: str, places: Any) -> Any:
    """Node k of an element here is the node with this number in gmsh, whose nodes are at these places of its cell."""
    if kind in CELLS:
        return np.argsort(CELLS[kind].gmsh_order)
    if (shape := shape_of(kind)) not in BETWEEN:
        return np.arange(len(places))
    corners = CORNERS[shape]
    middles = [places[list(own)].mean(axis=0) for own in BETWEEN[shape][: len(places) - corners]]
    return [*range(corners), *(int(np.argmin(np.linalg.norm(places - x, axis=1))) for x in middles)]


def _import(gmsh: Any, file: str, form: str, size: float) -> dict[int, Any]:
    """Import a CAD drawing; each surface is a physical group with its number, and so is each solid.

    Returns:
        Surface -> its vertices, by which names of the file can be assigned.
    """
    found = gmsh.model.occ.importShapes(file, highestDimOnly=True, format=form)
    gmsh.model.occ.synchronize()
    top = max((dim for dim, _ in found), default=0)
    if top < 2:
        raise ValueError("it has neither solids nor faces")
    low, high = (gmsh.model.getBoundingBox(-1, -1)[k : k + 3] for k in (0, 3))
    length = size or sum((b - a) ** 2 for a, b in zip(low, high, strict=True)) ** 0.5 / _CELLS_ALONG
    sizes = [(gmsh.model.occ.getMass(dim, tag), dim) for dim, tag in gmsh.model.getEntities(top)]
    with np.errstate(over="ignore"):
        cells = sum((np.float64(abs(mass)) ** (1 / dim) / length) ** dim / _SHARE[dim] for mass, dim in sizes)
    if _BYTES_PER_CELL * cells > resource.getrlimit(resource.RLIMIT_AS)[0]:
        raise ValueError(
            f"cells of size {length:g} would be about {cells:.2g}, too many for the memory: use larger ones"
        )
    # Cells are smaller where the surface is curved, this many to a full turn, but not by more than this factor.
    gmsh.option.setNumber("Mesh.MeshSizeMax", length)
    gmsh.option.setNumber("Mesh.MeshSizeMin", length / 8)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 16)
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
