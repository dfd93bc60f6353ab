"""Whether the numbers that ``solve`` prints are within their errors, on problems drawn at random.

    ./env python3 demos/studies/printed_numbers.py --seed 3 --count 30 --out
    docs/evidence/printed_numbers.csv

Each problem is solved on one mesh.  What is exact is told by solutions to a fourth and to a tenth
of its error; a number that these two leave apart by more than a fiftieth has no finite value, or
is not known.  Rows of other seeds in a file stay; those that constants were chosen on say so.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from pathlib import Path
from random import Random
from statistics import median
from typing import Any

import numpy as np
from mpi4py import MPI

from signorini_fx.errors import SignoriniError
from signorini_fx.machine.result_files import write_csv
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.quantities.summary import NO_FINITE_VALUE, PrintedNumber
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

# Of the error of the first mesh, what the two references leave; seconds that each may take.
SHARES, LIMIT = (1 / 4, 1 / 10), 60.0
# References that are apart by more than this share show no exact value; a number that is off by
# more than the second must not be printed without a word.
APART, OFF = 0.02, 0.05


def rectangle(length: float, n: int, cell: str) -> dict[str, Any]:
    """Its mesh, of n cells over its height, which is 1."""
    parameters = {"length": length, "height": 1.0, "nx": round(n * length), "ny": n, "cell": cell}
    return {"generator": "rectangle", "parameters": parameters}


def friction(draw: Random) -> dict[str, Any]:
    """None, Tresca or Coulomb."""
    coulomb = {"law": "coulomb", "coefficient": draw.uniform(0.1, 0.6)}
    tresca = {"law": "tresca", "bound": draw.uniform(0.5, 3.0)}
    return draw.choice(({"law": "none"}, tresca, coulomb, coulomb))


def gap(draw: Random, length: float) -> str:
    """A bowl, waves, a dent or a plane."""
    middle = f"(x[0] - {draw.uniform(0.3, 0.7) * length:.3f})"
    return draw.choice(
        (
            f"{draw.uniform(0.003, 0.03):.4f} * {middle}**2",
            f"{draw.uniform(0.003, 0.03):.4f} * {middle}**2",
            f"{draw.uniform(0.0005, 0.003):.4f} * (1 - cos({draw.uniform(2, 5):.2f} * {middle}))",
            f"{draw.uniform(0.002, 0.01):.4f} * (1 - exp(-({middle} / 0.5)**2))",
            "0",
        )
    )


def plane(draw: Random) -> dict[str, Any]:
    """A block that is pushed or loaded onto a foundation."""
    length = draw.choice((1.0, 2.0, 3.0))
    cell = draw.choice(("quadrilateral", "triangle"))
    sides = [{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}]
    load = {"boundary": "top", "y": -draw.uniform(3, 20)}
    begin = draw.uniform(0, 0.5) * length
    end = begin + draw.uniform(0.2, 0.5) * length
    part = {"boundary": "top", "y": f"-20 if {begin:.2f} <= x[0] <= {end:.2f} else 0"}
    moved = {"boundary": "top", "x": draw.uniform(0, 0.02), "y": -0.015}
    ways = (
        {"displacement": moved},
        {"displacement": sides, "traction": load},
        {"displacement": sides[0], "traction": load | {"x": draw.uniform(0, 2)}},
        {"displacement": sides[0] | {"y": 0.0}, "traction": load},
        {"displacement": sides, "traction": part},
    )
    hypothesis = draw.choice(("plane strain", "plane stress"))
    return {
        "mesh": rectangle(length, draw.randint(5, 14), cell),
        "element": {"degree": draw.choice((1, 1, 2))},
        "material": material(draw, hypothesis),
        "contact": {
            "boundary": "bottom",
            "gap": gap(draw, length),
            "friction": friction(draw),
        },
        **draw.choice(ways),
    }


def material(draw: Random, hypothesis: str) -> dict[str, Any]:
    """A linear one."""
    poisson = draw.choice((0.2, 0.3, 0.4, 0.45))
    return {"young": 1000.0, "poisson": poisson, "hypothesis": hypothesis}


def revolved(draw: Random) -> dict[str, Any]:
    """The same block, of revolution."""
    data = plane(draw)
    moved = {"boundary": "top", "x": 0.0, "y": -0.01}
    loaded = {"traction": {"boundary": "top", "y": -draw.uniform(3, 20)}}
    way = draw.choice(({"displacement": moved}, {"displacement": []} | loaded))
    return {**data, "traction": [], "material": material(draw, "axisymmetric"), **way}


def bodies(draw: Random) -> dict[str, Any]:
    """A body with a crown or edges that is pressed on a wider one, and pushed."""
    cell = draw.choice(("quadrilateral", "triangle"))
    crown = draw.choice((0.0, 0.02, 0.05, 0.1))
    upper = {
        "name": "upper",
        "shift": [0.0, 1.0],
        "mesh": rectangle(1.0, draw.randint(6, 12), cell),
    }
    lower = {
        "name": "lower",
        "shift": [-0.5, 0.0],
        "mesh": rectangle(2.0, draw.randint(6, 12), cell),
    }
    pushed = {"boundary": "upper.top", "x": draw.uniform(0, 0.02), "y": -draw.uniform(0.01, 0.05)}
    return {
        "body": [upper, lower],
        "element": {"degree": draw.choice((1, 2))},
        "material": [
            {"poisson": 0.3, "young": draw.uniform(50, 500), "region": region}
            for region in ("upper", "lower")
        ],
        "displacement": [{"boundary": "lower.bottom", "x": 0.0, "y": 0.0}, pushed],
        "contact": {
            "boundary": "upper.bottom",
            "against": "lower.top",
            "gap": f"{crown:.3f} * (x[0] - 0.5)**2",
            "friction": friction(draw),
        },
    }


def arcs(draw: Random) -> dict[str, Any]:
    """A half disk, of revolution or not, that is pressed onto a plane."""
    radius = draw.uniform(4.0, 10.0)
    sizes = {"size": radius / 8, "contact_size": draw.uniform(0.02, 0.06) * radius}
    parameters = {"radius": radius, "symmetric": True, "contact_zone": 0.2 * radius, **sizes}
    hypothesis = draw.choice(("plane strain", "axisymmetric"))
    sides = [{"boundary": "symmetry", "x": 0.0}]
    pressed = draw.choice(
        (
            {
                "displacement": [
                    *sides,
                    {"boundary": "top", "y": -draw.uniform(0.01, 0.04) * radius},
                ]
            },
            {"displacement": sides, "traction": {"boundary": "top", "y": -draw.uniform(3, 20)}},
        )
    )
    foundation = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    return {
        "mesh": {"generator": "half_disk", "parameters": parameters},
        "element": {"degree": draw.choice((1, 2))},
        "material": material(draw, hypothesis),
        "contact": {"boundary": "arc", "foundation": foundation, "friction": friction(draw)},
        **pressed,
    }


def space(draw: Random) -> dict[str, Any]:
    """A box whose top is moved down and along, on a bowl."""
    n = draw.randint(4, 6)
    bowl = f"{draw.uniform(0.002, 0.02):.4f} * ((x[0] - 1)**2 + (x[1] - 0.4)**2)"
    cell = draw.choice(("tetrahedron", "hexahedron"))
    sizes = {"length": 2.0, "nx": 2 * n, "ny": n, "nz": n, "cell": cell}
    return {
        "mesh": {"generator": "box", "parameters": sizes},
        "material": {"young": 1000.0, "poisson": draw.choice((0.2, 0.3, 0.4))},
        "displacement": {"boundary": "top", "x": draw.uniform(0, 0.01), "y": 0.0, "z": -0.02},
        "contact": {"boundary": "bottom", "gap": bowl, "friction": friction(draw)},
    }


def nonlinear(draw: Random) -> dict[str, Any]:
    """Rubber or metal into which a rigid circle is pressed in two load steps."""
    metal = {"law": "j2", "young": 2e5, "poisson": 0.3, "yield_stress": 300.0, "hardening": 2e3}
    law = draw.choice(
        (
            {"law": "neo-hooke", "young": 3.0, "poisson": draw.choice((0.3, 0.4))},
            {"law": "mooney-rivlin", "c10": 0.3, "c01": 0.1, "bulk": 3.0},
            {"law": "saint-venant-kirchhoff", "young": 1.0, "poisson": 0.3},
            metal,
        )
    )
    depth = draw.uniform(*((0.01, 0.02) if law is metal else (0.08, 0.2)))
    radius = draw.uniform(0.6, 1.2)
    place = {"centre": [draw.uniform(0.8, 1.2), 1 + radius], "shift": [0.0, f"-{depth:.3f}*t"]}
    return {
        "mesh": rectangle(2.0, draw.randint(6, 12), draw.choice(("quadrilateral", "triangle"))),
        "element": {"degree": draw.choice((1, 2))},
        "material": law,
        "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.0},
        "contact": {
            "boundary": "top",
            "foundation": {"shape": "circle", "radius": radius, **place},
            "friction": draw.choice(({"law": "none"}, {"law": "coulomb", "coefficient": 0.3})),
        },
        "load_steps": {"times": [0.5, 1.0]},
    }


KINDS = {
    "plane": plane,
    "rings": revolved,
    "two bodies": bodies,
    "arcs": arcs,
    "space": space,
    "nonlinear": nonlinear,
}
# Of 15 problems one after the other.
ORDER = (
    *("plane", "two bodies", "rings", "plane", "arcs", "nonlinear", "plane", "two bodies"),
    *("rings", "plane", "arcs", "nonlinear", "space", "plane", "nonlinear"),
)


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


def rows_of(kind: str, name: str, data: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """One row for each number."""
    scene = parse_scene(data)
    first = solve(scene, MPI.COMM_SELF)
    error = first.mean_error
    if isinstance(error, str) or not first.numbers:
        return
    shares = SHARES[:1] if kind in ("space", "nonlinear") else SHARES
    goals = [Accuracy(target=max(share * error, 3e-4), seconds=LIMIT) for share in shares]
    finer = [
        solve(scene.model_copy(update={"accuracy": goal}), MPI.COMM_SELF, check=False)
        for goal in goals
    ]
    if not all(one.certified for one in finer):
        return
    size = max(np.linalg.norm(finer[-1].numbers["force"].value), 1e-300)
    exact = [numbers_of(one) for one in finer]
    for key, number in numbers_of(first).items():
        values = [np.array(one[key].value) for one in exact]
        scale = size if key in ("force", "friction") else max(abs(values[-1]), 1e-300)
        off = float(np.linalg.norm(values[-1] - np.array(number.value)) / scale)
        apart = float(np.linalg.norm(values[-1] - values[0]) / scale)
        settled = apart <= APART and len(values) > 1
        settled = settled or (len(values) == 1 and exact[-1][key].error is not None)
        known = number.error is not None
        width = number.error / scale if known else float("nan")
        yield {
            "kind": kind,
            "problem": name,
            "unknowns": first.model.dofs,
            "number": key,
            "printed": str(number),
            "exact": str(exact[-1][key]),
            "settled": "yes" if settled else "no",
            "off": f"{off:.1e}",
            "width": f"{width:.1e}" if known else "",
            "within": ("yes" if off <= width + 1e-9 else "no") if known else "",
        }


def tables(rows: list[dict[str, Any]]) -> Iterator[str]:
    """By number: how many are within, how wide, and off without a word; by kind: within."""
    for held in ("no", "yes"):
        of = [row for row in rows if row["held out"] == held]
        if not of:
            continue
        problems = len({(row["seed"], row["problem"]) for row in of})
        yield f"{problems} problems, {'drawn after' if held == 'yes' else 'before'} the last choice"
        for group, values in (
            ("number", dict.fromkeys(row["number"] for row in of)),
            ("kind", KINDS),
        ):
            for value in values:
                some = [row for row in of if row[group] == value]
                stated = [row for row in some if row["width"] and row["settled"] == "yes"]
                within = sum(row["within"] == "yes" for row in stated)
                ratios = [float(row["width"]) / max(float(row["off"]), 1e-9) for row in stated]
                ratio = f"{median(ratios):.2g}" if ratios else "-"
                silent = [
                    row
                    for row in some
                    if float(row["off"]) > OFF and row["width"] and row["within"] == "no"
                ]
                unknown = sum(not row["width"] and row["settled"] == "yes" for row in some)
                yield (
                    f"  {value:17s} within {within} of {len(stated)}, median width over error "
                    f"{ratio}, not known though it settles {unknown}, off by more than 5 % "
                    f"without a word {len(silent)} of {len(some)}"
                )


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/printed_numbers.csv"))
    parser.add_argument(
        "--seed", type=int, default=3, help="of the problems (default: %(default)s)"
    )
    parser.add_argument("--count", type=int, default=15, help="how many (default: %(default)s)")
    parser.add_argument("--chosen", action="store_true", help="constants were chosen on them")
    options = parser.parse_args()
    rows = []
    if options.out.exists():
        rows = [*csv.DictReader(options.out.open(encoding="utf-8"))]
    rows = [row for row in rows if row["seed"] != str(options.seed)]
    held = "no" if options.chosen else "yes"
    for number in range(options.count):
        kind = ORDER[number % len(ORDER)]
        data = KINDS[kind](Random(1000 * options.seed + number))
        name = f"{kind} {number}"
        try:
            found = [*rows_of(kind, name, data)]
        except SignoriniError as error:  # the others are of use
            print(name, str(error).splitlines()[0], flush=True)
            continue
        for row in found:
            rows.append({"seed": str(options.seed), "held out": held} | row)
            print(*list(row.values())[1:], sep=" | ", flush=True)
        write_csv(options.out, rows)
    print(*tables(rows), sep="\n")


if __name__ == "__main__":
    main()
