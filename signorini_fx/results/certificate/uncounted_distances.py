"""The independent check on what the points of linear pairs leave out of distances that supports fix.

All of it is evaluated anew, from where both sides see each other and one of them can move (``mortar_integrals``):
places of nodes on the other side, and the distances there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.machine import parallel
from signorini_fx.results.certificate.held_distances import DisplacedSide, HeldDistances, held_distances
from signorini_fx.results.certificate.mortar_integrals import MortarIntegrals, TestedSides, round_off
from signorini_fx.results.certificate.paired_claim import Claim
from signorini_fx.results.certificate.partner_points import PartnerPoints, SideFacets
from signorini_fx.tuned import COMPLEX_STEP, NO_FORCE, SAME_PLACE_IN_CELL, ZERO_COMPONENT

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

# Steps of Newton's method to a place on a facet.
_STEPS = 20


def error_of_uncounted(claim: Claim, found: MortarIntegrals, tested: TestedSides, loose: tuple[Array, Array]) -> float:
    """How far what the solver says that points do not count is from what they should not, of the relative displacement
    relative to one, of distances relative to the largest of them; collective.

    Args:
        claim: what is claimed.
        found: where both sides see each other.
        tested: where one of them can move.
        loose: projectors onto the directions that supports leave at the nodes of slave and master, shapes (N, d, d).
    """
    pair, sides, held = claim.pair, found.sides, tested.held
    count, dim = sum(len(side.x) for side in sides), sides[0].dimension
    rows, of_slave = sp.csr_array((len(claim.points), dim * count)), sp.csr_array((len(claim.points), len(sides[0].x)))
    distances: Array = np.zeros(len(claim.points))
    largest = max(float(np.abs(side.x).max(initial=0.0)) for side in sides)
    rounded = ZERO_COMPONENT * largest * np.ones(len(claim.points))  # round-off of coordinates is no distance
    nodes_there = sides[0].facets[found.points.facet], sides[1].facets[found.points.over]
    both_held = held[0][nodes_there[0]].any(axis=1) & held[1][nodes_there[1]].any(axis=1)
    right, counted = rows, of_slave
    if parallel.any_rank(claim.comm, bool(both_held.any())):
        right, counted, of_all = _expected(claim, found, tested, loose)
        names = claim.points + claim.space.dofmap.index_map.local_range[0]
        at = np.searchsorted(sides[0].nodes[tested.taken.nodes], names)
        right, counted, distances = sp.csr_array(right[at]), sp.csr_array(counted[at]), of_all[at]
        rounded = round_off(claim, tested, largest)[at]
    coupling = pair.coupling
    if coupling.fixed is None:
        claimed, claimed_counts = rows, of_slave
    else:
        claimed = sp.csr_array(coupling.fixed_shares @ coupling.fixed.rows)
        claimed_counts = sp.csr_array(coupling.fixed_shares @ coupling.fixed.slave)
    worst = max(_largest(claimed - right), _largest(sp.csr_array(claimed_counts - counted)))
    sizes = float(np.abs([claim.uncounted, distances]).max(initial=0.0))
    sizes = parallel.global_max(claim.comm, max(sizes, NO_FORCE * largest))
    apart = float((np.abs(claim.uncounted - distances) - rounded).max(initial=0.0))
    worst = max(worst, apart / sizes)
    columns = sp.vstack((pair.slave.columns(claim.reached), pair.master.columns(claim.reached)))
    beyond = np.repeat(np.asarray(columns.sum(axis=1)).ravel() == 0.0, dim)  # nodes that points are not made of
    worst = max(worst, _largest(sp.csr_array(right[:, np.flatnonzero(beyond)])))
    inward = _along(coupling.normal) @ right @ sp.kron(columns, sp.eye_array(dim))
    moved = sp.csr_array(inward.shape) if claim.fixed_part is None else claim.fixed_part
    return parallel.global_max(claim.comm, max(worst, _largest(sp.csr_array(moved - inward))))


def _expected(
    claim: Claim, found: MortarIntegrals, tested: TestedSides, loose: tuple[Array, Array]
) -> tuple[Any, Any, Array]:
    """What the p points do not count of displacements of the nodes of both sides, slave first, scipy sparse, shape (p,
    d (N + M)), of what is given at the nodes of the slave, shape (p, N), and of the distance, length, shape (p,);
    collective.
    """
    slave, master = found.sides
    partners = np.unique(np.column_stack((found.points.facet, found.points.over)), axis=0)
    partners = parallel.gather_rows(claim.comm, partners)
    # All ranks look at all points.
    along, moving = slave.dimension - 1, tested.points
    columns = (moving.facet, moving.at, moving.over, moving.place, moving.area)
    rows = parallel.gather_rows(claim.comm, np.column_stack(columns))
    numbers = rows[:, [0, 1 + along]].astype(np.int64)
    rays = numbers[:, 0], rows[:, 1 : 1 + along], numbers[:, 1], rows[:, 2 + along : -1], rows[:, -1]
    psi = tested.psi if claim.comm.size == 1 else found.functions(PartnerPoints(*rays), claim)[0]
    sides = tuple(
        DisplacedSide(side.facets, side.x, None, None, flags, projectors, side.functions.at)
        for side, flags, projectors in zip(found.sides, tested.held, loose, strict=True)
    )
    ways = np.array(found.ways)
    ways[slave.facets] = slave.tests.at(slave.functions.places) @ found.ways[slave.tested]
    fixed = held_distances((sides[0], sides[1]), ways, (partners[:, 0], partners[:, 1]), rays, _seeing(slave, master))
    taken = tested.taken
    of_points = sp.diags_array(1.0 / (taken.shares @ tested.sizes)) @ taken.shares @ (psi @ fixed.at_rays)
    distances = np.asarray(of_points @ fixed.distance(slave.x, master.x))
    return sp.csr_array(of_points @ _from_positions(fixed)), sp.csr_array(of_points @ fixed.slave), distances


def _seeing(slave: SideFacets, master: SideFacets) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """See ``held_distances``."""

    def over(facets: Array, points: Array, ways: Array) -> tuple[Array, Flags]:
        def missed(at: Any, far: Any) -> Any:
            return np.einsum("mk,mkd->md", master.functions.at(at), facets) - points - far[:, None] * ways

        return _root(master, missed, len(facets))

    def under(facets: Array, ways: Array, points: Array) -> tuple[Array, Flags]:
        def missed(at: Any, far: Any) -> Any:
            ray = facets + far[:, None, None] * ways
            return np.einsum("mk,mkd->md", slave.functions.at(at), ray) - points

        return _root(slave, missed, len(facets))

    return over, under


def _root(side: SideFacets, missed: Callable[[Any, Any], Any], count: int) -> tuple[Array, Flags]:
    """Places on facets of a side at which nothing is missed, shape (m, d - 1), and whether they are on the facets.

    Args:
        side: of the facets.
        missed: from places and distances, of complex numbers, too, shape (m, d).
        count: m.
    """
    along = side.dimension - 1
    unknowns = np.column_stack((np.tile(side.functions.places.mean(axis=0), (count, 1)), np.zeros(count)))
    change = np.full(unknowns.shape, np.inf)
    for _ in range(_STEPS):
        slopes: Array = np.zeros((count, along + 1, along + 1))
        for k in range(along + 1):
            stepped = unknowns.astype(np.complex128)
            stepped[:, k] += 1j * COMPLEX_STEP
            slopes[:, :, k] = missed(stepped[:, :along], stepped[:, along]).imag / COMPLEX_STEP
        value = missed(unknowns[:, :along], unknowns[:, along])
        regular = np.linalg.cond(slopes) < 1.0 / np.finfo(float).eps
        change[regular] = -np.linalg.solve(slopes[regular], value[regular][..., None])[..., 0]
        far_off = np.maximum(1.0, np.abs(change[:, :along]).max(axis=1))
        change[regular] /= far_off[regular, None]
        unknowns[regular] += change[regular]
    settled = (np.abs(change[:, :along]) <= SAME_PLACE_IN_CELL).all(axis=1)
    at = unknowns[:, :along]
    highest = at.sum(axis=1) if side.functions.simplex else at.max(axis=1)
    return at, settled & (at.min(axis=1) >= -SAME_PLACE_IN_CELL) & (highest <= 1.0 + SAME_PLACE_IN_CELL)


def _from_positions(fixed: HeldDistances) -> Any:
    """Changes of distances from displacements of the nodes of both sides, slave first, scipy sparse, shape (k, d (N +
    M)).
    """
    moved = sp.kron(sp.hstack((-fixed.slave, fixed.master)), sp.eye_array(fixed.ways.shape[1]))
    return _along(fixed.ways).T @ moved + fixed.turning


def _along(vectors: Array) -> Any:
    """Vectors times numbers, one for each, scipy sparse, shape (n d, n)."""
    count, dim = vectors.shape
    places = np.arange(count * dim), np.repeat(np.arange(count), dim)
    return sp.csr_array(sp.coo_array((vectors.ravel(), places), shape=(count * dim, count)))


def _largest(matrix: Any) -> float:
    """The largest magnitude of a sparse matrix."""
    return float(np.max(np.abs(matrix.data), initial=0.0))
