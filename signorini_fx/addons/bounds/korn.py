"""Constants of Korn's inequality and of traces on triangles; for tetrahedra none is known that is of use."""

from __future__ import annotations

import numpy as np

from signorini_fx.addons.bounds.arrays import Array
from signorini_fx.addons.bounds.simplices import Simplices


def korn(t: Simplices) -> tuple[Array, Array]:
    """Constants of |w - r| <= c |eps(w)| in L2 of a triangle and k of |grad (w - r)| <= k |eps(w)|, shape (n,).

    r is the rigid motion with the mean of w and of its rotation.  The first one is k h / pi by Payne and
    Weinberger; k^2 = 1 + 2 / beta^2 with the inf-sup constant beta >= rho / (2 R) of M. Costabel and M. Dauge
    (Arch. Rational Mech. Anal. 217 (2015) 873-898), rho the radius of the incircle, R the distance of its centre
    from the farthest corner.
    """
    p, sides = t.x[t.corners], t.area[t.facets_of]
    centre = np.einsum("ni,nid->nd", sides, p) / sides.sum(axis=1)[:, None]
    inner = 2 * t.volume / sides.sum(axis=1)
    outer = np.linalg.norm(p - centre[:, None], axis=2).max(axis=1)
    k = np.sqrt(1 + 8 * (outer / inner) ** 2)
    return k * sides.max(axis=1) / np.pi, k


def on_edges(t: Simplices, inside: Array, gradient: Array) -> Array:
    """Bounds of |w| in L2 of the edges of each triangle, from those of |w| and |grad w| in it, shape (n, 3).

    |w|^2 on an edge e of a triangle K is at most |e| / |K| (|w|^2 + h |w| |grad w|), with its longest side h.
    """
    sides = t.area[t.facets_of]
    squares = inside**2 + sides.max(axis=1) * inside * gradient
    return np.asarray(np.sqrt(sides * (squares / t.volume)[:, None]))


def missed_squares(t: Simplices, inside: Array, on_facets: Array) -> Array:
    """Squares of the bounds of the work of loads without resultants per unit of the energy norm, by triangle, (n,).

    Args:
        t: the triangles.
        inside: integrals of the squares of the loads in them, shape (n,).
        on_facets: on the edges of the boundary, shape (f,).
    """
    constants = korn(t)
    edges = np.sqrt(on_facets)[t.facets_of]
    bounds = constants[0] * np.sqrt(inside) + (on_edges(t, *constants) * edges).sum(axis=1)
    return np.asarray(bounds**2 / t.moduli.softest)
