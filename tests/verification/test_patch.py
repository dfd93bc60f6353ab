"""Patch tests: states of constant stress on a flat foundation, which every element must hold exactly.

The regularisation is part of the exact solution: the body sinks in by lambda / gamma_1 and creeps by mu / gamma_2.
"""

import numpy as np
import pytest
from scenes import alone, table_of

from signorini_fx.scene.reading import parse_scene

E, NU, P = 200.0, 0.3, 5.0
GAMMA_N, GAMMA_T = 4e5, 3e5
SHEAR_MODULUS = E / (2 * (1 + NU))
COMPRESSION = P * (1 + NU) * (1 - 2 * NU) / (E * (1 - NU))  # -du_2/dx_2 where the body cannot widen
SIDEWAYS = NU / (1 - NU) * P  # -sigma_11 there
ELEMENTS = {
    "Q1": ("quadrilateral", 1, "structured"),
    "P1": ("triangle", 1, "structured"),
    "Q2": ("quadrilateral", 2, "structured"),
    "P2": ("triangle", 2, "structured"),
    "Q1 unstructured": ("quadrilateral", 1, "unstructured"),
    "P2 unstructured": ("triangle", 2, "unstructured"),
}
LAWS = {
    "none": {"law": "none"},
    "tresca": {"law": "tresca", "bound": 2.0},
    "coulomb": {"law": "coulomb", "coefficient": 0.4},
}


@pytest.fixture(params=ELEMENTS)
def element(request):
    """A kind of mesh and a degree."""
    return ELEMENTS[request.param]


def block(element, law, **effects):
    """A block 2 x 1 on the flat foundation x[1] = 0."""
    cell, degree, layout = element
    size = {"length": 2.0, "height": 1.0, "nx": 8, "ny": 4, "cell": cell, "layout": layout}
    return parse_scene(
        {
            "mesh": {"generator": "block", "parameters": size},
            "element": {"degree": degree},
            "material": {"young": E, "poisson": NU},
            "contact": {"boundary": "bottom", "friction": law},
            "solver": {"gamma_n": GAMMA_N, "gamma_t": GAMMA_T, "tolerance": 1e-12},
            **effects,
        }
    )


def holds(scene, u, pressure, shear):
    """The displacement is ``u(x, y)``, pressure and shear are constant, to round-off."""
    solution = alone(scene)
    x = solution.discretisation.space.tabulate_dof_coordinates()
    exact = np.column_stack(np.broadcast_arrays(*u(x[:, 0], x[:, 1])))
    found = solution.displacement.x.array.reshape(-1, 2)
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-11 * np.abs(exact).max())
    table = table_of(solution).columns
    np.testing.assert_allclose(table["pressure"], pressure, rtol=1e-8)
    np.testing.assert_allclose(table["shear"], shear, rtol=1e-8, atol=1e-8)
    return set(table["state"])


def test_compression_between_free_sides(element):
    """(a) Pressure on top, frictionless: uniaxial stress, held sideways at the left only."""
    scene = block(
        element,
        LAWS["none"],
        displacement={"boundary": "left", "x": 0.0},
        traction={"boundary": "top", "y": -P},
    )
    widening, shortening = P * NU * (1 + NU) / E, P * (1 - NU**2) / E
    holds(scene, lambda x, y: (widening * x, -shortening * y - P / GAMMA_N), P, 0.0)


@pytest.mark.parametrize("law", LAWS)
def test_compression_between_fixed_sides(element, law):
    """(b) Pressure on top between smooth walls: no shear, with any friction law."""
    scene = block(
        element,
        LAWS[law],
        displacement=[{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}],
        traction={"boundary": "top", "y": -P},
    )
    holds(scene, lambda x, y: (0.0, -COMPRESSION * y - P / GAMMA_N), P, 0.0)


def sheared(shear):
    """Tractions on top and sides of the constant state sigma_12 = shear, sigma_22 = -P, no widening."""
    return [
        {"boundary": "left", "x": SIDEWAYS, "y": -shear},
        {"boundary": "right", "x": -SIDEWAYS, "y": shear},
        {"boundary": "top", "x": shear, "y": -P},
    ]


@pytest.mark.parametrize("law", ["tresca", "coulomb"])
@pytest.mark.parametrize("shear", [1.9, -1.9])
def test_stick(element, law, shear):
    """(c) Shear below the bound of 2: everything sticks; nothing but friction holds the body sideways."""
    scene = block(element, LAWS[law], traction=sheared(shear))
    states = holds(
        scene,
        lambda x, y: (shear * y / SHEAR_MODULUS + shear / GAMMA_T, -COMPRESSION * y - P / GAMMA_N),
        P,
        shear,
    )
    assert states == {"stick"}


@pytest.mark.parametrize("law", ["tresca", "coulomb"])
@pytest.mark.parametrize("sign", [1, -1])
def test_slip(element, law, sign):
    """(d) The top is moved further than friction can hold: everything slips with the shear at its bound of 2."""
    shear, moved = 2.0 * sign, 0.1 * sign
    left, right, _ = sheared(shear)
    scene = block(
        element,
        LAWS[law],
        displacement={"boundary": "top", "x": moved, "y": -COMPRESSION - P / GAMMA_N},
        traction=[left, right],
    )
    states = holds(
        scene,
        lambda x, y: (moved - shear * (1 - y) / SHEAR_MODULUS, -COMPRESSION * y - P / GAMMA_N),
        P,
        shear,
    )
    assert states == {"slip+" if sign > 0 else "slip-"}


def test_gravity(element):
    """A body force presses the block down by its weight; the displacement is quadratic, exact for degree 2."""
    weight = 3.0
    scene = block(
        element,
        LAWS["none"],
        displacement=[{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}],
        body_force={"y": -weight},
    )
    stiffness = P / COMPRESSION
    if scene.element.degree == 2:
        holds(
            scene,
            lambda x, y: (0.0, -weight * (y - y**2 / 2) / stiffness - weight / GAMMA_N),
            weight,
            0.0,
        )
    else:
        contact, _ = alone(scene).contact.forces
        np.testing.assert_allclose(contact, [0.0, 2.0 * weight], atol=1e-9)
