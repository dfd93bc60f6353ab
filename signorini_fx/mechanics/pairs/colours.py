"""Division of a surface that touches itself into facets that carry points and facets opposite.

The partner g of a facet f is the nearest facet that it faces, see ``search``, except those around
itself.  Neighbours are on one side, partners on opposite sides:

    s_f = s_n for neighbours n,   s_f = - s_g.

Facets that stay opposite to their partner keep the side of the previous step, and the sides spread
from them.  In a connected patch without such facets the part with the smaller facets carries
points.  Facets without a partner take the side of those next to them, within reach, so that parts
may slide there during the step.  Facets within two rings of the other side are on neither side, so
that the sides have no common node.  Odd cycles, as where three sheets meet, cannot be divided:
facets are left out where both sides meet.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Flags, Ints, extents, inner
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.mechanics.pairs.search import Parts, candidates
from signorini_fx.tuned import COARSER_FACETS, DIGITS_OF_FILES, NOTABLE


def facing(surface: PairSurface, reach: float) -> tuple[Ints, Ints, Array]:
    """Return the pairs of facets of a surface that face each other within ``reach``, length, and
    are more than two facets apart.

    Returns both numbers and how far the second facet is in front of the first one along its normal,
    negative behind it, length; shape (m,) each.
    """
    count = len(surface.nodes)
    parts = Parts.of(surface, np.arange(count))
    first, second = candidates(parts, parts, reach, np.zeros(len(parts.facet)))
    way = parts.centre[second] - parts.centre[first]
    ahead = inner(way, parts.normal[first])
    first = parts.facet[first]
    second = parts.facet[second]
    around = surface.around_neighbours.tocoo()
    apart = ~np.isin(first * count + second, around.row * count + around.col)
    return first[apart], second[apart], ahead[apart]


def walls(surface: PairSurface, reach: float) -> Array:
    """Return the distance from each facet of an undeformed surface back through its body, length,
    shape (f,); inf: nothing within ``reach``.

    It is measured along the normal to the plane of the nearest facet behind.  Parts that touch,
    with their usual overlap, do not count.
    """
    first, second, _ = facing(surface, reach)
    parts = Parts.of(surface, np.arange(len(surface.nodes)))
    way = parts.centre[second] - parts.centre[first]
    normal = parts.normal[first]
    opposite = parts.normal[second]
    away = inner(way, opposite) / inner(normal, opposite)
    met = away < -2.0 * NOTABLE * parts.radius[first]
    behind = np.full(len(surface.nodes), np.inf)
    np.minimum.at(behind, first[met], -away[met])
    return behind


def chosen_sides(surface: PairSurface, reach: float, before: Ints) -> Ints:
    """Return the side of each facet, shape (f,): 1 carries points, -1 is opposite, 0 is on neither.

    Args:
        surface: the deformed surface, with its walls.
        reach: distance beyond which facets are not paired, length.
        before: the sides in the previous step, shape (f,).
    """
    count = len(surface.nodes)
    first, second, ahead = facing(surface, reach)
    by_distance = np.lexsort((np.abs(ahead), first))
    found, nearest = np.unique(first[by_distance], return_index=True)
    partner = second[by_distance][nearest]
    has = np.isin(np.arange(count), found)
    beside = surface.neighbours.tocoo()
    same = has[beside.row] & has[beside.col] & (beside.row < beside.col)
    opposite = has[partner]
    rows = np.concatenate((beside.row[same], found[opposite]))
    columns = np.concatenate((beside.col[same], partner[opposite]))
    signs = np.repeat([1.0, -1.0], [np.count_nonzero(same), np.count_nonzero(opposite)])
    joined = sp.csr_array((signs, (rows, columns)), shape=(count, count))
    side = np.zeros(count, dtype=np.int64)
    stays = before[partner] != before[found]
    side[found[stays]] = before[found[stays]]
    _, patch = connected_components(abs(joined), directed=False)
    fresh = ~np.isin(patch, patch[side != 0])
    # The first facet of a patch in the order of places, which is the same on all ranks.
    start = (surface.undeformed or surface).corners.mean(axis=1)
    order = np.lexsort(np.round(start / (DIGITS_OF_FILES * np.ptp(start))).T)
    order = order[(has & fresh)[order]]
    side[order[np.unique(patch[order], return_index=True)[1]]] = 1
    _spread(side, joined + joined.T, has)
    side[fresh & _coarser(surface, side, patch)] *= -1
    _spread(side, surface.neighbours, _near(surface, has, reach))
    near = [surface.around_neighbours @ (side == sign) > 0.0 for sign in (1, -1)]
    return np.where(near[0] & near[1], 0, side)


def _spread(side: Ints, joined: sp.csr_array, within: Flags) -> None:
    """Assign sides to facets that have none from those they are joined to, until nothing changes.

    ``joined``: positive entries join facets of the same side, negative ones facets of opposite
    sides; ``within``: which facets may be assigned a side, shape (f,).
    """
    new = within
    while new.any():
        votes = joined @ side
        new = within & (side == 0) & (votes != 0.0)
        side[new] = np.sign(votes[new])


def _near(surface: PairSurface, facets: Flags, reach: float) -> Flags:
    """Return the flags of facets, shape (f,), so near to one of ``facets`` that it may slide there
    in this step, except in folds.
    """
    middles = surface.corners.mean(axis=1)
    if not facets.any():
        return facets
    near = cKDTree(middles[facets]).query(middles)[0] <= reach
    return near & (2.0 * reach * surface.focus < 1.0)


def _coarser(surface: PairSurface, side: Ints, patch: Ints) -> Flags:
    """Return the flags of facets, shape (f,), in patches whose facets with points are larger than
    those opposite.
    """
    extent = extents(surface.corners)
    count = len(side)
    sums = [np.bincount(patch, extent * (side == sign), count) for sign in (1, -1)]
    sizes = [np.bincount(patch, side == sign, count) for sign in (1, -1)]
    coarser = sums[0] * sizes[1] > COARSER_FACETS * sums[1] * sizes[0]
    return coarser[patch]
