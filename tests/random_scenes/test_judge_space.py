"""The oracle of random scenes in 3D: it notices what is wrong."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from on_meshes import turn_by
from scene_tables import coulomb_friction, tresca_friction
from turned_scenes import block, scene

from benchmarks.stability.oracle import convex, statics
from benchmarks.stability.oracle.body import Body, Mesh
from benchmarks.stability.oracle.conditions import Origin, contact_of
from benchmarks.stability.oracle.judge import (
    DENIED,
    NO_BALANCE,
    NOT_CERTIFIED,
    OPEN,
    RIGHT,
    UNCERTIFIED,
    WRONG,
    Answer,
    judge,
)
from benchmarks.stability.oracle.package import answer_of, solution_of
from benchmarks.stability.oracle.scenes import Trial
from benchmarks.stability.oracle.scenes_in_space import grid
from benchmarks.stability.oracle.units import Units, same

needs_cvxopt = pytest.mark.skipif(
    convex.cvxopt is None, reason="CVXOPT (python3-cvxopt) is missing"
)


# ---- the oracle's own elements


# ---- what is wrong is noticed


TRESCA, COULOMB = tresca_friction(0.5), coulomb_friction(0.2)
TRIALS = {
    "tresca": Trial(0, scene(TRESCA), block(inner=0.03)[0], same(3)),
    "coulomb": Trial(
        0, scene(COULOMB, 2), block("tetrahedron", shape=(2, 2, 1))[0], Units(1e-6, 1e5, 3)
    ),
    "limit": Trial(
        0, scene(COULOMB, solver={"algorithm": "alm"}), block("tetrahedron")[0], same(3)
    ),
}
ANSWERS: dict[str, Answer] = {}


def answer(name, folder):
    """What the package says of one of these scenes, in units of the body."""
    if name not in ANSWERS:
        ANSWERS[name] = answer_of(solution_of(TRIALS[name].write(folder)), TRIALS[name].units)
    return copy.deepcopy(ANSWERS[name])


def verdict(name, given, **changes):
    return judge(TRIALS[name].scene | changes, TRIALS[name].mesh, given)


def vectors(table, name):
    return np.stack([table[f"{name}_{axis}"] for axis in "xyz"], axis=1)


def put(table, name, values):
    table[name] = np.linalg.norm(values, axis=1)
    for k, axis in enumerate("xyz"):
        table[f"{name}_{axis}"] = values[:, k]


def moved(given, change):
    """Another displacement; where contact points are nodes, the contact table says the same."""
    step = given.steps[-1]
    return replace(
        given, steps=[*given.steps[:-1], replace(step, displacement=step.displacement + change)]
    )


def one_percent_more(given):
    return moved(given, 0.01 * given.steps[-1].displacement)


def turned_displacement(given):
    return moved(given, 1e-4 * np.cross([0.3, -0.5, 0.8], given.place - given.place.mean(axis=0)))


def shifted(given):
    return moved(given, np.array([2e-5, -1e-5, 1e-5]))


def one_pressure(given):
    table = given.steps[-1].table
    table["pressure"][np.argmax(table["pressure"])] *= 1.0001
    return given


def shear_turned(given):
    """By two thousandths of a radian about the normal, at every point."""
    table = given.steps[-1].table
    normal, shear = vectors(table, "n"), vectors(table, "shear")
    put(table, "shear", shear + 2e-3 * np.cross(normal, shear))
    return given


def shear_reversed(given):
    table = given.steps[-1].table
    put(table, "shear", -vectors(table, "shear"))
    return given


def bound_one_percent_off(given):
    """Shear and bound, where it slips."""
    table = given.steps[-1].table
    grown = np.where(table["state"] == "slip", 1.01, 1.0)
    assert grown.max() > 1
    put(table, "shear", grown[:, None] * vectors(table, "shear"))
    table["bound"] = 1.01 * table["bound"]
    return given


def open_for_closed(given):
    table = given.steps[-1].table
    table["state"][np.argmax(table["pressure"])] = "open"
    return given


def stick_for_slip(given):
    table = given.steps[-1].table
    table["state"][table["state"] == "slip"] = "stick"
    return given


SPOILT = [
    one_percent_more,
    turned_displacement,
    shifted,
    one_pressure,
    shear_turned,
    shear_reversed,
    bound_one_percent_off,
    open_for_closed,
    stick_for_slip,
]


@pytest.mark.parametrize("name", TRIALS)
def test_answers_of_the_package_are_right(name, tmp_path):
    """Before something is spoilt."""
    found = verdict(name, answer(name, tmp_path))
    assert found.kind == RIGHT, found.worst
    assert {"open", "slip"} <= set(answer(name, tmp_path).steps[-1].table["state"])


@pytest.mark.one_quick("spoil", SPOILT)
@pytest.mark.parametrize("name", TRIALS)
def test_what_is_wrong_is_noticed(name, spoil, tmp_path):
    """One mistake at a time, of a tenth of a thousandth to one per cent."""
    assert verdict(name, spoil(answer(name, tmp_path))).kind == WRONG


@needs_cvxopt
@pytest.mark.parametrize("name", TRIALS)
def test_the_cone_programme_notices_too(name, tmp_path):
    """The programme alone: a friction bound that is off by 1 % gives another displacement."""
    given = answer(name, tmp_path)
    body_ = Body(TRIALS[name].scene, TRIALS[name].mesh)
    figures = verdict(name, given).figures
    assert figures["convex: displacement"] <= 1
    assert figures["convex: force"] <= 1
    contact = contact_of(body_)
    order = np.argmin(np.linalg.norm(body_.x[:, None] - given.place, axis=2), axis=1)
    table = given.steps[-1].table
    rows = np.argmin(np.linalg.norm(contact.x[:, None] - vectors_of_place(table), axis=2), axis=1)
    bound = contact.bound(table["pressure"][rows])
    law = (0.0, 0.0) if name == "limit" else (1 / given.gamma[0], 1 / given.gamma[1])
    nothing = Origin.nothing(contact)
    right, wrong = (
        convex.compare(
            body_, contact, 0, given.steps[-1].displacement[order], factor * bound, nothing, law
        )
        for factor in (1.0, 1.01)
    )
    assert wrong.displacement > 20 * right.displacement


def vectors_of_place(table):
    return np.stack([table[axis] for axis in "xyz"], axis=1)


# ---- outcomes without equilibrium


@needs_cvxopt
def test_the_room_that_statics_leaves():
    """A block on a plane, pressed by 1, holds a push of F in any direction, and none if it is
    lifted.
    """
    points, cells, boundaries = grid(2, 2, 2, "hexahedron")
    mesh = Mesh(points, cells, boundaries)

    def given(push, friction, down=-1.0):
        load = {"boundary": "bottom", "x": push[0], "y": push[1], "z": down}
        return {
            "material": {"young": 1.0, "poisson": 0.3},
            "traction": [load],
            "contact": [{"boundary": "bottom", "friction": friction}],
        }

    def room(push, friction, down=-1.0):
        block_ = Body(given(push, friction, down), mesh)
        contact = contact_of(block_)
        assert statics.held(block_, contact)
        return statics.slack(block_, contact, 0)[0]

    half = coulomb_friction(0.5)
    for angle in (0.0, 0.3, 2.0):
        direction = turn_by(angle)[:, 0]
        assert room(0.499 * direction, half) > 0
        assert room(0.501 * direction, half) < 0
        assert room(0.499 * direction, tresca_friction(0.5)) > 0
        assert room(0.501 * direction, tresca_friction(0.5)) < 0
    assert room((0.0, 0.0), half, down=0.1) < 0

    def kind(data, outcome):
        return judge(data, mesh, Answer(outcome, points, [], gamma=(np.inf, np.inf))).kind

    assert kind(given((0.3, 0.3), tresca_friction(0.5)), OPEN) == DENIED
    assert kind(given((0.3, 0.3), half), OPEN) == DENIED
    assert kind(given((0.4, 0.4), half), OPEN) == NO_BALANCE
    assert kind(given((0.3, 0.3), half), NOT_CERTIFIED) == UNCERTIFIED
