"""How far the contact problem of an iteration is solved, and with which sets a load step begins, changes how many
linear solves there are, and nothing else.
"""

from functools import cache

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem
from signorini_fx.forms.nonlinear import newton
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
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


@pytest.mark.slow
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
