"""Supports along the normals of flat boundaries that are across no axis: nodes with unknowns in
frames of their own.
"""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from numpy.testing import assert_allclose
from on_meshes import turn_by
from scenes import alone
from space_patches import (
    ELEMENTS,
    GAMMA,
    GAP,
    POISSON,
    PRESSURE,
    ROUND_OFF,
    YOUNG,
    State,
    assert_displacement,
    contact,
    pressed,
    run,
)
from spaces import friction_of, rotation

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.scenes.reading import parse_scene

ALONG = (0.0007, -0.0004)
LIMIT = {"algorithm": "alm", "tolerance": 1e-12}


@pytest.mark.one_quick("element", ELEMENTS)
@pytest.mark.parametrize("linear_algebra", ["full", "condensed"])
def test_two_walls(element, linear_algebra):
    """Compression between two walls that are across no axis, and move: exact to round-off."""
    state = State((0.0, 0.0, -PRESSURE, 0.0, 0.0, 0.0), (*ALONG, -GAP - PRESSURE / GAMMA))
    solution = run(
        element,
        "turned",
        displacement=[
            {"boundary": "left", "normal": -ALONG[0], "factors": [0.3, 1.0]},
            {"boundary": "front", "normal": -ALONG[1], "factors": [0.3, 1.0]},
        ],
        traction={"boundary": "top", "pressure": PRESSURE, "factors": [1.0, 1.0]},
        contact=contact(),
        solver={
            "gamma_n": GAMMA,
            "gamma_t": GAMMA,
            "tolerance": 1e-12,
            "linear_algebra": linear_algebra,
        },
    )
    assert_displacement(solution, state, "turned")
    assert_allclose(solution.table.columns["pressure"], PRESSURE, rtol=ROUND_OFF)


@pytest.mark.one_quick("element", ["P1", "Q1", "Q2"])
@pytest.mark.parametrize("linear_algebra", ["full", "condensed"])
def test_the_limit(element, linear_algebra):
    """Without regularisation as well: contact and supports share their nodes, whose frames
    agree.
    """
    state = pressed()
    state.origin[2] = -GAP
    solution = run(
        element,
        "turned",
        displacement=[
            {"boundary": name, "normal": 0.0} for name in ("left", "right", "front", "back")
        ],
        traction=state.tractions("turned", "top"),
        contact=contact(friction=friction_of(coefficient=0.3)),
        solver={**LIMIT, "linear_algebra": linear_algebra},
    )
    assert_displacement(solution, state, "turned")
    assert_allclose(solution.table.columns["pressure"], PRESSURE, rtol=ROUND_OFF)


@pytest.mark.parametrize("algorithm", ["ssn", "alm"])
def test_in_the_plane(algorithm):
    """A rectangle on a slope, held by a wall across it."""
    angle = 0.4
    back = turn_by(angle)
    mesh = dmesh.create_rectangle(
        MPI.COMM_SELF, [(0.0, 0.0), (2.0, 1.0)], (4, 3), dmesh.CellType.quadrilateral
    )
    mesh.geometry.x[:, :2] = mesh.geometry.x[:, :2] @ back.T

    def own(x):
        return back.T @ x[:2]

    sides = {
        "left": lambda x: own(x)[0] < 1e-9,
        "bottom": lambda x: own(x)[1] < 1e-9,
        "top": lambda x: own(x)[1] > 1 - 1e-9,
    }
    scene = parse_scene(
        {
            "mesh": tag_boundaries(mesh, sides),
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": {"boundary": "left", "normal": 0.001},
            "traction": {"boundary": "top", "pressure": PRESSURE},
            "contact": {"boundary": "bottom", "gap": GAP},
            "solver": {"algorithm": algorithm, "gamma_n": GAMMA, "gamma_t": GAMMA},
        }
    )
    solution = alone(scene)
    give = PRESSURE / GAMMA if algorithm == "ssn" else 0.0
    x = solution.model.space.tabulate_dof_coordinates()[:, :2] @ back
    modulus = YOUNG / (1 - POISSON**2)
    exact = np.column_stack(
        (
            PRESSURE * POISSON / (1 - POISSON) / modulus * x[:, 0] - 0.001,
            -PRESSURE / modulus * x[:, 1] - GAP - give,
        )
    )
    found = solution.displacement.x.array.reshape(-1, 2) @ back
    assert_allclose(found, exact, rtol=0, atol=1e-9 * np.abs(exact).max())


