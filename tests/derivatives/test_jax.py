"""A contact solve inside a function of JAX, which is not in Debian: `make test-wheel` runs it."""

import runpy
from pathlib import Path

import numpy as np
import pytest

DEMO = Path(__file__).parents[2] / "demos" / "studies" / "jax_gradient.py"


def test_demo():
    """Derivatives are those of differences of the whole function, and a fit by them finds the true
    weights.
    """
    pytest.importorskip("jax", reason="JAX is not installed: pip install jax")
    found = runpy.run_path(str(DEMO))
    assert np.abs(found["by_jax"]).min() > 1e-3
    assert found["by_jax"] == pytest.approx(found["by_difference"], rel=1e-5)
    assert found["fit"].x == pytest.approx(found["TRUE"], rel=1e-5)
    # The modulus is not fitted: the derivative of one solve by it.
    at, step = np.array([found["E0"], 0.3]), np.array([1e-2, 0.0])
    _, (by_young, _) = found["forward"](at)
    higher, lower = (float(found["force"](at + sign * step)) for sign in (1, -1))
    assert float(by_young) == pytest.approx((higher - lower) / (2 * step[0]), rel=1e-5)
