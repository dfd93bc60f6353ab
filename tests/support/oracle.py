"""Example 1 of the paper once more, in NumPy and SciPy alone: an independent program to hold the
package against.

Written from sections 4, 6.3 and 7 of the paper; it shares no line with the package.  The grid is
uniform: node (i, j) has number n = i + (nx + 1) j and dofs 2 n, 2 n + 1.  The interior is
eliminated once, so that every step is a small dense solve.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import solve
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

LENGTH, HEIGHT, YOUNG = 3.0, 1.0, 5000.0


def gap(x):
    """d of section 7.1."""
    return 0.003 * (x - 1.5) ** 2 + 0.001


def cells_of(nx, ny, cell):
    """Node numbers of the cells, counterclockwise."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(nx), np.arange(ny)))
    a = i + (nx + 1) * j
    b, c, d = a + 1, a + nx + 2, a + nx + 1
    if cell == "quadrilateral":
        return np.column_stack((a, b, c, d))
    return np.vstack((np.column_stack((a, b, c)), np.column_stack((a, c, d))))


def gradients(corners):
    """(weight, gradients of the shape functions (nodes, 2)) at the quadrature points of one
    cell.
    """
    if len(corners) == 3:
        reference = [(0.5, np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]))]
    else:
        points = np.array([-1.0, 1.0]) / np.sqrt(3)
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        reference = [
            (
                1.0,
                np.column_stack(
                    (signs[:, 0] * (1 + signs[:, 1] * t), signs[:, 1] * (1 + signs[:, 0] * s))
                )
                / 4,
            )
            for s in points
            for t in points
        ]
    for weight, derivatives in reference:
        jacobian = derivatives.T @ corners
        yield weight * np.linalg.det(jacobian), np.linalg.solve(jacobian, derivatives.T).T


def cell_stiffness(corners, poisson):
    """a(., .) of section 2.1 on one cell, in Voigt notation, plane strain."""
    lame = YOUNG * poisson / ((1 + poisson) * (1 - 2 * poisson))
    mu = YOUNG / (2 * (1 + poisson))
    law = np.array([[lame + 2 * mu, lame, 0], [lame, lame + 2 * mu, 0], [0, 0, mu]])
    total = 0.0
    for weight, gradient in gradients(corners):
        strain = np.zeros((3, 2 * len(corners)))
        strain[0, 0::2] = strain[2, 1::2] = gradient[:, 0]
        strain[1, 1::2] = strain[2, 0::2] = gradient[:, 1]
        total = total + weight * strain.T @ law @ strain
    return total


@dataclass(frozen=True)
class Block:
    """The elastic block of section 7.1 seen from its contact nodes.

    With c the contact dofs: schur u_c = load_c - contact forces, and u elsewhere is ``rest - lift
    u_c``.
    """

    x: np.ndarray
    weight: np.ndarray
    stiffness: object
    contact: np.ndarray
    free: np.ndarray
    schur: np.ndarray
    load: np.ndarray
    rest: np.ndarray
    lift: np.ndarray

    def displacement(self, contact):
        """All dofs, shape (nodes, 2), from those of the contact nodes."""
        u = np.zeros(self.stiffness.shape[0])
        u[self.contact] = contact
        u[self.free] = self.rest - self.lift @ contact
        return u.reshape(-1, 2)


