"""Facets of both sides of a pair, and their overlap, facet by facet, for ``paired_integrals``.

It shares no code with ``pairs``: shape functions are those of the cells, in 2D rays from points of the slave
meet the master, in 3D polygons of the slave are cut by those of the master (see ``paired_polygons``).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from paired_polygons import ROUND_OFF, STEPS, collapsed, cut, gauss, place_in, positive
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities, node_positions

Array = npt.NDArray[np.float64]

# Points of a rule along each direction: in 2D; in 3D for linear triangles and parallelograms, and for others,
# on which integrands may be no polynomials.
_POINTS = {"interval": 10, "triangle": 4, "quadrilateral": 10}
# Tangent of the angle between directions of projection along a facet and its normal in the middle.
_TURNING = 1.0
# Facets, in 3D their linear parts, whose normals have a larger product do not face each other.
_FACING = -0.2
# Distance from a parallelogram, relative to its diagonal, that is round-off.
_PARALLEL = 1e-9
# Beyond the smallest distance of both sides facets are partners within this share of the size of the smaller side.
_REACH = 0.2
# Share of a facet below which an overlap is round-off.
_NOTHING = 1e-9
# Of the quadrature of normals, exact where facets are straight.
_DEGREE = 8


class PairFacets:
    """Facets of all ranks, each made from its rows when it is asked for; collective.

    Args:
        space: the displacements.
        facets: those of this rank, local numbers.
        measure: by what areas are multiplied, by the global numbers of nodes; None: 1.

    Attributes:
        nodes: global numbers of their nodes, shape (f, k).
        points: those of them with test functions, see ``Facet``, shape (f, t).
        middle: the means of the positions of their nodes, length, shape (f, d).
    """

    def __init__(
        self, space: fem.FunctionSpace, facets: npt.NDArray[np.int32], measure: dict[int, float] | None = None
    ) -> None:
        self._measure = measure
        dim, layout, comm = int(space.mesh.geometry.dim), space.dofmap.dof_layout, space.mesh.comm
        self._element = space.element.basix_element
        count = len(basix.topology(self._element.cell_type)[dim - 1])
        self._closures = np.array([layout.entity_closure_dofs(dim - 1, k) for k in range(count)])
        x = node_positions(space)[:, :dim]
        cells, numbers = facet_entities(space.mesh, facets).T
        of_cells = space.dofmap.list[cells]
        nodes = of_cells[np.arange(len(cells))[:, None], self._closures[numbers]]
        names = space.dofmap.index_map.local_to_global(nodes.ravel()).reshape(nodes.shape)
        rows = numbers, names, x[nodes], x[of_cells].mean(axis=1)
        self._numbers, self.nodes, self._x, self._inside = (
            parallel.gather_rows(comm, local_rows) for local_rows in rows
        )
        self.points = _tested(self.nodes, dim)
        self._made: dict[int, Facet] = {}
        self.middle = self._x.mean(axis=1)
        self._radius = np.linalg.norm(self._x - self.middle[:, None], axis=2).max(axis=1)

    @property
    def x(self) -> Array:
        """Positions of their nodes, those of several facets several times, length, shape (f k, d)."""
        return np.asarray(self._x.reshape(-1, self._x.shape[2]))

    def __getitem__(self, k: Any) -> Facet:
        if k not in self._made:
            closure = self._closures[self._numbers[k]]
            names, measure = self.nodes[k], None
            if self._measure is not None:
                measure = np.array([self._measure[int(node)] for node in names])
            rows = self._x[k], self._inside[k], measure
            self._made[k] = Facet(self._element, int(self._numbers[k]), closure, names, *rows)
        return self._made[k]

    def around(self, nodes: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """The facets that have some of these nodes."""
        return np.flatnonzero(np.isin(self.nodes, nodes).any(axis=1))

    def near(self, facet: Facet, reach: float) -> npt.NDArray[np.int64]:
        """The facets that may be over or under another one within a distance, as it sees them along its normal."""
        apart = self.middle - facet.bounds[0] / 2 - facet.bounds[1] / 2
        along = apart @ facet.outward
        beyond = self._radius + facet.size
        across = np.sqrt(np.maximum(np.sum(apart**2, axis=1) - along**2, 0.0))
        return np.flatnonzero((np.abs(along) <= reach + beyond) & (across <= beyond + _TURNING * np.abs(along)))


def usual_reach(slave: PairFacets, master: PairFacets) -> float:
    """The distance beyond which facets are no partners where the problem names none, length."""
    nearest = float(cKDTree(master.x).query(slave.x)[0].min())
    return nearest + _REACH * min(float(np.linalg.norm(np.ptp(side.x, axis=0))) for side in (slave, master))


class Facet:
    """A facet as the cell that it is of sees it.

    Args:
        element: of the displacement.
        number: of the facet in its cell.
        closure: its nodes in the cell, shape (k,).
        nodes: their global numbers, shape (k,).
        x: their positions, length, shape (k, d).
        inside: the middle of the cell, shape (d,).
        measure: by what areas are multiplied at the nodes, shape (k,); None: 1.

    Attributes:
        nodes: see above.
        points: those with test functions, the vertices on quadratic triangles, shape (t,).
        kind: interval, triangle or quadrilateral.
        rule: points of a rule along each direction.
        quadratic: whether it has nodes between its vertices.
    """

    def __init__(
        self,
        element: Any,
        number: int,
        closure: npt.NDArray[Any],
        nodes: npt.NDArray[np.int64],
        x: Array,
        inside: Array,
        measure: Array | None = None,
    ) -> None:
        self._measure = measure
        dim = x.shape[1]
        self._element, self._closure, self._x, self._inside, self.nodes = element, closure, x, inside, nodes
        corner = basix.topology(element.cell_type)[dim - 1][number]
        vertices = basix.geometry(element.cell_type)
        self._start, *ends = vertices[corner[:dim]]
        self._along = np.array(ends) - self._start
        self.kind = {(2, 2): "interval", (3, 3): "triangle", (3, 4): "quadrilateral"}[dim, len(corner)]
        self.quadratic = len(self.nodes) > len(corner)
        self.points = _tested(self.nodes, dim)
        self._quadratic_triangle = len(self.points) < len(self.nodes)
        straight = self.kind == "triangle" or (self.kind == "quadrilateral" and _is_parallelogram(x))
        self.rule = _POINTS["triangle" if straight and not self.quadratic else "quadrilateral"]
        self._corner = np.array(corner)

    def _tabulated(self, at: Array, order: int) -> Array:
        points = self._start + at @ self._along
        return np.asarray(self._element.tabulate(order, points)[..., 0][..., self._closure])

    def shape(self, at: Array) -> Array:
        """Shape functions at places of shape (q, d - 1), shape (q, k)."""
        return np.asarray(self._tabulated(at, 0)[0])

    def hats(self, at: Array) -> Array:
        """The functions that test functions are dual to, shape (q, t)."""
        if not self._quadratic_triangle:
            return self.shape(at)
        hats = basix.create_element(basix.ElementFamily.P, self._element.cell_type, 1)
        return np.asarray(hats.tabulate(0, self._start + at @ self._along)[0, :, self._corner, 0].T)

    def place(self, at: Array) -> Array:
        """Positions, length, shape (q, d)."""
        return np.asarray(self.shape(at) @ self._x)

    @property
    def corners(self) -> Array:
        """Positions of its nodes, length, shape (k, d)."""
        return self._x

    def tangents(self, at: Array) -> Array:
        """Derivatives of the position along the facet, shape (d - 1, q, d)."""
        slopes = self._tabulated(at, 1)[1:]
        return np.einsum("st,tqk,kd->sqd", self._along, slopes, self._x)

    def areas(self, at: Array) -> Array:
        """Area (in 2D: length) of a unit of the reference facet, shape (q,)."""
        return np.asarray(np.linalg.norm(self._across(at), axis=1))

    def measured(self, at: Array) -> Array:
        """The same times the measure there."""
        return self.areas(at) * (1.0 if self._measure is None else self.shape(at) @ self._measure)

    def without_area(self, node: int) -> bool:
        """Whether the function of a node has none: on the axis of a body of revolution those of quadratic facets."""
        if self._measure is None or not self.quadratic:
            return False
        return bool(self._measure[self.nodes == node][0] <= _NOTHING * self._measure.max())

    def _across(self, at: Array) -> Array:
        tangents = self.tangents(at)
        if len(tangents) == 1:
            return np.stack((tangents[0][:, 1], -tangents[0][:, 0]), axis=1)
        return np.cross(tangents[0], tangents[1])

    @cached_property
    def middle(self) -> Array:
        """The place in the middle of the reference facet, shape (1, d - 1)."""
        return np.full((1, len(self._along)), 1.0 / 3.0 if self.kind == "triangle" else 0.5)

    @cached_property
    def _sign(self) -> float:
        return float(np.sign(self._across(self.middle)[0] @ (self.place(self.middle)[0] - self._inside)))

    def normal(self, at: Array) -> Array:
        """Outward unit normals, shape (q, d)."""
        across = self._across(at)
        return np.asarray(self._sign * across / np.linalg.norm(across, axis=1, keepdims=True))

    @cached_property
    def outward(self) -> Array:
        """The normal in the middle, shape (d,)."""
        return np.asarray(self.normal(self.middle)[0])

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Smallest and largest coordinates of its nodes."""
        return self._x.min(axis=0), self._x.max(axis=0)

    @property
    def size(self) -> float:
        """Length of its diagonal."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @cached_property
    def area(self) -> float:
        """Its area, roughly."""
        share = 0.5 if self.kind == "triangle" else 1.0
        return float(share * self.measured(self.middle)[0])

    @property
    def linear_parts(self) -> list[Array]:
        """Corners of its linear parts in the reference facet, in order, shape (c, 2) each."""
        if self.kind == "triangle":
            a, b, c = np.eye(3)[:, 1:]
            ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
            listed = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)] if self.quadratic else [(a, b, c)]
        else:
            cuts = (0.0, 0.5, 1.0) if self.quadratic else (0.0, 1.0)
            spans = list(pairwise(cuts))
            listed = [((s, t), (S, t), (S, T), (s, T)) for s, S in spans for t, T in spans]  # type: ignore[misc]
        return [np.array(corners) for corners in listed]

    @cached_property
    def placed_parts(self) -> list[tuple[Array, Array]]:
        """The linear parts, and the positions of their corners, length, shape (c, 3) each."""
        return [(part, self.place(part)) for part in self.linear_parts]

    @cached_property
    def outward_of_parts(self) -> Array:
        """Outward unit normals of the linear parts, shape (parts, 3)."""
        across = np.array([np.cross(x[2] - x[0], x[-1] - x[1]) for _, x in self.placed_parts])
        across *= np.sign(np.sum(across * self.normal(np.array([p.mean(axis=0) for p in self.linear_parts])), axis=1))[
            :, None
        ]
        return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))

    @cached_property
    def flat_parts(self) -> list[FlatPart]:
        """The linear parts in their planes."""
        return [FlatPart.of(part, corners) for part, corners in self.placed_parts]


def _tested(nodes: npt.NDArray[np.int64], dim: int) -> npt.NDArray[np.int64]:
    """Those nodes of facets, shape (..., k), that have test functions: the vertices on quadratic triangles."""
    return nodes[..., :3] if dim == 3 and nodes.shape[-1] == 6 else nodes


def _is_parallelogram(x: Array) -> bool:
    """Whether four nodes, numbered along x first, are the corners of one, shape (4, d); False for more nodes."""
    return len(x) == 4 and bool(np.linalg.norm(x[0] - x[1] - x[2] + x[3]) <= _PARALLEL * np.linalg.norm(x[3] - x[0]))


@dataclass(frozen=True)
class FlatPart:
    """A linear part of a facet in 3D, projected onto a plane through its centre.

    Attributes:
        part: its corners in the reference facet, shape (c, 2).
        centre: shape (3,).
        axes: of the plane, shape (2, 3).
        flat: the projected corners, length, shape (c, 2).
    """

    part: Array
    centre: Array
    axes: Array
    flat: Array

    @classmethod
    def of(cls, part: Array, corners: Array, normal: Array | None = None) -> FlatPart:
        """From the corners in the reference facet and their positions; ``normal``: of the plane; None: of the part."""
        centre = corners.mean(axis=0)
        if normal is None:
            normal = np.cross(corners[2] - corners[0], corners[-1] - corners[1])  # of a triangle: two of its sides
        axes = np.linalg.svd(normal[None] / np.linalg.norm(normal))[2][1:]
        return cls(part, centre, axes, (corners - centre) @ axes.T)

    @property
    def size(self) -> float:
        """Length of the diagonal."""
        return float(np.linalg.norm(np.ptp(self.flat, axis=0)))


@dataclass(frozen=True)
class OverlapPiece:
    """A piece of the overlap.

    Attributes:
        master: the facet over it.
        at: points of the slave in its reference facet, shape (q, d - 1).
        over: those of the master over them, shape (q, d - 1).
        weight: area that they stand for, shape (q,).
    """

    master: Facet
    at: Array
    over: Array
    weight: Array


def pieces_of(
    facet: Facet, masters: Sequence[Facet], reach: float, normals: dict[int, Array] | None = None
) -> list[OverlapPiece]:
    """The overlap of a slave facet with the facets of the other side.

    Args:
        facet: of the slave.
        masters: those of the other side that are near.
        reach: mean distance beyond which facets are no partners, length.
        normals: directions of projection at the points of the slave, which are interpolated; in 3D None: normals of
            the linear parts of the slave.
    """
    overlap: list[OverlapPiece] = []
    if facet.kind == "interval":
        assert normals is not None
        masters = [master for master in masters if facet.outward @ master.outward < _FACING]
        at_nodes = np.array([normals[int(node)] for node in facet.nodes])
        by_master = [_in_plane(facet, master, at_nodes) for master in masters]
    else:
        directions = None if normals is None else np.array([normals[int(node)] for node in facet.points])
        by_master = _in_space(facet, masters, directions)
    for master, pieces in zip(masters, by_master, strict=True):
        moment = sum(piece.weight @ (master.place(piece.over) - facet.place(piece.at)) for piece in pieces)
        if pieces and np.linalg.norm(moment) <= reach * sum(piece.weight.sum() for piece in pieces):
            overlap += pieces
    return overlap


def _in_plane(facet: Facet, master: Facet, normals: Array) -> list[OverlapPiece]:
    """Rays along the continuous normal: the places of the slave from which they meet the master."""

    def met(s: Array) -> Array:
        """The place on the master that the ray from each place meets, beyond its ends if it must."""
        at = s[:, None]
        x, normal = facet.place(at), facet.shape(at) @ normals
        parameters: Array = np.full(s.size, 0.5)
        for _ in range(STEPS):
            apart, along = master.place(parameters[:, None]) - x, master.tangents(parameters[:, None])[0]
            miss, slope = (u[:, 0] * normal[:, 1] - u[:, 1] * normal[:, 0] for u in (apart, along))
            parameters = parameters - miss / slope
            if np.abs(miss / slope).max() < ROUND_OFF:
                break
        return parameters

    ends = met(np.array([0.0, 1.0]))
    lowest, highest = float(ends.min()), float(ends.max())
    if lowest >= 1.0 - _NOTHING or highest <= _NOTHING:
        return []

    def beyond(s: float, value: float) -> float:
        return float(met(np.array([s]))[0]) - value

    passed = [value for value in (0.0, 1.0) if lowest + _NOTHING < value < highest - _NOTHING]
    cuts = sorted({0.0, 1.0, *(float(brentq(beyond, 0.0, 1.0, (value,), xtol=ROUND_OFF)) for value in passed)})
    nodes, weights = gauss(_POINTS["interval"])
    pieces = []
    for first, last in pairwise(cuts):
        at = first + (last - first) * (nodes + 1) / 2
        over = met(at)
        if last - first > _NOTHING and 0.0 <= over[len(over) // 2] <= 1.0:
            weight = facet.measured(at[:, None]) * weights / 2 * (last - first)
            pieces.append(OverlapPiece(master, at[:, None], over[:, None], weight))
    return pieces


def _in_space(facet: Facet, masters: Sequence[Facet], directions: Array | None) -> list[list[OverlapPiece]]:
    """The linear parts of the slave, each cut by those of the masters in its plane: the pieces with each master."""
    pieces: list[list[OverlapPiece]] = [[] for _ in masters]
    parts = facet.flat_parts
    if directions is not None:
        along = [(facet.hats(part.mean(axis=0, keepdims=True)) @ directions)[0] for part, _ in facet.placed_parts]
        parts = [FlatPart.of(*placed, normal) for placed, normal in zip(facet.placed_parts, along, strict=True)]
    for slave_part, outward in zip(parts, facet.outward_of_parts, strict=True):
        centre, axes, flat = slave_part.centre, slave_part.axes, slave_part.flat
        # Number and corners of a part of a master, in its reference facet and in 2D; points and their weights.
        shared: list[tuple[int, Array, Array, Array, Array]] = []
        for number, master in enumerate(masters):
            for (reference, corners), normal in zip(master.placed_parts, master.outward_of_parts, strict=True):
                if float(np.dot(outward, normal)) >= _FACING:
                    continue
                window = (corners - centre) @ axes.T
                if (window.min(axis=0) > flat.max(axis=0)).any() or (window.max(axis=0) < flat.min(axis=0)).any():
                    continue
                polygon = cut(positive(flat), positive(window))
                if len(polygon) < 3:
                    continue
                p, weight = collapsed(polygon, max(facet.rule, master.rule))
                if weight.sum() > _NOTHING * slave_part.size**2:
                    shared.append((number, reference, window, p, weight))
        if not shared:
            continue
        met, references, windows, points, weights = zip(*shared, strict=True)
        counts = [len(p) for p in points]
        p, ends = np.concatenate(points), np.cumsum(counts)[:-1]
        at, unit = place_in(slave_part.part[None], flat[None], p)
        weight = np.concatenate(weights) * facet.measured(at) / unit
        over, _ = place_in(np.repeat(references, counts, axis=0), np.repeat(windows, counts, axis=0), p)
        if facet.quadratic:  # as are all then; others are projected like their corners
            p = (facet.place(at) - centre) @ axes.T
        split = zip(met, *(np.split(rows, ends) for rows in (at, over, p, weight)), strict=True)
        for number, at_own, over_own, p_own, weight_own in split:
            master = masters[number]
            if facet.quadratic:
                over_own = _under(master, over_own, p_own, centre, axes)
            pieces[number].append(OverlapPiece(master, at_own, over_own, weight_own))
    return pieces


def _under(facet: Facet, at: Array, p: Array, centre: Array, axes: Array) -> Array:
    """The places of a facet that lie over points of the plane, by Newton's method."""
    for _ in range(STEPS):
        residual = p - (facet.place(at) - centre) @ axes.T
        jacobian = np.einsum("sqd,kd->qks", facet.tangents(at), axes)
        step = np.linalg.solve(jacobian, residual[:, :, None])[:, :, 0]
        at = at + step
        if np.abs(step).max() < ROUND_OFF:
            break
    return at


def mean_normals(facets: Sequence[Facet]) -> dict[int, Array]:
    """The means of the normals around each node with test functions, and between the vertices of quadratic triangles
    of those at both, of length one.
    """
    sums: dict[int, Array] = defaultdict(lambda: np.zeros(facets[0].outward.size))
    for facet in facets:
        at, weights = basix.make_quadrature(getattr(basix.CellType, facet.kind), _DEGREE)
        moments = facet.hats(at).T @ (facet.normal(at) * (facet.areas(at) * weights)[:, None])
        for node, moment in zip(facet.points, moments, strict=True):
            sums[int(node)] += moment
    return {node: moment / np.linalg.norm(moment) for node, moment in sums.items()}
