"""Verdicts on stability: by the derivative of F, with the curvature of shapes, in any units; or none."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from support.nonlinear_bodies import LAME, MU, PLATE, held, neo_hooke, rectangle, residual

from signorini_fx import ConvergenceError, Coulomb, Foundation, NonlinearContactProblem, Status
from signorini_fx.forms.nonlinear.condensed_inertia import is_positive
from signorini_fx.forms.nonlinear.tangent import is_derivative, product
from signorini_fx.mechanics.assembly.mesh_entities import assemble

HIGH = PLATE | {"point": (0.0, 8.0)}


def initial_stiffness(space):
    """The tangent of the body at rest."""
    w, z = ufl.TrialFunction(space), ufl.TestFunction(space)
    strain = ufl.sym(ufl.grad(w))
    return ufl.inner(2 * MU * strain + LAME * ufl.tr(strain) * ufl.Identity(2), ufl.grad(z)) * ufl.dx


def column(**options):
    """A column under a plate, pressed by 3 %, beyond Euler's load of its clamped and smooth ends."""
    space, side = rectangle([1.0, 8.0], [2, 16], MPI.COMM_SELF)
    u = fem.Function(space)
    shape = HIGH | {"shift": (0.0, -0.24)}
    contact = Foundation(side(1, 8.0), shape=shape, friction=options.pop("friction", None))
    make = {"J": initial_stiffness(space)} if options.pop("wrong", False) else {}
    return NonlinearContactProblem(residual(u), u, bcs=[held(space, side(1, 0.0))], contact=contact, **make, **options)


def test_a_wrong_tangent_is_no_verdict():
    """The stiffness of the body at rest as J leads to the equilibrium, but does not say that it is stable; where
    nothing else could say so, as a material returns its stresses by itself, that is the outcome.
    """
    with pytest.raises(ConvergenceError, match="unstable equilibrium"):
        column(wrong=True).solve()
    problem = column(wrong=True, stability=False)
    problem.solve()
    assert problem.certificate.holds


def last_factor(problem, at_end=None):
    """What the factorisation of the last iteration says, and in how many directions the tangent of now is negative;
    ``at_end``: a product in place of that of now.
    """
    solver = problem._solver
    (tangent, found), stability = solver.stability._derivative(), solver.stability
    linear = problem.linear
    linear.bend()
    negative, _ = stability._negative(tangent)
    said = is_positive(linear.elastic, linear.task.system, stability._restraint(), at_end or found)
    return said, negative


@pytest.mark.parametrize("friction", [None, Coulomb(0.3)])
def test_the_last_factor_says_what_another_one_does(friction):
    """Of a column that is pressed beyond Euler's load in small steps; what it cannot know it does not say."""
    problem = column(stability=False, linear_algebra="condensed", friction=friction)
    told = []
    for depth in np.linspace(0.06, 0.36, 16) * (1.0 if friction is None else 4.0):
        problem.place(0, shift=(0.0, -depth))
        problem.solve()
        problem.advance()
        told.append(last_factor(problem))
    assert all(said == (negative == 0) for said, negative in told)
    assert {negative for _, negative in told} >= {0, 1}


def test_a_last_factor_of_another_tangent_says_nothing():
    """Where the tangent of now is that of a column beyond Euler's load, or of one on the way there, or the last one was
    not condensed.
    """
    problem = column(linear_algebra="condensed")
    problem.place(0, shift=(0.0, -0.04))
    problem.solve()
    assert last_factor(problem) == (True, 0)
    solver, values = problem._solver, problem.u.x.array.copy()
    for share, enough in ((1e-8, True), (3.0, False), (8.0, False)):
        problem.u.x.array[:] = (1.0 + share) * values
        moved = product(solver.tangents.leading, problem.u, ~solver.stability._fixed, 1e-7)
        problem.u.x.array[:] = values
        assert last_factor(problem, moved)[0] is enough
    whole = column(linear_algebra="full")
    whole.place(0, shift=(0.0, -0.04))
    whole.solve()
    assert last_factor(whole) == (False, 0)


def test_a_last_factor_that_is_negative_inside():
    """What was eliminated counts too: the middle of a column that both its ends hold buckles, and no point of contact
    moves with it.
    """
    problem = column(stability=False, linear_algebra="condensed", friction=Coulomb(10.0))
    for depth in (0.2, 0.6, 1.0):
        problem.place(0, shift=(0.0, -depth))
        problem.solve()
        problem.advance()
    said, negative = last_factor(problem)
    assert negative > 0
    assert not said


