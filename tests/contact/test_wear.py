"""Wear: depths by closed forms, worn cylinders and pins, and what it does not go with."""

import csv
import tomllib

import numpy as np
import pytest
import ufl
from commands import run_python
from dolfinx import fem
from dolfinx import mesh as dmesh
from forms import Block
from hertz import RADIUS, parabolic_block
from mpi4py import MPI
from numpy.testing import assert_allclose
from parameters import slow
from scene_tables import box_mesh, fixed, plane_shape, rectangle_mesh
from scenes import changed

from signorini_fx import (
    Archard,
    Body,
    Contact,
    ContactProblem,
    Coulomb,
    Displacement,
    Foundation,
    LinearElastic,
    LoadSteps,
    NonlinearContactProblem,
    Scene,
    SolverSettings,
    Traction,
    sensitivity,
    solve,
    tag_boundaries,
    write_results,
)
from signorini_fx.addons.report.page import write_report
from signorini_fx.errors import FormError, SceneError
from signorini_fx.records import Status
from signorini_fx.scenes import cli
from signorini_fx.scenes.checks import check_scene

# A block that is pressed on a floor, which slides below it.
BLOCK = """
mesh = { generator = "rectangle", parameters = { length = 1.0, nx = 4, ny = 4 } }
material = { young = 1000.0, poisson = 0.3 }
traction = { boundary = "top", y = -5.0 }
displacement = { boundary = "left", x = 0.0 }
contact = { boundary = "bottom", wear = { coefficient = 1e-6, distance = "3e3*t" } }
load_steps = { times = [0.1, 0.2, 0.3, 0.7, 1.0] }
"""
BOX = {
    "mesh": box_mesh(2, 2, 2, length=1.0, width=1.0),
    "displacement": [fixed("left", "x"), fixed("front", "y")],
    "traction": {"boundary": "top", "z": -5.0},
}
ROUND = {"material": {"young": 1000.0, "poisson": 0.3, "hypothesis": "axisymmetric"}}
TWO = {
    "mesh": None,
    "body": [
        {"name": "low", "mesh": rectangle_mesh(4, 4, length=1.0)},
        {"name": "up", "mesh": rectangle_mesh(5, 5, length=1.0), "shift": [0.0, 1.0]},
    ],
    "displacement": [fixed("low.bottom", "y"), fixed("low.left", "x"), fixed("up.left", "x")],
    "traction": {"boundary": "up.top", "y": -5.0},
    "contact": {
        "boundary": "up.bottom",
        "against": "low.top",
        "wear": {"coefficient": 1e-6, "distance": "3e3*t"},
    },
}


@pytest.mark.mpi
@pytest.mark.parametrize(
    "more",
    [{}, {"element": {"degree": 2}}, BOX, ROUND, TWO, {"solver": {"linear_algebra": "krylov"}}],
    ids=["plane", "quadratic", "space", "revolution", "two", "krylov"],
)
def test_uniform_pressure(more):
    """The depth is k p s at each point, whatever the steps are, and the certificate holds."""
    solution = solve(changed(BLOCK, **more))
    assert all(step.certificate.holds for step in solution.steps)
    depth = solution.state.fields["wear"].values
    digits = 1e-8 if "solver" in more else 3e-13
    assert_allclose(depth, 1e-6 * 5.0 * 3e3, rtol=digits)
    last = solution.steps[-1].figures
    assert last["wear"] == pytest.approx(0.015, rel=digits)
    area = np.pi if more is ROUND else 1.0
    assert last["worn_volume"] == pytest.approx(0.015 * area, rel=1e-8)
    assert max(abs(step.figures["wear_error"]) for step in solution.steps) < 1e-8


# --- Hertzian contact that is worn flat: R 8, E 200000, nu .3, P 200, k s = 5e-5 ---

R, FORCE, WEAR = RADIUS, 200.0, 5e-5


