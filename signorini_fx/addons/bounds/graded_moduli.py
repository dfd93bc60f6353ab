"""Moduli that vary inside the cells: a polynomial gamma of the position times those in the centre of each cell.

A displacement v has the stress gamma C eps(v), C that of the centre, so that in its energy norm

    |gamma C eps(v) - tau|^2 = int 1 / gamma (gamma C eps(v) - tau) : C^-1 (gamma C eps(v) - tau),

of which all but 1 / gamma is a polynomial between jumps and kinks of gamma, and this is at most one over the least
coefficient of Bernstein of gamma there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from math import factorial, prod
from typing import Any

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_scene import BoundPoints, in_region
from signorini_fx.addons.bounds.initial_stress import simplex_rule
from signorini_fx.addons.bounds.simplices import CORNERS_OF_PARTS, TWICE, Moduli, Simplices
from signorini_fx.mechanics.body.moduli import middles
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.cut_simplices import cut
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.quantities.statements import Refused
from signorini_fx.tuned import SAME_NUMBER

# How far the points that a polynomial is known from are inside: on its boundary it may have the values beside a jump.
_INSIDE = 0.9
# Gamma, but for a factor of each cell, at points of cells, shape (m, q), of positions, length, shape (m, q, d).
_Grading = Callable[[Ints, Array], Array]


@dataclass(frozen=True)
class GradedPart:
    """Points of quadrature on one part of the cells.

    Attributes:
        rows: the cell of each row, shape (m,).
        at: barycentric in the part, shape (m, q, d + 1).
        weight: volume, shape (m, q).
        share: gamma, shape (m, q).
    """

    rows: Ints
    at: Array
    weight: Array
    share: Array

    def integral(self, moduli: Moduli, sigma: Array, tau: Array, count: int) -> Array:
        """Of sigma : C^-1 tau at the points, energies, shape (count,)."""
        strain, unit = moduli.of(self.rows).scaled_strain(tau)
        density = (sigma * strain * TWICE[self.at.shape[2] - 1]).sum(axis=2) / unit[:, None]
        return np.bincount(self.rows, (density * self.weight).sum(axis=1), count).astype(np.float64)


@dataclass(frozen=True)
class GradedModuli:
    """Gamma on n cells.

    Attributes:
        moduli: C.
        least: of which gamma is at least, shape (n,).
        greatest: of which it is at most, shape (n,).
        parts: points of quadrature.
    """

    moduli: Moduli
    least: Array
    greatest: Array
    parts: tuple[GradedPart, ...]

    def square(self, elastic: Array, tau: Array) -> Array:
        """More than the squares of the norm of gamma C eps - tau, by cell, energies, shape (n,).

        Args:
            elastic: C eps on the parts at their corners, see ``LocalStress.stress``.
            tau: another stress, likewise.
        """
        squares = np.zeros(len(self.least))
        for part, first, second in self._at_points(elastic, tau):
            apart = part.share[..., None] * first - second
            squares += part.integral(self.moduli, apart, apart, len(squares))
        return squares / self.least

    def energy(self, elastic: Array, second_elastic: Array) -> Array:
        """Integrals of gamma C eps : eps' from C eps and C eps', by cell, energies, shape (n,)."""
        energies = np.zeros(len(self.least))
        for part, first, second in self._at_points(elastic, second_elastic):
            energies += part.integral(self.moduli, part.share[..., None] * first, second, len(energies))
        return energies

    def _at_points(self, first: Array, second: Array) -> Iterator[tuple[GradedPart, Array, Array]]:
        """Stresses at the points, shape (m, q, 3 or 6)."""
        for number, part in enumerate(self.parts):
            yield part, part.at @ first[part.rows, number], part.at @ second[part.rows, number]


def graded_moduli(d: Model, t: Simplices, owner: Ints) -> GradedModuli | None:
    """Those of a scene; None: moduli are constant in each cell.

    Args:
        d: the model.
        t: the cells, with the moduli in the middles of those of the mesh.
        owner: the cell of the mesh that each is in, shape (n,).

    Raises:
        Refused: a modulus may vanish.
    """
    graded = [material for material in d.statement.material if material.grading is not None]
    if not graded:
        return None
    values = [material.grading for material in graded]
    inside = [in_region(d, material.region, owner) for material in graded]

    def grading(rows: Ints, x: Array) -> Array:
        """See ``_Grading``."""
        at, share = BoundPoints(x, np.zeros_like(x)), np.ones(x.shape[:2])
        for value, of_material in zip(values, inside, strict=True):
            graded_rows = of_material[rows]
            share[graded_rows] = at.value(value)[graded_rows]
        return share

    cells = np.arange(len(owner))
    of_mesh = middles(d.tagged, owner.astype(np.int32)).T[:, None, : t.dimension]
    centre = grading(cells, t.x[t.corners].mean(axis=1)[:, None])[:, 0]
    moduli = t.moduli.times(centre / grading(cells, of_mesh)[:, 0])
    degree = int(max(value.degree for value in values if isinstance(value, Expression)))
    least, greatest = _bounds(t, grading, values, degree)
    room = SAME_NUMBER * np.abs(greatest)  # for the round-off of values whose terms may cancel
    least, greatest = least - room, greatest + room
    if not (least > 0).all():
        raise Refused("a guaranteed bound needs moduli that do not vanish inside cells: use smaller ones there")
    parts = tuple(_points(t, part, grading, centre, values, degree) for part in range(t.dimension + 1))
    return GradedModuli(moduli, np.asarray(least / centre), np.asarray(greatest / centre), parts)


def _points(t: Simplices, number: int, grading: _Grading, centre: Array, values: list[Any], degree: int) -> GradedPart:
    """The points of quadrature on one part, exact for the squares of gamma times linear functions.

    Args:
        t: the cells.
        number: of the part.
        grading: of the scene.
        centre: the grading in the centres of the cells, shape (n,).
        values: of the scene that the grading is made of.
        degree: the largest of these.
    """
    d, count = t.dimension, t.dimension + 1
    x = np.einsum("kc,ncd->nkd", CORNERS_OF_PARTS[d][number], t.x[t.corners])
    rows, places = cut(x, values)
    points, weights = simplex_rule(d, degree + 2)
    at = points @ places
    share = grading(rows, np.einsum("mqc,mcd->mqd", at, x[rows])) / centre[rows, None]
    size = np.abs(np.linalg.det(places)) * t.volume[rows] / count
    return GradedPart(rows, at, size[:, None] * weights, share)


def _bounds(t: Simplices, grading: _Grading, values: list[Any], degree: int) -> tuple[Array, Array]:
    """The least and the largest coefficient of Bernstein of the grading in each cell, shapes (n,); for the arguments
    see ``_points``.
    """
    count = t.dimension + 1
    powers = np.array([exponents for exponents in product(range(degree + 1), repeat=count) if sum(exponents) == degree])
    points = _INSIDE * powers / max(degree, 1) + (1 - _INSIDE * (degree > 0)) / count
    multinomials = [factorial(degree) / prod(factorial(int(power)) for power in exponents) for exponents in powers]
    basis = np.array(multinomials) * np.prod(points[:, None] ** powers, axis=2)
    rows, places = cut(t.x[t.corners], values)
    x = np.einsum("mqc,mcd->mqd", points @ places, t.x[t.corners[rows]])
    coefficients = np.linalg.solve(basis, grading(rows, x).T)
    least, greatest = np.full(len(t.corners), np.inf), np.full(len(t.corners), -np.inf)
    np.minimum.at(least, rows, coefficients.min(axis=0))
    np.maximum.at(greatest, rows, coefficients.max(axis=0))
    return least, greatest
