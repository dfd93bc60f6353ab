"""List problems, write their meshes, judge results, run programs."""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from benchmarks.contactbench.adapters import ADAPTERS, adapter
from benchmarks.contactbench.answers import Answer, CannotRun, measured
from benchmarks.contactbench.expressions import ExpressionError
from benchmarks.contactbench.grids import Grid, make_grid
from benchmarks.contactbench.judging import Result, ResultError, judge, read_results, without_value
from benchmarks.contactbench.mesh_files import write_inp, write_msh
from benchmarks.contactbench.problem import Problem, ProblemError, problem_names, read_problem

# What a row says instead of yes or no, and how much of an error.
SKIPPED, FAILED, LONGEST = "skipped", "failed", 120
COLUMNS = ("problem", "program", "level", "quantity", "value", "error", "meets", "unknowns", "seconds", "note")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0: all met, 1: a reference is missed or a program failed, 2: bad input."""
    try:
        return _run(_parser().parse_args(arguments))
    except (ProblemError, ResultError, ExpressionError, ValueError) as error:
        print(f"contactbench: {error}", file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="contactbench", description="Contact problems with references.")
    parts = parser.add_subparsers(dest="command", required=True)
    parts.add_parser("list", help="the problems, one a line")
    show = parts.add_parser("show", help="a problem in words, with its references")
    show.add_argument("problem")
    mesh = parts.add_parser("mesh", help="write meshes")
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
    run.add_argument("--seconds", type=float, default=60.0, help="no finer mesh where one took longer")
    run.add_argument("--csv", type=Path, help="append the rows to this file")
    return parser


def _run(given: argparse.Namespace) -> int:
    match given.command:
        case "list":
            for name in problem_names():
                problem = read_problem(name)
                kinds = "/".join(sorted({quantity.kind for quantity in problem.quantities}))
                print(f"{name:32} {problem.hypothesis:13} {kinds:16} {problem.title}")
            return 0
        case "show":
            print(_shown(read_problem(given.problem)))
            return 0
        case "mesh":
            return _write_meshes(given)
        case "judge":
            problem = read_problem(given.problem)
            results = read_results(given.file, problem)
            return _judged(problem, results)
    return _run_programs(given)


def _shown(problem: Problem) -> str:
    lines = [problem.title, "", problem.text.strip(), "", f"Signs: {problem.signs}", f"Units: {problem.units}"]
    lines += [f"Source: {problem.source}", ""]
    for quantity in problem.quantities:
        numbers = ", ".join(f"{number:.8g}" for number in quantity.numbers)
        lines.append(f"{quantity.name} [{quantity.unit}]: {quantity.text}")
        lines.append(f"    {quantity.kind} {numbers}; {'; '.join(quantity.sources)}")
    return "\n".join(lines)


def _write_meshes(given: argparse.Namespace) -> int:
    given.out.mkdir(parents=True, exist_ok=True)
    for name in given.problem or problem_names():
        problem = read_problem(name)
        for level in range(given.levels):
            grid = make_grid(problem, level)
            stem = given.out / f"{problem.name}-{level}"
            write_msh(grid, stem.with_suffix(".msh"))
            write_inp(grid, problem.hypothesis, stem.with_suffix(".inp"))
            print(f"{stem}.msh, .inp: {len(grid.points)} nodes, {len(grid.cells)} cells")
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
            failed |= any(row["meets"] == FAILED or (row["level"] == 0 and row["meets"] == "no") for row in rows)
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
    program: str, solve: Callable[[Problem, Grid], Answer], problem: Problem, levels: int, limit: float
) -> Iterator[dict[str, object]]:
    """A row for each quantity on each mesh; one without a quantity where the program cannot, or fails."""
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
