"""The command line of ``demos/paper.py``."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

from .figures import FIGURES
from .report import Picture, Table, progress
from .studies import STUDIES
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
    everything = options.tables is options.figures is options.studies is None
    folder: Path = options.out
    folder.mkdir(parents=True, exist_ok=True)
    tables = _tables(TABLES, options.tables, everything, folder)
    figures = _figures(options.figures, everything, folder)
    studies = _tables(STUDIES, options.studies, everything, folder)
    seconds = time.perf_counter() - start
    numbers = _merged([*tables, *(table for figure in figures for table in figure.tables), *studies])
    if everything:
        _write_json(folder / "numbers.json", numbers)
    if options.json:
        _write_json(options.json, numbers)
    progress("")
    print(f"{folder}: {seconds:.0f} s")
    return 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="paper.py",
        description="Recompute the numerical results of Kunisch & Stadler (2005); without --tables, --figures and "
        "--studies all of them.",
    )
    parser.add_argument("--tables", metavar="1,3", type=_choice(TABLES), help="only these tables")
    parser.add_argument("--figures", metavar="2,4", type=_choice(FIGURES), help="only these figures")
    parser.add_argument(
        "--studies", metavar="NAMES", type=_choice(STUDIES), help=f"only these studies, of {', '.join(STUDIES)}"
    )
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the numbers in the layout of printed.json")
    parser.add_argument("--out", metavar="DIR", type=Path, default=ROOT / "results" / "paper", help="where to write")
    return parser.parse_args(arguments)


def _choice(known: dict[Any, Any]) -> Callable[[str], list[Any]]:
    """Parses a list with commas of keys of ``known``."""
    by_name = {str(key): key for key in known}

    def parse(text: str) -> list[Any]:
        names = [name.strip() for name in text.split(",") if name.strip()]
        unknown = [name for name in names if name not in by_name]
        if unknown:
            raise argparse.ArgumentTypeError(f"no {', '.join(unknown)}; there are {', '.join(by_name)}")
        return [by_name[name] for name in names]

    return parse


def _tables(
    functions: dict[Any, Callable[[], list[Table]]], wanted: list[Any] | None, everything: bool, folder: Path
) -> list[Table]:
    found = []
    for key, function in functions.items():
        if everything or key in (wanted or []):
            for table in function():
                _show(table, folder)
                found.append(table)
    return found


def _figures(wanted: list[int] | None, everything: bool, folder: Path) -> list[Picture]:
    found = []
    for number, function in FIGURES.items():
        if everything or number in (wanted or []):
            progress(f"figure {number}")
            picture = function(folder)
            picture.write(folder)
            for table in picture.tables:
                _show(table, folder)
            found.append(picture)
    return found


def _show(table: Table, folder: Path) -> None:
    table.write(folder)
    progress("")
    print(table.text(), flush=True)


def _merged(tables: Sequence[Table]) -> dict[str, Any]:
    """The numbers of all tables; those of one key together."""
    numbers: dict[str, Any] = {}
    for table in tables:
        for key, values in table.numbers.items():
            numbers.setdefault(key, {}).update(values)
    return numbers


def _write_json(path: Path, numbers: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(numbers, indent=1, allow_nan=False) + "\n", encoding="utf-8")
