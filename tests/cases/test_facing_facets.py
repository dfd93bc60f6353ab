"""Facets of a side that the other one faces: those beyond its ends, or round a corner, are none of them."""

import numpy as np
import pytest

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
