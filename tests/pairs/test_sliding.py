"""The map of two deformed sides of the plane: its derivatives against differences, and what no joint motion changes."""

import numpy as np
import pytest
from surfaces import nothing_held

from signorini_fx.mechanics.pairs.pair_side import Lagrange, PairSurface
from signorini_fx.mechanics.pairs.sliding import slide

DEGREES = pytest.mark.parametrize("degree", [1, 2])


def chain(x, sign, degree=1):
    """Facets between points in order; ``sign``: of their normals, see ``PairSurface``."""
    first = np.arange(0, len(x) - degree, degree)
    nodes = np.column_stack((first, first + degree, first + 1))[:, : degree + 1]
    places = np.array([[0.0], [1.0], [0.5]])[: degree + 1]
    return PairSurface(nodes, x, Lagrange(places), np.full(len(nodes), sign), np.zeros((len(x), 2, 2)))


class Dent:
    """A block from below with a dent, and an arc that fills it."""

    def __init__(self, degree=1):
        across = np.linspace(0.0, 4.0, 41)
        angle = np.linspace(0.2 - np.pi, -0.2, 33)
        self.block = chain(np.column_stack((across, np.ones(41))), -1.0, degree)
        self.arc = chain(np.column_stack((1.7 + 0.5 * np.cos(angle), 1.48 + 0.5 * np.sin(angle))), 1.0, degree)
        self.dent = np.column_stack((0.0 * across, -0.28 * np.exp(-(((across - 1.7) / 0.5) ** 2))))
        self.uneven = 1e-3 * np.random.default_rng(0).standard_normal((74, 2))

    def at(self, displacement):
        moved = displacement + self.uneven
        slave = self.block.displaced(self.dent + moved[:41])
        master = self.arc.displaced(moved[41:] + np.array([0.0, -0.26]))
        return slide(slave, master, np.arange(41), np.zeros(41, dtype=bool), 0.3, nothing_held(slave, master))


def differences(scene, direction, step=1e-6):
    """The map a step ahead and behind."""
    return scene.at(step * direction), scene.at(-step * direction)


@DEGREES
def test_joint_motions(degree):
    """No row changes under them, whatever the gaps are; slips do not change by a joint rotation by any angle."""
    scene = Dent(degree)
    coupling = scene.at(np.zeros((74, 2)))
    x = np.concatenate((coupling.slave.x, coupling.master.x))
    partnered = coupling.frames.partnered
    assert 5 < np.count_nonzero(partnered) < 35
    for motion in (np.tile([1.0, 0.0], (74, 1)), np.tile([0.0, 1.0], (74, 1)), np.column_stack((-x[:, 1], x[:, 0]))):
        for rows in (coupling.normal_rows, coupling.tangent_rows):
            assert np.abs(rows @ motion.ravel())[partnered].max() < 1e-12
    turn = np.array([[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]])
    turned = scene.at(x @ turn.T - x)
    assert turned.gap[partnered] == pytest.approx(coupling.gap[partnered], abs=1e-12)
    assert turned.slip(coupling.frames) == pytest.approx(0.0, abs=1e-12)


@DEGREES
def test_derivatives(degree):
    """Of gaps and of their forces to what is held, one per cent where sides touch; of the slip at rest."""
    scene = Dent(degree)
    coupling = scene.at(np.zeros((74, 2)))
    x = np.concatenate((coupling.slave.x, coupling.master.x))
    direction = np.column_stack((np.sin(2 * x[:, 0] + x[:, 1]), np.cos(1.5 * x[:, 0])))
    direction[41:] += [0.7, 0.1]
    ahead, behind = differences(scene, direction)
    touching = coupling.gap < 0.01
    assert np.count_nonzero(touching) >= 5
    change = (ahead.gap[touching] - behind.gap[touching]) / 2e-6
    expected = -(coupling.normal_rows @ direction.ravel())[touching]
    assert expected == pytest.approx(change, abs=2e-3 * np.abs(change).max())
    pressure = touching.astype(np.float64)
    forces = [side.normal_rows.T @ (side.weight * pressure) for side in (ahead, behind)]
    expected = (forces[0] - forces[1]) / 2e-6
    stiffness = coupling.stiffness(pressure, 0.0 * pressure[:, None])
    assert np.abs(stiffness - stiffness.T).max() < 1e-12
    assert np.linalg.norm(stiffness @ direction.ravel() - expected) < 0.03 * np.linalg.norm(expected)
    slips = [side.slip(coupling.frames) for side in (ahead, behind)]
    slipped = (slips[0] - slips[1])[touching, 0] / 2e-6
    assert (coupling.tangent_rows @ direction.ravel())[touching] == pytest.approx(slipped, rel=0.01, abs=1e-3)
