"""The augmented Lagrangian method ends at the unregularised solution, whatever gamma it begins
with.
"""

import numpy as np
import pytest
from scene_tables import box_mesh, coulomb_friction, fixed, rectangle_mesh
from scenes import alone, example1

from signorini_fx.scenes.reading import parse_scene

FORCE = 5.704914


def pushed(**solver):
    """A coarse block pushed sideways on a foundation with a kink: its pressure is nearly settled by
    statics.
    """
    return parse_scene(
        {
            "mesh": rectangle_mesh(8, 4),
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [fixed(side, "x") for side in ("left", "right")],
            "traction": {"boundary": "top", "y": -20.0, "x": 10.0},
            "contact": {
                "boundary": "bottom",
                "gap": "abs(x[0] - 1.5)",
                "friction": coulomb_friction(1.0),
            },
            "solver": solver,
        }
    )


@pytest.mark.one_quick("coulomb", ["fp", "newton"])
@pytest.mark.parametrize(
    "gamma", [(1e5, 1e4), (1e6, 1e2), (1e2, 1e6), (1e-3, 1e-3), (1e13, 1e13), (1e13, 1.0)]
)
def test_shear_settles_as_well_as_pressure(gamma, coulomb):
    """The friction force is that of the limit, though the pressure alone settles at once."""
    ours = alone(pushed(algorithm="alm", coulomb=coulomb, gamma_n=gamma[0], gamma_t=gamma[1]))
    assert not ours.certificate.law.regularised
    assert ours.contact.forces[1][0] == pytest.approx(FORCE, rel=1e-6)


# --- how it is judged -----------------------------------------------------------------------------


@pytest.mark.parametrize("gamma", [1e4, 1e7])
def test_the_fixed_point_needs_no_help(gamma):
    """(ALM-FP) by itself ends at the limit of the natural gamma, in shear too."""
    scene = example1(coefficient=0.3, nx=12, ny=4)
    limit = alone(example1(coefficient=0.3, nx=12, ny=4, algorithm="alm", tolerance=1e-12))
    settings = {
        "algorithm": "alm",
        "coulomb": "fp",
        "fallbacks": False,
        "gamma_n": gamma,
        "gamma_t": gamma,
    }
    ours = alone(scene.model_copy(update={"solver": scene.solver.model_copy(update=settings)}))
    assert not any("from the same start" in event for event in ours.history.events)
    largest = limit.contact.pressure.max()
    np.testing.assert_allclose(ours.contact.shear, limit.contact.shear, rtol=0, atol=5e-7 * largest)


def in_space(walls=("bottom",), supports=(), **solver):
    """A block that is pressed, and pushed towards its left side and away from its front side, in
    two load steps.
    """
    size = {"length": 1.5, "width": 1.2, "height": 1.0, "nx": 4, "ny": 3, "nz": 3}
    friction = coulomb_friction(0.283)
    return parse_scene(
        {
            "mesh": box_mesh(**size),
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": list(supports),
            "traction": {
                "boundary": "top",
                "x": -2.37,
                "y": 2.0,
                "z": -10.0,
                "factors": [0.3, 1.0],
            },
            "contact": [{"boundary": wall, "friction": friction} for wall in walls],
            "solver": solver,
        }
    )


def test_shear_along_a_wall_that_prescribes_the_slip():
    """A node beside a wall slips by little: the shear across the wall, which does nothing, has its
    limit.
    """
    supports = [{"boundary": "left", "normal": 0.001}, {"boundary": "front", "normal": 0.0}]
    solution = alone(
        in_space(supports=supports, algorithm="alm", gamma_n=1e7, gamma_t=1e4, tolerance=1e-10)
    )
    assert solution.converged
    assert solution.certificate.holds
    assert max(step.linear_solves for step in solution.steps) <= 30


@pytest.mark.parametrize("coulomb", ["fp", "newton"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_node_that_a_support_drags_along_the_foundation(dimension, coulomb):
    """However small gamma_t is, the shear of a node whose slip is prescribed has its limit at
    once.
    """
    sizes = {"length": 1.5, "height": 1.0, "nx": 4, "ny": 3}
    mesh = {2: {"generator": "rectangle"}, 3: {"generator": "box"}}[dimension]
    up = "y" if dimension == 2 else "z"
    solution = alone(
        parse_scene(
            {
                "mesh": {
                    **mesh,
                    "parameters": sizes if dimension == 2 else {**sizes, "width": 1.2, "nz": 3},
                },
                "material": {"young": 1000.0, "poisson": 0.3},
                "displacement": [
                    {"boundary": "left", "x": 0.002, **({} if dimension == 2 else {"y": 0.001})},
                    {"boundary": "top", up: -0.01},
                ],
                "contact": {"boundary": "bottom", "friction": coulomb_friction(0.3)},
                "solver": {"algorithm": "alm", "coulomb": coulomb, "gamma_n": 1e8, "gamma_t": 1e5},
            }
        )
    )
    contact = solution.contact
    dragged = np.trace(contact.points.still, axis1=1, axis2=2) > dimension - 1.5
    assert dragged.sum() == {2: 1, 3: 4}[dimension]
    assert solution.certificate.holds
    assert contact.pressure[dragged].min() > 0
    np.testing.assert_allclose(
        np.linalg.norm(contact.shear, axis=1)[dragged], 0.3 * contact.pressure[dragged]
    )
    assert solution.history.linear_solves <= 30


def test_round_off_of_a_direction_is_no_stiffness():
    """A corner is held across the contact direction, but for its round-off: gamma grows as without."""

    def ended(along):
        return alone(
            parse_scene(
                {
                    "mesh": rectangle_mesh(8, 4),
                    "material": {"young": 100.0, "poisson": 0.3},
                    "displacement": fixed("left", "x"),
                    "traction": {"boundary": "top", "y": -2.0},
                    "contact": {
                        "boundary": "bottom",
                        "direction": [along, -1.0],
                        "friction": coulomb_friction(0.3),
                    },
                    "solver": {"algorithm": "alm", "gamma_n": 1e3, "gamma_t": 1e3},
                }
            )
        )

    assert ended(1e-10).parameters == pytest.approx(ended(0.0).parameters)
