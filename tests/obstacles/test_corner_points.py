"""Contact points at convex corners of rigid foundations in the plane: figures of a program of its
own, and what must not depend on where the corner is between the nodes.
"""

import csv
import math

import forms
import numpy as np
import pytest
from commands import summary_in
from dolfinx import fem
from mpi4py import MPI
from on_meshes import no_load, trial_and_test, turn_by, vector_space
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from test_corners import OVERLAP, block, edge

from signorini_fx import ContactProblem, Coulomb, Foundation, solve
from signorini_fx.mechanics.obstacles.corner_points import BoundaryLine, CornerFeet
from signorini_fx.mechanics.statement.rigid_shape import read_shape
from signorini_fx.quantities.shown import brief_lines
from signorini_fx.results.certificate import corner_feet
from signorini_fx.results.files import write_results
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
# The force by the place of the edge in a facet from 1.0 to 1.1; the first one is on a node.
FORCES = {1.0: 8.934, 1.0001: 8.944, 1.0125: 10.170, 1.025: 11.283, 1.0375: 12.076, 1.05: 12.365}
EXACT = {"solver": {"algorithm": "alm"}}


def force(scene):
    """The contact force of a scene, length 2."""
    return solve(scene).contact.forces[0]


@pytest.mark.mpi
@pytest.mark.parametrize(("x", "expected"), FORCES.items())
def test_force_of_an_edge(x, expected):
    """It was 0 between two nodes, (-3.64, 3.64) beside one; mirrored places have the same."""
    for place in (x, 2.0 - x):
        across, up = force(block(edge(place), **EXACT))
        assert up == pytest.approx(expected, abs=2e-3)
        assert abs(across) <= 1e-6 * up


def test_force_changes_without_jumps():
    """From place to place by less than a hundredth."""
    forces = [force(block(edge(x), **EXACT))[1] for x in (1.0, 1.0001, 1.0002, 1.0999, 1.1, 1.1001)]
    assert np.abs(np.diff(forces)[[0, 1, 3, 4]]).max() <= 0.02


@pytest.mark.slow
def test_limit_of_small_facets():
    """5.27, once facets are smaller than the contact; nodes of the sides take over."""
    forces = [force(block(edge(x), nx=160, **EXACT))[1] for x in (1.0, 1.00625)]
    assert forces == pytest.approx([5.82, 7.12], rel=0.005)


@pytest.mark.parametrize("moved", [0.004, 0.008, -0.008])
def test_nodes_beside_a_corner_see_no_wall(moved):
    """A node beside the corner saw its side prolonged: (-2.14, 9.02)."""
    displacement = {"boundary": "top", "x": moved, "y": -OVERLAP}
    across, up = force(block(edge(1.001), displacement=displacement))
    assert up == pytest.approx(9.03, abs=0.01)
    assert abs(across) <= 1e-6 * up


DRAGGED = [
    {"boundary": "top", "y": -OVERLAP},
    {"boundary": "top", "x": 0.008, "factors": [0.25, 0.5, 0.75, 1.0]},
]
ROUGH = {"friction": coulomb_friction(0.3)}


@pytest.mark.parametrize(
    "settings",
    [
        {"algorithm": "ssn", "coulomb": "fp"},
        {"coulomb": "newton"},
        {"algorithm": "alm"},
        {"algorithm": "continuation"},
        {"linear_algebra": "full"},
        {"linear_algebra": "krylov"},
    ],
    ids=lambda settings: " ".join(settings.values()),
)
@pytest.mark.mpi
def test_friction(settings):
    """The body sticks to the corner, in four load steps."""
    scene = block(edge(1.025), contact=ROUGH, displacement=DRAGGED, solver=settings)
    contact, friction = solve(scene).contact.forces
    assert contact == pytest.approx([0.0, 11.293], abs=2e-3)
    assert friction == pytest.approx([-2.771, 0.0], abs=1e-3)


def whole_and_restarted(scene, folder):
    """The solution of a scene, and that of a run that is killed in the third load step and goes
    on.
    """

    def stop(record):
        if getattr(record, "step", 0) == 3:
            raise KeyboardInterrupt

    whole = solve(scene)
    with pytest.raises(KeyboardInterrupt):
        solve(scene, checkpoint=folder, observers=[stop])
    return whole, solve(scene, checkpoint=folder, restart=True)


def test_restart(tmp_path):
    """A run that is killed in the third load step goes on, on a corner that moves over facets."""
    moving = edge(1.05) | {"shift": ("-0.05*t", "0")}
    scene = block(moving, contact=ROUGH, displacement=DRAGGED)
    whole, again = whole_and_restarted(scene, tmp_path)
    assert np.array(again.contact.forces) == pytest.approx(np.array(whole.contact.forces), rel=1e-9)
    assert again.history.linear_solves == whole.history.linear_solves


