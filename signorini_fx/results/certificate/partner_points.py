"""Points of two undeformed sides that see each other, by code of the certificates' own.

Of the mesh it takes facets and positions of nodes, and of the problem how far partners may be apart.  What it does
otherwise than the solver:
- functions of facets follow from their nodes by a matrix of powers, and which side is outside from the middle of cells,
- facets that may see each other are looked for in a tree of the others' middles, in 3D along lines through them,
- in 2D places that see the ends of other facets are roots of quadratic equations, of curved facets found by
  bisection; in 3D the polygon that two facets share is made of corners of the one inside the other, and of where
  their edges cross, and each triangle of it has a square of points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities, node_positions
from signorini_fx.results.certificate.common_polygons import (
    common_polygons,
    near_lines,
    places_in_polygons,
    polygon_areas,
    triangle_rule,
)
from signorini_fx.tuned import FACING_SIDES, NO_PART, POINTS_OF_PIECES, SAME_LENGTH, ZERO_SUM

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

# Points of a part of a facet between two ends of facets of the other side: as many as the map is defined by, since on
# strongly curved facets these integrals are not exact, and others would be of another map.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(POINTS_OF_PIECES)
# Points along each side of a square, from which those of a triangle are made, for integrands of this degree on flat
# triangles and parallelograms, and for others; and how many more the largest twist of a quadrilateral takes, relative
# to its diagonal: with that of a triangle divided into three, a half, each one more leaves a fifth of the error.
_ALONG, _CURVED, _TWISTED = {2: 2, 4: 3}, 6, 8
# How often what lies between two changes of sign is halved.
_HALVED = 52
# Steps of Newton's method to a place on a curved facet.
_STEPS = 12
# How many pairs of facets are looked at together, for memory.
_TOGETHER = 8192


def cross(a: Any, b: Any) -> Any:
    """Of vectors of the plane."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


@dataclass(frozen=True)
class NodalFunctions:
    """The functions of nodes at places of the reference facet, shape (k, d - 1)."""

    places: Array

    @property
    def degree(self) -> int:
        """1 or 2."""
        return 2 if (self.places == 0.5).any() else 1

    @cached_property
    def _powers(self) -> Numbers:
        """Of the coordinates, shape (k, d - 1)."""
        along, each = self.places.shape[1], np.arange(self.degree + 1)
        listed = np.stack(np.meshgrid(*[each] * along, indexing="ij"), axis=-1).reshape(-1, along)
        return listed[listed.sum(axis=1) <= self.degree] if self.simplex else listed

    def _products(self, places: Any, along: int = -1) -> Any:
        """Of powers, or of their derivatives along one direction, shape (..., k)."""
        product = np.ones(1)
        for axis, powers in enumerate(self._powers.T):
            s, ones = places[..., axis], np.ones(places.shape[:-1])
            table = (0.0 * s, ones, 2.0 * s) if axis == along else (ones, s, s * s)
            product = product * np.stack(table, axis=-1)[..., powers]
        return product

    @property
    def simplex(self) -> bool:
        """Whether the facet is an interval or a triangle."""
        return self.places.shape[1] == 1 or len(self.places) in (3, 6)

    @cached_property
    def _factors(self) -> Array:
        """Of the powers in each function, shape (k, k)."""
        return np.asarray(np.linalg.inv(self._products(self.places)))

    def at(self, places: Any) -> Any:
        """Values at places of shape (..., d - 1), complex ones, too, shape (..., k)."""
        return self._products(places) @ self._factors

    def slopes(self, places: Array) -> Array:
        """Derivatives along the d - 1 directions, shape (d - 1, ..., k)."""
        return np.array([self._products(places, axis) @ self._factors for axis in range(self.places.shape[1])])


