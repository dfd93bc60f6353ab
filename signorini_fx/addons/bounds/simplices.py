"""Triangles or tetrahedra of a body as plain arrays: geometry, Hooke's law, strains of
displacements of degree 2.

Arrays of cells have n rows, of facets f, of edges e, of vertices v; facets are edges in 2D and
faces in 3D, and volumes and areas are areas and lengths in 2D.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import factorial

import basix
import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from signorini_fx.arrays import Array, Ints
from signorini_fx.mechanics.rigid.rigid_motions import rigid_modes

EPS = float(np.finfo(float).eps)

# By dimension: reference cells, and the corners of the facet opposite each corner, and of each
# edge.
CELLS = {2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}
FACETS: dict[int, Ints] = {
    d: np.array(basix.topology(CELLS[d])[d - 1], dtype=np.int64) for d in (2, 3)
}
EDGES: dict[int, Ints] = {d: np.array(basix.topology(CELLS[d])[1], dtype=np.int64) for d in (2, 3)}
# Barycentric places of the corners of each part of a cell, the centre of the cell last, shape (d +
# 1, d + 1, d + 1).
CORNERS_OF_PARTS: dict[int, Array] = {
    d: np.array([[*np.eye(d + 1)[facet], np.full(d + 1, 1 / (d + 1))] for facet in FACETS[d]])
    for d in (2, 3)
}
# Vertices of the edges of a facet; in 3D the i-th is opposite its i-th vertex.
EDGES_OF_FACET: dict[int, Ints] = {2: np.array([[0, 1]]), 3: EDGES[2]}
# Corners of the quarters of a triangle among its own and the middles of its edges, and their
# barycentric places.
QUARTERS = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]])
OF_QUARTERS: Array = np.concatenate((np.eye(3), (1 - np.eye(3)) / 2))[QUARTERS]
# Rows and columns of the components (xx, yy, xy) or (xx, yy, zz, yz, xz, xy) of symmetric tensors,
# and how often each one counts.
ROWS: dict[int, Ints] = {2: np.array([0, 1, 0]), 3: np.array([0, 1, 2, 1, 0, 0])}
COLUMNS: dict[int, Ints] = {2: np.array([0, 1, 1]), 3: np.array([0, 1, 2, 2, 2, 1])}
TWICE: dict[int, Array] = {d: np.where(ROWS[d] == COLUMNS[d], 1.0, 2.0) for d in (2, 3)}


@dataclass(frozen=True)
class Moduli:
    """Hooke's law of n cells, in the m components ``ROWS`` and ``COLUMNS`` of epsilon and sigma."""

    stiffness: Array  # stresses from strains, shape (n, m, m)
    compliance: Array  # its inverse

    @classmethod
    def isotropic(cls, lame: Array, mu: Array, dimension: int) -> Moduli:
        """Return the moduli for Lame's parameters lambda and mu, stresses, shape (n,)."""
        unit = np.eye(len(ROWS[dimension]))
        normal = (ROWS[dimension] == COLUMNS[dimension]).astype(np.float64)
        mean = np.outer(normal, normal)
        first = lame[:, None, None]
        second = 2 * mu[:, None, None]
        return cls(
            second * unit + first * mean,
            (unit - first / (dimension * first + second) * mean) / second,
        )

    @property
    def stiffest(self) -> Array:
        """An upper bound of sigma : epsilon over epsilon : epsilon, stress, shape (n,)."""
        return np.trace(self.stiffness, axis1=1, axis2=2)

    def stress(self, strain: Array) -> Array:
        """Return the stresses of strains, shape (n, ..., m)."""
        return _times(self.stiffness, strain)

    def strain(self, stress: Array) -> Array:
        """Return the strains of stresses, shape (n, ..., m)."""
        return _times(self.compliance, stress)

    def of(self, cells: Ints | slice) -> Moduli:
        """Return the moduli of some of the cells."""
        return Moduli(self.stiffness[cells], self.compliance[cells])


