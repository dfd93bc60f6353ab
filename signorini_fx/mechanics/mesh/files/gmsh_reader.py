"""Files that gmsh reads in this process: its meshes, its scripts, and CAD drawings, which it
meshes.
"""

from __future__ import annotations

import contextlib
import re
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np

from signorini_fx.arrays import Ints
from signorini_fx.errors import InstallationError, MeshError, SignoriniError
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, Numbering, RawMesh
from signorini_fx.mechanics.mesh.files.cells import CELLS, completed, order_in
from signorini_fx.mechanics.mesh.files.size_field import Sizes, check_memory, with_sizes
from signorini_fx.mechanics.statement.mesh_sources import MeshFile
from signorini_fx.tuned import SIZE_GROWTH

# Drawings of CAD programs, by what OpenCASCADE calls them.
CAD = {".step": "step", ".stp": "step", ".brep": "brep"}
# How files begin that gmsh does not take for scripts.
_BEGINNINGS = {
    "msh": (b"$MeshFormat", b"$Comments"),
    "step": (b"ISO-10303-21",),
    "brep": (b"DBRep_DrawableShape", b"CASCADE Topology"),
}
# The last lines of drawings.
_LAST = {
    "step": re.compile(rb"END-ISO-10303-21\s*;\s*$"),
    "brep": re.compile(rb"\n[+-]\d+ \d+\s*$"),
}
# A body's diagonal is so many cells long where no size is given.
_CELLS_ALONG = 25
# Where the surface is curved, so many cells are a full turn.
_TO_A_TURN = 16
# The model in which meshes are made within a session of the caller.
_OURS = "signorini_fx"
# Elements by gmsh's number, in meshio's words.
_TYPES = {cell.gmsh: kind for kind, cell in CELLS.items()} | {
    15: "vertex",
    16: "quad8",
    17: "hexahedron20",
}
_TYPES |= {6: "wedge", 7: "pyramid", 13: "wedge18", 14: "pyramid14", 18: "wedge15", 19: "pyramid13"}

# Where gmsh's messages name the file.
_PLACE = re.compile(r"'/[^']*', (?=line)")
# Comments and texts, whose words are no commands.
_SKIPPED = re.compile(r'//[^\n]*|/\*.*?\*/|"[^"\n]*"|\'[^\'\n]*\'', re.DOTALL)
_FORBIDDEN = re.compile(
    r"\b(?:(?:System|SystemCall|NonBlockingSystemCall|OnelabRun|ExternalProcess|CommandLine"
    r"|Parse|Exit|Abort|Save|Print|CreateDir)\b|(?:Error|Printf)\s*\([^;]*>)"
)
# These read another file, whose name follows.
_READS = re.compile(r"\b(?:Include|Merge|MergeFile|Open|ListFromFile|ShapeFromFile|FileName)\b")
_NAMED = re.compile(r"\s*[\[(=]?\s*[\"']([^\"'\n]*)[\"']")


@contextlib.contextmanager
def gmsh_session(failure: str) -> Iterator[ModuleType]:
    """Yield the module gmsh with an empty model and default options: silent, and without reading
    files of options.

    Raises:
        InstallationError: gmsh is not installed, or its wheel lacks a system library.
        MeshError: ``failure`` and the message of gmsh.
    """
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise InstallationError(
            f"this mesh is made by gmsh, which cannot be loaded: {error}: pip install gmsh, or "
            "apt install "
            "python3-gmsh; its wheel needs libgl1 libglu1-mesa libxcursor1 libxft2 libxinerama1"
        ) from None
    try:
        with _opened(gmsh):
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.option.setNumber("Mesh.RandomSeed", 1)
            yield gmsh
    except SignoriniError:
        raise
    except Exception as error:  # gmsh has no exceptions of its own
        reason = _PLACE.sub("", str(error))
        raise MeshError(f"{failure}: {reason or type(error).__name__}") from None


