"""Forces in tetrahedra that are orthogonal to linear vectors: their work on displacements against the constants."""

from itertools import pairwise

import basix
import numpy as np
import pytest
from self_similar import largest_norm
from test_lifted_tractions import SKEW, STEEL, UNIT, polynomials

from signorini_fx.addons.bounds.initial_stress import simplex_rule
from signorini_fx.addons.bounds.johnson_mercier import constant_forces
from signorini_fx.addons.bounds.korn import HILL, REGULAR, hill, work_inside
from signorini_fx.addons.bounds.lifted_forces import lifted_forces
from signorini_fx.addons.bounds.lifted_tractions import divided_face
from signorini_fx.addons.bounds.simplices import CORNERS_OF_PARTS, Simplices

DEGREE = 5


def least_constant(corners, direction=None):
    """The largest norm, less its linear part, of polynomials with an energy norm of one: a lower bound; of the
    component in a direction alone, if there is one."""
    basis, _ = polynomials(corners, UNIT, DEGREE)
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.tetrahedron, DEGREE, basix.LagrangeVariant.legendre, discontinuous=True
    )
    local, weights = basix.make_quadrature(basix.CellType.tetrahedron, 2 * DEGREE)
    weights = weights * abs(np.linalg.det(corners[1:] - corners[0]))
    values = element.tabulate(0, local)[0, :, :, 0]
    linear = np.column_stack((np.ones(len(local)), local))
    values -= linear @ np.linalg.solve(linear.T @ (weights[:, None] * linear), linear.T @ (weights[:, None] * values))
    axes = np.eye(3) if direction is None else np.outer(direction, direction)
    mass = np.kron(values.T @ (weights[:, None] * values), axes)
    return float(np.sqrt(np.linalg.eigvalsh(basis.T @ mass @ basis)[-1]))


@pytest.mark.slow
@pytest.mark.parametrize(("cosine", "constant"), HILL)
def test_the_constants(cosine, constant):
    """They are proved by stresses on eight parts, and nearly the least ones that these prove; polynomials show that
    they are not far from the least ones at all."""
    norm, missed = largest_norm(cosine, 2)
    assert missed < 1e-11
    proved = norm / np.sqrt(1 - 1 / 2**2)
    assert proved < constant < 1.01 * proved
    least = least_constant(hill(cosine))
    assert least < proved < 4 * least


@pytest.mark.parametrize(("cosine", "_"), HILL)
@pytest.mark.parametrize("m", [2, 3])
def test_parts_are_like_the_whole(cosine, _, m):
    """Each has a path of three edges with the same lengths and angles, smaller by m; together they have its volume."""
    face, corners = divided_face(m), hill(cosine)
    x = face.x @ corners
    whole = np.diff(corners, axis=0)
    for part in face.corners:
        steps = np.array([after - before for before, after in pairwise(x[part])])
        np.testing.assert_allclose(m**2 * steps @ steps.T, whole @ whole.T, atol=1e-13)
    middles = np.linalg.solve(
        np.column_stack((corners, np.ones(4))).T, np.column_stack((x[face.corners].mean(axis=1), np.ones(m**3))).T
    )
    assert (middles > 0).all()
    assert len(np.unique(middles.T.round(9), axis=0)) == m**3


@pytest.mark.parametrize(("cosine", "constant"), HILL)
def test_the_scale(cosine, constant):
    """Of tetrahedra that are like those of the constants it is the constant times the length of the edges, also where
    these are in another order and turned."""
    turn = np.linalg.qr(np.random.default_rng(6).normal(size=(3, 3)))[0]
    for size in (0.1, 3.0):
        for order in ([0, 1, 2, 3], [3, 1, 0, 2]):
            t = Simplices(size * hill(cosine)[order] @ turn.T, np.array([[0, 1, 2, 3]]), UNIT)
            assert work_inside(t, np.outer(turn[:, 0], turn[:, 0])[None])[0] == pytest.approx(constant * size)


@pytest.mark.parametrize("corners", [REGULAR, SKEW, SKEW * [1.0, 1.0, 0.1]], ids=["regular", "skew", "thin"])
def test_no_polynomial_does_more_work(corners):
    """Whatever the direction of the force is."""
    t = Simplices(corners, np.array([[0, 1, 2, 3]]), UNIT)
    directions = np.concatenate((np.eye(3), np.random.default_rng(2).normal(size=(3, 3))))
    for direction in directions / np.linalg.norm(directions, axis=1, keepdims=True):
        bound = work_inside(t, np.outer(direction, direction)[None])[0]
        assert least_constant(corners, direction) < bound


@pytest.mark.parametrize("moduli", [UNIT, STEEL], ids=["unit", "steel"])
@pytest.mark.parametrize(
    "corners",
    [REGULAR, SKEW, hill(0.0), SKEW * [1.0, 1.0, 0.1], hill(0.0) * [0.2, 1.0, 0.2]],
    ids=["regular", "skew", "of a cube", "flat", "long"],
)
def test_norms_of_liftings(corners, moduli):
    """What constants on quarters miss of a linear force does no more work on polynomials, and not much less."""
    t = Simplices(corners, np.array([[0, 1, 2, 3]]), moduli)
    chance = np.random.default_rng(3)
    basis, _ = polynomials(corners, moduli, DEGREE)
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.tetrahedron, DEGREE, basix.LagrangeVariant.legendre, discontinuous=True
    )
    local, weights = simplex_rule(3, DEGREE)
    for _ in range(4):
        linear = chance.normal(size=(4, 3))
        moments = t.volume[0] * (np.ones((4, 4)) + np.eye(4)) / 20 @ linear
        constants = constant_forces(t, moments[None])[0]
        work = np.zeros((basis.shape[0] // 3, 3))
        for part, constant in zip(CORNERS_OF_PARTS[3], constants, strict=True):
            at = local @ part
            left = at @ linear - constant
            work += t.volume[0] / 4 * element.tabulate(0, at[:, 1:])[0, :, :, 0].T @ (weights[:, None] * left)
        least = float(np.linalg.norm(work.ravel() @ basis))
        assert least < lifted_forces(t, linear[None])[0] < 1.5 * least


def test_a_constant_force_needs_no_lifting():
    """It is held as it is."""
    t = Simplices(SKEW, np.array([[0, 1, 2, 3]]), STEEL)
    assert lifted_forces(t, np.ones((1, 4, 3)))[0] == 0.0
