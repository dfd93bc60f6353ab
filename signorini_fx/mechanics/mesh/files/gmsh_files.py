"""Files of gmsh: its meshes, its scripts, and CAD drawings, which it meshes.

gmsh takes a file without the header of a mesh for a script, whatever its name, and a script may run commands and write
files.  So the header is checked first, and a script is translated into one that can do nothing but draw.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files import cad_step
from signorini_fx.mechanics.mesh.files.gmsh_reader import CAD
from signorini_fx.mechanics.mesh.files.gmsh_script import translated
from signorini_fx.mechanics.mesh.files.raw import RawMesh
from signorini_fx.mechanics.mesh.files.reading import read_separately
from signorini_fx.mechanics.mesh.files.shape import Ints
from signorini_fx.mechanics.mesh.files.size_field import SizeField
from signorini_fx.mechanics.statement.mesh_sources import DRAWN

# CPU seconds for a drawing, which may be a large one.
_DRAWING_SECONDS = 1200
_HEADERS = {
    "msh": ("no mesh of gmsh", (b"$MeshFormat", b"$Comments")),
    "step": ("no STEP file", (b"ISO-10303-21",)),
    "brep": ("no BREP file of OpenCASCADE", (b"DBRep_DrawableShape", b"CASCADE Topology")),
}
# A larger STEP file is not searched for the names of its faces.
_LARGEST_NAMED = 64 << 20


def read_gmsh(
    file: Path,
    halvings: int = 0,
    degree: int | None = None,
    size: float | None = None,
    *,
    skin: bool = False,
    sizes: SizeField | None = None,
) -> RawMesh:
    """A mesh, a gmsh script or a CAD drawing as arrays; physical groups are sets.

    The surfaces and solids of a drawing are physical groups with their numbers, and with the names that a STEP file
    gives them.

    Args:
        file: an existing file that ends in ``.msh`` or one of ``DRAWN``.
        halvings: how often gmsh divides all cells that it made, with the new nodes on the true shape.
        degree: 1: the cells that it makes have straight sides; 2: nodes between their corners on the true shape;
            None: what the script asks for, 1 for a drawing of a CAD program.
        size: length of the cells of a CAD drawing, in its unit; None: a fraction of the size of the body.
        skin: of a CAD drawing only the triangles on the surface of its solids, or the lines around its plane faces,
            counterclockwise.
        sizes: lengths of the cells of a drawing, on a mesh of it; None: by ``size``, or what the script asks for.

    Raises:
        MeshError: its content does not fit its suffix, a script does more than draw, or gmsh cannot make a mesh of it.
    """
    suffix = file.suffix.lower()
    settings = {"halvings": halvings, "degree": degree or 0, "size": size or 0.0}
    if skin:
        settings["skin"] = True
    with tempfile.TemporaryDirectory() as folder:
        # In a folder of its own there is no FILE.opt, which gmsh would run along with FILE.
        local_file = Path(folder) / f"mesh{suffix}"
        script = None
        try:
            if suffix == ".geo":
                script = translated(file)
                local_file.write_text(script.text, encoding="ascii")
            else:
                _check_header(file, CAD.get(suffix, "msh"))
                local_file.symlink_to(file.absolute())
        except OSError as error:
            raise MeshError(f"{file}: cannot be read: {error.strerror or error}") from None
        try:
            raw = read_separately(file, "gmsh", settings, place=local_file, sizes=sizes, **_limits_of_drawings(suffix))
        except MeshError as error:
            raise (error if script is None else MeshError(script.original(str(error)))) from None
    if script is not None:
        raw.sets = {script.original(name): rows for name, rows in raw.sets.items()}
    if raw.corners and CAD[suffix] == "step" and file.stat().st_size <= _LARGEST_NAMED:
        raw.sets = _with_names(raw.sets, cad_step.names_of_faces(file, raw.corners))
    return raw


def _limits_of_drawings(suffix: str) -> dict[str, Any]:
    """The limits on a process that makes a mesh; none for one that only reads it."""
    if suffix not in DRAWN:
        return {}
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return {"seconds": _DRAWING_SECONDS, "memory": memory, "hint": "; give the .msh that gmsh makes of it"}


def _with_names(sets: dict[str, list[Ints]], names: dict[int, str]) -> dict[str, list[Ints]]:
    """The sets with surfaces called by their names; several may have one."""
    renamed: dict[str, list[Ints]] = {}
    numbered = {f"boundary_{tag}": name for tag, name in names.items()}
    for label, rows in sets.items():
        name = numbered.get(label, label)
        renamed[name] = (
            [np.union1d(*pair) for pair in zip(renamed[name], rows, strict=True)] if name in renamed else rows
        )
    return renamed


def _check_header(file: Path, form: str) -> None:
    with file.open("rb") as stream:
        start = stream.read(256)
    format_name, beginnings = _HEADERS[form]
    if not any(word in start for word in beginnings) if form == "brep" else not start.lstrip().startswith(beginnings):
        raise MeshError(f"{file}: is {format_name}: it does not begin with {beginnings[0].decode()}")
