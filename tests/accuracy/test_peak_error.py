"""The largest pressure to a requested accuracy: at corners in contact, near and far from them."""

import numpy as np
import pytest
from dolfinx import mesh
from mpi4py import MPI
from parameters import slow
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import alone

from signorini_fx import tag_boundaries
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.records import Status
from signorini_fx.results.accuracy.pressure_error import diverging_row
from signorini_fx.scenes.reading import parse_scene


def seat(load, angle):
    """A block of 2 x 1 on a plane, whose angles at both ends of the contact boundary are these,
    degrees.
    """
    triangles = mesh.create_rectangle(MPI.COMM_SELF, [np.zeros(2), np.array([2.0, 1.0])], [8, 4])
    x = triangles.geometry.x
    x[:, 0] += (x[:, 0] - 1) * x[:, 1] * np.tan(np.radians(angle - 90))
    tagged = tag_boundaries(triangles, {"bottom": "x[1] < 1e-9", "top": "x[1] > 1 - 1e-9"})

    def make(degree, accuracy):
        scene = parse_scene(
            {
                "mesh": rectangle_mesh(2, 2),
                "element": {"degree": degree},
                "material": {"young": 1000.0, "poisson": 0.3},
                "displacement": fixed("top", "x"),
                "traction": {"boundary": "top", "y": load},
                "contact": {"boundary": "bottom"},
                "accuracy": accuracy,
            }
        )
        return scene.model_copy(update={"mesh": tagged})

    return make


def punch(degree, accuracy):
    """A punch whose rounded edges the first meshes do not resolve, with friction."""
    friction = coulomb_friction(0.3)
    return parse_scene(
        {
            "mesh": {
                "generator": "punch",
                "parameters": {"symmetric": True, "rounding": 0.5, "order": degree},
            },
            "element": {"degree": degree},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": fixed("symmetry", "x"),
            "traction": {"boundary": "top", "pressure": 20.0},
            "contact": {
                "boundary": "foot",
                "gap": "x[1]",
                "direction": [0.0, -1.0],
                "friction": friction,
            },
            "accuracy": {key: value for key, value in accuracy.items() if key != "refinement"},
        }
    )


EVEN, TILTED = "-10", "-10*(1 + 0.6*(1 - x[0]))"
FAR, NEAR = "-0.2 - 40*exp(-(x[0] - 1)**2/0.1)", "-2 - 60*exp(-(x[0] - 0.35)**2/0.03)"
# The largest pressure on meshes of degree 2 with 66,306 unknowns, whose last change was below 1e-3,
# of the punch with cells of a fifth of the size; none: a corner of more than 90 degrees in contact,
# where the stress has no limit.
PROBLEMS = {
    "even, 90 degrees": (seat(EVEN, 90.0), 11.103),
    "tilted, 90 degrees": (seat("-10*(1 + 0.9*(1 - x[0]))", 90.0), 16.878),
    "far from corners of 90 degrees": (seat("-40*exp(-(x[0] - 1)**2/0.1)", 90.0), 18.133),
    "near a corner of 90 degrees": (seat("-2 - 60*exp(-(x[0] - 0.2)**2/0.03)", 90.0), 39.104),
    "tilted, 75 degrees": (seat("-10*(1 + 4*(1 - x[0]))", 75.0), 30.066),
    "near a corner of 60 degrees": (seat(NEAR, 60.0), 1.9656),
    "round edge": (punch, 74.49),
    "even, 120 degrees": (seat(EVEN, 120.0), None),
    "even, 105 degrees": (seat(EVEN, 105.0), None),
    "tilted, 120 degrees": (seat(TILTED, 120.0), None),
    "far from corners of 120 degrees": (seat(FAR, 120.0), None),
    "near a corner of 120 degrees": (seat(NEAR, 120.0), None),
}


@pytest.mark.one_quick(("degree", "target"), [(1, 0.05), (2, 0.01), slow(1, 0.01), slow(2, 0.05)])
@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("refinement", ["uniform", "adaptive"])
def test_corners_in_contact(name, degree, target, refinement):
    """The error of a finite pressure is below the target; without a limit none is called right,
    though the corner may have less pressure than another place on all of these meshes.
    """
    make, expected = PROBLEMS[name]
    scene = make(degree, {"target": target, "of": "peak", "refinement": refinement})
    solution = alone(scene, check=False)
    largest = solution.table.columns["pressure"].max()
    if expected is None:
        assert solution.status is Status.OUT_OF_REACH
        assert any(
            "no finite value" in event and ", 0)" in event for event in solution.history.events
        )
        assert solution.convergence_table[-2].peak is None
    else:
        assert solution.converged
        assert largest == pytest.approx(expected, rel=target)


@pytest.mark.parametrize(("kink", "grows"), [(0.1, True), (0.0, False)])
def test_a_kink_of_the_gap(kink, grows):
    """Towards it the pressure grows like a logarithm, slower than any power, and has no limit; at a
    smooth top it ends to grow.
    """
    tables = []
    for number in range(4):
        s = np.linspace(-1.0, 1.0, 20 * 2**number + 1)
        top = 1.0 + 0.3 * number if grows else 2.0 - 4.0**-number
        pressure = np.maximum(top - 3 * np.abs(s), 0.0)
        gap = kink * np.abs(s) + 0.1 * s**2
        columns = {"s": s, "x": s, "y": 0 * s, "pressure": pressure, "gap": gap}
        columns |= {"weight": np.gradient(s), "state": np.where(pressure > 0, "stick", "open")}
        tables.append(ContactTable(columns, [range(s.size)]))
    row = diverging_row(tables)
    assert (row == 80) if grows else (row is None)
