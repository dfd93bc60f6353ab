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
# Bisections, then steps of Newton's method that polish the root.
_BISECTIONS, _STEPS = 30, 3


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
    rates = factors[1:] * np.arange(1, len(factors))[:, None]
    root = _crossing(way * factors)
    for _ in range(_STEPS):
        gradient = _powers(rates, root)
        step = np.divide(_powers(factors, root), gradient, out=np.zeros(len(x)), where=gradient != 0)
        root = np.clip(root - step, 0.0, 1.0)
    return np.where(above_low & below_high, root, np.where(above_low, 1.0, 0.0))


def _crossing(factors: Array) -> Array:
    """Where polynomials, with factors as in ``_powers``, fall from a positive value at 0 to a negative one at 1, up to
    a share of 1e-9; any place in [0, 1] where they do not.
    """
    if len(factors) == 3:  # of straight facets
        constant, linear, square = factors
        root_of_discriminant = np.sqrt(np.maximum(linear**2 - 4.0 * square * constant, 0.0))
        # The root at which they fall, in the form that has no difference of equal numbers.
        twice = root_of_discriminant - linear
        away = np.divide(2.0 * constant, twice, out=np.zeros_like(constant), where=twice != 0.0)
        back = np.divide(-linear - root_of_discriminant, 2.0 * square, out=np.zeros_like(constant), where=square != 0.0)
        return np.asarray(np.clip(np.where(linear <= 0.0, away, back), 0.0, 1.0))
    low: Array = np.zeros(factors.shape[1])
    width = 1.0
    for _ in range(_BISECTIONS):
        width /= 2
        middle = low + width
        low = np.where(_powers(factors, middle) > 0, middle, low)
    return np.asarray(low + width / 2)


def _powers(factors: Array, s: Array) -> Array:
    """The values of polynomials at s, with factors of powers in ascending order along the first axis."""
    value = factors[-1]
    for factor in factors[-2::-1]:
        value = value * s + factor
    return value


def _over(side: PairSurface, corners: Array, x: Array, normal: Array) -> Array:
    """The place of the master point over each point of shape (m, q, d) along its normal, in [0, 1]."""
    at, start = np.full(x.shape[:2], 0.5), corners[:, :1]
    places = side.functions.polynomials(corners - start).transpose(1, 0, 2)[:, :, None]
    factors = _cross(places, normal)
    factors[0] -= _cross(x - start, normal)
    rates = factors[1:] * np.arange(1, len(factors))[:, None, None]
    for _ in range(_BISECTIONS):
        miss, slope = _powers(factors, at), _powers(rates, at)
        step = np.divide(miss, slope, out=np.zeros_like(miss), where=slope != 0)
        at = np.clip(at - step, 0.0, 1.0)
        if np.abs(step).max(initial=0.0) < ZERO_COMPONENT:
            break
    return at
