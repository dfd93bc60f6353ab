"""Triangles at the contact of two bodies divided from their opposite corners, with a displacement of degree 2.

Facets of both sides match after that, so that tractions (B2) of docs/theory.md are exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.paired_parts import PairedParts
from signorini_fx.addons.bounds.simplices import EDGES, Simplices
from signorini_fx.addons.bounds.stress_products import energy
from signorini_fx.tuned import NO_PART


@dataclass(frozen=True)
class SplitTriangles:
    """Triangles whose facets on both sides of contacts match.

    Attributes:
        t: the triangles; vertices of the whole ones come first.
        parents: those that they were cells_given, with moved nodes.
        parent: the whole one that each is in, shape (n,).
        divided: the facets of each divided facet from its first vertex on.
        vertex: at the ends of each contact on both sides, shapes (ends, 2).
    """

    t: Simplices
    parents: Simplices
    parent: Ints
    divided: dict[int, Ints]
    vertex: list[Ints]

    @classmethod
    def of(cls, t: Simplices, contacts: list[PairedParts]) -> SplitTriangles:
        """Divide.

        Args:
            t: the triangles, with moved nodes.
            contacts: the parts of each contact.
        """
        x: list[Array] = [np.asarray(point) for point in t.x]
        breaks, vertices = dict[int, list[tuple[float, int]]](), list[Ints]()
        jumps = set[int]()
        for parts in contacts:
            vertex = parts.vertex.copy()
            for end in np.unique(parts.ends):
                for side in np.flatnonzero(parts.vertex[end] < 0):
                    facet, at = int(parts.facet[end, side]), parts.x[end, side]
                    along = t.x[t.facets[facet]]
                    way = along[1] - along[0]
                    parameter, on_facet = float((at - along[0]) @ way / (way @ way)), breaks.setdefault(facet, [])
                    met = [number for met_at, number in on_facet if abs(met_at - parameter) <= NO_PART]
                    if not met:
                        on_facet.append((parameter, len(x)))
                        x.append(at)
                    vertex[end, side] = met[0] if met else len(x) - 1
                    if (parts.ends == end).sum() == 1:
                        jumps.add(int(vertex[end, side]))
            vertices.append(vertex)
        inner = {facet: [number for _, number in sorted(places)] for facet, places in breaks.items()}
        of_cell = dict[int, list[int]]()
        for facet in inner:
            of_cell.setdefault(int(t.sides[facet, 0]), []).append(facet)
        intact = np.setdiff1d(np.arange(len(t.corners)), list(of_cell))
        corners, parent = [t.corners[intact]], [intact]
        for cell, facets in of_cell.items():
            fans = _fans(t.corners[cell].tolist(), [(*t.facets[facet].tolist(), inner[facet]) for facet in facets])
            for jump in jumps.intersection(chain.from_iterable(inner[facet] for facet in facets)):
                fans = _enriched(fans, jump, x)
            corners.append(np.array(fans, dtype=np.int64))
            parent.append(np.full(len(fans), cell))
        owner = np.concatenate(parent)
        split = Simplices(np.array(x), np.concatenate(corners), t.moduli.of(owner))
        divided = dict[int, Ints]()
        for facet, numbers in inner.items():
            row = np.array([t.facets[facet, 0], *numbers, t.facets[facet, 1]])
            divided[facet] = _numbers(split, np.stack((row[:-1], row[1:]), axis=1))
        return cls(split, t, owner, divided, vertices)

    def parts_of(self, facets: Ints) -> tuple[Ints, Ints]:
        """The parts of facets of the whole triangles, one after the other, and the whole facet that each is in."""
        undivided = _numbers(self.t, self.parents.facets[facets])
        parts = [self.divided.get(int(facet), undivided[[row]]) for row, facet in enumerate(facets)]
        return np.concatenate(parts), np.repeat(facets, [len(numbers) for numbers in parts])

    def between(self, first: Ints, last: Ints) -> Ints:
        """The facets between vertices, shape (m,)."""
        return _numbers(self.t, np.stack((first, last), axis=1))

    def carried(self, y: Array, middle: Array) -> tuple[Array, Array]:
        """A displacement of the whole triangles at vertices and middles of edges, length, shapes (v, 2) and (e, 2)."""
        t, parents = self.t, self.parents
        at = np.zeros((len(t.x), 2))
        at[: len(y)] = y
        cells, corners = np.nonzero(t.corners >= len(y))
        values = evaluated(parents, y, middle, self.parent[cells], t.x[t.corners[cells, corners]])
        at[t.corners[cells, corners]] = values
        between = np.zeros((len(t.edges), 2))
        ends = t.x[t.corners[:, EDGES[2]]].mean(axis=2)
        owners = np.repeat(self.parent, 3)
        between[t.edges_of.ravel()] = evaluated(parents, y, middle, owners, ends.reshape(-1, 2))
        numbers = np.searchsorted(t.keys(t.edges), t.keys(parents.edges)).clip(max=len(t.edges) - 1)
        matching = (t.edges[numbers] == parents.edges).all(axis=1)
        between[numbers[matching]] = middle[matching]
        return at, between


def _numbers(t: Simplices, vertices: Ints) -> Ints:
    """The facets with these vertices; any where there is none."""
    return np.searchsorted(t.keys(t.facets), t.keys(np.sort(vertices, axis=1))).clip(max=len(t.facets) - 1)


def _fans(corners: list[int], facets: list[tuple[int, int, list[int]]]) -> list[list[int]]:
    """A triangle divided at vertices on its facets, each given by its ends and the vertices between them in order."""
    triangles = [corners]
    for first, last, inner in facets:
        for number, triangle in enumerate(triangles):
            if first in triangle and last in triangle:
                opposite = next(corner for corner in triangle if corner not in (first, last))
                turned = triangle.index(last) == (triangle.index(first) + 1) % 3
                row = [first, *inner, last] if turned else [last, *inner[::-1], first]
                triangles[number : number + 1] = [[a, b, opposite] for a, b in pairwise(row)]
                break
    return triangles


def _enriched(triangles: list[list[int]], jump: int, x: list[Array]) -> list[list[int]]:
    """Triangles of which the two at a vertex on the boundary are divided, so that four meet there: where contact ends a
    traction jumps, and from one edge to the next a stress turns the less the more edges there are.
    """
    around = [triangle for triangle in triangles if jump in triangle]
    shared = set(around[0]) & set(around[1]) - {jump} if len(around) == 2 else set[int]()
    if len(shared) != 1:
        return triangles
    apex = shared.pop()
    sides = [next(corner for corner in triangle if corner not in (jump, apex)) for triangle in around]
    way = x[apex] - x[jump]
    base = min(float(np.linalg.norm(x[side] - x[jump])) for side in sides)
    middle = len(x)
    x.append(x[jump] + min(0.5, base / float(np.linalg.norm(way))) * way)
    divided = [triangle for triangle in triangles if jump not in triangle]
    for side in sides:
        between = len(x)
        x.append((x[side] + x[middle]) / 2)
        for triangle in (
            [jump, side, between],
            [jump, between, middle],
            [apex, side, between],
            [apex, between, middle],
        ):
            a, b = x[triangle[1]] - x[triangle[0]], x[triangle[2]] - x[triangle[0]]
            divided.append(triangle if a[0] * b[1] > a[1] * b[0] else [triangle[k] for k in (0, 2, 1)])
    return divided


def evaluated(t: Simplices, y: Array, middle: Array, cells: Ints, x: Array) -> Array:
    """A displacement of degree 2 at points of some cells, length, shape (n, 2)."""
    local = barycentric(t, cells, x)
    values = np.einsum("nc,ncd->nd", local, y[t.corners[cells]])
    bubble = (middle - y[t.edges].mean(axis=1))[t.edges_of[cells]]
    a, b = EDGES[2].T
    return np.asarray(values + np.einsum("ne,ned->nd", 4 * local[:, a] * local[:, b], bubble))


def barycentric(t: Simplices, cells: Ints, x: Array) -> Array:
    """Coordinates of a point in each of some cells, shape (n, 3)."""
    away = x - t.x[t.corners[cells, 0]]
    inner = np.einsum("nij,nj->ni", t.gradients[cells, 1:], away)
    return np.column_stack((1 - inner.sum(axis=1), inner))


def with_moved_nodes(
    cells_given: Simplices, placed: Simplices, y: Array, middle: Array
) -> tuple[Array, Array, float, npt.NDArray[np.bool_]]:
    """A displacement on triangles of which some nodes have moved along the boundary: what interpolates it.

    Args:
        cells_given: the triangles.
        placed: the same with these nodes elsewhere.
        y: at vertices, length, shape (v, 2).
        middle: at middles of edges, shape (e, 2).

    Returns:
        The interpolating one at both, the square of the energy norm of the difference, and the cells with one.
    """
    moved_nodes = (cells_given.x != placed.x).any(axis=1)
    touched = moved_nodes[cells_given.corners].any(axis=1)
    if not touched.any():
        return y, middle, 0.0, touched
    cells = np.flatnonzero(touched)
    y_after, middle_after = y.copy(), middle.copy()
    edges = np.unique(cells_given.edges_of[cells])
    edges = edges[moved_nodes[cells_given.edges[edges]].any(axis=1)]
    nodes = np.flatnonzero(moved_nodes)
    for places, values, numbers, vertices in (
        (placed.x, y_after, nodes, nodes[:, None]),
        (placed.x[placed.edges].mean(axis=1), middle_after, edges, cells_given.edges[edges]),
    ):
        for number, ends in zip(numbers, vertices, strict=True):
            around = cells[np.isin(cells_given.corners[cells], ends).any(axis=1)]  # of the same body
            at = np.tile(places[number], (len(around), 1))
            nearest = around[[barycentric(cells_given, around, at).min(axis=1).argmax()]]
            values[number] = evaluated(cells_given, y, middle, nearest, at[:1])[0]
    strains = cells_given.strain_at_corners(y, middle), placed.strain_at_corners(y_after, middle_after)
    corners, owners, differences = [], [], []
    for cell in cells:
        beside = cells[np.isin(cells_given.corners[cells], cells_given.corners[cell]).any(axis=1)]
        for moved_cell in beside:
            polygon = clipped(cells_given.x[cells_given.corners[cell]], placed.x[placed.corners[moved_cell]])
            for k in range(1, len(polygon) - 1):
                triangle = polygon[[0, k, k + 1]]
                strain_of = [
                    barycentric(t, np.full(3, number), triangle) @ strain[number]
                    for t, number, strain in zip((cells_given, placed), (cell, moved_cell), strains, strict=True)
                ]
                corners.append(triangle)
                owners.append(cell)
                differences.append(strain_of[0] - strain_of[1])
    pieces = Simplices(
        np.concatenate(corners), np.arange(3 * len(corners)).reshape(-1, 3), cells_given.moduli.of(np.array(owners))
    )
    return y_after, middle_after, float(energy(pieces, np.array(differences)).clip(min=0.0).sum()), touched


def clipped(polygon: Array, triangle: Array) -> Array:
    """The part of a convex polygon inside a triangle, both counterclockwise, shape (k, 2)."""
    for corner in range(3):
        first, last = triangle[corner], triangle[(corner + 1) % 3]
        if not len(polygon):
            break
        way = last - first
        height = way[0] * (polygon[:, 1] - first[1]) - way[1] * (polygon[:, 0] - first[0])
        points = []
        for k in range(len(polygon)):
            a, b, following = height[k], height[(k + 1) % len(polygon)], polygon[(k + 1) % len(polygon)]
            if a >= 0:
                points.append(polygon[k])
            if (a > 0 > b) or (a < 0 < b):
                points.append(polygon[k] + a / (a - b) * (following - polygon[k]))
        polygon = np.array(points).reshape(-1, 2)
    return polygon
