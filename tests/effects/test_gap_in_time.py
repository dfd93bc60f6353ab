"""A gap that depends on the time: each step has that of its time, also where contact alone holds
body or tool, and slips count from where these were before.
"""

import numpy as np
import pytest
from scene_tables import coulomb_friction, rectangle_mesh, tresca_friction

from signorini_fx import Scene, solve

FRICTION = coulomb_friction(0.4)
BLOCK = rectangle_mesh(8, 4, length=1.0, height=0.5)
TRACTION = [{"boundary": "top", "y": -1.0}, {"boundary": "top", "x": 0.2, "factors": [0.0, 1.0]}]


def solved(**entries):
    """The load steps of a block of E = 100, all of which have a solution."""
    solution = solve(
        Scene(**{"mesh": BLOCK, "material": {"young": 100.0, "poisson": 0.3}} | entries)
    )
    assert all(step.certificate.holds for step in solution.steps)
    return solution.steps


def forces(step):
    """Of contact and friction on the body."""
    return np.concatenate(step.contact.forces)


@pytest.mark.parametrize("gap", ["{} + 0.002*x[0]", "{}*x[0]"])
@pytest.mark.parametrize("friction", [FRICTION, tresca_friction(0.5)])
def test_body_that_contact_alone_holds(gap, friction):
    """The first step is that on a gap that stays; as the gap changes without load, the body moves
    rigidly with it.

    A direction has no size.
    """

    def block(given, times, size=1.0):
        contact = {
            "boundary": "bottom",
            "direction": [0.0, -size],
            "gap": given,
            "friction": friction,
        }
        return solved(traction=TRACTION, contact=contact, load_steps={"times": times})

    times = [0.5, 1.0]
    timed, still = block(gap.format("0.01*t"), times, 2.0), block(gap.format("0.005"), times)
    first, same = timed[0].displacement.x.array, still[0].displacement.x.array
    assert np.allclose(first, same, atol=1e-9 * np.abs(same).max())
    assert np.allclose(forces(timed[1]), forces(still[1]), atol=1e-9)
    rates = [
        step.displacement.x.array - other.displacement.x.array
        for step, other in zip(timed, still, strict=True)
    ]
    x = timed[1].displacement.function_space.tabulate_dof_coordinates()[:, :2]
    motions = np.stack(
        [np.tile([1.0, 0.0], len(x)), np.tile([0.0, 1.0], len(x)), (x[:, ::-1] * [-1, 1]).ravel()],
        axis=1,
    )
    along = np.linalg.lstsq(motions, rates[1], rcond=None)[0]
    assert np.linalg.norm(along) > 1e-3
    assert np.allclose(
        motions @ along, rates[1], atol=1e-4 * np.abs(rates[1]).max()
    )  # but for what the shear changes


@pytest.mark.parametrize(
    "driven", [{"force": [0.05, -0.5], "prescribed": {"rotation": 0.0}}, {"spring": {"x": 5.0}}]
)
def test_tools(driven):
    """A tool that forces move is as on a gap that stays, and lies farther away by as much as that
    has grown.
    """

    def pressed(given):
        circle = {"shape": "circle", "centre": [0.5, 1.5], "radius": 1.0, "pivot": [0.5, 1.5]}
        motion = {"force": [0.0, -0.5]} | driven
        contact = {
            "boundary": "top",
            "gap": given,
            "foundation": circle | motion,
            "friction": FRICTION,
        }
        support = {"boundary": "bottom", "x": 0.0, "y": 0.0, "factors": [1.0, 1.0]}
        return solved(displacement=support, contact=contact, load_steps={"times": [0.5, 1.0]})

    timed = pressed("0.01*t")
    for step, given in zip(timed, (0.005, 0.01), strict=True):
        still = pressed(given)[0]
        assert np.allclose(
            forces(step), forces(still), atol=2e-3
        )  # the second step turns what friction has carried
        assert np.allclose(
            step.rigid_bodies[0].translation, still.rigid_bodies[0].translation, atol=5e-5
        )
    still = pressed(0.005)[0]
    assert np.allclose(forces(timed[0]), forces(still), atol=1e-9)
    assert np.allclose(
        timed[0].rigid_bodies[0].translation, still.rigid_bodies[0].translation, atol=1e-9
    )


def test_supports_that_leave_a_tilted_block():
    """Where contact alone holds a block from the second step on, its slip is that since the first
    one.
    """
    support = {"boundary": "left", "x": 0.0, "y": 0.0, "holds": [True, False, False]}
    contact = {
        "boundary": "bottom",
        "direction": [0.0, -1.0],
        "gap": "0.002*x[0]",
        "friction": FRICTION,
    }
    push = {"boundary": "top", "x": 0.2, "factors": [0.0, 0.0, 1.0]}
    _, left, pushed = solved(displacement=support, traction=[TRACTION[0], push], contact=contact)
    assert np.allclose(forces(left), [0.0, 1.0, 0.0, 0.0], atol=1e-9)
    assert np.allclose(forces(pushed), [0.0, 1.0, -0.2, 0.0], atol=1e-9)
