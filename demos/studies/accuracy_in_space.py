"""Bodies in 3D: how good the estimates are, and whether an accuracy that is asked for is met.

    ./env python3 demos/studies/accuracy_in_space.py --out results/accuracy_in_space

Every scene is solved on three uniform meshes, each with cells half as large as the one before, and asked for an
accuracy of displacement, contact pressure and force.  Both are measured against the scene without regularisation on
hexahedra, whose own error is what the next coarser one says.  Written are effectivity.csv, asked.csv and their tables.
"""

from __future__ import annotations

import argparse
import time
from functools import cache
from pathlib import Path

import numpy as np
from mpi4py import MPI
from reference import Reference, reference_errors

from signorini_fx.machine.csv_text import write_csv
from signorini_fx.mechanics.statement.mesh_sources import MeshGenerator
from signorini_fx.mechanics.statement.settings import Accuracy, SolverSettings
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve

QUANTITIES = ("energy", "pressure", "force")
TARGETS = {"energy": 0.25, "pressure": 0.2, "force": 0.02}
# A run that takes longer ends by name.
BUDGET = {"seconds": 60.0}
BOWL = "0.003 * ((x[0] - 1.5)**2 + (x[1] - 0.5)**2) + 0.001"


def block(cell: str, friction: dict | None = None, gap: str = BOWL, degree: int = 1, **more) -> Scene:
    """A block of 3 x 1 x 1 over a bowl, pressed in the middle of its top and pulled along x[1]."""
    return parse_scene(
        {
            "mesh": {"generator": "box", "parameters": {"nx": 24, "ny": 8, "nz": 8, "cell": cell}},
            "element": {"degree": degree},
            "material": {"young": 5000.0, "poisson": 0.4},
            "displacement": [{"boundary": name, "x": 0.0, "y": 0.0} for name in ("left", "right")],
            "traction": {"boundary": "top", "y": "4 if 1 <= x[0] <= 2 else 0", "z": "-20 if 1 <= x[0] <= 2 else 0"},
            "contact": {"boundary": "bottom", "gap": gap, "friction": friction or {"law": "none"}},
            **more,
        }
    )


def sphere(cell: str) -> Scene:
    """A quarter of a block on a sphere (as a paraboloid): Hertz, with a contact radius of 0.3 of the block."""
    return parse_scene(
        {
            "mesh": {
                "generator": "box",
                "parameters": {"length": 1.0, "width": 1.0, "height": 1.0, "nx": 12, "ny": 12, "nz": 12, "cell": cell},
            },
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [
                {"boundary": "left", "normal": 0.0},
                {"boundary": "front", "normal": 0.0},
                {"boundary": "top", "z": -0.06},
            ],
            "contact": {"boundary": "bottom", "gap": "(x[0]**2 + x[1]**2) / 2"},
        }
    )


def brick(cell: str) -> Scene:
    """A brick that friction alone holds, pushed obliquely: contact all over its base, up to the edges."""
    parameters = {"length": 2.0, "width": 2.0, "height": 1.0, "nx": 12, "ny": 12, "nz": 6, "cell": cell}
    return parse_scene(
        {
            "mesh": {"generator": "box", "parameters": parameters},
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "pressure": "10 + 2 * x[0]"},
            "body_force": {"x": 2.0, "y": 1.5},
            "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.4}},
        }
    )


def foot(cell: str) -> Scene:
    """A block that leans on an inclined foundation with half of its base: the gap ends there with a step."""
    gap = "0.0 if x[0] <= 1.5 else 0.02"
    return block(cell, {"law": "tresca", "bound": 1.0}, gap, traction={"boundary": "top", "pressure": 10.0})


TRESCA, COULOMB = {"law": "tresca", "bound": 1.5}, {"law": "coulomb", "coefficient": 0.3}
SCENES = {
    "block, P1": lambda: block("tetrahedron"),
    "block, Q1": lambda: block("hexahedron"),
    "block, Q2": lambda: block("hexahedron", degree=2),
    "block, Tresca, P1": lambda: block("tetrahedron", TRESCA),
    "block, Tresca, Q1": lambda: block("hexahedron", TRESCA),
    "block, Coulomb, P1": lambda: block("tetrahedron", COULOMB),
    "block, Coulomb, Q1": lambda: block("hexahedron", COULOMB),
    "sphere, P1": lambda: sphere("tetrahedron"),
    "sphere, Q1": lambda: sphere("hexahedron"),
    "brick, P1": lambda: brick("tetrahedron"),
    "brick, Q1": lambda: brick("hexahedron"),
    "foot, P1": lambda: foot("tetrahedron"),
}


def on_mesh(scene: Scene, factor: float, **changed) -> Scene:
    """The scene with cells so many times as large, with other parameters of its mesh and no accuracy."""
    counts = {name: max(1, round(scene.mesh.parameters[name] / factor)) for name in ("nx", "ny", "nz")}
    mesh = MeshGenerator(generator="box", parameters={**scene.mesh.parameters, **counts, **changed})
    return scene.model_copy(update={"mesh": mesh, "accuracy": None})


