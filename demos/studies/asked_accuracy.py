"""Whether an accuracy that is asked for is met, and at what cost: asked, estimated and true error, and the price.

    ./env python3 demos/studies/asked_accuracy.py --out results/asked_accuracy

Every scene is asked for 10, 1 and 0.1 % of displacement and contact pressure, as by ``signorini-fx solve --accuracy``.
True errors are measured against references of much higher accuracy (see ``cases``).  The price is compared with the
cheapest run of the methods of ``methods`` that meets the same target, known only afterwards: by work, which is
linear solves times unknowns summed over all meshes, and by processor seconds, which depend on the machine.
Written are asked_accuracy.csv and asked_accuracy.md.

    ./env python3 demos/studies/asked_accuracy.py --random 25 --seed 1 --out results/asked_random

asks random scenes (see ``random_scenes``), most of them with contact up to corners, for 10, 5, 2 and 1 % of
displacement, pressure and force, against references that resolve the corners.  Written are random.csv and random.md.
"""

from __future__ import annotations

import argparse
import time
from functools import cache
from pathlib import Path

import numpy as np
import random_scenes
from mpi4py import MPI
from cases import on_mesh, reference_of, scene_of
from methods import methods, work_of

from signorini_fx.errors import SignoriniError
from signorini_fx.machine.csv_text import write_csv
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.scenes.solver import solve

SCENES = ("example1_tresca", "example1_coulomb", "hertz_degree2", "hertz")
TARGETS = (1e-1, 1e-2, 1e-3)
QUANTITIES = ("energy", "pressure")
# What a run may take: linear elements of Hertz would need millions of unknowns for the last digit.
BUDGET = {"seconds": 60.0}
# Sizes of the cells of the rivals, relative to those of the scene, and accuracies that adaptive ones are asked for.
FACTORS = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25)
ASKED = {"P1": (0.2, 0.1, 0.05, 0.02), "P2": (0.2, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 6e-4)}
# Of the study's methods those on different elements and meshes; gamma and the algorithm hardly change the accuracy.
FAMILIES = {"element", "meshes"}
# Runs of fewer processor seconds are repeated.
REPEATS, LONG = 3, 0.5


def timed(scene) -> tuple:
    """A solution and its processor seconds, the least of some repeats."""
    least = float("inf")
    for _ in range(REPEATS):
        begin = time.process_time()
        solution = solve(scene, MPI.COMM_SELF, check=False)
        least = min(least, time.process_time() - begin)
        if least > LONG:
            break
    return solution, least


@cache
def rivals(name: str, reference) -> list[dict]:
    """The methods on all meshes, each with its errors and its price.

    Triangles that are divided would leave a curved boundary the polygon that it was, and quadrilaterals cannot be
    evaluated at points of the reference that are outside theirs.
    """
    found, scene, straight = [], scene_of(name), not name.startswith("hertz")
    for method in methods(scene.statement):
        if not FAMILIES & set(method.families) or (not straight and (method.adaptive or method.element[0] == "Q")):
            continue
        plain = on_mesh(scene, 1.0, method.element, {**method.settings})
        factors = FACTORS[: len(FACTORS) - (method.degree == 2)]
        sizes = [on_mesh(scene, factor, method.element, {**method.settings}) for factor in factors]
        if method.adaptive:
            goals = [Accuracy(target=target, of="energy", refinement="adaptive") for target in ASKED[method.element]]
            sizes = [plain.model_copy(update={"accuracy": goal}) for goal in goals]
        for one in sizes:
            try:
                solution, seconds = timed(one)
            except SignoriniError:
                continue
            if solution.converged:
                price = {"work": work_of(solution), "seconds": seconds, "dofs": solution.model.dofs}
                found.append({"method": method.name, **price, **reference.errors(solution)})
    return found


