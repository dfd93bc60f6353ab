"""The files of a result folder: summary, tables, fields, pictures."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI
from pydantic import BaseModel

from signorini_fx import parallel
from signorini_fx.body.material import shear_energy_density
from signorini_fx.contact.table import ContactTable, contact_table
from signorini_fx.csv_text import as_text
from signorini_fx.errors import cannot_be_written
from signorini_fx.records import as_rows
from signorini_fx.results.fields import size_of_fields, write_fields
from signorini_fx.results.folder import CHECKPOINT, SUMMARY, ResultFolder
from signorini_fx.results.interpolation import interpolated
from signorini_fx.results.solution import Solution
from signorini_fx.results.summary import summarise
from signorini_fx.scene.values import kind_of

if TYPE_CHECKING:
    from signorini_fx.report.moving_body import Moment
    from signorini_fx.results.outer_surface import OuterSurface

T = TypeVar("T")
# The result of the last completed mesh, while the next one is being solved.
LAST_LEVEL = "last_level"
# Everything that a run may write, although some files are written by some runs only.  An older report is removed too.
_FILES = (
    *("history.csv", "outer.csv", "steps.csv", "contact.csv", "contact_steps.csv", "price_list.csv"),
    *("displacement.bp", "stress.bp", "von_mises.bp", "principal_stresses.bp", "density.bp"),
    *("fields.xdmf", "fields.h5", "contact.vtu"),
    *(
        f"{name}.{kind}"
        for name in ("deformed", "profiles", "history", "price_list", "contact_surface", "load_steps")
        for kind in ("png", "pdf")
    ),
    "deformed.gif",
    *("field_displacement.png", "field_density.png", "report.html"),
    LAST_LEVEL,
    CHECKPOINT,
)
# The columns that come first in the table of all load steps, and those that it leaves out.
_CONSTANT_COLUMNS = ("gap", "slip", "slip_x", "slip_y", "slip_z", "weight", "n_x", "n_y", "n_z")
_LEADING_COLUMNS = ("x", "y", "z", "s", "boundary")


def write_results(
    solution: Solution, folder: str | Path | ResultFolder, *, fields: bool = True, pictures: bool = True
) -> dict[str, Any]:
    """Write the result folder; collective.

    Args:
        solution: what to write, converged or not.
        folder: made if it does not exist, or claimed before.
        fields: write the fields for ParaView.
        pictures: draw the deformed body, the contact boundary and the iteration history.

    Returns:
        The summary.

    Raises:
        TypeError: the first argument is not a solution.
        OutputError: something could not be written; an older result is still there, or there is no summary.json.
    """
    if not isinstance(solution, Solution):
        raise TypeError(f"write_results takes a Solution and a folder, not {kind_of(solution)}")
    with folder if isinstance(folder, ResultFolder) else ResultFolder(solution.comm, folder) as claimed:
        summary = _write(solution, claimed, fields=fields, pictures=pictures)
        claimed.commit(_FILES)
    return summary


def _write(solution: Solution, folder: ResultFolder, *, fields: bool, pictures: bool) -> dict[str, Any]:
    """Write everything into the hidden part of a claimed folder; collective."""
    comm, part = solution.comm, folder.part
    table = solution.table if solution.contact is not None else None
    summary = summarise(solution, table)
    plane = solution.discretisation.tagged.dimension == 2
    # Keys that a scene in the plane, or one in space, does not have.
    summary["scene"] = describe(solution.scene, ("z",) if plane else ("hypothesis",))
    steps = summary.get("steps", [])
    if fields:
        folder.reserve(size_of_fields(solution))
        summary["fields"] = _together(comm, folder, lambda: write_fields(solution, part))
        summary["stress"] = solution.stress.as_dict()
    along_steps = _contact_by_step(solution) if steps and table is not None else []
    gathered = gather_cells(solution) if pictures and plane else None
    outer = _outer_surface(solution) if pictures and not plane else None
    moments = _moments(solution) if pictures and (plane or outer is not None) else []
    facets = None if plane else _contact_facets(solution)

    def write() -> None:
        try:
            write_csv(part / "history.csv", as_rows(solution.history.iterations))
            write_csv(part / "outer.csv", as_rows(solution.history.outer))
            if solution.price_list:
                write_csv(part / "price_list.csv", as_rows(solution.price_list))
            if steps:
                write_csv(part / "steps.csv", steps)
            if table is not None:
                write_csv(part / "contact.csv", _rows(table.columns))
            if table is not None and facets is not None:
                from signorini_fx.results.surface import write_surface

                write_surface(part / "contact.vtu", table, facets)
            if along_steps:
                write_csv(part / "contact_steps.csv", along_steps)
            if gathered is not None:
                _draw(solution, gathered, table, part, moments)
            if pictures and not plane:
                _draw_in_space(solution, outer, table, part, moments)
            if pictures and table is not None and len(steps) > 1:
                _draw_load_steps(part)
            text = json.dumps(_finite(summary), indent=2, allow_nan=False)
            (part / SUMMARY).write_text(text + "\n", encoding="utf-8")
        except Exception as error:  # matplotlib fails again on the file that a full disk has truncated
            if (reason := _of_the_system(error)) is None:
                raise
            raise cannot_be_written(folder.path, reason) from None

    parallel.on_root(comm, write)
    return summary


def _contact_facets(solution: Solution) -> npt.NDArray[np.int64] | None:
    """The facets of the contact surface; None without contact; collective."""
    from signorini_fx.results.surface import gather_facets

    return None if solution.contact is None else gather_facets(solution.contact.boundary)


def _of_the_system(error: BaseException | None) -> OSError | None:
    """The original error of the system behind later ones; None: there is none."""
    while error is not None and not isinstance(error, OSError):
        error = error.__cause__ or error.__context__
    return error


def _finite(value: Any) -> Any:
    """Plain data for JSON: values that a failed solve could not compute become null."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _together(comm: MPI.Comm, folder: ResultFolder, write: Callable[[], T]) -> T:
    """Files that all ranks write together; an error on one rank is raised on all."""
    result, error = None, None
    try:
        result = write()
    except (OSError, RuntimeError) as reason:  # ADIOS2 and HDF5 raise the second
        error = cannot_be_written(folder.path, reason)
    parallel.raise_together(comm, error)
    return cast(T, result)


