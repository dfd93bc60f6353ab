"""The oracle of random scenes with further effects: it notices an answer to a scene in which one of
them is off.
"""

import copy
from functools import cache

import pytest

from benchmarks.stability.oracle.body import Mesh
from benchmarks.stability.oracle.judge import RIGHT, WRONG, judge
from benchmarks.stability.oracle.package import answer_of, solution_of
from benchmarks.stability.oracle.scenes import Trial, grid
from benchmarks.stability.oracle.scenes_in_space import grid as grid_in_space

PLANE = {
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
SPACE = {
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
MESHES = {2: Mesh(*grid(8, 4, "quadrilateral")), 3: Mesh(*grid_in_space(4, 3, 2, "hexahedron"))}
SCENES = {2: PLANE, 3: SPACE}
# Keys with what they are changed to: about one percent, or another shape of the same size.
CHANGES = {
    2: {
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
    },
    3: {
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
    },
}


@pytest.fixture(scope="module")
def answer(tmp_path_factory):
    """That of the package, by the dimension."""

    @cache
    def solved(dimension):
        trial = Trial(0, SCENES[dimension], MESHES[dimension])
        return answer_of(solution_of(trial.write(tmp_path_factory.mktemp("effects"))))

    return solved


@pytest.mark.parametrize("dimension", SCENES)
def test_an_honest_answer_is_right(answer, dimension):
    """With all effects at once, of which there are open, sticking and slipping points."""
    found = judge(SCENES[dimension], MESHES[dimension], answer(dimension))
    assert found.kind == RIGHT, found
    assert {str(state)[:4] for state in answer(dimension).steps[0].table["state"]} == {
        "open",
        "stic",
        "slip",
    }


@pytest.mark.parametrize(
    ("dimension", "path"), [(d, path) for d, changes in CHANGES.items() for path in changes]
)
def test_another_value_is_noticed(answer, dimension, path):
    """The oracle reads the value from the scene, and takes it for what the package does."""
    scene = copy.deepcopy(SCENES[dimension])
    *tables, key = path.split(".")
    inner = scene
    for table in tables:
        inner = inner[table]
    inner[key] = CHANGES[dimension][path]
    assert judge(scene, MESHES[dimension], answer(dimension)).kind == WRONG
