"""The pictures of a solution for a notebook, without a result folder that stays."""

from __future__ import annotations

import shutil
import tempfile
from base64 import b64encode
from dataclasses import dataclass
from pathlib import Path

from signorini_fx import parallel
from signorini_fx.results.files import write_results
from signorini_fx.results.solution import Solution


@dataclass(frozen=True, repr=False)
class Pictures:
    """The pictures of a result folder, which a notebook displays one below the other.

    Attributes:
        png: name of each picture, such as ``deformed``, and its content, a PNG file.
    """

    png: dict[str, bytes]

    def __repr__(self) -> str:
        return f"<Pictures: {', '.join(self.png)}>"

    def _repr_html_(self) -> str:
        return "\n".join(
            f'<img alt="{name}" style="max-width: 100%" src="data:image/png;base64,{b64encode(data).decode()}">'
            for name, data in self.png.items()
        )


def pictures(solution: Solution) -> Pictures:
    """Draw a solution: the deformed body, the contact boundary and the iteration; collective.

    In a notebook the last expression of a cell is displayed: ``pictures(solution)``.

    Args:
        solution: what to draw, converged or not.

    Raises:
        OutputError: the folder for temporary files cannot be written.
    """
    comm = solution.comm
    folder = parallel.on_root(comm, lambda: Path(tempfile.mkdtemp()))
    try:
        write_results(solution, folder / "results", fields=False)
        order = ("deformed", "profiles", "contact_surface", "history")
        drawn = parallel.on_root(comm, lambda: {f.stem: f.read_bytes() for f in (folder / "results").glob("*.png")})
    finally:
        if parallel.is_root(comm):
            shutil.rmtree(folder, ignore_errors=True)
    return Pictures({name: drawn[name] for name in sorted(drawn, key=lambda n: (*order, n).index(n))})
