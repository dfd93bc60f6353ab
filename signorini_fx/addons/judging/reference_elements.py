"""Shape functions and quadrature of the elements of other programs, by monomials; independent of dolfinx and of basix.

Nodes are in the order of ``mesh.files.cells``; elements of the serendipity family are those of that order without the
nodes in the middle of faces and cells.  Reference cells are [0, 1]^d and the unit simplex.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np

from signorini_fx.mechanics.mesh.files.cells import CELLS
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

# The serendipity elements: the complete kind, and how many of its nodes they have.
_SERENDIPITY = {"quad8": ("quad9", 8), "hexahedron20": ("hexahedron27", 20)}


@dataclass(frozen=True, eq=False)
class ReferenceElement:
    """An element with its shape functions.

    Attributes:
        kind: its name.
        nodes: their places on the reference cell, shape (k, dim).
        corner_count: how many of them are corners.
        simplex: whether it is a triangle or a tetrahedron.
        exponents: of the monomials that span the shape functions, shape (k, dim).
        coefficients: of the shape functions in the monomials, shape (k, k).
    """

    kind: str
    nodes: Floats
    corner_count: int
    simplex: bool
    exponents: Ints
    coefficients: Floats

    @property
    def dim(self) -> int:
        """Its dimension."""
        return self.nodes.shape[1]

    @property
    def degree(self) -> int:
        """1: all nodes are corners; 2: there are others."""
        return 1 if len(self.nodes) == self.corner_count else 2

    @property
    def linear(self) -> ReferenceElement:
        """That of degree 1 on the same corners."""
        degree_one = next(
            cell
            for cell in CELLS.values()
            if cell.degree == 1 and cell.dim == self.dim and len(cell.corners) == self.corner_count
        )
        return reference_element(degree_one.kind)

    def shape(self, x: Floats) -> Floats:
        """Shape functions at places of the reference cell, shape (q, dim) -> (q, k)."""
        return _monomials(x, self.exponents) @ self.coefficients

    def gradient(self, x: Floats) -> Floats:
        """Their derivatives along the reference axes, shape (q, dim) -> (q, k, dim)."""
        columns = []
        for axis in range(self.dim):
            lower = self.exponents.copy()
            lower[:, axis] = np.maximum(lower[:, axis] - 1, 0)
            columns.append((self.exponents[:, axis] * _monomials(x, lower)) @ self.coefficients)
        return np.stack(columns, axis=2)


def _monomials(x: Floats, exponents: Ints) -> Floats:
    return np.asarray((x[:, None, :] ** exponents).prod(axis=2), dtype=np.float64)


@cache
def reference_element(kind: str) -> ReferenceElement:
    """The element of a kind.

    Raises:
        KeyError: there is no such element.
    """
    full_kind, count = _SERENDIPITY.get(kind, (kind, len(CELLS[kind].nodes) if kind in CELLS else 0))
    cell = CELLS[full_kind]
    corners = np.array(cell.corners, dtype=np.float64).reshape(len(cell.corners), cell.dim)
    nodes = np.array([corners[list(members)].mean(axis=0) for members in cell.nodes[:count]])
    powers = np.array(list(product(range(cell.degree + 1), repeat=cell.dim)), dtype=np.int64)
    if kind in _SERENDIPITY:  # superlinear degree at most 2
        powers = powers[np.where(powers > 1, powers, 0).sum(axis=1) <= cell.degree]
    elif cell.simplex:
        powers = powers[powers.sum(axis=1) <= cell.degree]
    # A line is a simplex and a cube, with the same functions.
    coefficients = np.asarray(np.linalg.inv(_monomials(nodes, powers)), dtype=np.float64)
    return ReferenceElement(kind, nodes, len(corners), cell.simplex and cell.dim > 1, powers, coefficients)


@cache
def gauss(points: int, dim: int, *, simplex: bool = False) -> tuple[Floats, Floats]:
    """Places and weights of Gauss's rule along each axis, on the cube or collapsed onto the simplex.

    Args:
        points: along each axis.
        dim: of the cell.
        simplex: whether it is one.
    """
    on_line, of_line = np.polynomial.legendre.leggauss(points)
    at, weight = (on_line + 1) / 2, of_line / 2
    x = np.stack(np.meshgrid(*[at] * dim, indexing="ij"), axis=-1).reshape(-1, dim).astype(np.float64)
    grid = np.stack(np.meshgrid(*[weight] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    weights: Floats = np.prod(grid, axis=1, dtype=np.float64)
    if simplex:
        remaining: Floats = np.ones(len(x))
        for axis in range(dim):
            along = x[:, axis].copy()
            weights, x[:, axis] = weights * remaining, along * remaining
            remaining = remaining * (1 - along)
    return x, weights


# Rules on simplices by which programs integrate stiffness: one point, and three or four of degree 2.
_THREE: Floats = np.array([[1, 1], [4, 1], [1, 4]]) / 6
_NEAR, _FAR = (5 - np.sqrt(5)) / 20, (5 + 3 * np.sqrt(5)) / 20
_FOUR: Floats = np.full((4, 3), _NEAR)
_FOUR[1:] += (_FAR - _NEAR) * np.eye(3)


def stiffness_rule(element: ReferenceElement, further: int = 0) -> tuple[Floats, Floats]:
    """Places and weights with which programs integrate the stiffness of an element.

    Args:
        element: the element.
        further: points along each axis, besides those of plain elements; simplices have one with fewer.
    """
    if element.simplex and further <= 0:
        volume = 1 / 2 if element.dim == 2 else 1 / 6
        places: Floats = np.full((1, element.dim), 1 / (element.dim + 1))
        if element.degree == 2 and further == 0:
            places = _THREE if element.dim == 2 else _FOUR
        return places, np.full(len(places), volume / len(places))
    return gauss(element.degree + 1 + further, element.dim, simplex=element.simplex)
