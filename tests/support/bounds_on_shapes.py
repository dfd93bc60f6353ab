"""Random scenes on foundations with shapes, and true errors of their displacements against solutions on finer meshes.

    ./env python3 tests/support/bounds_on_shapes.py DIMENSION [SEEDS] [FIRST] [round | plane | driven]

prints guaranteed bounds over true errors, from which ``docs/evidence/bounds_on_shapes.csv`` was made.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[2]))

import error_bounds
import error_bounds_in_space

from signorini_fx.scenes.reading import parse_scene

STUDIES = {2: error_bounds, 3: error_bounds_in_space}


def on_shape(scene, seed, kind=None):
    """A random scene with a foundation that touches, or nearly touches, the bottom of its body.

    Args:
        scene: of ``error_bounds.drawn`` or ``error_bounds_in_space.drawn``.
        seed: of the draw.
        kind: "round", "plane", "driven", by a force on it, or None: any that stands still.
    """
    chance, tagged = np.random.default_rng([seed, 11]), scene.mesh
    if hasattr(tagged, "generator"):
        size = np.array([scene.mesh.parameters["length"], scene.mesh.parameters["height"]])
    else:
        size = tagged.mesh.geometry.x.max(axis=0)
    d, length = len(size), float(size[0])
    on = [float(chance.uniform(0.1, 0.9) * side) for side in size[:-1]]
    depth = length * 1e-3 * float(chance.uniform(-0.5, 2))
    if kind == "plane" or (kind in (None, "driven") and chance.random() < 0.3):
        leaning = [float(chance.uniform(-0.02, 0.02)) for _ in on]
        # It touches a corner: the other side of the body is higher.
        touched = [0.0 if slope <= 0 else float(side) for slope, side in zip(leaning, size, strict=False)]
        shape = {"shape": "plane", "point": [*touched, depth], "normal": [*(-np.array(leaning)).tolist(), 1.0]}
    else:
        radius = length * float(10 ** chance.uniform(-0.2, 1.3))
        hollow = bool(chance.random() < 0.25)
        if hollow:  # around the body, whose corners touch it
            radius = max(radius, 2 * float(np.linalg.norm(size)))
            corner = np.array([max(at, float(side) - at) for at, side in zip(on, size, strict=False)])
            centre = [*on, depth + float(np.sqrt(radius**2 - corner @ corner))]
        else:
            centre = [*on, depth - radius]
        shape = {"shape": "circle" if d == 2 else "sphere", "centre": centre, "radius": radius, "hollow": hollow}
        if d == 3 and chance.random() < 0.4:
            shape |= {"shape": "cylinder", "axis": [1.0, float(chance.normal()), 0.0]}
    friction, support = scene.contact[0].friction, scene.displacement
    if kind == "driven":
        shape, friction = shape | driven(scene, chance, shape, on), {"law": "none"}
        support = [{"boundary": scene.displacement[0].boundary} | dict.fromkeys("xyz"[:d], 0.0)]
    if d == 3 and shape["shape"] != "plane":
        friction = {"law": "none"}
    contact = {"boundary": "bottom", "foundation": shape, "friction": friction}
    fields = {key: getattr(scene, key) for key in scene.model_fields_set}
    if d == 2:  # as fine as it takes to see a circle
        cells = {key: 2 * scene.mesh.parameters[key] for key in ("nx", "ny")}
        fields["mesh"] = scene.mesh.model_copy(update={"parameters": scene.mesh.parameters | cells})
    solver = {"algorithm": "alm" if scene.solver.algorithm == "exact" else scene.solver.algorithm}
    return parse_scene(fields | {"contact": contact, "solver": solver, "displacement": support})


def driven(scene, chance, shape, on):
    """What drives a foundation: a force onto the body at some place of it; planes may turn under it."""
    d, size = len(on) + 1, 1e-3 * float(scene.material[0].young)
    turning = {2: ["rotation"], 3: ["rotation_x", "rotation_y", "rotation_z"]}[d]
    if shape["shape"] == "plane" and chance.random() < 0.7:
        turning = turning[2:]  # about its normal
    prescribed = dict.fromkeys([*"xyz"[: d - 1], *turning], 0.0)
    prescribed["x"] = float(chance.choice([0.0, 1e-3]))
    force = [0.0] * (d - 1) + [size * float(chance.uniform(0.3, 2))]
    return {"force": force, "pivot": [*on, 0.0], "prescribed": prescribed}


def effectivity(dimension, seed, kind=None):
    """Guaranteed bound over the true error, this relative to the solution, and the bound; or why there is none."""
    study = STUDIES[dimension]
    found = study.effectivity(on_shape(study.drawn(seed), seed, kind))
    if isinstance(found, str):
        return found
    bound = found[3] if dimension == 2 else found[2]
    return found[0], bound.error / found[0] / bound.size, bound


if __name__ == "__main__":
    dimension, many, first = (int(word) for word in (*sys.argv[1:4], *("2", "100", "0")[len(sys.argv[1:4]) :]))
    kinds = sys.argv[4] if len(sys.argv) > 4 else None
    ratios = {1: [], 2: []}
    for number in range(first, first + many):
        found = effectivity(dimension, number, kinds)
        if isinstance(found, str):
            print(number, found, flush=True)
            continue
        degree, (_, true, bound) = STUDIES[dimension].drawn(number).element.degree, found
        ratios[degree].append(found[0])
        shares = ", ".join(f"{name} {getattr(bound, name):.2g}" for name in ("duality", "moved", "data", "round_off"))
        print(number, degree, f"{found[0]:.3f}", f"true {true:.1%}: {shares}", flush=True)
    for degree, found in ratios.items():
        if found:
            print(f"degree {degree}: {len(found)}, {min(found):.3f}, {np.median(found):.2f}, {max(found):.2f}")