@contextlib.contextmanager
def _opened(gmsh: ModuleType) -> Iterator[None]:
    """Open a session of gmsh with its default options; within an open session of the caller its
    models and options are restored afterwards.
    """
    if not gmsh.isInitialized():
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        try:
            yield
        finally:
            if gmsh.isInitialized():  # what is drawn is written by others
                gmsh.finalize()
        return
    earlier = gmsh.model.getCurrent()
    prints = gmsh.option.getNumber("General.Terminal")
    gmsh.option.setNumber("General.Terminal", 0)
    with tempfile.TemporaryDirectory() as folder:
        options = f"{folder}/session.opt"
        gmsh.write(options)
        gmsh.option.restoreDefaults()
        gmsh.model.add(_OURS)
        try:
            yield
        finally:
            if gmsh.isInitialized():
                gmsh.option.setNumber("General.Terminal", 0)
                gmsh.model.setCurrent(_OURS)
                gmsh.model.remove()
                gmsh.model.setCurrent(earlier)
                gmsh.merge(options)
                gmsh.option.setNumber("General.Terminal", prints)


def read_gmsh(
    mesh: MeshFile,
    named: Callable[[RawMesh], MeshArrays],
    halvings: int = 0,
    degree: int | None = None,
    sizes: Sizes = (),
    *,
    joined: bool = False,
) -> MeshArrays:
    """Return a mesh file, or a drawing after gmsh has meshed it.

    ``named``: makes the mesh from the content of the file; for the other arguments see
    ``formats.read_file``.
    """
    file = mesh.file
    suffix = mesh.file.suffix.lower()
    with gmsh_session(f"{file}: gmsh cannot read it") as gmsh:
        if suffix == ".geo":
            _run(gmsh, file)
        else:
            _check_ends(file, CAD.get(suffix, "msh"))
        if suffix in CAD:
            _import(gmsh, file, CAD[suffix], mesh.size, joined=joined)
        elif suffix == ".msh":
            gmsh.merge(str(file.absolute()))
            return named(content(gmsh))

        def make(times: int, order: int | None) -> MeshArrays:
            _mesh(gmsh, times, order)
            return named(content(gmsh))

        cure = "take Transfinite or Layers there out of the drawing"
        wanted = partial(make, halvings, degree)
        return with_sizes(gmsh, partial(make, 0, 1), wanted, sizes, cure) or wanted()


def content(gmsh: ModuleType) -> RawMesh:
    """Return the mesh of the current model; physical groups become sets."""
    tags, x, _ = gmsh.model.mesh.getNodes()
    numbering = Numbering(np.asarray(tags, dtype=np.int64))
    grouped = {dim for dim, _ in gmsh.model.getPhysicalGroups()}
    # Boundaries have one dimension less than the body.
    top = 3 if len(gmsh.model.mesh.getElementTypes(3)) else 2
    raw = RawMesh(np.asarray(x).reshape(-1, 3), [])
    members: dict[str, list[int]] = {}
    physical = []
    for dim, entity in gmsh.model.getEntities():
        numbers = [int(tag) for tag in gmsh.model.getPhysicalGroupsForEntity(dim, entity)]
        if dim < top - 1 or ((dim in grouped or dim < top) and not numbers):
            continue
        types, _, nodes = gmsh.model.mesh.getElements(dim, entity)
        for number, flat in zip(types, nodes, strict=True):
            name, _, _, count, _, _ = gmsh.model.mesh.getElementProperties(number)
            for tag in numbers:
                label = (
                    gmsh.model.getPhysicalName(dim, tag)
                    or f"{'boundary' if dim < top else 'region'}_{tag}"
                )
                members.setdefault(label, []).append(len(raw.blocks))
            kind = _TYPES.get(int(number), name)
            rows = numbering.rows(np.asarray(flat, dtype=np.int64)).reshape(-1, count)
            raw.blocks.append((kind, rows[:, _order(kind, count)]))
            physical.append(np.tile(np.array(numbers or [-1], dtype=np.int64), (len(rows), 1)))
    for name, blocks in members.items():
        rows_of_blocks = (
            np.arange(len(nodes) if k in blocks else 0) for k, (_, nodes) in enumerate(raw.blocks)
        )
        raw.sets[name] = list(rows_of_blocks)
    raw.data["gmsh:physical"] = physical
    return raw


