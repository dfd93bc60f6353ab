"""Random nonlinear bodies: none is called converged that another program finds wrong, and that program sees faults."""

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dolfinx import fem

from signorini_fx.forms.nonlinear import newton
from signorini_fx.records import Status

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.stability.nonlinear_bodies import Judge, RandomBody, posed, tried

DRAWN = [RandomBody.drawn(seed) for seed in range(300)]


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("seed", "expected"),
    [
        (8, Status.CONVERGED),
        (11, Status.CONVERGED),
        (13, Status.CONVERGED),
        (16, Status.INSIDE),  # through the body in one step
        (21, Status.INSIDE),  # between two nodes
        (74, Status.INSIDE),  # to its middle
        (4, Status.CONVERGED),  # with a tangent that is damped
    ],
)
def test_quick_ones(seed, expected):
    """What is converged is so for the judge; the others end by name."""
    end, faults = tried(seed)
    assert faults == []
    assert end == expected.value


@pytest.mark.one_quick
@pytest.mark.parametrize(("seed", "fault"), [(16, "passed through"), (21, "outline 0.7"), (74, "circle inside")])
def test_the_judge_needs_no_geometry_of_the_package(monkeypatch, seed, fault):
    """Where the package does not ask whether the shape is inside, these are called converged, and judged wrong."""
    monkeypatch.setattr(newton, "overlap", lambda *states: "")
    end, faults = tried(seed)
    assert end == Status.CONVERGED.value
    assert any(fault in text for text in faults)


@pytest.mark.one_quick
@pytest.mark.parametrize("seed", [26, 29, 276])
def test_loads_alone(seed):
    """Without contact forces are relative to reactions: with a tangent that is not the derivative, and with stiffness
    far above the load, a solution is called so, and what is beside it by 1e-7 of the displacement is not.
    """
    body = RandomBody.drawn(seed)
    problem, judge = posed(body)
    problem.place(0, shift=tuple(body.centre(0.005) - body.start))
    problem.solve()
    assert not problem.pressure.x.array.any()
    free = judge.x[:, 1] > 1e-9 * body.size[1]
    forces = judge.forces(problem.u.x.array.reshape(-1, 2))
    assert np.linalg.norm(forces[free]) < 1e-9 * np.linalg.norm(forces[~free])
    problem.u.x.array[:] *= 1 + 1e-7
    assert problem._solver._judge() is Status.NOT_CERTIFIED


@pytest.mark.long
def test_three_hundred():
    """No wrong one, and enough that converge."""
    ends = Counter()
    for seed in range(300):
        end, faults = tried(seed)
        assert faults == [], seed
        ends[end] += 1
    assert ends["converged"] >= 100


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
@pytest.mark.parametrize("degree", [1, 2])
def test_the_judge_has_the_forces_of_the_form(cell, degree):
    """Its forces are those that dolfinx assembles, its stiffness is their derivative, and they that of its energy."""
    body = next(b for b in DRAWN if b.cell == cell and b.degree == degree and b.pressure)
    problem, judge = posed(body)
    rng = np.random.default_rng(0)
    u = 0.02 * min(body.size) / max(body.counts) * rng.normal(size=judge.x.shape)
    problem.u.x.array[:] = u.ravel()
    assembled = fem.assemble_vector(problem._solver.residual.form).array.reshape(-1, 2)
    forces = judge.forces(u)
    np.testing.assert_allclose(forces, assembled, atol=1e-9 * np.abs(forces).max())
    dead = Judge(replace(body, pressure=0.0), judge.x, judge.cells)
    way, step = rng.normal(size=u.shape), 1e-6 * min(body.size) / max(body.counts)
    ahead, behind = (dead.forces(u + sign * step * way) for sign in (1, -1))
    product = (dead.stiffness(u) @ way.ravel()).reshape(-1, 2)
    np.testing.assert_allclose((ahead - behind) / (2 * step), product, atol=1e-6 * np.abs(product).max())
    slope = (dead.energy(u + step * way) - dead.energy(u - step * way)) / (2 * step)
    assert slope == pytest.approx((dead.forces(u) * way).sum(), rel=1e-4)


def test_the_judge_sees_what_is_wrong():
    """A circle between nodes, one that has gone through, a force without contact, a state that is no minimum."""
    body = next(b for b in DRAWN if not b.pressure and not b.friction and not b.pull.any())
    _, judge = posed(body)
    rng, still = np.random.default_rng(0), np.zeros_like(judge.x)
    width, height = body.size
    beside = np.array([-2 * body.radius - width, height / 2])
    assert judge.faults(still, beside, rng, stable=True) == []
    assert "circle inside the body" in judge.faults(still, np.array([0.51 * width, 0.52 * height]), rng, stable=True)
    assert judge.passed((still, beside), (still, beside + np.array([4 * body.radius + 3 * width, 0.0])))
    moved = still.copy()
    moved[np.argmax(judge.x[:, 1])] = 0.01 * height
    assert any("without contact" in fault for fault in judge.faults(moved, beside, rng, stable=True))
