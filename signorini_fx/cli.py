"""The command line.  Help and scene errors come without importing dolfinx; text is printed by one rank."""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import sys
import textwrap
import time
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from signorini_fx import __version__
from signorini_fx.errors import OutputError, SceneError, SignoriniError, shortened
from signorini_fx.machine import terminal
from signorini_fx.machine.launcher import started_as_root

if TYPE_CHECKING:
    from signorini_fx.check.checks import Check, Cost
    from signorini_fx.results.solution import Solution

EXIT_OK, EXIT_NO_SOLUTION, EXIT_BAD_INPUT, EXIT_CRASH, EXIT_INTERRUPTED = 0, 1, 2, 3, 130
_READ = ".msh, .geo, .step, .stp, .brep, .inp, .med, .vtu or .xdmf"


class _Parser(argparse.ArgumentParser):
    """Prints on one rank, and ends with the exit code of bad input."""

    def _print_message(self, message: str, file: Any = None) -> None:
        if message and started_as_root():
            terminal.say(message.removesuffix("\n"), error=file is sys.stderr)

    def error(self, message: str) -> NoReturn:
        self.exit(EXIT_BAD_INPUT, f"{self.prog}: {shortened(message)}\n{self.format_usage()}")


def _parser() -> argparse.ArgumentParser:
    after = (
        "What follows -- goes to PETSc, for example: -- -sfx_snes_monitor -sfx_pc_factor_mat_solver_type mumps. "
        "Exit codes: 0 solved, 1 no solution (the summary says why), 2 bad input, 3 internal error, 130 interrupted."
    )
    parser = _Parser(
        prog="signorini-fx",
        description="Signorini contact with Tresca and Coulomb friction on FEniCSx.",
        epilog=after,
    )
    parser.add_argument("--version", action="version", version=f"signorini-fx {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    solve = commands.add_parser("solve", help="solve a scene and write its results", epilog=after)
    solve.add_argument("scene", type=Path, metavar="SCENE", help="scene file (TOML)")
    solve.add_argument(
        "--out", type=Path, metavar="DIR", help="result folder (default: results/NAME of the scene file)"
    )
    solve.add_argument("--levels", type=int, metavar="N", help="meshes of a nested iteration (overrides solver.levels)")
    solve.add_argument(
        "--accuracy",
        type=_accuracy,
        metavar="E",
        help="relative error to reach by refining, such as 0.05 or 5%% (overrides accuracy.target)",
    )
    quantities = ("energy", "pressure", "force", "zone", "peak")
    solve.add_argument(
        "--of", choices=quantities, help="what the accuracy is asked of (overrides accuracy.of; default: energy)"
    )
    solve.add_argument("--adaptive", action="store_const", const="adaptive", help="refine triangles where the error is")
    solve.add_argument(
        "--budget",
        action="append",
        type=_budget,
        metavar="60s|4GB",
        help="what the accuracy may cost, in s, min or h, or in MB or GB; may be repeated",
    )
    solve.add_argument("--no-fields", action="store_true", help="write no fields for ParaView")
    solve.add_argument("--no-pictures", action="store_true", help="draw no pictures")
    solve.add_argument("--quiet", action="store_true", help="print nothing but errors")
    check = commands.add_parser("check", help="say what a scene will do and what will hurt, without solving it")
    check.add_argument("scene", type=Path, metavar="SCENE", help="scene file (TOML)")
    check.add_argument("--json", action="store_true", help="print JSON instead of a table")
    report = commands.add_parser("report", help="make one HTML page of a result folder, to read, print and send")
    report.add_argument("folder", type=Path, metavar="FOLDER", help="result folder that solve wrote")
    report.add_argument("--out", type=Path, metavar="FILE", help="the page (default: report.html in the folder)")
    study = commands.add_parser("work-precision", help="say which method is cheapest for which accuracy, by trying all")
    study.add_argument("scene", type=Path, metavar="SCENE", help="scene file (TOML) with a mesh from a generator")
    study.add_argument(
        "--out", type=Path, metavar="DIR", help="folder (default: results/work_precision_NAME of the scene file)"
    )
    study.add_argument("--quick", action="store_true", help="few methods, two coarse meshes, no repeats")
    new = commands.add_parser("new", help="write a scene file to start from, with every key explained")
    new.add_argument(
        "file", type=Path, metavar="FILE", nargs="?", default=Path("scene.toml"), help="where to (default: %(default)s)"
    )
    convert = commands.add_parser("convert", help="rewrite a mesh file in another format, with its names")
    convert.add_argument("source", type=Path, metavar="IN", help=f"mesh: {_READ}")
    convert.add_argument("target", type=Path, metavar="OUT", help="mesh: .msh, .inp, .med, .vtu or .xdmf")
    info = commands.add_parser("mesh-info", help="say what a mesh file holds: names, counts, quality, what is unnamed")
    info.add_argument("file", type=Path, metavar="FILE", help=f"mesh: {_READ}")
    for one in (convert, info):
        one.add_argument(
            "--size", type=float, metavar="H", help="length of the cells that are made of a .step, .stp or .brep"
        )
    info.add_argument("--json", action="store_true", help="print JSON instead of a table")
    commands.add_parser("schema", help="print the JSON schema of scene files, for editors")
    commands.add_parser("info", help="print versions, the BLAS and the linear solvers in use")
    return parser


_NUMBER = r"\s*(\d+(?:\.\d*)?|\.\d+)\s*"
# Ending -> key of the scene, and what one of it is there: seconds, GB.
_BUDGETS = {
    **{"s": ("seconds", 1.0), "min": ("seconds", 60.0), "h": ("seconds", 3600.0)},
    **{"MB": ("memory", 1e-3), "GB": ("memory", 1.0), "TB": ("memory", 1e3)},
}


def _accuracy(text: str) -> float:
    """0.05 or 5%."""
    found = re.fullmatch(rf"{_NUMBER}(%?)\s*", text)
    try:
        return float(found[1]) / 100 if found and found[2] else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"a number like 0.05 or 5% is wanted, got {text!r}") from None


