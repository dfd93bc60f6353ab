"""The augmented Lagrangian method ends at the unregularised solution, whatever gamma it begins with."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scenes import alone, example1

from signorini_fx.scene import parse_scene

FEW = settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow])
MANY = settings(FEW, max_examples=300)
FORCE = 5.704914


def pushed(**solver):
    """A coarse block pushed sideways on a foundation with a kink: its pressure is nearly settled by statics."""
    return parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"nx": 8, "ny": 4}},
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [{"boundary": side, "x": 0.0} for side in ("left", "right")],
            "traction": {"boundary": "top", "y": -20.0, "x": 10.0},
            "contact": {
                "boundary": "bottom",
                "gap": "abs(x[0] - 1.5)",
                "friction": {"law": "coulomb", "coefficient": 1.0},
            },
            "solver": solver,
        }
    )


@pytest.mark.parametrize("coulomb", ["fp", "newton"])
@pytest.mark.parametrize("gamma", [(1e5, 1e4), (1e6, 1e2), (1e2, 1e6), (1e-3, 1e-3), (1e13, 1e13), (1e13, 1.0)])
def test_shear_settles_as_well_as_pressure(gamma, coulomb):
    """The friction force is that of elimination, though the pressure alone settles at once."""
    exact = alone(pushed(algorithm="exact"))
    assert exact.contact.forces[1][0] == pytest.approx(FORCE, abs=1e-6)
    ours = alone(pushed(algorithm="alm", coulomb=coulomb, gamma_n=gamma[0], gamma_t=gamma[1]))
    assert not ours.certificate.law.regularised
    assert ours.contact.forces[1][0] == pytest.approx(exact.contact.forces[1][0], rel=1e-6)


SCENES = {
    "kink": lambda **s: pushed(**s),
    "no friction": lambda **s: example1(nx=12, ny=4, **s),
    "Tresca": lambda **s: example1(bound=1.5, nx=12, ny=4, **s),
    "Coulomb": lambda **s: example1(coefficient=0.6, nx=12, ny=4, **s),
    "Coulomb, degree 2": lambda **s: example1(coefficient=0.3, nx=8, ny=3, degree=2, **s),
}
EXACT = {}


def same_as_exact(name, coulomb, share_n, share_t):
    """Pressure and shear agree with those of elimination to the tolerance."""
    if name not in EXACT:
        EXACT[name] = alone(SCENES[name](algorithm="exact"))
    exact = EXACT[name]
    default = 1e5 * exact.scene.young / exact.discretisation.tagged.size
    gammas = {"gamma_n": share_n * default, "gamma_t": share_t * default}
    scene = SCENES[name]()
    ours = alone(
        scene.model_copy(
            update={"solver": scene.solver.model_copy(update={"algorithm": "alm", "coulomb": coulomb, **gammas})}
        )
    )
    largest = exact.contact.pressure.max()
    for ours_, theirs in ((ours.contact.pressure, exact.contact.pressure), (ours.contact.shear, exact.contact.shear)):
        np.testing.assert_allclose(ours_, theirs, rtol=0, atol=5e-7 * largest)


shares = st.floats(-3, 5).map(lambda power: 10**power)
cases = {
    "name": st.sampled_from(sorted(SCENES)),
    "coulomb": st.sampled_from(["fp", "newton"]),
    "share_n": shares,
    "share_t": shares,
}


@FEW
@given(**cases)
def test_random_gammas(name, coulomb, share_n, share_t):
    """From a thousandth to 1e5 times the default, each apart."""
    same_as_exact(name, coulomb, share_n, share_t)


@pytest.mark.long
@MANY
@given(**cases)
def test_many_random_gammas(name, coulomb, share_n, share_t):
    """The same, more of them."""
    same_as_exact(name, coulomb, share_n, share_t)


def wedge(angle, coefficient, load, **solver):
    """A wedge in a groove with oblique flanks, held sideways at its top, where two contact nodes are."""
    friction = {"law": "coulomb", "coefficient": coefficient}
    return parse_scene(
        {
            "mesh": {"generator": "wedge", "parameters": {"nx": 4, "ny": 8, "angle": angle}},
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [{"boundary": "top", "x": 0.0}],
            "traction": [{"boundary": "top", "y": -20.0, "x": load}],
            "contact": [{"boundary": side, "friction": friction} for side in ("left", "right")],
            "solver": solver,
        }
    )


@settings(FEW, max_examples=20)
@given(
    angle=st.floats(5, 40),
    coefficient=st.sampled_from([0.0, 0.1, 0.2]),
    load=st.floats(-30, 30).map(lambda load: round(load, 6)),
    share=st.floats(-2, 2).map(lambda power: 10**power),
)
def test_a_contact_node_with_a_support_across_its_normal(angle, coefficient, load, share):
    """Its multipliers settle in the free direction, whatever gamma; penalty with a large gamma agrees."""
    ours = alone(wedge(angle, coefficient, load, algorithm="alm"))
    penalty = alone(wedge(angle, coefficient, load))
    assert np.any(ours.contact.boundary.free.sum(axis=1) == 1)
    gamma = share * 1e5 * 5000.0 / ours.discretisation.tagged.size
    again = alone(wedge(angle, coefficient, load, algorithm="alm", gamma_n=gamma, gamma_t=gamma))
    largest = ours.contact.pressure.max()
    forces = [
        contact.boundary.nodal_forces(contact.pressure, contact.shear) * contact.boundary.free
        for contact in (ours.contact, penalty.contact, again.contact)
    ]
    size = np.abs(forces[0]).max()
    np.testing.assert_allclose(forces[2], forces[0], rtol=0, atol=1e-6 * size)
    np.testing.assert_allclose(forces[1], forces[0], rtol=0, atol=2e-3 * size)
    closed = ours.contact.pressure > 1e-6 * largest
    assert np.abs((ours.contact.u_n - ours.contact.gap)[closed]).max() < 1e-6 * np.abs(ours.displacement.x.array).max()
