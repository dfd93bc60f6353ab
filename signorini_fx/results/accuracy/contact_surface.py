"""The contact surface of a body in 3D in flat pieces, between whose corners nodal values are linear.

A facet of triangles or quadrilaterals of degree 1 is a piece, one of degree 2 is four.  What follows an arc length in
the plane has a counterpart here that needs no order of the nodes: slopes from piece to piece.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_table import ContactTable

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

# Corners of the pieces of a facet with so many nodes, one after the other around the piece.  Nodes as basix has them:
# vertices, middles of edges, the middle.
_TRIANGLE, _QUADRILATERAL = [[0, 1, 2]], [[0, 1, 3, 2]]
_PIECES = {
    3: _TRIANGLE,
    4: _QUADRILATERAL,
    6: [[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]],
    9: [[0, 4, 8, 5], [4, 1, 6, 8], [5, 8, 7, 2], [8, 6, 3, 7]],
}
# Pieces near a point that are looked at for the one that it is in.
_NEAR = 8


@dataclass(frozen=True)
class ContactSurface:
    """The pieces, k corners each, 3 or 4.

    Attributes:
        x: position of the nodes, length, shape (rows, 3).
        corners: the rows of the contact table at the corners of each piece, around it, shape (pieces, k).
        part: position in ``statement.contact`` of the boundary that each piece is of, shape (pieces,).
        per_facet: how many pieces a facet has; those of one facet follow each other.
        facets: which facets of the table have pieces: between two bodies those whose nodes all carry a point.
        count: of all facets of the table.
    """

    x: Floats
    corners: Ints
    part: Ints
    per_facet: int
    facets: Ints
    count: int

    @classmethod
    def of(cls, table: ContactTable) -> ContactSurface:
        """The contact surface of a table in 3D."""
        assert table.facets is not None
        assert table.nodes is not None
        facets = table.facets
        vertices = {6: 3, 9: 4}.get(facets.shape[1], facets.shape[1])
        if (facets[:, vertices:] < 0).all():  # no contact nodes but the vertices
            facets = facets[:, :vertices]
        complete = np.flatnonzero((facets >= 0).all(axis=1))
        pieces = np.array(_PIECES[facets.shape[1]])
        corners = facets[complete][:, pieces].reshape(-1, pieces.shape[1])
        x = np.column_stack([table.columns[axis] for axis in "xyz"])
        return cls(x, corners, table.nodes[corners[:, 0], 0], len(pieces), complete, len(facets))

    @cached_property
    def _normal_area(self) -> Floats:
        x = self.x[self.corners]
        return np.asarray(np.cross(x, np.roll(x, -1, axis=1)).sum(axis=1) / 2)

    @cached_property
    def area(self) -> Floats:
        """Of each piece, shape (pieces,)."""
        return np.asarray(np.linalg.norm(self._normal_area, axis=1))

    @cached_property
    def normal(self) -> Floats:
        """Unit normal of each piece, in or out, shape (pieces, 3)."""
        return np.asarray(self._normal_area / self.area[:, None])

    @cached_property
    def _edges(self) -> Floats:
        x = self.x[self.corners]
        return np.asarray(np.roll(x, -1, axis=1) - x)

    @cached_property
    def sides(self) -> Floats:
        """Length of the sides of each piece, the first from its first corner to its second, shape (pieces, k)."""
        return np.asarray(np.linalg.norm(self._edges, axis=2))

    @cached_property
    def outward(self) -> Floats:
        """Unit vectors in the plane of each piece, across each side and out of the piece, shape (pieces, k, 3)."""
        across = np.cross(self._edges, self.normal[:, None, :])
        return np.asarray(across / np.linalg.norm(across, axis=2, keepdims=True))

    @cached_property
    def heights(self) -> Floats:
        """Of each piece over each of its sides, shape (pieces, k)."""
        share = 2 if self.corners.shape[1] == 3 else 1
        return np.asarray(share * self.area[:, None] / self.sides)

    @cached_property
    def across(self) -> Ints:
        """The same side of the neighbour, as piece times k plus side; -1 at the rim; shape (pieces, k)."""
        ends = np.sort(np.stack((self.corners, np.roll(self.corners, -1, axis=1)), axis=2).reshape(-1, 2), axis=1)
        _, first, inverse, count = np.unique(ends, axis=0, return_index=True, return_inverse=True, return_counts=True)
        inverse = inverse.ravel()
        total = np.zeros(len(first), dtype=np.int64)
        np.add.at(total, inverse, np.arange(len(inverse)))
        opposite = np.where(count[inverse] == 2, total[inverse] - np.arange(len(inverse)), -1)
        return np.asarray(opposite.reshape(self.corners.shape))

    @cached_property
    def rim(self) -> npt.NDArray[np.bool_]:
        """Which sides have no neighbour: there the contact boundary ends; shape (pieces, k)."""
        return np.asarray(self.across < 0)

    @property
    def rim_nodes(self) -> npt.NDArray[np.bool_]:
        """Which rows of the table are on the rim, shape (rows,)."""
        on_rim = np.zeros(len(self.x), dtype=bool)
        on_rim[self.corners[self.rim]] = True
        on_rim[np.roll(self.corners, -1, axis=1)[self.rim]] = True
        return on_rim

    def jumps(self, values: Floats) -> Floats:
        """How much the slope across each side changes from one piece to the next, shape (pieces, k); 0 at the rim;
        ``values``: at the nodes, shape (rows,).
        """
        corner_values = values[self.corners]
        middle = (corner_values + np.roll(corner_values, -1, axis=1)) / 2
        # The mean gradient by the divergence theorem, exact for what is linear.
        gradient = np.einsum("ij,ijk->ik", middle * self.sides, self.outward) / self.area[:, None]
        slopes = np.einsum("ik,ijk->ij", gradient, self.outward)
        return np.where(self.rim, 0.0, slopes + slopes.ravel()[self.across])

    def turns(self) -> Floats:
        """Angle between each piece and its neighbours, radians, shape (pieces, k); 0 at the rim."""
        neighbour_normal = self.normal[np.maximum(self.across, 0) // self.corners.shape[1]]
        # Orders around pieces may differ: then one normal points in.
        cosine = np.abs(np.einsum("ik,ijk->ij", self.normal, neighbour_normal))
        sine = np.linalg.norm(np.cross(self.normal[:, None, :], neighbour_normal), axis=2)
        return np.where(self.rim, 0.0, np.arctan2(sine, cosine))

    def at(self, points: Floats, values: Floats, part: int) -> Floats:
        """Values between the nodes of a boundary; beside the surface those at a place on its rim that is near;
        ``points``: shape (n, 3); ``values``: at the nodes, shape (rows, m); ``part``: position of the boundary in
        ``statement.contact``; shape (n, m).

        Returns:
            Shape (n, m).
        """
        pieces = np.flatnonzero(self.part == part)
        count = min(_NEAR, pieces.size)
        centres = self.x[self.corners[pieces]].mean(axis=1)
        near = pieces[cKDTree(centres).query(points, count)[1].reshape(-1, count)]
        weights = self._weights(near, points)
        # The piece that holds the point is that whose nearest point is nearest.
        nearest = np.einsum("nck,nckd->ncd", weights, self.x[self.corners[near]])
        best = np.linalg.norm(nearest - points[:, None, :], axis=2).argmin(axis=1)
        rows = np.arange(len(points))
        return np.einsum("nk,nkm->nm", weights[rows, best], values[self.corners[near[rows, best]]])

    def _weights(self, pieces: Ints, points: Floats) -> Floats:
        """Weights of the corners at the place in each piece, shape (n, c), that is near a point, shape (n, c, k)."""
        x = self.x[self.corners[pieces]]
        if x.shape[2] == 3:
            a, b = x[:, :, 1] - x[:, :, 0], x[:, :, 2] - x[:, :, 0]
            s, t = _affine(a, b, points[:, None, :] - x[:, :, 0])
            weights = np.maximum(np.stack((1 - s - t, s, t), axis=2), 0.0)
            return np.asarray(weights / weights.sum(axis=2, keepdims=True))
        a = (x[:, :, 1] + x[:, :, 2] - x[:, :, 0] - x[:, :, 3]) / 2
        b = (x[:, :, 2] + x[:, :, 3] - x[:, :, 0] - x[:, :, 1]) / 2
        s, t = (
            np.clip(coordinate + 0.5, 0.0, 1.0) for coordinate in _affine(a, b, points[:, None, :] - x.mean(axis=2))
        )
        return np.stack(((1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t), axis=2)

    def of_rank(self, boundary: ContactBoundary, values: Floats) -> Floats:
        """Sums of what the pieces have for each facet of this rank, as in ``boundary.segments``; ``values``: of each
        piece, shape (pieces,); collective.
        """
        first = parallel.rows_before(boundary.comm, len(boundary.segments))
        facets = np.zeros(self.count)
        facets[self.facets] = values.reshape(-1, self.per_facet).sum(axis=1)
        return np.asarray(facets[first : first + len(boundary.segments)])


def _affine(a: Floats, b: Floats, d: Floats) -> tuple[Floats, Floats]:
    """S and t with s a + t b nearest to d, shapes (n, c, 3) -> (n, c)."""
    aa, ab, bb = (np.einsum("nck,nck->nc", first, second) for first, second in ((a, a), (a, b), (b, b)))
    ad, bd = (np.einsum("nck,nck->nc", first, d) for first in (a, b))
    determinant = aa * bb - ab**2
    return (bb * ad - ab * bd) / determinant, (aa * bd - ab * ad) / determinant


def places(table: ContactTable) -> npt.NDArray[np.float64]:
    """The positions of the nodes in 2D, length, shape (rows, 2)."""
    return np.column_stack((table.columns["x"], table.columns["y"]))


def interpolated(coarse: ContactTable, fine: ContactTable, name: str) -> npt.NDArray[np.float64]:
    """A column of the coarse table at the nodes of the fine one, interpolated on the facet that is nearest there.

    Arc lengths would not do: that of a curve grows with the facets, and between two bodies pieces begin elsewhere.
    """
    if fine.facets is not None:
        return _interpolated_in_space(coarse, fine, name)
    x, old, column = places(fine), places(coarse), coarse.columns[name]
    previous_node, next_node = np.arange(len(old)), np.arange(len(old))
    for path in coarse.paths:
        next_node[path[:-1]], previous_node[path[1:]] = path[1:], path[:-1]
    values, nearest = np.zeros(len(x)), np.full(len(x), np.inf)
    of_fine, of_coarse = fine.columns["boundary"], coarse.columns["boundary"]
    for boundary in np.unique(of_fine):
        fine_rows, coarse_rows = np.flatnonzero(of_fine == boundary), np.flatnonzero(of_coarse == boundary)
        if not coarse_rows.size:
            continue
        node = coarse_rows[cKDTree(old[coarse_rows]).query(x[fine_rows])[1]]
        for neighbour in (previous_node[node], next_node[node]):
            side, away = old[neighbour] - old[node], x[fine_rows] - old[node]
            square = (side**2).sum(axis=1)
            share = np.divide((side * away).sum(axis=1), square, out=np.zeros(fine_rows.size), where=square > 0)
            share = np.clip(share, 0.0, 1.0)
            distance = np.linalg.norm(share[:, None] * side - away, axis=1)
            candidate = column[node] + share * (column[neighbour] - column[node])
            values[fine_rows] = np.where(distance < nearest[fine_rows], candidate, values[fine_rows])
            nearest[fine_rows] = np.minimum(distance, nearest[fine_rows])
    return values


def _interpolated_in_space(coarse: ContactTable, fine: ContactTable, name: str) -> npt.NDArray[np.float64]:
    surface, c = ContactSurface.of(coarse), fine.columns
    x = np.column_stack([c[axis] for axis in "xyz"])
    values = np.zeros(len(x))
    assert fine.nodes is not None
    for part in np.unique(surface.part):
        on_part = fine.nodes[:, 0] == part
        values[on_part] = surface.at(x[on_part], coarse.columns[name][:, None], int(part))[:, 0]
    return values