def _budget(text: str) -> tuple[str, float]:
    """60s or 4GB as the key of the scene and its value."""
    found = re.fullmatch(rf"{_NUMBER}({'|'.join(_BUDGETS)})\s*", text)
    if found is None:
        wanted = "a time like 60s, 5min or 2h, or a memory like 500MB or 4GB, is wanted"
        raise argparse.ArgumentTypeError(f"{wanted}, got {text!r}")
    key, unit = _BUDGETS[found[2]]
    return key, float(found[1]) * unit


def _overrides(options: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """What the command line says in place of the scene, table by table."""
    accuracy = {
        "target": options.accuracy,
        "of": options.of,
        "refinement": options.adaptive,
        **dict(options.budget or ()),
    }
    tables = {"solver": {"levels": options.levels}, "accuracy": accuracy}
    given = {name: {k: v for k, v in table.items() if v is not None} for name, table in tables.items()}
    return {name: table for name, table in given.items() if table}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code is the same on every rank."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if argv is None:
        del sys.argv[1:]  # dolfinx reads them when it is imported, and does not survive what is not UTF-8
    terminal.prepare()
    petsc_options: list[str] = []
    if "--" in arguments:
        split = arguments.index("--")
        arguments, petsc_options = arguments[:split], arguments[split + 1 :]
    options = _parser().parse_args(arguments)
    match options.command:
        case "new":
            return _alone(partial(_new, options.file))
        case "schema":
            return _alone(_schema)
        case "report":
            return _alone(partial(_report, options))
        case "convert" | "mesh-info":
            return _alone(partial(_mesh_file, options))
        case "info":
            return _on_ranks(_info)
        case "check":
            return _on_ranks(partial(_check, options, petsc_options))
        case "work-precision":
            return _on_ranks(partial(_work_precision, options, petsc_options))
    return _on_ranks(partial(_solve, options, petsc_options))


def _complain(text: object) -> int:
    terminal.say(f"signorini-fx: error: {text}", error=True)
    return EXIT_BAD_INPUT


def _alone(run: Callable[[], str]) -> int:
    """Run a command that one of several processes does, and print what it gives."""
    if not started_as_root():
        return EXIT_OK
    try:
        terminal.say(run())
    except SignoriniError as error:
        return _complain(error)
    except MemoryError:
        return _complain(_OUT_OF_MEMORY)
    except KeyboardInterrupt:
        terminal.say("signorini-fx: interrupted", error=True)
        return EXIT_INTERRUPTED
    return EXIT_BAD_INPUT if terminal.output_lost() else EXIT_OK


_OUT_OF_MEMORY = "memory ran out: signorini-fx check says how much a scene needs; limits are in ulimit -a"


_PATIENCE = 1.0  # seconds


def _on_ranks(run: Callable[[], int]) -> int:
    """Run a command that all ranks share; every way in which it can end, in one place."""
    from signorini_fx.machine.requirements import check_fenicsx, check_machine

    try:
        check_machine()
        check_fenicsx()
    except SignoriniError as error:
        return _complain(error) if started_as_root() else EXIT_BAD_INPUT
    from mpi4py import MPI

    comm = MPI.COMM_WORLD

    def end(code: int) -> int:
        """An error that only one rank meets would leave the others waiting for ever."""
        if comm.size > 1:
            comm.Abort(code)
        return code

    # mpirun and batch systems ask with SIGTERM, and kill soon after.
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        code = run()
        return code or (EXIT_BAD_INPUT if terminal.output_lost() else EXIT_OK)
    except SignoriniError as error:  # these come on all ranks alike
        _forget_petsc_options()
        return _complain(error) if comm.rank == 0 else EXIT_BAD_INPUT
    except KeyboardInterrupt as interruption:
        if comm.rank == 0:
            os.write(2, f"signorini-fx: interrupted{interruption}\n".encode(errors="backslashreplace"))
        return end(EXIT_INTERRUPTED)
    except Exception as error:
        told = _OUT_OF_MEMORY if isinstance(error, MemoryError) else _refused_by_petsc(error)
        if told is not None:
            if comm.rank > 0:  # if the first rank has met it too, it has ended this one by then
                time.sleep(_PATIENCE)
            return end(_complain(told))
        traceback.print_exc()
        return end(EXIT_CRASH)
    finally:
        signal.signal(signal.SIGTERM, before)


def _forget_petsc_options() -> None:
    """At its end PETSc lists options that nobody has used, and obeys others: not after an error that comes before."""
    if "petsc4py.PETSc" in sys.modules:
        from petsc4py import PETSc

        options = PETSc.Options()
        for name in options.getAll():
            options.delValue(name)


def _refused_by_petsc(error: Exception) -> SignoriniError | None:
    """What to say of an error of PETSc that options of the user may have caused."""
    if "petsc4py" not in sys.modules:
        return None
    from petsc4py import PETSc

    from signorini_fx.linalg.options import refused

    return refused(error) if isinstance(error, PETSc.Error) else None


def _solve(options: argparse.Namespace, petsc_options: list[str]) -> int:
    from mpi4py import MPI

    from signorini_fx import parallel
    from signorini_fx.linalg.petsc_start import start_petsc
    from signorini_fx.scene.reading import parse_scene_text, read_scene_text

    comm = MPI.COMM_WORLD
    path = options.out or Path("results") / options.scene.stem
    progress = _Progress()
    text = parallel.on_root(comm, lambda: read_scene_text(options.scene))
    scene = parse_scene_text(text, options.scene, _overrides(options))
    start_petsc(comm, petsc_options)
    from signorini_fx.results import files
    from signorini_fx.results.folder import ResultFolder
    from signorini_fx.results.summary import render, table_row
    from signorini_fx.solving.solver import solve

    def keep(solution: Solution) -> None:
        files.write_results(solution, path / files.LAST_LEVEL, fields=not options.no_fields, pictures=False)
        progress.kept = path / files.LAST_LEVEL

    observers: list[Callable[[Any], None]] = [progress]
    if not options.quiet:
        observers.append(lambda record: parallel.log_on_root(comm, table_row(record)))
    try:
        with ResultFolder(comm, path) as folder:
            solution = solve(scene, comm, check=False, observers=observers, keep=keep)
            progress.solved = True
            summary = files.write_results(
                solution, folder, fields=not options.no_fields, pictures=not options.no_pictures
            )
    except SceneError as error:
        raise error.of(options.scene) from None
    except KeyboardInterrupt:
        raise KeyboardInterrupt(str(progress)) from None
    if not options.quiet:
        parallel.log_on_root(comm, f"{render(summary)}\n  results          {path}/")
    if not solution.converged:
        parallel.log_on_root(comm, f"signorini-fx: {solution.status.value}: {solution.status.advice}", error=True)
        return EXIT_NO_SOLUTION
    return EXIT_OK


class _Progress:
    """How far a solve has come: an observer of its history, and what an interruption says."""

    def __init__(self) -> None:
        self.solves = self.meshes = 0
        self.solved = False
        self.kept: Path | None = None

    def __call__(self, record: Any) -> None:
        if isinstance(record, str):
            self.meshes += record.startswith("level ")
        elif hasattr(record, "solve"):
            self.solves += 1

    def __str__(self) -> str:
        if self.solved:
            return " while the results were written: they are not kept"
        mesh = f" on mesh {self.meshes}" if self.meshes else ""
        kept = f": the mesh before is in {self.kept}/" if self.kept else ": nothing is complete yet"
        return f" after {self.solves} linear solves,{mesh}{kept}".replace(",:", ":")


def _work_precision(options: argparse.Namespace, petsc_options: list[str]) -> int:
    from mpi4py import MPI

    from signorini_fx import parallel
    from signorini_fx.linalg.petsc_start import start_petsc
    from signorini_fx.scene.reading import read_scene

    comm = MPI.COMM_WORLD
    path = options.out or Path("results") / f"work_precision_{options.scene.stem}"
    if comm.size > 1:
        problem = ("work-precision", "compares methods on one rank: run it without mpirun")
        raise SceneError([problem], str(options.scene))
    scene = read_scene(options.scene)
    start_petsc(comm, petsc_options)
    from signorini_fx.results.folder import ResultFolder, cannot_be_written
    from signorini_fx.studies import work_precision

    try:
        with ResultFolder(comm, path) as folder:  # find out early that it cannot be written
            study = work_precision.run_study(scene, quick=options.quick, report=partial(parallel.log_on_root, comm))
            try:
                work_precision.write_study(study, folder.part)
            except OSError as error:
                raise cannot_be_written(path, error) from None
            folder.commit(())
    except SceneError as error:
        raise error.of(options.scene) from None
    parallel.log_on_root(comm, f"\n{textwrap.fill(work_precision.advice(study), width=110)}\n\nresults: {path}/")
    return EXIT_OK


def _new(file: Path) -> str:
    """Write the starting scene."""
    from signorini_fx.scene.template import starting_scene

    try:
        with file.open("x", encoding="utf-8") as out:
            out.write(starting_scene())
    except FileExistsError:
        raise OutputError(f"{file}: is there already: give another name, or remove it") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"{file}: cannot be written: {reason}") from None
    return f"{file} is a scene that solves as it is; change it, then: signorini-fx check {file}"


