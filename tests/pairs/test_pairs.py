"""The map of a pair of surfaces: identities that hold on any meshes, and functions against listed numbers."""

import numpy as np
import pytest
from surfaces import ELEMENTS, both, curve, sheet

from signorini_fx.mechanics.pairs.mortar_coupling import PairingError, couple
from signorini_fx.mechanics.pairs.overlap_space import clip

PAIRS = [(2, a, b) for a in ELEMENTS[2] for b in ELEMENTS[2]] + [
    (3, "P1", "P1"),
    (3, "Q1", "P1"),
    (3, "P2", "Q1"),
    (3, "Q2", "P2"),
    (3, "P1", "Q2"),
]


def coupled(slave, master, **settings):
    unable = settings.pop("unable", np.zeros(len(slave.x), dtype=bool))
    return couple(slave, master, unable, **settings)


def relative(coupling, slave, master):
    """U_rel of displacements of both sides, shape (n, d)."""
    own = coupling.slave @ slave - coupling.master @ master
    return own + (coupling.slave_turning @ slave.ravel() + coupling.master_turning @ master.ravel()).reshape(own.shape)


def joint_motions(dimension):
    """A translation and a rotation, as functions of positions."""
    if dimension == 2:
        return [lambda x: np.tile([0.3, -0.7], (len(x), 1)), lambda x: np.stack((-x[:, 1], x[:, 0]), axis=1)]
    return [lambda x: np.tile([0.3, -0.7, 0.2], (len(x), 1)), lambda x: np.cross([0.4, -0.9, 0.5], x)]


@pytest.mark.one_quick
@pytest.mark.parametrize("curved", [False, True], ids=["flat", "curved"])
@pytest.mark.parametrize("overhang", [0.0, 0.33, 0.505])
@pytest.mark.parametrize(("dimension", "element", "other"), PAIRS)
def test_identities(dimension, element, other, overhang, curved):
    """D 1 = M 1 = 1, D x - M x + d = 0, B R = 0, the weights are the covered area, forces and moments balance."""
    slave, master = both(element, other, curved, overhang=overhang, dimension=dimension)
    found = coupled(slave, master)
    for shares in (found.slave, found.master):
        np.testing.assert_allclose(shares.sum(axis=1), 1.0, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.slave @ slave.x - found.master @ master.x + found.distance, 0, atol=1e-12)
    for motion in joint_motions(dimension):
        np.testing.assert_allclose(relative(found, motion(slave.x), motion(master.x)), 0, atol=1e-11)
    assert (found.weight > 0).all()
    assert found.weight.sum() == pytest.approx(found.overlap.weight.sum(), rel=1e-12)
    width = 1.0 - max(0.0, overhang - 0.05)
    if not curved:
        assert found.weight.sum() == pytest.approx(width, rel=1e-12)
    # The same said of forces.
    traction = np.random.default_rng(1).standard_normal(found.distance.shape) * found.weight[:, None]
    on_slave, on_master = found.slave.T @ traction, -found.master.T @ traction
    on_slave += (found.slave_turning.T @ traction.ravel()).reshape(on_slave.shape)
    on_master += (found.master_turning.T @ traction.ravel()).reshape(on_master.shape)
    np.testing.assert_allclose(on_slave.sum(axis=0) + on_master.sum(axis=0), 0, atol=1e-12)
    for motion in joint_motions(dimension):
        assert abs(np.sum(on_slave * motion(slave.x)) + np.sum(on_master * motion(master.x))) < 1e-12


@pytest.mark.one_quick
@pytest.mark.parametrize(("dimension", "element", "other"), PAIRS)
def test_linear_displacements_of_matching_planes(dimension, element, other):
    """Without a distance a linear displacement of both sides makes no relative one, and D is the identity."""
    slave, master = both(element, other, False, dimension=dimension, bent=True)
    slave.x[:, 1] = 0.0
    gradient = np.random.default_rng(2).standard_normal((dimension, dimension))
    found = coupled(slave, master)
    np.testing.assert_allclose(relative(found, slave.x @ gradient, master.x @ gradient), 0, atol=1e-12)
    if len(slave.tests.places) == len(slave.functions.places) and (dimension == 2 or element in ("P1",)):
        np.testing.assert_allclose(found.slave.toarray(), np.eye(len(slave.x))[found.nodes], atol=1e-12)


