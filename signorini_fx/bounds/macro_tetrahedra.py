"""Symmetric stresses on tetrahedra divided into four by their centroids, linear on the quarters, from linear tractions
on the faces and a constant force.

It is the element of Johnson and Mercier in space (M. Krizek, Apl. Mat. 27 (1982) 46-69; J. Gopalakrishnan, J. Guzman,
J. J. Lee, The Johnson-Mercier elasticity element in any dimensions, 2024): 96 numbers with 54 conditions between the
quarters leave 42, which tractions (36) and forces on the quarters (12, of which 6 follow from balance) determine.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from signorini_fx.bounds.arrays import Array, Ints
from signorini_fx.bounds.tetrahedra import COLUMNS, FACES, ROWS, TWICE, Tetrahedra

# Tetrahedra whose matrices are made at the same time.
_CHUNK = 1000
# Linear tractions at the vertices of a face of area 1 from their moments.
_FROM_MOMENTS: Array = 12 * np.eye(3) - 3


class MacroStress:
    """The tetrahedra one by one: moments of tractions, integrals times the hat functions of the vertices of faces.

    Attributes:
        places: of the moments of each tetrahedron among those of all faces, face and vertex, shape (n, 4, 3).
        compliance: moments per displacement of the vertices of the faces, balanced, force per length, shape
            (n, 36, 36).
        alone: moments in balance with the body force where the faces do not move, force, shape (n, 36).
        energy: traces of the squares of the norm per square of the moments, shape (n,).
    """

    def __init__(self, t: Tetrahedra, body: Array) -> None:
        """Make the matrices.

        Args:
            t: the tetrahedra.
            body: force per volume in each tetrahedron, shape (n, 3).
        """
        self._t, self._body = t, body
        self.places: Ints = 3 * t.of_tetrahedron[:, :, None] + np.argsort(
            np.argsort(t.corners[:, FACES], axis=2), axis=2
        )
        self._determinant, self._inverse = 6 * t.volume, np.linalg.inv(t.jacobian)
        f = t.jacobian / self._determinant[:, None, None]
        # sigma = F s F^T / J^2; tractions times areas are F (s n) / J, the divergence F (div s) / J^2.
        once = f[:, ROWS][:, :, ROWS] * f[:, COLUMNS][:, :, COLUMNS]
        self._turn = once + np.where(ROWS == COLUMNS, 0.0, f[:, ROWS][:, :, COLUMNS] * f[:, COLUMNS][:, :, ROWS])
        n = len(t.corners)
        self.compliance: Array = np.zeros((n, 36, 36))
        self.alone: Array = np.zeros((n, 36))
        self.energy: Array = np.zeros(n)
        for first in range(0, n, _CHUNK):
            self._invert(slice(first, first + _CHUNK))

    def _invert(self, chunk: slice) -> None:
        """Compliance of some tetrahedra: least energy with balanced moments."""
        t, operator = self._t, reference()[0]
        map_ = 2 * self._determinant[chunk, None, None] * self._inverse[chunk]
        n = len(map_)
        data = np.zeros((n, 48, 36))
        for i in range(4):
            for a in range(3):
                for b in range(3):
                    rows, columns = 3 * (3 * i + a), 3 * (3 * i + b)
                    data[:, rows : rows + 3, columns : columns + 3] = _FROM_MOMENTS[a, b] * map_
        stress = self._turn[chunk, None] @ (operator @ data).reshape(n, 16, 6, 36)
        fixed = self._turn[chunk, None] @ (self._forces(chunk) @ operator[:, 36:].T).reshape(n, 16, 6, 1)
        weighted = self._conjugate(stress, chunk).reshape(n, 96, 36).transpose(0, 2, 1)
        energy = weighted @ stress.reshape(n, 96, 36)
        coupling = weighted @ fixed.reshape(n, 96, 1)
        centre = t.x[t.corners[chunk]].mean(axis=1)
        size = np.cbrt(t.volume[chunk])
        arm = ((t.x[t.corners[chunk]] - centre[:, None]) / size[:, None, None])[:, FACES].reshape(n, 12, 3)
        balance = np.zeros((n, 6, 12, 3))
        for k in range(3):
            balance[:, k, :, k] = 1.0
            balance[:, 3 + k] = np.cross(np.eye(3)[k], arm)
        balanced = balance.reshape(n, 6, 36)
        self.energy[chunk] = np.trace(energy, axis1=1, axis2=2)
        unit = self.energy[chunk, None, None] / 36
        matrix = np.zeros((n, 42, 42))
        matrix[:, :36, :36] = energy / unit
        matrix[:, 36:, :36], matrix[:, :36, 36:] = balanced, balanced.transpose(0, 2, 1)
        solution = np.linalg.inv(matrix)
        self.compliance[chunk] = solution[:, :36, :36] / unit
        right = np.zeros((n, 42, 1))
        right[:, :36] = -coupling / unit
        right[:, 36:39, 0] = -self._body[chunk] * t.volume[chunk, None]  # its couple about the centroid is zero
        self.alone[chunk] = (solution[:, :36] @ right)[:, :, 0]

    def _forces(self, chunk: slice) -> Array:
        """Minus the forces of the quarters of the reference tetrahedron, shape (n, 12)."""
        value = (self._inverse[chunk] @ self._body[chunk, :, None])[:, :, 0] * self._determinant[chunk, None] ** 2
        return -np.tile(value, (1, 4))

    def _conjugate(self, stress: Array, chunk: slice) -> Array:
        """The matrix of the integral of sigma : C^-1 tau times stresses, shape (n, 16, 6, k)."""
        first, second = (self._t.lame[chunk, i, None, None] for i in (0, 1))
        strain = stress.copy()
        strain[:, :, :3] -= (first / (3 * first + 2 * second) * stress[:, :, :3].sum(axis=2))[:, :, None]
        strain *= TWICE[:, None]
        strain = strain.reshape(len(stress), 4, 4, 6, -1)
        weight = (self._t.volume[chunk, None, None] / (160 * second))[:, :, :, None, None]
        return np.asarray(weight * (strain + strain.sum(axis=2, keepdims=True))).reshape(stress.shape)

    def stress(self, tractions: Array) -> tuple[Array, Array]:
        """The stress, and the share of its data that it misses, by tetrahedron.

        Args:
            tractions: at the vertices of the faces of each tetrahedron, out of it, stress, shape (n, 4, 3, 3).

        Returns:
            On each quarter, opposite its corner, at the corners of the quarter: those of the face, and the centroid;
            shape (n, 4, 4, 6); and shape (n,).
        """
        t, n = self._t, len(tractions)
        operator, conditions = reference()
        forces = 2 * tractions * t.area[t.of_tetrahedron][:, :, None, None] * self._determinant[:, None, None, None]
        moments = (forces.reshape(n, 12, 3) @ self._inverse.transpose(0, 2, 1)).reshape(n, 36)
        data = np.concatenate((moments, self._forces(slice(None))), axis=1)
        local = data @ operator.T
        missed = local @ conditions[:, :96].T - data @ conditions[:, 96:].T
        missed_share = np.abs(missed).max(axis=1) / np.abs(data).max(axis=1, initial=1e-300)
        stress = local.reshape(n, 16, 6) @ self._turn.transpose(0, 2, 1)
        return stress.reshape(n, 4, 4, 6), missed_share


@cache
def reference() -> tuple[Array, Array]:
    """From tractions at the vertices of the four faces and the divergences of the quarters to the stress of the
    reference tetrahedron, shape (96, 48), and the conditions with their right-hand sides, shape (102, 96 + 48).

    The conditions determine the stress; they are compatible if the tetrahedron is in equilibrium.
    """
    x = np.concatenate((np.zeros((1, 3)), np.eye(3)))
    centre = x.mean(axis=0)

    def traction(quarter: int, corner: int, normal: Array) -> Array:
        row = np.zeros((3, 4, 4, 6))
        for k, (i, j) in enumerate(zip(ROWS, COLUMNS, strict=True)):
            row[i, quarter, corner, k] += normal[j]
            if i != j:
                row[j, quarter, corner, k] += normal[i]
        return row.reshape(3, 96)

    rows, data = [], []
    for i in range(4):
        p = x[FACES[i]]
        normal = np.cross(p[1] - p[0], p[2] - p[0])  # times twice the area of the face
        normal *= -np.sign(normal @ (x[i] - p[0]))
        for a in range(3):
            rows.append(traction(i, a, normal))
            side = np.zeros((3, 48))
            side[:, 3 * (3 * i + a) : 3 * (3 * i + a) + 3] = np.eye(3)
            data.append(side)
    for i in range(4):
        for j in range(i + 1, 4):
            shared = [k for k in range(4) if k not in (i, j)]
            normal = np.cross(x[shared[0]] - centre, x[shared[1]] - centre)
            normal /= np.linalg.norm(normal)
            places = [(list(FACES[i]).index(k), list(FACES[j]).index(k)) for k in shared]
            for first_corner, second_corner in (*places, (3, 3)):
                rows.append(traction(i, first_corner, normal) - traction(j, second_corner, normal))
                data.append(np.zeros((3, 48)))
    for i in range(4):
        p = np.concatenate((x[FACES[i]], centre[None]))
        g = np.linalg.inv((p[1:] - p[0]).T)
        gradients = np.concatenate((-g.sum(axis=0, keepdims=True), g))
        rows.append(np.sum([traction(i, corner, gradients[corner]) for corner in range(4)], axis=0))
        side = np.zeros((3, 48))
        side[:, 36 + 3 * i : 39 + 3 * i] = np.eye(3)
        data.append(side)
    conditions, right = np.concatenate(rows), np.concatenate(data)
    return np.linalg.pinv(conditions) @ right, np.column_stack((conditions, right))
