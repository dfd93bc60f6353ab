"""Runs the cases of one group for one number of ranks and reports each on standard output; started by ``runner``.

[mpirun -n RANKS] python3 -m stability.worker GROUP RANKS SKIP [--short]
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

from stability.case import RAISED, Finding, judge
from stability.groups import cases_of

# Libraries print too: the messages are the lines that begin like this.
MARK = "\x1e"


def main(arguments: Sequence[str]) -> None:
    """Run the cases except the first SKIP."""
    group, ranks, skip, *rest = arguments
    cases = [case for case in cases_of(group, short="--short" in rest) if case.ranks == int(ranks)]
    _say({"cases": [[case.name, case.seconds] for case in cases]})
    for case in cases[int(skip) :]:
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
