"""Ramps beyond a limit point: an arch that snaps through under a circle that a force presses."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from support.nonlinear_bodies import held, neo_hooke

from signorini_fx import FormError, Foundation, NonlinearContactProblem, Status

FORCE, HELD = 0.15, {"x": 0.0, "rotation": 0.0}


def arch(comm, **shape):
    """The right half of a shallow arch that is clamped at its end, below a circle."""
    mesh = dmesh.create_rectangle(comm, [[0.0, 0.0], [4.0, 0.3]], [12, 1], dmesh.CellType.quadrilateral)
    space = fem.functionspace(mesh, ("Lagrange", 2, (2,)))

    def side(axis, at):
        return dmesh.locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[axis], at))

    top, middle, end = side(1, 0.3), side(0, 0.0), side(0, 4.0)
    mesh.geometry.x[:, 1] += 0.8 * np.cos(np.pi * mesh.geometry.x[:, 0] / 8)
    u = fem.Function(space)
    circle = {"shape": "circle", "centre": (0.0, 1.6), "radius": 0.5, "pivot": (0.0, 1.6)} | shape
    F = ufl.derivative(neo_hooke(u) * ufl.dx(metadata={"quadrature_degree": 4}), u, ufl.TestFunction(space))
    bcs = [held(space, end), held(space, middle, 0)]
    return NonlinearContactProblem(F, u, bcs=bcs, contact=Foundation(top, shape=circle), algorithm="alm")


def pressed(problem, **further):
    """A ramp of the force; where the circle is after each step, and what it exerts."""
    path = []

    def apply(load):
        problem.place(0, force=(0.0, -FORCE * load), prescribed=HELD)

    def record(step):
        path.append((step.load, float(problem.tools[0].translation[1]), -float(sum(problem.state.forces)[1])))

    problem.ramp(apply, first=0.1, largest=0.1, on_step=record, **further)
    return np.array(path)


@pytest.mark.slow
def test_an_arch_snaps_through():
    """The force rises, falls along a branch on which the circle goes on down, and rises again to its whole."""
    problem = arch(MPI.COMM_SELF, force=(0.0, 0.0), prescribed=HELD)
    loads, places, forces = pressed(problem, control=(0, "y")).T
    assert problem.status is Status.CONVERGED
    assert loads[-1] == 1.0
    assert (np.diff(places) < 0).all()
    falling = np.flatnonzero(np.diff(loads) < 0)
    assert falling.size > 3
    assert loads[falling[0]] > 1.2 * loads[falling[-1] + 1]
    # Tools that are moved there take the same force, on either branch.
    placed = arch(MPI.COMM_SELF)
    for place, force in zip(places, forces, strict=True):
        placed.place(0, shift=(0.0, float(place)))
        placed.solve()
        assert -sum(placed.state.forces)[1] == pytest.approx(force, abs=1e-7 * forces.max())
        placed.advance()
    assert forces == pytest.approx(FORCE * loads, abs=1e-8 * FORCE)
    steps = problem.solution.steps
    assert [step.tools[0].translation[1] for step in steps] == pytest.approx(places, abs=1e-12)
    assert all(step.certificate.holds for step in steps)
    assert (np.diff([step.time for step in steps]) > 0).all()


def test_what_cannot_be_controlled():
    """By one sentence that names what to give."""
    problem = arch(MPI.COMM_SELF, force=(0.0, 0.0), prescribed=HELD)
    for control in (3, (1, "y"), (0, "z"), (0, "rotation")):
        with pytest.raises(FormError, match="control: must be the number of a foundation that a force moves"):
            pressed(problem, control=control)
    with pytest.raises(FormError, match=r"control: x of contact\[0\] is not moved by a force"):
        pressed(problem, control=(0, "x"))