def test_functions_of_a_whole_facet():
    """Dual functions of P1 and P2 lines and P1 triangles, and the shares of quadratic triangles."""
    from signorini_fx.mechanics.pairs.dual_functions import dual_coefficients
    from signorini_fx.mechanics.pairs.overlap_plane import plane_overlap
    from signorini_fx.mechanics.pairs.overlap_space import space_overlap

    def flat(s):
        return [s, 0.0]

    wanted = {
        "P1": [[2, -1], [-1, 2]],
        "P2": [[1.5, 0.5, -0.25], [0.5, 1.5, -0.25], [-1, -1, 1.5]],  # end, end, middle
    }
    for element, rows in wanted.items():
        slave = curve(element, 3, flat, (0, -1))
        master = curve("P1", 1, lambda s: [1.2 * s - 0.1, 0.0], (0, 1))
        overlap = plane_overlap(slave, master, 1.0, np.arange(3))
        # Which function is which follows from the order of the places.
        np.testing.assert_allclose(dual_coefficients(slave, overlap), [rows] * 3, atol=1e-12)

    def level(s, t):
        return [s, 0.0, t]

    for element in ("P1", "P2"):
        slave = sheet(element, (1, 1), level, (0, -1, 0))
        master = sheet("P1", (1, 1), lambda s, t: [1.4 * s - 0.2, 0.0, 1.4 * t - 0.2], (0, 1, 0))
        overlap = space_overlap(slave, master, 1.0, np.arange(2))
        np.testing.assert_allclose(dual_coefficients(slave, overlap), [4 * np.eye(3) - 1] * 2, atol=1e-11)
        if element == "P2":
            found = couple(slave, master, np.zeros(9, dtype=bool))
            alone = found.nodes == 0  # of the first triangle only
            row = (found.slave[alone] * found.weight[alone]).toarray().ravel() / 0.5
            vertices, mids = slave.nodes[0][:3], slave.nodes[0][3:]
            np.testing.assert_allclose(row[vertices], [2 / 15, -1 / 15, -1 / 15], atol=1e-12)
            np.testing.assert_allclose(row[mids], [-1 / 15, 1 / 5, 1 / 5], atol=1e-12)


def along(slave, master):
    """Integrals over a line of dual functions times the hats of another grid, exactly, shape (n, m)."""
    cuts = np.unique(np.concatenate((slave, master[(master > slave[0]) & (master < slave[-1])])))
    at, weights = np.polynomial.legendre.leggauss(3)
    x = ((cuts[:-1, None] + cuts[1:, None]) / 2 + np.diff(cuts)[:, None] / 2 * at).ravel()
    weights = (np.diff(cuts)[:, None] / 2 * weights).ravel()
    own, others = (np.array([np.interp(x, grid, row) for row in np.eye(len(grid))]) for grid in (slave, master))
    return (np.where(own > 0, 3 * own - 1, 0) * weights) @ others.T  # 2 N_1 - N_2 with N_2 = 1 - N_1


@pytest.mark.one_quick
@pytest.mark.parametrize(("dimension", "element", "other"), PAIRS)
def test_nodes_that_cannot_carry_a_point(dimension, element, other):
    """Held nodes are given to their neighbours: the weights still are the covered area, and shares sum to one."""
    slave, master = both(element, other, True, dimension=dimension)
    unable = slave.x[:, 0] < 0.3
    whole, found = coupled(slave, master), coupled(slave, master, unable=unable)
    assert not unable[found.nodes].any()
    assert found.nodes.size < whole.nodes.size
    assert found.weight.sum() == pytest.approx(whole.weight.sum(), rel=1e-12)
    for motion in joint_motions(dimension):
        np.testing.assert_allclose(relative(found, motion(slave.x), motion(master.x)), 0, atol=1e-11)
    with pytest.raises(PairingError, match="own all nodes"):
        coupled(slave, master, unable=np.ones(len(slave.x), dtype=bool))


