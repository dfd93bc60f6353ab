"""Integrals of loads over facets and cells that are cut where expressions may jump, and how far they are not known.

Two rules are compared, the finer one of which counts: their difference is what no statement may rest on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_scene import BoundPoints
from signorini_fx.addons.bounds.facets import GAUSS, POINTS, WEIGHTS, bernstein
from signorini_fx.addons.bounds.initial_stress import simplex_rule, sizes_of_rules
from signorini_fx.addons.bounds.simplices import Simplices
from signorini_fx.mechanics.statement.cut_simplices import cut, halved

# Points at which loads are looked at together.
_POINTS = 500_000
# How often the parts of edges are halved for the rules that are compared.
_HALVED = (2, 0, 1)

# The force per area or volume at points, shape (m, q, d), on parts of cells or facets, shape (m,).
Density = Callable[[Ints, BoundPoints], Array]


@dataclass(frozen=True)
class Integrated:
    """A load on facets or in cells.

    Attributes:
        moments: integrals with the functions that it is tested with over the length or area, stress or force per
            volume, shape (n, functions, d).
        unknown: how far these are not known, see ``moments``.
        missed: mean square of what constants or linear functions miss of it, shape (n,), or mean products of the
            components of that, shape (n, d, d).
        means: mean values, shape (n, d).
    """

    moments: Array
    unknown: Array
    missed: Array
    means: Array


def integral(t: Simplices, facets: Ints, value: Any) -> tuple[float, float]:
    """The integral of a value of the scene over facets, and how far it is not known by quadrature."""
    if t.dimension == 2:

        def density(_: Ints, points: BoundPoints) -> Array:
            return np.repeat(points.value(value)[:, :, None], 2, axis=2)

        integrated = on_edges(t, facets, density, [value])
        moments, unknown = (values[..., 0].sum(axis=1) for values in (integrated.moments, integrated.unknown))
        return float(t.area[facets] @ moments), float(t.area[facets] @ unknown)
    corners = t.x[t.facets[facets]]
    owner, parts = cut(corners, [value])
    fourths = np.stack([(np.eye(3) + np.eye(3)[k]) / 2 for k in range(3)] + [(1 - np.eye(3)) / 2])
    rules = []
    for owners, fine in (
        (np.repeat(owner, 4), (fourths @ parts[:, None]).reshape(-1, 3, 3)),
        *(() if isinstance(value, float) else ((owner, parts),)),
    ):
        x = POINTS[3] @ fine @ corners[owners]
        at = BoundPoints(x, np.broadcast_to(t.normal[facets[owners]][:, None], x.shape))
        share = t.area[facets[owners]] * np.abs(np.linalg.det(fine))
        rules.append(share * (at.value(value) @ WEIGHTS[3]))
    unknown = sum(np.abs(np.bincount(owner, rules[0].reshape(-1, 4).sum(axis=1) - rule)).sum() for rule in rules[1:])
    return float(rules[0].sum()), float(unknown)


def on_edges(t: Simplices, edges: Ints, density: Density, values: list[Any]) -> Integrated:
    """Moments of a load with the polynomials of Bernstein of degree 2, in the order of ``facets.bernstein``, and what
    linear functions miss of it.

    Args:
        t: the triangles.
        edges: that are loaded, shape (n,).
        density: at points of these edges.
        values: of the scene that it is made of.
    """
    x, varies = t.x[t.edges[edges]], not all(isinstance(value, float) for value in values)
    owner, parts = cut(x, values)
    rules: list[tuple[Array, Array]] = []
    for often in _HALVED if varies else (0,):
        owners, fine = owner, parts
        for _ in range(often):
            owners, fine = np.tile(owners, 2), halved(fine)
        begin, length = fine[:, 0, 1], fine[:, 1, 1] - fine[:, 0, 1]
        s, w = begin[:, None] + length[:, None] * GAUSS[0], length[:, None] * GAUSS[1]
        a, b = x[owners, 0][:, None], x[owners, 1][:, None]
        at = a + s[:, :, None] * (b - a)
        force = density(owners, BoundPoints(at, np.broadcast_to(t.normal[edges[owners]][:, None], at.shape)))
        local = np.stack((1 - s, s), axis=2)
        tested = bernstein(local.reshape(-1, 2)).reshape(*s.shape, 3) * w[:, :, None]
        moments = np.zeros((len(edges), 3, 2))
        np.add.at(moments, owners, np.einsum("mqb,mqd->mbd", tested, force))
        linear = local @ closest_linear(moments[:, :2] + moments[:, 2:] / 2)[owners]
        missed = np.bincount(owners, np.einsum("mq,mqd->m", w, (force - linear) ** 2), len(edges))
        rules.append((moments, np.asarray(missed, dtype=np.float64)))
    return _compared(rules, rules[0][0].sum(axis=1))


def in_simplices(
    x: Array, density: Density, values: list[Any], *, normal: Array | None = None, sizes: tuple[int, ...] | None = None
) -> Integrated:
    """Moments of a load with the barycentric coordinates, and with their products, and what linear functions miss of
    it.

    Args:
        x: corners of triangles or tetrahedra, length, shape (n, k, d).
        density: at points of these.
        values: of the scene that it is made of.
        normal: of facets, shape (n, d); None: they are cells.
        sizes: of the rules; None: those that the values need.
    """
    n, count, d = x.shape
    owner, parts = cut(x, values)
    share = np.abs(np.linalg.det(parts))
    across = np.zeros((n, d)) if normal is None else normal
    rules: list[tuple[Array, Array]] = []
    for size in sizes or sizes_of_rules(values, 1):
        local, weight = simplex_rule(count - 1, size)
        moments, squares = np.zeros((n, count + count**2, d)), np.zeros((n, d, d))
        chunks = np.array_split(np.arange(len(owner)), len(owner) * len(local) // _POINTS + 1)
        forces = []
        for rows in chunks:
            places, of = local @ parts[rows], owner[rows]
            at = np.einsum("mqc,mcd->mqd", places, x[of])
            force = density(of, BoundPoints(at, np.broadcast_to(across[of][:, None], at.shape)))
            products = np.einsum("mqi,mqj->mqij", places, places).reshape(*places.shape[:2], -1)
            tested = np.concatenate((places, products), axis=2) * (share[rows, None] * weight)[:, :, None]
            np.add.at(moments, of, np.einsum("mqb,mqd->mbd", tested, force))
            forces.append(force)
        linear = closest_linear(moments[:, :count])
        for rows, force in zip(chunks, forces, strict=True):
            left = force - np.einsum("mqc,mcd->mqd", local @ parts[rows], linear[owner[rows]])
            products = np.einsum("q,mqi,mqj->mij", weight, left, left)
            np.add.at(squares, owner[rows], share[rows, None, None] * products)
        rules.append((moments, squares))
    return _compared(rules, rules[0][0][:, :count].sum(axis=1))


def closest_linear(moments: Array) -> Array:
    """The values at the corners of simplices of the linear functions with given moments, shape (n, k, ...).

    Args:
        moments: mean values of the products with the barycentric coordinates, shape (n, k, ...).
    """
    count = moments.shape[1]
    return np.asarray(count * (count + 1) * moments - count * moments.sum(axis=1, keepdims=True))


def _compared(rules: list[tuple[Array, Array]], means: Array) -> Integrated:
    """What the first rule gives, and by how much the others differ from it."""
    (moments, missed), further_rules = rules[0], rules[1:]
    unknown = (
        np.max([np.abs(estimate - moments) for estimate, _ in further_rules], axis=0)
        if further_rules
        else np.zeros_like(moments)
    )
    if further_rules and missed.ndim == 3:
        sizes = np.max([np.linalg.norm(estimate - missed, axis=(1, 2)) for _, estimate in further_rules], axis=0)
        missed_change = sizes[:, None, None] * np.eye(missed.shape[2])
    else:
        differences = [np.abs(estimate - missed) for _, estimate in further_rules]
        missed_change = np.max(differences, axis=0) if differences else np.zeros_like(missed)
    return Integrated(moments, unknown, missed + missed_change, means)
