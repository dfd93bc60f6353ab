"""Torsion of a cylinder that rubs on its base, as a scalar problem in (r, z): NumPy and SciPy
alone.

It shares no line with the package.  Torsion of a body of revolution is u_theta = v(r, z) alone,
with the energy

    G/2 int ((r d(v/r)/dr)^2 + (dv/dz)^2) 2 pi r dr dz

and on the base a shear of at most the bound q that acts against v.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky
from scipy.optimize import lsq_linear


class Torsion(NamedTuple):
    """What the base does.

    Attributes:
        torque: M, force times length, positive along the turn.
        stick: radius within which the base does not slip, length; between nodes, by the area of
        those that stick.
        r, shear: radii of the nodes on the base but the axis, length, and the shear there, stress.
    """

    torque: float
    stick: float
    r: np.ndarray
    shear: np.ndarray


def torsion(shear_modulus, height, bound, turned, nr=60, nz=40):
    """A cylinder of radius 1, its top turned by ``turned``; its base rubs with at most ``bound``;
    bilinear elements.
    """
    r, areas, root, per_turn = _condensed(shear_modulus, height, nr, nz)
    load = per_turn * turned
    most = bound * areas[1:]
    # min over |m| <= most of (load - m) S^-1 (load - m) / 2; v = S^-1 (load - m).
    friction = lsq_linear(root, root @ load, (-most, most), method="bvls", tol=1e-13).x
    sticking = areas[0] + areas[1:][np.abs(friction) < (1 - 1e-9) * most].sum()
    return Torsion(
        float(friction @ r[1:]), float(np.sqrt(sticking / np.pi)), r[1:], friction / areas[1:]
    )


@cache
def _condensed(shear_modulus, height, nr, nz):
    """Radii of the base and their areas, L^-1 of its stiffness S = L L^T, and the load on it by a
    turn of 1.
    """
    r, z = np.linspace(0.0, 1.0, nr + 1), height * np.linspace(0.0, 1.0, nz + 1) ** 1.5
    number = np.arange((nr + 1) * (nz + 1)).reshape(nz + 1, nr + 1)
    matrix = np.zeros((number.size, number.size))
    corners = np.stack(
        (number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]), axis=-1
    ).reshape(-1, 4)
    size = np.array([(dr, dz) for dz in np.diff(z) for dr in np.diff(r)])
    gauss, weights = np.polynomial.legendre.leggauss(3)
    for s, ws in zip((gauss + 1) / 2, weights / 2, strict=True):
        for t, wt in zip((gauss + 1) / 2, weights / 2, strict=True):
            at = np.tile(r[:-1] + s * np.diff(r), nz)
            shape = np.array([(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t])
            along = np.array([-(1 - t), 1 - t, -t, t]) / size[:, :1] - shape / at[:, None]
            up = np.array([-(1 - s), -s, 1 - s, s]) / size[:, 1:]
            share = 2 * np.pi * at * shear_modulus * size.prod(axis=1) * ws * wt
            cells = np.einsum("c,ci,cj->cij", share, along, along) + np.einsum(
                "c,ci,cj->cij", share, up, up
            )
            np.add.at(matrix, (corners[:, :, None], corners[:, None, :]), cells)
    base, top, axis = number[0, 1:], number[-1], number[:, 0]
    inner = np.setdiff1d(number.ravel(), np.concatenate((base, top, axis)))
    given = np.zeros(number.size)
    given[top] = r
    factor = cho_factor(matrix[np.ix_(inner, inner)])
    coupling = matrix[np.ix_(inner, base)]
    stiffness = matrix[np.ix_(base, base)] - coupling.T @ cho_solve(factor, coupling)
    load = -matrix[np.ix_(base, top)] @ given[top]
    load += coupling.T @ cho_solve(factor, matrix[np.ix_(inner, top)] @ given[top])
    # Areas by the integrals of the linear functions.
    areas = np.zeros(nr + 1)
    for j in range(nr):
        a, b = r[j], r[j + 1]
        areas[j] += 2 * np.pi * (b - a) * (2 * a + b) / 6
        areas[j + 1] += 2 * np.pi * (b - a) * (a + 2 * b) / 6
    return r, areas, np.linalg.inv(cholesky(stiffness, lower=True)), load
