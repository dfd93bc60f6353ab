"""Moduli that vary within a material: a bar, layers, a cylinder, and that a constant changes
nothing.
"""

import numpy as np
import pytest
from mpi4py import MPI
from on_meshes import nodes
from revolved import section
from scene_tables import fixed
from scenes import alone
from steel_blocks import PLANE, body

from signorini_fx import SceneError
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
YOUNG = 5000.0


@pytest.mark.mpi
@pytest.mark.one_quick("linear_algebra", ["full", "condensed", "krylov"])
@pytest.mark.parametrize(
    ("cells", "degree"), [("quadrilateral", 2), ("triangle", 1), ("hexahedra", 1)]
)
def test_graded_bar(cells, degree, linear_algebra):
    """A bar pressed on a wall: the pressure passes through it, and it shortens by the integral of p
    / E.

    Where E is constant in each cell, the integral is that of the midpoint rule; on triangles two
    halves of a column differ, and only the pressure is known so well.
    """
    if linear_algebra == "condensed" and COMM.size > 1:
        pytest.skip("condensation is for one rank")
    pressure = 3.0
    given = parse_scene(
        {
            "mesh": body(cells),
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": 0.0, "grading": "1 / (1 + 0.5*x[0])"},
            "displacement": [{"boundary": "bottom", "y" if cells in PLANE else "z": 0.0}]
            + ([] if cells in PLANE else [fixed("front", "y")]),
            "traction": {"boundary": "right", "pressure": pressure},
            "contact": {"boundary": "left"},
            "solver": {"algorithm": "alm", "linear_algebra": linear_algebra, "tolerance": 1e-12},
        }
    )
    solution = solve(given, COMM, check=False)
    assert solution.converged
    assert solution.certificate.holds
    assert solution.linear_algebra.startswith(linear_algebra)
    assert sum(force[0] for force in solution.contact.forces) == pytest.approx(pressure, rel=1e-9)
    x, y = nodes(solution)
    shortened = -y[np.isclose(x[:, 0], 2.0), 0]
    exact = (
        pressure / YOUNG * (2 + 0.25 * 4)
    )  # the midpoint rule is exact for 1 / E, which is linear
    if cells != "triangle":
        assert solution.contact.pressure == pytest.approx(pressure, rel=1e-8)
        assert shortened == pytest.approx(exact, rel=1e-8)
        assert solution.certificate.strain_energy == pytest.approx(pressure * exact / 2, rel=1e-8)
    assert shortened == pytest.approx(exact, rel=2e-2)


def cylinder(n, power, **element):
    """Error of the displacement of a long cylinder under a pressure inside, relative; E grows like
    r^power.

    C. O. Horgan and A. M. Chan, J. Elasticity 55 (1999) 43-59, with the moduli of plane strain: u
    is a sum of powers k of r with k^2 + power k + power nu' - 1 = 0.
    """
    inside, outside, pressure, nu = 1.0, 2.0, 3.0, 0.3
    ratio = nu / (1 - nu)
    given = parse_scene(
        {
            "mesh": section(inside, outside, 0.25, counts=(n, 2), comm=MPI.COMM_SELF),
            "element": element,
            "material": {
                "young": YOUNG,
                "poisson": nu,
                "hypothesis": "axisymmetric",
                "grading": lambda x: (x[0] / outside) ** power,
            },
            "displacement": [fixed(side, "y") for side in ("top", "bottom")],
            "traction": {"boundary": "inside", "pressure": pressure},
        }
    )
    solution = alone(given, check=False)
    assert solution.certificate.holds
    x, y = nodes(solution)
    r, found = x[:, 0], y[:, 0]
    k = (-power + np.array([1, -1]) * np.sqrt(power**2 + 4 - 4 * power * ratio)) / 2

    def radial(at):
        """Stress of each of the powers."""
        young = YOUNG * (at / outside) ** power / (1 - nu**2) / (1 - ratio**2)
        return young * (k + ratio) * at ** (k - 1)

    c = np.linalg.solve([radial(inside), radial(outside)], [-pressure, 0.0])
    exact = r[:, None] ** k @ c
    return np.abs(found - exact).max() / np.abs(exact).max()


def test_graded_cylinder():
    """The error is of the second order."""
    errors = [cylinder(n, 1.5) for n in (8, 16)]
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)


@pytest.mark.one_quick("cell", ["triangle", "quadrilateral"])
def test_curved_cells(cell):
    """The modulus is that in the middle of the corners, for the solver and the certificate
    alike.
    """
    mesh = {
        "generator": "half_disk",
        "parameters": {"size": 0.4, "contact_size": 0.2, "order": 2, "cell": cell},
    }
    given = parse_scene(
        {
            "mesh": mesh,
            "element": {"degree": 2},
            "material": {"young": YOUNG, "poisson": 0.3, "grading": "0.6 + 0.3*sin(5*x[0])"},
            "displacement": {"boundary": "top", "x": 0.0, "y": -1e-3},
            "contact": {"boundary": "arc"},
        }
    )
    assert solve(given, COMM).certificate.holds


@pytest.mark.parametrize("grading", ["x[0] - 0.5", "1 + x[0]", "1 / (x[0] - x[0])"])
def test_what_is_wrong(grading):
    """A modulus that is negative, or larger than the largest."""
    given = parse_scene(
        {
            "mesh": body("quadrilateral", MPI.COMM_SELF),
            "material": {"young": YOUNG, "poisson": 0.3, "grading": grading},
            "displacement": fixed("left"),
        }
    )
    with pytest.raises(SceneError) as caught:
        check_scene(given, MPI.COMM_SELF)
    ((path, message),) = caught.value.problems
    assert path == "material[0].grading"
    assert "young is the largest" in message
