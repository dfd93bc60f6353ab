"""The maps of two sides: points, gaps, frames and shares are those of the oracle's own
integrals.
"""

import numpy as np
import pytest
from mpi4py import MPI
from parameters import slow

from benchmarks.stability.oracle.mortar import Side, points_of_moved
from signorini_fx.mechanics.pairs.mortar_coupling import couple
from signorini_fx.mechanics.pairs.pair_side import ALONE, Lagrange, PairSurface, Sharing
from signorini_fx.mechanics.pairs.search import Parts
from signorini_fx.mechanics.pairs.sliding import slide

CORNERS = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
PLACES = {
    2: [[0.0], [1.0]],
    3: [[0.0], [1.0], [0.5]],
    "triangle": CORNERS,
    "quadrilateral": [*CORNERS, [1.0, 1.0]],
    "quadratic triangle": [*CORNERS, [0.5, 0.5], [0.0, 0.5], [0.5, 0.0]],
    "quadratic quadrilateral": [
        *CORNERS,
        [1.0, 1.0],
        [0.5, 0.0],
        [0.0, 0.5],
        [1.0, 0.5],
        [0.5, 1.0],
        [0.5, 0.5],
    ],
}
SLIDING = [kind for kind in PLACES if "quadratic" not in str(kind)]
BUT_SLOW = [
    pytest.param(kind, marks=[pytest.mark.slow] * (kind == "quadrilateral")) for kind in SLIDING
]


def level(kind, cells, low, high):
    """Nodes of the facets of a straight line or a flat square, and places of all nodes."""
    places = np.array(PLACES[kind])
    degree = 2 if len(places) > 2 * places.shape[1] and len(places) != 4 else 1
    axis = np.linspace(low, high, degree * cells + 1)
    if places.shape[1] == 1:
        first = degree * np.arange(cells)[:, None]
        return first + (degree * places[:, 0]).astype(int), np.column_stack((axis, 0.0 * axis))
    first = degree * np.stack(
        np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij"), axis=-1
    ).reshape(-1, 1, 2)
    turns = (
        [np.eye(2)]
        if len(places) in (4, 9)
        else [np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0, 0.0], [1, 1]])]
    )
    nodes = [(first + (degree * places @ turn.T).astype(int)) @ [axis.size, 1] for turn in turns]
    x = np.stack(
        [*np.meshgrid(axis, axis, indexing="ij"), np.zeros((axis.size, axis.size))], axis=-1
    ).reshape(-1, 3)
    return np.concatenate(nodes), x


def displacement(x, upper, seed):
    """Both sides bend alike, and each a little by itself; the upper one slides; then both turn by
    up to a radian.
    """
    rng, dim = np.random.default_rng(seed), x.shape[1]
    phase, height = rng.uniform(0.0, 6.0, 3), dim - 1
    moved = x + 0.0
    moved[:, height] += 0.1 * np.sin(2 * x[:, 0] + phase[0]) * np.cos(x[:, dim - 2] + phase[1])
    moved[:, 0] += 0.04 * np.cos(3 * x[:, 0] + phase[2])
    moved[upper, 0] += rng.uniform(-0.1, 0.1)
    moved[upper, height] += 0.05 + 0.03 * np.sin(4 * x[upper, 0] + phase[0])
    turn = np.linalg.qr(np.eye(dim) + 0.5 * rng.standard_normal((dim, dim)))[0]
    turn[:, 0] *= np.linalg.det(turn)
    return moved @ turn.T - x


def both_sides(kind, seed, end, *, slides):
    """Both as surfaces, that have moved if they slide, and what the oracle makes its own from."""
    (nodes, x), (others, y) = level(kind, 2, -0.5, 0.5), level(kind, 3, -0.9, end)
    dim, count, places = x.shape[1], len(x), np.concatenate((x, y))
    moved = displacement(places, np.arange(len(places)) < count, seed)
    # The normal of a line is its direction turned clockwise.
    signs = (
        np.full(len(nodes), 1.0 if dim == 2 else -1.0),
        np.full(len(others), -1.0 if dim == 2 else 1.0),
    )
    functions, undeformed = Lagrange(np.array(PLACES[kind])), places if slides else places + moved
    surfaces = [
        PairSurface.of(of_side, at, functions, sign)
        for of_side, at, sign in zip(
            (nodes, others), np.split(undeformed, [count]), signs, strict=True
        )
    ]
    if slides:
        ways = np.split(moved, [count])
        surfaces = [side.displaced(way) for side, way in zip(surfaces, ways, strict=True)]
    return surfaces, [
        Side(at, places + moved, sign, undeformed)
        for at, sign in zip((nodes, count + others), signs, strict=True)
    ]


