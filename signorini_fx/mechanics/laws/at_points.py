"""Friction laws at contact points, in the form that algorithms take, and the check of a user's own
law at pressures of all sizes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from signorini_fx.algebra.contact.friction import LawAtPoints, PointFriction
from signorini_fx.arrays import Array, Flags, Ints
from signorini_fx.mechanics.laws.protocol import FrictionLaw
from signorini_fx.tuned import (
    NEGLIGIBLE,
    PRESSURES_PER_DECADE,
    ROOT_OF_EPS,
    SMALLEST_PRESSURE,
    TRIED_POINTS,
    WRONG_SLOPE,
)


def friction_of(law: FrictionLaw | None, count: int) -> PointFriction:
    """Return the friction of ``count`` points with one law.

    Args:
        law: the law, whose parameters are arrays; None: no friction.
        count: number of points.
    """
    zero = np.zeros(count)
    if law is None:
        return PointFriction(zero, zero)
    given, coefficient, cap = law.envelope(zero)
    ends = np.ones(count, dtype=bool) if law.ends_open else None
    laws = (LawAtPoints(law, np.arange(count), law.unknown),) if law.unknown else ()
    return PointFriction(given, coefficient, cap, ends, laws)


def joined(parts: Sequence[PointFriction], points: Sequence[Ints]) -> PointFriction:
    """Return the friction of several parts of the contact points as one.

    Args:
        parts: friction of each part.
        points: numbers of the points of each part, which together are all points.
    """
    count = sum(numbers.size for numbers in points)
    given, coefficient, cap, ends = (np.full(count, value) for value in (0.0, 0.0, np.inf, False))
    laws = list[LawAtPoints]()
    for part, numbers in zip(parts, points, strict=True):
        given[numbers] = part.given
        coefficient[numbers] = part.coefficient
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
    """Return what a user's own law does wrong, tried at ``count`` points; "" if nothing was found.

    Its bound, derivatives and envelope must agree with each other and with its class attributes.

    Args:
        law: the law, whose parameters are arrays.
        count: number of points.
        modulus: of the body, stress: pressures up to it are tried, and speeds of all sizes.
    """
    kind = type(law)
    own_envelope = kind.envelope is not FrictionLaw.envelope
    if kind.evaluate is FrictionLaw.evaluate and own_envelope and not law.unknown:
        return ""  # its envelope is its bound
    if law.follows_slip and not law.follows_pressure:
        return f"{kind.__name__} follows the slip: leave its follows_pressure out"
    points = np.arange(0, count, 1 + count // TRIED_POINTS)
    exponents = np.arange(PRESSURES_PER_DECADE * SMALLEST_PRESSURE, 1) / PRESSURES_PER_DECADE
    pressure = np.append(0.0, modulus * 10.0**exponents)[:, None]

    def envelope(at: Array) -> Array:
        given, coefficient, cap = law.at(points).envelope(np.zeros(points.size))
        bound = given + coefficient * at
        return bound if cap is None else np.minimum(bound, cap)

    def faults() -> Iterator[tuple[Array, str, Flags]]:
        limit, derivative, _ = _values(law, points, pressure, 0.0)
        # The bound may be a difference of numbers as large as its last value.
        round_off = 4 * np.finfo(np.float64).eps * limit[-1]
        most = np.broadcast_to(envelope(pressure), limit.shape)
        for reason, wrong in _faults(law, pressure, limit, derivative, most, round_off):
            yield pressure, reason, wrong
        # Odd numbers, because round ones may be kinks of a table.
        speeds = 1.2345 * 10.0 ** np.arange(SMALLEST_PRESSURE, 1 - SMALLEST_PRESSURE)
        few = pressure[::PRESSURES_PER_DECADE]
        for speed in speeds if law.follows_slip else (1.0,):
            for reason, wrong in _faults_at(speed, law, points, few, envelope(few), round_off):
                yield few, reason, wrong

    try:
        with np.errstate(all="ignore"):
            for at, reason, wrong in faults():
                if wrong.any():
                    where = np.broadcast_to(at, wrong.shape)[wrong][0]
                    return reason.format(law=kind.__name__, pressure=where)
    except _Fault as fault:
        return str(fault)
    return ""


class _Fault(Exception):
    """An error of a law; its message describes it."""


def _faults_at(
    speed: float,
    law: FrictionLaw,
    points: Ints,
    pressure: Array,
    envelope: Array,
    round_off: Array,
) -> Iterator[tuple[str, Flags]]:
    """Yield what is wrong at one speed, and where, see ``_faults``."""
    bound, _, by_slip = _values(law, points, pressure, speed)
    if not law.follows_slip:
        still, _, _ = _values(law, points, pressure, 0.0)
        yield (
            "bound of {law} follows the slip: set its follows_slip",
            (bound != still) | (by_slip != 0),
        )
        return
    where = f"of {{law}} at the pressure {{pressure:g}} and the speed {speed:g}"
    yield f"bound {where} is negative or not finite", ~((bound >= 0) & np.isfinite(bound))
    yield f"bound {where} exceeds its envelope", bound > envelope * (1 + NEGLIGIBLE) + round_off
    near = np.sqrt(ROOT_OF_EPS) * speed
    slower, faster = (_values(law, points, pressure, at)[0] for at in (speed - near, speed + near))
    slope = (faster - slower) / (2 * near)
    within = WRONG_SLOPE * np.maximum(np.abs(slope), np.abs(by_slip)) + round_off / near
    yield f"by_slip {where} is not the derivative of its bound", ~(abs(slope - by_slip) <= within)


def _values(law: FrictionLaw, points: Ints, pressure: Array, speed: float) -> list[Array]:
    """Return bound, derivative by pressure and derivative by slip, each of shape (k, m).

    Args:
        law: the law.
        points: m points.
        pressure: k pressures, stress, shape (k, 1).
        speed: one speed for all.

    Raises:
        _Fault: the law fails, or returns something of another shape.
    """
    name = type(law).__name__
    shape = (len(pressure), points.size)
    pressures = np.broadcast_to(pressure, shape).ravel()
    slips = np.full(pressures.size, speed)
    for argument in (pressures, slips):
        argument.flags.writeable = False  # a law must not change arrays of the solver
    try:
        values = law.at(np.tile(points, shape[0])).evaluate(pressures, slips, 1.0)
    except NotImplementedError:
        raise _Fault(f"{name} must define evaluate()") from None
    except Exception as error:
        raise _Fault(f"evaluate of {name} fails: {type(error).__name__}: {error}") from None
    if not isinstance(values, tuple) or len(values) != 3:
        raise _Fault(f"evaluate of {name} must return three: bound, by_pressure, by_slip")
    found = list[Array]()
    for value, part in zip(values, ("bound", "by_pressure", "by_slip"), strict=True):
        if np.shape(value) != pressures.shape and (part == "bound" or np.shape(value) != ()):
            shapes = f"{np.shape(value)} for pressures of the shape {pressures.shape}"
            raise _Fault(f"{part} of {name} has the shape {shapes}")
        values_at = np.broadcast_to(np.asarray(value, dtype=np.float64), pressures.shape)
        found.append(values_at.reshape(shape))
    return found


def _faults(
    law: FrictionLaw,
    pressure: Array,
    limit: Array,
    derivative: Array,
    envelope: Array,
    round_off: Array,
) -> Iterator[tuple[str, Flags]]:
    """Yield messages, with placeholders for law and pressure, and where each applies, shape (k, m).

    Args:
        law: the law.
        pressure: k ascending pressures, stress, shape (k, 1).
        limit: its bound, stress, shape (k, m).
        derivative: of the bound by the pressure, shape (k, m).
        envelope: bound of its envelope, stress, shape (k, m).
        round_off: of the bound, stress, shape (m,).
    """
    yield "bound of {law} is not finite at the pressure {pressure:g}", ~np.isfinite(limit)
    yield "bound of {law} is negative at the pressure {pressure:g}", limit < 0
    infinite = ~(
        np.isfinite(derivative) | ((pressure == 0) & np.isposinf(derivative))
    )  # infinite at zero is allowed, as for a square root
    yield "by_pressure of {law} is not finite at the pressure {pressure:g}", infinite
    if not law.follows_pressure:
        yield (
            "{law}.follows_pressure is False, but bound() depends on the pressure",
            limit != limit[:1],
        )
    within = NEGLIGIBLE * limit + round_off
    what = "its tangent at zero, or its limit: it is not concave" if law.concave else "its envelope"
    yield (
        f"bound of {{law}} exceeds, at the pressure {{pressure:g}}, {what}",
        limit > envelope + within,
    )
    if not law.unknown:
        yield (
            "bound of {law} is less than its envelope, which leaves nothing unknown",
            limit < envelope - within,
        )
    # The derivative must be between the slopes of the chords to the neighbouring pressures.
    step = np.diff(pressure, axis=0)
    ends = ((1, 1), (0, 0))
    chords = np.diff(limit, axis=0) / step
    before = chords[:-1]
    behind = chords[1:]
    slope = derivative[1:-1]
    within = WRONG_SLOPE * np.max(np.abs([before, behind, slope]), axis=0) + round_off / step[:-1]
    if law.concave:
        reason = (
            "bound of {law} is not concave: it grows faster beyond the pressure {pressure:g} "
            "than before"
        )
        yield reason, np.pad(behind > before + within, ends)
    outside = (slope < np.minimum(before, behind) - within) | (
        slope > np.maximum(before, behind) + within
    )
    yield (
        "by_pressure of {law} is not the derivative of its bound at the pressure {pressure:g}",
        np.pad(outside, ends),
    )
