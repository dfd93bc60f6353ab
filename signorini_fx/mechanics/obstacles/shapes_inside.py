"""Whether a rigid shape lies inside the body, or has passed through it: what contact conditions at nodes cannot see.

A shape is the solid {phi < 0} of a signed distance phi, and the body in its present place is the union of its cells,
x = sum_j N_j(xi) (X_j + u_j).  They overlap by

    depth = - min over cells c and xi in c of phi(x(xi)),

which nodes alone do not tell: a shape that is narrower than a facet fits between them, and one that is inside is
outside of all nodes of the boundary.  The minimum is found by branch and bound.  As |phi(x) - phi(z)| <= |x - z|, a
part of a cell with the middle m, all of which is within r of m, has no point deeper than r - phi(m).  Parts for which
this is above the depth allowed are divided, into 2^d along the lattice of their reference cell, and elongated ones in
their long directions alone, until the middle of one is too deep or none is left.

Contact at nodes allows for some depth: between two nodes that are outside, a chord of length h cuts a circle of radius
R to R - sqrt(R^2 - h^2 / 4).  So up to ``SHAPE_INSIDE`` of the radius of a cell, and of the inradius of the shape,
which is the greatest depth that there is, nothing is said.  A cone, an edge or an open line has no largest ball, and
its tip is cut by a chord however short: up to half its length, so the whole radius of a cell is allowed there.  A tip
between two nodes that it does not touch is not told from that.  Of a shape of a user's own that does not say its
inradius a ball is sought in it, see ``users_shapes``.

A shape has passed through the body if on the straight way from one place and displacement to the next it is too deep
somewhere; then both ends may be free of overlap.  Places between are those of the rigid motion with a share of the
shift and of the rotation.  Where the shape has no largest ball, the body may have given way in between by as much as
it is deformed otherwise at the end: a tip that slides along it dents places that are even at both ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.obstacles.users_shapes import inradius_of, on_way
from signorini_fx.tuned import ELONGATED, MOST_PLACES, SHAPE_INSIDE, SHAPE_MIDDLE, SHAPE_STEP, SMALLEST_PART

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class InsideBody:
    """Where a shape lies deep inside the body, or has on its way.

    Attributes:
        depth: of the body's point below the surface of the shape, length.
        at: that point, displaced, length, shape (d,).
    """

    depth: float
    at: tuple[float, ...]

    def __str__(self) -> str:
        return f"{self.depth:.3g} at ({', '.join(f'{c:.4g}' for c in self.at)})"


@dataclass(frozen=True)
class BodyCells:
    """The cells of this rank.

    Attributes:
        element: of the displacement, scalar.
        nodes: of each cell, local numbers, shape (c, n).
        x: initial positions of the nodes, length, shape (nodes, d).
        space: the displacements.
    """

    element: basix.finite_element.FiniteElement
    nodes: npt.NDArray[np.int32]
    x: Array
    space: fem.FunctionSpace

    @classmethod
    def of(cls, space: fem.FunctionSpace, dimension: int) -> BodyCells:
        """Those of a space of displacements; ``dimension``: of the points that shapes are asked at, d."""
        mesh = space.mesh
        owned = mesh.topology.index_map(mesh.topology.dim).size_local
        x = node_positions(space)[:, :dimension].astype(np.float64)
        return cls(space.element.basix_element, space.dofmap.list[:owned], x, space)

    def placed(self, displacement: Array) -> Array:
        """Positions of the nodes at a displacement, its values with ghosts, length, shape (nodes, d).

        Sections of bodies of revolution stay in their plane, whatever turns around the axis.
        """
        places, within = self.x.copy(), slice(self.space.mesh.topology.dim)
        places[:, within] += displacement.reshape(-1, self.space.dofmap.index_map_bs)[:, within]
        return places

    def inside(self, places: Array, shape: Any, added: float = 0.0) -> InsideBody | None:
        """Where the shape lies inside the body, None: nowhere; collective.

        Args:
            places: of the nodes, see ``placed``.
            shape: an object with ``distance``, see ``Shape``; what is hollow and what is flat is not looked at.
            added: what is added to its distance, length.
        """
        radius = inradius_of(self._comm, shape, places)
        of_cell = 1.0 if radius == math.inf else SHAPE_INSIDE
        return self._too_deep(places, shape, (radius, added), SHAPE_INSIDE, of_cell)

    def swallowed(self, shape: Any, added: float = 0.0) -> InsideBody | None:
        """Where the middle of the shape lies inside the undeformed body, so that the surface of the body does not see
        it, or from behind; None: nowhere; collective.  For the arguments see ``inside``.
        """
        radius = inradius_of(self._comm, shape, self.x)
        return self._too_deep(self.x, shape, (radius, added), SHAPE_MIDDLE, math.inf)

    def passed(self, before: tuple[Array, Any], now: tuple[Array, Any], added: float = 0.0) -> InsideBody | None:
        """Where the shape has been inside the body on the straight way between two states; None: nowhere; collective.

        Args:
            before: places of the nodes, and the shape.
            now: likewise.
            added: see ``inside``.
        """
        (begun, earlier), (ended, shape), comm = before, now, self._comm
        radius = inradius_of(comm, shape, ended)
        if radius == math.inf and not getattr(shape, "narrows", True):
            return None
        moved = ended - begun
        ways = np.linalg.norm(moved, axis=1), np.linalg.norm(shape.moved_from(earlier, ended), axis=1)
        far = sum(parallel.largest(comm, way, 0.0) for way in ways)
        if radius < math.inf:
            size, of_cell, yielding = radius, math.inf, 0.0
        else:
            total, count = parallel.global_sum(comm, moved.sum(axis=0)), parallel.global_sum(comm, len(moved))
            yielding = parallel.largest(comm, np.linalg.norm(moved - total / count, axis=1), 0.0)
            size, of_cell = self._mean_radius(ended), 1.0
        if far <= SHAPE_INSIDE * size:
            return None
        steps = math.ceil(min(far / (SHAPE_STEP * size), MOST_PLACES))
        for share in np.arange(1, steps) / steps:
            places = (1.0 - share) * begun + share * ended
            between = on_way(comm, shape, earlier, float(share), places)
            deep = self._too_deep(places, between, (radius, added), SHAPE_INSIDE, of_cell, yielding)
            if deep is not None:
                return deep
        return None

    @property
    def _comm(self) -> MPI.Comm:
        return self.space.mesh.comm

    def _mean_radius(self, places: Array) -> float:
        """Of all cells, length; collective."""
        corners = places[self.nodes]
        reach = np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1, initial=0.0)
        total, count = parallel.global_sum(self._comm, np.array([reach.sum(), len(reach)]))
        return float(total / count)

    def _too_deep(
        self,
        places: Array,
        shape: Any,
        sizes: tuple[float, float],
        of_shape: float,
        of_cell: float,
        yielding: float = 0.0,
    ) -> InsideBody | None:
        """A point of the body that is deeper in the shape than these shares of its inradius and of the radius of the
        cell, the deepest one of those of its level; collective.

        Args:
            places: see ``inside``.
            shape: likewise.
            sizes: its inradius, and what is added to its distance.
            of_shape: share of the inradius.
            of_cell: share of the radius of the cell.
            yielding: by which it may be deeper, length.
        """
        comm, added = self._comm, sizes[1]
        radius = sizes[0] - max(added, 0.0)
        endless = radius == math.inf and (of_cell == math.inf or not getattr(shape, "narrows", True))
        if radius <= 0.0 or endless:
            return None

        def depths(x: Array) -> Array:
            return -(shape.distance(x)[0] + added)

        deep = self._search(places, depths, (of_shape * radius, of_cell, yielding))
        rows = parallel.gather_rows(comm, np.array([deep] if deep else []).reshape(-1, 1 + places.shape[1]))
        if not len(rows):
            return None
        deepest, *at = rows[np.lexsort((*rows[:, 1:].T[::-1], -rows[:, 0]))[0]].tolist()
        return InsideBody(deepest, tuple(at))

    def _search(
        self, places: Array, depths: Callable[[Array], Array], limits: tuple[float, float, float]
    ) -> list[float] | None:
        """Depth and position of a point of this rank that is deeper than the smaller one of a length and a share of the
        radius of its cell, and another length.
        """
        limit, of_cell, yielding = limits
        kind = self.element.cell_type
        corners = np.asarray(basix.geometry(kind), dtype=np.float64)
        sampled = np.vstack((corners.mean(axis=0), corners))
        all_cells = np.arange(len(self.nodes))
        x = self._positions(places, all_cells, np.broadcast_to(sampled, (all_cells.size, *sampled.shape)))
        reach = np.linalg.norm(x[:, 1:] - x[:, :1], axis=2).max(axis=1, initial=0.0)
        allowed = np.minimum(limit, of_cell * reach) + yielding
        boxes = _boxes(kind, x[:, 1:])
        regular = np.flatnonzero(~boxes.elongated)
        identity = np.tile(np.eye(corners.shape[1]), (regular.size, 1, 1))
        groups = [
            (regular, kind, identity, np.zeros((regular.size, corners.shape[1])), False),
            (np.flatnonzero(boxes.elongated), boxes.kind, boxes.turned, boxes.moved, boxes.cut),
        ]
        for cells, of_kind, turned, moved, cut in groups:
            deep = self._search_parts(places, depths, allowed, cells, of_kind, (turned, moved), cut)
            if deep is not None:
                return deep
        return None

    def _search_parts(
        self,
        places: Array,
        depths: Callable[[Array], Array],
        allowed: Array,
        cells: npt.NDArray[np.int64],
        kind: basix.CellType,
        maps: tuple[Array, Array],
        cut: bool,
    ) -> list[float] | None:
        """See ``_search``.

        Args:
            places: see ``inside``.
            depths: of positions in the shape.
            allowed: depth in each cell of this rank, length, shape (c,).
            cells: numbers of those that are searched, shape (m,).
            kind: what is divided.
            maps: matrices and shifts of the affine maps from it onto a cell, shapes (m, d, d) and (m, d).
            cut: whether these are boxes around simplices, of which only parts belong to the cell.
        """
        corners = np.asarray(basix.geometry(kind), dtype=np.float64)
        dim = corners.shape[1]
        points = np.vstack((corners.mean(axis=0), corners))
        turned, moved = maps
        while cells.size:
            at = np.einsum("pij,vj->pvi", turned, points) + moved[:, None]
            if cut:
                at, inside = _within(at)
                at, cells, turned, moved = at[inside], cells[inside], turned[inside], moved[inside]
            x = self._positions(places, cells, at)
            middle, reach = x[:, 0], np.linalg.norm(x[:, 1:] - x[:, :1], axis=2).max(axis=1, initial=0.0)
            depth = depths(middle)
            if (deep := depth > allowed[cells]).any():
                deepest = int(np.argmax(np.where(deep, depth, -np.inf)))
                return [float(depth[deepest]), *middle[deepest].tolist()]
            # Curved parts may reach farther than their corners.
            bulge = 1.0 if self.element.degree == 1 else 1.5
            left = (depth + bulge * reach > allowed[cells]) & (reach > SMALLEST_PART * allowed[cells])
            cells, turned, moved, x = cells[left], turned[left], moved[left], x[left, 1:]
            parts = []
            for rows, smaller in _divided(kind, x):
                shift = moved[rows][:, None] + np.einsum("pij,kj->pki", turned[rows], smaller[:, :, -1])
                turn = np.einsum("pij,kjl->pkil", turned[rows], smaller[:, :, :-1])
                parts.append((np.repeat(cells[rows], len(smaller)), turn.reshape(-1, dim, dim), shift.reshape(-1, dim)))
            if not parts:
                return None
            cells, turned, moved = (np.concatenate(column) for column in zip(*parts, strict=True))
        return None

    def _positions(self, places: Array, cells: npt.NDArray[np.int64], at: Array) -> Array:
        """Positions of points of the reference cell, shape (m, v, d), in these cells, shape (m,)."""
        count, points, dim = at.shape
        if not at.size:  # a rank without cells: Basix 0.9 ends the program where it is given no point
            return np.zeros((count, points, places.shape[1]))
        functions = self.element.tabulate(0, at.reshape(-1, dim))[0, :, :, 0].reshape(count, points, -1)
        return np.asarray(np.einsum("pvn,pnd->pvd", functions, places[self.nodes[cells]]))


@dataclass(frozen=True)
class ElongatedCells:
    """Cells that are much longer in one direction than in another, as boxes that are halved in the long ones alone.

    A triangle or tetrahedron is the part with sum xi <= 1 of a box on the edges from one of its corners, the one whose
    edges are shortest and so the nearest to orthogonal: needles that are halved themselves overlap in more and more
    layers.

    Attributes:
        elongated: which cells are, shape (c,).
        kind: of the box.
        turned: matrices of the affine maps from the box into the reference cell, shape (m, d, d).
        moved: the shifts of these maps, shape (m, d).
        cut: whether only a part of the box belongs to the cell.
    """

    elongated: npt.NDArray[np.bool_]
    kind: basix.CellType
    turned: Array
    moved: Array
    cut: bool


def _boxes(kind: basix.CellType, x: Array) -> ElongatedCells:
    """The elongated ones of cells with corners at these positions, length, shape (c, v, d)."""
    corners = np.asarray(basix.geometry(kind), dtype=np.float64)
    dim = corners.shape[1]
    if len(corners) > dim + 1:
        none = np.zeros(len(x), dtype=bool)
        return ElongatedCells(none, kind, np.zeros((0, dim, dim)), np.zeros((0, dim)), cut=False)
    spread = np.linalg.svd(x[:, 1:] - x[:, :1], compute_uv=False)
    elongated = spread[:, -1] * ELONGATED < spread[:, 0]
    lengths = np.linalg.norm(x[elongated, :, None] - x[elongated, None], axis=3)
    products = (lengths + np.eye(dim + 1)).prod(axis=2)
    remaining = np.array([[k for k in range(dim + 1) if k != first] for first in range(dim + 1)])
    first = products.argmin(axis=1)
    moved = corners[first]
    turned = np.swapaxes(corners[remaining[first]] - moved[:, None], 1, 2)
    box = basix.CellType.quadrilateral if dim == 2 else basix.CellType.hexahedron
    return ElongatedCells(elongated, box, turned, moved, cut=True)


def _within(at: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Middles and corners of boxes, shape (m, v, d), with middles moved into the reference simplex, and which boxes
    have points in it, shape (m,).
    """
    # The box lies along edges of the simplex: its corners take every coordinate, and the sum of all, to their ends.
    coordinates = np.concatenate((at, 1.0 - at.sum(axis=2, keepdims=True)), axis=2)
    inside = (coordinates[:, 1:].max(axis=1) >= 0).all(axis=1)
    middle = coordinates[:, 0]
    best = at[np.arange(len(at)), 1 + coordinates[:, 1:].min(axis=2).argmax(axis=1)]
    bary = np.column_stack((best, 1.0 - best.sum(axis=1)))
    # From the corner that is deepest in the simplex as far towards the middle as it goes.
    steps = np.where(middle < 0, bary / np.where(middle < 0, bary - middle, 1.0), 1.0).clip(0.0, 1.0).min(axis=1)
    moved = best + steps[:, None] * (at[:, 0] - best)
    inside &= coordinates[:, 1:].min(axis=2).max(axis=1) >= 0
    return np.concatenate((moved[:, None], at[:, 1:]), axis=1), inside


