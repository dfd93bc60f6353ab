"""The shape of cells."""

import numpy as np

# Edges of the regular triangle and tetrahedron, by their dimension.
REGULAR = {
    2: [[1.0, 0.0], [0.5, 3**0.5 / 2]],
    3: [[1.0, 0.0, 0.0], [0.5, 3**0.5 / 2, 0.0], [0.5, 3**0.5 / 6, (2 / 3) ** 0.5]],
}
# The corners at the other ends of the sides that meet in each corner, by the number of corners:
# dolfinx numbers them as binary numbers, of which each side changes one digit.
NEIGHBOURS = {2**d: [[corner ^ 2**k for k in range(d)] for corner in range(2**d)] for d in (2, 3)}


def quality(points, corners):
    """The mean ratio of each cell, at the worst corner: 1 for equilateral ones, squares and cubes,
    0 for flat ones.
    """
    x, dim = points[corners], points.shape[1]
    if corners.shape[1] == dim + 1:
        sides = (np.linalg.inv(REGULAR[dim]) @ (x[:, 1:] - x[:, :1]))[:, None]
    else:
        sides = x[:, NEIGHBOURS[corners.shape[1]]] - x[:, :, None]
    ratio = dim * np.abs(np.linalg.det(sides)) ** (2 / dim) / (sides**2).sum(axis=(2, 3))
    return ratio.min(axis=1)
