"""The report of a result folder: one page of HTML that needs no network and no other file, and can
be read without scripts.

It is made from the files of ``solve``, without dolfinx, and has the pictures that ``solve`` drew.
Results come first, then their checks and how they were computed.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from signorini_fx import __version__
from signorini_fx.addons.report import sections
from signorini_fx.addons.report.markup import Markup, joined, part, rendered
from signorini_fx.addons.report.turning_body import turning_body, turning_mesh
from signorini_fx.errors import OutputError, ResultError, cannot_be_written
from signorini_fx.machine import manifest
from signorini_fx.machine.display import status_in_words
from signorini_fx.machine.result_files import read_csv, read_summary
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.statement.units import labelled, names_of
from signorini_fx.quantities.shown import Summary, was_solved

PAGE = "report.html"
# By this a page is known to be one of these.
_MADE_BY = '<meta name="generator" content="signorini_fx'


def page(folder: Path, only: Sequence[str] = ()) -> str:
    """Return the report of a result folder as HTML.

    Args:
        folder: the result folder.
        only: its chapters; () for all.

    Raises:
        ResultError: it is not a result folder, or it is incomplete.
    """
    summary = read_summary(folder)
    try:
        with labelled(names_of(summary["scene"], summary["dimension"])):
            return _page(summary, folder, only)
    except FileNotFoundError as error:
        name = Path(error.filename).name
        raise ResultError(
            f"{folder}: {name} is missing, so this is only a part of a result: solve again"
        ) from None
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        OSError,
        RecursionError,
        TypeError,
        ValueError,
    ) as error:
        raise ResultError(
            f"{folder}: its files are not as signorini-fx {__version__} writes them, or do not "
            "belong together "
            f"({type(error).__name__}: {error}): solve again"
        ) from error


def _page(summary: Summary, folder: Path, only: Sequence[str]) -> str:
    name = folder.resolve().name
    solved = was_solved(summary)
    contact = "contact_nodes" in summary
    no_result = sections.no_result(summary)
    note = (
        part("note", no_result) if no_result else Markup("")
    )  # on the state that figures belong to
    # First the outcome, then the results, then their checks, and last how they were computed.
    chapters = {
        "Outcome": sections.outcome(summary, folder),
        "Body": turning_body(summary, folder) if solved else Markup(""),
        "Figures": Markup("") if no_result else sections.figures(summary),
        "Further pictures": sections.further_pictures(folder),
    }
    if solved and contact:
        drawn = sections.contact(summary, folder)
        chapters["Contact"] = drawn and joined([note, drawn])
    if solved and "steps" in summary:
        table = read_csv(folder / "steps.csv")
        if len(table["step"]) != len(summary["steps"]):
            raise ValueError(
                f"steps.csv has {len(table['step'])} rows, {len(summary['steps'])} are expected"
            )
        chapters["Load steps"] = joined([note, sections.steps(table, summary, folder)])
    if "convergence_table" in summary:
        chapters["Convergence table"] = sections.convergence_table(summary["convergence_table"])
    chapters["Certificate"] = sections.certificate(summary) if solved else Markup("")
    chapters["Scene and effects"] = sections.scene(summary)
    if solved and contact:
        chapters["Iteration"] = sections.history(summary)
    chapters["Made with"] = sections.made_with(summary)
    day = ""
    if "finished" in summary:
        day = f"{sections.done(summary)} on {summary['finished'].partition('T')[0]}"
    chosen = {head: chapters[head] for head in only or chapters if chapters[head]}
    return _rendered(summary["title"] or name, status_in_words(summary), name, day, chosen)


def _rendered(title: str, status: str, name: str, day: str, chapters: dict[str, Markup]) -> str:
    """Return a page with its head and its chapters."""
    style = resources.files("signorini_fx.addons.report").joinpath("report.css")
    head = {"version": __version__, "title": title, "status": status, "name": name, "day": day}
    css = Markup(style.read_text(encoding="utf-8"))
    return f"{rendered('page', **head, style=css, chapters=chapters)}\n"


def write_mesh_page(mesh: MeshArrays, file: Path) -> None:
    """Write a page on which a mesh in 3D turns, with its boundaries named under the pointer.

    Raises:
        OutputError: the page cannot be written.
    """
    head = f"{len(mesh.boundaries)} boundaries"
    text = _rendered(file.stem, head, file.stem, "", {"Boundaries": turning_mesh(mesh)})
    try:
        file.write_text(text, encoding="utf-8", errors="xmlcharrefreplace")
    except OSError as error:
        raise cannot_be_written(file, error) from None


def write_report(
    folder: str | Path, file: str | Path | None = None, only: Sequence[str] = ()
) -> Path:
    """Write the report of a result folder.

    Args:
        folder: the result folder that ``solve`` wrote.
        file: the page; None for ``report.html`` in the folder.
        only: its chapters; () for all.

    Returns:
        The file.

    Raises:
        ResultError: the folder is not a result folder, or it is incomplete.
        OutputError: the page cannot be written, or a file of this name exists and is no report.
    """
    folder = Path(folder)
    text = page(folder, only)
    file = Path(folder / PAGE if file is None else file)
    listed = file.parent == folder
    if file.is_dir():
        raise OutputError(f"{file}: is a folder: give the name of a file")
    if os.path.lexists(file) and not _is_page(file):
        raise OutputError(
            f"{file}: already exists, and is no report: give another name, or remove it"
        )
    part = file.parent / f".{file.name}.part"
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="utf-8", errors="xmlcharrefreplace")
        if listed:
            manifest.add(folder, [file.name])
        part.replace(file)
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        with contextlib.suppress(OSError, ValueError):
            part.unlink(missing_ok=True)
        raise cannot_be_written(file, error) from None
    return file


def _is_page(file: Path) -> bool:
    try:
        with file.open(encoding="utf-8") as stream:
            return _MADE_BY in stream.read(1000)
    except (OSError, ValueError):
        return False
