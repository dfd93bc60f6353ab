"""Convex corners of foundations between two nodes: what does not feel them says so, with place, depth and cure."""

import math

import forms
import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from on_meshes import trial_and_test, vector_space
from scene_tables import box_mesh, coulomb_friction, fixed, rectangle_mesh, tresca_friction

from signorini_fx import ContactProblem, ConvergenceError, Foundation, Tresca, solve
from signorini_fx.records import Status
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
OVERLAP = 0.02


def edge(x, angle=45.0):
    """A wedge whose sides fall by an angle on both sides of the tip at (x, 0)."""
    fall = 2.0 * math.tan(math.radians(angle))
    return {"shape": "polyline", "points": ((x - 2.0, -fall), (x, 0.0), (x + 2.0, -fall))}


def block(foundation, nx=20, contact=None, **entries):
    """A block 2 x 1, pressed on a foundation by 0.02 along y; ``contact``: its further keys."""
    sizes = {"length": 2.0, "height": 1.0, "nx": nx, "ny": nx // 2}
    scene = {
        "mesh": rectangle_mesh(**sizes),
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.0, "y": -OVERLAP},
        "contact": {"boundary": "bottom", "foundation": foundation} | (contact or {}),
    }
    return scene | entries


def brick(foundation, n=5, **entries):
    """A brick 1 x 1 x 0.5, pressed on a foundation by 0.02 along z."""
    sizes = {"length": 1.0, "width": 1.0, "height": 0.5, "nx": n, "ny": n, "nz": 3}
    scene = {
        "mesh": box_mesh(**sizes),
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.0, "y": 0.0, "z": -OVERLAP},
        "contact": {"boundary": "bottom", "foundation": foundation},
    }
    return scene | entries


def failed(scene):
    """The solution of a scene that has none, and its advice."""
    with pytest.raises(ConvergenceError) as error:
        solve(scene)
    return error.value.solution, str(error.value)


# A bound of friction is a stress, which a corner has no area for.
TRESCA = {"friction": tresca_friction(1.0)}
NEO_HOOKE = {"material": {"law": "neo-hooke", "young": 1000.0, "poisson": 0.3}}


@pytest.mark.parametrize(
    "keys", [{"contact": TRESCA}, {"contact": TRESCA} | NEO_HOOKE], ids=["linear", "neo-hooke"]
)
@pytest.mark.parametrize("x", [1.025, 1.05])
def test_edge_without_contact_points(x, keys):
    """The force was 0, or beside a node (-3.64, 3.64), *converged*."""
    solution, advice = failed(block(edge(x), **keys))
    assert solution.status is Status.CORNER
    assert f"its corner at ({x:.4g}, 0) is 0.0" in advice
    assert "round it off with a radius of at least 0.2" in advice


def test_edge_on_a_node():
    """The normal is the mean of both sides, not that of one of them, which gave (3.66, 3.66)."""
    force, _ = solve(block(edge(1.0))).contact.forces
    assert force == pytest.approx([0.0, 8.9336], abs=1e-4)


def test_rounded_as_the_advice_says():
    """Nodes feel a rounding of two facets, up to a tenth; the tip is where it was."""
    forces = []
    for x in (1.0, 1.05):
        radius, sine = 0.2, math.sin(math.radians(45.0))
        tip = [x, radius * (1 / sine - 1)]
        cone = {"shape": "cone", "tip": tip, "axis": [0.0, -1.0], "angle": 45.0, "radius": radius}
        forces.append(solve(block(cone, contact=TRESCA)).contact.forces[0])
    assert [up for _, up in forces] == pytest.approx([8.93, 8.52], rel=0.05)


def test_edge_that_a_force_moves():
    """It sank between two nodes until its sides met them."""
    driven = edge(1.05) | {"pivot": (1.05, 0.0), "force": (0.0, 5.0)}
    driven |= {"prescribed": {"x": 0.0, "rotation": 0.0}}
    held = fixed("top")
    solution, advice = failed(block(driven, displacement=held))
    assert solution.status is Status.CORNER
    assert "its corner at (1.05, 0.05" in advice


@pytest.mark.mpi
def test_each_load_step():
    """The first load step ends before the edge is reached."""
    moved = edge(1.05) | {"shift": ("0", "-0.03")}
    factors = {"boundary": "top", "x": 0.0, "y": -OVERLAP, "factors": [1.0, 3.0]}
    solution, advice = failed(block(moved, contact=TRESCA, displacement=factors))
    assert [step.status for step in solution.steps] == [Status.CONVERGED, Status.CORNER]
    assert "its corner at (1.05, -0.03) is 0.0293 below a facet of 0.0997" in advice


@pytest.mark.parametrize("body", [{}, NEO_HOOKE], ids=["linear", "neo-hooke"])
@pytest.mark.parametrize("radius", [0.0, 0.0625], ids=["sharp", "rounded"])
@pytest.mark.parametrize("tip", [(0.5, 0.5), (0.4, 0.5)], ids=["in a facet", "on an edge"])
def test_tip_of_a_cone(tip, radius, body):
    """Two of the sides of a brick of five cells are no nodes; the place is where the cone is
    highest, however it is rounded.
    """
    sine = 0.8
    cone = {"shape": "cone", "tip": (*tip, radius / sine - radius), "axis": (0.0, 0.0, -1.0)}
    cone |= {"angle": math.degrees(math.asin(sine)), "radius": radius}
    solution, advice = failed(brick(cone, **body))
    assert solution.status is Status.CORNER
    assert f"its corner at ({tip[0]:g}, {tip[1]:g}, 0) is 0.02 below" in advice