@dataclass(frozen=True)
class Simplices:
    """A body of straight triangles or tetrahedra."""

    x: Array  # vertices, length, shape (v, d)
    corners: Ints  # of each cell, with positive determinants, shape (n, d + 1)
    moduli: Moduli  # of each cell
    # how many similar triangles a cell of the mesh is divided into, 1 or 4: those of the i-th of m
    # cells are i, i + m and so on, with corners in the order of its own, the last one between the
    # others
    parts: int = 1
    facets: Ints = field(init=False)  # vertices of each facet, ascending, shape (f, d)
    facets_of: Ints = field(
        init=False
    )  # facets of each cell, the i-th opposite its i-th corner, shape (n, d + 1)
    edges: Ints = field(
        init=False
    )  # vertices of each edge, ascending, shape (e, 2); in 2D those of the facets
    edges_of: Ints = field(
        init=False
    )  # edges of each cell in the order of ``EDGES``, shape (n, 3 or 6)

    def __post_init__(self) -> None:
        """Number facets and edges."""
        for name, parts in (("facets", FACETS), ("edges", EDGES)):
            vertices = np.sort(self.corners[:, parts[self.dimension]], axis=2)
            _, first, inverse = np.unique(
                self.keys(vertices), return_index=True, return_inverse=True
            )
            object.__setattr__(self, name, vertices.reshape(-1, vertices.shape[2])[first])
            object.__setattr__(self, f"{name}_of", inverse.reshape(vertices.shape[:2]))

    @property
    def dimension(self) -> int:
        """The dimension, 2 or 3."""
        return int(self.x.shape[1])

    def keys(self, vertices: Ints) -> Ints:
        """Return a number for each edge or facet from its ascending vertices; edges and facets are
        sorted by it.
        """
        return vertices @ len(self.x) ** np.arange(vertices.shape[-1])[::-1]

    @cached_property
    def nodes_of(self) -> Ints:
        """The nodes of each cell: vertices, and edges with numbers after all vertices, shape (n, 6
        or 10).
        """
        return np.column_stack((self.corners, len(self.x) + self.edges_of))

    @cached_property
    def nodes_of_facets(self) -> Ints:
        """The nodes of each facet, with edges in the order of ``EDGES_OF_FACET``, shape (f, 3 or
        6).
        """
        edges = np.searchsorted(
            self.keys(self.edges), self.keys(self.facets[:, EDGES_OF_FACET[self.dimension]])
        )
        return np.column_stack((self.facets, len(self.x) + edges))

    def with_middles(self, y: Array) -> Array:
        """Return the values at all nodes of a function that is linear on the cells, from its values
        at vertices; the middles of edges follow the vertices.
        """
        return np.concatenate((y, y[self.edges].mean(axis=1)))

    @cached_property
    def sides(self) -> Ints:
        """The cells at each facet, the lower number first, -1 for none, shape (f, 2)."""
        order = np.argsort(self.facets_of.ravel(), kind="stable")
        facet = self.facets_of.ravel()[order]
        cell = order // (self.dimension + 1)
        second = np.append(False, facet[1:] == facet[:-1])
        sides = np.full((len(self.facets), 2), -1)
        sides[facet[~second], 0] = cell[~second]
        sides[facet[second], 1] = cell[second]
        return sides

    @cached_property
    def neighbours(self) -> sp.csr_matrix:
        """The matrix of cells that share a facet, with the lower number as its row, shape
        (n, n).
        """
        inner = self.sides[self.sides[:, 1] >= 0]
        count = len(self.corners)
        return sp.csr_matrix((np.ones(len(inner)), tuple(inner.T)), shape=(count, count))

    @cached_property
    def piece(self) -> Ints:
        """The piece of the body that each cell is in, from 0, shape (n,)."""
        return np.asarray(connected_components(self.neighbours, directed=False)[1], dtype=np.int64)

    @cached_property
    def piece_of_vertex(self) -> Ints:
        """The piece that each vertex is in, shape (v,); no vertex is in two of them."""
        piece = np.zeros(len(self.x), dtype=np.int64)
        piece[self.corners] = self.piece[:, None]
        return piece

    @cached_property
    def sign(self) -> Array:
        """1 where a cell is the first one at its facet, otherwise -1, shape (n, d + 1)."""
        first = self.sides[self.facets_of, 0] == np.arange(len(self.corners))[:, None]
        return np.where(first, 1.0, -1.0)

    @cached_property
    def outer(self) -> Ints:
        """The facets of the boundary."""
        return np.flatnonzero(self.sides[:, 1] < 0)

    @cached_property
    def _scaled_normals(self) -> Array:
        """The area of each facet times its normal out of its first cell, shape (f, d)."""
        cell = self.sides[:, 0]
        scaled = -self.dimension * self.volume[:, None, None] * self.gradients
        opposite = (self.facets_of[cell] == np.arange(len(cell))[:, None]).argmax(axis=1)
        return scaled[cell, opposite]

    @cached_property
    def area(self) -> Array:
        """The area of each facet, shape (f,)."""
        return np.linalg.norm(self._scaled_normals, axis=1)

    @cached_property
    def normal(self) -> Array:
        """The unit normal of each facet, out of its first cell, on the boundary out of the body,
        shape (f, d).
        """
        return self._scaled_normals / self.area[:, None]

    @cached_property
    def jacobian(self) -> Array:
        """The Jacobian of each cell, with the columns x_1 - x_0, x_2 - x_0, ..., shape (n,
        d, d).
        """
        p = self.x[self.corners]
        return (p[:, 1:] - p[:, :1]).transpose(0, 2, 1)

    @cached_property
    def volume(self) -> Array:
        """The volume of each cell, shape (n,)."""
        return np.linalg.det(self.jacobian) / factorial(self.dimension)

    @cached_property
    def gradients(self) -> Array:
        """The gradients of the barycentric coordinates, 1 / length, shape (n, d + 1, d)."""
        inverse = np.linalg.inv(self.jacobian)
        return np.concatenate((-inverse.sum(axis=1, keepdims=True), inverse), axis=1)

    def strain_at_corners(self, y: Array) -> Array:
        """Return the strain of a displacement of degree 2 at the corners of the cells, shape (n, d
        + 1, 3 or 6).

        Args:
            y: the displacement at the nodes, length, shape (v + e, d).
        """
        d = self.dimension
        g = self.gradients
        # From the first corner on: how far a cell moves costs its strain no digits.
        at, middle = np.split(y[self.nodes_of] - y[self.corners[:, :1]], [d + 1], axis=1)
        bubble = middle - at[:, EDGES[d]].mean(axis=2)
        gradient = np.repeat(np.einsum("nid,nij->ndj", at, g)[:, None], d + 1, axis=1)
        if np.any(bubble):
            for k in range(len(EDGES[d])):  # 4 l_a l_b
                a, b = EDGES[d][k]
                gradient[:, a] += 4 * bubble[:, k, :, None] * g[:, b, None]
                gradient[:, b] += 4 * bubble[:, k, :, None] * g[:, a, None]
        rows = ROWS[d]
        columns = COLUMNS[d]
        return (gradient[..., rows, columns] + gradient[..., columns, rows]) / 2


