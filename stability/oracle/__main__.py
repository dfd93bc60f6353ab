"""Random scenes, judged by a program that shares no code with the package.

    ./env python3 -m stability.oracle [--scenes N] [--first SEED] [--jobs N] [--out DIR]        (make oracle)
    ./env python3 -m stability.oracle --only SEED            one scene, with its file and every figure

Exit code 1 if a converged answer is wrong, an equilibrium is denied that there is, or anything ends without an outcome.
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

from stability.oracle.convex import cvxopt
from stability.oracle.judge import CONVERGED, CRASHED, FAILURES, KINDS, RIGHT
from stability.oracle.scenes import trial
from stability.oracle.worker import MARK, Row, examined

# Wall seconds for one scene; the first one of a process also compiles.
_LIMIT, _START = 60.0, 180.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Examine random scenes."""
    parser = argparse.ArgumentParser(prog="python3 -m stability.oracle", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--scenes", type=int, default=2000, metavar="N", help="how many (2000)")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="the first one's number (0)")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes (1)")
    parser.add_argument("--only", type=int, metavar="SEED", help="one scene, with its file and every figure")
    parser.add_argument("--out", type=Path, default=Path("results/oracle"), metavar="DIR")
    given = parser.parse_args(arguments)
    if cvxopt is None:
        print(
            "no CVXOPT (Debian: python3-cvxopt): conditions are judged, no convex programme is solved", file=sys.stderr
        )
    if given.only is not None:
        return _one(given.only, given.out)
    begin, rows = time.monotonic(), list[Row]()
    found: queue.Queue[Row | None] = queue.Queue()
    stop = given.first + given.scenes
    for job in range(given.jobs):
        threading.Thread(target=_work, args=(given.first + job, stop, given.jobs, found), daemon=True).start()
    working = given.jobs
    while working:
        if (row := found.get()) is None:
            working -= 1
            continue
        rows.append(row)
        if row.kind in FAILURES:
            print(f"\r\x1b[K{line(row)}" if sys.stderr.isatty() else line(row), flush=True)
        if sys.stderr.isatty() or len(rows) % 100 == 0:
            count = Counter(row.kind in FAILURES for row in rows)
            text = f"{len(rows)} of {given.scenes} scenes, {count[True]} wrong, {time.monotonic() - begin:.0f} s"
            print(
                f"\r\x1b[K{text}" if sys.stderr.isatty() else text,
                end="" if sys.stderr.isatty() else "\n",
                file=sys.stderr,
            )
    rows.sort(key=lambda row: row.seed)
    print(f"\n{table(rows)}\n")
    given.out.mkdir(parents=True, exist_ok=True)
    with (given.out / "oracle.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    wrong = [line(row) for row in rows if row.kind in FAILURES]
    (given.out / "oracle.txt").write_text("\n".join([table(rows), "", *wrong, ""]), encoding="utf-8")
    print(f"{time.monotonic() - begin:.0f} s; written to {given.out}: oracle.txt, oracle.csv")
    return int(bool(wrong))


def _one(seed: int, out: Path) -> int:
    """Examine one scene and show everything."""
    drawn = trial(seed)
    path = drawn.write(out / f"scene_{seed}")
    print(path.read_text(encoding="utf-8"))
    verdict, about = examined(drawn)
    print(f"{path}\n{verdict.kind}: {verdict.outcome} {about} {verdict.note}")
    for name, value in sorted(verdict.figures.items(), key=lambda item: -item[1]):
        print(f"{value:10.2e}  {name}")
    return int(verdict.kind in FAILURES)


def line(row: Row) -> str:
    """A scene in one line."""
    figure = f"{row.figure}: {row.value:.1e} times what is tolerated" if row.figure and row.value > 0 else row.note
    note = f"; {row.note}" if row.note and row.note != figure else ""
    return f"scene {row.seed}: {row.kind} ({row.outcome}; {row.algorithm}; {row.law}; {row.element}) {figure}{note}"


def table(rows: Sequence[Row]) -> str:
    """How many scenes ended how, by friction law; then by algorithm; then what the convex programmes say."""
    laws = ["none", "tresca", "coulomb", "coulomb and tresca"]
    parts = [_counts("verdict", [row.kind for row in rows], KINDS, [row.law for row in rows], laws)]
    named = Counter(row.outcome for row in rows if row.outcome != CONVERGED)
    parts.append(
        "\n".join(["outcomes that are no solution:", *(f"  {n:5}  {name}" for name, n in named.most_common())])
    )
    algorithms = sorted({row.algorithm for row in rows if row.algorithm})
    kinds = [row.kind for row in rows if row.algorithm]
    parts.append(_counts("verdict", kinds, KINDS, [row.algorithm for row in rows if row.algorithm], algorithms))
    steps, compared = (sum(getattr(row, name) for row in rows if row.kind == RIGHT) for name in ("steps", "compared"))
    parts.append(f"{compared} of {steps} load steps that are right were computed a second time as a convex programme")
    return "\n\n".join(parts)


def _counts(title: str, kinds: Sequence[str], order: Iterable[str], groups: Sequence[str], names: Sequence[str]) -> str:
    """Counts of pairs as a table of Markdown."""
    count = Counter(zip(kinds, groups, strict=True))
    lines = [f"| {title} | all | {' | '.join(names)} |", "|---" * (len(names) + 2) + "|"]
    for kind in order:
        if kind in kinds:
            cells = [sum(count[kind, name] for name in names), *(count[kind, name] for name in names)]
            lines.append(f"| {kind} | {' | '.join(map(str, cells))} |")
    total = [len(kinds), *(sum(group == name for group in groups) for name in names)]
    return "\n".join([*lines, f"| all | {' | '.join(map(str, total))} |"])


def _work(first: int, stop: int, stride: int, found: queue.Queue[Row | None]) -> None:
    """Let worker processes examine every ``stride``-th scene; one that dies or is stuck costs its scene only."""
    while first < stop:
        command = [sys.executable, "-m", "stability.oracle.worker", str(first), str(stop), str(stride)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
            assert process.stdout is not None
            lines: queue.Queue[str] = queue.Queue()
            reader = threading.Thread(target=_read, args=(process.stdout, lines), daemon=True)
            reader.start()
            limit, reason = _START, ""
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
                    first, limit = first + stride, _LIMIT
            reader.join()
        if first < stop:
            found.put(Row(first, CRASHED, "process died", note=reason))
            first += stride
    found.put(None)


def _read(stream: Iterable[str], lines: queue.Queue[str]) -> None:
    for text in stream:
        if text.startswith(MARK):
            lines.put(text[len(MARK) :])
    lines.put("")


if __name__ == "__main__":
    sys.exit(main())
