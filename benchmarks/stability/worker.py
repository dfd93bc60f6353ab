"""Runs the cases of groups for one number of ranks and reports each on standard output; started by ``runner``.

[mpirun -n RANKS] python3 -m benchmarks.stability.worker RANKS [--short]

Each line of standard input is a group, and how many of its cases to leave out.
"""

from __future__ import annotations

import json
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from mpi4py import MPI

from benchmarks.stability.case import RAISED, Finding, judge
from benchmarks.stability.groups import cases_of

# Libraries print too: the messages are the lines that begin like this.
MARK = "\x1e"


def main(arguments: Sequence[str]) -> None:
    """Run what is asked for, until there is no more."""
    ranks, *rest = arguments
    while line := MPI.COMM_WORLD.bcast(sys.stdin.readline() if MPI.COMM_WORLD.rank == 0 else None):
        group, skip = line.split()
        _run(group, int(ranks), int(skip), short="--short" in rest)


def _run(group: str, ranks: int, skip: int, *, short: bool) -> None:
    """Run the cases of a group except the first ones."""
    cases = [case for case in cases_of(group, short=short) if case.ranks == ranks]
    _say({"cases": [[case.name, case.seconds] for case in cases]})
    for case in cases[skip:]:
        _say({"begin": case.name})
        begin = time.process_time()
        try:
            found = case.run()
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            where = f"{last.filename.rsplit('/', 1)[-1]}:{last.lineno}"
            found = Finding(RAISED, note=f"{type(error).__name__} in {where}: {error}".split("\n")[0])
        _say({"row": asdict(judge(group, case, found, time.process_time() - begin))})


def _say(message: dict[str, Any]) -> None:
    if MPI.COMM_WORLD.rank == 0:
        print(MARK + json.dumps(message), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
