"""The mean rotation of nodes, from their displacements."""

import numpy as np
import pytest
import scipy.sparse as sp

from signorini_fx.mechanics.pairs.mean_rotation import turning_of


@pytest.mark.parametrize("far", [0.0, 1e4])
@pytest.mark.parametrize("dim", [2, 3])
def test_nodes_near_a_line_far_from_the_origin(dim, far):
    """Displacements that are the same turn nothing, and rotations are found, by nodes with arms of a thousandth, of
    which the middle has the round-off of the coordinates.
    """
    rng = np.random.default_rng(5)
    x = rng.random((7, dim))
    x[:, 1:] *= 1e-3
    x += far
    distance = np.array([[0.3, -0.2, 0.1][:dim]])
    turning = turning_of(sp.csr_array(rng.random((1, 7)) + 0.1), x, distance)
    assert turning @ np.tile([1.0, -2.0, 3.0][:dim], 7) == pytest.approx(0.0, abs=1e-11)
    skew = np.array([[0.0, -0.7, 0.4], [0.7, 0.0, -0.2], [-0.4, 0.2, 0.0]])[:dim, :dim]
    moved = (x - x.mean(axis=0)) @ skew.T
    assert turning @ moved.ravel() == pytest.approx(skew @ distance[0], abs=1e-8)