def _times(matrix: Array, components: Array) -> Array:
    """Return the products of the matrix of each cell with components, shape (n, ..., m)."""
    count = components.shape[0]
    m = components.shape[-1]
    return (components.reshape(count, -1, m) @ matrix.swapaxes(1, 2)).reshape(components.shape)


def with_hats(values: Array, measure: Array) -> Array:
    """Return integrals over simplices of linear functions times the hat functions of their k
    corners, shape (m, k, ...).

    Args:
        values: the functions at the corners, shape (m, k, ...).
        measure: length, area or volume of the simplices, shape (m,).
    """
    count = values.shape[1]
    shape = (-1, *[1] * (values.ndim - 1))
    return (
        measure.reshape(shape)
        / (count * (count + 1))
        * (values + values.sum(axis=1, keepdims=True))
    )


def motions_of(arm: Array) -> Array:
    """Return translations and rotations at points with these arms, from shape (..., d) to (..., d,
    3 or 6).
    """
    d = arm.shape[-1]
    return rigid_modes(arm.reshape(-1, d), np.zeros(d), np.array(1.0)).reshape(*arm.shape, -1)


def closest_linear(moments: Array) -> Array:
    """Return linear functions at the corners of simplices from the mean values of their products
    with the barycentric coordinates, both of shape (n, k, ...).
    """
    count = moments.shape[1]
    return count * (count + 1) * moments - count * moments.sum(axis=1, keepdims=True)


def lagrange(d: int, degree: int, points: Array) -> tuple[Array, Array]:
    """Return the Lagrange functions of a degree (vertices, then edges) at points of the reference
    cell: values and derivatives by its axes, shapes (points, nodes) and (d, points, nodes).
    """
    element = basix.create_element(
        basix.ElementFamily.P, CELLS[d], degree, basix.LagrangeVariant.gll_warped
    )
    tables = element.tabulate(1, points)[..., 0]
    return tables[0], tables[1:]


def divide(t: Simplices, y: Array) -> tuple[Simplices, Array, Ints]:
    """Divide each triangle into four at the middles of its edges, see ``QUARTERS``, with a
    displacement of degree 2.

    Args:
        t: the triangles.
        y: the displacement at the nodes, length, shape (v + e, 2).

    Returns:
        Four times as many triangles, those at the first corners first, with the v + e nodes as
        vertices; the displacement at their nodes; and the halves of each given edge, the one at its
        first end first, shape (e, 2).
    """
    moduli = t.moduli.of(np.tile(np.arange(len(t.corners)), 4))
    middles = len(t.x) + np.arange(len(t.edges))
    corners = t.nodes_of[:, QUARTERS].transpose(1, 0, 2).reshape(-1, 3)
    divided = Simplices(t.with_middles(t.x), corners, moduli, 4)
    values, _ = lagrange(2, 2, OF_QUARTERS[:, EDGES[2]].mean(axis=2).reshape(-1, 3)[:, 1:])
    between = np.zeros((len(divided.edges), 2))
    between[divided.edges_of] = np.einsum(
        "ken,cnd->kced", values.reshape(4, 3, 6), y[t.nodes_of]
    ).reshape(-1, 3, 2)
    keys = divided.keys(divided.edges)
    halves = [
        np.searchsorted(keys, divided.keys(np.column_stack((t.edges[:, k], middles))))
        for k in (0, 1)
    ]
    return divided, np.concatenate((y, between)), np.column_stack(halves)
