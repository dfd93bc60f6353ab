"""Random scenes with graded moduli, and true errors of their displacements against solutions on finer meshes, whose
moduli are constant in each cell.

    ./env python3 tests/support/graded_scenes.py plane | space | pair | shape [SEEDS] [FIRST]

prints guaranteed bounds over true errors, and what the finer solutions say against the interval of the energy.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[2]))

import bounds_on_shapes
import error_bounds
from heated_scenes import STUDIES
from scenes import alone

from signorini_fx.addons.bounds.error_bound import error_bound
from signorini_fx.errors import SignoriniError
from signorini_fx.quantities.statements import Refused
from signorini_fx.scenes.reading import parse_scene


def graded(scene, seed):
    """The scene with moduli that are between a fifth and all of what they were."""
    chance = np.random.default_rng([seed, 41])
    plane = not hasattr(scene.mesh, "mesh") or scene.mesh.mesh.geometry.dim == 2
    length = float(scene.mesh.parameters["length"]) if plane and not scene.body else 2.0
    steep = float(chance.uniform(0.2, 0.8)) / (length if plane else 2.0)
    grading = chance.choice(
        [
            f"1 - {steep}*abs(x[0])",
            f"1 - {steep / 3}*x[0]**2 - {steep / 20}*abs(x[1])",
            f"0.2 + {steep}*(x[0] - {0.37 * length})**2",
            f"where(x[0] < {0.37 * length}, 1, 0.6 + {steep / 10}*x[0])",
        ]
    )
    materials = [
        {key: getattr(one, key) for key in one.model_fields_set} | {"grading": str(grading)} for one in scene.material
    ]
    fields = {key: getattr(scene, key) for key in scene.model_fields_set}
    return parse_scene(fields | {"material": materials})


def drawn(kind, seed):
    """A scene of a study, see ``heated_scenes.drawn``."""
    if kind == "shape":
        return graded(bounds_on_shapes.on_shape(error_bounds.drawn(seed), seed), seed)
    return graded(STUDIES[kind].drawn(seed), seed)


def effectivity(kind, seed):
    """Bound over true error, the bound, and what the finer solution refutes; or why there is none."""
    study, scene = STUDIES[kind], drawn(kind, seed)
    try:
        solution = alone(scene)
        bound = error_bound(solution.model, solution.displacement, solution.contact)
        if isinstance(bound, str):
            return bound
        reference = study.on_finer_mesh(scene)
        true = study.energy_of_difference(solution, reference)
    except (SignoriniError, Refused) as failed:
        return str(failed).splitlines()[0]
    low, high = bound.strain_energy
    energy = reference.last_step.strain_energy
    wrong = [] if low <= energy <= high else [f"energy {low:.5g} {energy:.5g} {high:.5g}"]
    return bound.error / true, bound, wrong


if __name__ == "__main__":
    kind, many, first = sys.argv[1], *(int(word) for word in (*sys.argv[2:4], *("100", "0")[len(sys.argv[2:4]) :]))
    ratios = []
    for number in range(first, first + many):
        found = effectivity(kind, number)
        if isinstance(found, str):
            print(number, found, flush=True)
            continue
        ratio, bound, wrong = found
        ratios.append(ratio)
        degree = drawn(kind, number).element.degree
        shares = ", ".join(f"{name} {getattr(bound, name):.2g}" for name in ("duality", "moved", "data", "round_off"))
        print(
            f"{number} {degree} {ratio:.3f} true {bound.error / ratio / bound.size:.1%}: {shares} {wrong}", flush=True
        )
    least, middle, most = min(ratios), np.median(ratios), max(ratios)
    print(f"{len(ratios)} of {many}: {least:.3f}, {middle:.2f}, {np.quantile(ratios, 0.9):.2f}, {most:.2f}")
