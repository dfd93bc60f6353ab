"""How good the estimates of the price list are: estimated over true error, mesh by mesh.

    ./env python3 demos/studies/effectivity.py --out results/effectivity

True errors are measured against a solution without regularisation on a much finer mesh (see
``signorini_fx.work_precision.Reference``); how far that may be wrong itself is estimated from two on cells two and four
times as large.  A ratio between 1/2 and 2 is good, above 1 it is on the safe side; * marks what is outside [1/2, 2], ~
a true error that is less than three times the reference's own.  Written are effectivity.csv and effectivity.md.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from mpi4py import MPI

from signorini_fx.io import write_csv
from signorini_fx.nested import scene_on
from signorini_fx.scene import read_scene
from signorini_fx.solver import solve
from signorini_fx.work_precision import Reference, on_mesh, reference_errors

SCENES = Path(__file__).parent.parent / "scenes"
# Scene, how much finer than it the finest mesh is, element of the reference, how much finer than the scene.
CASES = {
    "example1_tresca": (0.5, "Q2", 1 / 6),
    "example1_coulomb": (0.5, "Q2", 1 / 6),
    "hertz": (0.5, "P1", 1 / 12),
}
COLUMNS = ("energy", "pressure", "peak", "zone")
LEVELS = 5
EXACT = {"algorithm": "exact"}


def effectivities(name: str) -> list[dict]:
    """One row a mesh and a quantity."""
    finest, element, fine = CASES[name]
    scene = read_scene(SCENES / f"{name}.toml")
    begin = time.perf_counter()
    reference = Reference(solve(on_mesh(scene, fine, element, EXACT), MPI.COMM_SELF))
    own = reference_errors(
        *(reference.errors(solve(on_mesh(scene, k * fine, element, EXACT), MPI.COMM_SELF)) for k in (2, 4))
    )
    nested = scene_on(scene, finest)
    nested = nested.model_copy(update={"solver": scene.solver.model_copy(update={"levels": LEVELS})})
    solution = solve(nested, MPI.COMM_SELF)
    rows = []
    for level, price in zip(solution.levels[1:], solution.price_list[1:], strict=False):
        # The level itself is gone but for its contact boundary: solve its mesh again, to measure the displacement.
        factor = finest * 2 ** (LEVELS - 1 - level.level)
        same = solve(scene_on(scene, factor), MPI.COMM_SELF)
        true = reference.errors(same)
        for column in COLUMNS:
            estimated = getattr(price, column)
            known = estimated is not None and bool(true[column])
            rows.append(
                {
                    "scene": name,
                    "level": level.level,
                    "h": level.h,
                    "dofs": level.dofs,
                    "quantity": column,
                    "estimated": estimated,
                    "true": true[column],
                    "effectivity": estimated / true[column] if known else None,
                    "reference_error": own[column],
                    "doubtful": bool(known and true[column] < 3 * (own[column] or 0.0)),
                }
            )
    print(f"{name}: {time.perf_counter() - begin:.1f} s", flush=True)
    return rows


def table(rows: list[dict]) -> str:
    """The ratios as a table in Markdown."""
    lines = ["| scene | mesh | h | " + " | ".join(COLUMNS) + " |", "|---|---|---|" + "---|" * len(COLUMNS)]
    for name in dict.fromkeys(row["scene"] for row in rows):
        for level in sorted({row["level"] for row in rows if row["scene"] == name}):
            own = {row["quantity"]: row for row in rows if (row["scene"], row["level"]) == (name, level)}
            cells = [_cell(own[column]) for column in COLUMNS]
            lines.append(f"| {name} | {level} | {own['energy']['h']:.3g} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _cell(row: dict) -> str:
    """A ratio and the true error, with the marks of the head of this file."""
    value = row["effectivity"]
    if value is None:
        return "-"
    mark = "" if 0.5 <= value <= 2 else r"\*"
    return f"{value:.2f}{mark}{'~' if row['doubtful'] else ''} ({row['true']:.0e})"


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/effectivity"), help="folder (default: %(default)s)")
    parser.add_argument("--scene", choices=CASES, action="append", help="only this one")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = [row for name in options.scene or CASES for row in effectivities(name)]
    write_csv(options.out / "effectivity.csv", rows)
    text = table(rows)
    (options.out / "effectivity.md").write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
