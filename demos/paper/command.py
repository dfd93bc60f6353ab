"""The command line of ``demos/paper.py``."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

from signorini_fx import write_results

from . import laboratory as lab
from .figures import FIGURES
from .report import progress
from .tables import TABLES

ROOT = Path(__file__).resolve().parents[2]


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute what is asked for, write it, and return the exit code."""
    options = _options(arguments)
    if MPI.COMM_WORLD.size > 1:
        if MPI.COMM_WORLD.rank == 0:
            print("paper.py works on one rank: start it without mpirun", file=sys.stderr)
        return 2
    start = time.perf_counter()
    everything = options.tables is options.figures is None
    folder: Path = options.out
    folder.mkdir(parents=True, exist_ok=True)
    numbers: dict[str, Any] = {}
    for number, tables in TABLES.items():
        if everything or number in (options.tables or []):
            for table in tables():
                (folder / f"{table.name}.txt").write_text(table.text(), encoding="utf-8")
                progress("")
                print(table.text(), flush=True)
                for key, values in table.numbers.items():
                    numbers.setdefault(key, {}).update(values)
    for number, scenes in FIGURES.items():
        if everything or number in (options.figures or []):
            for name, scene in scenes().items():
                progress(f"figure {number}: {name}")
                write_results(
                    lab.solved(scene), folder / f"figure{number}" / name, fields=False, pdf=True
                )
    if everything:
        _write_json(folder / "numbers.json", numbers)
    if options.json:
        _write_json(options.json, numbers)
    progress("")
    print(f"{folder}: {time.perf_counter() - start:.0f} s")
    return 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="paper.py",
        description="Recompute the numerical results of Kunisch & Stadler (2005); without "
        "--tables and --figures all "
        "of them.",
    )
    parser.add_argument("--tables", type=int, nargs="+", choices=TABLES, help="only these tables")
    parser.add_argument(
        "--figures", type=int, nargs="+", choices=FIGURES, help="only these figures"
    )
    parser.add_argument(
        "--json", metavar="FILE", type=Path, help="write the numbers in the layout of printed.json"
    )
    parser.add_argument(
        "--out", metavar="DIR", type=Path, default=ROOT / "results" / "paper", help="where to write"
    )
    return parser.parse_args(arguments)


def _write_json(path: Path, numbers: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(numbers, indent=1, allow_nan=False) + "\n", encoding="utf-8")
