"""Bodies of very unequal loads and stiffness in one scene: none stops the iteration of another one
too early.
"""

from functools import cache

import numpy as np
import pytest
from scenes import alone

from signorini_fx.scenes.reading import parse_scene

# Of the largest pressure of each body: what a tolerance of 1e-7 leaves of a fixed point.
NEAR = 1e-6


def scene(*sizes, algorithm="ssn", coulomb="fp", degree=1, steps=0):
    """Blocks beside each other, pressed onto the ground and pushed aside; size, and modulus over
    1000, of each.
    """
    data = {
        "body": [],
        "element": {"degree": degree},
        "solver": {"algorithm": algorithm, "coulomb": coulomb, "gamma_n": 1e7, "gamma_t": 1e7},
        "load_steps": {"steps": steps} if steps else {},
    }
    for k, (size, soft, coefficient) in enumerate(sizes):
        name, x0, mesh = (
            "abc"[k],
            3.0 * k,
            {"length": 1.0, "height": 0.5, "nx": 8, "ny": 3, "cell": "quadrilateral"},
        )
        sample = {
            "material": {"region": name, "young": 1e3 * soft, "poisson": 0.3},
            "displacement": {"boundary": f"{name}.left", "x": 0.0},
            "traction": {"boundary": f"{name}.top", "y": -size},
            "contact": {
                "boundary": f"{name}.bottom",
                "gap": f"{1e-4 * size / soft!r} * (x[0] - {x0}) ** 2",
                "friction": {"law": "coulomb", "coefficient": coefficient},
            },
        }
        data["body"].append(
            {
                "name": name,
                "mesh": {"generator": "rectangle", "parameters": mesh},
                "shift": [x0, 0.0],
            }
        )
        for key, entry in sample.items():
            data.setdefault(key, []).append(entry)
        data["traction"].append({"boundary": f"{name}.right", "x": -size})
    return parse_scene({key: value for key, value in data.items() if value})


def tractions(solution, part):
    """Pressure and shear on the ground of one body, in order from left to right."""
    boundary = solution.contact.boundary
    here = np.flatnonzero(boundary.part == part)
    order = here[np.argsort(boundary.x[here, 0])]
    return np.column_stack((solution.contact.pressure, solution.contact.shear))[order]


@cache
def unpaired(*size, **options):
    """Tractions of a body that is alone in its scene."""
    return tractions(alone(scene(size, **options)), 0)


@pytest.mark.one_quick(
    ("algorithm", "coulomb", "small", "steps"),
    [
        ("ssn", "fp", (1e-8, 1.0, 0.3), 0),
        ("alm", "fp", (1e-7, 1.0, 0.3), 0),
        ("ssn", "fp", (1e-7, 1e-2, 0.3), 2),
    ],
)
def test_a_small_body_is_solved_as_if_it_were_alone(algorithm, coulomb, small, steps):
    """The Coulomb iteration stopped, and old factors served as preconditioners, by norms over all
    bodies.
    """
    options = {"algorithm": algorithm, "coulomb": coulomb, "steps": steps}
    bodies = (1.0, 1.0, 0.01), small
    solution = alone(scene(*bodies, **options))
    assert solution.certificate.holds
    for part, body in enumerate(bodies):
        expected = unpaired(*body, **options)
        assert tractions(solution, part) == pytest.approx(
            expected, abs=NEAR * np.abs(expected).max()
        )
