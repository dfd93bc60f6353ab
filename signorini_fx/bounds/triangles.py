"""Triangles of a body in the plane as plain arrays: geometry, Hooke's law, constants of Korn's inequality."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from signorini_fx.bounds.arrays import Array, Ints
from signorini_fx.bounds.cell_pieces import pieces_of_cells, pieces_of_vertices

# Points and weights on (0, 1).
GAUSS = (np.polynomial.legendre.leggauss(8)[0] + 1) / 2, np.polynomial.legendre.leggauss(8)[1] / 2


@dataclass(frozen=True)
class Triangles:
    """A body of straight triangles, n of them with v vertices and e edges.

    Attributes:
        x: vertices, length, shape (v, 2).
        corners: of each triangle, counterclockwise, shape (n, 3).
        lame: lambda and mu of each triangle, stresses, shape (n, 2).
        parts: how many similar triangles a cell is divided into, 1 or 4: those of the i-th of m cells are i, i + m and
            so on, with corners in the order of its own, the last one between the others.
    """

    x: Array
    corners: Ints
    lame: Array
    parts: int = 1

    @cached_property
    def _edges(self) -> tuple[Ints, Ints]:
        """Vertices of each edge, ascending, shape (e, 2); edges of each triangle, edge i opposite corner i, (n, 3)."""
        ends = self.corners[:, [[1, 2], [2, 0], [0, 1]]]
        keys, inverse = np.unique(ends.min(axis=2) * len(self.x) + ends.max(axis=2), return_inverse=True)
        return np.column_stack(np.divmod(keys, len(self.x))), inverse.reshape(-1, 3)

    @property
    def edges(self) -> Ints:
        """Vertices of each edge, the lower number first, shape (e, 2)."""
        return self._edges[0]

    @property
    def facets(self) -> Ints:
        """The edges."""
        return self.edges

    @property
    def of_triangle(self) -> Ints:
        """Edges of each triangle, the i-th opposite its i-th corner, shape (n, 3)."""
        return self._edges[1]

    @cached_property
    def sides(self) -> Ints:
        """The triangles at each edge, -1 for none, the one where it runs counterclockwise first, shape (e, 2)."""
        sides = np.full((len(self.edges), 2), -1)
        for i in range(3):
            forward = self.corners[:, (i + 1) % 3] < self.corners[:, (i + 2) % 3]
            sides[self.of_triangle[:, i], np.where(forward, 0, 1)] = np.arange(len(self.corners))
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
    def length(self) -> Array:
        """Of each edge, shape (e,)."""
        return np.asarray(np.linalg.norm(self.x[self.edges[:, 1]] - self.x[self.edges[:, 0]], axis=1))

    @cached_property
    def normal(self) -> Array:
        """Of each edge, out of its first triangle, unit, shape (e, 2)."""
        along = (self.x[self.edges[:, 1]] - self.x[self.edges[:, 0]]) / self.length[:, None]
        return np.column_stack((along[:, 1], -along[:, 0]))

    @cached_property
    def outer(self) -> Ints:
        """The edges of the boundary."""
        return np.flatnonzero((self.sides < 0).any(axis=1))

    @cached_property
    def outward(self) -> Array:
        """Normal of each edge, on the boundary out of the body, shape (e, 2)."""
        return np.where(self.sides[:, :1] < 0, -self.normal, self.normal)

    @cached_property
    def jacobian(self) -> Array:
        """(x_1 - x_0, x_2 - x_0) of each triangle, one per column, shape (n, 2, 2)."""
        p = self.x[self.corners]
        return np.stack((p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=2)

    @cached_property
    def area(self) -> Array:
        """Shape (n,)."""
        return np.linalg.det(self.jacobian) / 2

    @cached_property
    def gradients(self) -> Array:
        """Of the barycentric coordinates, 1 / length, shape (n, 3, 2)."""
        inverse = np.linalg.inv(self.jacobian)
        return np.concatenate((-inverse.sum(axis=1, keepdims=True), inverse), axis=1)

    @cached_property
    def korn(self) -> tuple[Array, Array]:
        """Constants of |w - r| <= c |eps(w)| in L2 of a triangle and k of |grad (w - r)| <= k |eps(w)|, shape (n,).

        r is the rigid motion with the mean of w and of its rotation.  The first one is k h / pi by Payne and
        Weinberger; k^2 = 1 + 2 / beta^2 with the inf-sup constant beta >= rho / (2 R) of M. Costabel and M. Dauge
        (Arch. Rational Mech. Anal. 217 (2015) 873-898), rho the radius of the incircle, R the distance of its centre
        from the farthest corner.
        """
        p, sides = self.x[self.corners], self.length[self.of_triangle]
        centre = np.einsum("ni,nid->nd", sides, p) / sides.sum(axis=1)[:, None]
        inner = 2 * self.area / sides.sum(axis=1)
        outer = np.linalg.norm(p - centre[:, None], axis=2).max(axis=1)
        k = np.sqrt(1 + 8 * (outer / inner) ** 2)
        return k * sides.max(axis=1) / np.pi, k

    def on_edges(self, inside: Array, gradient: Array) -> Array:
        """Bounds of |w| in L2 of the edges of each triangle, from those of |w| and |grad w| in it, shape (n, 3).

        |w|^2 on an edge e of a triangle K is at most |e| / |K| (|w|^2 + h |w| |grad w|), with its longest side h.
        """
        sides = self.length[self.of_triangle]
        squares = inside**2 + sides.max(axis=1) * inside * gradient
        return np.asarray(np.sqrt(sides * (squares / self.area)[:, None]))

    def stress(self, strain: Array) -> Array:
        """Of strains (xx, yy, xy), shape (n, ..., 3)."""
        first, second = (self.lame[:, k].reshape(-1, *[1] * (strain.ndim - 2)) for k in (0, 1))
        trace = first * (strain[..., 0] + strain[..., 1])
        return np.stack(
            (trace + 2 * second * strain[..., 0], trace + 2 * second * strain[..., 1], 2 * second * strain[..., 2]),
            axis=-1,
        )

    @property
    def softest(self) -> Array:
        """Alpha with sigma(w) : eps(w) >= alpha |eps(w)|^2, stress, shape (n,)."""
        return 2 * np.minimum(self.lame[:, 1], self.lame.sum(axis=1))

    def strain_at_corners(self, y: Array, middle: Array) -> Array:
        """(xx, yy, xy) of a displacement of degree 2 at the corners of the triangles, shape (n, 3, 3).

        Args:
            y: at the vertices, length, shape (v, 2).
            middle: at the middles of the edges, shape (e, 2).
        """
        at, mid = y[self.corners], middle[self.of_triangle]
        # Shape functions l_i (2 l_i - 1) and 4 l_j l_k; their gradients at corner c.
        grad = np.zeros((len(at), 3, 2, 2))
        for c in range(3):
            for i in range(3):
                weight = 3.0 if i == c else -1.0
                grad[:, c] += weight * at[:, i, :, None] * self.gradients[:, i, None, :]
                j, k = (i + 1) % 3, (i + 2) % 3
                if c in (j, k):
                    partner = k if c == j else j
                    grad[:, c] += 4 * mid[:, i, :, None] * self.gradients[:, partner, None, :]
        return np.stack((grad[..., 0, 0], grad[..., 1, 1], (grad[..., 0, 1] + grad[..., 1, 0]) / 2), axis=-1)


def divide(t: Triangles, y: Array, middle: Array) -> tuple[Triangles, Array, Array, Ints]:
    """Each triangle in four by the middles of its edges, with a displacement of degree 2.

    Args:
        t: the triangles.
        y: at their vertices, length, shape (v, 2).
        middle: at the middles of their edges, length, shape (e, 2).

    Returns:
        Four times as many triangles, the first ones at the first corners; the displacement at their vertices, of which
        the first v are the given ones and the next e the middles; at the middles of their edges; and the halves of
        each given edge, that at its first end first, shape (e, 2).
    """
    first, count = len(t.x), len(t.x) + len(t.edges)
    c, m = t.corners, t.of_triangle + first
    corners = [np.column_stack([c[:, i] if j == i else m[:, 3 - i - j] for j in range(3)]) for i in range(3)]
    divided = Triangles(
        np.concatenate((t.x, t.x[t.edges].mean(axis=1))), np.concatenate((*corners, m)), np.tile(t.lame, (4, 1)), 4
    )
    keys = divided.edges @ [count, 1]
    between = np.zeros((len(divided.edges), 2))
    halves = np.stack([np.searchsorted(keys, t.edges[:, k] * count + first + np.arange(len(t.edges))) for k in (0, 1)])
    for k in (0, 1):
        between[halves[k]] = (3 * y[t.edges[:, k]] + 6 * middle - y[t.edges[:, 1 - k]]) / 8
    at, mid = y[c], middle[t.of_triangle]
    for i in range(3):  # between the middles of the edges opposite the next two corners
        j, k = (i + 1) % 3, (i + 2) % 3
        between[np.searchsorted(keys, np.sort(m[:, [j, k]], axis=1) @ [count, 1])] = (
            mid[:, i] / 4 + (mid[:, j] + mid[:, k]) / 2 - (at[:, j] + at[:, k]) / 8
        )
    return divided, np.concatenate((y, middle)), between, halves.T
