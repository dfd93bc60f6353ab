"""The map of two sides that have moved: points, gaps, frames and shares are those of the oracle's own integrals."""

import numpy as np
import pytest

from signorini_fx.mechanics.pairs.pair_side import Lagrange, PairSurface
from signorini_fx.mechanics.pairs.sliding import slide
from stability.oracle.bodies.mortar import Side, points_of_moved

PLACES = {
    2: [[0.0], [1.0]],
    3: [[0.0], [1.0], [0.5]],
    "triangle": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
    "quadrilateral": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]],
}


def line(width, cells, low, high):
    """Nodes of facets of a line with ``width`` nodes each, and places of nodes in the plane."""
    steps = width - 1
    first = steps * np.arange(cells)
    x = np.linspace(low, high, steps * cells + 1)
    return np.column_stack((first, first + steps, first + 1))[:, :width], np.column_stack((x, 0 * x))


def sheet(kind, cells, low, high):
    """The same of a square in space."""
    axis = np.linspace(low, high, cells + 1)
    x = np.stack([*np.meshgrid(axis, axis, indexing="ij"), np.zeros((cells + 1, cells + 1))], axis=-1).reshape(-1, 3)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    nodes = first[:, None] + np.array([0, cells + 1, 1, cells + 2])
    return np.concatenate((nodes[:, [0, 1, 3]], nodes[:, [0, 3, 2]])) if kind == "triangle" else nodes, x


def displacement(x, upper, seed):
    """Both sides bend alike, and each a little by itself; the upper one slides; then both turn by up to a radian."""
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


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", PLACES)
def test_points_of_moved_sides(kind, seed):
    """Weights, gaps, normals, D and M of a side that is wholly over the other one."""
    make = line if isinstance(kind, int) else sheet
    (nodes, x), (others, y) = make(kind, 3, -0.5, 0.5), make(kind, 4, -0.9, 0.8)
    dim, count = x.shape[1], len(x)
    places = np.concatenate((x, y))
    moved = displacement(places, np.arange(len(places)) < count, seed)
    # The normal of a line is its direction turned clockwise.
    signs = np.full(len(nodes), 1.0 if dim == 2 else -1.0), np.full(len(others), -1.0 if dim == 2 else 1.0)
    functions = Lagrange(np.array(PLACES[kind]))
    slave, master = (
        PairSurface(of_side, at, functions, sign, np.zeros((len(at), dim, dim)))
        for of_side, at, sign in zip((nodes, others), (x, y), signs, strict=True)
    )
    slave, master = slave.displaced(moved[:count]), master.displaced(moved[count:])
    found = slide(slave, master, np.arange(count), np.zeros(count, dtype=bool), 0.5)
    assert found.covered == pytest.approx(1.0)
    expected = points_of_moved(
        Side(nodes, places + moved, signs[0], places), Side(count + others, places + moved, signs[1], places)
    )
    assert np.array_equal(expected.nodes, found.nodes)
    assert found.weight == pytest.approx(expected.weight, rel=1e-9)
    assert np.abs(found.gap - expected.gap).max() < 1e-8
    assert np.abs(found.normal - expected.normal).max() < 1e-8
    assert np.abs(found.frames.slave.toarray() - expected.own[:, :count]).max() < 1e-8
    assert np.abs(found.frames.master.toarray() - expected.others[:, count:]).max() < 1e-8
