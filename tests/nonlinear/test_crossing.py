"""Bodies that pass through themselves, or through others, where no contact sees it: a named outcome."""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from on_meshes import turn_by, vector_space
from scene_tables import coulomb_friction, fixed, plane_shape, rectangle_mesh
from support.nonlinear_bodies import residual
from support.sliding_bodies import blocks, cylinders, stacked
from two_bodies import assembled, facets, grid

from signorini_fx import ConvergenceError, NonlinearContactProblem, Scene, Status, solve

ANGLE = 1.75 * np.pi  # of a ring with an opening


def open_ring(kind, comm=MPI.COMM_SELF, degree=1):
    """Part of a ring of the radii 2 and 3 from the angle 0 on, held there, and driven at its end."""
    dim = 2 if kind in ("quadrilateral", "triangle") else 3
    counts = (28, 2) if dim == 2 else (28, 2, 1)

    def bent(x):
        radius, angle = 2.0 + x[:, 1], ANGLE * x[:, 0]
        plane = [radius * np.cos(angle), radius * np.sin(angle)]
        return np.column_stack((*plane, *x.T[2:]))

    cells = grid(kind, counts, [0.0] * dim, [1.0] * dim, bent)
    mesh = assembled(kind, cells, comm=comm)
    space = vector_space(mesh, degree)

    def end(angle):
        return facets(mesh, lambda x: np.isclose(np.arctan2(x[1], x[0]) % (2 * np.pi), angle))

    drive = fem.Constant(mesh, np.zeros(dim))
    values = np.zeros(dim), drive
    nodes = [fem.locate_dofs_topological(space, dim - 1, end(angle)) for angle in (0.0, ANGLE)]
    bcs = [fem.dirichletbc(value, where, space) for value, where in zip(values, nodes, strict=True)]
    u = fem.Function(space)
    inside = facets(mesh, lambda x: np.hypot(x[0], x[1]) < 2.0 + 1e-9)
    problem = NonlinearContactProblem(residual(u), u, bcs=bcs, boundaries={"inside": inside})
    return problem, drive


@pytest.mark.mpi
@pytest.mark.one_quick("kind", ["quadrilateral", "triangle", "hexahedron", "tetrahedron"])
def test_a_ring_whose_ends_pass_through_each_other(kind):
    """Its last solution is that of a step in which they do not meet."""
    problem, drive = open_ring(kind, MPI.COMM_WORLD)
    middle = 2.5 * turn_by(ANGLE)[:, 0]

    def move(t):
        drive.value[:2] = t * (np.array([2.5, 0.6]) - middle)

    ends = []
    with pytest.raises(
        ConvergenceError, match=r"^body passes through itself \(('inside' )?at \("
    ) as raised:
        problem.run([0.25, 0.5, 0.75, 1.0], move, on_step=lambda step: ends.append(step.time))
    assert problem.status is Status.CROSSED
    assert "name both as the sides of a contact" in str(raised.value)
    assert ends[:2] == [0.25, 0.5]
    # The ends touch where the way has closed the opening.
    assert 0.55 < ends[-1] < 0.8


@pytest.mark.one_quick(
    "made",
    [
        lambda: blocks(),
        lambda: blocks("triangle", degree=2),
        lambda: cylinders(),
        lambda: stacked(),
        lambda: stacked("tetrahedron"),
    ],
    ids=["plane", "quadratic", "revolved", "space", "tetrahedra"],
)
def test_a_body_that_no_contact_names(made):
    """It may be touched, and not be entered: with the contact the same way is a solution."""
    bodies = made()
    alone = NonlinearContactProblem(bodies.form, bodies.u, bcs=bodies.bcs)
    alone.solve()
    bodies.drive.value[-1] = -0.1
    if bodies.driven is not None:
        bodies.driven.value = -0.1
    with pytest.raises(
        ConvergenceError, match=r"bodies inside each other \(at \(.*: a body is inside another one"
    ):
        alone.solve()
    assert alone.status is Status.PASSED
    assert not bodies.u.x.array.any()
    bodies.problem.solve()
    assert bodies.problem.status is Status.CONVERGED


def test_scenes_name_the_boundary():
    """A block above another one that is moved into it, without contact of both."""
    mesh = rectangle_mesh(4, 4)
    scene = Scene(
        body=[
            {"name": "lower", "mesh": mesh},
            {"name": "upper", "mesh": mesh, "shift": [0.0, 1.02]},
        ],
        material={"law": "neo-hooke", "young": 1.0, "poisson": 0.3},
        displacement=[fixed("lower.bottom"), {"boundary": "upper.top", "x": 0.0, "y": "-t"}],
        contact={"boundary": "lower.top", "foundation": plane_shape([0.0, 9.0], [0.0, -1.0])},
        load_steps={"times": [0.01, 0.1]},
    )
    with pytest.raises(
        ConvergenceError, match=r"inside each other \('(lower.top|upper.bottom)' at \("
    ) as raised:
        solve(scene, MPI.COMM_SELF)
    solution = raised.value.solution
    assert solution.status is Status.PASSED
    assert solution.steps[0].time == 0.01


@pytest.mark.one_quick("sides", [False, True])
def test_a_side_that_rolls_onto_a_plate(sides):
    """A free side of rubber that bulges beyond the edge of a rough plate passes its surface, which
    is said by name, unless it may touch the plate, too.
    """
    plate = {"shape": "plane", "point": [0.0, 0.5], "normal": [0.0, -1.0], "shift": [0.0, "-t"]}
    names = ["top", "right"] if sides else ["top"]
    scene = Scene(
        mesh=rectangle_mesh(12, 12, length=0.5, height=0.5),
        material={"law": "neo-hooke", "young": 1.0, "poisson": 0.45},
        displacement=[fixed("left", "x"), fixed("bottom", "y")],
        contact=[
            {"boundary": name, "foundation": plate, "friction": coulomb_friction(0.8)}
            for name in names
        ],
        element={"volumetric": "auto"},
        load_steps={"times": [0.05, 0.1, 0.14, 0.16]},
    )
    solution = solve(scene, MPI.COMM_SELF)
    warned = [found for found in solution.findings if "behind the surface" in found.message]
    assert [found.path for found in warned] == ([] if sides else ["contact[0]"])
    assert all(found.message.startswith("'right' is behind") for found in warned)
