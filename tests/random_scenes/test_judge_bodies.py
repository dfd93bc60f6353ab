"""The oracle of random scenes of several bodies: it notices what is wrong."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.stability.oracle import mortar
from benchmarks.stability.oracle.body import Body
from benchmarks.stability.oracle.judge import RIGHT, WRONG, judge
from benchmarks.stability.oracle.mortar import contacts_of
from benchmarks.stability.oracle.package import answer_of, solution_of
from benchmarks.stability.oracle.scenes_of_bodies import trial

# With Coulomb friction, in 2D and in 3D.
SPOILT = (40, 9)


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """What the package says of two scenes."""
    drawn = {seed: trial(seed, 2 + seed % 2) for seed in SPOILT}
    return {
        seed: answer_of(solution_of(one.write(tmp_path_factory.mktemp("s"))), one.units)
        for seed, one in drawn.items()
    }


def one_pressure(given):
    table = given.steps[-1].table
    table["pressure"][np.argmax(table["pressure"])] *= 1.0001
    return given


def one_body_moves(given):
    """By a ten thousandth of the largest displacement."""
    step = given.steps[-1]
    moved = step.displacement.copy()
    moved[given.behind[:, -1] > np.median(given.behind[:, -1])] *= 1.0001
    return replace(given, steps=[*given.steps[:-1], replace(step, displacement=moved)])


def shear_reversed(given):
    table = given.steps[-1].table
    for name in table:
        if name.startswith("shear_") or (name == "shear" and "shear_x" not in table):
            table[name] = -table[name]
    return given


def weight_of_another_overlap(given):
    table = given.steps[-1].table
    table["weight"] = table["weight"] * np.where(np.arange(len(table["weight"])) == 0, 1.0001, 1.0)
    return given


@pytest.mark.one_quick(
    "spoil", [None, one_pressure, one_body_moves, shear_reversed, weight_of_another_overlap]
)
@pytest.mark.parametrize("seed", SPOILT)
def test_what_is_wrong_is_noticed(seed, spoil, answers):
    """One mistake at a time, and nothing where there is none."""
    drawn = trial(seed, 2 + seed % 2)
    given = copy.deepcopy(answers[seed])
    found = judge(drawn.scene, drawn.mesh, given if spoil is None else spoil(given))
    assert found.kind == (RIGHT if spoil is None else WRONG), found.worst


@pytest.mark.one_quick("seed", [0, 1, 3, 7])
def test_joint_rigid_motions_do_not_move_the_points(seed):
    """The oracle's own map: zero on them, and one body alone moves all points by as much."""
    drawn = trial(seed, 2 + seed % 2)
    body = Body(drawn.scene, drawn.mesh)
    contact = contacts_of(body)
    pair = contact.part == 0
    middle = body.x - body.x.mean(axis=0)
    skew = np.zeros((body.x.shape[1],) * 2)
    skew[0, 1], skew[1, 0] = 1.0, -1.0
    for motion in (np.ones_like(body.x), middle @ skew):
        assert np.abs(contact.of(motion)[pair]).max() < 1e-11
    slave = mortar.Side.of(body, drawn.scene["contact"][0]["boundary"])
    count, labels = body.pieces
    assert count > 1
    alone = np.where(labels == labels[slave.nodes[0, 0]], 1.0, 0.0)[:, None] * np.ones_like(body.x)
    np.testing.assert_allclose(contact.of(alone)[pair], 1.0, atol=1e-11)
