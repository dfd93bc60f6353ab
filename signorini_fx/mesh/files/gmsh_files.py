"""Files of gmsh, read in a separate process.

A file may come from anywhere.  gmsh takes a file without the header of a mesh for a script, whatever its name, and a
script may run commands and write files; on some broken meshes gmsh ends the whole process, and it allocates whatever
memory a file requests.  So a file is checked first, then read in a process with limits, which writes plain arrays.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from signorini_fx.errors import MeshError
from signorini_fx.machine import launcher
from signorini_fx.mesh.files import gmsh_process, step
from signorini_fx.mesh.files.arrays import RawMesh
from signorini_fx.mesh.files.cells import CELLS
from signorini_fx.mesh.files.shape import Ints

# CPU seconds: for reading a file, a constant and a part per megabyte; for a script, which may mesh a large geometry.
_READ_SECONDS, _SECONDS_PER_MEGABYTE, _SCRIPT_SECONDS = 60, 5, 1200
# Address space: gmsh's own libraries, and the memory of a mesh for each byte of its file.
_BASE_BYTES, _BYTES_PER_BYTE = 3 << 30, 200
_LARGEST_SCRIPT = 1 << 20
_HEADERS = {
    "msh": ("no mesh of gmsh", (b"$MeshFormat", b"$Comments")),
    "step": ("no STEP file", (b"ISO-10303-21",)),
    "brep": ("no BREP file of OpenCASCADE", (b"DBRep_DrawableShape", b"CASCADE Topology")),
}
# Text in quotes and comments are not commands.
_NO_COMMAND = re.compile(r'"[^"]*"|\'[^\']*\'|//[^\n]*|/\*.*?\*/', re.DOTALL)
_COMMAND = re.compile(
    r"\b(System\w*|NonBlockingSystemCall|OnelabRun|ExternalProcess|Include|Merge\w*|CreateDir|Save|Print|Plugin|Sleep)\b(?!\s*\.)"
    r"|\b(?:Printf|Warning|Error)\s*\([^;]*\)\s*(>)"
)
_CAD = re.compile(r'\bMerge\s*"[^"]+\.(?:step|stp|brep|iges|igs)"\s*;', re.IGNORECASE)


# Files that gmsh meshes first: its scripts, and CAD drawings.
CAD = tuple(gmsh_process.CAD)
DRAWN = (".geo", *CAD)
# A larger STEP file is not searched for the names of its faces.
_LARGEST_NAMED = 64 << 20


def read_gmsh(file: Path, halvings: int = 0, degree: int | None = None, size: float | None = None) -> RawMesh:
    """A mesh, a gmsh script or a CAD drawing as arrays; physical groups are sets.

    The surfaces and solids of a drawing are physical groups with their numbers, and with the names that a STEP file
    gives them.

    Args:
        file: an existing file that ends in ``.msh`` or one of ``DRAWN``.
        halvings: how often gmsh divides all cells that it made, with the new nodes on the true shape.
        degree: 1: the cells that it makes have straight sides; 2: nodes between their corners on the true shape;
            None: what the script asks for, 1 for a drawing of a CAD program.
        size: length of the cells of a CAD drawing, in its unit; None: a fraction of the size of the body.

    Raises:
        MeshError: its content does not fit its suffix, a script does more than draw, or gmsh cannot make a mesh of it.
    """
    with (
        tempfile.TemporaryDirectory() as folder,
        np.load(_arrays(file, Path(folder), halvings, degree or 0, size or 0.0), allow_pickle=False) as arrays,
    ):
        sets = json.loads(str(arrays["sets"]))
        kinds = json.loads(str(arrays["kinds"]))
        blocks = [(kind, _in_our_order(kind, arrays[f"block_{k}"])) for k, kind in enumerate(kinds)]
        points, physical = arrays["points"], json.loads(str(arrays["physical"]))
        corners = {int(tag): places for tag, places in json.loads(str(arrays["corners"])).items()}
    if corners and gmsh_process.CAD[file.suffix.lower()] == "step" and file.stat().st_size <= _LARGEST_NAMED:
        sets = _with_names(sets, step.names_of_faces(file, corners))
    every = [np.arange(len(nodes)) for _, nodes in blocks]
    none = np.empty(0, dtype=np.int64)
    return RawMesh(
        points,
        blocks,
        {name: [rows if k in own else none for k, rows in enumerate(every)] for name, own in sets.items()},
        data={"gmsh:physical": [_repeated(own, len(rows)) for rows, own in zip(every, physical, strict=True)]},
    )


def _with_names(sets: dict[str, list[int]], names: dict[int, str]) -> dict[str, list[int]]:
    """The sets with surfaces called by their names; several may have one."""
    found: dict[str, list[int]] = {}
    numbered = {f"boundary_{tag}": name for tag, name in names.items()}
    for label, blocks in sets.items():
        found.setdefault(numbered.get(label, label), []).extend(blocks)
    return found


def _in_our_order(kind: str, nodes: Ints) -> Ints:
    """The nodes of elements in meshio's order."""
    if kind == "hexahedron20":
        order = CELLS["hexahedron27"].gmsh_order[:20]
    else:
        order = CELLS[kind].gmsh_order if kind in CELLS else tuple(range(nodes.shape[1]))
    return nodes[:, np.argsort(order)]


