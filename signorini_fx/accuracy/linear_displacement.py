"""Displacements that are linear on triangles and have the smallest energy among those with given components."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from signorini_fx.accuracy.triangles import Array, Ints, Triangles
from signorini_fx.linalg.definite import Factor

# Components along directions that are closer are one and the same; given ones may differ by as much.
_SAME = 1e-9


@dataclass(frozen=True)
class Given:
    """Components of displacements at vertices, r of them.

    Attributes:
        vertex: where, shape (r,).
        direction: unit vectors, shape (r, 2).
        value: of the components, length, shape (r,).
    """

    vertex: Ints
    direction: Array
    value: Array

    def fixes(self, t: Triangles) -> bool:
        """Whether they leave no rigid motion free."""
        arm = (t.x - t.x.mean(axis=0))[self.vertex] / np.ptp(t.x, axis=0).max()
        turn = arm[:, 0] * self.direction[:, 1] - arm[:, 1] * self.direction[:, 0]
        modes = np.column_stack((self.direction, turn))
        return float(np.linalg.eigvalsh(modes.T @ modes)[0]) > _SAME * len(modes)

    @staticmethod
    def joined(*parts: Given) -> Given:
        """All of them."""
        return Given(
            np.concatenate([one.vertex for one in parts]),
            np.concatenate([one.direction for one in parts]),
            np.concatenate([one.value for one in parts]),
        )

    @staticmethod
    def of_edges(t: Triangles, projectors: Array, value: Array) -> Given:
        """Those of a vector in directions that edges hold.

        Args:
            t: the triangles.
            projectors: onto these directions, shape (e, 2, 2).
            value: of the displacement, length, shape (2,) or (e, 2).
        """
        edges = np.flatnonzero(projectors.any(axis=(1, 2)))
        sizes, vectors = np.linalg.eigh(projectors[edges])
        found = []
        for k in (0, 1):
            kept = sizes[:, k] > 0.5
            for end in (0, 1):
                direction = vectors[kept, :, k]
                there = np.broadcast_to(value, (len(t.edges), 2))[edges[kept]]
                found.append(Given(t.edges[edges[kept], end], direction, (direction * there).sum(axis=1)))
        return Given.joined(*found)


def smallest_energy(t: Triangles, given: Given, load: Array | None = None) -> tuple[Array, float]:
    """The displacement of least energy, loads included, with given components.

    Args:
        t: the triangles.
        given: the components; they leave no rigid motion free.
        load: forces at vertices, shape (v, 2); None: there are none.

    Returns:
        The displacement at the vertices, length, shape (v, 2), and how far it is from what is given at most, length.
    """
    count = len(t.x)
    weight, value = np.zeros((count, 2, 2)), np.zeros((count, 2))
    np.add.at(weight, given.vertex, given.direction[:, :, None] * given.direction[:, None])
    np.add.at(value, given.vertex, given.direction * given.value[:, None])
    turn, fixed, start = np.tile(np.eye(2), (count, 1, 1)), np.zeros((count, 2), dtype=bool), np.zeros((count, 2))
    some = np.unique(given.vertex)
    sizes, vectors = np.linalg.eigh(weight[some])
    turn[some], fixed[some] = vectors, sizes > _SAME
    along = np.einsum("nik,ni->nk", vectors, value[some])
    start[some] = np.einsum(
        "nik,nk->ni", vectors, np.where(fixed[some], along / np.where(fixed[some], sizes, 1.0), 0.0)
    )
    missed = np.abs((start[given.vertex] * given.direction).sum(axis=1) - given.value).max(initial=0.0)
    matrix = stiffness(t)
    force = (np.zeros((count, 2)) if load is None else load) - (matrix @ start.ravel()).reshape(-1, 2)
    numbers = (2 * np.arange(count)[:, None, None] + [[[0], [1]]]).repeat(2, axis=2)
    basis = sp.csr_matrix((turn.ravel(), (numbers.ravel(), numbers.transpose(0, 2, 1).ravel())), shape=matrix.shape)
    basis = basis[:, np.flatnonzero(~fixed.ravel())]
    if not basis.shape[1]:
        return start, float(missed)
    upper = sp.triu(basis.T @ matrix @ basis, format="csr")
    upper.sort_indices()
    found = basis @ Factor(upper).solve(basis.T @ force.ravel())
    return start + found.reshape(-1, 2), float(missed)


def stiffness(t: Triangles) -> sp.csr_matrix:
    """Of displacements linear on triangles, force per length, shape (2 v, 2 v)."""
    strain = np.zeros((len(t.corners), 6, 3))
    for i in range(3):
        gx, gy = t.gradients[:, i].T
        strain[:, 2 * i, 0], strain[:, 2 * i, 2] = gx, gy / 2
        strain[:, 2 * i + 1, 1], strain[:, 2 * i + 1, 2] = gy, gx / 2
    local = t.area[:, None, None] * t.stress(strain) @ (strain * [1.0, 1.0, 2.0]).transpose(0, 2, 1)
    dofs = (2 * t.corners[:, :, None] + [0, 1]).reshape(-1, 6)
    rows, columns = np.repeat(dofs, 6, axis=1).ravel(), np.tile(dofs, (1, 6)).ravel()
    return sp.csr_matrix((local.ravel(), (rows, columns)), shape=(2 * len(t.x), 2 * len(t.x)))
