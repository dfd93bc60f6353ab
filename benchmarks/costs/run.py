"""Compare the package with one linear solve and with other programs: ratios, CSV files and a picture.

    ./env python3 benchmarks/costs/run.py [--quick] [--only NAME,...] [--out DIR]        (make bench)

Every contestant gets the same mesh in memory, the same problem, tolerance and BLAS, and one thread per rank; all
forms are compiled before any time is measured, and all must find the same pressure and the same sets.  Runs are
interleaved, a ratio is taken within each round, and the median of the rounds counts.  Targets that are not reached are
reported as such.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import mpi4py.MPI  # first: with wheels of PyPI its library is not found otherwise  # noqa: F401

# isort: split
import dolfinx
import report
import rows
from clock import Sample
from petsc4py import PETSc

_FULL = rows.Sizes(240, 480, 960, 1734, (48, 96))
_QUICK = rows.Sizes(60, 120, 240, 480, (24, 48))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(prog="benchmarks/costs/run.py", description=__doc__.split("\n\n")[0])
    parser.add_argument("--quick", action="store_true", help="small meshes, three repeats")
    parser.add_argument("--only", metavar="NAME,...", help=f"some rows only: {', '.join(rows.GROUPS)}")
    parser.add_argument("--repeats", type=int, metavar="N", help="rounds, 5 by default")
    parser.add_argument("--sizes", metavar="A,B,C,D", help="cells along the bottom, multiples of 3")
    parser.add_argument("--levels", type=int, default=4, metavar="N", help="meshes of the nested iterations")
    parser.add_argument("--out", type=Path, default=Path("results/bench"), metavar="DIR")
    given = parser.parse_args(arguments)
    groups = given.only.split(",") if given.only else list(rows.GROUPS)
    if unknown := set(groups) - set(rows.GROUPS):
        parser.error(f"no row {', '.join(sorted(unknown))}")
    repeats = given.repeats or (3 if given.quick else 5)
    sizes = rows.Sizes(*map(int, given.sizes.split(","))) if given.sizes else _QUICK if given.quick else _FULL
    if any(nx % 3 for nx in (sizes.small, sizes.middle, sizes.large, sizes.huge)):
        parser.error("--sizes must be multiples of 3")

    start, load = time.time(), os.getloadavg()
    facts = {
        "dolfinx": dolfinx.__version__,
        "PETSc": ".".join(map(str, PETSc.Sys.getVersion())),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "not set: more than one thread may run"),
        "repeats": repeats,
    }
    found: list[rows.Row] = []
    samples: list[Sample] = []
    # Written after each group, because the whole takes hours.
    for found, samples in rows.run(groups, sizes, repeats, given.levels, _say):
        facts["load average at the start, at the end"] = " and ".join(
            f"{one[0]:.1f}" for one in (load, os.getloadavg())
        )
        facts["minutes"] = round((time.time() - start) / 60, 1)
        report.write(given.out, found, samples, facts)
    _say("")
    print("\n".join(f"{name}: {value}" for name, value in facts.items()), end="\n\n")
    if sizes != _FULL:
        print("The targets are for the full sizes; here they mean little.\n")
    print(report.table(found), end="\n\n")
    if samples:
        print(report.information(samples), end="\n\n")
    report.picture(given.out, found, samples, sizes)
    print(f"written to {given.out}: rows.csv, samples.csv, facts.csv, performance.png")
    return 0


def _say(text: str) -> None:
    """The current run, on one line of a terminal."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