def _report(options: argparse.Namespace) -> str:
    """Write the page of a result folder."""
    from signorini_fx.report.page import write_report

    return str(write_report(options.folder, options.out))


def _mesh_file(options: argparse.Namespace) -> str:
    """Rewrite or describe a mesh file."""
    from signorini_fx.mesh.files.formats import read_file, write_file
    from signorini_fx.mesh.info import mesh_info, render

    if options.command == "convert":
        mesh = read_file(options.source, size=options.size)
        write_file(mesh, options.target)
        return render(mesh_info(mesh), str(options.target))
    info = mesh_info(read_file(options.file, size=options.size))
    return json.dumps(info, indent=2) if options.json else render(info, str(options.file))


def _schema() -> str:
    from signorini_fx.scene.template import scene_schema

    return json.dumps(scene_schema(), indent=2)


def _check(options: argparse.Namespace, petsc_options: list[str]) -> int:
    from mpi4py import MPI

    from signorini_fx import parallel
    from signorini_fx.linalg.petsc_start import start_petsc
    from signorini_fx.scene.reading import parse_scene_text, read_scene_text

    comm = MPI.COMM_WORLD
    try:
        text = parallel.on_root(comm, lambda: read_scene_text(options.scene))
        scene = parse_scene_text(text, options.scene)
        start_petsc(comm, petsc_options)
        from signorini_fx.check.checks import check_scene

        check = check_scene(scene, comm)
    except SignoriniError as error:
        if options.json:
            problems = error.problems if isinstance(error, SceneError) else [("mesh", str(error))]
            report = {"problems": [{"path": path, "message": message} for path, message in problems]}
            parallel.log_on_root(comm, json.dumps(report, indent=2))
        raise error.of(options.scene) if isinstance(error, SceneError) else error from None
    parallel.log_on_root(comm, json.dumps(check.as_dict(), indent=2) if options.json else _render(check))
    return EXIT_OK


