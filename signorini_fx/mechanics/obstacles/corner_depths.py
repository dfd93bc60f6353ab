"""Penetration of convex corners of rigid foundations into a body between its contact nodes.

A corner c that is rounded by rho is below a facet of the boundary with the outward normal n and the
closest point x by rho - added - n . (c - x), where ``added`` is added to the distance.  Edges in 3D
are sampled at points.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import basix
import numpy as np
from dolfinx import fem

from signorini_fx.arrays import Array, Indices, Ints, inner, quotient
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import (
    facet_cells,
    facet_nodes,
    node_positions,
)
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.interfaces import PlacedShape
from signorini_fx.mechanics.mesh.tagged import outer_facets
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodyMotion
from signorini_fx.mechanics.statement.rigid_shape import Corners, corners_of
from signorini_fx.tuned import DIGITS_OF_FILES, NOTABLE, SAME_LENGTH

# Numbers that are compared at a time.
_AT_A_TIME = 1_000_000

# A corner that is rounded off with a radius of so many facets is a curve, which nodes feel.
FACETS_OF_ROUNDING = 2


@dataclass(frozen=True)
class DeepCorner:
    """A corner of a foundation that penetrates the body between nodes.

    Attributes:
        path: the name of the foundation in the input.
        at: position of the corner, length.
        depth: depth below the facet, length.
        facet: length of the facet, in 3D of its longest side.
    """

    path: str
    at: tuple[float, ...]
    depth: float
    facet: float

    def __str__(self) -> str:
        at = ", ".join(f"{c:.4g}" for c in self.at)
        return (
            f"its corner at ({at}) is {self.depth:.3g} below a facet of {self.facet:.3g}, between "
            f"nodes: round it off with a radius of at least {FACETS_OF_ROUNDING * self.facet:.2g}"
        )


@dataclass(frozen=True)
class BodySurface:
    """The boundary of a body on this rank, divided into m flat pieces.

    Attributes:
        space: the space of displacements.
        pieces: local numbers of the nodes of each piece, shape (m, d).
        behind: one node, not on the piece, of the cell behind it, shape (m,).
    """

    space: fem.FunctionSpace
    pieces: Indices
    behind: Indices

    @classmethod
    def of(cls, space: fem.FunctionSpace) -> BodySurface:
        """Return the surface of a space of displacements; midside nodes divide a facet."""
        mesh = space.mesh
        dim = space.mesh.topology.dim
        facets = outer_facets(mesh)
        nodes = facet_nodes(space, facets)
        kind = getattr(basix.CellType, mesh.topology.cell_name())
        vertices = space.dofmap.list[facet_cells(mesh, facets)][:, : len(basix.topology(kind)[0])]
        beside = ~(vertices[:, :, None] == nodes[:, None]).any(axis=2)
        behind = vertices[np.arange(len(vertices)), beside.argmax(axis=1)]
        split = _split(dim, nodes.shape[1])
        return cls(space, nodes[:, split].reshape(-1, dim), np.repeat(behind, len(split)))

    def below(self, points: Array, places: Array) -> tuple[Array, Array, Array]:
        """Return the depth of points below the closest piece, negative outside, the length of its
        longest side, shapes (k,), and its outward normal, shape (k, d); collective.

        ``points``: the same on every rank; ``places``: positions of the nodes of this rank, length,
        shape (nodes, d).
        """
        dim = self.pieces.shape[1]
        x = places[self.pieces][..., :dim]
        normal = _normals(x)
        inwards = inner(normal, places[self.behind][:, :dim] - x[:, 0])
        normal = np.where((inwards > 0)[:, None], -normal, normal)
        sides = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(axis=1)
        rows = np.full((len(points), 3 + dim), (np.inf, -np.inf, *[0.0] * (1 + dim)))
        for batch in np.array_split(np.arange(len(points)), 1 + len(points) * x.size // _AT_A_TIME):
            if not (len(x) and batch.size):
                continue
            away = points[batch, None, :dim] - _closest(points[batch, :dim], x)
            distance = np.linalg.norm(away, axis=2)
            height = np.einsum("bmd,md->bm", away, normal)
            nearest = distance.min(axis=1)
            # Of pieces that share the closest point the body is on the inner side of all or of
            # none.
            tied = distance <= nearest[:, None] + SAME_LENGTH * sides
            height = np.where(tied, height, -np.inf)
            piece = height.argmax(axis=1)
            rows[batch] = np.column_stack(
                (nearest, height.max(axis=1), sides[piece], normal[piece])
            )
        every = parallel.gather_rows(self.space.mesh.comm, rows).reshape(-1, *rows.shape)
        nearest = every[..., 0].min(axis=0)
        height = np.where(
            every[..., 0] <= nearest + SAME_LENGTH * every[..., 2].max(axis=0),
            every[..., 1],
            -np.inf,
        )
        rows = every[height.argmax(axis=0), np.arange(len(points))]
        return -rows[:, 1], rows[:, 2], rows[:, 3:]


def deepest_corner(
    foundations: Iterable[PlacedShape],
    displacement: fem.Function,
    rigid: Iterable[RigidBodyMotion],
    boundary: ContactBoundary | None,
) -> DeepCorner | None:
    """Return the corner without contact points that penetrates the deformed body most, if its depth
    is a notable fraction of the deformation; None if there is none; collective.

    ``rigid``: the motions of foundations that forces move.
    """
    felt: Ints = np.zeros((0, 2), dtype=np.int64)
    if boundary is not None and (at := boundary.corners) is not None:
        rows = np.column_stack((boundary.part, at.number // 2))
        felt = parallel.gather_rows(boundary.comm, rows[~boundary.at_nodes & ~at.alone])
    space = displacement.function_space
    surface = None
    deepest = None
    dim = space.mesh.topology.dim
    comm = space.mesh.comm
    moved = displacement.x.array.reshape(-1, space.dofmap.index_map_bs)[:, :dim]
    places = node_positions(space)[:, :dim] + moved
    for foundation in foundations:
        added = foundation.added
        if not isinstance(added, int | float):
            continue
        corners = corners_of(foundation.shape, dim)
        if corners is not None and len(felt):
            numbers = felt[felt[:, 0] == foundation.contact, 1]
            unfelt = ~np.isin(np.arange(len(corners.places)), numbers)
            corners = replace(corners, places=corners.places[unfelt], radius=corners.radius[unfelt])
        if corners is None or not corners.places.size + corners.edges.size:
            continue
        for motion in rigid:
            if foundation.contact in motion.body.parts:
                ends = corners.edges.reshape(-1, dim)
                corners = replace(
                    corners,
                    places=corners.places + motion.at(corners.places),
                    edges=(ends + motion.at(ends)).reshape(corners.edges.shape),
                )
        surface = surface or BodySurface.of(space)
        low, high = parallel.global_bounds(comm, places)
        points, radius = _points_of(corners, low, high, surface, places)
        if not len(points):
            continue
        below, facets, normal = surface.below(points, places)
        # Advice follows undeformed facets, too.
        curved = radius >= (1.0 - NOTABLE) * FACETS_OF_ROUNDING * facets
        depth = np.where(curved, -np.inf, below + radius - added)
        sums = parallel.global_sum(comm, np.array([len(moved), *moved.sum(axis=0)]))
        deformed = parallel.largest(comm, np.linalg.norm(moved - sums[1:] / sums[0], axis=1), 0.0)
        size = float(np.linalg.norm(high - low))
        k = int(np.lexsort((*np.round(points / size, 9).T[::-1], -np.round(depth / size, 9)))[0])
        if depth[k] > max(
            NOTABLE * deformed, DIGITS_OF_FILES * size, 0.0 if deepest is None else deepest.depth
        ):
            tip = np.round((points[k] - radius[k] * normal[k]) / size, 9) * size + 0.0
            deepest = DeepCorner(
                foundation.path, tuple(tip.tolist()), float(depth[k]), float(facets[k])
            )
    return deepest


def facing_corners(foundation: PlacedShape, space: fem.FunctionSpace) -> tuple[Array, float] | None:
    """Return the corners of a foundation, shape (k, d), length, that point at a facet of the
    undeformed body and are sharper than it can resolve, and the length of the longest such facet;
    None if there are none; collective.
    """
    dim = space.mesh.topology.dim
    corners = corners_of(foundation.shape, dim)
    if corners is None or not corners.places.size:
        return None
    _, facets, normal = BodySurface.of(space).below(corners.places, node_positions(space)[:, :dim])
    # Two sides press along all directions between their normals.
    points_at = np.einsum("kd,ksd->ks", normal, corners.sides).max(axis=1) <= 0
    meets = points_at & (corners.radius < FACETS_OF_ROUNDING * facets)
    return (corners.places[meets], float(facets[meets].max())) if meets.any() else None


def _points_of(
    corners: Corners, low: Array, high: Array, surface: BodySurface, places: Array
) -> tuple[Array, Array]:
    """Return corners within the bounding box of the body, and points on edges there, at most half a
    facet apart, with their rounding radii, shapes (k, d) and (k,); collective.
    """
    points = [corners.places]
    radii = [corners.radius]
    if len(corners.edges):
        x = places[surface.pieces]
        lengths = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(axis=1)
        total, count = parallel.global_sum(
            surface.space.mesh.comm, np.array([lengths.sum(), lengths.size])
        )
        begin = corners.edges[:, 0]
        along = corners.edges[:, 1] - corners.edges[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            enters = (low - begin) / along
            leaves = (high - begin) / along
        within = (along != 0) | ((begin >= low) & (begin <= high))
        first = np.where(along != 0, np.minimum(enters, leaves), 0.0).max(axis=1).clip(0.0, 1.0)
        last = np.where(along != 0, np.maximum(enters, leaves), 1.0).min(axis=1).clip(0.0, 1.0)
        for k in np.flatnonzero(within.all(axis=1) & (last >= first)):
            pieces = int(
                np.ceil((last[k] - first[k]) * np.linalg.norm(along[k]) / (total / count / 2))
            )
            points.append(begin[k] + np.linspace(first[k], last[k], pieces + 2)[:, None] * along[k])
            radii.append(np.zeros(pieces + 2))
    x = np.concatenate(points)
    radius = np.concatenate(radii)
    inside = ((x >= low - radius[:, None]) & (x <= high + radius[:, None])).all(axis=1)
    return x[inside], radius[inside]


def _split(dim: int, nodes: int) -> Ints:
    """Return the flat pieces into which a facet with this number of nodes is divided, as numbers of
    its nodes, vertices first, shape (pieces, d).
    """
    if dim == 2:  # vertices, and those between them in order
        return np.array([*zip([0, *range(2, nodes)], [*range(2, nodes), 1], strict=True)])
    corners = {3: [[0, 1, 2]], 4: [[0, 1, 2], [1, 3, 2]]}
    if nodes in corners:
        return np.array(corners[nodes])
    if nodes == 6:  # basix: node 3 is across vertex 0, and so on
        return np.array([[0, 5, 4], [1, 3, 5], [2, 4, 3], [3, 4, 5]])
    around = [0, 4, 1, 6, 3, 7, 2, 5]  # of nine, around the last one
    return np.array([[8, *pair] for pair in zip(around, np.roll(around, -1), strict=True)])


def _normals(x: Array) -> Array:
    """Return unit normals of segments or triangles with these corners, shape (m, d); zero if
    degenerate.
    """
    along = x[:, 1] - x[:, 0]
    normal = (
        np.column_stack((along[:, 1], -along[:, 0]))
        if x.shape[1] == 2
        else np.cross(along, x[:, 2] - x[:, 0])
    )
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    return quotient(normal, size)


def _closest(points: Array, x: Array) -> Array:
    """Return the closest point of each of m segments or triangles to each of b points, shape (b, m,
    d).
    """
    if x.shape[1] == 2:
        return _on_segments(points, x[:, 0], x[:, 1])
    normal = _normals(x)
    height = np.einsum("bmd,md->bm", points[:, None] - x[:, 0], normal)
    flat = points[:, None] - height[..., None] * normal
    inside = np.ones(height.shape, dtype=bool)
    best = flat.copy()
    nearest = np.full(height.shape, np.inf)
    for k in range(3):
        begin = x[:, k]
        end = x[:, (k + 1) % 3]
        inside &= np.einsum("bmd,md->bm", flat - begin, np.cross(normal, end - begin)) >= 0
        on_side = _on_segments(points, begin, end)
        distance = np.linalg.norm(points[:, None] - on_side, axis=2)
        closer = distance < nearest
        best[closer] = on_side[closer]
        nearest[closer] = distance[closer]
    best[inside] = flat[inside]
    return best


def _on_segments(points: Array, begin: Array, end: Array) -> Array:
    """Return the closest point of each of m segments to each of b points, shape (b, m, d)."""
    along = end - begin
    square = inner(along, along)
    share = np.einsum("bmd,md->bm", points[:, None] - begin, along) / np.where(
        square > 0, square, 1.0
    )
    return begin + np.clip(share, 0.0, 1.0)[..., None] * along
