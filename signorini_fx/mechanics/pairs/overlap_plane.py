"""The overlap of two sides in 2D: projection along a continuous direction on the slave side.

The direction n(s) interpolates those at the nodes.  The slave point under a master point x has (x - x_s(s)) x n(s) = 0.
Between the images of the ends of a master facet all integrands are smooth.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.pairs.pair_side import Overlap, PairSurface
from signorini_fx.mechanics.pairs.search import Patches, candidates
from signorini_fx.tuned import NOTHING_LEFT, POINTS_OF_PIECES, TURNED_DIRECTION, ZERO_COMPONENT

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

# Of Gauss' rule in [-1, 1] for a segment of the overlap: integrands are rational where the normal turns.
PLACES_OF_RULE, _WEIGHTS_OF_RULE = np.polynomial.legendre.leggauss(POINTS_OF_PIECES)
# Steps of Newton's method and bisections, at most.
_STEPS = 60


def facing_facets(slave: PairSurface, master: PairSurface, reach: float, facets: Indices) -> tuple[Indices, Indices]:
    """Pairs of facets of both sides that may meet, shape (m,) each.

    Args:
        slave: the side with the points, d = 2.
        master: the other one.
        reach: distance beyond which facets are no partners, length.
        facets: the facets of the slave that are paired, shape (m,).
    """
    slave_facets, master_facets = candidates(
        patches(slave, facets), patches(master, np.arange(len(master.nodes))), reach, TURNED_DIRECTION
    )
    return facets[slave_facets], master_facets


def plane_overlap(
    slave: PairSurface, master: PairSurface, pairs: tuple[Indices, Indices], directions: Array | None
) -> Overlap:
    """The overlap, one piece for each pair of facets that meet.

    Args:
        slave: the side with the points, d = 2.
        master: the other one.
        pairs: of facets that may meet.
        directions: of projection at the nodes of the slave, shape (N, 2); None: its normals.
    """
    slave_facets, master_facets = pairs
    normals = (slave.nodal_normals if directions is None else directions)[slave.nodes[slave_facets]]
    corners = slave.corners[slave_facets]
    vertices = np.concatenate([_end(master, master_facets, parameter) for parameter in (0.0, 1.0)])
    ends: Array = _under(slave, np.tile(corners, (2, 1, 1)), np.tile(normals, (2, 1, 1)), vertices)
    ends = ends.reshape(2, -1).T.copy()  # of each pair: the images of both ends
    ends.sort(axis=1)
    meets = ends[:, 1] - ends[:, 0] > NOTHING_LEFT
    slave_facets, master_facets = slave_facets[meets], master_facets[meets]
    ends, normals, corners = ends[meets], normals[meets], corners[meets]
    width = ends[:, 1] - ends[:, 0]
    at = ends[:, :1] + width[:, None] * (PLACES_OF_RULE + 1) / 2
    shape = slave.functions.values(at[..., None])
    x, normal = np.einsum("mqk,mkd->mqd", shape, corners), np.einsum("mqk,mkd->mqd", shape, normals)
    over = _over(master, master.corners[master_facets], x, normal)
    weight = slave.sizes(slave_facets, at[..., None]) * _WEIGHTS_OF_RULE / 2 * width[:, None]
    return Overlap(slave_facets, master_facets, at[..., None], over[..., None], weight)


def turned_in_plane(slave: PairSurface, directions: Array) -> float:
    """The largest distance of directions of projection from those that a first projection takes, of length one."""
    return float(np.abs(directions - slave.nodal_normals)[slave.points].max())


def patches(side: PairSurface, facets: Indices) -> Patches:
    """Facets of a side as flat patches."""
    at = np.broadcast_to(side.functions.places.mean(axis=0), (len(facets), 1, side.dimension - 1))
    middle = side.normals(facets, at)[:, 0]
    return Patches(side.corners[facets], middle / np.linalg.norm(middle, axis=1, keepdims=True))


def _end(side: PairSurface, facets: Indices, parameter: float) -> Array:
    return side.positions(facets, np.full((len(facets), 1, 1), parameter))[:, 0]


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _under(side: PairSurface, corners: Array, normals: Array, x: Array) -> Array:
    """The place s in [0, 1] of the slave point under each point of shape (m, d), or the end beyond which it is."""
    ends = side.functions.values(np.array([[0.0], [1.0]]))
    at_ends, outward = ends @ corners, ends @ normals
    first: Array = at_ends[:, 0]
    last: Array = at_ends[:, 1]
    # Along the facet the misses fall or rise, as its normal is on its right or left.
    way = np.sign(_cross(last - first, normals.mean(axis=1)))
    above_low, below_high = way * _cross(x - first, outward[:, 0]) > 0, way * _cross(x - last, outward[:, 1]) < 0
    # The misses are polynomials of the place.
    places = side.functions.polynomials(corners - first[:, None])
    ways = side.functions.polynomials(normals)
    places[:, 0] -= x - first
    factors: Array = np.zeros((2 * places.shape[1] - 1, len(x)))
    for power in range(places.shape[1]):
        factors[power : power + ways.shape[1]] -= _cross(places[:, power, None], ways).T
    root = _crossing(way * factors)
    return np.where(above_low & below_high, root, np.where(above_low, 1.0, 0.0))


def _crossing(factors: Array) -> Array:
    """Where polynomials, with factors as in ``_powers``, fall to zero in [0, 1], else the end beyond which they do, by
    Newton's method with bisections.
    """
    low, high, at = (np.full(factors.shape[1:], end) for end in (0.0, 1.0, 0.5))
    rates = (factors[1:].T * np.arange(1, len(factors))).T
    for _ in range(_STEPS):
        value, slope = _powers(factors, at), _powers(rates, at)
        low, high = np.where(value > 0, at, low), np.where(value > 0, high, at)
        step = np.divide(value, slope, out=np.full(value.shape, np.nan), where=slope != 0)
        following = np.clip(at - step, 0.0, 1.0)
        following = np.where((following >= low) & (following <= high), following, (low + high) / 2)
        step, at = following - at, following
        if np.abs(step).max(initial=0.0) < ZERO_COMPONENT:
            break
    return at


def _powers(factors: Array, s: Array) -> Array:
    """The values of polynomials at s, with factors of powers in ascending order along the first axis."""
    value = factors[-1]
    for factor in factors[-2::-1]:
        value = value * s + factor
    return value


def _over(side: PairSurface, corners: Array, x: Array, normal: Array) -> Array:
    """The place of the master point over each point of shape (m, q, d) along its normal, in [0, 1]."""
    start = corners[:, :1]
    places = side.functions.polynomials(corners - start).transpose(1, 0, 2)[:, :, None]
    factors = _cross(places, normal)
    factors[0] -= _cross(x - start, normal)
    return _crossing(factors * np.sign(-factors[1:].sum(axis=0)))
