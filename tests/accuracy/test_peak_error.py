"""The largest pressure to a requested accuracy: at corners in contact, near and far from them; and its estimate."""

import numpy as np
import pytest
from dolfinx import mesh
from mpi4py import MPI

from signorini_fx import solve, tag_boundaries
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.records import Status
from signorini_fx.results.accuracy.peak_error import diverging_row, peak_error
from signorini_fx.scenes.reading import parse_scene


def seat(load, angle):
    """A block of 2 x 1 on a plane, whose angles at both ends of the contact boundary are these, degrees."""
    triangles = mesh.create_rectangle(MPI.COMM_SELF, [np.zeros(2), np.array([2.0, 1.0])], [8, 4])
    x = triangles.geometry.x
    x[:, 0] += (x[:, 0] - 1) * x[:, 1] * np.tan(np.radians(angle - 90))
    tagged = tag_boundaries(triangles, {"bottom": "x[1] < 1e-9", "top": "x[1] > 1 - 1e-9"})

    def make(degree, accuracy):
        scene = parse_scene(
            {
                "mesh": {"generator": "rectangle", "parameters": {"nx": 2, "ny": 2}},
                "element": {"degree": degree},
                "material": {"young": 1000.0, "poisson": 0.3},
                "displacement": {"boundary": "top", "x": 0.0},
                "traction": {"boundary": "top", "y": load},
                "contact": {"boundary": "bottom"},
                "accuracy": accuracy,
            }
        )
        return scene.model_copy(update={"mesh": tagged})

    return make


def punch(degree, accuracy):
    """A punch whose rounded edges the first meshes do not resolve, with friction."""
    friction = {"law": "coulomb", "coefficient": 0.3}
    return parse_scene(
        {
            "mesh": {"generator": "punch", "parameters": {"symmetric": True, "rounding": 0.5, "order": degree}},
            "element": {"degree": degree},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "symmetry", "x": 0.0},
            "traction": {"boundary": "top", "pressure": 20.0},
            "contact": {"boundary": "foot", "gap": "x[1]", "direction": [0.0, -1.0], "friction": friction},
            "accuracy": {key: value for key, value in accuracy.items() if key != "refinement"},
        }
    )


EVEN, TILTED = "-10", "-10*(1 + 0.6*(1 - x[0]))"
FAR, NEAR = "-0.2 - 40*exp(-(x[0] - 1)**2/0.1)", "-2 - 60*exp(-(x[0] - 0.35)**2/0.03)"
# The largest pressure on meshes of degree 2 with 66,306 unknowns, whose last change was below 1e-3, of the punch with
# cells of a fifth of the size; none: a corner of more than 90 degrees in contact, where the stress has no limit.
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


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("degree", "target"),
    [
        (1, 0.05),
        (2, 0.01),
        pytest.param(1, 0.01, marks=pytest.mark.slow),
        pytest.param(2, 0.05, marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("refinement", ["uniform", "adaptive"])
def test_corners_in_contact(name, degree, target, refinement):
    """The error of a finite pressure is below the target; without a limit none is called right, though the corner may
    have less pressure than another place on all of these meshes.
    """
    make, expected = PROBLEMS[name]
    scene = make(degree, {"target": target, "of": "peak", "refinement": refinement})
    solution = solve(scene, MPI.COMM_SELF, check=False)
    largest = solution.table.columns["pressure"].max()
    if expected is None:
        assert solution.status is Status.OUT_OF_REACH
        assert any("no finite value" in event and ", 0)" in event for event in solution.history.events)
        assert solution.convergence_table[-2].peak is None
    else:
        assert solution.converged
        assert largest == pytest.approx(expected, rel=target)


def curve(pressure, spacing=1.0, turn=0.0):
    """A boundary with these pressures, which turns by an angle at its third node."""
    pressure = np.asarray(pressure, dtype=float)
    s = spacing * np.arange(len(pressure))
    beyond = np.maximum(s - s[2], 0.0)
    columns = {"x": s - beyond * (1 - np.cos(turn)), "y": beyond * np.sin(turn), "s": s, "pressure": pressure}
    columns["state"] = np.where(pressure > 0, "slip+", "open")
    columns["boundary"] = np.full(len(s), "bottom")
    return ContactTable(columns, [range(len(s))])


def hertz(count, top=1.0):
    """With the pressure of Hertz, and its spacing."""
    x = np.arange(-count - 2, count + 3)
    return curve(top * np.sqrt(np.maximum(1 - (x / count) ** 2, 0.0)), 1 / count)


def test_an_error_that_falls_with_the_rate():
    tables = [hertz(count, 1 + 0.1 / count**1.5) for count in (8, 16, 32)]
    assert peak_error(tables) == pytest.approx(0.1 / 32**1.5, rel=0.3)


def test_an_error_that_falls_more_slowly():
    tables = [hertz(count, 1 + 0.1 / count) for count in (8, 16, 32)]
    assert peak_error(tables) == pytest.approx(0.1 / 32, rel=0.1)


def test_a_change_that_is_small_by_chance():
    """The change before counts."""
    assert peak_error([hertz(8, 1.1), hertz(16), hertz(32)]) > 0.1 / (4**1.5 - 1) * 0.99


def test_meshes_that_are_alike_at_the_peak_say_nothing():
    """Nor do meshes with few nodes in contact, or without any."""
    assert peak_error([hertz(16, 1.1), hertz(16)]) is None
    assert peak_error([hertz(8, 1.1), hertz(16, 1.1), hertz(16)]) == peak_error([hertz(8, 1.1), hertz(16)])
    assert peak_error([hertz(1, 1.1), hertz(3)]) is None
    nothing = curve(np.zeros(20))
    assert peak_error([nothing, nothing]) is None
    assert diverging_row([nothing, nothing, nothing]) is None


def growing(powers, turns=(0.0, 0.0, 0.0), row=0):
    """Pressures that grow by these powers of 1 / h at a node, and are 1 elsewhere, on meshes that are halved."""
    sizes = 0.5 * 2.0 ** np.cumsum([0.0, *powers])
    tables = []
    for number, (size, turn) in enumerate(zip(sizes, turns, strict=True)):
        pressure = np.ones(9 * 2**number)
        pressure[row] = size
        tables.append(curve(pressure, 2.0**-number, turn))
    return tables


def test_a_corner_that_grows():
    """It has no limit, though the pressure is larger elsewhere on all meshes."""
    tables = growing([0.3, 0.3])
    assert diverging_row(tables) == 0
    assert peak_error(tables) is None


def test_a_corner_that_may_grow():
    """It did so on the last mesh alone, or after a mesh before it on the whole."""
    for powers in ([0.0, 0.3], [0.4, -0.1]):
        tables = growing(powers)
        assert diverging_row(tables) is None
        assert peak_error(tables) is None
    assert peak_error(growing([0.3, 0.1])) is not None
    assert peak_error(growing([-0.3, 0.2, -0.2], (0.0,) * 4)) is not None


def test_a_rounding_is_no_corner():
    """Its facets turn ever less; a corner inside of the boundary always turns alike."""

    def at_third(turns):
        tables = growing([0.3, 0.3], turns, row=2)
        for number, table in enumerate(tables):  # so that the node is at the same place on all meshes
            shift = 2 - 2 * 2.0**-number
            table.columns["x"] += shift
        return diverging_row(tables)

    assert at_third((1.5, 1.5, 1.5)) == 2
    assert at_third((1.5, 0.8, 0.45)) is None
