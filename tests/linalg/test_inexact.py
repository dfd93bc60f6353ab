"""Inexact Newton: the Krylov path solves loosely while the sets change, and exactly in the end."""

import numpy as np
import pytest
from scenes import alone, example1, table_of

from signorini_fx.algebra.linalg import krylov
from signorini_fx.records import Status


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
