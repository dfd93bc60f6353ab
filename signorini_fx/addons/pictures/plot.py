"""Pictures of a solution in a notebook, and the grid that PyVista shows."""

from __future__ import annotations

import shutil
import tempfile
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from signorini_fx.addons.pictures.deformed_body import draw_on_axes
from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.addons.pictures.gather import gather_body
from signorini_fx.addons.pictures.results import drawn_fields
from signorini_fx.addons.pictures.solid import ready_pyvista
from signorini_fx.addons.pictures.style import INK, VALUES, visible_factor
from signorini_fx.arrays import Plain
from signorini_fx.errors import OutputError, PictureError, cannot_be_written
from signorini_fx.machine import parallel
from signorini_fx.results.fields import grid_of, write_vtu
from signorini_fx.results.files import write_results
from signorini_fx.results.mechanics import StepResult
from signorini_fx.results.solution import Solution

if TYPE_CHECKING:
    from pyvista import Plotter, UnstructuredGrid

# Of a moving picture of one load step.
_FRAMES = 12


@dataclass(frozen=True, repr=False)
class Pictures:
    """The pictures of a result folder, which a notebook displays one below the other.

    Attributes:
        png: content of each picture, a PNG file, by its name, such as ``deformed``.
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


def plot(solution: Solution, field: str | Sequence[str] = (), *, ax: Axes | None = None) -> Any:
    """Draw a solution: the deformed body and the contact boundary; collective.

    In a notebook the last expression of a cell is displayed: ``plot(solution)`` or
    ``solution.plot()``.

    Args:
        solution: what to draw, converged or not.
        field: one or several of ``pressure``, ``displacement`` and ``density``, drawn in addition
            to the von Mises stress, or on ``ax`` in place of it.
        ax: axes of matplotlib on which the deformed body in 2D is drawn in its coordinates (by the
            first rank); None for new pictures.

    Returns:
        The pictures, or ``ax``.

    Raises:
        ValueError: there is no such field, or axes are given for a body in 3D.
        OutputError: the folder for temporary files cannot be written.
        PictureError: the pictures cannot be drawn.

    Examples:
        >>> pictures = sfx.plot(solution)
        >>> print(len(pictures.png), "deformed" in pictures.png)
        2 True
    """
    comm = solution.comm
    if ax is not None:
        _draw_on(ax, solution, field)
        return ax
    folder = parallel.on_root(comm, lambda: Path(tempfile.mkdtemp()))
    try:
        summary = write_results(solution, folder / "results", fields=False, pictures=field or True)
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


def _draw_on(ax: Axes, solution: Solution, field: str | Sequence[str]) -> None:
    """Draw the deformed body in 2D on axes; collective."""
    if solution.model.tagged.dimension == 3:
        raise ValueError("ax: is for bodies in 2D; in 3D take solution.plotter()")
    asked = [field] if isinstance(field, str) else list(field)
    if wrong := [name for name in asked if name not in FIELDS]:
        raise ValueError(f"no picture of {wrong[0]!r}: there are {', '.join(FIELDS)}")
    name = [*asked, *drawn_fields(solution, asked)][0]
    body = gather_body(solution, (name,))
    if parallel.is_root(solution.comm) and body is not None:
        draw_on_axes(ax, body, name)


def _grids(solution: Solution, steps: Sequence[StepResult]) -> list[UnstructuredGrid]:
    """Return the grids of load steps as ParaView would read them, on the first rank, and [] on the
    others; collective.
    """
    comm = solution.comm
    pyvista = ready_pyvista(draws=False)
    folder = parallel.on_root(comm, lambda: Path(tempfile.mkdtemp()))
    files = [folder / f"{step.step}.vtu" for step in steps]
    try:
        for file, step in zip(files, steps, strict=True):
            write_vtu(file, comm, *grid_of(solution.at(step)))
        return [pyvista.read(file) for file in files] if parallel.is_root(comm) else []
    finally:
        if parallel.is_root(comm):
            shutil.rmtree(folder)


def plotter(
    solution: Solution, field: str = "", *, times: float | None = None, **options: Plain
) -> Plotter | None:
    """Return a plotter with the deformed body, see ``Solution.plotter``; collective."""
    for grid in _grids(solution, [solution.last_step]):
        scene = ready_pyvista().Plotter(**options)
        _show(scene, grid, [grid], field, times)
        return scene
    return None


def animate(
    solution: Solution,
    file: str | Path,
    field: str = "",
    *,
    times: float | None = None,
    **options: Plain,
) -> None:
    """Write an animation, see ``Solution.animate``; collective."""
    path = Path(file)
    if path.suffix != ".gif":
        raise OutputError(f"{path}: a moving picture is .gif")
    steps = solution.shown_steps
    grids = _grids(solution, steps)

    def write() -> None:
        scene = ready_pyvista().Plotter(off_screen=True, **options)
        frames = list(zip(grids, map(str, steps), [1.0] * len(steps), strict=True))
        if len(steps) == 1:
            frames = [(grids[0], "", share) for share in np.linspace(0.0, 1.0, _FRAMES)]
        try:
            scene.open_gif(str(path))
            for grid, text, share in frames:
                _show(scene, grid, grids, field, times, share)
                scene.add_text(text, name="step", font_size=10, color=INK)
                scene.write_frame()
        except OSError as error:
            raise cannot_be_written(path, error) from None
        finally:
            scene.close()

    parallel.on_root(solution.comm, write)


def _show(
    scene: Plotter,
    grid: UnstructuredGrid,
    steps: Sequence[UnstructuredGrid],
    field: str,
    times: float | None,
    share: float = 1.0,
) -> None:
    """Show the body of a grid in a scene, in place of the previous one.

    Args:
        scene: the plotter.
        grid: the grid to show.
        steps: the grids of all load steps, which share colours and magnification.
        field: name of the field; "" for the stress or the displacement.
        times: magnification of the displacement; None for a visible one.
        share: the share of the displacement to show.
    """
    if field and field not in grid.point_data:
        raise ValueError(f"no field {field!r}: there are {', '.join(grid.point_data.keys())}")
    usual = ("recovered_von_mises", "von_mises", "displacement")
    name = field or next(name for name in usual if name in grid.point_data)
    rows = [each[name].reshape(each.n_points, -1) for each in steps]
    sizes = [np.linalg.norm(row, axis=1) if row.shape[1] > 1 else row for row in rows]
    limits = [min(map(np.nanmin, sizes)), max(map(np.nanmax, sizes))]
    if times is None:
        times = visible_factor(grid.points, steps[-1]["displacement"])
    body = grid.warp_by_vector("displacement", factor=share * times)
    bar = {"title": name.replace("_", " ")}
    scene.add_mesh(body, scalars=name, clim=limits, cmap=VALUES, name="body", scalar_bar_args=bar)
    if np.ptp(grid.points[:, 2]) == 0.0:
        scene.view_xy()


def pyvista_grid(solution: Solution) -> UnstructuredGrid | None:
    """Return the mesh with the displacement and the stresses, for PyVista, on the first rank; None
    on the others; collective.

    ``solution.plotter().show()`` opens a window, or in a notebook an output, in which the body can
    be turned.

    Args:
        solution: the solution, converged or not.

    Returns:
        A ``pyvista.UnstructuredGrid``.  Each cell has its own points, because raw stresses jump
        between cells, with the ``displacement`` and the fields that are written for ParaView.

    Raises:
        PictureError: PyVista is not installed.

    Examples:
        >>> print(sfx.pyvista_grid(solution).n_cells)
        32
    """
    return next(iter(_grids(solution, [solution.last_step])), None)
