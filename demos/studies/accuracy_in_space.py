"""Bodies in 3D: how good the estimates are, and whether an accuracy that is asked for is met.

    ./env python3 demos/studies/accuracy_in_space.py --out docs/evidence

Every scene is solved on three uniform meshes, each with cells half as large as the one before, and asked for an
accuracy of displacement, contact pressure and force.  Both are measured against the scene without penetration on
hexahedra of degree 2, whose own error is what coarser ones say: ~ marks a true error of less than three times that.
Written are effectivity_in_space.csv and asked_accuracy_in_space.csv; seconds are those of the processor.
"""

from __future__ import annotations

import argparse
import time
from functools import cache
from pathlib import Path

from mpi4py import MPI
from effectivity import one_after_the_other
from reference import Reference, reference_errors

from signorini_fx.machine.result_files import write_csv
from signorini_fx.mechanics.statement.mesh_sources import MeshGenerator
from signorini_fx.mechanics.statement.settings import Accuracy, SolverSettings
from signorini_fx.results.accuracy.convergence_table import convergence_table
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve

TARGETS = {"energy": 0.25, "pressure": 0.2, "force": 0.02}
COLUMNS = ("energy", "pressure", "force", "peak", "zone")
# A run that takes longer ends by name.
BUDGET = 60.0
# Errors below this are round-off.
ROUND_OFF = 1e-9
TRESCA, COULOMB = {"law": "tresca", "bound": 1.5}, {"law": "coulomb", "coefficient": 0.3}


def block(friction: dict | None = None, **more) -> dict:
    """A block of 3 x 1 x 1 over a bowl, pressed in the middle of its top and pulled along x[1]."""
    gap = "0.003 * ((x[0] - 1.5)**2 + (x[1] - 0.5)**2) + 0.001"
    return {
        "mesh": {"generator": "box", "parameters": {"nx": 24, "ny": 8, "nz": 8}},
        "material": {"young": 5000.0, "poisson": 0.4},
        "displacement": [{"boundary": name, "x": 0.0, "y": 0.0} for name in ("left", "right")],
        "traction": {"boundary": "top", "y": "4 if 1 <= x[0] <= 2 else 0", "z": "-20 if 1 <= x[0] <= 2 else 0"},
        "contact": {"boundary": "bottom", "gap": gap, "friction": friction or {"law": "none"}},
        **more,
    }


def sphere() -> dict:
    """A quarter of a block on a sphere (as a paraboloid): Hertz, with a contact radius of 0.3 of the block."""
    sides, counts = dict.fromkeys(("length", "width", "height"), 1.0), dict.fromkeys(("nx", "ny", "nz"), 12)
    return {
        "mesh": {"generator": "box", "parameters": {**sides, **counts}},
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": [
            {"boundary": "left", "normal": 0.0},
            {"boundary": "front", "normal": 0.0},
            {"boundary": "top", "z": -0.06},
        ],
        "contact": {"boundary": "bottom", "gap": "(x[0]**2 + x[1]**2) / 2"},
    }


def brick() -> dict:
    """A brick that friction alone holds, pushed obliquely: contact all over its base, up to the edges."""
    parameters = {"length": 2.0, "width": 2.0, "height": 1.0, "nx": 12, "ny": 12, "nz": 6}
    return {
        "mesh": {"generator": "box", "parameters": parameters},
        "material": {"young": 1000.0, "poisson": 0.3},
        "traction": {"boundary": "top", "pressure": "10 + 2 * x[0]"},
        "body_force": {"x": 2.0, "y": 1.5},
        "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.4}},
    }


def foot() -> dict:
    """A block that leans on an inclined foundation with half of its base: the gap ends there with a step."""
    contact = {"boundary": "bottom", "gap": "0.0 if x[0] <= 1.5 else 0.02", "friction": {"law": "tresca", "bound": 1.0}}
    return block(traction={"boundary": "top", "pressure": 10.0}, contact=contact)


