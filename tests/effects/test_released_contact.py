"""A body with Coulomb friction whose contact is released exactly: no point presses, round-off
decides which ones touch, and the solution is that without contact.
"""

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import box_mesh, coulomb_friction, fixed, rectangle_mesh

from signorini_fx import Scene, solve

FRICTION = coulomb_friction(0.3)
BLOCK = rectangle_mesh(8, 4, length=1.0, height=0.5)
BOX = box_mesh(2, 2, 2, length=1.0, width=1.0, height=0.5)
STEEL = {"young": 100.0, "poisson": 0.3}
PRESSED = [1.0, 0.0, 1.0, 0.5, 0.0]
PUSHED = [{"boundary": "top", "x": 0.01, "factors": [0.0, 1.0, 1.0, -0.5, 0.5]}]


def cycle(up="y", **entries):
    """The load steps of a block that is pressed and released, twice."""
    press = {"boundary": "top", up: -0.01, "factors": PRESSED}
    contact = {"boundary": "bottom", "friction": FRICTION}
    displacement = [press, *entries.pop("displacement", PUSHED)]
    body = {"mesh": BLOCK, "material": STEEL, "contact": contact}
    solution = solve(Scene(**body | {"displacement": displacement} | entries))
    assert all(step.certificate.holds for step in solution.steps)
    # What may take many linear solves is not tried for what round-off alone says.
    events = map(str, solution.history.events)
    assert not any("interior point" in event for event in events)
    return solution.steps


def size(step):
    """Of the largest nodal traction, stress."""
    contact = step.contact
    largest = max(
        (np.abs(values).max(initial=0.0) for values in (contact.pressure, contact.shear)),
        default=0.0,
    )
    return MPI.COMM_WORLD.allreduce(largest, MPI.MAX)


@pytest.mark.one_quick(
    "entries",
    [
        {},
        {"displacement": [fixed("top", "x")]},
        {"element": {"degree": 2}},
        {"solver": {"algorithm": "alm"}},
        {"material": STEEL | {"hypothesis": "axisymmetric"}, "displacement": [fixed("left", "x")]},
        {"mesh": BOX, "up": "z", "displacement": [PUSHED[0] | {"y": 0.004}]},
    ],
    ids=["pushed", "pressed", "degree 2", "alm", "axisymmetric", "space"],
)
def test_nothing_is_left(entries):
    """After each release there is no traction and no strain, and pressed again it is as before."""
    pressed, released, again, _, at_end = cycle(**entries)
    assert size(pressed) > 1.0
    assert size(again) > 0.9 * size(pressed)
    for step in (released, at_end):
        assert size(step) < 1e-13 * size(pressed)
        assert step.strain_energy < 1e-20 * pressed.strain_energy


def test_what_friction_holds_stays():
    """A wedge that its friction holds stays where it is driven to, though it would be in
    equilibrium elsewhere, too.
    """
    scene = Scene(
        mesh={"generator": "wedge", "parameters": {"angle": 15.0}},
        material={"young": 210e3, "poisson": 0.3},
        force={"boundary": "top", "y": -100.0, "factors": [1.0, 0.0]},
        contact=[{"boundary": side, "friction": FRICTION} for side in ("left", "right")],
    )
    assert size(solve(scene).steps[1]) > 1.0
