"""Two nonlinear bodies of revolution that slide on each other: closed forms, limits, invariances, and what the
certificate refuses.
"""

import numpy as np
import pytest
from support.nonlinear_bodies import stress_of_block
from support.sliding_bodies import as_linear_bodies, cylinders, dome, ring_on_cone

from signorini_fx import Coulomb

FRICTION = pytest.mark.parametrize("friction", [None, Coulomb(0.3)], ids=["smooth", "rough"])
SLOW = pytest.mark.slow


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", ["quadrilateral", pytest.param("triangle", marks=SLOW)])
@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize("inner", [0.0, pytest.param(0.2, marks=SLOW)])
def test_patch(kind, slave, inner):
    """Two cylinders whose meshes do not match, compressed by two fifths: uniform, in closed form; the tubes as well."""
    scene = cylinders(kind, inner=inner, slave=slave)
    area = np.pi * (1.0 - inner**2)
    for depth in (0.1, 0.4):
        force = scene.move(0.0, -2 * depth)
        assert scene.problem.certificate.holds
        state = scene.problem.state
        (pair,) = scene.problem.linear.pairs.values()
        into = -pair.coupling.gap
        assert into == pytest.approx(into[0], rel=1e-6)
        assert 0 < into[0] < 1e-4
        stress = stress_of_block(1 - depth + into[0] / 2, directions=2)
        assert state.pressure == pytest.approx(-stress, rel=1e-8)
        assert abs(force[1]) == pytest.approx(-stress * area, rel=1e-8)
        x = scene.u.function_space.tabulate_dof_coordinates()[:, :2]
        across = scene.u.x.array.reshape(-1, 2)[:, 0]
        assert across == pytest.approx(across[x[:, 0].argmax()] * x[:, 0], abs=1e-9)


def agrees_with_linear_bodies(scene):
    """Whether displacements and forces are those of the pair of linear bodies on the same mesh, to 1e-6."""
    force = scene.move(1e-8 * (not scene.half), -1e-7)
    linear = as_linear_bodies(scene)
    expected = sum(linear.state.forces)
    assert np.count_nonzero(linear.state.in_contact) > 3
    assert force == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    far = np.abs(linear.u.x.array).max()
    assert scene.u.x.array == pytest.approx(linear.u.x.array, abs=1e-6 * far)
    return linear


@pytest.mark.one_quick
@pytest.mark.parametrize("friction", [pytest.param(None, marks=SLOW), Coulomb(0.3)], ids=["smooth", "rough"])
@pytest.mark.parametrize("slave", [0, 1])
def test_linear_limit(friction, slave):
    """A paraboloid on a cylinder."""
    linear = agrees_with_linear_bodies(dome(friction=friction, slave=slave, algorithm="alm"))
    if friction is not None:
        assert np.abs(linear.state.shear).max() > 0.01 * linear.state.pressure.max()


@pytest.mark.slow
@FRICTION
def test_ring_over_a_cone(friction):
    """A soft thin ring that is driven down a cone, over ten facets, widens by two fifths: its force along the axis is
    that of the slope and the angle of friction, whatever the number of steps is.
    """
    angle = np.pi / 4 + np.arctan(0.0 if friction is None else 0.3)
    ends = []
    for steps in (4, 8):
        scene = ring_on_cone(ratio=0.02, slave=1, size=0.1, cells=(48, 4), friction=friction)
        for way in -0.4 * np.arange(1, steps + 1) / steps:
            force = scene.move(0.0, way)
        assert scene.problem.certificate.holds
        assert max(scene.iterations) <= 7
        ends.append(force)
    assert force[1] / force[0] == pytest.approx(np.tan(angle), rel=0.01)
    assert np.abs(scene.u.x.array).max() > 0.35
    assert ends[1] == pytest.approx(ends[0], rel=1e-5)