def test_flat_corners():
    """Nodes share from the start; there was up to .17 sideways."""
    across, up = force(block(edge(1.025, 2.0), **EXACT))
    assert (across, up) == pytest.approx((0.0011, 16.293), abs=2e-3)
    fine = [force(block(edge(x, 10.0), nx=80, **EXACT))[1] for x in (1.0, 1.0125)]
    assert fine == pytest.approx([8.00, 8.36], abs=0.04)


@pytest.mark.parametrize("radius", [0.0, 0.01, 0.05])
@pytest.mark.parametrize("x", [1.0, 1.025, 1.05])
def test_small_roundings(radius, x):
    """A circle between two nodes is felt as its middle is, whatever its radius."""
    tip = [x, radius * (math.sqrt(2.0) - 1.0)]
    cone = {"shape": "cone", "tip": tip, "axis": [0.0, -1.0], "angle": 45.0, "radius": radius}
    assert force(block(cone, **EXACT))[1] == pytest.approx(FORCES[x], abs=2e-3)


@pytest.mark.parametrize("turned", [0.0, 30.0, 137.0])
def test_closed_lines_in_both_directions(turned):
    """A box, one of whose corners is its first point, placed and turned; both corners are felt."""
    box = np.array([[1.52, 0.0], [1.52, -1.0], [0.57, -1.0], [0.57, 0.0]])
    pivot, angle = np.array([0.3, -0.2]), -math.radians(turned)
    turn = turn_by(angle)
    points = ((box - pivot) @ turn.T + pivot).tolist()
    for line in (points, points[::-1]):
        placed = {"rotation": turned, "pivot": pivot.tolist()}
        solution = solve(block({"shape": "polyline", "points": [*line, line[0]]} | placed))
        assert solution.contact.forces[0] == pytest.approx([0.0, 33.687], abs=1e-3)
        assert len(solution.corner_figures) == 2


def test_two_corners_in_one_facet():
    """A box that is narrower than a facet."""
    line = [[1.02, 0.0], [1.02, -1.0], [1.07, -1.0], [1.07, 0.0], [1.02, 0.0]]
    solution = solve(block({"shape": "polyline", "points": line}))
    assert [one.place for one in solution.corner_figures] == [[1.02, 0.0], [1.07, 0.0]]
    assert solution.contact.forces[0] == pytest.approx([0.0, 12.364], abs=0.01)


@pytest.mark.parametrize("x", [0.0, 2.0])
def test_corner_under_the_end_of_the_boundary(x):
    """It presses on the last node; beside the boundary that sees it as nodes do."""
    across, up = force(block(edge(x)))
    assert up == pytest.approx(3.068, abs=1e-3)
    assert abs(across) <= 1e-6 * up
    assert not solve(block(edge(-0.01))).corner_figures


def test_axisymmetric_ring():
    """Per circumference as in the plane, within the tenth that rings bend otherwise."""
    held = [{"boundary": "top", "y": -OVERLAP}, fixed("left", "x")]
    material = {"young": 1000.0, "poisson": 0.3, "hypothesis": "axisymmetric"}
    for x in (1.025, 1.05):
        _, up = force(block(edge(x), material=material, displacement=held))
        assert up / (2 * math.pi * x) == pytest.approx(FORCES[x], rel=0.1)


def test_quadratic_facets():
    """Smooth and without sideways force, a third less than on linear ones."""
    forces = [force(block(edge(x), element={"degree": 2})) for x in (1.0, 1.025, 1.05)]
    assert np.abs(np.array(forces)[:, 0]).max() <= 1e-6
    assert np.array(forces)[1:, 1] == pytest.approx([9.157, 8.647], abs=1e-2)


@pytest.mark.mpi
def test_forms_as_scenes():
    """``ContactProblem`` has the same points."""
    mesh = forms.box((2.0, 1.0), [20, 10], forms.CELLS[2][1])
    V = vector_space(mesh)
    u, v = trial_and_test(V)
    given = fem.Function(V)
    given.x.array[1::2] = -OVERLAP
    held = fem.dirichletbc(given, fem.locate_dofs_topological(V, 1, forms.side(mesh, 1, 1.0)))
    contact = Foundation(forms.side(mesh, 1, 0.0), shape=edge(1.025), friction=Coulomb(0.3))
    nothing = no_load(mesh, v)
    problem = ContactProblem(forms.hooke(u, v), nothing, [held], contact)
    problem.solve()
    scene = solve(block(edge(1.025), contact=ROUGH))
    assert problem.state.forces[0] == pytest.approx(scene.contact.forces[0], abs=1e-9)


# --- nonlinear bodies ---


