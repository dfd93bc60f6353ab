"""The mesh of a body in the plane with the cells around some points halved: what is near them is seen more finely.

Straight facets of a curved boundary are divided on a smooth curve through their nodes, as those of a finer mesh of the
curve would be; curved cells are divided on their own geometry.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.mesh.balance import global_nodes, owned_entities
from signorini_fx.mechanics.mesh.distribution import order_of_nodes
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, sides_of
from signorini_fx.mechanics.mesh.files.cells import CELLS
from signorini_fx.mechanics.mesh.files.raw import rows_of
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.mechanics.mesh.halving import halved_in_part
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, from_arrays
from signorini_fx.tuned import CORNER_ANGLE, SAME_LENGTH

# The kind of the cells, by the degree of their geometry.
_KINDS = {1: "triangle", 2: "triangle6"}


def has_divisible_zone(tagged: TaggedMesh) -> bool:
    """Whether ``halved_around`` can divide its cells: triangles of degree 1 or 2 in the plane."""
    mesh = tagged.mesh
    plane = (mesh.topology.dim, mesh.geometry.dim, mesh.topology.cell_name()) == (2, 2, "triangle")
    return plane and compat.geometry_degree(mesh) in _KINDS


def halved_around(tagged: TaggedMesh, points: Floats, reach: float, curved: Collection[str] = ()) -> TaggedMesh:
    """The mesh with all cells halved that come nearer to some points than ``reach``; collective.

    Args:
        tagged: a mesh that ``has_divisible_zone``.
        points: the same on all ranks, length, shape (n, 2).
        reach: length.
        curved: boundaries whose straight facets stand for a curve.
    """
    gathered = _gathered(tagged)

    def make() -> MeshArrays:
        arrays = gathered
        distance = cKDTree(points).query(arrays.points[arrays.corners].reshape(-1, 2))[0].reshape(-1, 3)
        divided = halved_in_part(arrays, distance.min(axis=1) <= reach)
        return divided if arrays.degree > 1 else _on_curves(arrays, divided, curved)

    return replace(from_arrays(tagged.mesh.comm, make), origin=tagged.origin)


def _gathered(tagged: TaggedMesh) -> MeshArrays:
    """All cells and names on the first rank, none on the others; collective."""
    mesh, comm = tagged.mesh, tagged.mesh.comm
    kind, nodes = CELLS[_KINDS[compat.geometry_degree(mesh)]], mesh.geometry.index_map()
    count = mesh.topology.index_map(2).size_local
    cells = np.empty((count, len(kind.nodes)), dtype=np.int64)
    cells[:, order_of_nodes(kind)] = global_nodes(mesh, compat.geometry_cells(mesh)[:count])
    first_cell = parallel.rows_before(comm, count)
    parts: Ints = np.empty((0, 2), dtype=np.int64)
    if tagged.cell_tags is not None:
        tagged_here = tagged.cell_tags.indices < count
        parts = np.column_stack(
            (first_cell + tagged.cell_tags.indices[tagged_here], tagged.cell_tags.values[tagged_here])
        )
    own_facets = owned_entities(mesh, tagged.facet_tags)
    points = parallel.rows_on_root(comm, mesh.geometry.x[: nodes.size_local, :2].astype(np.float64))
    cells, parts = parallel.rows_on_root(comm, cells), parallel.rows_on_root(comm, parts.astype(np.int64))
    facets = parallel.rows_on_root(comm, np.column_stack((own_facets.nodes[:, :2], own_facets.tags)))
    sides = sides_of(cells, kind)
    return MeshArrays(
        points=points,
        kind=kind.kind,
        cells=cells,
        facets=sides[rows_of(facets[:, :2], sides[:, :2])],
        boundaries={name: np.flatnonzero(np.isin(facets[:, 2], tags)) for name, tags in tagged.boundaries.items()},
        regions={name: np.sort(parts[np.isin(parts[:, 1], tags), 0]) for name, tags in tagged.regions.items()},
    )


def _on_curves(coarse: MeshArrays, fine: MeshArrays, curved: Collection[str]) -> MeshArrays:
    """The divided mesh with the middles of facets of some boundaries on a smooth curve through the nodes before."""
    points = fine.points.copy()
    for name in curved:
        ends = coarse.facets[coarse.boundaries[name]]
        boundary_nodes = np.unique(fine.facets[fine.boundaries[name]])  # another body may have a node at the same place
        straight, middles = coarse.points[ends].mean(axis=1), _middles(coarse.points, ends)
        far, at = cKDTree(fine.points[boundary_nodes]).query(straight)
        halved_ones = far <= SAME_LENGTH * np.linalg.norm(np.diff(coarse.points[ends], axis=1)[:, 0], axis=1)
        points[boundary_nodes[at[halved_ones]]] = middles[halved_ones]
    return replace(fine, points=points)


def _middles(x: Floats, ends: Ints) -> Floats:
    """The middle of each straight facet, shape (f, 2), on the polynomial through its ends and the nodes beside it."""
    facets = [(int(a), int(b)) for a, b in ends]
    beside: dict[int, list[int]] = {}
    for a, b in facets:
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    middles = np.empty((len(ends), 2))
    for number, (a, b) in enumerate(facets):
        nodes = [*_going_on(x, b, a, beside[a]), a, b, *_going_on(x, a, b, beside[b])]
        s = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(x[nodes], axis=0), axis=1))))
        middle = s[nodes.index(a) : nodes.index(b) + 1].mean()
        # Lagrange's polynomials of the arc length of the polygon.
        weights = [np.prod([(middle - knot) / (support - knot) for knot in s if knot != support]) for support in s]
        middles[number] = np.array(weights) @ x[nodes]
    return middles


def _going_on(x: Floats, last: int, at: int, beside: list[int]) -> list[int]:
    """The node beyond one of a facet where the boundary goes on without a corner."""
    onward = []
    for node in beside:
        if node != last:
            first, second = x[at] - x[last], x[node] - x[at]
            if abs(np.arctan2(first[0] * second[1] - first[1] * second[0], first @ second)) <= CORNER_ANGLE:
                onward.append(node)
    return onward[:1]
