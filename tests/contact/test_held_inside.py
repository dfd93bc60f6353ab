"""Contact nodes that supports hold inside their foundation: nothing is transmitted there, and the
user is told.

The reference is complementarity by hand: a minimiser over the free unknowns, in which no such node
appears.
"""

from dataclasses import replace

import numpy as np
import pytest
from certifying import certify
from scene_tables import coulomb_friction, fixed, rectangle_mesh, tresca_friction
from scenes import alone

from signorini_fx.results.certificate.contact_nodes import Tractions
from signorini_fx.scenes.reading import parse_scene

DEPTH, FORCE = 1e-3, 0.09197869954726  # of ``by_hand``, in 2D


def square(gap=-DEPTH, unit=1.0, supports=None, contact=(), friction=None, cells=8, **solver):
    """A square that is held at its top, with a foundation at its right side that overlaps with
    it.
    """
    return parse_scene(
        {
            "mesh": rectangle_mesh(cells, cells, length=unit, height=unit),
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": supports or fixed("top"),
            "contact": {
                "boundary": "right",
                "gap": gap,
                "friction": friction or {"law": "none"},
                **dict(contact),
            },
            "solver": solver,
        }
    )


def told(solution):
    """The warnings about nodes that are held inside."""
    return [found.message for found in solution.findings if "supports hold" in found.message]


@pytest.mark.parametrize(
    "solver",
    [
        {"algorithm": "alm"},
        {"gamma_n": 1e7},
        {"gamma_n": 1e9},
        {"algorithm": "path-following", "regularisation_error": 1e-5},
    ],
)
def test_the_penalty_decides_about_nothing(solver):
    """The force is that of the free nodes, whatever gamma is; the message says how many nodes, how
    deep and where.
    """
    solution = alone(square(**solver))
    assert solution.converged
    force, friction = solution.contact.forces
    assert force[0] == pytest.approx(-FORCE, rel=1e-4)
    assert not friction.any()
    held = solution.contact.points.immovable
    assert held.sum() == 1
    assert not solution.contact.pressure[held].any()
    table = solution.table.columns
    assert table["state"][np.isclose(table["y"], 1.0)] == ["open"]
    (message,) = told(solution)
    assert message.startswith(
        "supports hold 1 contact node inside the foundation, by 0.001 at (1, 1):"
    )
    assert message in str(solution.findings[0])


def test_a_pressure_at_such_a_node_is_refused():
    """Of whatever size, by the certificate, for both laws."""
    for solver in ({"algorithm": "alm"}, {"gamma_n": 1e7}):
        solution = alone(square(**solver))
        held = solution.contact.points.immovable
        tractions = Tractions.of(solution.contact)
        added = np.where(held, 1e-4 * solution.contact.pressure.max(), 0.0)
        wrong = replace(tractions, pressure=tractions.pressure + added)
        tagged = solution.model.tagged
        found = certify(
            solution.statement, tagged, solution.displacement, wrong, law=solution.certificate.law
        )
        assert found.pressure_at_distance == pytest.approx(1e-4, rel=1e-2)
        assert not found.holds


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("gap", [0.0, 1e-17, -1e-17])
def test_a_gap_that_is_closed_at_the_support_is_no_conflict(gap, unit):
    """But for round-off, in any unit of length; the load presses the body on."""
    scene = square(gap=gap * unit, unit=unit, cells=3)
    solution = alone(scene.model_copy(update={"traction": pulled("left", x=0.1)}))
    assert solution.contact.in_contact.any()
    assert not told(solution)


def pulled(boundary, **components):
    """A traction."""
    given = square(cells=1).model_dump(mode="json", exclude_none=True)
    return parse_scene(given | {"traction": [{"boundary": boundary, **components}]}).traction


@pytest.mark.parametrize("law", [coulomb_friction(0.4), tresca_friction(0.02)])
def test_friction_there_is_that_without_pressure(law):
    """Held along the normal alone: Coulomb's is zero, and Tresca's its bound."""
    supports = [fixed("top", "x"), fixed("left")]
    scene = square(supports=supports, friction=law, algorithm="alm", cells=4)
    scene = scene.model_copy(update={"traction": pulled("bottom", y=-1.0)})
    solution = alone(scene)
    held = solution.contact.points.immovable
    assert held.sum() == 1
    assert np.abs(solution.contact.shear[held]) == pytest.approx(law.get("bound", 0.0), rel=1e-9)
    assert solution.certificate.holds


@pytest.mark.parametrize(
    ("changed", "deep"),
    [
        ({}, 0.001),
        ({"gap": 0.0}, None),
        ({"gap": 0.01}, None),
        ({"gap": -0.02}, 0.02),
        (
            {
                "gap": 0.004,
                "supports": {"boundary": "top", "x": 0.005, "y": 0.0, "factors": [0.5, 1.0, 0.7]},
            },
            0.001,
        ),
        ({"gap": 0.003, "contact": {"kind": "bilateral"}}, 0.003),
        ({"supports": fixed("bottom"), "contact": {"direction": [1.0, 1.0]}}, 0.001),
        ({"supports": fixed("left")}, None),
    ],
)
def test_the_depth_is_that_of_the_deepest_load_step(changed, deep):
    """Of given gaps, load steps, bilateral contact, other directions and supports elsewhere."""
    found = told(alone(square(cells=3, **changed)))
    assert [f", by {deep:.3g} at (1, " in message for message in found] == [True] * bool(deep)
