"""The contact surface of a body in 3D, divided into flat pieces with linear values between their
corners.

A facet of triangles or quadrilaterals of degree 1 is one piece, a facet of degree 2 is four.  What
follows the arc length in 2D is done here from piece to piece, which needs no order of the nodes.

For bodies at finite strains it gives the contact pressure per area of their deformed boundary.
Contact tractions are unknowns per area of the undeformed boundary; a gauge between two bodies
measures forces per deformed area.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from dolfinx import fem

from signorini_fx.arrays import Array, Flags, Ints, sides_of
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.tuned import CORNER_SHARE, KINK_SHARE

# By the number of nodes of a facet the corners of its pieces, in order around each piece.  Nodes
# are in basix's order: vertices, middles of edges, the middle.
_TRIANGLE = [[0, 1, 2]]
_QUADRILATERAL = [[0, 1, 3, 2]]
_PIECES = {
    3: _TRIANGLE,
    4: _QUADRILATERAL,
    6: [[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]],
    9: [[0, 4, 8, 5], [4, 1, 6, 8], [5, 8, 7, 2], [8, 6, 3, 7]],
}


@dataclass(frozen=True)
class ContactSurface:
    """The flat pieces of a contact surface, with k corners each, 3 or 4."""

    x: Array  # position of the nodes, length, shape (rows, 3)
    # rows of the contact table at the corners of each piece, in order around it, shape (pieces, k)
    corners: Ints
    per_facet: int  # pieces of each facet, which follow each other
    # the facets of the table with pieces: between two bodies those with contact points at all nodes
    facets: Ints
    count: int  # number of facets of the table

    @classmethod
    def of(cls, table: ContactTable) -> ContactSurface:
        """Return the contact surface of a table in 3D."""
        assert table.facets is not None
        facets = table.facets
        vertices = {6: 3, 9: 4}.get(facets.shape[1], facets.shape[1])
        if (facets[:, vertices:] < 0).all():  # no contact nodes but the vertices
            facets = facets[:, :vertices]
        complete = np.flatnonzero((facets >= 0).all(axis=1))
        pieces = np.array(_PIECES[facets.shape[1]])
        corners = facets[complete][:, pieces].reshape(-1, pieces.shape[1])
        x = np.column_stack([table.columns[axis] for axis in "xyz"])
        return cls(x, corners, len(pieces), complete, len(facets))

    @cached_property
    def _normal_area(self) -> Array:
        x = self.x[self.corners]
        return np.cross(x, np.roll(x, -1, axis=1)).sum(axis=1) / 2

    @cached_property
    def area(self) -> Array:
        """The area of each piece, shape (pieces,)."""
        return np.linalg.norm(self._normal_area, axis=1)

    @cached_property
    def normal(self) -> Array:
        """Unit normal of each piece, inwards or outwards, shape (pieces, 3)."""
        return self._normal_area / self.area[:, None]

    @cached_property
    def _edges(self) -> Array:
        x = self.x[self.corners]
        return np.roll(x, -1, axis=1) - x

    @cached_property
    def sides(self) -> Array:
        """Length of the sides of each piece, shape (pieces, k); the first side is that from the
        first corner to the second.
        """
        return np.linalg.norm(self._edges, axis=2)

    @cached_property
    def outward(self) -> Array:
        """Unit vectors in the plane of each piece, normal to each side and out of the piece, shape
        (pieces, k, 3).
        """
        across = np.cross(self._edges, self.normal[:, None, :])
        return across / np.linalg.norm(across, axis=2, keepdims=True)

    @cached_property
    def across(self) -> Ints:
        """The side of the neighbouring piece at each side, as piece times k plus side, shape
        (pieces, k); -1 at the rim.
        """
        ends = np.sort(
            sides_of(self.corners).reshape(-1, 2),
            axis=1,
        )
        _, first, inverse, count = np.unique(
            ends, axis=0, return_index=True, return_inverse=True, return_counts=True
        )
        inverse = inverse.ravel()
        total = np.zeros(len(first), dtype=np.int64)
        np.add.at(total, inverse, np.arange(len(inverse)))
        opposite = np.where(count[inverse] == 2, total[inverse] - np.arange(len(inverse)), -1)
        return opposite.reshape(self.corners.shape)

    @cached_property
    def rim(self) -> Flags:
        """Which sides have no neighbour, because the contact boundary ends there, shape (pieces,
        k).
        """
        return self.across < 0

    @property
    def rim_nodes(self) -> Flags:
        """Which rows of the table are on the rim, shape (rows,)."""
        ends = sides_of(self.corners)[self.rim]
        return np.isin(np.arange(len(self.x)), ends)

    def jumps(self, values: Array) -> Array:
        """Return the jump of the slope across each side from one piece to the next, shape (pieces,
        k); 0 at the rim.

        Args:
            values: values at the nodes, shape (rows,).
        """
        corner_values = values[self.corners]
        middle = (corner_values + np.roll(corner_values, -1, axis=1)) / 2
        # The mean gradient by the divergence theorem, exact for what is linear.
        gradient = np.einsum("ij,ijk->ik", middle * self.sides, self.outward) / self.area[:, None]
        slopes = np.einsum("ik,ijk->ij", gradient, self.outward)
        return np.where(self.rim, 0.0, slopes + slopes.ravel()[self.across])

    def turns(self) -> Array:
        """Return the angle between each piece and its neighbours, radians, shape (pieces, k); 0 at
        the rim.
        """
        neighbour_normal = self.normal[np.maximum(self.across, 0) // self.corners.shape[1]]
        # The orders of corners may differ: then one normal points inwards.
        cosine = np.abs(np.einsum("ik,ijk->ij", self.normal, neighbour_normal))
        sine = np.linalg.norm(np.cross(self.normal[:, None, :], neighbour_normal), axis=2)
        return np.where(self.rim, 0.0, np.arctan2(sine, cosine))

    def squares(self, pressure: Array) -> Array:
        """Return the estimated squared error of the pressure on each piece, stress^2 times area,
        shape (pieces,).

        It is the estimate along a curve, see ``pressure_error``, summed over the sides: a pressure
        that changes along one direction only has the same error here as there.
        """
        jumps = self.jumps(pressure)
        heights = (2 if self.corners.shape[1] == 3 else 1) * self.area[:, None] / self.sides
        kinks = self.sides * heights**3 * jumps**2
        squares = KINK_SHARE / 2 * kinks.sum(axis=1)
        return np.maximum(squares, CORNER_SHARE * self._convex(pressure, jumps, kinks))

    def growing(self, pressure: Array) -> Flags:
        """Return which rows in contact are on the rim, where the pressure is convex towards it,
        shape (rows,).
        """
        jumps = self.jumps(pressure)
        pieces = self._convex(pressure, jumps, jumps**2) > 0
        beside = np.isin(np.arange(len(self.x)), self.corners[pieces])
        return beside & self.rim_nodes & (pressure > 0)

    def _convex(self, pressure: Array, jumps: Array, kinks: Array) -> Array:
        """Return for each piece at the rim the sum of ``kinks`` over its sides where the pressure
        is convex towards the rim, shape (pieces,).

        There the pressure may be singular; at a plane of symmetry it is concave.
        """
        on_rim = (self.rim_nodes & (pressure != 0))[self.corners]
        pressed = (pressure != 0)[self.corners].all(
            axis=1
        )  # the end of a contact zone is another matter
        both_pressed = (
            pressed[:, None] & pressed[np.maximum(self.across, 0) // self.corners.shape[1]]
        )
        inside = both_pressed & ~(on_rim | np.roll(on_rim, -1, axis=1)) & (jumps < 0)
        return np.where(inside, kinks, 0.0).sum(axis=1) * on_rim.any(axis=1)

    def of_rank(self, boundary: ContactBoundary, values: Array) -> Array:
        """Return the sum of values of the pieces for each facet of this rank, in the order of
        ``boundary.segments``; collective.

        Args:
            boundary: the contact points of this rank.
            values: one value for each piece, shape (pieces,).
        """
        first = parallel.rows_before(boundary.comm, len(boundary.segments))
        facets = np.zeros(self.count)
        facets[self.facets] = values.reshape(-1, self.per_facet).sum(axis=1)
        return facets[first : first + len(boundary.segments)]


def places(table: ContactTable) -> Array:
    """Return the positions of the nodes in 2D, length, shape (rows, 2)."""
    return np.column_stack((table.columns["x"], table.columns["y"]))


def present_pressure(
    table: ContactTable, contact: ContactState, displacement: fem.Function, *, revolved: bool
) -> Array:
    """Return the pressure at each row of a contact table per deformed area, which is that between
    the displaced nodes, shape (rows,).  Collective.

    Args:
        table: the contact table.
        contact: the contact state of this rank.
        displacement: y.
        revolved: whether the body is axisymmetric, so that areas are those of rings.
    """
    boundary = contact.boundary
    size = displacement.function_space.dofmap.index_map_bs
    moved = displacement.x.array.reshape(-1, size)[boundary.nodes]
    rows = np.column_stack((boundary.part, boundary.global_nodes, moved))
    gathered = parallel.gather_rows(boundary.comm, rows[boundary.at_nodes])
    assert table.nodes is not None
    order = np.lexsort(gathered[:, 1::-1].T)
    at = np.empty(len(order), dtype=np.int64)
    at[np.lexsort(table.nodes[:, ::-1].T)] = order
    u = gathered[at, 2:]
    stretch = np.ones(len(u))
    before = np.zeros(len(u))
    after = np.zeros(len(u))
    if table.facets is not None:
        surface = ContactSurface.of(table)
        corners = surface.corners
        areas = surface.area, replace(surface, x=surface.x + u).area
    else:
        corners = np.concatenate([np.column_stack((path[:-1], path[1:])) for path in table.paths])
        x = places(table)
        areas = _lengths(x, corners), _lengths(x + u[:, :2], corners)
        if revolved:
            around = x[corners, 0].sum(axis=1)
            turned = (x + u[:, :2])[corners, 0].sum(axis=1)
            areas = areas[0] * around, areas[1] * turned
    for total, area in zip((before, after), areas, strict=True):
        np.add.at(total, corners, area[:, None])
    np.divide(after, before, out=stretch, where=(before > 0) & (after > 0))
    return table.columns["pressure"] / stretch


def _lengths(x: Array, corners: Ints) -> Array:
    """Return the length of each interval, shape (intervals,)."""
    return np.linalg.norm(x[corners[:, 1]] - x[corners[:, 0]], axis=1)