def test_a_sharp_end_over_an_edge():
    """Rubber slides over an edge with F = 1: *not solved* says why, and what to round off."""
    moved = {"boundary": "top", "x": "0.1*t", "y": -OVERLAP}
    contact = {"friction": coulomb_friction(1.0)}
    scene = block(edge(2.0), contact=contact, displacement=moved, **NEO_HOOKE)
    scene["mesh"]["parameters"]["cell"] = "triangle"
    _, advice = failed(scene | {"load_steps": {"times": [0.5, 1.0]}})
    assert "is beside the corner of the foundation at (2, 0)" in advice
    assert "chamfer the body or round off the corner, by at least" in advice


def test_tip_of_a_cone_on_a_node():
    """It was (.92, .92, 1.30) on a finer mesh."""
    cone = {"shape": "cone", "tip": (0.4, 0.6, 0.0), "axis": (0.0, 0.0, -1.0), "angle": 45.0}
    force, _ = solve(brick(cone)).contact.forces
    assert force[:2] == pytest.approx(0.0, abs=0.05 * force[2])
    assert force[2] > 0


def wedge_file(folder):
    """An STL file of a wedge along y, whose edge is at x = z = 0."""
    x = np.array([[along, y, -abs(along)] for y in (-1.0, 2.0) for along in (-1.0, 0.0, 1.0)])
    faces = [[0, 1, 2], [3, 5, 4], [0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2], [0, 2, 5], [0, 5, 3]]
    lines = ["solid wedge"]
    for face in faces:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {' '.join(map(str, point))}" for point in x[face]]
        lines += ["endloop", "endfacet"]
    path = folder / "wedge.stl"
    path.write_text("\n".join([*lines, "endsolid wedge", ""]))
    return path


@pytest.mark.mpi
@pytest.mark.parametrize("turned", [0.0, 25.0])
def test_edge_of_a_surface(tmp_path_factory, turned):
    """It passes between the nodes, along a row of them or askew."""
    folder = COMM.bcast(tmp_path_factory.mktemp("wedge") if COMM.rank == 0 else None)
    file = wedge_file(folder) if COMM.rank == 0 else None
    COMM.barrier()
    wedge = {
        "shape": "surface",
        "file": folder / "wedge.stl",
        "shift": (0.51, 0.3, 0.0),
        "rotation": (0.0, 0.0, turned),
    }
    assert file is None or file.is_file()
    solution, advice = failed(brick(wedge))
    assert solution.status is Status.CORNER
    assert ", 0) is 0.0" in advice


def test_corners_of_shapes():
    """Convex ones alone, in both directions of a closed line, and the others where it is hollow."""
    from signorini_fx.mechanics.statement.rigid_shape import read_shape

    star = [(0.0, 0.0), (2.0, 0.0), (1.0, 0.5), (0.0, 2.0), (0.0, 0.0)]
    for points in (star, star[::-1]):
        shape = read_shape({"shape": "polyline", "points": points, "shift": (1.0, 0.0)})
        assert sorted(map(tuple, shape.corners(2).places)) == [(1.0, 0.0), (1.0, 2.0), (3.0, 0.0)]
        hollow = shape.model_copy(update={"hollow": True})
        assert hollow.corners(2).places.tolist() == [[2.0, 0.5]]
    cone = read_shape(
        {"shape": "cone", "tip": (0.0, 0.0), "axis": (0.0, -1.0), "angle": 30.0, "radius": 0.1}
    )
    assert cone.corners(2).places[0] == pytest.approx([0.0, -0.2])


def test_check_names_corners_and_radius():
    """Before anything is solved; the corners below a box point away from the body."""
    box = {
        "shape": "polyline",
        "points": ((0.55, 0.0), (0.55, -1.0), (1.45, -1.0), (1.45, 0.0), (0.55, 0.0)),
    }
    (finding,) = [
        one for one in check_scene(parse_scene(block(box))).findings if "corners" in one.message
    ]
    assert finding.path == "contact[0].foundation"
    assert "at (0.55, 0), (1.45, 0): facets there are 0.1 long" in finding.message
    assert finding.message.endswith("a radius of at least 0.2")


def test_forms_say_where():
    """The message of ``solve`` has the place; the block in the air over the edge comes first in a loop of one's own."""
    mesh = forms.box((2.0, 1.0), [20, 10])
    V = vector_space(mesh)
    u, v = trial_and_test(V)
    pressed = fem.Constant(mesh, (0.0, 0.01))
    top = fem.locate_dofs_topological(V, 1, forms.side(mesh, 1, 1.0))
    given = fem.Function(V)
    contact = Foundation(forms.side(mesh, 1, 0.0), shape=edge(1.05), friction=Tresca(1.0))
    problem = ContactProblem(
        forms.hooke(u, v), ufl.inner(pressed, v) * ufl.dx, [fem.dirichletbc(given, top)], contact
    )
    problem.solve()
    problem.advance()
    given.x.array[1::2] = -OVERLAP
    with pytest.raises(
        ConvergenceError, match=r"inside the body: contact\[0\].shape: its corner at \(1.05, 0\)"
    ):
        problem.solve()
