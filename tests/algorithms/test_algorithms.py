"""What the algorithms promise on their way, where the answer alone would not show it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import alone, example1

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.records import Status


@pytest.mark.parametrize("law", [{"bound": 1.5}, {"coefficient": 0.3}])
def test_augmented_lagrangian_leaves_no_penalty(law):
    """Its limit is the unregularised solution in both directions, whatever gamma: no overlap and no
    creep in stick.
    """
    solution = alone(example1(**law, nx=30, ny=10, gamma=1e6, algorithm="alm", tolerance=1e-8))
    assert (solution.contact.direction == 0).any()
    assert solution.certificate.penetration < 1e-8
    assert solution.certificate.stick_slip < 1e-8
    plain = alone(example1(**law, nx=30, ny=10, gamma=1e6))
    assert plain.certificate.penetration > 1e-3
    assert plain.certificate.stick_slip > 1e-4


def test_inexact_augmented_lagrangian_shifts_by_feasible_multipliers(monkeypatch):
    """Section 7: lambda >= 0 and |mu| <= F g before each update, also after a problem that was cut
    off.
    """
    shifts = []
    solve_one = SemismoothNewton.solve

    def spy(self, data, *arguments, **options):
        status = solve_one(self, data, *arguments, **options)
        shifts.append((data, status, self.multipliers()))
        return status

    monkeypatch.setattr(SemismoothNewton, "solve", spy)
    scene = example1(bound=1.5, nx=30, ny=10, gamma=1e5, algorithm="alm", inner_iterations=1)
    assert alone(scene).converged
    cut_off = [
        (pressure, shear)
        for _, status, (pressure, shear) in shifts
        if status is Status.MAX_ITERATIONS
    ]
    assert any(pressure.min() < 0 or np.abs(shear).max() > 1.5 for pressure, shear in cut_off)
    for data, _, _ in shifts:
        assert data.lambda_hat.min() >= 0
        assert np.abs(data.mu_hat).max() <= 1.5


@pytest.mark.parametrize("value", [0.01, "0.01 + 0*x[0]"])
@pytest.mark.parametrize(
    ("side", "component", "sign"), [("left", 0, -1), ("right", 0, 1), ("top", 1, 1)]
)
def test_normal_displacement_is_outward(side, component, sign, value):
    """A prescribed normal displacement moves the boundary out of the body, given as a number or as
    an expression.
    """
    scene = example1(nx=6, ny=2).model_copy(
        update={
            "displacement": (Displacement(boundary=side, normal=value),),
            "contact": (),
            "traction": (),
        }
    )
    held = Displacement(boundary="bottom", x=0.0, y=0.0)
    solution = alone(scene.model_copy(update={"displacement": (held, *scene.displacement)}))
    x = solution.model.space.tabulate_dof_coordinates()
    place = {"left": 0.0, "right": 3.0, "top": 1.0}[side]
    nodes = np.isclose(x[:, component], place) & ~np.isclose(x[:, 1], 0.0)
    moved = solution.displacement.x.array.reshape(-1, 2)[nodes, component]
    assert moved.size >= 2
    assert_allclose(moved, sign * 0.01, rtol=1e-12)


@pytest.mark.parametrize("gamma", [(1e8, 1e5), (1e6, 1e9)])
def test_continuation_ends_at_both_gammas(gamma):
    """The last problem is that of the scene, also where gamma_n and gamma_t differ."""
    scene = {"bound": 1.5, "nx": 30, "ny": 10, "gamma": gamma}
    plain, followed = alone(example1(**scene)), alone(example1(**scene, algorithm="continuation"))
    assert_allclose(followed.contact.shear, plain.contact.shear, rtol=0, atol=1e-9)
    assert_allclose(followed.contact.u_t, plain.contact.u_t, rtol=0, atol=1e-12)
