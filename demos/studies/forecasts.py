"""How good the forecasts of the line ``cost`` are: seconds that the printed command was said to
take, and took.

    ./env python3 demos/studies/forecasts.py --seed 31 --out docs/evidence/forecasts.csv [--draw
    FILE]

Problems drawn at random are solved on one mesh, and with the command that their line has.  Seconds
are those of the processor, forms compiled, the fewer of two runs; errors are estimates.  Other rows
of a file stay.  The score is that of T. Gneiting and A. Raftery, J. Amer. Statist. Assoc. 102
(2007) 359-378, of logarithms: log(high / low), and 2 / alpha times the logarithm of the way beyond
an end.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Callable, Iterator
from datetime import date
from functools import partial
from itertools import pairwise
from math import log
from pathlib import Path
from random import Random
from statistics import mean, median
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem
from dolfinx import mesh as dmesh
from matplotlib.figure import Figure

import signorini_fx as sfx
from signorini_fx.machine.result_files import write_csv
from signorini_fx.scenes.reading import parse_scene

# Share of problems that may be outside of the interval; seconds after which a run is given up, and
# is not repeated.
ALPHA, LIMIT, LONG = 0.15, 60.0, 3.0
TRIANGLE, QUADRILATERAL, TETRAHEDRON, HEXAHEDRON = (
    "triangle",
    "quadrilateral",
    "tetrahedron",
    "hexahedron",
)
# Kind, name, the solve on the first mesh, and that to an accuracy.
Problem = tuple[str, str, Callable[[], Any], Callable[[sfx.Accuracy], Any]]


def of_scene(kind: str, name: str, scene: sfx.Scene) -> Problem:
    """A problem of a scene."""
    return (
        kind,
        name,
        partial(sfx.solve, scene),
        lambda goal: sfx.solve(scene.model_copy(update={"accuracy": goal})),
    )


def friction(draw: Random) -> dict[str, Any]:
    """None, Tresca or Coulomb."""
    laws = (
        {"law": "none"},
        {"law": "tresca", "bound": 1.0},
        {"law": "coulomb", "coefficient": draw.uniform(0.1, 0.5)},
    )
    return draw.choice(laws)


def box(draw: Random, name: str, cell: str) -> Problem:
    """A box whose top is moved down and along, on a bowl."""
    n, gap = (
        draw.randint(4, 6),
        f"{draw.uniform(0.002, 0.02):.4f} * ((x[0] - 1)**2 + (x[1] - 0.4)**2)",
    )
    sizes = {"length": 2.0, "nx": 2 * n, "ny": n, "nz": n, "cell": cell}
    data = {
        "mesh": {"generator": "box", "parameters": sizes},
        "material": {"young": 1000.0, "poisson": draw.choice((0.2, 0.3, 0.4))},
        "displacement": {"boundary": "top", "x": draw.uniform(0, 0.01), "y": 0.0, "z": -0.02},
        "contact": {"boundary": "bottom", "gap": gap, "friction": friction(draw)},
    }
    return of_scene("space", name, parse_scene(data))


def rectangle(length: float, n: int, cell: str) -> dict[str, Any]:
    """Its mesh, of n cells over its height, which is 1."""
    parameters = {"length": length, "height": 1.0, "nx": round(n * length), "ny": n, "cell": cell}
    return {"generator": "rectangle", "parameters": parameters}


def nonlinear(draw: Random, law: dict[str, Any], cell: str, degree: int) -> Problem:
    """A block into which a rigid circle is pressed in two load steps."""
    depth, radius = (
        draw.uniform(*((0.01, 0.02) if law["law"] == "j2" else (0.08, 0.2))),
        draw.uniform(0.6, 1.2),
    )
    place = {"centre": [draw.uniform(0.8, 1.2), 1 + radius], "shift": [0.0, f"-{depth:.3f}*t"]}
    data = {
        "mesh": rectangle(2.0, draw.randint(6, 10), cell),
        "element": {"degree": degree},
        "material": law,
        "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.0},
        "contact": {
            "boundary": "top",
            "foundation": {"shape": "circle", "radius": radius, **place},
        },
        "load_steps": {"times": [0.5, 1.0]},
    }
    return of_scene("nonlinear", f"{law['law']}, {cell}, degree {degree}", parse_scene(data))


def bodies(
    draw: Random, kind: str, name: str, law: dict[str, Any], cell: str, degree: int
) -> Problem:
    """A body with a crown that is pressed on a wider one, and pushed."""
    crown = {"gap": f"{draw.uniform(0.0, 0.1):.3f} * (x[0] - 0.5)**2", "friction": friction(draw)}
    data = {
        "body": [
            {
                "name": "upper",
                "shift": [0.0, 1.0],
                "mesh": rectangle(1.0, draw.randint(6, 10), cell),
            },
            {
                "name": "lower",
                "shift": [-0.5, 0.0],
                "mesh": rectangle(2.0, draw.randint(8, 12), cell),
            },
        ],
        "element": {"degree": degree},
        "material": [
            {**law, "young": draw.uniform(50, 500), "region": region}
            for region in ("upper", "lower")
        ],
        "displacement": [
            {"boundary": "lower.bottom", "x": 0.0, "y": 0.0},
            {"boundary": "upper.top", "x": 0.01, "y": -0.05},
        ],
        "contact": {"boundary": "upper.bottom", "against": "lower.top", **crown},
    }
    return of_scene(kind, name, parse_scene(data))


def forms(draw: Random, name: str, cell: str, degree: int, weak: float = 0.0) -> Problem:
    """A block of a user's own forms, softer towards x[0] = 0, whose top is moved."""
    dim, kind = (3 if cell in (TETRAHEDRON, HEXAHEDRON) else 2), dmesh.CellType[cell]
    n, bowl, across = (
        draw.randint(8, 12) // degree // (dim - 1),
        draw.uniform(0.0, 0.02),
        draw.uniform(0.0, 0.01),
    )
    law = draw.choice((sfx.Coulomb(draw.uniform(0.1, 0.5)), sfx.Tresca(1.0), sfx.NoFriction()))

    def mesh(finer: int) -> Any:
        create, size = (
            (dmesh.create_rectangle, (2, 1)) if dim == 2 else (dmesh.create_box, (2, 1, 1))
        )
        return create(MPI.COMM_SELF, [[0.0] * dim, size], [finer * n * k for k in size], kind)

    def make(domain: Any) -> sfx.ContactProblem:
        V = fem.functionspace(domain, ("Lagrange", degree, (dim,)))
        u, v, x = ufl.TrialFunction(V), ufl.TestFunction(V), ufl.SpatialCoordinate(domain)
        ends = (lambda x: np.isclose(x[dim - 1], 0.0)), (lambda x: np.isclose(x[dim - 1], 1.0))
        bottom, top = (dmesh.locate_entities_boundary(domain, dim - 1, end) for end in ends)
        moved = np.array([across, 0.0, -0.02] if dim == 3 else [across, -0.02])

        def stress(y: Any) -> Any:
            e = ufl.sym(ufl.grad(y))
            return (1 - weak * (1 - x[0] / 2)) * (800 * e + 600 * ufl.tr(e) * ufl.Identity(dim))

        a, L = (
            ufl.inner(stress(u), ufl.grad(v)) * ufl.dx,
            ufl.inner(fem.Constant(domain, np.zeros(dim)), v) * ufl.dx,
        )
        held = fem.dirichletbc(moved, fem.locate_dofs_topological(V, dim - 1, top), V)
        base = sfx.Foundation(bottom, gap=bowl * (x[0] - 1) ** 2, friction=law)
        return sfx.ContactProblem(a, L, [held], base, stress=stress)

    def first() -> Any:
        (problem := make(mesh(1))).solve()
        return problem.solution

    given = mesh(1) if cell in (TRIANGLE, TETRAHEDRON) else mesh
    return "forms", name, first, lambda goal: sfx.solve_to_accuracy(make, given, goal)