def _rows(columns: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Columns of equal length as rows."""
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _contact_by_step(solution: Solution) -> list[dict[str, Any]]:
    """The contact boundary of each load step in turn, step number first; collective."""
    names = [effect.boundary for effect in solution.scene.contact]
    found: list[dict[str, Any]] = []
    for result in solution.shown_steps:
        if result.contact is not None:
            columns = contact_table(result.contact, names).columns
            first = [name for name in _LEADING_COLUMNS if name in columns]
            rest = [name for name in columns if name not in (*first, *_CONSTANT_COLUMNS)]
            rows = _rows({name: columns[name] for name in (*first, *rest)})
            found += [{"step": result.step, **row} for row in rows]
    return found


def describe(value: Any, without: tuple[str, ...] = ()) -> Any:
    """Scene data as JSON: expressions as text, and a note of the type for everything that cannot be written.

    Args:
        value: the data.
        without: keys of tables to leave out, which a scene in the plane, or one in space, does not have.
    """
    if isinstance(value, BaseModel):
        names = (name for name in type(value).model_fields if name not in without)
        return {name: describe(getattr(value, name), without) for name in names}
    if isinstance(value, Mapping):
        return {str(key): describe(item, without) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [describe(item, without) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    if value is None or isinstance(value, str | int | float | bool):
        return value
    if isinstance(value, Path):
        return value.name
    return getattr(value, "text", f"<{type(value).__name__}>")


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Rows with a header; numbers with all digits, and names as text that no spreadsheet takes for a formula."""
    with path.open("w", newline="", encoding="utf-8", errors="backslashreplace") as file:
        if rows:
            writer = csv.DictWriter(file, rows[0].keys())
            writer.writeheader()
            writer.writerows({key: _cell(value) for key, value in row.items()} for row in rows)


def _cell(value: Any) -> Any:
    """A value as it is written in a CSV file."""
    if isinstance(value, np.generic):
        return value.item()
    return as_text(value) if isinstance(value, str) else value


def _hypothesis(solution: Solution) -> str:
    """Plane strain or plane stress: one for the whole body."""
    return solution.scene.material[0].hypothesis


@dataclass(frozen=True)
class GatheredCells:
    """The whole mesh with its result on one rank, for a picture.

    Attributes:
        points: vertex positions, shape (n, 2); a vertex appears once for each rank that has it.
        cells: vertices of each cell along its perimeter, shape (m, 3) or (m, 4).
        displacement: at the points, shape (n, 2).
        density: shear energy density, energy per volume, one value per cell (at its midpoint), shape (m,).
        mises: von Mises stress there, shape (m,).
    """

    points: npt.NDArray[np.float64]
    cells: npt.NDArray[np.int64]
    displacement: npt.NDArray[np.float64]
    density: npt.NDArray[np.float64]
    mises: npt.NDArray[np.float64]


def gather_cells(solution: Solution) -> GatheredCells:
    """Vertices, cells and their values from all ranks, on the first one, and none on the others; collective."""
    d = solution.discretisation
    mesh = d.tagged.mesh
    comm = solution.comm
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    linear = fem.Function(fem.functionspace(mesh, ("Lagrange", 1, (2,))))
    linear.interpolate(solution.displacement)
    density = shear_energy_density(solution.displacement, *d.lame, _hypothesis(solution))
    both = ufl.as_vector((density, ufl.sqrt(6 * d.lame[1] * density)))
    constant = interpolated(both, fem.functionspace(mesh, ("DG", 0, (2,))))
    space = linear.function_space
    cells = space.dofmap.list[:owned].astype(np.int64)
    if cells.shape[1] == 4:
        cells = cells[:, [0, 1, 3, 2]]
    x = space.tabulate_dof_coordinates()[:, :2]
    counts = comm.allgather(x.shape[0])
    cells += sum(counts[: comm.rank])
    per_cell = parallel.rows_on_root(
        comm, constant.x.array.reshape(-1, 2)[constant.function_space.dofmap.list[:owned, 0]]
    )
    return GatheredCells(
        parallel.rows_on_root(comm, x),
        parallel.rows_on_root(comm, cells),
        parallel.rows_on_root(comm, linear.x.array.reshape(-1, 2)[: x.shape[0]]),
        per_cell[:, 0],
        per_cell[:, 1],
    )


def _moments(solution: Solution) -> list[Moment]:
    """The body at each of several load steps that an animation shows; collective."""
    from signorini_fx.report.moving_body import Moment, shown

    steps = solution.shown_steps
    if len(steps) < 2:
        return []
    found = []
    for step in (steps[k] for k in shown(len(steps))):
        moment = solution.at(step)
        if solution.discretisation.tagged.dimension == 2:
            body: GatheredCells | OuterSurface = gather_cells(moment)
        else:
            from signorini_fx.results.outer_surface import gather_outer_surface

            body = gather_outer_surface(moment)
        found.append(Moment(str(step), body.displacement, body.mises))
    return found


def _draw_load_steps(folder: Path) -> None:
    """The forces step by step."""
    from signorini_fx.report.load_steps import load_steps
    from signorini_fx.report.reading import read_csv

    load_steps(folder / "load_steps", read_csv(folder / "steps.csv"))


def _draw(
    solution: Solution,
    gathered: GatheredCells,
    table: ContactTable | None,
    folder: Path,
    moments: Sequence[Moment],
) -> None:
    # matplotlib takes a while to import
    from signorini_fx.report.boundary_profiles import boundary_profiles
    from signorini_fx.report.deformed_body import Foundation, deformed_mesh, magnification
    from signorini_fx.report.moving_body import moving_body
    from signorini_fx.report.pyvista_pictures import draw_fields
    from signorini_fx.report.style import plain

    title = plain(solution.scene.title)
    foundation = None
    if table is not None:
        c = table.columns
        foundation = Foundation(
            np.column_stack((c["x"], c["y"])),
            np.column_stack((c["n_x"], c["n_y"])) * c["gap"][:, None],
            c["state"] != "open",
        )
    deformed_mesh(
        folder / "deformed",
        gathered.points,
        gathered.cells,
        gathered.displacement,
        gathered.mises,
        foundation=foundation,
        title=title,
    )
    if moments:
        moving_body(
            folder / "deformed.gif", gathered.points, gathered.cells, moments, foundation=foundation, title=title
        )
    factor = magnification(gathered.points, gathered.displacement)
    draw_fields(folder, gathered.points, gathered.cells, gathered.displacement, gathered.density, factor)
    if table is not None:
        boundary_profiles(folder / "profiles", table.columns, title=title)
    _draw_course(solution, folder)


def _draw_course(solution: Solution, folder: Path) -> None:
    """The convergence history for a picture."""
    from signorini_fx.report.convergence import errors_against_time, iteration_history
    from signorini_fx.report.style import plain

    dimension = solution.discretisation.tagged.dimension
    if solution.history.iterations:
        iteration_history(folder / "history", as_rows(solution.history.iterations), dimension=dimension)
    if solution.price_list:
        errors_against_time(folder / "price_list", as_rows(solution.price_list), title=plain(solution.scene.title))


def _outer_surface(solution: Solution) -> OuterSurface | None:
    """The data for the picture of a body in space; None if there are too many facets; collective."""
    from signorini_fx.report.solid_body import MOST_FACETS
    from signorini_fx.results.outer_surface import gather_outer_surface, outer_facets

    count = outer_facets(solution)
    if count <= MOST_FACETS:
        return gather_outer_surface(solution)
    parallel.log_on_root(
        solution.comm,
        f"the deformed body is not drawn: its surface has {count} facets, more than {MOST_FACETS}: see it in ParaView",
    )
    return None


def _draw_in_space(
    solution: Solution,
    outer: OuterSurface | None,
    table: ContactTable | None,
    folder: Path,
    moments: Sequence[Moment],
) -> None:
    from signorini_fx.report.contact_surface import contact_surface
    from signorini_fx.report.moving_body import moving_body
    from signorini_fx.report.reading import read_facets
    from signorini_fx.report.solid_body import deformed_solid
    from signorini_fx.report.style import plain

    title = plain(solution.scene.title)
    if outer is not None:
        foundations = foundations_of(table.columns) if table is not None else []
        deformed_solid(
            folder / "deformed",
            outer.points,
            outer.facets,
            outer.displacement,
            outer.mises,
            foundations=foundations,
            title=title,
        )
        if moments:
            moving_body(
                folder / "deformed.gif", outer.points, outer.facets, moments, foundations=foundations, title=title
            )
    if table is not None:
        contact_surface(folder / "contact_surface", table.columns, read_facets(folder / "contact.vtu"), title=title)
    _draw_course(solution, folder)


def foundations_of(c: Mapping[str, Any]) -> list[tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]]:
    """Nodes of each contact boundary in space and the vectors d n from there to the foundation, both (k, 3)."""
    nodes, normals = (np.column_stack([c[f"{name}{axis}"] for axis in "xyz"]) for name in ("", "n_"))
    offset = normals * np.asarray(c["gap"])[:, None]
    where = [c["boundary"] == name for name in dict.fromkeys(c["boundary"])]
    return [(nodes[rows], offset[rows]) for rows in where]
