"""The map of two deformed sides in 3D: its derivatives against differences, and what no joint motion changes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from surfaces import nothing_held

from signorini_fx.mechanics.pairs.pair_side import Lagrange, PairSurface
from signorini_fx.mechanics.pairs.sliding import slide

KINDS = pytest.mark.parametrize("kind", ["triangle", "quadrilateral"])
PLACES = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])


def sheet(kind, counts, low, high, up):
    """Facets of a rectangle at z = 0; ``up``: whether their normals are along z, 1, or against it, -1."""
    axes = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, counts, strict=True)]
    x = np.stack([*np.meshgrid(*axes, indexing="ij"), np.zeros([n + 1 for n in counts])], axis=-1).reshape(-1, 3)
    first = (np.arange(counts[0])[:, None] * (counts[1] + 1) + np.arange(counts[1])).ravel()
    nodes = first[:, None] + np.array([0, counts[1] + 1, 1, counts[1] + 2])
    sign = np.full(len(nodes), float(up))
    if kind == "triangle":
        nodes = np.concatenate((nodes[:, [0, 1, 3]], nodes[:, [0, 3, 2]]))
        sign = np.concatenate((sign, sign))
    return PairSurface(nodes, x, Lagrange(PLACES[: nodes.shape[1]]), sign, np.zeros((len(x), 3, 3)))


class Dent:
    """A block from below with a dent, and a sphere that fills it; ``radius``: of both; infinite: both are flat."""

    def __init__(self, kind, radius=3.0):
        block, ball = ((6, 5), (0.0, 0.0), (2.0, 2.0), 1.0), ((5, 6), (0.3, 0.25), (1.8, 1.7), -1.0)
        self.sides = sheet(kind, *block), sheet(kind, *ball)
        self.count = len(self.sides[0].x)

        def height(x):
            away = np.sum((x[:, :2] - [1.03, 0.96]) ** 2, axis=1)
            return 0.0 if np.isinf(radius) else radius - np.sqrt(radius**2 - away)

        self.places = np.concatenate([side.x for side in self.sides])
        self.bent = np.zeros_like(self.places)
        self.bent[:, 2] = height(self.places)

    def at(self, displacement):
        moved = self.bent + displacement
        slave, master = (
            side.displaced(part) for side, part in zip(self.sides, np.split(moved, [self.count]), strict=True)
        )
        return slide(
            slave, master, np.arange(self.count), np.zeros(self.count, dtype=bool), 0.5, nothing_held(slave, master)
        )

    @property
    def x(self):
        return self.places + self.bent

    @property
    def still(self):
        return np.zeros_like(self.places)


@KINDS
def test_joint_motions(kind):
    """No row changes under them, whatever the gaps are; neither gaps, weights nor slips change by a joint rotation."""
    scene = Dent(kind)
    coupling = scene.at(scene.still)
    partnered = coupling.frames.partnered
    assert 10 < np.count_nonzero(partnered) < len(partnered)
    assert np.abs(coupling.gap[partnered]).max() > 1e-3
    motions = [np.tile(axis, (len(scene.x), 1)) for axis in np.eye(3)]
    motions += [np.cross(axis, scene.x) for axis in np.eye(3)]
    for motion in motions:
        assert np.abs(coupling.normal_rows @ motion.ravel())[partnered].max() < 1e-13
        assert np.abs(coupling.tangent_rows @ motion.ravel()).reshape(-1, 2)[partnered].max() < 1e-13
    turn = Rotation.from_rotvec([0.5, -0.3, 1.8]).as_matrix()
    turned = scene.at(scene.x @ turn.T - scene.x)
    assert turned.gap[partnered] == pytest.approx(coupling.gap[partnered], abs=1e-13)
    assert turned.weight == pytest.approx(coupling.weight, rel=1e-12)
    assert turned.slip(coupling.frames) == pytest.approx(0.0, abs=1e-13)


def field(x):
    """A smooth displacement of both sides alike."""
    return np.column_stack((np.sin(2 * x[:, 0] + x[:, 1]), np.cos(1.5 * x[:, 0] - x[:, 1]), np.sin(1.3 * x[:, 1])))


@KINDS
def test_derivatives_where_sides_touch(kind):
    """Of gaps, slips and forces along an affine displacement of flat sides beside a translation along them: 1e-6."""
    scene = Dent(kind, radius=np.inf)
    coupling = scene.at(scene.still)
    seen = np.flatnonzero(coupling.covered > 0.999)
    assert seen.size > 5
    along = scene.x @ np.array([[0.3, -0.2, 0.5], [0.1, 0.4, -0.7], [0.2, 0.6, 0.3]]).T
    along[scene.count :] += [0.3, 0.2, 0.0]
    step = 1e-5
    ahead, behind = scene.at(step * along), scene.at(-step * along)
    change = (ahead.gap[seen] - behind.gap[seen]) / (2 * step)
    assert -(coupling.normal_rows @ along.ravel())[seen] == pytest.approx(change, abs=1e-6)
    slipped = (ahead.slip(coupling.frames) - behind.slip(coupling.frames))[seen] / (2 * step)
    assert np.abs(slipped).max() > 0.1
    assert (coupling.tangent_rows @ along.ravel()).reshape(-1, 2)[seen] == pytest.approx(slipped, abs=1e-6)
    bent = along + np.where(np.arange(len(along)) < scene.count, 0.0, 0.4)[:, None] * [0.0, 0.0, 1.0]
    assert -(coupling.normal_rows @ bent.ravel())[seen] == pytest.approx(change + 0.4, abs=1e-6)


@pytest.mark.one_quick
@KINDS
def test_stiffness_of_pressures(kind):
    """Against differences of their forces: what edges of the master add as they pass by is in it, too."""
    scene = Dent(kind)
    coupling = scene.at(scene.still)
    full = coupling.covered > 0.999
    along = field(scene.x)
    along[scene.count :] += [0.4, 0.2, 0.1]
    pressure = np.where(full, 1.0 + coupling.slave.x[:, 0], 0.0)
    step = 1e-6
    ahead, behind = (scene.at(sign * step * along) for sign in (1, -1))
    change = (ahead.gap[full] - behind.gap[full]) / (2 * step)
    assert -(coupling.normal_rows @ along.ravel())[full] == pytest.approx(change, abs=2e-3 * np.abs(change).max())
    forces = [side.normal_rows.T @ (side.weight * pressure) for side in (ahead, behind)]
    expected = (forces[0] - forces[1]) / (2 * step)
    stiffness = coupling.stiffness(pressure, np.zeros((scene.count, 2)))
    assert np.abs(stiffness - stiffness.T).max() < 1e-12
    assert np.linalg.norm(stiffness @ along.ravel() - expected) < 0.02 * np.linalg.norm(expected)
