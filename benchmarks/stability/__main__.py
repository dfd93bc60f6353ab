"""Run the stability suite: text, CSV and a picture.

    ./env python3 -m benchmarks.stability [--short] [--only GROUP,...] [--out DIR]        (make stability)

The exit code is 1 if any row is red.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.stability import report
from benchmarks.stability.case import RED, Row
from benchmarks.stability.groups import GROUPS, ranks_of
from benchmarks.stability.runner import Runner


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the suite."""
    parser = argparse.ArgumentParser(
        prog="python3 -m benchmarks.stability", description=(__doc__ or "").split("\n\n")[0]
    )
    parser.add_argument("--short", action="store_true", help="the cases that the tests run")
    parser.add_argument("--only", metavar="GROUP,...", help=f"some groups only: {', '.join(GROUPS)}")
    parser.add_argument("--out", type=Path, default=Path("results/stability"), metavar="DIR")
    given = parser.parse_args(arguments)
    groups = given.only.split(",") if given.only else list(GROUPS)
    if unknown := set(groups) - set(GROUPS):
        parser.error(f"no group {', '.join(sorted(unknown))}")
    rows: list[Row] = []
    with Runner(short=given.short, show=_say) as runner:
        for group in groups:
            own = [row for ranks in ranks_of(group, short=given.short) for row in runner.group(group, ranks)]
            _say("")
            print(report.table(own), end="\n\n", flush=True)
            rows += own
    print(report.tally(rows))
    report.write(given.out, rows)
    report.picture(given.out, rows)
    print(f"written to {given.out}: stability.txt, stability.csv, stability.png")
    return int(any(row.verdict == RED for row in rows))


def _say(text: str) -> None:
    """The current case, on one line of a terminal."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
