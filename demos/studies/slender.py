"""Slender bodies that peel off: linear solves with proposed sets and without them (docs/evidence/slender.csv).

    ./env python3 demos/studies/slender.py [--scenes 200] [--out FILE]

Beams, strips and plates lie on a foundation and are lifted at an end, in the middle or by a force, with and without
weight, on flat and wavy foundations, without friction and with Tresca's and Coulomb's.  Full steps alone lose a few
contact nodes with each linear solve.  Every scene is solved both ways, in one run; the displacements must be the same.
The second table is that of the heavy beam by its thickness.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import numpy as np
from mpi4py import MPI

from signorini_fx.algebra.algorithms import ssn
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve

LAWS = {"none": None, "tresca": {"law": "tresca", "bound": 0.05}, "coulomb": {"law": "coulomb", "coefficient": 0.3}}


def heavy_beam(h: float, *, cells: int = 400, rows: int = 2, degree: int = 2, **solver: object) -> Scene:
    """A beam of length 10 under its weight whose clamped end is lifted so far that 6.58 of it are off the ground."""
    length, young, weight = 10.0, 1e6, 0.16
    lift = weight * 5.0**4 / (2 * young * h**3)
    parameters = {"length": length, "height": h, "nx": cells, "ny": rows}
    return parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": parameters},
            "element": {"degree": degree},
            "material": {"young": young, "poisson": 0.0},
            "displacement": [{"boundary": "left", "x": 0.0, "y": lift}],
            "body_force": {"y": -weight / h},
            "contact": {"boundary": "bottom", "gap": 0.0},
            "solver": solver,
        }
    )


def random_scene(seed: int) -> tuple[str, Scene]:
    """A slender body, and the law of its friction."""
    random = np.random.default_rng(seed)
    space, law = random.random() < 0.25, str(random.choice(list(LAWS)))
    h, young = float(10 ** random.uniform(np.log10(0.05), np.log10(0.5))), 1e6
    weight = 0.0 if random.random() < 0.2 else 0.16
    lifted = float(random.uniform(2.0, 6.0))
    lift = float(max(weight, 0.02) * lifted**4 / (2 * young * h**3))
    where = str(random.choice(["end", "middle", "force"]))
    wave = float(random.choice([0.0, 0.1, 0.3])) * lift
    up = "z" if space else "y"
    if space:
        cells = {"nx": int(random.integers(30, 50)), "ny": int(random.integers(2, 6)), "nz": 2}
        mesh = {"generator": "box", "parameters": {"length": 10.0, "width": 2.0, "height": h, **cells}}
    else:
        cells = {"nx": int(random.integers(100, 500)), "ny": int(random.integers(1, 4))}
        mesh = {"generator": "rectangle", "parameters": {"length": 10.0, "height": h, **cells}}
    held = {"boundary": "left", "x": 0.0, **({"y": 0.0} if space else {})}
    scene: dict[str, object] = {
        "mesh": mesh,
        "element": {"degree": 1 if space else int(random.integers(1, 3))},
        "material": {"young": young, "poisson": float(random.choice([0.0, 0.3]))},
        "contact": {"boundary": "bottom", "gap": f"{wave} * (1 - cos(2 * pi * x[0] / 3))"},
        "displacement": [held | {up: lift}],
    }
    if LAWS[law] is not None:
        scene["contact"] |= {"friction": LAWS[law]}  # type: ignore[operator]
    if weight > 0:
        scene["body_force"] = {up: -weight / h}
    if where == "middle":  # a blister: both ends are held down, a part of the top is pulled
        scene["displacement"] = [held | {up: 0.0}, {**held, "boundary": "right", up: 0.0}]
        pull = float(random.uniform(1.5, 4.0)) * max(weight, 0.02)
        scene["traction"] = {"boundary": "top", up: f"{pull} if 4 <= x[0] <= 6 else {-0.0 if weight > 0 else -0.02}"}
    elif where == "force":
        scene["displacement"] = [{**held, "boundary": "right", up: 0.0}]
        scene["traction"] = {
            "boundary": "left",
            up: float(random.uniform(0.3, 1.5)) * max(weight, 0.02) * lifted / 3 / h,
        }
        if weight == 0:
            scene["body_force"] = {up: -0.02 / h}
    elif weight == 0:
        scene["traction"] = {"boundary": "top", up: "-0.05 if x[0] >= 6 else 0"}
    return law, parse_scene(scene)


@dataclass(frozen=True)
class Counts:
    """What one way took: linear solves, factorisations, how it ended, and CPU seconds."""

    solves: int
    factorisations: int
    status: str
    seconds: float
    displacement: np.ndarray


def counted(scene: Scene, *, proposals: bool) -> Counts:
    """Solve a scene, with proposed sets or without."""
    never = mock.patch.object(ssn, "SLOW_STEPS", sys.maxsize)
    start = time.process_time()
    if proposals:
        solution = solve(scene, MPI.COMM_SELF, check=False)
    else:
        with never:
            solution = solve(scene, MPI.COMM_SELF, check=False)
    iterations, seconds = solution.history.iterations, time.process_time() - start
    factorised = sum(record.factorised for record in iterations)
    return Counts(len(iterations), factorised, solution.status.value, seconds, solution.displacement.x.array.copy())


def main() -> int:
    """Write the table; exit code 1 if two ways that both converge have other displacements."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--out", type=Path, default=None)
    given = parser.parse_args()
    wrong, rows = 0, list[list[object]]()
    by_kind: dict[str, list[tuple[Counts, Counts]]] = {}
    for h in (0.4, 0.2, 0.1, 0.05):
        scene = heavy_beam(h)
        before, after = (counted(scene, proposals=on) for on in (False, True))
        by_kind[f"heavy beam, h = {h:g}"] = [(before, after)]
    for seed in range(given.first, given.first + given.scenes):
        law, scene = random_scene(seed)
        kind = f"random, {'space' if scene.mesh.generator == 'box' else 'plane'}, {law}"
        before, after = (counted(scene, proposals=on) for on in (False, True))
        by_kind.setdefault(kind, []).append((before, after))
        if before.status == after.status == "converged":
            size = np.abs(before.displacement).max()
            away = np.abs(before.displacement - after.displacement).max() / size
            if away > 1e-6:
                wrong += 1
                print(f"seed {seed}: displacements differ by {away:.1e}", flush=True)
        elif before.status != after.status:
            print(f"seed {seed}: {before.status} -> {after.status}", flush=True)
        print(seed, kind, before.solves, after.solves, after.factorisations, after.status, flush=True)
    for kind, pairs in sorted(by_kind.items()):
        for way, counts in (("full steps", [b for b, _ in pairs]), ("proposed sets", [a for _, a in pairs])):
            solves = np.array([count.solves for count in counts])
            rows.append(
                [
                    kind,
                    way,
                    len(counts),
                    sum(count.status == "converged" for count in counts),
                    *(int(np.percentile(solves, share)) for share in (50, 90, 100)),
                    int(np.median([count.factorisations for count in counts])),
                    f"{sum(count.seconds for count in counts):.1f}",
                ]
            )
    head = ["scenes", "way", "number", "converged", "solves, median", "90 %", "most", "factorisations, median", "CPU s"]
    with given.out.open("w", newline="", encoding="utf-8") if given.out else sys.stdout as file:
        csv.writer(file, lineterminator="\n").writerows([head, *rows])
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())
