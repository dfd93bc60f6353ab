"""Functions of a user that fail: one error with its place on all ranks, and no rank that waits for
another.
"""

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import rectangle_mesh

import signorini_fx as sfx
from signorini_fx.errors import SceneError
from signorini_fx.scenes.solver import solve

WORLD = MPI.COMM_WORLD
pytestmark = pytest.mark.mpi


def fails_on_last_rank(x):
    """As one that reads a file which only some machines have."""
    if WORLD.rank == WORLD.size - 1:
        raise OSError("no such table")
    return np.zeros(x.shape[1])


def entries(function):
    """Scenes by the path of the function in them."""
    bottom, left = {"boundary": "bottom"}, {"boundary": "left"}
    heated = {"young": 200.0, "poisson": 0.3, "expansion": 1e-3}
    return {
        "traction[0].x": {"traction": sfx.Traction(**left, x=function)},
        "body_force.y": {"body_force": sfx.BodyForce(y=function)},
        "displacement[0].y": {"displacement": sfx.Displacement(boundary="top", x=0.0, y=function)},
        "contact[0].gap": {"contact": sfx.Contact(**bottom, gap=function)},
        "contact[0].friction": {
            "contact": sfx.Contact(**bottom, friction=sfx.Coulomb(coefficient=function))
        },
        "material[0].grading": {"material": {"young": 200.0, "poisson": 0.3, "grading": function}},
        "springs[0]": {"springs": sfx.Springs(**left, normal=function)},
        "force[0]": {"force": sfx.Force(boundary="top", x=1.0, spread=function)},
        "temperature[0].change": {
            "material": heated,
            "temperature": sfx.Temperature(change=function),
        },
    }


def scene(changes):
    """A block pressed onto a flat foundation."""
    data = {
        "mesh": rectangle_mesh(6, 4, length=2.0, height=1.0),
        "material": {"young": 200.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.0, "y": -0.01},
        "contact": {"boundary": "bottom"},
    }
    return sfx.Scene(**(data | changes))


@pytest.mark.parametrize("path", entries(fails_on_last_rank))
def test_a_function_that_fails_on_one_rank(path):
    """On all ranks the same error, which says where the function is and what it said."""
    with pytest.raises(SceneError, match="no such table") as caught:
        solve(scene(entries(fails_on_last_rank)[path]), check=False)
    assert path in str(caught.value)


@pytest.mark.parametrize("path", entries(fails_on_last_rank))
def test_values_that_are_no_real_numbers(path):
    """Their imaginary part is not left out silently."""
    with pytest.raises(SceneError, match="complex") as caught:
        solve(scene(entries(lambda x: 1j * x[0])[path]), check=False)
    assert path in str(caught.value)


@pytest.mark.parametrize("path", ["traction[0].x", "displacement[0].y", "body_force.y"])
def test_values_of_a_wrong_shape(path):
    """As many as points, or one."""
    with pytest.raises(SceneError, match="shape") as caught:
        solve(scene(entries(lambda x: x)[path]), check=False)
    assert path in str(caught.value)


def test_no_communicator():
    """That of the ranks which do not take part."""
    with pytest.raises(TypeError, match="COMM_NULL"):
        solve(scene({}), MPI.COMM_NULL)
