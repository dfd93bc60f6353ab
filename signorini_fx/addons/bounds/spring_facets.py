"""Springs on facets, whose energy is a part of the energy norm, and what a stress leaves of their forces.

With the stiffness K per area, the squared norm of a displacement v is a(v, v) + int K v . v.  A stress tau is
admissible with any traction t of the springs in the range of K: tau n = h + t on their facets.  The gap of the
functionals then has one more term, (B11) of docs/bounds.md,

    int K^+ (K v + t) . (K v + t),

with the pseudo-inverse K^+.  So pairs of a stress and a traction of springs are the stresses of a body that has the
springs as a part, with the product int K^+ s . t of the latter.  These are springs whose stiffness is the same on each
facet: of others, what is more than the least stiffness on a facet is in ``varying_springs``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_error import ROUND_OFF
from signorini_fx.addons.bounds.facets import POINTS, WEIGHTS, bernstein
from signorini_fx.addons.bounds.simplices import Simplices
from signorini_fx.addons.bounds.varying_springs import SpringComponent
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.tuned import SAME_LENGTH


@dataclass(frozen=True)
class SpringFacets:
    """Facets with springs whose stiffness is the same on all of each of them, m of them.

    Attributes:
        facets: of the cells, shape (m,).
        cells: that they are facets of, shape (m,).
        area: of the facets, shape (m,).
        stiffness: K in the directions that supports leave free, stress / length, shape (m, d, d).
        give: its pseudo-inverse, shape (m, d, d).
        onto: the projector onto its range, shape (m, d, d).
        softest: the least stiffness that is not zero, shape (m,).
    """

    facets: Ints
    cells: Ints
    area: Array
    stiffness: Array
    give: Array
    onto: Array
    softest: Array

    @staticmethod
    def of(t: Simplices, held: Array, springs: Sequence[SpringComponent]) -> SpringFacets | None:
        """Those of the scene, with their least stiffness on each facet; None: none acts where supports let the body
        move.

        Args:
            t: the cells.
            held: projectors onto the directions in which facets are held, shape (f, d, d).
            springs: of the scene.

        Raises:
            Refused: supports hold a boundary across its springs, or round-off in the largest stiffness of a facet is
                not little of the least one.
        """
        d, stiffnesses = t.dimension, np.zeros((len(t.facets), t.dimension, t.dimension))
        least_given = np.full(len(t.facets), np.inf)
        for component in springs:
            facets, least = component.facets, component.least[:, None, None]
            stiffnesses[facets] += least * component.directions
            if isinstance(component.value, float) and component.value > 0:
                least_given[facets] = np.minimum(least_given[facets], component.value)
        facets = np.flatnonzero(stiffnesses.any(axis=(1, 2)))
        loose = np.eye(d) - held[facets]
        across = np.abs(loose @ stiffnesses[facets] @ held[facets]).max(axis=(1, 2))
        if (across > SAME_LENGTH * np.abs(stiffnesses[facets]).max(axis=(1, 2))).any():
            raise Refused(
                "springs have a guaranteed bound where supports hold the boundary along or across them so far"
            )
        stiffness = loose @ stiffnesses[facets] @ loose
        sizes, vectors = np.linalg.eigh(stiffness)
        largest = np.abs(stiffnesses[facets]).max(axis=(1, 2))[:, None]
        acts = sizes > SAME_LENGTH * largest
        uncertain = (least_given[facets, None] <= SAME_LENGTH * largest) | (~acts & (sizes > ROUND_OFF * largest))
        if uncertain.any():
            raise Refused(
                "springs have a guaranteed bound where the least stiffness on a facet is more than "
                f"{SAME_LENGTH:g} of the largest one there"
            )
        rows = np.flatnonzero(acts.any(axis=1))
        if not rows.size:
            return None
        sizes, vectors, acts = sizes[rows], vectors[rows], acts[rows]

        def with_values(values: Array) -> Array:
            """The matrices with these eigenvalues."""
            return np.einsum("mik,mk,mjk->mij", vectors, values, vectors)

        return SpringFacets(
            facets[rows],
            t.sides[facets[rows], 0],
            t.area[facets[rows]],
            with_values(np.where(acts, sizes, 0.0)),
            with_values(np.where(acts, 1 / np.where(acts, sizes, 1.0), 0.0)),
            with_values(acts.astype(np.float64)),
            np.where(acts, sizes, np.inf).min(axis=1),
        )

    @property
    def matrices(self) -> Array:
        """Forces at the vertices per displacement there, linear between, force per length, shape (m, d d, d d)."""
        m, d, _ = self.stiffness.shape
        mass = self.area[:, None, None] / (d * (d + 1)) * (1 + np.eye(d))
        return np.einsum("mab,mij->maibj", mass, self.stiffness).reshape(m, d * d, d * d)

    def stopped(self, held: Array) -> Array:
        """Projectors onto the directions in which supports or springs hold facets, shape (f, d, d)."""
        projectors: Array = held.copy()
        projectors[self.facets] += self.onto  # which is in what supports leave free
        return projectors

    def traction(self, tractions: Array, given: Array) -> Array:
        """T at the vertices, stress, shape (m, d, d), from all tractions and the given ones, shapes (f, d, d)."""
        return np.asarray((tractions - given)[self.facets] @ self.onto)

    def reaction(self, displacement: Array) -> Array:
        """K v at ``POINTS``, stress, shape (m, q, d), from coefficients of Bernstein, length, shape (m, 3 or 6, d)."""
        return np.asarray(bernstein(POINTS[self._dimension]) @ displacement @ self.stiffness)

    def at_points(self, traction: Array) -> Array:
        """A linear traction at ``POINTS``, stress, shape (m, q, d); for the argument see ``traction``."""
        return np.asarray(POINTS[self._dimension] @ traction)

    def product(self, first: Array, second: Array) -> Array:
        """Integrals of K^+ s . t by facet, energies, shape (m,).

        Args:
            first: s at ``POINTS``, stress, shape (m, q, d).
            second: t, see ``first``.
        """
        at_points = np.einsum("mqi,mij,mqj->mq", first, self.give, second)
        return np.asarray(self.area * (at_points @ WEIGHTS[self._dimension]))

    def by_cell(self, of_facets: Array, count: int) -> Array:
        """The sums of what is of facets in each of the cells, shape (count,)."""
        return np.bincount(self.cells, of_facets, count).astype(np.float64)

    def carried(self, forces: Array) -> Array:
        """Squares of bounds of the norm of linear tractions on the facets, by cell, energies, shape (n,).

        Args:
            forces: over the area of a facet of the cell a bound of the traction, force, shape (n,).
        """
        return self.by_cell(forces[self.cells] ** 2 / (self.area * self.softest), len(forces))

    @property
    def _dimension(self) -> int:
        return int(self.stiffness.shape[1])