NEO_HOOKE = {"material": {"law": "neo-hooke", "young": 1000.0, "poisson": 0.3}}


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("x", "expected"),
    [
        (1.0, (0.0, 9.012)),
        (1.001, (0.319, 9.013)),
        (1.025, (0.830, 11.152)),
        (1.05, (0.005, 12.409)),
    ],
)
def test_force_on_a_nonlinear_body(x, expected):
    """It was 0, or (-3.71, 3.71) on a node; mirrored places have mirrored forces."""
    right = solve(block(edge(x), **NEO_HOOKE))
    left = solve(block(edge(2.0 - x), **NEO_HOOKE))
    assert right.contact.forces[0] == pytest.approx(expected, abs=1e-3)
    assert left.contact.forces[0] == pytest.approx([-expected[0], expected[1]], abs=1e-3)
    assert right.history.linear_solves <= 10


@pytest.mark.parametrize("body", [{}, NEO_HOOKE], ids=["linear", "neo-hooke"])
def test_beside_a_pair(body):
    """A block that another one presses on the edge: the pair transmits the same force."""
    meshes = [rectangle_mesh(n, 10, length=x, height=1.0) for x, n in ((2.0, 20), (1.0, 10))]
    scene = block(edge(1.0), **body)
    scene["body"] = [
        {"name": "lower", "mesh": meshes[0]},
        {"name": "upper", "mesh": meshes[1], "shift": [0.5, 1.0]},
    ]
    del scene["mesh"]
    scene["displacement"] = [
        {"boundary": "upper.top", "x": 0.0, "y": -OVERLAP},
        fixed("lower.left", "x"),
    ]
    below = scene["contact"] | {"boundary": "lower.bottom"}
    scene["contact"] = [{"boundary": "lower.top", "against": "upper.bottom"}, below]
    solution = solve(scene)
    between, on_edge = solution.contact.forces_of_each[:, 0, 1]
    assert on_edge > 5.0
    assert abs(between) == pytest.approx(on_edge, rel=1e-6)
    assert len(solution.corner_figures) == 1


def dragged(steps, **moves):
    """A rough body that is pressed on a blunt edge and dragged along it over three facets."""
    way = {"x": f"{0.3 if 'shift' not in moves else 0.0}*max(t-1,0)", "y": "-0.03*min(t,1)"}
    times = [1.0, *(1 + (k + 1) / steps for k in range(steps))]
    return block(
        edge(1.02, 20.0) | moves,
        contact=ROUGH,
        displacement={"boundary": "top"} | way,
        load_steps={"times": times},
        **NEO_HOOKE,
    )


@pytest.mark.slow
def test_corner_slides_over_facets():
    """The force depends on the way, not on its steps, nor on which of both has moved."""
    forces = [
        np.array(solve(scene).contact.forces)
        for scene in (dragged(3), dragged(6), dragged(3, shift=("-0.3*max(t-1,0)", "0")))
    ]
    assert forces[0] == pytest.approx(np.array([[1.4676, 17.0431], [-5.1129, 0.4403]]), abs=1e-3)
    assert forces[1] == pytest.approx(forces[0], abs=1e-5)
    assert forces[2] == pytest.approx(forces[0], abs=1e-5)


def test_restart_of_a_nonlinear_body(tmp_path):
    """A killed run goes on with the slip of the body that was under the corner."""
    scene = dragged(3)
    scene["load_steps"] = {"times": [1.0, 1.1, 1.2]}
    whole, again = whole_and_restarted(scene, tmp_path)
    assert np.array(again.contact.forces) == pytest.approx(np.array(whole.contact.forces), abs=1e-6)


@pytest.mark.parametrize("degree", [1, 2])
def test_second_variation_of_the_gap(degree):
    """Of a bent facet under a corner, against differences."""
    corners = read_shape(edge(0.4) | {"shift": (0.0, -0.03)}).corners(2)
    rng = np.random.default_rng(1)
    x = np.column_stack((np.linspace(0, 1, degree + 1), np.zeros(degree + 1)))
    x += 0.05 * rng.standard_normal(x.shape)
    nodes = np.arange(degree + 1)[None]

    def seen(u):
        line = BoundaryLine(nodes, (x + u.reshape(x.shape))[None], x[None])
        return line, CornerFeet.of(line, corners)

    def gap_and_slope(u):
        line, feet = seen(u)
        phi, _, normal, gap, _ = feet.rows(line, corners)
        k = int(np.flatnonzero(~feet.alone.ravel())[0])
        return gap[k], -np.outer(phi[k], normal[k]).ravel()

    steps = 1e-6 * np.eye(x.size)
    ahead, behind = ([gap_and_slope(sign * step) for step in steps] for sign in (1, -1))
    slopes = [(a[0] - b[0]) / 2e-6 for a, b in zip(ahead, behind, strict=True)]
    second = [(a[1] - b[1]) / 2e-6 for a, b in zip(ahead, behind, strict=True)]
    line, feet = seen(np.zeros(x.size))
    assert slopes == pytest.approx(gap_and_slope(np.zeros(x.size))[1], abs=1e-9)
    matrix = feet.stiffness(line, corners, np.where(feet.alone.ravel(), 0.0, 1.0)).matrix
    assert -matrix.toarray() == pytest.approx(np.array(second), abs=1e-8)


