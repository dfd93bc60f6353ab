"""Sentences of the pages that say what the program does, and that no other test looks at."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from on_meshes import trial_and_test, vector_space

import signorini_fx as sfx


@pytest.fixture(scope="module")
def cornered():
    """A block that is pressed into a corner of two foundations, frictionless."""
    block = sfx.generate_mesh("rectangle", {"length": 2.0, "nx": 8, "ny": 4}, MPI.COMM_WORLD)
    V = vector_space(block.mesh)
    u, v = trial_and_test(V)
    a = 1000.0 * ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))) * ufl.dx
    L = ufl.inner(fem.Constant(block.mesh, (-1.0, -4.0)), v) * ufl.dx
    sides = [sfx.Foundation(block.facets(name)) for name in ("left", "bottom")]
    problem = sfx.ContactProblem(a, L, contact=sides)
    problem.solve()
    return problem


def at_corner(function):
    """The value of a scalar function at the origin."""
    x = function.function_space.tabulate_dof_coordinates()
    return float(function.x.array[np.linalg.norm(x, axis=1).argmin()])


def test_functions_at_a_node_of_two_contacts(cornered):
    """docs/own-forms.md: they hold the values of the last one, each contact alone has its own."""
    first, last = (cornered.solution.boundary_fields(number).pressure for number in range(2))
    assert abs(at_corner(first) - at_corner(last)) > 0.1
    assert at_corner(cornered.pressure) == pytest.approx(at_corner(last), rel=1e-9)


def test_fields_are_new_at_each_call(cornered):
    """docs/own-forms.md: each call returns new Functions."""
    once, again = (cornered.solution.boundary_fields(1).pressure for _ in range(2))
    once.x.array[:] = 0.0
    assert np.abs(again.x.array).max() > 1.0


def test_penetration_of_the_defaults(cornered):
    """docs/target-accuracy.md: about 1e-5 to 1e-4 of the displacements; none with alm."""
    assert 1e-6 < cornered.certificate.penetration < 3e-4
    scene = sfx.Scene(
        mesh=sfx.generate_mesh("rectangle", {"length": 2.0, "nx": 8, "ny": 4}, MPI.COMM_WORLD),
        material=sfx.LinearElastic(young=1000.0, poisson=0.3),
        displacement=sfx.Displacement(boundary="left", x=0.0),
        traction=sfx.Traction(boundary="top", y="-4*x[0]"),
        contact=sfx.Contact(boundary="bottom"),
    )
    found = sfx.solve(scene).certificate.penetration
    exact = scene.model_copy(update={"solver": sfx.SolverSettings(algorithm="alm")})
    assert 1e-6 < found < 3e-4
    assert sfx.solve(exact).certificate.penetration < 1e-9


def test_a_changed_copy_is_not_validated():
    """docs/api.md: ``model_copy`` takes what the constructor refuses."""
    steel = sfx.LinearElastic(young=1000.0, poisson=0.3)
    assert steel.model_copy(update={"poisson": 0.7}).poisson == 0.7
    with pytest.raises(sfx.SceneError, match=r"poisson: must be at most 0\.5"):
        sfx.LinearElastic(young=1000.0, poisson=0.7)
