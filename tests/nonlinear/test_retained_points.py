"""Contact points far from touching are eliminated with the inside of the body: solutions do not depend on which."""

from functools import partial

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem, Tresca
from signorini_fx.forms.nonlinear import retained_points
from signorini_fx.forms.nonlinear.retained_points import RetainedPoints
from tests.support.nonlinear_bodies import LAME, MU, held, neo_hooke

NONE = -10.0  # a reach with which no point is retained that need not be


def with_reach(monkeypatch, reach):
    """Points are chosen with this reach; None: all are retained."""
    if reach is None:
        monkeypatch.setattr(RetainedPoints, "far_points", lambda *_: None)
    else:
        monkeypatch.setattr(retained_points, "RETAINED_REACH", reach)


def answers(monkeypatch, make, *, reach, steps):
    """Displacements and nodal forces after each step, and how many points its last tangent has left out.

    Args:
        monkeypatch: of pytest.
        make: makes a problem.
        reach: see ``with_reach``.
        steps: each changes the problem before it is solved.
    """
    with_reach(monkeypatch, reach)
    problem, found, left = make(), [], []
    for change in steps:
        change(problem)
        problem.solve()
        problem.advance()
        boundary = problem.state.boundary
        found.append([problem.u.x.array.copy(), boundary.nodal_forces(problem.state.pressure, problem.state.shear)])
        far = problem.linear.elastic.far
        left.append(0 if far is None else int(np.count_nonzero(far[0])))
    return found, left


def small_block(energy, *, shape, friction, holds=True, below=None):
    """A problem of a block of one of these energies under a shape, condensed however small it is.

    Args:
        energy: of the displacement, UFL.
        shape: above.
        friction: there.
        holds: whether the lower side is held.
        below: a shape below; None: there is none.
    """
    mesh = dmesh.create_box(MPI.COMM_SELF, [[-1, -1, -0.7], [1, 1, 0]], [6, 6, 2], dmesh.CellType.hexahedron)
    u = fem.Function(fem.functionspace(mesh, ("Lagrange", 1, (3,))))
    lower, upper = (dmesh.locate_entities_boundary(mesh, 2, lambda x, z=z: np.isclose(x[2], z)) for z in (-0.7, 0.0))
    F = ufl.derivative(energy(u) * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(u.function_space))
    contact = [Foundation(upper, shape=shape, friction=friction)]
    if below is not None:
        contact.append(Foundation(lower, shape=below, friction=friction))
    bcs = [held(u.function_space, lower)] if holds else []
    return NonlinearContactProblem(F, u, bcs=bcs, contact=contact, linear_algebra="condensed")


def quadratic(u):
    """The strain energy of a linear body, whose tangent stays what it is."""
    strain = ufl.sym(ufl.grad(u))
    return MU * ufl.inner(strain, strain) + LAME / 2 * ufl.tr(strain) ** 2


def moved(*shift, **rotation):
    """A step that places the first shape."""
    return lambda problem: problem.place(0, shift=shift, **rotation)


SPHERE = {"shape": "sphere", "centre": (0.0, 0.0, 1.0), "radius": 1.0}
PLANE = {"shape": "plane", "point": (0.0, 0.0, 0.0), "normal": (0.0, 0.0, -1.0)}
TILTED = {"rotation": (0.0, 15.0, 0.0)}


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("make", "steps", "leaves_out"),
    [
        # A bound that is given acts without contact.
        (partial(small_block, neo_hooke, shape=SPHERE, friction=Tresca(1.0)), [moved(0, 0, -0.1), moved(0.2, 0, 0)], 0),
        # Held by nothing but contact, it is condensed onto all points.
        (
            partial(
                small_block,
                neo_hooke,
                shape=SPHERE,
                friction=Coulomb(0.5),
                holds=False,
                below={"shape": "plane", "point": (0.0, 0.0, -0.7), "normal": (0.0, 0.0, 1.0)},
            ),
            [moved(0, 0, -0.01), moved(0, 0, -0.1), moved(0, 0, -0.15)],
            None,
        ),
        # The tangent of the step before serves once more, with its points left out, while these come into contact.
        (
            partial(small_block, quadratic, shape=PLANE, friction=None),
            [moved(0, 0, 0.5), moved(0, 0, 0.5, **TILTED), moved(0, 0, 0.4), moved(0, 0, 0.1)],
            2,  # in the last one points come into contact, so that all are retained
        ),
    ],
    ids=["tresca", "floating", "tangent-of-before"],
)
def test_what_else_acts_on_points(monkeypatch, make, steps, leaves_out):
    """Answers are those with all points; ``leaves_out``: in how many steps the last tangent leaves out some, None: in
    none, whatever is chosen.
    """
    with monkeypatch.context() as patched:
        expected, all_points = answers(patched, make, reach=None, steps=steps)
    assert not any(all_points)
    found, left = answers(monkeypatch, make, reach=NONE, steps=steps)
    if leaves_out is not None:
        assert sum(count > 0 for count in left) == leaves_out, left
    for values in zip(found, expected, strict=True):
        for ours, reference in zip(*values, strict=True):
            assert ours == pytest.approx(reference, abs=1e-9 * max(1e-3, np.abs(reference).max()))
