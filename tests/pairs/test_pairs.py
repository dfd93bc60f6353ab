"""The map of a pair of surfaces: identities that hold on any meshes, and sides that do not fit."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from surfaces import ELEMENTS, both, curve

from signorini_fx.mechanics.pairs.dual_functions import carried
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError, couple
from signorini_fx.mechanics.pairs.pair_side import turned_normals

PAIRS = [(2, a, b) for a in ELEMENTS[2] for b in ELEMENTS[2]] + [
    (3, "P1", "P1"),
    (3, "Q1", "P1"),
    (3, "P2", "Q1"),
    (3, "Q2", "P2"),
    (3, "P1", "Q2"),
]


def coupled(slave, master, **settings):
    return couple(replace(slave, unable=settings.pop("unable", slave.unable)), master, **settings)


def relative(coupling, slave, master):
    """U_rel of displacements of both sides, shape (n, d)."""
    own = coupling.slave @ slave - coupling.master @ master
    return own + (coupling.turning @ np.concatenate((slave, master)).ravel()).reshape(own.shape)


def joint_motions(dimension):
    """A translation and a rotation, as functions of positions."""
    if dimension == 2:
        return [
            lambda x: np.tile([0.3, -0.7], (len(x), 1)),
            lambda x: np.stack((-x[:, 1], x[:, 0]), axis=1),
        ]
    return [
        lambda x: np.tile([0.3, -0.7, 0.2], (len(x), 1)),
        lambda x: np.cross([0.4, -0.9, 0.5], x),
    ]


@pytest.mark.one_quick("curved", [False, True], ids=["flat", "curved"])
@pytest.mark.parametrize("overhang", [0.0, 0.33, 0.505])
@pytest.mark.parametrize(("dimension", "element", "other"), PAIRS)
def test_identities(dimension, element, other, overhang, curved):
    """D 1 = M 1 = 1, D x - M x + d = 0, B R = 0, the weights are the covered area, forces and
    moments balance.
    """
    slave, master = both(element, other, curved, overhang=overhang, dimension=dimension)
    found = coupled(slave, master)
    for shares in (found.slave, found.master):
        assert_allclose(shares.sum(axis=1), 1.0, rtol=0, atol=1e-11)
    assert_allclose(found.slave @ slave.x - found.master @ master.x + found.distance, 0, atol=1e-12)
    for motion in joint_motions(dimension):
        assert_allclose(relative(found, motion(slave.x), motion(master.x)), 0, atol=1e-11)
    assert (found.weight > 0).all()
    assert found.weight.sum() == pytest.approx(found.covered, rel=1e-12)
    width = 1.0 - max(0.0, overhang - 0.05)
    if not curved:
        assert found.weight.sum() == pytest.approx(width, rel=1e-12)
    # The same said of forces.
    traction = (
        np.random.default_rng(1).standard_normal(found.distance.shape) * found.weight[:, None]
    )
    on_slave, on_master = found.slave.T @ traction, -found.master.T @ traction
    turning = (found.turning.T @ traction.ravel()).reshape(-1, dimension)
    on_slave, on_master = on_slave + turning[: len(on_slave)], on_master + turning[len(on_slave) :]
    assert_allclose(on_slave.sum(axis=0) + on_master.sum(axis=0), 0, atol=1e-12)
    for motion in joint_motions(dimension):
        assert (
            abs(np.sum(on_slave * motion(slave.x)) + np.sum(on_master * motion(master.x))) < 1e-12
        )


@pytest.mark.one_quick(("dimension", "element", "other"), PAIRS)
def test_nodes_that_cannot_carry_a_point(dimension, element, other):
    """Held nodes are given to their neighbours: the weights still are the covered area, and shares
    sum to one.
    """
    slave, master = both(element, other, True, dimension=dimension)
    unable = slave.x[:, 0] < 0.3
    whole, found = coupled(slave, master), coupled(slave, master, unable=unable)
    assert not unable[found.nodes].any()
    assert found.nodes.size < whole.nodes.size
    assert found.weight.sum() == pytest.approx(whole.weight.sum(), rel=1e-12)
    for motion in joint_motions(dimension):
        assert_allclose(relative(found, motion(slave.x), motion(master.x)), 0, atol=1e-11)
    with pytest.raises(PairingError, match="hold all nodes"):
        coupled(slave, master, unable=np.ones(len(slave.x), dtype=bool))


def test_points_have_positive_weights():
    """A node whose own function has one, but takes over a larger negative one, carries no point:
    the next one does.
    """
    side, weight = curve("P1", 2, lambda s: [s, 0.0], (0, 1)), np.array([-0.5, 0.3, 1.0])
    nodes, shares = carried(side, np.arange(2), weight, np.zeros(3, dtype=bool))
    assert nodes.tolist() == [2]
    assert shares @ weight == pytest.approx([0.8])


def test_sides_that_do_not_fit():
    """They overlap nowhere, are far apart, face the same way, or lie over each other twice: each is
    said.
    """
    slave, master = both("P1", "P1", False)
    with pytest.raises(PairingError, match="no facet faces the other side"):
        coupled(slave, both("P1", "P1", False, overhang=3.0)[1])
    with pytest.raises(PairingError, match="no facet faces the other side"):
        coupled(slave, master, reach=1e-3)
    turned = curve("P1", 5, lambda s: [s, -0.1], (0, -1))
    with pytest.raises(PairingError, match="no facet faces the other side"):
        coupled(slave, turned)
    lower = curve("P1", 5, lambda s: [s, -0.05], (0, 1))
    twice = replace(
        master,
        nodes=np.vstack((master.nodes, lower.nodes + len(master.x))),
        x=np.vstack((master.x, lower.x)),
        sign=np.append(master.sign, lower.sign),
        held=np.append(master.held, lower.held),
    )
    with pytest.raises(PairingError, match="the other surface is folded"):
        coupled(slave, twice)


@pytest.mark.parametrize(
    ("dim", "element"), [(dim, element) for dim, names in ELEMENTS.items() for element in names]
)
def test_how_normals_turn(dim, element):
    """As differences of the normals of sides that bend say."""
    side = both(element, element, curved=True, counts=(4, 4), dimension=dim, bent=True)[0]
    way = np.random.default_rng(0).standard_normal(side.x.shape)
    after, before = (replace(side, x=side.x + step * way).nodal_normals for step in (1e-6, -1e-6))
    turned = (turned_normals(side) @ way.ravel()).reshape(way.shape)
    assert turned == pytest.approx((after - before) / 2e-6, abs=1e-6)