BODIES = {
    "block": (block(), ("P1", "Q1", "Q2")),
    "block, Tresca": (block(TRESCA), ("P1", "Q1")),
    "block, Coulomb": (block(COULOMB), ("P1", "Q1")),
    "sphere": (sphere(), ("P1", "Q1")),
    "brick": (brick(), ("P1", "Q1")),
    "foot": (foot(), ("P1",)),
}


def scene_of(body: str, element: str, factor: float = 1.0, solver: SolverSettings | None = None) -> Scene:
    """A body on cells so many times as large."""
    scene = parse_scene({**BODIES[body][0], "element": {"degree": int(element[1])}})
    counts = {name: max(1, round(scene.mesh.parameters[name] / factor)) for name in ("nx", "ny", "nz")}
    cell = {"P": "tetrahedron", "Q": "hexahedron"}[element[0]]
    mesh = MeshGenerator(generator="box", parameters={**scene.mesh.parameters, **counts, "cell": cell})
    return scene.model_copy(update={"mesh": mesh, "solver": solver or SolverSettings()})


@cache
def reference_of(body: str) -> tuple[Reference, dict[str, float | None]]:
    """The finest solution, and how far it may be wrong."""
    limit = SolverSettings(algorithm="alm")
    far, near, finest = (solve(scene_of(body, "Q2", k, limit), MPI.COMM_SELF) for k in (4, 2, 1))
    reference = Reference(finest)
    return reference, reference_errors(reference.errors(near), reference.errors(far))


def effectivity(body: str, element: str) -> list[dict]:
    """One row for each mesh."""
    (reference, own), finest, rows = reference_of(body), int(element[1]), []
    found = one_after_the_other([scene_of(body, element, finest * k) for k in (4, 2, 1)])
    for solved, price in zip(found, convergence_table([one.level for one in found], 0.0), strict=False):
        true, row = reference.errors(solved.solution), {"scene": f"{body}, {element}", "unknowns": price.dofs}
        for of in COLUMNS:
            estimated, error = getattr(price, of), true[of]
            doubtful = "~" if error and error < 3 * (own[of] or 0.0) else ""
            known = estimated is not None and error and error > ROUND_OFF
            row[of] = f"{estimated / error:.2f}{doubtful} ({error:.0e})" if known else "-"
        rows.append(row)
    return rows


def asked(body: str, element: str) -> list[dict]:
    """One row for each quantity that is asked for."""
    reference, _ = reference_of(body)
    rows = []
    for of, target in TARGETS.items():
        scene = scene_of(body, element).model_copy(update={"accuracy": Accuracy(target=target, of=of, seconds=BUDGET)})
        begin = time.process_time()
        solution = solve(scene, MPI.COMM_SELF, check=False)
        seconds, true = time.process_time() - begin, reference.errors(solution)[of]
        estimated = f"{getattr(solution.convergence_table[-2], of):.1e}" if len(solution.levels) > 1 else "-"
        rows.append(
            {
                "scene": f"{body}, {element}",
                "of": of,
                "asked": target,
                "estimated": estimated + ("" if solution.converged else f" ({solution.status.value})"),
                "true": f"{true:.1e}{'' if true <= target else ' not met'}",
                "meshes": len(solution.levels),
                "unknowns": solution.model.dofs,
                "seconds": f"{seconds:.1f}",
            }
        )
    return rows


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results"), help="folder (default: %(default)s)")
    options = parser.parse_args()
    time.perf_counter = time.process_time  # other programs take no part of the budget
    tables: dict[str, list[dict]] = {"effectivity_in_space": [], "asked_accuracy_in_space": []}
    for body, (_, elements) in BODIES.items():
        for element in elements:
            for rows, measure in zip(tables.values(), (effectivity, asked), strict=True):
                rows += (new := measure(body, element))
                for row in new:
                    print(*row.values(), sep=" | ", flush=True)
        for name, rows in tables.items():
            write_csv(options.out / f"{name}.csv", rows)


if __name__ == "__main__":
    main()
