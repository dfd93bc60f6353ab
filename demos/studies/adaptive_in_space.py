"""How good the estimate of contact forces is on meshes in 3D that are divided here and there.

    ./env python3 demos/studies/adaptive_in_space.py --seed 21 --out results/adaptive_in_space

Half a ring on a rigid pin, a ball on a plane, loaded or pressed, a plate that bends onto a bowl, a punch with a rounded
edge, a cylinder in a socket, a ball in a groove, and a lug on a pin, with parameters drawn from the seed, are asked for
their contact force with ``refinement = "adaptive"`` and elements of degree 1.  The reference is of degree 2; how far it
may be wrong is a third of what it differs from one with larger cells.  Written is adaptive_in_space.csv: estimated over
true error of each mesh, also as the changes from mesh to mesh alone tell it.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import tomllib
import zlib
from pathlib import Path

import numpy as np
from mpi4py import MPI
from effectivity import as_asked

from signorini_fx.errors import SignoriniError
from signorini_fx.machine.csv_text import write_csv
from signorini_fx.results.accuracy.force_error import force_error
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

ASKED = 0.005
RING = """SetFactory("OpenCASCADE"); Mesh.ElementOrder = {order}; Mesh.HighOrderOptimize = 0;
Point(1) = {{0, 0, 0}}; Point(2) = {{0, 1, 0}}; Point(3) = {{1, 0, 0}}; Point(7) = {{0, {outer}, 0}};
Point(8) = {{{outer}, 0, 0}};
Circle(1) = {{2, 1, 3}}; Line(2) = {{3, 8}}; Circle(3) = {{8, 1, 7}}; Line(4) = {{7, 2}};
Curve Loop(1) = {{1, 2, 3, 4}}; Plane Surface(1) = {{1}};
Extrude {{0, 0, {thick}}} {{ Surface{{1}}; }}
Physical Surface("hole") = {{2}}; Physical Surface("low") = {{3}}; Physical Surface("rim") = {{4}};
Physical Surface("symmetry") = {{5}}; Physical Surface("middle") = {{1}}; Physical Surface("side") = {{6}};
Physical Volume("ring") = {{1}};
MeshSize {{ PointsOf{{ Volume{{1}}; }} }} = {size};
"""
SOCKET = """SetFactory("OpenCASCADE"); Mesh.ElementOrder = {order}; Mesh.HighOrderOptimize = 0;
Cylinder(1) = {{0, 0, {radius}, 0, {length}, 0, {radius}}};
Box(2) = {{0, 0, 0, {radius}, {length}, {radius}}};
BooleanIntersection(3) = {{Volume{{1}}; Delete;}}{{Volume{{2}}; Delete;}};
MeshSize {{ PointsOf{{ Volume{{3}}; }} }} = {size};
e = {radius} / 1000;
round() = Surface In BoundingBox{{-e, -e, -e, {radius} + e, {length} + e, {radius} + e}};
flat() = Surface In BoundingBox{{-e, -e, -e, e, {length} + e, {radius} + e}};
flat() += Surface In BoundingBox{{-e, -e, -e, {radius} + e, e, {radius} + e}};
flat() += Surface In BoundingBox{{-e, -e, {radius} - e, {radius} + e, {length} + e, {radius} + e}};
flat() += Surface In BoundingBox{{-e, {length} - e, -e, {radius} + e, {length} + e, {radius} + e}};
round() -= flat();
Physical Surface("round") = {{round()}};
Physical Surface("axis") = {{flat(0)}}; Physical Surface("middle") = {{flat(1)}}; Physical Surface("top") = {{flat(2)}};
Physical Volume("body") = {{3}};
"""
SCENES = Path(__file__).parents[1] / "scenes"
# What is kept of these: forces that statics determines have no error.
KEPT = ("mesh", "material", "displacement", "contact")
MIRRORED = [{"boundary": "symmetry_x", "x": 0.0}, {"boundary": "symmetry_y", "y": 0.0}]


def ring(rng, folder):
    """Half a ring that hangs on a rigid pin smaller than its hole."""
    outer, thick, loose = rng.uniform(1.8, 2.6), rng.uniform(0.5, 1.0), rng.uniform(0.004, 0.02)
    poisson, pull = rng.uniform(0.1, 0.4), rng.uniform(5, 15)
    pin = {"shape": "cylinder", "centre": [0.0, -loose, 0.0], "axis": [0.0, 0.0, 1.0], "radius": 1 - loose}

    def make(degree, size):
        name = folder / f"ring_{degree}_{size:g}.geo"
        name.write_text(RING.format(outer=outer, thick=thick, size=0.4 * size, order=degree), encoding="utf-8")
        return parse_scene(
            {
                "mesh": {"file": str(name)},
                "element": {"degree": degree},
                "material": {"young": 1000.0, "poisson": poisson},
                "displacement": [{"boundary": "symmetry", "x": 0.0}, {"boundary": "middle", "z": 0.0}],
                "traction": {"boundary": "low", "y": -pull},
                "contact": {"boundary": "hole", "foundation": pin},
            }
        )

    return make


def ball(rng, folder):
    """A quarter of half a ball on a plane, with a pressure on its section."""

    def pressure(radius, wide, poisson):
        return 4 * 200 / (1 - poisson**2) * wide**3 / (3 * radius) / (math.pi * radius**2)

    return _ball(rng, lambda *of: {"traction": {"boundary": "top", "pressure": pressure(*of)}})


def pressed_ball(rng, folder):
    """The ball, whose section is moved down."""
    return _ball(
        rng, lambda radius, wide, _: {"displacement": [*MIRRORED, {"boundary": "top", "z": -(wide**2) / radius}]}
    )


def _ball(rng, acting):
    """A quarter of half a ball on a plane, and what acts by radius, half-width of contact and Poisson's ratio."""
    radius, share, poisson = rng.uniform(3, 10), rng.uniform(0.15, 0.3), rng.uniform(0, 0.4)
    wide = share * radius

    def make(degree, size):
        parameters = {"part": "quarter", "radius": radius, "size": 0.3 * radius * max(size, 0.5), "order": degree}
        sizes = {"contact_size": wide / 3 * size, "contact_zone": 1.4 * wide}
        return parse_scene(
            {
                "mesh": {"generator": "half_sphere", "parameters": parameters | sizes},
                "element": {"degree": degree},
                "material": {"young": 200.0, "poisson": poisson},
                "displacement": MIRRORED,
                "contact": {"boundary": "sphere", "gap": "x[2]", "direction": [0.0, 0.0, -1.0]},
            }
            | acting(radius, wide, poisson)
        )

    return make


