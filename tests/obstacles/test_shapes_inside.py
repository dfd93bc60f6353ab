"""Rigid shapes inside a body: depths against dense sampling, shapes between nodes, refusals."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import vector_space
from scene_tables import circle_shape, fixed, rectangle_mesh
from scenes import alone

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells
from signorini_fx.mechanics.statement.rigid_shape import read_shape
from signorini_fx.scenes.reading import parse_scene

PLANE, SPACE = ("triangle", "quadrilateral"), ("tetrahedron", "hexahedron")


def body(cell, degree=1, comm=MPI.COMM_SELF):
    """A block [0, 4] x [0, 1] (x [0, 1]) of cells of size 0.25."""
    kind = getattr(dmesh.CellType, cell)
    if cell in PLANE:
        mesh = dmesh.create_rectangle(comm, [[0, 0], [4, 1]], (16, 4), kind)
    else:
        mesh = dmesh.create_box(comm, [[0, 0, 0], [4, 1, 1]], (16, 4, 4), kind)
    return BodyCells.of(vector_space(mesh, degree))


def ball(cells, centre, radius, **more):
    """A circle, or a sphere in the middle of the width."""
    plane = cells.x.shape[1] == 2
    centre = centre if plane else (centre[0], 0.53, centre[1])
    return read_shape(
        {"shape": "circle" if plane else "sphere", "centre": centre, "radius": radius, **more}
    )


def in_body(cell, centre, radius):
    """Depth by the distance of the centre from the block [0, 4] x [0, 1]: the closest point is that
    deep.
    """
    outside = np.linalg.norm(np.array(centre) - np.clip(centre, [0.0, 0.0], [4.0, 1.0]))
    return radius - outside


@pytest.mark.one_quick("degree", [1, 2])
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
    """By the distance of its centre from the block; a point that is said to be deep is in the body,
    and that deep.
    """
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


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_a_linear_body_refuses_a_circle_in_it(unit):
    """The contact boundary does not see it; one that reaches in from outside is seen."""

    def scene(height):
        return parse_scene(
            {
                "mesh": rectangle_mesh(8, 4, length=2 * unit, height=unit),
                "material": {"young": 100.0, "poisson": 0.3},
                "displacement": fixed("bottom"),
                "contact": {
                    "boundary": "top",
                    "foundation": circle_shape([unit, height * unit], 0.05 * unit),
                },
            }
        )

    with pytest.raises(
        SceneError, match=r"contact\[0\]: the foundation lies inside the body, at \("
    ):
        alone(scene(0.7))
    assert alone(scene(1.049)).contact.pressure.max() > 0


def test_a_linear_result_names_a_circle_between_its_nodes():
    """It is not refused, as the nodes keep to what contact says; and not named where the facets are
    finer.
    """

    def told(cells):
        scene = parse_scene(
            {
                "mesh": rectangle_mesh(cells, 4),
                "material": {"young": 100.0, "poisson": 0.3},
                "displacement": fixed("bottom"),
                "traction": {"boundary": "right", "x": 0.1},
                "contact": {"boundary": "top", "foundation": circle_shape([0.11, 1.01], 0.05)},
            }
        )
        solution = alone(scene)
        return [
            found.message
            for found in solution.findings
            if "lies inside the deformed body" in found.message
        ]

    assert len(told(4)) == 1
    assert not told(60)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("cell", [*PLANE, "hexahedron"])
def test_elongated_cells(cell, axis):
    """A ball beside the long side of cells of 1:1e6 is outside; moved into it, it is found."""
    dim, length, radius = 2 if cell in PLANE else 3, 1e6, 0.5
    upper = np.ones(dim)
    upper[axis] = length
    make = dmesh.create_rectangle if dim == 2 else dmesh.create_box
    counts = tuple(np.where(np.arange(dim) == axis, 4, 8))
    mesh = make(MPI.COMM_SELF, [np.zeros(dim), upper], counts, getattr(dmesh.CellType, cell))
    cells = BodyCells.of(vector_space(mesh))
    for gap in (1e-3, -0.4):
        centre = 0.37 * upper
        centre[1 - axis] = 1.0 + radius + gap
        entry = {
            "shape": "circle" if dim == 2 else "sphere",
            "centre": tuple(centre),
            "radius": radius,
        }
        shape = read_shape(entry)
        deep = cells.inside(cells.x, shape)
        assert (deep is None) == (gap > 0)
        if deep is not None:
            assert deep.depth == pytest.approx(-shape.distance(np.array([deep.at]))[0][0])
            assert deep.depth <= -gap + 1e-9 * length**0.5
