"""What a user gives to ``NonlinearContactProblem``: each mistake is one error that names it."""

import basix.ufl
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import at_coordinate, vector_space
from support.nonlinear_bodies import PLATE, held, rectangle, residual, under_shape

from signorini_fx import ConvergenceError, FormError, Foundation, NonlinearContactProblem, Status


def block(**arguments):
    """A block under a plate that presses it, with other arguments."""
    return under_shape(PLATE | {"shift": (0.0, -0.05)}, **arguments)


def test_wrong_arguments_are_named():
    """One line for each, before anything is solved."""
    space, side = rectangle([1.0, 1.0], [2, 2])
    z, w = ufl.TestFunction(space), ufl.TrialFunction(space)
    other = ufl.TrialFunction(rectangle([1.0, 1.0], [2, 2])[0])
    for arguments, wrong in (
        ({"J": z[0] * ufl.dx}, "J: must have 2 arguments, not 1"),
        ({"J": "K"}, "J: must be a UFL form"),
        ({"J": ufl.Form([])}, "J: the form is identically zero"),
        (
            {"J": ufl.inner(other, ufl.TestFunction(other.ufl_function_space())) * ufl.dx},
            "J: its arguments are on",
        ),
        ({"P": ufl.inner(w, z) * ufl.dx}, "P: is not used"),
        ({"kind": "mpi"}, "kind: is not used"),
        ({"gamma": 1.0}, "gamma"),
        ({"max_newton": 0}, "max_newton: must be a whole number from 1, got 0"),
        ({"max_newton": 2.5}, "max_newton: must be a whole number from 1, got 2.5"),
    ):
        with pytest.raises(FormError, match=wrong) as raised:
            block(**arguments)
        assert len(raised.value.problems) == 1
    block(max_newton=np.int64(3), P=None, kind=None, entity_maps=None)  # as dolfinx has them
    u, contact = fem.Function(space), Foundation(side(1, 1.0), shape=PLATE)
    for form, wrong in (
        (residual(fem.Function(space)), "F: does not contain u, so that its derivative is zero"),
        (ufl.Form([]), "F: must be a UFL form with one test function"),
        (
            0 * residual(u),
            "F: must be a UFL form with one test function; what is 0 times a form has none",
        ),
    ):
        with pytest.raises(FormError, match=f"^contact problem: {wrong}"):
            NonlinearContactProblem(form, u, contact=contact)
    mesh = space.mesh
    vector = basix.ufl.element("Lagrange", "quadrilateral", 1, shape=(2,))
    mixed = fem.functionspace(
        mesh, basix.ufl.mixed_element([vector, basix.ufl.element("Lagrange", "quadrilateral", 1)])
    )
    u = fem.Function(mixed)
    form = ufl.inner(u, ufl.TestFunction(mixed)) * ufl.dx
    with pytest.raises(
        FormError, match=r"u: its space is .* a vector Lagrange space of degree 1 or 2 is needed"
    ):
        NonlinearContactProblem(form, u, contact=Foundation(side(1, 1.0), shape=PLATE))
    tetrahedra = dmesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
    u = fem.Function(vector_space(tetrahedra, 2, 3))
    top = dmesh.locate_entities_boundary(tetrahedra, 2, at_coordinate(2, 1.0))
    ball = {"shape": "sphere", "centre": (0.5, 0.5, 2.0), "radius": 1.0}
    with pytest.raises(FormError, match="on quadratic tetrahedra a shape must be a plane"):
        NonlinearContactProblem(residual(u), u, contact=Foundation(top, shape=ball))


@pytest.mark.parametrize("values", [np.nan, -3.0], ids=["undefined", "inverted"])
def test_a_first_iterate_without_a_residual(values):
    """It is named, and u keeps it, until a solve begins at another one."""
    problem = block()
    problem.u.x.array[4:] = values
    before = problem.u.x.array.copy()
    with pytest.raises(
        ConvergenceError, match=r"inside out \(at the values of u before the solve\)"
    ):
        problem.solve()
    assert problem.status is Status.INVERTED
    np.testing.assert_array_equal(problem.u.x.array, before)
    problem.u.x.array[:] = 0.0
    assert problem.solve() is problem.u


def test_wrong_placements_are_named():
    """Numbers that are none, other keys, and other kinds of values; the shape stays where it is."""
    problem = block()
    before = problem.shapes[0].shape
    for placement in (
        {"shift": (0.0, np.nan)},
        {"rotation": np.inf},
        {"turn": 3.0},
        {"shift": "up"},
    ):
        with pytest.raises(FormError, match=r"contact\[0\]\.shape"):
            problem.place(0, **placement)
    assert problem.shapes[0].shape == before


@pytest.mark.mpi
def test_update_that_raises_on_one_rank():
    """All ranks have the error of the one, and go on together."""
    space, side = rectangle([1.0, 1.0], [2, 2], MPI.COMM_WORLD)
    comm, u, raising = space.mesh.comm, fem.Function(space), True

    def update():
        if raising and comm.rank == comm.size - 1:
            raise ValueError("no return")

    contact = Foundation(side(1, 1.0), shape=PLATE | {"shift": (0.0, -0.05)})
    problem = NonlinearContactProblem(
        residual(u), u, bcs=[held(space, side(1, 0.0))], contact=contact, update=update
    )
    with pytest.raises(FormError, match="update: raised ValueError: no return"):
        problem.solve()
    raising = False
    problem.solve()
    assert problem.certificate.holds
