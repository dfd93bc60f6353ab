"""What the next accuracy costs: the arithmetic of the forecast, and that it is the same wherever it is said."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone, example1

from signorini_fx.results.accuracy import next_accuracy
from signorini_fx.results.accuracy.convergence_table import predict
from signorini_fx.scenes.checks import check_scene
from signorini_fx.tuned import CORNER_EXPONENTS, NEXT_ERROR, SPREAD_OF_SECONDS


@pytest.mark.parametrize("degree", [1, 2])
def test_finer_for_a_smooth_and_a_singular_solution(degree):
    """Alone each part decreases with its power; together the slower one takes more than alone on its own share."""
    assert next_accuracy.finer_for(0.1, 0.0, degree, 0.7) == pytest.approx(10 ** (1 / degree), rel=1e-5)
    assert next_accuracy.finer_for(0.1, 1.0, degree, 0.7) == pytest.approx(10 ** (1 / 0.7), rel=1e-5)
    finer = next_accuracy.finer_for(0.1, 0.5, degree, 0.7)
    assert 0.5 * finer ** (-2 * degree) + 0.5 * finer**-1.4 == pytest.approx(0.01, rel=1e-4)


def test_crowded_share():
    """Cells with more than three times the mean; of equal ones none, without an error nothing."""
    squares = np.array([10.0, *[1.0] * 10])
    assert next_accuracy.crowded_share(MPI.COMM_SELF, squares) == pytest.approx(0.5)
    assert next_accuracy.crowded_share(MPI.COMM_SELF, np.ones(5)) == 0.0
    assert next_accuracy.crowded_share(MPI.COMM_SELF, np.zeros(5)) == 0.0


def price(dofs, seconds, pressure, *, predicted=False):
    """A row of a convergence table as far as a forecast looks at it."""
    return SimpleNamespace(
        dofs=dofs,
        seconds=seconds,
        pressure=pressure,
        force=None,
        energy=None,
        zone=None,
        peak=None,
        predicted=predicted,
    )


def test_forecast_from_a_convergence_table():
    """Of errors that decrease like h, and seconds like n^1.2, the next accuracy is foretold as it is."""
    rows = [price(n, 1e-6 * n**1.2, n**-0.5, predicted=n > 40_000) for n in (10_000, 40_000, 160_000)]
    cost = next_accuracy.from_prices(rows, 2, 1, np.inf)
    assert (cost.of, cost.error, cost.dofs) == ("pressure", pytest.approx(40_000**-0.5), 40_000)
    assert cost.seconds == pytest.approx(1e-6 * (10_000**1.2 + 40_000**1.2))
    assert cost.next_dofs == pytest.approx(4_000_000, rel=1e-6)
    meshes = [40_000 * 100 ** (k / 4) for k in range(1, 5)]  # each no more than four times as large as the one before
    spent = cost.seconds + sum(1e-6 * n**1.2 for n in meshes)
    assert cost.next_seconds == pytest.approx((spent / SPREAD_OF_SECONDS, spent * SPREAD_OF_SECONDS))
    assert next_accuracy.from_prices(rows, 2, 1, np.inf, "force") == "no error of the force is known"


def test_range_of_a_convergence_table():
    """Where the rate that was seen is another one than that expected, both are told."""
    rows = [price(10_000, 1.0, 4e-2), price(40_000, 4.0, 1e-2), price(160_000, 16.0, 5e-3, predicted=True)]
    low, high = next_accuracy.from_prices(rows, 2, 1, np.inf).next_seconds
    assert high > 4 * low


def test_seconds_that_stay_do_not_grow():
    """The growing part is no more than what is not constant, and what a mesh of this size usually takes."""
    assert next_accuracy.seconds_on_finer(1.0, 1e6, 4.0, 2, np.inf, constant=1.0) == 1.0
    assert next_accuracy.seconds_on_finer(1.0, 1e8, 4.0, 2, np.inf) == pytest.approx(4**1.2)
    small = next_accuracy.seconds_on_finer(1.0, 1e3, 4.0, 2, np.inf)
    assert 1.0 < small < 1.1
    # A Krylov method takes as long as there are unknowns, from the mesh on where it is taken.
    assert next_accuracy.seconds_on_finer(1e-3, 1e5, 8.0, 3, 1e5) == pytest.approx(8e-3)
    assert next_accuracy.seconds_on_finer(1e-3, 1e5, 8.0, 3, 4e5) == pytest.approx(1e-3 * 4**1.6 * 2)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        ((3.2, 3.4), "about 3 s"),
        ((3.2, 6.1), "3 to 6 s"),
        ((57.2, 429.0), "57 to 430 s"),
        ((4.0, 700.0), "4 s to 12 min"),
    ],
)
def test_times_in_words(seconds, words):
    """One number where both are the same, and the unit once."""
    assert next_accuracy.between(seconds) == words


def test_counts_in_words():
    """Two digits and a letter."""
    assert list(map(next_accuracy.count, (90_000, 2.13e6, 999_999, 412, 3e9))) == ["90k", "2.1M", "1M", "410", "3G"]


@pytest.mark.parametrize(("dimension", "degree", "share"), [(2, 1, 0.0), (2, 2, 0.0), (3, 1, 0.0), (2, 1, 1.0)])
def test_range_of_one_mesh(dimension, degree, share):
    """Without crowded cells the unknowns are known, and seconds within 1.5; all at corners takes the slowest powers."""
    given = {"degree": degree, "dofs": 10_000, "dimension": dimension, "seconds": 1e-3, "constant": 0.0}
    cost = next_accuracy.from_one_mesh(0.1, share, **given, krylov_from=np.inf)
    times = {2: 10.0, 3: 2.0}[dimension]
    slow, usual, fast = (dimension / (power if share else degree) for power in (0.5, 0.7, 1.0))
    assert cost.next_dofs == pytest.approx(10_000 * times**usual, rel=1e-4)
    seconds = [1e-3 * (times**growth) ** {2: 1.2, 3: 1.6}[dimension] for growth in (fast, slow)]
    assert cost.next_seconds == pytest.approx((seconds[0] / 1.5, seconds[1] * 1.5), rel=1e-3)


def test_forecast_of_one_mesh_against_the_mesh():
    """The mesh that is foretold for half of the error has it, within a fifth, and the unknowns."""
    solution = alone(example1(coefficient=0.3, gamma="auto", nx=30, ny=10))
    cost = solution.cost
    assert (cost.of, cost.error, cost.dofs) == ("energy", solution.stress.error, 682)
    assert cost.next_error == pytest.approx(NEXT_ERROR[2] * cost.error)
    share = next_accuracy.crowded_share(solution.comm, solution.stress.squares)
    finer = next_accuracy.finer_for(0.5, share, 1, CORNER_EXPONENTS[1])
    fine = alone(example1(coefficient=0.3, gamma="auto", nx=round(30 * finer), ny=round(10 * finer)))
    assert fine.stress.error == pytest.approx(cost.error / 2, rel=0.2)
    assert cost.next_seconds[0] <= cost.next_seconds[1]


def test_check_foretells_what_it_costs():
    """From a solution that is smooth to one that is not; the forecast after the solve is in between."""
    scene = example1(coefficient=0.3, gamma="auto", nx=30, ny=10)
    low, high = check_scene(scene).cost.next_unknowns
    assert low == pytest.approx(100 * check_scene(scene).cost.unknowns, rel=1e-4)
    assert low < alone(scene).cost.next_dofs < high


def test_prediction_and_forecast_agree():
    """A mesh as much finer as the convergence table predicts has the error that it predicts."""
    rows = list(alone(example1(bound=1.5, gamma="auto", nx=40, ny=12, levels=3)).convergence_table)
    cost = next_accuracy.from_prices(rows, 2, 1, np.inf)
    assert cost.error == rows[-2].pressure
    rate = np.log(rows[-2].pressure / rows[-1].pressure) / np.log((rows[-1].dofs / rows[-2].dofs) ** 0.5)
    following = predict(rows[:-1], 0.0, finer=float(10 ** (1 / rate)))
    assert following.pressure == pytest.approx(cost.next_error, rel=0.02)


def test_a_rate_that_says_nothing_is_no_number_of_hours():
    """Seconds with a fast rate and years with a slow one: the error hardly decreases."""
    assert next_accuracy.between((0.8, 7e7)) == "0.8 s to more than a day"
    assert next_accuracy.between((3.0, 6.0)) == "3 to 6 s"
    assert next_accuracy.between((2e5, 7e5)) == "55.6 to 194.4 h"
