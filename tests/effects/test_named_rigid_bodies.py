"""Rigid bodies that several contacts name: rollers, a sphere in a seat, keys and wedges, by statics
and by hand.
"""

import math
from copy import deepcopy

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import coulomb_friction, fixed, plane_shape, rectangle_mesh

from signorini_fx import ConvergenceError, SceneError, solve
from signorini_fx.records import Status
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
F = 0.3
FRICTION = coulomb_friction(F)


def rectangle(name, length, height, nx, ny, **place):
    parameters = {"length": length, "height": height, "nx": nx, "ny": ny, "cell": "quadrilateral"}
    return {"name": name, "mesh": rectangle_mesh(**parameters), **place}


def rows(solution):
    """The rows of rigid bodies in the summary."""
    return [
        tool.as_dict(solution.contact, solution.statement.contact, solution.model.kinematics)
        for tool in solution.last_step.rigid_bodies
    ]


def sums(solution):
    """Of each contact: its pressures and its shears times weights, one row each."""
    contact = solution.contact
    forces = np.column_stack((contact.pressure, contact.shear)) * contact.boundary.weight[:, None]
    of = np.arange(len(solution.statement.contact))[:, None] == contact.boundary.part
    return COMM.allreduce(of @ forces)


def roller(
    *,
    upper=None,
    load=None,
    law=FRICTION,
    cells=15,
    unit=(1.0, 1.0),
    mirrored=False,
    radius=1.0,
    **driving,
):
    """A rigid roller between two plates; the upper one is moved, or else a load presses it down."""
    length, stress = unit
    sign = -1.0 if mirrored else 1.0
    plate = {"length": length, "height": length / 2, "nx": cells, "ny": 6}
    middle = radius * length
    shape = {"shape": "circle", "centre": [0.0, middle], "radius": middle, "rigid": "roller"}
    driven = {**shape, "pivot": [0.0, middle], **(driving or {"prescribed": {}})}
    top = {"x": 0.0} if upper is None else {"x": sign * upper[0] * length, "y": upper[1] * length}
    scene = {
        "body": [
            rectangle("lower", **plate, shift=[-length / 2, -length / 2]),
            rectangle("upper", **plate, shift=[-length / 2, 2 * middle]),
        ],
        "material": {"young": 1000.0 * stress, "poisson": 0.3},
        "displacement": [fixed("lower.bottom"), {"boundary": "upper.top", **top}],
        "contact": [
            {"boundary": name, "foundation": foundation, "friction": law}
            for name, foundation in (("lower.top", driven), ("upper.bottom", shape))
        ],
        "solver": {"tolerance": 1e-11},
    }
    if load is not None:
        scene["traction"] = {"boundary": "upper.top", "y": -load * stress}
    return scene


def test_a_roller_rolls():
    """Between plates of which one moves by s it moves by s / 2 and turns by s / (2 R), and it
    resists with nothing.
    """
    s, radius = 2.5e-3, 4.0
    solution = solve(parse_scene(roller(upper=(s, -0.01), radius=radius)))
    (row,), (below, above) = rows(solution), sums(solution)
    pressed = below[0]
    assert pressed > 1.0
    assert np.allclose(row["displacement"], [s / 2, -0.005], rtol=1e-8)
    # Plates whose surface is strained where they are pressed turn it a little less.
    assert np.isclose(row["rotation"], -s / (2 * radius), rtol=0.01)
    assert np.abs([*row["force"], row["moment"]]).max() < 1e-9 * pressed
    assert abs(below[1]) + abs(above[1]) < 1e-5 * pressed
    assert solution.certificate.holds
    assert solution.certificate.equilibrium < 1e-9


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_couple_turns_a_roller_as_soon_as_friction_gives_way(share):
    """Statics: it is held up to F P R at each of two plates."""
    load, radius = 4.0, 4.0
    scene = parse_scene(
        roller(load=load, radius=radius, force=[0.0, 0.0], moment=share * 2 * F * load * radius)
    )
    if share < 1:
        (row,) = rows(solve(scene))
        assert np.isclose(row["moment"], -share * 2 * F * load * radius, rtol=1e-9)
        return
    with pytest.raises(ConvergenceError) as raised:
        solve(scene)
    assert raised.value.solution.status in (Status.SLIDES, Status.SLIDES_AT_PRESSURES)


def seat(turn=45.0, law=None, **driving):
    """A sphere in a conical seat of revolution, a washer whose inner face is inclined by
    ``turn``.
    """
    radius, angle, length, height = 2.0, math.radians(turn), 1.0, 0.5
    ball = {
        "shape": "circle",
        "centre": [0.0, 0.0],
        "radius": radius,
        "pivot": [0.0, 0.0],
        "rigid": "ball",
        **driving,
    }
    # Where the sphere about the origin touches the cone, in the middle of the upper side of the
    # washer's section.
    touched = radius * np.array([math.sin(angle), -math.cos(angle)])
    along, normal = (
        np.array([math.cos(angle), math.sin(angle)]),
        np.array([math.sin(angle), -math.cos(angle)]),
    )
    corner = touched - length / 2 * along + height * normal
    return {
        "body": rectangle("seat", length, height, 20, 10, rotation=turn, shift=corner.tolist()),
        "material": {"young": 1e4, "poisson": 0.3, "hypothesis": "axisymmetric"},
        "displacement": fixed("seat.bottom"),
        "contact": {"boundary": "seat.top", "foundation": ball, "friction": law or {"law": "none"}},
    }