def corner(right_angle):
    """A prism of triangles x[0] + slope x[1] <= 1 on a foundation, two of whose sides hold it along
    their normals.
    """
    mesh = dmesh.create_box(
        MPI.COMM_SELF, [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0)], (3, 3, 3), dmesh.CellType.hexahedron
    )
    x = mesh.geometry.x
    lean = 0.0 if right_angle else 0.5
    x[:, 0] += lean * x[:, 1]  # left and right lean, front and back do not
    x[:] = x @ rotation(0.9, (0.3, -0.8, 0.5)).T
    return mesh, lean


@pytest.mark.parametrize("right_angle", [True, False])
def test_an_edge_of_two_walls(right_angle):
    """Nodes between two walls, at whatever angle: no widening, so that both just move the body."""
    mesh, lean = corner(right_angle)
    back = rotation(0.9, (0.3, -0.8, 0.5))

    def side(axis, value):
        def marker(x):
            own = back.T @ x
            own[0] -= lean * own[1]
            return np.abs(own[axis] - value) < 1e-9

        return marker

    tagged = tag_boundaries(
        mesh,
        {"left": side(0, 0.0), "front": side(1, 0.0), "bottom": side(2, 0.0), "top": side(2, 1.0)},
    )
    motion = np.array([0.002, -0.001, -GAP])  # in the frame of the body
    left = np.array([-1.0, lean, 0.0]) / np.hypot(1.0, lean)
    scene = parse_scene(
        {
            "mesh": tagged,
            "material": {"young": YOUNG, "poisson": 0.0},
            "displacement": [
                {"boundary": "left", "normal": float(left @ motion)},
                {"boundary": "front", "normal": -float(motion[1])},
            ],
            "traction": {"boundary": "top", "pressure": PRESSURE},
            "contact": {"boundary": "bottom", "gap": GAP},
            "solver": {"gamma_n": GAMMA, "gamma_t": GAMMA},
        }
    )
    solution = alone(scene)
    own = solution.model.space.tabulate_dof_coordinates() @ back
    exact = motion - np.outer(PRESSURE / GAMMA + PRESSURE / YOUNG * own[:, 2], [0.0, 0.0, 1.0])
    found = solution.displacement.x.array.reshape(-1, 3) @ back
    assert_allclose(found, exact, rtol=0, atol=ROUND_OFF * np.abs(exact).max())


TURN = rotation(0.9, (0.3, -0.8, 0.5))
ASIDE = np.array([0.011, -0.007, 0.013])
# Supports in the frame of the body, in the order of the scene: a boundary with a displacement along
# its normal, or with all of the displacement ASIDE.
MEETING = {
    "wall, then all": [("left", 0.004), ("front", None)],
    "all, then wall": [("front", None), ("left", 0.004)],
    "two walls": [("left", 0.004), ("front", -0.002)],
    "two walls of one plane": [("upper left", 0.004), ("lower left", 0.001), ("front", 0.0)],
    "two walls of one plane, the lower one first": [
        ("lower left", 0.001),
        ("upper left", 0.004),
        ("front", 0.0),
    ],
    "a corner of three walls": [("left", 0.004), ("front", -0.002), ("top", 0.003)],
    "a corner, then all": [("left", 0.004), ("top", 0.003), ("front", None)],
    "all, then a corner": [("front", None), ("left", 0.004), ("top", 0.003)],
}


