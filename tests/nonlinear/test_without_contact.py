"""Bodies without contact go the same way: as scenes, as forms, as residuals."""

from pathlib import Path

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from numpy.testing import assert_allclose
from on_meshes import vector_space
from scenes import alone
from scipy.optimize import root
from support.nonlinear_bodies import Killed, held, rectangle

from signorini_fx import ContactProblem, ConvergenceError, NonlinearContactProblem, solve
from signorini_fx.errors import FormError
from signorini_fx.forms.meshes import solve_nested
from signorini_fx.records import Status, StepRecord
from signorini_fx.scenes.scene import Scene

YOUNG, POISSON, PULL = 100.0, 0.3, 40.0
SHEAR, LAME = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))


def bar(**material):
    """A bar that is pulled, in two load steps, free to become thinner."""
    size = {"length": 2.0, "height": 1.0, "nx": 8, "ny": 4, "cell": "triangle"}
    return Scene(
        title="bar",
        mesh={"generator": "rectangle", "parameters": size},
        material={"young": YOUNG, "poisson": POISSON} | material,
        displacement=[{"boundary": "left", "x": 0.0}, {"boundary": "bottom", "y": 0.0}],
        traction={"boundary": "right", "x": PULL, "factors": [0.5, 1.0]},
        load_steps={"times": [0.5, 1.0]},
    )


def stretches(pull):
    """Those along and across a neo-Hookean bar in plane strain, from its energy mu/2 (tr C - 3) -
    mu ln J +
    lambda/2 ln^2 J: nominal stresses are its derivatives.
    """

    def unbalanced(both):
        along, across = both
        volume = LAME * np.log(along * across)
        return SHEAR * (along - 1 / along) + volume / along - pull, SHEAR * (
            across - 1 / across
        ) + volume / across

    solved = root(unbalanced, (1.0, 1.0), tol=1e-14)
    assert solved.success
    return solved.x


def certified(solution):
    """It, if its certificate holds."""
    assert solution.converged
    assert solution.certificate.holds
    assert solution.contact is None
    return solution


@pytest.mark.mpi
def test_a_bar_of_rubber():
    """Its stretches follow from its energy; forces at both ends balance, and the stress is that of
    the pull.
    """
    solution = certified(solve(bar(law="neo-hooke"), MPI.COMM_WORLD))
    for step, share in zip(solution.steps, (0.5, 1.0), strict=True):
        (along, across), space = stretches(share * PULL), step.displacement.function_space
        count = space.dofmap.index_map.size_local
        x, y = (
            space.tabulate_dof_coordinates()[:count, :2],
            step.displacement.x.array.reshape(-1, 2)[:count],
        )
        assert_allclose(y, x * (along - 1, across - 1), atol=1e-9)
        assert step.linear_solves > 2
    rows = {row.boundary: row for row in solution.resultants.every()}
    assert_allclose(rows["right"].force, (PULL, 0.0), atol=1e-9)
    assert_allclose(rows["left"].force, (-PULL, 0.0), atol=1e-9)
    assert_allclose(rows["left"].acts_at, (0.0, across / 2), atol=1e-9)
    assert solution.stress.largest("xx").value == pytest.approx(PULL / across, rel=1e-9)


def forms(mesh):
    """The linear bar as forms: a, L, its stress, conditions, parts of its boundary, and the
    pull.
    """
    space = vector_space(mesh)
    sides = {
        name: dmesh.locate_entities_boundary(
            mesh, 1, lambda x, axis=axis, at=at: np.isclose(x[axis], at)
        )
        for name, axis, at in (("left", 0, 0.0), ("right", 0, 2.0), ("bottom", 1, 0.0))
    }
    tags = dmesh.meshtags(
        mesh, 1, np.sort(sides["right"]), np.full(sides["right"].size, 1, dtype=np.int32)
    )
    pull, v = fem.Constant(mesh, 0.0), ufl.TestFunction(space)

    def stress(y):
        strain = ufl.sym(ufl.grad(y))
        mean, (xx, xy, _, yy) = (
            LAME * ufl.tr(strain),
            (strain[i, j] for i in (0, 1) for j in (0, 1)),
        )
        rows = [
            [2 * SHEAR * xx + mean, 2 * SHEAR * xy, 0],
            [2 * SHEAR * xy, 2 * SHEAR * yy + mean, 0],
            [0, 0, mean],
        ]
        return ufl.as_matrix(rows)

    strain = ufl.sym(ufl.grad(v))
    trial = ufl.sym(ufl.grad(ufl.TrialFunction(space)))
    a = (2 * SHEAR * ufl.inner(trial, strain) + LAME * ufl.tr(trial) * ufl.tr(strain)) * ufl.dx
    L = pull * v[0] * ufl.ds(1, subdomain_data=tags, domain=mesh)
    bcs = [held(space, sides["left"], 0), held(space, sides["bottom"], 1)]
    return space, a, L, stress, bcs, sides, pull


