"""Two bodies that slide on each other and cannot part, as a slider in its guide: pressures may pull."""

import numpy as np
import pytest
from support.nonlinear_bodies import stress_of_block
from support.sliding_bodies import (
    as_linear_bodies,
    blocks,
    bulge,
    bump,
    stacked,
)

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem

CLOSED = {"pair": {"bilateral": True}, "algorithm": "alm"}
PULLED = ((0.0, 0.05), (0.1, 0.1), (0.4, 0.1), (0.4, -0.1), (0.2, -0.1))


@pytest.mark.parametrize("slave", [0, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "scene_of",
    [
        lambda **more: blocks(lower=(5, 3), upper=(3, 2), width=1.0, **more),
        pytest.param(lambda **more: blocks("triangle", degree=2, width=1.0, **more), marks=pytest.mark.slow),
        pytest.param(lambda **more: stacked(**more), marks=pytest.mark.slow),
    ],
    ids=["plane", "quadratic", "space"],
)
def test_patch(scene_of, slave):
    """Blocks whose meshes do not match are pressed, and then pulled by a tenth: uniform, in closed form."""
    scene = scene_of(slave=slave, smooth=lambda x: np.isclose(x[0], 0.0), **CLOSED)
    dim = len(scene.u)
    for depth in (0.1, -0.1):
        scene.move(*[0.0] * (dim - 1), -2 * depth)
        (pair,) = scene.problem.linear.pairs.values()
        into = -pair.coupling.gap
        assert np.abs(into).max() < 1e-4
        expected = -stress_of_block(1 - depth + into[0] / 2, directions=dim - 1)
        assert scene.problem.state.pressure == pytest.approx(expected, rel=1e-8)
        assert scene.problem.certificate.holds


@pytest.mark.one_quick
@pytest.mark.parametrize("friction", [None, Coulomb(0.3)], ids=["smooth", "rough"])
@pytest.mark.parametrize(
    ("scene_of", "lower", "slave"),
    [(bump, (26, 8), 0), (bump, (26, 8), 1), pytest.param(bulge, (10, 10, 4), 1, marks=pytest.mark.slow)],
)
def test_linear_limit(scene_of, lower, slave, friction):
    """At small loads pairs of linear bodies, some of whose points pull; points at the rim of the other side, which in
    space share their functions in another way than those of linear bodies, are left out there.
    """
    scene = scene_of(lower=lower, friction=friction, slave=slave, **CLOSED)
    dim = len(scene.u)
    force = scene.move(2e-5, *[0.0] * (dim - 2), -5e-5)
    linear = as_linear_bodies(scene)
    expected, pressure = sum(linear.state.forces), scene.problem.state.pressure
    assert pressure.min() < -0.1 * pressure.max()
    assert force == pytest.approx(expected, abs=1e-3 * pressure.max())
    assert scene.u.x.array == pytest.approx(linear.u.x.array, abs=1e-3 * np.abs(linear.u.x.array).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "degree"), [("quadrilateral", 1), pytest.param("triangle", 2, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("friction", [None, Coulomb(0.3)], ids=["smooth", "rough"])
def test_on_a_rigid_plane(friction, kind, degree):
    """A block that is 1e5 times as stiff is a rigid plane, of which other code knows, pulled and slid over facets."""
    forces, rigid = [], {"shape": "plane", "point": (0.0, 0.0), "normal": (0.0, 1.0)}
    for on_plane in (False, True):
        size = {"lower": (8, 3), "upper": (4, 3), "width": 3.0, "degree": degree, "ratio": 1e-5}
        scene = blocks(kind, slave=1, friction=friction, **size, **CLOSED)
        if on_plane:
            tool = Foundation(scene.sides[1], shape=rigid, friction=friction, bilateral=True)
            scene.problem = NonlinearContactProblem(scene.form, scene.u, bcs=scene.bcs, contact=tool, algorithm="alm")
        forces.append(1e5 * np.array([scene.move(*way) for way in PULLED]))
        assert scene.problem.certificate.holds
    largest = np.abs(forces[1]).max()
    assert forces[1][:3, 1].max() < 0 < forces[1][3:, 1].min()
    assert forces[0] == pytest.approx(forces[1], abs=3e-5 * largest)
