"""How well the convergence table foretells the next mesh: predicted and measured time and memory, mesh by mesh.

    ./env python3 demos/studies/prediction.py --out results/prediction

Every scene is solved by nested iteration on more and more meshes, in a process of its own, for memory is the largest
that a process ever had.  The list of the first meshes predicts the next one, which is then solved.  Times are medians
of rounds.  Written are prediction.csv and prediction.md; a ratio beyond 1.5 either way is marked *.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
from pathlib import Path

import accuracy_in_space
from cases import scene_of

# Scene and the sizes of its cells, relative to those of the demo, coarse to fine.
SCENES = {
    "example1_coulomb": (4, 2, 1, 0.5, 0.25),
    "example2_tresca": (4, 2, 1, 0.5, 0.25),
    "hertz": (2, 1, 0.5, 0.25, 0.125),
    **dict.fromkeys(("block, Q1", "block, P1", "block, Coulomb, Q1"), (4, 2, 1, 0.5)),
}
ROUNDS = 3
ENOUGH = 1.5


def levels_of(name: str) -> None:
    """Solve once, and print what each mesh took, and before the first one, as JSON."""
    from mpi4py import MPI
    from effectivity import one_after_the_other

    from signorini_fx.results.accuracy.convergence_table import peak_memory
    from signorini_fx.scenes.hierarchy import scene_on

    scene = accuracy_in_space.SCENES[name]() if name in accuracy_in_space.SCENES else scene_of(name)
    # Forms are compiled, libraries loaded.
    one_after_the_other([scene_on(scene, SCENES[name][0])])
    base = peak_memory(MPI.COMM_SELF)
    found = one_after_the_other([scene_on(scene, factor) for factor in SCENES[name]])
    own = [(s.level.dofs, s.level.linear_solves, s.level.seconds, s.level.memory) for s in found]
    print(json.dumps({"base": base, "levels": own}))


def measured(name: str) -> list[dict]:
    """One row per mesh that could be predicted."""
    from signorini_fx.results.accuracy.convergence_table import Price, predict

    command = [sys.executable, __file__, "--levels-of", name]
    rounds = [
        json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[-1])
        for _ in range(ROUNDS)
    ]
    base = statistics.median(one["base"] for one in rounds)
    nothing = dict.fromkeys(("energy", "pressure", "force", "zone", "peak"))
    prices = []
    for level, same in enumerate(zip(*(one["levels"] for one in rounds), strict=True)):
        seconds, memory = (statistics.median(one[k] for one in same) for k in (2, 3))
        effort = {"h": 1.0, "dofs": same[0][0], "linear_solves": same[0][1], "factorisations": 0}
        left = {"regularisation": 0.0, "iteration": 0.0}
        prices.append(Price(level=level, **effort, seconds=seconds, memory=memory, **nothing, **left))
    rows = []
    for level in range(2, len(prices)):
        dimension = 3 if name in accuracy_in_space.SCENES else 2
        guess, real = predict(prices[:level], base, dimension=dimension), prices[level]
        row = {"scene": name, "level": level, "dofs": real.dofs}
        for quantity in ("seconds", "memory"):
            ours, theirs = getattr(guess, quantity), getattr(real, quantity)
            row |= {f"predicted_{quantity}": ours, quantity: theirs, f"{quantity}_ratio": ours / theirs}
        rows.append(row)
    return rows


def table(rows: list[dict]) -> str:
    """The rows as a table in Markdown."""
    lines = [
        "| scene | mesh | unknowns | s predicted | measured | ratio | MB predicted | measured | ratio |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = [row["scene"], str(row["level"]), str(row["dofs"])]
        for quantity, digits in (("seconds", 2), ("memory", 0)):
            ratio = row[f"{quantity}_ratio"]
            mark = "" if 1 / ENOUGH <= ratio <= ENOUGH else r"\*"
            cells += [f"{row[f'predicted_{quantity}']:.{digits}f}", f"{row[quantity]:.{digits}f}", f"{ratio:.2f}{mark}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/prediction"), help="folder (default: %(default)s)")
    parser.add_argument("--scene", choices=SCENES, action="append", help="only this one")
    parser.add_argument("--levels-of", choices=SCENES, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.levels_of:
        levels_of(options.levels_of)
        return
    from signorini_fx.machine.csv_text import write_csv

    options.out.mkdir(parents=True, exist_ok=True)
    rows = [row for name in options.scene or SCENES for row in measured(name)]
    write_csv(options.out / "prediction.csv", rows)
    text = table(rows)
    (options.out / "prediction.md").write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
