"""Bodies of rubber and metal: estimated over true errors, and whether an accuracy that is asked for
is reached.

    ./env python3 demos/studies/nonlinear_effectivity.py --out
    docs/evidence/effectivity_nonlinear.csv

Each scene is solved on meshes with cells half as large as those before, and with a requested
accuracy.  Errors of the stress P in L2, of the pressure and of the force are measured against a
finer mesh of degree 2.  The table has estimated over true error (true error); * is outside of 1/2
to 2, ~ a true error that is less than three times the distance of the reference to that on cells
twice as large.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import basix
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem

from signorini_fx.forms.nonlinear.results import stress_of
from signorini_fx.machine.result_files import write_csv
from signorini_fx.mechanics.mesh.points import cells_of_points
from signorini_fx.mechanics.mesh.tagged import load_file
from signorini_fx.mechanics.statement.mesh_sources import MeshFile
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.records import History
from signorini_fx.scenes.mesh import scene_on
from signorini_fx.scenes.mesh_sequence import scene_with
from signorini_fx.scenes.nonlinear import build_problem
from signorini_fx.scenes.reading import parse_scene, read_scene
from signorini_fx.scenes.solver import solve

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "support"))
from effectivity import SCENE_FILES
from reference import OUTSIDE_OTHER_MESH, interpolated

COLUMNS = ("stress", "pressure", "force")
RUBBER = {"law": "neo-hooke", "young": 1.0, "poisson": 0.4}
METAL = {"law": "j2", "young": 200000.0, "poisson": 0.3, "yield_stress": 300.0, "hardening": 2000.0}
STEPS = {"times": [0.25, 0.5, 0.75, 1.0]}


def rectangle(length: float, nx: int, ny: int, **more: Any) -> dict[str, Any]:
    """The mesh of a rectangle with the height 1."""
    return {
        "generator": "rectangle",
        "parameters": {"length": length, "height": 1.0, "nx": nx, "ny": ny, **more},
    }


def punch() -> dict[str, Any]:
    """A flat punch with edges in the half of a metal block: its foundation ends with a step of the
    gap.
    """
    return {
        "mesh": rectangle(2.0, 16, 8),
        "element": {"volumetric": "reduced"},
        "material": METAL,
        "displacement": [{"boundary": "top", "y": "-0.004*t"}, {"boundary": "left", "x": 0.0}],
        "contact": {"boundary": "bottom", "gap": "0.0 if x[0] <= 1.0 else 1.0"},
        "load_steps": STEPS,
    }


def blocks() -> dict[str, Any]:
    """A crowned block of rubber on one that is softer, with friction."""
    crown = {"gap": "0.4 * (x[0] - 0.5)**2", "friction": {"law": "coulomb", "coefficient": 0.3}}
    return {
        "body": [
            {"name": "upper", "shift": [0.0, 1.0], "mesh": rectangle(1.0, 6, 6)},
            {"name": "lower", "shift": [-0.5, 0.0], "mesh": rectangle(2.0, 16, 8)},
        ],
        "material": [{**RUBBER, "region": "upper"}, {**RUBBER, "young": 0.5, "region": "lower"}],
        "displacement": [
            {"boundary": "lower.bottom", "x": 0.0, "y": 0.0},
            {"boundary": "upper.top", "x": "0.02*t", "y": "-0.08*t"},
        ],
        "contact": {"boundary": "upper.bottom", "against": "lower.top", **crown},
        "load_steps": STEPS,
    }


def cube() -> dict[str, Any]:
    """A quarter of a block of rubber that is pressed on a bowl, in 3D."""
    sides, counts = (
        dict.fromkeys(("length", "width", "height"), 1.0),
        dict.fromkeys(("nx", "ny", "nz"), 4),
    )
    return {
        "mesh": {"generator": "box", "parameters": {**sides, **counts, "cell": "hexahedron"}},
        "material": RUBBER,
        "displacement": [
            {"boundary": "left", "x": 0.0},
            {"boundary": "front", "y": 0.0},
            {"boundary": "top", "x": 0.0, "y": 0.0, "z": "-0.15*t"},
        ],
        "contact": {"boundary": "bottom", "gap": "0.15 * (x[0]**2 + x[1]**2)"},
        "load_steps": {"times": [0.5, 1.0]},
    }


# Scenes, the finest mesh that is judged and the reference, as halvings of the first one, and what
# is asked for.
SCENES = {
    "punch in metal": (lambda: parse_scene(punch()), 1, 3, 0.08),
    "two blocks of rubber": (lambda: parse_scene(blocks()), 1, 2, 0.03),
    "block of rubber, 3D": (lambda: parse_scene(cube()), 1, 1, None),
    "rubber seal": (lambda: read_scene(SCENE_FILES / "rubber_seal.toml"), 1, 1, None),
}


def on(scene: Any, halvings: int, degree: int | None = None) -> Any:
    """The scene with cells halved so many times."""
    if degree is not None:
        scene = scene.model_copy(
            update={"element": scene.element.model_copy(update={"degree": degree})}
        )
    if isinstance(scene.mesh, MeshFile):
        return scene_with(
            scene, load_file(scene.mesh, MPI.COMM_SELF, halvings, scene.element.degree)
        )
    return scene_on(scene, 0.5**halvings)


def solved(scene: Any) -> tuple[Any, fem.Function, Any]:
    """The solution on one mesh, its stress P and estimated errors."""
    problem = build_problem(scene, MPI.COMM_SELF, History())
    solution = problem.solved()
    assert solution.converged
    return (
        solution,
        stress_of(problem._lowered, problem.u),
        problem.errors_of(solution),
    )


class Fine:
    """A solution to compare others with."""

    def __init__(self, scene: Any) -> None:
        self.solution, stress, _ = solved(scene)
        mesh = stress.function_space.mesh
        points, weights = basix.make_quadrature(
            getattr(basix.CellType, mesh.topology.cell_name()), 2
        )
        cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)

        def at_points(expression: Any) -> Any:
            return (
                fem.Expression(expression, points)
                .eval(mesh, cells)
                .reshape(cells.size * len(points), -1)
            )

        x = at_points(ufl.SpatialCoordinate(mesh))
        self.points = np.zeros((len(x), 3))
        self.points[:, : x.shape[1]] = x
        self.weights = np.abs(at_points(ufl.JacobianDeterminant(mesh))[:, 0]) * np.tile(
            weights, cells.size
        )
        self.stress = at_points(stress)

    def errors(self, solution: Any, stress: fem.Function) -> dict[str, float]:
        """Relative errors of another solution."""
        space = stress.function_space
        cells, places, _ = cells_of_points(space.mesh, self.points, OUTSIDE_OTHER_MESH)
        shares = space.element.basix_element.tabulate(0, places)[0, :, :, 0]
        values = stress.x.array.reshape(-1, self.stress.shape[1])
        there = np.einsum("nk,nkc->nc", shares, values[space.dofmap.list[cells]])
        sizes = [
            np.sqrt(self.weights @ (f**2).sum(axis=1)) for f in (there - self.stress, self.stress)
        ]
        fine = self.solution.table.columns
        away = interpolated(solution.table, self.solution.table, "pressure") - fine["pressure"]
        pressures = [np.sqrt(fine["weight"] @ f**2) for f in (away, fine["pressure"])]
        forces = [one.contact.forces_of_each for one in (solution, self.solution)]
        force = np.linalg.norm(forces[0] - forces[1]) / np.linalg.norm(forces[1])
        return dict(
            zip(
                COLUMNS,
                (sizes[0] / sizes[1], pressures[0] / pressures[1], float(force)),
                strict=True,
            )
        )


def row_of(name: str, mesh: str, scene: Any, fine: Fine, known: dict[str, float]) -> dict[str, Any]:
    """Estimated and true errors on a mesh."""
    solution, stress, errors = solved(scene)
    true = fine.errors(solution, stress)
    row = {"scene": name, "mesh": mesh, "unknowns": solution.model.dofs}
    for of, estimated in zip(COLUMNS, (errors.energy, errors.pressure, errors.force), strict=True):
        ratio, doubtful = estimated / true[of], "~" if true[of] < 3 * known[of] else ""
        row[of] = f"{ratio:.2f}{'' if 0.5 <= ratio <= 2 else '*'}{doubtful} ({true[of]:.1e})"
    print(*row.values(), sep=" | ", flush=True)
    return row


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--out", type=Path, default=Path("results/effectivity_nonlinear.csv"), help="file"
    )
    parser.add_argument("--scene", choices=SCENES, action="append", help="only this one")
    options = parser.parse_args()
    time.perf_counter = time.process_time  # other programs take no part of the budget
    rows = []
    for name in options.scene or SCENES:
        make, finest, reference, target = SCENES[name]
        scene = make()
        fine = Fine(on(scene, reference, 2))
        known = fine.errors(*solved(on(scene, reference - 1, 2))[:2])
        print(name, "reference", fine.solution.model.dofs, known, flush=True)
        rows += [row_of(name, str(k), on(scene, k), fine, known) for k in range(finest + 1)]
        if target is not None:
            found = solve(
                scene.model_copy(update={"accuracy": Accuracy(target=target, seconds=60.0)}),
                check=False,
            )
            print(name, found.status, [level.dofs for level in found.levels], flush=True)
            element = scene.element.model_copy(update={"degree": found.statement.element.degree})
            last = scene_with(scene.model_copy(update={"element": element}), found.model.tagged)
            rows.append(
                row_of(name, f"asked for {target:g}: {found.status.value}", last, fine, known)
            )
        write_csv(options.out, rows)


if __name__ == "__main__":
    main()
