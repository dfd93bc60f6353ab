"""The oracle of random scenes of several bodies: it notices what is wrong."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.stability.oracle import mortar
from benchmarks.stability.oracle.body import Body
from benchmarks.stability.oracle.conditions import Origin, Tractions, violations
from benchmarks.stability.oracle.judge import RIGHT, WRONG, _rows, _solution_exists, judge
from benchmarks.stability.oracle.mortar import contacts_of
from benchmarks.stability.oracle.package import answer_of, solution_of
from benchmarks.stability.oracle.scenes_of_bodies import trial
from benchmarks.stability.oracle.worker import row_of

# With Coulomb friction, in 2D and in 3D.
SPOILT = (40, 9)


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """What the package says of two scenes."""
    drawn = {seed: trial(seed, 2 + seed % 2) for seed in SPOILT}
    return {
        seed: answer_of(solution_of(one.write(tmp_path_factory.mktemp("s"))), one.units) for seed, one in drawn.items()
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


@pytest.mark.one_quick
@pytest.mark.parametrize("spoil", [None, one_pressure, one_body_moves, shear_reversed, weight_of_another_overlap])
@pytest.mark.parametrize("seed", SPOILT)
def test_what_is_wrong_is_noticed(seed, spoil, answers):
    """One mistake at a time, and nothing where there is none."""
    drawn = trial(seed, 2 + seed % 2)
    given = copy.deepcopy(answers[seed])
    found = judge(drawn.scene, drawn.mesh, given if spoil is None else spoil(given))
    assert found.kind == (RIGHT if spoil is None else WRONG), found.worst


@pytest.mark.slow
@pytest.mark.parametrize("known", [True, False])
def test_planes_of_symmetry(known, monkeypatch):
    """Where supports hold both bodies across a plane, the normal on it is that of both halves; elsewhere it is not."""
    if not known:
        monkeypatch.setattr(mortar.Side, "mirrored", lambda side, *_: side)
    assert row_of(95032, "bodies").kind == (RIGHT if known else WRONG)
    if known:
        assert row_of(95794, "bodies").kind == RIGHT


@pytest.mark.one_quick
@pytest.mark.parametrize("seed", [0, 1, 3, 7])
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


class Loaded:
    """A body under other loads."""

    def __init__(self, body, load):
        self._body, self._load = body, load

    def __getattr__(self, name):
        return getattr(self._body, name)

    def load(self, step):
        return self._load


@pytest.mark.parametrize("seed", SPOILT[:1])
def test_forces_of_the_last_digits_of_displacements(seed):
    """What gamma makes of them is in equilibrium with a law that has this gamma, and not with others."""
    drawn, chance = trial(seed, 2 + seed % 2), np.random.default_rng(seed)
    body = Body(drawn.scene, drawn.mesh)
    contact = contacts_of(body)
    u = 1e-3 * chance.normal(size=body.x.shape)
    shear, pressure = np.zeros(contact.x.shape), 1e-3 * chance.uniform(size=len(contact.weight))
    gamma = 1e13
    away = contact.of(np.finfo(float).eps * chance.choice([-1, 1], u.shape) * u)
    wrong = pressure + gamma * (away * contact.normal).sum(axis=1)
    loaded = Loaded(body, body.stiffness @ u.ravel() + contact.forces(pressure, shear))
    said = Tractions(wrong, shear, np.full(len(pressure), "open"))
    figures = [
        violations(loaded, contact, 0, u, said, Origin.nothing(contact), (soft, soft))["equilibrium"]
        for soft in (1 / gamma, 1e3 / gamma, 0.0)
    ]
    assert figures[0] < 1 < min(figures[1:])


@pytest.mark.parametrize("seed", SPOILT[:1])
def test_a_solution_is_looked_for_in_later_steps(seed, answers):
    """From the end of the one before: here the same load once more, whose solution is the same."""
    drawn, given = trial(seed, 2 + seed % 2), answers[seed]
    body = Body(drawn.scene, drawn.mesh)
    contact, last = contacts_of(body), given.steps[-1]
    order = _rows(body, contact, last.table)
    again = replace(given, steps=[last, last])
    assert isinstance(_solution_exists(body, contact, 1, again, np.asarray(last.table["pressure"])[order]), bool)
