"""What a load step hands on, and reports: by itself, for an iterate and multipliers that are made up."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI
from test_load_steps import by_force

from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.algorithms.task import Outcome
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.reactions import reactions
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.records import History, Status, Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.solving.solve_on_mesh import contact_task


@pytest.fixture
def task():
    scene = by_force(0.5, nx=9)
    d = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    return contact_task(d, History())


def outcome_of(task, start, **changes):
    """All nodes in contact and stuck after a displacement that is made up."""
    task.iterate.begin_step(start)
    newton, rng = task.iterate.newton, np.random.default_rng(0)
    newton.x.getArray()[:] = 1e-3 * rng.normal(size=newton.x.getLocalSize())
    newton.pose(start.data, ActiveSets.all_in_contact(*start.data.mu_hat.shape))
    return Outcome(Status.CONVERGED, newton, start.data, **changes)


def test_elastic_slip_of_load_steps(task):
    """It adds up, and there is none after a load step without regularisation."""
    start = replace(task.start, elastic_slip=np.full_like(task.start.data.mu_hat, 0.25))
    outcome = outcome_of(task, start)
    _, shear = outcome.newton.multipliers()
    crept = outcome.next_step(start).elastic_slip
    np.testing.assert_allclose(crept, 0.25 + (shear - start.data.mu_hat) / start.data.gamma_t, rtol=1e-12)
    assert not replace(outcome, augmented=True).next_step(start).elastic_slip.any()


@pytest.mark.parametrize("held", [True, False])
def test_without_contact_points(held):
    """One linear solve in each load step, from what is prescribed there, without a record or a regularised law; motions
    that supports leave free are named.
    """
    scene = by_force(0.5, nx=9)
    support = PrescribedDisplacement(boundary="bottom", x=0.25, y=0.0 if held else None)
    scene = scene.model_copy(update={"contact": (), "displacement": (support,)})
    d = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    task = contact_task(d, History())
    begun, matrix = task.start, sp.csr_array(d.stiffness.getValuesCSR()[::-1]).toarray()
    for factor in (0.5, 1.0):
        begun = replace(begun, factors=factor * d.factors(0))
        outcome = solve_task(task, begun)
        assert outcome.status is (Status.CONVERGED if held else Status.NOT_HELD)
        assert (outcome.unrecorded, task.history.linear_solves) == (int(held), 0)
        if held:
            load = factor * sum(case.load.getArray(readonly=True) for case in d.cases)
            exact = np.linalg.solve(matrix, load)
            x = outcome.displacement().getArray(readonly=True)
            np.testing.assert_allclose(x, exact, rtol=0, atol=1e-10 * np.abs(exact).max())
            assert np.abs(x).max() >= factor * 0.25
        assert task.promised(outcome) == (np.inf, np.inf, 0.0)
        begun = outcome.next_step(begun)
    assert begun.step == 2


def test_friction_bound_and_slip(task):
    """The bound is that of the pressure of the result, also if the iteration had another one; the slip counts from
    where the load step began, also if augmentation counted from elsewhere.
    """
    data = task.start.data
    start = replace(task.start, data=replace(data, slip_origin=np.full_like(data.mu_hat, 0.5)))
    posed = replace(start.data, bound=np.full(data.gap.size, 7.0), slip_origin=np.full_like(data.mu_hat, 0.1))
    contact = task.contact(outcome_of(task, replace(start, data=posed)), start)
    np.testing.assert_allclose(contact.bound, start.law.bound(contact.pressure), rtol=1e-12)
    rest_t = 0.0 if task.rest is None else task.rest.u_t
    np.testing.assert_allclose(contact.slip_length, contact.u_t - rest_t - 0.5, rtol=0, atol=1e-12)


def test_a_cap_limits_given_friction_in_statics(task):
    """As it does in the law itself, times the weight of the node."""
    given, none = np.linspace(1.0, 5.0, task.motions.points.size), np.zeros(task.motions.points.size)
    law = PointFriction(given, none, np.full_like(given, 3.0))
    found = reactions(task.motions, law, none > 0).given
    np.testing.assert_allclose(found, task.motions.points.weight * law.bound(none), rtol=1e-14)
    assert found.max() < (task.motions.points.weight * given).max()


def test_bilateral_friction_has_no_limit_in_statics(task):
    """Where the foundation may pull as well as push, F |lambda| is not convex: statics sets it no limit."""
    bilateral = np.arange(task.motions.points.size) % 2 == 0
    law = PointFriction(np.zeros(bilateral.size), np.full(bilateral.size, 0.3))
    found = reactions(task.motions, law, bilateral)
    np.testing.assert_array_equal(np.isinf(found.given), bilateral)
    np.testing.assert_array_equal(found.coefficient, np.where(bilateral, 0.0, 0.3))
