"""Elastic systems of every kind give the same answer."""

import numpy as np
import pytest
from scenes import alone, table_of

from signorini_fx.scenes.reading import parse_scene


def turned(**solver):
    """Half a disk, whose contact nodes have normals of their own, held by friction."""
    return parse_scene(
        {
            "mesh": {"generator": "half_disk", "parameters": {"radius": 1.0, "size": 0.2, "contact_size": 0.1}},
            "material": {"young": 5000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "x": 0.5, "y": -5.0},
            "contact": {"boundary": "arc", "gap": 1e-3, "friction": {"law": "tresca", "bound": 1.0}},
            "solver": solver,
        }
    )


@pytest.mark.one_quick
@pytest.mark.parametrize("algorithm", ["ssn", "alm"])
def test_condensed_with_turned_nodes(algorithm):
    """The dense matrix in the frames of the nodes, against the sparse one."""
    ours, theirs = (table_of(alone(turned(algorithm=algorithm, linear_algebra=k))) for k in ("condensed", "full"))
    for name in ("pressure", "shear"):
        close = 1e-7 * theirs.columns["pressure"].max()
        np.testing.assert_allclose(ours.columns[name], theirs.columns[name], rtol=0, atol=close)
