"""Whether the numbers that ``solve`` prints are within their errors, and the seconds of the line
``cost`` within their forecast, on eighty problems drawn at random.

    ./env python3 demos/studies/printed_numbers.py --out docs/evidence --picture docs/images

Each problem is solved on one mesh, to a fourth of its error, and with the command that its line
``cost`` has.  The finer ones tell what is exact; a number that these two leave apart by more than
a fiftieth has no finite value, or is not known.  In 3D the command asks for a third only, and what
is exact is told by one mesh.  Seconds are those of the processor, forms compiled: of a second
solve, and of the faster one of two runs of the command.  The score is
that of T. Gneiting and A. Raftery, J. Amer. Statist. Assoc. 102 (2007) 359-378, of logarithms:
log(high / low), and 2 / alpha times the logarithm of the way beyond an end.  Half of the problems
are drawn after the last choice of rules.  Rows of problems that are left out stay.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Callable, Iterator
from math import log
from pathlib import Path
from statistics import mean, median
from typing import Any

import numpy as np
from drawn_problems import COUNT, Problem, drawn, held_out
from matplotlib.figure import Figure

import signorini_fx as sfx
from signorini_fx.machine.result_files import write_csv
from signorini_fx.quantities.summary import NO_FINITE_VALUE, PrintedNumber

# Of the error of the first mesh, what the first reference leaves; seconds that each may take.
SHARE, LIMIT = 1 / 4, 15.0
# References that are apart by more than this share show no exact value; a number that is off by
# more than the second must not be printed without a word.
APART, OFF = 0.02, 0.05
# Errors of friction are told beside these.
LARGER = {"friction": "force", "friction moment": "contact moment"}
# Share of forecasts that may be wrong.
ALPHA = 0.15

Row = dict[str, Any]


def numbers_of(solution: Any) -> dict[str, PrintedNumber]:
    """Those of the contact, and the largest von Mises stress."""
    stress = solution.stress.as_dict()
    rows = [stress["von_mises"], (stress["recovered"] or stress)["von_mises"]]
    largest = max(rows, key=lambda row: float(row["value"]))
    why = largest.get("no_limit")
    number = PrintedNumber(
        value=largest["value"],
        error=None if why else largest.get("error"),
        why=f"{NO_FINITE_VALUE}{why}" if why else None,
    )
    return {**solution.numbers, "von Mises": number}


def compared(problem: Problem, first: Any, finer: list[Any]) -> Iterator[Row]:
    """One row for each number."""
    exact = [numbers_of(one) for one in finer]
    for key, number in numbers_of(first).items():
        values = [np.array(one[key].value) for one in exact]
        whole = exact[-1][LARGER.get(key, key)].value
        scale = max(float(np.linalg.norm(whole)), 1e-300)
        off = float(np.linalg.norm(values[-1] - np.array(number.value)) / scale)
        apart = float(np.linalg.norm(values[-1] - values[0]) / scale)
        settled = apart <= APART if len(values) > 1 else exact[-1][key].error is not None
        settled = settled and not (exact[-1][key].why or "").startswith(NO_FINITE_VALUE)
        known = number.error is not None
        width = number.error / scale if known else float("nan")
        yield {
            "kind": problem.kind,
            "problem": problem.name,
            "unknowns": first.model.dofs,
            "number": key,
            "printed": str(number),
            "exact": str(exact[-1][key]),
            "settled": "yes" if settled else "no",
            "off": f"{off:.1e}",
            "width": f"{width:.1e}" if known else "",
            "within": ("yes" if off <= width + 1e-9 else "no") if known else "",
        }


def seconds_of(solution: Any) -> float:
    """What the meshes took together."""
    prices = [price.seconds for price in solution.convergence_table if not price.predicted]
    return float(sum(prices or solution.timings.seconds.values()))


def priced(problem: Problem, cost: Any, found: Any) -> Row:
    """What was foretold, and what the command took."""
    (low, high), needed = cost.next_seconds, seconds_of(found)
    miss = max(log(low / needed), log(needed / high), 0.0)
    return {
        "kind": problem.kind,
        "problem": problem.name,
        "unknowns": cost.dofs,
        "error": f"{cost.error:.2e}",
        "seconds": f"{cost.seconds:.2g}",
        "command": cost.command,
        "cells": "where the error is" if cost.local else "all smaller",
        "foretold, from": f"{low:.2g}",
        "foretold, to": f"{high:.2g}",
        "unknowns foretold": f"{cost.next_dofs:.2g}",
        "needed": f"{'' if found.converged else 'above '}{needed:.2g}",
        "unknowns needed": found.model.dofs,
        "within": "no" if miss or not found.converged else "yes",
        "width": f"{high / low:.2g}",
        "score": f"{log(high / low) + 2 / ALPHA * miss:.2f}",
    }


def goal_of(cost: Any) -> sfx.Accuracy:
    """What the command of a line ``cost`` asks for."""
    words = cost.command.split()
    if words[0] == "--accuracy":
        return sfx.Accuracy(target=words[1], seconds=LIMIT)
    goal: sfx.Accuracy = eval(cost.command, {"Accuracy": sfx.Accuracy})
    return goal.model_copy(update={"seconds": LIMIT})


def measured(problem: Problem) -> tuple[list[Row], list[Row]]:
    """The rows of the numbers of a problem, and that of its price."""
    problem.first()  # compiles forms
    first = problem.first()
    cost = first.cost
    if isinstance(cost, str) or not cost.command:
        print(problem.name, cost, flush=True)
        return [], []
    target = max(SHARE * cost.error, 3e-4)
    finer = [problem.to_accuracy(sfx.Accuracy(target=target, seconds=LIMIT))]
    tries = [problem.to_accuracy(goal_of(cost)) for _ in range(2)]
    finer.append(min(tries, key=seconds_of))
    price = [priced(problem, cost, finer[-1])]
    if first.model.tagged.dimension == 3:
        finer = finer[:1]
    exact = [one for one in finer if one.certified and one.numbers]
    return [*compared(problem, first, exact)] if first.numbers and exact else [], price


# --- tables and picture ---------------------------------------------------------------------------


def groups(rows: list[Row], key: str) -> Iterator[tuple[str, str, list[Row]]]:
    """All rows by a column, those drawn before the last choice and after it."""
    for half, text in (("no", "before"), ("yes", "after")):
        of = [row for row in rows if row["held out"] == half]
        for value in dict.fromkeys(row[key] for row in of):
            yield text, value, [row for row in of if row[key] == value]
        yield text, "all", of


def tables(numbers: list[Row], prices: list[Row]) -> Iterator[str]:
    """How many are within, how wide, not known, and off without a word; and the same of prices."""
    for key in ("number", "kind"):
        for text, value, some in groups(numbers, key):
            settle = [row for row in some if row["settled"] == "yes"]
            stated = [row for row in settle if row["width"]]
            within = sum(row["within"] == "yes" for row in stated)
            # Some forces are known from the loads, without an error.
            wide = [row for row in stated if float(row["width"]) > 0]
            ratios = [float(row["width"]) / max(float(row["off"]), 1e-9) for row in wide]
            silent = [
                row
                for row in some
                if float(row["off"]) > OFF and row["width"] and row["within"] == "no"
            ]
            yield (
                f"{text:6s} {value:17s} within {within} of {len(stated)}, median width over error "
                f"{median(ratios) if ratios else 0:.2g}, not known of those that settle "
                f"{len(settle) - len(stated)} of {len(settle)}, off by more than 5 % without a "
                f"word {len(silent)} of {len(some)}"
            )
    for text, value, some in groups(prices, "kind"):
        if some:
            within = sum(row["within"] == "yes" for row in some)
            widths, scores = ([float(row[one]) for row in some] for one in ("width", "score"))
            yield (
                f"{text:6s} price, {value:17s} within {within} of {len(some)}, width "
                f"{median(widths):.2g}, score {mean(scores):.2f}"
            )


def draw(numbers: list[Row], prices: list[Row], folder: Path) -> None:
    """True errors over the stated ones by quantity, and seconds over their forecast by kind."""
    figure = Figure((9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    stated = [row for row in numbers if row["width"] and row["settled"] == "yes"]
    shares: list[Callable[[Row], float]] = [
        lambda row: max(float(row["off"]) / max(float(row["width"]), 1e-12), 3e-3),
        lambda row: (
            float(row["needed"].split()[-1])
            / (float(row["foretold, from"]) * float(row["foretold, to"])) ** 0.5
        ),
    ]
    for axes, rows, key, share in zip(
        (left, right), (stated, prices), ("number", "kind"), shares, strict=True
    ):
        names = [*dict.fromkeys(row[key] for row in rows)]
        for k, name in enumerate(names):
            some = [row for row in rows if row[key] == name]
            at = k + np.linspace(-0.35, 0.35, len(some)) if len(some) > 1 else np.array([k])
            for place, row in zip(at, some, strict=True):
                colour = "tab:blue" if row["within"] == "yes" else "tab:red"
                filled = colour if row["held out"] == "yes" else "none"
                axes.plot(place, share(row), "o", color=colour, mfc=filled, markersize=3.0)
                if axes is right:
                    half = (float(row["foretold, to"]) / float(row["foretold, from"])) ** 0.5
                    axes.vlines(place, 1 / half, half, color="0.85", linewidth=1.5, zorder=0)
        axes.axhline(1.0, color="0.5", linewidth=0.6)
        axes.set(yscale="log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("")
        axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    left.set_ylabel("true error over the stated one")
    right.set_ylabel("seconds over the middle of the forecast")
    left.set_title("filled: drawn after the last choice", fontsize=9)
    figure.savefig(folder / "printed_numbers.png", dpi=120)


def read(file: Path) -> dict[str, list[Row]]:
    """The rows of a table by problem."""
    found: dict[str, list[Row]] = {}
    for row in csv.DictReader(file.open(encoding="utf-8")) if file.exists() else []:
        found.setdefault(row["problem"], []).append(row)
    return found


def main() -> None:
    """Measure, print, write and draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results"), help="folder of the tables")
    parser.add_argument("--picture", type=Path, default=Path("results"), help="its folder")
    parser.add_argument("--begin", type=int, default=0, help="the first problem")
    parser.add_argument("--end", type=int, default=COUNT, help="the one after the last")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    time.perf_counter = time.process_time  # other programs take no part of it
    files = [options.out / name for name in ("printed_numbers.csv", "forecasts.csv")]
    kept = [read(file) for file in files]
    for number in range(options.begin, options.end):
        problem = drawn(number)
        try:
            found = measured(problem)
        except sfx.SignoriniError as error:  # the others are of use
            print("skipped", problem.name, str(error).splitlines()[0], flush=True)
            continue
        held = {"held out": "yes" if held_out(number) else "no"}
        for file, rows, new in zip(files, kept, found, strict=True):
            rows[problem.name] = [held | row for row in new]
            ordered = sorted(rows, key=lambda name: int(name.split()[-1]))
            if lines := [row for name in ordered for row in rows[name]]:
                write_csv(file, lines)
        print(problem.name, f"{time.process_time():.0f} s so far", flush=True)
    numbers, prices = ([row for some in rows.values() for row in some] for rows in kept)
    print(*tables(numbers, prices), sep="\n")
    draw(numbers, prices, options.picture)


if __name__ == "__main__":
    main()
