"""The program that reads a foreign file: within limits, and in a sandbox from before it opens the file.

python3 -P reading_process.py REQUEST, a JSON object with the names in ``main``; lengths of cells, if there are any, are
the standard input, a file.  The content of the file is written to
the standard output, which must be a file, or in its place what is wrong.
"""

from __future__ import annotations

import json
import os
import resource
import sys
from collections.abc import Sequence
from pathlib import Path

REFUSED = 3


def main(arguments: Sequence[str]) -> int:
    """Read a file within limits, and write what is in it, or what is wrong."""
    sys.path.append(str(Path(__file__).parents[4]))
    from signorini_fx.mechanics.mesh.files import gmsh_reader, meshio_reader, sandbox
    from signorini_fx.mechanics.mesh.files.size_field import SizeField

    request = json.loads(arguments[0])
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # libraries print there
    _limit(resource.RLIMIT_CORE, 0, 0)
    _limit(resource.RLIMIT_CPU, request["seconds"], request["seconds"] + 5)
    _limit(resource.RLIMIT_AS, request["bytes"], request["bytes"])
    _limit(resource.RLIMIT_FSIZE, request["bytes"], request["bytes"])
    file, settings = Path(request["file"]), request["settings"]
    if request["sized"]:
        with os.fdopen(os.dup(0), "rb") as stream:
            settings["sizes"] = SizeField.load(stream)
    reader = {"gmsh": gmsh_reader, "meshio": meshio_reader}[request["reader"]]
    try:
        # A file may have another suffix than its format, as those of code_aster do.
        reader.load_libraries(f".{settings['kind']}" if "kind" in settings else file.suffix)
        if request["sandbox"]:
            sandbox.confine(reader.files_of(file))
        raw = reader.read(file, **settings)
    except (Exception, SystemExit) as error:  # meshio ends the process on files that it does not know
        output.write((str(error) or type(error).__name__).encode(errors="replace"))
        output.close()
        return REFUSED
    raw.save(output)
    output.close()
    return 0


def _limit(kind: int, soft: int, hard: int) -> None:
    """Set a limit, or keep the current one if it is tighter and may not be raised."""
    _, ceiling = resource.getrlimit(kind)
    if ceiling != resource.RLIM_INFINITY:
        soft, hard = min(soft, ceiling), min(hard, ceiling)
    resource.setrlimit(kind, (soft, hard))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
