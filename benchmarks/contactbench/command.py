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
    run.add_argument("--csv", type=Path, help="append the rows to this file")
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
    failed = False
    for program in given.program or ADAPTERS:
        try:
            solve = adapter(program)
        except CannotRun as why:
            print(f"{program}: skipped: {why}", flush=True)
            continue
        for name in given.problem or problem_names():
            rows = list(_solved(program, solve, read_problem(name), given.levels, given.seconds))
            failed |= any(
                row["meets"] == FAILED or (row["level"] == 0 and row["meets"] == "no")
                for row in rows
            )
            if given.csv:
                _append(given.csv, rows)
    return int(failed)


def _append(path: Path, rows: list[dict[str, object]]) -> None:
    new = not path.exists()
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerows(rows)


def _solved(
    program: str,
    solve: Callable[[Problem, Grid], Answer],
    problem: Problem,
    levels: int,
    limit: float,
) -> Iterator[dict[str, object]]:
    """A row for each quantity on each mesh; one without a quantity where the program cannot, or
    fails.
    """
    level = -1
    while (level := level + 1) < levels:
        where = f"{program}, {problem.name}, level {level}"
        row: dict[str, object] = {"problem": problem.name, "program": program, "level": level}
        grid = make_grid(problem, level)
        try:
            answer = solve(problem, grid)
        except CannotRun as why:
            print(f"{where}: skipped: {why}", flush=True)
            yield row | {"meets": SKIPPED, "note": str(why)}
            return
        except Exception as error:
            print(f"{where}: FAILED: {error}", flush=True)
            yield row | {"meets": FAILED, "note": str(error)[:LONGEST]}
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
                "unknowns": answer.unknowns,
                "seconds": f"{answer.seconds:.3g}",
                "note": answer.note,
            }
