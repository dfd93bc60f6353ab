"""Patch tests in 3D: constant states of stress on distorted meshes at any angle, which every
element must hold.

The body is a box on a flat foundation in its own frame X; the mesh is distorted, then turned with
all that acts on it, x = R X.  The foundation gives way by p / gamma_1 and mu / gamma_2, which a
constant state turns into a rigid motion.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from on_meshes import turn_by
from parameters import slow
from space_patches import (
    CONFINED,
    ELEMENTS,
    GAMMA,
    GAP,
    OBLIQUE,
    PRESSURE,
    ROUND_OFF,
    SHEAR,
    SIZE,
    TURNS,
    State,
    assert_displacement,
    contact,
    pressed,
    run,
)
from spaces import friction_of, rotation

each_element = pytest.mark.parametrize("element", ELEMENTS)
each_turn = pytest.mark.parametrize("turn", ["turned", slow("upright")])


LAWS = [{"bound": SHEAR / 0.9}, {"coefficient": SHEAR / 0.9 / PRESSURE}]


def assert_contact(solution, turn, shear=(0.0, 0.0), state=None):
    """Pressure and shear, the latter in the frame of the body, are constant, and all nodes in one
    state.

    The iteration leaves up to 1e-8 of its bound of a shear whose direction it has to find.
    """
    columns = solution.table.columns
    assert_allclose(columns["pressure"], PRESSURE, rtol=0, atol=ROUND_OFF * PRESSURE)
    vectors = np.column_stack([columns[f"shear_{axis}"] for axis in "xyz"])
    expected = rotation(*TURNS[turn]) @ np.array([*shear, 0.0])
    left = 1e-8 * SHEAR if state == "slip" else ROUND_OFF * PRESSURE
    assert_allclose(vectors, np.tile(expected, (len(vectors), 1)), rtol=0, atol=left)
    if state is not None:
        assert set(columns["state"]) == {state}


def smooth(*names):
    """Walls that hold without friction."""
    return [{"boundary": name, "kind": "bilateral"} for name in names]


@each_element
@each_turn
def test_compression(element, turn):
    """Pressure on top between free sides, frictionless: the body widens, held sideways by two
    smooth walls.
    """
    stress = (0.0, 0.0, -PRESSURE, 0.0, 0.0, 0.0)
    state = State(stress, (0.0, 0.0, -GAP - PRESSURE / GAMMA))
    walls = {"contact": [contact(), *smooth("left", "front")]}
    solution = run(element, turn, traction=[{"boundary": "top", "pressure": PRESSURE}], **walls)
    assert_displacement(solution, state, turn)
    bottom = solution.table.columns["boundary"] == "bottom"
    assert_allclose(solution.table.columns["pressure"][bottom], PRESSURE, rtol=ROUND_OFF)


@each_element
@each_turn
@pytest.mark.one_quick("law", LAWS, ids=["tresca", "coulomb"])
def test_stick(element, turn, law):
    """Shear at 0.9 of its bound: everything sticks, and nothing but friction holds the body
    sideways.
    """
    state = pressed(SHEAR, OBLIQUE)
    solution = run(
        element,
        turn,
        traction=state.tractions(turn, "top", "left", "right", "front", "back"),
        contact=contact(friction=friction_of(**law)),
    )
    assert solution.converged
    assert_displacement(solution, state, turn)
    assert_contact(solution, turn, SHEAR * turn_by(OBLIQUE)[:, 0], "stick")


@each_element
@each_turn
def test_tilted_plane(element, turn):
    """A foundation that is not parallel to the bottom: the body turns until the pressure is
    constant.
    """
    state, slope = pressed(SHEAR, OBLIQUE), np.array([0.002, -0.001])
    state.slope[2, :2] -= slope
    state.slope[:2, 2] += slope
    back = rotation(*TURNS[turn])
    solution = run(
        element,
        turn,
        traction=state.tractions(turn, "top", "left", "right", "front", "back"),
        contact={
            "boundary": "bottom",
            "gap": lambda x: GAP + (x.T @ back)[:, :2] @ slope,
            "friction": friction_of(**LAWS[0]),
        },
    )
    assert solution.converged
    assert_displacement(solution, state, turn)
    assert_contact(solution, turn, SHEAR * turn_by(OBLIQUE)[:, 0], "stick")


@each_element
@each_turn
@pytest.mark.one_quick("coulomb", ["tresca", "fp", "newton"])
def test_slip(element, turn, coulomb):
    """The top is moved farther than friction can hold, at 37 degrees: everything slips, the shear
    is at its bound.
    """
    state = pressed(SHEAR, OBLIQUE, creep=0.01)
    law = {"bound": SHEAR} if coulomb == "tresca" else {"coefficient": SHEAR / PRESSURE}
    back = rotation(*TURNS[turn])

    def moved(component):
        return lambda x: state.displacement(turn, x.T)[:, component]

    solution = run(
        element,
        turn,
        displacement={"boundary": "top", **{axis: moved(k) for k, axis in enumerate("xyz")}},
        traction=state.tractions(turn, "left", "right", "front", "back"),
        contact=contact(
            friction=friction_of(**law), direction=[float(c) for c in back @ [0.0, 0.0, -1.0]]
        ),
        solver={
            "gamma_n": GAMMA,
            "gamma_t": GAMMA,
            "tolerance": 1e-12,
            "coulomb": "auto" if coulomb == "tresca" else coulomb,
        },
    )
    assert_displacement(solution, state, turn)
    assert_contact(solution, turn, SHEAR * turn_by(OBLIQUE)[:, 0], "slip")


@each_element
@each_turn
def test_two_foundations(element, turn):
    """Pressed into a corner of two foundations with friction on one of them: each has its own
    pressure.
    """
    state = pressed(0.0)
    give = -CONFINED / GAMMA
    state.origin[0] = -GAP - give
    solution = run(
        element,
        turn,
        traction=state.tractions(turn, "top", "right", "front", "back"),
        contact=[contact(), {"boundary": "left", "gap": GAP}, *smooth("front")],
    )
    columns = solution.table.columns
    for name, value in (("bottom", PRESSURE), ("left", -CONFINED)):
        here = columns["boundary"] == name
        assert_allclose(columns["pressure"][here], value, rtol=0, atol=ROUND_OFF * PRESSURE)


@pytest.mark.one_quick("element", ["P1", "Q1", "Q2"])
@pytest.mark.parametrize("linear_algebra", ["full", "condensed"])
@pytest.mark.parametrize("across", [0, 1])
def test_in_the_limit_beside_a_support(element, linear_algebra, across):
    """Without regularisation, on a slope, between two walls across an axis, whose nodes are turned
    as well.
    """
    turn = "leaning sideways" if across == 0 else "leaning"
    shear = (0.0, SHEAR) if across == 0 else (SHEAR, 0.0)
    state = State((CONFINED, CONFINED, -PRESSURE, 0.0, *shear), (0.0, 0.0, -GAP))
    walls, others = ("left", "right"), ("front", "back")
    if across == 1:
        walls, others = others, walls
    solution = run(
        element,
        turn,
        displacement=[{"boundary": name, "xy"[across]: 0.0} for name in walls],
        traction=state.tractions(turn, "top", *others),
        contact=contact(friction=friction_of(coefficient=SHEAR / 0.9 / PRESSURE)),
        solver={"algorithm": "alm", "tolerance": 1e-12, "linear_algebra": linear_algebra},
    )
    assert_displacement(solution, state, turn)
    columns = solution.table.columns
    inside = np.abs(columns["xy"[across]] - SIZE[across] / 2) < 0.4 * SIZE[across]
    assert inside.any()
    assert_allclose(columns["pressure"], PRESSURE, rtol=0, atol=ROUND_OFF * PRESSURE)
    # What friction takes beside a wall the wall may take as well.
    assert_allclose(columns["shear"][inside], SHEAR, rtol=0, atol=ROUND_OFF * PRESSURE)
