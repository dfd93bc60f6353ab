"""Liftings of tractions on a face of a tetrahedron: their norms against displacements that are polynomials."""

import basix
import numpy as np
import pytest

from signorini_fx.addons.bounds.korn import BESIDE_LINEAR, REGULAR, work_beside_linear
from signorini_fx.addons.bounds.lifted_tractions import Liftings, _forms, divided_face, finest, rounded
from signorini_fx.addons.bounds.simplices import COLUMNS, ROWS, TWICE, IsotropicModuli, Simplices

# A tetrahedron without any symmetry, in units of its own.
SKEW = np.array([[0.1, 0.2, -0.3], [2.3, 0.1, 0.2], [0.5, 1.4, 0.1], [1.5, 0.9, 1.7]])
UNIT = IsotropicModuli(np.zeros(1), np.full(1, 0.5), 3)  # |sigma|^2 is that of the norm of matrices
STEEL = IsotropicModuli(np.full(1, 1.2), np.full(1, 0.8), 3)


def polynomials(corners, moduli, degree):
    """Of displacements of a degree in a tetrahedron: those without rigid motions, orthonormal in the energy norm, as
    coefficients of functions, shape (3 n, k), and these at points of the first face, (q, 3) to (q, n)."""
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.tetrahedron, degree, basix.LagrangeVariant.legendre, discontinuous=True
    )
    points, weights = basix.make_quadrature(basix.CellType.tetrahedron, 2 * degree)
    map_ = (corners[1:] - corners[0]).T
    gradient = np.einsum("kqi,kl->qil", element.tabulate(1, points)[1:, :, :, 0], np.linalg.inv(map_))
    n = gradient.shape[1]
    full = np.zeros((len(points), 3 * n, 3, 3))
    for axis in range(3):
        full[:, axis::3, axis] = gradient
    strain = ((full + full.transpose(0, 1, 3, 2)) / 2)[..., ROWS[3], COLUMNS[3]]
    stress = moduli.stress(strain.reshape(1, -1, 6)).reshape(strain.shape) * TWICE[3]
    matrix = np.einsum("q,qik,qjk->ij", weights * abs(np.linalg.det(map_)), stress, strain)
    size, vectors = np.linalg.eigh(matrix)
    strained = size > 1e-10 * size[-1]
    assert (~strained).sum() == 6

    def at(local):
        return element.tabulate(0, np.column_stack((local[:, 1:], np.zeros(len(local)))))[0, :, :, 0]

    return vectors[:, strained] / np.sqrt(size[strained]), at


def face_rule(corners, degree):
    """Points of a face and weights."""
    points, weights = basix.make_quadrature(basix.CellType.triangle, degree)
    area = np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) / 2
    return np.column_stack((1 - points.sum(axis=1), points)), 2 * area * weights


def least_constant(corners, moduli, degree):
    """The largest norm on the face, less its linear part, of polynomials with an energy norm of one: a lower bound."""
    basis, at = polynomials(corners, moduli, degree)
    local, weights = face_rule(corners, 2 * degree)
    values = at(local)
    values -= local @ np.linalg.solve(local.T @ (weights[:, None] * local), local.T @ (weights[:, None] * values))
    mass = np.kron(values.T @ (weights[:, None] * values), np.eye(3))
    return float(np.sqrt(np.linalg.eigvalsh(basis.T @ mass @ basis)[-1]))


@pytest.mark.parametrize(
    ("corners", "moduli", "near"),
    [(REGULAR, UNIT, 1.45), (SKEW, UNIT, 2.0), (SKEW, STEEL, 2.0), (SKEW[[1, 0, 2, 3]], STEEL, 2.0)],
    ids=["regular", "skew", "with the moduli of steel", "left-handed"],
)
def test_the_constant_is_enclosed(corners, moduli, near):
    """By polynomials of degree 6 from below; from above it is not far from these."""
    least = least_constant(corners, moduli, 6)
    constants = [Liftings.of(corners[None], moduli, m).constant[0] for m in (2, 3)]
    assert least < constants[1] < constants[0]
    assert constants[1] < near * least


def test_the_constant_of_the_regular_tetrahedron():
    """Is the one of ``korn``, which other tetrahedra are compared with; and is nearly the least one that it proves."""
    proved = Liftings.of(REGULAR[None], UNIT, 3).constant[0]
    assert proved < BESIDE_LINEAR < 1.01 * proved