def drawn(draw: Random) -> Iterator[Problem]:
    """24 problems."""
    plane = [
        (TRIANGLE, 2),
        (TRIANGLE, 2, 0.8),
        (TRIANGLE, 2),
        (TRIANGLE, 1, 0.5),
        (QUADRILATERAL, 2),
    ]
    for n, (cell, *more) in enumerate(
        [*plane, (QUADRILATERAL, 1, 0.8), (TETRAHEDRON, 1), (HEXAHEDRON, 1, 0.5)]
    ):
        yield forms(draw, f"{n}, {cell}, degree {more[0]}", cell, *more)
    for n, cell in enumerate((TETRAHEDRON,) * 5 + (HEXAHEDRON,) * 3):
        yield box(draw, f"{n}, {cell}", cell)
    yield nonlinear(
        draw, {"law": "mooney-rivlin", "c10": 0.3, "c01": 0.1, "bulk": 3.0}, QUADRILATERAL, 1
    )
    yield nonlinear(
        draw, {"law": "ogden", "mu": [0.5, -0.1], "alpha": [2.0, -2.0], "bulk": 3.0}, TRIANGLE, 2
    )
    yield nonlinear(
        draw, {"law": "saint-venant-kirchhoff", "young": 1.0, "poisson": 0.3}, TRIANGLE, 1
    )
    metal = {"law": "j2", "young": 2e5, "poisson": 0.3, "yield_stress": 300.0, "hardening": 2e3}
    yield nonlinear(draw, metal, QUADRILATERAL, 1)
    rubber = {"law": "neo-hooke", "poisson": 0.4}
    yield bodies(draw, "nonlinear", "two blocks of rubber", rubber, QUADRILATERAL, 1)
    for cell, degree in ((TRIANGLE, 1), (TRIANGLE, 2), (QUADRILATERAL, 1)):
        yield bodies(draw, "two bodies", f"{cell}, degree {degree}", {"poisson": 0.3}, cell, degree)


