"""Contact points far from touching are eliminated with the inside of the body: solutions do not depend on which."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem
from signorini_fx.forms.nonlinear import retained_points
from signorini_fx.forms.nonlinear.retained_points import RetainedPoints
from tests.support.nonlinear_bodies import held, neo_hooke


def pressed(monkeypatch, *, reach, left_out):
    """A sphere is pressed into a block of rubber, lifted out of it, and pressed in beside: the displacements, the
    linear solves, how many points were left out of each tangent, and whether these sufficed.
    """
    monkeypatch.setattr(retained_points, "RETAINED_REACH", reach)
    monkeypatch.setattr(retained_points, "FEWEST_LEFT_OUT", left_out)
    seen, suffice = [], RetainedPoints.suffice

    def told(self, far, begun, outcome):
        seen.append((0 if far is None else np.count_nonzero(far[0]), suffice(self, far, begun, outcome)))
        return seen[-1][1]

    monkeypatch.setattr(RetainedPoints, "suffice", told)
    mesh = dmesh.create_box(MPI.COMM_SELF, [[-1, -1, -1], [1, 1, 0]], [10, 10, 4], dmesh.CellType.hexahedron)
    u = fem.Function(fem.functionspace(mesh, ("Lagrange", 1, (3,))))
    below, above = (dmesh.locate_entities_boundary(mesh, 2, lambda x, z=z: np.isclose(x[2], z)) for z in (-1.0, 0.0))
    F = ufl.derivative(neo_hooke(u) * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(u.function_space))
    sphere = {"shape": "sphere", "centre": (0.0, 0.0, 1.0), "radius": 1.0}
    contact = Foundation(above, shape=sphere, friction=Coulomb(0.3))
    problem, found = NonlinearContactProblem(F, u, bcs=[held(u.function_space, below)], contact=contact), []
    for shift in ((0.0, 0.0, -0.1), (0.3, 0.0, 0.05), (0.4, 0.0, -0.05)):
        problem.place(0, shift=shift)
        problem.solve()
        problem.advance()
        found.append(u.x.array.copy())
    return np.array(found), len(problem.history.iterations), seen


@pytest.mark.parametrize(("reach", "repeats"), [(0.5, False), (-10.0, True)])
def test_left_out_points(monkeypatch, reach, repeats):
    """The answers are those with all points, to round-off, also if points are left out that will touch: these are found
    and added.  None is, with the reach that the package has.
    """
    with monkeypatch.context() as patched:
        expected, solves, all_points = pressed(patched, reach=0.5, left_out=2.0)
    assert not any(left for left, _ in all_points)
    found, taken, seen = pressed(monkeypatch, reach=reach, left_out=0.2)
    assert sum(left > 0 for left, _ in seen) > len(seen) / 2
    assert any(not sufficed for _, sufficed in seen) == repeats
    assert (taken > solves) == repeats
    assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()