def _repeated(groups: list[int], count: int) -> Ints:
    """The numbers of the groups of each of the ``count`` elements, shape (count, groups or 1); -1: in none."""
    return np.tile(np.array(groups or [-1], dtype=np.int64), (count, 1))


def _arrays(file: Path, folder: Path, halvings: int, degree: int, length: float) -> Path:
    """Let the other process read the file and write its content, and report how that ended."""
    suffix = file.suffix.lower()
    script, drawn = suffix == ".geo", suffix in DRAWN
    try:
        size = file.stat().st_size
        if script:
            _check_script(file)
        else:
            _check_header(file, gmsh_process.CAD.get(suffix, "msh"))
        options = file.with_name(f"{file.name}.opt")
        if suffix not in CAD and options.exists():  # gmsh runs it along with the file
            _check_script(options)
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror or error}") from None
    if drawn:
        seconds, memory = _SCRIPT_SECONDS, os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    else:
        seconds = _READ_SECONDS + _SECONDS_PER_MEGABYTE * (size >> 20)
        memory = _BASE_BYTES + _BYTES_PER_BYTE * size
    arrays, complaint = folder / "arrays.npz", folder / "complaint.txt"
    command = [sys.executable, "-P", gmsh_process.__file__, str(file.absolute()), str(arrays), str(complaint)]
    try:
        process = subprocess.run(
            [*command, str(seconds), str(memory), str(halvings), str(degree), repr(length)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=launcher.environment_of_no_rank(),
            timeout=4 * seconds,
            check=False,
        )
        code = process.returncode
    except subprocess.TimeoutExpired:
        code = -gmsh_process.OUT_OF_TIME
    if code == 0:
        return arrays
    if code == gmsh_process.REFUSED:
        raise MeshError(f"{file}: {complaint.read_text(encoding='utf-8', errors='replace')[:1000]}")
    if -code in (gmsh_process.OUT_OF_TIME, gmsh_process.KILLED):
        hint = "; give the .msh that gmsh makes of it" if drawn else ""
        raise MeshError(f"{file}: gmsh cannot read it: it took more than {seconds} s{hint}")
    memory_hint = f" or needs more than {memory / 1e9:.1f} GB"
    raise MeshError(f"{file}: gmsh cannot read it: it crashes on this file{memory_hint} (exit code {code})")


def _check_header(file: Path, form: str) -> None:
    with file.open("rb") as stream:
        start = stream.read(256)
    what, beginnings = _HEADERS[form]
    if not any(word in start for word in beginnings) if form == "brep" else not start.lstrip().startswith(beginnings):
        raise MeshError(f"{file}: is {what}: it does not begin with {beginnings[0].decode()}")


def _check_script(file: Path) -> None:
    """Refuse a script that does more than draw."""
    with file.open(encoding="utf-8", errors="replace") as stream:
        text = stream.read(_LARGEST_SCRIPT + 1)
    if len(text) > _LARGEST_SCRIPT:
        raise MeshError(
            f"{file}: a script of more than {_LARGEST_SCRIPT >> 20} MB; give the .msh that gmsh makes of it"
        )
    if text.startswith("$"):
        raise MeshError(f"{file}: is not a gmsh script: it begins with $; a mesh must end in .msh")

    def blank(match: re.Match[str]) -> str:
        return re.sub(r"[^\n]", " ", match[0])

    commands = _NO_COMMAND.sub(blank, _CAD.sub(blank, text))
    if found := _COMMAND.search(commands):
        line = commands.count("\n", 0, found.start()) + 1
        raise MeshError(
            f"{file}: line {line}: {found[1] or 'writing a file'} is not allowed in a script: it may only describe "
            "geometry and mesh; give the .msh that gmsh makes of it"
        )
