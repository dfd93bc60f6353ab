"""Verdicts on stability: by the derivative of F, with the curvature of shapes, in any units; or
none.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import at_coordinate, trial_and_test, vector_space
from support.nonlinear_bodies import LAME, MU, PLATE, held, rectangle, residual

from signorini_fx import ConvergenceError, Coulomb, Foundation, NonlinearContactProblem, Status
from signorini_fx.forms.nonlinear.moving_shapes import turning_of
from signorini_fx.forms.nonlinear.verdicts import stable

HIGH = PLATE | {"point": (0.0, 8.0)}


def initial_stiffness(space):
    """The tangent of the body at rest."""
    w, z = trial_and_test(space)
    strain = ufl.sym(ufl.grad(w))
    return (
        ufl.inner(2 * MU * strain + LAME * ufl.tr(strain) * ufl.Identity(2), ufl.grad(z)) * ufl.dx
    )


def column(**options):
    """A column under a plate, pressed by 3 %, beyond Euler's load of its clamped and smooth
    ends.
    """
    space, side = rectangle([1.0, 8.0], [2, 16])
    u = fem.Function(space)
    shape = HIGH | {"shift": (0.0, -0.24)}
    contact = Foundation(side(1, 8.0), shape=shape, friction=options.pop("friction", None))
    make = {"J": initial_stiffness(space)} if options.pop("wrong", False) else {}
    return NonlinearContactProblem(
        residual(u), u, bcs=[held(space, side(1, 0.0))], contact=contact, **make, **options
    )


def test_a_wrong_tangent_is_no_verdict():
    """The stiffness of the body at rest as J leads to the equilibrium, but does not say that it is
    stable; where nothing else could say so, as a material returns its stresses by itself, that is
    the outcome.
    """
    with pytest.raises(ConvergenceError, match="unstable equilibrium"):
        column(wrong=True).solve()
    problem = column(wrong=True, stability=False)
    problem.solve()
    assert problem.certificate.holds


def test_no_verdict_without_a_derivative():
    """Stresses that ``update`` returns are not differentiated by UFL: without their tangent there
    is no verdict.
    """
    space, side = rectangle([1.0, 1.0], [2, 2])
    u, followed = fem.Function(space), fem.Function(space)
    form = ufl.replace(residual(u), {u: followed})

    def update():
        followed.x.array[:] = u.x.array

    def problem(J, **options):
        contact = Foundation(side(1, 1.0), shape=PLATE | {"shift": (0.0, -0.05)})
        bcs = [held(space, side(1, 0.0))]
        return NonlinearContactProblem(
            form, u, bcs=bcs, contact=contact, J=J, update=update, **options
        )

    with pytest.raises(ConvergenceError, match="stability unknown"):
        problem(initial_stiffness(space)).solve()
    unknown, loads = problem(initial_stiffness(space)), list[float]()
    with pytest.raises(ConvergenceError, match="stability unknown"):
        unknown.run(
            [1.0], lambda load: loads.append(load) or unknown.place(0, shift=(0.0, -0.05 * load))
        )
    assert loads == [1.0, 0.0]  # a smaller step would know no more
    unjudged = problem(initial_stiffness(space), stability=False)
    unjudged.solve()
    assert (followed.x.array == u.x.array).all()
    exact = problem(ufl.derivative(form, followed, ufl.TrialFunction(space)))
    exact.solve()
    assert exact.status is Status.CONVERGED
    assert (
        followed.x.array == u.x.array
    ).all()  # the state is that of the solution, whatever was tried for verdicts


@pytest.mark.one_quick("degree", [1, 2])
def test_a_column_on_top_of_a_circle(degree):
    """It would roll off: the curvature of the circle decides, which the tangent of the body does
    not have.
    """
    space, side = rectangle([1.0, 2.0], [2, 4], degree=degree)
    u, statuses = fem.Function(space), []
    for hollow, radius in (
        (False, 3.0),
        (True, 3.0),
    ):  # convex below the column, and a bowl around its end
        centre = (0.5, -radius) if not hollow else (0.5, np.sqrt(radius**2 - 0.25))
        circle = {"shape": "circle", "centre": centre, "radius": radius, "hollow": hollow}
        u.x.array[:] = 0.0
        soft = (
            1e-5 * MU * u[0] * ufl.TestFunction(space)[0] * ufl.ds
        )  # holds the body where nothing else does
        top = fem.locate_dofs_topological(space.sub(1), 1, side(1, 2.0))
        push = fem.dirichletbc(-0.02, top, space.sub(1))
        contact = Foundation(side(1, 0.0), shape=circle)
        problem = NonlinearContactProblem(residual(u) + soft, u, bcs=[push], contact=contact)
        try:
            problem.solve()
        except ConvergenceError:
            assert problem.status is Status.UNSTABLE
        statuses.append(problem.status)
    assert statuses == [Status.UNSTABLE, Status.CONVERGED]


def test_shears_that_turn_with_their_slip(monkeypatch):
    """A cube of rubber that a rough plate squeezes slides inwards under it: as dead loads these
    shears would twist it, but friction acts against a twist.
    """
    mesh = dmesh.create_box(
        MPI.COMM_SELF, [[0.0] * 3, [1.0] * 3], [4, 4, 4], dmesh.CellType.hexahedron
    )
    space = vector_space(mesh, 1, 3)
    u = fem.Function(space)
    gradient = ufl.Identity(3) + ufl.grad(u)
    volume = ufl.det(gradient)
    energy = (
        volume ** (-2 / 3) * ufl.inner(gradient, gradient) - 3 + 1000.0 * (volume - 1) ** 2
    ) / 2
    form = ufl.derivative(
        energy * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(space)
    )
    bottom, top = (
        dmesh.locate_entities_boundary(mesh, 2, at_coordinate(2, at)) for at in (0.0, 1.0)
    )
    plate = {
        "shape": "plane",
        "point": (0.0, 0.0, 1.0),
        "normal": (0.0, 0.0, -1.0),
        "shift": (0.0, 0.0, -0.05),
    }
    contact = Foundation(top, shape=plate, friction=Coulomb(0.5))
    problem = NonlinearContactProblem(form, u, bcs=[held(space, bottom)], contact=contact)
    problem.solve()
    assert problem.status is Status.CONVERGED
    assert problem.state.areas["slip"] > 0.5
    blocks = turning_of(problem.state, 1.0)[:, 1:, 1:]
    assert (
        np.abs(np.einsum("nij,nj->ni", blocks, problem.state.slip_length)).max()
        < 1e-12 * blocks.max()
    )
    without = "signorini_fx.forms.nonlinear.verdicts.turning_of"
    monkeypatch.setattr(without, lambda state, size: np.zeros((state.boundary.size, 3, 3)))
    assert stable(problem.linear.solved)[0] is Status.UNSTABLE
