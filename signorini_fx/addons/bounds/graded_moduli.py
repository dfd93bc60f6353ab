"""Moduli that vary inside the cells: a polynomial gamma of the position times those in the centre of each cell.

A displacement v has the stress gamma C eps(v), C that of the centre, so that in its energy norm

    |gamma C eps(v) - tau|^2 = int 1 / gamma (gamma C eps(v) - tau) : C^-1 (gamma C eps(v) - tau),

of which all but 1 / gamma is a polynomial between jumps and kinks of gamma, and this is at most one over the least
coefficient of Bernstein of gamma there.  With an initial strain s the stress is gamma (C eps(v) - s f), see
``initial_stress``, and s is evaluated at the points of quadrature.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from math import factorial, prod
from typing import Any

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_scene import BoundPoints, in_region
from signorini_fx.addons.bounds.initial_stress import FreeStrain, simplex_rule
from signorini_fx.addons.bounds.simplices import CORNERS_OF_PARTS, TWICE, Moduli, Simplices
from signorini_fx.mechanics.elasticity.moduli import middles
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.cut_simplices import cut
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.tuned import INSIDE_CELL, SAME_NUMBER

# Gamma, but for a factor of each cell, at points of cells, shape (m, q), of positions, length, shape (m, q, d).
_Grading = Callable[[Ints, Array], Array]


@dataclass(frozen=True)
class GradedPart:
    """Points of quadrature on one part of the cells.

    Attributes:
        number: of the part.
        rows: the cell of each row, shape (m,).
        at: barycentric in the part, shape (m, q, d + 1).
        weight: volume, shape (m, q).
        share: gamma, shape (m, q).
        strain: s, shape (m, q).
    """

    number: int
    rows: Ints
    at: Array
    weight: Array
    share: Array
    strain: Array

    def of(self, stress: Array) -> Array:
        """A stress on the parts, see ``LocalStress.stress``, at the points, shape (m, q, 3 or 6)."""
        return np.asarray(self.at @ stress[self.rows, self.number])


# What is integrated, at the points of a part, energy density, shape (m, q).
_Density = Callable[[GradedPart], Array]


@dataclass(frozen=True)
class GradedModuli:
    """Gamma on n cells.  Stresses are those on the parts of cells at their corners, see ``LocalStress.stress``.

    Attributes:
        moduli: C.
        least: of which gamma is at least, shape (n,).
        greatest: of which it is at most, shape (n,).
        rules: points of quadrature on the parts: the rule that counts, and others where it is not exact for s.
        free: s, with the stress f of C; None: there is none.
    """

    moduli: Moduli
    least: Array
    greatest: Array
    rules: tuple[tuple[GradedPart, ...], ...]
    free: FreeStrain | None = None

    def square(self, elastic: Array, tau: Array) -> Array:
        """More than the squares of the norm of gamma (C eps - s f) - tau, by cell, energies, shape (n,).

        Args:
            elastic: C eps.
            tau: another stress.
        """

        def density(part: GradedPart) -> Array:
            apart = self._stress(part, elastic) - part.of(tau)
            return self._product(part, apart, apart)

        squares, unknown = self._integral(density)
        return (squares + unknown) / self.least

    def energy(self, elastic: Array) -> tuple[Array, Array]:
        """Squares of the norm of gamma (C eps - s f), the strain across the plane included, by cell, and how far they
        are not known, energies, shapes (n,).

        Args:
            elastic: C eps.
        """

        def density(part: GradedPart) -> Array:
            strained = self._strained(part, elastic)
            squares = self._product(part, strained, strained)
            if self.free is not None:
                squares += self.free.prevented[part.rows, None] * part.strain**2
            return part.share * squares

        return self._integral(density)

    def work(self, elastic: Array, other: Array) -> tuple[float, float]:
        """The integral of gamma (C eps - s f) : eps', and how far it is not known, energies.

        Args:
            elastic: C eps.
            other: C eps'.
        """
        work, unknown = self._integral(lambda part: self._product(part, self._stress(part, elastic), part.of(other)))
        return float(work.sum()), float(unknown.sum())

    def product(self, dual: tuple[Array, Array], primal: tuple[Array, Array]) -> tuple[Array, Array]:
        """The product of tau' - gamma C eps' and tau - gamma (C eps - s f) in the complementary energy of gamma C, by
        cell, and how far it may be from this, energies, shapes (n,): 1 / gamma is between its bounds.

        Args:
            dual: C eps' and tau'.
            primal: C eps and tau.
        """

        def first(part: GradedPart) -> Array:
            return part.of(dual[1]) - part.share[..., None] * part.of(dual[0])

        def second(part: GradedPart) -> Array:
            return part.of(primal[1]) - self._stress(part, primal[0])

        product, unknown = self._integral(lambda part: self._product(part, first(part), second(part)))
        high, low = 1 / self.least, 1 / self.greatest
        around = (high - low) / 2 * self._size(first) * self._size(second) + high * unknown
        return (high + low) / 2 * product, around

    @property
    def terms(self) -> int:
        """Products of components that are summed up to an integral."""
        return int(sum(part.weight.size for part in self.rules[0])) * len(TWICE[len(self.rules[0]) - 1])

    def _strained(self, part: GradedPart, elastic: Array) -> Array:
        """C eps - s f at the points, shape (m, q, 3 or 6)."""
        if self.free is None:
            return part.of(elastic)
        return part.of(elastic) - part.strain[..., None] * self.free.stress[part.rows, None]

    def _stress(self, part: GradedPart, elastic: Array) -> Array:
        """Gamma (C eps - s f) at the points, shape (m, q, 3 or 6)."""
        return part.share[..., None] * self._strained(part, elastic)

    def _product(self, part: GradedPart, sigma: Array, tau: Array) -> Array:
        """Sigma : C^-1 tau of stresses at the points, shape (m, q)."""
        strain, unit = self.moduli.of(part.rows).scaled_strain(tau)
        return np.asarray((sigma * strain * TWICE[part.at.shape[2] - 1]).sum(axis=2) / unit[:, None])

    def _size(self, stress: Callable[[GradedPart], Array]) -> Array:
        """More than the norm of a stress at the points, in the complementary energy of C, by cell, shape (n,)."""
        squares, unknown = self._integral(lambda part: self._product(part, stress(part), stress(part)))
        return np.sqrt(squares + unknown)

    def _integral(self, density: _Density) -> tuple[Array, Array]:
        """By cell, and how far rules differ in it, shapes (n,)."""
        sums = []
        for rule in self.rules:
            of_parts = (
                np.bincount(part.rows, (density(part) * part.weight).sum(axis=1), len(self.least)) for part in rule
            )
            sums.append(np.sum(list(of_parts), axis=0))
        return sums[0], np.max([np.abs(sums[0] - one) for one in sums], axis=0)


def graded_moduli(model: Model, t: Simplices, owner: Ints, free: FreeStrain | None) -> GradedModuli | None:
    """Those of a scene; None: moduli are constant in each cell.

    Args:
        model: the model.
        t: the cells, with the moduli in the middles of those of the mesh.
        owner: the cell of the mesh that each is in, shape (n,).
        free: initial strains, with these moduli; None: there are none.

    Raises:
        Refused: a modulus may vanish.
    """
    graded = [material for material in model.statement.material if material.grading is not None]
    if not graded:
        return None
    values = [material.grading for material in graded]
    inside = [in_region(model, material.region, owner) for material in graded]

    def grading(rows: Ints, x: Array) -> Array:
        """See ``_Grading``."""
        at, share = BoundPoints(x, np.zeros_like(x)), np.ones(x.shape[:2])
        for value, of_material in zip(values, inside, strict=True):
            graded_rows = of_material[rows]
            share[graded_rows] = at.value(value)[graded_rows]
        return share

    cells = np.arange(len(owner))
    of_mesh = middles(model.tagged, owner.astype(np.int32)).T[:, None, : t.dimension]
    centre = grading(cells, t.x[t.corners].mean(axis=1)[:, None])[:, 0]
    factor = centre / grading(cells, of_mesh)[:, 0]
    degree = int(max(value.degree for value in values if isinstance(value, Expression)))
    least, greatest = range_of(t.x[t.corners], grading, values, degree)
    room = SAME_NUMBER * np.abs(greatest)  # for the round-off of values whose terms may cancel
    least, greatest = least - room, greatest + room
    if not (least > 0).all():
        raise Refused("a guaranteed bound needs moduli that do not vanish inside cells: use smaller ones there")
    sizes = (degree + 2,) if free is None else free.rules(degree + 1)
    rules = tuple(
        tuple(_points(t, part, grading, centre, values, free, size) for part in range(t.dimension + 1))
        for size in sizes
    )
    moduli, free = t.moduli.times(factor), None if free is None else free.times(factor)
    return GradedModuli(moduli, np.asarray(least / centre), np.asarray(greatest / centre), rules, free)


def _points(
    t: Simplices,
    number: int,
    grading: _Grading,
    centre: Array,
    values: list[Any],
    free: FreeStrain | None,
    size: int,
) -> GradedPart:
    """The points of quadrature on one part.

    Args:
        t: the cells.
        number: of the part.
        grading: of the scene.
        centre: the grading in the centres of the cells, shape (n,).
        values: of the scene that the grading is made of.
        free: initial strains; None: there are none.
        size: of the rule.
    """
    d, count = t.dimension, t.dimension + 1
    x = np.einsum("kc,ncd->nkd", CORNERS_OF_PARTS[d][number], t.x[t.corners])
    rows, places = cut(x, [*values, *([] if free is None else free.values)])
    points, weights = simplex_rule(d, size)
    at = points @ places
    of_points = np.einsum("mqc,mcd->mqd", at, x[rows])
    share = grading(rows, of_points) / centre[rows, None]
    strain = np.zeros(share.shape) if free is None else free.at(rows, of_points)
    volume = np.abs(np.linalg.det(places)) * t.volume[rows] / count
    return GradedPart(number, rows, at, volume[:, None] * weights, share, strain)


def range_of(corners: Array, function: _Grading, values: list[Any], degree: int) -> tuple[Array, Array]:
    """The least and the largest coefficient of Bernstein of a function in each of some simplices, shapes (n,).

    Args:
        corners: of the simplices, which may be facets, length, shape (n, count, d).
        function: a polynomial between the jumps and kinks of the values.
        values: of the scene that it is made of.
        degree: of the polynomial.
    """
    count = corners.shape[1]
    powers = np.array([exponents for exponents in product(range(degree + 1), repeat=count) if sum(exponents) == degree])
    points = INSIDE_CELL * powers / max(degree, 1) + (1 - INSIDE_CELL * (degree > 0)) / count
    multinomials = [factorial(degree) / prod(factorial(int(power)) for power in exponents) for exponents in powers]
    basis = np.array(multinomials) * np.prod(points[:, None] ** powers, axis=2)
    rows, places = cut(corners, values)
    x = np.einsum("mqc,mcd->mqd", points @ places, corners[rows])
    coefficients = np.linalg.solve(basis, function(rows, x).T)
    least, greatest = np.full(len(corners), np.inf), np.full(len(corners), -np.inf)
    np.minimum.at(least, rows, coefficients.min(axis=0))
    np.maximum.at(greatest, rows, coefficients.max(axis=0))
    return least, greatest
