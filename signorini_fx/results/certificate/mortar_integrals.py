"""The independent check on the map of a linear pair of bodies: its integrals, evaluated anew.

Of the solver it takes which directions are across planes of symmetry, which another check tries.  The rest it
evaluates from the mesh and the problem: normals, who sees whom along which directions, the functions of the points,
which nodes carry a point and how these take over the functions of others, which facets supports hold, and the mean
rotations of both sides.  Matrices are tried on displacements of the nodes that have no pattern (Freivalds 1979), so
that no product of two functions is integrated: a wrong entry changes the products of its row, but for coincidences.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.results.certificate.held_distances import at_nodes
from signorini_fx.results.certificate.paired_claim import Claim
from signorini_fx.results.certificate.partner_points import PartnerPoints, SideFacets, partner_points, turned_ways
from signorini_fx.results.certificate.surface_quadrature import SurfaceQuadrature
from signorini_fx.results.certificate.taken_functions import (
    TakenFunctions,
    TestedNodes,
    carried_by_rings,
    spread,
)
from signorini_fx.tuned import NO_ARM, NO_FORCE, PARALLEL, SAME_DIRECTION, SINGULAR, ZERO_COMPONENT

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


def without_pattern(nodes: Numbers, dim: int) -> Array:
    """Displacements of nodes that have no pattern, by their global numbers, between one half and one in size, shape
    (n, d).
    """
    places = (nodes[:, None] * dim + np.arange(dim) + 1.0) * (np.sqrt(5.0) - 1.0) / 2.0
    parts = np.modf(places * np.sqrt(2.0) * 1e3)[0]
    return np.asarray(np.where(parts < 0.5, -0.5 - parts, parts))


@dataclass(frozen=True)
class MortarIntegrals:
    """Both sides of a pair, and points that see each other.

    Attributes:
        sides: slave and master.
        normals: unit normals at their nodes, of which there are none across planes of symmetry, shapes (N, d), (M, d).
        ways: directions in which points see each other, at the nodes of the slave, shape (N, d).
        points: those of some facets of the slave, on this rank.
        hats: whether the functions of points are hats, not dual ones.
        known: what ``tested`` has found last, by what was asked for.
    """

    sides: tuple[SideFacets, SideFacets]
    normals: tuple[Array, Array]
    ways: Array
    points: PartnerPoints
    hats: bool
    known: dict[Any, TestedSides] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, claim: Claim, evaluation: SurfaceQuadrature, reach: float) -> MortarIntegrals:
        """Those of the sides of a claim, with partners up to a distance; collective."""
        first = claim.space.dofmap.index_map.local_range[0]

        def directed(nodes: npt.NDArray[np.int32], vectors: Array) -> Array:
            return claim.in_planes(first + nodes.astype(np.int64), vectors)

        sides = (
            SideFacets.of(claim.space, claim.slave, claim.factor),
            SideFacets.of(claim.space, claim.master),
        )
        slave, master = sides
        own, opposite = (
            from_owners(evaluation.normals(facets, directed), side.nodes, claim.comm)
            for facets, side in zip((claim.slave, claim.master), sides, strict=True)
        )
        comm, count = claim.comm, len(slave.facets)
        chosen = np.arange(count * comm.rank // comm.size, count * (comm.rank + 1) // comm.size)
        flat = slave.dimension > 2
        points = partner_points(sides, None if flat else own, reach, chosen)
        hats = claim.bonded and len(slave.tests.places) < len(slave.functions.places)
        found = cls(sides, (own, opposite), own, points, hats)
        if claim.nominal:
            return found
        psi, sizes = found.functions(points, claim)
        taken = carried_by_rings(found._tested(points, sizes, np.zeros(len(own), dtype=bool), claim))
        means = [
            _summed(claim, psi @ np.einsum("rk,rkd->rd", side.functions.at(at), normals[side.facets[facets]]))
            for side, normals, facets, at in (
                (slave, own, points.facet, points.at),
                (master, opposite, points.over, points.place),
            )
        ]
        own_means, of_master = (taken.shares @ mean / (taken.shares @ sizes)[:, None] for mean in means)
        seen, reached = np.zeros_like(own), np.zeros(len(own), dtype=bool)
        seen[taken.nodes], reached[taken.nodes] = of_master, True
        ways = own - spread(slave.tested, seen, reached)
        ways[taken.nodes] = own_means - of_master
        ways = claim.in_planes(slave.nodes, ways)
        if turned_ways(slave, ways, own) > PARALLEL:
            points = partner_points(sides, ways, reach, chosen)
        return cls(sides, (own, opposite), ways, points, hats)

    def functions(self, points: PartnerPoints, claim: Claim) -> tuple[Any, Array]:
        """The functions of the nodes of the slave at points of this rank times their areas, scipy sparse, shape (N, r),
        and their integrals, shape (N,); collective.
        """
        slave = self.sides[0]
        values = slave.tests.at(points.at)
        if not self.hats:
            mass = np.zeros((len(slave.facets), values.shape[1], values.shape[1]))
            for i in range(values.shape[1]):
                for j in range(i + 1):
                    mass[:, i, j] = np.bincount(
                        points.facet, points.area * values[:, i] * values[:, j], minlength=len(mass)
                    )
                    mass[:, j, i] = mass[:, i, j]
            covered = np.unique(points.facet)
            duals = np.zeros_like(mass)
            # Where hardly anything is covered the functions are not independent.
            inverse = np.linalg.pinv(mass[covered], rcond=SINGULAR, hermitian=True)
            duals[covered] = mass[covered].sum(axis=2)[:, :, None] * inverse
            values = np.einsum("rij,rj->ri", duals[points.facet], values)
        psi = sp.csr_array(at_nodes(slave.tested[points.facet], values * points.area[:, None], len(slave.x)).T)
        return psi, _summed(claim, np.asarray(psi.sum(axis=1)).ravel())

    def tested(self, claim: Claim, loose: tuple[Array, Array], unable: Flags) -> TestedSides:
        """Where one side can move, the functions there, and who carries points; collective.

        Args:
            claim: what is claimed.
            loose: projectors onto the directions that supports leave at the nodes of both sides, shapes (N, d, d).
            unable: nodes of the slave that other contacts own, shape (N,).
        """
        (slave, master), points = self.sides, self.points
        held = along_normals(self.normals[0], loose[0]), along_normals(self.normals[1], loose[1])
        asked = (*(flags.tobytes() for flags in held), unable.tobytes())
        if asked in self.known:
            return self.known[asked]
        of_slave, of_master = slave.facets[points.facet], master.facets[points.over]
        still = held[0][of_slave].all(axis=1) & held[1][of_master].all(axis=1)
        moving = points.chosen(~still) if still.any() else points
        psi, sizes = self.functions(moving, claim)
        share: Array = np.ones(len(slave.x))
        if held[0].any() and held[1].any():
            free = np.sum(master.functions.at(moving.place) * ~held[1][master.facets[moving.over]], axis=1)
            of_free = _summed(claim, psi @ free)
            seen = np.divide(of_free, sizes, out=np.ones_like(sizes), where=sizes > 0.0)
            share = np.where(held[0], np.clip(seen, 0.0, 1.0), 1.0)
        taken = carried_by_rings(self._tested(moving, sizes, unable, claim, share))
        self.known.clear()
        self.known[asked] = TestedSides(held, moving, psi, sizes, taken)
        return self.known[asked]

    def _tested(
        self, points: PartnerPoints, seen: Array, unable: Flags, claim: Claim, share: Array | None = None
    ) -> TestedNodes:
        """See ``TestedNodes``; collective."""
        slave = self.sides[0]
        covered = np.unique(parallel.gather_rows(claim.comm, np.unique(points.facet)))
        share = np.ones(len(slave.x)) if share is None else share
        return TestedNodes(slave.tested[covered], slave.tested, slave.area, seen, unable | slave.without_area, share)


class TestedSides(NamedTuple):
    """Where one of two sides can move, with the functions of points.

    Attributes:
        held: nodes of both sides that supports hold along their normals.
        points: there, on this rank.
        psi: functions of the nodes of the slave at these, times their areas, scipy sparse, shape (N, r).
        sizes: their integrals, shape (N,).
        taken: which nodes carry points, and what these have of the functions of all.
    """

    held: tuple[Flags, Flags]
    points: PartnerPoints
    psi: Any
    sizes: Array
    taken: TakenFunctions


def error_of_integrals(claim: Claim, found: MortarIntegrals, tested: TestedSides) -> float:
    """How far what is claimed of the points is from what the integrals make it, relative to one, to weights, or of
    distances to the largest of them; collective.
    """
    (slave, master), points, taken, dim = found.sides, tested.points, tested.taken, found.sides[0].dimension
    names = claim.points + claim.space.dofmap.index_map.local_range[0]
    if not np.array_equal(np.sort(parallel.gather_rows(claim.comm, names)), slave.nodes[taken.nodes]):
        return 1.0
    nodes = slave.facets[points.facet], master.facets[points.over]
    hats = slave.functions.at(points.at), master.functions.at(points.place)
    moved = tuple(without_pattern(side.nodes, dim) for side in found.sides)
    columns = [
        np.einsum("rk,rkd->rd", part, values[facets])
        for part, facets, sides in zip(hats, nodes, ((slave.x, moved[0]), (master.x, moved[1])), strict=True)
        for values in sides
    ]
    integrals = _summed(claim, tested.psi @ np.hstack((columns[1], columns[3], columns[2] - columns[0])))
    weight = taken.shares @ tested.sizes
    own, opposite, distance = np.split(taken.shares @ integrals / weight[:, None], 3, axis=1)
    largest = max(float(np.abs(side.x).max(initial=0.0)) for side in found.sides)
    relative = own - opposite
    if claim.followed is None and np.abs(distance).max(initial=0.0) > ZERO_COMPONENT * largest:
        half = 0.0 if claim.nominal else 0.5
        for arms, side, values, part in zip(
            _arms(claim, found, points), found.sides, moved, (half, 1.0 - half), strict=True
        ):
            relative = relative + part * _turned(taken.shares @ arms, side.x, values, distance)
    at = np.searchsorted(slave.nodes[taken.nodes], names)
    of_reached = without_pattern(claim.reached, dim)
    expected = relative[at] - np.einsum("nij,nj->ni", claim.across, relative[at])
    errors = [
        claim.own @ of_reached - own[at],
        claim.others @ of_reached - opposite[at],
        (claim.operator @ of_reached.ravel()).reshape(-1, dim) - expected,
        claim.weight / weight[at] - 1.0,
    ]
    rounded = round_off(claim, tested, largest)[at]
    of_places = rounded / min(side.narrowest for side in found.sides)
    worst = max(float((np.abs(error).T - of_places).max(initial=0.0)) for error in errors)
    size = max(float(np.abs(distance).max(initial=0.0)), NO_FORCE * largest)
    apart = np.abs(claim.distance - distance[at]) - rounded[:, None]
    return parallel.global_max(claim.comm, max(worst, float(apart.max(initial=0.0)) / size))


def round_off(claim: Claim, tested: TestedSides, largest: float) -> Array:
    """Of mean distances between coordinates up to the largest one, length, shape (p,): functions of small parts of
    facets have large values of both signs, which multiply it; collective.
    """
    magnitudes = _summed(claim, np.asarray(abs(tested.psi).sum(axis=1)).ravel())
    weight = tested.taken.shares @ tested.sizes
    return np.asarray(ZERO_COMPONENT * largest * (tested.taken.shares @ magnitudes) / weight)


def _arms(claim: Claim, found: MortarIntegrals, points: PartnerPoints) -> list[Any]:
    """The areas over which the functions of the nodes of the slave see the nodes of both sides, scipy sparse, shapes
    (N, N) and (N, M); collective.
    """
    slave, master = found.sides
    pairs, number = np.unique(points.facet * len(master.facets) + points.over, return_inverse=True)
    area = np.bincount(number, points.area, minlength=len(pairs))
    rows = parallel.gather_rows(claim.comm, np.column_stack((*np.divmod(pairs, len(master.facets)), area)))
    facet, over = rows[:, :2].T.astype(np.int64)
    tests, listed = slave.tested[facet], []
    for nodes, count in ((slave.facets[facet], len(slave.x)), (master.facets[over], len(master.x))):
        shape = (*tests.shape, nodes.shape[1])
        entries = [
            np.broadcast_to(part, shape).ravel() for part in (rows[:, 2, None, None], tests[:, :, None], nodes[:, None])
        ]
        listed.append(sp.csr_array(sp.coo_array((entries[0], tuple(entries[1:])), shape=(len(slave.x), count))))
    return listed


def _turned(arms: Any, x: Array, u: Array, ways: Array) -> Array:
    """How the mean rotations of nodes with displacements u turn vectors, shape (n, d); ``arms``: weights of the nodes,
    scipy sparse, shape (n, N).
    """
    arms = sp.csr_array(arms)
    row, count = np.repeat(np.arange(arms.shape[0]), np.diff(arms.indptr)), arms.shape[0]
    total = np.bincount(row, arms.data, minlength=count)
    deep: list[Array] = []
    for values in (x, u, ways):
        padded = np.zeros((len(values), 3))
        padded[:, : values.shape[1]] = values
        deep.append(padded)
    positions, moved, along = deep
    arm = positions[arms.indices] - (arms @ positions / total[:, None])[row]
    remainder = [np.bincount(row, arms.data * part, minlength=count) / total for part in arm.T]
    arm = arm - np.column_stack(remainder)[row]  # round-off of the mean of coordinates far from the origin
    couple = np.cross(arm, arms.data[:, None] * moved[arms.indices])
    square = arms.data[:, None, None] * arm[:, :, None] * arm[:, None, :]
    couples: Array = np.zeros((count, 3))
    squares: Array = np.zeros((count, 3, 3))
    np.add.at(couples, row, couple)
    np.add.at(squares, row, square)
    inertia = np.trace(squares, axis1=1, axis2=2)[:, None, None] * np.eye(3) - squares
    turn = np.linalg.pinv(inertia, rcond=NO_ARM, hermitian=True) @ couples[..., None]
    return np.asarray(np.cross(turn[..., 0], along)[:, : x.shape[1]])


def along_normals(normals: Array, loose: Array) -> Flags:
    """Which nodes of a side supports hold along its normals, shape (N,)."""
    moving = np.linalg.norm(np.einsum("nij,nj->ni", loose, normals), axis=1)
    return np.asarray((moving <= SAME_DIRECTION) & normals.any(axis=1))


def _summed(claim: Claim, values: Array) -> Array:
    """Over all ranks."""
    return np.asarray(parallel.global_sum(claim.comm, values))