def test_the_scale_of_the_cheap_bound():
    """Of tetrahedra that are like the regular one the bound is the constant times the square root of the edges, also
    where these are in another order; of one that is not it is above that of its own shape."""
    turn = np.linalg.qr(np.random.default_rng(6).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    for size in (0.1, 3.0):
        for order in ([0, 1, 2, 3], [1, 2, 0, 3]):
            t = Simplices(size * REGULAR[order] @ turn.T, np.array([[0, 1, 2, 3]]), UNIT)
            face = np.flatnonzero((t.facets == [0, 1, 2]).all(axis=1))
            unit = np.outer(turn[:, 0], turn[:, 0])
            assert work_beside_linear(t, face, unit[None])[0] == pytest.approx(BESIDE_LINEAR * size**0.5)
    t = Simplices(SKEW, np.array([[0, 1, 2, 3]]), UNIT)
    face = np.flatnonzero((t.facets == [0, 1, 2]).all(axis=1))
    bounds = work_beside_linear(t, np.repeat(face, 3), np.einsum("ki,kj->kij", np.eye(3), np.eye(3)))
    assert np.linalg.norm(bounds) > least_constant(SKEW, UNIT, 4)


def random_traction(seed):
    """Values of a traction that jumps inside a face, at points, and the parts that it is integrated on exactly."""
    chance = np.random.default_rng(seed)
    jump, linear = chance.normal(size=3), chance.normal(size=(3, 3))

    def traction(local):
        return np.where(local[:, :1] > 0.25, jump, 0.0) + local @ linear * (local[:, 1:2] > 0.125)

    return traction


def projections(traction, corners, parts):
    """Onto linear functions on some parts of equal size of a face, which jumps do not cross, and the square of what is
    left."""
    local, weights = face_rule(corners, 6)
    values = np.stack([traction(local @ part) for part in parts])
    mass = local.T @ (weights[:, None] * local)
    closest = np.linalg.solve(mass, np.einsum("q,qa,pqd->pad", weights, local, values))
    left = values - np.einsum("qa,pad->pqd", local, closest)
    return closest, float(np.einsum("q,pqd,pqd->", weights, left, left)) / len(parts)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("corners", [REGULAR, SKEW], ids=["regular", "skew"])
def test_norms_of_liftings(corners, seed):
    """The work of a traction on polynomials of degree 5 is below both bounds, and not far below the better one."""
    traction = random_traction(seed)
    parts = finest(divided_face(2), 3)  # the jumps are along edges of these
    exact, left = projections(traction, corners, parts)
    assert left < 1e-20
    (linear,), _ = projections(lambda local: local, corners, np.eye(3)[None])
    np.testing.assert_allclose(linear, np.eye(3), atol=1e-12)
    # The traction without its linear part, in the same parts.
    local, weights = face_rule(corners, 6)
    whole = np.linalg.solve(
        local.T @ (weights[:, None] * local),
        np.einsum("q,pqa,pqd->ad", weights / len(parts), local @ parts, local @ exact),
    )
    rest = exact - parts @ whole
    basis, at = polynomials(corners, STEEL, 5)
    work = np.zeros((basis.shape[0] // 3, 3))
    for part, values in zip(parts, rest, strict=True):
        work += at(local @ part).T @ (weights[:, None] / len(parts) * (local @ values))
    least = float(np.linalg.norm(work.ravel() @ basis))
    squares = np.einsum("q,pqi,pqj->ij", weights / len(parts), local @ rest, local @ rest)
    t = Simplices(corners, np.array([[0, 1, 2, 3]]), STEEL)
    face = np.flatnonzero((t.facets == [0, 1, 2]).all(axis=1))
    cheap = work_beside_linear(t, face, squares[None])[0] / np.sqrt(STEEL.softest[0])
    for m, levels, near in ((2, 1, 6.0), (2, 3, 4.0)):
        liftings = Liftings.of(corners[None], STEEL, m)
        closest, left = projections_of(exact, parts, liftings.face, levels, corners)
        found = liftings.norms(closest[None], np.array([left]))[0]
        assert least < found < near * least
        assert found < cheap
    assert least < cheap


def projections_of(exact, parts, face, levels, corners):
    """Those of a function that is linear on finer parts, by the means of ``face``."""
    values, count = exact, len(face.parts)
    local, weights = face_rule(corners, 6)
    squares = np.einsum("q,pqd,pqd->", weights / len(parts), local @ exact, local @ exact)
    while len(values) > count**levels:
        values = np.einsum("ak,jkd->jad", face.mean, values.reshape(-1, 3 * count, 3))
    kept = np.einsum("q,pqd,pqd->", weights / len(values), local @ values, local @ values)
    return values, max(float(squares - kept), 0.0)


@pytest.mark.parametrize("moduli", [UNIT, IsotropicModuli(np.full(1, 50.0), np.ones(1), 3)], ids=["soft", "stiff"])
@pytest.mark.parametrize("thin", [1.0, 0.1, 0.01, 0.001])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_round_off_of_forms(moduli, thin, axis):
    """Forms of turned tetrahedra are the same; round-off grows with the fourth power of the aspect and is counted."""
    chance = np.random.default_rng(5)
    turn, tip = (np.linalg.qr(chance.normal(size=(3, 3)))[0] for _ in range(2))
    corners = REGULAR @ tip * np.where(np.arange(3) == axis, thin, 1.0)
    share = rounded(corners[None], moduli)[0]
    form, turned = (_forms(divided_face(2), x[None], moduli)[0] for x in (corners, corners @ turn.T))
    unit = np.kron(np.eye(12), turn)
    counted = Liftings.of(corners[None], moduli, 2).forms[0, 0]
    assert np.linalg.norm(unit.T @ turned @ unit - form, 2) < share * np.linalg.norm(form, 2) / 3
    least = np.linalg.eigvalsh(counted - form)[0]
    assert least == pytest.approx(share * np.linalg.norm(form, 2), rel=1e-3)


def test_parts_of_a_face():
    """They cover the face once, are like it or turned by half a turn, and their means are those of functions."""
    chance = np.random.default_rng(3)
    corners = chance.normal(size=(3, 2))
    for m in (2, 3):
        face = divided_face(m)
        at = face.parts @ corners
        centre, away = at.mean(axis=1, keepdims=True), corners - corners.mean(axis=0)
        signs = np.where(face.turned, -1.0, 1.0)[:, None, None]
        np.testing.assert_allclose(at - centre, signs * away / m, atol=1e-14)
        assert len(np.unique(centre.round(9), axis=0)) == m * m
        assert (face.parts >= 0).all()
        linear = chance.normal(size=3)
        np.testing.assert_allclose(face.mean @ (face.parts @ linear).ravel(), linear, atol=1e-13)
        assert len(finest(face, 2)) == m**4
        np.testing.assert_allclose(finest(face, 2).mean(axis=(0, 1)), 1 / 3)


@pytest.mark.parametrize("number", [0, 2, 7])
def test_tractions_on_a_part(number):
    """What is orthogonal to linear functions on one part is lifted as on the face of the tetrahedron on it."""
    m, chance = 3, np.random.default_rng(4)
    face, whole = divided_face(m), Liftings.of(SKEW[None], STEEL, m)
    assert set(face.turned[[0, 7]]) == {0, 1}
    part = face.parts[number]
    apex = np.append(part.mean(axis=0) - 1 / (3 * m), 1 / m)
    own = np.vstack((np.column_stack((part, np.zeros(3))), apex)) @ SKEW
    alone = Liftings.of(own[None], STEEL, m)
    values = chance.normal(size=(m * m, 3, 3))
    values -= face.parts @ (face.mean @ values.reshape(-1, 3))
    spread = np.zeros((m * m, m * m, 3, 3))
    spread[number] = values
    zero = np.zeros(1)
    found = whole.norms(spread.reshape(1, -1, 3, 3), zero)[0]
    assert found == pytest.approx(alone.norms(values[None], zero)[0], rel=1e-9)
    assert alone.constant[0] == pytest.approx(whole.constant[0] / m**0.5)


@pytest.mark.parametrize("m", [2, 3])
def test_tetrahedra_on_the_parts_do_not_meet(m):
    """Those of the second part of the proof: they are in the tetrahedron, and no two of them share a point inside."""
    face = divided_face(m)
    tetrahedra = []
    for part in face.parts:
        # From the centroid of the part to its apex it is 1 / m of the way from that of the face to that of K.
        apex = np.append(part.mean(axis=0) - 1 / (3 * m), 1 / m)
        tetrahedra.append(np.vstack((np.column_stack((part, np.zeros(3))), apex)))
    chance, count = np.random.default_rng(0), np.zeros(4000, dtype=int)
    points = chance.dirichlet(np.ones(4), 4000)
    for corners in tetrahedra:
        inside = points @ np.linalg.inv(corners)
        assert (corners >= -1e-14).all()
        np.testing.assert_allclose(corners.sum(axis=1), 1.0)
        assert abs(np.linalg.det(corners)) == pytest.approx(1 / m**3)
        count += (inside > 1e-9).all(axis=1)
    assert count.max() == 1
    assert count.mean() == pytest.approx(1 / m, abs=0.05)
