"""The commands: those that run on one process return the text to print, the others the exit
code.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import signal
import webbrowser
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from signorini_fx.errors import (
    OptionsError,
    OutputError,
    SceneError,
    SignoriniError,
    cannot_be_written,
)
from signorini_fx.extensions import add_on
from signorini_fx.machine import terminal
from signorini_fx.scenes.cli.grammar import (
    EXIT_BAD_INPUT,
    EXIT_INCOMPLETE,
    EXIT_NO_SOLUTION,
    EXIT_OK,
    changes,
    several_values,
)

if TYPE_CHECKING:
    from mpi4py import MPI

    from signorini_fx.records import Record
    from signorini_fx.scenes.scene import Scene


def _start_petsc(options: Sequence[str]) -> None:
    """Start PETSc, once, with these options from the command line."""
    words = [*os.environ.get("PETSC_OPTIONS", "").split(), *options]
    if any(word.startswith("-options_file") for word in words):
        raise OptionsError(
            "PETSc option -options_file: files of options are not read: give the options after --"
        )
    import petsc4py

    try:
        petsc4py.init(["signorini-fx", "-no_signal_handler", "-skip_petscrc", *options])
    except (
        Exception
    ) as error:  # petsc4py.PETSc.Error, which cannot be imported before PETSc has started
        raise OptionsError(
            f"PETSc does not start with the options {' '.join(options)!r}: {error}"
        ) from None


def _begin_job(petsc_options: Sequence[str]) -> None:
    """Start PETSc in a parallel process; only the first process handles an interrupt from the
    keyboard.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _start_petsc(petsc_options)


def _read_scene(
    options: argparse.Namespace, comm: MPI.Comm, leave_out: Sequence[str] = ()
) -> Scene:
    """Return the scene on every rank, with the changes of the command line, and start PETSc.

    Args:
        options: the command line.
        comm: the ranks.
        leave_out: paths whose changes are not applied.
    """
    from signorini_fx.machine import parallel
    from signorini_fx.scenes.reading import parse_scene_text, read_scene_text

    text = parallel.on_root(comm, lambda: read_scene_text(options.scene))
    entries = {path: value for path, value in changes(options).items() if path not in leave_out}
    scene = parse_scene_text(text, options.scene, entries)
    _start_petsc(options.petsc_options)
    return scene


def solve(options: argparse.Namespace, comm: MPI.Comm) -> int:
    """Solve a scene and write its results."""
    from signorini_fx.machine import parallel

    path = options.out or Path("results") / options.scene.stem
    scene = _read_scene(options, comm)
    from signorini_fx.quantities.shown import short_answer
    from signorini_fx.results import files
    from signorini_fx.results.folder import CHECKPOINT, ResultFolder
    from signorini_fx.results.progress_line import ProgressLine
    from signorini_fx.results.solution import outcome
    from signorini_fx.results.summary import lines_of, table_row
    from signorini_fx.scenes import solver

    if not gc.get_freeze_count():  # imported objects stay, so the garbage collector can skip them
        gc.freeze()
    fields = not options.no_fields
    if options.picture:
        add_on("pictures")

    line = ProgressLine()

    def show(record: Record) -> None:
        line.erase()
        terminal.say_once(comm, table_row(record))

    observers: list[Callable[[Record], None]] = [
        *[show] * options.verbose,
        *[line] * (not options.quiet),
    ]
    folder: ResultFolder | None = None
    try:
        with ResultFolder(comm, path, (*files.FILES, CHECKPOINT)) as folder:
            older = parallel.on_root(comm, lambda: files.title_of_result(path))
            if older not in (None, scene.title) and not options.quiet:
                terminal.say_once(
                    comm, f"{path}: the result of another scene, {older!r}, will be replaced"
                )
            try:
                solution = solver.solve(
                    scene,
                    comm,
                    check=False,
                    observers=observers,
                    checkpoint=path,
                    restart=options.restart,
                )
            finally:
                line.erase()
            pictures = False if options.no_pictures else options.picture or True
            if pictures:
                # Skips the docstrings of matplotlib, which take a tenth of the time of a short run.
                with suppress(ImportError):
                    from matplotlib.artist import Artist

                    hook = "_update_set_signature_and_docstring"
                    setattr(Artist, hook, classmethod(lambda _: None))
            summary = files.write_results(
                solution, folder, fields=fields, pictures=pictures, pdf=options.pdf
            )
    except KeyboardInterrupt:
        kept = folder is not None and folder.committed
        where = (
            f": the results are in {path}/" if kept else "; run again with --restart to continue"
        )
        raise KeyboardInterrupt(where) from None
    if not options.quiet:
        terminal.say_once(
            comm, lines_of(summary, path) if options.verbose else short_answer(summary, path)
        )
    if not solution.converged:
        # The summary above contains the advice.
        ended = terminal.TerminalLine(
            "signorini-fx: ", outcome(solution, advice=options.quiet), "error"
        )
        terminal.say_once(comm, [ended], error=True)
        return EXIT_NO_SOLUTION
    if lacking := len(solution.statement.incomplete):
        items = f"{lacking} item{'s' * (lacking > 1)}, listed under incomplete"
        message = f"the scene lacks {items}: these are not the results of your model"
        warning = terminal.TerminalLine("signorini-fx: ", message, "error")
        terminal.say_once(comm, [warning], error=True)
    return EXIT_INCOMPLETE if lacking else EXIT_OK


