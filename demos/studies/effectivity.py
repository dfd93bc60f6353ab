"""How good the estimates of the convergence table are: estimated over true error, mesh by mesh.

    ./env python3 demos/studies/effectivity.py --out docs/evidence/effectivity.csv

The scenes of the demos on uniform meshes, and Example 1 on the meshes that an asked-for accuracy
takes, are measured against references of much higher accuracy; how far these may be wrong
themselves is estimated from coarser ones.  Of the made-up solution (see ``manufactured``)
displacement and pressure are known exactly.  A ratio between 1/2 and 2 is good, above 1 it is on
the safe side; * marks what is outside [1/2, 2], ~ a true error that is less than three times the
reference's own.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem

from signorini_fx.machine.result_files import write_csv
from signorini_fx.mechanics.mesh.tagged import generate_mesh
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.records import History
from signorini_fx.results.accuracy.convergence_table import convergence_table
from signorini_fx.scenes.mesh import scene_on
from signorini_fx.scenes.mesh_sequence import MeshedScene, meshes_of
from signorini_fx.scenes.reading import parse_scene, read_scene
from signorini_fx.solving.meshed_problem import SolvedMesh
from signorini_fx.solving.to_accuracy import Budget, solve_to_accuracy

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "support"))
import manufactured
from on_meshes import vector_space
from reference import Reference, divided, reference_errors, reference_solution

# Sizes of the cells, relative to those of the scene.
MESHES = (8, 4, 2, 1, 0.5)
SCENES = ("example1_tresca", "example1_coulomb", "hertz", "hertz_degree2")
ADAPTIVE = ("example1_tresca", "example1_coulomb")
ASKED = 1e-3
# Element and facets along the contact boundary, whose kinks are off the nodes.
MADE_UP = {"Q1": ("quadrilateral", 1, (8, 16, 32, 64, 128)), "P2": ("triangle", 2, (8, 16, 32, 64))}
COLUMNS = ("energy", "pressure", "peak", "zone")
SCENE_FILES = Path(__file__).parents[2] / "demos" / "scenes"
UNKNOWNS = 200_000
# Errors below this are none: nodes of both meshes are the same.
ROUND_OFF = 1e-12
# The gap of the true circle at the nodes inside the facets too, which are not on it.
TRUE_SHAPE = "8 - sqrt(max(0, 64 - x[0]**2))"


def scene_of(name):
    """A scene of the demos; ``hertz_degree2`` is Hertz with quadratic elements."""
    if name != "hertz_degree2":
        return read_scene(SCENE_FILES / f"{name}.toml")
    data = tomllib.loads((SCENE_FILES / "hertz.toml").read_text(encoding="utf-8"))
    data["contact"][0]["gap"] = TRUE_SHAPE
    return parse_scene({**data, "element": {"degree": 2}}, name)


def reference_of(name):
    """A reference of much higher accuracy, and how far it may be wrong."""
    if not name.startswith("hertz"):
        return reference_solution(scene_of(name), UNKNOWNS)
    return _hertz_reference()


@cache
def _hertz_reference():
    # From small cells on: where facets are divided, the body remains the polygon that it is.
    scene = scene_of("hertz_degree2")
    solutions = divided(scene, 1 / 3, UNKNOWNS)
    reference, finest = Reference(solutions[-1]), solutions[-1].model.dofs
    coarse = (divided(scene, k / 3, finest / k**2)[-1] for k in (2, 4))
    return reference, reference_errors(*(reference.errors(solution) for solution in coarse))


def one_after_the_other(scenes) -> list[SolvedMesh]:
    """Nested iteration: each mesh from the contact state of the one before."""
    history, state, found = History(), None, []
    for number, scene in enumerate(scenes):
        found.append(
            MeshedScene(comm=MPI.COMM_SELF, history=history, scene=scene).solved(
                number, state, None
            )
        )
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


def compare(
    name: str, found: list[SolvedMesh], prices: list, true: list[dict], own: dict
) -> list[dict]:
    """One row per mesh and a quantity."""
    rows = []
    for solved, price, errors in zip(found, prices, true, strict=False):
        for column in COLUMNS:
            estimated, error = getattr(price, column), errors.get(column)
            if error is None and column not in errors:
                continue
            known = bool(estimated) and bool(error) and error > ROUND_OFF
            rows.append(
                {
                    "scene": name,
                    "level": price.level,
                    "dofs": solved.solution.model.dofs,
                    "quantity": column,
                    "true": error,
                    "effectivity": estimated / error if known else None,
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
    rows = compare(
        name, found, prices, [reference.errors(solved.solution) for solved in found], own
    )
    if name in ADAPTIVE:
        found, prices = as_asked(scene, ASKED, of="pressure")
        true = [reference.errors(solved.solution) for solved in found]
        rows += compare(f"{name}, adaptive", found, prices, true, own)
    return rows


def of_made_up(law: str, element: str) -> list[dict]:
    """The solution that is known exactly."""
    cell, degree, counts = MADE_UP[element]
    size = {"length": manufactured.LENGTH, "height": manufactured.HEIGHT, "cell": cell}
    meshes = [
        generate_mesh("rectangle", {**size, "nx": n, "ny": n // 2}, MPI.COMM_SELF) for n in counts
    ]
    found = one_after_the_other([manufactured.made_up(tagged, degree, law) for tagged in meshes])
    prices = convergence_table([solved.level for solved in found], 0.0)
    return compare(
        f"made up, {law}, {element}", found, prices, [exact_errors(s.solution) for s in found], {}
    )


def exact_errors(solution) -> dict[str, float]:
    """Errors against the made-up displacement and pressure."""
    d = solution.model
    # In a richer space: against the interpolant in its own a solution looks better than it is.
    richer = vector_space(d.tagged.mesh, solution.statement.element.degree + 2)
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


def table(rows: list[dict]) -> list[dict]:
    """One row per mesh, with the ratios of all quantities."""
    lines = []
    for scene, level in dict.fromkeys((row["scene"], row["level"]) for row in rows):
        own = {
            row["quantity"]: row for row in rows if (row["scene"], row["level"]) == (scene, level)
        }
        cells = {column: _cell(own[column]) if column in own else "-" for column in COLUMNS}
        lines.append({"scene": scene, "mesh": level, "unknowns": own["energy"]["dofs"], **cells})
    return lines


def _cell(row: dict) -> str:
    """A ratio and the true error, with the marks of the head of this file."""
    value = row["effectivity"]
    if value is None:
        return "-"
    return (
        f"{value:.2f}{'' if 0.5 <= value <= 2 else '*'}{'~' if row['doubtful'] else ''} "
        f"({row['true']:.0e})"
    )


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("results/effectivity.csv"),
        help="file (default: %(default)s)",
    )
    options = parser.parse_args()
    rows = [row for name in SCENES for row in of_scene(name)]
    rows += [
        row for law in manufactured.LAWS for element in MADE_UP for row in of_made_up(law, element)
    ]
    options.out.parent.mkdir(parents=True, exist_ok=True)
    write_csv(options.out, table(rows))
    for line in table(rows):
        print(*line.values(), sep=" | ")


if __name__ == "__main__":
    main()
