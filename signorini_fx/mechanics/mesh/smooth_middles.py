"""The middles of straight facets that stand for a curve or a curved surface: on a smooth one through their nodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import CORNER_ANGLE


def sides_of_facets(facets: Ints) -> Ints:
    """Where halved facets get nodes: the corners of each side, in space once, shape (s, 2); in the plane the facets."""
    if facets.shape[1] == 2:
        return facets
    sides = np.stack((facets, np.roll(facets, -1, axis=1)), axis=2).reshape(-1, 2)
    distinct: Ints = np.unique(np.sort(sides, axis=1), axis=0)
    return distinct


def smooth_middles(x: Floats, facets: Ints, sides: Ints) -> Floats:
    """The middle of each of some sides, shape (s, d).

    In the plane, and where a surface ends or has an edge, it is on the polynomial through the ends of the side and the
    nodes beside it, as long as these go on without a corner.  Elsewhere in space it is the mean of two paraboloids,
    each through an end of the side and next to the nodes of the facets around it and around these.

    Args:
        x: positions of the nodes, length, shape (n, d).
        facets: corners of each along its perimeter, shape (f, c).
        sides: rows of ``sides_of_facets``, shape (s, 2).
    """
    if facets.shape[1] == 2:
        return _on_curve(x, facets, sides)
    all_sides = sides_of_facets(facets)
    of_facets = np.sort(np.stack((facets, np.roll(facets, -1, axis=1)), axis=2), axis=2)
    numbered = {pair: number for number, pair in enumerate(pairs_of(all_sides))}
    of_facet = np.array([[numbered[int(a), int(b)] for a, b in pairs] for pairs in of_facets])
    sharp = _is_edge(x, facets, all_sides, of_facet)
    middles = np.empty((len(sides), 3))
    on_edge = np.array([sharp[numbered[min(a, b), max(a, b)]] for a, b in pairs_of(sides)], dtype=bool)
    middles[on_edge] = _on_curve(x, all_sides[sharp], sides[on_edge])
    middles[~on_edge] = _on_surface(x, facets, sides[~on_edge], _smooth_parts(sharp, of_facet), of_facet, numbered)
    return middles


def _is_edge(x: Floats, facets: Ints, sides: Ints, of_facet: Ints) -> npt.NDArray[np.bool_]:
    """Whether each side belongs to other than two facets, or these meet at an angle."""
    order = np.argsort(of_facet.ravel(), kind="stable")
    number, first, count = np.unique(of_facet.ravel()[order], return_index=True, return_counts=True)
    sharp = np.ones(len(sides), dtype=bool)
    number, first = number[count == 2], first[count == 2]
    pairs = order[np.column_stack((first, first + 1))] // facets.shape[1]
    along = x[sides[number, 1]] - x[sides[number, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]
    away = x[facets].mean(axis=1)[pairs] - x[sides[number, 0]][:, None]
    away -= (away @ along[:, :, None]) * along[:, None]
    unit = away / np.linalg.norm(away, axis=2)[:, :, None]
    angle = np.pi - np.arccos(np.clip((unit[:, 0] * unit[:, 1]).sum(axis=1), -1, 1))
    sharp[number] = angle > CORNER_ANGLE
    return sharp


def _smooth_parts(sharp: npt.NDArray[np.bool_], of_facet: Ints) -> Ints:
    """A number for each smooth part of the surface, by facet, shape (f,)."""
    facet = np.repeat(np.arange(len(of_facet)), of_facet.shape[1])
    links = ~sharp[of_facet.ravel()]
    joined = coo_array((np.ones(links.sum()), (facet[links], of_facet.ravel()[links])), (len(of_facet), len(sharp)))
    parts: Ints = connected_components(joined @ joined.T, directed=False)[1].astype(np.int64)
    return parts


def _on_surface(
    x: Floats, facets: Ints, sides: Ints, parts: Ints, of_facet: Ints, numbered: dict[tuple[int, int], int]
) -> Floats:
    """See ``smooth_middles``; sides that belong to two facets of one smooth part."""
    facets_at: dict[tuple[int, int], list[int]] = {}  # by part and node
    for facet in range(len(facets)):
        for node in facets[facet]:
            facets_at.setdefault((int(parts[facet]), int(node)), []).append(facet)
    part_of = np.empty(len(numbered), dtype=np.int64)
    part_of[of_facet] = parts[:, None]
    fits: dict[tuple[int, int], _Paraboloid] = {}

    def fit(part: int, node: int) -> _Paraboloid:
        if (part, node) not in fits:
            near = np.unique(facets[facets_at[part, node]])
            around = np.unique(facets[sorted({facet for at in near for facet in facets_at[part, int(at)]})])
            fits[part, node] = _Paraboloid(x[node], x[around[around != node]])
        return fits[part, node]

    middles = np.empty((len(sides), 3))
    for number, (a, b) in enumerate(pairs_of(sides)):
        part, middle = int(part_of[numbered[min(a, b), max(a, b)]]), (x[a] + x[b]) / 2
        middles[number] = (fit(part, a).above(middle) + fit(part, b).above(middle)) / 2
    return middles


class _Paraboloid:
    """The paraboloid through a point that is nearest to others, as a height above the plane nearest to them."""

    def __init__(self, point: Floats, others: Floats) -> None:
        self.point = point
        away = others - point
        self.axes = np.linalg.svd(away, full_matrices=False)[2]
        u, v, height = (away @ self.axes.T).T
        near = 1 / np.linalg.norm(away, axis=1) ** 2
        powers = np.column_stack((u, v, u * u, u * v, v * v))
        size = np.abs(powers).max(axis=0) + np.finfo(float).tiny
        self.weights = np.linalg.lstsq(powers / size * near[:, None], height * near, rcond=None)[0] / size

    def above(self, point: Floats) -> Floats:
        """The point of the paraboloid above or below another one."""
        u, v, _ = self.axes @ (point - self.point)
        height = np.array([u, v, u * u, u * v, v * v]) @ self.weights
        above: Floats = self.point + np.array([u, v, height]) @ self.axes
        return above


def _on_curve(x: Floats, sides: Ints, wanted: Ints) -> Floats:
    """The middle of each of some sides of curves, shape (w, d), on the polynomial through its ends and the nodes beside
    it.
    """
    beside: dict[int, list[int]] = {}
    for a, b in pairs_of(sides):
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    middles = np.empty((len(wanted), x.shape[1]))
    for number, (a, b) in enumerate(pairs_of(wanted)):
        nodes = [*_going_on(x, b, a, beside[a]), a, b, *_going_on(x, a, b, beside[b])]
        s = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(x[nodes], axis=0), axis=1))))
        middle = s[nodes.index(a) : nodes.index(b) + 1].mean()
        # Lagrange's polynomials of the arc length of the polygon.
        weights = [np.prod([(middle - knot) / (support - knot) for knot in s if knot != support]) for support in s]
        middles[number] = np.array(weights) @ x[nodes]
    return middles


def pairs_of(sides: Ints) -> list[tuple[int, int]]:
    """The ends of each side as plain numbers."""
    return [(int(a), int(b)) for a, b in sides]


def _going_on(x: Floats, last: int, at: int, beside: Sequence[int]) -> list[int]:
    """The node beyond one of a side where the curve goes on without a corner."""
    first = x[at] - x[last]
    onward = []
    for node in beside:
        second = x[node] - x[at]
        cosine = first @ second / (np.linalg.norm(first) * np.linalg.norm(second))
        if node != last and np.arccos(np.clip(cosine, -1, 1)) <= CORNER_ANGLE:
            onward.append(node)
    return onward[:1]
