"""The largest pressure of rubber is per area of the displaced boundary, where it is that of
Cauchy's stress.
"""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import fixed, floor, plane_shape
from scenes import alone

from signorini_fx import solve
from signorini_fx.quantities.shown import short_answer
from signorini_fx.results.summary import summary_of
from signorini_fx.scenes.reading import parse_scene

RUBBER = {"law": "neo-hooke", "young": 2.0, "poisson": 0.3}
FLAT = floor()
SPATIAL = plane_shape([0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
SIDES = {"length": 2.0, "height": 1.0, "nx": 4, "ny": 2}
CUBE = {"length": 1.0, "width": 2.0, "height": 1.0, "nx": 2, "ny": 2, "nz": 2}


def squeezed(generator, parameters, supports, plane, degree, **material):
    """A block between smooth plates, which is free to become broader, by a third of its height."""
    return {
        "mesh": {"generator": generator, "parameters": parameters},
        "element": {"degree": degree},
        "material": RUBBER | material,
        "displacement": supports,
        "contact": {"boundary": "bottom", "foundation": plane},
        "load_steps": {"times": [0.5, 1.0]},
    }


DOWN = {"boundary": "top", "y": "-0.35*t"}
HELD = fixed("left", "x")
BLOCKS = {
    "plane strain": squeezed("rectangle", SIDES, [DOWN, HELD], FLAT, 1),
    "degree 2": squeezed("rectangle", SIDES, [DOWN, HELD], FLAT, 2),
    "of revolution": squeezed("rectangle", SIDES, [DOWN, HELD], FLAT, 1, hypothesis="axisymmetric"),
    "3D": squeezed(
        "box", CUBE, [HELD, fixed("front", "y"), {"boundary": "top", "z": "-0.35*t"}], SPATIAL, 1
    ),
}


@pytest.mark.mpi
@pytest.mark.parametrize("name", BLOCKS)
def test_it_is_that_of_cauchys_stress(name):
    """Everywhere on the boundary, and in the summary; per undeformed area it is larger."""
    found = solve(parse_scene(BLOCKS[name]), MPI.COMM_WORLD)
    summary = summary_of(found)
    cauchy = -found.stress.as_dict()["smallest_principal"]["value"]
    columns = found.table.columns
    np.testing.assert_allclose(columns["present_pressure"], cauchy, rtol=1e-6)
    assert summary["present_pressure"] == pytest.approx(cauchy, rel=1e-6)
    assert summary["max_pressure"] > 1.1 * cauchy
    text = " ".join(" ".join(map(str, short_answer(summary, Path()))).split())
    assert f"largest pressure {cauchy:.4g} per present area" in text


def test_small_strains_have_one_area():
    """There is no other pressure."""
    found = alone(
        parse_scene(
            BLOCKS["plane strain"]
            | {"material": {"young": 2.0, "poisson": 0.3}, "load_steps": {"times": [0.001]}}
        )
    )
    assert "present_pressure" not in found.table.columns
    assert "present_pressure" not in summary_of(found)
