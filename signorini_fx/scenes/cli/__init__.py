"""The command line: from arguments to an exit code, with every error and interruption, the same on
every rank.

Help and errors in a scene need no import of dolfinx; only one rank prints.  No other module imports
this package.
"""

from __future__ import annotations

import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from signorini_fx.errors import SceneError, SignoriniError, check_fenicsx
from signorini_fx.machine import terminal
from signorini_fx.scenes.cli import commands
from signorini_fx.scenes.cli.grammar import (
    EXIT_BAD_INPUT,
    EXIT_CRASH,
    EXIT_INTERRUPTED,
    EXIT_OK,
    parser,
)
from signorini_fx.tuned import PROGRESS_PAUSE

if TYPE_CHECKING:
    from mpi4py import MPI

# Commands that run on one rank only.
_ON_ONE_PROCESS = ("new", "schema", "report", "view", "mesh-info", "contacts")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code, which is the same on every rank."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if argv is None:
        del sys.argv[1:]  # dolfinx reads them on import, and fails if they are not UTF-8
    terminal.limit_threads()
    terminal.prepare()
    petsc_options: list[str] = []
    if "--" in arguments:
        split = arguments.index("--")
        petsc_options = arguments[split + 1 :]
        arguments = arguments[:split]
    if not arguments:
        parser().print_help()
        return EXIT_BAD_INPUT
    if arguments[0] == "help":
        arguments = [*arguments[1:2], "--help"]
    if arguments[0].endswith(".toml"):  # a scene without a command is solved
        arguments.insert(0, "solve")
    options = parser().parse_args(arguments)
    options.petsc_options = petsc_options
    command = partial(getattr(commands, options.command.replace("-", "_")), options)
    if options.command in _ON_ONE_PROCESS:
        return on_one_process(command)
    return on_ranks(command, source=getattr(options, "scene", None))


_OUT_OF_MEMORY = (
    "memory ran out: signorini-fx check prints how much a scene needs, ulimit -a the limits"
)


def _complain(text: str | Exception) -> int:
    terminal.say([terminal.TerminalLine("signorini-fx: error: ", str(text), "error")], error=True)
    return EXIT_BAD_INPUT


def on_one_process(run: Callable[[], str | tuple[str, int]]) -> int:
    """Run a command on the first process only, print the text that it returns, and return the exit
    code, which may come with the text.
    """
    if not terminal.started_as_root():
        return EXIT_OK
    try:
        result = run()
        text, code = result if isinstance(result, tuple) else (result, EXIT_OK)
        terminal.say(text)
    except SignoriniError as error:
        return _complain(error)
    except MemoryError:
        return _complain(_OUT_OF_MEMORY)
    except KeyboardInterrupt:
        terminal.say("signorini-fx: interrupted", error=True)
        return EXIT_INTERRUPTED
    return EXIT_BAD_INPUT if terminal.output_lost() else code


def on_ranks(run: Callable[[MPI.Comm], int], source: Path | None = None) -> int:
    """Run a command on all ranks and return the exit code, whichever way it ends.

    Args:
        run: the command; it returns the exit code.
        source: name of the scene in messages; None: there is no scene.
    """
    try:
        check_fenicsx()
    except SignoriniError as error:
        return _complain(error) if terminal.started_as_root() else EXIT_BAD_INPUT
    from mpi4py import MPI

    comm = MPI.COMM_WORLD

    def end(code: int) -> int:
        """Return the code; on several ranks abort, as an error on one rank would leave the others
        waiting.
        """
        if comm.size > 1:
            comm.Abort(code)
        return code

    # mpirun and batch systems send SIGTERM, and kill soon after.
    handler = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        code = run(comm)
        return code or (EXIT_BAD_INPUT if terminal.output_lost() else EXIT_OK)
    except SignoriniError as error:  # raised on all ranks
        # At exit PETSc would list unused options, and apply others.
        if (petsc := sys.modules.get("petsc4py.PETSc")) is not None:
            for name in petsc.Options().getAll():
                petsc.Options().delValue(name)
        if isinstance(error, SceneError) and source is not None:
            error = error.of(source)
        return _complain(error) if comm.rank == 0 else EXIT_BAD_INPUT
    except KeyboardInterrupt as interruption:
        if comm.rank == 0:
            os.write(
                2, f"signorini-fx: interrupted{interruption}\n".encode(errors="backslashreplace")
            )
        return end(EXIT_INTERRUPTED)
    except Exception as error:
        if (message := _explained(error)) is not None:
            if comm.rank > 0:  # if the first rank has the same error, it ends this one meanwhile
                time.sleep(PROGRESS_PAUSE)
            return end(_complain(message))
        traceback.print_exc()
        return end(EXIT_CRASH)
    finally:
        signal.signal(signal.SIGTERM, handler)


def _explained(error: Exception) -> str | Exception | None:
    """Return a message if the error is a lack of memory, or an option that PETSc refuses; otherwise
    None.
    """
    if "petsc4py.PETSc" not in sys.modules:
        return _OUT_OF_MEMORY if isinstance(error, MemoryError) else None
    from petsc4py import PETSc

    from signorini_fx.algebra.linalg.petsc_calls import memory_ended
    from signorini_fx.algebra.linalg.petsc_options import refused

    if memory_ended(error):
        return _OUT_OF_MEMORY
    return refused(error) if isinstance(error, PETSc.Error) else None