def asked(name: str) -> list[dict]:
    """One row for each quantity and target."""
    scene, (reference, own) = scene_of(name), reference_of(name)
    others = rivals("hertz_degree2" if name.startswith("hertz") else name, reference)
    rows = []
    for of in QUANTITIES:
        for target in TARGETS:
            goal = Accuracy(target=target, of=of, **BUDGET)
            solution, seconds = timed(scene.model_copy(update={"accuracy": goal}))
            true = reference.errors(solution)[of]
            price = {"work": work_of(solution), "seconds": seconds}
            enough = [other for other in others if other[of] is not None and other[of] <= target]
            row = {
                "scene": name,
                "of": of,
                "asked": target,
                "estimated": getattr(solution.convergence_table[-2], of),
                "true": true,
                "reference_error": own[of],
                "status": solution.status.value,
                "met": true <= target,
                "meshes": len(solution.levels),
                "dofs": solution.model.dofs,
                **price,
            }
            for cost in price:
                cheapest = min(enough, key=lambda other: other[cost], default=None)
                row[f"cheapest_by_{cost}"] = None if cheapest is None else f"{cheapest['method']}, {cheapest['dofs']}"
                row[f"{cost}_ratio"] = None if cheapest is None else price[cost] / cheapest[cost]
            rows.append(row)
    return rows


COLUMNS = (
    "scene",
    "of",
    "asked",
    "estimated",
    "true",
    "unknowns",
    "work",
    "ratio",
    "seconds",
    "ratio",
    "cheapest work",
)


