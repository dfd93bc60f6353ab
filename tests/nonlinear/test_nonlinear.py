"""Contact of nonlinear bodies: energies minimised by a library, the certificate, and named
outcomes.
"""

import re

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from scene_tables import circle_shape, plane_shape
from scipy.optimize import minimize
from support.nonlinear_bodies import (
    LAME,
    MU,
    PLATE,
    POISSON,
    YOUNG,
    held,
    polynomial,
    rectangle,
    residual,
    under_shape,
)

from signorini_fx import ConvergenceError, Coulomb, Foundation, NonlinearContactProblem, Status
from signorini_fx.forms.nonlinear.results import certified
from signorini_fx.results.certificate.contact_nodes import Tractions


def triangles_of(space):
    """Vertices, shape (n, 2), triangles, shape (m, 3), and the unknowns of the vertices, of one
    rank.
    """
    return space.tabulate_dof_coordinates()[:, :2], space.dofmap.list


def least_energy(space, apart):
    """The displacement of least energy of a body that is held below, by SciPy with exact
    constraints at the vertices of its top; and their distances.
    """
    x, cells = triangles_of(space)
    shapes = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    jacobians = np.einsum("mai,aj->mij", x[cells], shapes)
    gradients, areas = (
        np.einsum("aj,mji->mai", shapes, np.linalg.inv(jacobians)),
        np.abs(np.linalg.det(jacobians)) / 2,
    )
    free = np.flatnonzero(np.repeat(x[:, 1] > 1e-9, 2))
    above = np.flatnonzero(np.isclose(x[:, 1], 1.0))

    def whole(values):
        y = np.zeros(x.size)
        y[free] = values
        return y.reshape(-1, 2)

    def energy(values):
        f = np.eye(2) + np.einsum("mai,maj->mij", whole(values)[cells], gradients)
        growth = np.linalg.det(f)[:, None, None] - 1
        cofactors = np.array([[f[:, 1, 1], -f[:, 1, 0]], [-f[:, 0, 1], f[:, 0, 0]]]).transpose(
            2, 0, 1
        )
        stress = MU * f + ((LAME + MU) * growth - MU) * cofactors
        forces = np.zeros_like(x)
        np.add.at(forces, cells, np.einsum("mij,maj,m->mai", stress, gradients, areas))
        growth = growth[:, 0, 0]
        density = MU / 2 * ((f**2).sum(axis=(1, 2)) - 2) - MU * growth + (LAME + MU) / 2 * growth**2
        return float(density @ areas), forces.ravel()[free]

    def distances(values):
        return apart((x + whole(values))[above])

    constraint = {"type": "ineq", "fun": distances}
    options = {"maxiter": 500, "ftol": 1e-14}
    found = minimize(
        energy,
        np.zeros(free.size),
        jac=True,
        method="SLSQP",
        constraints=constraint,
        options=options,
    )
    assert found.status in (
        0,
        8,
    )  # 8: the line search meets round-off; whether this is the minimum, the comparison says
    return whole(found.x), distances(found.x)


def test_energy_minimised_by_a_library():
    """Circles and oblique planes pressed into a block, frictionless: the displacement of a
    minimiser of the energy.
    """
    touching = 0
    for seed in range(4):
        chance = np.random.default_rng(seed)
        cells = [int(chance.integers(4, 8)), int(chance.integers(2, 5))]
        space, side = rectangle([2.0, 1.0], cells, cell="triangle")
        depth, across = chance.uniform(0.02, 0.25), chance.uniform(0.4, 1.6)
        lifted = np.array([0.0, depth])
        if chance.random() < 0.7:
            radius = chance.uniform(0.3, 1.0)
            centre = np.array([across, 1.0 + radius - depth])
            shape = circle_shape(tuple(centre + lifted), radius)

            def apart(places, centre=centre, radius=radius):
                return np.linalg.norm(places - centre, axis=1) - radius

        else:
            angle = chance.uniform(-0.3, 0.3)
            normal = np.array([np.sin(angle), -np.cos(angle)])
            point = np.array([2.0 if angle < 0 else 0.0, 1.0 - depth])
            shape = plane_shape(tuple(point + lifted), tuple(normal))

            def apart(places, normal=normal, point=point):
                return (places - point) @ normal

        u = fem.Function(space)
        contact = Foundation(side(1, 1.0), shape=shape)
        bcs = [held(space, side(1, 0.0))]
        problem = NonlinearContactProblem(
            residual(u, polynomial), u, bcs=bcs, contact=contact, algorithm="alm"
        )
        problem.run(
            [1.0], lambda t, problem=problem, depth=depth: problem.place(0, shift=(0.0, -depth * t))
        )
        expected, distances = least_energy(space, apart)
        assert problem.certificate.holds
        assert u.x.array.reshape(-1, 2) == pytest.approx(expected, abs=5e-6), seed
        touching += int((np.abs(distances) < 1e-9).sum())
    assert touching >= 6


