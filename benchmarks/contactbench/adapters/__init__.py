"""Programs that solve the problems: one file each, with a function ``solve(problem, grid) ->
Answer``.

A file of your own beside these needs its name here.  Its ``available()`` raises ``CannotRun`` where
the program is not there.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable

from ..answers import Answer
from ..grids import Grid
from ..problem import Problem

ADAPTERS = {
    "signorini_fx": "signorini",
    "dolfinx": "plain_dolfinx",
    "getfem": "getfem_bricks",
    "calculix": "calculix_deck",
}


def adapter(program: str) -> Callable[[Problem, Grid], Answer]:
    """The function of a program.

    Raises:
        CannotRun: it is not installed.
    """
    module = importlib.import_module(f".{ADAPTERS[program]}", __name__)
    module.available()
    solve: Callable[[Problem, Grid], Answer] = module.solve
    return solve