def test_a_wrong_tangent_proves_no_limit():
    """With a J that is negative Newton's method fails at any load, but the body would hold all of them."""
    space, side = rectangle([1.0, 1.0], [2, 2], MPI.COMM_SELF)
    u = fem.Function(space)
    contact = Foundation(side(1, 1.0), shape=PLATE, friction=Coulomb(0.3))
    wrong = -ufl.derivative(residual(u), u, ufl.TrialFunction(space))
    problem = NonlinearContactProblem(residual(u), u, bcs=[held(space, side(1, 0.0))], contact=contact, J=wrong)
    with pytest.raises(ConvergenceError):
        problem.ramp(lambda load: problem.place(0, shift=(0.0, -0.1 * load)), smallest=0.5)
    assert problem.status is not Status.LIMIT


def test_no_verdict_without_a_derivative():
    """Stresses that ``update`` returns are not differentiated by UFL: without their tangent there is no verdict."""
    space, side = rectangle([1.0, 1.0], [2, 2], MPI.COMM_SELF)
    u, followed = fem.Function(space), fem.Function(space)
    form = ufl.replace(residual(u), {u: followed})

    def update():
        followed.x.array[:] = u.x.array

    def problem(J, **options):
        contact = Foundation(side(1, 1.0), shape=PLATE | {"shift": (0.0, -0.05)})
        bcs = [held(space, side(1, 0.0))]
        return NonlinearContactProblem(form, u, bcs=bcs, contact=contact, J=J, update=update, **options)

    with pytest.raises(ConvergenceError, match="stability not known"):
        problem(initial_stiffness(space)).solve()
    unknown, loads = problem(initial_stiffness(space)), list[float]()
    with pytest.raises(ConvergenceError, match="stability not known"):
        unknown.ramp(lambda load: loads.append(load) or unknown.place(0, shift=(0.0, -0.05 * load)))
    assert loads == [1.0, 0.0]  # a smaller step would know no more
    unjudged = problem(initial_stiffness(space), stability=False)
    unjudged.solve()
    assert (followed.x.array == u.x.array).all()
    exact = problem(ufl.derivative(form, followed, ufl.TrialFunction(space)))
    exact.solve()
    assert exact.status is Status.CONVERGED
    assert (followed.x.array == u.x.array).all()  # the state is that of the solution, whatever was tried for verdicts


@pytest.mark.parametrize("beyond", [1e-8, 0.0])
def test_a_residual_near_a_kink(beyond):
    """Springs that meet the body after 1e-8: differences over a strain of 1e-7 lead across.  At the kink itself the
    derivative is that of either side; and what is none is seen beside it.
    """
    space, _ = rectangle([1.0, 1.0], [2, 2], MPI.COMM_SELF)
    u, trial = fem.Function(space), ufl.TrialFunction(space)

    def springs(force):
        return MU * force * ufl.TestFunction(space)[0] * ufl.ds

    form = fem.form(residual(u) + springs(ufl.max_value(u[0] - beyond, 0.0)))
    free = np.ones(u.x.array.size, dtype=bool)

    def forces(values):
        u.x.array[:] = values
        return assemble(form)

    exact = ufl.derivative(residual(u), u, trial)
    assert is_derivative(fem.form(exact), u, forces, free)
    assert is_derivative(fem.form(exact + springs(trial[0])), u, forces, free) is (beyond == 0.0)
    for wrong in (1.00001 * exact, exact - springs(trial[0]), exact + springs(2 * trial[0])):
        assert not is_derivative(fem.form(wrong), u, forces, free)


def test_a_cell_at_its_yield_strain():
    """A bar that is stretched by its weight is solved with its tangent where the strain of a cell is that of a kink of
    its law.
    """
    space, side = rectangle([1.0, 1.0], [4, 1], MPI.COMM_SELF, cell="triangle")
    u, v, w = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
    yields = fem.Constant(space.mesh, 1.0)

    def strain(y):
        return ufl.sym(ufl.grad(y))

    above = ufl.conditional(ufl.gt(strain(u)[0, 0], yields), 1.0, 0.0)
    softer = 0.9 * above * (strain(u)[0, 0] - yields)
    F = MU * (ufl.inner(strain(u), strain(v)) - softer * strain(v)[0, 0] - 1e-3 * v[0]) * ufl.dx
    J = MU * (ufl.inner(strain(w), strain(v)) - 0.9 * above * strain(w)[0, 0] * strain(v)[0, 0]) * ufl.dx
    problem = NonlinearContactProblem(F, u, J=J, bcs=[held(space, side(0, 0.0))])
    problem.solve()
    cells = np.arange(8, dtype=np.int32)
    along = fem.Expression(strain(u)[0, 0], np.array([[1 / 3, 1 / 3]])).eval(space.mesh, cells).ravel()
    yields.value = np.sort(along)[-1]
    problem.solve()
    assert problem.status is Status.CONVERGED


