"""Surfaces for pairs of bodies, made of parameters in [0, 1] without a mesh."""

import numpy as np

from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.mechanics.pairs.pair_side import Lagrange, PairSurface

ELEMENTS = {2: ("P1", "P2"), 3: ("P1", "Q1", "P2", "Q2")}


def curve(element, count, place, outward):
    """A curve x(s), s in [0, 1], of equal facets; ``outward``: a vector on its outer side at s =
    1/2.
    """
    degree = int(element[1])
    s = np.linspace(0.0, 1.0, degree * count + 1)
    x = np.array([place(at) for at in s])
    first = degree * np.arange(count)
    nodes = first[:, None] + ([0, 1] if degree == 1 else [0, 2, 1])
    places = np.array([[0.0], [1.0], [0.5]][: degree + 1])
    return _outward(PairSurface.of(nodes, x, Lagrange(places), np.ones(count)), outward)


def grid(x, y, cells, z=0.0):
    """The table of a surface over a grid of points, in squares or in triangles; no pressure."""
    points = np.array([(a, b) for b in y for a in x])
    corner = np.array([j * len(x) + i for j in range(len(y) - 1) for i in range(len(x) - 1)])
    a, b, c, d = corner, corner + 1, corner + len(x), corner + len(x) + 1
    facets = np.column_stack((a, b, c, d))  # in the order of basix
    if cells == "triangles":
        facets = np.concatenate((np.column_stack((a, b, d)), np.column_stack((a, c, d))))
    columns = {
        "x": points[:, 0],
        "y": points[:, 1],
        "z": np.broadcast_to(z, len(points)).astype(float),
    }
    columns |= {"pressure": np.zeros(len(points)), "weight": np.full(len(points), 1.0)}
    numbers = np.column_stack((np.zeros(len(points), dtype=np.int64), np.arange(len(points))))
    return ContactTable(columns, [], numbers, facets)


def sheet(element, counts, place, outward, shift=0.0, bent=False):
    """A sheet x(s, t), (s, t) in [0, 1]^2, of nx times ny squares or twice as many triangles;
    ``shift``: how far inner nodes are moved, in shares of a square; ``bent``: whether quadratic
    triangles have curved sides in the sheet.
    """
    degree, (nx, ny) = int(element[1]), counts
    s, t = (np.linspace(0.0, 1.0, degree * n + 1) for n in counts)
    grid = np.stack(np.meshgrid(s, t), axis=-1)  # [j, i]
    inner = np.zeros(grid.shape[:2])
    inner[degree:-degree:degree, degree:-degree:degree] = 1.0
    generator = np.random.default_rng(7)
    grid = grid + shift * inner[..., None] * generator.uniform(-1, 1, grid.shape) / np.array(counts)
    if degree == 2:  # nodes between vertices stay in the middle of them
        grid[:, 1::2] = (grid[:, :-1:2] + grid[:, 2::2]) / 2
        grid[1::2] = (grid[:-1:2] + grid[2::2]) / 2
        if element[0] == "P" and not bent:
            grid[1::2, 1::2] = (grid[:-1:2, 2::2] + grid[2::2, :-1:2]) / 2
    x = np.array([place(*at) for at in grid.reshape(-1, 2)])
    j, i = (degree * index.ravel() for index in np.meshgrid(range(ny), range(nx), indexing="ij"))
    if element[0] == "Q":
        corners = np.array(
            [[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0], [0, 0.5], [1, 0.5], [0.5, 1], [0.5, 0.5]]
        )
        places = corners[: 4 if degree == 1 else 9]
        squares = [places]
    else:
        corners = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])
        places = corners[: 3 if degree == 1 else 6]
        squares = [places, 1.0 - places]
    nodes = [
        (
            (j[:, None] + degree * at[:, 1]) * (degree * nx + 1) + i[:, None] + degree * at[:, 0]
        ).astype(np.int64)
        for at in squares
    ]
    nodes = np.concatenate(nodes)
    return _outward(PairSurface.of(nodes, x, Lagrange(places), np.ones(len(nodes))), outward)


def _outward(surface, outward):
    """The same with normals on the outer side."""
    middle = surface.functions.places[: surface.dimension].mean(axis=0)
    every = np.arange(len(surface.nodes))
    normals = surface.normals(every, np.tile(middle, (len(every), 1, 1)))[:, 0]
    sign = np.sign(normals @ np.asarray(outward, dtype=float))
    return PairSurface.of(surface.nodes, surface.x, surface.functions, sign)


def both(element, other, curved, counts=(5, 7), overhang=0.0, dimension=2, bent=False):
    """A slave above a master, over [0, 1] along each axis, with a distance between them;
    ``overhang``: by how much the master is shifted along x.
    """
    rise = 0.3 if curved else 0.0

    def lower(s, t=0.0):
        x = 1.1 * s - 0.05 + overhang
        y = 1.1 * t - 0.05
        return [x, rise * (x - x**2) + 0.1 * rise * y, y][:dimension]

    def upper(s, t=0.0):
        return [s, rise * (s - s**2) * 1.1 + 0.02 + 0.1 * rise * t, t][:dimension]

    if dimension == 2:
        slave = curve(element, counts[0], upper, (0, -1))
        master = curve(other, counts[1], lower, (0, 1))
    else:
        slave = sheet(element, (counts[0], counts[0] - 1), upper, (0, -1, 0), 0.15, bent)
        master = sheet(other, (counts[1], counts[1] - 2), lower, (0, 1, 0), 0.15, bent)
    return slave, master
