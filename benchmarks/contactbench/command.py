"""Write meshes of the problems, judge results, run programs."""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from .adapters import ADAPTERS, adapter
from .answers import Answer, CannotRun, measured
from .expressions import ExpressionError
from .grids import Grid, make_grid
from .judging import Result, ResultError, judge, read_results, without_value
from .mesh_files import inp_lines, write_msh
from .problem import Problem, ProblemError, problem_names, read_problem

# What a row says instead of yes or no, and how much of an error.
SKIPPED, FAILED, LONGEST = "skipped", "failed", 120
COLUMNS = (
    "problem",
    "program",
    "level",
    "quantity",
    "value",
    "error",
    "meets",
    "unknowns",
    "seconds",
    "note",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0: all met, 1: a reference is missed or a program failed, 2: bad input."""
    try:
        return _run(_parser().parse_args(arguments))
    except (ProblemError, ResultError, ExpressionError, ValueError) as error:
        print(f"contactbench: {error}", file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="contactbench", description="Contact problems with references."
    )
    parts = parser.add_subparsers(dest="command", required=True)
    mesh = parts.add_parser("mesh", help="write meshes as .msh and .inp")
    mesh.add_argument("problem", nargs="*", help="none: all")
    mesh.add_argument("--levels", type=int, default=1, help="meshes, each twice as fine")
    mesh.add_argument("--out", type=Path, default=Path("contactbench-meshes"))
    mark = parts.add_parser("judge", help="judge a CSV with the columns quantity,value")
    mark.add_argument("problem")
    mark.add_argument("file", type=Path)
    run = parts.add_parser("run", help="run programs, and judge them")
    run.add_argument("problem", nargs="*", help="none: all")
    run.add_argument("--program", action="append", choices=sorted(ADAPTERS), help="none: all")
    run.add_argument("--levels", type=int, default=1)
    run.add_argument(
        "--seconds", type=float, default=60.0, help="no finer mesh where one took longer"
    )
    run.add_argument(
        "--csv", type=Path, help="append the rows to this file; what it has is not run again"
    )
    return parser


def _run(given: argparse.Namespace) -> int:
    if given.command == "mesh":
        return _write_meshes(given)
    if given.command == "run":
        return _run_programs(given)
    problem = read_problem(given.problem)
    return _judged(problem, read_results(given.file, problem))


def _write_meshes(given: argparse.Namespace) -> int:
    given.out.mkdir(parents=True, exist_ok=True)
    for name in given.problem or problem_names():
        problem = read_problem(name)
        for level in range(given.levels):
            grid = make_grid(problem, level)
            path = given.out / f"{problem.name}-{level}.inp"
            write_msh(grid, path.with_suffix(".msh"))
            path.write_text("\n".join(inp_lines(grid, problem.hypothesis)) + "\n", encoding="utf-8")
            print(f"{path}: {len(grid.points)} nodes, {len(grid.cells)} cells")
    return 0


def _judged(problem: Problem, results: list[Result]) -> int:
    verdicts, missing = judge(problem, results), without_value(problem, results)
    for verdict in verdicts:
        print(f"{verdict.quantity.name}: {verdict.text}")
    for name in missing:
        print(f"{name}: not given")
    return int(not all(verdict.meets for verdict in verdicts))


def _run_programs(given: argparse.Namespace) -> int:
    rows = _recorded(given.csv)
    there = {(row["program"], row["problem"]) for row in rows}
    for program in given.program or ADAPTERS:
        try:
            solve = adapter(program)
        except CannotRun as why:
            print(f"{program}: skipped: {why}", flush=True)
            continue
        for name in given.problem or problem_names():
            if (program, name) in there:
                continue
            new = list(_solved(program, solve, read_problem(name), given.levels, given.seconds))
            if given.csv:
                _append(given.csv, new)
            rows += new
    if rows:
        print("", *summary(rows), sep="\n")
    return int(
        any(
            row["meets"] == FAILED or (row["level"] == "0" and row["meets"] == "no") for row in rows
        )
    )


def _recorded(path: Path | None) -> list[dict[str, str]]:
    """The rows of a file; none where there is no file."""
    if path is None or not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _append(path: Path, rows: list[dict[str, str]]) -> None:
    new = not path.exists()
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerows(rows)


def summary(rows: list[dict[str, str]]) -> Iterator[str]:
    """A table in Markdown with a line for each program; before it, what each fails."""
    counts = []
    for program in dict.fromkeys(row["program"] for row in rows):
        own = [row for row in rows if row["program"] == program]
        named = {
            meets: sorted({row["problem"] for row in own if row["meets"] == meets})
            for meets in (FAILED, "no", SKIPPED)
        }
        for meets, what in ((FAILED, "fails"), ("no", "is beyond a tolerance")):
            if named[meets]:
                yield f"{program} {what}: {', '.join(named[meets])}"
        values = [row for row in own if row["quantity"]]
        solved = {row["problem"] for row in own} - {*named[FAILED], *named[SKIPPED]}
        seconds = {(row["problem"], row["level"]): float(row["seconds"]) for row in values}
        beyond = sum(row["meets"] == "no" for row in values)
        cells = (
            program,
            len(solved),
            len(named[FAILED]),
            len(named[SKIPPED]),
            len(values),
            beyond,
            f"{sum(seconds.values()):.0f}",
        )
        counts.append("| " + " | ".join(map(str, cells)) + " |")
    yield ""
    yield "| program | solved | failed | skipped | values | beyond their tolerance | CPU seconds |"
    yield "|---|---|---|---|---|---|---|"
    yield from counts


def _solved(
    program: str,
    solve: Callable[[Problem, Grid], Answer],
    problem: Problem,
    levels: int,
    limit: float,
) -> Iterator[dict[str, str]]:
    """A row for each quantity on each mesh; one without a quantity where the program cannot, or
    fails.
    """
    level = -1
    while (level := level + 1) < levels:
        where = f"{program}, {problem.name}, level {level}"
        row = {"problem": problem.name, "program": program, "level": str(level)}
        grid = make_grid(problem, level)
        try:
            answer = solve(problem, grid)
        except CannotRun as why:
            print(f"{where}: skipped: {why}", flush=True)
            yield row | {"quantity": "", "meets": SKIPPED, "note": str(why)}
            return
        except Exception as error:
            print(f"{where}: FAILED: {error}", flush=True)
            yield row | {"quantity": "", "meets": FAILED, "note": str(error)[:LONGEST]}
            return
        if answer.seconds > limit and level + 1 < levels:
            print(f"{where}: took {answer.seconds:.3g} s: no finer mesh is run", flush=True)
            levels = level + 1
        values = measured(problem, grid, answer)
        results = [Result(key, value) for key, value in values.items()]
        for verdict in judge(problem, results):
            print(f"{where}: {verdict.quantity.name}: {verdict.text}", flush=True)
            yield row | {
                "quantity": verdict.quantity.name,
                "value": f"{verdict.result.value:.9g}",
                "error": f"{verdict.error:.3e}",
                "meets": "yes" if verdict.meets else "no",
                "unknowns": str(answer.unknowns),
                "seconds": f"{answer.seconds:.3g}",
                "note": answer.note,
            }
