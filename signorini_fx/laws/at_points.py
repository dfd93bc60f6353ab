"""A law at contact points, as the core takes it."""

from __future__ import annotations

import numpy as np

from signorini_fx.contact.friction import LawAtPoints, PointFriction
from signorini_fx.laws.protocol import FrictionLaw


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
