"""The oracle of random scenes with further effects: it notices an answer to a scene in which one of them is off."""

import copy
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.stability.oracle.body import Mesh
from benchmarks.stability.oracle.judge import RIGHT, WRONG, judge
from benchmarks.stability.oracle.package import answer_of, solution_of
from benchmarks.stability.oracle.scenes import Trial, grid

POINTS, CELLS, BOUNDARIES = grid(8, 4, "quadrilateral")
SCENE = {
    "mesh": {"file": "body.inp"},
    "element": {"degree": 1},
    "material": {
        "young": 1.0,
        "poisson": 0.3,
        "density": 1.5,
        "expansion": 0.8,
        "grading": "0.6 + 0.3*sin(3*x[0])",
    },
    "gravity": {"x": 1e-3, "y": -4e-3},
    "rotation": {"speed": 0.04, "about": [0.5, 1.0]},
    "temperature": {"change": "1e-3*(1 + x[1])"},
    "force": {"boundary": "top", "x": 1e-3, "y": -2e-3, "spread": "1 + x[0]"},
    "fluid": {"boundary": "right", "level": 0.63, "weight": 5e-3},
    "springs": {"boundary": "left", "normal": 0.4, "tangential": 0.02},
    "contact": {
        "boundary": "bottom",
        "foundation": {"shape": "circle", "centre": [0.5, -3.0], "radius": 3.0},
        "friction": {"law": "coulomb", "coefficient": 0.1, "cohesion": 1e-4},
    },
}
MESH = Mesh(POINTS, CELLS, BOUNDARIES)
# Keys with what they are changed to: about one percent, or another shape of the same size.
CHANGES = {
    "material.grading": "0.6 + 0.303*sin(3*x[0])",
    "material.density": 1.515,
    "material.expansion": 0.808,
    "gravity.x": 1.05e-3,
    "rotation.about": [0.51, 1.0],
    "temperature.change": "1e-3*(1 + 1.02*x[1])",
    "force.spread": "1 + 1.05*x[0]",
    "fluid.level": 0.64,
    "springs.normal": 0.404,
    "springs.tangential": 0.0204,
    "contact.foundation.radius": 3.00001,
    "contact.foundation.centre": [0.51, -3.0],
    "contact.friction.cohesion": 1.01e-4,
}


@pytest.fixture(scope="module")
def answer(tmp_path_factory):
    """That of the package."""
    return answer_of(solution_of(Trial(0, SCENE, MESH).write(tmp_path_factory.mktemp("effects"))))


def test_an_honest_answer_is_right(answer):
    """With all effects at once, of which there are open, sticking and slipping points."""
    found = judge(SCENE, MESH, answer)
    assert found.kind == RIGHT, found
    assert {state[:4] for state in answer.steps[0].table["state"]} == {"open", "stic", "slip"}


@pytest.mark.parametrize("path", CHANGES)
def test_another_value_is_noticed(answer, path):
    """The oracle reads the value from the scene, and takes it for what the package does."""
    scene = copy.deepcopy(SCENE)
    *tables, key = path.split(".")
    inner = scene
    for table in tables:
        inner = inner[table]
    inner[key] = CHANGES[path]
    assert judge(scene, MESH, answer).kind == WRONG
