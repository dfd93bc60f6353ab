"""Pictures of the fields on the deformed body by pyvista, if it is installed.

VTK ends the process if it has no way to draw, as on a machine with neither display nor EGL nor OSMesa.  So it
draws in a separate process; if that fails, only these pictures are missing.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.machine.launcher import environment_of_no_rank

# Stem of the picture -> what it shows.
FIELDS = {
    "field_displacement": "Size of the displacement",
    "field_density": "Elastic shear energy density",
}
_PATIENCE = 300.0  # seconds; a million cells take some ten
_WIDTH = 1200  # pixels
_EDGES_UP_TO = 20_000  # cells whose edges can still be distinguished


def draw_fields(
    folder: Path,
    points: npt.NDArray[np.float64],
    cells: npt.NDArray[np.int64],
    displacement: npt.NDArray[np.float64],
    density: npt.NDArray[np.float64],
    factor: float,
) -> list[str]:
    """Draw each of ``FIELDS`` on the deformed body; call it on one rank.

    Args:
        folder: where to write.
        points: positions, shape (n, 2).
        cells: triangles or quadrilaterals, their points in order along the perimeter, shape (m, 3) or (m, 4).
        displacement: at the points, length, shape (n, 2).
        density: elastic shear energy density, energy per volume, one value per cell, shape (m,).
        factor: the factor that the displacement is multiplied by.

    Returns:
        Names of the pictures; none if pyvista is not installed or cannot draw.
    """
    if importlib.util.find_spec("pyvista") is None:
        return []
    with tempfile.TemporaryDirectory() as scratch:
        np.savez(
            Path(scratch) / "body.npz",
            points=points,
            cells=cells,
            displacement=displacement,
            density=density,
            factor=factor,
        )
        search = [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
        environment = environment_of_no_rank() | {"PYTHONPATH": os.pathsep.join(filter(None, search))}
        command = [sys.executable, "-m", __name__, scratch]
        try:
            subprocess.run(command, env=environment, check=True, capture_output=True, timeout=_PATIENCE)
        except (OSError, subprocess.SubprocessError):
            return []
        drawn = [f"{stem}.png" for stem in FIELDS if (Path(scratch) / f"{stem}.png").is_file()]
        for name in drawn:
            shutil.move(Path(scratch) / name, folder / name)
    return drawn


def _main(scratch: Path) -> None:
    """Draw the content of body.npz, in this process."""
    import pyvista

    with np.load(scratch / "body.npz") as data:
        points, cells, displacement, density = (data[name] for name in ("points", "cells", "displacement", "density"))
        factor = float(data["factor"])
    kind = pyvista.CellType.TRIANGLE if cells.shape[1] == 3 else pyvista.CellType.QUAD
    flat = np.zeros((len(points), 1))
    body = pyvista.UnstructuredGrid({kind: cells}, np.hstack((points, flat)))
    outline = body.extract_feature_edges(feature_edges=False, manifold_edges=False, non_manifold_edges=False)
    body.points = np.hstack((points + factor * displacement, flat))
    body.point_data["field_displacement"] = np.hypot(*displacement.T)
    body.cell_data["field_density"] = density
    for stem in FIELDS:
        _draw(pyvista, body, outline, stem).screenshot(scratch / f"{stem}.png")


def _draw(pyvista: Any, body: Any, outline: Any, stem: str) -> Any:
    """A plotter with a field on the deformed body, and the outline of the undeformed body."""
    low, high = np.minimum(body.bounds, outline.bounds)[::2], np.maximum(body.bounds, outline.bounds)[1::2]
    wide, tall = (high - low)[:2]
    height = int(np.clip(_WIDTH * tall / wide, 200, 2 * _WIDTH)) + 160
    plotter = pyvista.Plotter(off_screen=True, window_size=(_WIDTH, height))
    plotter.set_background("white")
    bar = {"title": f"{FIELDS[stem]}\n", "color": "black", "height": 110 / height, "width": 0.7, "position_x": 0.15}
    bar |= {"position_y": 15 / height, "title_font_size": 24, "label_font_size": 22, "fmt": "%.3g"}
    plotter.add_mesh(
        body,
        scalars=stem,
        cmap="cividis",
        lighting=False,
        show_edges=body.n_cells <= _EDGES_UP_TO,
        edge_color="black",
        edge_opacity=0.25,
        line_width=1,
        scalar_bar_args=bar,
    )
    plotter.add_mesh(outline, color="black", line_width=2)
    plotter.enable_parallel_projection()
    plotter.view_xy()
    # The bar has the lower 160 pixels to itself.
    size = 1.05 * max(tall * height / (height - 160), wide * height / _WIDTH)
    middle = 0.5 * (low + high) - np.array([0.0, size * 80 / height, 0.0])
    plotter.camera.focal_point = middle
    plotter.camera.position = middle + np.array([0.0, 0.0, wide + tall])
    plotter.camera.parallel_scale = 0.5 * size
    return plotter


if __name__ == "__main__":
    _main(Path(sys.argv[1]))
