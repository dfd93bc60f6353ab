"""The line search: which share of an increment to take, by the slope of the energy along it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from signorini_fx.tuned import BRACKET_MARGIN, LINE_SEARCH_STEPS, SHORTENED_SLOPE, WHOLE_SLOPE


def share_of_increment(slope: Callable[[float], float], first: float, *, search: bool) -> float:
    """The share to take; 0: there is none at which the slope is finite.

    Args:
        slope: at a share, by which the energy changes; infinite where it cannot be evaluated.
        first: at 0, negative where the increment goes down.
        search: whether the slope decides, or only whether it is finite.
    """
    share, now = 1.0, slope(1.0)
    for _ in range(LINE_SEARCH_STEPS):
        if np.isfinite(now):
            break
        share /= 2
        now = slope(share)
    if not np.isfinite(now):
        return 0.0
    if not search or first >= 0 or abs(now) <= WHOLE_SLOPE * abs(first):
        return share
    below, at_below, above, at_above = 0.0, first, share, now
    for _ in range(LINE_SEARCH_STEPS):
        if abs(now) <= SHORTENED_SLOPE * abs(first) or at_above <= 0:
            break
        if np.isfinite(at_above):
            share = (below * at_above - above * at_below) / (at_above - at_below)  # regula falsi
            margin = BRACKET_MARGIN * (above - below)
            share = min(max(share, below + margin), above - margin)
        else:
            share = (below + above) / 2
        now = slope(share)
        if now > 0:  # infinite, too
            above, at_above = share, now
        else:
            below, at_below = share, now
    return share
