"""The second opinion on what the points of linear pairs leave out of distances that supports fix.

Of the solver it takes where both sides lie over each other, along which directions, and which nodes other contacts
own.  The rest it evaluates itself: which nodes supports hold and where nothing can move, the dual functions, which
nodes carry a point and how these take over the functions of others, places of nodes on the other side, and the
distances there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.machine import parallel
from signorini_fx.mechanics.pairs.overlap_quadrature import Overlap
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.results.certificate.held_distances import DisplacedSide, HeldDistances, at_nodes, held_distances
from signorini_fx.results.certificate.paired_claim import Claim
from signorini_fx.results.certificate.taken_functions import TestedNodes, carried_by_rings, movable
from signorini_fx.tuned import NO_FORCE, SAME_DIRECTION, SAME_PLACE_IN_CELL, ZERO_COMPONENT

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

# Steps of Newton's method to a place on a facet, and of complex steps, which have no differences in them.
_STEPS, _STEP = 20, 1e-30


class _Places(NamedTuple):
    """Points of the overlap, r of them, on all ranks.

    Attributes:
        facet, over: of slave and master, shape (r,).
        at, place: on these, shape (r, d - 1).
        area: of the slave, times its measure, shape (r,).
    """

    facet: Numbers
    at: Array
    over: Numbers
    place: Array
    area: Array

    @classmethod
    def of(cls, claim: Claim) -> _Places:
        """All of a claim, also those where it says that nothing can move; collective."""
        coupling, parts = claim.pair.coupling, []
        for overlap in (coupling.overlap, coupling.still):
            parts.append(_rows(overlap, claim.pair.slave.surface.dimension - 1))
        rows = parallel.gather_rows(claim.comm, np.concatenate(parts))
        along = claim.pair.slave.surface.dimension - 1
        numbers = rows[:, :2].astype(np.int64)
        return cls(numbers[:, 0], rows[:, 2 : 2 + along], numbers[:, 1], rows[:, 2 + along : -1], rows[:, -1])

    def chosen(self, points: Flags) -> _Places:
        """Some of them."""
        return _Places(self.facet[points], self.at[points], self.over[points], self.place[points], self.area[points])


def error_of_uncounted(claim: Claim, loose: tuple[Array, Array]) -> float:
    """How far what the solver says that points do not count is from what they should not, of the relative displacement
    relative to one, of distances relative to the largest of them; collective.

    Args:
        claim: what is claimed.
        loose: projectors onto the directions that supports leave at the nodes of slave and master, shapes (N, d, d).
    """
    pair = claim.pair
    surfaces = pair.slave.surface, pair.master.surface
    held = _along_normals(surfaces[0], loose[0]), _along_normals(surfaces[1], loose[1])
    expected, count = None, sum(len(surface.x) for surface in surfaces)
    if held[0].any() and held[1].any():
        seen = _Places.of(claim)
        nodes_there = surfaces[0].nodes[seen.facet], surfaces[1].nodes[seen.over]
        both_held = held[0][nodes_there[0]].any(axis=1) & held[1][nodes_there[1]].any(axis=1)
        expected = _expected(claim, loose, held, seen) if both_held.any() else None
    coupling, dim = pair.coupling, surfaces[0].dimension
    rows = sp.csr_array((len(coupling.normal), dim * count))
    distances: Array = np.zeros(len(coupling.normal))
    if expected is None:
        right = rows
    else:
        nodes, right, of_all = expected
        names = pair.slave.nodes[coupling.nodes]
        at = np.searchsorted(pair.slave.nodes[nodes], names)
        carriers = parallel.gather_rows(claim.comm, names)
        if not np.array_equal(np.sort(carriers), pair.slave.nodes[nodes]):
            return 1.0
        right, distances = sp.csr_array(right[at]), of_all[at]
    claimed = rows if coupling.fixed is None else sp.csr_array(coupling.fixed_shares @ coupling.fixed.rows)
    worst = _largest(claimed - right)
    # Round-off of coordinates is no distance.
    largest = max(float(np.abs(surface.x).max(initial=0.0)) for surface in surfaces)
    sizes = float(np.abs([claim.uncounted, distances]).max(initial=0.0))
    sizes = parallel.global_max(claim.comm, max(sizes, NO_FORCE * largest))
    apart = float(np.abs(claim.uncounted - distances).max(initial=0.0))
    worst = max(worst, (apart - ZERO_COMPONENT * largest) / sizes)
    columns = sp.vstack((pair.slave.columns(claim.reached), pair.master.columns(claim.reached)))
    beyond = np.repeat(np.asarray(columns.sum(axis=1)).ravel() == 0.0, dim)  # nodes that points are not made of
    worst = max(worst, _largest(sp.csr_array(right[:, np.flatnonzero(beyond)])))
    inward = _along(coupling.normal) @ right @ sp.kron(columns, sp.eye_array(dim))
    moved = sp.csr_array(inward.shape) if claim.fixed_part is None else claim.fixed_part
    return max(worst, _largest(sp.csr_array(moved - inward)))


def _expected(
    claim: Claim, loose: tuple[Array, Array], held: tuple[Flags, Flags], seen: _Places
) -> tuple[Numbers, Any, Array]:
    """Nodes of the slave that carry points, ascending, shape (p,), what these do not count of displacements of the
    nodes of both sides, slave first, scipy sparse, shape (p, d (N + M)), and of the distance, length, shape (p,).
    """
    slave, master = claim.pair.slave.surface, claim.pair.master.surface
    still = held[0][slave.nodes[seen.facet]].all(axis=1) & held[1][master.nodes[seen.over]].all(axis=1)
    partners = seen.facet, seen.over
    moving = seen.chosen(np.asarray(~still))
    psi, areas = _functions(claim, moving)
    over = at_nodes(master.nodes[moving.over], master.functions.values(moving.place), len(master.x))
    unable, facets = claim.unable | slave.without_area, slave.points[np.unique(moving.facet)]
    nodes = TestedNodes(facets, slave.points, slave.area, areas, unable, movable(held, sp.csr_array(psi @ over)))
    taken = carried_by_rings(nodes)
    ways = _ways(claim)
    sides = tuple(
        DisplacedSide(surface.nodes, surface.x, None, None, flags, projectors, surface.functions.values)
        for surface, flags, projectors in zip((slave, master), held, loose, strict=True)
    )
    rays = moving.facet, moving.at, moving.over, moving.place, moving.area
    fixed = held_distances((sides[0], sides[1]), ways, partners, rays, _seeing(slave, master))
    of_points = sp.diags_array(1.0 / (taken.shares @ areas)) @ taken.shares @ (psi @ fixed.at_rays)
    return taken.nodes, sp.csr_array(of_points @ _from_positions(fixed)), of_points @ fixed.distance(slave.x, master.x)


def _functions(claim: Claim, seen: _Places) -> tuple[Any, Array]:
    """The functions of the nodes of the slave at points times their areas, scipy sparse, shape (N, r), and their
    integrals, shape (N,).
    """
    slave = claim.pair.slave.surface
    values = slave.tests.values(seen.at)
    if not claim.pair.coupling.hats:
        mass = np.zeros((len(slave.nodes), values.shape[1], values.shape[1]))
        np.add.at(mass, seen.facet, seen.area[:, None, None] * values[:, :, None] * values[:, None, :])
        covered = np.unique(seen.facet)
        duals = np.zeros_like(mass)
        # Where hardly anything is covered the functions are not independent.
        inverse = np.linalg.pinv(mass[covered], rcond=1e-10, hermitian=True)
        duals[covered] = mass[covered].sum(axis=2)[:, :, None] * inverse
        values = np.einsum("rij,rj->ri", duals[seen.facet], values)
    psi = at_nodes(slave.points[seen.facet], values * seen.area[:, None], len(slave.x)).T
    return sp.csr_array(psi), np.asarray(psi.sum(axis=1)).ravel()


def _ways(claim: Claim) -> Array:
    """Directions of projection at all nodes of the slave, which its functions interpolate, shape (N, d)."""
    slave, directions = claim.pair.slave.surface, claim.pair.coupling.directions
    directions = slave.nodal_normals if directions is None else directions
    ways = np.array(directions)
    at_nodes = slave.tests.values(slave.functions.places) @ directions[slave.points]
    ways[slave.nodes] = at_nodes
    return ways


def _seeing(slave: PairSurface, master: PairSurface) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """See ``held_distances``."""

    def over(facets: Array, points: Array, ways: Array) -> tuple[Array, Flags]:
        def missed(at: Any, far: Any) -> Any:
            return np.einsum("mk,mkd->md", master.functions.values(at), facets) - points - far[:, None] * ways

        return _root(master, missed, len(facets))

    def under(facets: Array, ways: Array, points: Array) -> tuple[Array, Flags]:
        def missed(at: Any, far: Any) -> Any:
            ray = facets + far[:, None, None] * ways
            return np.einsum("mk,mkd->md", slave.functions.values(at), ray) - points

        return _root(slave, missed, len(facets))

    return over, under


def _root(side: PairSurface, missed: Callable[[Any, Any], Any], count: int) -> tuple[Array, Flags]:
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
            stepped[:, k] += 1j * _STEP
            slopes[:, :, k] = missed(stepped[:, :along], stepped[:, along]).imag / _STEP
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


def _along_normals(surface: PairSurface, loose: Array) -> Flags:
    """Which nodes of a side supports hold along its normals, shape (N,)."""
    normals = surface.directions
    moving = np.linalg.norm(np.einsum("nij,nj->ni", loose, normals), axis=1)
    return np.asarray((moving <= SAME_DIRECTION) & normals.any(axis=1))


def _rows(overlap: Overlap, along: int) -> Array:
    """Both facets, both places and the area of each point, shape (r, 3 + 2 along)."""
    count = overlap.weight.shape[1]
    facets = np.repeat(np.column_stack((overlap.slave, overlap.master)), count, axis=0)
    places = (at.reshape(-1, along) for at in (overlap.at, overlap.over))
    return np.column_stack((facets, *places, overlap.weight.ravel()))


def _largest(matrix: Any) -> float:
    """The largest magnitude of a sparse matrix."""
    return float(np.max(np.abs(matrix.data), initial=0.0))