def seconds_of(solution: Any) -> float:
    """What the meshes took together."""
    prices = [price.seconds for price in solution.convergence_table if not price.predicted]
    return float(sum(prices or solution.timings.seconds.values()))


def row_of(
    kind: str, name: str, first: Callable[[], Any], asked: Callable[[sfx.Accuracy], Any]
) -> dict[str, Any]:
    """What was foretold, and what the command took."""
    cost, found = (
        min((first() for _ in range(3)), key=seconds_of).cost,
        list[Any](),
    )  # the first one compiles forms
    words, Accuracy = cost.command.split(), sfx.Accuracy
    goal = (
        Accuracy(target=words[1])
        if words[0] == "--accuracy"
        else eval(cost.command, {"Accuracy": Accuracy})
    )
    while not found or (len(found) < 2 and seconds_of(found[0]) < LONG):
        try:
            found.append(asked(goal.model_copy(update={"seconds": LIMIT})))
        except sfx.ConvergenceError as error:
            found.append(error.solution)
    fine = min(found, key=seconds_of)
    (low, high), needed = cost.next_seconds, seconds_of(fine)
    miss = max(log(low / needed), log(needed / high), 0.0)
    return {
        "kind": kind,
        "problem": name,
        "chosen on": "no",
        "unknowns": cost.dofs,
        "error": f"{cost.error:.2e}",
        "seconds": f"{cost.seconds:.2g}",
        "command": cost.command,
        "cells": "where the error is" if cost.local else "all smaller",
        "foretold, from": f"{low:.2g}",
        "foretold, to": f"{high:.2g}",
        "unknowns foretold": f"{cost.next_dofs:.2g}",
        "needed": f"{'' if fine.converged else 'above '}{needed:.2g}",
        "unknowns needed": fine.model.dofs,
        "error reached": f"{fine.convergence_table[-2].energy:.2e}"
        if fine.convergence_table
        else fine.status.value,
        "width": f"{high / low:.2g}",
        "within": "no" if miss or not fine.converged else "yes",
        "score": f"{log(high / low) + 2 / ALPHA * miss:.2f}",
        "recorded": f"{date.today():%-d %B %Y}",
    }