def test_gap_between_arcs():
    """Between concentric arcs the gap is the difference of the radii as far as quadratic facets are round."""

    def arc(radius, first, last):
        return lambda s: [radius * np.sin(first + (last - first) * s), -radius * np.cos(first + (last - first) * s)]

    for element, tolerance in (("P1", 2e-2), ("P2", 1e-5)):
        slave = curve(element, 12, arc(1.0, -0.8, 0.8), (0, -1))
        master = curve(element, 17, arc(1.1, -1.0, 1.0), (0, 1))
        found = coupled(slave, master)
        np.testing.assert_allclose(found.gap, 0.1, atol=tolerance)
        radial = slave.x[found.nodes] / np.linalg.norm(slave.x[found.nodes], axis=1, keepdims=True)
        np.testing.assert_allclose(found.normal, radial, atol=0.1)


def test_facets_out_of_reach():
    """Facets are partners where their mean distance is within reach, which does not depend on points of quadrature: six
    of the master.  Rays half-way between both normals, with half of the slope's angle, widen what is under these.
    """
    slave = curve("P1", 10, lambda s: [s, 0.0], (0, -1))
    master = curve("P1", 10, lambda s: [s, -0.1 - 0.5 * s], (0, 1))
    assert coupled(slave, master, reach=0.41).covered == pytest.approx(0.6 * (1.0 + 0.5 * np.tan(np.arctan(0.5) / 2)))


def test_sides_that_do_not_fit():
    """They overlap nowhere, are far apart, face the same way, or lie over each other twice: each is said."""
    slave, master = both("P1", "P1", False)
    with pytest.raises(PairingError, match="none of its facets finds one"):
        coupled(slave, both("P1", "P1", False, overhang=3.0)[1])
    with pytest.raises(PairingError, match="none of its facets finds one"):
        coupled(slave, master, reach=1e-3)
    turned = curve("P1", 5, lambda s: [s, -0.1], (0, -1))
    with pytest.raises(PairingError, match="none of its facets finds one"):
        coupled(slave, turned)
    lower = curve("P1", 5, lambda s: [s, -0.05], (0, 1))
    from dataclasses import replace

    twice = replace(
        master,
        nodes=np.vstack((master.nodes, lower.nodes + len(master.x))),
        x=np.vstack((master.x, lower.x)),
        sign=np.append(master.sign, lower.sign),
    )
    with pytest.raises(PairingError, match="more than one sheet"):
        coupled(slave, twice)


def test_clipping():
    """Areas of convex polygons that overlap, against a count of random points."""
    generator = np.random.default_rng(3)
    angle = np.sort(generator.uniform(0, 2 * np.pi, (40, 4)), axis=1)
    both_of_them = [
        np.stack((np.cos(turn), np.sin(turn)), axis=2) + generator.uniform(-0.5, 0.5, (40, 1, 2))
        for turn in (angle[:, :3], angle)
    ]
    polygon, count = clip(*both_of_them)
    p = generator.uniform(-1.6, 1.6, (40_000, 2))

    def inside(corners):
        along = np.roll(corners, -1, axis=0) - corners
        arm = p[:, None] - corners
        return (along[:, 0] * arm[..., 1] - along[:, 1] * arm[..., 0] >= 0).all(axis=1)

    for number in range(40):
        hit = inside(both_of_them[0][number]) & inside(both_of_them[1][number])
        corners = polygon[number, : count[number]]
        x, y = corners.T if len(corners) else (np.zeros(1), np.zeros(1))
        area = (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2
        assert area == pytest.approx(hit.mean() * 3.2**2, abs=0.08)
