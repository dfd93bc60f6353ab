"""The second opinion on two sides in space that slide on each other, at displaced points, by code of its own.

Of the solver it takes who carries a point, which facets there are, and which nodes lie in planes of symmetry.  What it
does otherwise:
- the polygon that two facets share is made of corners of the one inside the other, and of where their edges cross,
- places on quadrilaterals are roots of quadratic equations, and each triangle of a polygon has a square of points,
- derivatives of distances are taken by complex steps, and the rotation around a node is that of a pseudo-inverse, or of
  a quaternion,
- slips are evaluated from the displacements of both ends of the step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem
from scipy.spatial.transform import Rotation

from signorini_fx.machine import parallel
from signorini_fx.mechanics.body.assembly import facet_entities
from signorini_fx.mechanics.body.averages import from_owners
from signorini_fx.mechanics.body.node_positions import node_positions
from signorini_fx.mechanics.mesh.files.raw import rows_of
from signorini_fx.mechanics.pairs.dual_functions import HeldSides, carried, extended
from signorini_fx.mechanics.pairs.surface import PairSurface
from signorini_fx.results.certificate.sliding_claim import Chain, Rays, SeenSides, SlidingClaim, at_ends, sparse_rows
from signorini_fx.tuned import FACING_SIDES, NO_PART, PARALLEL, SAME_NUMBER

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]

# Of complex steps: derivatives have no differences in them.
_STEP = 1e-30
# Points along each side of a square, from which those of a triangle are made: on triangles products of two linear
# functions are integrated, on quadrilaterals what is rational.
_POINTS = {3: 3, 4: 5}


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


def _rule(count: int) -> tuple[Array, Array]:
    """Points of the triangle with the corners (0, 0), (1, 0), (0, 1), from those of a square, and their weights."""
    places, weights = np.polynomial.legendre.leggauss(count)
    s, t = (grid.ravel() for grid in np.meshgrid((places + 1) / 2, (places + 1) / 2, indexing="ij"))
    return np.column_stack((s, t * (1 - s))), np.outer(weights, weights).ravel() / 4 * (1 - s)


@dataclass(frozen=True)
class Sheet(Chain):
    """Facets in space, corners around each so that the body is behind them, see ``Chain``."""

    @classmethod
    def of(cls, space: fem.FunctionSpace, facets: npt.NDArray[np.int32], factor: Array | None = None) -> Sheet:
        """See ``Chain``."""
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
        """See ``Chain``, shape (N, 3); not of length one."""
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

    @cached_property
    def areas(self) -> Array:
        """Undeformed, times the measure, shape (f,)."""
        points, weights = np.polynomial.legendre.leggauss(5)
        s, t = (grid.ravel() for grid in np.meshgrid((points + 1) / 2, (points + 1) / 2, indexing="ij"))
        at, factors = np.column_stack((s, t)), np.outer(weights, weights).ravel() / 4
        if self.width == 3:
            at, factors = _rule(3)
        along = np.einsum("aqk,fkd->afqd", _slopes(at, self.width), self.x[self.facets])
        size = np.linalg.norm(np.cross(along[0], along[1]), axis=2)
        return np.asarray((size * (self.measure[self.facets] @ _hats(at, self.width).T)) @ factors)


def _inside(points: Array, window: Array, most: float) -> npt.NDArray[np.bool_]:
    """Which points of the plane, shape (v, 2), are in a convex polygon, corners counterclockwise, or outside by at most
    this length.
    """
    edges = np.roll(window, -1, axis=0) - window
    away = points[:, None] - window
    height = edges[:, 0] * away[..., 1] - edges[:, 1] * away[..., 0]
    return np.asarray((height >= -most * np.linalg.norm(edges, axis=1)).all(axis=1))


def _common(first: Array, second: Array) -> Array | None:
    """The polygon that two convex ones share, corners counterclockwise, shape (v, 2); None: they share none.

    Where edges of both are on one line but for round-off, its corners are theirs, as no crossing is to be had.
    """
    start, along = first[:, None], (np.roll(first, -1, axis=0) - first)[:, None]
    begin, across = second[None], (np.roll(second, -1, axis=0) - second)[None]
    turn = along[..., 0] * across[..., 1] - along[..., 1] * across[..., 0]
    away = begin - start
    crosses = np.abs(turn) > PARALLEL * np.linalg.norm(along, axis=-1) * np.linalg.norm(across, axis=-1)
    apart = away[..., 0] * across[..., 1] - away[..., 1] * across[..., 0]
    at = np.divide(apart, turn, out=np.zeros_like(turn), where=crosses)
    crossings = (start + at[..., None] * along)[crosses]
    points = np.concatenate((first, second, crossings))
    most = SAME_NUMBER * max(float(np.ptp(polygon, axis=0).max()) for polygon in (first, second))
    points = points[_inside(points, first, most) & _inside(points, second, most)]
    if len(points) < 3:
        return None
    arms = points - points.mean(axis=0)
    return np.asarray(points[np.argsort(np.arctan2(arms[:, 1], arms[:, 0]))])


def _area(polygon: Array) -> float:
    """Of a polygon, corners counterclockwise, shape (v, 2)."""
    arms = polygon - polygon[0]
    after = np.roll(arms, -1, axis=0)
    return float(np.sum(arms[:, 0] * after[:, 1] - arms[:, 1] * after[:, 0]) / 2)


def _inverse(corners: Array, p: Array) -> Array:
    """The places of points of the plane, shape (r, 2), in facets with corners of shape (r, k, 2)."""

    def cross(a: Array, b: Array) -> Array:
        return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

    away, first, last = corners[:, 0] - p, corners[:, 1] - corners[:, 0], corners[:, -1] - corners[:, 0]
    if corners.shape[1] == 3:
        size = cross(first, last)
        return np.column_stack((cross(last, away) / size, cross(away, first) / size))
    twist = corners[:, 2] - corners[:, 1] - last
    square, linear, constant = cross(last, twist), cross(away, twist) + cross(last, first), cross(away, first)
    root = np.sqrt(np.maximum(linear**2 - 4 * square * constant, 0.0))
    half = -(linear + np.where(linear >= 0, root, -root)) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = np.stack((constant / half, half / square))
    roots = np.where(np.isfinite(roots), roots, np.inf)
    t = np.take_along_axis(roots, np.abs(roots - 0.5).argmin(axis=0)[None], axis=0)[0]
    along, offset = first + t[:, None] * twist, away + t[:, None] * last
    return np.column_stack((-np.sum(offset * along, axis=1) / np.sum(along**2, axis=1), t))


def _rays(slave: Sheet, x: Array, ways: Array, master: Sheet, y: Array, reach: float) -> Rays:
    """All pairs of points that see each other along directions of the facets of the slave, of length one, shape (f, 3);
    the nodes of both sides are at x and y.
    """
    points, weights = _rule(_POINTS[max(slave.width, master.width)])
    outward, facing = slave.facing(x), master.facing(y)
    opposite = y[master.facets]
    columns = list(_seen_from_facets(slave, x, ways, opposite, facing @ outward.T < FACING_SIDES, (points, weights)))
    if not columns:
        return Rays.none()
    facet, at, over, places, area = (np.concatenate(column) for column in zip(*columns, strict=True))
    apart = np.einsum("rk,rkd->rd", _hats(places, master.width), opposite[over])
    apart = apart - np.einsum("rk,rkd->rd", _hats(at, slave.width), x[slave.facets[facet]])
    _, pair = np.unique(facet * len(master.facets) + over, return_inverse=True)
    pair = pair.ravel()
    means = np.stack([np.bincount(pair, area * part) for part in apart.T], axis=1) / np.bincount(pair, area)[:, None]
    near = np.flatnonzero(np.linalg.norm(means[pair], axis=1) <= reach)
    distance = np.sum(apart * ways[facet], axis=1)
    return Rays(facet[near], at[near], over[near], places[near], distance[near], area[near])


def _seen_from_facets(
    slave: Sheet, x: Array, ways: Array, opposite: Array, faces: npt.NDArray[np.bool_], rule: tuple[Array, Array]
) -> Iterator[tuple[Any, ...]]:
    """Of each facet of the slave the points that see one of the other side: numbers of both, places and areas."""
    points, weights = rule
    for number, nodes in enumerate(slave.facets):
        corners, way = x[nodes], ways[number]
        middle = corners.mean(axis=0)
        first = _unit(np.cross(way, np.eye(3)[np.abs(way).argmin()]))
        axes = np.stack((first, np.cross(way, first)))
        flat, flat_master = (corners - middle) @ axes.T, (opposite - middle) @ axes.T
        near = faces[:, number] & (flat_master.min(axis=1) <= flat.max(axis=0)).all(axis=1)
        near &= (flat_master.max(axis=1) >= flat.min(axis=0)).all(axis=1)
        size = _area(flat)
        triangles, partners = [], []
        for k in np.flatnonzero(near):
            polygon = _common(flat, flat_master[k][::-1])
            if polygon is None or _area(polygon) <= NO_PART * size:
                continue
            ends = polygon[1:-1], polygon[2:]
            fan = np.stack((np.broadcast_to(polygon[0], ends[0].shape), *ends), axis=1)
            triangles.append(fan)
            partners.append(np.full(len(fan), k))
        if not triangles:
            continue
        fans, over = np.concatenate(triangles), np.concatenate(partners)
        arms = fans[:, 1] - fans[:, 0], fans[:, 2] - fans[:, 0]
        double = arms[0][:, 0] * arms[1][:, 1] - arms[0][:, 1] * arms[1][:, 0]
        p = (fans[:, :1] + points[:, :1] * arms[0][:, None] + points[:, 1:] * arms[1][:, None]).reshape(-1, 2)
        over = np.repeat(over, len(points))
        at = _inverse(np.broadcast_to(flat, (len(p), *flat.shape)), p)
        slopes = _slopes(at, slave.width)
        image = slopes @ flat
        ratio = np.abs(image[0, :, 0] * image[1, :, 1] - image[0, :, 1] * image[1, :, 0])
        stretched = slopes @ slave.x[nodes]
        undeformed = np.linalg.norm(np.cross(stretched[0], stretched[1]), axis=1)
        area = (double[:, None] * weights).ravel() * undeformed / ratio
        area = area * (_hats(at, slave.width) @ slave.measure[nodes])
        yield np.full(over.size, number), at, over, _inverse(flat_master[over], p), area


@dataclass(frozen=True)
class SpaceSlidingClaim(SlidingClaim):
    """A pair of sides in space as the certificate sees it, see ``SlidingClaim``."""

    @cached_property
    def _sheets(self) -> tuple[Sheet, Sheet]:
        slave, master = self.chains
        assert isinstance(slave, Sheet)
        assert isinstance(master, Sheet)
        return slave, master

    @property
    def across(self) -> Array:
        """See ``SlidingClaim``, shape (n, 3, 3)."""
        if self.surface.across is None:
            return np.zeros((self._mine.size, 3, 3))
        return np.asarray(self.surface.across[self.carriers[self._mine]])

    def relative(self, owned: Array) -> Array:
        """See ``SlidingClaim``, from displacements of shape (owned nodes, 3), shape (n, 3)."""
        values = from_owners(owned, np.concatenate([chain.nodes for chain in self.chains]), self.comm)
        end_number = next((k for k, end in enumerate(self.ends) if np.array_equal(values, end)), None)
        seen = (self.present, self._begun)[end_number] if end_number is not None else self._seen(values)
        begun, at = self._begun, self._begun.partnered[:, None]
        sharing, opposite = np.where(at, begun.sharing, seen.sharing), np.where(at, begun.opposite, seen.opposite)
        tangents = self._tangents(seen)
        start = np.where(at[..., None], self._tangents(begun), tangents)
        way = np.einsum("ndk,nd->nk", tangents, sharing @ seen.x - opposite @ seen.y)
        way -= np.einsum("ndk,nd->nk", start, sharing @ begun.x - opposite @ begun.y)
        slip = np.where(seen.partnered[:, None], np.einsum("ndk,nk->nd", tangents, way), 0.0)[self._mine]
        slip -= np.einsum("nij,nj->ni", self.across, slip)
        return np.asarray(slip - seen.gap[self._mine, None] * self.present.normal[self._mine])

    def _tangents(self, seen: SeenSides) -> Array:
        """Those of the points, which turn with the facets of the slave around their nodes, and with the least rotation
        from the normal of these, shape (p, 3, 2).
        """
        slave = self._sheets[0]
        outward = self.surface.in_planes(slave.normals(slave.x), np.arange(len(slave.x)))
        tangents = np.zeros((self.carriers.size, 3, 2))
        for point, node in enumerate(self.carriers):
            around, normal = self._around[node], outward[node]
            rings = [x[around.indices] - x[node] for x in (seen.x, slave.x)]
            turned, _ = Rotation.align_vectors(*rings, weights=around.data)
            first = _unit(np.cross(normal, np.eye(3)[np.abs(normal).argmax() - 1]))
            normal, turned_pair = turned.apply(normal), turned.apply(np.stack((first, np.cross(normal, first))))
            axis = np.cross(normal, seen.normal[point])
            size = np.linalg.norm(axis)
            if size > 0:
                angle = np.arctan2(size, normal @ seen.normal[point])
                turned_pair = Rotation.from_rotvec(axis / size * angle).apply(turned_pair)
            tangents[point] = turned_pair.T
        return tangents

    @cached_property
    def _around(self) -> list[Any]:
        """The areas of the facets around each node that are around others, too: those and itself, scipy sparse rows."""
        slave = self._sheets[0]
        areas: Any = sp.lil_array((slave.nodes.size, slave.nodes.size))
        for nodes, area in zip(slave.facets, slave.areas, strict=True):
            areas[np.ix_(nodes, nodes)] += area * np.ones((slave.width, slave.width))
        rows = sp.csr_array(areas)
        return [rows[[node]] for node in range(slave.nodes.size)]

    def forces(self, traction: Array, owned: int) -> tuple[Numbers, Array, Array]:
        """See ``Claim``; collective."""
        seen, (slave, master) = self.present, self._sheets
        count, names = slave.nodes.size, np.concatenate([chain.nodes for chain in self.chains])
        rows = np.zeros((owned, 3))
        rows[self.points] = traction
        gathered = from_owners(rows, slave.nodes[self.carriers], self.comm)
        pressure = np.where(seen.partnered, np.sum(gathered * seen.normal, axis=1), 0.0)
        drag = seen.weight[:, None] * (gathered - np.sum(gathered * seen.normal, axis=1)[:, None] * seen.normal)
        forces = np.zeros((names.size, 3))
        by_slave, by_master, turn = self._derivatives
        pushing = -(seen.functions.T @ pressure)[:, None]
        np.add.at(forces, slave.facets[seen.rays.facet], pushing[..., None] * by_slave)
        np.add.at(forces, count + master.facets[seen.rays.over], pushing[..., None] * by_master)
        couples = np.zeros((count, 3))
        middle = _hats(np.full(2, 1 / 3 if slave.width == 3 else 1 / 2), slave.width)
        for column, share in zip(slave.facets[seen.rays.facet].T, middle, strict=True):
            np.add.at(couples, column, share * np.cross(seen.ways[column], pushing * turn))
        for node in np.flatnonzero(couples.any(axis=1)):
            around, rotation = self._rotations[node]
            forces[around] += (couples[node] @ rotation).reshape(-1, 3)
        forces[:count] += seen.sharing.T @ drag
        forces[count:] -= seen.opposite.T @ drag
        self._add_couples(forces, drag)
        area = np.concatenate((np.abs(seen.sharing).T @ seen.weight, np.abs(seen.opposite).T @ seen.weight))
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
        by_slave, by_master, turn = self._derivatives
        places = seen.x[slave.facets[seen.rays.facet]], seen.y[master.facets[seen.rays.over]]
        middle, size = seen.x.mean(axis=0), float(np.ptp(seen.x, axis=0).max())
        errors.append(float(np.max(np.abs(by_slave.sum(axis=1) + by_master.sum(axis=1)))))
        moments = np.cross(places[0] - middle, by_slave).sum(axis=1)
        moments += np.cross(places[1] - middle, by_master).sum(axis=1)
        shares = _hats(np.full(2, 1 / 3 if slave.width == 3 else 1 / 2), slave.width)
        sums = np.einsum("k,rkd->rd", shares, seen.ways[slave.facets[seen.rays.facet]])
        errors.append(float(np.max(np.abs(moments + np.cross(sums, turn)))) / size)
        for around, rotation in self._rotations.values():
            arms, turned = seen.x[around] - middle, rotation.reshape(3, -1, 3)
            as_one = np.einsum("ild,lda->ia", turned, np.cross(np.eye(3)[None], arms[:, None]).transpose(0, 2, 1))
            errors.append(float(np.max(np.abs(as_one - np.eye(3)))))
        return parallel.global_max(self.comm, max(errors))

    # --- at one displacement ---

    def _seen(self, values: Array) -> SeenSides:
        slave, master = self._sheets
        count = slave.nodes.size
        x, y = slave.x + values[:count], master.x + values[count:]
        side = self.surface.displaced(values[:count])
        own_normals = side.in_planes(slave.normals(x), np.arange(count))
        other_normals = self.other_surface.in_planes(master.normals(y), np.arange(len(y)))
        ways, of_facets, rays = own_normals, slave.facing(x), Rays.none()
        middle = _hats(np.full(2, 1 / 3 if slave.width == 3 else 1 / 2), slave.width)
        facet_of_side = self._facets_of_surface
        for turn in range(2):
            rays = _rays(slave, x, of_facets, master, y, self.reach)
            psi = self._functions(rays)
            sums = np.asarray(psi.sum(axis=1)).ravel()
            unable = self._unable(rays, psi) if turn else np.zeros(count, dtype=bool)
            able, shares = carried(side, facet_of_side[np.unique(rays.facet)], sums, unable)
            if turn or not able.size:
                break
            mean = sp.csr_array(sp.diags_array(1.0 / (shares @ sums)) @ shares @ psi)
            of_own = np.einsum("rk,rkd->rd", _hats(rays.at, slave.width), own_normals[slave.facets[rays.facet]])
            of_other = np.einsum("rk,rkd->rd", _hats(rays.place, master.width), other_normals[master.facets[rays.over]])
            ways = own_normals - extended(side, able, mean @ of_other)
            ways[able] = mean @ of_own - mean @ of_other
            ways = side.in_planes(ways, np.arange(count))
            of_facets = _unit(np.einsum("k,fkd->fd", middle, ways[slave.facets]))
        at, size = np.searchsorted(self.carriers, able), self.carriers.size
        partnered, weight = np.zeros(size, dtype=bool), np.array(self.surface.area[self.carriers])
        placing = sp.csr_array(sp.coo_array((np.ones(at.size), (at, np.arange(at.size))), shape=(size, at.size)))
        functions = sp.csr_array(placing @ shares @ psi)
        partnered[at], weight[at] = True, (shares @ sums)
        mean = sp.csr_array(sp.diags_array(1.0 / weight) @ functions)
        sharing, opposite = (
            (mean @ self._at_nodes(sheet, facet, places)).toarray()
            for sheet, facet, places in ((slave, rays.facet, rays.at), (master, rays.over, rays.place))
        )
        lonely = np.flatnonzero(~partnered)
        sharing[lonely, self.carriers[lonely]] = 1.0
        normal = side.in_planes(sharing @ own_normals - opposite @ other_normals, self.carriers)
        gap = np.where(partnered, mean @ rays.distance, self.reach)
        return SeenSides(x, y, ways, rays, functions, weight, sharing, opposite, normal, partnered, gap)

    def _functions(self, rays: Rays) -> Any:
        """The dual functions of the nodes of the slave at rays times their areas, scipy sparse, shape (N, r)."""
        slave = self._sheets[0]
        values = np.zeros((rays.area.size, slave.width))
        order = np.argsort(rays.facet, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(rays.facet[order])) + 1) if order.size else []:
            hats = _hats(rays.at[rows], slave.width).T
            mass = (hats * rays.area[rows]) @ hats.T
            dual = np.diag(mass.sum(axis=1)) @ np.linalg.pinv(mass, rcond=1e-10, hermitian=True) @ hats
            values[rows] = (dual * rays.area[rows]).T
        numbers = np.broadcast_to(np.arange(len(values))[:, None], values.shape)
        places = slave.facets[rays.facet].ravel(), numbers.ravel()
        return sp.csr_array(sp.coo_array((values.ravel(), places), shape=(slave.nodes.size, len(values))))

    @cached_property
    def _facets_of_surface(self) -> Numbers:
        """Of each facet of the slave its number on the surface of the solver, which has the same nodes."""
        return rows_of(self._sheets[0].facets, self.surface.nodes)

    @cached_property
    def _derivatives(self) -> tuple[Array, Array, Array]:
        """The derivatives of the distance along each ray by the corners of its facets on both sides, shapes (r, k, 3)
        and (r, l, 3), and by the sum that its direction is along, shape (r, 3).
        """
        seen, (slave, master), rays = self.present, self._sheets, self.present.rays
        middle = _hats(np.full(2, 1 / 3 if slave.width == 3 else 1 / 2), slave.width)
        facets = slave.facets[rays.facet]
        parts = [
            np.array(values, dtype=np.complex128)
            for values in (
                seen.x[facets],
                seen.y[master.facets[rays.over]],
                np.einsum("k,rkd->rd", middle, seen.ways[facets])[:, None],
            )
        ]
        hats, over = _hats(rays.at, slave.width), _hats(rays.place, master.width)
        slopes = _slopes(rays.place, master.width)

        def distance(corners: Any, opposite: Any, sums: Any) -> Any:
            way = _unit(sums[:, 0])
            along = np.einsum("ark,rkd->ard", slopes, opposite)
            normal = np.cross(along[0], along[1])
            apart = np.einsum("rk,rkd->rd", over, opposite) - np.einsum("rk,rkd->rd", hats, corners)
            # One step of Newton's method from the place has the derivative of the distance.
            return np.sum(apart * normal, axis=1) / np.sum(way * normal, axis=1)

        rates = [np.zeros(part.shape) for part in parts]
        for part, rate in zip(parts, rates, strict=True):
            for k in range(part.shape[1]):
                for component in range(3):
                    value = part[:, k, component].copy()
                    part[:, k, component] += 1j * _STEP
                    rate[:, k, component] = distance(*parts).imag / _STEP
                    part[:, k, component] = value
        return rates[0], rates[1], rates[2][:, 0]

    @cached_property
    def _rotations(self) -> dict[int, tuple[Numbers, Array]]:
        """Of each node of a facet with rays the nodes around it, and their rotation from their displacements, by least
        squares with areas, shapes (k,) and (3, 3 k).
        """
        seen, slave = self.present, self._sheets[0]
        rotations = {}
        for node in np.unique(slave.facets[np.unique(seen.rays.facet)]):
            around = self._around[node]
            ring, root = around.indices.astype(np.int64), np.sqrt(around.data)
            arms = seen.x[ring] - seen.x[node]
            moved = np.zeros((ring.size, 3, 6))
            moved[:, :, :3] = np.eye(3)
            moved[:, :, 3:] = np.cross(np.eye(3)[None], arms[:, None]).transpose(0, 2, 1)
            inverse = np.linalg.pinv((root[:, None, None] * moved).reshape(-1, 6))
            rotations[int(node)] = ring, inverse[3:] * np.repeat(root, 3)
        return rotations

    def _add_couples(self, forces: Array, drag: Array) -> None:
        """See ``SlidingClaim``."""
        seen, (slave, master), count = self.present, self._sheets, self.chains[0].nodes.size
        apart = seen.opposite @ seen.y - seen.sharing @ seen.x
        apart[~seen.partnered] = 0.0
        couples = np.cross(apart, drag) / 2
        of_point = self._shares[0][seen.partnered]
        for sheet, facets, x, first in (
            (slave, seen.rays.facet, seen.x, 0),
            (master, seen.rays.over, seen.y, count),
        ):
            met = np.zeros((count, sheet.nodes.size))
            for slave_column in slave.facets[seen.rays.facet].T:
                for column in sheet.facets[facets].T:
                    np.add.at(met, (slave_column, column), seen.rays.area)
            acting = np.flatnonzero(couples[seen.partnered].any(axis=1))
            of_points = of_point @ met
            for k in acting:
                couple, arms = couples[seen.partnered][k], of_points[k]
                r = x - (arms @ x) / arms.sum()
                inertia = np.sum(arms[:, None] * r**2) * np.eye(3) - (arms[:, None] * r).T @ r
                forces[first : first + sheet.nodes.size] += arms[:, None] * np.cross(
                    np.linalg.pinv(inertia, rcond=1e-12, hermitian=True) @ couple, r
                )

    def _at_nodes(self, chain: Chain, facets: Numbers, places: Array) -> Any:
        """See ``SlidingClaim``."""
        return sparse_rows(_hats(places, chain.width), chain.facets[facets], chain.nodes.size)


def sliding_claim_in_space(
    space: fem.FunctionSpace,
    sides: tuple[PairSurface, PairSurface],
    points: tuple[Numbers, npt.NDArray[np.bool_], HeldSides, float],
    facets: tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]],
    ends: tuple[fem.Function, fem.Function | None],
    factor: Array | None = None,
) -> SpaceSlidingClaim:
    """The second opinion on a pair in space; collective.

    Args:
        space: of the displacement.
        sides: slave and master.
        points: nodes of the slave with points, those that cannot carry one, those of both sides that supports hold, and
            the reach.
        facets: of both sides, owned, local numbers.
        ends: displacements now and at the beginning of the step; None: none.
        factor: by what the problem says that areas are multiplied, at all nodes of this rank, shape (nodes,); None: 1.
    """
    sheets = Sheet.of(space, facets[0], factor), Sheet.of(space, facets[1])
    surface = replace(sides[0], measure=None if factor is None else sheets[0].measure)
    at = at_ends(space, sheets, ends)
    return SpaceSlidingClaim(space, surface, sides[1], sheets, *points, *facets, at)