def meeting(supports, turn, comm=MPI.COMM_SELF, **solver):
    """A cube on a foundation whose supports share edges."""
    mesh = dmesh.create_box(
        comm, [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0)], (3, 3, 3), dmesh.CellType.tetrahedron
    )
    mesh.geometry.x[:] = mesh.geometry.x @ turn.T
    sides = {
        "left": lambda x: (turn.T @ x)[0] < 1e-9,
        "lower left": lambda x: ((turn.T @ x)[0] < 1e-9) & ((turn.T @ x)[2] < 0.34),
        "upper left": lambda x: ((turn.T @ x)[0] < 1e-9) & ((turn.T @ x)[2] > 0.33),
        "front": lambda x: (turn.T @ x)[1] < 1e-9,
        "top": lambda x: (turn.T @ x)[2] > 1 - 1e-9,
        "bottom": lambda x: (turn.T @ x)[2] < 1e-9,
        "right": lambda x: (turn.T @ x)[0] > 1 - 1e-9,
    }
    named = {name: sides[name] for name in ("bottom", "right", *(name for name, _ in supports))}
    aside, load = (
        dict(zip("xyz", (turn @ along).tolist(), strict=True))
        for along in (ASIDE, [-30.0, 10.0, -20.0])
    )
    return parse_scene(
        {
            "mesh": tag_boundaries(mesh, named),
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": [
                {"boundary": name, **(aside if along is None else {"normal": along})}
                for name, along in supports
            ],
            "traction": {"boundary": "right", **load},
            "contact": {"boundary": "bottom", "gap": 0.002},
            "solver": {"gamma_n": GAMMA, "gamma_t": GAMMA, **solver},
        }
    )


@pytest.mark.one_quick("supports", MEETING.values(), ids=MEETING)
@pytest.mark.parametrize("linear_algebra", ["full", "condensed"])
def test_where_supports_meet(supports, linear_algebra):
    """The later one applies, and the earlier one in what is left, in a turned body as in one along
    the axes.
    """
    here, there = (
        alone(meeting(supports, turn, linear_algebra=linear_algebra)) for turn in (np.eye(3), TURN)
    )
    expected = here.displacement.x.array.reshape(-1, 3) @ TURN.T
    size = np.abs(expected).max()
    assert_allclose(
        there.displacement.x.array.reshape(-1, 3), expected, rtol=0, atol=ROUND_OFF * size
    )
    forces = [
        np.array([one.force for one in solution.resultants.every()]) for solution in (here, there)
    ]
    assert_allclose(forces[1], forces[0] @ TURN.T, rtol=0, atol=1e-9 * np.abs(forces[0]).max())


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_a_corner_of_walls_at_any_angle(order):
    """Three walls that move with the body, none of them across another one: each of them applies in
    full.
    """
    lean = np.array([[1.0, 0.4, -0.3], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])  # from a cube to the body
    mesh = dmesh.create_unit_cube(MPI.COMM_SELF, 3, 3, 3, dmesh.CellType.hexahedron)
    mesh.geometry.x[:] = mesh.geometry.x @ (TURN @ lean).T
    back = np.linalg.inv(TURN @ lean)
    normals = -back / np.linalg.norm(back, axis=1)[:, None]
    walls = {
        name: lambda x, axis=axis: (back @ x)[axis] < 1e-9
        for axis, name in enumerate(("a", "b", "c"))
    }
    sides = walls | {"far": lambda x: (back @ x)[0] > 1 - 1e-9}
    motion = TURN @ ASIDE
    scene = parse_scene(
        {
            "mesh": tag_boundaries(mesh, sides),
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": [
                {"boundary": "abc"[axis], "normal": float(normals[axis] @ motion)} for axis in order
            ],
            "contact": {"boundary": "far", "gap": 1.0},
        }
    )
    found = alone(scene).displacement.x.array.reshape(-1, 3)
    assert_allclose(found, np.tile(motion, (len(found), 1)), rtol=0, atol=1e-12)


def test_refused():
    """A boundary that is not flat has no normal."""
    scene = parse_scene(
        {
            "mesh": {"generator": "half_disk", "parameters": {"radius": 1.0}},
            "material": {"young": 1.0, "poisson": 0.3},
            "displacement": {"boundary": "arc", "normal": 0.0},
        }
    )
    with pytest.raises(SceneError, match="is not flat"):
        alone(scene)
