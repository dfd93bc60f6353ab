"""A law at contact points, as the core takes it, and what a law of a user's own says of itself,
tried at pressures of all sizes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.friction import LawAtPoints, PointFriction
from signorini_fx.mechanics.laws.protocol import Array, FrictionLaw
from signorini_fx.tuned import (
    NEGLIGIBLE,
    PRESSURES_PER_DECADE,
    SMALLEST_PRESSURE,
    TRIED_POINTS,
    WRONG_SLOPE,
)


def friction_of(law: FrictionLaw | None, count: int) -> PointFriction:
    """The friction of ``count`` points with one law, whose parameters are arrays; None: there is
    none.
    """
    zero = np.zeros(count)
    if law is None:
        return PointFriction(zero, zero)
    given, coefficient, cap = law.envelope(zero)
    ends = np.ones(count, dtype=bool) if law.ends_open else None
    laws = (LawAtPoints(law, np.arange(count), law.unknown),) if law.unknown else ()
    return PointFriction(given, coefficient, cap, ends, laws)


def joined(
    parts: Sequence[PointFriction], points: Sequence[npt.NDArray[np.int64]]
) -> PointFriction:
    """The friction of several parts of the contact points as one; ``points``: the numbers of those
    of each part, which together are all.
    """
    count = sum(numbers.size for numbers in points)
    given, coefficient, cap, ends = (np.full(count, value) for value in (0.0, 0.0, np.inf, False))
    laws = list[LawAtPoints]()
    for part, numbers in zip(parts, points, strict=True):
        given[numbers], coefficient[numbers] = part.given, part.coefficient
        cap[numbers] = np.inf if part.cap is None else part.cap
        ends[numbers] = False if part.ends_open is None else part.ends_open
        laws += [replace(entry, points=numbers[entry.points]) for entry in part.laws]
    return PointFriction(
        given,
        coefficient,
        None if all(part.cap is None for part in parts) else cap,
        None if all(part.ends_open is None for part in parts) else ends,
        tuple(laws),
    )


def fault_of(law: FrictionLaw, count: int, modulus: float) -> str:
    """What a law of a user's own says of itself and does not keep, at ``count`` points, for which
    its parameters are arrays; "": nothing was found; ``modulus``: of the body, stress: pressures up
    to it are tried.
    """
    kind = type(law)
    if (
        kind.limit is FrictionLaw.limit
        and kind.envelope is not FrictionLaw.envelope
        and not law.unknown
    ):
        return ""  # its envelope is its bound
    points = np.arange(0, count, 1 + count // TRIED_POINTS)
    exponents = np.arange(PRESSURES_PER_DECADE * SMALLEST_PRESSURE, 1) / PRESSURES_PER_DECADE
    pressure = np.append(0.0, modulus * 10.0**exponents)[:, None]
    name = type(law).__name__
    shape = (len(pressure), points.size)
    tried = law.at(np.tile(points, shape[0]))
    at_pressures = np.broadcast_to(pressure, shape).ravel()
    at_pressures.flags.writeable = (
        False  # a law that changes its argument changes the solver's pressures
    )
    values = []
    with np.errstate(all="ignore"):
        for statement in ("limit", "derivative"):
            try:
                value = getattr(tried, statement)(at_pressures)
            except NotImplementedError:
                return f"{name} must define {statement}()"
            except Exception as error:
                return f"{statement} of {name} fails: {type(error).__name__}: {error}"
            if np.shape(value) != at_pressures.shape:
                shapes = f"{np.shape(value)} for pressures of the shape {at_pressures.shape}"
                return f"{statement} of {name} has the shape {shapes}"
            values.append(np.asarray(value, dtype=np.float64).reshape(shape))
        limit, derivative = values
        given, coefficient, cap = law.at(points).envelope(np.zeros(points.size))
        envelope = given + coefficient * pressure
        envelope = np.broadcast_to(envelope if cap is None else np.minimum(envelope, cap), shape)
        round_off = (
            4 * np.finfo(np.float64).eps * limit[-1]
        )  # the bound may be a difference of numbers as large
        for reason, wrong in _faults(law, pressure, limit, derivative, envelope, round_off):
            if wrong.any():
                return reason.format(law=name, pressure=np.broadcast_to(pressure, shape)[wrong][0])
    return ""


def _faults(
    law: FrictionLaw,
    pressure: Array,
    limit: Array,
    derivative: Array,
    envelope: Array,
    round_off: Array,
) -> Iterator[tuple[str, npt.NDArray[np.bool_]]]:
    """What is wrong in words, with places for law and pressure, and where: k ascending pressures, m
    points, (k, m).
    """
    yield "limit of {law} is not finite at the pressure {pressure:g}", ~np.isfinite(limit)
    yield "limit of {law} is negative at the pressure {pressure:g}", limit < 0
    infinite = ~(
        np.isfinite(derivative) | ((pressure == 0) & np.isposinf(derivative))
    )  # such as that of a root
    yield "derivative of {law} is not finite at the pressure {pressure:g}", infinite
    if not law.follows_pressure:
        yield (
            "{law}.follows_pressure is False, but limit() depends on the pressure",
            limit != limit[:1],
        )
    within = NEGLIGIBLE * limit + round_off
    what = "its tangent at zero, or its limit: it is not concave" if law.concave else "its envelope"
    yield (
        f"limit of {{law}} exceeds, at the pressure {{pressure:g}}, {what}",
        limit > envelope + within,
    )
    if not law.unknown:
        yield (
            "limit of {law} is less than its envelope, which leaves nothing unknown",
            limit < envelope - within,
        )
    # The slope at a pressure is between those of the chords to its neighbours.
    step = np.diff(pressure, axis=0)
    ends = ((1, 1), (0, 0))
    chords = np.diff(limit, axis=0) / step
    before = chords[:-1]
    behind = chords[1:]
    slope = derivative[1:-1]
    within = WRONG_SLOPE * np.max(np.abs([before, behind, slope]), axis=0) + round_off / step[:-1]
    if law.concave:
        reason = (
            "limit of {law} is not concave: it grows faster beyond the pressure {pressure:g} "
            "than before"
        )
        yield reason, np.pad(behind > before + within, ends)
    outside = (slope < np.minimum(before, behind) - within) | (
        slope > np.maximum(before, behind) + within
    )
    yield (
        "derivative of {law} is not that of its limit at the pressure {pressure:g}",
        np.pad(outside, ends),
    )
