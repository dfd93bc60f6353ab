"""The files of a result folder: summary, tables, fields, pictures."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from signorini_fx.errors import (
    InstallationError,
    MissingPackageError,
    PictureError,
    ResultError,
    cannot_be_written,
)
from signorini_fx.extensions import add_on
from signorini_fx.machine import parallel
from signorini_fx.machine.result_files import (
    Table,
    read_csv,
    read_summary,
    write_columns,
    write_csv,
)
from signorini_fx.machine.terminal import printable, say
from signorini_fx.mechanics.contact_points.contact_table import ContactTable, contact_table
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.quantities.values import of_fields
from signorini_fx.records import Finding
from signorini_fx.results.fields import (
    FIELD_FILES,
    VTU,
    write_fields,
    write_surface,
)
from signorini_fx.results.folder import SUMMARY, ResultFolder
from signorini_fx.results.solution import Solution
from signorini_fx.results.summary import asked, post_processing, proved, summary_of

# Fields drawn on demand: the von Mises stress always is, and the displacement around the axis where
# there is one.
ON_DEMAND = ("pressure", "displacement", "density")
_PICTURES = (
    *(
        "deformed",
        "profiles",
        "convergence_table",
        "contact_surface",
        "load_steps",
        "effects",
        "setup",
    ),
    *(f"field_{name}" for name in (*ON_DEMAND, "around")),
)
# All files of a result, although some are written by some runs only, and its report.
FILES = (
    *(
        f"{name}.csv"
        for name in (
            *("history", "outer", "steps", "time_steps", "contact", "contact_steps"),
            "convergence_table",
        )
    ),
    *(f"{name}.{kind}" for name in _PICTURES for kind in ("png", "pdf")),
    *FIELD_FILES,
    "contact.vtu",
    "report.html",
    "view.html",
)
# The columns that come first in the table of all load steps, and those that it leaves out.
_CONSTANT_COLUMNS = (
    "against",
    "gap",
    "slip",
    "slip_x",
    "slip_y",
    "slip_z",
    "weight",
    "n_x",
    "n_y",
    "n_z",
)
_LEADING_COLUMNS = ("x", "y", "z", "s", "boundary")


def write_results(
    solution: Solution,
    folder: str | Path | ResultFolder | None,
    *,
    fields: bool = True,
    pictures: bool | Sequence[str] = True,
    pdf: bool = False,
) -> dict[str, Any]:
    """Write the result folder; collective.

    The result is in place before guaranteed bounds, friction used, further tables and pictures are
    made.  If one of these fails, the summary has a warning.

    Args:
        solution: what to write, converged or not.
        folder: made if it does not exist, or claimed before; None: nothing is written.
        fields: write the fields for ParaView.
        pictures: draw the deformed body with the von Mises stress, and the contact boundary; a list
            of names: draw the deformed body with these fields too (``pressure``, ``displacement``,
            ``density``).
        pdf: write each picture as a PDF, for print, beside the PNG.

    Returns:
        The summary.

    Raises:
        TypeError: the first argument is not a solution.
        ValueError: ``fields`` is neither True nor False, or a field in ``pictures`` is not known.
        InstallationError: pictures of certain fields are asked for, and the add-on is missing.
        OutputError: something could not be written, or a file is in the way that is no result; an
            older result is still there, or there is no summary.json.

    Examples:
        >>> import tempfile
        >>> folder = tempfile.mkdtemp() + "/block"
        >>> summary = sfx.write_results(solution, folder, fields=False, pictures=False)
        >>> print(summary["status"], np.round(summary["contact_force"], 6))
        converged [0. 4.]
    """
    if not isinstance(solution, Solution):
        raise TypeError(f"write_results takes a Solution and a folder, not {kind_of(solution)}")
    if folder is None:
        summary = _standing(solution) | of_fields(solution)
        return summary | proved(solution, summary["findings"])
    if not isinstance(fields, bool):
        raise ValueError(
            f"fields: True or False is expected, got {fields!r}: all of them are in {VTU}"
        )
    if not isinstance(pictures, bool):
        pictures = [pictures] if isinstance(pictures, str) else list(pictures)
        if wrong := [name for name in pictures if name not in ("von_mises", *ON_DEMAND)]:
            raise ValueError(
                f"no picture of {', '.join(map(repr, wrong))}: there are "
                f"{', '.join(('von_mises', *ON_DEMAND))}"
            )
    gather: Callable[..., Any] | None = None
    missing = ""
    try:
        gather = add_on("pictures") if pictures is not False else None
    except InstallationError as error:
        if not isinstance(pictures, bool):
            raise
        missing = str(error) if isinstance(error, MissingPackageError) else ""
    with (
        folder
        if isinstance(folder, ResultFolder)
        else ResultFolder(solution.comm, folder, FILES) as claimed
    ):
        return _Written(solution, claimed).write(
            fields,
            gather
            and partial(gather, asked=() if isinstance(pictures, bool) else pictures, pdf=pdf),
            missing,
        )


def title_of_result(folder: Path) -> str | None:
    """Return the title of the scene whose result is in a folder, or None if the folder has no
    result.
    """
    try:
        return str(read_summary(folder).get("title", ""))
    except ResultError:
        return None


def _standing(solution: Solution) -> dict[str, Any]:
    """Return the summary of the solution and a description of its scene.  Collective."""
    model = solution.model
    tables = solution.statement.tables
    if "forms" in tables:
        tables |= {"title": model.title, "load_steps": vars(model.path)}
    # Keys that a scene in 2D, or one in 3D, does not have.
    left_out = ("z" if model.tagged.dimension == 2 else "hypothesis",)
    return summary_of(solution) | {"scene": describe(tables, left_out)}


@dataclass(frozen=True)
class _Written:
    """A solution and the claimed folder that it is written into; every method is collective."""

    solution: Solution
    folder: ResultFolder

    def write(
        self, fields: bool, gather: Callable[[Solution], Any] | None, missing: str
    ) -> dict[str, Any]:
        """Write the result, then bounds, further tables and pictures, each of which may fail, and
        return the summary.
        """
        solution = self.solution
        folder = self.folder
        table = solution.table if solution.contact is not None else None
        summary = self._stands(table, fields)
        findings = summary["findings"]
        if missing:
            findings.append(Finding("note", "pictures", f"are not drawn: {missing}").as_row())
            self._on_root(lambda: say(f"pictures are not drawn: {missing}"))
        drawn = ["pictures"] if gather is not None else []
        self._put(summary, [*asked(solution), "tables", *drawn])
        folder.commit()
        post_processing(solution.comm, "tables", findings, lambda: self._tables(table))
        summary |= proved(solution, findings)
        self._put(summary, drawn)
        folder.add()
        if gather is not None:
            count = len(findings)
            post_processing(
                solution.comm,
                "pictures",
                findings,
                lambda: self._pictures(table, gather(solution)),
            )
            if len(findings) > count:
                parallel.on_root(solution.comm, folder.clear)  # a file may be truncated
            self._put(summary, [])
            folder.add()
        return summary

    def _stands(self, table: ContactTable | None, fields: bool) -> dict[str, Any]:
        """Write the fields and the tables of the result, and return the summary."""
        solution = self.solution
        comm = self.solution.comm
        part = self.folder.part
        summary = _standing(solution)
        summary["finished"] = parallel.on_root(
            comm, lambda: datetime.now(UTC).isoformat(timespec="seconds")
        )
        steps = summary.get("steps", [])
        if fields:
            try:
                summary["fields"] = write_fields(solution, part)
            except OSError as error:
                raise cannot_be_written(self.folder.path, error) from None
            summary |= of_fields(solution)
        corners = [_flat(figures.model_dump()) for figures in solution.corner_figures]

        def write() -> None:
            for name, records in (
                ("history", solution.history.iterations),
                ("outer", solution.history.outer),
            ):
                rows = [asdict(record) for record in records]
                if not steps:
                    rows = [
                        {key: value for key, value in row.items() if key != "step"} for row in rows
                    ]
                write_csv(part / f"{name}.csv", rows)
            if steps:
                write_csv(part / "steps.csv", steps)
            shorter = [row for step in solution.steps for row in step.between]
            if shorter:
                columns = dict.fromkeys(name for _, told in shorter for name in told)
                rows = [
                    {"time": time, **{name: told.get(name) for name in columns}}
                    for time, told in shorter
                ]
                write_csv(part / "time_steps.csv", rows)
            if table is not None:
                write_columns(part / "contact.csv", table.columns)
            if corners:
                write_csv(part / "corners.csv", corners)

        self._on_root(write)
        return summary

    def _tables(self, table: ContactTable | None) -> None:
        """Write the further tables: convergence table, contact surface, and contact by load
        step.
        """
        solution = self.solution
        part = self.folder.part
        along_steps = (
            _contact_by_step(solution) if solution.model.path.several and table is not None else {}
        )

        def write() -> None:
            if solution.convergence_table:
                write_csv(
                    part / "convergence_table.csv",
                    [row.model_dump() for row in solution.convergence_table],
                )
            if table is not None and table.facets is not None:
                write_surface(part / "contact.vtu", table)
            if along_steps:
                write_columns(part / "contact_steps.csv", along_steps)

        self._on_root(write)

    def _pictures(self, table: ContactTable | None, gathered: Any) -> None:
        """Draw all pictures; some are drawn from tables that are already written."""
        folder = self.folder

        def draw() -> None:
            written = (folder.path / name for name in ("steps.csv", "contact_steps.csv"))
            tables = [read_csv(file) if file.is_file() else None for file in written]
            try:
                gathered.draw(folder.part, table, *tables)
            except PictureError as error:
                say(f"the deformed body is not drawn: {error}")

        self._on_root(draw)

    def _put(self, summary: dict[str, Any], absent: list[str]) -> None:
        """Write summary.json, with a warning for each entry that is still absent."""
        reason = "is missing: the run ended before it was complete"
        findings = [
            *summary["findings"],
            *(Finding("warning", name, reason).as_row() for name in absent),
        ]
        text = json.dumps(for_json({**summary, "findings": findings}), indent=2, allow_nan=False)
        self._on_root(
            lambda: (self.folder.part / SUMMARY).write_text(text + "\n", encoding="utf-8")
        )

    def _on_root(self, write: Callable[[], object]) -> None:
        """Write files on the first rank; an OSError becomes an OutputError on all ranks."""

        def attempt() -> None:
            try:
                write()
            except OSError as error:
                raise cannot_be_written(self.folder.path, error) from None

        parallel.on_root(self.solution.comm, attempt)


def for_json(value: Any) -> Any:
    """Return plain data for JSON: numbers that are not finite become null, control characters are
    escaped.
    """
    if isinstance(value, dict):
        return {for_json(key): for_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [for_json(item) for item in value]
    if isinstance(value, str):
        return value if value.isprintable() else printable(value)
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _contact_by_step(solution: Solution) -> Table:
    """Return the columns of the contact boundary in all load steps, the number of the step first;
    empty on ranks other than the first.  Collective.
    """
    tables: list[Table] = []
    for result in solution.shown_steps:
        if result.contact is not None:
            columns = contact_table(result.contact, *solution.statement.sides).columns
            first = [name for name in _LEADING_COLUMNS if name in columns]
            trailing = [name for name in columns if name not in (*first, *_CONSTANT_COLUMNS)]
            if parallel.is_root(solution.comm):
                steps = np.full(len(columns["x"]), result.step)
                tables.append(
                    {"step": steps, **{name: columns[name] for name in (*first, *trailing)}}
                )
    return {
        name: np.concatenate([table[name] for table in tables])
        for name in (tables[0] if tables else ())
    }


def describe(
    value: Any,
    without: tuple[str, ...] = (),
    of_file: Callable[[Path], str] = lambda path: path.name,
) -> Any:
    """Return scene data as JSON-safe values: expressions as text, and the name of the type for
    everything that cannot be written.

    Args:
        value: the data.
        without: keys of tables to leave out, because a scene in 2D, or one in 3D, does not have
            them.
        of_file: returns the text that represents a file.
    """

    def inner(value: Any) -> Any:
        return describe(value, without, of_file)

    if isinstance(value, BaseModel):
        return {
            name: inner(getattr(value, name))
            for name in type(value).model_fields
            if name not in without
        }
    if isinstance(value, Mapping):
        return {str(key): inner(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [inner(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    if value is None or isinstance(value, str | int | float | bool):
        return value
    if isinstance(value, Path):
        return of_file(value)
    if isinstance(value, TaggedMesh) and value.origin:
        return {**describe(value.origin), "refined": True}
    return getattr(value, "text", f"<{type(value).__name__}>")


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row of a table in which each component of a vector has its own column."""
    columns: dict[str, Any] = {}
    for name, value in row.items():
        one = isinstance(value, list)
        columns |= (
            {f"{name}_{a}": v for a, v in zip("xyz", value, strict=False)} if one else {name: value}
        )
    return columns