def flattened(steps, columns=48, *, revolution=False):
    """Half of a block whose lower side is a parabola, pressed on a plane that slides below it."""
    tagged = parabolic_block(columns)
    hypothesis = "axisymmetric" if revolution else "plane strain"
    mean = FORCE / (np.pi * 4.0**2 if revolution else 2 * 4.0)
    floor = plane_shape([0.0, 0.0], [0.0, 1.0])
    return solve(
        Scene(
            mesh=tagged,
            material=LinearElastic(young=2e5, poisson=0.3, hypothesis=hypothesis),
            displacement=Displacement(boundary="middle", x=0.0),
            traction=Traction(boundary="top", y=-mean),
            contact=Contact(boundary="low", foundation=floor, wear=Archard(1e-8, distance="5e3*t")),
            load_steps=LoadSteps(times=[(k + 1) / steps for k in range(steps)]),
        )
    )


@pytest.mark.parametrize(
    ("steps", "columns", "revolution"),
    [
        (5, 48, False),
        (20, 48, False),
        (20, 48, True),
        slow(80, 48, False),
        slow(80, 48, True),
        slow(20, 64, False),
    ],
)
def test_worn_flat(steps, columns, revolution):
    """Half width of the contact within a cell, depth to 1 %, volume to round-off, and an even
    pressure, as without elasticity: 2 b^3 / (3 R) of a cylinder, pi b^4 / (4 R) of a pin.
    """
    solution = flattened(steps, columns, revolution=revolution)
    assert all(step.certificate.holds for step in solution.steps)
    force = FORCE if revolution else FORCE / 2
    b = (
        (4 * R * FORCE * WEAR / np.pi) ** 0.25
        if revolution
        else (1.5 * R * FORCE * WEAR) ** (1 / 3)
    )
    pressure = FORCE / (np.pi * b**2) if revolution else FORCE / (2 * b)
    x = solution.contact.boundary.x[:, 0]
    wide = x[solution.contact.pressure > 0].max()
    beyond = x[x > wide].min()
    before = x[x < wide].max()
    assert before < b < beyond
    figures = solution.steps[-1].figures
    assert figures["wear"] == pytest.approx(b**2 / (2 * R), rel=0.01)
    assert figures["worn_volume"] == pytest.approx(WEAR * force, rel=1e-9)
    assert max(abs(step.figures["wear_error"]) for step in solution.steps) < 1e-8
    inner = solution.contact.pressure[x < 0.6 * b]
    assert inner == pytest.approx(pressure, rel=0.06)


# --- the slip of the contact itself ---


@pytest.mark.mpi
@pytest.mark.parametrize("coefficient", [1e-8, 1e-5])
@pytest.mark.parametrize("more", [{}, BOX], ids=["plane", "space"])
def test_own_slip(coefficient, more):
    """A block that slides to and fro as a whole, pressed by a force: k p times its way."""
    way = {"boundary": "top", "x": 0.01, "factors": [0.5, 1.0, -1.0, 1.0]}
    held = [fixed("front", "y")] if more else []
    contact = {"boundary": "bottom", "wear": {"coefficient": coefficient}}
    changes = {"material": {"young": 1e3, "poisson": 0.0}, "load_steps": None, "contact": contact}
    solution = solve(changed(BLOCK, **{**more, **changes, "displacement": [*held, way]}))
    assert all(step.certificate.holds for step in solution.steps)
    slips = [step.figures["slip_range"] for step in solution.steps]
    assert_allclose(slips, [0.005, 0.005, 0.02, 0.02], rtol=1e-7)
    depth = solution.state.fields["wear"].values
    assert_allclose(depth, coefficient * 5.0 * 0.05, rtol=1e-7)


def test_a_slip_that_does_not_settle(monkeypatch):
    """Is said where the last turn of a step still changes the depth: it is no solution."""
    monkeypatch.setattr("signorini_fx.solving.step._MOST_TURNS", 1)
    way = {"boundary": "top", "x": 0.01, "factors": [0.5, 1.0]}
    contact = {"boundary": "bottom", "wear": {"coefficient": 1e-6}}
    scene = changed(BLOCK, load_steps=None, contact=contact, displacement=[way])
    solution = solve(scene, check=False)
    assert solution.status is Status.OUTER_MAX_ITERATIONS
    assert "its slip still changes the depth" in str(solution.steps[-1].reason)


