"""Symmetric stresses on triangles divided into three by their centroids, linear on the thirds, from linear tractions on
the edges and a force that is constant on the thirds (C. Johnson and B. Mercier, Numer. Math. 30 (1978) 103-116).
"""

from __future__ import annotations

import numpy as np

from signorini_fx.bounds.arrays import Array
from signorini_fx.bounds.triangles import Triangles

# The corners at both ends of the edge opposite a corner.
_ENDS = np.array([[1, 2], [2, 0], [0, 1]])


class LocalStress:
    """The triangles one by one: moments of tractions, integrals times the hat functions of both ends of their edges.

    Similar triangles have the same matrices, so that those of the first of the parts of each cell are enough.

    Attributes:
        places: of the moments of each triangle among those of all edges, edge and end, shape (n, 3, 2).
        compliance: moments per displacement of the ends of the edges, balanced, of the first triangle of each cell,
            force per length, shape (n / parts, 12, 12).
    """

    def __init__(self, t: Triangles) -> None:
        self._t = t
        corners = t.corners
        # Which end of the edge each corner is.
        ends = t.edges[t.of_triangle][:, :, :1] != corners[:, _ENDS]
        self.places = 2 * t.of_triangle[:, :, None] + ends
        self._operator, self._conditions = reference()
        # sigma = F s F^T / J^2; tractions times lengths are F (s n) / J, the divergence F (div s) / J^2.
        self._determinant, self._inverse = 2 * t.area, np.linalg.inv(t.jacobian)
        f = t.jacobian / self._determinant[:, None, None]
        xx, xy, yx, yy = f[:, 0, 0], f[:, 0, 1], f[:, 1, 0], f[:, 1, 1]
        rows = (
            (xx * xx, xy * xy, 2 * xx * xy),
            (yx * yx, yy * yy, 2 * yx * yy),
            (xx * yx, xy * yy, xx * yy + xy * yx),
        )
        self._turn = np.stack([np.stack(row, axis=1) for row in rows], axis=1)
        centre = t.x[corners].mean(axis=1)
        self._arm = (t.x[corners] - centre[:, None]) / np.sqrt(t.area)[:, None, None]
        self._size = n = len(corners) // t.parts
        # From moments to the tractions of the reference triangle.
        share = np.array([[4.0, -2.0], [-2.0, 4.0]])
        map_ = self._determinant[:n, None, None] * self._inverse[:n]
        data = np.zeros((n, 18, 12))
        for i in range(3):
            for end in (0, 1):
                for column_end in (0, 1):
                    rows_ = slice(4 * i + 2 * end, 4 * i + 2 * end + 2)
                    data[:, rows_, 4 * i + 2 * column_end : 4 * i + 2 * column_end + 2] = share[end, column_end] * map_
        stress = self._of((self._operator @ data).reshape(n, 9, 3, 12), n)
        self._weighted = self._conjugate(stress).reshape(n, 27, 12)
        energy = self._weighted.transpose(0, 2, 1) @ stress.reshape(n, 27, 12)
        balance = np.zeros((n, 3, 3, 2, 2))
        balance[:, 0, :, :, 0] = balance[:, 1, :, :, 1] = 1.0
        balance[:, 2, :, :, 0] = -self._arm[:n, _ENDS, 1]
        balance[:, 2, :, :, 1] = self._arm[:n, _ENDS, 0]
        balanced = balance.reshape(n, 3, 12)
        self._unit = np.trace(energy, axis1=1, axis2=2)[:, None, None] / 12
        matrix = np.zeros((n, 15, 15))
        matrix[:, :12, :12] = energy / self._unit
        matrix[:, 12:, :12], matrix[:, :12, 12:] = balanced, balanced.transpose(0, 2, 1)
        self._solution = np.linalg.inv(matrix)
        self.compliance = self._solution[:, :12, :12] / self._unit

    def alone(self, body: Array) -> Array:
        """Moments in balance with a body force where the ends of the edges do not move, force, shape (n, 12).

        Args:
            body: integrals of the force per volume times the barycentric coordinates, force, shape (n, 3, 2).
        """
        n, parts = self._size, self._t.parts
        if not body.any():
            return np.zeros((n * parts, 12))
        fixed = self._of((self._body_forces(body) @ self._operator[:, 12:].T).reshape(-1, 9, 3, 1), n * parts)
        arm = self._arm
        couple = (arm[..., 0] * body[..., 1] - arm[..., 1] * body[..., 0]).sum(axis=1)
        load = np.column_stack((body.sum(axis=1), couple)).reshape(parts, n, 3, 1)
        linear = self._weighted.transpose(0, 2, 1) @ fixed.reshape(parts, n, 27, 1)
        if parts == 4:  # the triangle between the three others is turned by half a turn
            linear[3] *= -1
            load[3, :, 2] *= -1
        moments = -self.compliance @ linear - self._solution[:, :12, 12:] @ load
        return np.asarray(moments.reshape(-1, 12))

    def stress(self, tractions: Array, body: Array) -> tuple[Array, Array]:
        """The stress, and the share of its data that it misses, by triangle.

        Args:
            tractions: at both ends of the edges of each triangle, out of it, stress, shape (n, 3, 2, 2).
            body: see ``alone``.

        Returns:
            (xx, yy, xy) on each third at its corners, shape (n, 3, 3, 3), and shape (n,).
        """
        t, n = self._t, len(self._arm)
        forces = tractions * t.length[t.of_triangle][:, :, None, None] * self._determinant[:, None, None, None]
        reference = forces.reshape(n, 6, 2) @ self._inverse.transpose(0, 2, 1)
        data = np.concatenate((reference.reshape(n, 12), self._body_forces(body)), axis=1)
        local = data @ self._operator.T
        missed = local @ self._conditions[:, :27].T - data @ self._conditions[:, 27:].T
        missed_share = np.abs(missed).max(axis=1) / np.abs(data).max(axis=1, initial=1e-300)
        stress = local.reshape(n, 9, 3) @ self._turn.transpose(0, 2, 1)
        return stress.reshape(n, 3, 3, 3), missed_share

    def _body_forces(self, body: Array) -> Array:
        """Minus the forces of the thirds on the reference triangle, shape (n, 6)."""
        value = constant_forces(self._t, body) * (self._determinant**2)[:, None, None]
        return np.asarray(-(value @ self._inverse.transpose(0, 2, 1)).reshape(-1, 6))

    def _of(self, reference: Array, count: int) -> Array:
        """Stresses of the first triangles, shape (n, 9, 3, k), from those of the reference triangle."""
        return np.asarray(self._turn[:count, None] @ reference)

    def _conjugate(self, stress: Array) -> Array:
        """The matrix of the integral of sigma : C^-1 tau over the triangle times stresses, shape (n, 9, 3, k)."""
        n, k = len(stress), stress.shape[-1]
        first, second = (self._t.lame[:n, i, None, None] for i in (0, 1))
        trace = first / (2 * (first + second)) * (stress[:, :, 0] + stress[:, :, 1])
        strain = np.stack((stress[:, :, 0] - trace, stress[:, :, 1] - trace, 2 * stress[:, :, 2]), axis=2)
        strain = strain.reshape(n, 3, 3, 3, k)
        weight = (self._t.area[:n, None, None] / (72 * second))[:, :, :, None, None]
        return np.asarray(weight * (strain + strain.sum(axis=2, keepdims=True)))


