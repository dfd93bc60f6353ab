"""A block between two others: whether it is pressed, squeezed or loose follows from how far the
upper one is lifted.
"""

import numpy as np
import pytest
from scene_tables import coulomb_friction, fixed, rectangle_mesh, tresca_friction
from scenes import alone, stack_of_three

from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene

COULOMB, TRESCA = coulomb_friction(0.5), tresca_friction(1.0)


def forces(solution):
    """The forces across the contacts, along y."""
    state = solution.contact
    total = state.boundary.weight * state.pressure
    part = state.boundary.part
    return np.array([total[part == k].sum() for k in (0, 1)])


@pytest.mark.one_quick(
    ("below", "above", "solver"),
    [
        (COULOMB, COULOMB, {}),
        (COULOMB, COULOMB, {"algorithm": "alm"}),
        (TRESCA, COULOMB, {"algorithm": "alm", "fallbacks": False}),
        (TRESCA, TRESCA, {"algorithm": "alm", "fallbacks": False}),
    ],
)
def test_lifted(below, above, solver):
    """The middle block has room; the outcome names it, and no other one.

    By round-off an iteration may end at one of the many positions without forces, with dolfinx 0.11
    the first one.
    """
    solution = alone(stack_of_three(0.02, below, above, **solver), check=False)
    if solution.converged:
        np.testing.assert_allclose(forces(solution), 0.0, atol=1e-9)
        return
    assert solution.status is Status.NOT_HELD
    assert "nothing presses on body 'middle'" in solution.advice
    assert "body 'lower'" not in solution.advice
    assert "body 'upper'" not in solution.advice


@pytest.mark.parametrize(
    ("gap", "size", "stress"), [(0.5, 1.0, 1.0), (0.02, 1e-6, 1e9), (0.02, 1e5, 1e-3)]
)
def test_nothing_moves(gap, size, stress):
    """Nothing is loaded or moved, and the block has room: that is found wherever the methods have
    left the body.
    """
    solution = alone(stack_of_three(0.0, COULOMB, COULOMB, gap, size, stress), check=False)
    assert solution.status is Status.NOT_HELD
    assert "body 'middle'" in solution.advice
    assert (
        sum(step.linear_solves for step in solution.steps) < 500
    )  # how soon is a matter of round-off


@pytest.mark.one_quick(
    ("lift", "gap", "size", "stress"),
    [(-0.02, 0.0, 1.0, 1.0), (0.02, -0.03, 1e-6, 1e9), (-0.01, -0.01, 1e5, 1e-3)],
)
def test_pressed_or_squeezed(lift, gap, size, stress):
    """Where the blocks overlap by more than the upper one is lifted, both contacts carry the same
    force.
    """
    below, above = forces(alone(stack_of_three(lift, TRESCA, COULOMB, gap, size, stress)))
    assert below == pytest.approx(above, rel=1e-6)
    assert below / (size * stress) > 0.1


def unloaded(friction, factors, check=True):
    """A block alone that is pressed on, and then is not: its solution."""
    contact = {"boundary": "bottom"} | ({} if friction is None else {"friction": friction})
    scene = {
        "mesh": rectangle_mesh(4, 4, length=1.0, height=1.0),
        "material": {"young": 100.0, "poisson": 0.3},
        "displacement": [] if friction else [fixed("left", "x")],
        "traction": [{"boundary": "top", "y": -1.0, "factors": factors}],
        "contact": [contact],
    }
    return alone(parse_scene(scene), check=check)


@pytest.mark.parametrize("friction", [None, COULOMB, COULOMB | {"cohesion": 0.1}])
def test_unloaded_between_two_loads(friction):
    """It stays where it was, and is pressed on again as before."""
    solution = unloaded(friction, [1.0, 0.0, 1.0])
    assert not solution.steps[1].contact.pressure.any()
    first, last = (solution.steps[k].displacement.x.array for k in (0, 2))
    np.testing.assert_allclose(last, first, rtol=0, atol=1e-3 * np.abs(first).max())