def blocks(columns, up, low):
    """Two blocks with sides of these curvatures that face each other, 1 / length; the columns of
    the upper one.
    """
    bodies = []
    for name, count, curvature in (("up", columns, up), ("low", columns + 6, low)):
        mesh = dmesh.create_rectangle(
            MPI.COMM_WORLD,
            [np.array([-1.0, 0.0]), np.ones(2)],
            [count, 14],
            dmesh.CellType.quadrilateral,
        )
        x = mesh.geometry.x
        x[:, 0] = 4.0 * np.sign(x[:, 0]) * np.abs(x[:, 0]) ** 2.5
        side = 0.5 * curvature * x[:, 0] ** 2
        x[:, 1] = side + x[:, 1] ** 1.6 * (4.0 - side)
        if name == "low":
            x[:, 1] *= -1.0
        marks = {
            "facing": lambda x, c=curvature: np.isclose(np.abs(x[1]), 0.5 * c * x[0] ** 2),
            "far": lambda x: np.isclose(np.abs(x[1]), 4.0),
        }
        bodies.append(Body(name=name, mesh=tag_boundaries(mesh, marks)))
    return {
        "body": bodies,
        "material": [LinearElastic(region=one.name, young=2e5, poisson=0.3) for one in bodies],
    }


def test_worn_pair():
    """Two cylinders of twice the radius wear as one on a plane does, from the cylinder of before
    wear, which is Hertz's.
    """
    solution = solve(
        Scene(
            **blocks(64, 1 / 16, 1 / 16),
            displacement=[
                Displacement(boundary="low.far", x=0.0, y=0.0),
                Displacement(boundary="up.far", x=0.0),
            ],
            traction=Traction(boundary="up.far", y=-FORCE / 8.0),
            contact=Contact(
                boundary="up.facing", against="low.facing", wear=Archard(1e-8, distance="5e3*t")
            ),
            load_steps=LoadSteps(times=[(k + 1) / 20 for k in range(20)]),
        )
    )
    assert all(step.certificate.holds for step in solution.steps)
    b = (1.5 * R * FORCE * WEAR) ** (1 / 3)
    x = np.sort(solution.contact.boundary.x[:, 0])
    wide = solution.contact.boundary.x[solution.contact.pressure > 0, 0].max()
    assert x[np.searchsorted(x, wide) - 1] < b < x[np.searchsorted(x, wide) + 1]
    figures = solution.steps[-1].figures
    assert figures["wear"] == pytest.approx(b**2 / (2 * R), rel=0.025)
    assert figures["worn_volume"] == pytest.approx(WEAR * FORCE, rel=1e-9)


def halves(columns, push, shift, **wear):
    """A round block that is pressed on a flat one of the same material, and slid to and fro by less
    than friction holds: half a cycle in each load step from the second one.
    """
    return Scene(
        **blocks(columns, 1 / R, 0.0),
        displacement=[
            Displacement(boundary="low.far", x=0.0, y=0.0),
            Displacement(boundary="up.far", y=-push),
            Displacement(boundary="up.far", x=shift, factors=[0.0, 1.0, -1.0, 1.0]),
        ],
        contact=Contact(boundary="up.facing", against="low.facing", friction=Coulomb(0.5), **wear),
        solver=SolverSettings(coulomb="newton"),
    )


