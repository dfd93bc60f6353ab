"""Where the path of gamma begins and ends, and what is not taken for a solution at rest."""

import numpy as np
import pytest
from scene_tables import fixed, rectangle_mesh
from scenes import alone, example1

from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene


@pytest.mark.parametrize("length", [1e-3, 1e3])
def test_path_following_has_no_unit(length):
    """The path begins at a share of E over the size of the body, and ends at the same gamma times
    the size.
    """
    scenes = (
        example1(
            bound=1.5, nx=30, ny=10, gamma="auto", algorithm="path-following", length_unit=unit
        )
        for unit in (1.0, length)
    )
    here, there = (alone(scene) for scene in scenes)
    ours, theirs = (
        [record.gamma_n for record in solution.history.outer] for solution in (there, here)
    )
    np.testing.assert_allclose(np.array(ours) * length, theirs, rtol=1e-6)


def test_a_loose_body_without_load_is_not_at_rest():
    """Where it is nothing holds it: every position off the foundation is as good."""
    scene = example1(bound=1.5, nx=6, ny=2).model_copy(update={"displacement": (), "traction": ()})
    assert alone(scene, check=False).status is Status.NOT_HELD


def test_cooling_on_a_foundation_with_cohesion():
    """Nothing presses on the body: while springs hold it, no motion is free, and the iteration ends
    in an outcome.
    """
    scene = {
        "mesh": rectangle_mesh(3, 1),
        "material": {"young": 1000.0, "poisson": 0.3, "expansion": 1.0},
        "displacement": fixed("right", "y"),
        "temperature": {"change": -0.003},
        "contact": {
            "boundary": "bottom",
            "friction": {"law": "coulomb", "coefficient": 1.4, "cohesion": 0.5},
        },
    }
    solution = alone(parse_scene(scene), check=False)
    assert solution.status is Status.OUTER_MAX_ITERATIONS
