"""The independent check on two sides in 3D that slide on each other, at displaced points, by code of its own.

What the solver says of the undeformed sides is tried by ``undeformed_sides``.  What is done otherwise here:
- who carries a point, and how points take over functions, is evaluated anew (``taken_functions``),
- facets that may see each other are looked for along lines through the middles of facets, in a tree of the others',
- the polygon that two facets share is made of corners of the one inside the other, and of where their edges cross,
- places on quadrilaterals are roots of quadratic equations, and each triangle of a polygon has a square of points,
- derivatives of distances are taken by complex steps, and the rotation around a node is that of a pseudo-inverse, or of
  a quaternion,
- slips are evaluated from the displacements of both ends of the step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities, node_positions
from signorini_fx.results.certificate.common_polygons import (
    common_polygons,
    near_lines,
    places_in_polygons,
    polygon_areas,
    triangle_rule,
)
from signorini_fx.results.certificate.sliding_claim import (
    POINTS_OF_AREAS,
    BoundaryPolyline,
    LookedAt,
    Rays,
    SeenSides,
    SlidingClaim,
)
from signorini_fx.results.certificate.taken_functions import times_rows
from signorini_fx.tuned import COMPLEX_STEP, FACING_SIDES, NO_PART, SAME_LENGTH, SAME_PLACE_IN_CELL

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]

# Points along each side of a square, from which those of a triangle are made: on triangles products of two linear
# functions are integrated, on quadrilaterals what is rational.
_POINTS = {3: 3, 4: 5}
# How often the way to a place is taken at the place that it leads to.
_REPEATED = 40
# How many facets, and how many rays, are looked at together, for memory.
_FACETS_AT_ONCE, _RAYS_AT_ONCE = 1024, 65536


def _unit(vectors: Any) -> Any:
    """Along the last axis, complex numbers as if they were real."""
    return vectors / np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True))


def _hats(at: Any, count: int) -> Any:
    """The functions of the corners around a facet at places, shape (..., 2)."""
    s, t = at[..., 0], at[..., 1]
    if count == 3:
        return np.stack((1 - s - t, s, t), axis=-1)
    return np.stack(((1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t), axis=-1)


def _slopes(at: Any, count: int) -> Any:
    """Their derivatives, shape (2, ..., count)."""
    s, t = at[..., 0], at[..., 1]
    ones = np.ones_like(s)
    if count == 3:
        return np.stack((np.stack((-ones, ones, 0 * s), axis=-1), np.stack((-ones, 0 * s, ones), axis=-1)))
    return np.stack((np.stack((t - 1, 1 - t, t, -t), axis=-1), np.stack((s - 1, -s, s, 1 - s), axis=-1)))


@dataclass(frozen=True)
class Sheet(BoundaryPolyline):
    """Facets in 3D, corners around each so that the body is behind them, see ``BoundaryPolyline``."""

    @classmethod
    def of(cls, space: fem.FunctionSpace, facets: npt.NDArray[np.int32], factor: Array | None = None) -> Sheet:
        """See ``BoundaryPolyline``."""
        mesh, dofmap = space.mesh, space.dofmap
        positions, listed = node_positions(space)[:, :3], []
        for cell, number in facet_entities(mesh, facets):
            cell_nodes = dofmap.list[cell]
            corners = cell_nodes[np.array(dofmap.dof_layout.entity_closure_dofs(2, int(number)))]
            if corners.size == 4:
                corners = corners[[0, 1, 3, 2]]
            first, last = positions[corners[1]] - positions[corners[0]], positions[corners[-1]] - positions[corners[0]]
            inside = positions[cell_nodes].mean(axis=0) - positions[corners[0]]
            listed.append(corners if np.cross(first, last) @ inside < 0 else corners[::-1])
        count = 3 if mesh.topology.cell_name() == "tetrahedron" else 4
        local = np.array(listed, dtype=np.int32).reshape(-1, count)
        names = parallel.gather_rows(mesh.comm, dofmap.index_map.local_to_global(local.ravel()).reshape(-1, count))
        places = parallel.gather_rows(mesh.comm, np.asarray(positions[local], dtype=np.float64).reshape(-1, 3 * count))
        nodes, first_rows, numbers = np.unique(names, return_index=True, return_inverse=True)
        measure = np.ones(nodes.size)
        if factor is not None:
            rows = parallel.gather_rows(mesh.comm, np.asarray(factor[local], dtype=np.float64).reshape(-1, count))
            measure = rows.ravel()[first_rows]
        x = places.reshape(-1, 3)[first_rows]
        return cls(nodes.astype(np.int64), x, numbers.reshape(names.shape).astype(np.int64), measure)

    def facing(self, x: Array) -> Array:
        """The outward normal in the middle of each facet, of length one, shape (f, 3)."""
        corners = x[self.facets]
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        if self.width == 4:
            first, second = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        return np.asarray(_unit(np.cross(first, second)))

    def normals(self, x: Array) -> Array:
        """See ``BoundaryPolyline``, shape (N, 3); not of length one."""
        sums, corners = np.zeros_like(x), x[self.facets]
        if self.width == 3:
            np.add.at(sums, self.facets, np.repeat(self.facing_areas(x)[:, None], 3, axis=1))
            return sums
        places, weights = np.polynomial.legendre.leggauss(2)
        for s, of_s in zip(places, weights, strict=True):
            for t, of_t in zip(places, weights, strict=True):
                at = (np.array([s, t]) + 1) / 2
                along = np.einsum("ak,fkd->afd", _slopes(at, 4), corners)
                normal = np.cross(along[0], along[1]) * of_s * of_t / 4
                np.add.at(sums, self.facets, _hats(at, 4)[None, :, None] * normal[:, None])
        return sums

    def facing_areas(self, x: Array) -> Array:
        """Normals of triangles times their areas, shape (f, 3)."""
        corners = x[self.facets]
        return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2)

    @property
    def quadratic(self) -> bool:
        """See ``BoundaryPolyline``."""
        return False

    @cached_property
    def areas(self) -> Array:
        """Undeformed, times the measure, shape (f,)."""
        return np.asarray(self._tested_areas.sum(axis=1))

    @cached_property
    def nodal_areas(self) -> Array:
        """See ``BoundaryPolyline``."""
        return self._summed_at_nodes(self._tested_areas)

    @cached_property
    def _tested_areas(self) -> Array:
        """Integrals of the functions of the corners of each facet times the measure, shape (f, k)."""
        points, weights = np.polynomial.legendre.leggauss(POINTS_OF_AREAS)
        s, t = (grid.ravel() for grid in np.meshgrid((points + 1) / 2, (points + 1) / 2, indexing="ij"))
        at, factors = np.column_stack((s, t)), np.outer(weights, weights).ravel() / 4
        if self.width == 3:
            at, factors = triangle_rule(3)
        along, hats = np.einsum("aqk,fkd->afqd", _slopes(at, self.width), self.x[self.facets]), _hats(at, self.width)
        size = np.linalg.norm(np.cross(along[0], along[1]), axis=2)
        return np.asarray((size * factors * (self.measure[self.facets] @ hats.T)) @ hats)


def _rays(slave: Sheet, x: Array, ways: Array, master: Sheet, y: Array, reach: float) -> Rays:
    """All pairs of points that see each other along directions of the facets of the slave, of length one, shape (f, 3);
    the nodes of both sides are at x and y.
    """
    rule = triangle_rule(_POINTS[max(slave.width, master.width)])
    both = x[slave.facets], y[master.facets]
    middles = [corners.mean(axis=1) for corners in both]
    sizes = [
        np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        for corners, middle in zip(both, middles, strict=True)
    ]
    tree, outward, facing = cKDTree(middles[1]), slave.facing(x), master.facing(y)
    parts = [_none()]
    for first in range(0, len(slave.facets), _FACETS_AT_ONCE):
        chosen = np.arange(first, min(first + _FACETS_AT_ONCE, len(slave.facets)))
        number, over = near_lines(middles[0][chosen], ways[chosen], tree, sizes[0][chosen] + sizes[1].max(), reach)
        number = chosen[number]
        faces = np.einsum("md,md->m", facing[over], outward[number]) < FACING_SIDES
        parts.append(_seen_from_facets(slave, both, ways, (number[faces], over[faces]), rule, reach))
    facet, at, over, place, distance, area = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Rays(facet, at, over, place, distance, area)


def _none() -> tuple[Any, ...]:
    """What ``_seen_from_facets`` finds of no pairs."""
    numbers, places, values = np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros(0)
    return numbers, places, numbers, places, values, values


def _seen_from_facets(
    slave: Sheet,
    corners: tuple[Array, Array],
    ways: Array,
    pairs: tuple[Numbers, Numbers],
    rule: tuple[Array, Array],
    reach: float,
) -> tuple[Any, ...]:
    """The points of pairs of facets that see each other: numbers and places of both, distances and areas, see ``Rays``.

    Args:
        slave: the side with the points.
        corners: of the facets of both sides, shapes (f, k, 3) and (g, l, 3).
        ways: see ``_rays``.
        pairs: the facets of both sides, in order, shape (m,) each.
        rule: points of a triangle, and their weights.
        reach: distance beyond which facets are no partners, length.
    """
    (points, weights), (number, over), (slave_corners, opposite) = rule, pairs, corners
    middle, first = slave_corners.mean(axis=1), np.eye(3)[np.abs(ways).argmin(axis=1)]
    first = _unit(np.cross(ways, first))
    axes = np.stack((first, np.cross(ways, first)), axis=1)
    flat = np.einsum("fkd,fad->fka", slave_corners - middle[:, None], axes)
    size = polygon_areas(flat, np.full(len(flat), flat.shape[1]))
    over_flat = np.einsum("mkd,mad->mka", opposite[over] - middle[number][:, None], axes[number])
    near = (over_flat.min(axis=1) <= flat.max(axis=1)[number]).all(axis=1)
    near &= (over_flat.max(axis=1) >= flat.min(axis=1)[number]).all(axis=1)
    number, over, over_flat = number[near], over[near], over_flat[near]
    polygons, count = common_polygons(flat[number], over_flat[:, ::-1])
    large = polygon_areas(polygons, count) > NO_PART * size[number]
    number, over, over_flat = number[large], over[large], over_flat[large]
    polygons, count = polygons[large], count[large]
    if not number.size:
        return _none()
    # A fan of triangles around the first corner of each.
    pair, k = np.nonzero(np.arange(1, polygons.shape[1] - 1) < (count - 1)[:, None])
    start, arms = polygons[pair, 0], [polygons[pair, k + end] - polygons[pair, 0] for end in (1, 2)]
    double = arms[0][:, 0] * arms[1][:, 1] - arms[0][:, 1] * arms[1][:, 0]
    p = start[:, None] + points[:, :1] * arms[0][:, None] + points[:, 1:] * arms[1][:, None]
    p, pair = p.reshape(-1, 2), np.repeat(pair, len(points))
    facet = number[pair]
    at, place = places_in_polygons(flat[facet], p), places_in_polygons(over_flat[pair], p)
    slopes = _slopes(at, slave.width)
    image = np.einsum("ark,rkd->ard", slopes, flat[facet])
    ratio = np.abs(image[0, :, 0] * image[1, :, 1] - image[0, :, 1] * image[1, :, 0])
    stretched = np.einsum("ark,rkd->ard", slopes, slave.x[slave.facets[facet]])
    undeformed = np.linalg.norm(np.cross(stretched[0], stretched[1]), axis=1)
    hats = _hats(at, slave.width)
    area = (double[:, None] * weights).ravel() * undeformed / ratio
    area = area * np.sum(hats * slave.measure[slave.facets[facet]], axis=1)
    apart = np.einsum("rk,rkd->rd", _hats(place, opposite.shape[1]), opposite[over[pair]])
    apart = apart - np.einsum("rk,rkd->rd", hats, slave_corners[facet])
    means = np.stack([np.bincount(pair, area * part) for part in apart.T], axis=1) / np.bincount(pair, area)[:, None]
    seen = np.flatnonzero(np.linalg.norm(means, axis=1)[pair] <= (1.0 + SAME_LENGTH) * reach)
    distance = np.sum(apart * ways[facet], axis=1)
    return facet[seen], at[seen], over[pair][seen], place[seen], distance[seen], area[seen]


@dataclass(frozen=True)
class SpaceSlidingClaim(SlidingClaim):
    """A pair of sides in 3D as the certificate sees it, see ``SlidingClaim``."""

    kind_of_chain: ClassVar[type[BoundaryPolyline]] = Sheet

    @cached_property
    def _sheets(self) -> tuple[Sheet, Sheet]:
        slave, master = self.chains
        assert isinstance(slave, Sheet)
        assert isinstance(master, Sheet)
        return slave, master

    def relative(self, owned: Array) -> Array:
        """See ``SlidingClaim``, from displacements of shape (owned nodes, 3), shape (n, 3)."""
        values = from_owners(owned, np.concatenate([chain.nodes for chain in self.chains]), self.comm)
        end_number = next((k for k, end in enumerate(self.ends) if np.array_equal(values, end)), None)
        seen = (self.present, self._begun)[end_number] if end_number is not None else self._seen(values)
        begun, (sharing, opposite) = self._begun, self._met_since(seen)
        tangents = self._tangents(seen)
        start = np.where(begun.partnered[:, None, None], self._tangents(begun), tangents)
        way = np.einsum("ndk,nd->nk", tangents, sharing @ seen.x - opposite @ seen.y)
        way -= np.einsum("ndk,nd->nk", start, sharing @ begun.x - opposite @ begun.y)
        slip = np.where(seen.partnered[:, None], np.einsum("ndk,nk->nd", tangents, way), 0.0)[self._mine]
        slip -= np.einsum("nij,nj->ni", self.across, slip)
        return np.asarray(slip - seen.gap[self._mine, None] * self.present.normal[self._mine])

    def _tangents(self, seen: SeenSides) -> Array:
        """Those of the points, which turn with the facets of the slave around their nodes, and with the least rotation
        from the normal of these, shape (p, 3, 2).
        """
        slave, count = self._sheets[0], self.carriers.size
        normal = self.surface.in_planes(slave.normals(slave.x), np.arange(len(slave.x)))[self.carriers]
        around = self._around[self.carriers]
        row = np.repeat(np.arange(count), np.diff(around.indptr))
        arms, undeformed = (x[around.indices] - x[self.carriers[row]] for x in (seen.x, slave.x))
        turned = _rotations_of(arms, undeformed, around.data, row, count)
        first = _unit(np.cross(normal, np.eye(3)[np.abs(normal).argmax(axis=1) - 1]))
        pair = np.stack((first, np.cross(normal, first)), axis=1)
        normal, pair = turned.apply(normal), np.stack([turned.apply(pair[:, k]) for k in range(2)], axis=1)
        axis = np.cross(normal, seen.normal)
        size = np.linalg.norm(axis, axis=1)
        angle = np.arctan2(size, np.sum(normal * seen.normal, axis=1))
        least = Rotation.from_rotvec(np.divide(angle, size, out=np.zeros(count), where=size > 0)[:, None] * axis)
        return np.stack([least.apply(pair[:, k]) for k in range(2)], axis=2)

    @cached_property
    def _around(self) -> Any:
        """The areas of the facets around each node that are around others, too, or around itself, scipy sparse, shape
        (N, N).
        """
        slave, count = self._sheets[0], self._sheets[0].nodes.size
        rows, columns = np.repeat(slave.facets, slave.width, axis=1), np.tile(slave.facets, (1, slave.width))
        areas = np.repeat(slave.areas, slave.width**2)
        return sp.csr_array(sp.coo_array((areas, (rows.ravel(), columns.ravel())), shape=(count, count)))

    def forces(self, traction: Array, owned: int) -> tuple[Numbers, Array, Array]:
        """See ``Claim``; collective."""
        seen, (slave, master) = self.present, self._sheets
        count, names = slave.nodes.size, np.concatenate([chain.nodes for chain in self.chains])
        rows = np.zeros((owned, 3))
        rows[self.points] = traction
        gathered = from_owners(rows, slave.nodes[self.carriers], self.comm)
        pressure = np.where(seen.partnered, np.sum(gathered * seen.normal, axis=1), 0.0)
        along = gathered - np.sum(gathered * seen.normal, axis=1)[:, None] * seen.normal
        drag = (seen.weight * seen.partnered)[:, None] * along
        forces = np.zeros((names.size, 3))
        pressures, couples = seen.functions.T @ pressure, np.zeros((count, 3))
        middle = _hats(np.full(2, 1 / 3 if slave.width == 3 else 1 / 2), slave.width)
        for part, by_slave, by_master, turn in self._derivatives():
            pushing = -pressures[part, None]
            facets = slave.facets[seen.rays.facet[part]]
            np.add.at(forces, facets, pushing[..., None] * by_slave)
            np.add.at(forces, count + master.facets[seen.rays.over[part]], pushing[..., None] * by_master)
            for column, share in zip(facets.T, middle, strict=True):
                np.add.at(couples, column, share * np.cross(seen.ways[column], pushing * turn))
        nodes, around, rotations = self._rotations
        turned = np.einsum("na,naki->nki", couples[nodes], rotations)
        np.add.at(forces, around, turned)
        forces[:count] += seen.sharing.T @ drag
        forces[count:] -= seen.opposite.T @ drag
        self._add_couples(forces, drag)
        area = np.concatenate((abs(seen.sharing).T @ seen.weight, abs(seen.opposite).T @ seen.weight))
        # What turns directions acts on the neighbours of points, too.
        area[:count] = np.maximum(area[:count], 0.5 * (forces[:count].any(axis=1)) * self.surface.area)
        first, last = self.space.dofmap.index_map.local_range
        local = np.flatnonzero((names >= first) & (names < last) & (area > 0))
        return names[local] - first, forces[local], area[local]

    def error(self) -> float:
        """See ``SlidingClaim``."""
        seen, (slave, master) = self.present, self._sheets
        if not seen.partnered.any():
            return 0.0
        errors = [
            float(np.max(np.abs(matrix[seen.partnered].sum(axis=1) - 1.0))) for matrix in (seen.sharing, seen.opposite)
        ]
        middle, size = seen.x.mean(axis=0), float(np.ptp(seen.x, axis=0).max())
        shares = _hats(np.full(2, 1 / 3 if slave.width == 3 else 1 / 2), slave.width)
        for part, by_slave, by_master, turn in self._derivatives():
            facets, over = slave.facets[seen.rays.facet[part]], master.facets[seen.rays.over[part]]
            errors.append(float(np.max(np.abs(by_slave.sum(axis=1) + by_master.sum(axis=1)))))
            moments = np.cross(seen.x[facets] - middle, by_slave).sum(axis=1)
            moments += np.cross(seen.y[over] - middle, by_master).sum(axis=1)
            sums = np.einsum("k,rkd->rd", shares, seen.ways[facets])
            errors.append(float(np.max(np.abs(moments + np.cross(sums, turn)))) / size)
        _, around, rotations = self._rotations
        as_one = np.einsum("naki,nkib->nab", rotations, _turns(seen.x[around] - middle))
        errors.append(float(np.max(np.abs(as_one - np.eye(3)))))
        return parallel.global_max(self.comm, max(errors))

    # --- at one displacement ---

    def _looked(self, values: Array, of_places: Array | None = None) -> LookedAt:
        """See ``SlidingClaim``."""
        slave, master = self._sheets
        count = slave.nodes.size
        x, y = slave.x + values[:count], master.x + values[count:]
        side = self.surface.displaced(values[:count])
        own_normals = side.in_planes(slave.normals(x), np.arange(count))
        other_normals = self.other_surface.in_planes(master.normals(y), np.arange(len(y)))
        ways, of_facets, rays = own_normals, slave.facing(x), Rays.none()
        partners: tuple[Numbers, Numbers] = rays.facet, rays.over
        middle = _hats(np.full(2, 1 / 3 if slave.width == 3 else 1 / 2), slave.width)
        for turn in range(2):
            rays = _rays(slave, x, of_facets, master, y, self.reach)
            if turn:
                partners, rays = (rays.facet, rays.over), self._moving(rays)
            psi = self._functions(rays)
            sums = np.asarray(psi.sum(axis=1)).ravel()
            carriers, nodes = self._carriers(rays, psi, sums, of_places, moving=turn > 0)
            able, shares = carriers.nodes, carriers.shares
            if turn or not able.size:
                break
            mean = times_rows(1.0 / (shares @ sums), shares) @ psi
            of_own = np.einsum("rk,rkd->rd", _hats(rays.at, slave.width), own_normals[slave.facets[rays.facet]])
            of_other = np.einsum("rk,rkd->rd", _hats(rays.place, master.width), other_normals[master.facets[rays.over]])
            ways = side.in_planes(carriers.ways(nodes, own_normals, mean @ of_own, mean @ of_other), np.arange(count))
            of_facets = _unit(np.einsum("k,fkd->fd", middle, ways[slave.facets]))
        shares, functions, partnered, weight, mean = self._carried(able, shares, psi)
        sharing, opposite = self._shares_of(rays, mean, partnered)
        normal = side.in_planes(sharing @ own_normals - opposite @ other_normals, self.carriers)
        gap = np.where(partnered, mean @ rays.distance, self.reach)
        nothing = sp.csr_array((partnered.size, count))
        seen = SeenSides(
            x, y, ways, rays, shares, functions, weight, sharing, opposite, normal, partnered, gap, nothing
        )
        return seen, partners, psi

    def _place_over(self, facets: Array, points: Array, ways: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
        """See ``SlidingClaim``, nodes of shape (m, k, 3)."""
        first = _unit(np.cross(ways, np.eye(3)[np.abs(ways).argmin(axis=1)]))
        axes = np.stack((first, np.cross(ways, first)), axis=1)
        places = places_in_polygons(
            np.einsum("mkd,mad->mka", facets - points[:, None], axes), np.zeros((len(points), 2))
        )
        return places, (_hats(places, facets.shape[1]) >= -SAME_PLACE_IN_CELL).all(axis=1)

    def _place_under(self, facets: Array, ways: Array, points: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
        """See ``SlidingClaim``: the way at a place tells the place along it, again until both agree."""
        places: Array = np.full((len(facets), 2), 1 / 3)
        inside: npt.NDArray[np.bool_] = np.zeros(len(facets), dtype=bool)
        for _ in range(_REPEATED):
            along = _unit(np.einsum("mk,mkd->md", _hats(places, facets.shape[1]), ways))
            places, inside = self._place_over(facets, points, along)
        return places, inside

    def _hats(self, places: Array, chain: BoundaryPolyline) -> Array:
        """See ``SlidingClaim``."""
        return np.asarray(_hats(places, chain.width))

    def _derivatives(self) -> Iterator[tuple[slice, Array, Array, Array]]:
        """Of parts of the rays the derivatives of the distance along each by the corners of its facets on both sides,
        shapes (r, k, 3) and (r, l, 3), and by the sum that its direction is along, shape (r, 3).
        """
        seen, (slave, master), rays = self.present, self._sheets, self.present.rays
        middle = _hats(np.full(2, 1 / 3 if slave.width == 3 else 1 / 2), slave.width)
        for first in range(0, rays.area.size, _RAYS_AT_ONCE):
            part = slice(first, first + _RAYS_AT_ONCE)
            facets, opposite = slave.facets[rays.facet[part]], seen.y[master.facets[rays.over[part]]]
            hats, over = _hats(rays.at[part], slave.width), _hats(rays.place[part], master.width)
            slopes = _slopes(rays.place[part], master.width)
            # What corners move: the point, the one over it, and the tangents there; the last one is the direction.
            vectors = [
                np.array(values, dtype=np.complex128)
                for values in (
                    np.einsum("rk,rkd->rd", hats, seen.x[facets]),
                    np.einsum("rk,rkd->rd", over, opposite),
                    *np.einsum("ark,rkd->ard", slopes, opposite),
                    np.einsum("k,rkd->rd", middle, seen.ways[facets]),
                )
            ]
            rates = [np.zeros(values.shape) for values in vectors]
            for values, rate in zip(vectors, rates, strict=True):
                for component in range(3):
                    values[:, component] += 1j * COMPLEX_STEP
                    rate[:, component] = _distance(*vectors).imag / COMPLEX_STEP
                    values[:, component] -= 1j * COMPLEX_STEP
            by_master = over[..., None] * rates[1][:, None]
            by_master += sum(slope[..., None] * rate[:, None] for slope, rate in zip(slopes, rates[2:4], strict=True))
            yield part, hats[..., None] * rates[0][:, None], by_master, rates[4]

    @cached_property
    def _rotations(self) -> tuple[Numbers, Numbers, Array]:
        """The nodes of facets with rays, the nodes around each, itself again where there are fewer, and its rotation
        from their displacements, by least squares with areas, shapes (n,), (n, k) and (n, 3, k, 3).
        """
        seen, slave = self.present, self._sheets[0]
        nodes = np.unique(slave.facets[np.unique(seen.rays.facet)])
        rows = self._around[nodes]
        number = np.diff(rows.indptr)
        row = np.repeat(np.arange(nodes.size), number)
        column = np.arange(row.size) - np.repeat(rows.indptr[:-1], number)
        around = np.tile(nodes[:, None], (1, number.max(initial=0)))
        area = np.zeros(around.shape)
        around[row, column], area[row, column] = rows.indices, rows.data
        rotations = np.zeros((nodes.size, 3, around.shape[1], 3))
        for first in range(0, nodes.size, _FACETS_AT_ONCE):
            part = slice(first, first + _FACETS_AT_ONCE)
            arms, root = seen.x[around[part]] - seen.x[nodes[part], None], np.sqrt(area[part])[..., None, None]
            moved = np.concatenate((np.broadcast_to(np.eye(3), (*arms.shape, 3)), _turns(arms)), axis=3)
            inverse = np.linalg.pinv((root * moved).reshape(len(arms), -1, 6))
            rotations[part] = inverse[:, 3:].reshape(len(arms), 3, -1, 3) * root[:, None, ..., 0]
        return nodes, around, rotations

    def _add_couples(self, forces: Array, drag: Array) -> None:
        """See ``SlidingClaim``."""
        seen, (slave, master), count = self.present, self._sheets, self.chains[0].nodes.size
        apart = seen.opposite @ seen.y - seen.sharing @ seen.x
        apart[~seen.partnered] = 0.0
        couples = np.cross(apart, drag) / 2
        acting = np.flatnonzero(couples.any(axis=1))
        rays, of_point = seen.rays, sp.csr_array(seen.shares[acting])
        projected_onto = sp.diags_array(rays.area) @ _incidence(slave.facets[rays.facet], count)
        for sheet, facets, x, first in ((slave, rays.facet, seen.x, 0), (master, rays.over, seen.y, count)):
            total = sheet.nodes.size
            arms = sp.csr_array(of_point @ (projected_onto.T @ _incidence(sheet.facets[facets], total)))
            row, node, share = np.repeat(np.arange(acting.size), np.diff(arms.indptr)), arms.indices, arms.data
            r = x[node] - ((arms @ x) / np.asarray(arms.sum(axis=1)).reshape(-1, 1))[row]
            inertia = np.zeros((acting.size, 3, 3))
            squares = np.sum(r**2, axis=1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None]
            np.add.at(inertia, row, share[:, None, None] * squares)
            spin = np.einsum("nij,nj->ni", np.linalg.pinv(inertia, rcond=1e-12, hermitian=True), couples[acting])
            np.add.at(forces, first + node, share[:, None] * np.cross(spin[row], r))


def _distance(start: Any, end: Any, first: Any, second: Any, along: Any) -> Any:
    """From points to facets, along directions: one step of Newton's method from the places on them has the derivative
    of the distance; all of shape (r, 3), complex.
    """
    normal = np.cross(first, second)
    return np.sum((end - start) * normal, axis=1) / np.sum(_unit(along) * normal, axis=1)


def _turns(arms: Array) -> Array:
    """How places at arms, shape (..., 3), move as a rotation about three axes begins, shape (..., 3, 3)."""
    return np.stack([np.cross(axis, arms) for axis in np.eye(3)], axis=-1)


def _incidence(nodes: Numbers, count: int) -> Any:
    """One where a row of nodes, shape (r, k), has a node, scipy sparse, shape (r, count)."""
    rows = np.repeat(np.arange(len(nodes)), nodes.shape[1])
    return sp.csr_array(sp.coo_array((np.ones(rows.size), (rows, nodes.ravel())), shape=(len(nodes), count)))


def _rotations_of(arms: Array, undeformed: Array, areas: Array, row: Numbers, count: int) -> Any:
    """The rotations that take undeformed arms to those of now, by least squares with areas: n of them, of the unit
    quaternions of the largest eigenvalue (P. B. Davenport, NASA TN D-4696, 1968).

    Args:
        arms: shape (m, 3).
        undeformed: likewise.
        areas: shape (m,).
        row: which rotation each belongs to, shape (m,).
        count: n.
    """
    moments = np.zeros((count, 3, 3))
    np.add.at(moments, row, areas[:, None, None] * arms[:, :, None] * undeformed[:, None])
    trace = np.trace(moments, axis1=1, axis2=2)
    matrix = np.zeros((count, 4, 4))
    matrix[:, :3, :3] = moments + moments.swapaxes(1, 2) - trace[:, None, None] * np.eye(3)
    for k in range(3):
        matrix[:, k, 3] = matrix[:, 3, k] = moments[:, (k + 2) % 3, (k + 1) % 3] - moments[:, (k + 1) % 3, (k + 2) % 3]
    matrix[:, 3, 3] = trace
    return Rotation.from_quat(np.linalg.eigh(matrix)[1][..., -1])