def table(rows: list[dict]) -> str:
    """The rows as a table in Markdown."""
    lines = [f"| {' | '.join(COLUMNS)} |", "|" + "---|" * len(COLUMNS)]
    for row in rows:
        outcome = "" if row["status"] == "converged" else f" ({row['status']})"
        cells = [
            row["scene"],
            row["of"],
            f"{row['asked']:g}",
            f"{row['estimated']:.1e}{outcome}",
            f"{row['true']:.1e}{'' if row['met'] else ' (not met)'}",
            f"{row['dofs']}",
            f"{row['work']:.1e}",
            _ratio(row["work_ratio"]),
            f"{row['seconds']:.2f}",
            _ratio(row["seconds_ratio"]),
            row["cheapest_by_work"] or "none meets it",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _ratio(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


RANDOM_TARGETS = (0.1, 0.05, 0.02, 0.01)
# A run that takes longer ends by name.
RANDOM_BUDGET = {"seconds": 60.0}


def asked_of(one: random_scenes.RandomScene) -> list[dict]:
    """One row for each quantity and target of a random scene."""
    fine, own = random_scenes.reference(one)
    others = random_scenes.rivals(one, fine)
    rows = []
    for of in random_scenes.QUANTITIES:
        for target in RANDOM_TARGETS:
            scene = one.scene.model_copy(update={"accuracy": Accuracy(target=target, of=of, **RANDOM_BUDGET)})
            begin = time.process_time()
            solution = solve(scene, MPI.COMM_SELF, check=False)
            seconds = time.process_time() - begin
            true, prices = fine.errors(solution)[of], {"work": work_of(solution), "seconds": seconds}
            estimated = getattr(solution.convergence_table[-2], of) if len(solution.levels) > 1 else None
            row = {
                "scene": one.name,
                "traits": ", ".join(one.traits),
                "of": of,
                "asked": target,
                "status": solution.status.value,
                "true": true,
                "estimated": estimated,
                "effectivity": estimated / true if estimated is not None and true > 3 * own[of] > 0 else None,
                "reference_error": own[of],
                "met": true <= target,
                "meshes": len(solution.levels),
                "dofs": solution.model.dofs,
            }
            for cost, price in prices.items():
                enough = [other for other in others if other[of] is not None and other[of] <= target]
                cheapest = min(enough, key=lambda other: other[cost], default=None)
                row[cost] = price
                row[f"cheapest_by_{cost}"] = cheapest and cheapest["method"]
                row[f"{cost}_ratio"] = cheapest and price / cheapest[cost]
            rows.append(row)
    return rows


def random_table(rows: list[dict]) -> str:
    """A line for each scene and quantity: true error and, in multiples of the cheapest, the work."""
    head = [f"{100 * target:g} %" for target in RANDOM_TARGETS]
    lines = [f"| scene | of | {' | '.join(head)} |", "|" + "---|" * (2 + len(head))]
    for name, of in dict.fromkeys((row["scene"], row["of"]) for row in rows):
        own = [row for row in rows if (row["scene"], row["of"]) == (name, of)]
        cells = []
        for row in own:
            how = "" if row["status"] == "converged" else f" ({row['status']})"
            how += " **not met**" if row["status"] == "converged" and not row["met"] else ""
            cells.append(f"{100 * row['true']:.2g} %{how}, {_ratio(row['work_ratio'])}")
        label = f"{name}: {own[0]['traits']}" if of == random_scenes.QUANTITIES[0] else ""
        lines.append(f"| {label} | {of} | {' | '.join(cells)} |")
    return "\n".join(lines)


def random_summary(rows: list[dict]) -> str:
    """How many have met their target, at what cost, and how good the estimates were."""
    converged = [row for row in rows if row["status"] == "converged"]
    lines = [
        f"- {len(converged)} of {len(rows)} converged; of these {sum(row['met'] for row in converged)} have met it"
    ]
    for cost in ("work", "seconds"):
        known = [row[f"{cost}_ratio"] for row in converged if row[f"{cost}_ratio"] is not None]
        per = {of: _median(converged, cost, of) for of in random_scenes.QUANTITIES}
        words = ", ".join(f"{of} {ratio:.1f}" for of, ratio in per.items())
        lines.append(f"- {cost}: median {np.median(known):.1f} times the cheapest ({words})")
    for of in random_scenes.QUANTITIES:
        seen = [row["effectivity"] for row in rows if row["of"] == of and row["effectivity"] is not None]
        lines.append(f"- effectivity, {of}: {min(seen):.2f} to {max(seen):.2g}, median {np.median(seen):.2g}")
    return "\n".join(lines)


def _median(rows: list[dict], cost: str, of: str) -> float:
    known = [row[f"{cost}_ratio"] for row in rows if row["of"] == of and row[f"{cost}_ratio"] is not None]
    return float(np.median(known))


def ask_random(count: int, seed: int, out: Path) -> None:
    """Ask so many random scenes, print and write."""
    rows = []
    for one in random_scenes.scenes(seed, count):
        begin = time.perf_counter()
        own = asked_of(one)
        rows += own
        missed = [f"{row['of']} {row['asked']:g}" for row in own if row["status"] == "converged" and not row["met"]]
        words = f"; missed: {', '.join(missed)}" if missed else ""
        print(f"{one.name} ({', '.join(one.traits)}): {time.perf_counter() - begin:.1f} s{words}", flush=True)
        write_csv(out / "random.csv", rows)
        text = f"{random_table(rows)}\n\n{random_summary(rows)}\n"
        (out / "random.md").write_text(text, encoding="utf-8")
    print(text)


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--out", type=Path, default=Path("results/asked_accuracy"), help="folder (default: %(default)s)"
    )
    parser.add_argument("--scene", choices=SCENES, action="append", help="only this one")
    parser.add_argument("--random", type=int, default=0, help="so many random scenes instead")
    parser.add_argument("--seed", type=int, default=1, help="of the random scenes (default: %(default)s)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.random:
        ask_random(options.random, options.seed, options.out)
        return
    rows = []
    for name in options.scene or SCENES:
        begin = time.perf_counter()
        rows += asked(name)
        print(f"{name}: {time.perf_counter() - begin:.1f} s", flush=True)
        write_csv(options.out / "asked_accuracy.csv", rows)
        (options.out / "asked_accuracy.md").write_text(table(rows) + "\n", encoding="utf-8")
    print(table(rows))
    met = sum(row["met"] for row in rows)
    print(f"\nmet: {met} of {len(rows)}", end="")
    for cost in ("work", "seconds"):
        known = [row[f"{cost}_ratio"] for row in rows if row[f"{cost}_ratio"] is not None and row["met"]]
        print(f"; at most 3 times the cheapest {cost}: {sum(r <= 3 for r in known)} of {len(known)}", end="")
    print()


if __name__ == "__main__":
    main()
