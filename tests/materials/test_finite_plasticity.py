"""Metal at finite strains at points: closed forms, its tangent, and what a rotation changes."""

import numpy as np
import pytest
from pydantic import TypeAdapter

from signorini_fx.mechanics.effects.material import Entry as OneMaterial

YOUNG, POISSON, YIELD = 200000.0, 0.3, 300.0
SHEAR = YOUNG / (2 * (1 + POISSON))
HALF_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def metal(**changes):
    """Steel of the tests."""
    given = {"law": "j2", "strains": "finite", "young": YOUNG, "poisson": POISSON}
    return TypeAdapter(OneMaterial).validate_python(given | {"yield_stress": YIELD} | changes)


def drawn(count, seed=0):
    """Changes grad u of random bodies that flow."""
    return 0.2 * np.random.default_rng(seed).standard_normal((count, 3, 3))


def after(material, *changes):
    """Stress, tangent and state at the last of several changes, each the end of a step."""
    answer = None, None, np.zeros((len(changes[0]), material.state_size))
    for change in changes:
        answer = material.respond_by_change(change, answer[2])
    return answer


@pytest.mark.parametrize(
    "change", [drawn(100), 0.3 * np.diag([1.0, 1.0, -0.4])[None], 0.2 * np.eye(3)[None]]
)
def test_the_tangent_is_the_derivative(change):
    """Of states that have flowed, also where two or all stretches are the same; it has an energy,
    and plastic flow keeps the volume.
    """
    law = metal(hardening=[[0.05, 350.0], [0.5, 500.0]])
    begun = after(law, drawn(len(change), 1) if len(change) > 1 else np.zeros_like(change))[2]
    _, tangent, state = law.respond_by_change(change, begun)
    columns = []
    for step in 1e-6 * np.eye(9).reshape(9, 3, 3):
        ahead, behind = (
            law.respond_by_change(change + sign * step, begun)[0] for sign in (1.0, -1.0)
        )
        columns.append((ahead - behind).reshape(-1, 9) / 2e-6)
    assert np.abs(np.stack(columns, axis=2) - tangent).max() <= 1e-9 * YOUNG
    assert np.abs(tangent - tangent.swapaxes(1, 2)).max() <= 1e-15 * YOUNG
    volume = np.linalg.det(np.eye(3) + state[:, :9].reshape(-1, 3, 3))
    assert np.abs(volume - 1).max() <= 1e-13


def test_a_body_that_turns():
    """After it has flowed: its stress turns with it, its state stays, and it flows on likewise."""
    law = metal(hardening=1000.0)
    first, second = drawn(50, 2), drawn(50, 3)
    turned = [HALF_TURN @ (np.eye(3) + change) - np.eye(3) for change in (first, second)]
    stress, _, state = after(law, first)
    again, _, kept = after(law, first, turned[0])
    assert np.abs(again - HALF_TURN @ stress).max() <= 1e-10 * YIELD
    assert np.abs(kept[:, 9] - state[:, 9]).max() <= 1e-13
    on, _, flown = after(law, first, second)
    turned_on, _, turned_flown = after(law, first, turned[0], turned[1])
    assert np.abs(turned_on - HALF_TURN @ on).max() <= 1e-10 * YIELD
    assert np.abs(turned_flown - flown).max() <= 1e-12


def test_small_strains():
    """It is the law of small strains up to the strain, with all digits."""
    finite, small = metal(yield_stress=1e-9), metal(yield_stress=1e-9, strains="small")
    for scale in (1e-3, 1e-6, 1e-12):
        strain = scale * (drawn(50) + drawn(50).swapaxes(1, 2))
        state = np.zeros((50, 10))
        for load in (strain, -0.5 * strain):
            others = small.respond(load, state)
            answers = finite.respond_by_change(load, np.zeros((50, 10)))
        assert np.abs(answers[0] - others[0]).max() <= 10 * scale * np.abs(others[0]).max() + 1e-24
        assert np.allclose(answers[2][:, 9], others[2][:, 9], rtol=10 * scale + 1e-12)


def test_elastic_shear():
    """By the angle gamma = 1: tau_12 = 2 G arsinh(1/2) / sqrt(5/4), tau_11 = - tau_22 =
    tau_12 / 2.
    """
    change = np.zeros((1, 3, 3))
    change[0, 0, 1] = 1.0
    stress = after(metal(yield_stress=1e9), change)[0][0] @ (np.eye(3) + change[0]).T
    across = 2 * SHEAR * np.arcsinh(0.5) / np.sqrt(1.25)
    expected = np.array([[across / 2, across, 0], [across, -across / 2, 0], [0, 0, 0]])
    np.testing.assert_allclose(stress, expected, atol=1e-12 * SHEAR)


@pytest.mark.parametrize(
    ("steps", "shear", "normal"), [(1, 154.92, 77.0), (10, 172.97, 9.0), (100, 173.2005, 1.26)]
)
def test_plastic_shear(steps, shear, normal):
    """Without hardening, in so many steps: the stress comes to yield / sqrt 3; an independent
    program's figures.
    """
    changes = np.zeros((steps, 1, 3, 3))
    changes[:, 0, 0, 1] = np.arange(1, steps + 1) / steps
    stress = after(metal(), *changes)[0][0] @ (np.eye(3) + changes[-1, 0]).T
    assert stress[0, 1] == pytest.approx(shear, rel=1e-4)
    assert stress[0, 0] == pytest.approx(normal, rel=1e-2)


@pytest.mark.filterwarnings("error")
def test_a_body_inside_out():
    """Has no stress."""
    changes = np.array([-2.0 * np.eye(3), np.diag([-1.0, 0, 0]), np.full((3, 3), np.nan)])
    assert not np.isfinite(after(metal(), changes)[0]).any()
