"""The law of bonds at points: energies, derivatives, damage that only grows."""

import numpy as np
import pytest

from signorini_fx.algebra.contact.bond import Bond


def bond(count=1, dimension=2, *, exponent=2.1, damage=0.0, stiffness=1e6, **changed):
    """Equal bonds of points without gaps."""
    law = {
        "stiffness": stiffness,
        "strength": 30.0,
        "shear_strength": 50.0,
        "energy": 0.3,
        "shear_energy": 0.9,
        "exponent": exponent,
    } | changed
    given = {key: np.full(count, value) for key, value in law.items()}
    zero = np.zeros((count, dimension - 1))
    return Bond(
        **given,
        damage=np.full(count, damage),
        separation=zero,
        position=np.zeros((count, dimension)),
    )


@pytest.mark.parametrize(
    ("degrees", "energy"), [(0, 0.3), (30, 0.332646), (45, 0.439955), (60, 0.627929), (90, 0.9)]
)
def test_energy_of_mixed_modes(degrees, energy):
    """The work of tearing along a straight way is that of Benzeggagh and Kenane."""
    angle = np.deg2rad(degrees)
    way = np.linspace(0.0, 0.1, 200_001)
    traces = -way * np.cos(angle), (way * np.sin(angle))[:, None]
    bonds = bond(way.size)
    tractions = bonds.tractions(traces)
    steps = np.diff(np.column_stack(traces), axis=0)
    work = np.sum(0.5 * (tractions[1:] + tractions[:-1]) * steps)
    assert work == pytest.approx(energy, rel=1e-5)
    assert bonds.torn(traces)[-1, 0] == pytest.approx(energy, rel=3e-6)
    np.testing.assert_allclose(
        bonds.torn(traces)[:, 0] + bonds.stored(traces),
        np.concatenate(
            ([0.0], np.cumsum(np.sum(0.5 * (tractions[1:] + tractions[:-1]) * steps, axis=1)))
        ),
        atol=1e-5,
    )


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("damage", [0.0, 0.997])
def test_derivatives(dimension, damage):
    """Of tractions by displacements, against differences; secants are definite."""
    rng = np.random.default_rng(3)
    bonds = bond(400, dimension, damage=damage, stiffness=1e5)
    at = 1e-2 * rng.uniform(-1.0, 1.0, (400, dimension)) * rng.uniform(0.0, 1.0, (400, 1)) ** 2

    def tractions(x):
        return bonds.tractions((x[:, 0], x[:, 1:]))

    blocks = bonds.blocks((at[:, 0], at[:, 1:]))
    step = 1e-9
    for j in range(dimension):
        moved = step * np.eye(dimension)[j]
        by = (tractions(at + moved) - tractions(at - moved)) / (2 * step)
        away = np.abs(by - blocks[:, :, j]).max(axis=1)
        assert np.quantile(away, 0.98) < 1e-6 * np.abs(blocks).max()  # but where branches meet
    assert np.linalg.eigvalsh(bonds.blocks((at[:, 0], at[:, 1:]), 0.0)).min() >= 0.0
    assert not bonds.symmetric


def test_unloading():
    """Damage stays, and unloading follows the secant; pressed bonds shear alone."""
    bonds = bond(shear_strength=30.0, shear_energy=0.3)
    assert bonds.symmetric
    torn = bonds.damaged((np.array([-0.01]), np.zeros((1, 1))))
    later = bond(damage=torn, shear_strength=30.0, shear_energy=0.3)
    pulled = [later.tractions((np.array([-way]), np.zeros((1, 1))))[0, 0] for way in (0.005, 0.01)]
    assert pulled[1] == pytest.approx(-30.0 * (0.02 - 0.01) / (0.02 - 3e-5), rel=1e-9)
    assert pulled[0] == pytest.approx(pulled[1] / 2)
    pressed = bonds.tractions((np.array([1.0]), np.array([[1e-5]])))
    np.testing.assert_allclose(pressed, [[0.0, 10.0]])