def _order(kind: str, count: int) -> Ints:
    """Return the gmsh number of each node of an element in meshio's order."""
    full_cell = completed(kind)
    cell = CELLS.get(kind) if full_cell is None else full_cell[0]
    return (
        np.arange(count)
        if cell is None
        else order_in("gmsh", cell)[np.argsort(order_in("vtk", cell))][:count]
    )


def _check_ends(file: Path, form: str) -> None:
    """Check that a file has the header of its format, and that a drawing is complete: OpenCASCADE
    may hang on one that is cut off.

    Raises:
        MeshError: the header or the last line is missing.
    """
    if not _begins_as(file, form):
        first = _BEGINNINGS[form][0].decode()
        raise MeshError(f"{file}: is no file of the format {form}: it does not begin with {first}")
    if form in _LAST and not _LAST[form].search(file.read_bytes()[-200:]):
        raise MeshError(f"{file}: gmsh cannot read it: it ends before its last line")


def _check_script(file: Path, name: str = "", checked: frozenset[Path] = frozenset()) -> None:
    """Raise a MeshError if a script starts programs, writes files, or reads files outside its
    folder.
    """
    where = f"{name}: {file.name}" if name else str(file)
    text = file.read_text(encoding="utf-8-sig", errors="replace")
    if name and not text.endswith("\n"):
        raise MeshError(
            f"{where}: its last line does not end, so that gmsh would leave it out: add a line "
            "break"
        )
    # Blanks in place of comments and texts leave all other places where they are.
    bare = _SKIPPED.sub(lambda skipped: re.sub(r"[^\n]", " ", skipped[0]), text)
    refused = [
        (word, "runs programs, writes files or ends the process")
        for word in _FORBIDDEN.finditer(bare)
    ]
    for word in _READS.finditer(bare):
        argument = _NAMED.match(text, word.end())
        if argument is None or Path(argument[1]).name != argument[1]:
            refused.append((word, "may read a file outside the folder of the script"))
            continue
        other = file.with_name(argument[1])
        if other.is_file() and other not in checked and not _begins_as(other, *_BEGINNINGS):
            _check_script(other, name or str(file), checked | {file, other})
    if refused:
        word, reason = refused[0]
        line = text.count("\n", 0, word.start()) + 1
        command = word[0].partition("(")[0].rstrip()
        raise MeshError(
            f"{where}: line {line}: {command} is not allowed in a script, as it {reason}; give "
            "the .msh that gmsh "
            "makes of it"
        )


def _begins_as(file: Path, *forms: str) -> bool:
    """Return whether a file begins like files of one of these formats."""
    with file.open("rb") as stream:
        start = stream.read(256).lstrip()
    return start.startswith(tuple(word for form in forms for word in _BEGINNINGS[form]))


def _run(gmsh: ModuleType, file: Path) -> None:
    """Run a gmsh script to its end even after errors: gmsh's parser would otherwise continue the
    next script from where this one stopped.
    """
    text = file.read_bytes()
    if text.startswith(b"$"):
        raise MeshError(f"{file}: is not a gmsh script: it begins with $; a mesh must end in .msh")
    _check_script(file)
    gmsh.logger.start()
    gmsh.option.setNumber("General.AbortOnError", 0)
    try:
        if text.endswith(b"\n"):
            gmsh.merge(str(file.absolute()))
        else:  # gmsh leaves a last line out that does not end
            with tempfile.NamedTemporaryFile(suffix=".geo") as ended:
                ended.write(text + b"\n")
                ended.flush()
                gmsh.merge(ended.name)
        errors = [line.partition(": ")[2] for line in gmsh.logger.get() if line.startswith("Error")]
    finally:
        gmsh.option.setNumber("General.AbortOnError", 2)
        gmsh.logger.stop()
    if errors:
        raise ValueError(errors[0])