def summaries(rows: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Coverage, median and largest width, and mean score of each kind, and of all."""
    for kind in [*dict.fromkeys(row["kind"] for row in rows), "all"]:
        group = [row for row in rows if kind in (row["kind"], "all")]
        widths, scores = ([float(row[key]) for row in group] for key in ("width", "score"))
        yield dict.fromkeys(rows[-1], "") | {
            "kind": f"{kind}, together",
            "problem": f"{len(group)} problems",
            "width": f"{median(widths):.2g}, at most {max(widths):.2g}",
            "within": f"{sum(row['within'] == 'yes' for row in group)} of {len(group)}",
            "score": f"{mean(scores):.2f}",
        }


def draw(rows: list[dict[str, Any]], file: Path) -> None:
    """The seconds that were needed over the forecast interval of each problem, by kind."""
    figure = Figure((9.0, 3.6), layout="constrained")
    axes, kinds = figure.subplots(), [*dict.fromkeys(row["kind"] for row in rows)]
    ordered = sorted(
        rows, key=lambda row: (kinds.index(row["kind"]), float(row["needed"].split()[-1]))
    )
    low, high = (
        np.array([float(row[f"foretold, {end}"]) for row in ordered]) for end in ("from", "to")
    )
    needed, at = (
        np.array([float(row["needed"].split()[-1]) for row in ordered]),
        np.arange(len(ordered)),
    )
    within, named = (
        np.array([row["within"] == "yes" for row in ordered]),
        [row["kind"] for row in ordered],
    )
    axes.vlines(
        at, low / needed, high / needed, color="0.7", linewidth=3.0, label="forecast interval"
    )
    for chosen, colour, text in (
        (within, "tab:blue", "needed, within"),
        (~within, "tab:red", "needed, outside"),
    ):
        axes.plot(at[chosen], np.ones(chosen.sum()), "o", color=colour, markersize=3.0, label=text)
    starts = [named.index(kind) for kind in kinds]
    axes.vlines(np.array(starts[1:]) - 0.5, 0.08, 9.0, color="0.5", linewidth=0.6, linestyle=":")
    axes.set(yscale="log", ylabel="seconds over those needed", xlim=(-1, len(at)), ylim=(0.08, 9.0))
    axes.set_xticks(
        [float(np.mean(ends)) for ends in pairwise([*starts, len(at)])], kinds, rotation=30
    )
    axes.set_yticks([0.1, 0.3, 1.0, 3.0], ["0.1", "0.3", "1", "3"])
    axes.legend(loc="lower left", ncols=3)
    figure.savefig(file, dpi=120)


def main() -> None:
    """Measure, print and write, or draw what is written."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("results/forecasts.csv"),
        help="file (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=int, default=31, help="of the problems (default: %(default)s)"
    )
    parser.add_argument(
        "--draw", type=Path, help="only draw the problems of the file that --out names"
    )
    options = parser.parse_args()
    time.perf_counter = time.process_time  # other programs take no part of it
    old = csv.DictReader(options.out.open(encoding="utf-8")) if options.out.exists() else []
    rows = {(row["kind"], row["problem"]): row for row in old if row["unknowns"]}
    if options.draw is not None:
        draw([*rows.values()], options.draw)
        return
    for kind, name, *runs in drawn(Random(options.seed)):
        named = kind, f"seed {options.seed}: {name}"
        try:
            rows[named] = row_of(*named, *runs)
        except sfx.SignoriniError as error:  # the others are of use
            print(*named, error, flush=True)
            continue
        print(*rows[named].values(), sep="  ", flush=True)
        write_csv(options.out, [*rows.values(), *summaries([*rows.values()])])


if __name__ == "__main__":
    main()