def sweep(options: argparse.Namespace, comm: MPI.Comm) -> int:
    """Solve a scene for several values of some of its entries."""
    from signorini_fx.records import Status
    from signorini_fx.scenes import sweep as study

    path = options.out or Path("results") / f"sweep_{options.scene.stem}"
    entries = several_values(changes(options))
    paths = list(entries)
    scene = _read_scene(options, comm, leave_out=paths)
    combinations = study.combinations(entries)
    if options.jobs > 1 and comm.size > 1:
        raise OptionsError("--jobs is for one rank: leave mpirun out")
    begin = partial(_begin_job, options.petsc_options)
    with study.SweepFolder(comm, path, scene, combinations) as folder:
        if options.restart:
            folder.recall()
        terminal.say_once(comm, study.heading(paths))
        for row in folder.rows:
            terminal.say_once(comm, study.line_of(paths, row))
        try:
            for row in folder.solved(scene, options.jobs, begin):
                terminal.say_once(comm, study.line_of(paths, row))
        except KeyboardInterrupt:
            done = f"{len(folder.rows)} of {len(combinations)} values are in {path}/"
            raise KeyboardInterrupt(f": {done}; --restart goes on from there") from None
    rows = folder.rows
    terminal.say_once(comm, f"results: {path}/")
    return (
        EXIT_OK
        if all(row["status"] == Status.CONVERGED.value for row in rows)
        else EXIT_NO_SOLUTION
    )


def calibrate(options: argparse.Namespace, comm: MPI.Comm) -> int:
    """Print the values of entries for which the scene fits the measured results."""
    scene = _read_scene(options, comm)
    terminal.say_once(comm, str(add_on("calibrate")(scene, options.measured, options.by, comm)))
    return EXIT_OK


def check(options: argparse.Namespace, comm: MPI.Comm) -> int:
    """Print what acts in a scene, its cost and findings, without solving it."""
    try:
        scene = _read_scene(options, comm)
        from signorini_fx.scenes.checks import check_scene, text_of
        from signorini_fx.scenes.mesh import load_mesh
        from signorini_fx.scenes.reading import as_scene

        scene = as_scene(scene, comm)
        checked = check_scene(scene, comm, uniqueness=options.verbose)
        if options.picture is not None:
            add_on("draw_setup")(
                partial(load_mesh, scene, comm), scene.statement, comm, options.picture
            )
    except SignoriniError as error:
        if options.json:
            problems = error.problems if isinstance(error, SceneError) else [("mesh", str(error))]
            report = {
                "problems": [{"path": path, "message": message} for path, message in problems]
            }
            terminal.say_once(comm, json.dumps(report, indent=2))
        raise
    text = text_of(checked, verbose=options.verbose)
    terminal.say_once(comm, json.dumps(checked.as_dict(), indent=2) if options.json else text)
    warned = any(finding.level == "warning" for finding in checked.findings)
    return EXIT_BAD_INPUT if options.strict and warned else EXIT_OK


def info(_: argparse.Namespace, comm: MPI.Comm) -> int:
    """Print the versions of libraries and the factorisations in use."""
    from signorini_fx.algebra.linalg.factorisation import factorisation_package
    from signorini_fx.results.summary import versions

    lines = [f"{name:14s} {version}" for name, version in versions().items()]
    lines.append(f"{'Cholesky':14s} {factorisation_package(comm, symmetric=True)}")
    lines.append(f"{'LU':14s} {factorisation_package(comm, symmetric=False)}")
    terminal.say_once(comm, "\n".join(lines))
    return EXIT_OK


def new(options: argparse.Namespace) -> str | tuple[str, int]:
    """Write a scene to start from, or one for a drawing or a mesh, or a draft from a deck; existing
    files are not overwritten.
    """
    from signorini_fx.mechanics.statement.mesh_sources import MESH_FORMATS

    if options.deck is None and options.file.suffix.lower() in MESH_FORMATS:
        return _new_of_mesh(options)
    file = options.out or options.file
    if options.deck is None:
        from signorini_fx.scenes.template import starting_scene

        _write_scene(file, starting_scene(full=options.full))
        return (
            f"{file} is a scene that can be solved as it is; change it, then run: signorini-fx "
            f"check {file}"
        )
    if options.deck.suffix.lower() != ".inp":
        raise OutputError(
            f"{options.deck}: a scene is drafted from an input file of Abaqus or CalculiX, .inp"
        )
    draft = add_on("draft").draft(options.deck, file)
    _write_scene(file, draft.text)
    lines = [f"{file} is the draft of a scene; check it: signorini-fx check {file}"]
    lines += [f"does not change the answer: {remark}" for remark in draft.noted]
    lines += [f"changes the answer: {remark}" for remark in draft.lost]
    if draft.lost:
        lines.append(
            f"{file} is incomplete: complete it, and remove from 'incomplete' what you have "
            "completed"
        )
    return "\n".join(lines), EXIT_INCOMPLETE if draft.lost else EXIT_OK


