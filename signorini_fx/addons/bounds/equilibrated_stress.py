"""A symmetric stress in equilibrium with given tractions, on triangles or tetrahedra.

The stress is that of ``johnson_mercier``; its tractions are those of least complementary energy.  Displacements on the
facets, the multipliers of equal and opposite tractions, are the unknowns of one symmetric positive definite system
(hybridisation), which is factorised in the plane and solved by conjugate gradients in space.  So no constant of Korn's
inequality enters.  Plain arrays, one rank.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from signorini_fx.addons.bounds.arrays import Array
from signorini_fx.addons.bounds.carried_residuals import carried
from signorini_fx.addons.bounds.factorised_system import FactorisedSystem
from signorini_fx.addons.bounds.iterated_system import IteratedSystem, balanced
from signorini_fx.addons.bounds.johnson_mercier import LocalStress, reference
from signorini_fx.addons.bounds.simplices import Simplices, moments_of
from signorini_fx.addons.bounds.spring_facets import SpringFacets

_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Loads:
    """What acts on the cells.

    Attributes:
        body: integrals of the force per volume times the barycentric coordinates, force, shape (n, d + 1, d).
        traction: linear tractions at the vertices of each facet of the boundary, zero elsewhere, stress, (f, d, d).
        unknown: bound of the force on each cell that quadrature does not know, shape (n,); 0: none.
        initial: stress that initial strains take from the body, see ``LocalStress.stress``; None: there are none.
    """

    body: Array
    traction: Array
    unknown: Array | float = 0.0
    initial: Array | None = None


@dataclass(frozen=True)
class EquilibratedStress:
    """A stress in equilibrium.

    Attributes:
        stress: on each part of each cell at its corners, see ``LocalStress.stress``.
        tractions: at the vertices of each facet out of its first cell, stress, shape (f, d, d).
        squares: of bounds of the work of what is not in equilibrium by round-off, per unit of the energy norm, shape
            (n,).
        of_springs: what springs exert of the tractions at the vertices of their facets, stress, shape (m, d, d); None:
            nothing.
        lost: a bound of the force that all cells together miss by round-off, force.
    """

    stress: Array
    tractions: Array
    squares: Array
    of_springs: Array | None = None
    lost: float = 0.0

    @property
    def missing(self) -> float:
        """The bound for all cells."""
        return float(np.sqrt(self.squares.sum()))


class Equilibration:
    """Stresses in equilibrium on a body that is held in given directions.

    From displacements at the vertices of each facet each cell has balanced tractions of its own; those of the solution
    are equal and opposite.  What a system misses of this is part of ``missing``: no digit rests on it.
    """

    def __init__(self, t: Simplices, held: Array, springs: SpringFacets | None = None) -> None:
        """Make the system.

        Args:
            t: the cells.
            held: projector onto the directions in which each facet is held, shape (f, d, d).
            springs: on facets; None: there are none.
        """
        self._t, self._springs, self._local = t, springs, LocalStress(t)
        self._stopped = held if springs is None else springs.stopped(held)
        kind = FactorisedSystem if t.dimension == 2 else IteratedSystem
        self._system: FactorisedSystem | IteratedSystem = kind(t, self._local, held, springs)

    def stress(self, loads: Loads, prescribed: Array) -> EquilibratedStress:
        """The stress of least complementary energy among those of this kind in equilibrium with loads.

        With initial strains it is the one that is closest to that of a displacement with them.

        Args:
            loads: what acts on the cells; its resultant on free motions must vanish.
            prescribed: the displacement at the vertices of held facets, as a linear function, length, shape (f, d, d);
                on the others any one to begin with.
        """
        t, places, d = self._t, self._local.places, self._t.dimension
        alone = self._local.alone(loads.body)
        if loads.initial is not None:
            alone = alone - self._local.held_back(loads.initial)
        moments = self._system.moments(alone, moments_of(t, loads.traction), prescribed)
        # The means of both sides, where tractions are given of these.
        signed = (t.sign[:, :, None, None] * moments).reshape(-1, d)
        summed = np.column_stack([np.bincount(places.ravel(), signed[:, k], t.facets.size) for k in range(d)])
        total = summed.reshape(-1, d, d) / ((t.sides >= 0).sum(axis=1) * t.area)[:, None, None]
        tractions = d * (d + 1) * total - d * total.sum(axis=1, keepdims=True)
        stopped = self._stopped[t.outer]
        tractions[t.outer] = loads.traction[t.outer] @ (np.eye(d) - stopped) + tractions[t.outer] @ stopped
        if isinstance(self._system, IteratedSystem):
            tractions = balanced(t, loads.body, self._stopped, tractions)
        stress, missed = self._local.stress(t.sign[:, :, None, None] * tractions.reshape(-1, d)[places], loads.body)
        of_springs = None if self._springs is None else self._springs.traction(tractions, loads.traction)
        squares, lost = self._round_off(loads, tractions, missed)
        return EquilibratedStress(stress, tractions, squares, of_springs, lost)

    def _round_off(self, loads: Loads, tractions: Array, missed_share: Array) -> tuple[Array, float]:
        """Squares of bounds of the work of what is not in equilibrium, per unit of the energy norm, shape (n,), and of
        the force that all cells miss.

        The forces and couples that a cell misses are carried from one to the next to a facet with a support or springs,
        or to a cell of a piece without one, by linear tractions: those with a resultant R and a couple M about the
        middle of an edge of length l are at most R / l + 6 M / l^2, on a face of area A and least height h R / A +
        12 M / (A h).  The stress
        of each cell that balances these is bounded by the norm of the map from tractions or moments to stresses.
        """
        t, d = self._t, self._t.dimension
        force = np.abs(tractions).max(axis=(1, 2)) * t.area
        force_sizes = force[t.facets_of].max(axis=1) + np.abs(loads.body).sum(axis=(1, 2))
        missed = force_sizes * (missed_share + 32 * _EPS) + loads.unknown
        start = np.unique(t.sides[t.outer, 0][self._stopped[t.outer].any(axis=(1, 2))])
        total, couple = carried(t.x[t.corners].mean(axis=1), t.sides, start, missed)
        longest = np.linalg.norm(t.x[t.edges[:, 0]] - t.x[t.edges[:, 1]], axis=1)[t.edges_of].max(axis=1)
        lowest = (d - 1) * t.area[t.facets_of].min(axis=1) / longest ** (d - 2)
        forces = total + 6 * (d - 1) * (couple + total * longest) / lowest
        if d == 3:
            squares = np.asarray(self._local.energy * (36 * forces) ** 2)
        else:
            shape = np.linalg.norm(t.jacobian, axis=(1, 2)) ** 2 / (2 * t.volume)
            squares = np.asarray((np.linalg.norm(reference(2)[0], 2) * shape**2 * forces) ** 2 / t.moduli.softest)
        squares = squares if self._springs is None else squares + self._springs.carried(forces)
        return squares, float(missed.sum())
