"""The stress of a residual, and the error of it: closed forms, and a fine mesh."""

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from on_meshes import at_coordinate, turn_by, vector_space
from reference import interpolated
from scene_tables import circle_shape, rectangle_mesh

from signorini_fx import Foundation, NonlinearContactProblem
from signorini_fx.forms.nonlinear.residual import lowered
from signorini_fx.forms.nonlinear.results import squared_errors, stress_of
from signorini_fx.machine import compat
from signorini_fx.records import History
from signorini_fx.scenes.nonlinear import build_problem
from signorini_fx.scenes.reading import parse_scene

WORLD = MPI.COMM_WORLD
YOUNG, POISSON = 100.0, 0.4
MU, LAME = YOUNG / 2 / (1 + POISSON), YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON)


def neo_hooke(u, poisson=POISSON):
    shear = YOUNG / 2 / (1 + poisson)
    lame = YOUNG * poisson / (1 + poisson) / (1 - 2 * poisson)
    gradient = ufl.Identity(len(u)) + ufl.grad(u)
    volume = ufl.det(gradient)
    energy = (
        shear / 2 * ufl.inner(gradient, gradient)
        - shear * ufl.ln(volume)
        + lame / 2 * ufl.ln(volume) ** 2
    )
    return ufl.derivative(energy * ufl.dx, u, ufl.TestFunction(u.function_space))


def pressed(cells, degree):
    """A block under a circle, pressed by a fifth of its height."""
    comm, kind = MPI.COMM_SELF, mesh.CellType.quadrilateral
    block = mesh.create_rectangle(comm, [[0.0, 0.0], [2.0, 1.0]], [2 * cells, cells], kind)
    u = fem.Function(vector_space(block, degree))
    top, bottom = (
        mesh.locate_entities_boundary(block, 1, at_coordinate(1, at)) for at in (1.0, 0.0)
    )
    fixed = fem.dirichletbc(
        np.zeros(2), fem.locate_dofs_topological(u.function_space, 1, bottom), u.function_space
    )
    foundation = Foundation(top, shape=circle_shape((1.03, 1.5), 0.5))
    problem = NonlinearContactProblem(neo_hooke(u), u, bcs=[fixed], contact=foundation)
    problem.run([0.5, 1.0], lambda t: problem.place(0, shift=(0.0, -0.2 * t)))
    return problem


@pytest.mark.mpi
@pytest.mark.parametrize("dim", [2, 3])
def test_stress_of_a_residual(dim):
    """Of constant gradients it is exact, whatever multiplies the test function itself."""
    cells = [2] * dim
    body = (mesh.create_unit_square if dim == 2 else mesh.create_unit_cube)(WORLD, *cells)
    u = fem.Function(vector_space(body))
    u.interpolate(lambda x: 0.1 * np.sin(2 * x[:dim] + x[::-1][:dim]))
    test, normal = ufl.TestFunction(u.function_space), ufl.FacetNormal(body)
    found = stress_of(
        lowered(neo_hooke(u) + ufl.inner(u, test) * ufl.dx - ufl.inner(normal, test) * ufl.ds), u
    )
    gradient = ufl.Identity(dim) + ufl.grad(u)
    inverse = ufl.inv(gradient).T
    expected = MU * (gradient - inverse) + LAME * ufl.ln(ufl.det(gradient)) * inverse
    rows = ufl.as_vector([expected[i, j] for i in range(dim) for j in range(dim)])
    exact = fem.Function(found.function_space)
    exact.interpolate(
        fem.Expression(rows, compat.interpolation_points(exact.function_space.element))
    )
    np.testing.assert_allclose(found.x.array, exact.x.array, rtol=1e-10, atol=1e-12 * YOUNG)


@pytest.mark.mpi
def test_a_stress_that_the_cells_have():
    """The stress of a quadratic displacement is linear: there is no error; of others there is."""
    body = mesh.create_unit_square(WORLD, 3, 3)
    u = fem.Function(vector_space(body, 2))
    strain = ufl.sym(ufl.grad(u))
    residual = lowered(
        ufl.inner(2 * MU * strain, ufl.grad(ufl.TestFunction(u.function_space))) * ufl.dx
    )
    every_cell = [np.arange(u.function_space.dofmap.list.shape[0], dtype=np.int32)]

    def error():
        squares, size = squared_errors(stress_of(residual, u), u, every_cell)
        return np.sqrt(WORLD.allreduce(squares.sum()) / size)

    assert squared_errors(stress_of(residual, u), u, every_cell)[1] == 0
    u.interpolate(lambda x: np.array([x[0] ** 2, x[0] * x[1]]))
    assert error() < 1e-6
    u.interpolate(lambda x: np.array([np.sin(3 * x[0] * x[1]), x[1] ** 3]))
    assert error() > 1e-3


@pytest.fixture(scope="module")
def fine():
    """A block with many cells of degree 2."""
    return pressed(16, 2)