def _write_scene(file: Path, text: str, *, over: bool = False) -> None:
    """Write a scene file; an existing one is replaced only with ``over``.

    Raises:
        OutputError: the file exists, or cannot be written.
    """
    try:
        with file.open("w" if over else "x", encoding="utf-8") as out:
            out.write(text)
    except FileExistsError:
        raise OutputError(f"{file}: already exists: give another name, or remove it") from None
    except (OSError, ValueError) as error:
        raise cannot_be_written(file, error) from None


def _new_of_mesh(options: argparse.Namespace) -> str:
    """Write a scene for a drawing or a mesh, and a picture with the names of its boundaries."""
    from mpi4py import MPI

    from signorini_fx.mechanics.mesh.files.formats import read_file
    from signorini_fx.mechanics.statement.mesh_sources import MeshFile
    from signorini_fx.scenes import found_contacts

    mesh = MeshFile(file=options.file, size=options.size)
    scene = options.out or Path(f"{options.file.stem}.toml")
    arrays = read_file(mesh)
    _write_scene(scene, found_contacts.scene_of(mesh, arrays, scene))
    picture = scene.with_suffix(".png")
    add_on("draw_mesh")(mesh, MPI.COMM_SELF, picture)
    shows = f"{picture} shows the names of its boundaries"
    if arrays.dim == 3:
        page = scene.with_suffix(".html")
        add_on("mesh_page")(arrays, page)
        shows += f", and {page} those under the pointer"
    if options.file.suffix.lower() == ".inp":
        shows += f"; a draft with those of the deck: --from {options.file}"
    return (
        f"{scene} is a scene without materials, supports and loads; {shows}. Fill in what is 0.0 "
        f'or "", then run: signorini-fx check {scene}'
    )


def contacts(options: argparse.Namespace) -> str:
    """Print the contacts that a file of several bodies suggests, or write them into a scene."""
    from signorini_fx.mechanics.statement.mesh_sources import MeshFile
    from signorini_fx.scenes import found_contacts
    from signorini_fx.scenes.reading import read_scene_text

    mesh = MeshFile(file=options.file, size=options.size)
    found = found_contacts.contacts_of(mesh, options.within)
    lines = found_contacts.in_words(found)
    if options.into is None:
        entry = found_contacts.mesh_entry(mesh, Path(), found.contacts)
        words = [f"# {line}" for line in lines]
        return "\n".join([*words, entry, "", found_contacts.as_entries(found.contacts)])
    text = read_scene_text(options.into)
    new_text = found_contacts.with_contacts(text, options.into, found.contacts)
    _write_scene(options.into, new_text, over=True)
    return "\n".join([*lines, f"they are in {options.into}"])


def report(options: argparse.Namespace) -> str:
    """Write the report of a result folder."""
    return str(add_on("report")(options.folder, options.out))


def view(options: argparse.Namespace) -> str:
    """Write a page with the body, which can be rotated, and open it if there is a display."""
    file = add_on("report")(options.folder, options.folder / "view.html", ("Body", "Outcome"))
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(file.absolute().as_uri())
    return str(file)


def judge(options: argparse.Namespace, comm: MPI.Comm) -> int:
    """Print a verdict on the result of another program."""
    from signorini_fx.machine import parallel

    _start_petsc(options.petsc_options)
    # One rank reads and solves; the others wait for the verdict.
    judgement = parallel.on_root(comm, lambda: add_on("judge")(options.problem, options.result))
    text = json.dumps(judgement.as_dict(), indent=2) if options.json else str(judgement)
    terminal.say_once(comm, text)
    return int(judgement.exit_code)


def mesh_info(options: argparse.Namespace) -> str:
    """Describe a mesh file."""
    from signorini_fx.mechanics.mesh import info
    from signorini_fx.mechanics.statement.mesh_sources import MeshFile

    mesh = MeshFile(file=options.file, size=options.size)
    described = info.mesh_info(mesh)
    if options.picture is not None:
        from mpi4py import MPI

        add_on("draw_mesh")(mesh, MPI.COMM_SELF, options.picture)
    return (
        json.dumps(described, indent=2)
        if options.json
        else info.render(described, str(options.file))
    )


def schema(options: argparse.Namespace) -> str:
    """Return the JSON schema of scene files, or of the summary in result folders."""
    from signorini_fx.scenes.template import scene_schema, summary_schema

    return json.dumps(summary_schema() if options.summary else scene_schema(), indent=2)
