"""Foundations that are things: distances and normals by brute force, contact against the same by
formula, Hertz.
"""

import subprocess
import sys

import forms
import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from on_meshes import no_load, trial_and_test, vector_space
from scene_tables import (
    box_mesh,
    circle_shape,
    coulomb_friction,
    fixed,
    floor,
    plane_shape,
    rectangle_mesh,
)

from signorini_fx import ContactProblem, Coulomb, FormError, Foundation, SceneError, solve
from signorini_fx.mechanics.statement.rigid_shape import distance_from, read_shape
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
HILL = ((-1.5, 0.0), (-1.0, 0.5), (0.0, 0.2), (1.0, 0.6), (1.5, 0.0))
LOOP = ((-1.0, 0.0), (0.0, -1.0), (1.0, 0.0), (0.2, 0.8), (-1.0, 0.0))
# Rotations and shifts among them.
PLANE = [
    {"shape": "plane", "point": (0.1, -0.3), "normal": (0.2, 3.0), "rotation": 20.0},
    {"shape": "circle", "centre": (0.1, -0.3), "radius": 0.7, "shift": (0.2, 0.1)},
    {"shape": "circle", "centre": (0.1, -0.3), "radius": 0.7, "hollow": True},
    {"shape": "cone", "tip": (0.0, 0.1), "axis": (0.3, -1.0), "angle": 50.0, "radius": 0.2},
    {"shape": "polyline", "points": HILL},
    {"shape": "polyline", "points": LOOP, "rotation": 30.0, "pivot": (0.5, 0.5)},
]
TURN = {"rotation": (10.0, -20.0, 30.0), "pivot": (0.1, 0.2, 0.3), "shift": (0.05, 0.0, -0.1)}
SPACE = [
    {"shape": "plane", "point": (0.1, -0.3, 0.0), "normal": (0.2, 3.0, 1.0), **TURN},
    {"shape": "sphere", "centre": (0.1, -0.3, 0.0), "radius": 0.7, **TURN},
    {
        "shape": "cylinder",
        "centre": (0.1, -0.3, 0.0),
        "axis": (1.0, 2.0, 0.0),
        "radius": 0.7,
        "hollow": True,
    },
    {"shape": "cone", "tip": (0.0, 0.1, 0.0), "axis": (0.3, -1.0, 0.2), "angle": 50.0, **TURN},
    {
        "shape": "cone",
        "tip": (0.0, 0.1, 0.0),
        "axis": (0.3, -1.0, 0.2),
        "angle": 70.0,
        "radius": 0.3,
    },
]


