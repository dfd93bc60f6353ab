"""Resultants, points of action and the friction used against statics, on any number of ranks."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import alone, example1
from spaces import block as block_in_space
from spaces import box

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.results.files import write_results
from signorini_fx.results.summary import lines_of
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
STEEL = {"young": 1000.0, "poisson": 0.3}
LENGTH, HEIGHT, DEPTH = 2.0, 3.0, 1.5
# Cells and degree in 2D.
PLANE = [("quadrilateral", 1), ("triangle", 2)]
SPACE = [("hexahedra", 1), ("tetrahedra", 2)]
COULOMB = coulomb_friction(0.6)


def plane(cell="quadrilateral", degree=1, **effects):
    """A rectangle from the origin."""
    size = {"length": LENGTH, "height": HEIGHT, "nx": 6, "ny": 5, "cell": cell}
    mesh = rectangle_mesh(**size)
    return parse_scene({"mesh": mesh, "element": {"degree": degree}, "material": STEEL, **effects})


def space(cells="hexahedra", degree=1, **effects):
    """A box from the origin."""
    mesh = box(cells, (4, 3, 4), size=(LENGTH, DEPTH, HEIGHT), comm=COMM)
    return parse_scene({"mesh": mesh, "element": {"degree": degree}, "material": STEEL, **effects})


def near(expected, scale):
    """The same, to the residual that the iteration leaves, of numbers of this size."""
    return pytest.approx(np.asarray(expected), rel=0, abs=1e-8 * scale)


@pytest.mark.mpi
@pytest.mark.parametrize(("cells", "degree"), SPACE)
def test_clamped_beam_in_space(cells, degree):
    """Force and all three moments, of a load that bends and twists."""
    load = {"boundary": "right", "x": 1.0, "y": "x[2]", "z": "2 * x[1]"}
    beam = space(cells, degree, displacement=fixed("left", "xyz"), traction=load)
    found = solve(beam, COMM).resultants
    area, (y, z) = DEPTH * HEIGHT, (DEPTH / 2, HEIGHT / 2)
    force = np.array([1.0, z, 2 * y]) * area
    # r x t over the end x[0] = LENGTH: the squares of x[1] and x[2] have means DEPTH^2 / 3 and
    # HEIGHT^2 / 3.
    twist = 2 * DEPTH**2 / 3 - HEIGHT**2 / 3
    moment = np.array([twist, z - 2 * LENGTH * y, LENGTH * z - y]) * area
    size = 2 * np.abs(moment).max()
    assert found.of("right").force == near(force, size)
    assert found.of("right").moment == near(moment, size)
    assert found.of("left").force == near(-force, size)
    assert found.of("left").moment == near(-moment, size)
    # On the flat end no moment is left but that along its normal.
    acts_at = found.of("right").acts_at
    assert acts_at[0] == near(LENGTH, 1.0)
    assert found.of("right").moment_about(acts_at)[1:] == near([0.0, 0.0], size)


@pytest.mark.mpi
@pytest.mark.one_quick("where", ["plane", "space", "quadratic tetrahedra"])
def test_balance(where):
    """With supports, loads and contact: of all forces and moments nothing is left, about any
    point.
    """
    if where == "plane":
        scene = example1(coefficient=0.3, nx=24, ny=8)
        scene = scene.model_copy(
            update={"body_force": plane(body_force={"x": "x[1]", "y": -1.0}).body_force}
        )
    else:
        cells, degree = ("hexahedra", 1) if where == "space" else ("tetrahedra", 2)
        scene = block_in_space(6, cells, coefficient=0.3, gamma="auto", degree=degree, comm=COMM)
    found = solve(scene, COMM).resultants.every()
    point = np.array([0.3, -7.0, 2.0])[: 2 if where == "plane" else 3]
    size = max(one.size[0] for one in found)
    assert size > 1.0
    np.testing.assert_allclose(sum(one.force for one in found), 0.0, atol=1e-9 * size)
    np.testing.assert_allclose(sum(one.moment_about(point) for one in found), 0.0, atol=1e-8 * size)
    assert {one.acts for one in found} == {("support",), ("traction",), ("contact",)} | (
        {("body force",)} if where == "plane" else set()
    )


@pytest.mark.mpi
@pytest.mark.one_quick("push", [0.2, 0.6, 0.9])
@pytest.mark.parametrize(("cell", "degree"), PLANE)
def test_block_that_may_tip(cell, degree, push):
    """A heavy block pushed sideways uses H / F W of its friction, and is pressed at one end."""
    weight, overturning = 1.5, push * HEIGHT / 2
    scene = plane(
        cell,
        degree,
        body_force={"y": -weight / (LENGTH * HEIGHT)},
        traction={"boundary": "left", "x": push / HEIGHT},
        contact={"boundary": "bottom", "friction": COULOMB | {"coefficient": 2.0}},
    )
    solution = solve(scene, COMM)
    (foot,) = solution.contact_figures
    assert foot.pressure_integral == pytest.approx(weight, rel=1e-8)
    assert foot.tangential_force == pytest.approx(push, rel=1e-8)
    assert foot.friction_limit == pytest.approx(2.0 * weight, rel=1e-8)
    assert foot.mean_pressure * foot.contact_area == pytest.approx(weight, rel=1e-8)
    assert foot.touching_nodes == np.count_nonzero(solution.table.columns["pressure"] > 0)
    assert foot.area == pytest.approx(LENGTH)
    assert solution.friction_used == pytest.approx(push / (2.0 * weight), rel=1e-6)
    assert solution.resultants.of("bottom").acts_at == near(
        [LENGTH / 2 + overturning / weight, 0.0], 1.0
    )


@pytest.mark.mpi
def test_two_feet():
    """The base of a body on two feet reaches from one to the other; each foot has its own
    figures.
    """
    mesh = dmesh.create_rectangle(COMM, [(0.0, 0.0), (4.0, 1.0)], (16, 4))
    sides = {
        "one": lambda x: np.isclose(x[1], 0.0) & (x[0] < 1.01),
        "other": lambda x: np.isclose(x[1], 0.0) & (x[0] > 2.99),
        "top": lambda x: np.isclose(x[1], 1.0) & (x[0] > 1.99),
    }
    scene = parse_scene(
        {
            "mesh": tag_boundaries(mesh, sides),
            "material": STEEL,
            "traction": {"boundary": "top", "y": -1.0},
            "contact": [
                {"boundary": "one", "friction": COULOMB},
                {"boundary": "other", "friction": COULOMB},
            ],
        }
    )
    solution = solve(scene, COMM)
    one, other = solution.contact_figures
    assert (one.boundary, other.boundary) == ("one", "other")
    assert one.pressure_integral + other.pressure_integral == pytest.approx(2.0, rel=1e-8)
    assert (one.area, other.area) == (pytest.approx(1.0), pytest.approx(1.0))
    assert solution.friction_used == 0.0


@pytest.mark.mpi
def test_support_and_contact_on_one_boundary():
    """The foundation presses, and what the push needs the support takes; with the factors of the
    last load step.
    """
    scene = plane(
        displacement=fixed("bottom", "x"),
        traction={"boundary": "top", "x": 0.4, "y": -2.0, "factors": [2.0, 0.5]},
        contact={"boundary": "bottom", "friction": COULOMB},
    )
    found = solve(scene, COMM).resultants
    assert found.of("top").force == near([0.2 * LENGTH, -LENGTH], 1.0)
    foot = found.of("bottom")
    assert foot.acts == ("support", "contact")
    assert foot.force == near([-0.2 * LENGTH, LENGTH], 1.0)
    # The load acts at the middle of the top; the push moves the place at the bottom by HEIGHT times
    # its share.
    assert foot.acts_at == near([LENGTH / 2 + 0.2 * HEIGHT, 0.0], 1.0)


def test_summary(tmp_path):
    """What statics say is zero is zero in the rows, and the terminal has a line for each figure."""
    scene = plane(
        traction=[{"boundary": "top", "y": -3.0}, {"boundary": "left", "x": 0.5}],
        contact={"boundary": "bottom", "friction": COULOMB},
    )
    solution = alone(scene)
    found = write_results(solution, tmp_path, fields=False, pictures=False)
    rows = {row["boundary"]: row for row in found["resultants"]}
    assert rows["top"]["force"] == [0.0, pytest.approx(-6.0)]
    assert rows["left"]["force"] == [pytest.approx(1.5), 0.0]
    assert rows["left"]["moment"] == pytest.approx(-1.5 * HEIGHT / 2)
    assert rows["left"]["acts_at"] == [0.0, pytest.approx(HEIGHT / 2)]
    assert rows["bottom"]["acts_at"][1] == 0.0
    lines = [" ".join(str(line).split()) for line in lines_of(found, tmp_path)]
    assert "friction bottom: 1.5, at most 3.6" in lines
    assert "friction 42 % used" in lines
    assert "forces top: (0, -6) by traction, acts at (1, 3)" in lines
    assert "left: (1.5, 0) by traction, acts at (0, 1.5)" in lines


def test_mistakes():
    """A boundary that the mesh has not, and a point of another dimension."""
    found = alone(plane(displacement=fixed("left"))).resultants
    with pytest.raises(MeshError, match="no boundary 'nose'"):
        found.of("nose")
    with pytest.raises(ValueError, match="2 coordinates"):
        found.of("left", about=[0.0, 0.0, 0.0])