@pytest.mark.parametrize(("cells", "degree"), [(4, 1), (8, 1), (4, 2)])
def test_against_a_fine_mesh(fine, cells, degree):
    """Within a factor of two of the difference to a finer mesh."""
    coarse = pressed(cells, degree)
    found, exact = (
        stress_of(lowered(neo_hooke(problem.u)), problem.u) for problem in (coarse, fine)
    )
    space = exact.function_space
    owned = np.arange(space.mesh.topology.index_map(2).size_local, dtype=np.int32)
    difference = fem.Function(space)
    data = fem.create_interpolation_data(space, found.function_space, owned, 1e-10)
    difference.interpolate_nonmatching(found, owned, data)
    difference.x.array[:] -= exact.x.array
    squares = [fem.assemble_scalar(fem.form(ufl.inner(f, f) * ufl.dx)) for f in (difference, exact)]
    error = np.sqrt(coarse.solution.error_shares.sum())
    assert 0.5 < error / np.sqrt(squares[0] / squares[1]) < 2.0
    assert str(coarse.solution.cost).startswith(f"{100 * error:.2g} % error of the stress took")
    errors, force = (
        coarse.errors,
        [sum(problem.solution.contact.forces) for problem in (coarse, fine)],
    )
    assert errors.energy == pytest.approx(error)
    columns = fine.solution.table.columns
    away = (
        interpolated(coarse.solution.table, fine.solution.table, "pressure") - columns["pressure"]
    )
    true = np.sqrt(
        np.dot(columns["weight"], away**2) / np.dot(columns["weight"], columns["pressure"] ** 2)
    )
    assert 1 / 3 < errors.pressure / true < 3
    assert np.linalg.norm(force[0] - force[1]) < 3 * errors.force * np.linalg.norm(force[1])


# Unknowns of degree 2, force on the body of a mesh with 21,186 unknowns, and how far that is from
# one with 5,474.
STRIP, UNSURE = np.array([-0.01066162, -0.05526606]), 0.023


def under_a_circle(degree, cells, turn=0.0, values=None):
    """A strip held at its left end, a circle pressed down beside the other: with one node in
    contact.  ``turn``: that of all in radians, ``values``: of a displacement to begin with.
    """
    strip = mesh.create_rectangle(
        MPI.COMM_SELF, [[0.0, 0.0], [10.0, 1.0]], cells, mesh.CellType.triangle
    )
    u = fem.Function(vector_space(strip, degree))
    rotation = turn_by(turn)
    left, top = (
        mesh.locate_entities_boundary(strip, 1, lambda x, k=k: np.isclose(x[k], k)) for k in (0, 1)
    )
    held = fem.Function(u.function_space)
    held.interpolate(lambda x: rotation @ x[:2] - x[:2])
    fixed = fem.dirichletbc(held, fem.locate_dofs_topological(u.function_space, 1, left))
    centre = tuple(map(float, rotation @ [8.0, 2.0 if values is None else 1.0]))
    circle = Foundation(top, shape=circle_shape(centre, 1.0))
    problem = NonlinearContactProblem(neo_hooke(u, 0.3), u, bcs=[fixed], contact=circle)
    if values is None:
        problem.run([0.5, 1.0], lambda t: problem.place(0, shift=(0.0, -t)))
    else:
        x = u.function_space.tabulate_dof_coordinates()[:, :2]
        u.x.array[:] = ((x + values.reshape(-1, 2)) @ rotation.T - x).ravel()
        problem.solve()
    return problem


@pytest.mark.parametrize(("degree", "cells"), [(1, (20, 2)), (1, (40, 4)), (2, (20, 2))])
def test_force_at_one_node(degree, cells):
    """Of a body that turns strains tell, and of one node how far the direction of its force may be
    off.
    """
    problem = under_a_circle(degree, cells)
    found = problem.state.forces_of_each[0].sum(axis=0)
    true = np.linalg.norm(found - STRIP) / np.linalg.norm(STRIP)
    assert true > 1.5 * UNSURE
    assert 0.5 < problem.errors.force / true < 3


@pytest.mark.parametrize("degrees", [30, 90])
def test_errors_of_a_state_that_is_turned(degrees):
    """They are the same."""
    problem = under_a_circle(1, (20, 2))
    turned = under_a_circle(1, (20, 2), np.radians(degrees), problem.u.x.array)
    first, second = problem.errors, turned.errors
    for name in ("energy", "pressure", "force", "points"):
        assert getattr(second, name) == pytest.approx(getattr(first, name), rel=1e-5)


def test_force_of_a_punch_on_metal():
    """Strains grow where the stress hardly does: the square of its error is a quarter of that of
    the force.  The exact force is extrapolated from meshes of degree 2 with up to 66,306 unknowns.
    """
    scene = {
        "mesh": rectangle_mesh(16, 8, length=2.0, height=1.0),
        "element": {"volumetric": "reduced"},
        "material": {
            "law": "j2",
            "young": 2e5,
            "poisson": 0.3,
            "yield_stress": 300.0,
            "hardening": 2000.0,
        },
        "displacement": [{"boundary": "top", "y": "-0.004*t"}, {"boundary": "left", "x": 0.0}],
        "contact": {"boundary": "bottom", "gap": "0.0 if x[0] <= 1.0 else 1.0"},
        "load_steps": {"times": [0.25, 0.5, 0.75, 1.0]},
    }
    problem = build_problem(parse_scene(scene), MPI.COMM_SELF, History())
    force = problem.solved().contact.forces[0][1]
    assert 0.5 < problem.errors.force / abs(force / 375.6 - 1) < 2.0


def test_an_earlier_solve():
    """Its body is no more where it was."""
    problem = pressed(2, 1)
    earlier = problem.solution
    problem.place(0, shift=(0.0, -0.25))
    problem.solve()
    assert earlier.cost == "there is no estimate of the error of an earlier solve"
    assert not isinstance(problem.solution.cost, str)
