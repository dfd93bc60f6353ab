"""Two bodies that slide with friction that needs no pressure: Tresca's, cohesion, and laws of one's own."""

import numpy as np
import pytest
from support.sliding_bodies import (
    as_linear_bodies,
    blocks,
    bulge,
    bump,
    out_of_balance,
    roller,
)

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem, Tresca
from signorini_fx.mechanics.laws.protocol import Envelope, FrictionLaw, Parameter

BOUND = 0.4
THERE_AND_BACK = ((0, -0.02), (0, -0.1), (0.05, -0.1), (0.3, -0.1), (0.27, -0.1), (0.05, -0.1))
WIDE = {"slave": 1, "width": 3.0, "algorithm": "alm"}


class Sticky(FrictionLaw):
    """c + F lambda, in contact or not."""

    law: str = "sticky"
    given: Parameter
    coefficient: Parameter

    def limit(self, pressure):
        return self.given + self.coefficient * pressure

    def derivative(self, pressure):
        return self.coefficient + 0.0 * pressure

    def envelope(self, zero):
        return Envelope(zero + self.given, zero + self.coefficient)


NAMES = ["tresca", "cohesion"]


@pytest.mark.one_quick
@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize("scene_of", [bump, pytest.param(bulge, marks=pytest.mark.slow)])
@pytest.mark.parametrize("law", [Tresca(2e-4), Coulomb(0.1, cohesion=1e-4)], ids=NAMES)
def test_linear_limit(law, scene_of, slave):
    """At small loads pairs of linear bodies, on the same mesh, with points that are open and carry shear, or do not."""
    scene = scene_of(friction=law, slave=slave, algorithm="alm")
    dim = len(scene.u)
    force = scene.move(2e-5, *[0.0] * (dim - 2), -1e-4)
    linear = as_linear_bodies(scene)
    state, expected = scene.problem.state, sum(linear.state.forces)
    slips = np.linalg.norm(state.direction, axis=1) > 0
    across = ~state.in_contact & (np.linalg.norm(state.shear, axis=1) > 0)
    assert np.count_nonzero(slips) > 3
    assert across.any() == isinstance(law, Tresca)
    assert force == pytest.approx(expected, abs=2e-4 * np.abs(expected).max())
    assert scene.u.x.array == pytest.approx(linear.u.x.array, abs=2e-4 * np.abs(linear.u.x.array).max())


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", ["quadrilateral", pytest.param("triangle", marks=pytest.mark.slow)])
@pytest.mark.parametrize("law", [Tresca, lambda bound: Coulomb(0.0, cohesion=bound)], ids=NAMES)
def test_on_a_rigid_plane(law, kind, degree):
    """A block that is 1e5 times as stiff is a rigid plane, of which other code knows, over two facets and back; where
    all slides the force is the bound times the undeformed area of the first side.
    """
    forces, rigid = [], {"shape": "plane", "point": (0.0, 0.0), "normal": (0.0, 1.0)}
    for on_plane in (False, True):
        friction = {"friction": law(1e-5 * BOUND)}
        scene = blocks(kind, lower=(8, 3), upper=(4, 3), ratio=1e-5, degree=degree, **WIDE, **friction)
        if on_plane:
            tool = Foundation(scene.sides[1], shape=rigid, **friction)
            scene.problem = NonlinearContactProblem(scene.form, scene.u, bcs=scene.bcs, contact=tool, algorithm="alm")
        forces.append(1e5 * np.array([scene.move(*way) for way in THERE_AND_BACK]))
        assert scene.problem.certificate.holds
    assert forces[0] == pytest.approx(forces[1], abs=3e-5 * np.abs(forces[1]).max())
    assert forces[0][[3, 5], 0] == pytest.approx([-BOUND, BOUND], rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [Tresca(BOUND), Coulomb(0.1, cohesion=BOUND), Sticky(BOUND, 0.3)], ids=type)
@pytest.mark.parametrize("algorithm", [pytest.param("ssn", marks=pytest.mark.slow), "alm"])
def test_nothing_acts_where_there_is_no_other_side(friction, algorithm):
    """Bodies that part and meet: no force where none sees the other one, and no shear at points that do not; forces and
    moments balance where there is some.
    """
    scene = roller(ratio=10.0, gap=0.3, reach=0.2, friction=friction, algorithm=algorithm)
    shears = []
    for way in ((0.0, 0.0), (0.0, -0.25), (0.0, -0.4), (0.0625, -0.4), (0.2, -0.4), (0.2, 0.1), (0.25, 0.1)):
        force = scene.move(*way)
        (pair,) = scene.problem.linear.pairs.values()
        shear, sees = np.abs(scene.problem.state.shear[:, 0]), pair.coupling.frames.partnered
        assert not sees.all()
        assert np.abs(shear[~sees]).max() == 0.0
        assert scene.problem.certificate.holds
        shears.append(shear.max())
        if shear.any():
            left, moment = out_of_balance(scene)
            assert left < 1e-13
            assert moment < 1e-12
        if not sees.any():
            assert np.abs(force).max() == 0.0
    assert shears[4] >= BOUND * (1 - 1e-9)
    assert shears[0] == shears[-1] == 0.0


@pytest.mark.one_quick
@pytest.mark.parametrize(("law", "across"), [(Tresca(BOUND), True), (Coulomb(0.0, cohesion=BOUND), False)], ids=NAMES)
def test_friction_across_gaps_is_told(law, across):
    """A finding says how far friction without pressure reaches, and what to take instead; of that nothing is said."""
    scene = roller(ratio=10.0, friction=law, algorithm="alm")
    for way in ((0.0, -0.1), (0.1, -0.1)):
        scene.move(*way)
    state, found = scene.problem.state, [finding for finding in scene.problem.findings if "gaps" in finding.message]
    open_points = ~state.in_contact & (state.shear[:, 0] != 0.0)
    assert open_points.any() == bool(found) == across
    if across:
        gap = (state.gap - state.u_n)[open_points].max()
        (finding,) = found
        assert (finding.level, finding.path) == ("warning", "contact[0].friction")
        assert f"up to {gap:.3g}, at {np.count_nonzero(open_points)} points" in finding.message
        assert "Coulomb(0.0, cohesion=...)" in finding.message
