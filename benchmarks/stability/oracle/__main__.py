"""Random scenes, judged by a program that shares no code with the package.

    ./env python3 -m benchmarks.stability.oracle [--plane N] [--space N] [--bodies N] [--effects N]
                                              [--space-effects N] [--first SEED] [--jobs N]
                                              (make oracle)
    ./env python3 -m benchmarks.stability.oracle --only plane SEED      one scene, with its file and
    every figure ./env python3 -m benchmarks.stability.oracle --only space SEED --same-units
    the same in units of the body

Exit code 1 if a converged answer is wrong, an equilibrium is denied that there is, a certificate
does not hold, a scene is refused without a documented reason, or anything ends without an outcome.
"""

from __future__ import annotations

import argparse
import csv
import json
import queue
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, fields
from pathlib import Path

from benchmarks.stability.oracle.convex import cvxopt
from benchmarks.stability.oracle.judge import (
    CONVERGED,
    CRASHED,
    DOUBTFUL,
    FAILURES,
    KINDS,
    REFUSED,
    REPORTED,
    RIGHT,
)
from benchmarks.stability.oracle.worker import MARK, TRIAL, Row, examined, same_units

# Wall seconds more for the first scene of a process, which also compiles.
_START = 120.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Examine random scenes."""
    parser = argparse.ArgumentParser(
        prog="python3 -m benchmarks.stability.oracle", description=(__doc__ or "").split("\n\n")[0]
    )
    parser.add_argument("--plane", type=int, metavar="N", help="how many scenes in 2D (2000)")
    parser.add_argument(
        "--space",
        type=int,
        metavar="N",
        help="how many scenes in 3D (1000); one of these alone: no others",
    )
    parser.add_argument(
        "--bodies", type=int, metavar="N", help="how many scenes of two and three bodies (1000)"
    )
    parser.add_argument(
        "--effects", type=int, metavar="N", help="how many scenes with further effects (1000)"
    )
    parser.add_argument(
        "--space-effects", type=int, metavar="N", help="how many of these in 3D (1000)"
    )
    parser.add_argument(
        "--first", type=int, default=0, metavar="SEED", help="the first one's number (0)"
    )
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes (1)")
    parser.add_argument(
        "--limit", type=float, default=180.0, metavar="S", help="wall seconds for one scene (180)"
    )
    parser.add_argument(
        "--only",
        nargs=2,
        metavar=("WHERE", "SEED"),
        help="one scene, with its file and every figure",
    )
    parser.add_argument(
        "--same-units", action="store_true", help="units of the body, none at random"
    )
    parser.add_argument("--out", type=Path, default=Path("results/oracle"), metavar="DIR")
    given = parser.parse_args(arguments)
    if cvxopt is None:
        print(
            "no CVXOPT (Debian: python3-cvxopt): conditions are judged, no programme is solved",
            file=sys.stderr,
        )
    if given.only is not None:
        return _one(given.only[0], int(given.only[1]), given.out, own=given.same_units)
    counts = {where: getattr(given, where.replace("-", "_")) for where in _SHOWN}
    if all(count is None for count in counts.values()):
        counts = {
            "plane": 2000,
            "space": 1000,
            "bodies": 1000,
            "effects": 1000,
            "space-effects": 1000,
        }
    begin, rows = time.monotonic(), list[Row]()
    for where, count in counts.items():
        rows += _examined(where, given, count or 0)
    shown = "\n\n".join(
        f"Scenes {_SHOWN[where]}\n\n{table(some)}"
        for where in counts
        if (some := [row for row in rows if row.where == where])
    )
    print(f"\n{shown}\n")
    given.out.mkdir(parents=True, exist_ok=True)
    with (given.out / "oracle.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    told = [line(row) for row in rows if row.kind in FAILURES]
    others = [line(row) for row in rows if row.kind in (REPORTED, DOUBTFUL, REFUSED)]
    text = [shown, "", *told, "", "Not wrong, but no solution:", *others, ""]
    (given.out / "oracle.txt").write_text("\n".join(text), encoding="utf-8")
    print(f"{time.monotonic() - begin:.0f} s; written to {given.out}: oracle.txt, oracle.csv")
    return int(bool(told))


_SHOWN = {
    "plane": "in 2D",
    "space": "in 3D",
    "bodies": "of several bodies, in 2D and in 3D",
    "effects": "in 2D with further effects",
    "space-effects": "in 3D with further effects",
}


def _examined(where: str, given: argparse.Namespace, count: int) -> list[Row]:
    """The rows of ``count`` scenes, by seed; what is wrong is printed when it is found."""
    first, jobs = given.first, given.jobs
    begin, rows = time.monotonic(), list[Row]()
    found: queue.Queue[Row | None] = queue.Queue()
    for job in range(jobs):
        arguments = (where, given.same_units, given.limit, first + job, first + count, jobs, found)
        threading.Thread(target=_work, args=arguments, daemon=True).start()
    working = jobs
    while working:
        if (row := found.get()) is None:
            working -= 1
            continue
        rows.append(row)
        if row.kind in FAILURES:
            print(f"\r\x1b[K{line(row)}" if sys.stderr.isatty() else line(row), flush=True)
        if sys.stderr.isatty() or len(rows) % 100 == 0:
            wrong = sum(row.kind in FAILURES for row in rows)
            text = f"{len(rows)} of {count} scenes, {wrong} wrong, {time.monotonic() - begin:.0f} s"
            start, end = ("\r\x1b[K", "") if sys.stderr.isatty() else ("", "\n")
            print(f"{start}{text}", end=end, file=sys.stderr)
    return sorted(rows, key=lambda row: row.seed)


def _one(where: str, seed: int, out: Path, *, own: bool) -> int:
    """Examine one scene and show everything."""
    drawn = TRIAL[where](seed, same_units(where, seed) if own else None)
    path = drawn.write(out / f"scene_{where}_{seed}")
    print(path.read_text(encoding="utf-8"))
    verdict, about = examined(drawn, where)
    print(f"{path}\n{verdict.kind}: {verdict.outcome} {about} {verdict.note}")
    for name, value in sorted(verdict.figures.items(), key=lambda item: -item[1]):
        print(f"{value:10.2e}  {name}")
    return int(verdict.kind in FAILURES)


def line(row: Row) -> str:
    """A scene in one line."""
    figure = (
        f"{row.figure}: {row.value:.1e} times what is tolerated"
        if row.figure and row.value > 0
        else row.note
    )
    note = f"; {row.note}" if row.note and row.note != figure else ""
    return (
        f"{row.where} {row.seed}: {row.kind} ({row.outcome}; {row.algorithm}; {row.law}; "
        f"{row.element}) {figure}{note}"
    )


def table(rows: Sequence[Row]) -> str:
    """How many scenes ended how, by friction law; then by algorithm; then what the convex
    programmes say.
    """
    laws = ["none", "tresca", "coulomb", "coulomb and tresca"]
    parts = [_counts("verdict", [row.kind for row in rows], KINDS, [row.law for row in rows], laws)]
    named = Counter(row.outcome for row in rows if row.outcome != CONVERGED)
    parts.append(
        "\n".join(
            [
                "outcomes that are no solution:",
                *(f"  {n:5}  {name}" for name, n in named.most_common()),
            ]
        )
    )
    algorithms = sorted({row.algorithm for row in rows if row.algorithm})
    kinds = [row.kind for row in rows if row.algorithm]
    parts.append(
        _counts(
            "verdict", kinds, KINDS, [row.algorithm for row in rows if row.algorithm], algorithms
        )
    )
    steps, compared = (
        sum(getattr(row, name) for row in rows if row.kind == RIGHT)
        for name in ("steps", "compared")
    )
    parts.append(
        f"{compared} of {steps} load steps that are right were computed a second time as a convex "
        "programme"
    )
    return "\n\n".join(parts)


def _counts(
    title: str,
    kinds: Sequence[str],
    order: Iterable[str],
    groups: Sequence[str],
    names: Sequence[str],
) -> str:
    """Counts of pairs as a table of Markdown."""
    count = Counter(zip(kinds, groups, strict=True))
    lines = [f"| {title} | all | {' | '.join(names)} |", "|---" * (len(names) + 2) + "|"]
    for kind in order:
        if kind in kinds:
            cells = [kinds.count(kind), *(count[kind, name] for name in names)]
            lines.append(f"| {kind} | {' | '.join(map(str, cells))} |")
    total = [len(kinds), *(sum(group == name for group in groups) for name in names)]
    return "\n".join([*lines, f"| all | {' | '.join(map(str, total))} |"])


def _work(
    where: str,
    own: bool,
    most: float,
    first: int,
    stop: int,
    stride: int,
    found: queue.Queue[Row | None],
) -> None:
    """Let worker processes examine every ``stride``-th scene; one that dies or is stuck costs its
    scene only.
    """
    while first < stop:
        command = [
            sys.executable,
            "-W",
            "error::RuntimeWarning",
            "-m",
            "benchmarks.stability.oracle.worker",
            *map(str, (where, int(own), first, stop, stride)),
        ]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        ) as process:
            assert process.stdout is not None
            lines: queue.Queue[str] = queue.Queue()
            reader = threading.Thread(target=_read, args=(process.stdout, lines), daemon=True)
            reader.start()
            limit, reason = most + _START, ""
            while not reason:
                try:
                    text = lines.get(timeout=limit)
                except queue.Empty:
                    process.kill()
                    reason = f"took longer than {limit:.0f} s"
                    continue
                if not text:
                    reason = f"exit code {process.wait()}"
                elif "row" in (message := json.loads(text)):
                    found.put(Row(**message["row"]))
                    first, limit = first + stride, most
            reader.join()
        if first < stop:
            found.put(Row(first, CRASHED, where, "process died", note=reason))
            first += stride
    found.put(None)


def _read(stream: Iterable[str], lines: queue.Queue[str]) -> None:
    for text in stream:
        if text.startswith(MARK):
            lines.put(text[len(MARK) :])
    lines.put("")


if __name__ == "__main__":
    sys.exit(main())