@pytest.mark.parametrize("degree", [1, 2])
def test_a_column_on_top_of_a_circle(degree):
    """It would roll off: the curvature of the circle decides, which the tangent of the body does not have."""
    space, side = rectangle([1.0, 2.0], [2, 4], MPI.COMM_SELF, degree=degree)
    u, statuses = fem.Function(space), []
    for hollow, radius in ((False, 3.0), (True, 3.0)):  # convex below the column, and a bowl around its end
        centre = (0.5, -radius) if not hollow else (0.5, np.sqrt(radius**2 - 0.25))
        circle = {"shape": "circle", "centre": centre, "radius": radius, "hollow": hollow}
        u.x.array[:] = 0.0
        soft = 1e-5 * MU * u[0] * ufl.TestFunction(space)[0] * ufl.ds  # holds the body where nothing else does
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
    """A cube of rubber that a rough plate squeezes slides inwards under it: as dead loads these shears would twist it,
    but friction acts against a twist.
    """
    mesh = dmesh.create_box(MPI.COMM_SELF, [[0.0] * 3, [1.0] * 3], [4, 4, 4], dmesh.CellType.hexahedron)
    space = fem.functionspace(mesh, ("Lagrange", 1, (3,)))
    u = fem.Function(space)
    gradient = ufl.Identity(3) + ufl.grad(u)
    volume = ufl.det(gradient)
    energy = (volume ** (-2 / 3) * ufl.inner(gradient, gradient) - 3 + 1000.0 * (volume - 1) ** 2) / 2
    form = ufl.derivative(energy * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(space))
    bottom, top = (dmesh.locate_entities_boundary(mesh, 2, lambda x, at=at: np.isclose(x[2], at)) for at in (0.0, 1.0))
    plate = {"shape": "plane", "point": (0.0, 0.0, 1.0), "normal": (0.0, 0.0, -1.0), "shift": (0.0, 0.0, -0.05)}
    contact = Foundation(top, shape=plate, friction=Coulomb(0.5))
    problem = NonlinearContactProblem(form, u, bcs=[held(space, bottom)], contact=contact)
    problem.solve()
    assert problem.status is Status.CONVERGED
    assert problem.state.areas["slip"] > 0.5
    without = "signorini_fx.forms.nonlinear.stability.turning_of"
    monkeypatch.setattr(without, lambda state, size: np.zeros((state.boundary.size, 3, 3)))
    assert problem._solver.stability.verdict() is Status.UNSTABLE


@pytest.mark.parametrize("unit", [1.0, 2.1e9, 1e-9])
def test_verdicts_in_any_units(unit):
    """A column below a tilted plate, held across at its top: normals askew to what is prescribed."""
    space, side = rectangle([1.0, 8.0], [2, 16], MPI.COMM_SELF)
    u = fem.Function(space)
    tilted = HIGH | {"normal": (np.sin(0.2), -np.cos(0.2))}
    contact = Foundation(side(1, 8.0), shape=tilted)
    bcs = [held(space, side(1, 0.0)), held(space, side(1, 8.0), 0)]
    form = ufl.derivative(unit * neo_hooke(u) * ufl.dx, u, ufl.TestFunction(space))
    problem = NonlinearContactProblem(form, u, bcs=bcs, contact=contact)
    problem.place(0, shift=(0.0, -0.1))
    problem.solve()
    assert problem.certificate.holds


def test_loads_without_potential():
    """Their tangent is not symmetric: Newton's method is as quick, and stable is what its symmetric part proves."""
    space, side = rectangle([1.0, 1.0], [2, 2], MPI.COMM_SELF)
    u = fem.Function(space)
    gradient = ufl.Identity(2) + ufl.grad(u)
    normal = ufl.det(gradient) * ufl.inv(gradient).T * ufl.FacetNormal(space.mesh)
    form = residual(u) + 0.1 * MU * ufl.inner(normal, ufl.TestFunction(space)) * u[0] * ufl.ds
    contact = Foundation(side(1, 1.0), shape=PLATE | {"shift": (0.0, -0.05)}, friction=Coulomb(0.1))
    problem = NonlinearContactProblem(form, u, bcs=[held(space, side(1, 0.0))], contact=contact)
    u.x.array[:] = 0.01 * np.random.default_rng(1).random(u.x.array.size)
    problem.solve()
    assert problem.certificate.holds
    assert problem.iterations <= 6
    assert any("the tangent is not symmetric" in event for event in problem.history.events)


def test_contact_of_a_tangent_that_has_no_solution():
    """It is no contact problem of the body: the outcome does not advise to iterate longer, but to take smaller steps,
    which a ramp does by itself.
    """
    settings = {"friction": Coulomb(0.3), "algorithm": "alm", "max_outer_iterations": 1, "fallbacks": False}
    problem = column(stability=False, **settings)
    with pytest.raises(ConvergenceError, match=r"not solved \(maximum outer iterations reached\).*take smaller steps"):
        problem.solve()
    assert problem.status is Status.NOT_SOLVED
