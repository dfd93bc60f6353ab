"""The grammar of the command line: commands, their options, and the scene entries that they
override.
"""

from __future__ import annotations

import argparse
import difflib
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from signorini_fx import __version__
from signorini_fx.errors import SceneError
from signorini_fx.machine import terminal

if TYPE_CHECKING:
    pass

EXIT_OK = 0
EXIT_NO_SOLUTION = 1
EXIT_BAD_INPUT = 2
EXIT_CRASH = 3
EXIT_INCOMPLETE = 4
EXIT_INTERRUPTED = 130


class _Parser(argparse.ArgumentParser):
    """A parser that prints on one rank, and exits with the code for bad input."""

    def _print_message(self, message: str, file: Any = None) -> None:
        if message and terminal.started_as_root():
            terminal.say(message.removesuffix("\n"), error=file is sys.stderr)

    def _check_value(self, action: argparse.Action, value: str) -> None:
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError:
            if similar := difflib.get_close_matches(str(value), [*(action.choices or ())], n=1):
                meant = f"invalid choice: {value!r}: did you mean {similar[0]!r}?"
                raise argparse.ArgumentError(action, meant) from None
            raise

    def error(self, message: str) -> NoReturn:
        if terminal.started_as_root():
            usage = terminal.TerminalLine(self.format_usage().removesuffix("\n"))
            terminal.say(
                [terminal.TerminalLine(f"{self.prog}: ", message, "error"), usage], error=True
            )
        self.exit(EXIT_BAD_INPUT)


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands and their options."""
    epilog = (
        "Options after -- are passed to PETSc, for example: -- -sfx_snes_monitor "
        "-sfx_pc_factor_mat_solver_type mumps. "
        "Exit codes: 0 solved, 1 no solution (the summary has the reason), 2 bad input, 3 internal "
        "error, 4 a part of the deck that changes the answer was left out, 130 interrupted."
    )
    judged = (
        "Exit codes: 0 it agrees, 2 bad input, 3 internal error, 4 it agrees with what was read "
        "of the deck, 5 it "
        "solves another problem, 6 it violates the problem, 7 undecided."
    )
    about = "Signorini contact with Tresca and Coulomb friction on FEniCSx."
    main = _Parser(prog="signorini-fx", description=about, epilog=epilog)
    main.add_argument("--version", action="version", version=f"signorini-fx {__version__}")
    commands = main.add_subparsers(
        dest="command", required=True, metavar="COMMAND", parser_class=_Parser
    )
    solve = commands.add_parser("solve", help="solve a scene and write its results", epilog=epilog)
    check = commands.add_parser(
        "check", help="list the effects of a scene, its cost and problems, without solving it"
    )
    report = commands.add_parser(
        "report", help="write one HTML page from a result folder, to read, print and send"
    )
    view = commands.add_parser(
        "view", help="write and open a page on which the body of a result folder turns"
    )
    judge = commands.add_parser("judge", help="check another program's result", epilog=judged)
    sweep = commands.add_parser(
        "sweep", help="solve a scene for several values of some of its entries", epilog=epilog
    )
    calibrate = commands.add_parser(
        "calibrate", help="fit values of entries of a scene to measured results", epilog=epilog
    )
    new = commands.add_parser(
        "new", help="write a scene file to start from, or one for a drawing or a mesh"
    )
    info = commands.add_parser(
        "mesh-info", help="describe a mesh file: names, counts, unnamed parts"
    )
    contacts = commands.add_parser(
        "contacts", help="find the contacts of a drawing or mesh of several bodies, as entries"
    )
    schema = commands.add_parser("schema", help="print the JSON schema of scene files, for editors")
    commands.add_parser("info", help="print versions, the BLAS and the linear solvers in use")

    flag: dict[str, Any] = {"action": "store_true"}
    file: dict[str, Any] = {"type": named_path, "metavar": "FILE"}
    folder: dict[str, Any] = {"type": named_path, "metavar": "DIR"}
    solve.add_argument(
        "-o", "--out", **folder, help="result folder (default: results/NAME of the file)"
    )
    wanted = "relative error to reach by refining, such as 0.05 or 5%% (overrides accuracy.target)"
    solve.add_argument("--accuracy", type=parsed_accuracy, metavar="E", help=wanted)
    of = (
        "quantity that must be accurate (overrides accuracy.of; default: energy, that of the "
        "stress)"
    )
    solve.add_argument("--of", choices=("energy", "pressure", "force", "zone", "peak"), help=of)
    solve.add_argument(
        "--restart", **flag, help="continue a killed run after its last complete load step or mesh"
    )
    solve.add_argument("--no-fields", **flag, help="write no fields for ParaView")
    pictures = solve.add_mutually_exclusive_group()
    pictures.add_argument("--no-pictures", **flag, help="draw no pictures")
    pictures.add_argument(
        "--pdf", **flag, help="draw each picture as a PDF, for print, beside the PNG"
    )
    drawn = "field to draw on the deformed body beside the von Mises stress; may be repeated"
    solve.add_argument(
        "--picture", action="append", choices=("pressure", "displacement", "density"), help=drawn
    )
    said = solve.add_mutually_exclusive_group()
    said.add_argument("-q", "--quiet", **flag, help="print nothing but errors")
    said.add_argument(
        "-v", "--verbose", **flag, help="print each iteration, and all that is in summary.json"
    )

    output = check.add_mutually_exclusive_group()
    output.add_argument("--json", **flag, help="print JSON instead of text")
    output.add_argument("-v", "--verbose", **flag, help="print all findings")
    check.add_argument("--strict", **flag, help="end with exit code 2 where there is a warning")
    check.add_argument(
        "--picture", **file, help="draw mesh, loads, supports and contact: .png, .pdf or .svg"
    )
    for command in (report, view):
        command.add_argument(
            "folder", type=named_path, metavar="FOLDER", help="result folder that solve wrote"
        )
    report.add_argument("-o", "--out", **file, help="the page (default: report.html in the folder)")
    judge.add_argument(
        "problem", type=named_path, metavar="PROBLEM", help="input file, .inp, or scene file (TOML)"
    )
    judge.add_argument(
        "result", type=named_path, metavar="RESULT", help="displacements: .dat, .frd, .csv or .vtu"
    )
    judge.add_argument("--json", **flag, help="print JSON instead of text")
    sweep.add_argument(
        "--restart", **flag, help="continue a killed sweep after its last complete value"
    )
    sweep.add_argument(
        "-j", "--jobs", type=int, default=1, metavar="N", help="processes side by side (default: 1)"
    )
    sweep.add_argument(
        "-o", "--out", **folder, help="folder (default: results/sweep_NAME of the scene file)"
    )
    for command in (solve, check, sweep, calibrate):
        command.add_argument("scene", type=named_path, metavar="SCENE", help="scene file (TOML)")
        several = (
            "; with several values, FROM:TO:COUNT or A,B,C, of all combinations"
            if command is sweep
            else ""
        )
        entry = (
            "entry of the scene, such as contact[0].friction.coefficient=0.3; may be "
            f"repeated{several}"
        )
        command.add_argument(
            "--set", action="append", type=parsed_setting, metavar="PATH=VALUE", help=entry
        )
    calibrate.add_argument(
        "measured",
        type=named_path,
        metavar="MEASURED",
        help="CSV with the columns of, value and, if known, deviation",
    )
    calibrate.add_argument(
        "--by",
        action="append",
        required=True,
        metavar="PATH",
        help="entry of the scene to fit; may be repeated",
    )
    new.add_argument(
        "file",
        **file,
        nargs="?",
        default=Path("scene.toml"),
        help="the file (default: %(default)s), or the drawing or mesh to write a scene for",
    )
    scene = "the scene (default: FILE, or NAME.toml of a drawing or mesh)"
    new.add_argument("-o", "--out", **file, help=scene)
    new.add_argument("--full", **flag, help="explain every key")
    draft = "draft it from an .inp of Abaqus or CalculiX"
    new.add_argument("--from", dest="deck", type=named_path, metavar="DECK", help=draft)
    info.add_argument(
        "file", **file, help="mesh: .msh, .geo, .step, .stp, .brep, .inp, .med, .vtu or .xdmf"
    )
    contacts.add_argument(
        "file", **file, help="several bodies: .msh, .geo, .step, .stp, .brep, .inp, .med, .vtu"
    )
    for command in (new, info, contacts):
        command.add_argument("--size", type=float, help="cell size for a .step, .stp or .brep")
    contacts.add_argument(
        "--within", type=float, help="distance of surfaces that are near (default: 1/4 of a facet)"
    )
    into = "scene file in which the entries of an earlier search are replaced"
    contacts.add_argument("--into", type=named_path, metavar="SCENE", help=into)
    info.add_argument("--json", **flag, help="print JSON instead of a table")
    info.add_argument(
        "--picture",
        **file,
        help="draw the mesh and the names of its boundaries: .png, .pdf or .svg",
    )
    schema.add_argument("--summary", **flag, help="the schema of summary.json in result folders")
    return main


def named_path(text: str) -> Path:
    """Return a path; an empty text is refused, as it would mean the current folder, for example if
    a shell variable is not set.
    """
    if not text:
        raise argparse.ArgumentTypeError("a name is expected, got ''; the current folder is .")
    return Path(text)


def parsed_accuracy(text: str) -> float:
    """Return a relative error from a text such as 0.05 or 5%."""
    from signorini_fx.mechanics.statement.values import share

    try:
        return float(share(text))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"a number like 0.05 or 5% is expected, got {text!r}"
        ) from None


def parsed_setting(text: str) -> tuple[str, Any]:
    """Return path and value from ``PATH=VALUE`` for an entry of the scene."""
    from signorini_fx.scenes.reading import parsed_change

    try:
        return parsed_change(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def changes(options: argparse.Namespace) -> dict[str, Any]:
    """Return the entries of the scene that the command line replaces, by their paths."""
    entries = {
        "accuracy.target": getattr(options, "accuracy", None),
        "accuracy.of": getattr(options, "of", None),
        **dict(getattr(options, "set", None) or ()),
    }
    return {path: value for path, value in entries.items() if value is not None}


_COMMA = re.compile(r",(?![^()]*\))")  # a comma between values, not between arguments of a function
_RANGE = re.compile(r"\s*([-+.\deE]+)\s*:\s*([-+.\deE]+)\s*:\s*(\d{1,5})\s*")


def several_values(entries: dict[str, Any]) -> dict[str, list[Any]]:
    """Return the entries with several values, by path.

    Values are ``0.1:0.8:8`` (from, to, and number of equally spaced values) or ``0.1,0.2,0.4``.
    """
    ranges = {
        path: values for path, value in entries.items() if len(values := _values(path, value)) > 1
    }
    if not ranges:
        raise SceneError.at("sweep", "no range found: write --set PATH=0.1:0.8:8 or PATH=1,2,3")
    return ranges


def _values(path: str, value: Any) -> list[Any]:
    from signorini_fx.scenes.reading import parsed_change

    if not isinstance(value, str):
        return [value]
    if match := _RANGE.fullmatch(value):
        try:
            first = float(match[1])
            last = float(match[2])
            count = int(match[3])
        except ValueError:
            raise SceneError.at(
                path, f"{value!r} is no range: FROM:TO:COUNT is expected, such as 0.1:0.8:8"
            ) from None
        return [
            float(f"{first + k / max(count - 1, 1) * (last - first):.12g}") for k in range(count)
        ]
    return [parsed_change(f"value={entry}")[1] for entry in _COMMA.split(value)]
