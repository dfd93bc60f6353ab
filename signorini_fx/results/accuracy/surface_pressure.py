"""How wrong the contact pressure is on a surface, in L2(Gamma_c), and where: from its kinks between the pieces.

It is the estimate along a curve (``pressure_error``), side by side: a pressure that changes along one direction only
has the same error here as there.  At the rim of the surface, an edge of the body, the pressure may be singular.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from signorini_fx.results.accuracy.contact_surface import ContactSurface
from signorini_fx.results.accuracy.pressure_error import bends, singular_square
from signorini_fx.tuned import CORNER_SHARE, KINK_SHARE, NOTABLE, PLACES_BESIDE_RIM, SAME_POWER

Floats = npt.NDArray[np.float64]

# Of these the rim, the end of the first piece, and those that tell a power: near it and farther away.
_STRETCHES = ([0, 1, 2, 3, 4], [0, 1, 4, 5, 6])


def piece_squares(surface: ContactSurface, pressure: Floats) -> Floats:
    """Estimated squared error of the pressure on each piece, stress^2 times area, shape (pieces,)."""
    jumps = surface.jumps(pressure)
    kinks = surface.sides * surface.heights**3 * jumps**2
    squares = KINK_SHARE / 2 * kinks.sum(axis=1)
    on_rim = surface.rim_nodes & (pressure != 0)
    ends, next_ends = on_rim[surface.corners], np.roll(on_rim[surface.corners], -1, axis=1)
    # A pressure that is convex towards the rim may be singular there; at a plane of symmetry it is concave.
    pressed = (pressure != 0)[surface.corners].all(axis=1)  # the end of a contact zone is another matter
    both_pressed = pressed[:, None] & pressed[np.maximum(surface.across, 0) // surface.corners.shape[1]]
    convex = np.where(both_pressed & ~(ends | next_ends) & (jumps < 0), kinks, 0.0).sum(axis=1) * ends.any(axis=1)
    squares = np.maximum(squares, CORNER_SHARE * convex)
    pieces, sides = np.nonzero(surface.rim & ends & next_ends)
    r, beneath = _profiles(surface, pressure, pieces, sides)
    for row, (piece, side) in enumerate(zip(pieces, sides, strict=True)):
        square = _singular(r[row], beneath[row])
        squares[piece] = max(squares[piece], surface.sides[piece, side] * square)
    return squares


def _singular(r: Floats, pressure: Floats) -> float:
    """``singular_square`` where the pressure falls like a power of the distance, ever more slowly; else 0.

    Towards the end of a contact zone that reaches the rim it falls ever faster, and beyond the surface it is not known.
    """
    slopes = np.diff(pressure[1:]) / np.diff(r[1:])
    if not (pressure > 0).all() or slopes[-1] >= 0 or (np.diff(slopes) < 0).any():
        return 0.0
    near, middle, far = pressure[[2, 4, 6]]  # each twice as far away: a power falls by the same factor each time
    if near * far < SAME_POWER * middle**2 or bends(r[[2, 4, 6]], pressure[[2, 4, 6]]):
        return 0.0
    return min(singular_square(r[places], pressure[places], 0.0) for places in _STRETCHES)


def _profiles(
    surface: ContactSurface, pressure: Floats, pieces: npt.NDArray[np.int64], sides: npt.NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """The pressure along straight lines from the middle of sides at the rim into the surface.

    Returns:
        Distances from the rim and the pressure there, shape (sides, places); nan beyond the surface.
    """
    corners = surface.corners
    first, second = corners[pieces, sides], np.roll(corners, -1, axis=1)[pieces, sides]
    middle, inward = (surface.x[first] + surface.x[second]) / 2, -surface.outward[pieces, sides]
    r = surface.heights[pieces, sides][:, None] * PLACES_BESIDE_RIM
    places = middle[:, None, :] + r[:, :, None] * inward[:, None, :]
    profile = np.full(r.shape, np.nan)
    for part in np.unique(surface.part[pieces]):
        on_part = surface.part[pieces] == part
        points = places[on_part].reshape(-1, 3)
        values = np.column_stack((pressure, surface.x))
        at = surface.at(points, values, int(part))
        away = np.linalg.norm(at[:, 1:] - points, axis=1).reshape(r[on_part].shape)
        profile[on_part] = np.where(away <= NOTABLE * r[on_part][:, 1:2], at[:, 0].reshape(r[on_part].shape), np.nan)
    return r, profile
