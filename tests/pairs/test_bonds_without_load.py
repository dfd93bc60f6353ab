"""A block that is bonded beneath another one, pressed on a foundation and lifted off it: no load is
left at all.
"""

import numpy as np
import pytest
from scene_tables import coulomb_friction, rectangle_mesh
from scenes import alone

from signorini_fx.scenes.reading import parse_scene

FACTORS = (1.0, 0.4, -1.3)


def hanging(**solver):
    """The upper block is moved down and aside, less far, and up."""
    sizes = {"lower": (2.3, 1.3, 3, 1), "upper": (2.6, 0.6, 7, 2)}
    bodies = [
        {
            "name": name,
            "shift": [0.0, 1.3 * k],
            "mesh": rectangle_mesh(size[2], size[3], length=size[0], height=size[1]),
        }
        for k, (name, size) in enumerate(sizes.items())
    ]
    return parse_scene(
        {
            "body": bodies,
            "material": [
                {"region": "lower", "young": 1120.5, "poisson": -0.3},
                {"region": "upper", "young": 1120.5, "poisson": 0.3},
            ],
            "displacement": {
                "boundary": "upper.top",
                "x": -3.47e-4,
                "y": -3.09e-4,
                "factors": list(FACTORS),
            },
            "contact": [
                {
                    "boundary": "lower.top",
                    "against": "upper.bottom",
                    "points": "boundary",
                    "kind": "bonded",
                },
                {"boundary": "lower.bottom", "friction": coulomb_friction(0.23)},
            ],
            "solver": solver,
        }
    )


@pytest.mark.one_quick(
    "solver", [{"algorithm": "alm"}, {"algorithm": "alm", "coulomb": "newton"}, {}]
)
def test_lifted(solver):
    """The bodies hang on the support without stress: that is found in a few solves, by the method
    asked for.
    """
    solution = alone(hanging(**solver))
    lifted = solution.steps[-1]
    assert lifted.linear_solves <= 12
    assert solution.certificate.law.regularised == (not solver)
    moved = np.array([-3.47e-4, -3.09e-4]) * FACTORS[-1]
    difference = solution.displacement.x.array.reshape(-1, 2) - moved
    assert np.abs(difference).max() <= 1e-9 * np.abs(moved).max()