@lru_cache
def block(nx, ny, poisson, cell="quadrilateral"):
    """Assemble and condense: u_x = 0 on both sides, traction (0, -20) on [1, 2] of the top (nodes
    at 1 and 2).
    """
    nodes = np.arange((nx + 1) * (ny + 1))
    x = np.column_stack((nodes % (nx + 1) * LENGTH / nx, nodes // (nx + 1) * HEIGHT / ny))
    cells = cells_of(nx, ny, cell)
    kinds = [cell_stiffness(x[c], poisson) for c in (cells[0], cells[-1])]
    blocks = np.array([kinds[2 * k >= len(cells)] for k in range(len(cells))])
    dofs = (2 * cells[:, :, None] + np.arange(2)).reshape(len(cells), -1)
    rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    size = 2 * len(nodes)
    stiffness = coo_array(
        (blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)
    ).tocsc()
    load = np.zeros((len(nodes), 2))
    h = LENGTH / nx
    for left in nodes[-nx - 1 : -1]:
        if 1 < x[left, 0] + h / 2 < 2:
            load[[left, left + 1], 1] -= 20 * h / 2
    load = load.ravel()
    side = (nodes % (nx + 1) == 0) | (nodes % (nx + 1) == nx)
    fixed = np.zeros((len(nodes), 2), dtype=bool)
    fixed[side, 0] = True
    at_contact = np.zeros_like(fixed)
    at_contact[: nx + 1] = True
    contact = np.flatnonzero(at_contact)
    free = np.flatnonzero(~fixed & ~at_contact)
    interior = splu(stiffness[free][:, free])
    coupling = stiffness[free][:, contact].toarray()
    lift, rest = interior.solve(coupling), interior.solve(load[free])
    schur = stiffness[contact][:, contact].toarray() - coupling.T @ lift
    weight = np.full(nx + 1, h)
    weight[[0, -1]] /= 2
    reduced = load[contact] - coupling.T @ rest
    return Block(x[: nx + 1, 0], weight, stiffness, contact, free, schur, reduced, rest, lift)


@dataclass
class Result:
    """What a run ends with: displacement of all nodes, lambda, mu and the sets at the contact
    nodes, linear solves.
    """

    u: np.ndarray
    pressure: np.ndarray
    shear: np.ndarray
    in_contact: np.ndarray
    slip: np.ndarray
    solves: int
    energy: float
    outer: int = 1


def linear_step(body, bound, gamma, in_contact, slip):
    """Step 4 of Algorithm (SSN): tau_N y = -u_2, tau_T y = u_1 on the bottom; returns (u_c, tau_N
    y, tau_T y).
    """
    gamma_n, gamma_t = gamma
    matrix, load = body.schur.copy(), body.load.copy()
    first, second = np.arange(0, len(load), 2), np.arange(1, len(load), 2)
    matrix[second, second] += body.weight * np.where(in_contact, gamma_n, 0)
    load[second] -= body.weight * np.where(in_contact, gamma_n * gap(body.x), 0)
    if bound is not None:
        matrix[first, first] += body.weight * np.where(slip == 0, gamma_t, 0)
        load[first] -= body.weight * slip * bound
    corners = [0, len(load) - 2]
    keep = np.setdiff1d(np.arange(len(load)), corners)
    u = np.zeros_like(load)
    u[keep] = solve(matrix[np.ix_(keep, keep)], load[keep], assume_a="pos")
    return u, -u[second], u[first]


def ssn(body, bound, gamma, in_contact, slip, sigma=1.0, limit=100):
    """Algorithm (SSN) with lambda_hat = mu_hat = 0 from the sets of its first linear solve; bound
    None: no friction.
    """
    gamma_n, gamma_t = gamma
    for solves in range(1, limit + 1):
        u, u_n, u_t = linear_step(body, bound, gamma, in_contact, slip)
        pressure = np.where(in_contact, gamma_n * (u_n - gap(body.x)), 0)
        new_contact = gamma_n * (u_n - gap(body.x)) > 0
        if bound is None:
            shear, new_slip = np.zeros_like(u_t), np.zeros_like(slip)
        else:
            shear = np.where(slip == 0, gamma_t * u_t, slip * bound)
            xi = np.where(slip == 0, 0, u_t - slip * bound / gamma_t)
            new_slip = (xi + sigma * (shear - bound) > 0).astype(int) - (
                xi + sigma * (shear + bound) < 0
            )
        transmits = bound is not None and bound > 0
        if np.array_equal(new_contact, in_contact) and np.array_equal(
            new_slip * transmits, slip * transmits
        ):
            everywhere = body.displacement(u)
            energy = everywhere.ravel() @ (body.stiffness @ everywhere.ravel()) / 2
            return Result(everywhere, pressure, shear, in_contact, slip, solves, energy)
        in_contact, slip = new_contact, new_slip
    raise RuntimeError(f"no solution after {limit} solves")


def tresca(nx, ny, poisson, bound, gamma, patch, cell="quadrilateral"):
    """Tresca friction; the first contact set is the nodes of ``patch``, xi = mu = 0 there and
    everywhere.
    """
    body = block(nx, ny, poisson, cell)
    low, high = patch
    first = (body.x >= low - 1e-9) & (body.x <= high + 1e-9)
    return ssn(body, np.full(nx + 1, bound), gamma, first, np.zeros(nx + 1, dtype=int))


def coulomb(nx, ny, poisson, coefficient, gamma, cell="quadrilateral", tolerance=1e-7):
    """Algorithm (FP) of section 6.3 from the pure contact problem; it counts the solves of the
    start as well.

    The first friction sets are stick in contact (xi = mu = 0) and free elsewhere, where nothing can
    be transmitted.
    """
    body = block(nx, ny, poisson, cell)
    nobody = np.zeros(nx + 1, dtype=int)
    start = ssn(body, None, gamma, np.ones(nx + 1, dtype=bool), nobody)
    result, g, solves = start, start.pressure, start.solves
    for outer in range(1, 100):
        slip = np.where(g > 0, 0, 1) if outer == 1 else result.slip
        result = ssn(body, coefficient * g, gamma, result.in_contact, slip)
        result.outer, solves = outer, solves + result.solves
        change = result.pressure - g
        g = result.pressure
        if np.sqrt(body.weight @ change**2) <= tolerance * np.sqrt(body.weight @ g**2):
            result.solves = solves
            return result
    raise RuntimeError("no fixed point")
