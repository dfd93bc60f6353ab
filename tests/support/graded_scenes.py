"""Random scenes with graded moduli, and true errors of their displacements against solutions on finer meshes, whose
moduli are constant in each cell.

    ./env python3 tests/support/graded_scenes.py plane | space | pair | shape | pressed [SEEDS] [FIRST] [heated]

prints guaranteed bounds over true errors, and what the finer solutions say against other bounds.
"""

import sys
from functools import partial

import heated_scenes
import numpy as np

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


def graded_and_heated(scene, seed):
    """The scene with such moduli and with thermal strain."""
    return graded(heated_scenes.heated(scene, seed), seed)


drawn = partial(heated_scenes.drawn, change=graded)
effectivity = partial(heated_scenes.effectivity, change=graded)


if __name__ == "__main__":
    heated_scenes.main(graded_and_heated if "heated" in sys.argv else graded)
