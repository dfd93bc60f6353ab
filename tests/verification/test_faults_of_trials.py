"""Faults that independent trials found and that no other file of tests has: wrong answers and wrong
refusals.
"""

import csv

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from parameters import slow
from scene_tables import box_mesh, coulomb_friction, fixed, floor, rectangle_mesh
from scenes import alone
from scipy.spatial.transform import Rotation
from support.nonlinear_bodies import held, rectangle, residual
from support.nonlinear_scenes import block, indented, material
from two_cylinders import altered

from signorini_fx import (
    ConvergenceError,
    Coulomb,
    Foundation,
    NonlinearContactProblem,
    SceneError,
    Status,
    solve,
)
from signorini_fx.quantities.shown import short_answer
from signorini_fx.results.files import write_results
from signorini_fx.results.summary import summary_of
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.cli import main
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

STEEL = {"young": 1000.0, "poisson": 0.3}


# ---- wrong without a word

RING = """Point(1) = {{0, 0, 0}}; Point(2) = {{{0}, 0, 0}}; Point(3) = {{{1}, 0, 0}}; Point(4) = {{0, {1}, 0}};
Point(5) = {{0, {0}, 0}}; Line(1) = {{2, 3}}; Circle(2) = {{3, 1, 4}}; Line(3) = {{4, 5}}; Circle(4) = {{5, 1, 2}};
Transfinite Curve{{2, 4}} = {2}; Transfinite Curve{{1, 3}} = 5; Curve Loop(1) = {{1, 2, 3, 4}};
Plane Surface(1) = {{1}}; Transfinite Surface{{1}} = {{2, 3, 4, 5}}; Physical Surface("body") = {{1}};
Physical Curve("bottom") = {{1}}; Physical Curve("outer") = {{2}}; Physical Curve("left") = {{3}};
Physical Curve("inner") = {{4}};
"""


J2 = {"law": "j2", "yield_stress": 1e9}
NEO_HOOKE = {"law": "neo-hooke"}


@pytest.mark.parametrize(
    ("facets", "law", "order", "contact", "wrong"),
    [
        ((24, 36), {}, 1, {}, True),
        ((24, 36), {}, 1, {"distance": "nominal"}, False),
        ((24, 24), {}, 1, {}, False),
        ((12, 18), {"young": 1e6}, 2, {}, True),
        slow((18, 18), {"young": 1e6}, 2, {}, False),
        ((12, 18), J2, 1, {}, True),
        slow((12, 12), J2, 1, {}, False),
        ((12, 18), NEO_HOOKE, 1, {}, True),
        slow((12, 18), NEO_HOOKE, 1, {"sliding": "small"}, True),
        slow((12, 18), NEO_HOOKE, 1, {"sliding": "small", "distance": "nominal"}, False),
    ],
)
def test_chords_of_round_sides_that_change_the_pressure(
    tmp_path, facets, law, order, contact, wrong
):
    """Two rings of one material under pressure, which are one body (Lame): the first lines say
    where the distances between facets decide the pressure, and say nothing where the nodes of both
    sides match.
    """
    for name, ends, count in (("small", (4, 10), facets[0]), ("large", (10, 20), facets[1])):
        lines = RING.format(*ends, count + 1) + f"Mesh.ElementOrder = {order};"
        (tmp_path / f"{name}.geo").write_text(lines)
    scene = {
        "body": [
            {"name": name, "mesh": {"file": str(tmp_path / f"{name}.geo")}}
            for name in ("small", "large")
        ],
        "material": STEEL | law,
        "element": {"degree": order},
        "displacement": [
            {"boundary": f"{name}.{side}", axis: 0.0}
            for name in ("small", "large")
            for side, axis in (("bottom", "y"), ("left", "x"))
        ],
        "traction": {"boundary": "large.outer", "pressure": 1.0},
        "contact": {"boundary": "small.outer", "against": "large.inner"} | contact,
    }
    solution = solve(parse_scene(scene))
    lame = (1 - 4**2 / 10**2) * 20**2 / (20**2 - 4**2)
    largest = solution.table.columns["pressure"].max()
    assert (largest > 2 * lame) == wrong
    assert wrong or largest == pytest.approx(lame, rel=0.06)
    summary = write_results(solution, tmp_path / "results", fields=False, pictures=False)
    lines = [str(line) for line in short_answer(summary, tmp_path)]
    assert any("off the curved sides" in line for line in lines) == wrong
    if contact == {"distance": "nominal"}:
        force = summary["numbers"]["force"]
        assert force["error"] < 0.1 * np.linalg.norm(force["value"])
        assert any(line.startswith("  force") and "+-" in line for line in lines)


