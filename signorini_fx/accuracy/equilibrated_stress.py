"""A symmetric stress in equilibrium with given tractions, on triangles.

On each triangle, divided into three by its centroid, the stress is linear on each third and continuous in its normal
component (C. Johnson and B. Mercier, Numer. Math. 30 (1978) 103-116).  It is determined by linear tractions on the
edges of the triangle and a body force that is constant on the thirds.  The tractions come from the stress of the finite
element solution, the mean of both sides, plus what brings each triangle into equilibrium with all linear displacements,
rotations included: small independent problems around each vertex (P. Ladeveze and D. Leguillon, SIAM J. Numer. Anal. 20
(1983) 485-509).  So no constant of Korn's inequality enters.  Plain arrays, one rank.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order
from scipy.sparse.linalg import splu

from signorini_fx.accuracy.triangles import Array, Triangles, free_motions

# Pivots of motions that are free, relative.
_FREE = 1e-10
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Loads:
    """What acts on the triangles.

    Attributes:
        body: integrals of the force per volume times the barycentric coordinates, force, shape (n, 3, 2).
        traction: linear tractions at both ends of each edge of the boundary, zero elsewhere, stress, shape (e, 2, 2).
        held: projector onto the directions in which each edge is held, shape (e, 2, 2).
    """

    body: Array
    traction: Array
    held: Array


@dataclass(frozen=True)
class Equilibrated:
    """A stress in equilibrium.

    Attributes:
        stress: (xx, yy, xy) on each third of each triangle, opposite its corners, at the corners of the third: the two
            next ones of the triangle, and the centroid; shape (n, 3, 3, 3).
        tractions: at both ends of each edge out of its first triangle, stress, shape (e, 2, 2).
        missing: bound of the work of what is not in equilibrium by round-off per unit of the energy norm.
    """

    stress: Array
    tractions: Array
    missing: float


def equilibrate(t: Triangles, loads: Loads, prescribed: Array) -> Equilibrated:
    """The stress of least complementary energy among those of this kind in equilibrium with loads.

    The unknowns are displacements at both ends of each edge, the multipliers of equal and opposite tractions, from
    which each triangle has its own balanced tractions (hybridisation).  What the solution of the linear system misses
    is part of ``missing``: no digit of the result rests on it.

    Args:
        t: the triangles.
        loads: what acts on them; its resultant on free motions must vanish.
        prescribed: the displacement at both ends of held edges, as a linear function, length, shape (e, 2, 2).
    """
    local = _Local(t, loads.body)
    count = len(t.edges)
    size, dofs = 4 * count, local.dofs.reshape(len(t.corners), 12)
    rows, columns = np.repeat(dofs, 12, axis=1).ravel(), np.tile(dofs, (1, 12)).ravel()
    matrix = sp.csr_matrix((local.compliance.ravel(), (rows, columns)), shape=(size, size))
    a, b = loads.traction[:, 0], loads.traction[:, 1]
    right = (np.stack((2 * a + b, a + 2 * b), axis=1) * t.length[:, None, None] / 6).ravel()
    right -= np.bincount(dofs.ravel(), local.alone.ravel(), minlength=size)
    # Held directions as unknowns of their own.
    held = np.repeat(loads.held, 2, axis=0)
    values, vectors = np.linalg.eigh(held)
    aligned = np.abs(held[:, 0, 1]) <= _FREE
    vectors[aligned] = np.eye(2)
    fixed = np.where(aligned[:, None], np.einsum("nii->ni", held), values) > 0.5
    places, row = 2 * np.arange(2 * count)[:, None, None], np.array([[0, 0], [1, 1]])
    turn = sp.csr_matrix(
        (vectors.ravel(), ((places + row).ravel(), (places + row.T).ravel())),
        shape=(size, size),
    )
    free = np.flatnonzero(~fixed.ravel())
    start = np.where(fixed.ravel(), turn.T @ prescribed.ravel(), 0.0)
    lift = turn @ start
    basis = turn[:, free]
    system = (basis.T @ matrix @ basis).tocsc()
    modes = basis.T @ free_motions(t, loads.held).reshape(len(t.x), 2, -1)[t.edges.ravel()].reshape(size, -1)
    system = _tied(system, modes)
    found = splu(system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).solve(
        basis.T @ (right - matrix @ lift)
    )
    displacement = lift + basis @ found
    own = local.alone + np.einsum("nij,nj->ni", local.compliance, displacement[dofs])
    return local.stress(loads, own.reshape(-1, 3, 2, 2))


def _tied(matrix: sp.csc_matrix, modes: Array) -> sp.csc_matrix:
    """The matrix with as many unknowns tied as there are free motions; without a force if loads are in balance."""
    rows, pins = modes.copy(), []
    for _ in range(modes.shape[1]):
        pins.append(int(np.argmax(np.linalg.norm(rows, axis=1))))
        unit = rows[pins[-1]] / np.linalg.norm(rows[pins[-1]])
        rows -= np.outer(rows @ unit, unit)
    stiff = np.full(len(pins), matrix.diagonal().max())
    return (matrix + sp.csc_matrix((stiff, (pins, pins)), shape=matrix.shape)).tocsc()


class _Local:
    """The triangles one by one: moments of tractions, integrals times the hat functions of both ends of their edges.

    Attributes:
        dofs: places of the moments of each triangle among those of all edges, shape (n, 3, 2, 2).
        compliance: moments per displacement of the ends of the edges, balanced, shape (n, 12, 12).
        alone: moments in balance with the body force where these displacements vanish, force, shape (n, 12).
    """

    def __init__(self, t: Triangles, body: Array) -> None:
        self._t, self._body = t, body
        n, corners = len(t.corners), t.corners
        operator, self._conditions = _reference()
        ends = np.array([[(i + 1) % 3, (i + 2) % 3] for i in range(3)])
        # Which end of the edge each corner is.
        self._end = np.stack(
            [
                np.stack([np.where(t.edges[t.of_triangle[:, i], 0] == corners[:, c], 0, 1) for c in ends[i]], axis=1)
                for i in range(3)
            ],
            axis=1,
        )
        self.dofs = 4 * t.of_triangle[:, :, None, None] + 2 * self._end[:, :, :, None] + np.arange(2)
        # From moments to reference tractions: sigma = F s F^T / J^2; tractions times lengths are F (s n) / J, the
        # divergence F (div s) / J^2.
        inverse, determinant = np.linalg.inv(t.jacobian), 2 * t.area
        share = np.array([[4.0, -2.0], [-2.0, 4.0]])
        self._data = np.zeros((n, 18, 12))
        for i in range(3):
            for end in (0, 1):
                for other in (0, 1):
                    rows = slice(4 * i + 2 * end, 4 * i + 2 * end + 2)
                    self._data[:, rows, 4 * i + 2 * other : 4 * i + 2 * other + 2] = (
                        share[end, other] * determinant[:, None, None] * inverse
                    )
        force = constant_forces(t, body)
        self._given = np.zeros((n, 18))
        for i in range(3):
            value = -force[:, i] * (determinant**2)[:, None]
            self._given[:, 12 + 2 * i : 14 + 2 * i] = np.einsum("nij,nj->ni", inverse, value)
        self._operator = operator
        # Stress at the corners of the thirds, (n, 27, ...), from the reference stress by a matrix of each triangle.
        f = t.jacobian / determinant[:, None, None]
        xx, xy, yx, yy = f[:, 0, 0], f[:, 0, 1], f[:, 1, 0], f[:, 1, 1]
        self._turn = np.stack(
            [
                np.stack((xx * xx, xy * xy, 2 * xx * xy), axis=1),
                np.stack((yx * yx, yy * yy, 2 * yx * yy), axis=1),
                np.stack((xx * yx, xy * yy, xx * yy + xy * yx), axis=1),
            ],
            axis=1,
        )
        stress = self._of(np.einsum("ij,njk->nik", operator, self._data))
        fixed = self._of((self._given @ operator.T)[:, :, None])
        weighted = self._weighted(stress)
        energy = np.einsum("nik,nil->nkl", weighted, stress)
        linear = np.einsum("nik,nil->nk", weighted, fixed)
        # Balance of each triangle about its centroid, in units of its size.
        centre = t.x[corners].mean(axis=1)
        arm = (t.x[corners] - centre[:, None]) / np.sqrt(t.area)[:, None, None]
        balance = np.zeros((n, 3, 3, 2, 2))
        balance[:, 0, :, :, 0] = balance[:, 1, :, :, 1] = 1.0
        for i in range(3):
            for end in (0, 1):
                balance[:, 2, i, end, 0] = -arm[:, ends[i, end], 1]
                balance[:, 2, i, end, 1] = arm[:, ends[i, end], 0]
        load = np.stack(
            (
                body[..., 0].sum(axis=1),
                body[..., 1].sum(axis=1),
                (arm[..., 0] * body[..., 1] - arm[..., 1] * body[..., 0]).sum(axis=1),
            ),
            axis=1,
        )
        balanced = balance.reshape(n, 3, 12)
        unit = np.einsum("nii->n", energy) / 12
        whole = np.zeros((n, 15, 15))
        whole[:, :12, :12] = energy / unit[:, None, None]
        whole[:, 12:, :12], whole[:, :12, 12:] = balanced, balanced.transpose(0, 2, 1)
        solution = np.linalg.inv(whole)
        self.compliance = solution[:, :12, :12] / unit[:, None, None]
        self.alone = -np.einsum("nij,nj->ni", self.compliance, linear) - np.einsum(
            "nij,nj->ni", solution[:, :12, 12:], load
        )

    def _of(self, reference: Array) -> Array:
        """Stresses, shape (n, 27, k), from those of the reference triangle."""
        n, _, k = reference.shape
        found: Array = np.einsum("nij,najk->naik", self._turn, reference.reshape(n, 9, 3, k)).reshape(n, 27, k)
        return found

    def _weighted(self, stress: Array) -> Array:
        """The matrix of the integral of sigma : C^-1 tau over the triangle times stresses, shape (n, 27, k)."""
        n, _, k = stress.shape
        first, second = self._t.lame.T
        s = stress.reshape(n, 3, 3, 3, k)
        trace = (first / (2 * (first + second)))[:, None, None, None] * (s[:, :, :, 0] + s[:, :, :, 1])
        strain = np.stack((s[:, :, :, 0] - trace, s[:, :, :, 1] - trace, 2 * s[:, :, :, 2]), axis=3)
        strain /= (2 * second)[:, None, None, None, None]
        mass = (self._t.area / 36)[:, None, None, None, None] * (strain + strain.sum(axis=2, keepdims=True))
        return np.asarray(mass.reshape(n, 27, k))

    def stress(self, loads: Loads, moments: Array) -> Equilibrated:
        """The stress of the means of the moments of both sides, where tractions are given of these.

        Args:
            loads: what acts.
            moments: of each triangle, out of it, force, shape (n, 3, 2, 2).
        """
        t = self._t
        place, sign = (
            self.dofs[..., 0] // 2,
            np.where(t.sides[t.of_triangle, 0] == np.arange(len(t.corners))[:, None], 1.0, -1.0),
        )
        summed = np.zeros((2 * len(t.edges), 2))
        np.add.at(summed, place.ravel(), (sign[:, :, None, None] * moments).reshape(-1, 2))
        total = summed.reshape(-1, 2, 2) / (t.sides >= 0).sum(axis=1)[:, None, None]
        per_length = total / t.length[:, None, None]
        tractions = np.stack(
            (4 * per_length[:, 0] - 2 * per_length[:, 1], 4 * per_length[:, 1] - 2 * per_length[:, 0]), axis=1
        )
        out = np.where(t.sides[:, :1, None] < 0, -1.0, 1.0)
        free = np.eye(2) - loads.held
        given = np.einsum("eij,eaj->eai", free, loads.traction) + np.einsum("eij,eaj->eai", loads.held, tractions * out)
        tractions[t.outer] = (given * out)[t.outer]
        a, b = tractions[:, 0], tractions[:, 1]
        total = np.stack((2 * a + b, a + 2 * b), axis=1) * t.length[:, None, None] / 6
        own = (sign[:, :, None, None] * total.reshape(-1, 2)[place]).reshape(-1, 12)
        data = np.einsum("nij,nj->ni", self._data, own) + self._given
        local = data @ self._operator.T
        missed = local @ self._conditions[:, :27].T - data @ self._conditions[:, 27:].T
        rest = np.abs(missed).max(axis=1) / np.abs(data).max(axis=1, initial=1e-300)
        stress = self._of(local[:, :, None]).reshape(-1, 3, 3, 3)
        return Equilibrated(stress, tractions, _round_off(t, loads, tractions, rest))


def _reference() -> tuple[Array, Array]:
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
        one, other = (k + 1) % 3, (k + 2) % 3  # of these thirds the corner is the second and the first one
        for first, second in ((1, 0), (2, 2)):
            rows.append(traction(one, first, normal) - traction(other, second, normal))
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


def _round_off(t: Triangles, loads: Loads, tractions: Array, rest: Array) -> float:
    """Bound of the work of what is not in equilibrium, per unit of the energy norm.

    The forces and couples that a triangle misses are carried from triangle to triangle to a held edge, or to the last
    triangle of a body without one, by tractions that are as large as their sum; the stress of each that balances these
    is bounded by the norm of the map from tractions to stresses.
    """
    count = len(t.corners)
    force = np.abs(tractions).max(axis=(1, 2)) * t.length
    own = force[t.of_triangle].max(axis=1) + np.abs(loads.body).sum(axis=(1, 2))
    missed = own * (rest + 32 * _EPS)
    inner = np.flatnonzero((t.sides >= 0).all(axis=1))
    graph = sp.csr_matrix((np.ones(inner.size), tuple(t.sides[inner].T)), shape=(count, count))
    todo = np.ones(count, dtype=bool)
    held = t.outer[np.einsum("eii->e", loads.held)[t.outer] > 0]
    start = t.sides[held].max(axis=1) if held.size else np.array([0])
    # One more node joins all triangles that are held.
    root = sp.csr_matrix((np.ones(start.size), (np.full(start.size, 0), start)), shape=(1, count))
    whole = sp.bmat([[graph, None], [root, sp.csr_matrix((1, 1))]], format="csr")
    order, before = breadth_first_order(whole, count, directed=False)
    total = np.append(missed, 0.0)
    for one in order[:0:-1]:
        total[before[one]] += total[one]
    todo[order[order < count]] = False
    if todo.any():  # several pieces: each is summed up as if it were a path
        total[:count][todo] = missed[todo].sum()
    shape = np.linalg.norm(t.jacobian, axis=(1, 2)) ** 2 / (2 * t.area)
    size = float(np.linalg.norm(_reference()[0], 2))
    return float(np.sqrt((((size * shape**2 * total[:count]) ** 2) / t.softest).sum()))
