"""The command line: from arguments to an exit code.

Help and errors in a scene need no import of dolfinx; text is printed by one rank.  Nothing imports this package.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial

from signorini_fx.machine import terminal
from signorini_fx.machine.terminal import limit_threads
from signorini_fx.scenes.cli import commands
from signorini_fx.scenes.cli.exit_codes import on_one_process, on_ranks
from signorini_fx.scenes.cli.grammar import parser

_ON_ONE_PROCESS: dict[str, Callable[[argparse.Namespace], str | tuple[str, int]]] = {
    "new": commands.new,
    "schema": commands.schema,
    "report": commands.report,
    "mesh-info": commands.mesh_info,
}
_ON_RANKS = {
    "solve": commands.solve,
    "check": commands.check,
    "sweep": commands.sweep,
    "judge": commands.judge,
    "info": commands.info,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code is the same on every rank."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if argv is None:
        del sys.argv[1:]  # dolfinx reads them when it is imported, and fails if they are not UTF-8
    limit_threads()
    terminal.prepare()
    petsc_options: list[str] = []
    if "--" in arguments:
        split = arguments.index("--")
        arguments, petsc_options = arguments[:split], arguments[split + 1 :]
    options = parser().parse_args(arguments)
    options.petsc_options = petsc_options
    if options.command in _ON_ONE_PROCESS:
        return on_one_process(partial(_ON_ONE_PROCESS[options.command], options))
    return on_ranks(partial(_ON_RANKS[options.command], options), source=getattr(options, "scene", None))
