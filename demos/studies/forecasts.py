"""How good the forecasts of the line ``cost`` are: the printed command over what it then took.

    ./env python3 demos/studies/forecasts.py --out docs/evidence/forecasts.csv --picture forecasts.png

Each problem is solved on one mesh, and then with the command that its line has.  Seconds are those of the processor,
without compilation, of two rounds the fewest; errors are estimates, and docs/evidence/effectivity.csv says how good
these are.  The interval score is that of T. Gneiting and A. Raftery, J. Amer. Statist. Assoc. 102 (2007) 359-378, of
logarithms: log(high / low), and 2 / alpha times the logarithm by which the seconds are beyond an end.  The last rows
have the share of problems within the range, its width and score, for those that the ranges were chosen on and others.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from pathlib import Path
from typing import Any

from forecast_problems import Problem, problems

# Share of problems that may be outside of the range, and the seconds after which a run is given up.
ALPHA, LIMIT = 0.15, 20.0


def _seconds(solution: Any) -> float:
    if solution.convergence_table:
        return float(sum(price.seconds for price in solution.convergence_table if not price.predicted))
    return float(sum(solution.timings.total.values()))


def row_of(problem: Problem) -> dict[str, Any]:
    """What was foretold, and what the command took."""
    from mpi4py import MPI

    from signorini_fx import Accuracy, solve

    def solved(**changes: Any) -> Any:
        return min((solve(problem.scene.model_copy(update=changes), MPI.COMM_SELF) for _ in range(2)), key=_seconds)

    solve(problem.scene, MPI.COMM_SELF)  # compiles forms
    cost = solved().cost
    row: dict[str, Any] = {
        "kind": problem.kind,
        "problem": problem.name,
        "chosen on": "yes" if problem.chosen_on else "no",
        "unknowns": cost.dofs,
        "error": f"{cost.error:.2e}",
        "seconds": f"{cost.seconds:.2g}",
        "command": cost.command,
        "cells": "where the error is" if cost.local else "all smaller",
        "foretold, from": f"{cost.next_seconds[0]:.2g}",
        "foretold, to": f"{cost.next_seconds[1]:.2g}",
        "unknowns foretold": f"{cost.next_dofs:.2g}",
    }
    if "does not get there" in str(cost):
        return row | dict.fromkeys(("needed", "unknowns needed", "error reached", "width", "within", "score"), "")
    goal = Accuracy(target=float(cost.command.split()[1]), seconds=LIMIT)
    fine = solved(accuracy=goal)
    low, high = cost.next_seconds
    needed = _seconds(fine) if fine.converged else LIMIT
    miss = max(math.log(low / needed), math.log(needed / high), 0.0)
    return row | {
        "needed": f"{needed:.2g}" if fine.converged else f"above {needed:.2g}",
        "unknowns needed": fine.model.dofs,
        "error reached": f"{fine.convergence_table[-2].energy:.2e}" if fine.convergence_table else "",
        "width": f"{high / low:.2g}",
        "within": "no" if miss else "yes",
        "score": f"{math.log(high / low) + 2 / ALPHA * miss:.2f}",
    }


def summaries(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Coverage, width and score of those that the ranges were chosen on and of others, by how cells become smaller."""
    result = []
    for cells in ("where the error is", "all smaller"):
        for chosen in ("yes", "no"):
            group = [r for r in rows if (r["cells"], r["chosen on"]) == (cells, chosen) and r["within"]]
            if group:
                result.append(
                    dict.fromkeys(rows[0], "")
                    | {
                        "kind": "all",
                        "problem": f"{len(group)} problems",
                        "chosen on": chosen,
                        "cells": cells,
                        "width": f"{statistics.median(float(r['width']) for r in group):.2g}",
                        "within": f"{sum(r['within'] == 'yes' for r in group)} of {len(group)}",
                        "score": f"{statistics.mean(float(r['score']) for r in group):.2f}",
                    }
                )
    return result


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """The range of each problem and what it needed, seconds."""
    import matplotlib.pyplot as plt

    known = sorted((r for r in rows if r["within"]), key=lambda r: float(r["foretold, from"]))
    figure, axes = plt.subplots(figsize=(6.4, 0.17 * len(known) + 1))
    for k, row in enumerate(known):
        local = row["cells"] == "where the error is"
        ends = [float(row["foretold, from"]), float(row["foretold, to"])]
        axes.plot(ends, [k, k], color="C0" if local else "C1", linewidth=4, alpha=0.4)
        needed = float(row["needed"].removeprefix("above "))
        axes.plot(needed, k, "k>" if row["needed"].startswith("above") else "k.", markersize=4)
    axes.set_yticks(range(len(known)), [f"{r['problem']} ({r['unknowns']})" for r in known], fontsize=5)
    axes.set(xscale="log", xlabel="seconds of the printed command; blue: cells divided where the error is")
    figure.savefig(path, dpi=150, bbox_inches="tight")


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/forecasts.csv"), help="file (default: %(default)s)")
    parser.add_argument("--kind", action="append", help="only these")
    parser.add_argument("--picture", type=Path, help="file")
    options = parser.parse_args()
    from signorini_fx.machine.csv_text import write_csv

    time.perf_counter = time.process_time  # other programs take no part of it
    rows = []
    for problem in problems():
        if options.kind and problem.kind not in options.kind:
            continue
        try:
            rows.append(row_of(problem))
        except Exception as error:  # the others are of use
            print(problem.name, repr(error), flush=True)
            continue
        print(*rows[-1].values(), sep="  ", flush=True)
        write_csv(options.out, rows + summaries(rows))
    if options.picture:
        draw(rows, options.picture)


if __name__ == "__main__":
    main()
