"""Test whether a rigid shape lies inside the body or has passed through it, which contact
conditions at nodes cannot detect.

A shape is the solid {phi < 0} of a signed distance phi, and the body is the union of its cells,
each bounded by the planes through the vertices of its facets.  A shape narrower than a facet fits
between nodes.  So in each cell that a shape reaches, a point that is too deep is sought by
alternating projections: onto the planes of the cell, and along the normal of the shape.  For convex
cells and shapes they find such a point if there is one.

Contact at nodes allows some depth: between two nodes that are outside, a chord of length h cuts a
circle of radius R to R - sqrt(R^2 - h^2 / 4).  So depths up to ``SHAPE_INSIDE`` times the radius of
a cell, and times the inradius of the shape, are accepted.  The tip of a cone, an edge or an open
line, which have no largest ball, are cut by a chord up to half its length: there the whole radius
of a cell is allowed, as for a user's own shape that does not define its inradius.

A shape has passed through the body if it is too deep somewhere on the straight path from one place
and displacement to the next.  Where it has no largest ball, the body may have yielded in between by
as much as it is deformed otherwise at the end: a tip that slides along the body dents places that
are even at both ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import basix
import numpy as np
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Indices, Ints, inner, quotient
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.statement.rigid_shape import Shape, SignedDistance
from signorini_fx.tuned import (
    MANY_STEPS,
    MOST_PLACES,
    SAME_LENGTH,
    SHAPE_INSIDE,
    SHAPE_MIDDLE,
    WRONG_SLOPE,
)


@dataclass(frozen=True)
class InsideBody:
    """A place where a shape lies, or has been, deep inside the body.

    Attributes:
        depth: depth of the point below the surface of the shape, length.
        at: position of the point in the displaced body, length.
    """

    depth: float
    at: tuple[float, ...]

    def __str__(self) -> str:
        return f"{self.depth:.3g} at ({', '.join(f'{c:.4g}' for c in self.at)})"


@dataclass(frozen=True)
class BodyCells:
    """The cells of this rank in a space of displacements.

    Attributes:
        kind: the type of the cells.
        nodes: local numbers of their nodes, vertices first, shape (c, n).
        x: initial positions of all nodes, length, shape (nodes, d).
        space: the space of displacements.
    """

    kind: basix.CellType
    nodes: Indices
    x: Array
    space: fem.FunctionSpace

    @classmethod
    def of(cls, space: fem.FunctionSpace) -> BodyCells:
        """Return the cells of a space of displacements."""
        mesh = space.mesh
        owned = mesh.topology.index_map(mesh.topology.dim).size_local
        x = node_positions(space)[:, : mesh.geometry.dim].astype(np.float64)
        return cls(space.element.basix_element.cell_type, space.dofmap.list[:owned], x, space)

    def placed(self, displacement: Array) -> Array:
        """Return the positions of the nodes, shape (nodes, d), at a displacement with ghosts;
        displacements out of the plane of a section are ignored.
        """
        places = self.x.copy()
        within = slice(self.space.mesh.topology.dim)
        places[:, within] += displacement.reshape(-1, self.space.dofmap.index_map_bs)[:, within]
        return places

    def corners(self, places: Array) -> Array:
        """Return positions of the vertices of the cells, shape (c, v, d), see ``placed``."""
        return places[self.nodes[:, : len(basix.topology(self.kind)[0])]]

    @cached_property
    def vertices(self) -> Ints:
        """Global numbers of the vertices of the cells, shape (c, v)."""
        local = self.nodes[:, : len(basix.topology(self.kind)[0])]
        numbers = self.space.dofmap.index_map.local_to_global(local.ravel())
        return numbers.reshape(local.shape)

    def covering(self, places: Array, x: Array, cells: Ints | None = None) -> tuple[Ints, Ints]:
        """Return the pairs of a point and a cell of this rank that covers it, as numbers of both,
        shapes (k,).

        Args:
            places: positions of the nodes, see ``placed``.
            x: positions of the points, shape (n, d).
            cells: the cells to be searched, ascending; None: all.
        """
        corners = self.corners(places)
        cells = np.arange(len(corners)) if cells is None else cells
        if not (cells.size and len(x)):
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        corners = corners[cells]
        found = cKDTree(x).query_ball_point(corners.mean(axis=1), _reach(corners))
        cell = np.repeat(np.arange(cells.size), list(map(len, found)))
        point = np.concatenate(found).astype(np.int64)
        near, number = np.unique(cell, return_inverse=True)
        on_planes, outward = self.planes(corners[near])
        away = x[point, None] - on_planes[number]
        covered = (np.einsum("kfd,kfd->kf", away, outward[number]) <= 0.0).all(axis=1)
        return point[covered], cells[cell[covered]]

    def planes(self, corners: Array) -> tuple[Array, Array]:
        """Return a point on the plane of each facet of cells with these corners, and its outward
        normal, shapes (c, f, d).
        """
        facets = [facet[: self.space.mesh.topology.dim] for facet in basix.topology(self.kind)[-2]]
        at = corners[:, np.array(facets)]
        along = at[:, :, 1:, :] - at[:, :, :1, :]
        if along.shape[2] == 1:
            normal = np.zeros_like(along[:, :, 0])  # in the plane, also that of a section in 3D
            normal[..., 0] = along[:, :, 0, 1]
            normal[..., 1] = -along[:, :, 0, 0]
        else:
            normal = np.asarray(np.cross(along[:, :, 0], along[:, :, 1]))
        normal *= np.sign(
            np.einsum("cfd,cfd->cf", normal, at[:, :, 0] - corners.mean(axis=1)[:, None])
        )[..., None]
        size = np.linalg.norm(normal, axis=2, keepdims=True)
        return at[:, :, 0], quotient(normal, size)

    def inside(self, places: Array, shape: SignedDistance, added: float = 0.0) -> InsideBody | None:
        """Return the deepest place where a shape lies inside the body, or None; collective.

        Hollow and flat shapes are not tested.

        ``places``: positions of the nodes, see ``placed``. ``added``: length added to the distance.
        """
        of_cell = 1.0 if _inradius(shape) == math.inf else SHAPE_INSIDE
        return self._too_deep(places, shape, added, SHAPE_INSIDE, of_cell)

    def swallowed(self, shape: SignedDistance) -> InsideBody | None:
        """Return the place where the middle of the shape lies inside the undeformed body, away from
        or behind its contact boundary; None if there is none; collective.
        """
        return self._too_deep(self.x, shape, 0.0, SHAPE_MIDDLE, math.inf)

    def passed(
        self,
        before: tuple[Array, Shape],
        now: tuple[Array, Shape],
        added: float = 0.0,
    ) -> InsideBody | None:
        """Return a place where the shape has been too deep inside the body on the straight path
        between two states; None if there is none; collective.

        ``before``, ``now``: positions of the nodes and the shape in both states; ``added``: see
        ``inside``.
        """
        begun, earlier = before
        ended, shape = now
        comm = self.space.mesh.comm
        radius = _inradius(shape)
        if radius == math.inf and not getattr(shape, "narrows", True):
            return None
        moved = ended - begun
        ways = (
            np.linalg.norm(moved, axis=1),
            np.linalg.norm(shape.moved_from(earlier, ended), axis=1),
        )
        far = sum(parallel.largest(comm, way, 0.0) for way in ways)
        if radius < math.inf:
            size = radius
            of_cell = math.inf
            yielding = 0.0
        else:
            reach = _reach(self.corners(ended))
            sums = parallel.global_sum(
                comm, np.array([len(reach), reach.sum(), len(moved), *moved.sum(axis=0)])
            )
            yielding = parallel.largest(
                comm, np.linalg.norm(moved - sums[3:] / sums[2], axis=1), 0.0
            )
            size = float(sums[1] / sums[0])
            of_cell = 1.0
        if far <= SHAPE_INSIDE * size:
            return None
        steps = math.ceil(min(2.0 * far / (SHAPE_INSIDE * size), MOST_PLACES))
        for share in np.arange(1, steps) / steps:
            places = (1.0 - share) * begun + share * ended
            between = shape.on_way_from(earlier, float(share), places.shape[1])
            if (
                deep := self._too_deep(places, between, added, SHAPE_INSIDE, of_cell, yielding)
            ) is not None:
                return deep
        return None

    def _too_deep(
        self,
        places: Array,
        shape: SignedDistance,
        added: float,
        of_shape: float,
        of_cell: float,
        yielding: float = 0.0,
    ) -> InsideBody | None:
        """Return the deepest point that is deeper in the shape than ``allowed``; None if there is
        none.

        The limit is the smaller of ``of_shape`` times the inradius and ``of_cell`` times the radius
        of the cell, plus ``yielding``.
        """
        radius = _inradius(shape) - max(added, 0.0)
        endless = radius == math.inf and (
            of_cell == math.inf or not getattr(shape, "narrows", True)
        )
        if radius <= 0.0 or endless:
            return None
        corners = self.corners(places)
        reach = _reach(corners)
        allowed = np.minimum(of_shape * radius, of_cell * reach) + yielding
        deep: Array = np.zeros((0, 1 + places.shape[1]))
        if len(corners):
            # No point of a cell is deeper than its centre by more than the radius of the cell.
            depth = -shape.distance(corners.mean(axis=1))[0] - added
            near = depth + reach > allowed
            if near.any():
                deep = self._deep_points(corners[near], shape, added, allowed[near])
        rows = parallel.gather_rows(self.space.mesh.comm, deep)
        if not len(rows):
            return None
        deepest, *place = rows[np.lexsort((*rows[:, 1:].T[::-1], -rows[:, 0]))[0]].tolist()
        return InsideBody(deepest, tuple(place))

    def _deep_points(
        self, corners: Array, shape: SignedDistance, added: float, allowed: Array
    ) -> Array:
        """Return a point of each cell that is deeper in the shape than ``allowed``, where one is
        found: rows of its depth and position, shape (m, 1 + d).

        From the centre of the cell, projections onto the half-spaces of its facets alternate with
        projections onto the points that are deep enough.
        """
        x = corners.mean(axis=1)
        inaccurate = SAME_LENGTH * _reach(corners)
        at, outward = self.planes(corners)
        for _ in range(MANY_STEPS):
            for facet in range(outward.shape[1]):
                beyond = inner(x - at[:, facet], outward[:, facet])
                x = x - np.maximum(beyond, 0.0)[:, None] * outward[:, facet]
            signed, normal = shape.distance(x)
            outside = np.einsum("nfd,nfd->nf", x[:, None] - at, outward).max(axis=1)
            deep = -signed - added > (1.0 - WRONG_SLOPE) * allowed
            found = deep & (outside <= inaccurate)
            if found.all():
                break
            back = np.maximum(signed + added + allowed, 0.0)[:, None] * normal
            x = x - np.where(found[:, None], 0.0, back)
        return np.column_stack((-signed - added, x))[found]


def _inradius(shape: SignedDistance) -> float:
    """Return the radius of the largest ball in a shape, length; infinite where there is none or the
    shape does not define it.
    """
    return float(getattr(shape, "inradius", math.inf))


def _reach(corners: Array) -> Array:
    """Return the largest distance from the middle of each cell to its vertices, shape (c,).

    Args:
        corners: shape (c, v, d).
    """
    return np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1)
