"""Whether an accuracy that is asked for is met in 2D, and at what cost: asked, estimated and true
error, and the price.

    ./env python3 demos/studies/asked_accuracy.py --out docs/evidence/asked_accuracy.csv

Scenes are asked for 10, 1 and 0.1 % of displacement and contact pressure.  True errors are measured
against references of much higher accuracy (see ``effectivity``).  The price is over that of the
cheapest of other ways, on meshes of many sizes, that meet the same target, which is known only
afterwards: by work, which is linear solves times unknowns summed over all meshes, and by seconds of
the processor.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

from mpi4py import MPI

from signorini_fx.errors import SignoriniError
from signorini_fx.machine.result_files import write_csv
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.scenes.solver import solve

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "support"))
from effectivity import reference_of, scene_of
from reference import LIMIT, varied

SCENES = ("example1_tresca", "example1_coulomb", "hertz_degree2", "hertz")
TARGETS = (1e-1, 1e-2, 1e-3)
# What a run may take: linear elements of Hertz would need millions of unknowns for the last digit.
BUDGET = 60.0
# The other ways: uniform meshes of these sizes, relative to those of the scene, by one solve or
# nested, and divided triangles asked for these accuracies.
FACTORS = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25)
ASKED = {"P1": (0.2, 0.1, 0.05, 0.02), "P2": (0.2, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 6e-4)}
ELEMENTS = ("P1", "Q1", "P2", "Q2")
NESTED = {**LIMIT, "levels": 3}
# Runs of fewer seconds are repeated.
REPEATS, LONG = 3, 0.5


def timed(scene: Any) -> tuple[Any, dict[str, float]]:
    """A solution, its work and the least seconds of some repeats."""
    least = float("inf")
    for _ in range(REPEATS):
        begin = time.process_time()
        solution = solve(scene, MPI.COMM_SELF, check=False)
        least = min(least, time.process_time() - begin)
        if least > LONG:
            break
    meshes = [(level.linear_solves, level.dofs) for level in solution.levels]
    meshes = meshes or [(solution.history.linear_solves, solution.model.dofs)]
    return solution, {"work": sum(solves * dofs for solves, dofs in meshes), "seconds": least}


def ways(name: str, *, straight: bool) -> list[tuple[str, Any]]:
    """Other ways and their scenes.

    Triangles that are divided would leave a curved boundary the polygon that it was, and
    quadrilaterals cannot be evaluated at points of the reference that are outside theirs.
    """
    scene, listed = scene_of(name), []
    for element in ELEMENTS if straight else ("P1", "P2"):
        factors = FACTORS[: len(FACTORS) - (element[1] == "2")]
        listed += [(element, varied(scene, factor, element, LIMIT)) for factor in factors]
        if element[0] == "Q":
            listed += [
                (f"{element}, nested", varied(scene, factor, element, NESTED)) for factor in factors
            ]
        elif straight:
            plain = varied(scene, 1.0, element, LIMIT)
            goals = [Accuracy(target=target, refinement="adaptive") for target in ASKED[element]]
            listed += [
                (f"{element}, adaptive", plain.model_copy(update={"accuracy": goal}))
                for goal in goals
            ]
    return listed


def others(name: str, reference: Any, *, straight: bool) -> list[dict[str, Any]]:
    """What other ways reach, and their price."""
    found = []
    for way, scene in ways(name, straight=straight):
        try:
            solution, price = timed(scene)
        except SignoriniError:
            continue
        if solution.converged:
            found.append(
                {"way": f"{way}, {solution.model.dofs}", **price, **reference.errors(solution)}
            )
    return found


def asked(name: str) -> list[dict[str, Any]]:
    """One row for each quantity and target."""
    scene, (reference, _), straight = (
        scene_of(name),
        reference_of(name),
        not name.startswith("hertz"),
    )
    known, rows = others(name if straight else "hertz_degree2", reference, straight=straight), []
    for of in ("energy", "pressure"):
        for target in TARGETS:
            goal = Accuracy(target=target, of=of, seconds=BUDGET)
            solution, price = timed(scene.model_copy(update={"accuracy": goal}))
            true = reference.errors(solution)[of]
            enough = [other for other in known if other[of] is not None and other[of] <= target]
            cheapest = {
                key: min(enough, key=lambda other: other[key], default=None) for key in price
            }
            ratio = {
                key: f"{price[key] / least[key]:.1f}" if least else "-"
                for key, least in cheapest.items()
            }
            estimated = f"{getattr(solution.convergence_table[-2], of):.1e}"
            rows.append(
                {
                    "scene": name,
                    "of": of,
                    "asked": target,
                    "estimated": estimated
                    + ("" if solution.converged else f" ({solution.status.value})"),
                    "true": f"{true:.1e}{'' if true <= target else ' not met'}",
                    "unknowns": solution.model.dofs,
                    "work": f"{price['work']:.1e}",
                    "work ratio": ratio["work"],
                    "seconds": f"{price['seconds']:.2f}",
                    "seconds ratio": ratio["seconds"],
                    "cheapest work": cheapest["work"]["way"]
                    if cheapest["work"]
                    else "none meets it",
                }
            )
            print(*rows[-1].values(), sep=" | ", flush=True)
    return rows


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/asked_accuracy.csv"), help="file")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for name in SCENES:
        rows += asked(name)
        write_csv(options.out, rows)
    met = sum("not met" not in row["true"] for row in rows)
    print(f"met: {met} of {len(rows)}", end="")
    for cost in ("work", "seconds"):
        known = [float(row[f"{cost} ratio"]) for row in rows if row[f"{cost} ratio"] != "-"]
        print(
            f"; at most 3 times the cheapest {cost}: {sum(ratio <= 3 for ratio in known)} of "
            f"{len(known)}",
            end="",
        )
    print()


if __name__ == "__main__":
    main()
