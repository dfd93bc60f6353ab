"""Random scenes of two bodies in space whose facets match where they meet, and true errors of their displacements.

    ./env python3 tests/support/pairs_in_space.py [SEEDS] [FIRST] [degree=1] [kind=bonded]

prints guaranteed bounds over true errors.
"""

import sys
from functools import partial
from pathlib import Path

import numpy as np
from mpi4py import MPI

sys.path.append(str(Path(__file__).resolve().parents[2]))

import bounds_of_pairs
from error_bounds_in_space import energy_of_difference
from scenes import alone

from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene


def drawn(seed, **kinds):
    """Two random boxes, one on the other, of one load step.

    Args:
        seed: of the draw.
        kinds: what is not drawn: ``friction``, ``held`` (else by contact alone), ``degree``, ``kind`` of the contact;
            with ``unmatched`` facets do not match, and bodies may be of other sizes, shifted and turned.
    """
    chance = np.random.default_rng([seed, 17])
    pick = chance.choice
    size, shape = chance.uniform(0.7, 1.4, 2), chance.integers(1, 4, 2)
    height, layers = chance.uniform(0.5, 1.2, 2), chance.integers(1, 3, 2)
    young, poisson = 10 ** chance.uniform(2, 4, 2), pick([0.0, 0.3, 0.45], 2)
    stress = 1e-3 * float(young.min())
    sizes, shapes, lower = [size, size], [shape, shape], {}
    if kinds.get("unmatched"):
        more = np.random.default_rng([seed, 18])
        shapes = [more.integers(1, 5, 2), more.integers(1, 5, 2)]
        if more.random() < 0.6:
            sizes[1] = size * more.uniform(0.7, 1.7, 2)
            lower = {"shift": [*map(float, more.uniform(-0.3, 0.1, 2)), 0.0]}
        if more.random() < 0.5:
            lower |= {"rotation": [0.0, 0.0, float(more.uniform(-30, 30))], "pivot": [*map(float, sizes[1] / 2), 0.0]}
    meshes = [
        {
            "generator": "box",
            "parameters": {
                "length": float(wide[0]),
                "width": float(wide[1]),
                "height": float(high),
                "nx": int(cells[0]),
                "ny": int(cells[1]),
                "nz": int(count),
                "cell": "tetrahedron",
            },
        }
        for wide, cells, high, count in zip(sizes, shapes, height, layers, strict=True)
    ]
    apart = float(chance.uniform(0, 2e-3)) if chance.random() < 0.3 else 0.0
    deep = 1e-3 * float(chance.uniform(0, 2))
    gap = pick(["0.0", "0.0", f"{deep}*(x[0] - 0.4)**2", f"{deep}*abs(x[1] - 0.5)", f"{-deep / 3}"])
    friction = {"law": "none"}
    if kinds.get("friction", chance.random() < 0.5):
        friction, apart = {"law": "tresca", "bound": float(stress * 10 ** chance.uniform(-1.5, 0))}, 0.0
    contact = {
        "boundary": "upper.bottom",
        "against": "lower.top",
        "points": str(pick(["boundary", "against", "auto"])),
        "kind": kinds.get("kind", "unilateral"),
    }
    if contact["kind"] == "bonded":
        apart = 0.0
    else:
        contact |= {"gap": str(gap), "friction": friction}
    support = [{"boundary": "lower.bottom", "x": 0.0, "y": 0.0, "z": 0.0}]
    loads = [{"boundary": "upper.right", "x": stress * float(chance.normal()), "y": stress * float(chance.normal())}]
    if kinds.get("held", bool(chance.random() < 0.6)):
        down = 3e-3 * float(chance.uniform(0.5, 2))
        tilt = [down / side * float(chance.uniform(-0.8, 0.8)) for side in size]
        moved = f"{-down} + {tilt[0]}*x[0] + {tilt[1]}*x[1]"
        support.append({"boundary": "upper.top", "x": 1e-3 * float(chance.normal()), "y": 0.0, "z": moved})
    else:
        support.append({"boundary": "upper.left", "x": 0.0})
        support.append({"boundary": "upper.front", "y": 0.0})
        loads.append({"boundary": "upper.top", "z": float(-stress * chance.uniform(0.5, 2))})
    scene = {
        "body": [
            {"name": "upper", "mesh": meshes[0], "shift": [0.0, 0.0, float(height[1] + apart)]},
            {"name": "lower", "mesh": meshes[1]} | lower,
        ],
        "element": {"degree": kinds.get("degree", int(pick([1, 1, 2])))},
        "material": [
            {"region": name, "young": float(e), "poisson": float(nu)}
            for name, e, nu in zip(("upper", "lower"), young, poisson, strict=True)
        ],
        "displacement": support,
        "traction": loads,
        "contact": contact,
    }
    if chance.random() < 0.3:
        scene["body_force"] = {"z": -stress}
    return parse_scene(scene)


def on_finer_mesh(scene):
    """The scene on tetrahedra that are twice finer, of degree 2."""
    tagged = refine(load_mesh(scene, MPI.COMM_SELF))
    element = scene.element.model_copy(update={"degree": 2})
    if scene.element.degree == 2:
        tagged = refine(tagged)
    return alone(scene.model_copy(update={"mesh": tagged, "body": (), "element": element}))


effectivity = partial(bounds_of_pairs.effectivity, finer=on_finer_mesh, distance=energy_of_difference)


if __name__ == "__main__":
    many, first = (int(word) for word in (*sys.argv[1:3], *("100", "0")[len(sys.argv[1:3]) :]))
    ratios, kinds = [], dict(word.split("=") for word in sys.argv[3:])
    kinds = {key: int(value) if value.isdigit() else value for key, value in kinds.items()}
    for number in range(first, first + many):
        found = effectivity(scene := drawn(number, **kinds))
        if isinstance(found, str):
            print(number, found, flush=True)
            continue
        ratio, _, true, bound, _, reference = found
        ratios.append(ratio)
        low, high = bound.strain_energy
        wrong = "" if low <= reference.last_step.strain_energy <= high else "WRONG ENERGY"
        shares = ", ".join(f"{name} {getattr(bound, name):.2g}" for name in ("duality", "moved", "data", "round_off"))
        kind = f"degree {scene.element.degree} {scene.contact[0].friction.law}"
        print(f"{number} {kind} {ratio:.3f} true {true:.1%}: {shares} {wrong}", flush=True)
    least, middle, most = min(ratios), np.median(ratios), max(ratios)
    print(f"{len(ratios)} of {many}: {least:.3f}, {middle:.2f}, {np.quantile(ratios, 0.9):.2f}, {most:.2f}")
