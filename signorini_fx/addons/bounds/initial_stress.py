"""The stress that initial strains take from a body: linear on the parts of its cells, and what this misses.

With an initial strain s in all directions, a function of the position, a displacement v has the stress C eps(v) - s f,
f a stress of each cell.  Let p be the projection of s in L2 onto linear functions on each part of a cell: r = s - p is
perpendicular to these, so that for a stress tau that is linear on the parts

    |C eps(v) - s f - tau|^2 = |C eps(v) - p f - tau|^2 + |r f|^2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from scipy.special import roots_jacobi

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_scene import BoundPoints, in_region, stress_of_free_strain
from signorini_fx.addons.bounds.simplices import CORNERS_OF_PARTS, TWICE, Simplices
from signorini_fx.addons.bounds.stress_products import from_strain
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.cut_simplices import cut
from signorini_fx.mechanics.statement.effect import InitialStrain
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.tuned import KNOWN_DEGREE


@dataclass(frozen=True)
class StrainPoints(BoundPoints):
    """Points of quadrature in cells, ``statement.effect.BodyPoints``.

    Attributes:
        coefficients: of thermal expansion, 1 / temperature, shape (f,).
        owner: the cell of the mesh that each row is in, shape (f,).
        tagged: the mesh.
    """

    coefficients: Array
    owner: Ints
    tagged: TaggedMesh

    @property
    def expansion(self) -> Array:
        """Of the material, shape (f, 1)."""
        return self.coefficients[:, None]

    def value_in(self, region: str | None, value: Any) -> Array:
        """A value in a region of the mesh, 0 elsewhere, shape (f, q)."""
        if region is None:
            return self.value(value)
        rows = np.flatnonzero(np.isin(self.owner, self.tagged.cells(region)))
        values = np.zeros(self.x.shape[:2])
        values[rows] = BoundPoints(self.x[rows], self.normal[rows]).value(value)
        return values


@dataclass(frozen=True)
class FreeStrain:
    """The initial strain s of n cells, known at all points, and the stress f that one of it takes.

    Attributes:
        at: s at points of cells, shape (m, q), of the numbers of these and positions, length, shape (m, q, d).
        values: of the scene that s is made of.
        stress: f, shape (n, 3 or 6).
        prevented: twice the energy density of a strain of one that no displacement changes, stress, shape (n,).
    """

    at: Callable[[Ints, Array], Array]
    values: list[Any]
    stress: Array
    prevented: Array

    def times(self, factor: Array) -> FreeStrain:
        """The same with moduli that are multiplied in each cell, shape (n,)."""
        return replace(self, stress=factor[:, None] * self.stress, prevented=factor * self.prevented)

    def rules(self, power: int) -> tuple[int, ...]:
        """``sizes_of_rules`` for the products of two such strains with polynomials of degree 2 ``power``."""
        return sizes_of_rules(self.values, power)


def sizes_of_rules(values: list[Any], power: int) -> tuple[int, ...]:
    """Sizes of ``simplex_rule`` for the products of two values of a scene with polynomials of degree 2 ``power``.

    One that is exact for polynomials of ``KNOWN_DEGREE`` at most; of others the finest of three counts, with what the
    others differ from it.
    """
    degree = max((value.degree for value in values if isinstance(value, Expression)), default=0)
    exact = degree <= KNOWN_DEGREE and all(
        isinstance(value, float) or (isinstance(value, Expression) and value.cuts_exactly) for value in values
    )
    return (int(degree) + power + 1,) if exact else tuple(KNOWN_DEGREE + power + k for k in (2, 1, 0))


@dataclass(frozen=True)
class InitialStress:
    """The stress s f of n cells.

    Attributes:
        stress: p f on the parts at their corners, see ``LocalStress.stress``.
        strain: C^-1 f, shape (n, 3 or 6).
        missed: squares of the norm of r f, energies, shape (n,).
        unknown: how far the moments of s with the barycentric coordinates of each part are not known by quadrature,
            volume, shape (n, d + 1, d + 1).
        prevented: twice the energy of the strain out of the plane, which no displacement changes, shape (n,).
    """

    stress: Array
    strain: Array
    missed: Array
    unknown: Array
    prevented: Array

    def added(self, stress: Array) -> Array:
        """What r f adds to the square of the norm of a stress that is linear on the parts, energies, shape (n,).

        Args:
            stress: at the corners of the parts.
        """
        return self.missed + 2 * self.unknown_work(stress)

    def unknown_work(self, stress: Array) -> Array:
        """How far the work of such a stress on s is not known by quadrature, energies, shape (n,)."""
        twice = TWICE[stress.shape[1] - 1]
        work = np.einsum("npck,nk->npc", stress, self.strain * twice)
        return np.asarray((np.abs(work) * self.unknown).sum(axis=(1, 2)))


def free_strain(model: Model, owner: Ints, step: float) -> FreeStrain | None:
    """That of a scene, with the moduli in the middles of the cells of the mesh; None: there is none.

    Args:
        model: the model.
        owner: the cell of the mesh that each cell is in, shape (n,).
        step: place in the lists of factors.

    Raises:
        Refused: a strain is given as a form.
    """
    acting = [model.statement.now(entry, step) for entry in model.statement.of(InitialStrain) if entry.acts]
    if not any(factor != 0 for factor, _ in acting):
        return None
    expansion = np.zeros(len(owner))
    for material in model.statement.material:
        expansion[in_region(model, material.region, owner)] = material.expansion or 0.0

    def strain(rows: Ints, x: Array) -> Array:
        at = StrainPoints(x, np.zeros_like(x), expansion[rows], owner[rows], model.tagged)
        return np.asarray(sum((factor * entry.strain_at(at) for factor, entry in acting), np.zeros(x.shape[:2])))

    values = [value for _, entry in acting for value in entry.given.values()]
    return FreeStrain(strain, values, *stress_of_free_strain(model, owner))


def initial_stress(t: Simplices, free: FreeStrain) -> InitialStress:
    """Of the initial strain of cells."""
    parts = [_of_part(t, part, free) for part in range(t.dimension + 1)]
    at_corners, missed, unknown = (np.stack(quantity, axis=1) for quantity in zip(*parts, strict=True))
    of_stress = t.strain(free.stress)
    squares = _squares(t, at_corners) + missed.sum(axis=1)
    return InitialStress(
        at_corners[..., None] * free.stress[:, None, None],
        of_stress,
        (free.stress * of_stress * TWICE[t.dimension]).sum(axis=1) * missed.sum(axis=1),
        unknown,
        free.prevented * squares,
    )


def elastic_stress(t: Simplices, strain: Array, initial: InitialStress | None) -> Array:
    """The stress of linear strains at corners without what initial strains take from it, see ``from_strain``."""
    stress = from_strain(t, strain)
    return stress if initial is None else stress - initial.stress


def _squares(t: Simplices, linear: Array) -> Array:
    """Integrals of the squares of functions that are linear on the parts, from their values at corners, shape (n,)."""
    count = t.dimension + 1
    sums = (linear**2).sum(axis=(1, 2)) + (linear.sum(axis=2) ** 2).sum(axis=1)
    return np.asarray(t.volume / (count**2 * (count + 1)) * sums)


def _of_part(t: Simplices, part: int, free: FreeStrain) -> tuple[Array, Array, Array]:
    """The projection of s on one part of each cell at its corners, shape (n, d + 1); the integral of the square of what
    it misses, shape (n,); and how far its moments are not known, shape (n, d + 1).

    Args:
        t: the cells.
        part: its number.
        free: s.
    """
    d, count, n = t.dimension, t.dimension + 1, len(t.corners)
    x = np.einsum("kc,ncd->nkd", CORNERS_OF_PARTS[d][part], t.x[t.corners])
    owner, places = cut(x, free.values)
    share = np.abs(np.linalg.det(places)) * t.volume[owner] / count
    moments, missed = list[Array](), list[Array]()
    linear = np.zeros((n, count))
    for size in free.rules(0):
        points, weights = simplex_rule(d, size)
        at = points @ places
        s = free.at(owner, np.einsum("mqc,mcd->mqd", at, x[owner]))
        of_rule = np.zeros((n, count))
        np.add.at(of_rule, owner, share[:, None] * np.einsum("q,mqc,mq->mc", weights, at, s))
        if not moments:
            scale = (count / t.volume * count)[:, None]
            linear = scale * ((count + 1) * of_rule - of_rule.sum(axis=1, keepdims=True))
        moments.append(of_rule)
        deviation = (s - np.einsum("mqc,mc->mq", at, linear[owner])) ** 2
        missed.append(np.bincount(owner, share * (deviation @ weights), n).astype(np.float64))
    unknown = np.max([np.abs(moments[0] - of_rule) for of_rule in moments], axis=0)
    return linear, missed[0] + np.max([np.abs(missed[0] - of_rule) for of_rule in missed], axis=0), unknown


@cache
def simplex_rule(d: int, size: int) -> tuple[Array, Array]:
    """Barycentric points and weights, of which the sum is one, exact for polynomials of degree 2 size - 1 on simplices:
    the conical product of rules of Gauss and Jacobi (A. H. Stroud, Approximate Calculation of Multiple Integrals,
    Prentice-Hall 1971, section 2.4).
    """
    points, weights = np.ones((1, 1)), np.ones(1)
    for power in range(d):
        s, w = roots_jacobi(size, power, 0)
        s, w = (s + 1) / 2, w / w.sum()
        points = np.concatenate([np.column_stack((np.full(len(points), place), (1 - place) * points)) for place in s])
        weights = np.outer(w, weights).ravel()
    return points, weights