def test_three_fronts_agree():
    """A scene, forms, and a residual that is linear, over two load steps."""
    scene = certified(alone(bar()))
    space, a, L, stress, bcs, sides, pull = forms(scene.model.tagged.mesh)
    linear = ContactProblem(a, L, contact=(), bcs=bcs, stress=stress, boundaries=sides)
    u = fem.Function(space)
    residual = ufl.action(a, u) - L
    newton = NonlinearContactProblem(residual, u, bcs=bcs, boundaries=sides)
    for problem in (linear, newton):
        solution = certified(
            problem.run([0.5, 1.0], lambda time: setattr(pull, "value", PULL * time))
        )
        assert [step.time for step in solution.steps] == [0.5, 1.0]
        for step, reference in zip(solution.steps, scene.steps, strict=True):
            assert_allclose(step.displacement.x.array, reference.displacement.x.array, atol=1e-12)
        force = {row.boundary: row.force for row in solution.resultants.every()}["left"]
        assert_allclose(force, (-PULL, 0.0), atol=1e-9)
    assert scene.error_bound.error < 1e-6 * scene.error_bound.size  # the stress is constant
    assert linear.solution.last_step.strain_energy == pytest.approx(
        scene.last_step.strain_energy, rel=1e-12
    )
    assert linear.solution.stress.largest().value == pytest.approx(
        scene.stress.largest().value, rel=1e-9
    )


def test_what_needs_contact_says_so():
    """By name; a body that nothing holds is one that is not held."""
    _, a, L, stress, bcs, _, pull = forms(bar_mesh())
    problem, pull.value = ContactProblem(a, L, bcs=bcs, stress=stress), PULL
    problem.solve()
    assert problem.state.boundary.size == 0
    assert not problem.pressure.x.array.any()
    for asked in (lambda: problem.errors, lambda: problem.gradient(problem.u[0] * ufl.dx, [pull])):
        with pytest.raises(FormError, match="contact: there is none"):
            asked()
    with pytest.raises(FormError, match="must return a problem with contact"):
        solve_nested(lambda mesh: ContactProblem(*forms(mesh)[1:3]), bar_mesh(), levels=2)
    problem.bcs = []
    with pytest.raises(ConvergenceError):
        problem.solve()
    assert problem.status is Status.NOT_HELD


def bar_mesh():
    """That of the bar."""
    return dmesh.create_rectangle(
        MPI.COMM_SELF, [(0.0, 0.0), (2.0, 1.0)], [8, 4], dmesh.CellType.triangle
    )


def column(share):
    """A slender column, clamped at one end, under this share of Euler's load pi^2 E' h^3 / (48
    l^2).
    """
    length, height = 10.0, 1.0
    space, side = rectangle([length, height], [40, 2], degree=2)
    u, v, mesh = fem.Function(space), ufl.TestFunction(space), space.mesh
    gradient = ufl.Identity(2) + ufl.grad(u)
    volume = ufl.det(gradient)
    nominal = SHEAR * (gradient - ufl.inv(gradient).T) + LAME * ufl.ln(volume) * ufl.inv(gradient).T
    end = side(0, length)
    tags = dmesh.meshtags(mesh, 1, np.sort(end), np.full(end.size, 1, dtype=np.int32))
    push = share * np.pi**2 * YOUNG / (1 - POISSON**2) * height**2 / (48 * length**2)
    rule = {"quadrature_degree": 4}
    F = ufl.inner(nominal, ufl.grad(v)) * ufl.dx(metadata=rule)
    F += push * v[0] * ufl.ds(1, subdomain_data=tags, domain=mesh)
    return NonlinearContactProblem(F, u, bcs=[held(space, side(0, 0.0))])


def test_a_column_is_stable_up_to_the_load_of_euler():
    """A straight column is in equilibrium under any load: beyond 1.02 times that of a bar without
    shear it is unstable, and said to be.
    """
    problem = column(0.96)
    problem.solve()
    certified(problem.solution)
    with pytest.raises(ConvergenceError):
        (problem := column(1.04)).solve()
    assert problem.status is Status.UNSTABLE


@pytest.mark.mpi
@pytest.mark.one_quick("further", [{}, {"law": "neo-hooke"}], ids=["linear", "nonlinear"])
def test_restart_of_a_scene(tmp_path, further):
    """Likewise, on any number of ranks."""
    folder, scene = Path(MPI.COMM_WORLD.bcast(str(tmp_path))), bar(**further)

    def watch(record):
        if isinstance(record, StepRecord) and record.step == 2:
            raise Killed

    with pytest.raises(Killed):
        solve(scene, MPI.COMM_WORLD, checkpoint=folder, observers=[watch])
    solution, reference = solve(scene, checkpoint=folder, restart=True), solve(scene)
    assert solution.history.events[0].startswith("restart: 1 complete load step")
    assert not any("solved again" in event for event in solution.history.events)
    for step, other in zip(certified(solution).steps, reference.steps, strict=True):
        assert (step.time, step.linear_solves) == (other.time, other.linear_solves)
        both = step.displacement, other.displacement  # whose nodes may be on other ranks
        owned = [y.x.array[: 2 * y.function_space.dofmap.index_map.size_local] for y in both]
        everywhere = [np.sort(np.concatenate(MPI.COMM_WORLD.allgather(values))) for values in owned]
        assert_allclose(*everywhere, atol=1e-12)
