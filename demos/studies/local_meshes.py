"""The largest pressure of bodies from CAD in 3D: smaller cells everywhere, in contact, or where the error is.

    ./env python3 demos/studies/local_meshes.py --out results/local_meshes

Each scene is asked for its largest pressure to 2 % in three ways: by smaller cells everywhere; by facets in contact
that have a `contact_size` to begin with; and with `refinement = "adaptive"`.  The error is that against a reference:
the same with `refinement = "adaptive"` to a fifth of the error; for the ball also Hertz's formula.  Written are
local_meshes.csv and, with pictures, the results of each way.
"""

from __future__ import annotations

import argparse
import math
import resource
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpi4py import MPI
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from signorini_fx import read_scene, solve, write_results
from signorini_fx.machine.csv_text import write_csv
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.scene import Scene

SCENES = Path(__file__).parents[1] / "scenes"
# The length of facets in contact that each scene begins with where all cells are divided from there on.
CONTACT_SIZES = {"lug_and_pin": 2.0, "flange": 5.0, "ball_in_groove": 0.2}
TARGET = 0.02
WAYS = ("all cells smaller", "contact_size", "adaptive")


@dataclass(frozen=True)
class Ellipse:
    """Hertz's contact of two bodies whose gap is (across x^2 + along y^2) / 2, across > along.

    Attributes:
        long: half axis along y, length.
        short: half axis along x, length.
        peak: largest pressure.
    """

    long: float
    short: float
    peak: float

    @classmethod
    def of(cls, force: float, across: float, along: float, modulus: float) -> Ellipse:
        """K. L. Johnson, Contact Mechanics (1985), section 4.2.

        Args:
            force: that presses both together.
            across: the larger relative curvature, 1 / length.
            along: the smaller one, 1 / length.
            modulus: E*, stress.
        """

        def ratio(square: float) -> float:
            k, e = ellipk(square), ellipe(square)
            return float((e / (1 - square) - k) / (k - e))

        square = brentq(lambda m: ratio(m) - across / along, 1e-9, 1 - 1e-12)
        spread = ellipk(square) - ellipe(square)
        long = (3 * force / (math.pi * modulus * square * along) * spread) ** (1 / 3)
        short = long * math.sqrt(1 - square)
        return cls(long, short, 3 * force / (2 * math.pi * long * short))


def hertz() -> Ellipse:
    """The ball in the groove: of 5 mm and 5.5 mm, pressed by 5 MPa on its section."""
    return Ellipse.of(5 * math.pi * 5**2, 1 / 5, 1 / 5 - 1 / 5.5, 210e3 / (2 * (1 - 0.3**2)))


def seconds() -> float:
    """CPU time of this process and of those that it has started and that have ended."""
    return sum(
        usage.ru_utime + usage.ru_stime
        for usage in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def asked(name: str, way: str, target: float, budget: float) -> tuple[Solution, float]:
    """The solution of a scene with its largest pressure asked for, and the CPU seconds that it took.

    Args:
        name: of the scene.
        way: one of ``WAYS``.
        target: relative error.
        budget: seconds.
    """
    scene: Scene = read_scene(SCENES / f"{name}.toml")
    refinement = "adaptive" if way == "adaptive" else "uniform"
    update: dict[str, Any] = {"accuracy": Accuracy(target=target, of="peak", refinement=refinement, seconds=budget)}
    if way == "contact_size":
        update["mesh"] = scene.mesh.model_copy(update={"contact_size": CONTACT_SIZES[name]})
    begin = seconds()
    solution = solve(scene.model_copy(update=update), MPI.COMM_SELF, check=False)
    return solution, seconds() - begin


def largest(solution: Solution) -> float:
    """The largest contact pressure."""
    return float(solution.table.columns["pressure"].max())


def rows_of(name: str, budget: float, pictures: Path | None) -> list[dict[str, object]]:
    """One row for each way, and one for the reference."""
    finest, took = asked(name, "adaptive", TARGET / 5, 3 * budget)
    known = largest(finest)
    rows = [_row(name, "reference", finest, took, known)]
    for way in WAYS:
        solution, took = asked(name, way, TARGET, budget)
        rows.append(_row(name, way, solution, took, known))
        if pictures is not None:
            write_results(solution, pictures / name / way.replace(" ", "_"))
        print(rows[-1], flush=True)
    if name == "ball_in_groove":
        peak = hertz().peak
        rows.append({"scene": name, "way": "Hertz", "peak": f"{peak:.4g}", "true": f"{abs(peak / known - 1):.1e}"})
    return rows


def _row(name: str, way: str, solution: Solution, took: float, known: float) -> dict[str, object]:
    estimate = solution.convergence_table[-2].peak if len(solution.levels) > 1 else None
    peak = largest(solution)
    return {
        "scene": name,
        "way": way,
        "status": solution.status.value,
        "meshes": len(solution.levels),
        "unknowns": solution.levels[-1].dofs,
        "CPU seconds": f"{took:.0f}",
        "peak": f"{peak:.4g}",
        "estimated": "" if estimate is None else f"{estimate:.1e}",
        "true": "" if way == "reference" else f"{abs(peak / known - 1):.1e}",
    }


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/local_meshes"), help="folder (default: %(default)s)")
    parser.add_argument("--scene", choices=CONTACT_SIZES, action="append", help="only this one")
    parser.add_argument("--seconds", type=float, default=300.0, help="for each way (default: %(default)s)")
    parser.add_argument("--pictures", action="store_true", help="write the results of each way, with pictures")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, object]] = []
    for name in options.scene or CONTACT_SIZES:
        rows += rows_of(name, options.seconds, options.out if options.pictures else None)
        columns = list(rows[0])
        write_csv(options.out / "local_meshes.csv", [{key: row.get(key, "") for key in columns} for row in rows])


if __name__ == "__main__":
    main()
