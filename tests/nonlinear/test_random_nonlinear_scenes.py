"""Random scenes with nonlinear materials: what is called converged is so for another program, which
sees faults.
"""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import coulomb_friction
from scenes import alone

from benchmarks.stability.nonlinear_scenes import RandomScene, judged, tried
from signorini_fx.scenes.reading import parse_scene


@pytest.mark.one_quick("seed", [6, 2, 5, 20, 42])
def test_they_agree(seed):
    """Equilibrium, gaps, friction, reported forces, balance of tools, stability."""
    end, faults, _ = tried(seed)
    assert faults == []
    assert end == "converged"


@pytest.mark.one_quick(
    ("changes", "fault"),
    [
        (
            {"law": {"law": "neo-hooke", "young": 1.01, "poisson": 0.3}},
            "force reported is another one",
        ),
        ({"law": {"law": "neo-hooke", "young": 1.0, "poisson": 0.31}}, "out of balance"),
        ({"friction": coulomb_friction(0.1)}, "friction beyond its bound"),
        ({"sizes": 1.01}, "penetration"),
        ({"warmth": 1.01}, "force reported is another one"),
        ({"warmth": np.array([1.0, 1.0, 1.05])}, "out of balance"),
    ],
)
def test_the_judge_sees_what_is_wrong(changes, fault):
    """Of a scene that is another one than the solution is of: stiffness, Poisson's ratio, friction,
    place, temperature.
    """
    scene = next(
        s
        for s in map(RandomScene.drawn, range(300))
        if s.kind == "plane strain" and s.shape == "circle"
    )
    rubber = {"law": "neo-hooke", "young": 1.0, "poisson": 0.3}
    scene = replace(scene, law=rubber, friction=coulomb_friction(0.3), push=None, volumetric="full")
    scene = replace(
        scene,
        ways=0.02 * scene.sizes[1] * (scene.ways / abs(scene.ways).max()),
        pull=0.0 * scene.pull,
    )
    scene = replace(scene, centre=np.array([scene.centre[0], scene.sizes[1] + scene.radius]))
    if "warmth" in changes:
        scene = replace(
            scene, warmth=np.outer(np.array(scene.times) / scene.times[-1], [0.02, 0.01, -0.02])
        )
    solution = alone(parse_scene(scene.stated()))
    assert judged(scene, solution, MPI.COMM_SELF) == []
    if "sizes" in changes:  # of the foundation's place
        changes = {"centre": scene.centre - np.array([0.0, 0.01 * scene.sizes[1]])}
    if "warmth" in changes:
        changes = {"warmth": changes["warmth"] * scene.warmth}
    faults = judged(replace(scene, **changes), solution, MPI.COMM_SELF)
    assert any(fault in text for text in faults)
