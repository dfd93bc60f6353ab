"""What `check` says of curved things that are pressed together in one step with friction."""

import pytest

from signorini_fx import solve
from signorini_fx.scene.reading import parse_scene

CIRCLE = {"shape": "circle", "centre": [1.5, -5.0], "radius": 5.0}
PLANE = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}


@pytest.mark.parametrize(
    ("foundation", "coefficient", "factors", "said"),
    [(CIRCLE, 0.3, None, 1), (CIRCLE, 0.3, [0.5, 1.0], 0), (CIRCLE, 0.0, None, 0), (PLANE, 0.3, None, 0)],
)
def test_one_step_counts_the_way_before_the_touch(foundation, coefficient, factors, said):
    """It is said of a circle with friction, not of several steps, without friction, or where the gap is the same."""
    pressed = {"boundary": "top", "x": 0.0, "y": -0.01} | ({} if factors is None else {"factors": factors})
    scene = {
        "mesh": {"generator": "block", "parameters": {"length": 3.0, "height": 1.0, "nx": 18, "ny": 6}},
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": pressed,
        "contact": {
            "boundary": "bottom",
            "foundation": foundation,
            "friction": {"law": "coulomb", "coefficient": coefficient},
        },
    }
    findings = solve(parse_scene(scene)).findings
    assert sum("before it touches" in finding.message for finding in findings) == said
