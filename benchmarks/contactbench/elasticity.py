"""Linear elements in NumPy: weights of boundaries and nodal forces of loads, for every adapter."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .grids import Grid
from .problem import Problem

Floats = npt.NDArray[np.float64]
# Points of Gauss on a facet: loads of the problems are singular at worst like 1/sqrt(r) off the
# boundary.
_POINTS = 8


def coordinates(points: Floats) -> dict[str, Floats]:
    """What x, y and z stand for at points, shape (..., d)."""
    return {name: points[..., k] for k, name in enumerate("xyz"[: points.shape[-1]])}


def values_at(
    problem: Problem, formula: str | float, points: Floats, time: float | None = None
) -> Floats:
    """A formula at points, shape (...), at a time or the last one."""
    return np.broadcast_to(
        np.asarray(problem.at(formula, coordinates(points), time), dtype=float), points.shape[:-1]
    )


def _on_facets(grid: Grid, boundary: str, axisymmetric: bool) -> tuple[Floats, Floats, Floats]:
    """Positions (f, q, d), shape functions (q, corners), and weights (f, q) of quadrature, times 2
    pi r.
    """
    x = grid.points[grid.facets[boundary]]
    g, w = np.polynomial.legendre.leggauss(_POINTS)
    g, w = (1 + g) / 2, w / 2
    if grid.dimension == 2:
        shape = np.stack([1 - g, g], axis=1)
        weight = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)[:, None] * w
    else:
        s, t = (part.ravel() for part in np.meshgrid(g, g, indexing="ij"))
        shape = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=1)
        along = np.stack([t - 1, 1 - t, t, -t], axis=1), np.stack([s - 1, -s, s, 1 - s], axis=1)
        tangents = [np.einsum("qa,fad->fqd", part, x) for part in along]
        weight = np.linalg.norm(np.cross(*tangents), axis=2) * np.outer(w, w).ravel()
    at = np.einsum("qa,fad->fqd", shape, x)
    if axisymmetric:
        weight = weight * 2 * np.pi * at[..., 0]
    return at, shape, weight


def nodal_weights(problem: Problem, grid: Grid, boundary: str) -> Floats:
    """Integrals of the shape functions over a boundary (axisymmetric: of the revolution), shape
    (nodes,).
    """
    _, shape, weight = _on_facets(grid, boundary, problem.hypothesis == "axisymmetric")
    found = np.zeros(len(grid.points))
    np.add.at(found, grid.facets[boundary], weight @ shape)
    return found


def nodal_loads(problem: Problem, grid: Grid, time: float | None = None) -> Floats:
    """Forces at the nodes that do the work of all tractions at a time, shape (nodes, d)."""
    found = np.zeros_like(grid.points)
    for traction in problem.tractions:
        at, shape, weight = _on_facets(
            grid, traction.boundary, problem.hypothesis == "axisymmetric"
        )
        for k, formula in traction.components.items():
            force = (weight * values_at(problem, formula, at, time)) @ shape
            np.add.at(found[:, k], grid.facets[traction.boundary], force)
    return found


def prescribed(
    problem: Problem, grid: Grid, time: float | None = None
) -> dict[tuple[int, int], float]:
    """Prescribed displacements by node and component; where two meet the later one counts."""
    found = {}
    for support in problem.supports:
        if support.at:
            nodes = np.array([grid.node_at(np.array([problem.number(c) for c in support.at]))])
        else:
            nodes = grid.nodes(support.boundary)
        for k, formula in support.components.items():
            values = values_at(problem, formula, grid.points[nodes], time)
            found |= {
                (int(node), k): float(value) for node, value in zip(nodes, values, strict=True)
            }
    return found
