"""Bodies in 3D that only contact and friction hold: what slides, opens or stays, and six rigid
motions.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from on_meshes import turn_by
from scenes import alone
from spaces import box, brick, disc, friction_of

from signorini_fx.records import Status

PRESS, AREA, VOLUME = 10.0, 4.0, 4.0
FRICTION = {"coulomb": {"coefficient": 0.3}, "tresca": {"bound": 3.0}}
LIMIT = 0.3 * PRESS * AREA


def pushed(law, angle, share, **more):
    """A push in a direction, in shares of the limit."""
    force = share * LIMIT / VOLUME * turn_by(angle)[:, 0]
    return alone(
        brick(law, body_force=dict(zip("xy", map(float, force), strict=True)), **more), check=False
    )


@pytest.mark.one_quick("law", FRICTION)
@pytest.mark.parametrize("angle", [0.1, 2.0, 4.4])
def test_limit_push(law, angle):
    """The limit is F N in every direction: held at 0.99 of it, *slides* at 1.01."""
    held = pushed(FRICTION[law], angle, 0.99)
    assert held.status is Status.CONVERGED
    force = held.contact.forces[1]
    assert_allclose(force[:2], -0.99 * LIMIT * turn_by(angle)[:, 0], rtol=1e-6)
    assert pushed(FRICTION[law], angle, 1.01).status is Status.SLIDES


@pytest.mark.one_quick("law", FRICTION)
def test_limit_push_on_quadratic_tetrahedra(law):
    """The same limit where contact points average."""
    more = {"mesh": box("tetrahedra", (3, 3, 2), size=(2.0, 2.0, 1.0)), "element": {"degree": 2}}
    for angle in (0.1, 2.0, 4.4):
        held = pushed(FRICTION[law], angle, 0.99, **more)
        assert held.status is Status.CONVERGED
        assert held.certificate.holds
        assert pushed(FRICTION[law], angle, 1.01, **more).status is Status.SLIDES


@pytest.mark.slow
@pytest.mark.parametrize("hertz", [False, True])
def test_limit_torque(hertz):
    """2/3 F N a under a uniform bound, 3 pi/16 F N a under that of a Hertz pressure; by the weights
    of the mesh itself to the share of the polygon, and nearly that of the smooth disc.
    """
    mesh = disc(n=16)
    bound = "3 * sqrt(max(1 - x[0]**2 - x[1]**2, 0))" if hertz else 3.0

    def turned(torque):
        # A traction q r about the axis on top has the torque q I with I = integral of r^2.
        twist = torque / inertia
        law = {"law": "tresca", "bound": bound}
        effects = [{"boundary": "top", "x": f"{-twist} * x[1]", "y": f"{twist} * x[0]"}]
        press = {"boundary": "top", "pressure": PRESS}
        contact = {"boundary": "bottom", "friction": law}
        return alone(brick({}, mesh=mesh, traction=[press, *effects], contact=contact), check=False)

    inertia = 1.0
    weighted = turned(0.0).contact.boundary
    r, given = np.hypot(*weighted.x[:, :2].T), 3.0
    if hertz:
        given = 3.0 * np.sqrt(np.maximum(1 - r**2, 0.0))
    limit = float(np.dot(weighted.weight, r * given))
    smooth = 3.0 * np.pi * (np.pi / 8 if hertz else 2 / 3)  # integral of bound r over the disc
    assert limit == pytest.approx(smooth, rel=0.06 if hertz else 0.002)
    # The traction is integrated exactly on the mesh: its torque for twist = 1 is what the contact
    # takes up.
    inertia = float(torque_of(turned(0.01)) / 0.01)
    held = turned(0.99 * limit)
    assert held.status is Status.CONVERGED
    assert torque_of(held) == pytest.approx(0.99 * limit, rel=1e-6)
    assert turned(1.01 * limit).status is Status.SLIDES


@pytest.mark.parametrize("law", FRICTION)
def test_the_limit_is_that_of_the_disc(law):
    """No polygon replaces the disc of the shear: one part in 10,000 below the limit holds, one
    above slides.
    """
    middle = np.pi / 32
    held = pushed(FRICTION[law], middle, 0.9999)
    assert held.status is Status.CONVERGED
    over = pushed(FRICTION[law], middle, 1.0001)
    assert over.status is Status.SLIDES
    assert over.history.linear_solves == 0


def torque_of(solution):
    """What friction takes up about the axis x[2]."""
    columns = solution.table.columns
    arm = columns["x"] * columns["shear_y"] - columns["y"] * columns["shear_x"]
    return float(np.dot(columns["weight"], arm))


@pytest.mark.parametrize(
    ("law", "press", "status"),
    [
        ({}, PRESS, Status.NOT_HELD),
        ({"coefficient": 0.3}, -PRESS, Status.OPEN),
        ({"coefficient": 0.3}, 0.0, Status.NOT_HELD),
        ({"bound": 3.0}, PRESS, Status.CONVERGED),
    ],
)
def test_held_or_not(law, press, status):
    """Three translations and three rotations; contact takes one and two of them, friction the
    rest.
    """
    assert alone(brick(law, press=press), check=False).status is status


def test_reference_motion():
    """A brick that drops on a foundation that is tilted against it comes to rest on it; the results
    are those of one that lies there, but for the motion.
    """
    law = {"coefficient": 0.5}
    contact = {"boundary": "bottom", "friction": friction_of(**law)}
    lying = alone(brick(law))
    dropped = alone(brick(law, contact={**contact, "gap": "0.02 + 0.01 * x[0] + 0.005 * x[1]"}))
    assert dropped.converged
    one, other = (solution.table.columns["pressure"] for solution in (lying, dropped))
    assert_allclose(other, one, rtol=0, atol=2e-2 * one.max())
    assert_allclose(sum(dropped.contact.forces)[2], PRESS * AREA, rtol=1e-9)
    u_n = dropped.table.columns["u_n"] - dropped.table.columns["gap"]
    assert np.abs(u_n).max() < 1e-5