def gmsh_files(folder):
    """A cube and a ball of radius 1 as STEP, and as STL the cube in binary and the ball in text; a
    disc with a hole.
    """
    code = f"""
import math
import gmsh
gmsh.initialize()
for name in ("cube", "ball"):
    gmsh.clear()
    gmsh.model.occ.addBox(-1, -1, -1, 2, 2, 2) if name == "cube" else gmsh.model.occ.addSphere(0, 0, 0, 1)
    gmsh.model.occ.synchronize()
    gmsh.write({str(folder)!r} + f"/{{name}}.step")
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.1)
    gmsh.option.setNumber("Mesh.Binary", int(name == "cube"))
    gmsh.model.mesh.generate(2)
    gmsh.write({str(folder)!r} + f"/{{name}}.stl")
for name, angle in (("disc", math.pi), ("tilted", 0.1)):  # the first is seen from below
    gmsh.clear()
    disc, hole = gmsh.model.occ.addDisk(0, 0, 0, 1, 1), gmsh.model.occ.addDisk(0.2, 0, 0, 0.3, 0.3)
    gmsh.model.occ.rotate(gmsh.model.occ.cut([(2, disc)], [(2, hole)])[0], 0, 0, 0, 1, 0, 0, angle)
    gmsh.model.occ.synchronize()
    gmsh.write({str(folder)!r} + f"/{{name}}.step")
for name, low in (("touching", 1.0), ("overlapping", 0.5), ("flat", 1.0)):
    gmsh.clear()
    for x, y, size in ((-1, -1, 2), (low, -0.5, 1)):
        flat = (x, y, 0, 3 - low if x > 0 else 2, size)
        gmsh.model.occ.addRectangle(*flat) if name == "flat" else gmsh.model.occ.addBox(x, y, y, *flat[3:], size)
    gmsh.model.occ.synchronize()
    gmsh.write({str(folder)!r} + f"/{{name}}.step")
gmsh.clear()
gmsh.model.occ.addBox(-1, -1, -1, 2, 2, 2), gmsh.model.occ.addBox(1, 1, -1, 2, 2, 2)
gmsh.model.occ.synchronize()
gmsh.write({str(folder)!r} + "/beside.step")
"""
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The folder of the files, written by the first rank."""
    folder = COMM.bcast(tmp_path_factory.mktemp("solids") if COMM.rank == 0 else None)
    if COMM.rank == 0:
        gmsh_files(folder)
    COMM.barrier()
    return folder


def cube(x):
    """The signed distance from the cube."""
    beyond = np.abs(x) - 1.0
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)


def on_the_surface(shape, dim, count=5_000):
    """Points where the signed distance is zero, found by steps along its gradient from anywhere."""
    x = np.random.default_rng(8).uniform(-3, 3, (count, dim))
    for _ in range(40):
        signed, normal = shape.distance(x)
        x = x - signed[:, None] * normal
    return x[np.abs(shape.distance(x)[0]) < 1e-12]


# --- distances ------------------------------------------------------------------------------------


@pytest.mark.parametrize("table", [*PLANE, *SPACE], ids=lambda table: table["shape"])
def test_distance_and_normal(table):
    """The gradient has the length one and is the normal; no point of the surface is closer, and one
    is as close.
    """
    shape = read_shape(table)
    dim = 2 if table in PLANE else 3
    x = np.random.default_rng(8).uniform(-1.5, 1.5, (300, dim))
    signed, normal = shape.distance(x)
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0, abs=1e-13)
    step = 1e-6
    around = [[shape.distance(x + way * step * e) for way in (1, -1)] for e in np.eye(dim)]
    slope = np.stack([(ahead[0] - behind[0]) / (2 * step) for ahead, behind in around], axis=1)
    # Between two closest points the gradient jumps.
    alone = np.all(
        [np.linalg.norm(one[1] - normal, axis=1) < 1e-3 for pair in around for one in pair], axis=0
    )
    assert np.mean(alone) > 0.98
    assert slope[alone] == pytest.approx(normal[alone], abs=1e-7)
    foot = x - signed[:, None] * normal
    assert shape.distance(foot)[0] == pytest.approx(0.0, abs=1e-12)
    from scipy.spatial import cKDTree

    nearest, _ = cKDTree(on_the_surface(shape, dim)).query(x)
    assert (nearest > np.abs(signed) - 1e-9).all()
    assert (signed > 0).any()
    assert (signed < 0).any()


@pytest.mark.one_quick("name", ["cube.stl", "cube.step"])
def test_surfaces_of_files(files, name):
    """The distance from a cube, on its faces, edges and corners, placed and turned."""
    x = np.random.default_rng(8).uniform(-2, 2, (500, 3))
    shape = read_shape({"shape": "surface", "file": files / name, "scale": 0.5})
    signed, normal = shape.distance(x)
    assert signed == pytest.approx(cube(2 * x) / 2, abs=1e-14)
    assert shape.inradius == pytest.approx(0.5)
    assert np.isinf(read_shape({"shape": "surface", "file": files / name, "hollow": True}).inradius)
    moved = read_shape({"shape": "surface", "file": files / name, "scale": 0.5, **TURN})
    q = moved.turn_matrix(3)
    there = (x - np.array(TURN["pivot"])) @ q.T + np.array(TURN["pivot"]) + np.array(TURN["shift"])
    assert moved.distance(there)[0] == pytest.approx(signed, abs=1e-13)
    assert moved.distance(there)[1] == pytest.approx(normal @ q.T, abs=1e-12)
    face = np.array([[0.5, 0.1, 0.2], [-0.1, -0.5, 0.3]])
    signed, normal = shape.distance(face)
    assert (signed, normal) == (
        pytest.approx(0.0, abs=1e-15),
        pytest.approx(np.array([[1.0, 0, 0], [0, -1, 0]])),
    )


def test_a_plane_mesh_is_a_shape(tmp_path):
    """Its rim, whichever way its cells are turned; a hole is outside."""
    import meshio

    x = np.array([(i, j) for j in range(4) for i in range(4)], dtype=float)
    cells = [[k, k + 1, k + 5, k + 4] for k in (0, 1, 2, 4, 6, 8, 9, 10)]  # around [1, 2]^2
    cells[0], cells[3] = cells[0][::-1], cells[3][::-1]
    meshio.write(
        tmp_path / "frame.vtu",
        meshio.Mesh(np.column_stack((x, 0 * x[:, 0])), {"quad": np.array(cells)}),
    )
    shape = read_shape({"shape": "surface", "file": tmp_path / "frame.vtu"})
    at = np.random.default_rng(8).uniform(-1, 4, (400, 2))

    def square(x, half):
        beyond = np.abs(x - 1.5) - half
        return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)

    assert shape.inradius == pytest.approx(0.5)
    outside, hole = square(at, 1.5), square(at, 0.5)
    assert shape.distance(at)[0] == pytest.approx(
        np.where(hole < 0, -hole, np.maximum(outside, -hole)), abs=1e-13
    )


@pytest.mark.one_quick("size", [0.05, 5e-3])
def test_a_plane_drawing_is_a_shape(files, size):
    """A disc with a hole, with few and with many lines around it: distances are exact but for their
    sag.
    """
    at = np.random.default_rng(8).uniform(-1.5, 1.5, (300, 2))
    signed, normal = read_shape(
        {"shape": "surface", "file": files / "disc.step", "size": size}
    ).distance(at)
    from_hole = at - [0.2, 0.0]
    outside, inside = np.linalg.norm(at, axis=1) - 1.0, 0.3 - np.linalg.norm(from_hole, axis=1)
    assert signed == pytest.approx(np.maximum(outside, inside), abs=size**2)
    exact = np.where((outside > inside)[:, None], at, -from_hole)
    clear = (np.abs(outside - inside) > 0.1) & (np.abs(signed) > 0.1)
    assert normal[clear] == pytest.approx(
        exact[clear] / np.linalg.norm(exact[clear], axis=1)[:, None], abs=2 * size
    )
    with pytest.raises(SceneError, match="not in a plane"):
        distance_from({"shape": "surface", "file": files / "tilted.step"}, 2)


# --- the same by formula --------------------------------------------------------------------------


def block(dim=3, comm=COMM, kind=None, scale=1.0):
    """The mesh of a block; two of them may be distributed differently."""
    counts = (8, 4) if dim == 2 else (6, 4, 3)
    return forms.box(tuple(scale * c for c in (2.0, 1.0, 1.0)[:dim]), list(counts), kind, comm)


def pressed(shape=None, mesh=None, degree=1, scale=1.0, **data):
    """A block whose top is pressed on a foundation below it."""
    mesh = mesh or block(comm=MPI.COMM_SELF)
    dim = mesh.geometry.dim
    space = vector_space(mesh, degree)
    u, v = trial_and_test(space)
    a = 1000.0 / scale ** (dim - 2) * ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))) * ufl.dx
    down = np.zeros(dim)
    down[0], down[-1] = 0.01 * scale, -0.06 * scale
    top = fem.locate_dofs_topological(space, dim - 1, forms.side(mesh, dim - 1, scale))
    bottom = forms.side(mesh, dim - 1, 0.0)
    zero = no_load(mesh, v)
    found = Foundation(bottom, shape=shape, friction=Coulomb(0.3), **data)
    problem = ContactProblem(a, zero, [fem.dirichletbc(down, top, space)], contact=[found])
    return problem, problem.solve()


def of_a_ball(centre, radius):
    """Gap and direction to a ball by formula."""

    def away(x):
        return x[: len(centre)] - np.array(centre)[:, None]

    return {"gap": lambda x: np.hypot.reduce(away(x)) - radius, "direction": lambda x: -away(x)}


def of_a_rod(height, radius, offset):
    """Gap and direction to a cylinder along x[1] by formula."""
    in_section = of_a_ball((offset, height), radius)
    return {
        "gap": lambda x: in_section["gap"](x[[0, 2]]),
        "direction": lambda x: np.insert(in_section["direction"](x[[0, 2]]), 1, 0.0, axis=0),
    }


def of_a_slope(normal, height):
    """Gap and direction to a plane through (0, ..., -height) by formula."""
    n = np.array(normal) / np.linalg.norm(normal)
    return {"gap": lambda x: n @ x[: n.size] + height * n[-1], "direction": -n}


SAME = {
    "circle": (2, circle_shape((0.9, -1.51), 1.5), of_a_ball((0.9, -1.51), 1.5)),
    "sphere": (
        3,
        {"shape": "sphere", "centre": (0.9, 0.5, -1.51), "radius": 1.5},
        of_a_ball((0.9, 0.5, -1.51), 1.5),
    ),
    "cylinder": (
        3,
        {"shape": "cylinder", "centre": (0.9, 7.0, -1.51), "axis": (0, -2, 0), "radius": 1.5},
        of_a_rod(-1.51, 1.5, 0.9),
    ),
    "plane": (3, plane_shape((0, 0, -0.03), (0.02, 0, 2.0)), of_a_slope((0.01, 0, 1), 0.03)),
    "polyline": (
        2,
        {"shape": "polyline", "points": ((0.0, -0.03), (1.0, -0.02))},
        of_a_slope((-0.01, 1), 0.03),
    ),
    "cone": (
        3,
        {
            "shape": "cone",
            "tip": (0.9, 0.5, -0.51),
            "axis": (0, 0, -1),
            "angle": 5.0,
            "radius": 1.0,  # of more than two facets
        },
        None,
    ),
    "surface": (3, None, of_a_slope((0.0, 0, 1), 0.02)),
}
SAME["cone"] = (
    *SAME["cone"][:2],
    of_a_ball((0.9, 0.5, -0.51 - 1.0 / np.sin(np.radians(5.0))), 1.0),
)


@pytest.mark.mpi
@pytest.mark.one_quick("name", SAME)
def test_the_same_by_formula(name, files):
    """Displacement, pressure and shear are those of gap and direction by formula, on any number of
    ranks.
    """
    dim, table, formula = SAME[name]
    if name == "surface":  # the upper face of the cube, which is larger than the body
        table = {
            "shape": "surface",
            "file": files / "cube.step",
            "scale": 50.0,
            "shift": (0.0, 0.0, -50.02),
        }
    if name == "cone":  # its tip is a ball
        sine = np.sin(np.radians(5.0))
        table = table | {"tip": (0.9, 0.5, -0.01 - 1.0 + 1.0 / sine)}
        formula = of_a_ball((0.9, 0.5, -1.01), 1.0)
    mesh = block(dim)
    first, u = pressed(table, mesh)
    second, v = pressed(None, mesh, **formula)
    size = np.abs(v.x.array).max()
    assert u.x.array == pytest.approx(v.x.array, abs=1e-10 * size)
    largest = COMM.allreduce(np.abs(second.state.pressure).max(initial=0.0), MPI.MAX)
    assert largest > 0
    for field in ("pressure", "shear"):
        assert getattr(first.state, field) == pytest.approx(
            getattr(second.state, field), abs=1e-8 * largest
        )


def test_gap_is_added():
    """To the distance; and any object with a distance is a shape."""

    class Ground:
        def distance(self, x):
            return x[:, -1] + 0.01, np.broadcast_to([0.0, 1.0], x.shape)

    (_, u), (_, v) = (
        pressed(one, block(2, MPI.COMM_SELF), gap=gap)
        for one, gap in ((Ground(), 0.02), (None, 0.03))
    )
    assert u.x.array == pytest.approx(v.x.array, abs=1e-14)


class Ball:
    """A circle about (.5, -1) through (.5, 0), which may be wrong."""

    def __init__(self, signed=lambda away, x: away, normal=lambda unit, x: unit):
        self.signed, self.normal = signed, normal

    def distance(self, x):
        away = x - [0.5, -1.0]
        size = np.linalg.norm(away, axis=1)
        return self.signed(size - 1.0, x), self.normal(away / size[:, None], x)


@pytest.mark.one_quick(
    ("wrong", "message"),
    [
        ({"signed": lambda away, x: away * np.nan}, r"distance of Ball is not finite at \("),
        ({"normal": lambda unit, x: unit * np.nan}, "distance of Ball is not finite"),
        ({"signed": lambda away, x: away[:, None]}, r"has the shapes \(\d+, 1\) and"),
        ({"normal": lambda unit, x: unit[0]}, r"has the shapes \(\d+,\) and \(2,\), not"),
        ({"normal": lambda unit, x: 2 * unit}, "the normals of Ball are not of unit length"),
        ({"normal": lambda unit, x: -unit}, "does not grow along its normals"),
        ({"normal": lambda unit, x: unit[:, ::-1]}, "does not grow along its normals"),
        ({"signed": lambda away, x: 1.1 * away}, "does not grow along its normals"),
        ({"signed": lambda away, x: np.abs(away + 0.1)}, "distance of Ball is not negative inside"),
        (
            {"signed": lambda away, x: away + np.add(x, 0, out=x)[:, 0]},
            "distance of Ball fails: .*read-only",
        ),
        ({"signed": lambda away, x: away / x.nothing}, "distance of Ball fails: AttributeError"),
    ],
)
def test_shapes_that_are_not_what_they_say(wrong, message):
    """An object with a distance that is none is refused, with its name, before anything is
    solved.
    """
    with pytest.raises(FormError, match=message):
        pressed(Ball(**wrong), block(2, MPI.COMM_SELF))
    assert pressed(Ball(), block(2, MPI.COMM_SELF))[0].certificate.holds


# --- scenes ---------------------------------------------------------------------------------------


def scene(shape, **more):
    """The block on a cylinder of the demonstration, on a coarse mesh."""
    given = {
        "mesh": rectangle_mesh(20, 10, length=10.0, height=5.0),
        "material": {"young": 200.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.0, "y": -0.06},
        "contact": {"boundary": "bottom", "foundation": shape},
    }
    return parse_scene(given | more)


GROUND = plane_shape((0, -0.01), (0, 1))


@pytest.mark.mpi
def test_a_scene():
    """A plane is the gap; the certificate evaluates the shape anew, and ``check`` says where it
    is.
    """
    coulomb = coulomb_friction(0.3)
    first = solve(
        scene(None, contact={"boundary": "bottom", "foundation": GROUND, "friction": coulomb})
    )
    second = solve(scene(None, contact={"boundary": "bottom", "gap": 0.01, "friction": coulomb}))
    assert first.certificate.holds
    size = [
        COMM.allreduce(np.abs(one.displacement.x.array).max(), MPI.MAX) for one in (first, second)
    ]
    energy = [one.steps[-1].strain_energy for one in (first, second)]
    assert size[0] == pytest.approx(size[1], rel=1e-12)
    assert energy[0] == pytest.approx(energy[1], rel=1e-12)
    told = "; ".join(check_scene(scene(GROUND)).acts)
    assert "plane, point = [0, -0.01], normal = [0, 1]; at a distance of 0.01" in told


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (circle_shape((5, -8), 0), "foundation.radius: must be greater than 0"),
        (circle_shape((5, -8, 0), 8), "foundation.centre: the mesh is plane: give 2"),
        ({"shape": "circle", "center": (5, -8), "radius": 8}, "unknown key: did you mean 'centre'"),
        (
            {"shape": "circle", "centre": (5, -8), "radius": 8, "qqq": 1},
            "foundation.qqq: unknown key",
        ),
        (circle_shape((5, 0), 80), "the whole body is inside of the foundation"),
        (
            {"shape": "sphere", "centre": (5, -8), "radius": 8},
            "the mesh is plane: there is no sphere",
        ),
        ({"shape": "ball"}, "shape must be one of circle, cone, cylinder"),
        (8.0, "foundation: a table is expected"),
        (GROUND | {"normal": (0, 0)}, "foundation.normal: must not be zero"),
        (GROUND | {"rotation": (0, 0, 1)}, "foundation.rotation: the mesh is plane: give an angle"),
        ({"shape": "polyline", "points": ((0, 0), (0, 0))}, "points: numbers 1 and 2 are the same"),
        (
            {"shape": "polyline", "points": ((0, 0), (1, 0), (0, 0))},
            "points: a closed line needs three",
        ),
        (
            {"shape": "polyline", "points": ((0, 0), (1, 0), (2, 0), (1, 0), (0, 0))},
            "must enclose an area",
        ),
        (
            {"shape": "polyline", "points": ((9, 0), (6, 0), (4, -2), (6, -2), (4, 0), (-9, 0))},
            "points: segments 2-3 and 4-5 intersect",
        ),
        (
            {"shape": "polyline", "points": ((0, 0), (2, 2), (2, 0), (0, 3), (0, 0))},
            "segments 1-2 and",
        ),
        (
            {"shape": "spline", "points": ((9, 0), (6, 0))},
            "shape must be one of circle, cone, cylinder, plane, polyline, sphere, surface, got 'spline'",
        ),
        (
            {"shape": "cone", "tip": (0, 0), "axis": (0, 1), "angle": 90},
            "foundation.angle: must be less than 90",
        ),
        ({"shape": "surface", "file": "no.stl"}, "foundation.file: no.stl: no such file"),
    ],
)
def test_bad_values(shape, message):
    """One clear error each."""
    with pytest.raises(SceneError) as error:
        check_scene(scene(shape))
    assert message in str(error.value)
    assert not str(error.value).endswith("there are: ")
    assert len(error.value.problems) == 1 + ("center" in str(shape))


def test_bad_surfaces(tmp_path):
    """Surfaces that are open, have no inside, or are no surfaces."""

    def error_of(triangles):
        lines = ["solid it"]
        for corners in triangles:
            vertices = "".join(f"vertex {x} {y} {z}\n" for x, y, z in corners)
            lines.append(f"facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet")
        (tmp_path / "it.stl").write_text("\n".join([*lines, "endsolid it\n"]), encoding="utf-8")
        return [
            why
            for _, why in read_shape(
                {"shape": "surface", "file": tmp_path / "it.stl"}
            ).contradictions(3)
        ]

    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    faces = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
    assert error_of(corners[list(face)] for face in faces) == []
    (wrong,) = error_of(corners[list(face)] for face in faces[:3])
    assert "not closed: 3 sides of its 3 triangles belong to one alone" in wrong
    # The projective plane: closed, and without an inside.
    six = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1)])
    ten = ["123", "124", "135", "146", "156", "236", "245", "256", "345", "346"]
    (wrong,) = error_of(six[[int(c) - 1 for c in face]] for face in ten)
    assert "no inside and outside" in wrong
    (tmp_path / "it.stl").write_bytes(b"")
    (wrong,) = [
        why
        for _, why in read_shape({"shape": "surface", "file": tmp_path / "it.stl"}).contradictions(
            3
        )
    ]
    assert "it.stl" in wrong


# --- foundations that move ------------------------------------------------------------------------


def moving(*, tool, shift, rotation=0.0, **more):
    """A block in four load steps on a plane that moves, or whose top moves instead."""
    axes = ("x", "y")
    given = {"mesh": rectangle_mesh(8, 4, length=2.0, height=1.0)}
    given |= {
        "material": {"young": 1000.0, "poisson": 0.3},
        "load_steps": {"times": [0.0, 1.0, 2.0, 3.0]},
    }
    foundation = floor()
    top = (
        dict.fromkeys(axes, 0.0)
        if tool
        else dict(zip(axes, (f"-({way})" for way in shift), strict=True))
    )
    if tool:
        foundation |= {"shift": shift, "rotation": rotation}
    contact = {"boundary": "bottom", "foundation": foundation, "friction": coulomb_friction(0.3)}
    return parse_scene(
        given | {"displacement": {"boundary": "top", **top}, "contact": contact} | more
    )


@pytest.mark.mpi
def test_a_foundation_moves_a_body_that_nothing_holds():
    """It carries the body as it is by friction; what nothing presses stays where it is, which a
    finding says.
    """
    pressure = {"boundary": "top", "pressure": 1.0}
    carried, loose = (
        solve(
            moving(tool=True, shift=["0.01*t", "0.0"], traction=loads).model_copy(
                update={"displacement": ()}
            )
        )
        for loads in ([pressure], [])
    )
    assert carried.certificate.holds
    assert loose.certificate.holds
    first, *later = (step.displacement.x.array.reshape(-1, 2) for step in carried.steps)
    for time, u in enumerate(later, 1):
        np.testing.assert_allclose(u - first, np.tile([0.01 * time, 0.0], (len(u), 1)), atol=1e-9)
    assert not loose.displacement.x.array.any()
    assert any("nothing presses on the body" in finding.message for finding in loose.findings)


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick(
    "more",
    [
        {},
        {"solver": {"algorithm": "alm"}},
        {"load_steps": {"times": [1, 2], "steps": 2}},
        {"solver": {"levels": 2}},
        {"accuracy": {"target": 0.09}},
    ],
)
def test_a_foundation_moves_in_a_scene(more):
    """With t, step by step, as its opposite moves the supports."""
    shift = ["0.01*t if t < 2 else 0.04 - 0.01*t", "0.02 + 0.002*t"]
    first, second = (solve(moving(tool=tool, shift=shift, **more)) for tool in (True, False))
    assert len(first.steps) == len(second.steps) > 2
    for one, other in zip(first.steps, second.steps, strict=True):
        assert one.certificate.holds
        assert one.strain_energy == pytest.approx(other.strain_energy, rel=1e-7)
        for name in ("pressure", "shear"):
            sums = [
                COMM.allreduce(float((getattr(s.contact, name) ** 2).sum())) for s in (one, other)
            ]
            assert sums[0] == pytest.approx(sums[1], rel=1e-6)
    assert not any("penetrates" in finding.message for finding in first.findings)
    assert len(first.levels) == len(second.levels)
    assert bool(len(first.levels) > 1) == ("accuracy" in more or "levels" in more.get("solver", {}))
    for one, other in zip(first.levels, second.levels, strict=True):
        assert one.dofs == other.dofs
        assert one.energy == pytest.approx(other.energy, rel=1e-5)
        assert one.regularisation == pytest.approx(other.regularisation, rel=0.01)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"shift": ["x[0]", 0.0]}, "a number or an expression of the time t is expected"),
        ({"shift": ["t", 0.0, 0.0]}, "foundation.shift: the mesh is plane: give 2 numbers, not 3"),
    ],
)
def test_bad_motions(more, message):
    """One clear error each."""
    with pytest.raises(SceneError) as error:
        solve(moving(tool=True, **({"shift": ["0.01*t", 0.0]} | more)))
    assert message in str(error.value)
    assert len(error.value.problems) == 1


@pytest.mark.parametrize(("cells", "coarse"), [(16, True), (2, False)])
def test_surfaces_that_are_coarser_than_the_body(files, cells, coarse):
    """The ball presses with its facets: a note has their size, and that of the body's."""
    scene = {
        "mesh": box_mesh(cells, cells, 1, length=1, height=0.5),
        "material": {"young": 1.0, "poisson": 0.3},
        "displacement": fixed("bottom", "xyz"),
        "contact": {
            "boundary": "top",
            "foundation": {
                "shape": "surface",
                "file": str(files / "ball.stl"),
                "shift": [0.5, 0.5, 1.5],
            },
        },
    }
    found = [str(finding) for finding in check_scene(parse_scene(scene), MPI.COMM_SELF).findings]
    assert any("the surface has flat facets about" in text for text in found) == coarse
