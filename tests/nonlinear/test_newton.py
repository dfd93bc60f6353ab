"""Newton's method of nonlinear bodies: what it solves, in how many iterations, and from where."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import at_coordinate, trial_and_test, vector_space
from scene_tables import circle_shape
from support.nonlinear_bodies import MU, PLATE, held, neo_hooke, rectangle, residual, under_shape

from signorini_fx import ConvergenceError, Coulomb, Foundation, NonlinearContactProblem, Status
from signorini_fx.algebra.linalg import is_by_blocks


@pytest.mark.one_quick(("hollow", "most"), [(False, 6), (True, 8)])
def test_a_deep_press_from_rest(hollow, most):
    """Points that stick come along a plane that turns by the way to the shape over its radius:
    Newton's method knows, and its last increments fall quadratically, not by this factor.  In a
    bowl, which squeezes the corners, the first increment is halved.
    """
    radius = 2.0 if hollow else 0.5
    circle = circle_shape((1.03, 1.0 + radius * (-1 if hollow else 1)), radius)
    circle["hollow"] = hollow
    problem = under_shape(circle, (2.0, 1.0), (16, 8), friction=Coulomb(0.6))
    problem.place(0, shift=(0.0, -0.2))
    problem.solve()
    assert problem.iterations <= most
    assert problem.state.areas["stick"] > 0.2


@pytest.mark.slow
@pytest.mark.mpi
def test_a_ball_with_multigrid():
    """A matrix by blocks has the curvature of shapes too: otherwise its solution is not that of the
    residual.
    """
    mesh = dmesh.create_box(
        MPI.COMM_WORLD, [[0.0, 0.0, 0.0], [2.0, 2.0, 1.0]], [12, 12, 5], dmesh.CellType.hexahedron
    )
    space = vector_space(mesh, 1, 3)
    bottom, top = (
        dmesh.locate_entities_boundary(mesh, 2, at_coordinate(2, at)) for at in (0.0, 1.0)
    )
    u = fem.Function(space)
    ball = {"shape": "sphere", "centre": (1.0, 1.0, 1.55), "radius": 0.6}
    F = ufl.derivative(
        neo_hooke(u) * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(space)
    )
    options = {"linear_algebra": "krylov", "stability": False}
    problem = NonlinearContactProblem(
        F, u, bcs=[held(space, bottom)], contact=Foundation(top, shape=ball), **options
    )
    problem.solve()
    assert problem.status is Status.CONVERGED
    assert problem.iterations <= 5
    assert is_by_blocks(problem.linear.now.elastic.stiffness)


def test_line_search():
    """Springs that soften like an arctangent, from far away: whole increments of Newton's method go
    ever farther.
    """
    space, side = rectangle([1.0, 1.0], [2, 2])
    u = fem.Function(space)
    spring = MU * ufl.atan(20 * u[0]) * ufl.TestFunction(space)[0] * ufl.dx
    contact = Foundation(side(1, 1.0), shape=PLATE | {"shift": (0.0, -1e-3)})
    problem = NonlinearContactProblem(
        residual(u) + spring, u, bcs=[held(space, side(1, 0.0), 1)], contact=contact
    )
    u.x.array[::2] = 0.1
    problem.solve()
    assert np.abs(u.x.array).max() < 2e-3


def test_a_wrong_tangent_goes_on_until_the_forces_balance():
    """Increments of a method that converges linearly are small before the residual is: it goes on,
    or says that its iterations have ended.
    """
    space, side = rectangle([1.0, 1.0], [1, 1])
    u, (trial, test) = fem.Function(space), trial_and_test(space)
    F = residual(u) - 1e-2 * MU * test[1] * ufl.ds
    J = (
        ufl.derivative(residual(u), u, trial)
        + 0.5 * MU * ufl.inner(ufl.grad(trial), ufl.grad(test)) * ufl.dx
    )
    contact = Foundation(side(1, 1.0), shape=PLATE | {"shift": (0.0, 1.0)})
    options = {"bcs": [held(space, side(1, 0.0))], "contact": contact, "J": J}
    problem = NonlinearContactProblem(F, u, **options)
    problem.solve()
    free = space.tabulate_dof_coordinates()[:, 1] > 0.5
    forces = fem.assemble_vector(problem.linear.evaluated.form).array.reshape(-1, 2)
    assert np.abs(forces[free]).max() < 1e-9 * np.abs(forces[~free]).max()
    u.x.array[:] = 0.0
    short = NonlinearContactProblem(F, u, max_newton=problem.iterations - 1, **options)
    with pytest.raises(ConvergenceError, match=r"not solved \(equilibrium .*give the derivative"):
        short.solve()
    assert short.status is Status.NOT_SOLVED


@pytest.mark.one_quick("hollow", [False, True])
def test_a_bilateral_shape_in_tension(hollow):
    """It pulls the body, whose normals turn as under pressure; a node of two such shapes has both
    curvatures.
    """
    space, side = rectangle([2.0, 1.0], [16, 8])
    u, radius = fem.Function(space), 4.0
    centre = (1.0, 1.0 + radius * (-1 if hollow else 1))
    roof = {"shape": "circle", "centre": centre, "radius": radius, "hollow": hollow}
    wall = circle_shape((2.0 + radius, 0.5), radius)
    contact = [
        Foundation(side(1, 1.0), shape=roof, kind="bilateral"),
        Foundation(side(0, 2.0), shape=wall, kind="bilateral"),
    ]
    problem = NonlinearContactProblem(
        residual(u), u, bcs=[held(space, side(1, 0.0))], contact=contact
    )
    for step in range(1, 5):
        problem.place(0, shift=(0.0, 0.05 * step))
        problem.place(1, shift=(0.03 * step, 0.0))
        problem.solve()
        problem.advance()
        assert problem.certificate.worst < 1e-9
        assert problem.iterations <= 6
    assert problem.state.forces_of_each[0][0][1] > 0.0
    assert problem.state.pressure.min() < 0.0
