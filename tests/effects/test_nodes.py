"""Forces at single nodes: statics, the certificate, load steps, several ranks, and what is
refused.
"""

import numpy as np
import pytest
from scene_tables import fixed, rectangle_mesh
from scenes import alone

from signorini_fx import SceneError
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

FORCES = [{"at": [2.0, 0.5], "x": 1.0, "y": -2.0}, {"at": [1.0, 1.0], "x": 0.5, "y": 3.0}]


def pulled(forces, degree=1, **more):
    """A block 2 x 1 that is held on its left, and pulled at nodes."""
    size = {"length": 2.0, "height": 1.0, "nx": 4, "ny": 2}
    return parse_scene(
        {
            "mesh": rectangle_mesh(**size),
            "element": {"degree": degree},
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [fixed("left")],
            "point_force": forces,
            **more,
        }
    )


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
def test_what_carries_forces_at_nodes(degree):
    """The support has their sum and their moment."""
    solution = solve(pulled(FORCES, degree))
    left = solution.resultants.of("left")
    np.testing.assert_allclose(left.force[:2], (-1.5, -1.0), rtol=1e-9)
    assert solution.certificate.worst < 1e-7


@pytest.mark.parametrize(
    ("force", "message"),
    [
        ({"at": [9.0, 0.0], "x": 1.0}, "no node of the mesh is at (9, 0)"),
        ({"at": [0.0, 0.0], "x": 1.0, "region": "elsewhere"}, "the mesh has no region 'elsewhere'"),
        ({"at": [0.0, 0.0, 0.0], "x": 1.0}, "point_force[0]"),
        ({"file": "forces.csv"}, "file: unknown key here"),
    ],
)
def test_forces_that_are_wrong(force, message):
    """One error with the path of the entry, and what is wrong."""
    with pytest.raises(SceneError) as error:
        alone(pulled([force]))
    assert "point_force[0]" in str(error.value)
    assert message in str(error.value)
