"""What happened before: released bodies, and shears that turn with the tool."""

import numpy as np
import pytest
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scene_tables import circle_shape, plane_shape
from support.nonlinear_bodies import rectangle, residual, under_shape

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem


@pytest.mark.one_quick("algorithm", ["ssn", "alm"])
@pytest.mark.parametrize("friction", [None, 0.3])
def test_pressed_and_released(algorithm, friction):
    """A body without stress is in equilibrium to round-off, however small its displacement."""
    law = None if friction is None else Coulomb(friction)
    options = {"friction": law, "algorithm": algorithm}
    problem = under_shape(circle_shape((0.8, 1.5), 0.5), (2.0, 1.0), (8, 4), **options)
    u = problem.u
    for depth in (0.1, -0.1, 0.0, -0.2, 0.15, -0.1):  # 0: it touches
        problem.run([1.0], lambda load, depth=depth: problem.place(0, shift=(0.0, -depth * load)))
        assert problem.certificate.holds
        if depth < 0:
            assert np.abs(u.x.array).max() < 1e-12


def turned(angle, dimension):
    """The rotation in 2D, and in 3D about the normal of a plate, by degrees."""
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    rotation = np.eye(dimension)
    rotation[:2, :2] = [[cosine, -sine], [sine, cosine]]
    return rotation


@pytest.mark.one_quick("dimension", [2, 3])
@pytest.mark.parametrize("algorithm", ["ssn", "alm"])
def test_stuck_contact_that_turns(algorithm, dimension):
    """A block that sticks to a tool turns by 90 degrees with it and with its ground, in three
    steps: forces and shears turn too, as nothing else has changed; with the elastic slip of the
    regularised law, and about the normal.
    """
    comm = MPI.COMM_SELF
    if dimension == 2:
        space, side = rectangle([2.0, 1.0], [4, 2], comm)
    else:
        mesh = dmesh.create_unit_cube(comm, 2, 2, 1, dmesh.CellType.hexahedron)
        space = fem.functionspace(mesh, ("Lagrange", 1, (3,)))

        def side(axis, at):
            return dmesh.locate_entities_boundary(mesh, 2, lambda x: np.isclose(x[axis], at))

    up = dimension - 1
    point, normal, shift = np.eye(dimension)[up], -np.eye(dimension)[up], np.zeros(dimension)
    shift[[0, up]] = 0.05, -0.1
    u, ground, x = (
        fem.Function(space),
        fem.Function(space),
        space.tabulate_dof_coordinates()[:, :dimension],
    )
    bottom = fem.dirichletbc(ground, fem.locate_dofs_topological(space, up, side(up, 0.0)))
    plate = plane_shape(tuple(point), tuple(normal))
    contact = Foundation(side(up, 1.0), shape=plate, friction=Coulomb(2.0))
    problem = NonlinearContactProblem(
        residual(u), u, bcs=[bottom], contact=contact, algorithm=algorithm
    )
    problem.place(0, shift=tuple(shift), pivot=(0.0,) * dimension)
    problem.solve()
    problem.advance()
    force = sum(problem.state.forces)
    shear = problem.shear.x.array.reshape(-1, dimension).copy()
    step = turned(30.0, dimension)
    for angle in (30.0, 60.0, 90.0):
        turn = turned(angle, dimension)
        ground.x.array[:] = (x @ turn.T - x).ravel()
        u.x.array[:] = ((x + u.x.array.reshape(-1, dimension)) @ step.T - x).ravel()
        rotation = angle if dimension == 2 else (0.0, 0.0, angle)
        problem.place(0, shift=tuple(turn @ shift), rotation=rotation, pivot=(0.0,) * dimension)
        problem.solve()
        problem.advance()
        assert sum(problem.state.forces) == pytest.approx(
            turn @ force, abs=1e-9 * np.linalg.norm(force)
        )
        now = problem.shear.x.array.reshape(-1, dimension)
        assert now == pytest.approx(shear @ turn.T, abs=1e-9 * np.abs(shear).max())