def reference() -> tuple[Array, Array]:
    """From tractions at both ends of the three edges and the divergences of the thirds to the stress of the reference
    triangle, shape (27, 18), and the conditions with their right-hand sides, shape (30, 27 + 18).

    The conditions determine the stress; they are compatible if the triangle is in equilibrium.
    """
    x = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    centre = x.mean(axis=0)
    thirds = [np.array([x[(i + 1) % 3], x[(i + 2) % 3], centre]) for i in range(3)]

    def traction(third: int, corner: int, normal: Array) -> Array:
        row = np.zeros((2, 3, 3, 3))
        row[0, third, corner, [0, 2]] = normal
        row[1, third, corner, [2, 1]] = normal
        return row.reshape(2, 27)

    rows, data = [], []
    for i in range(3):
        along = x[(i + 2) % 3] - x[(i + 1) % 3]
        normal = np.array([along[1], -along[0]])  # times the length of the edge
        for end in (0, 1):
            rows.append(traction(i, end, normal))
            side = np.zeros((2, 18))
            side[[0, 1], [4 * i + 2 * end, 4 * i + 2 * end + 1]] = 1.0
            data.append(side)
    for k in range(3):
        along = centre - x[k]
        normal = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        first_third, second_third = (
            (k + 1) % 3,
            (k + 2) % 3,
        )  # of these thirds the corner is the second and the first one
        for first, second in ((1, 0), (2, 2)):
            rows.append(traction(first_third, first, normal) - traction(second_third, second, normal))
            data.append(np.zeros((2, 18)))
    for i in range(3):
        g = np.linalg.inv(np.column_stack((thirds[i][1] - thirds[i][0], thirds[i][2] - thirds[i][0])))
        gradients = np.concatenate((-g.sum(axis=0, keepdims=True), g))
        row = np.zeros((2, 3, 3, 3))
        for corner in range(3):
            row[0, i, corner, [0, 2]] = gradients[corner]
            row[1, i, corner, [2, 1]] = gradients[corner]
        rows.append(row.reshape(2, 27))
        side = np.zeros((2, 18))
        side[[0, 1], [12 + 2 * i, 13 + 2 * i]] = 1.0
        data.append(side)
    conditions, right = np.concatenate(rows), np.concatenate(data)
    return np.linalg.pinv(conditions) @ right, np.column_stack((conditions, right))


def constant_forces(t: Triangles, body: Array) -> Array:
    """The force per volume, constant on thirds, with given integrals times barycentric coordinates, shape (n, 3, 2)."""
    share = (np.full((3, 3), 4.0) - 3 * np.eye(3)) / 27  # int of l_j over the third i, over the area
    return np.einsum("ij,njd->nid", np.linalg.inv(share), body) / t.area[:, None, None]
