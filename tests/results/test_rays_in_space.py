"""The search of the certificate of sides that slide in 3D: no pair of facets is missed, and its memory is sparse."""

import tracemalloc

import numpy as np
import pytest

from signorini_fx.results.certificate import sliding_claim_in_space as certificate
from signorini_fx.results.certificate.sliding_claim_in_space import Sheet

WIDTHS = {"triangle": 3, "quadrilateral": 4}


def sheet(kind, counts, place, up):
    """A grid over the unit square, moved by ``place``; ``up``: whether the body is below it."""
    axes = [np.linspace(0, 1, n + 1) for n in counts]
    x = place(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2))
    k = np.arange(len(x)).reshape(counts[0] + 1, counts[1] + 1)
    around = np.stack((k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]), axis=-1).reshape(-1, 4)
    facets = around if kind == "quadrilateral" else np.concatenate((around[:, :3], around[:, [0, 2, 3]]))
    return Sheet(np.arange(len(x)), x, facets if up else facets[:, ::-1], np.ones(len(x)))


def facing(kind, others, seed, cells=9):
    """Two sheets, bent and graded at random, and directions of the facets of the first one."""
    rng = np.random.default_rng(seed)
    bend, grade = 0.2 * rng.standard_normal(4), rng.uniform(1.0, 2.5)

    def place(x, away):
        x = x**grade if away else x
        height = bend[0] * np.sin(3 * x[:, 0]) + bend[1] * np.cos(2 * x[:, 1]) + bend[2] * x[:, 0] * x[:, 1]
        return np.column_stack((x + away * bend[3], height + away * (0.05 + 0.1 * x[:, 0])))

    slave = sheet(kind, (cells, cells - 2), lambda x: place(x, 0), up=True)
    master = sheet(others, (cells - 2, cells + 1), lambda x: place(x, 1), up=False)
    ways = slave.facing(slave.x) + 0.1 * rng.standard_normal((len(slave.facets), 3))
    return slave, master, ways / np.linalg.norm(ways, axis=1, keepdims=True)


@pytest.mark.one_quick
@pytest.mark.parametrize("reach", [0.0, 0.08, np.inf])
@pytest.mark.parametrize(("kind", "others"), [(a, b) for a in WIDTHS for b in WIDTHS])
def test_no_pair_is_missed(kind, others, reach):
    """The points are those of all pairs of facets, tried one and all."""
    found = 0
    for seed in range(4):
        slave, master, ways = facing(kind, others, seed)
        rays = certificate._rays(slave, slave.x, ways, master, master.x, reach)
        number, over = np.divmod(np.arange(len(slave.facets) * len(master.facets)), len(master.facets))
        outward, inward = slave.facing(slave.x), master.facing(master.x)
        faces = np.sum(outward[number] * inward[over], axis=1) < certificate.FACING_SIDES
        corners = slave.x[slave.facets], master.x[master.facets]
        rule = certificate.triangle_rule(certificate._POINTS[max(slave.width, master.width)])
        tried = certificate._seen_from_facets(slave, corners, ways, (number[faces], over[faces]), rule, reach)
        columns = rays.facet, rays.at, rays.over, rays.place, rays.distance, rays.area
        for values, expected in zip(columns, tried, strict=True):
            np.testing.assert_array_equal(values, expected)
        found += rays.facet.size
    assert (found > 0) == (reach > 0)


def test_the_areas_are_those_of_the_slave():
    """Over a sheet that is larger each facet of the slave is covered once."""

    def flat(x, size, z):
        return np.column_stack((size * (x - 0.5), np.full(len(x), z)))

    for kind in WIDTHS:
        slave = sheet(kind, (6, 5), lambda x: flat(x, 1.0, 0.0), up=True)
        master = sheet(kind, (8, 7), lambda x: flat(x, 1.3, 0.1), up=False)
        rays = certificate._rays(slave, slave.x, slave.facing(slave.x), master, master.x, 1.0)
        areas = np.bincount(rays.facet, rays.area)
        assert areas == pytest.approx(slave.areas, rel=1e-12)
        assert rays.distance == pytest.approx(0.1, rel=1e-12)


def test_memory_is_that_of_facets():
    """Four times the facets on both sides take about four times the memory, and not sixteen times."""
    peaks = []
    for cells in (20, 40):
        slave, master, _ = facing("triangle", "triangle", 0, cells)
        ways = slave.facing(slave.x)
        tracemalloc.start()
        certificate._rays(slave, slave.x, ways, master, master.x, 0.2)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 6 * peaks[0]
