"""The surfaces of rigid shapes near a body, where they are: lines in 2D, triangles in 3D."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.machine import parallel
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.rigid_shape import Distance
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import FOUNDATION_BESIDE, FOUNDATION_GRID, FOUNDATION_GRID_IN_SPACE, WHOLE_FOUNDATION

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]
Triangles = tuple[Floats, Rows]

# The corners of the six tetrahedra of a cube, which all have its diagonal: steps along the axes, one after another.
_TETRAHEDRA = np.array(
    [np.cumsum([np.zeros(3), *np.eye(3)[list(order)]], axis=0) for order in itertools.permutations(range(3))]
).astype(np.int64)
# Which of their edges are cut, in order around the cut: one, two or three corners are inside, and stand first.
_CUT_EDGES = (((0, 1), (0, 2), (0, 3)), ((0, 2), (0, 3), (1, 3), (1, 2)), ((0, 3), (1, 3), (2, 3)))


def lines_of(distances: Sequence[Distance], tagged: TaggedMesh) -> list[Floats]:
    """The lines of shapes in 2D near the body, each of shape (k, 2), the body on its left; collective."""
    from contourpy import contour_generator  # matplotlib's

    if not distances:
        return []
    lines = []
    for distance in distances:
        x, y = _axes(distance, tagged, FOUNDATION_GRID)
        grid = np.stack(np.meshgrid(x, y), axis=2)
        signed = distance(grid.reshape(-1, 2).T).reshape(len(y), len(x))
        for line in contour_generator(x, y, signed).lines(0.0):
            line = np.asarray(line)
            k = len(line) // 2
            ahead = line[k] - line[k - 1]
            towards = distance.direction(line[k : k + 1].T)[:, 0]
            lines.append(line[:: 1 if ahead[0] * towards[1] < ahead[1] * towards[0] else -1])
    return lines


def triangles_of(distance: Distance, tagged: TaggedMesh) -> Triangles:
    """The surface of a shape in 3D near the body, counterclockwise as seen from there; collective.

    Where the signed distance is zero along the edges of small tetrahedra, as it is linear within each.
    """
    axes = _axes(distance, tagged, FOUNDATION_GRID_IN_SPACE)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=3)
    shape = grid.shape[:3]
    signed = distance(grid.reshape(-1, 3).T)
    first = np.indices([count - 1 for count in shape]).reshape(3, -1, 1, 1)
    cells = np.ravel_multi_index(tuple(first + np.moveaxis(_TETRAHEDRA, 2, 0)[:, None]), shape).reshape(-1, 4)
    inside = signed[cells] < 0
    cut = inside.any(axis=1) & ~inside.all(axis=1)
    order = np.argsort(~inside[cut], axis=1, kind="stable")  # corners inside first
    cells, counts = np.take_along_axis(cells[cut], order, axis=1), inside[cut].sum(axis=1)
    parts = []
    for count, pairs in enumerate(_CUT_EDGES, start=1):
        edges = cells[counts == count][:, pairs]
        parts += [edges[:, (0, k, k + 1)] for k in range(1, len(pairs) - 1)]
    # An edge is cut once, whatever tetrahedra have it.
    ends, triangles = np.unique(np.concatenate(parts).reshape(-1, 2), axis=0, return_inverse=True)
    low, high = ends.T
    points = grid.reshape(-1, 3)
    points = points[low] + (signed[low] / (signed[low] - signed[high]))[:, None] * (points[high] - points[low])
    triangles = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    away = np.einsum("ij,ij->i", normals, distance.direction(corners.mean(axis=1).T).T) > 0
    triangles[away] = triangles[away, ::-1]
    return points, triangles


def drawn_shapes(solution: Solution) -> dict[str, Any]:
    """Of each contact boundary whose foundation is a shape what is drawn of that where it has moved to; collective.

    Returns:
        By the boundary: in 2D its lines, see ``lines_of``; in 3D points and triangles, see ``triangles_of``.
    """
    tagged, last = solution.model.tagged, solution.last_step
    moved: dict[int, Callable[[Floats], Floats]] = {part: tool.at for tool in last.tools for part in tool.body.parts}
    drawn: dict[str, Any] = {}
    for part, effect in enumerate(solution.statement.placed(last.place).contact):
        if effect.surface is None:
            continue
        distance = effect.gap_in(tagged.dimension)

        at = moved.get(part, np.zeros_like)
        if tagged.dimension == 2:
            drawn[effect.boundary] = [line + at(line) for line in lines_of([distance], tagged)]
        else:
            points, triangles = triangles_of(distance, tagged)
            drawn[effect.boundary] = points + at(points), triangles
    return drawn


def _axes(distance: Distance, tagged: TaggedMesh, count: int) -> list[Floats]:
    """Coordinates along each axis of a grid around the body, as many on the longest one, so large that a round thing
    that is not much larger than the body is whole; collective.
    """
    low, high = parallel.global_bounds(tagged.mesh.comm, tagged.mesh.geometry.x.astype(np.float64))
    low, high = low[: tagged.dimension], high[: tagged.dimension]
    size, around = float((high - low).max()), 2.2 * getattr(distance.shape, "inradius", np.inf)
    aside = around if around <= WHOLE_FOUNDATION * size else FOUNDATION_BESIDE * size
    spacing = (size + 2 * aside) / (count - 1)
    sides = zip(low - aside, high + aside, strict=True)
    return [np.linspace(a, b, max(round(float(b - a) / spacing) + 1, 2)) for a, b in sides]
