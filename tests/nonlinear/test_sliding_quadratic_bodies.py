"""Two nonlinear bodies of degree 2 that slide on each other: what bodies of degree 1 are tested by, and accuracy."""

import numpy as np
import pytest
from mpi4py import MPI
from support.nonlinear_bodies import stress_of_block
from support.sliding_bodies import as_linear_bodies, blocks, bump, cylinders, dome, ring_on_cone, roller

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


@pytest.mark.slow
def test_over_facets():
    """Over three facets of a block, in three and in five steps: the same force; without friction hardly any of it is
    along the block, and triangles and quadrilaterals have the same to a fifth of a per cent.
    """
    ends = []
    for kind, steps in (("quadrilateral", 3), ("quadrilateral", 5), ("triangle", 3)):
        scene = roller(kind, ratio=10.0, cells=(28, 7), around=14, degree=2)
        ways = [(0, -0.1), (0, -0.2), *((3 / 7 * share, -0.2) for share in np.arange(1, steps + 1) / steps)]
        force = [scene.move(*way) for way in ways][-1]
        assert scene.problem.certificate.holds
        ends.append(force)
    largest = abs(ends[0][1])
    assert ends[1] == pytest.approx(ends[0], abs=1e-6 * largest)
    assert ends[2] == pytest.approx(ends[0], abs=2e-3 * largest)
    assert abs(ends[0][0]) < 3e-3 * largest


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("revolved", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_on_ranks(revolved):
    """The same on any number of ranks."""
    forces = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        more = {"friction": Coulomb(0.3), "degree": 2, "comm": comm}
        if revolved:
            scene = ring_on_cone(ratio=0.02, slave=1, cells=(16, 2), around=6, **more)
            ways = (0.0, -0.1), (0.0, -0.2)
        else:
            scene = roller(ratio=10.0, cells=(8, 2), around=6, **more)
            ways = (0.0, -0.1), (0.2, -0.1)
        for way in ways:
            force = scene.move(*way)
        assert scene.problem.certificate.holds
        forces.append(force)
    assert np.abs(forces[0]).min() > 0.01 * np.abs(forces[0]).max()
    assert forces[0] == pytest.approx(forces[1], rel=1e-7)


def test_a_body_inside_another_one():
    """It is seen by the outlines of cells with nodes between their vertices."""
    small = roller(radius=0.1, gap=0.05, cells=(16, 4), around=4, ratio=10.0, reach=0.05, degree=2)
    with pytest.raises(ConvergenceError, match=r"bodies inside each other \(contact\[0\]: "):
        small.move(0.0, -0.6)
    assert small.problem.status is Status.PASSED