@pytest.mark.parametrize("turn", [30.0, 45.0])
def test_a_sphere_in_a_conical_seat(turn):
    """Statics: all of the seat together pushes with P / cos of its inclination, whatever its radius
    is.
    """
    load = 1.0
    solution = solve(parse_scene(seat(turn, force=[0.0, -load])))
    (row,), ((pressed, _),) = rows(solution), sums(solution)
    assert np.isclose(row["force"][1], load, rtol=1e-9)
    assert np.isclose(pressed, load / math.cos(math.radians(turn)), rtol=2e-3)
    assert solution.certificate.equilibrium < 1e-9


def wedge(share, *, law=FRICTION, mirrored=False, **driving):
    """A rigid wedge between two blocks that are pressed on its sides, inclined by an angle whose
    tangent is a share of F.
    """
    angle = math.degrees(math.atan(share * F))
    cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    # The right block lies along the normal of the right side of the wedge, (cos, sin), the left one
    # mirrored.
    right = rectangle("right", 1.0, 1.0, 4, 4, rotation=angle, shift=[1.0, 0.0])
    left = rectangle("left", 1.0, 1.0, 4, 4, rotation=-angle, shift=[-1.0 - cos, sin])
    planes = {
        "right": plane_shape([1.0, 0.0], [cos, sin]),
        "left": plane_shape([-1.0, 0.0], [-cos, sin]),
    }
    faces = {"right": ("left", "right"), "left": ("right", "left")}
    order = ("left", "right") if mirrored else ("right", "left")
    moved = {"pivot": [0.0, 0.0], "force": [0.0, 0.0], **driving}
    return {
        "body": [{"right": right, "left": left}[name] for name in order],
        "material": {"young": 1000.0, "poisson": 0.0},
        "displacement": [
            {"boundary": f"{name}.{side}", "normal": 0.0}
            for name in order
            for side in ("top", "bottom")
        ],
        "traction": [{"boundary": f"{name}.{faces[name][1]}", "pressure": 2.0} for name in order],
        "contact": [
            {
                "boundary": f"{name}.{faces[name][0]}",
                "foundation": {
                    **planes[name],
                    "rigid": "wedge",
                    **(moved if name == order[0] else {}),
                },
                "friction": law,
            }
            for name in order
        ],
    }


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_wedge_locks_itself_where_its_slope_is_below_the_friction(mirrored):
    solution = solve(parse_scene(wedge(0.99, mirrored=mirrored)))
    (row,), pressed = rows(solution), sums(solution)[:, 0]
    assert np.allclose(pressed, 2.0, rtol=1e-9)
    assert np.allclose(np.abs(sums(solution)[:, 1]), 2.0 * 0.99 * F, rtol=1e-9)
    assert np.abs(row["force"]).max() < 1e-9 * 2.0
    assert solution.certificate.equilibrium < 1e-9


def test_a_steeper_wedge_slides_and_says_so():
    with pytest.raises(ConvergenceError) as raised:
        solve(parse_scene(wedge(1.01)))
    assert raised.value.solution.status is Status.SLIDES
    assert "contact[0]" in str(raised.value)


HELD_BY_NOTHING = [
    (roller(load=4.0, law={"law": "none"}, force=[0.0, 0.0], moment=0.1), Status.NOT_HELD),
    (wedge(0.5, law={"law": "none"}), Status.NOT_HELD),
    (seat(force=[0.0, 1.0]), Status.OPEN),
    (wedge(0.5, force=[0.0, 10.0]), Status.SLIDES),
]


@pytest.mark.parametrize(("scene", "status"), HELD_BY_NOTHING)
def test_what_nothing_holds_ends_with_its_name(scene, status):
    with pytest.raises(ConvergenceError) as raised:
        solve(parse_scene(deepcopy(scene)))
    assert raised.value.solution.status is status
    assert raised.value.solution.history.linear_solves == 0


MISTAKES = [
    (
        {"rigid": "another"},
        r"contact\[1\].foundation.rigid: give force, .* in one contact of 'roller', not in 0",
    ),
    ({"force": [0.0, 0.0, 0.0]}, "the mesh is plane"),
    ({"pivot": None, "force": [0.0, 0.0]}, "give the point where the force acts"),
    ({"spring": {"z": 1.0}}, "spring.z: the mesh is plane"),
    (
        {"spring": {"x": 1.0}, "prescribed": {"x": 0.0}},
        "spring.x: has no effect on a component that is prescribed",
    ),
    ({"colour": "red"}, r"contact\[0\].foundation.colour: unknown key"),
]


@pytest.mark.parametrize(("change", "words"), MISTAKES)
def test_mistakes_are_named(change, words):
    scene = roller(upper=(0.0, -0.04))
    of_first = scene["contact"][0]
    shape = of_first["foundation"] | change
    of_first["foundation"] = {key: value for key, value in shape.items() if value is not None}
    with pytest.raises(SceneError, match=words):
        check_scene(parse_scene(scene))
