"""Two nonlinear bodies of degree 2 that slide on each other: patches, the linear limit, and overlaps."""

import numpy as np
import pytest
from support.nonlinear_bodies import stress_of_block
from support.sliding_bodies import as_linear_bodies, blocks, bump, cylinders, dome, roller

from signorini_fx import ConvergenceError, Coulomb, Status


def smooth_blocks(kind, slave):
    """As high and wide as each other, between smooth plates."""
    middle = {"smooth": lambda x: np.isclose(x[0], 0.0)}
    return blocks(kind, lower=(5, 3), upper=(3, 2), width=1.0, slave=slave, degree=2, **middle)


@pytest.mark.one_quick
@pytest.mark.parametrize("slave", [0, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", [pytest.param("quadrilateral", marks=pytest.mark.slow), "triangle"])
@pytest.mark.parametrize("revolved", [False, True])
def test_patch(revolved, kind, slave):
    """Blocks and cylinders whose meshes do not match, compressed by three tenths: uniform, in closed form."""
    scene = cylinders(kind, slave=slave, degree=2) if revolved else smooth_blocks(kind, slave)
    for depth in (0.1, 0.3):
        scene.move(0.0, -2 * depth)
        assert scene.problem.certificate.holds
        (pair,) = scene.problem.linear.pairs.values()
        into = -pair.coupling.gap
        assert into == pytest.approx(into[0], rel=1e-6)
        assert 0 < into[0] < 1e-4
        stress = stress_of_block(1 - depth + into[0] / 2, directions=1 + revolved)
        assert scene.problem.state.pressure == pytest.approx(-stress, rel=1e-8)
        x = scene.u.function_space.tabulate_dof_coordinates()[:, :2]
        across = scene.u.x.array.reshape(-1, 2)[:, 0]
        assert across == pytest.approx(across[x[:, 0].argmax()] * x[:, 0], abs=1e-8)


@pytest.mark.parametrize("scene_of", [bump, pytest.param(dome, marks=pytest.mark.slow)])
def test_linear_limit(scene_of):
    """At small loads pairs of linear bodies of degree 2, with friction, in 2D and of revolution."""
    scene = scene_of(height=2e-7, lower=(12, 4), upper=(9, 3), friction=Coulomb(0.3), algorithm="alm", degree=2)
    force = scene.move(0.0, -1e-7)
    linear = as_linear_bodies(scene)
    expected = sum(linear.state.forces)
    assert np.count_nonzero(linear.state.in_contact) >= 5
    assert force == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    far = np.abs(linear.u.x.array).max()
    assert scene.u.x.array == pytest.approx(linear.u.x.array, abs=1e-6 * far)


def test_a_body_inside_another_one():
    """It is seen by the outlines of cells with nodes between their vertices."""
    small = roller(radius=0.1, gap=0.05, cells=(16, 4), around=4, ratio=10.0, reach=0.05, degree=2)
    with pytest.raises(ConvergenceError, match=r"bodies inside each other \(contact\[0\]: "):
        small.move(0.0, -0.6)
    assert small.problem.status is Status.PASSED
