"""Facets of a side that the other one faces: those beyond its ends, or round a corner, are none of them."""

import numpy as np
import pytest

from signorini_fx.addons.cases import body_facets
from signorini_fx.addons.cases.body_facets import BodyFacets


def bodies(dim, gap):
    """A plate of 4 x 1 cells (x 3 in space) and above it a block of one cell, over the second of them and a part of the
    third; and the marks of the top of the plate and of the bottom of the block.
    """
    cells, points = [], []
    for shape, corner, size in (((4, 3), (0.0, 0.0, 0.0), 1.0), ((1, 1), (1.0, 1.0, 1.0 + gap), 1.2)):
        nx, ny = shape if dim == 3 else (shape[0], 1)
        first = sum(map(len, points))
        grid = [(i, j, k) for k in (0, 1) for j in range(ny + 1) for i in range(nx + 1)]
        x = np.array([(corner[0] + size * i, corner[1] + size * j, corner[2] + k) for i, j, k in grid])
        points.append(x if dim == 3 else x[np.array(grid)[:, 1] == 0][:, [0, 2, 1]] * [1, 1, 0])
        row, layer = nx + 1, (nx + 1) * (ny + 1 if dim == 3 else 1)
        for j in range(ny if dim == 3 else 1):
            for i in range(nx):
                a = first + i + row * j
                side = [a, a + 1, a + 1 + row, a + row]
                flat = [a, a + 1, a + 1 + layer, a + layer]
                cells.append([*side, *(n + layer for n in side)] if dim == 3 else flat)
    facets = BodyFacets(np.concatenate(points), [("hexahedron" if dim == 3 else "quad", np.array(cells))])
    (_, rows) = facets.mesh.blocks[-1]
    height = facets.mesh.points[rows][..., 2 if dim == 3 else 1]
    top, bottom = (np.isclose(height, level).all(axis=1) for level in (1.0, 1.0 + gap))
    of_block = (rows >= sum(map(len, points[:1]))).all(axis=1)
    nothing = facets.nothing()[:-1]
    return facets, [*nothing, top & ~of_block], [*nothing, bottom & of_block]


@pytest.mark.parametrize("gap", [0.0, 0.1, -0.1])
@pytest.mark.parametrize("dim", [2, 3])
def test_what_is_met_first(dim, gap):
    """The cells under the block, also where they enter; all others of the side, and the other sides, are left out."""
    facets, top, bottom = bodies(dim, gap)
    found = facets.facing(bottom, top)[-1]
    middles = facets.mesh.points[facets.mesh.blocks[-1][1]].mean(axis=1)[found]
    expected = [(1.5, 1.5), (2.5, 1.5), (1.5, 2.5), (2.5, 2.5)] if dim == 3 else [(1.5, 1.0), (2.5, 1.0)]
    assert sorted(map(tuple, middles[:, :2])) == sorted(expected)
    assert not facets.facing(facets.nothing(), top)[-1].any()


def wavy_plates(dim, cells, gap):
    """Two plates of one layer of cells that do not match, with wavy sides; marks of some facets of the upper one and
    of all of the lower one where they meet.
    """
    rng, points, nodes = np.random.default_rng(7), [], []
    for count, level in ((cells, 0.0), (cells + 3, 1.0 + gap)):
        first, across = sum(map(len, points)), count if dim == 3 else 0
        grid = np.array([(i, j, k) for i in range(count + 1) for j in range(across + 1) for k in (0, 1)])
        x = np.column_stack((grid[:, :2] / count + 0.2 * (level > 0), level + grid[:, 2]))
        x[:, 2] += 0.1 * np.sin(5 * x[:, 0]) * np.cos(3 * x[:, 1]) + 1e-3 * rng.normal(size=len(x))
        number = {tuple(place): first + n for n, place in enumerate(grid.tolist())}
        square = [(0, 0), (1, 0), (1, 1), (0, 1)]
        for i in range(count):
            for j in range(max(across, 1)):
                corners = [(i + a, j + b, k) for k in (0, 1) for a, b in square]
                corners = corners if dim == 3 else [(i + a, 0, k) for a, k in square]
                nodes.append([number[corner] for corner in corners])
        points.append(x if dim == 3 else x[:, [0, 2, 1]] * [1, 1, 0])
    facets = BodyFacets(np.concatenate(points), [("hexahedron" if dim == 3 else "quad", np.array(nodes))])
    rows = facets.mesh.blocks[-1][1]
    upper = (rows >= len(points[0])).all(axis=1)
    between = np.abs(facets.mesh.points[rows][..., dim - 1] - 1.0 - gap).max(axis=1) < 0.3
    some = np.arange(len(rows)) % 5 == 0
    return facets, [*facets.nothing()[:-1], upper & between & some], [*facets.nothing()[:-1], ~upper & between]


@pytest.mark.parametrize(("dim", "cells"), [(2, 40), (3, 9)])
def test_only_what_is_near_a_line_is_tried(dim, cells, monkeypatch):
    """Of each facet few of the others are, and what they meet first is what is met first of all of them."""
    facets, upper, lower = wavy_plates(dim, cells, 0.05)
    everything = facets.mesh.points[facets.mesh.blocks[-1][1][lower[-1]]]
    everything = np.concatenate(list(body_facets._triangles(everything)))
    met, tried = body_facets._met, []

    def recorded(places, normal, corners):
        tried.append(len(corners))
        first = met(places, normal, corners)
        among_all = met(places, normal, everything)
        np.testing.assert_array_equal(first < 0, among_all < 0)
        np.testing.assert_array_equal(corners[first[first >= 0]], everything[among_all[first >= 0]])
        return first

    monkeypatch.setattr(body_facets, "_met", recorded)
    assert facets.facing(upper, lower)[-1].any()
    assert len(tried) == upper[-1].sum()
    assert max(tried) < 0.3 * len(everything)
