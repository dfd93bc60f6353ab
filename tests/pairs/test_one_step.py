"""What `check` says of curved things that are pressed together with friction: in one step, and by tilted frames."""

import re

import numpy as np
import pytest
from curved_pairs import cap
from two_bodies import assembled

from signorini_fx import solve, tag_boundaries
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene


def pressed(foundation, coefficient, **more):
    """A nearly incompressible block on a foundation, half of it."""
    return parse_scene(
        {
            "mesh": {"generator": "block", "parameters": {"length": 2.0, "height": 2.0, "nx": 40, "ny": 12}},
            "element": {"degree": 2},
            "material": {"young": 200.0, "poisson": 0.49},
            "displacement": [{"boundary": "top", "y": -0.05}, {"boundary": "left", "x": 0.0}],
            "contact": {
                "boundary": "bottom",
                "friction": {"law": "coulomb", "coefficient": coefficient},
            }
            | foundation
            | more,
        }
    )


def said(findings):
    """The share of the finding about tilted frames; 0: there is none."""
    found = [re.search("up to about ([0-9]+)%", one.message) for one in findings if "tilted frames" in one.message]
    return float(found[0][1]) / 100 if found else 0.0


ROUND = {"foundation": {"shape": "circle", "centre": [0.0, -8.0], "radius": 8.0}}
FORMULA = {"gap": "8 - sqrt(64 - x[0]**2)", "direction": [0.0, -1.0]}


@pytest.mark.parametrize("coefficient", [0.3, 0.6])
def test_shear_of_tilted_frames(coefficient):
    """What is said of a result is what differs from one by vertical normals, to a third; before there is one it is
    more, by what bodies may reach, and nothing is said of a formula.
    """
    tilted, upright = (solve(pressed(foundation, coefficient)) for foundation in (ROUND, FORMULA))
    states = [solution.contact for solution in (tilted, upright)]
    along = [state.boundary.weight * state.shear[:, 0] * state.boundary.tangents[:, 0, 0] for state in states]
    share = np.abs(along[0] - along[1]).sum() / (coefficient * states[1].boundary.weight @ states[1].pressure)
    assert said(tilted.findings) == pytest.approx(share, rel=0.35)
    assert 1 <= said(check_scene(pressed(ROUND, coefficient)).findings) / said(tilted.findings) < 2
    assert said(upright.findings) == 0.0


@pytest.mark.one_quick
@pytest.mark.parametrize(("lower", "share"), [(8.0, 0.0), (np.inf, 0.1)])
def test_tilted_frames_of_two_bodies(lower, share):
    """Half-way frames are not tilted between equal bodies, and by a/(2R) between a round and a flat one."""
    pieces = [cap("quadrilateral", radius, sign, (14, 6)) for radius, sign in ((8.0, 1), (lower, -1))]
    marked = {
        "upper": lambda x: np.isclose(x[1], x[0] ** 2 / 16),
        "lower": lambda x: np.isclose(x[1], -(x[0] ** 2) / (2 * lower)),
        "top": lambda x: np.isclose(x[1], 3.0),
        "end": lambda x: np.isclose(x[1], -3.0),
    }
    tagged = tag_boundaries(assembled("quadrilateral", *pieces), marked)
    scene = {
        "mesh": tagged,
        "material": {"young": 200.0, "poisson": 0.3},
        "displacement": [{"boundary": "top", "x": 0.0, "y": -0.1}, {"boundary": "end", "x": 0.0, "y": 0.0}],
        "contact": {"boundary": "upper", "against": "lower", "friction": {"law": "coulomb", "coefficient": 0.3}},
    }
    assert said(solve(parse_scene(scene)).findings) == pytest.approx(share, abs=0.03)
