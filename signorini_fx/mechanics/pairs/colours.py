"""Which facets of a surface that touches itself carry points, and which are the other side.

A facet f has for a partner the nearest one g that it faces, see ``search``, but for those around
itself.  Facets beside each other are on one side, partners on both:

    s_f = s_n for neighbours n,   s_f = - s_g,

from facets that stay on the side of the step before.  Of a patch without any the part with the
smaller facets carries points.  Facets without a partner are on the side of those beside them,
within reach of these, so that parts may slide there in the step.  Facets within two rings of the
other side are on none, so that both sides are parts without a common node.  Odd cycles, as of three
sheets that meet, cannot be divided: facets are left out where both sides meet.
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
    """Return which facets of a surface face each other within reach, length, more than two facets
    apart, and how far the second one is ahead of the first one, negative: behind it, shape (m,)
    each.
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
    """Return how far behind each facet of an undeformed surface the back of its body is, length,
    inf: not within reach, shape (f,): the distance along the normal to the plane of the nearest
    facet there that is behind by more than parts that touch each other overlap.
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
    """Return the side of each facet: 1, it carries points, -1, it is the other side, 0, it is on
    none, shape (f,).

    Args:
        surface: as it is deformed, with its walls.
        reach: distance beyond which facets are no partners, length.
        before: the sides in the last step, shape (f,).
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
    """Give facets without a side that of those that they are joined to, again and again; the sign
    tells whether it is the same.

    ``within``: which facets get one, shape (f,).
    """
    new = within
    while new.any():
        votes = joined @ side
        new = within & (side == 0) & (votes != 0.0)
        side[new] = np.sign(votes[new])


def _near(surface: PairSurface, facets: Flags, reach: float) -> Flags:
    """Return which facets are so near to some of them that these may slide there, and are not in a
    fold, shape (f,).
    """
    middles = surface.corners.mean(axis=1)
    if not facets.any():
        return facets
    near = cKDTree(middles[facets]).query(middles)[0] <= reach
    return near & (2.0 * reach * surface.focus < 1.0)


def _coarser(surface: PairSurface, side: Ints, patch: Ints) -> Flags:
    """Return which facets are of patches where those on the first side are larger, shape (f,)."""
    extent = extents(surface.corners)
    count = len(side)
    sums = [np.bincount(patch, extent * (side == sign), count) for sign in (1, -1)]
    sizes = [np.bincount(patch, side == sign, count) for sign in (1, -1)]
    coarser = sums[0] * sizes[1] > COARSER_FACETS * sums[1] * sizes[0]
    return coarser[patch]
