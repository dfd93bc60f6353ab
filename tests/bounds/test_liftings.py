"""Liftings of tractions and forces that are orthogonal to linear functions: their norms against
polynomials.
"""

import basix
import numpy as np
import pytest

from signorini_fx.addons.bounds.johnson_mercier import constant_forces
from signorini_fx.addons.bounds.liftings import Liftings, divided_facet, lifted_forces
from signorini_fx.addons.bounds.simplices import (
    COLUMNS,
    CORNERS_OF_PARTS,
    ROWS,
    TWICE,
    Moduli,
    Simplices,
)

# Cells without any symmetry, in units of their own, the facet first; and regular ones.
SKEW = {
    2: np.array([[0.1, 0.2], [2.3, 0.1], [0.5, 1.4]]),
    3: np.array([[0.1, 0.2, -0.3], [2.3, 0.1, 0.2], [0.5, 1.4, 0.1], [1.5, 0.9, 1.7]]),
}
REGULAR = {
    d: np.concatenate((np.zeros((1, d)), np.linalg.cholesky((np.ones((d, d)) + np.eye(d)) / 2)))
    for d in (2, 3)
}
CELLS = {2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}
FACETS = {2: basix.CellType.interval, 3: basix.CellType.triangle}
STEEL = {d: Moduli.isotropic(np.full(1, 1.2), np.full(1, 0.8), d) for d in (2, 3)}
SHAPES = pytest.mark.parametrize(
    ("d", "corners"), [(d, shape[d]) for d in (2, 3) for shape in (REGULAR, SKEW)]
)


def polynomials(corners, moduli, degree):
    """Of displacements of a degree in a cell: those without rigid motions, orthonormal in the
    energy norm, as coefficients of functions, shape (d n, k), and these functions at barycentric
    points, (q, d + 1) to (q, n)."""
    d = corners.shape[1]
    element = basix.create_element(
        basix.ElementFamily.P, CELLS[d], degree, basix.LagrangeVariant.legendre, discontinuous=True
    )
    points, weights = basix.make_quadrature(CELLS[d], 2 * degree)
    map_ = (corners[1:] - corners[0]).T
    gradient = np.einsum(
        "kqi,kl->qil", element.tabulate(1, points)[1:, :, :, 0], np.linalg.inv(map_)
    )
    full = np.zeros((len(points), d * gradient.shape[1], d, d))
    for axis in range(d):
        full[:, axis::d, axis] = gradient
    strain = ((full + full.transpose(0, 1, 3, 2)) / 2)[..., ROWS[d], COLUMNS[d]]
    stress = moduli.stress(strain.reshape(1, -1, len(ROWS[d]))).reshape(strain.shape) * TWICE[d]
    matrix = np.einsum("q,qik,qjk->ij", weights * abs(np.linalg.det(map_)), stress, strain)
    size, vectors = np.linalg.eigh(matrix)
    strained = size > 1e-10 * size[-1]
    assert (~strained).sum() == d * (d + 1) // 2
    return vectors[:, strained] / np.sqrt(size[strained]), lambda at: element.tabulate(
        0, at[:, 1:]
    )[0, :, :, 0]


def facet_rule(corners, degree):
    """Barycentric points of the first facet in the cell, and weights."""
    d = corners.shape[1]
    points, weights = basix.make_quadrature(FACETS[d], degree)
    along = corners[1:d] - corners[0]
    local = np.column_stack((1 - points.sum(axis=1), points, np.zeros(len(points))))
    return local, np.sqrt(np.linalg.det(along @ along.T)) * weights


