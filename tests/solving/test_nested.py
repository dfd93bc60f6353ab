"""What a coarse mesh hands on to a finer one: sets of the nearest nodes, and multipliers that linear ones survive."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.records import Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving.nested import carry_over

pytestmark = pytest.mark.mpi
WORLD = MPI.COMM_WORLD


def scene(cells):
    """A body in a corner: two contact boundaries, which share a node."""
    return parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"nx": 3 * cells, "ny": cells}},
            "material": {"young": 5000.0, "poisson": 0.3},
            "traction": [{"boundary": "top", "y": -20.0}, {"boundary": "left", "x": 20.0}],
            "contact": [{"boundary": "bottom"}, {"boundary": "right"}],
        }
    )


def along(boundary):
    """x[0] on the bottom and x[1] on the right."""
    return np.where(boundary.part == 0, boundary.x[:, 0], boundary.x[:, 1])


def pressure(boundary):
    return np.where(boundary.part == 0, 1.0 + along(boundary), 50.0 - 7.0 * along(boundary))


def contact(boundary):
    return np.where(boundary.part == 0, along(boundary) < 1.4, along(boundary) > 0.55)


def slip(boundary):
    """+, stick and - on the bottom; - and stick on the right."""
    bottom = (along(boundary) < 0.9).astype(int) - (along(boundary) > 2.1)
    return np.where(boundary.part == 0, bottom, -(along(boundary) < 0.45).astype(int))


def slid(boundary):
    return 1e-3 * (1.0 + along(boundary))


def bound(boundary):
    return 2.0 + 3.0 * along(boundary)


@pytest.fixture(scope="module")
def coarse():
    """A contact state on the coarse mesh with known entries."""
    state = solve(scene(4), WORLD).contact
    boundary = state.boundary
    return replace(
        state,
        pressure=pressure(boundary),
        shear=-3.0 * pressure(boundary)[:, None] + 1.0,
        in_contact=contact(boundary),
        direction=slip(boundary).astype(float)[:, None],
        slip_length=-slid(boundary)[:, None],
        bound=bound(boundary),
    )


@pytest.fixture(params=[2, 3])
def fine(request):
    """The boundary of the mesh whose cells are that many times smaller."""
    data = scene(4 * request.param)
    return discretise(data.statement, load_mesh(data, WORLD), Timings()).boundary


def test_linear_multipliers_are_carried_over_exactly(coarse, fine):
    """On each boundary by itself, also at the node that both have."""
    _, (found, shear) = carry_over(coarse, fine)
    np.testing.assert_allclose(found, pressure(fine), rtol=1e-12)
    np.testing.assert_allclose(shear[:, 0], -3.0 * pressure(fine) + 1.0, rtol=1e-12)


def test_sets_are_those_of_the_neighbours(coarse, fine):
    """A node of the coarse mesh keeps its own; the others have one of their neighbours', contact and stick first."""
    sets, _ = carry_over(coarse, fine)
    h = 0.25
    place = along(fine) / h
    same = np.isclose(place, np.round(place))
    assert sets.contact[same].tolist() == contact(fine)[same].tolist()
    assert sets.direction[:, 0][same].tolist() == slip(fine)[same].tolist()
    below, above = (fine_at(fine, h * end(place)) for end in (np.floor, np.ceil))
    middle = np.isclose(place % 1, 0.5)
    assert sets.contact[middle].tolist() == (contact(below) | contact(above))[middle].tolist()
    sliding = np.where(slip(below) == slip(above), slip(below), 0)
    assert sets.direction[:, 0][middle].tolist() == sliding[middle].tolist()
    near = np.abs(place % 1 - 0.5) > 0.1  # a third of the way: that of the nearer one
    nearest = fine_at(fine, h * np.round(place))
    assert sets.contact[near].tolist() == contact(nearest)[near].tolist()
    assert sets.direction[:, 0][near].tolist() == slip(nearest)[near].tolist()


def fine_at(boundary, place):
    """The boundary with its nodes moved along it."""
    x = boundary.x.copy()
    x[boundary.part == 0, 0] = place[boundary.part == 0]
    x[boundary.part == 1, 1] = place[boundary.part == 1]
    return replace(boundary, x=x)