def _divided(kind: basix.CellType, x: Array) -> list[tuple[npt.NDArray[np.int64], Array]]:
    """How parts with corners at x, shape (m, v, d), are divided: numbers of parts, and the affine maps from the
    reference cell onto smaller parts of it, matrices and shifts side by side, shape (k, d, d + 1).

    Halves in all directions, or of an elongated box in its long ones alone, so that the number of parts does not grow
    with the aspect ratio.
    """
    if not len(x):
        return []
    corners = np.asarray(basix.geometry(kind), dtype=np.float64)
    dim = corners.shape[1]
    if len(corners) == dim + 1:
        return [(np.arange(len(x)), _similar(corners))]
    edges = np.array(basix.topology(kind)[1])
    lengths = np.linalg.norm(x[:, edges[:, 1]] - x[:, edges[:, 0]], axis=2)
    along = np.abs(corners[edges[:, 1]] - corners[edges[:, 0]]) > 0
    of_axes = np.column_stack([lengths[:, along[:, axis]].max(axis=1) for axis in range(dim)])
    way = (2 * of_axes > lengths.max(axis=1)[:, None]) @ (1 << np.arange(dim))
    return [(np.flatnonzero(way == number), _halves(int(number), corners)) for number in np.unique(way)]


def _halves(way: int, corners: Array) -> Array:
    """The affine maps of a unit box onto its halves along the axes whose bits ``way`` has."""
    size = np.array([0.5 if way >> axis & 1 else 1.0 for axis in range(corners.shape[1])])
    kept = corners[(corners[:, size == 1.0] == 0).all(axis=1)]
    return np.array([np.column_stack((np.diag(size), corner / 2)) for corner in kept])


def _similar(corners: Array) -> Array:
    """The affine maps of a simplex onto its 2^d parts between its corners and the middles of its edges."""
    dim = corners.shape[1]
    parts = [np.array([(corner + vertex) / 2 for vertex in corners]) for corner in corners]
    middles = {(i, j): (corners[i] + corners[j]) / 2 for i in range(dim + 1) for j in range(i)}
    if dim == 2:
        parts.append(np.array([middles[1, 0], middles[2, 0], middles[2, 1]]))
    else:  # the octahedron between the corners, about one of its diagonals
        ends = middles[1, 0], middles[3, 2]
        ring = [middles[2, 0], middles[2, 1], middles[3, 1], middles[3, 0]]
        parts += [np.array([*ends, ring[k], ring[(k + 1) % 4]]) for k in range(4)]
    return np.array([np.column_stack(((part[1:] - part[0]).T, part[0])) for part in parts])
