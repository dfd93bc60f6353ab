"""A solution in a notebook: its pictures, and the grid that PyVista draws and turns."""

from __future__ import annotations

import shutil
import tempfile
from base64 import b64encode
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.errors import PYVISTA, PictureError
from signorini_fx.machine import parallel
from signorini_fx.results.fields import fields_in_cells
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
            f'<img alt="{name}" style="max-width: 100%" '
            f'src="data:image/png;base64,{b64encode(data).decode()}">'
            for name, data in self.png.items()
        )


def plot(solution: Solution, *fields: str) -> Pictures:
    """Draw a solution: the deformed body and the contact boundary; collective.

    In a notebook the last expression of a cell is displayed: ``plot(solution)`` or
    ``solution.plot()``.

    Args:
        solution: what to draw, converged or not.
        fields: to draw on the body beside the von Mises stress: ``pressure``, ``displacement`` or
            ``density``.

    Raises:
        ValueError: there is no such field.
        OutputError: the folder for temporary files cannot be written.
        PictureError: the pictures cannot be drawn.

    Examples:
        >>> pictures = sfx.plot(solution)
        >>> print(len(pictures.png), "deformed" in pictures.png)
        2 True
    """
    comm = solution.comm
    folder = parallel.on_root(comm, lambda: Path(tempfile.mkdtemp()))
    try:
        summary = write_results(
            solution, folder / "results", fields=False, pictures=list(fields) or True
        )
        for found in summary["findings"]:
            if found["path"] == "pictures":
                raise PictureError(f"the pictures were not drawn: {found['message']}")
        order = ("deformed", "profiles", "contact_surface")
        drawn = parallel.on_root(
            comm, lambda: {f.stem: f.read_bytes() for f in (folder / "results").glob("*.png")}
        )
    finally:
        if parallel.is_root(comm):
            shutil.rmtree(folder, ignore_errors=True)
    return Pictures(
        {name: drawn[name] for name in sorted(drawn, key=lambda n: (*order, n).index(n))}
    )


def pyvista_grid(solution: Solution) -> Any:
    """Return the mesh of this rank with the displacement and the stresses, for PyVista; collective.

    ``pyvista_grid(solution).warp_by_vector("displacement",
    factor=50).plot(scalars="recovered_von_mises")`` opens a window, in a notebook an output, in
    which the body can be turned.

    Args:
        solution: converged or not.

    Returns:
        A ``pyvista.UnstructuredGrid``.  Each cell has points of its own, because raw stresses jump
        between cells, with the ``displacement`` and the fields that are written for ParaView.

    Raises:
        PictureError: PyVista is not installed.

    Examples:
        >>> print(sfx.pyvista_grid(solution).n_cells)
        32
    """
    if find_spec("pyvista") is None:
        raise PictureError(f"pyvista_grid needs {PYVISTA}")
    import pyvista
    from dolfinx.plot import vtk_mesh

    fields = fields_in_cells(solution)
    grid = pyvista.UnstructuredGrid(*vtk_mesh(fields["displacement"].function_space))
    for name, function in fields.items():
        values: Any = function.x.array.reshape(grid.n_points, -1)
        if name == "displacement":  # in 3D, as PyVista expects of a vector
            values = np.pad(values, ((0, 0), (0, 3 - values.shape[1])))
        grid.point_data[name] = values[:, 0] if values.shape[1] == 1 else values
    return grid
