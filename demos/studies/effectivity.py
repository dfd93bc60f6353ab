"""How good the estimates of the convergence table are: estimated over true error, mesh by mesh.

    ./env python3 demos/studies/effectivity.py --out results/effectivity

The scenes of the demos on uniform meshes, and Example 1 on the meshes that an asked-for accuracy takes, are measured
against references of much higher accuracy (see ``cases``); how far these may be wrong themselves is estimated from
coarser ones.  Of the made-up solution (see ``manufactured``) displacement and pressure are known exactly.  A ratio
between 1/2 and 2 is good, above 1 it is on the safe side; * marks what is outside [1/2, 2], ~ a true error that is less
than three times the reference's own.  Written are effectivity.csv and effectivity.md.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import manufactured
import numpy as np
import ufl
from mpi4py import MPI
from cases import reference_of, scene_of
from dolfinx import fem

from signorini_fx.machine.csv_text import write_csv
from signorini_fx.mechanics.mesh.tagged import generate_mesh
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.records import History
from signorini_fx.results.accuracy.convergence_table import convergence_table
from signorini_fx.scenes.hierarchy import scene_on
from signorini_fx.scenes.mesh_sequence import meshed_scene, meshes_of
from signorini_fx.solving.meshed_problem import SolvedMesh
from signorini_fx.solving.to_accuracy import Budget, solve_to_accuracy

# Sizes of the cells, relative to those of the scene.
MESHES = (8, 4, 2, 1, 0.5)
SCENES = ("example1_tresca", "example1_coulomb", "hertz", "hertz_degree2")
ADAPTIVE = ("example1_tresca", "example1_coulomb")
ASKED = 1e-3
# Element and facets along the contact boundary, whose kinks are off the nodes.
MADE_UP = {"Q1": ("quadrilateral", 1, (8, 16, 32, 64, 128)), "P2": ("triangle", 2, (8, 16, 32, 64))}
COLUMNS = ("energy", "pressure", "peak", "zone")


def one_after_the_other(scenes) -> list[SolvedMesh]:
    """Nested iteration: each mesh from the contact state of the one before."""
    history, state, found = History(), None, []
    for number, scene in enumerate(scenes):
        found.append(meshed_scene(scene, MPI.COMM_SELF, history).solved(number, state, None))
        state = found[-1].solution.contact
    return found


def as_asked(scene, target: float, **goal) -> tuple[list[SolvedMesh], list]:
    """The meshes that an asked-for accuracy takes, and their convergence table."""
    history, found, goal = History(), [], Accuracy(target=target, **goal)
    meshes = meshes_of(scene, goal, MPI.COMM_SELF, history)
    solve = meshes.solve

    def noted(state, number):
        found.append(solve(state, number))
        return found[-1]

    meshes.solve = noted
    solution = solve_to_accuracy(meshes, Budget.begins(goal, MPI.COMM_SELF, history), history)
    assert len(found) == len(solution.levels)
    return found, list(solution.convergence_table)


def compare(name: str, found: list[SolvedMesh], prices: list, true: list[dict], own: dict) -> list[dict]:
    """One row per mesh and a quantity."""
    rows = []
    for solved, price, errors in zip(found, prices, true, strict=False):
        for column in COLUMNS:
            estimated, error = getattr(price, column), errors.get(column)
            if error is None and column not in errors:
                continue
            known = bool(estimated) and bool(error)
            rows.append(
                {
                    "scene": name,
                    "level": price.level,
                    "h": price.h,
                    "dofs": solved.solution.model.dofs,
                    "quantity": column,
                    "estimated": estimated,
                    "true": error,
                    "effectivity": estimated / error if known else None,
                    "reference_error": own.get(column) or 0.0,
                    "doubtful": bool(known and error < 3 * (own.get(column) or 0.0)),
                }
            )
    return rows


def of_scene(name: str) -> list[dict]:
    """A scene of the demos, uniform and as an asked-for accuracy has it."""
    reference, own = reference_of(name)
    scene = scene_of(name)
    found = one_after_the_other([scene_on(scene, factor) for factor in MESHES])
    prices = convergence_table([solved.level for solved in found], 0.0)
    rows = compare(name, found, prices, [reference.errors(solved.solution) for solved in found], own)
    if name in ADAPTIVE:
        found, prices = as_asked(scene, ASKED, of="pressure")
        true = [reference.errors(solved.solution) for solved in found]
        rows += compare(f"{name}, adaptive", found, prices, true, own)
    return rows


def of_made_up(law: str, element: str) -> list[dict]:
    """The solution that is known exactly."""
    cell, degree, counts = MADE_UP[element]
    size = {"length": manufactured.LENGTH, "height": manufactured.HEIGHT, "cell": cell}
    meshes = [generate_mesh("rectangle", {**size, "nx": n, "ny": n // 2}, MPI.COMM_SELF) for n in counts]
    found = one_after_the_other([manufactured.made_up(tagged, degree, law) for tagged in meshes])
    prices = convergence_table([solved.level for solved in found], 0.0)
    return compare(f"made up, {law}, {element}", found, prices, [exact_errors(s.solution) for s in found], {})


def exact_errors(solution) -> dict[str, float]:
    """Errors against the made-up displacement and pressure."""
    d = solution.model
    # In a richer space: against the interpolant in its own a solution looks better than it is.
    richer = fem.functionspace(d.tagged.mesh, ("Lagrange", solution.statement.element.degree + 2, (2,)))
    exact, difference = fem.Function(richer), fem.Function(richer)
    exact.interpolate(lambda x: np.array(manufactured.displacement(manufactured.NUMBERS, x)))
    difference.interpolate(solution.displacement)
    difference.x.array[:] -= exact.x.array
    lame, mu = d.elastic.lame

    def norm(v):
        epsilon = ufl.sym(ufl.grad(v))
        energy = lame * ufl.tr(epsilon) ** 2 + 2 * mu * ufl.inner(epsilon, epsilon)
        return np.sqrt(fem.assemble_scalar(fem.form(energy * ufl.dx)))

    x = np.linspace(0, manufactured.LENGTH, 40_001)
    columns = solution.table.columns
    true = manufactured.pressure(manufactured.NUMBERS, np.array([x, 0 * x]))
    missing = np.interp(x, columns["x"], columns["pressure"]) - true
    return {
        "energy": float(norm(difference) / norm(exact)),
        "pressure": float(np.linalg.norm(missing) / np.linalg.norm(true)),
        "peak": float(abs(columns["pressure"].max() / true.max() - 1)),
    }


def table(rows: list[dict]) -> str:
    """The ratios as a table in Markdown."""
    lines = ["| scene | mesh | unknowns | " + " | ".join(COLUMNS) + " |", "|---|---|---|" + "---|" * len(COLUMNS)]
    for name in dict.fromkeys(row["scene"] for row in rows):
        for level in sorted({row["level"] for row in rows if row["scene"] == name}):
            own = {row["quantity"]: row for row in rows if (row["scene"], row["level"]) == (name, level)}
            cells = [_cell(own[column]) if column in own else "-" for column in COLUMNS]
            lines.append(f"| {name} | {level} | {own['energy']['dofs']} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _cell(row: dict) -> str:
    """A ratio and the true error, with the marks of the head of this file."""
    value = row["effectivity"]
    if value is None:
        return "-"
    mark = "" if 0.5 <= value <= 2 else r"\*"
    return f"{value:.2f}{mark}{'~' if row['doubtful'] else ''} ({row['true']:.0e})"


def spread(rows: list[dict]) -> str:
    """The range of each ratio, and how many are outside."""
    lines = []
    for column in COLUMNS:
        values = [row["effectivity"] for row in rows if row["quantity"] == column and row["effectivity"]]
        outside = sum(not 0.5 <= value <= 2 for value in values)
        lines.append(f"{column}: {min(values):.2f} to {max(values):.2f}, {outside} of {len(values)} outside [0.5, 2]")
    return "\n".join(lines)


def main() -> None:
    """Measure, print and write."""
    cases = {name: lambda name=name: of_scene(name) for name in SCENES}
    for law in manufactured.LAWS:
        for element in MADE_UP:
            cases[f"made_up_{law}_{element}"] = lambda law=law, element=element: of_made_up(law, element)
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/effectivity"), help="folder (default: %(default)s)")
    parser.add_argument("--case", choices=cases, action="append", help="only this one")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in options.case or cases:
        begin = time.perf_counter()
        rows += cases[name]()
        print(f"{name}: {time.perf_counter() - begin:.1f} s", flush=True)
    write_csv(options.out / "effectivity.csv", rows)
    text = f"{table(rows)}\n\n{spread(rows)}"
    (options.out / "effectivity.md").write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