def test_state_of_the_material():
    """A viscoelastic block, whose state is committed after each step, relaxes as the implicit Euler
    method says.
    """
    space, side = rectangle([1.0, 1.0], [2, 2], MPI.COMM_WORLD)
    u, viscous = (
        fem.Function(space),
        fem.Function(space),
    )  # the displacement that the dashpot has followed
    share, step, time = 0.6, 0.5, 1.0

    def stress(y):
        strain = ufl.sym(ufl.grad(y))
        return 2 * MU * strain + LAME * ufl.tr(strain) * ufl.Identity(2)

    follows = share / (1 + step / time)
    form = (
        ufl.inner(
            (1 - share) * stress(u) + follows * stress(u - viscous),
            ufl.grad(ufl.TestFunction(space)),
        )
        * ufl.dx
    )

    def commit():
        viscous.x.array[:] += (u.x.array - viscous.x.array) * (step / time) / (1 + step / time)

    bcs = [held(space, side(1, 0.0), 1), held(space, side(0, 0.0), 0)]
    contact = Foundation(side(1, 1.0), shape=PLATE | {"shift": (0.0, -0.01)})
    problem = NonlinearContactProblem(
        form, u, bcs=bcs, contact=contact, commit=commit, algorithm="alm"
    )
    forces = []
    for _ in range(4):
        problem.solve()
        problem.advance()
        forces.append(problem.state.forces[0][1])
    elastic = -0.01 * YOUNG / (1 - POISSON**2)
    assert forces == pytest.approx(
        [elastic * ((1 - share) + share / (1 + step / time) ** n) for n in range(1, 5)], rel=1e-7
    )


def column(coefficient, **options):
    """A column between plates, one of them with friction."""
    options |= {"friction": coefficient and Coulomb(coefficient), "comm": MPI.COMM_WORLD}
    return under_shape(PLATE | {"point": (0.0, 8.0)}, (1.0, 8.0), (3, 16), **options)


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("system", ["full", "condensed"])
@pytest.mark.parametrize(
    ("friction", "stable", "unstable"), [(1.0, 0.03, 0.1), (1e-3, 0.003, 0.02), (None, 0.003, 0.02)]
)
def test_buckled_columns_are_called_unstable(friction, stable, unstable, system):
    """The straight state of a column is an equilibrium at every load; beyond Euler's it is not
    called converged.
    """
    problem = column(friction, linear_algebra=system)
    problem.place(0, shift=(0.0, -8 * stable))
    problem.solve()
    problem.advance()
    problem.place(0, shift=(0.0, -8 * unstable))
    with pytest.raises(ConvergenceError, match="unstable equilibrium") as error:
        problem.solve()
    assert problem.status is Status.UNSTABLE
    assert problem.certificate.holds
    # A column that is held at both ends buckles in its middle, one that slides at its upper end.
    height = float(re.search(r"it begins at \(\S+, ([^)]+)\)", str(error.value)).group(1))
    assert (3.0 <= height <= 5.0) if friction == 1.0 else (height == 8.0)
    assert "Round off" in str(error.value)


def test_certificate_notices_what_is_wrong():
    """Another pressure, a displacement that is not in equilibrium, a shape at another place,
    friction the other way.
    """
    circle, options = circle_shape((0.8, 1.5), 0.5), {"friction": Coulomb(0.3), "algorithm": "alm"}
    problem = under_shape(circle, (2.0, 1.0), (8, 4), **options)
    problem.place(0, shift=(0.0, -0.1))
    problem.solve()
    u = problem.u
    solved, form = problem.linear.solved, fem.form(residual(u))

    def judged(of=lambda tractions: tractions):
        return certified(
            fem.assemble_vector(form).array, solved, tractions=of(Tractions.of(problem.state))
        )[0]

    from dataclasses import replace

    assert judged().holds
    assert judged(lambda t: replace(t, pressure=1.001 * t.pressure)).equilibrium > 1e-4
    assert not judged(lambda t: replace(t, shear=-t.shear)).holds
    problem.shapes[0].shape = problem.shapes[0].shape.remade(shift=(0.0, -0.1001))
    assert judged().entered > 1e-5
    problem.shapes[0].shape = problem.shapes[0].shape.remade(shift=(0.0, -0.0999))
    assert judged().pressure_at_distance > 1e-5
    problem.shapes[0].shape = problem.shapes[0].shape.remade(shift=(0.0, -0.1))
    top = int(np.argmax(u.x.array))
    u.x.array[top] += 1e-4
    assert not judged().holds
