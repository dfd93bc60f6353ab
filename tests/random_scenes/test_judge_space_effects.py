"""The oracle of random scenes in 3D with further effects: it notices an answer in which one of them is off."""

import copy
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.stability.oracle.body import Mesh
from benchmarks.stability.oracle.judge import RIGHT, WRONG, judge
from benchmarks.stability.oracle.package import answer_of, solution_of
from benchmarks.stability.oracle.scenes import Trial
from benchmarks.stability.oracle.scenes_in_space import grid

MESH = Mesh(*grid(4, 3, 2, "hexahedron"))
SCENE = {
    "mesh": {"file": "body.inp"},
    "element": {"degree": 1},
    "material": {
        "orthotropic": {
            "young": [1.0, 0.4, 0.2],
            "poisson": [0.3, 0.2, 0.25],
            "shear": [0.3, 0.2, 0.1],
            "direction": [1.0, "0.5*sin(x[0])", 0.2],
            "second": [0.0, 1.0, 0.3],
        },
        "density": 1.5,
    },
    "gravity": {"x": 1e-3, "z": -4e-3},
    "force": {"boundary": "top", "x": 2e-3, "y": 1e-3, "z": -3e-3, "spread": "1 + x[0]"},
    "springs": {"boundary": "left", "normal": 0.4, "tangential": 0.02},
    "contact": {
        "boundary": "bottom",
        "foundation": {"shape": "sphere", "centre": [0.5, 0.5, -8.0], "radius": 8.0},
        "friction": {
            "law": "coulomb",
            "coefficient": 0.4,
            "cohesion": 1e-4,
            "ratio": 0.5,
            "along": [1.0, 1.0, 0.0],
        },
    },
}
# Keys with what they are changed to: about one percent, or another shape of the same size.
CHANGES = {
    "material.orthotropic.young": [1.0, 0.4, 0.202],
    "material.orthotropic.poisson": [0.3, 0.21, 0.25],
    "material.orthotropic.shear": [0.303, 0.2, 0.1],
    "material.orthotropic.direction": [1.0, "0.52*sin(x[0])", 0.2],
    "material.orthotropic.second": [0.0, 1.0, 0.33],
    "material.density": 1.515,
    "gravity.x": 1.05e-3,
    "force.spread": "1 + 1.05*x[0]",
    "springs.normal": 0.404,
    "springs.tangential": 0.0204,
    "contact.foundation.radius": 8.00001,
    "contact.friction.cohesion": 1.01e-4,
    "contact.friction.ratio": 0.505,
    "contact.friction.along": [1.0, 1.02, 0.0],
}


@pytest.fixture(scope="module")
def answer(tmp_path_factory):
    """That of the package."""
    return answer_of(solution_of(Trial(0, SCENE, MESH).write(tmp_path_factory.mktemp("effects"))))


def test_an_honest_answer_is_right(answer):
    """With all effects at once, of which there are open, sticking and slipping points."""
    found = judge(SCENE, MESH, answer)
    assert found.kind == RIGHT, found
    assert {str(state)[:4] for state in answer.steps[0].table["state"]} == {"open", "stic", "slip"}


@pytest.mark.one_quick
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
