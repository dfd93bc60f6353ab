"""What a coarse mesh hands on to a finer one: sets of the nearest nodes, and multipliers that linear ones survive."""

import weakref
from dataclasses import replace
from itertools import permutations
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import example1
from spaces import block

from signorini_fx.algebra.linalg.blocks import BlockRows
from signorini_fx.algebra.linalg.multigrid import Hierarchy
from signorini_fx.mechanics.body import elastic_body
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.records import Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving import solve_on_mesh
from signorini_fx.solving.check.findings import scene_findings
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


def test_shear_against_slip_across_its_direction(coarse, fine):
    """Bound over slip, of which both are carried over exactly here."""
    sets, _ = carry_over(coarse, fine)
    np.testing.assert_allclose(sets.turning, bound(fine) / slid(fine), rtol=1e-12)


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


def test_neighbours_at_the_same_distance():
    """A node in the middle of four takes the same two of them in whatever order ranks have numbered them."""
    corners = np.array([(x, y, 0.0) for x in (0.0, 1.0) for y in (0.0, 1.0)])
    plane = np.eye(3)[:, :2]

    def at(x):
        count = len(x)
        tangents = np.broadcast_to(plane, (count, 3, 2))
        return SimpleNamespace(
            part=np.zeros(count),
            x=x,
            normal=np.tile([0.0, 0.0, 1.0], (count, 1)),
            tangents=tangents,
            cotangents=tangents,
            size=count,
            comm=MPI.COMM_SELF,
        )

    def of(order):
        values = np.array(order) + 1.0
        state = {"pressure": values, "bound": values**2, "in_contact": values > 2}
        vectors = {name: np.outer(values, [1.0, k]) for k, name in enumerate(("shear", "direction", "slip_length"))}
        coarse = SimpleNamespace(boundary=at(corners[list(order)]), **state, **vectors)
        sets, multipliers = carry_over(coarse, at(np.array([[0.5, 0.5, 0.0]])))
        return np.concatenate([np.ravel(part) for part in (sets.contact, sets.direction, sets.turning, *multipliers)])

    for order in permutations(range(4)):
        np.testing.assert_array_equal(of(order), of(range(4)))


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("looked_at", [True, False])
def test_nothing_is_said_about_meshes_that_nobody_looks_at(looked_at, monkeypatch):
    """Findings about the scene are those of the last mesh, and of each mesh that a function is called with."""
    asked, given = [], []

    def findings(body, **how):
        asked.append(body.dofs)
        return scene_findings(body, **how)

    monkeypatch.setattr(solve_on_mesh, "scene_findings", findings)
    solution = solve(
        example1(bound=1.5, nx=24, ny=8, levels=3), MPI.COMM_SELF, on_level=given.append if looked_at else None
    )
    assert asked == []  # nobody has asked so far
    expected = [each.model.dofs for each in (*given, solution)]
    assert all(each.findings is not None for each in (*given, solution))
    assert asked == expected
    assert len(given) == (2 if looked_at else 0)
    assert all(each.findings for each in (*given, solution))


@pytest.mark.mpi(slow=True)
def test_nothing_of_a_coarser_mesh_but_its_level_is_alive(monkeypatch):
    """When the next mesh is solved multigrid for contact on the last one is gone, and its rounded stiffness.

    On one rank: on several ones PETSc's objects wait for a clean-up of their communicator.
    """
    made, alive = [], []
    of, single, task = Hierarchy.of.__func__, BlockRows.in_single_precision, solve_on_mesh.contact_task

    def seen(thing):
        made.append(weakref.ref(thing))
        return thing

    def begun(*given):
        alive.append(sum(reference() is not None for reference in made))
        return task(*given)

    monkeypatch.setattr(elastic_body, "FEWEST_BLOCK_UNKNOWNS", 0)
    monkeypatch.setattr(Hierarchy, "of", classmethod(lambda cls, *given: seen(of(cls, *given))))
    monkeypatch.setattr(BlockRows, "in_single_precision", lambda rows: seen(single(rows)))
    monkeypatch.setattr(solve_on_mesh, "contact_task", begun)
    sizes = {"length": 3.0, "width": 1.0, "height": 1.0, "nx": 12, "ny": 4, "nz": 4}
    mesh = {"generator": "box", "parameters": sizes}
    assert solve(block(coefficient=0.3, mesh=mesh, levels=2, linear_algebra="krylov"), MPI.COMM_SELF).converged
    assert alive == [0, 0]
    assert len(made) == 4
