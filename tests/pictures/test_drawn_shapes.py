"""Rigid shapes are drawn whole and where they are: lines in 2D, triangles in 3D, the body outside
of them.
"""

import numpy as np
import pytest
from mpi4py import MPI
from numpy.testing import assert_allclose, assert_array_equal

from signorini_fx.addons.pictures.rigid_shapes import lines_of, triangles_of
from signorini_fx.mechanics.statement.rigid_shape import distance_from
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

RADIUS = 0.3


def mesh_of(dimension):
    name = {2: "rectangle", 3: "box"}[dimension]
    parameters = {"nx": 2, "ny": 2} | ({"nz": 2} if dimension == 3 else {})
    mesh = {"generator": name, "parameters": {"length": 1.0, "height": 1.0, **parameters}}
    return load_mesh(
        parse_scene({"mesh": mesh, "material": {"young": 1.0, "poisson": 0.3}}), MPI.COMM_SELF
    )


@pytest.mark.parametrize("hollow", [False, True])
def test_a_circle_is_a_closed_line_of_its_length(hollow):
    """The body, outside or inside, is on the left of the line; what is added to the gap takes the
    line nearer.
    """
    shape = {"shape": "circle", "centre": [0.5, 0.5], "radius": RADIUS, "hollow": hollow}
    (line,) = lines_of(distance_from(shape, 2), mesh_of(2))
    assert_allclose(np.linalg.norm(line - 0.5, axis=1), RADIUS, rtol=1e-4)
    assert_array_equal(line[0], line[-1])
    x, y = (line - 0.5).T
    area = 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])
    # Seen from inside it runs counterclockwise, from outside clockwise.
    assert area == pytest.approx((1 if hollow else -1) * np.pi * RADIUS**2, rel=1e-3)


@pytest.mark.parametrize("hollow", [False, True])
def test_a_sphere_has_its_volume(hollow):
    """Its triangles are closed, each side shared by two, and counterclockwise as seen from the
    body.
    """
    pytest.importorskip("pyvista")
    shape = {"shape": "sphere", "centre": [0.5, 0.5, 0.5], "radius": RADIUS, "hollow": hollow}
    points, triangles = triangles_of(distance_from(shape, 3), mesh_of(3))
    # The distance is linear along the diagonals of the grid, of 40 points along the longest side
    # and what is beside it.
    longest = np.sqrt(3) * (1 + 2 * 2.2 * RADIUS) / 39
    assert_allclose(np.linalg.norm(points - 0.5, axis=1), RADIUS, rtol=longest**2 / (8 * RADIUS**2))
    sides = np.sort(
        np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), axis=1
    )
    _, often = np.unique(sides, axis=0, return_counts=True)
    assert set(often) == {2}
    volume = np.linalg.det(points[triangles] - 0.5).sum() / 6
    assert volume == pytest.approx((-1 if hollow else 1) * 4 / 3 * np.pi * RADIUS**3, rel=0.03)