@SHAPES
def test_the_constant_is_enclosed(d, corners):
    """By polynomials of degree 6 from below; from above it is not far from these."""
    basis, at = polynomials(corners, STEEL[d], 6)
    local, weights = facet_rule(corners, 12)
    values, linear = at(local), local[:, :d]
    values -= linear @ np.linalg.solve(
        linear.T @ (weights[:, None] * linear), linear.T @ (weights[:, None] * values)
    )
    mass = np.kron(values.T @ (weights[:, None] * values), np.eye(d))
    least = float(np.sqrt(np.linalg.eigvalsh(basis.T @ mass @ basis)[-1]))
    constants = [Liftings.of(corners[None], STEEL[d], m).constant[0] for m in (2, 3)]
    assert least < constants[1] < constants[0]
    assert constants[1] < 2.2 * least


@pytest.mark.one_quick("seed", [1, 2])
@SHAPES
def test_norms_of_liftings(d, corners, seed):
    """A traction that jumps inside a facet does no more work on polynomials than the bound says."""
    chance, parts = np.random.default_rng(seed), divided_facet(d, 3).parts
    jump, slope = chance.normal(size=(2, d))
    moduli, basis, at = STEEL[d], *polynomials(corners, STEEL[d], 6)

    def traction(local):
        return np.where(local[:, :1] > 1 / 3, jump, 0.0) + local[:, 1:2] * slope * (
            local[:, :1] > 4 / 9
        )

    inside, weights = facet_rule(corners, 12)
    inside, finest = (
        inside[:, :d],
        (parts @ parts[:, None]).reshape(-1, d, d),
    )  # the jumps are at ends of these
    weights = np.tile(weights / len(finest), len(parts))
    places = np.concatenate([inside @ part for part in finest])
    values, all_weights = traction(places), np.tile(weights, len(parts))
    closest = np.linalg.solve(
        places.T @ (all_weights[:, None] * places), places.T @ (all_weights[:, None] * values)
    )
    functions = at(np.column_stack((places, np.zeros(len(places)))))
    work = functions.T @ (all_weights[:, None] * (values - places @ closest))
    least = float(np.linalg.norm(work.ravel() @ basis))
    local = np.concatenate([inside @ part for part in parts])
    mass = local.T @ (weights[:, None] * local)
    samples = np.stack([traction(local @ part) for part in parts])
    on_parts = np.linalg.solve(mass, np.einsum("q,qa,pqd->pad", weights, local, samples))
    rest = samples - np.einsum("qa,pad->pqd", local, on_parts)
    missed = float(np.einsum("q,pqd,pqd->", weights, rest, rest))
    found = Liftings.of(corners[None], moduli, 3).norms(on_parts[None], np.array([missed]))[0]
    assert least < found < 5 * least


@SHAPES
def test_norms_of_lifted_forces(d, corners):
    """What constants on the parts miss of a linear force does no more work on polynomials, and not
    far from that.
    """
    ordered = (
        corners
        if np.linalg.det(corners[1:] - corners[0]) > 0
        else corners[[1, 0, *range(2, d + 1)]]
    )
    t, chance = Simplices(ordered, np.arange(d + 1)[None], STEEL[d]), np.random.default_rng(3)
    basis, at = polynomials(ordered, STEEL[d], 5)
    points, weights = basix.make_quadrature(CELLS[d], 8)
    local, weights = np.column_stack((1 - points.sum(axis=1), points)), weights / weights.sum()
    for _ in range(4):
        linear = chance.normal(size=(d + 1, d))
        moments = (
            t.volume[0] * (np.ones((d + 1, d + 1)) + np.eye(d + 1)) / ((d + 1) * (d + 2)) @ linear
        )
        work = np.zeros((basis.shape[0] // d, d))
        for part, constant in zip(
            CORNERS_OF_PARTS[d], constant_forces(t, moments[None])[0], strict=True
        ):
            places = local @ part
            work += (
                t.volume[0]
                / (d + 1)
                * at(places).T
                @ (weights[:, None] * (places @ linear - constant))
            )
        least = float(np.linalg.norm(work.ravel() @ basis))
        assert least < lifted_forces(t, linear[None])[0] < 3 * least
    assert lifted_forces(t, np.ones((1, d + 1, d)))[0] < 1e-14
