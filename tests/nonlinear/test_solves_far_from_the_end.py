"""How far the contact problem of an iteration is solved, and with which sets a load step begins, changes how many
linear solves there are, and nothing else.
"""

from functools import cache, partial
from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem
from signorini_fx.algebra.algorithms.task import Start
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.forms.nonlinear import newton
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.forms.nonlinear.predicted_sets import StepChange
from tests.support.nonlinear_bodies import held, neo_hooke

PLANE = (
    {"shape": "circle", "centre": (1.5, 1.5), "radius": 0.5},
    [(0.0, -0.1), (0.0, -0.2), *((0.1 * k, -0.2) for k in range(1, 5))],
)
SPACE = (
    {"shape": "sphere", "centre": (0.0, 0.0, 1.0), "radius": 1.0},
    [
        (0.0, 0.0, -0.1),
        (0.0, 0.0, -0.2),
        (0.05, 0.0, -0.2),
    ],
)
TOOL = {"shape": "circle", "centre": (1.1, 1.4), "radius": 0.4}


@cache
def block(dim):
    """A mesh of it, the same for all solves, as ranks may share another one in another way."""
    if dim == 2:
        return dmesh.create_rectangle(MPI.COMM_WORLD, [[0, 0], [4, 1]], [64, 16], dmesh.CellType.quadrilateral)
    return dmesh.create_box(MPI.COMM_WORLD, [[-1, -1, -1], [1, 1, 0]], [8, 8, 4], dmesh.CellType.hexahedron)


def ploughed(tool, shifts):
    """A round tool is pressed into a block of rubber and moved over it: displacements, iterations, linear solves."""
    dim = len(shifts[0])
    mesh, (low, high) = block(dim), (0.0, 1.0) if dim == 2 else (-1.0, 0.0)
    u = fem.Function(fem.functionspace(mesh, ("Lagrange", 1, (dim,))))
    below, above = (
        dmesh.locate_entities_boundary(mesh, dim - 1, lambda x, at=at: np.isclose(x[dim - 1], at)) for at in (low, high)
    )
    F = ufl.derivative(neo_hooke(u) * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(u.function_space))
    contact = Foundation(above, shape=tool, friction=Coulomb(0.3))
    problem = NonlinearContactProblem(F, u, bcs=[held(u.function_space, below)], contact=contact)
    found, iterations = [], 0
    for shift in shifts:
        problem.place(0, shift=shift)
        problem.solve()
        problem.advance()
        iterations += problem.iterations
        found.append(u.x.array.copy())
    return np.array(found), iterations, len(problem.history.iterations)


@pytest.mark.mpi
@pytest.mark.parametrize(("problem", "share"), [(PLANE, 0.9), (SPACE, 0.7)], ids=["plane", "space"])
def test_displacements_are_those_of_full_solves(monkeypatch, problem, share):
    """Contact problems that are solved to their end from the sets of the last load step take more linear solves, and
    those that are left early, whatever they are short of, as many iterations.
    """
    ours, iterations, solves = ploughed(*problem)
    with monkeypatch.context() as patched:
        patched.setattr(newton, "FAR_FROM_LAW", 0.0)
        patched.setattr(LinearisedProblem, "_with_first_sets", lambda self, begun: begun)
        patched.setattr(LinearisedProblem, "_with_predicted_sets", lambda self, begun: begun)
        full, fewest, largest = ploughed(*problem)
    np.testing.assert_allclose(ours, full, rtol=0, atol=1e-10 * np.abs(full).max())
    assert solves <= share * largest
    assert iterations <= fewest + 2
    monkeypatch.setattr(newton, "FAR_FROM_LAW", 0.5)
    np.testing.assert_allclose(ploughed(*problem)[0], full, rtol=0, atol=1e-10 * np.abs(full).max())