@dataclass(frozen=True)
class SideFacets:
    """Facets of one side, f of them, the same on every rank.

    Attributes:
        nodes: global numbers, ascending, shape (N,).
        x: their positions, length, shape (N, d).
        facets: nodes of each, those at vertices first, numbers of the side, shape (f, k).
        functions: of these nodes.
        outward: +1 where the normal that follows from the order of nodes is outward, else -1, shape (f,).
        measure: by what areas are multiplied, at the nodes, between which it is interpolated, shape (N,); None: 1.
    """

    nodes: Numbers
    x: Array
    facets: Numbers
    functions: NodalFunctions
    outward: Array
    measure: Array | None

    @classmethod
    def of(cls, space: fem.FunctionSpace, facets: npt.NDArray[np.int32], factor: Array | None = None) -> SideFacets:
        """Those of all ranks; collective.

        Args:
            space: of the displacement.
            facets: owned, local numbers.
            factor: of the measure, at all nodes of this rank, shape (nodes,); None: 1.
        """
        mesh, element, dofmap = space.mesh, space.element.basix_element, space.dofmap
        dim, entities = mesh.topology.dim, facet_entities(mesh, facets)
        vertices, geometry = basix.geometry(element.cell_type), compat.geometry_element(mesh)
        corners, listed, places, outward = compat.geometry_cells(mesh), [], np.zeros((0, dim - 1)), []
        for number, corner in enumerate(basix.topology(element.cell_type)[dim - 1]):
            start, along = vertices[corner[0]], vertices[corner[1:dim]] - vertices[corner[0]]
            closure = np.array(dofmap.dof_layout.entity_closure_dofs(dim - 1, number))
            within = np.round(2.0 * (element.points[closure] - start) @ np.linalg.pinv(along)) / 2.0
            order = np.lexsort((*within.T[::-1], np.count_nonzero(within == 0.5, axis=1)))
            places, cells = within[order], entities[entities[:, 1] == number, 0]
            listed.append(dofmap.list[cells][:, closure[order]])
            # From the middle of the facet to that of the cell, as the reference cell is mapped there.
            middle, inner = start + along.sum(axis=0) / 2, vertices.mean(axis=0) - start
            slopes = geometry.tabulate(1, middle[None])[1:, 0, :, 0]
            jacobian = np.einsum("kg,cgi->cik", slopes, mesh.geometry.x[corners[cells], :dim])
            ways = np.concatenate((along, inner[None])) @ jacobian.transpose(0, 2, 1)
            sign = np.sign(np.linalg.det(ways))
            outward.append(sign if dim == 2 else -sign)
        local, signs = np.concatenate(listed), np.concatenate(outward)
        names = dofmap.index_map.local_to_global(local.ravel()).reshape(local.shape)
        rows = [node_positions(space)[local, :dim].reshape(-1, places.size * dim // (dim - 1)), signs[:, None]]
        if factor is not None:
            rows.append(np.nan_to_num(factor)[local])
        names, gathered = parallel.gather_rows(mesh.comm, names), parallel.gather_rows(mesh.comm, np.hstack(rows))
        nodes, first, numbers = np.unique(names, return_index=True, return_inverse=True)
        count = len(places)
        x = np.array(gathered[:, : count * dim].reshape(-1, dim)[first])
        measure = None if factor is None else gathered[:, count * dim + 1 :].ravel()[first]
        return cls(
            nodes.astype(np.int64),
            x,
            numbers.reshape(names.shape).astype(np.int64),
            NodalFunctions(places),
            gathered[:, count * dim],
            measure,
        )

    @property
    def dimension(self) -> int:
        """D."""
        return int(self.x.shape[1])

    @cached_property
    def tests(self) -> NodalFunctions:
        """What the functions of points are dual to: on quadratic triangles the hats of the vertices."""
        if self.dimension == 3 and len(self.functions.places) == 6:
            return NodalFunctions(self.functions.places[:3])
        return self.functions

    @property
    def tested(self) -> Numbers:
        """The nodes of the facets that have such functions, shape (f, t)."""
        return self.facets[:, : len(self.tests.places)]

    def normals(self, facets: Numbers, at: Array) -> Array:
        """Outward normals times the area of a unit of the reference facet, at places of facets, shape (m, d - 1) both
        but for facets, shape (m, d).
        """
        along = np.einsum("amk,mkd->amd", self.functions.slopes(at), self.x[self.facets[facets]])
        if self.dimension == 2:
            across = np.stack((along[0, :, 1], -along[0, :, 0]), axis=1)
        else:
            across = np.cross(along[0], along[1])
        return np.asarray(across * self.outward[facets, None])

    def sizes(self, facets: Numbers, at: Array) -> Array:
        """Area of a unit of the reference facet, times the measure, shape (m,), see ``normals``."""
        sizes = np.linalg.norm(self.normals(facets, at), axis=1)
        if self.measure is not None:
            sizes = sizes * np.sum(self.functions.at(at) * self.measure[self.facets[facets]], axis=1)
        return np.asarray(sizes)

    @cached_property
    def area(self) -> Array:
        """The integral of the function of each node times the measure, shape (N,)."""
        kind = basix.CellType.interval
        if self.dimension == 3:
            kind = basix.CellType.triangle if self.functions.simplex else basix.CellType.quadrilateral
        points, weights = basix.make_quadrature(kind, 8)
        count, total = len(self.facets), np.zeros(len(self.x))
        for point, weight in zip(points, weights, strict=True):
            sizes = weight * self.sizes(np.arange(count), np.tile(point, (count, 1)))
            np.add.at(total, self.tested, sizes[:, None] * self.tests.at(point))
        return total

    @property
    def narrowest(self) -> float:
        """The shortest distance between two nodes of a facet, length."""
        x = self.x[self.facets]
        pairs = [(j, k) for k in range(x.shape[1]) for j in range(k)]
        return float(min(np.linalg.norm(x[:, j] - x[:, k], axis=1).min(initial=np.inf) for j, k in pairs))

    @property
    def without_area(self) -> Flags:
        """Nodes whose functions have none because of the measure, as on an axis of revolution, shape (N,)."""
        if self.measure is None:
            return np.zeros(len(self.x), dtype=bool)
        least = ZERO_SUM * self.measure.max() if self.functions.degree > 1 else -np.inf
        return np.asarray((self.measure <= least) | (self.area <= ZERO_SUM * self.area.max()))

    @property
    def parts(self) -> Array:
        """Corners of the linear parts of the reference facet in 3D, in order around each, shape (p, c, 2)."""
        around = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        around = around[[0, 1, 3]] if self.functions.simplex else around
        if self.functions.degree == 1:
            return around[None]
        halves = [(around + corner) / 2 for corner in around]
        return np.array([*halves, 0.5 - around / 2 + 0.0] if self.functions.simplex else halves)


@dataclass(frozen=True)
class PartnerPoints:
    """Points of the slave with that of the master over each, r of them, as far as this rank has looked for them.

    Attributes:
        facet, over: facets of slave and master, shape (r,).
        at, place: on these, shape (r, d - 1).
        area: of the slave, times its measure, shape (r,).
    """

    facet: Numbers
    at: Array
    over: Numbers
    place: Array
    area: Array

    def chosen(self, points: Any) -> PartnerPoints:
        """Some of them."""
        return PartnerPoints(
            self.facet[points], self.at[points], self.over[points], self.place[points], self.area[points]
        )


def partner_points(
    sides: tuple[SideFacets, SideFacets], ways: Array | None, reach: float, facets: Numbers
) -> PartnerPoints:
    """Those of some facets of the slave.

    Args:
        sides: slave and master.
        ways: directions in which points see each other, at the nodes of the slave with functions of points, shape (N,
            d); None: the normals of facets, in 3D.
        reach: distance beyond which facets are no partners, length.
        facets: their numbers.
    """
    slave, master = sides
    look = _in_plane if slave.dimension == 2 else _in_space
    count = max(1, _TOGETHER // 8)
    blocks = [look(sides, ways, reach, facets[k : k + count]) for k in range(0, max(len(facets), 1), count)]
    points = PartnerPoints(*(np.concatenate([getattr(block, name) for block in blocks]) for name in vars(blocks[0])))
    apart = np.einsum("rk,rkd->rd", master.functions.at(points.place), master.x[master.facets[points.over]])
    apart -= np.einsum("rk,rkd->rd", slave.functions.at(points.at), slave.x[slave.facets[points.facet]])
    _, pair = np.unique(points.facet * len(master.facets) + points.over, return_inverse=True)
    means = np.stack([np.bincount(pair, points.area * part) for part in apart.T], axis=1)
    near = np.linalg.norm(means, axis=1) <= (1.0 + SAME_LENGTH) * reach * np.bincount(pair, points.area)
    return points if near.all() else points.chosen(near[pair])


def _in_plane(sides: tuple[SideFacets, SideFacets], ways: Array | None, reach: float, chosen: Numbers) -> PartnerPoints:
    slave, master = sides
    assert ways is not None
    halves = [np.full((len(side.facets), 1), 0.5) for side in sides]
    numbers = [chosen, np.arange(len(master.facets))]
    middles = [side.x[side.facets[facets]].mean(axis=1) for side, facets in zip(sides, numbers, strict=True)]
    widths = [
        np.linalg.norm(side.x[side.facets[facets]] - middle[:, None], axis=2).max(axis=1)
        for side, facets, middle in zip(sides, numbers, middles, strict=True)
    ]
    outward = [side.normals(facets, half[facets]) for side, facets, half in zip(sides, numbers, halves, strict=True)]
    outward = [normals / np.linalg.norm(normals, axis=1, keepdims=True) for normals in outward]
    # Curved facets bulge beyond their nodes.
    found = cKDTree(middles[1]).query_ball_point(
        middles[0], min(reach, _apart(*middles)) + 2 * (widths[0] + max(widths[1]))
    )
    counts = np.array([len(listed) for listed in found], dtype=np.int64)
    row, over = np.repeat(np.arange(len(chosen)), counts), np.concatenate([np.zeros(0), *found]).astype(np.int64)
    faces = np.sum(outward[0][row] * outward[1][over], axis=1) < FACING_SIDES
    facet, over = chosen[row[faces]], over[faces]
    images = [_seeing(slave, facet, ways, master.x[master.facets[over, end]]) for end in range(2)]
    low, high = np.minimum(*images), np.maximum(*images)
    meets = high - low > NO_PART
    facet, over, low, high = facet[meets], over[meets], low[meets, None], high[meets, None]
    at = (low + (high - low) * (_POINTS + 1) / 2).reshape(-1, 1)
    area = (_WEIGHTS / 2 * (high - low)).ravel()
    facet, over = np.repeat(facet, _POINTS.size), np.repeat(over, _POINTS.size)
    hats, nodes = slave.functions.at(at), slave.facets[facet]
    points, rays = (np.einsum("rk,rkd->rd", hats, values[nodes]) for values in (slave.x, ways))
    place = _met(master.x[master.facets[over]], points, rays)
    return PartnerPoints(facet, at, over, np.clip(place, 0.0, 1.0)[:, None], area * slave.sizes(facet, at))


def _apart(first: Array, second: Array) -> float:
    """No two of these points are farther apart, length."""
    both = np.concatenate((first, second))
    return float(np.linalg.norm(np.ptp(both, axis=0)))


def _seeing(side: SideFacets, facets: Numbers, ways: Array, points: Array) -> Array:
    """The places in [0, 1] of facets, shape (m,), that see points, shape (m, 2), along directions at their nodes, or
    the ends beyond which these are.
    """
    x, rays = side.x[side.facets[facets]], ways[side.facets[facets]]

    def missed(s: Array, rows: Any) -> Array:
        hats = side.functions.at(s[:, None])
        at, way = (np.einsum("mk,mkd->md", hats, values[rows]) for values in (x, rays))
        return np.asarray(cross(points[rows] - at, way))

    count = len(facets)
    along = np.sign(cross(x[:, 1] - x[:, 0], rays.mean(axis=1)))
    before, behind = along * missed(np.zeros(count), slice(None)), along * missed(np.ones(count), slice(None))
    places = np.where(before > 0, 1.0, 0.0)
    rows = np.flatnonzero((before > 0) & (behind < 0))
    if x.shape[1] == 2:
        start, step = x[rows, 0], x[rows, 1] - x[rows, 0]
        first, turn = rays[rows, 0], rays[rows, 1] - rays[rows, 0]
        away = points[rows] - start
        square, linear = -cross(step, turn), cross(away, turn) - cross(step, first)
        places[rows] = _root_nearest_to_middle(square, linear, cross(away, first))
        return places
    low: Array = np.zeros(rows.size)
    high: Array = np.ones(rows.size)
    for _ in range(_HALVED):
        middle = (low + high) / 2
        above = along[rows] * missed(middle, rows) > 0
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    places[rows] = (low + high) / 2
    return places


def _met(nodes: Array, points: Array, rays: Array) -> Array:
    """Where rays through points, shape (m, 2), meet facets with these nodes, shape (m, k, 2): places, shape (m,)."""
    start, end = nodes[:, 0], nodes[:, 1]
    bend = 0 * start if nodes.shape[1] == 2 else 2 * (start + end) - 4 * nodes[:, 2]
    square, linear, constant = cross(bend, rays), cross(end - start - bend, rays), cross(start - points, rays)
    return _root_nearest_to_middle(square, linear, constant)


def _root_nearest_to_middle(square: Array, linear: Array, constant: Array) -> Array:
    """Of the two roots of quadratic equations that which is nearest to 1/2, as places on facets are, shape (m,)."""
    root = np.sqrt(np.maximum(linear**2 - 4 * square * constant, 0.0))
    half = -(linear + np.where(linear >= 0, root, -root)) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = np.nan_to_num(np.stack((constant / half, half / square)), nan=np.inf)
    return np.asarray(np.take_along_axis(roots, np.abs(roots - 0.5).argmin(axis=0)[None], axis=0)[0])


@dataclass(frozen=True)
class _Parts:
    """Linear parts of facets in 3D, p of them.

    Attributes:
        facet: of which, shape (p,).
        reference: their corners in it, shape (p, c, 2).
        corners: where these are, shape (p, c, 3).
        normal: outward, of length one, shape (p, 3).
    """

    facet: Numbers
    reference: Array
    corners: Array
    normal: Array

    @classmethod
    def of(cls, side: SideFacets, facets: Numbers) -> _Parts:
        parts = side.parts
        facet, reference = np.repeat(facets, len(parts)), np.tile(parts, (len(facets), 1, 1))
        corners = np.einsum("pck,pkd->pcd", side.functions.at(reference), side.x[side.facets[facet]])
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        if corners.shape[1] == 4:
            first, second = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        normal = np.cross(first, second) * side.outward[facet, None]
        # Parts whose corners are in the other order have it, too.
        turn = cross(reference[:, 1] - reference[:, 0], reference[:, 2] - reference[:, 0])
        normal *= np.sign(turn)[:, None]
        return cls(facet, reference, corners, normal / np.linalg.norm(normal, axis=1, keepdims=True))

    def along(self, side: SideFacets, ways: Array | None) -> Array:
        """Directions in the middle of each, of length one, shape (p, 3), see ``partner_points``."""
        if ways is None:
            return self.normal
        hats = side.tests.at(self.reference.mean(axis=1))
        along = np.einsum("pt,ptd->pd", hats, ways[side.tested[self.facet]])
        return np.asarray(along / np.linalg.norm(along, axis=1, keepdims=True))


def turned_ways(side: SideFacets, ways: Array, normals: Array) -> float:
    """How far directions are from those in which points see each other at first: from the normals at nodes, or in 3D
    from those of facets, as a tangent.
    """
    if side.dimension == 2:
        return float(np.abs(ways - normals)[side.tested].max())
    parts = _Parts.of(side, np.arange(len(side.facets)))
    along = parts.along(side, ways)
    cosine = np.sum(along * parts.normal, axis=1)
    return float((np.linalg.norm(np.cross(along, parts.normal), axis=1) / cosine).max())


def _in_space(sides: tuple[SideFacets, SideFacets], ways: Array | None, reach: float, chosen: Numbers) -> PartnerPoints:
    slave, master = sides
    parts, others = _Parts.of(slave, chosen), _Parts.of(master, np.arange(len(master.facets)))
    along = parts.along(slave, ways)
    middles = [listed.corners.mean(axis=1) for listed in (parts, others)]
    widths = [
        np.linalg.norm(listed.corners - middle[:, None], axis=2).max(axis=1)
        for listed, middle in zip((parts, others), middles, strict=True)
    ]
    row, over = np.zeros((2, 0), dtype=np.int64)
    if len(chosen):
        row, over = near_lines(middles[0], along, cKDTree(middles[1]), widths[0] + widths[1].max(), reach)
    away = middles[1][over] - middles[0][row]
    away -= np.sum(away * along[row], axis=1)[:, None] * along[row]
    near = np.sum(away**2, axis=1) <= (1 + SAME_LENGTH) * (widths[0][row] + widths[1][over]) ** 2
    row, over = row[near], over[near]
    faces = np.sum(parts.normal[row] * others.normal[over], axis=1) < FACING_SIDES
    row, over = row[faces], over[faces]
    rule = triangle_rule(_points_along(sides, (parts, others), row, over))
    first = np.eye(3)[np.abs(along).argmin(axis=1)]
    first = np.cross(along, first)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    axes = np.stack((first, np.cross(along, first)), axis=1)
    blocks = [
        _shared_by(sides, (parts, others), (middles[0], axes), (row[k : k + _TOGETHER], over[k : k + _TOGETHER]), rule)
        for k in range(0, max(len(row), 1), _TOGETHER)
    ]
    return PartnerPoints(*(np.concatenate([getattr(block, name) for block in blocks]) for name in vars(blocks[0])))


def _points_along(
    sides: tuple[SideFacets, SideFacets], parts: tuple[_Parts, _Parts], row: Numbers, over: Numbers
) -> int:
    """See ``_ALONG``."""
    highest, count = max(side.functions.degree for side in sides), 0
    for side, listed, numbers in zip(sides, parts, (row, over), strict=True):
        corners = listed.corners[np.unique(numbers)]
        if not len(corners):
            continue
        if corners.shape[1] == 4:
            twist = np.linalg.norm(corners[:, 0] - corners[:, 1] + corners[:, 2] - corners[:, 3], axis=1)
            share = float((twist / np.linalg.norm(corners[:, 2] - corners[:, 0], axis=1)).max())
            if highest > 1 or share > SAME_LENGTH:
                count = max(count, _CURVED + int(np.ceil(_TWISTED * share - SAME_LENGTH)))
        elif side.functions.degree > 1:
            nodes = side.x[side.facets[np.unique(listed.facet[numbers])]]
            straight = NodalFunctions(side.functions.places[:3]).at(side.functions.places) @ nodes[:, :3]
            size = np.linalg.norm(nodes[:, 1:2] - nodes[:, :1], axis=2)
            if (np.linalg.norm(nodes - straight, axis=2) > SAME_LENGTH * size).any():
                count = max(count, _CURVED)
    boxes = any(not side.functions.simplex for side in sides)
    return count or _ALONG[4 if boxes or highest > 1 else 2]


def _shared_by(
    sides: tuple[SideFacets, SideFacets],
    parts: tuple[_Parts, _Parts],
    planes: tuple[Array, Array],
    pairs: tuple[Numbers, Numbers],
    rule: tuple[Array, Array],
) -> PartnerPoints:
    """The points of pairs of parts.

    Args:
        sides: slave and master.
        parts: of both.
        planes: onto which the parts of the slave are projected with those over them: a point of each, shape (p, 3), and
            two vectors along it, shape (p, 2, 3).
        pairs: numbers of parts of both sides, shape (m,) each.
        rule: points of a triangle, and their weights.
    """
    (slave, master), (middle, axes), (points, weights) = sides, planes, rule

    def counterclockwise(polygons: Array) -> tuple[Array, Flags]:
        turned = polygon_areas(polygons, np.full(len(polygons), polygons.shape[1])) < 0
        return np.where(turned[:, None, None], polygons[:, ::-1], polygons), turned

    row, over = pairs
    flat, others = (
        np.einsum("mcd,mkd->mck", listed.corners[numbers] - middle[row][:, None], axes[row])
        for listed, numbers in zip(parts, pairs, strict=True)
    )
    near = (others.min(axis=1) <= flat.max(axis=1)).all(axis=1) & (others.max(axis=1) >= flat.min(axis=1)).all(axis=1)
    row, over, flat, others = row[near], over[near], flat[near], others[near]
    references = [listed.reference[numbers] for listed, numbers in zip(parts, (row, over), strict=True)]
    for k, polygons in enumerate((flat, others)):
        polygons[:], turned = counterclockwise(polygons)
        references[k] = np.where(turned[:, None, None], references[k][:, ::-1], references[k])
    polygons, count = common_polygons(flat, others)
    size = polygon_areas(flat, np.full(len(flat), flat.shape[1]))
    large = polygon_areas(polygons, count) > NO_PART * size
    row, over, flat, others, polygons, count = (values[large] for values in (row, over, flat, others, polygons, count))
    references = [reference[large] for reference in references]
    # A fan of triangles around the first corner of each.
    pair, corner = np.nonzero(np.arange(1, polygons.shape[1] - 1) < (count - 1)[:, None])
    start, arms = polygons[pair, 0], [polygons[pair, corner + end] - polygons[pair, 0] for end in (1, 2)]
    double = cross(*arms)
    p = (start[:, None] + points[:, :1] * arms[0][:, None] + points[:, 1:] * arms[1][:, None]).reshape(-1, 2)
    pair = np.repeat(pair, len(points))
    at, ratio = _within(flat[pair], references[0][pair], p)
    place, _ = _within(others[pair], references[1][pair], p)
    facet, of_master = parts[0].facet[row[pair]], parts[1].facet[over[pair]]
    area = (double[:, None] * weights).ravel() * slave.sizes(facet, at) / ratio
    if max(side.functions.degree for side in sides) > 1:
        centre, frame = middle[row[pair]], axes[row[pair]]
        x = np.einsum("rk,rkd->rd", slave.functions.at(at), slave.x[slave.facets[facet]])
        p = np.einsum("rd,rad->ra", x - centre, frame)
        nodes = np.einsum("rkd,rad->rka", master.x[master.facets[of_master]] - centre[:, None], frame)
        for _ in range(_STEPS):
            missed = p - np.einsum("rk,rka->ra", master.functions.at(place), nodes)
            tangents = np.einsum("brk,rka->rab", master.functions.slopes(place), nodes)
            step = np.linalg.solve(tangents, missed[..., None])[..., 0] if len(p) else missed
            place = place + step
            if np.abs(step).max(initial=0.0) <= ZERO_SUM:
                break
    return PartnerPoints(facet, at, of_master, place, area)


def _within(flat: Array, reference: Array, p: Array) -> tuple[Array, Array]:
    """The places of points of the plane, shape (r, 2), in the reference facet, from the corners of parts in 2D
    and there, shape (r, c, 2), and the area in 2D of a unit of the reference facet, shape (r,).
    """
    at = places_in_polygons(flat, p)
    s, t = at[:, :1], at[:, 1:]
    around = [1 - s - t, s, t] if flat.shape[1] == 3 else [(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t]
    hats = np.hstack(around)
    sizes = []
    for corners in (flat, reference):
        first, last = corners[:, 1] - corners[:, 0], corners[:, -1] - corners[:, 0]
        twist = 0 * first if flat.shape[1] == 3 else corners[:, 2] - corners[:, 1] - last
        sizes.append(np.abs(cross(first + t * twist, last + s * twist)))
    return np.einsum("rc,rcd->rd", hats, reference), sizes[0] / sizes[1]
