"""The numbers that are printed, with their errors: an interval that the exact value is in, or a
reason.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone, example1

from signorini_fx.machine.display import with_error
from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.quantities.summary import NO_FINITE_VALUE, PrintedNumber
from signorini_fx.results.summary import lines_of, proved, summary_of
from signorini_fx.scenes.reading import changed, parse_scene, read_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.scenes.sweep import row_of

DEMOS = Path(__file__).parents[2] / "demos" / "scenes"


def block(n=10, length=2.0, **changes):
    """A block, pushed along a bowl with friction."""
    mesh = {"length": length, "height": 1.0, "nx": round(length * n), "ny": n}
    data = {
        "mesh": {"generator": "rectangle", "parameters": mesh},
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.006, "y": -0.015},
        "contact": {
            "boundary": "bottom",
            "gap": "0.04 * (x[0] - 0.9)**2",
            "friction": {"law": "coulomb", "coefficient": 0.3},
        },
    }
    return parse_scene(data | changes)


LOADED = {
    "displacement": [{"boundary": "left", "x": 0.0}],
    "traction": {"boundary": "top", "x": 0.5, "y": "-20 if 0.77 <= x[0] <= 1.49 else 0"},
}
RING = {"material": {"young": 1000.0, "poisson": 0.3, "hypothesis": "axisymmetric"}}
RING |= {"displacement": {"boundary": "top", "x": 0.0, "y": -0.015}}


def exact(scene):
    """The numbers of a solution whose error is far smaller."""
    return alone(scene.model_copy(update={"accuracy": Accuracy(target=0.004)})).numbers


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("changes", [{}, LOADED, RING], ids=["pushed", "loaded", "ring"])
def test_exact_values_are_within(changes, degree):
    """On one mesh, and the interval is not wide: the force is known to 5 %, other figures to a
    third.
    """
    scene = block(n=8 // degree, **changes, element={"degree": degree})
    numbers = alone(scene).numbers
    assert [*numbers] == ["force", "friction", "largest pressure", "contact area"]
    force = np.linalg.norm(numbers["force"].value)
    for name, right in exact(scene).items():
        number = numbers[name]
        off = np.linalg.norm(np.subtract(number.value, right.value))
        assert off <= number.error + right.error, name
        size = force if name == "friction" else np.linalg.norm(number.value)
        assert number.error < {"force": 0.05}.get(name, 0.34) * size, name


def test_what_loads_alone_determine():
    """It has no error: the force on a body that slides sideways; and friction on a flat face if
    nothing else holds it.
    """
    scene = block(
        displacement=[{"boundary": "left", "x": 0.0}], traction={"boundary": "top", "y": -10.0}
    )
    numbers = alone(scene).numbers
    assert str(numbers["force"]) == "(0, 20) from the loads"
    assert numbers["friction"].error > 0
    # Where no adjoint state is asked for statics says so, of a flat boundary.
    flat = alone(scene.model_copy(update={"contact": (Contact(boundary="bottom"),)}))
    for reached in (flat.reached, None):
        assert str(replace(flat, reached=reached).numbers["force"]) == "(0, 20) from the loads"
    free = block(displacement=[], traction={"boundary": "top", "x": 1.0, "y": -10.0})
    assert str(alone(free).numbers["friction"]) == "(-2, 0) from the loads"


def test_loads_that_jump_within_a_facet():
    """What their quadrature misses is in the force that they determine."""
    traction = {"boundary": "top", "y": "-20 if x[0] <= 1.49 else 0"}
    number = alone(block(n=6, **LOADED | {"traction": traction})).numbers["force"]
    off = abs(number.value[1] - 20 * 1.49)
    assert off > 0.05
    assert number.error == pytest.approx(off, rel=0.05)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        (
            {"contact": {"boundary": "bottom", "friction": {"law": "tresca", "bound": 3.0}}},
            f"{NO_FINITE_VALUE}at the end of the boundary bottom, (",
        ),
        (
            {"contact": {"boundary": "bottom", "gap": "0.4 * (x[0] - 0.9)**2"}},
            "3 nodes in contact",
        ),
    ],
    ids=["corner", "few"],
)
def test_a_reason(changes, why):
    """Where the largest pressure has no finite value none is printed; a few nodes leave its first
    digit.
    """
    solution = alone(block(**changes))
    number = solution.numbers["largest pressure"]
    summary = summary_of(solution)
    summary |= proved(solution, summary["findings"])
    (line,) = (str(line) for line in lines_of(summary, "") if "largest pressure" in str(line))
    assert why in line
    assert number.why.startswith(why)
    if number.error is None:
        assert f"{number.value:.2g}" not in line
    else:
        assert number.error > 0.25 * number.value


def test_penetration():
    """The regularised law lets a body in, which changes a uniform pressure; the approach of a soft
    contact is no error.
    """
    given = {"displacement": {"boundary": "top", "y": -0.01, "x": 0.0}}
    given |= {"material": {"young": 1000.0, "poisson": 0.0}}
    uniform = alone(block(contact={"boundary": "bottom"}, **given)).numbers["largest pressure"]
    assert 0.0 < abs(uniform.value - 10.0) <= uniform.error < 1e-3
    overclosure = {"law": "linear", "stiffness": 1e4}
    contact = {"boundary": "bottom", "overclosure": overclosure}
    soft = alone(block(contact=contact, **given)).numbers["largest pressure"]
    assert abs(soft.value - 100.0 / 11.0) <= soft.error + 1e-9  # two springs, 1,000 and 10,000
    assert soft.error < 1e-3


def test_moments_in_space():
    """They are within their errors, and friction is known better than the force."""
    sizes = ({"length": 2.0, "nx": 2 * n, "ny": n, "nz": n} for n in (4, 10))
    coarse, fine = (
        alone(
            block(
                mesh={"generator": "box", "parameters": size},
                displacement={"boundary": "top", "x": 0.006, "y": 0.0, "z": -0.015},
            )
        ).numbers
        for size in sizes
    )
    whole = np.linalg.norm(fine["contact moment"].value)
    for name in ("contact moment", "friction moment"):
        off = np.linalg.norm(np.subtract(coarse[name].value, fine[name].value))
        assert 0 < off <= coarse[name].error < 0.3 * whole, name
    assert coarse["friction moment"].error < coarse["contact moment"].error


def test_the_motion_of_a_rigid_body():
    """Where a single force presses it its work tells it; beside another load it is not known."""
    circle = {"shape": "circle", "radius": 1.0, "centre": [1.0, 2.0], "pivot": [1.0, 1.0]}
    pressed = {
        "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.0},
        "contact": {"boundary": "top", "foundation": circle | {"force": [0.0, -10.0]}},
    }
    pressed["contact"]["friction"] = {"law": "coulomb", "coefficient": 0.3}
    coarse, fine = (alone(block(n=n, **pressed)).numbers["displacement of top"] for n in (8, 32))
    off = np.linalg.norm(np.subtract(coarse.value, fine.value))
    assert off <= coarse.error < 0.5 * np.linalg.norm(fine.value)
    both = alone(block(n=4, **pressed, traction={"boundary": "right", "x": 1.0}))
    assert both.numbers["displacement of top"].why == "error not known: other loads act too"


def test_products_of_errors():
    """They are the squared error of a displacement with itself, and twice that with twice it."""
    solution = alone(block(n=4))
    recovery = solution.mechanics.recovery
    y = solution.displacement
    twice = y.copy()
    twice.x.array[:] *= 2
    squares = recovery.squares(y)
    for factor, products in zip((1, 2), recovery.products(y, [y, twice]), strict=True):
        np.testing.assert_allclose(products, factor * squares, atol=1e-13 * squares.max())


@pytest.mark.mpi
def test_on_several_ranks():
    """The errors are those of one rank."""
    scene = block(n=6, material={"young": 1000.0, "poisson": 0.45})
    alike, ours = (solve(scene, comm).numbers for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    for name, number in alike.items():
        assert ours[name].error == pytest.approx(number.error, rel=1e-6), name


def test_in_tables():
    """A sweep has the errors beside the figures, and a summary is read with them."""
    solution = alone(block(n=4))
    row = row_of({}, solution)
    for key, name in (("contact_force", "force"), ("max_pressure", "largest pressure")):
        assert row[f"{key}_error"] == solution.numbers[name].error > 0
    assert solution.at(solution.steps[0]).numbers["force"].error > 0


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (17.068, 0.17, "17.07 +- 0.17"),
        (17.068, 0.213, "17.1 +- 0.3"),
        (123456.0, 2345.0, "123000 +- 3000"),
        (1.2e-5, 3e-7, "(1.20 +- 0.03)e-05"),
        ([-2.03, 1e-9], 0.13, "(-2.03, 0) +- 0.13"),
        (1e-7, 0.02, "0 +- 0.02"),
        (20.0, 0.0, "20"),
        (20.123, None, "20"),
        (487.3, None, "490"),
    ],
)
def test_in_words(value, error, text):
    """One digit of the error, two if it begins with 1, rounded up, and the value to that digit."""
    assert with_error(value, error) == text
    assert PrintedNumber(value=value, error=error).told("N") == f"{text} N"


def test_it_is_computed_where_it_is_asked_for():
    """A solve alone computes no error of a number."""
    solution = alone(example1(nx=12, ny=4))
    assert "numbers" not in vars(solution)
    assert "recovery" not in vars(solution.mechanics)
    assert solution.numbers


@pytest.mark.mpi
def test_a_load_on_facets_of_one_rank_alone():
    """Of hexahedra, whose facets have four corners on ranks that have none of these, too: there the
    others waited for ever.
    """
    scene = {
        "mesh": {"generator": "box", "parameters": {"length": 6.0, "nx": 12, "ny": 2, "nz": 2}},
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": {"boundary": "left", "x": 0.0, "y": 0.0},
        "traction": [
            {"boundary": "right", "z": "-1 if x[2] > 0.3 else 0"},
            {"boundary": "top", "z": -1.0},
        ],
        "contact": {"boundary": "bottom"},
    }
    numbers = solve(parse_scene(scene)).numbers
    assert numbers["force"].value[2] == pytest.approx(6.7, rel=0.05)
    assert 0 < numbers["force"].error < 0.2 * numbers["force"].value[2]


@pytest.mark.parametrize(("name", "times"), [("bar", [0.0, 0.5]), ("lid", [0.1, 0.2])])
def test_forces_of_effects_are_no_loads(name, times):
    """A body that hits the floor without any load, and a fluid that seeps in."""
    scene = changed(read_scene(DEMOS / f"{name}.toml"), {"load_steps.times": times})
    force = alone(parse_scene(scene)).numbers["force"]
    assert force.why != "from the loads"
    assert force.error > 0
