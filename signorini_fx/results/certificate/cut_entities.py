"""Points of quadrature where loads jump inside facets or cells, for what is integrated without any compiled form.

Each facet or cell is a convex polytope in its reference cell.  Every function that a load compares divides the
polytopes on both of whose sides it has vertices, and Delaunay's triangulation fills what is left.  The solver cuts
simplices instead, edge by edge, and shares no line of this.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import basix
import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh, entities_to_geometry
from scipy.spatial import ConvexHull, Delaunay, QhullError

from signorini_fx.machine import compat
from signorini_fx.mechanics.assembly.quadrature import has_affine_parts
from signorini_fx.mechanics.statement.effect import Effect
from signorini_fx.mechanics.statement.expressions import Expression, in_space
from signorini_fx.tuned import AFFINE, NO_PART

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]

_SIMPLICES = {1: basix.CellType.interval, 2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}


def cut_rules(mesh: Mesh, effect: Effect, every: Indices, degree: int) -> Iterator[tuple[int, tuple[Array, Array]]]:
    """Those of some cells of a mesh, or facets if the effect has a boundary, that jumps of a load cut, each with points
    in its reference cell or facet and their weights, see ``cut_entities``; collective.
    """
    jumps, inside, across = getattr(effect, "jumps", ()), effect.where is None, mesh.topology.dim
    if not jumps or not has_affine_parts(mesh, in_body=inside):
        return
    cell = getattr(basix.CellType, mesh.topology.cell_name())
    corners: Array = np.asarray(basix.geometry(cell if inside else basix.cell.subentity_types(cell)[across - 1][0]))
    if every.size:  # dolfinx divides by their number
        at = compat.geometry_cells(mesh)[every] if inside else entities_to_geometry(mesh, across - 1, every)
        x = mesh.geometry.x[at[:, : len(corners)], :across].astype(np.float64)
        for number, points, weights in cut_entities(corners, x, jumps, degree):
            yield int(every[number]), (points, weights)


def cut_entities(
    corners: Array, x: Array, jumps: Sequence[Expression], degree: int
) -> Iterator[tuple[int, Array, Array]]:
    """Rules of those facets or cells that jumps cut into parts that are known exactly.

    Args:
        corners: vertices of the reference facet or cell, shape (k, t).
        x: the same of each facet or cell in the body, of which the reference has an affine map, shape (n, k, d).
        jumps: the expressions of a load.
        degree: of the rule on each part.

    Yields:
        Number of a facet or cell, points in the reference, shape (q, t), and weights, shape (q,).
    """
    for number in np.flatnonzero(_may_be_cut(x, jumps)):
        along = np.linalg.lstsq(np.column_stack((corners, np.ones(len(corners)))), x[number], rcond=None)[0]
        parts = _parts(corners, along, jumps)
        if parts is not None and len(parts) > 1:
            rules = [_rule(part, degree) for part in parts]
            points, weights = (np.concatenate([rule[k] for rule in rules]) for k in (0, 1))
            whole = basix.make_quadrature(_kind(corners), 1)[1].sum()
            if abs(weights.sum() - whole) <= NO_PART * whole:
                yield int(number), points, weights


def _kind(corners: Array) -> basix.CellType:
    """The kind of the facet or cell with these vertices."""
    boxes = {4: basix.CellType.quadrilateral, 8: basix.CellType.hexahedron}
    size = corners.shape[1]
    return boxes[len(corners)] if len(corners) > size + 1 else _SIMPLICES[size]


def _may_be_cut(x: Array, jumps: Sequence[Expression]) -> npt.NDArray[np.bool_]:
    """Where some function has not the same sign at all vertices, shape (n,)."""
    found = np.zeros(len(x), dtype=bool)
    for value in jumps:
        signs = np.sign(np.nan_to_num(value.switches(in_space(x.reshape(-1, x.shape[2])))))
        by_vertex = signs.reshape(len(signs), *x.shape[:2])
        found |= (by_vertex.min(axis=2) * by_vertex.max(axis=2) < 0).any(axis=0)
    return found


def _parts(corners: Array, along: Array, jumps: Sequence[Expression]) -> list[Array] | None:
    """Vertices of the convex parts on which no function changes its sign; None if one is not affine on a part.

    Args:
        corners: of the reference, shape (k, t).
        along: its affine map, the place of the origin last, shape (t + 1, d).
        jumps: the expressions.
    """
    parts = [corners]
    for value in jumps:
        for number in range(value.switch_count):

            def sign(at: Array, value: Expression = value, number: int = number) -> Array:
                at = at @ along[:-1] + along[-1]
                return np.asarray(np.nan_to_num(value.switch(number, in_space(at))))

            every = [sign(part) for part in parts]
            most = max(float(np.abs(here).max()) for here in every)
            before, parts = parts, []
            for part, here in zip(before, every, strict=True):
                pairs = np.array(list(combinations(range(len(part)), 2)))
                middle = sign(part[pairs].mean(axis=1))
                if (np.abs(middle - here[pairs].mean(axis=1)) > AFFINE * most).any():
                    return None
                here = np.where(np.abs(here) <= AFFINE * np.abs(here).max(), 0.0, here)
                across = pairs[here[pairs[:, 0]] * here[pairs[:, 1]] < 0]
                if not len(across):
                    parts.append(part)
                    continue
                a, b = here[across].T[..., None]
                between = part[across[:, 0]] + a / (a - b) * (part[across[:, 1]] - part[across[:, 0]])
                sides = [np.concatenate((part[side], between)) for side in (here >= 0, here <= 0)]
                parts += [side[_extreme(side)] for side in sides]
    return parts


def _extreme(vertices: Array) -> Indices:
    """The numbers of those points, shape (v, t), that are corners of their convex hull, or of all if it is flat: points
    between corners would make parts without an area, whose points are on a jump.
    """
    if vertices.shape[1] == 1:
        return np.array([vertices.argmin(), vertices.argmax()], dtype=np.int32)
    try:
        return np.asarray(ConvexHull(vertices).vertices, dtype=np.int32)
    except QhullError:
        return np.arange(len(vertices), dtype=np.int32)


def _rule(vertices: Array, degree: int) -> tuple[Array, Array]:
    """A rule on the convex hull of points, shape (v, t)."""
    size = vertices.shape[1]
    if size == 1:
        simplices = np.array([[vertices.min(axis=0), vertices.max(axis=0)]])
    else:
        try:
            simplices = vertices[Delaunay(vertices).simplices]
        except QhullError:  # it is flat: nothing is in it
            simplices = np.empty((0, size + 1, size))
    # All of its points are inside.
    points, weights = basix.make_quadrature(_SIMPLICES[size], degree, rule=basix.QuadratureType.gauss_jacobi)
    edges = simplices[:, 1:] - simplices[:, :1]
    sizes = np.abs(np.linalg.det(edges))
    there = sizes > NO_PART * sizes.sum()
    simplices, edges = simplices[there], edges[there]
    at = simplices[:, :1] + points @ edges
    return at.reshape(-1, size), (np.abs(np.linalg.det(edges))[:, None] * weights).ravel()
