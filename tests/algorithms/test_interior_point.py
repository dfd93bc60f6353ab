"""The interior-point method: where no set of the solution holds a body, and judged by the second program's CVXOPT."""

import numpy as np
import pytest
from scenes import alone
from test_fall_backs import flat

from benchmarks.stability.oracle.judge import RIGHT
from benchmarks.stability.oracle.worker import TRIAL, examined, same_units
from signorini_fx.algebra.algorithms.interior_point import interior_point
from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.records import Status


def test_a_body_that_friction_alone_holds():
    """No set of the solution holds it, each step does."""
    contact, friction = alone(flat()).contact.forces
    np.testing.assert_allclose(contact + friction, [0.0, 20.0], atol=1e-6)


@pytest.mark.one_quick
@pytest.mark.parametrize(("where", "seed"), [("plane", 7), ("space", 2), ("space-effects", 5), ("bodies", 7)])
def test_judged_by_another_programme(where, seed, monkeypatch):
    """Random scenes of which each problem with a given bound is solved by it alone."""
    plain, statuses = SemismoothNewton.solve, []

    def inside(self, data, first_sets=None, *, measure=lambda: None, **limits):
        if data.follows is not None or np.isinf(data.gamma_n):
            return plain(self, data, first_sets, measure=measure, **limits)
        statuses.append(interior_point(self, data, measure))
        return statuses[-1]

    monkeypatch.setattr(SemismoothNewton, "solve", inside)
    verdict, _ = examined(TRIAL[where](seed, same_units(where, seed)), where)
    assert verdict.kind == RIGHT, verdict
    assert set(statuses) == {Status.CONVERGED}
