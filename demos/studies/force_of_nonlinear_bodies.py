"""Bodies of rubber and metal: the error of the force that one mesh states, over the true one.

    ./env python3 demos/studies/force_of_nonlinear_bodies.py

writes docs/evidence/force_of_nonlinear_bodies.csv.  Twenty problems: strips and beams that turn,
with one to three nodes in contact, blocks under circles, planes and punches, two bodies, a body of
revolution and three in 3D.  The true error is that against a mesh of degree 2 whose cells are a
quarter or an eighth as long, in 3D half; ``unsure`` is how far that one is from one with cells
twice as long.  * is outside of 1/2 to 3.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from signorini_fx.machine.result_files import write_csv
from signorini_fx.records import History
from signorini_fx.scenes.mesh import scene_on
from signorini_fx.scenes.nonlinear import build_problem
from signorini_fx.scenes.reading import parse_scene

SOFT = {"law": "neo-hooke", "young": 1.0, "poisson": 0.4}
RUBBER = {"law": "neo-hooke", "young": 100.0, "poisson": 0.3}
MOONEY = {"law": "mooney-rivlin", "c10": 0.4, "c01": 0.1, "bulk": 5.0}
KIRCHHOFF = {"law": "saint-venant-kirchhoff", "young": 50.0, "poisson": 0.2}
METAL = {
    "law": "j2",
    "young": 200000.0,
    "poisson": 0.3,
    "yield_stress": 300.0,
    "hardening": 2000.0,
}
ROUGH = {"friction": {"law": "coulomb", "coefficient": 0.3}}
CLAMP = {"boundary": "left", "x": 0.0, "y": 0.0}
BASE = {"boundary": "bottom", "x": 0.0, "y": 0.0}
REDUCED = {"element": {"volumetric": "reduced"}}


def rectangle(length: float, height: float, nx: int, ny: int, cell: str = "quadrilateral") -> Any:
    """A mesh."""
    sides = {"length": length, "height": height, "nx": nx, "ny": ny, "cell": cell}
    return {"generator": "rectangle", "parameters": sides}


def box(sides: tuple[float, ...], counts: tuple[int, ...]) -> Any:
    """A mesh of hexahedra."""
    of_sides = dict(zip(("length", "width", "height"), sides, strict=True))
    of_counts = dict(zip(("nx", "ny", "nz"), counts, strict=True))
    return {"generator": "box", "parameters": {**of_sides, **of_counts, "cell": "hexahedron"}}


def circle(x: float, y: float, radius: float, *shift: str) -> dict[str, Any]:
    """Contact of the top with a circle."""
    shape = {"shape": "circle", "centre": [x, y], "radius": radius, "shift": list(shift)}
    return {"boundary": "top", "foundation": shape}


def plane(boundary: str, point: list[float], normal: list[float], *shift: str) -> dict[str, Any]:
    """Contact with a plane."""
    shape = {"shape": "plane", "point": point, "normal": normal, "shift": list(shift)}
    return {"boundary": boundary, "foundation": shape}


def sphere(centre: list[float], radius: float, down: str) -> dict[str, Any]:
    """Contact of the top with a sphere."""
    shape = {"shape": "sphere", "centre": centre, "radius": radius, "shift": ["0", "0", down]}
    return {"boundary": "top", "foundation": shape}


def scene(mesh: Any, material: Any, held: Any, contact: Any, steps: int, **more: Any) -> Any:
    """A body in so many equal load steps."""
    times = [(step + 1) / steps for step in range(steps)]
    entries = {"mesh": mesh, "material": material, "displacement": held, "contact": contact}
    return {**entries, "load_steps": {"times": times}, **more}


def bodies(young: float, cells: tuple[int, int], aside: str, **friction: Any) -> Any:
    """A crowned block on a broader one."""
    upper, lower = cells
    materials = [{**SOFT, "region": "upper"}, {**SOFT, "young": young, "region": "lower"}]
    held = [
        {"boundary": "lower.bottom", "x": 0.0, "y": 0.0},
        {"boundary": "upper.top", "x": aside, "y": "-0.08*t"},
    ]
    meshes = [
        {"name": "upper", "shift": [0.0, 1.0], "mesh": rectangle(1.0, 1.0, upper, upper)},
        {"name": "lower", "shift": [-0.5, 0.0], "mesh": rectangle(2.0, 1.0, lower, lower // 2)},
    ]
    pair = {"boundary": "upper.bottom", "against": "lower.top", "gap": "0.4 * (x[0] - 0.5)**2"}
    whole = scene(None, materials, held, {**pair, **friction}, 4, body=meshes)
    del whole["mesh"]
    return whole


def degree_2(whole: Any) -> Any:
    """The same scene with elements of degree 2."""
    return {**whole, "element": {"degree": 2}}


TIP = scene(rectangle(10, 1, 20, 2, "triangle"), RUBBER, CLAMP, circle(8, 2, 1, "0", "-t"), 2)
ENDS = [CLAMP, {"boundary": "right", "x": 0.0, "y": 0.0}]
DENT = circle(1.03, 1.5, 0.5, "0", "-0.2*t")
PUNCH = {"boundary": "bottom", "gap": "0.0 if x[0] <= 1.0 else 1.0"}
SLIDE = {"boundary": "top", "x": "0.15*t", "y": "-0.1*t"}
SYMMETRIC = [{"boundary": "left", "x": 0.0}, {"boundary": "front", "y": 0.0}]
ROUND = {**RUBBER, "hypothesis": "axisymmetric"}
# Scenes, and how often cells of the reference are halved.
SCENES: dict[str, tuple[Any, int]] = {
    "tip of a strip": (TIP, 3),
    "tip of a strip, degree 2": (degree_2(TIP), 3),
    "rough tip of a strip": (
        degree_2(
            scene(
                rectangle(8, 1, 24, 3, "triangle"),
                RUBBER,
                CLAMP,
                {**circle(6, 1.7, 0.7, "0", "-1.5*t"), **ROUGH},
                6,
            )
        ),
        2,
    ),
    "beam": (
        scene(
            rectangle(10, 0.6, 40, 3, "triangle"),
            KIRCHHOFF,
            ENDS,
            circle(4.3, 1.4, 0.8, "0", "-1.2*t"),
            4,
        ),
        2,
    ),
    "beam, degree 2": (
        degree_2(
            scene(
                rectangle(10, 0.6, 20, 2),
                KIRCHHOFF,
                ENDS,
                circle(4.3, 1.4, 0.8, "0", "-1.2*t"),
                4,
            )
        ),
        2,
    ),
    "block under a circle": (scene(rectangle(2, 1, 16, 8), RUBBER, BASE, DENT, 2), 2),
    "the same, degree 2": (degree_2(scene(rectangle(2, 1, 8, 4), RUBBER, BASE, DENT, 2)), 3),
    "block under a rough circle": (
        scene(
            rectangle(2, 1, 12, 6, "triangle"),
            RUBBER,
            BASE,
            {**circle(0.9, 1.8, 0.8, "0.05*t", "-0.15*t"), **ROUGH},
            4,
        ),
        2,
    ),
    "block under a plane": (
        scene(
            rectangle(2, 1, 12, 6), MOONEY, BASE, plane("top", [0, 1], [0, -1], "0", "-0.2*t"), 2
        ),
        2,
    ),
    "column pushed aside": (
        scene(
            rectangle(1, 3, 4, 12, "triangle"),
            RUBBER,
            BASE,
            plane("right", [1.0, 3.0], [-0.966, -0.259], "-0.8*t", "0"),
            4,
        ),
        2,
    ),
    "block that slides": (
        scene(
            rectangle(2, 1, 12, 6),
            RUBBER,
            SLIDE,
            {**plane("bottom", [0, 0], [0, 1], "0", "0"), **ROUGH},
            6,
        ),
        2,
    ),
    "punch in metal": (
        scene(
            rectangle(2, 1, 16, 8),
            METAL,
            [{"boundary": "top", "y": "-0.004*t"}, {"boundary": "left", "x": 0.0}],
            PUNCH,
            4,
            **REDUCED,
        ),
        3,
    ),
    "circle in metal": (
        scene(
            rectangle(2, 1, 16, 8),
            METAL,
            [{"boundary": "bottom", "y": 0.0}, {"boundary": "left", "x": 0.0}],
            circle(0, 4, 3, "0", "-0.008*t"),
            4,
            **REDUCED,
        ),
        3,
    ),
    "two bodies": (bodies(0.5, (6, 16), "0"), 2),
    "two rough bodies": (bodies(2.0, (8, 12), "0.02*t", **ROUGH), 2),
    "cylinder under a sphere": (
        scene(
            rectangle(1.5, 1, 12, 8),
            ROUND,
            [BASE, {"boundary": "left", "x": 0.0}],
            circle(0, 1.7, 0.7, "0", "-0.2*t"),
            2,
        ),
        2,
    ),
    "block on a bowl": (
        scene(
            rectangle(2, 1, 10, 5),
            RUBBER,
            {"boundary": "top", "x": 0.0, "y": "-0.1*t"},
            {"boundary": "bottom", "gap": "0.15 * (x[0] - 0.9)**2"},
            2,
        ),
        3,
    ),
    "block on a bowl, 3D": (
        scene(
            box((1, 1, 1), (4, 4, 4)),
            SOFT,
            [*SYMMETRIC, {"boundary": "top", "x": 0.0, "y": 0.0, "z": "-0.15*t"}],
            {"boundary": "bottom", "gap": "0.15 * (x[0]**2 + x[1]**2)"},
            2,
        ),
        1,
    ),
    "strip under a sphere, 3D": (
        scene(
            box((6, 1, 1), (18, 2, 3)),
            RUBBER,
            {**CLAMP, "z": 0.0},
            sphere([5.0, 0.5, 3.0], 2.0, "-0.6*t"),
            2,
        ),
        1,
    ),
    "block under a sphere, 3D": (
        scene(
            box((1, 1, 0.6), (5, 5, 3)),
            RUBBER,
            [{**BASE, "z": 0.0}, *SYMMETRIC],
            sphere([0.0, 0.0, 1.6], 1.0, "-0.15*t"),
            2,
        ),
        1,
    ),
}


def solved(given: Any, halvings: int = 0, degree: int | None = None) -> tuple[Any, Any]:
    """The problem and its solution with cells halved so many times."""
    one = parse_scene(given)
    if degree is not None:
        one = one.model_copy(update={"element": one.element.model_copy(update={"degree": degree})})
    problem = build_problem(scene_on(one, 0.5**halvings), MPI.COMM_SELF, History())
    solution = problem.solved()
    assert solution.converged
    return problem, solution


def apart(one: Any, other: Any) -> float:
    """The distance of the forces of two solutions, relative to those of the second."""
    forces, exact = (solution.contact.forces_of_each for solution in (one, other))
    return float(np.linalg.norm(forces - exact) / np.linalg.norm(exact))


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    default = Path(__file__).parents[2] / "docs/evidence/force_of_nonlinear_bodies.csv"
    parser.add_argument("--out", type=Path, default=default, help="file")
    parser.add_argument("--scene", choices=SCENES, action="append", help="only this one")
    options = parser.parse_args()
    rows = []
    for name in options.scene or SCENES:
        given, halvings = SCENES[name]
        problem, coarse = solved(given)
        fine, less_fine = (solved(given, halvings - k, 2)[1] for k in (0, 1))
        true, errors = apart(coarse, fine), problem.errors_of(coarse)
        ratio = errors.force / true
        row = {
            "scene": name,
            "unknowns": coarse.model.dofs,
            "nodes in contact": coarse.table.touching,
            "stated over true": f"{ratio:.2f}{'' if 0.5 <= ratio <= 3 else '*'}",
            "true": f"{true:.1e}",
            "unsure": f"{apart(less_fine, fine):.1e}",
        }
        print(*row.values(), sep=" | ", flush=True)
        rows.append(row)
    write_csv(options.out, rows)


if __name__ == "__main__":
    main()