@cache
def references(name: str) -> tuple[Reference, dict]:
    """The finest solution, and how far it may be wrong; the same for tetrahedra and hexahedra."""
    scene = SCENES[name]()
    limit = scene.model_copy(update={"solver": SolverSettings(algorithm="alm")})
    element = scene.element.model_copy(update={"degree": 2})
    limit = limit.model_copy(update={"element": element})
    far, near, finest = (solve(on_mesh(limit, k, cell="hexahedron"), MPI.COMM_SELF) for k in (4, 2, 1))
    reference = Reference(finest)
    return reference, reference_errors(reference.errors(near), reference.errors(far))


def common(name: str) -> str:
    """The scene whose reference serves this one."""
    first = name.rsplit(", ", 1)[0]
    return next(other for other in SCENES if other.rsplit(", ", 1)[0] == first)


def effectivity(name: str) -> list[dict]:
    """One row for each mesh and quantity."""
    reference, own = references(common(name))
    scene, found, rows = SCENES[name](), [], []
    finest = scene.element.degree  # with about the same unknowns
    nested = scene.model_copy(update={"solver": SolverSettings(levels=3)})
    found.append(solve(on_mesh(nested, finest), MPI.COMM_SELF, on_level=found.append))
    for solution, price in zip(found, found[-1].convergence_table, strict=False):
        errors = reference.errors(solution)
        for of in ("energy", "pressure", "force", "peak", "zone"):
            estimated, error = getattr(price, of), errors[of]
            known = estimated is not None and bool(error)
            rows.append(
                {
                    "scene": name,
                    "dofs": price.dofs,
                    "of": of,
                    "estimated": estimated,
                    "true": error,
                    "effectivity": estimated / error if known else None,
                    "doubtful": error is not None and error < 3 * (own[of] or 0.0),
                }
            )
    return rows


def asked(name: str) -> list[dict]:
    """One row for each quantity that is asked for."""
    reference, own = references(common(name))
    rows = []
    for of, target in TARGETS.items():
        scene = SCENES[name]().model_copy(update={"accuracy": Accuracy(target=target, of=of, **BUDGET)})
        begin = time.process_time()
        solution = solve(scene, MPI.COMM_SELF, check=False)
        seconds = time.process_time() - begin
        true = reference.errors(solution)[of]
        rows.append(
            {
                "scene": name,
                "of": of,
                "asked": target,
                "status": solution.status.value,
                "estimated": getattr(solution.convergence_table[-2], of) if len(solution.levels) > 1 else None,
                "true": true,
                "reference_error": own[of],
                "met": true <= target,
                "meshes": len(solution.levels),
                "dofs": solution.model.dofs,
                "seconds": seconds,
            }
        )
    return rows


def effectivity_table(rows: list[dict]) -> str:
    """Effectivity and, in parentheses, the true error of each mesh, in Markdown."""
    names = ("energy", "pressure", "force", "peak", "zone")
    lines = [f"| scene | unknowns | {' | '.join(names)} |", "|" + "---|" * (2 + len(names))]
    for name, dofs in dict.fromkeys((row["scene"], row["dofs"]) for row in rows):
        cells = []
        for of in names:
            (row,) = (r for r in rows if (r["scene"], r["dofs"], r["of"]) == (name, dofs, of))
            mark = "~" if row["doubtful"] else ""
            balanced = row["true"] is not None and row["true"] < 1e-9
            known = row["effectivity"] is not None and not balanced
            cells.append(f"{row['effectivity']:.2f}{mark} ({row['true']:.0e})" if known else "-")
        lines.append(f"| {name} | {dofs} | {' | '.join(cells)} |")
    return "\n".join(lines)


def asked_table(rows: list[dict]) -> str:
    """What was asked for and what came out, in Markdown."""
    lines = ["| scene | of | asked | estimated | true | meshes | unknowns | seconds |", "|" + "---|" * 8]
    for row in rows:
        how = "" if row["status"] == "converged" else f" ({row['status']})"
        estimated = "-" if row["estimated"] is None else f"{row['estimated']:.1e}"
        true = f"{row['true']:.1e}{'' if row['met'] else ' **not met**'}"
        lines.append(
            f"| {row['scene']} | {row['of']} | {row['asked']:g} | {estimated}{how} | {true} | {row['meshes']} "
            f"| {row['dofs']} | {row['seconds']:.1f} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--out", type=Path, default=Path("results/accuracy_in_space"), help="folder (default: %(default)s)"
    )
    parser.add_argument("--scene", choices=SCENES, action="append", help="only this one")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    good: list[dict] = []
    met: list[dict] = []
    for name in options.scene or SCENES:
        begin = time.perf_counter()
        good += effectivity(name)
        met += asked(name)
        print(f"{name}: {time.perf_counter() - begin:.1f} s", flush=True)
        write_csv(options.out / "effectivity.csv", good)
        write_csv(options.out / "asked.csv", met)
        text = f"{effectivity_table(good)}\n\n{asked_table(met)}\n"
        (options.out / "tables.md").write_text(text, encoding="utf-8")
    print(text)
    for of in QUANTITIES:
        seen = [row["effectivity"] for row in good if row["of"] == of and row["true"] > 1e-9 and row["effectivity"]]
        if not seen:
            continue
        print(f"{of}: {min(seen):.2f} to {max(seen):.2g}, median {np.median(seen):.2g}")
    converged = [row for row in met if row["status"] == "converged"]
    print(f"{len(converged)} of {len(met)} converged; of these {sum(row['met'] for row in converged)} have met it")


if __name__ == "__main__":
    main()
