"""Inexact Newton: the Krylov path solves loosely while the sets change, and exactly in the end."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import alone, example1, table_of
from spaces import block

from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.linalg import krylov
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.records import History, Status, Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.solving.solve_on_mesh import contact_task


@pytest.fixture
def iterations(monkeypatch):
    """Counts the CG iterations."""
    count = [0]
    configure = krylov.KrylovSystem.configure

    def watched(self, ksp, **how):
        configure(self, ksp, **how)
        ksp.setMonitor(lambda _ksp, number, _norm: count.__setitem__(0, count[0] + (number > 0)))

    monkeypatch.setattr(krylov.KrylovSystem, "configure", watched)
    return count


def test_fewer_iterations_and_the_same_answer(iterations, monkeypatch):
    """Half of the CG iterations, one solve more, and the pressure of the direct path."""
    scene = example1(bound=1.5, nx=60, ny=20, linear_algebra="krylov")
    direct = alone(example1(bound=1.5, nx=60, ny=20, linear_algebra="full"))
    loose, used = alone(scene), iterations[0]
    monkeypatch.setattr(krylov, "INEXACT_TOLERANCE", 0.0)
    iterations[0] = 0
    exact = alone(scene)
    assert used < 0.6 * iterations[0]
    assert exact.history.linear_solves == direct.history.linear_solves
    assert loose.history.linear_solves == direct.history.linear_solves + 1
    assert loose.certificate.holds
    wanted = table_of(direct).columns["pressure"]
    np.testing.assert_allclose(table_of(loose).columns["pressure"], wanted, atol=1e-9 * wanted.max())


def test_no_more_exact_than_newton_converges(iterations, monkeypatch):
    """A loose solve leaves what Newton's method leaves anyway: fewer steps with friction in 3D, the same answer."""
    scene = block(12, gamma=1e8, coefficient=0.3, coulomb="newton", linear_algebra="krylov")
    ours, used = alone(scene), iterations[0]
    monkeypatch.setattr(krylov.KrylovSystem, "_left_by", lambda self, size: min(0.03, size / self._forces) * size)
    iterations[0] = 0
    theirs = alone(scene)
    assert used < iterations[0]
    assert ours.history.linear_solves <= theirs.history.linear_solves + 2
    for name in ("pressure", "shear"):
        wanted = getattr(theirs.contact, name)
        np.testing.assert_allclose(getattr(ours.contact, name), wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


def test_what_a_loose_solve_may_leave():
    """The factor of the last Newton step or the share of the forces; nothing where Newton's method may end."""
    scene = block(3, bound=1.5, linear_algebra="krylov")
    discretisation = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    system = krylov.KrylovSystem.of(discretisation.elasticity(discretisation.cases))
    assert system._left_by(1.0) == 0.03  # without forces
    system._forces = 10.0
    for size, share in ((1.0, 0.03), (0.5, 0.03), (1e-2, 0.02), (1e-4, 0.01), (5e-5, 0.03), (1e-5, 0.03)):
        np.testing.assert_allclose(system._left_by(10.0 * size), 10.0 * size * share, rtol=1e-6)
        system._first_residual = 10.0 * size
    assert system._left_by(10.0 * 9e-7) == 0.0


def test_no_iteration_follows_an_earlier_one():
    """An iteration that has ended leaves nothing that the tolerances of the next one could depend on."""
    scene = block(6, coefficient=0.3, coulomb="newton", linear_algebra="krylov")
    task = contact_task(discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings()), History())
    assert solve_task(task, task.start).status is Status.CONVERGED
    assert task.system.inexact
    assert task.system._first_residual == 0.0


def test_cycles_of_loose_solves_are_none(monkeypatch):
    """Where loose solves make the sets come back, exact ones go on from there, and their outcome counts."""
    monkeypatch.setattr(krylov, "INEXACT_TOLERANCE", 0.1)
    scene = example1(bound=1.5, nx=60, ny=20, fallbacks=False, linear_algebra="krylov")
    ours = alone(scene, check=False)
    assert ours.status is Status.CONVERGED
    wanted = table_of(alone(example1(bound=1.5, nx=60, ny=20, linear_algebra="full"))).columns["pressure"]
    np.testing.assert_allclose(table_of(ours).columns["pressure"], wanted, atol=1e-8 * wanted.max())


def test_far_too_loose_is_no_solution(monkeypatch):
    """Solves that are hardly any do not end in a wrong answer."""
    scene = example1(bound=1.5, nx=60, ny=20, linear_algebra="krylov")
    wanted = alone(scene)
    monkeypatch.setattr(krylov, "INEXACT_TOLERANCE", 0.9)
    loose = alone(scene)
    residuals = [[record.residual for record in solution.history.iterations] for solution in (loose, wanted)]
    assert residuals[0][0] > 1.5 * residuals[1][0]
    largest = wanted.contact.pressure.max()
    np.testing.assert_allclose(loose.contact.pressure, wanted.contact.pressure, rtol=0, atol=1e-9 * largest)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_multigrid_knows_the_rigid_motions(cell):
    """With them CG takes hardly more iterations on a finer mesh, and clearly fewer than without."""

    def iterations(nx, motions=True):
        scene = example1(nx=nx, ny=nx // 3, cell=cell)
        held = PrescribedDisplacement(boundary="left", x=0.0, y=0.0)
        scene = scene.model_copy(update={"displacement": (held,), "contact": ()})
        discretisation = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
        system = krylov.KrylovSystem.of(discretisation.elasticity(discretisation.cases))
        if not motions:
            system.matrix.setNearNullSpace(PETSc.NullSpace())
        ksp = PETSc.KSP().create(system.comm)
        ksp.setOperators(system.matrix)
        system.configure(ksp, symmetric=True)
        ksp.solve(system.load, system.start.duplicate())
        assert ksp.getConvergedReason() > 0
        return ksp.getIterationNumber()

    coarse, fine, without = iterations(30), iterations(90), iterations(90, motions=False)
    assert fine <= 1.5 * coarse
    assert fine <= 0.75 * without
