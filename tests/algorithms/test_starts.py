"""Where Coulomb friction starts: bodies that nothing touches yet, and bodies that need friction
although walls hold.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import alone, bar_on_a_bowl

from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

RADIUS, ARM = 1.0, 4.0  # of the pin, and of the load at the end of the lug


def lug(slope, friction=0.3, **solver):
    """A plate with a hole that a pin with clearance holds, pulled at its end; nothing else holds
    it.
    """
    return parse_scene(
        {
            "mesh": {
                "generator": "plate_with_hole",
                "parameters": {"contact_size": 0.2, "size": 0.8},
            },
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": [{"boundary": "right", "x": 1.0, "y": slope}],
            "contact": {"boundary": "hole", "gap": 0.02, "friction": coulomb_friction(friction)},
            "solver": solver,
        }
    )


@pytest.mark.parametrize("law", ["coulomb", "tresca"])
def test_slip_counts_from_where_the_body_was(law):
    """Of a body that only contact holds, which turns to its reference motion first; the start makes
    no difference.
    """

    tables = []
    for start in ("all", "auto"):
        solution = alone(bar_on_a_bowl(80, law, start))
        assert solution.converged
        tables.append(solution.table.columns)
    for names, tolerance in ((("pressure", "shear"), 1e-6), (("u_n", "u_t"), 1e-9)):
        size = max(np.abs(tables[0][name]).max() for name in names)
        for name in names:
            assert_allclose(tables[1][name], tables[0][name], rtol=0, atol=tolerance * size)


def friction_circle(friction):
    """The largest distance from the middle of the pin at which a load passes that friction at one
    point can hold.
    """
    return RADIUS * np.sin(np.arctan(friction))


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("method", [{}, {"coulomb": "newton"}, {"algorithm": "alm"}])
def test_a_lug_on_a_pin_with_clearance(method):
    """Nothing touches at first, and normals do not hold it: friction must, where the lug comes to
    touch the pin.
    """
    slope = 0.06
    assert ARM * slope / np.hypot(1, slope) < friction_circle(0.3)
    solution = solve(lug(slope, **method))
    normal, tangential = solution.contact.forces
    assert_allclose(normal + tangential, [-4.0, -4.0 * slope], atol=1e-6)
    touching = solution.table.columns["pressure"] > 0
    assert 0 < np.count_nonzero(touching) < touching.size / 4


@pytest.mark.parametrize("walls", [("bottom", "left"), ("bottom", "left", "right")])
def test_a_block_that_friction_keeps_in_its_corner(walls):
    """Pushed off a wall, it would open without friction: the start is not the problem without
    it.
    """
    contacts = [{"boundary": wall, "friction": coulomb_friction(0.3)} for wall in walls]
    if len(walls) > 2:
        contacts[2]["gap"] = 1.0
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(9, 3),
            "material": {"young": 5000.0, "poisson": 0.3},
            "traction": [{"boundary": "top", "x": 3.0, "y": -20.0}],
            "contact": contacts,
        }
    )
    solution = alone(scene)
    normal, tangential = solution.contact.forces
    assert_allclose(normal + tangential, [-9.0, 60.0], atol=1e-6)


@pytest.mark.parametrize("distance", [1e4, 1e5, 1e6, 1e7])
def test_a_foundation_far_away_costs_no_digits(distance):
    """The first solve reaches for the foundation, and the next one comes back with round-off of
    that displacement.
    """
    scene = {
        "mesh": rectangle_mesh(4, 4, length=1.0, height=1.0),
        "material": {"young": 1.0, "poisson": 0.3, "hypothesis": "plane stress"},
        "displacement": [fixed("left", "x"), fixed("top", "y")],
        "traction": {"boundary": "right", "x": 1e-2},
        "contact": {"boundary": "bottom", "gap": distance * 1e-2, "friction": {"law": "none"}},
        "solver": {"initial_contact": "all"},
    }
    solution = solve(parse_scene(scene))
    assert solution.certificate.holds
    assert solution.table.columns["u_n"] == pytest.approx(
        -3e-3, rel=1e-9
    )  # poisson * traction / young


@pytest.mark.parametrize("law", [{}, {"law": "neo-hooke"}], ids=["linear", "neo-hooke"])
def test_a_tool_that_has_not_arrived_adheres_to_nothing(law):
    """Friction with cohesion needs contact: under a curved tool that comes nearer, nothing acts and
    nothing moves.
    """
    circle = {
        "shape": "circle",
        "centre": [1.0, 1.335],
        "radius": 0.3,
        "shift": ["0.01*t", "-0.02*t"],
    }
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(4, 2, length=2.0, height=1.0),
            "material": {"young": 1.0, "poisson": 0.3, **law},
            "displacement": fixed("bottom"),
            "contact": {
                "boundary": "top",
                "friction": {"law": "coulomb", "coefficient": 0.2, "cohesion": 0.005},
                "foundation": circle,
            },
            "load_steps": {"times": [0.5, 1.0]},
        }
    )
    solution = alone(scene)
    assert solution.converged
    assert len(solution.steps) == 2
    assert not any(step.displacement.x.array.any() for step in solution.steps)