def test_a_slow_fixed_point_takes_no_iterations_of_newton(monkeypatch):
    """Of large friction under a circle that moves sideways: what its fixed point is left from falls with increments."""
    mesh = dmesh.create_rectangle(MPI.COMM_SELF, [[0, 0], [3, 1]], [24, 8], dmesh.CellType.quadrilateral)
    below, above = (dmesh.locate_entities_boundary(mesh, 1, lambda x, at=at: np.isclose(x[1], at)) for at in (0.0, 1.0))

    def iterations():
        u = fem.Function(fem.functionspace(mesh, ("Lagrange", 1, (2,))))
        energy = neo_hooke(u) * ufl.dx(metadata={"quadrature_degree": 2})
        F = ufl.derivative(energy, u, ufl.TestFunction(u.function_space))
        contact = Foundation(above, shape=TOOL, friction=Coulomb(0.9))
        problem = NonlinearContactProblem(F, u, bcs=[held(u.function_space, below)], contact=contact, coulomb="fp")
        for along in (0.0, 0.1, 0.2):
            problem.place(0, shift=(along, -0.1))
            problem.solve()
            problem.advance()
        return problem.iterations, len(problem.history.iterations)

    ours, solves = iterations()
    monkeypatch.setattr(newton, "FAR_FROM_LAW", 0.0)
    fewest, largest = iterations()
    assert ours <= fewest + 2
    assert solves <= 0.6 * largest


def changed(displacement, moved=None, pressure=(1.0, -2.0, 0.0)):
    """What a load step has changed at three points in 2D."""
    shear = np.array([[0.5, 0.0], [0.0, 0.0], [0.0, 0.0]])
    return StepChange(np.asarray(displacement), np.array(pressure), shear, moved)


@pytest.mark.parametrize(
    ("ways", "moved", "share"),
    [
        ([0.2, 0.0], None, 2.0),
        ([0.1, 0.01], None, 1.0),  # nearly along the last ones
        ([-0.1, 0.0], None, 0.0),
        ([0.0, 0.1], None, 0.0),
        ([0.0, 0.0], None, 0.0),
        ([0.1, 0.0], [[0.0, 5.0]] * 3, 0.0),  # a tool that stood still moves on
    ],
)
def test_steps_that_go_on(ways, moved, share):
    """Of the way of the last load step, along it; 0 where supports or tools go another way, back, or none."""
    change = changed([0.1, 0.0, 0.3, 0.4, 0.0, 0.0])
    supported = np.array([True, True, False, False])
    found = change.goes_on(MPI.COMM_SELF, supported, np.array(ways), None if moved is None else np.array(moved))
    assert found == pytest.approx(share)


def test_sets_after_a_step_that_goes_on():
    """A pressure that would be gone opens, a gap that would be gone closes and slips where the body goes, and what
    would be above its bound slips; a point that is called far stays open.
    """
    pressure, shear = np.array([4.0, 3.0, 0.0]), np.array([[0.9], [0.0], [0.0]])
    law = PointFriction(given=np.zeros(3), coefficient=np.full(3, 0.25))
    gap, nothing = np.array([0.0, 0.0, 0.1]), np.zeros((3, 1))
    never = np.zeros(3, dtype=bool)
    held = {"bilateral": never, "immovable": never, "slip_origin": nothing}
    data = RegularisedData(gap, 1e3, 1e3, np.inf, np.zeros(3), shear, law.bound(pressure), **held)
    sets = ActiveSets.of(pressure > 0, nothing)
    start = Start(data, law, nothing, sets, multipliers=(pressure, shear), step=1)
    boundary = SimpleNamespace(cotangents=np.tile([[1.0], [0.0]], (3, 1, 1)))

    def traces(further):
        return np.array([0.0, 0.0, 0.06 * further[0]]), np.array([[0.0], [0.0], [-0.2]])

    after = partial(changed([1.0]).sets_after, begun=start, boundary=boundary, traces=traces)
    once, twice = (after(share, far=None) for share in (1.0, 2.0))
    np.testing.assert_array_equal(once.contact, [True, True, False])
    np.testing.assert_array_equal(once.side, [1, 0, 0])
    np.testing.assert_array_equal(twice.contact, [True, False, True])
    np.testing.assert_array_equal(twice.side, [1, 0, -1])
    far = after(2.0, far=np.array([False, False, True]))
    np.testing.assert_array_equal(far.contact, [True, False, False])
