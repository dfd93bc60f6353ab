"""The mesh decides whether a scene is one of the plane or of space; what has no meaning there is
refused by its key.
"""

import basix.ufl
import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import alone, example1
from spaces import block, box, friction_of

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

SPACE = block(3, bound=1.5)
PLANE = example1(bound=1.5, nx=6, ny=2)
TABLES = ("mesh", "material", "displacement", "traction", "contact", "solver")


def changed(scene, **more):
    """The scene with other tables."""
    return parse_scene({**{name: getattr(scene, name) for name in TABLES}, **more})


TETRAHEDRA = {"mesh": box("tetrahedra", (3, 1, 1))}
STRESSED = {"young": 1.0, "poisson": 0.3, "hypothesis": "plane stress"}
FOOT = {"boundary": "bottom"}
# What is changed, the key that the message names, and a word of the reason.
IN_SPACE = [
    ({"material": STRESSED}, "material[0].hypothesis", "plane stress and plane strain"),
    ({"contact": {**FOOT, "direction": [0.0, -1.0]}}, "contact[0].direction", "3 numbers, not 2"),
    ({"displacement": {**FOOT, "z": 0.0}}, "displacement[0]", "prescribes the normal displacement"),
    (
        {"element": {"volumetric": "reduced"}, **TETRAHEDRA},
        "element.volumetric",
        "linear tetrahedra",
    ),
]
IN_THE_PLANE = [
    ({"traction": {"boundary": "top", "z": 1.0}}, "traction[0].z", "nothing along x[2]"),
    ({"body_force": {"z": 0.0}}, "body_force.z", "nothing along x[2]"),
    ({"displacement": {"boundary": "left", "z": 0.0}}, "displacement[0].z", "nothing along x[2]"),
    ({"solver": {"initial_contact": "x[2] < 1"}}, "solver.initial_contact", "no x[2]"),
    ({"contact": {**FOOT, "gap": "0.1 * x[2]"}}, "contact[0].gap", "no x[2]"),
    (
        {"contact": {**FOOT, "friction": friction_of(bound="1 + x[2]")}},
        "contact[0].friction.bound",
        "no x[2]",
    ),
    (
        {"contact": {**FOOT, "direction": [0.0, 0.0, -1.0]}},
        "contact[0].direction",
        "2 numbers, not 3",
    ),
    (
        {"displacement": {**FOOT, "x": 0.0, "y": 0.0}},
        "displacement[0]",
        "prescribes the normal displacement",
    ),
]
CASES = [*((SPACE, *case) for case in IN_SPACE), *((PLANE, *case) for case in IN_THE_PLANE)]


@pytest.mark.parametrize("use", [solve, check_scene])
@pytest.mark.parametrize(("scene", "more", "path", "reason"), CASES)
def test_refused(use, scene, more, path, reason):
    """One error that names the key, by solving and by checking."""
    with pytest.raises(SceneError) as caught:
        use(changed(scene, **more), MPI.COMM_SELF)
    assert path in str(caught.value)
    assert reason in str(caught.value)


def surface(points):
    """A mesh of one triangle and its neighbour, with points in 3D."""
    element = basix.ufl.element("Lagrange", "triangle", 1, shape=(3,))
    mesh = dmesh.create_mesh(
        MPI.COMM_SELF, np.array([[0, 1, 2], [1, 3, 2]]), x=np.array(points, dtype=float), e=element
    )
    return tag_boundaries(mesh, {"bottom": lambda x: x[0] < 1e-9})


@pytest.mark.parametrize("last", [(1, 1, 0), (1, 1, 1)])
def test_surfaces_in_space(last):
    """A shell, or a planar mesh whose points have three coordinates, is no body."""
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), last]
    with pytest.raises(MeshError, match=r"surface in 3D .*gdim = 2"):
        load_mesh(changed(SPACE, mesh=surface(points)), MPI.COMM_SELF)


def test_a_mesh_of_a_line_is_no_body():
    """Neither are intervals."""
    mesh = dmesh.create_interval(MPI.COMM_SELF, 3, (0.0, 1.0))
    tagged = tag_boundaries(mesh, {"bottom": lambda x: x[0] < 1e-9})
    with pytest.raises(MeshError, match="dimension 1"):
        load_mesh(changed(SPACE, mesh=tagged), MPI.COMM_SELF)


def test_coordinates_of_an_expression():
    """The largest index that it uses."""
    assert [
        Expression(text).coordinates for text in ("1", "x[0]", "x[1] + x[0]", "min(x[0], x[2])")
    ] == [0, 1, 2, 3]


def test_symmetry_planes_and_three_numbers():
    """A quarter of a block behaves like the whole: normal = 0 on two planes, a gap by a callable
    along a direction.
    """

    def whole(mesh, **more):
        return parse_scene(
            {
                "mesh": mesh,
                "material": {"young": 5000.0, "poisson": 0.3},
                "traction": {"boundary": "top", "z": "-20 if x[0] <= 1 and x[1] <= 0.5 else 0"},
                "contact": {
                    "boundary": "bottom",
                    "direction": [0.0, 0.0, -2.0],
                    "gap": lambda x: 0.002 * (x[0] ** 2 + x[1] ** 2),
                    "friction": {"law": "coulomb", "coefficient": 0.3},
                },
                "solver": {"gamma_n": 1e7, "gamma_t": 1e7, "tolerance": 1e-10},
                **more,
            }
        )

    quarter = alone(
        whole(
            box("hexahedra", (8, 4, 4), size=(2.0, 1.0, 1.0)),
            displacement=[
                {"boundary": "left", "normal": 0.0},
                {"boundary": "front", "normal": 0.0},
            ],
        )
    )
    tagged = box("hexahedra", (16, 8, 4), size=(4.0, 2.0, 1.0))
    tagged.mesh.geometry.x[:, :2] -= (2.0, 1.0)
    full = alone(
        whole(
            tagged,
            traction={"boundary": "top", "z": "-20 if abs(x[0]) <= 1 and abs(x[1]) <= 0.5 else 0"},
        )
    )
    ours, theirs = quarter.table.columns, full.table.columns
    here = (theirs["x"] > -1e-9) & (theirs["y"] > -1e-9)
    np.testing.assert_allclose(
        ours["pressure"], theirs["pressure"][here], rtol=0, atol=1e-6 * ours["pressure"].max()
    )
    inner = (ours["x"] > 1e-9) & (ours["y"] > 1e-9)
    for name in ("shear_x", "shear_y"):
        np.testing.assert_allclose(ours[name][inner], theirs[name][here][inner], rtol=0, atol=1e-5)
