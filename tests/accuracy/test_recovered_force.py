"""The error of contact forces that one mesh tells: true errors, what statics determines, and where it is not known."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone

from signorini_fx.records import History
from signorini_fx.results.accuracy.force_error import force_error
from signorini_fx.results.accuracy.recovered_force import force_by_recovery
from signorini_fx.scenes.mesh_sequence import meshed_scene
from signorini_fx.scenes.reading import parse_scene

RADIUS, WIDE = 5.0, 1.0


def block(**more):
    """A block whose top is pressed down onto a bowl."""
    sizes = {"length": 2.0, "width": 1.0, "height": 1.0, "nx": 4, "ny": 2, "nz": 2, "cell": "tetrahedron"}
    scene = {
        "mesh": {"generator": "box", "parameters": sizes},
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.0, "y": 0.0, "z": -0.02},
        "contact": {"boundary": "bottom", "gap": "0.01*(x[0] - 0.7)**2 + 0.02*(x[1] - 0.5)**2"},
    }
    return parse_scene(scene | more)


def ball(degree, size):
    """A quarter of half a ball that is pressed onto a plane."""
    parameters = {"part": "quarter", "radius": RADIUS, "size": 1.5 * max(size, 0.5), "order": degree}
    sizes = {"contact_size": WIDE / 3 * size, "contact_zone": 1.4 * WIDE}
    return parse_scene(
        {
            "mesh": {"generator": "half_sphere", "parameters": parameters | sizes},
            "element": {"degree": degree},
            "material": {"young": 200.0, "poisson": 0.3},
            "displacement": [
                {"boundary": "symmetry_x", "x": 0.0},
                {"boundary": "symmetry_y", "y": 0.0},
                {"boundary": "top", "z": -(WIDE**2) / RADIUS},
            ],
            "contact": {"boundary": "sphere", "gap": "x[2]", "direction": [0.0, 0.0, -1.0]},
        }
    )


def told(scene):
    """The solution on its mesh, and the error of the force."""
    solved = meshed_scene(scene, MPI.COMM_SELF, History()).solved(0, None, None)
    contact = solved.solution.contact
    return solved, force_by_recovery(solved.solution.model, solved.task, solved.outcome, contact, 0.0)


@pytest.mark.parametrize("size", [1.0, 0.7])
def test_the_error_that_one_mesh_tells(size):
    """Against curved elements of degree 2 on cells of this size, whose force is far more accurate."""
    solved, error = told(ball(1, size))
    reference = alone(ball(2, 1.0)).contact.forces_of_each
    true = np.linalg.norm(solved.solution.contact.forces_of_each - reference) / np.linalg.norm(reference)
    level = replace(solved.level, recovered_force=error)
    assert force_error([level, level], uniform=False) == error + level.data
    assert true < error < 2 * true


def test_between_two_bodies():
    """Unknowns are those that contact reaches there, from which the displacement follows."""
    upper = {"generator": "box", "parameters": {"length": 1.0, "width": 1.0, "height": 0.5, "nx": 4, "ny": 4, "nz": 2}}
    scene = parse_scene(
        {
            "body": [{"name": "upper", "mesh": upper, "shift": [0.0, 0.0, 0.5]}, {"name": "lower", "mesh": upper}],
            "material": {"young": 1000.0, "poisson": 0.0},
            "displacement": [
                {"boundary": "upper.top", "z": -0.01},
                {"boundary": "lower.bottom", "z": 0.0},
                *(
                    {"boundary": f"{name}.{side}", "normal": 0.0}
                    for name in ("upper", "lower")
                    for side in ("left", "front")
                ),
            ],
            "contact": {"boundary": "upper.bottom", "against": "lower.top"},
        }
    )
    # The strain is the same everywhere, and so is that on which the force depends.
    solved, error = told(scene)
    assert np.linalg.norm(solved.solution.contact.forces_of_each) == pytest.approx(1000.0 * 0.01, rel=1e-4)
    assert error < 1e-6


def test_what_statics_determines():
    """The force of a block that is loaded, and held aside alone, has no error."""
    aside = [{"boundary": "left", "x": 0.0}, {"boundary": "front", "y": 0.0}]
    _, error = told(block(displacement=aside, traction={"boundary": "top", "z": -3.0}))
    assert error < 1e-6


def test_where_it_is_not_known():
    """The error of friction is across the force, and without contact there is none."""
    friction = {"law": "coulomb", "coefficient": 0.3}
    held = block(contact={"boundary": "bottom", "friction": {"law": "tresca", "bound": 1.0}})
    assert told(held)[1] is None
    pressed = block()
    contact = [one.model_copy(update={"gap": 1.0}) for one in pressed.contact]
    assert told(pressed.model_copy(update={"contact": tuple(contact)}))[1] is None
    rough = block(contact={"boundary": "bottom", "friction": friction}, solver={"coulomb": "newton"})
    assert told(rough)[1] is None
