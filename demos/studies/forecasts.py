"""How good the forecasts of the line ``cost`` are: what the next error was said to take, over what it then took.

    ./env python3 demos/studies/forecasts.py --out docs/evidence/forecasts.csv
    ./env python3 demos/studies/forecasts.py --held-out --out docs/evidence/forecasts_held_out.csv

Each problem is solved on a coarse mesh, which foretells unknowns and seconds for a smaller error.  The mesh with so
many unknowns is then made and solved.  From its error, and the rate between both meshes, follow the unknowns and the
seconds that the smaller error needs.  Problems *by list* request an accuracy, and then one ten times better: needed is
what that run had taken when its error was as small as foretold.  All errors are estimates;
docs/evidence/effectivity.csv says how good these are.  Each problem runs in a process of its own with its forms
compiled; seconds are those that the processor spent, of several rounds the fewest.  The last rows have the median and
the range of each kind.  With ``--needed`` only the forecasts are made anew, as after a change of their rule.  With
``--held-out`` the problems are those that had no part in the choice of the ranges.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

from forecast_problems import CHOSEN_ON, HELD_OUT, Problem, problems

# Rounds of which the fastest counts: on the coarse mesh, and on the fine one.
COARSE_ROUNDS, FINE_ROUNDS = 5, 2


def _seconds(solution: Any) -> float:
    if solution.convergence_table:
        return float(sum(price.seconds for price in solution.convergence_table if not price.predicted))
    return float(sum(solution.timings.total.values()))


def _fastest(solved: Callable[[float], Any], finer: float, rounds: int) -> Any:
    return min((solved(finer) for _ in range(rounds)), key=_seconds)


def row_of(problem: Problem, known: tuple[float, float] | None = None) -> dict[str, Any]:
    """What was foretold, and what was needed; ``known``: unknowns and seconds that were needed in an earlier run."""
    time.perf_counter = time.process_time  # other programs take no part of it
    problem.solved(1.0)  # compiles forms and loads libraries
    coarse = _fastest(problem.solved, 1.0, COARSE_ROUNDS)
    cost, dimension = coarse.cost, coarse.model.tagged.dimension
    if known is None:
        known = _by_list(problem, cost) if coarse.convergence_table else _on_mesh(problem, cost, dimension)
    unknowns, seconds = known
    low, high = cost.next_seconds
    foretold = math.sqrt(low * high)
    return {
        "kind": problem.kind,
        "problem": problem.name,
        "unknowns": cost.dofs,
        "of": cost.of,
        "error": f"{cost.error:.2e}",
        "next error": f"{cost.next_error:.2e}",
        "unknowns foretold": f"{cost.next_dofs:.2g}",
        "needed": f"{unknowns:.2g}",
        "unknowns, ratio": f"{cost.next_dofs / unknowns:.2f}",
        "seconds foretold": f"{low:.2g} to {high:.2g}",
        "seconds needed": f"{seconds:.2g}",
        "seconds, ratio": f"{foretold / seconds:.2f}",
        "within": "yes" if low <= seconds <= high else "no",
    }


def _needed(table: Path, problem: Problem) -> tuple[float, float]:
    """Unknowns and seconds that a problem needed, by a table of an earlier run."""
    with table.open(encoding="utf-8") as file:
        rows = {(row["kind"], row["problem"]): row for row in csv.DictReader(file)}
    row = rows[problem.kind, problem.name]
    return float(row["needed"]), float(row["seconds needed"])


def _on_mesh(problem: Problem, cost: Any, dimension: int) -> tuple[float, float]:
    """Unknowns and seconds that the next error needs, from the mesh with as many unknowns as were foretold."""
    finer = (cost.next_dofs / cost.dofs) ** (1 / dimension)
    finer = round(finer) if dimension == 2 else finer  # whole multiples keep the nodes where loads jump
    fine = _fastest(problem.solved, finer, FINE_ROUNDS)
    dofs, error = fine.model.dofs, fine.stress.error
    rate = math.log(cost.error / error) / math.log(dofs / cost.dofs)
    needed = dofs * (error / cost.next_error) ** (1 / rate)
    power = max(math.log(_seconds(fine) / cost.seconds) / math.log(dofs / cost.dofs), 0.0)
    return needed, _seconds(fine) * (needed / dofs) ** power


def _by_list(problem: Problem, cost: Any) -> tuple[float, float]:
    """The same from the convergence table of a run to a better accuracy."""
    fine = _fastest(problem.solved, cost.error / cost.next_error, FINE_ROUNDS)
    rows = [price for price in fine.convergence_table if not price.predicted and getattr(price, cost.of)]
    spent = {price.level: sum(row.seconds for row in fine.convergence_table[: price.level + 1]) for price in rows}
    for before, after in pairwise(rows):
        errors = getattr(before, cost.of), getattr(after, cost.of)
        if errors[1] <= cost.next_error:
            share = math.log(max(errors[0] / cost.next_error, 1.0)) / math.log(errors[0] / errors[1])
            share = min(max(share, 0.0), 1.0)
            dofs = before.dofs * (after.dofs / before.dofs) ** share
            return dofs, spent[before.level] + share * (spent[after.level] - spent[before.level])
    return float(rows[-1].dofs), spent[rows[-1].level]


def spread(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row for each kind, and one for all on one mesh: median, smallest and largest ratio."""
    groups = {kind: [row for row in rows if row["kind"] == kind] for kind in CHOSEN_ON}
    groups["on one mesh"] = [row for row in rows if row["kind"] != "by list"]
    summary = []
    for kind, group in groups.items():
        if not group:
            continue
        entry = dict.fromkeys(rows[0], "")
        entry |= {"kind": "all", "problem": f"{kind}, {len(group)}: median, from to"}
        for column in ("unknowns, ratio", "seconds, ratio"):
            ratios = [float(row[column]) for row in group]
            entry[column] = f"{statistics.median(ratios):.2f}, {min(ratios):.2f} to {max(ratios):.2f}"
        entry["within"] = f"{sum(row['within'] == 'yes' for row in group)} of {len(group)}"
        summary.append(entry)
    return summary


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/forecasts.csv"), help="file (default: %(default)s)")
    parser.add_argument("--kind", choices=CHOSEN_ON, action="append", help="only these")
    parser.add_argument("--held-out", action="store_true", help="problems that had no part in the choice of the ranges")
    parser.add_argument("--needed", type=Path, help="an earlier table: what was needed is taken from there")
    parser.add_argument("--one", nargs=2, metavar=("KIND", "NUMBER"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    kinds = HELD_OUT if options.held_out else CHOSEN_ON
    if options.one:
        kind, number = options.one
        problem = problems(kinds, kind)[int(number)]
        print(json.dumps(row_of(problem, None if options.needed is None else _needed(options.needed, problem))))
        return
    from signorini_fx.machine.csv_text import write_csv

    rows = []
    for kind in options.kind or kinds:
        for number in range(len(kinds[kind]())):
            command = [sys.executable, __file__, "--one", kind, str(number)]
            command += ["--held-out"] if options.held_out else []
            command += ["--needed", str(options.needed)] if options.needed else []
            ended = subprocess.run(command, capture_output=True, text=True, check=True)
            rows.append(json.loads(ended.stdout.splitlines()[-1]))
            print(*rows[-1].values(), sep="  ", flush=True)
    write_csv(options.out, rows + spread(rows))


if __name__ == "__main__":
    main()