def _render(check: Check) -> str:
    """A check for a terminal."""
    rows = [("effect", "", "why", "form", "unknowns", "linear solves")]
    for effect in check.effects:
        unknowns = f"{effect.unknowns:+d}" if effect.unknowns else ""
        low, high = effect.solves
        solves = "" if effect.solves == (0, 0) else f"{low:+d}" if low == high else f"{low:+d} to {high:+d}"
        rows.append((effect.name, "on" if effect.on else "-", effect.why, ", ".join(effect.forms), unknowns, solves))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    count = len(check.warnings)
    verdict = "fine" if count == 0 else f"{count} warning{'s' * (count > 1)}"
    lines = [f"{check.title or 'scene'}: {verdict}", *(f"  {line}" for line in lines), *_wrapped(_estimate(check.cost))]
    for finding in check.findings:
        lines += _wrapped(f"{finding.level}: {finding.path}: {finding.message}")
    return "\n".join(lines)


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, width=110, initial_indent="  ", subsequent_indent="    ", break_long_words=False)


def _estimate(cost: Cost) -> str:
    low, high = cost.linear_solves
    solves = f"{low}" if low == high else f"{low} to {high}"
    return (
        f"estimate, good to a factor of about three: {cost.unknowns} unknowns, {cost.contact_nodes} contact nodes, "
        f"{solves} linear solves ({cost.linear_algebra}); "
        f"one sparse factorisation {_seconds(cost.factorisation_seconds)} and {_bytes(cost.factorisation_bytes)}; "
        f"altogether {' to '.join(dict.fromkeys(map(_seconds, cost.seconds)))} and {_bytes(cost.memory_bytes)}"
    )


def _seconds(value: float) -> str:
    if value < 0.01:
        return "below 0.01 s"
    return f"{value:.1g} s" if value < 10 else f"{value:.0f} s" if value < 600 else f"{value / 60:.0f} min"


def _bytes(value: float) -> str:
    if value < 1e6:
        return "below 1 MB"
    return f"{value / 1e6:.0f} MB" if value < 1e9 else f"{value / 1e9:.1f} GB"


def _info() -> int:
    from mpi4py import MPI

    from signorini_fx import parallel
    from signorini_fx.linalg.full import factorisation_package
    from signorini_fx.results.summary import versions

    comm = MPI.COMM_WORLD
    lines = [f"{name:14s} {version}" for name, version in versions().items()]
    lines.append(f"{'Cholesky':14s} {factorisation_package(comm, symmetric=True)}")
    lines.append(f"{'LU':14s} {factorisation_package(comm, symmetric=False)}")
    parallel.log_on_root(comm, "\n".join(lines))
    return EXIT_OK
