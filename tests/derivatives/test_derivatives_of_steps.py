"""Derivatives of results of several load steps: against statics, central differences of solves, and
other units.
"""

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import box_mesh, coulomb_friction, fixed, rectangle_mesh
from sensitivities import COMM, COULOMB, TRESCA, agrees

from signorini_fx import SceneError, sensitivity
from signorini_fx.scenes.reading import parse_scene

OF = ["force bottom x", "moment bottom step 3", "displacement 1.7,0.6 x step 2", "mean top y"]


def plane(friction, length=1.0, stress=1.0, **solver):
    """A block on a shallow bowl that is pushed to and fro, and lifted by and by: points stick,
    slip, turn back, and open.
    """
    return parse_scene(
        {
            "mesh": rectangle_mesh(12, 4, length=3.0 * length, height=length),
            "material": {"young": 5000.0 * stress, "poisson": 0.33},
            "displacement": [fixed("left", "x")],
            "traction": [
                {"boundary": "top", "y": -20.0 * stress, "factors": [1.0, 1.0, 0.9, 0.5]},
                {"boundary": "top", "x": 4.0 * stress, "factors": [0.5, 1.5, -1.5, 0.2]},
            ],
            "contact": {
                "boundary": "bottom",
                "gap": f"{0.003 / length}*(x[0]-{1.5 * length})**2",
                "friction": friction,
            },
            "solver": {
                "gamma_n": 1e7 * stress / length,
                "gamma_t": 1e7 * stress / length,
                **solver,
            },
        }
    )


def space(friction, **solver):
    """A block on a sphere that moves and turns under it."""
    return parse_scene(
        {
            "mesh": box_mesh(5, 2, 2, cell="hexahedron"),
            "material": {"young": 5000.0, "poisson": 0.33},
            "displacement": [fixed("left", "xyz")],
            "traction": [
                {"boundary": "top", "z": -20.0, "factors": [1.0, 0.8, 0.6]},
                {"boundary": "top", "x": 1.0, "y": 3.0, "factors": [0.5, 1.5, -1.0]},
            ],
            "contact": {
                "boundary": "bottom",
                "foundation": {
                    "shape": "sphere",
                    "centre": [1.4, 0.55, -100.0],
                    "radius": 100.0,
                    "shift": ["3e-4*t", 0.0, "1e-4*t"],
                    "rotation": [0.0, "1e-5*t*t", "0.002*t"],
                },
                "friction": friction,
            },
            "load_steps": {"times": [1.0, 2.0, 3.0]},
            "solver": {"gamma_n": 1e7, "gamma_t": 1e7, **solver},
        }
    )


DATA = ["contact.gap", "material.young", "traction[0]", "displacement[0].x"]
WAYS = {
    "tresca alm": (TRESCA, ["contact.friction.bound"], {"algorithm": "alm"}),
    "fixed point": (
        COULOMB,
        ["contact.friction.coefficient"],
        {"coulomb": "fp", "linear_algebra": "krylov"},
    ),
    "alm": (COULOMB, ["contact.friction.coefficient"], {"algorithm": "alm"}),
}


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("way", WAYS)
def test_in_the_plane(way):
    """Each law, with regularisation and without, at the last load step and at earlier ones."""
    friction, more, solver = WAYS[way]
    # With a given bound the node that a support pushes along slips in either direction: there the
    # force jumps.
    data = DATA[:-1] if friction is TRESCA else DATA
    found = agrees(plane(friction, **solver), OF, [*more, *data])
    steps = [step.contact for step in found[0].solution.steps]
    slips = [np.any(state.direction != 0, axis=1) for state in steps]
    met = [
        COMM.allreduce(bool(one.any()), op=MPI.LOR)
        for one in (
            slips[0] & (steps[0].shear[:, 0] * steps[2].shear[:, 0] < 0),
            steps[0].in_contact & ~steps[3].in_contact,
        )
    ]
    assert all(met), "some point turns back, and some point opens"


def test_a_block_that_has_slid_and_sticks():
    """Pulled back by very little, a block keeps the friction of the first load step, F times the
    pressing force of 8, less what the way back shears it by, which F does not change but for one
    corner that goes on slipping.
    """
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(8, 4, length=2.0),
            "material": {"young": 1000.0, "poisson": 0.0},
            "displacement": [{"boundary": "top", "x": 0.3, "factors": [1.0, 0.99999]}],
            "traction": [{"boundary": "top", "y": -4.0}],
            "contact": {"boundary": "bottom", "friction": coulomb_friction(0.25)},
        }
    )
    slides, sticks = sensitivity(
        scene, ["force bottom x step 1", "force bottom x"], ["contact.friction.coefficient"]
    )
    assert slides.value == pytest.approx(-2.0, rel=1e-9)
    assert sticks.value > slides.value + 1e-3
    assert [slides.derivatives[0], sticks.derivatives[0]] == pytest.approx([-8.0, -8.0], rel=1e-5)


@pytest.mark.slow
@pytest.mark.mpi(slow=True)
def test_moduli_and_loads_of_many_kinds():
    """Moduli that vary in the body, springs that do not follow them, heat that does, weight, and a
    load of the time.
    """
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(12, 4),
            "material": {
                "young": 5000.0,
                "poisson": 0.33,
                "grading": "1 - 0.2*x[1]",
                "expansion": 1e-4,
                "density": 2.0,
            },
            "displacement": [fixed("left", "x")],
            "springs": [{"boundary": "right", "x": 800.0, "y": 300.0}],
            "temperature": [{"change": "2*x[1]", "factors": [1.0, 2.0, 0.5]}],
            "gravity": [{"x": 0.2, "y": -1.0}],
            "traction": [
                {"boundary": "top", "y": -20.0, "factors": [1.0, 0.8, 0.6]},
                {"boundary": "top", "x": "4*sin(2*t)"},
            ],
            "contact": {"boundary": "bottom", "gap": "0.003*(x[0]-1.5)**2", "friction": TRESCA},
            "load_steps": {"times": [1.0, 2.0, 3.0]},
            "solver": {"gamma_n": 1e7, "gamma_t": 1e7},
        }
    )
    loads = ["temperature[0]", "temperature.change", "gravity.y", "traction[1]", "traction[0].y"]
    agrees(scene, OF[:3], ["material.young", "material.poisson", "springs.x", *loads])


@pytest.mark.parametrize("number", ["5", "0", "last"])
def test_no_such_step(number):
    """The load steps that there are."""
    with pytest.raises(SceneError, match="there are load steps 1 to 4"):
        sensitivity(plane(TRESCA), f"force bottom x step {number}", [])


def test_friction_of_the_time_on_a_foundation_that_moves():
    """A step has its friction coefficient, not that of the step before: where all slips, the shear
    is F(t) lambda.
    """
    found = sensitivity(space(coulomb_friction("0.02*t")), "force bottom x", [])
    for number, step in enumerate(found.solution.steps, start=1):
        state = step.contact
        slips = np.any(state.direction != 0, axis=1) & state.in_contact
        assert slips.any()
        shear = np.linalg.norm(state.shear[slips], axis=1)
        assert shear == pytest.approx(0.02 * number * state.pressure[slips], rel=1e-6)