# --- what is said of it ---------------------------------------------------------------------------


def test_stress_has_no_limit():
    """As at a point force."""
    assert "it is at a corner of the foundation" in str(solve(block(edge(1.05))).stress.as_dict())


@pytest.mark.slow
def test_force_to_an_accuracy():
    """5.27, on facets that are smaller than the contact where the corner is."""
    solution = solve(block(edge(1.05), accuracy={"target": 0.05, "of": "force"}))
    assert solution.contact.forces[0] == pytest.approx([0.0, 5.27], abs=0.05)


def test_results(tmp_path):
    """A force is no pressure: corners have a table, a line and a list of their own."""
    solution = solve(block(edge(1.05)))
    write_results(solution, tmp_path, fields=False, pictures=False)
    summary = summary_in(tmp_path)
    assert summary["max_pressure"] == 0.0
    assert summary["touching_nodes"] == 0
    assert summary["contact_nodes"] == 21
    assert summary["pressure_integral"] == pytest.approx(12.363, abs=1e-3)
    (corner,) = summary["corners"]
    assert corner["place"] == [1.05, 0.0]
    assert corner["contact_force"] == pytest.approx([0.0, 12.363], abs=1e-3)
    assert corner["contact_width"] == pytest.approx(0.0124, abs=1e-4)
    rows = list(csv.DictReader((tmp_path / "corners.csv").read_text().splitlines()))
    assert [float(row["contact_force_y"]) for row in rows] == corner["contact_force"][1:]
    x = [
        float(row["x"])
        for row in csv.DictReader((tmp_path / "contact.csv").read_text().splitlines())
    ]
    assert x == sorted(x)
    assert len(x) == 21
    (line,) = [str(line) for line in brief_lines(summary) if "corner" in str(line)]
    assert "not resolved by facets of 0.1: it falls as they are refined" in line


def test_results_of_a_nonlinear_body(tmp_path):
    """The same, with pressures per present area."""
    solution = solve(block(edge(1.05), **NEO_HOOKE))
    summary = write_results(solution, tmp_path, fields=False, pictures=False)
    assert summary["max_pressure"] == 0.0
    assert summary["corners"][0]["contact_force"] == pytest.approx([0.005, 12.409], abs=1e-3)


@pytest.mark.parametrize("fault", ["foot moved", "dropped node kept", "side's normal", "left out"])
def test_certificate_finds_feet_itself(monkeypatch, fault):
    """The solver's points are changed; the certificate does not take them from it."""
    of, left_out, rows = CornerFeet.of.__func__, CornerFeet.left_out, CornerFeet.rows
    own = corner_feet.feet_of

    def feet(cls, line, corners):
        found = of(cls, line, corners)
        if fault == "foot moved":
            found.xi[~found.alone] += 0.1
        if fault == "left out":
            found.alone[:] = True
        return found

    monkeypatch.setattr(CornerFeet, "of", classmethod(feet))
    if fault == "dropped node kept":
        monkeypatch.setattr(CornerFeet, "left_out", lambda *given: left_out(*given) & False)
    if fault == "side's normal":
        side = np.array([math.sqrt(0.5), -math.sqrt(0.5)])

        def askew(self, line, corners):
            known = list(rows(self, line, corners))
            known[2] = np.tile(side, (len(known[2]), 1))
            return tuple(known)

        monkeypatch.setattr(CornerFeet, "rows", askew)
        monkeypatch.setattr(
            corner_feet, "feet_of", lambda *given: _unaskew(monkeypatch, rows, own(*given))
        )
    displacement = {"boundary": "top", "x": 0.008, "y": -OVERLAP}
    scene = parse_scene(block(edge(1.001), displacement=displacement))
    assert not solve(scene, check=False).certificate.holds


def _unaskew(monkeypatch, rows, found):
    """The rows of the certificate's feet are its own."""
    monkeypatch.setattr(CornerFeet, "rows", rows)
    return found


def test_warns_of_slip():
    """A linear body is pressed at the same point, however far it slides."""
    displacement = {"boundary": "top", "x": 0.03, "y": -OVERLAP}
    messages = [
        one.message for one in solve(block(edge(1.025), displacement=displacement)).findings
    ]
    assert any("of a facet along a corner of its foundation" in message for message in messages)
