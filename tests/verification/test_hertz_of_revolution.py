"""Hertz's ball of revolution: contact that reaches the axis, where elements of degree 2 have a node
without a point.
"""

import numpy as np
import pytest
from scene_tables import circle_shape, coulomb_friction, fixed, floor
from scenes import alone

from signorini_fx.scenes.reading import parse_scene

DEPTH, POISSON = 1e-4, 0.3
MODULUS = 1 / (1 - POISSON**2)
FOUNDATIONS = {"plane": floor(), "ball": circle_shape([0.0, -1.0], 1.0)}


def pressed(cell, degree, share, *, on="plane", law="linear", friction=0.0):
    """A ball of radius 1 whose facets are a share of the radius of contact: its force, the radii of
    the contact points and the pressures, over Hertz's radius of contact and largest pressure at
    this force, how far the node on the axis is beyond the foundation, over the depth, and the
    solution.
    """
    curvature = 2.0 if on == "ball" else 1.0
    small = share * np.sqrt(DEPTH / curvature)
    size = {"radius": 1.0, "size": 0.1, "contact_size": small, "contact_zone": 1.6 * small / share}
    form = {"symmetric": True, "cell": cell, "order": degree}
    scene = {
        "mesh": {"generator": "half_disk", "parameters": size | form},
        "element": {"degree": degree},
        "material": {"law": law, "young": 1.0, "poisson": POISSON, "hypothesis": "axisymmetric"},
        "displacement": [fixed("symmetry", "x"), {"boundary": "top", "x": 0.0, "y": f"-{DEPTH}*t"}],
        "contact": {
            "boundary": "arc",
            "foundation": FOUNDATIONS[on],
            "friction": coulomb_friction(friction) if friction else {"law": "none"},
        },
        "load_steps": {"times": [1.0]},
        "solver": {"algorithm": "alm"},
    }
    if law == "linear":
        del scene["material"]["law"]
    solution = alone(parse_scene(scene))
    force = np.sum(solution.contact.forces, axis=0)[1]
    radius = (3 * force / 4 / MODULUS / curvature) ** (1 / 3)
    largest = 3 * force / 2 / np.pi / radius**2
    x = solution.displacement.function_space.tabulate_dof_coordinates()
    lowest = np.hypot(x[:, 0], x[:, 1]).argmin()
    beyond = -(x[lowest, 1] + solution.displacement.x.array.reshape(-1, 2)[lowest, 1]) / DEPTH
    radii = solution.contact.boundary.x[:, 0] / radius
    order = np.argsort(radii)
    return force, radii[order], solution.contact.pressure[order] / largest, beyond, solution


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cell", "on", "law"),
    [
        ("triangle", "plane", "linear"),
        ("quadrilateral", "ball", "linear"),
        ("quadrilateral", "ball", "neo-hooke"),
    ],
)
def test_pressure_near_the_axis(cell, on, law):
    """It is Hertz's to a part in 250 of the largest one, from the point beside the axis to three
    quarters of the radius of contact; the node on the axis, which no point holds, is beyond the
    foundation by no more than interpolation: the cube of the cells.
    """
    for share in (0.1, 0.05):
        _, radii, pressure, beyond, solution = pressed(cell, 2, share, on=on, law=law)
        near = radii < 0.75
        assert 0.3 * share < radii[0] < 0.6 * share
        assert pressure[near] == pytest.approx(np.sqrt(1 - radii[near] ** 2), abs=4e-3)
        assert abs(beyond) < 0.2 * share**3
        assert solution.certificate.worst < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize(("cell", "law"), [("quadrilateral", "linear"), ("triangle", "neo-hooke")])
def test_friction_near_the_axis(cell, law):
    """As of degree 1 on cells a quarter as large; friction raises the force by less than a bond
    does, which raises it by (1 - nu) ln(3 - 4 nu) / (1 - 2 nu) (D. A. Spence, 1968).
    """
    force, radii, pressure, _, _ = pressed(cell, 2, 0.1, law=law, friction=0.3)
    fine_force, fine_radii, fine_pressure, _, _ = pressed(cell, 1, 0.025, law=law, friction=0.3)
    smooth_force = pressed(cell, 2, 0.1, law=law)[0]
    assert force == pytest.approx(fine_force, rel=4e-3)
    near = radii < 0.5
    assert pressure[near] == pytest.approx(
        np.interp(radii[near], fine_radii, fine_pressure), abs=0.01
    )
    bonded = (1 - POISSON) * np.log(3 - 4 * POISSON) / (1 - 2 * POISSON)
    assert 1.0 < force / smooth_force < bonded