def _import(gmsh: ModuleType, file: Path, form: str, size: float | None, *, joined: bool) -> None:
    """Import a CAD drawing; each surface and each solid becomes a physical group with its number.

    ``joined``: merge shared faces of solids that touch or overlap.
    """
    shapes = gmsh.model.occ.importShapes(str(file.absolute()), highestDimOnly=True, format=form)
    if joined and len(shapes) > 1:
        gmsh.model.occ.removeAllDuplicates()
    gmsh.model.occ.synchronize()
    top = max((dim for dim, _ in shapes), default=0)
    if top < 2:
        raise MeshError(f"{file}: it has neither solids nor faces")
    low, high = (gmsh.model.getBoundingBox(-1, -1)[k : k + 3] for k in (0, 3))
    length = size or sum((b - a) ** 2 for a, b in zip(low, high, strict=True)) ** 0.5 / _CELLS_ALONG
    body = sum(gmsh.model.occ.getMass(top, tag) for _, tag in gmsh.model.getEntities(top))
    check_memory(body / length**top, top, "mesh.size", length)
    # Cells are smaller where the surface is curved, by a factor of 8 at most, and grow from there.
    gmsh.option.setNumber("Mesh.MeshSizeMax", length)
    gmsh.option.setNumber("Mesh.MeshSizeMin", length / 8)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", _TO_A_TURN)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    fields = gmsh.model.mesh.field
    grown = fields.add("Extend")
    for dim, kind in ((1, "Curves"), (2, "Surfaces")):
        fields.setNumbers(grown, f"{kind}List", [tag for _, tag in gmsh.model.getEntities(dim)])
    fields.setNumber(grown, "SizeMax", length)
    fields.setNumber(grown, "DistMax", (length - length / 8) / SIZE_GROWTH)
    fields.setAsBackgroundMesh(grown)
    for dim in (top, top - 1):
        for _, tag in gmsh.model.getEntities(dim):
            name = gmsh.model.getEntityName(dim, tag).rpartition("/")[2]
            if name.startswith(
                "Open CASCADE STEP translator"
            ):  # what the library writes for a part without a name
                name = ""
            gmsh.model.addPhysicalGroup(dim, [tag], tag, name if dim == top else "")


def _mesh(gmsh: ModuleType, halvings: int, degree: int | None) -> None:
    """Mesh the drawing, halve its cells ``halvings`` times, and set the degree of the geometry."""
    if (
        degree
    ):  # a script's own order would interfere with the division, and with the kinds of cells
        gmsh.option.setNumber("Mesh.ElementOrder", 1)
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 0)
    top = 3 if gmsh.model.getEntities(3) else 2
    gmsh.model.mesh.generate(top)
    for _ in range(halvings):
        gmsh.model.mesh.refine()
    if degree:
        gmsh.model.mesh.setOrder(degree)
    if _inverted(gmsh):
        gmsh.model.mesh.optimize("HighOrder")  # it moves the nodes between the corners


def _inverted(gmsh: ModuleType) -> bool:
    """Return whether a curved solid cell is turned inside out."""
    mesh = gmsh.model.mesh
    kinds = [kind for kind in mesh.getElementTypes(3) if mesh.getElementProperties(kind)[2] > 1]
    cells = [mesh.getElementsByType(kind)[0] for kind in kinds]
    return not all((mesh.getElementQualities(tags, "minDetJac") > 0).all() for tags in cells)


def set_order(gmsh: ModuleType, order: int) -> None:
    """Add nodes between the corners of cells, on curves and surfaces, and check that no solid cell
    is inverted.

    Raises:
        MeshError: a cell is inverted, as cells are too large for the arcs.
    """
    gmsh.model.mesh.setOrder(order)
    # gmsh could move the nodes, but ends the whole process if it finds no place for them.
    if _inverted(gmsh):
        raise MeshError(
            "cells that follow the arcs would be turned inside out: use more of them, or order = 1"
        )
