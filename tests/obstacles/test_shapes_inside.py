"""Rigid shapes inside a body: depths against dense sampling, shapes between nodes, ways that pass through, refusals."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx import ContactProblem, Foundation
from signorini_fx.errors import SceneError
from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells
from signorini_fx.mechanics.statement.rigid_shape import read_shape
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

PLANE, SPACE = ("triangle", "quadrilateral"), ("tetrahedron", "hexahedron")


def body(cell, degree=1, comm=MPI.COMM_SELF):
    """A block [0, 4] x [0, 1] (x [0, 1]) of cells of size 0.25."""
    kind = getattr(dmesh.CellType, cell)
    if cell in PLANE:
        mesh = dmesh.create_rectangle(comm, [[0, 0], [4, 1]], (16, 4), kind)
    else:
        mesh = dmesh.create_box(comm, [[0, 0, 0], [4, 1, 1]], (16, 4, 4), kind)
    return BodyCells.of(fem.functionspace(mesh, ("Lagrange", degree, (mesh.geometry.dim,))), mesh.geometry.dim)


def ball(cells, centre, radius, **more):
    """A circle, or a sphere in the middle of the width."""
    plane = cells.x.shape[1] == 2
    centre = centre if plane else (centre[0], 0.53, centre[1])
    return read_shape({"shape": "circle" if plane else "sphere", "centre": centre, "radius": radius, **more})


def in_body(cell, centre, radius):
    """Depth by the distance of the centre from the block [0, 4] x [0, 1]: the closest point is that deep."""
    outside = np.linalg.norm(np.array(centre) - np.clip(centre, [0.0, 0.0], [4.0, 1.0]))
    return radius - outside


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", [*PLANE, *SPACE])
@pytest.mark.parametrize(
    ("centre", "radius"),
    [
        ((1.52, 0.74), 0.05),  # between nodes
        ((1.6, 1.003), 0.05),  # half of it
        ((2.1, 0.5), 0.002),  # tiny
        ((2.0, 0.3), 0.7),  # larger than cells, out of the block on one side
        ((1.6, 1.03), 0.05),  # not deeper than a chord may be
        ((1.5, 1.48), 0.5),
        ((1.5, 1.06), 0.05),  # outside
        ((-3.0, 0.5), 2.9),
    ],
)
def test_depth_of_a_ball(cell, degree, centre, radius):
    """By the distance of its centre from the block; a point that is said to be deep is in the body, and that deep."""
    cells = body(cell, degree)
    shape, depth = ball(cells, centre, radius), in_body(cell, centre, radius)
    deep = cells.inside(cells.x, shape)
    cell_radius = 0.125 * cells.x.shape[1] ** 0.5
    if depth < 0.4 * min(radius, cell_radius):
        assert deep is None
    if depth > 0.6 * min(radius, 1.3 * cell_radius):
        assert deep is not None
    if deep is not None:
        at = np.array(deep.at)
        assert np.all(at >= 0)
        assert np.all(at <= [4.0, *[1.0] * (at.size - 1)])
        assert -shape.distance(at[None])[0][0] == pytest.approx(deep.depth)
        assert deep.depth <= depth + 1e-12


class Counted:
    """A shape that counts the points at which its distance was asked."""

    def __init__(self, shape):
        self.shape, self.points = shape, 0

    def __getattr__(self, name):
        return getattr(self.shape, name)

    def distance(self, x):
        self.points += len(x)
        return self.shape.distance(x)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("cell", [*PLANE, "hexahedron"])
def test_elongated_cells(cell, axis):
    """The parts that are looked at grow with the logarithm of the aspect ratio: a ball touches the side in its middle,
    and is then moved into it, where it is found.
    """
    counts = []
    dim = 2 if cell in PLANE else 3
    kind = getattr(dmesh.CellType, cell)
    for length in (1e3, 1e6, 1e9):
        upper = np.ones(dim)
        upper[axis], radius, gaps = length, 0.5, (1e-3, -0.4)
        points, numbers = [np.zeros(dim), upper], np.where(np.arange(dim) == axis, 4, 8)
        make = dmesh.create_rectangle if dim == 2 else dmesh.create_box
        mesh = make(MPI.COMM_SELF, points, tuple(numbers), kind)
        cells = BodyCells.of(fem.functionspace(mesh, ("Lagrange", 1, (dim,))), dim)
        for gap in gaps:
            centre = 0.37 * upper
            centre[1 - axis] = 1.0 + radius + gap
            entry = {"shape": "circle" if dim == 2 else "sphere", "centre": tuple(centre), "radius": radius}
            shape = Counted(read_shape(entry))
            deep = cells.inside(cells.x, shape)
            assert (deep is None) == (gap > 0)
            counts.append(shape.points)
            if deep is not None:
                # The body is deepest below the middle of the ball.
                assert deep.depth == pytest.approx(-shape.distance(np.array([deep.at]))[0][0])
                assert deep.depth <= -gap + 1e-9 * length**0.5
    # Ten halvings more for each factor of 1000, of as many parts that come near the ball.
    steps = np.diff(counts[::2])
    assert 0 < steps[1] <= 1.1 * steps[0]


@pytest.mark.parametrize("cell", PLANE)
def test_in_a_bent_body(cell):
    """Places are the displaced ones, of curved cells too: a quarter of a ring."""
    cells = body(cell, degree=2)
    angle, radius = np.pi / 8 * cells.x[:, 0], 2.0 + cells.x[:, 1]
    places = radius[:, None] * np.column_stack((np.sin(angle), np.cos(angle)))
    where = 2.4 * np.array([np.sin(0.7), np.cos(0.7)])
    assert cells.inside(places, ball(cells, where, 0.05)) is not None
    assert cells.inside(places, ball(cells, where * 1.96 / 2.4, 0.05)) is None
    assert cells.inside(places, ball(cells, where * 3.04 / 2.4, 0.05)) is None


@pytest.mark.one_quick
@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron"])
def test_on_the_way(cell):
    """Through the block, over it, round it; and with it, where all moves together."""
    cells = body(cell)
    still = np.zeros(cells.x.shape[1])

    def way(centre, x=cells.x, **placement):
        shape = ball(cells, centre, 0.3)
        return cells.passed((cells.x, shape), (x, ball(cells, centre, 0.3, **placement)))

    def shift(*components):
        moved = still.copy()
        moved[[0, -1]] = components
        return moved.tolist()

    assert way((-4.0, 0.5), shift=shift(10.0, 0.0)) is not None
    assert way((2.0, 1.4), shift=shift(0.0, -1.8)) is not None
    assert way((-4.0, 1.31), shift=shift(10.0, 0.0)) is None
    assert way((2.0, 1.31), shift=shift(0.0, -0.1)) is None  # a step of which the surface is to tell
    assert way((-4.0, 0.5), x=cells.x + shift(10.0, 0.0), shift=shift(10.0, 0.0)) is None
    turn, pivot = (180.0, [2.0, 2.0]) if still.size == 2 else ([0.0, -180.0, 0.0], [2.0, 0.53, 2.0])
    assert way((1.0, 2.0), rotation=turn, pivot=pivot) is not None
    back = -180.0 if still.size == 2 else [0.0, 180.0, 0.0]
    assert way((1.0, 2.0), rotation=back, pivot=pivot) is None


def test_on_the_way_from_another_pivot():
    """The start of a way is where the shape was, whatever its pivot; the end where it is."""
    given = {"shape": "circle", "centre": (1.0, 2.0), "radius": 0.3}
    earlier = read_shape(given | {"shift": (0.5, 0.1), "rotation": 30.0, "pivot": (3.0, 0.0)})
    now = read_shape(given | {"shift": (0.2, -0.4), "rotation": 70.0, "pivot": (0.0, 1.0)})
    x = np.random.default_rng(1).normal(size=(5, 2))
    for share, shape in ((0.0, earlier), (1.0, now)):
        for between, exact in zip(now.on_way_from(earlier, share, 2).distance(x), shape.distance(x), strict=True):
            np.testing.assert_allclose(between, exact, atol=1e-14)


def test_shapes_with_and_without_an_inside():
    """A closed line has one that is at least as large as its area over its perimeter; planes and hollow ones none.
    Edges, open lines and a user's own shape are measured by the cells alone.
    """
    cells = body("quadrilateral")
    square = [[1.0, 0.4], [1.2, 0.4], [1.2, 0.6], [1.0, 0.6], [1.0, 0.4]]
    line = read_shape({"shape": "polyline", "points": square})
    assert line.inradius == pytest.approx(0.05)
    assert cells.inside(cells.x, line) is not None
    for shape in (
        {"shape": "polyline", "points": square, "hollow": True},
        {"shape": "plane", "point": [0.0, 0.5], "normal": [0.0, 1.0]},
        {"shape": "circle", "centre": [1.0, 0.5], "radius": 0.1, "hollow": True},
    ):
        assert cells.inside(cells.x, read_shape(shape)) is None
    wedge = {"shape": "cone", "axis": [0.0, 1.0], "angle": 45.0}
    edge = {"shape": "edge", "normals": [[1.0, -1.0], [-1.0, -1.0]]}

    class Own:
        def __init__(self, tip):
            self.shape = read_shape(wedge | {"tip": tip})

        def distance(self, x):
            return self.shape.distance(x)

    for depth, found in ((0.4, True), (0.125, False)):  # the latter touches two nodes
        tip = [1.625, 1.0 - depth]
        line = [[5.625, 5.0 - depth], tip, [-2.375, 5.0 - depth]]
        for shape in (wedge | {"tip": tip}, edge | {"point": tip}, {"shape": "polyline", "points": line}):
            assert (cells.inside(cells.x, read_shape(shape)) is not None) is found
            assert cells.inside(cells.x, read_shape(shape | {"hollow": True})) is None
        assert (cells.inside(cells.x, Own(tip)) is not None) is found


def test_what_is_added_to_the_distance():
    """The shape is smaller by it."""
    cells = body("quadrilateral")
    assert cells.inside(cells.x, ball(cells, (1.52, 0.74), 0.05), 0.02) is not None
    assert cells.inside(cells.x, ball(cells, (1.52, 0.74), 0.05), 0.06) is None


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_a_linear_body_refuses_a_circle_in_it(unit):
    """The contact boundary does not see it; one that reaches in from outside is seen."""

    def scene(height):
        return parse_scene(
            {
                "mesh": {
                    "generator": "rectangle",
                    "parameters": {"length": 2 * unit, "height": unit, "nx": 8, "ny": 4},
                },
                "material": {"young": 100.0, "poisson": 0.3},
                "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.0},
                "contact": {
                    "boundary": "top",
                    "foundation": {"shape": "circle", "centre": [unit, height * unit], "radius": 0.05 * unit},
                },
            }
        )

    with pytest.raises(SceneError, match=r"contact\[0\]: the foundation lies inside the body, at \("):
        solve(scene(0.7), MPI.COMM_SELF)
    assert solve(scene(1.049), MPI.COMM_SELF).contact.pressure.max() > 0


def test_a_linear_result_names_a_circle_between_its_nodes():
    """It is not refused, as the nodes keep to what contact says; and not named where the facets are finer."""

    def told(cells):
        scene = parse_scene(
            {
                "mesh": {"generator": "rectangle", "parameters": {"nx": cells, "ny": 4}},
                "material": {"young": 100.0, "poisson": 0.3},
                "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.0},
                "traction": {"boundary": "right", "x": 0.1},
                "contact": {
                    "boundary": "top",
                    "foundation": {"shape": "circle", "centre": [0.11, 1.01], "radius": 0.05},
                },
            }
        )
        solution = solve(scene, MPI.COMM_SELF)
        return [found.message for found in solution.findings if "lies inside the deformed body" in found.message]

    assert len(told(4)) == 1
    assert not told(60)


@pytest.mark.parametrize("deep", [False, True])
def test_a_result_of_forms_names_a_wedge_in_the_body(deep):
    """As one of a scene."""
    mesh = dmesh.create_rectangle(MPI.COMM_SELF, [[0, 0], [4, 1]], (16, 4), dmesh.CellType.quadrilateral)
    space = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    y, z = ufl.TrialFunction(space), ufl.TestFunction(space)
    stiffness = ufl.inner(ufl.sym(ufl.grad(y)), ufl.sym(ufl.grad(z))) * ufl.dx
    bottom, top = (dmesh.locate_entities_boundary(mesh, 1, lambda x, at=at: np.isclose(x[1], at)) for at in (0.0, 1.0))
    held = fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(space, 1, bottom), space)
    tip, axis = ((1.3, 0.5), (-1.0, 0.0)) if deep else ((1.63, 0.95), (0.0, 1.0))  # from the side, or on the top
    wedge = {"shape": "cone", "tip": tip, "axis": axis, "angle": 20.0}
    load = ufl.inner(fem.Constant(mesh, (0.0, 0.0)), z) * ufl.dx
    problem = ContactProblem(stiffness, load, [held], contact=Foundation(top, shape=wedge))
    problem.solve()
    told = [found for found in problem.findings if "lies inside the deformed body" in found.message]
    assert [found.path for found in told] == (["contact[0].shape"] if deep else [])


@pytest.mark.mpi
def test_on_ranks():
    """All of them say the same."""
    comm = MPI.COMM_WORLD
    cells = body("triangle", comm=comm)
    deep = cells.inside(cells.x, ball(cells, (3.9, 0.5), 0.05))
    assert deep is not None
    assert set(comm.allgather(deep)) == {deep}
    assert cells.inside(cells.x, ball(cells, (4.06, 0.5), 0.05)) is None
