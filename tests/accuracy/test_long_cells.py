"""The pressure under cells that are long beside the facets near them: a graded mesh has such ones,
which flat cells of other parts are made of as they are divided.
"""

from functools import cache

import numpy as np
import pytest
from reference import interpolated
from scenes import alone

from signorini_fx import Status
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.results.accuracy.error_estimates import estimate_errors, under_long_cells
from signorini_fx.scenes.reading import parse_scene

SIDES = {"length": 4.0, "height": 1.0}
HELD = [{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}]
LOADS = {
    "crown": {
        "displacement": {"boundary": "top", "x": 0.0, "y": -0.01},
        "contact": {"boundary": "bottom", "gap": "0.004*(x[0] - 2)**2"},
    },
    "waves": {
        "displacement": HELD,
        "traction": {"boundary": "top", "y": "-10*exp(-(x[0] - 2)**2)"},
        "contact": {"boundary": "bottom", "gap": "0.001*sin(x[0])**2"},
    },
}
MESHES = {
    "20": {"nx": 16, "ny": 8, "grading": 20.0},
    "60": {"nx": 32, "ny": 8, "grading": 60.0},
    "200": {"nx": 32, "ny": 8, "grading": 200.0},
    "60, fine": {"nx": 60, "ny": 20, "grading": 60.0, "cell": "triangle"},
    "1000": {"nx": 40, "ny": 20, "grading": 1000.0},
}


def solved(load, generator, parameters, degree=1, **tables):
    """A block."""
    mesh = {"generator": generator, "parameters": SIDES | parameters}
    scene = {"mesh": mesh, "material": {"young": 1000.0, "poisson": 0.3}, **LOADS[load]}
    return alone(parse_scene(scene | {"element": {"degree": degree}} | tables), check=False)


@cache
def fine(load):
    """On square cells of degree 2."""
    return solved(load, "rectangle", {"nx": 256, "ny": 64}, 2)


def distance(found, exact):
    """Of the pressure in L2, relative."""
    columns = exact.table.columns
    away = interpolated(found.table, exact.table, "pressure") - columns["pressure"]
    return np.sqrt(
        np.dot(columns["weight"], away**2) / np.dot(columns["weight"], columns["pressure"] ** 2)
    )


@pytest.mark.slow
@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("load", LOADS)
def test_a_requested_pressure_on_graded_meshes(load, mesh):
    """It is met, and stated within a factor of two; it was said to be .9 % where it was 69 %."""
    graded = {"layout": "graded", **MESHES[mesh]}
    found = solved(load, "block", graded, accuracy={"target": 0.02, "of": "pressure"})
    assert found.status in (Status.CONVERGED, Status.OUT_OF_REACH)
    true = distance(found, fine(load))
    assert true < 0.02
    assert 0.5 < found.convergence_table[-2].pressure / true < 2


def stated(solution):
    """The estimated error of its pressure."""
    table = contact_table(solution.contact, *solution.statement.sides)
    energy = solution.steps[-1].strain_energy
    return estimate_errors(solution.mechanics, solution.displacement, energy, table, 0)


@pytest.mark.parametrize(("nx", "ny", "seen"), [(128, 4, True), (32, 8, False), (16, 32, False)])
def test_only_long_cells_count(nx, ny, seen):
    """Cells that are eight times as long as their facets; no square ones, and no flat ones."""
    found = solved("crown", "rectangle", {"nx": nx, "ny": ny, "cell": "triangle"})
    body = stated(found).squares["energy"]
    tagged = found.model.tagged
    under = under_long_cells(tagged, tagged.facets("bottom"), body)
    assert bool(under.sum() > 0) is seen


@pytest.mark.parametrize(
    ("gap", "missed"),
    [
        ("0 if x[0] < 1.3 else 0.05", True),
        ("0 if x[0] <= 1.2 else 0.05", False),
        ("0.004*(x[0] - 2)**2", False),
        (0.0, False),
    ],
)
def test_a_gap_that_jumps_between_nodes(gap, missed):
    """What acts on the part of a facet that may be in contact, or not, is part of the errors as the
    loads are that jump there: half of the pressure times the area.
    """
    scene = {"contact": {"boundary": "bottom", "gap": gap}}
    found = solved("crown", "rectangle", {"nx": 20, "ny": 5, "cell": "triangle"}, **scene)
    errors = stated(found)
    columns = found.table.columns
    at = np.argmin(np.abs(columns["x"] - 1.2))
    total = np.dot(columns["weight"], columns["pressure"])
    expected = columns["pressure"][at] * 0.1 / total if missed else 0.0
    assert errors.loads == pytest.approx(expected, rel=0.05, abs=1e-12)
