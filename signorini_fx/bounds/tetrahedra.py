"""Tetrahedra of a body as plain arrays: geometry, Hooke's law, strains of displacements of degree 2."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from signorini_fx.bounds.arrays import Array, Ints
from signorini_fx.bounds.cell_pieces import pieces_of_cells, pieces_of_vertices

# Corners of the face opposite each corner, and of each edge.
FACES: Ints = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
EDGES: Ints = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
# Rows and columns of the components (xx, yy, zz, yz, xz, xy) of symmetric tensors, and how often each one counts.
ROWS: Ints = np.array([0, 1, 2, 1, 0, 0])
COLUMNS: Ints = np.array([0, 1, 2, 2, 2, 1])
TWICE: Array = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])


@dataclass(frozen=True)
class Tetrahedra:
    """A body of straight tetrahedra, n of them with v vertices, e edges and f faces.

    Attributes:
        x: vertices, length, shape (v, 3).
        corners: of each tetrahedron, with positive determinants, shape (n, 4).
        lame: lambda and mu of each tetrahedron, stresses, shape (n, 2).
    """

    x: Array
    corners: Ints
    lame: Array

    def _numbered(self, parts: Ints) -> tuple[Ints, Ints]:
        """Vertices of faces or edges, ascending, and their numbers in each tetrahedron.

        Args:
            parts: ``FACES`` or ``EDGES``.
        """
        sorted_vertices = np.sort(self.corners[:, parts], axis=2)
        entities, inverse = np.unique(sorted_vertices.reshape(-1, parts.shape[1]), axis=0, return_inverse=True)
        return entities, inverse.reshape(-1, len(parts))

    @cached_property
    def _faces(self) -> tuple[Ints, Ints]:
        return self._numbered(FACES)

    @cached_property
    def _edges(self) -> tuple[Ints, Ints]:
        return self._numbered(EDGES)

    @property
    def faces(self) -> Ints:
        """Vertices of each face, ascending, shape (f, 3)."""
        return self._faces[0]

    @property
    def facets(self) -> Ints:
        """The faces."""
        return self.faces

    @property
    def of_tetrahedron(self) -> Ints:
        """Faces of each tetrahedron, the i-th opposite its i-th corner, shape (n, 4)."""
        return self._faces[1]

    @property
    def edges(self) -> Ints:
        """Vertices of each edge, ascending, shape (e, 2)."""
        return self._edges[0]

    @property
    def edges_of(self) -> Ints:
        """Edges of each tetrahedron in the order of ``EDGES``, shape (n, 6)."""
        return self._edges[1]

    @cached_property
    def edges_of_faces(self) -> Ints:
        """Edges of each face, the i-th opposite its i-th vertex, shape (f, 3)."""
        keys = self.edges @ [len(self.x), 1]
        return np.searchsorted(keys, self.faces[:, [[1, 2], [0, 2], [0, 1]]] @ [len(self.x), 1])

    @cached_property
    def sides(self) -> Ints:
        """The tetrahedra at each face, the lower number first, -1 for none, shape (f, 2)."""
        order = np.argsort(self.of_tetrahedron.ravel(), kind="stable")
        face, cell = self.of_tetrahedron.ravel()[order], order // 4
        second = np.append(False, face[1:] == face[:-1])
        sides = np.full((len(self.faces), 2), -1)
        sides[face[~second], 0], sides[face[second], 1] = cell[~second], cell[second]
        return sides

    @cached_property
    def piece(self) -> Ints:
        """The piece of the body that each cell is in, from 0, shape (n,)."""
        return pieces_of_cells(self.sides, len(self.corners))

    @cached_property
    def piece_of_vertex(self) -> Ints:
        """The piece that each vertex is in, shape (v,)."""
        return pieces_of_vertices(self.corners, self.piece, len(self.x))

    @cached_property
    def sign(self) -> Array:
        """1 where a tetrahedron is the first one at its face, else -1, shape (n, 4)."""
        first = self.sides[self.of_tetrahedron, 0] == np.arange(len(self.corners))[:, None]
        return np.where(first, 1.0, -1.0)

    @cached_property
    def outer(self) -> Ints:
        """The faces of the boundary."""
        return np.flatnonzero(self.sides[:, 1] < 0)

    @cached_property
    def _cross(self) -> Array:
        """Twice the area times the normal out of the first tetrahedron, shape (f, 3)."""
        p = self.x[self.faces]
        cross = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        inside = self.x[self.corners[self.sides[:, 0]]].mean(axis=1) - p[:, 0]
        return np.where(((cross * inside).sum(axis=1) > 0)[:, None], -cross, cross)

    @cached_property
    def area(self) -> Array:
        """Of each face, shape (f,)."""
        return np.asarray(np.linalg.norm(self._cross, axis=1) / 2)

    @cached_property
    def normal(self) -> Array:
        """Of each face, out of its first tetrahedron, unit, shape (f, 3)."""
        return self._cross / (2 * self.area[:, None])

    @cached_property
    def jacobian(self) -> Array:
        """(x_1 - x_0, x_2 - x_0, x_3 - x_0) of each tetrahedron, one per column, shape (n, 3, 3)."""
        p = self.x[self.corners]
        return (p[:, 1:] - p[:, :1]).transpose(0, 2, 1)

    @cached_property
    def volume(self) -> Array:
        """Shape (n,)."""
        return np.linalg.det(self.jacobian) / 6

    @cached_property
    def gradients(self) -> Array:
        """Of the barycentric coordinates, 1 / length, shape (n, 4, 3)."""
        inverse = np.linalg.inv(self.jacobian)
        return np.concatenate((-inverse.sum(axis=1, keepdims=True), inverse), axis=1)

    @property
    def softest(self) -> Array:
        """Alpha with sigma(w) : eps(w) >= alpha |eps(w)|^2, stress, shape (n,)."""
        return np.minimum(2 * self.lame[:, 1], 3 * self.lame[:, 0] + 2 * self.lame[:, 1])

    def stress(self, strain: Array) -> Array:
        """Of strains, shape (n, ..., 6)."""
        first, second = (self.lame[:, k].reshape(-1, *[1] * (strain.ndim - 1)) for k in (0, 1))
        stress = 2 * second * strain
        stress[..., :3] += first * strain[..., :3].sum(axis=-1, keepdims=True)
        return np.asarray(stress)

    def strain(self, stress: Array) -> Array:
        """Of stresses, shape (n, ..., 6)."""
        first, second = (self.lame[:, k].reshape(-1, *[1] * (stress.ndim - 1)) for k in (0, 1))
        strain = stress.copy()
        strain[..., :3] -= first / (3 * first + 2 * second) * stress[..., :3].sum(axis=-1, keepdims=True)
        return np.asarray(strain / (2 * second))

    def strain_at_corners(self, y: Array, middle: Array) -> Array:
        """Strains of a displacement of degree 2 at the corners of the tetrahedra, shape (n, 4, 6).

        Args:
            y: at the vertices, length, shape (v, 3).
            middle: at the middles of the edges, shape (e, 3).
        """
        bubble = (middle - y[self.edges].mean(axis=1))[self.edges_of]
        g = self.gradients
        grad = np.repeat(np.einsum("nid,nij->ndj", y[self.corners], g)[:, None], 4, axis=1)
        if np.any(bubble):
            for k in range(6):  # 4 l_a l_b
                a, b = int(EDGES[k, 0]), int(EDGES[k, 1])
                grad[:, a] += 4 * bubble[:, k, :, None] * g[:, b, None]
                grad[:, b] += 4 * bubble[:, k, :, None] * g[:, a, None]
        return np.asarray((grad[..., ROWS, COLUMNS] + grad[..., COLUMNS, ROWS]) / 2)
