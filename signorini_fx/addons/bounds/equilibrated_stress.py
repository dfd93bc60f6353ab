"""A symmetric stress in equilibrium with given tractions, on triangles or tetrahedra.

The stress is that of ``johnson_mercier``, with the tractions of least complementary energy.
Displacements on the facets, the multipliers of equal and opposite tractions, are the unknowns of
one symmetric positive definite system (hybridisation), which is factorised.  So no constant of
Korn's inequality enters.  It works with plain arrays on one rank.

``balanced`` gives the admissible contact tractions closest to given ones in L2 that balance the
loads of bodies that move freely.  With the work R of unit tractions at the vertices of facets on
the free motions, and the weights W of the vertices, they are

    z(y) = P(z_0 - W^-1 R y),   R^T z(y) + L = 0,

where P is the projection onto the closest point of the admissible set.  The Lagrange multipliers y,
one per free motion, maximise a concave function whose gradient is the imbalance; Newton's method
finds the maximum.  The motions of all pieces of the body are taken together, because one pressure
may occur in the balance of two pieces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order

from signorini_fx.addons.bounds.johnson_mercier import LocalStress
from signorini_fx.addons.bounds.linear_displacement import free_basis, free_motions, solved
from signorini_fx.addons.bounds.simplices import EPS, Simplices, closest_linear, with_hats
from signorini_fx.arrays import Array, Ints, quotient
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.tuned import MANY_STEPS, NOTHING_LEFT


@dataclass(frozen=True)
class EquilibratedStress:
    """A stress in equilibrium."""

    stress: Array  # on each part of each cell at its corners, see ``LocalStress.stress``
    # a bound of the work of what is not in equilibrium by round-off, per unit of the energy norm
    missing: float


def equilibrated(
    t: Simplices, held: Array, body: Array, traction: Array, prescribed: Array
) -> EquilibratedStress:
    """Return the stress of least complementary energy, among those of Johnson and Mercier, in
    equilibrium with the loads.

    Args:
        t: the cells.
        held: projector onto the directions in which each facet is held, shape (f, d, d).
        body: integrals of the force per volume times the barycentric coordinates, force, shape (n,
            d + 1, d); the resultant of all loads on free motions must vanish.
        traction: linear tractions at the vertices of each facet of the boundary, zero elsewhere,
            stress, shape (f, d, d).
        prescribed: the displacement at the vertices of held facets, as a linear function, length,
            shape (f, d, d).
    """
    local = LocalStress(t)
    d = t.dimension
    moments = _moments(t, local, held, local.alone(body), with_hats(traction, t.area), prescribed)
    # The means of both sides, where tractions are given of these.
    signed = (t.sign[:, :, None, None] * moments).reshape(-1, d)
    summed = np.column_stack(
        [np.bincount(local.places.ravel(), signed[:, k], t.facets.size) for k in range(d)]
    )
    tractions = closest_linear(
        summed.reshape(-1, d, d) / ((t.sides >= 0).sum(axis=1) * t.area)[:, None, None]
    )
    stopped = held[t.outer]
    tractions[t.outer] = traction[t.outer] @ (np.eye(d) - stopped) + tractions[t.outer] @ stopped
    stress, missed = local.stress(
        t.sign[:, :, None, None] * tractions.reshape(-1, d)[local.places], body
    )
    return EquilibratedStress(stress, _round_off(t, local, held, body, tractions, missed))


def _moments(
    t: Simplices, local: LocalStress, held: Array, alone: Array, loads: Array, prescribed: Array
) -> Array:
    """Return the moments of the tractions of each cell, which are equal and opposite between cells
    except for loads on facets, force, shape (n, d + 1, d, d).
    """
    d = t.dimension
    size = t.facets.size * t.dimension
    compliance = np.tile(local.compliance, (t.parts, 1, 1))
    places = (d * local.places[..., None] + np.arange(d)).reshape(len(t.corners), -1)
    rows = np.repeat(places, places.shape[1], axis=1).ravel()
    columns = np.tile(places, (1, places.shape[1])).ravel()
    matrix = sp.csr_matrix((compliance.ravel(), (rows, columns)), shape=(size, size))
    values, vectors = np.linalg.eigh(np.repeat(held, d, axis=0))
    basis = free_basis(vectors, values > 0.5)
    held_values = (prescribed @ held).ravel()
    modes = free_motions(t, held).reshape(len(t.x), d, -1)[t.facets.ravel()].reshape(size, -1)
    tied = _tied(sp.csr_matrix(basis.T @ matrix @ basis), basis.T @ modes)
    forces = np.bincount(places.ravel(), alone.ravel(), size) + matrix @ held_values
    u = held_values + basis @ solved(tied, basis.T @ (loads.ravel() - forces))
    moments = (compliance @ u[places][:, :, None])[:, :, 0] + alone
    return moments.reshape(len(t.corners), d + 1, d, d)


def _tied(matrix: sp.csr_matrix, modes: Array) -> sp.csr_matrix:
    """Return the matrix with one unknown fixed for each free motion; balanced loads cause no force
    there.
    """
    diagonal = matrix.diagonal()
    pins = np.zeros(matrix.shape[0])
    for _ in range(modes.shape[1]):
        pin = int(np.argmax(np.linalg.norm(modes, axis=1)))
        unit = modes[pin] / np.linalg.norm(modes[pin])
        modes = modes - np.outer(modes @ unit, unit)
        pins[pin] = float(diagonal[pin])
    return sp.csr_matrix(matrix + sp.diags_array(pins))


def _round_off(
    t: Simplices,
    local: LocalStress,
    held: Array,
    body: Array,
    tractions: Array,
    missed_share: Array,
) -> float:
    """Return a bound of the work of the imbalance due to round-off, per unit of the energy norm.

    The imbalance of each cell, force and couple, is passed from cell to cell to a facet with a
    support, or to one cell of a piece without supports, by linear tractions: those with a resultant
    R and a couple M about the middle of an edge of length l are at most R / l + 6 M / l^2, on a
    face of area A and least height h R / A + 12 M / (A h).  The stress of each cell that balances
    these is bounded by the norm of the map from moments to stresses.
    """
    d = t.dimension
    force = np.abs(tractions).max(axis=(1, 2)) * t.area
    sizes = force[t.facets_of].max(axis=1) + np.abs(body).sum(axis=(1, 2))
    start = np.unique(t.sides[t.outer, 0][held[t.outer].any(axis=(1, 2))])
    total, couple = _carried(t, start, sizes * (missed_share + 32 * EPS))
    longest = np.linalg.norm(t.x[t.edges[:, 0]] - t.x[t.edges[:, 1]], axis=1)[t.edges_of].max(
        axis=1
    )
    lowest = (d - 1) * t.area[t.facets_of].min(axis=1) / longest ** (d - 2)
    forces = total + 6 * (d - 1) * (couple + total * longest) / lowest
    count = d * d * (d + 1)  # moments of a cell, each of which is no larger
    return float(np.sqrt((np.tile(local.energy, t.parts) * count * forces**2).sum()))


def _carried(t: Simplices, held: Ints, missed: Array) -> tuple[Array, Array]:
    """Return bounds of the force that each cell passes on towards the supports, and of its couple
    about the centre of the cell, both of shape (n,).
    """
    count = len(t.corners)
    centre = t.x[t.corners].mean(axis=1)
    loose = np.setdiff1d(np.arange(t.piece.max(initial=-1) + 1), t.piece[held])
    start = np.concatenate((held, np.unique(t.piece, return_index=True)[1][loose]))
    # One more node joins all cells that take what the others pass on.
    root = sp.csr_matrix((np.ones(start.size), (np.full(start.size, 0), start)), shape=(1, count))
    rooted_graph = sp.bmat([[t.neighbours, None], [root, sp.csr_matrix((1, 1))]], format="csr")
    order, parent = breadth_first_order(rooted_graph, count, directed=False)
    total = np.append(missed, 0.0)
    couple = np.zeros(count + 1)
    arm = np.append(np.linalg.norm(centre - centre[parent[:count].clip(0, count - 1)], axis=1), 0.0)
    for cell in order[:0:-1]:
        total[parent[cell]] += total[cell]
        couple[parent[cell]] += couple[cell] + total[cell] * arm[cell]
    return total[:count], couple[:count]


@dataclass(frozen=True)
class AdmissibleTractions:
    """The admissible tractions of one contact, at k vertices of each of its m facets."""

    pressure: Array  # p, stress, shape (m, k)
    shear: Array  # mu, stress, shape (m, k, d)
    least: Array  # of which |mu| is at most, stress, shape (m, k)
    normal: Array  # work of unit pressures on the free motions, shape (m, k, n)
    across: Array  # that of unit shears, shape (m, k, d, n)
    weight: Array  # areas, shape (m,)

    def at(self, y: Array) -> tuple[Array, Array]:
        """Return the admissible pressure and shear for multipliers y."""
        unit = self.weight[:, None]
        pressure = (self.pressure - self.normal @ y / unit).clip(min=0.0)
        return pressure, onto_disc(self.shear - self.across @ y / unit[:, :, None], self.least)

    def work(self, pressure: Array, shear: Array) -> Array:
        """Return the work of the tractions on the free motions, shape (n,)."""
        return np.einsum("fak,fa->k", self.normal, pressure) + np.einsum(
            "fadk,fad->k", self.across, shear
        )

    def distance(self, pressure: Array, shear: Array) -> float:
        """Return half of the squared distance to the given tractions in L2."""
        squares = (pressure - self.pressure) ** 2 + ((shear - self.shear) ** 2).sum(axis=2)
        return float((self.weight[:, None] * squares).sum()) / 2

    @property
    def resistance(self) -> float:
        """The trace of ``slope`` if all vertices transmit forces."""
        unit = self.weight[:, None]
        return float(
            ((self.normal**2).sum(axis=2) / unit).sum()
            + ((self.across**2).sum(axis=(2, 3)) / unit).sum()
        )

    def slope(self, y: Array) -> Array:
        """Return minus the derivative of the work by the multipliers, shape (n, n)."""
        unit = self.weight[:, None, None]
        room = (self.pressure - self.normal @ y / unit[..., 0] >= 0)[:, :, None]
        free = self.shear - self.across @ y / unit
        size = np.linalg.norm(free, axis=2)
        inside = size < self.least
        share = quotient(self.least, size, ~inside & (size > 0), otherwise=1.0)
        unit_shear = quotient(free, size[..., None])
        along = np.einsum("fadk,fad->fak", self.across, unit_shear) * ~inside[..., None]
        across = share[:, :, None, None] * (self.across - unit_shear[..., None] * along[:, :, None])
        return np.einsum("fak,fal->kl", self.normal / unit, self.normal * room) + np.einsum(
            "fadk,fadl->kl", self.across / unit[..., None], across
        )


def balanced(
    loads: Array, contacts: list[AdmissibleTractions], small: Array
) -> list[tuple[Array, Array]]:
    """Return pressures and shears of each contact that balance the loads, except for at most
    ``small`` of each.

    Args:
        loads: work of the loads on the free motions, force, shape (n,).
        contacts: the admissible tractions of each contact.
        small: the largest imbalance allowed, shape (n,).

    Raises:
        Refused: none were found.
    """
    y: Array = np.zeros(len(loads))

    def imbalance(unbalanced: Array) -> float:
        return float((np.abs(unbalanced) - small).max())

    def tried(multipliers: Array) -> tuple[list[tuple[Array, Array]], Array, float]:
        tractions = [contact.at(multipliers) for contact in contacts]
        unbalanced = loads + sum(
            contact.work(*pair) for contact, pair in zip(contacts, tractions, strict=True)
        )
        far = sum(
            contact.distance(*pair) for contact, pair in zip(contacts, tractions, strict=True)
        )
        return tractions, unbalanced, float(far + multipliers @ unbalanced)

    tractions, unbalanced, value = tried(y)
    for _ in range(MANY_STEPS):
        if (last := imbalance(unbalanced)) <= 0:
            return tractions
        slope = sum((contact.slope(y) for contact in contacts), np.zeros((len(y), len(y))))
        # Where the vertices that carry resist no motion that is not balanced, the step is along it,
        # as far as others.
        resisted = slope + NOTHING_LEFT * sum(contact.resistance for contact in contacts) * np.eye(
            len(y)
        )
        step = np.linalg.lstsq(resisted, unbalanced, rcond=None)[0]
        length = 1.0
        while True:
            tractions, unbalanced, reached = tried(y + length * step)
            # Near the maximum the change of the function is round-off; then the imbalance decides.
            if reached >= value or length < NOTHING_LEFT or imbalance(unbalanced) < last:
                break
            length /= 2
        y = y + length * step
        value = reached
    if imbalance(unbalanced) <= 0:
        return tractions
    raise Refused("no admissible tractions near the nodal ones balance the loads")


def onto_disc(shear: Array, least: Array) -> Array:
    """Return the closest vectors with a magnitude of at most ``least``, shape (..., d)."""
    size = np.linalg.norm(shear, axis=-1)
    share = quotient(least, size, size > least, otherwise=1.0) * (1 - 2 * EPS)
    return shear * share[..., None]