def plate(rng, folder):
    """A plate that is held at its ends and bends onto a bowl."""
    length, thick, poisson = rng.uniform(3, 5), rng.uniform(0.3, 0.6), rng.uniform(0.1, 0.4)
    bend, load = rng.uniform(0.001, 0.004), rng.uniform(1, 4)
    gap = f"{bend} * ((x[0] - {length / 2})**2 + 2 * (x[1] - 0.5)**2) + {bend / 4}"

    def make(degree, size):
        counts = {"nx": round(16 / size), "ny": round(4 / size), "nz": round(2 / size)}
        cell = {"cell": "tetrahedron" if degree == 1 else "hexahedron"}
        return parse_scene(
            {
                "mesh": {
                    "generator": "box",
                    "parameters": {"length": length, "width": 1.0, "height": thick, **counts, **cell},
                },
                "element": {"degree": degree},
                "material": {"young": 2000.0, "poisson": poisson},
                "displacement": [{"boundary": name, "x": 0.0, "y": 0.0, "z": 0.0} for name in ("left", "right")],
                "traction": {"boundary": "top", "z": -load},
                "contact": {"boundary": "bottom", "gap": gap},
            }
        )

    return make


def punch(rng, folder):
    """A quarter of a cylinder with a rounded edge that is pressed onto a plane."""
    radius, rounding = rng.uniform(1.5, 3), rng.uniform(0.3, 0.6)
    poisson, height = rng.uniform(0.1, 0.4), rng.uniform(1.5, 3)

    def make(degree, size):
        shape = {"part": "quarter", "radius": radius, "height": height, "rounding": rounding, "order": degree}
        sizes = {"size": 0.5 * max(size, 0.5), "contact_size": 0.2 * size, "contact_zone": 0.3}
        return parse_scene(
            {
                "mesh": {"generator": "cylindrical_punch", "parameters": shape | sizes},
                "element": {"degree": degree},
                "material": {"young": 200.0, "poisson": poisson},
                "displacement": [*MIRRORED, {"boundary": "top", "z": -0.01 * height}],
                "contact": {"boundary": "foot", "gap": "x[2]", "direction": [0.0, 0.0, -1.0]},
            }
        )

    return make


def socket(rng, folder):
    """A quarter of a cylinder in a rigid socket, whose section is moved down."""
    radius, wider, length = rng.uniform(2, 4), rng.uniform(1.03, 1.15), rng.uniform(0.5, 1.5)
    poisson = rng.uniform(0.1, 0.4)
    around = wider * radius

    def make(degree, size):
        name = folder / f"socket_{degree}_{size:g}.geo"
        text = SOCKET.format(radius=radius, length=length, size=0.35 * radius * size, order=degree)
        name.write_text(text, encoding="utf-8")
        return parse_scene(
            {
                "mesh": {"file": str(name)},
                "element": {"degree": degree},
                "material": {"young": 200.0, "poisson": poisson},
                "displacement": [
                    {"boundary": "axis", "x": 0.0},
                    {"boundary": "middle", "y": 0.0},
                    {"boundary": "top", "z": -0.01 * radius},
                ],
                "contact": {
                    "boundary": "round",
                    "gap": f"x[2] - {around} + sqrt({around**2} - x[0]**2)",
                    "direction": [0.0, 0.0, -1.0],
                },
            }
        )

    return make


