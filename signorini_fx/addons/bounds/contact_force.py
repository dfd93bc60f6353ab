"""Two-sided bounds of the force of a contact.

Let v be a displacement without penetration and tau a stress in equilibrium, as for the bound of the
error.  The stress of the solution is within rho of their mean, (C eps(v) + tau) / 2, with

    rho^2 = |C eps(v) - tau|^2 / 4 + int p (d - v_n) + int (g |v_t| - mu v_t)

(the hypercircle of W. Prager and J. L. Synge, Quart. Appl. Math. 5 (1947) 241-269).  The force R
along c on the body follows from the displacement z of least energy that is c on the boundary and
vanishes where other forces of supports and contacts act (R. Becker and R. Rannacher, Acta Numerica
10 (2001) 1-102):

    R = a(u, z) - L(z) = int eps(z) : (C eps(v) + tau) / 2 - L(z) + r,    |r| <= rho |z|.

z is linear on the cells, so that the part of loads and tractions that tau does not balance does no
work on it.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem

from signorini_fx.addons.bounds.error_bound import ROUND_OFF, Bounded, proved
from signorini_fx.addons.bounds.johnson_mercier import energy, from_strain
from signorini_fx.addons.bounds.linear_displacement import Given, free_motions, smallest_energy
from signorini_fx.addons.bounds.simplices import TWICE
from signorini_fx.arrays import Array
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.quantities.proved_statements import Interval, Refused
from signorini_fx.tuned import SAME_LENGTH


def force(
    model: Model,
    y: fem.Function,
    contact: ContactState | None,
    boundary: str,
    direction: tuple[float, ...],
    step: float = 0.0,
) -> Interval | str:
    """Return bounds of the force on a body along a direction at a boundary in contact, or why there
    are none; collective.

    They have the same assumptions as the bound of the error, and name them.

    Args:
        model: the model.
        y: the displacement.
        contact: the contact points.
        boundary: a boundary of a contact, on either body.
        direction: any vector; a unit vector gives a force, in 2D per thickness.
        step: position of the load step in the lists of factors.
    """
    along = np.asarray(direction, dtype=np.float64)
    return proved(
        model, y, contact, step, lambda problem: _interval(problem, boundary, along), named=boundary
    )


def _interval(problem: Bounded, boundary: str, direction: Array) -> Interval:
    """Return the interval of the force at a boundary in contact."""
    t = problem.t
    given = _given(problem, boundary, direction)
    projectors = np.zeros_like(problem.held)
    for facets, along, _ in given:
        np.add.at(projectors, facets, along)
    if free_motions(t, projectors).shape[1]:
        raise Refused("a force has bounds where supports and contacts hold the body")
    z, missed = smallest_energy(t, given)
    size = float(np.linalg.norm(direction))
    if missed > SAME_LENGTH * size:
        raise Refused(
            f"the force on {boundary!r} has no bounds: it shares a corner with another support or "
            "contact"
        )
    strain = t.strain_at_corners(t.with_middles(z))
    norm = float(np.sqrt(energy(t, strain).sum()))
    mean = (from_strain(t, problem.admissible.strain) + problem.stress.stress).mean(axis=(1, 2)) / 2
    products = t.volume[:, None] * mean * strain[:, 0] * TWICE[t.dimension]
    centre = float(products.sum()) - problem.work(z)
    # Of sums, and of what z misses of the values that are prescribed, where forces act.
    largest = float(np.abs(products).sum()) + (problem.size + problem.distance) * norm
    lost = (ROUND_OFF + missed / size) * len(t.corners) * largest
    half = (problem.radius + problem.round_off) * norm + lost
    return Interval(centre - half, centre + half, problem.assumed)


def _given(problem: Bounded, boundary: str, direction: Array) -> list[Given]:
    """Return the prescribed components of z where forces of supports and contacts act; without
    friction only the normal component of a contact.
    """
    d = problem.t.dimension
    nothing = np.zeros_like(direction)
    met = False
    rows = [(problem.t.outer, problem.held[problem.t.outer], nothing)]
    for surface in problem.contacts:
        parts = surface.parts
        for side in parts.sides:
            facets = parts.facets[side]
            normal = np.zeros((len(facets), d))
            normal[parts.row[side]] = parts.normal
            projectors = normal[:, :, None] * normal[:, None]
            if surface.bound.any():
                projectors = np.tile(np.eye(d), (len(facets), 1, 1))
            is_named = np.isin(facets, problem.named)
            met |= bool(is_named.any())
            rows += [
                (facets[of], projectors[of], value)
                for of, value in ((is_named, direction), (~is_named, nothing))
            ]
    if not met:
        raise Refused(f"a force has guaranteed bounds at contacts, and {boundary!r} is none")
    return rows
