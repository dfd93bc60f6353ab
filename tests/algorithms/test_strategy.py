"""Where the path of gamma begins and ends, and what is not taken for a solution at rest."""

import numpy as np
import pytest
from scenes import alone, example1

from signorini_fx.records import Status


@pytest.mark.parametrize("length", [1e-3, 1e3])
def test_path_following_has_no_unit(length):
    """The path begins at a share of E over the size of the body, and ends at the same gamma times the size."""
    scenes = (
        example1(bound=1.5, nx=30, ny=10, gamma="auto", algorithm="path-following", length_unit=unit)
        for unit in (1.0, length)
    )
    here, there = (alone(scene) for scene in scenes)
    ours, theirs = ([record.gamma_n for record in solution.history.outer] for solution in (there, here))
    np.testing.assert_allclose(np.array(ours) * length, theirs, rtol=1e-6)


def test_a_loose_body_without_load_is_not_at_rest():
    """Where it is nothing holds it: every position off the foundation is as good."""
    scene = example1(bound=1.5, nx=6, ny=2).model_copy(update={"displacement": (), "traction": ()})
    assert alone(scene, check=False).status is Status.OPEN
