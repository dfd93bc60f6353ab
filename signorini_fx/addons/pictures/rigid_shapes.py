"""The surfaces of rigid shapes near a body, at their positions: lines in 2D, triangles in 3D."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np

from signorini_fx.addons.pictures.body import normals_of
from signorini_fx.addons.pictures.foundation import DrawnSurface
from signorini_fx.arrays import Array, Ints, inner
from signorini_fx.machine import parallel
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.rigid_shape import Distance
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import (
    FOUNDATION_BESIDE,
    FOUNDATION_GRID,
    FOUNDATION_GRID_IN_SPACE,
    WHOLE_FOUNDATION,
)

Triangles = tuple[Array, Ints]


def lines_of(distance: Distance, tagged: TaggedMesh) -> list[Array]:
    """Return the lines of a shape in 2D near the body, each of shape (k, 2), with the body on the
    left; collective.
    """
    from contourpy import contour_generator  # matplotlib's

    x, y = _axes(distance, tagged, FOUNDATION_GRID)
    grid = np.stack(np.meshgrid(x, y), axis=2)
    signed = distance(grid.reshape(-1, 2).T).reshape(len(y), len(x))
    lines = []
    for line in map(np.asarray, contour_generator(x, y, signed).lines(0.0)):
        k = len(line) // 2
        ahead = line[k] - line[k - 1]
        towards = distance.direction(line[k : k + 1].T)[:, 0]
        lines.append(line[:: 1 if ahead[0] * towards[1] < ahead[1] * towards[0] else -1])
    return lines


def triangles_of(distance: Distance, tagged: TaggedMesh) -> Triangles:
    """Return points and triangles of a shape in 3D near the body, on the first rank,
    counterclockwise as seen from the body; collective.
    """
    axes = _axes(distance, tagged, FOUNDATION_GRID_IN_SPACE)
    if tagged.mesh.comm.rank != 0:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    import pyvista

    grid = pyvista.RectilinearGrid(*axes)
    surface = grid.contour([0.0], scalars=distance(np.asarray(grid.points, dtype=np.float64).T))
    points = np.asarray(surface.points, dtype=np.float64)
    triangles = surface.faces.reshape(-1, 4)[:, 1:].astype(np.int64)
    corners = points[triangles]
    away = inner(normals_of(corners), distance.direction(corners.mean(axis=1).T).T) > 0
    triangles[away] = triangles[away, ::-1]
    return points, triangles


def rigid_motions_of(solution: Solution) -> dict[str, Callable[[Array], Array]]:
    """Return for each boundary with a rigid body a function from points of shape (n, d) to the
    displacement of the rigid body there.
    """
    contacts = solution.model.contacts
    return {
        contacts[part].boundary: motion.at
        for motion in solution.last_step.rigid_bodies
        for part in motion.body.parts
    }


def drawn_shapes(solution: Solution) -> dict[str, DrawnSurface]:
    """Return the surface of the moved shape for each contact boundary whose foundation is a shape;
    collective.

    In 2D these are lines, see ``lines_of``; in 3D points and triangles, see ``triangles_of``, if
    PyVista is installed.
    """
    tagged = solution.model.tagged
    last = solution.last_step
    drawn = dict[str, DrawnSurface]()
    motions = rigid_motions_of(solution)
    if tagged.dimension == 3 and not parallel.on_root(
        solution.comm, lambda: find_spec("pyvista") is not None
    ):
        return drawn
    for effect in solution.statement.contacts_at(last.place):
        if effect.surface is None:
            continue
        distance = effect.gap_in(tagged.dimension)
        at = motions.get(effect.boundary, np.zeros_like)
        if tagged.dimension == 2:
            drawn[effect.boundary] = [line + at(line) for line in lines_of(distance, tagged)]
        else:
            points, triangles = triangles_of(distance, tagged)
            drawn[effect.boundary] = points + at(points), triangles
    return drawn


def _axes(distance: Distance, tagged: TaggedMesh, count: int) -> list[Array]:
    """Return the coordinates along the axes of a grid around the body, which contains a round shape
    if that is not much larger than the body; collective.
    """
    low, high = parallel.global_bounds(tagged.mesh.comm, tagged.mesh.geometry.x.astype(np.float64))
    low = low[: tagged.dimension]
    high = high[: tagged.dimension]
    size = float((high - low).max())
    around = 2.2 * getattr(distance.shape, "inradius", np.inf)
    aside = around if around <= WHOLE_FOUNDATION * size else FOUNDATION_BESIDE * size
    spacing = (size + 2 * aside) / (count - 1)
    sides = zip(low - aside, high + aside, strict=True)
    return [np.linspace(a, b, max(round(float(b - a) / spacing) + 1, 2)) for a, b in sides]
