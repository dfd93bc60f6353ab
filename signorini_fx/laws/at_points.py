"""A law at contact points, as the core takes it."""

from __future__ import annotations

import numpy as np

from signorini_fx.contact.friction import LawAtPoints, PointFriction
from signorini_fx.laws.protocol import FrictionLaw
from signorini_fx.tuned import TRIED_POINTS, WRONG_BOUND

# Pressures at which what a law says of itself is tried, at about so many of its points, and by what share of its bound
# it may be wrong, which is more than round-off at any unit of stress.
_PRESSURES = 10.0 ** np.arange(13)


def friction_of(law: FrictionLaw | None, count: int) -> PointFriction:
    """The friction of ``count`` points with one law, whose parameters are arrays; None: there is none."""
    zero = np.zeros(count)
    if law is None:
        return PointFriction(zero, zero)
    given, coefficient, cap = law.envelope(zero)
    ends = np.ones(count, dtype=bool) if law.ends_open else None
    if not law.unknown:
        return PointFriction(given, coefficient, cap, ends)
    return PointFriction(given, coefficient, None, ends, (LawAtPoints(law, np.arange(count), cap, law.unknown),))


def fault_of(law: FrictionLaw, count: int) -> str:
    """What a law of a user's own says of itself and does not keep, at ``count`` points, for which its parameters are
    arrays; "": nothing was found.
    """
    tried = law.at(slice(None, None, 1 + count // TRIED_POINTS))
    zero = np.zeros(len(range(0, count, 1 + count // TRIED_POINTS)))
    for name in ("limit", "derivative", "claimed"):
        try:
            shape = np.shape(getattr(tried, name)(zero.copy()))
        except NotImplementedError:
            return f"{type(law).__name__} does not say its {name}"
        if shape != zero.shape:
            return f"{name} of {type(law).__name__} has the shape {shape} for pressures of the shape {zero.shape}"
    given, coefficient, cap = tried.envelope(zero)
    with np.errstate(all="ignore"):
        for pressure in _PRESSURES:
            bound, envelope = tried.limit(zero + pressure), given + coefficient * pressure
            envelope = envelope if cap is None else np.minimum(envelope, cap)
            if not (law.follows_pressure or np.array_equal(bound, tried.limit(zero.copy()), equal_nan=True)):
                return f"limit of {type(law).__name__} follows the pressure, which it denies"
            if (bound < 0).any():
                return f"limit of {type(law).__name__} is negative at the pressure {pressure:g}"
            if (bound > (1 + WRONG_BOUND) * envelope).any():
                what = "its tangent at zero, or its limit: it is not concave" if law.concave else "its envelope"
                return f"limit of {type(law).__name__} exceeds, at the pressure {pressure:g}, {what}"
            if not law.unknown and (bound < (1 - WRONG_BOUND) * envelope).any():
                return f"limit of {type(law).__name__} is less than its envelope, which leaves nothing unknown"
    return ""
