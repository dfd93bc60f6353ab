"""What the next accuracy would cost: error and seconds of what was solved, and a forecast for an error so much smaller.

From several meshes it follows from the convergence table.  From a single one the error of the stress is split in two:
that of the few cells with much more of it than the others decreases like the error at a corner of the body, the rest
with the degree of the elements.  The forecast is for cells that are smaller everywhere by the same factor; of meshes
that are divided where the error is, for more of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, inf, log, log2
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.machine import parallel
from signorini_fx.machine.display import duration
from signorini_fx.results.accuracy.convergence_table import Price, fineness_of
from signorini_fx.results.accuracy.forecast import grown, powers
from signorini_fx.tuned import (
    CORNER_EXPONENTS,
    CROWDED,
    LEAST_GROWING_TIME,
    MOST_FINER,
    NEXT_ERROR,
    SECONDS_OF_UNKNOWNS,
    SLOW_FORECAST,
    SLOWEST_FORECAST,
    SPREAD_OF_SECONDS,
    TIME_POWER,
)

# The errors that a forecast is made of, in this order, and what they are of.
NAMES = {
    "pressure": "the pressure",
    "force": "the force",
    "energy": "the stress",
    "zone": "the zone",
    "peak": "the largest pressure",
}


@dataclass(frozen=True)
class CostOfAccuracy:
    """What an accuracy took, and what a better one would take.

    Attributes:
        of: the error that it is about, a column of the convergence table; ``energy`` is that of stress and
            displacement.
        error: estimated, relative, of what was solved.
        seconds: wall time of that, all meshes together.
        dofs: unknowns of the last mesh.
        next_error: the smaller one.
        next_seconds: that it would take, from and to.
        next_dofs: unknowns that it would take, the most likely number.
    """

    of: str
    error: float
    seconds: float
    dofs: int
    next_error: float
    next_seconds: tuple[float, float]
    next_dofs: float

    def __str__(self) -> str:
        """Such as: 3 % error of the stress took 0.4 s; 0.3 % would take 10 to 40 s, 2M unknowns."""
        return f"{self.known}; {self.forecast}"

    @property
    def known(self) -> str:
        """What was solved."""
        return f"{100 * self.error:.2g} % error of {NAMES[self.of]} took {duration(self.seconds)}"

    @property
    def forecast(self) -> str:
        """What would be solved."""
        figures = 1 if self.next_error * 5 < self.error else 2  # a digit less
        share = f"{100 * self.next_error:.{figures}g} %"
        return f"{share} would take {between(self.next_seconds)}, {count(self.next_dofs)} unknowns"

    def as_dict(self) -> dict[str, Any]:
        """JSON-safe."""
        return {
            "of": self.of,
            "error": self.error,
            "seconds": self.seconds,
            "dofs": self.dofs,
            "next_error": self.next_error,
            "next_seconds": list(self.next_seconds),
            "next_dofs": self.next_dofs,
            "statement": str(self),
        }


def between(seconds: tuple[float, float]) -> str:
    """A time that is known from and to, such as 3 to 6 s."""
    low, high = (duration(float(f"{value:.2g}")) for value in seconds)
    if min(seconds) < SLOW_FORECAST < max(seconds):
        return f"{low} to more than a day"
    if low == high:
        return low if low.startswith("below") else f"about {low}"
    if low.startswith("below"):
        return f"up to {high}"
    number, _, unit = low.rpartition(" ")
    return f"{number} to {high}" if unit == high.rpartition(" ")[2] else f"{low} to {high}"


def count(number: float) -> str:
    """A number that is only known roughly, such as 90k or 2M."""
    for size, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if number >= 0.995 * size:
            return f"{float(f'{number / size:.2g}'):g}{letter}"
    return f"{float(f'{number:.2g}'):g}"


def crowded_share(comm: MPI.Comm, squares: npt.NDArray[np.float64]) -> float:
    """The share of the squared error that is in cells with much more of it than the mean; collective.

    Args:
        comm: the ranks of the mesh.
        squares: of the error in each owned cell, shape (cells,).
    """
    total, cells = (float(parallel.global_sum(comm, np.array(value))) for value in (squares.sum(), float(squares.size)))
    if not total > 0:
        return 0.0
    crowded = squares[squares > CROWDED * total / cells].sum()
    return float(parallel.global_sum(comm, np.array(crowded))) / total


def finer_for(times: float, share: float, degree: int, exponent: float) -> float:
    """How many times finer a mesh is on which the error is ``times`` as large, below 1.

    Args:
        times: next error over this one.
        share: of the squared error, which decreases with this exponent.
        degree: of the elements, with which the rest decreases.
        exponent: of h, as at a corner.
    """

    def left(finer: float) -> float:
        return float((1 - share) * finer ** (-2 * degree) + share * finer ** (-2 * exponent))

    low, high = 1.0, MOST_FINER
    while high / low > 1 + 1e-6:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if left(middle) > times**2 else (low, middle)
    return high


def seconds_on_finer(
    seconds: float, dofs: float, growth: float, dimension: int, krylov_from: float, *, constant: float = 0.0
) -> float:
    """The time of a mesh with ``growth`` times the unknowns, from that of a single one.

    Args:
        seconds: of the mesh.
        dofs: its unknowns.
        growth: quotient of the unknowns.
        dimension: of the body.
        krylov_from: as in ``LevelResult``.
        constant: the least part of the seconds that does not grow, such as that of compilation.
    """
    power = TIME_POWER[dimension]
    last_factorised = min(max(krylov_from, dofs), dofs * growth)
    times = (last_factorised / dofs) ** power * (dofs * growth / last_factorised)
    growing = float(np.clip(SECONDS_OF_UNKNOWNS[dimension] * dofs**power, 0.0, max(seconds - constant, 0.0)))
    return seconds + growing * (times - 1)


def from_one_mesh(
    error: float,
    share: float,
    *,
    degree: int,
    dofs: int,
    dimension: int,
    seconds: float,
    constant: float,
    krylov_from: float,
) -> CostOfAccuracy:
    """From the error of the stress on a single mesh.

    Args:
        error: relative, in the energy norm.
        share: see ``crowded_share``.
        degree: of the elements.
        dofs: unknowns.
        dimension: of the body.
        seconds: of the solve.
        constant: as for ``seconds_on_finer``.
        krylov_from: as in ``LevelResult``.
    """
    times = NEXT_ERROR[dimension]

    def growth(exponent: float) -> float:
        return finer_for(times, share, degree, exponent) ** dimension

    def on_finer(exponent: float) -> float:
        return seconds_on_finer(seconds, dofs, growth(exponent), dimension, krylov_from, constant=constant)

    slow, usual, fast = CORNER_EXPONENTS
    between_both = on_finer(fast) / SPREAD_OF_SECONDS, on_finer(slow) * SPREAD_OF_SECONDS
    return CostOfAccuracy("energy", error, seconds, dofs, times * error, between_both, dofs * growth(usual))


def growth_before(degree: int, dimension: int) -> tuple[float, float]:
    """How many times the unknowns the next accuracy takes, from and to, where nothing is known of the solution."""
    finer = (finer_for(NEXT_ERROR[dimension], share, degree, CORNER_EXPONENTS[1]) for share in (0.0, 1.0))
    low, high = (factor**dimension for factor in finer)
    return low, high


def from_prices(
    prices: Sequence[Price], dimension: int, degree: int, krylov_from: float, asked: str | None = None
) -> CostOfAccuracy | str:
    """From the convergence table; or why it says nothing.

    Args:
        prices: at least two solved meshes, and the next one.
        dimension: of the body.
        degree: of the elements, the best rate of the energy norm whatever was seen on the first meshes.
        krylov_from: as in ``LevelResult``.
        asked: the error that it is to be about; None: the first one that is known.
    """
    *solved, following = prices
    last, previous = solved[-1], solved[-2]
    of = next((name for name in ((asked,) if asked else NAMES) if getattr(last, name)), None)
    if of is None:
        return f"no error of {NAMES[asked]} is known" if asked else "no error is known"
    error, times = float(getattr(last, of)), NEXT_ERROR[dimension]
    finer = fineness_of(following.dofs / last.dofs, dimension)
    expected = log(error / getattr(following, of)) / log(finer)
    seen = _seen_rate(solved, of, dimension)
    best = float(degree) if of == "energy" else inf
    rates = sorted(
        float(np.clip(rate, SLOWEST_FORECAST, best)) for rate in (expected, expected if seen is None else seen)
    )
    took = sum(price.seconds for price in solved)

    def growth(rate: float) -> float:
        return float(min(times ** (-1 / rate), MOST_FINER) ** dimension)

    def still(rate: float) -> float:
        """Seconds of the meshes to come, each about twice as fine as the one before."""
        whole = growth(rate)
        meshes = max(ceil(log2(whole) / dimension), 1)
        seen_growth = max(last.dofs / previous.dofs, 1.0 + 1e-6)
        total = 0.0
        for number in range(1, meshes + 1):
            part = whole ** (number / meshes)
            power, _ = powers(last.dofs * part, dimension, krylov_from)
            total += grown(last.seconds, previous.seconds, seen_growth, part, power, least=LEAST_GROWING_TIME)
        return total

    slow, fast = rates
    middle = (slow * fast) ** 0.5
    return CostOfAccuracy(
        of,
        error,
        took,
        last.dofs,
        times * error,
        ((took + still(fast)) / SPREAD_OF_SECONDS, (took + still(slow)) * SPREAD_OF_SECONDS),
        last.dofs * growth(middle),
    )


def _seen_rate(solved: Sequence[Price], of: str, dimension: int) -> float | None:
    """With which an error decreased from the first mesh with an estimate to the last; None: it is known of one only."""
    known = [(price.dofs, float(getattr(price, of))) for price in solved if getattr(price, of)]
    steps = [
        log(coarse / fine) / log(fineness_of(more / few, dimension))
        for (few, coarse), (more, fine) in pairwise([known[0], known[-1]])
        if more > few
    ]
    return steps[0] if steps else None
