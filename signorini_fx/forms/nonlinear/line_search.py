"""The line search: which share of an increment to take, by the slope of the energy along it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.errors import FormError
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.machine import parallel
from signorini_fx.tuned import (
    BRACKET_MARGIN,
    CERTIFICATE_TOLERANCE,
    LINE_SEARCH_STEPS,
    SHORTENED_SLOPE,
    WHOLE_SLOPE,
)

Array = npt.NDArray[np.float64]


def share_of_increment(slope: Callable[[float], float], first: float, *, search: bool) -> float:
    """The share to take; 0: there is none at which the slope is finite.

    ``slope``: by which the energy changes at a share, infinite where it cannot be evaluated; ``first``: at 0, negative
    where the increment goes down; ``search``: whether the slope decides, or only whether it is finite.
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


def length_of_increment(
    linear: LinearisedProblem,
    forces_at: Callable[[Array], Array | None],
    at: tuple[Array, Array, Array],
    *,
    search: bool,
) -> tuple[float, Array | None]:
    """The share of an increment to take, and F there; 0 and None: there is no F however short it is; collective.

    ``forces_at``: see ``Residual.at``; its FormError is raised if it is there however short the increment is; ``at``:
    values of ``u`` and the increment to them, ghosts included, and F at the owned unknowns; ``search``: whether the
    slope decides, too: not where prescribed values must arrive.
    """
    old, increment, residual = at
    moved = fem.Function(linear.u.function_space)
    moved.x.array[:] = increment
    comm, owned = moved.function_space.mesh.comm, len(residual)
    internal, turning, on_tools = linear.internal(moved)
    ahead = np.where(linear.prescribed[0][:owned], 0.0, increment[:owned])
    # The contact forces of the linearised problem are - a(d, .) - R(u); along d they turn with the normals.
    contact = -internal - residual
    failed: FormError | None = None
    forces: Array | None = None

    def slope(share: float) -> float:
        nonlocal failed, forces
        try:
            forces, failed = forces_at(old + share * increment), None
        except FormError as error:
            forces, failed = None, error
        if forces is None:
            return np.inf
        along = float(parallel.global_sum(comm, np.array(ahead @ (forces + contact + share * turning))))
        return along - (1.0 - share) * on_tools

    first = -float(parallel.global_sum(comm, np.array(ahead @ internal))) - on_tools
    size, change = (float(parallel.largest(comm, np.abs(values), 0.0)) for values in (old, increment))
    search = search and change > CERTIFICATE_TOLERANCE * size
    share = share_of_increment(slope, first, search=search)
    if share == 0.0 and failed is not None:
        raise failed
    return share, forces