def groove(rng, folder):
    """The ball in a groove of the gallery, whose section is moved down."""
    down = rng.uniform(0.01, 0.03)

    def make(degree, size):
        scene = tomllib.loads((SCENES / "ball_in_groove.toml").read_text(encoding="utf-8"))
        name = folder / f"groove_{degree}_{size:g}.geo"
        text = (SCENES / "ball_in_groove.geo").read_text(encoding="utf-8")
        name.write_text(f"Mesh.ElementOrder = {degree}; Mesh.HighOrderOptimize = 0;\n{text}", encoding="utf-8")
        scene["mesh"] = {"file": str(name)} | ({"contact_size": 0.4 * size} if size < 1 else {})
        scene["displacement"].append({"boundary": "top", "z": -down})
        return parse_scene({key: scene[key] for key in KEPT} | {"element": {"degree": degree}})

    return make


def lug(rng, folder):
    """The lug on a pin of the gallery, whose end is moved."""
    pull = rng.uniform(0.02, 0.06)

    def make(degree, size):
        scene = tomllib.loads((SCENES / "lug_and_pin.toml").read_text(encoding="utf-8"))
        scene["mesh"] |= {"file": str(SCENES / "lug_and_pin.step"), "size": 5.0 * max(size, 0.6)}
        scene["mesh"] |= {"contact_size": 3.0 * size} if size < 1 else {}
        scene["displacement"].append({"boundary": "end", "y": pull})
        return parse_scene({key: scene[key] for key in KEPT} | {"element": {"degree": degree}})

    return make


# What is drawn, the size of the first cells, and those of the references.
PROBLEMS = {
    "ring": (ring, 1.0, (0.5, 0.3)),
    "ball": (ball, 2.0, (1.0, 0.5)),
    "plate": (plate, 1.0, (1.0, 0.5)),
    "pressed_ball": (pressed_ball, 2.0, (0.8, 0.5)),
    "punch": (punch, 1.5, (0.5, 0.38)),
    "socket": (socket, 1.0, (0.3, 0.18)),
    "groove": (groove, 1.0, (0.3, 0.2)),
    "lug": (lug, 1.0, (0.4, 0.28)),
}


def forces_of(name, seed, folder):
    """The meshes of one problem that have an estimate of the force."""
    draw, first, finest = PROBLEMS[name]
    make = draw(np.random.default_rng([seed, zlib.crc32(name.encode())]), folder)
    coarse, reference = (
        solve(make(2, size), MPI.COMM_SELF, check=False).contact.forces_of_each.ravel() for size in finest
    )
    whole, rows = np.linalg.norm(reference), []
    found, prices = as_asked(make(1, first), ASKED, of="force", refinement="adaptive", seconds=60.0)
    for number, (one, price) in enumerate(zip(found, prices, strict=False)):
        if price.force is None:
            continue
        true = np.linalg.norm(one.solution.contact.forces_of_each.ravel() - reference) / whole
        changes = force_error([mesh.level for mesh in found[: number + 1]])
        rows.append(
            {
                "problem": name,
                "seed": seed,
                "dofs": one.level.dofs,
                "last": number == len(found) - 1,
                "estimated": price.force,
                "by changes": changes,
                "true": true,
                "reference_error": np.linalg.norm(coarse - reference) / whole / 3,
                "ratio": price.force / true,
                "ratio by changes": changes / true,
            }
        )
    return rows


def main():
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/adaptive_in_space"), help="folder (%(default)s)")
    parser.add_argument("--problem", choices=PROBLEMS, action="append", help="only this one")
    parser.add_argument("--seed", type=int, action="append", help="of the parameters (default: 1)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for seed in options.seed or [1]:
        for name in options.problem or PROBLEMS:
            with tempfile.TemporaryDirectory() as folder:
                try:
                    rows += forces_of(name, seed, Path(folder))
                except (SignoriniError, AssertionError) as error:
                    print(f"{name}, seed {seed}: {error}", flush=True)
            for row in rows:
                if (row["problem"], row["seed"]) == (name, seed):
                    print({key: f"{v:.3g}" if isinstance(v, float) else v for key, v in row.items()}, flush=True)
            write_csv(options.out / "adaptive_in_space.csv", rows)


if __name__ == "__main__":
    main()
