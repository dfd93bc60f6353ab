"""The command line.  Help and scene errors come without importing dolfinx; text is printed by one rank."""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from signorini_fx import __version__

EXIT_OK, EXIT_NO_SOLUTION, EXIT_BAD_INPUT, EXIT_CRASH = 0, 1, 2, 3
_RANK_VARIABLES = ("PMIX_RANK", "OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID")


def _started_as_root() -> bool:
    """Whether this process prints help; known from the launcher, before MPI is there."""
    return next((os.environ[name] for name in _RANK_VARIABLES if name in os.environ), "0") == "0"


class _Parser(argparse.ArgumentParser):
    """Prints on one rank, and ends with the exit code of bad input."""

    def _print_message(self, message: str, file: Any = None) -> None:
        if _started_as_root():
            super()._print_message(message, file)

    def error(self, message: str) -> NoReturn:
        self.exit(EXIT_BAD_INPUT, f"{self.prog}: {message}\n{self.format_usage()}")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="signorini-fx",
        description="Signorini contact with Tresca and Coulomb friction on FEniCSx.",
        epilog="What follows -- goes to PETSc, for example: -- -sfx_snes_monitor -sfx_pc_factor_mat_solver_type mumps. "
        "Exit codes: 0 solved, 1 no solution (the summary says why), 2 bad input, 3 internal error.",
    )
    parser.add_argument("--version", action="version", version=f"signorini-fx {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    solve = commands.add_parser("solve", help="solve a scene and write its results")
    solve.add_argument("scene", type=Path, help="scene file (TOML)")
    solve.add_argument("--out", type=Path, help="result folder (default: results/NAME of the scene file)")
    solve.add_argument("--no-fields", action="store_true", help="write no fields for ParaView")
    solve.add_argument("--no-pictures", action="store_true", help="draw no pictures")
    solve.add_argument("--quiet", action="store_true", help="print nothing but errors")
    commands.add_parser("info", help="print versions, the BLAS and the linear solvers in use")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code is the same on every rank."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    petsc_options: list[str] = []
    if "--" in arguments:
        split = arguments.index("--")
        arguments, petsc_options = arguments[:split], arguments[split + 1 :]
    options = _parser().parse_args(arguments)
    from mpi4py import MPI

    try:
        return _info() if options.command == "info" else _solve(options, petsc_options)
    except KeyboardInterrupt:
        return 130
    except Exception:
        # An error that only one rank meets would leave the others waiting for ever.
        traceback.print_exc()
        if MPI.COMM_WORLD.size > 1:
            MPI.COMM_WORLD.Abort(EXIT_CRASH)
        return EXIT_CRASH


def _solve(options: argparse.Namespace, petsc_options: list[str]) -> int:
    from mpi4py import MPI

    from signorini_fx import parallel
    from signorini_fx.errors import SceneError, SignoriniError
    from signorini_fx.scene import parse_scene_text, read_scene_text

    comm = MPI.COMM_WORLD
    folder = options.out or Path("results") / options.scene.stem
    prepared = False
    try:
        text = parallel.on_root(comm, lambda: read_scene_text(options.scene))
        scene = parse_scene_text(text, options.scene)

        import petsc4py

        petsc4py.init(["signorini-fx", *petsc_options])
        from signorini_fx import io
        from signorini_fx.solver import solve
        from signorini_fx.summary import render, table_row

        io.prepare_folder(comm, folder)
        prepared = True
        observers = []
        if not options.quiet:
            observers.append(lambda record: parallel.log_on_root(comm, table_row(record)))
        solution = solve(scene, comm, check=False, observers=observers)
        summary = io.write_results(solution, folder, fields=not options.no_fields, pictures=not options.no_pictures)
    except SignoriniError as error:
        if prepared:
            io.discard_folder(comm, folder)
        if isinstance(error, SceneError):
            error = SceneError(error.problems, str(options.scene))
        parallel.log_on_root(comm, f"signorini-fx: error: {error}", error=True)
        return EXIT_BAD_INPUT
    if not options.quiet:
        parallel.log_on_root(comm, f"{render(summary)}\n  results          {folder}/")
    if not solution.converged:
        parallel.log_on_root(comm, f"signorini-fx: {solution.status.value}: {solution.status.advice}", error=True)
        return EXIT_NO_SOLUTION
    return EXIT_OK


def _info() -> int:
    from mpi4py import MPI

    from signorini_fx import parallel
    from signorini_fx.linalg.full import factorisation_package
    from signorini_fx.summary import versions

    comm = MPI.COMM_WORLD
    lines = [f"{name:14s} {version}" for name, version in versions().items()]
    lines.append(f"{'Cholesky':14s} {factorisation_package(comm, symmetric=True)}")
    lines.append(f"{'LU':14s} {factorisation_package(comm, symmetric=False)}")
    parallel.log_on_root(comm, "\n".join(lines))
    return EXIT_OK