@pytest.mark.parametrize(("columns", "push", "error"), [(60, 0.02, 0.04), slow(120, 0.04, 0.02)])
def test_fretting(columns, push, error):
    """The energy of half a cycle before wear is that of Cattaneo (1938) and Mindlin (1949), as
    Mindlin and Deresiewicz (1953) go on from: beyond c = a (1 - T / (F P))^(1/2) surfaces slip
    by twice 4 (1 - nu^2) F p_0 / (E a) times the integral of (x^2 - c^2)^(1/2) from c.
    """
    step = solve(halves(columns, push, 0.4 * push)).steps[-1]
    pressed, sheared = (np.linalg.norm(force) for force in step.contact.forces)
    modulus = 2e5 / (1 - 0.3**2) / 2
    a = np.sqrt(4 * pressed * R / np.pi / modulus)
    largest = 2 * pressed / np.pi / a
    c = a * np.sqrt(1 - sheared / (0.5 * pressed))
    x = np.linspace(c, a, 20001)
    middle = 0.5 * (x[1:] + x[:-1])
    root = np.sqrt(middle**2 - c**2)
    slip = np.cumsum(root) * (x[1] - x[0]) * 2 * 0.5 * largest / (modulus * a)
    shear = 0.5 * largest * np.sqrt(1 - (middle / a) ** 2)
    energy = 2 * np.sum(shear * 2 * slip) * (x[1] - x[0])
    assert step.contact.friction_work == pytest.approx(energy, rel=error)


def test_fretting_wears_the_ends():
    """Where the middle sticks it does not wear; energy and wear of a point keep to k / F."""
    solution = solve(halves(60, 0.02, 0.008, wear=Archard(1e-7)))
    assert all(step.certificate.holds for step in solution.steps)
    depth, energy = (solution.state.fields[name].values for name in ("wear", "dissipated"))
    x = solution.contact.boundary.x[:, 0]
    assert (depth[np.abs(x) < 0.1] == 0).all()
    assert_allclose(depth, 1e-7 / 0.5 * energy, rtol=1e-6, atol=1e-15)
    assert depth.max() > 0
    table = solution.table.columns
    assert sorted(table["wear"]) == pytest.approx(sorted(depth))


# A block that is pressed and pushed to and fro by less than friction holds.
PUSHED = """
mesh = { generator = "rectangle", parameters = { length = 2.0, nx = 8, ny = 4 } }
material = { young = 1000.0, poisson = 0.3 }
traction = [{ boundary = "top", y = -5.0 }, { boundary = "top", x = 1.2, factors = [1.0, -1.0] }]
[[contact]]
boundary = "bottom"
friction = { law = "coulomb", coefficient = 0.3 }
wear = { coefficient = 1e-5 }
"""


