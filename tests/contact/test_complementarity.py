"""The pointwise maps of Algorithm (SSN), on numbers that binary fractions hold exactly."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from on_meshes import turn_by
from shifted_problems import shifted

from signorini_fx.algebra.contact.active_sets import (
    ActiveSets,
    classify,
    law_residual,
    multipliers,
    next_sets,
    release,
    tangent,
)
from signorini_fx.algebra.contact.complementarity import onto_disc, trial_shear
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.arrays import inner, length, unit

GAMMA_N, GAMMA_T = 16.0, 64.0
STICK, PLUS, MINUS = 0, 1, -1


def data(nodes=1, *, gap=0.0, bound=1.0, sigma=math.inf, lambda_hat=0.0, mu_hat=0.0):
    """The same data at every node; bound None: no friction."""
    gap, lambda_hat, mu_hat = (
        np.full(nodes, gap),
        np.full(nodes, lambda_hat),
        np.full((nodes, 1), mu_hat),
    )
    bound = None if bound is None else np.full(nodes, bound)
    return shifted(gap, GAMMA_N, GAMMA_T, sigma, lambda_hat, mu_hat, bound)


def in_plane(contact, slip):
    """Sets in 2D from the signs of the slip."""
    return ActiveSets.of(np.array(contact), np.array(slip, dtype=float)[:, None])


def sets(contact, slip):
    """The sets of one node."""
    return in_plane([contact], [slip])


def column(*values):
    """Tangential numbers of nodes in 2D."""
    return np.array(values)[:, None]


def signs(states):
    """The slip sets in 2D as signs."""
    return states.direction[:, 0].tolist()


def test_nothing_slips_without_a_limit():
    """Slip that a start brings along from another problem sticks where the bound is infinite."""
    before = in_plane([True, False, True], [PLUS, MINUS, STICK])
    assert signs(release(before, data(3, bound=math.inf))) == [STICK] * 3
    assert signs(release(before, data(3))) == [PLUS, MINUS, STICK]


@pytest.mark.parametrize("sigma", [math.inf, 1.0, 1 / GAMMA_T])
@pytest.mark.parametrize("before", [STICK, PLUS, MINUS])
@pytest.mark.parametrize(("u_t", "side"), [(-1.0, MINUS), (0.0, PLUS), (1.0, PLUS)])
def test_a_node_with_bound_zero(before, u_t, side, sigma):
    """Where nothing can be transmitted the node slips as it moves, mu is zero, and its side does
    not count.
    """
    problem = data(bound=0.0, sigma=sigma)
    after = classify(sets(True, before), np.zeros(1), column(u_t), problem)
    assert signs(after) == [side]
    assert multipliers(after, np.zeros(1), column(u_t), problem)[1].tolist() == [[0.0]]
    other = classify(after, np.zeros(1), column(-u_t), problem)
    assert not after.sticking(np.array([True])).changed(other.sticking(np.array([True]))).any()


def test_friction_law_where_the_foundation_pulls():
    """Bilateral contact may pull, and rubs all the same: the bound is given + coefficient *
    |lambda|, capped.
    """
    law = PointFriction(
        given=np.array([1.5, 0.0]), coefficient=np.array([0.0, 0.25]), cap=np.array([9.0, 1.75])
    )
    bound, by_pressure, by_slip = law.evaluate(np.array([-8.0, -4.0]), 1.0)
    assert bound.tolist() == [1.5, 1.0]
    assert by_pressure.tolist() == [0.0, -0.25]
    assert by_slip.tolist() == [0.0, 0.0]
    bound, by_pressure, _ = law.evaluate(np.array([-8.0, -8.0]), 0.0)
    assert bound.tolist() == [1.5, 1.75]
    assert by_pressure.tolist() == [0.0, 0.0]


# Multiples of 1/16 of moderate size: sums and products with gamma are exact, a difference is zero
# or far from it.
NUMBER = st.integers(-64, 64).map(lambda i: i / 16)
POSITIVE = st.integers(1, 64).map(lambda i: i / 16)
NODE = st.tuples(
    NUMBER,
    NUMBER,
    NUMBER,
    NUMBER,
    NUMBER,
    POSITIVE,
    st.booleans(),
    st.sampled_from([STICK, PLUS, MINUS]),
)


@st.composite
def states(draw):
    """(sets before, u_n, u_t, data) of a few nodes."""
    columns = [
        np.array(column)
        for column in zip(*draw(st.lists(NODE, min_size=1, max_size=8)), strict=True)
    ]
    u_n, u_t, gap, lambda_hat, mu_hat, bound, contact, slip = columns
    problem = shifted(gap, GAMMA_N, GAMMA_T, math.inf, lambda_hat, mu_hat[:, None], bound)
    return in_plane(contact, slip), u_n, u_t[:, None], problem


SIGMAS = st.sampled_from([math.inf, 1.0, 0.125, 1 / GAMMA_T])


@given(states(), SIGMAS)
def test_pressure_is_never_negative(state, sigma):
    """lambda >= 0 with the sets that follow from the same displacement."""
    before, u_n, u_t, problem = state
    after = classify(before, u_n, u_t, replace(problem, sigma=sigma))
    assert (multipliers(after, u_n, u_t, problem)[0] >= 0).all()


@given(states())
def test_no_jump_between_the_slip_sets(state):
    """With sigma infinite a node never goes from one slip set to the other."""
    before, u_n, u_t, problem = state
    after = classify(before, u_n, u_t, problem)
    assert (before.direction * after.direction >= 0).all()


@given(states(), SIGMAS)
def test_fixed_points_satisfy_the_complementarity_system(state, sigma):
    """For given y the sets settle in three steps, and then (3.3b) and (3.3c) hold, for every sigma:
    Lemma 4.1.
    """
    current, u_n, u_t, problem = state
    problem = replace(problem, sigma=sigma)
    for _ in range(3):
        current = classify(current, u_n, u_t, problem)
    assert not current.changed(classify(current, u_n, u_t, problem)).any()
    pressure, shear = multipliers(current, u_n, u_t, problem)
    assert_array_equal(pressure, np.maximum(0, problem.lambda_hat + GAMMA_N * (u_n - problem.gap)))
    trial, bound = problem.mu_hat + GAMMA_T * u_t, problem.bound[:, None]
    assert_array_equal(shear, np.clip(trial, -bound, bound))
    assert not law_residual(current, u_n, u_t, problem).any()
    xi = u_t + (problem.mu_hat - shear) / GAMMA_T
    weight = 1.0 if math.isinf(sigma) else sigma
    over, under = xi + weight * (shear - bound), xi + weight * (shear + bound)
    assert_array_equal(xi - np.maximum(0, over) - np.minimum(0, under), 0.0)


# In 3D: the disc.
VECTOR = st.tuples(st.floats(-4, 4), st.floats(-4, 4))


@st.composite
def discs(draw):
    """(direction, u_t, mu_hat, bound) of a few points in 3D."""
    nodes = st.tuples(VECTOR, VECTOR, VECTOR, st.floats(0.125, 4))
    columns = zip(*draw(st.lists(nodes, min_size=1, max_size=6)), strict=True)
    direction, u_t, mu_hat, bound = map(np.array, columns)
    return direction, u_t, mu_hat, bound


def in_space(u_t, mu_hat, bound, sigma=math.inf):
    """The data of points in 3D, all with the gap zero."""
    zero = np.zeros(bound.size)
    return shifted(zero, GAMMA_N, GAMMA_T, sigma, zero, mu_hat, bound)


def natural_sets(u_t, problem):
    return next_sets(np.ones(len(u_t)), u_t, 0.0 * u_t, trial_shear(u_t, problem), problem)


@given(discs())
def test_projection_onto_the_disc(disc):
    """The nearest point of the disc: it is in it, and no closer one is."""
    _, shear, _, bound = disc
    nearest = onto_disc(shear, bound)
    assert (length(nearest) <= bound * (1 + 1e-15)).all()
    # The condition of the projection onto a convex set, for all corners of a polygon in it.
    for angle in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        other = bound[:, None] * turn_by(angle)[:, 0]
        assert (
            inner(shear - nearest, other - nearest) <= 1e-12 * (1 + length(shear)) * bound
        ).all()


@given(discs())
def test_tangent_is_the_derivative_in_space(disc):
    """For fixed sets mu is affine in tau_T y, and its derivative is the block of ``tangent``:
    symmetric, positive.
    """
    direction, u_t, mu_hat, bound = disc
    problem = in_space(u_t, mu_hat, bound)
    current = natural_sets(u_t, problem)
    blocks = tangent(current, problem)
    step = 0.5 * direction
    before, after = (
        multipliers(current, np.ones(bound.size), u, problem)[1] for u in (u_t, u_t + step)
    )
    expected = np.einsum("nij,nj->ni", blocks[:, 1:, 1:], step)
    assert_allclose(after - before, expected, rtol=0, atol=1e-9 * GAMMA_T)
    assert_array_equal(blocks, blocks.transpose(0, 2, 1))
    assert (np.linalg.eigvalsh(blocks) >= -1e-12 * GAMMA_T).all()


@given(discs())
def test_turning_is_the_slope_of_the_projection(disc):
    """Across its direction mu of (3.4) changes by gamma_2 F g / |mu_hat + gamma_2 tau_T y| times
    the slip.
    """
    _, u_t, mu_hat, bound = disc
    current = natural_sets(u_t, in_space(u_t, mu_hat, bound))
    trial = length(mu_hat + GAMMA_T * u_t)
    assert_allclose(
        (current.turning * trial)[current.slip], GAMMA_T * bound[current.slip], rtol=1e-12
    )


@given(discs())
def test_the_primal_sets_give_the_projection(disc):
    """At the iterate itself mu of the sets of the derivative is the projection (3.4): the law
    holds.
    """
    _, u_t, mu_hat, bound = disc
    problem = in_space(u_t, mu_hat, bound)
    current = natural_sets(u_t, problem)
    _, shear = multipliers(current, np.ones(bound.size), u_t, problem)
    assert_allclose(shear, onto_disc(mu_hat + GAMMA_T * u_t, bound), rtol=0, atol=1e-12 * GAMMA_T)
    assert (law_residual(current, np.ones(bound.size), u_t, problem) <= 1e-12 * GAMMA_T).all()


@given(discs(), st.floats(0, 2 * math.pi))
def test_the_law_does_not_depend_on_the_tangents(disc, angle):
    """Turned tangents turn directions and shears, and change no set."""
    direction, u_t, mu_hat, bound = disc
    turn = turn_by(angle)
    start = ActiveSets.of(
        np.ones(bound.size, dtype=bool), unit(direction), np.full(bound.size, GAMMA_T / 2)
    )
    turned = ActiveSets.of(start.contact, start.direction @ turn.T, start.turning)
    u_n = np.ones(bound.size)
    plain = classify(start, u_n, u_t, in_space(u_t, mu_hat, bound))
    other = classify(turned, u_n, u_t @ turn.T, in_space(u_t @ turn.T, mu_hat @ turn.T, bound))
    # A point at round-off of two sets may be in either.
    trial = mu_hat + GAMMA_T * u_t
    edge = np.abs(inner(unit(direction), trial) - bound) <= 1e-9 * GAMMA_T
    assert (plain.slip == other.slip)[~edge].all()
    slipping = plain.slip & other.slip
    assert_allclose(
        (plain.direction @ turn.T)[slipping], other.direction[slipping], rtol=0, atol=1e-9
    )


def test_equal_sets_are_no_solution_in_space():
    """A point that slips on, its direction still turning: the sets repeat, and the law does not
    hold.
    """
    problem = in_space(None, np.zeros((1, 2)), np.ones(1))
    sideways = ActiveSets.of(np.array([True]), np.array([[1.0, 0.0]]), np.array([0.0]))
    u_t = np.array([[1.0, 1.0]])
    after = classify(sideways, np.ones(1), u_t, problem)
    assert not sideways.changed(after).any()
    assert law_residual(sideways, np.ones(1), u_t, problem)[0] == pytest.approx(
        math.hypot(1 - 0.5**0.5, 0.5**0.5)
    )
    for _ in range(40):
        after = classify(after, np.ones(1), u_t, problem)
    assert law_residual(after, np.ones(1), u_t, problem)[0] < 1e-12


def test_a_slip_that_is_reversed_passes_through_stick_in_space():
    """A direction may turn; a slip against it ends in stick first."""
    problem = in_space(None, np.zeros((1, 2)), np.ones(1))
    start = ActiveSets.of(np.array([True]), np.array([[0.0, 1.0]]), np.array([0.0]))
    assert not classify(start, np.ones(1), np.array([[0.0, -1.0]]), problem).slip[0]
    mu = np.array([[0.0, 2.0]])
    assert next_sets(
        np.ones(1), np.zeros((1, 2)), np.zeros((1, 2)), mu, problem
    ).direction.tolist() == [[0.0, 1.0]]
