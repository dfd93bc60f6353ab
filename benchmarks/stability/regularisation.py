"""Gamma from far too small to far above the limit of round-off, and methods whose limit does not depend on it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache, partial

from benchmarks.stability.case import CONVERGED, Case, Finding
from benchmarks.stability.measure import apart, found, solved
from benchmarks.stability.scenes import LAWS, example1
from signorini_fx.records import Status
from signorini_fx.results.solution import Solution

# E over the diagonal of the body, the natural scale of gamma.
NATURAL = 5000.0 / math.hypot(3.0, 1.0)
# From this exponent on, eps gamma is more than the 1e-8 of the forces that a residual may have.
_ROUND_OFF = 9


def cases(*, short: bool) -> Iterator[Case]:
    """The sweep over gamma for every law; then the methods that go on to the limit."""
    for law in ("Tresca",) if short else LAWS:
        for exponent in (0, 4, 8, 12, 18) if short else range(-2, 19):
            large = exponent > _ROUND_OFF
            yield Case(
                f"{law}, gamma = 1e{exponent:+d} E/L",
                partial(_gamma, law, exponent),
                wanted=(CONVERGED, Status.ROUND_OFF.value) if large else (CONVERGED,),
                # The regularisation error falls like 1 / gamma; round-off grows like gamma.
                target=20.0 * 10.0**-exponent + 1e-15 * 10.0**exponent,
                reference="unregularised limit",
                seconds=60,
            )
    for law in ("Tresca", "Coulomb") if short else LAWS:
        for name, settings in {
            "ALM, gamma = 1e3 E/L": {"algorithm": "alm", "gamma_n": 1e3 * NATURAL, "gamma_t": 1e3 * NATURAL},
            "ALM, gamma = auto": {"algorithm": "alm"},
            "ALM, gamma = 1e7 E/L": {"algorithm": "alm", "gamma_n": 1e7 * NATURAL, "gamma_t": 1e7 * NATURAL},
        }.items():
            yield Case(
                f"{law}, {name}",
                partial(_limit, law, settings),
                # The penalty terms have round-off that grows with gamma.
                target=1e-10 if "1e7" in name else 3e-12 if "auto" in name else 1e-12,
                reference="ALM, monolithic, on the full system",
            )


def _gamma(law: str, exponent: int) -> Finding:
    gamma = 10.0**exponent * NATURAL
    solution = solved(example1(law, gamma_n=gamma, gamma_t=gamma, tolerance=1e-9))
    return found(solution, apart(solution, _limit_of(law)))


@cache
def _limit_of(law: str) -> Solution:
    """The reference is the same limit from another gamma: full system, tight tolerance."""
    gamma = 1e4 * NATURAL
    settings = {"gamma_n": gamma, "gamma_t": gamma, "linear_algebra": "full", "coulomb": "newton"}
    return solved(example1(law, algorithm="alm", tolerance=1e-13, **settings))


def _limit(law: str, settings: dict) -> Finding:
    solution = solved(example1(law, tolerance=1e-13, **settings))
    return found(solution, apart(solution, _limit_of(law)))