def test_chords_far_below_the_approach_are_not_warned_of():
    """Facets of two cylinders are .0002 off their arcs and .02 apart at the rim of the contact,
    whose pressure is Hertz's within 1 %.
    """
    scene = altered(friction={"law": "none"}) | {"load_steps": {}}
    scene["displacement"] = [scene["displacement"][0], {"boundary": "top", "x": 0.0, "y": -0.08}]
    solution = solve(parse_scene(scene))
    line_load = (solution.table.columns["pressure"] * solution.table.columns["weight"]).sum()
    stiffness = 1 / (0.91 / 200 + 0.96 / 600)
    hertz = np.sqrt(line_load * stiffness / np.pi / 4.8)
    assert solution.table.columns["pressure"].max() == pytest.approx(hertz, rel=0.01)
    assert not any("off the curved sides" in str(finding) for finding in solution.findings)


@pytest.mark.parametrize("algorithm", ["auto", "alm"])
@pytest.mark.parametrize(("length", "cells"), [(50.0, 40), (100.0, 80)])
def test_slender_bodies_converge_with_the_default_gamma(algorithm, length, cells):
    """The end of a cantilever is pressed down by far: its force is that with a tenth of gamma."""
    parameters = {"length": length, "nx": cells, "ny": 2, "height": 1.0}
    scene = {
        "mesh": rectangle_mesh(**parameters),
        "material": {"young": 210e3, "poisson": 0.3},
        "displacement": fixed("left"),
        "contact": {"boundary": "top", "gap": f"{-length / 20} if x[0] > {0.95 * length} else 1e9"},
        "solver": {"algorithm": algorithm},
    }
    solution = solve(parse_scene(scene))
    lower = {"gamma_n": solution.parameters["gamma_n"] / 10}
    other = solve(parse_scene(scene | {"solver": {"algorithm": algorithm} | lower}))
    np.testing.assert_allclose(solution.contact.forces, other.contact.forces, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("algorithm", ["alm", "ssn"])
def test_pressing_while_all_turns(algorithm):
    """A circle presses a block, and both turn together: forces and displacements are those without
    the turn, turned, also where points close in a step that turns.
    """
    space, side = rectangle([2.0, 1.0], [8, 4])
    top, bottom, x = side(1, 1.0), side(1, 0.0), space.tabulate_dof_coordinates()[:, :2]
    circle = {"shape": "circle", "centre": (0.8, 1.5), "radius": 0.5, "pivot": (0.0, 0.0)}
    gamma = {"gamma_n": 1e5, "gamma_t": 1e5} if algorithm == "ssn" else {}

    def pressed(angles):
        """The force and the displacements of each step, turned back."""
        u, ground = fem.Function(space), fem.Function(space)
        support = fem.dirichletbc(ground, fem.locate_dofs_topological(space, 1, bottom))
        contact = Foundation(top, shape=circle, friction=Coulomb(0.3))
        problem = NonlinearContactProblem(
            residual(u), u, bcs=[support], contact=contact, algorithm=algorithm, **gamma
        )
        last, forces, displacements = np.eye(2), [], []
        for angle, place in zip(angles, [(0.0, -0.05), (0.1, -0.12), (0.2, -0.2)], strict=True):
            turn = Rotation.from_rotvec([0.0, 0.0, np.radians(angle)]).as_matrix()[:2, :2]
            ground.x.array[:] = (x @ turn.T - x).ravel()
            u.x.array[:] = ((x + u.x.array.reshape(-1, 2)) @ (turn @ last.T).T - x).ravel()
            problem.place(0, shift=tuple(turn @ place), rotation=angle)
            problem.solve()
            problem.advance()
            last = turn
            forces.append(turn.T @ sum(problem.state.forces))
            displacements.append((x + u.x.array.reshape(-1, 2)) @ turn - x)
        return np.array(forces), np.array(displacements)

    for still, turned_back in zip(
        pressed([0.0, 0.0, 0.0]), pressed([-20.0, -30.0, -10.0]), strict=True
    ):
        assert turned_back == pytest.approx(still, abs=1e-8 * np.abs(still).max())


@pytest.mark.parametrize("driven", ["by a force at its end", "by a circle under a force"])
def test_load_steps_of_metal_that_yields(driven):
    """Hardening is a tenth of the modulus: each time is one load step, and no unit of length
    changes the result.
    """
    metal = {"law": "j2", "young": 100.0, "poisson": 0.3, "yield_stress": 2.0, "hardening": 10.0}
    ends = []
    for unit in (1.0, 2.0**-9):
        if driven == "by a force at its end":
            scene = {
                "contact": [],
                "displacement": [fixed("left", "x"), fixed("bottom", "y")],
                "traction": {"boundary": "right", "x": 1.0, "factors": [1.5, 5.0, 3.0, 6.0]},
                "load_steps": {"times": [1.0, 2.0, 3.0, 4.0]},
            }
        else:
            middle = [unit, 1.5 * unit]
            circle = {"shape": "circle", "centre": middle, "radius": 0.5 * unit, "pivot": middle}
            circle |= {"force": ["0", f"-{unit}*t"], "prescribed": {"x": 0.0, "rotation": 0.0}}
            scene = {
                "contact": {"boundary": "top", "foundation": circle},
                "load_steps": {"times": [0.2, 1.5, 4.0]},
            }
        solution = alone(indented(metal, unit=unit, cells=(8, 4), **scene))
        assert [step.time for step in solution.steps] == scene["load_steps"]["times"]
        ends.append(solution.displacement.x.array / unit)
    assert abs(ends[1] - ends[0]).max() <= 1e-9 * abs(ends[0]).max()


@pytest.mark.parametrize(
    ("cell", "degree"),
    [("hexahedron", 1), ("hexahedron", 2), ("tetrahedron", 1), ("tetrahedron", 2)],
)
def test_a_sphere_that_touches_in_one_point(cell, degree):
    """A block that is held at its top, without a load: nothing is pressed, whatever its elements
    are.
    """
    sphere = {"shape": "sphere", "centre": [0.5, 0.5, -3.0], "radius": 3.0}
    size = {"length": 1.0, "width": 1.0, "height": 1.0, "nx": 4, "ny": 4, "nz": 2, "cell": cell}
    scene = {
        "mesh": box_mesh(**size),
        "element": {"degree": degree},
        "material": STEEL,
        "displacement": fixed("top", "xyz"),
        "contact": {"boundary": "bottom", "foundation": sphere},
    }
    solution = alone(parse_scene(scene))
    assert solution.converged
    assert solution.table.columns["gap"].min() >= -1e-12
    assert np.abs(solution.contact.forces).max() == 0.0


def test_a_force_of_which_no_digit_is_known(tmp_path):
    """Its first digit stands with the error: 0 would be a claim."""
    scene = block(STEEL, "0.01", load_steps={}, solver={})
    summary = summary_of(alone(scene))
    force = {"value": [0.0, 544.8], "error": 1.9 * 544.8}
    found = summary | {"contact_force": force["value"], "numbers": {"force": force}}
    (line,) = (str(line) for line in short_answer(found, tmp_path) if "force" in str(line)[:14])
    assert "(0, 500) +- 1100" in line


# ---- refused, or called by a wrong name

PUNCH = {
    "material": STEEL,
    "displacement": [fixed("low.bottom"), {"boundary": "high.top", "x": 0.0, "y": -0.01}],
}


@pytest.mark.parametrize(
    ("low", "high", "cell"),
    [
        ({}, {}, "quadrilateral"),
        ({"cell": "triangle"}, {}, "triangle"),
        ({}, {"cell": "triangle"}, "triangle"),
    ],
)
def test_generators_agree_on_a_kind_of_cell(low, high, cell):
    """Of generators with other defaults all make the cells that one is given, or else those of the
    first.
    """
    bodies = [
        {"name": "low", "mesh": rectangle_mesh(length=4.0, height=1.0, **low)},
        {
            "name": "high",
            "mesh": {"generator": "punch", "parameters": {"size": 0.8, **high}},
            "shift": [2.0, 1.0],
        },
    ]
    given = parse_scene(
        {**PUNCH, "body": bodies, "contact": {"boundary": "high.foot", "against": "low.top"}}
    )
    assert load_mesh(given, MPI.COMM_SELF).mesh.topology.cell_name() == cell
    assert alone(given).converged


BLOCK = """
Point(1) = {0, 0, 0, 0.4}; Point(2) = {2, 0, 0, 0.4}; Point(3) = {2, 1, 0, 0.4}; Point(4) = {0, 1, 0, 0.4};
Point(5) = {1, 0.3, 0, 0.4}; LOWER; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1}; Curve Loop(1) = {1:4};
Plane Surface(1) = {1}; Physical Curve("bottom") = {1}; Physical Curve("top") = {3}; Physical Surface("body") = {1};
"""


def test_a_curved_drawing_and_a_straight_one(tmp_path):
    """Elements of degree 2 are on the arc of one body, and the other one gets nodes between its
    corners.
    """
    for name, lower in (("straight", "Line(1) = {1, 2}"), ("curved", "Circle(1) = {1, 5, 2}")):
        (tmp_path / f"{name}.geo").write_text(BLOCK.replace("LOWER", lower))
    bodies = [
        {"name": "low", "mesh": {"file": str(tmp_path / "straight.geo")}},
        {"name": "high", "mesh": {"file": str(tmp_path / "curved.geo")}, "shift": [0.0, 1.8]},
    ]
    contact = {"boundary": "high.bottom", "against": "low.top", "gap": 0.0}
    mesh = load_mesh(
        parse_scene({**PUNCH, "element": {"degree": 2}, "body": bodies, "contact": contact}),
        MPI.COMM_SELF,
    ).mesh
    # A segment of a circle through (0, 0) and (2, 0) with its centre above is below the upper
    # block.
    half = np.arctan2(1.0, 0.3)
    segment = (1.0 + 0.3**2) * (half - np.sin(half) * np.cos(half))
    size = fem.assemble_scalar(fem.form(fem.Constant(mesh, 1.0) * ufl.dx))
    assert mesh.comm.allreduce(size) == pytest.approx(4.0 + segment, rel=1e-4)


@pytest.mark.parametrize("friction", [{}, {"friction": coulomb_friction(0.3)}])
def test_a_step_in_which_nothing_presses_has_no_other_law(friction):
    """A body that is let go after it was pressed and dragged: augmentation is said to be what
    solved it.
    """
    parameters = {"length": 2.21, "height": 0.714, "nx": 9, "ny": 5}
    scene = {
        "mesh": rectangle_mesh(**parameters),
        "solver": {"algorithm": "alm"},
        "material": {"young": 248.0, "poisson": 0.2},
        "contact": {"boundary": "bottom", "gap": "0.00096*(x[0]-1.1)**2"} | friction,
        "displacement": {"boundary": "left", "x": 0.00064, "factors": [0.0, 0.8, 0.2]},
        "traction": {"boundary": "top", "y": -0.879, "factors": [1.0, 1.0, 0.0]},
    }
    solution = solve(parse_scene(scene))
    assert solution.table.columns["pressure"].max() == 0.0
    assert not [finding for finding in solution.findings if "fall-back" in finding.message]


@pytest.mark.parametrize("law", [{}, {"law": "neo-hooke"}])
def test_lines_that_are_drawn_the_wrong_way_round(law):
    """Half inside the body, so that it is not wholly inside the foundation: check says it."""
    line = [[3.0, 0.5], [1.0, 0.3], [-1.0, 0.5]]
    scene = {
        "mesh": rectangle_mesh(8, 4, length=2.0),
        "material": STEEL | law,
        "displacement": {"boundary": "top", "x": 0.0, "y": -0.05},
        "contact": {"boundary": "bottom", "foundation": {"shape": "polyline", "points": line}},
    }
    found = [finding.message for finding in check_scene(parse_scene(scene), MPI.COMM_SELF).findings]
    assert any("reverse the points of a line" in message for message in found)
    line.reverse()
    found = [finding.message for finding in check_scene(parse_scene(scene), MPI.COMM_SELF).findings]
    assert not any("reverse the points of a line" in message for message in found)
    assert any("the gap is negative" in message for message in found)


@pytest.mark.parametrize("law", [{}, {"law": "neo-hooke"}])
def test_bodies_that_begin_beside_each_other(law):
    """They cannot be paired there, and the message says from where they can be brought together."""
    size = {"length": 1.0, "height": 1.0, "nx": 4, "ny": 4}
    mesh = rectangle_mesh(**size)
    scene = {
        "material": STEEL | law,
        "body": [{"name": "low", "mesh": mesh}, {"name": "up", "mesh": mesh, "shift": [2.5, 1.0]}],
        "displacement": [
            fixed("low.bottom"),
            {"boundary": "up.top", "x": "-2.5*min(t, 1)", "y": "-0.05*max(t - 1, 0)"},
        ],
        "contact": {"boundary": "up.bottom", "against": "low.top"},
        "load_steps": {"times": [0.5, 1.0, 2.0]},
    }
    with pytest.raises(
        SceneError, match=r"of bodies that meet later move one \(in a scene by its shift\)"
    ):
        solve(parse_scene(scene))
    scene["body"][1]["shift"] = [0.1, 1.2]
    scene["displacement"][1] |= {"x": "-0.1*min(t, 1)", "y": "-0.25*max(t - 1, 0)"}
    scene["solver"] = {"largest_deformation": 1.0}
    pressed = solve(parse_scene(scene)).contact.pressure
    assert pressed.max() > 0.0


CROSSING = {
    "a node in the middle of two edges": ("1, 1, 2, 3, 6, 8, 7", "2, 2, 4, 3, 8, 9, 5"),
    "an edge with two nodes in its middle": ("1, 1, 2, 3, 6, 10, 7", "2, 2, 4, 3, 8, 9, 5"),
    "a corner in the middle of an edge": ("1, 1, 2, 3, 6, 4, 7", "2, 2, 4, 3, 8, 9, 5"),
}


@pytest.mark.parametrize("cells", CROSSING.values(), ids=CROSSING)
def test_cells_that_cross(tmp_path, monkeypatch, capsys, cells):
    """They were a crash of the process, or taken without a word: all commands have one error that
    names the file and the place.
    """
    x = [(0, 0), (1, 0), (0, 1), (1, 1), (0.5, 0.5), (0.5, 0), (0, 0.5), (1, 0.5), (0.5, 1)]
    x.append((0.6, 0.6))
    monkeypatch.chdir(tmp_path)  # results of ``solve`` go where no other process writes
    file = tmp_path / "body.inp"
    lines = ["*NODE", *(f"{k + 1}, {a}, {b}, 0" for k, (a, b) in enumerate(x))]
    lines += ["*ELEMENT, TYPE=CPE6, ELSET=BODY", *cells]
    file.write_text("\n".join(lines) + "\n")
    scene = tmp_path / "scene.toml"
    scene.write_text(
        f'mesh = {{ file = "{file}" }}\nelement.degree = 2\n'
        'material = { young = 1.0, poisson = 0.3 }\ncontact = { boundary = "BODY" }\n'
    )
    new = ["new", str(tmp_path / "other.toml"), "--from", str(file)]
    for command in (["mesh-info", str(file)], new, ["check", str(scene)], ["solve", str(scene)]):
        assert main(command) == 2
        assert "cells cross at the node at (" in capsys.readouterr().err


def test_a_cell_at_its_yield_strain():
    """A bar that is stretched by its weight is solved with its tangent where the strain of a cell
    is that of a kink of its law.
    """
    space, side = rectangle([1.0, 1.0], [4, 1], cell="triangle")
    u, v, w = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
    yields = fem.Constant(space.mesh, 1.0)

    def strain(y):
        return ufl.sym(ufl.grad(y))

    above = ufl.conditional(ufl.gt(strain(u)[0, 0], yields), 1.0, 0.0)
    softer = 0.9 * above * (strain(u)[0, 0] - yields)
    F = 40.0 * (ufl.inner(strain(u), strain(v)) - softer * strain(v)[0, 0] - 1e-3 * v[0]) * ufl.dx
    J = (
        40.0
        * (ufl.inner(strain(w), strain(v)) - 0.9 * above * strain(w)[0, 0] * strain(v)[0, 0])
        * ufl.dx
    )
    problem = NonlinearContactProblem(F, u, J=J, bcs=[held(space, side(0, 0.0))])
    problem.solve()
    along = fem.Expression(strain(u)[0, 0], np.array([[1 / 3, 1 / 3]])).eval(
        space.mesh, np.arange(8, dtype=np.int32)
    )
    yields.value = along.max()
    problem.solve()
    assert problem.status is Status.CONVERGED


def test_between_a_plate_at_rest_and_one_that_moves():
    """The forces of both plates in each load step are those of mu (w^2 - 1) + Lambda ln(w h) =
    0.
    """
    plates = [
        floor(),
        {"shape": "plane", "point": [0.0, 1.0], "normal": [0.0, -1.0], "shift": [0.0, "-0.1*t"]},
    ]
    scene = block(
        material("neo-hooke"),
        "0",
        displacement=[fixed("left", "x")],
        contact=[
            {"boundary": name, "foundation": plate}
            for name, plate in zip(("bottom", "top"), plates, strict=True)
        ],
        load_steps={"times": [1.0, 2.0]},
    )
    for step, pressure in zip(alone(scene).steps, (12.052108, 26.863153), strict=True):
        forces = np.array(step.contact.forces_of_each)[:, 0, 1]
        assert forces == pytest.approx([pressure, -pressure], rel=1e-6)


def test_the_side_that_ends_carries_the_points():
    """A narrow rubber block slides on a wide one with its corners in contact, the wide side given
    first: no increment is halved.
    """
    sizes = {"block": ([3.0, 0.0], 4.0, 8), "base": ([0.0, -2.0], 10.0, 20)}
    bodies = [
        {"name": name, "shift": shift, "mesh": rectangle_mesh(nx, 4, length=length, height=2.0)}
        for name, (shift, length, nx) in sizes.items()
    ]
    scene = {
        "body": bodies,
        "material": {"law": "neo-hooke", **STEEL},
        "displacement": [
            fixed("base.bottom"),
            {"boundary": "block.top", "y": -0.1},
            {"boundary": "block.top", "x": 1.5, "factors": [0.0, 0.5, 1.0]},
        ],
        "contact": {
            "boundary": "base.top",
            "against": "block.bottom",
            "friction": coulomb_friction(0.3),
        },
    }
    solution = alone(parse_scene(scene))
    assert solution.converged
    assert len(solution.steps) == 3
    assert set(solution.table.columns["boundary"]) == {"block.bottom"}


def test_an_unstable_equilibrium_says_where():
    """A column beyond Euler's load, driven by a displacement: the place, and no advice to prescribe
    one.
    """
    scene = block(
        material("neo-hooke"),
        "0.02*t",
        length=0.1,
        cells=(2, 20),
        displacement=fixed("bottom"),
        load_steps={"times": [1.0, 4.0]},
    )
    with pytest.raises(ConvergenceError, match="unstable equilibrium") as error:
        alone(scene)
    assert "instead of a force" not in str(error.value)
    assert "begins" in str(error.value)


RAMP = """
mesh = { generator = "rectangle", parameters = { nx = 6, ny = 2 } }
material = { young = 5000.0, poisson = 0.3 }
traction = [{ boundary = "top", y = -20.0 }, { boundary = "top", x = 10.0, factors = [0.0, 1.0] }]
contact = { boundary = "bottom", friction = { law = "coulomb", coefficient = 0.2 } }
load_steps = { steps = 2, times = [0.0, 1.0] }
"""


def test_a_ramp_beyond_its_limit_is_a_row_of_a_sweep(tmp_path):
    """A block of length 3 under 20 that is pushed with 10 t slides at the time 2 F, known to half a per
    cent; the forces of its row are those of the last load step with a solution.
    """
    scene, out = tmp_path / "ramp.toml", tmp_path / "out"
    scene.write_text(RAMP)
    main(
        [
            "sweep",
            str(scene),
            "--set",
            "contact.friction.coefficient=0.2,0.3,0.8",
            "--out",
            str(out),
        ]
    )
    with (out / "sweep.csv").open() as file:
        rows = list(csv.DictReader(file))
    reached = [float(row["solved_until"]) for row in rows]
    assert reached == pytest.approx([0.4, 0.6, 1.0], rel=5e-3)
    assert [float(row["contact_force"]) for row in rows] == pytest.approx([60.0] * 3)
    friction = [float(row["friction_force"]) for row in rows]
    assert friction == pytest.approx([30 * time for time in reached])
