"""Whether an accuracy that is asked for is met, and at what cost: asked, estimated and true error, and the price.

    ./env python3 demos/studies/asked_accuracy.py --out results/asked_accuracy

Every scene is asked for 10, 1 and 0.1 % of displacement and contact pressure, as by ``signorini-fx solve --accuracy``.
True errors are measured against references of much higher accuracy (see ``cases``).  The price is compared with the
cheapest run of the work-precision study's methods that meets the same target, known only afterwards: by work, which is
linear solves times unknowns summed over all meshes, and by processor seconds, which depend on the machine.
Written are asked_accuracy.csv and asked_accuracy.md.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from cases import reference_of, scene_of
from mpi4py import MPI

from signorini_fx.errors import SignoriniError
from signorini_fx.io import write_csv
from signorini_fx.reference import on_mesh
from signorini_fx.scene import Accuracy
from signorini_fx.solver import solve
from signorini_fx.work_precision import methods, work_of

SCENES = ("example1_tresca", "example1_coulomb", "hertz_degree2", "hertz")
TARGETS = (1e-1, 1e-2, 1e-3)
QUANTITIES = ("energy", "pressure")
# What a run may take: linear elements of Hertz would need millions of unknowns for the last digit.
BUDGET = {"seconds": 60.0, "memory": 4.0}
# Sizes of the cells of the rivals, relative to those of the scene, and accuracies that adaptive ones are asked for.
FACTORS = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25)
ASKED = (0.2, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 5e-4)
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


def rivals(scene, reference, *, straight: bool) -> list[dict]:
    """The work-precision study's methods on all meshes, each with its errors and its price.

    Triangles that are divided would leave a curved boundary the polygon that it was.
    """
    found = []
    for method in methods(scene):
        if not FAMILIES & set(method.families) or (method.adaptive and not straight):
            continue
        plain = on_mesh(scene, 1.0, method.element, {**method.settings})
        factors = FACTORS[: len(FACTORS) - (method.degree == 2)]
        sizes = [on_mesh(scene, factor, method.element, {**method.settings}) for factor in factors]
        if method.adaptive:
            goals = [Accuracy(target=target, of="energy", refinement="adaptive") for target in ASKED]
            sizes = [plain.model_copy(update={"accuracy": goal}) for goal in goals]
        for one in sizes:
            try:
                solution, seconds = timed(one)
            except SignoriniError:
                continue
            if solution.converged:
                price = {"work": work_of(solution), "seconds": seconds, "dofs": solution.discretisation.dofs}
                found.append({"method": method.name, **price, **reference.errors(solution)})
    return found


def asked(name: str) -> list[dict]:
    """One row for each quantity and target."""
    scene, (reference, own) = scene_of(name), reference_of(name)
    others = [] if name == "hertz" else rivals(scene, reference, straight=not name.startswith("hertz"))
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
                "estimated": getattr(solution.price_list[-2], of),
                "true": true,
                "reference_error": own[of],
                "status": solution.status.value,
                "met": true <= target,
                "meshes": len(solution.levels),
                "dofs": solution.discretisation.dofs,
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


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--out", type=Path, default=Path("results/asked_accuracy"), help="folder (default: %(default)s)"
    )
    parser.add_argument("--scene", choices=SCENES, action="append", help="only this one")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in options.scene or SCENES:
        begin = time.perf_counter()
        rows += asked(name)
        print(f"{name}: {time.perf_counter() - begin:.1f} s", flush=True)
    write_csv(options.out / "asked_accuracy.csv", rows)
    text = table(rows)
    (options.out / "asked_accuracy.md").write_text(text + "\n", encoding="utf-8")
    print(text)
    met = sum(row["met"] for row in rows)
    print(f"\nmet: {met} of {len(rows)}", end="")
    for cost in ("work", "seconds"):
        known = [row[f"{cost}_ratio"] for row in rows if row[f"{cost}_ratio"] is not None and row["met"]]
        print(f"; at most 3 times the cheapest {cost}: {sum(r <= 3 for r in known)} of {len(known)}", end="")
    print()


if __name__ == "__main__":
    main()