def test_cycles():
    """They are the load steps of one, listed again and again; with jumps volume and energy are
    those of all of them, within what a jump changes.
    """
    pressed, pushed = tomllib.loads(PUSHED)["traction"]
    listed = solve(changed(PUSHED, traction=[pressed, {**pushed, "factors": 12 * [1.0, -1.0]}]))
    every = solve(changed(PUSHED, load_steps={"cycles": 12}))
    assert every.steps[-1].figures == listed.steps[-1].figures
    jumped = solve(changed(PUSHED, load_steps={"cycles": 12, "jump": 3}))
    assert len(jumped.steps) == 2 * (1 + 12 // 3)
    ends = [each.steps[-1].figures for each in (every, jumped)]
    for name in ("wear", "worn_volume", "dissipated"):
        assert ends[1][name] == pytest.approx(ends[0][name], rel=0.01)
    again = {
        "traction": [pressed, {**pushed, "factors": 5 * [1.0, -1.0]}],
        "load_steps": {"jump": [1, 1, 2, 2, *(6 * [3])]},
    }
    assert solve(changed(PUSHED, **again)).steps[-1].figures == jumped.steps[-1].figures


def test_map_of_fretting(tmp_path):
    """A sweep over two loads has slip, volume and energy of each in its table."""
    (tmp_path / "pushed.toml").write_text(PUSHED)
    values = ["--set", "traction[1].x=0.6,1.2", "--set", "traction[0].y=-5,-6"]
    place = ["--out", str(tmp_path / "map")]
    assert cli.main(["sweep", str(tmp_path / "pushed.toml"), *values, *place]) == 0
    with (tmp_path / "map" / "sweep.csv").open() as file:
        rows = [*csv.DictReader(file)]
    slips = [float(row["slip_range"]) for row in rows]
    assert slips[0] < slips[2]
    assert slips[3] < slips[2]
    volumes, energies = (
        [float(row[name]) for row in rows] for name in ("worn_volume", "dissipated")
    )
    # Coulomb: the energy is F times the pressure times slip.
    assert volumes == pytest.approx(1e-5 / 0.3 * np.array(energies), rel=1e-5)


# --- what it does not go with ---


def test_too_deep():
    """Half a cell is where it ends, with the steps before."""
    deep = changed(
        BLOCK, contact={"boundary": "bottom", "wear": {"coefficient": 1e-6, "distance": "3e4*t"}}
    )
    solution = solve(deep, check=False)
    assert solution.status is Status.WORN
    assert [step.status for step in solution.steps] == [Status.CONVERGED] * 4 + [Status.WORN]
    said = [one.message for one in solution.findings if one.path == "contact[0].wear"]
    assert any("is 0.6 cells deep" in message for message in said)
    foretold = [one.message for one in check_scene(deep).findings if one.level == "warning"]
    assert any("would be 0.6 cells deep" in message for message in foretold)


def test_what_check_says():
    """How much more a step wears than an explicit rule could."""
    solution_free = check_scene(changed(BLOCK))
    (said,) = [one for one in solution_free.findings if one.path == "contact[0].wear"]
    # k ds E / (2.2 h) of the step of .4
    assert "2.18 times what an explicit rule could" in said.message


def test_what_is_written(tmp_path):
    """Columns of points and of load steps, a line of the terminal, a picture in the report."""
    solution = solve(changed(BLOCK, contact=wear(distance="3e3*t*x[0]")["contact"]))
    summary = write_results(solution, tmp_path, fields=False)
    write_report(tmp_path)
    said = [found["message"] for found in summary["findings"]]
    assert "bottom: worn 0.009031 deep at (1, 0), volume 0.005439" in said
    table = (tmp_path / "contact.csv").read_text().splitlines()
    assert {"wear", "dissipated"} < set(table[0].split(","))
    steps = (tmp_path / "steps.csv").read_text().splitlines()
    assert {"wear", "worn_volume", "slip_range", "wear_error"} < set(steps[0].split(","))
    assert (tmp_path / "effects.png").stat().st_size > 10_000
    assert "effects from step to step" in (tmp_path / "report.html").read_text()


def test_forms():
    """Forms wear as the scene does."""
    block = Block((4, 4))
    worn = Archard(1e-6, distance="3e3*t")
    foundation = Foundation(block.foundation.facets, wear=worn)
    problem = ContactProblem(block.a, block.L, block.bcs, foundation)
    state = problem.initial()
    expected = 0.0
    before = 0.0
    for time in (0.1, 0.2, 0.3, 0.7, 1.0):
        state, result = problem.step(state, time)
        assert result.certificate.holds
        expected = expected + 1e-6 * 3e3 * (time - before) * result.contact.pressure
        before = time
    assert_allclose(state.fields["wear"].values, expected, rtol=1e-12)


def wear(**more):
    """The table of a contact."""
    return {
        "contact": {"boundary": "bottom", "wear": {"coefficient": 1e-6, "distance": "t", **more}}
    }


@pytest.mark.parametrize(
    ("more", "key", "reason"),
    [
        (wear(coefficient=-1.0), "contact.wear.coefficient", "must not be negative"),
        (wear(distance=3.0), "contact.wear.distance", "must grow with the time t"),
        (wear(rate=3.0), "contact.wear.rate", "unknown key"),
        ({"contact": {"boundary": "bottom", "wear": 1e-8}}, "contact.wear", "must be a table"),
        ({"solver": {"algorithm": "alm"}}, "contact.wear", "needs algorithm = 'ssn'"),
        ({"load_steps": {"cycles": 9, "jump": 2}}, "load_steps.jump", "divides the 9 cycles"),
        ({"load_steps": {"cycles": 9, "steps": 2}}, "load_steps.cycles", "not possible yet with a"),
        (
            {"load_steps": {"cycles": 9, "times": [0.0, 1.0]}},
            "load_steps.times",
            "must be positive",
        ),
        (
            {"load_steps": {"jump": 9}, "contact": {"boundary": "bottom"}},
            "load_steps.jump",
            "is for contact that wears",
        ),
        ({"solver": {"levels": 2}}, "solver.levels", "not possible yet with wear"),
        ({"accuracy": {"target": 0.1}}, "accuracy", "not possible yet with wear"),
        (
            {
                "material": {"young": 1e3, "poisson": 0.3, "density": 1.0},
                "inertia": {"time_step": 0.1},
            },
            "inertia",
            "not possible yet with wear",
        ),
        (
            {"material": {"law": "neo-hooke", "young": 1e3, "poisson": 0.3}},
            "material",
            "not possible yet with wear",
        ),
        (
            {"contact": {**wear()["contact"], "kind": "bilateral"}},
            "contact.wear",
            "is for unilateral contact",
        ),
    ],
)
def test_refusals(more, key, reason):
    """One error names the key."""
    with pytest.raises(SceneError) as error:
        changed(BLOCK, **more)
    assert [(path, reason in text) for path, text in error.value.problems][:1] == [(key, True)]


@pytest.mark.parametrize(
    ("more", "wrong"),
    [
        ({"coefficient": "1e-6*(x[0] - 0.5)"}, "coefficient: is negative"),
        ({"coefficient": "1e-6/x[0]"}, "coefficient: is not finite"),
        ({"distance": "-t"}, "distance: falls with the time"),
        ({"distance": "log(t)"}, "distance: is not finite"),
    ],
)
def test_values_at_points(more, wrong):
    """What is wrong at some contact point names its key, in check and in solve."""
    given = changed(BLOCK, **wear(**more))
    for use in (solve, check_scene):
        with pytest.raises(SceneError, match=r"contact\[0\]\.wear\." + wrong):
            use(given)


def test_refusals_of_forms():
    """Bad input, inertia, nonlinear problems and derivatives."""
    block = Block((4, 4))
    facets = block.foundation.facets
    for contact, key, more in (
        (Foundation(facets, wear=1e-8), r"contact\[0\]\.wear.*Archard\(...\), not float", {}),
        (Foundation(facets, wear=Archard(1.0, distance=2.0)), r"contact\[0\]\.wear\.distance", {}),
        (
            Foundation(facets, wear=Archard(1.0, distance="t")),
            "density.*not possible yet",
            {"density": 1.0},
        ),
        (
            Foundation(facets, wear=Archard(1.0, distance="t")),
            r"contact\[0\]\.wear: needs",
            {"algorithm": "alm"},
        ),
    ):
        with pytest.raises(FormError, match=key):
            ContactProblem(block.a, block.L, block.bcs, contact, **more)
    space = block.a.arguments()[0].ufl_function_space()
    u = fem.Function(space)
    F = ufl.replace(block.a, {block.a.arguments()[1]: u}) - block.L
    with pytest.raises(FormError, match=r"F.*not possible yet with wear"):
        NonlinearContactProblem(F, u, contact=Foundation(facets, wear=Archard(1.0, distance="t")))
    problem = ContactProblem(block.a, block.L, block.bcs, Foundation(facets, wear=Archard(1e-8)))
    problem.solve()
    with pytest.raises(FormError, match=r"contact\[0\]\.wear: derivatives are not possible yet"):
        problem.gradient("force", [])
    with pytest.raises(SceneError, match="not possible yet with wear"):
        sensitivity(changed(BLOCK), of="energy", by="traction[0].y")


def test_it_is_not_imported():
    """Neither the table nor the step of wear, where no scene has it."""
    code = (
        "import sys, tomllib, signorini_fx as sfx;"
        "from signorini_fx.scenes.reading import parse_scene;"
        f"sfx.solve(parse_scene(tomllib.loads({BLOCK.partition('contact')[0]!r} + "
        "'contact = {boundary = \"bottom\"}')));"
        "print([name for name in sys.modules if 'wear' in name])"
    )
    done = run_python(code)
    assert done.stdout.strip() == "[]"