def differences(kind, seed, *, slides):
    """The largest differences of weights, gaps, normals, D and M of a side that is wholly over the
    other one.
    """
    (slave, master), sides = both_sides(kind, seed, 0.8, slides=slides)
    count = len(slave.x)
    if slides:
        found = slide(slave, master, np.arange(count), 0.5)
        shares = found.frames.both[:, :count], -found.frames.both[:, count:]
    else:
        found = couple(slave, master, reach=0.5)
        shares = found.slave, found.master
    expected = points_of_moved(*sides)
    assert np.array_equal(expected.nodes, found.nodes)
    return [
        np.abs(found.weight - expected.weight).max(),
        np.abs(found.gap - expected.gap).max() if slides else 0.0,
        np.abs(found.normal - expected.normal).max(),
        np.abs(shares[0].toarray() - expected.own[:, :count]).max(),
        np.abs(shares[1].toarray() - expected.others[:, count:]).max(),
    ]


@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in (1, 2))])
@pytest.mark.parametrize("kind", BUT_SLOW)
def test_sides_that_have_moved(kind, seed):
    """At X + u, with the areas of X."""
    assert max(differences(kind, seed, slides=True)) < 1e-8


@pytest.mark.mpi
@pytest.mark.parametrize("slides", [False, True])
@pytest.mark.parametrize("kind", SLIDING)
def test_ranks_that_share_a_pair(kind, slides):
    """Each has the rows of its own points, and a part of the stiffness, of a side that ends over
    the other one.
    """
    comm = MPI.COMM_WORLD
    (slave, master), _ = both_sides(kind, 1, 0.3, slides=slides)
    rng = np.random.default_rng(2)
    owner = rng.integers(0, comm.size, len(slave.x))
    more = (np.arange(len(slave.x)),) if slides else ()
    whole, own = (
        (slide if slides else couple)(slave, master, *more, reach=0.5, sharing=sharing)
        for sharing in (ALONE, Sharing(comm, owner))
    )
    here = np.flatnonzero(owner[whole.nodes] == comm.rank)
    assert np.array_equal(own.nodes, whole.nodes[here])
    entries = ["weight", "normal", "gap", "centre", *(["normal_rows"] if slides else ["both"])]
    for name in entries:
        expected, found = getattr(whole, name)[here], getattr(own, name)
        assert abs(expected - found).max() < 1e-12 if here.size else found.shape[0] == 0
    if slides:
        tractions = rng.standard_normal((len(whole.nodes), slave.dimension))
        full, part = (
            at.stiffness(rows[:, 0], rows[:, 1:], symmetric=False).toarray()
            for at, rows in ((whole, tractions), (own, tractions[here]))
        )
        assert np.abs(comm.allreduce(part) - full).max() < 1e-12 * np.abs(full).max()


def test_points_at_a_rim():
    """Where a node has hardly anything of the other side, those that are wholly over it keep their
    weights.
    """
    (nodes, x), (others, y) = level(2, 4, -0.5, 0.5), level(2, 3, -0.9, 0.3)
    slave, master = (
        PairSurface.of(
            of_side, at, Lagrange(np.array(PLACES[2])), np.full(len(of_side), sign)
        ).displaced(0 * at)
        for of_side, at, sign in ((nodes, x, 1.0), (others, y, -1.0))
    )
    found = slide(slave, master, np.arange(len(x)), 0.5)
    assert found.frames.partnered.all()
    assert found.weight[:3] == pytest.approx([0.125, 0.25, 0.25], rel=1e-12)
    assert found.weight.sum() == pytest.approx(0.8)


@pytest.mark.parametrize("kind", PLACES)
def test_parts_of_no_facets(kind):
    """Some ranks have none."""
    places = np.array(PLACES[kind])
    x = np.column_stack((places, np.zeros(len(places))))
    side = PairSurface.of(np.arange(len(x))[None], x, Lagrange(places), np.ones(1))
    assert [len(Parts.of(side, np.arange(count)).centre) for count in (0, 1)] == [
        0,
        len(side.functions.parts),
    ]


def test_shears_move_on_with_partners():
    """From node to node of the other side, as that moves along."""
    (nodes, x), (others, y) = level(2, 2, -0.5, 0.5), level(2, 3, -0.9, 0.8)
    slave, master = (
        PairSurface.of(of_side, at, Lagrange(np.array(PLACES[2])), np.full(len(of_side), sign))
        for of_side, at, sign in ((nodes, x, 1.0), (others, y, -1.0))
    )
    way, shear = np.array([1e-6, 0.0]), np.arange(1.0, 1.0 + len(x))[:, None]
    old, new = (
        slide(slave.displaced(0 * x), master.displaced(0 * y + to), np.arange(len(x)), 0.5)
        for to in (0, way)
    )
    change = [
        old.stiffness(0 * old.weight, shear, symmetric=symmetric) for symmetric in (False, True)
    ]
    along = (change[0] - change[1]) @ np.concatenate((0 * x, 0 * y + way)).ravel()
    forces = (new.frames.both - old.frames.both).T @ (
        old.weight[:, None] * shear * old.frames.tangents[:, :, 0]
    )
    assert np.abs(forces).max() > 1e-7
    assert along == pytest.approx(forces.ravel(), rel=1e-4, abs=1e-12)


@pytest.mark.parametrize(
    "kind", [*BUT_SLOW, *(slow(kind) for kind in PLACES if kind not in SLIDING)]
)
def test_undeformed_sides(kind):
    """Curved ones, which keep their partners."""
    assert max(differences(kind, 0, slides=False)) < 1e-8
