"""Springs whose stiffness varies on a facet: what is more than the least one there, as a given reaction.

Springs of the stiffness K are springs of the least one on each facet, K_1, beside others of K_2 = K - K_1.  For the
latter the stress holds the traction -K_2 y of a displacement y that is at hand, whatever K_2 is: then what it leaves of
the forces that v exerts is, by (B14) of docs/bounds.md,

    int K_2^+ (K_2 v - K_2 y) . (K_2 v - K_2 y) = int K_2 (v - y) . (v - y),

in which nothing is divided by K_2: it may vanish, and the integrals are those of polynomials where K is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_scene import BoundPoints
from signorini_fx.addons.bounds.facets import POINTS, SEEN, bernstein
from signorini_fx.addons.bounds.graded_moduli import range_of
from signorini_fx.addons.bounds.initial_stress import simplex_rule, sizes_of_rules
from signorini_fx.addons.bounds.simplices import Simplices
from signorini_fx.mechanics.effects.springs import Springs
from signorini_fx.mechanics.statement.cut_simplices import cut
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.tuned import KNOWN_DEGREE, LEAST_SEEN_SHARE, SAME_LENGTH, SAME_NUMBER

# Barycentric corners of the parts of a facet on which coefficients of Bernstein are nearer to the least value.
_FOURTHS: dict[int, Array] = {
    2: np.array([[[1 - k / 4, k / 4], [0.75 - k / 4, 0.25 + k / 4]] for k in range(4)]),
    3: np.array([*((np.eye(3) + np.eye(3)[k]) / 2 for k in range(3)), (1 - np.eye(3)) / 2]),
}


@dataclass(frozen=True)
class SpringPoints(BoundPoints):
    """Points at which springs are asked for their forces, ``statement.effect.Points``.

    Attributes:
        moved: the displacement there, length, shape (f, q, d).
    """

    moved: Array

    @property
    def displacement(self) -> Array:
        """See ``Points``."""
        return self.moved


@dataclass(frozen=True)
class SpringComponent:
    """Springs of one entry in its directions: the stiffness is a function times the same matrix on each facet.

    Attributes:
        facets: of the cells, shape (m,).
        directions: that matrix, shape (m, d, d).
        value: of the scene, stress / length.
        least: at most its least value on each facet, not negative, shape (m,).
    """

    facets: Ints
    directions: Array
    value: Any
    least: Array

    @staticmethod
    def of(t: Simplices, entry: Springs, facets: Ints) -> list[SpringComponent]:
        """Those of an entry on its facets."""
        d, components = t.dimension, []
        x = t.x[t.facets[facets]].mean(axis=1)[:, None]
        for key, value in entry.given.items():
            alone = entry.model_copy(update={**dict.fromkeys(entry.given, 0.0), key: 1.0})
            directions = np.empty((len(facets), d, d))
            for k in range(d):
                at = SpringPoints(x, t.normal[facets][:, None], np.broadcast_to(np.eye(d)[k], x.shape))
                directions[:, :, k] = np.broadcast_to(alone.reaction_at(at), x.shape)[:, 0]
            components.append(SpringComponent(facets, directions, value, _least(t, facets, value)))
        return components


def _least(t: Simplices, facets: Ints, value: Any) -> Array:
    """At most the least value on each facet, not negative, shape (m,)."""
    if isinstance(value, float):
        return np.full(len(facets), value)
    corners = t.x[t.facets[facets]]
    if isinstance(value, Expression) and value.degree <= KNOWN_DEGREE and value.cuts_exactly:
        parts = (_FOURTHS[t.dimension] @ corners[:, None]).reshape(-1, *corners.shape[1:])
        least, greatest = range_of(
            parts, lambda _, x: BoundPoints(x, np.zeros_like(x)).value(value), [value], int(value.degree)
        )
        least, greatest = least.reshape(len(facets), -1).min(axis=1), greatest.reshape(len(facets), -1).max(axis=1)
        least = least - SAME_NUMBER * np.abs(greatest)  # for the round-off of values whose terms may cancel
    else:
        seen = np.concatenate((SEEN[t.dimension], POINTS[t.dimension])) @ corners
        at_points = BoundPoints(seen, np.zeros_like(seen)).value(value)
        least, greatest = LEAST_SEEN_SHARE * at_points.min(axis=1), at_points.max(axis=1)
    return np.where(least > SAME_LENGTH * greatest, least, 0.0)


@dataclass(frozen=True)
class _SpringQuadrature:
    """Points of quadrature on parts of facets.

    Attributes:
        rows: the facet of each part, shape (k,).
        at: barycentric in it, shape (k, q, d).
        weight: area, shape (k, q).
        stiffness: K_2, shape (k, q, d, d).
    """

    rows: Ints
    at: Array
    weight: Array
    stiffness: Array


@dataclass(frozen=True)
class VaryingSprings:
    """K_2 on m facets.

    Attributes:
        t: the cells.
        facets: of the cells, shape (m,).
        cells: that they are facets of, shape (m,).
        loose: projectors onto the directions that supports leave free, shape (m, d, d).
        components: of the scene, of which some vary.
        rules: the one that counts, and others where it is not exact.
    """

    t: Simplices
    facets: Ints
    cells: Ints
    loose: Array
    components: tuple[SpringComponent, ...]
    rules: tuple[_SpringQuadrature, ...]

    @staticmethod
    def of(t: Simplices, held: Array, springs: Sequence[SpringComponent]) -> VaryingSprings | None:
        """Those of a scene; None: the stiffness is a number everywhere.

        Args:
            t: the cells.
            held: projectors onto the directions in which facets are held, shape (f, d, d).
            springs: of the scene.

        Raises:
            Refused: supports hold a boundary across its springs, or a stiffness is negative.
        """
        varying = tuple(component for component in springs if not isinstance(component.value, float))
        if not varying:
            return None
        facets = np.unique(np.concatenate([component.facets for component in varying]))
        loose = np.eye(t.dimension) - held[facets]
        without_rules = VaryingSprings(t, facets, t.sides[facets, 0], loose, varying, ())
        values = [component.value for component in varying]
        corners, rules = t.x[t.facets[facets]], []
        rows, places = cut(corners, values)
        for size in sizes_of_rules(values, 2):
            points, weights = simplex_rule(t.dimension - 1, size)
            at, share = points @ places, np.abs(np.linalg.det(places)) * t.area[facets[rows]]
            x = np.einsum("kqc,kcd->kqd", at, corners[rows])
            stiffness = without_rules.stiffness_at(rows, x)
            across = np.abs(loose[rows][:, None] @ stiffness @ held[facets[rows]][:, None]).max(initial=0.0)
            if across > SAME_LENGTH * np.abs(stiffness).max(initial=0.0):
                raise Refused(
                    "springs have a guaranteed bound where supports hold the boundary along or across them so far"
                )
            projected = loose[rows][:, None] @ stiffness @ loose[rows][:, None]
            rules.append(_SpringQuadrature(rows, at, share[:, None] * weights, projected))
        return replace(without_rules, rules=tuple(rules))

    def stiffness_at(self, rows: Ints, x: Array) -> Array:
        """K_2 at points on parts of facets, supports left out, shape (k, q, d, d).

        Args:
            rows: the facets, shape (k,).
            x: length, shape (k, q, d).
        """
        stiffness = np.zeros((*x.shape, x.shape[2]))
        for component in self.components:
            number = np.full(len(self.t.facets), -1)
            number[component.facets] = np.arange(len(component.facets))
            of_component = number[self.facets[rows]]
            parts = np.flatnonzero(of_component >= 0)
            places = of_component[parts]
            value = BoundPoints(x[parts], np.zeros_like(x[parts])).value(component.value)
            if (value < -SAME_LENGTH * np.abs(value).max(initial=0.0)).any():
                raise Refused("springs have a guaranteed bound where their stiffness is not negative")
            excess = value - component.least[places][:, None]
            stiffness[parts] += excess[:, :, None, None] * component.directions[places][:, None]
        return stiffness

    @property
    def matrices(self) -> Array:
        """See ``SpringFacets``, shape (m, d d, d d)."""
        rule, (m, d, _) = self.rules[0], self.loose.shape
        local = np.einsum("kq,kqa,kqb,kqij->kaibj", rule.weight, rule.at, rule.at, rule.stiffness)
        matrices = np.zeros((m, d * d, d * d))
        np.add.at(matrices, rule.rows, local.reshape(-1, d * d, d * d))
        return matrices

    def product(self, first: Array, second: Array) -> tuple[Array, Array]:
        """Integrals of K_2 v . w in the cells of the facets, and how far they are not known, energies, shapes (n,).

        Args:
            first: coefficients of Bernstein of v, length, shape (m, 3 or 6, d).
            second: those of w.
        """
        sums = []
        for rule in self.rules:
            values = bernstein(rule.at.reshape(-1, rule.at.shape[2])).reshape(*rule.at.shape[:2], -1)
            v, w = (values @ coefficients[rule.rows] for coefficients in (first, second))
            products = np.einsum("kq,kqi,kqij,kqj->k", rule.weight, v, rule.stiffness, w)
            sums.append(np.bincount(self.cells[rule.rows], products, len(self.t.corners)).astype(np.float64))
        return sums[0], np.max([np.abs(sums[0] - rival) for rival in sums], axis=0)


@dataclass(frozen=True)
class SpringReaction:
    """The traction -K_2 y as a load, see ``applied_loads.Acting``.

    Attributes:
        springs: of the stiffness K_2.
        displacement: coefficients of Bernstein of y on their facets, length, shape (m, 3 or 6, d).
    """

    springs: VaryingSprings
    displacement: Array
    doubtful: float = 0.0
    beyond: int = 2

    @property
    def facets(self) -> Ints:
        """On which it acts."""
        return self.springs.facets

    def profile(self, dimension: int) -> tuple[Any, ...]:
        """See ``Force``: ``beyond`` is the degree of the displacement."""
        return tuple(component.value for component in self.springs.components)

    def on(self, t: Simplices, facets: Ints, points: BoundPoints) -> Array:
        """Force per area at points on parts of some of its facets, shape (m, q, d)."""
        springs = self.springs
        rows = np.searchsorted(springs.facets, facets)
        corners = t.x[t.facets[facets]]
        edges = corners[:, 1:] - corners[:, :1]
        gram = edges @ edges.transpose(0, 2, 1)
        coordinates = np.linalg.solve(gram, edges @ (points.x - corners[:, :1]).transpose(0, 2, 1)).transpose(0, 2, 1)
        at = np.concatenate((1 - coordinates.sum(axis=2, keepdims=True), coordinates), axis=2)
        moved = bernstein(at.reshape(-1, at.shape[2])).reshape(*at.shape[:2], -1) @ self.displacement[rows]
        loose = springs.loose[rows][:, None]
        stiffness = loose @ springs.stiffness_at(rows, points.x) @ loose
        return np.asarray(-np.einsum("kqij,kqj->kqi", stiffness, moved))
