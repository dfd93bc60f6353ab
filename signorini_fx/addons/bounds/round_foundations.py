"""Contact with a rigid circle, sphere or cylinder: its distance is no polynomial, and its normals turn along a facet.

What is bounded is the problem with the distance itself and with its gradient at each point of the facets of the mesh,
which refined meshes of the same polygon approach; values at nodes alone do not enter.  Let a(x) lead from x to the
centre or the axis, with the length r(x), R be the radius, and delta what is added to the gap; sigma = 1 where the body
is outside, -1 where it is inside.  The direction to the foundation is n = sigma a / r, and v keeps to it where

    n . v <= sigma (r - R) + delta.

With a length rho of each facet this is, times r / rho > 0,

    m . v <= G,    m = sigma a / rho,    G = (sigma r^2 + c r) / rho,    c = delta - sigma R,

in which a is linear and r^2 of degree 2 on a facet: only r is no polynomial.  So (B1) of docs/theory.md holds for
tractions -(p m + mu T), T being m turned in the plane, with p >= 0 and |mu| |m| <= g, if

    p (G - m . v)    and    g |T . v| / |m| - mu T . v

stand for p (d - v_N) and g |v_T| - mu . v_T: it needs no more than that the traction leans on n(x) at each point.

*The displacement.*  r lies between its secant and its tangents as a concave function of s = r^2, with r in [r_0, r_1]

    (s + r_0 r_1) / (r_0 + r_1) <= r <= (s + t) / (2 sqrt(t)),    t > 0,

so that G has a quadratic B below it, and v keeps to the foundation where no coefficient of Bernstein of m . v - B,
which is of degree 3, is positive.

*The stress.*  In the plane p and mu are linear on facets, and the stress holds the moments of p m + mu T with linear
functions.  What is left is A (x^2 - x + 1/6) along a facet of length l, with the second difference A: it does no work
on rigid motions, its square is |A|^2 l / 180, and its work is bounded as that of loads is, by ``korn``.  In space no
such constants are known: there p is constant on each facet, p m linear, and nothing is left.

*The integrals.*  All is polynomial but r and 1 / |m| = rho / r.  With s between t (1 - e) and t (1 + e) Taylor's sums
up to the fifth power of (s - t) / t are integrated exactly, and differ from s^(1/2) and s^(-1/2) by at most

    |binom(+-1/2, 6)| t^(+-1/2) e^6 / (1 - e)^(6 -+ 1/2),

twice of which, in the integral and in the rule, is added.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.bounds.arrays import Array
from signorini_fx.addons.bounds.facets import POINTS
from signorini_fx.addons.bounds.simplices import EDGES_OF_FACET
from signorini_fx.mechanics.shapes.circle import Circle
from signorini_fx.mechanics.shapes.cylinder import Cylinder
from signorini_fx.mechanics.shapes.plane import Plane
from signorini_fx.mechanics.shapes.sphere import Sphere
from signorini_fx.tuned import LONG_OF_ROUND, SHORT_OF_ROUND

# Sizes of the sixth coefficients of the series of (1 + x)^(1/2) and (1 + x)^(-1/2).
_SIXTH = {0.5: 21 / 1024, -0.5: 231 / 1024}


def is_round(shape: Any) -> bool:
    """Whether the distance from a foundation is that from a point or a line, less a radius; of a class made from one of
    these it need not be.
    """
    return type(shape) in (Circle, Sphere, Cylinder)


def is_known(shape: Any) -> bool:
    """Whether a foundation is one that contact with has a bound."""
    return type(shape) is Plane or is_round(shape)


@dataclass(frozen=True)
class RoundFacets:
    """Facets in contact with a round foundation.

    Attributes:
        direction: m at the vertices, linear between them, shape (m, d, d).
        gap: G at ``POINTS``, length, shape (m, q).
        below: coefficients of Bernstein of B, length, shape (m, 3 or 6).
        missed_gap: how far the mean of G times a polynomial of size one may be off by quadrature on short facets,
            length, shape (m,).
        stretch: 1 / |m| at ``POINTS``, shape (m, q).
        missed_stretch: see ``missed_gap``, shape (m,).
        short: whether the facet is short beside its distance from the centre, shape (m,).
    """

    direction: Array
    gap: Array
    below: Array
    missed_gap: Array
    stretch: Array
    missed_stretch: Array
    short: npt.NDArray[np.bool_]

    @classmethod
    def of(cls, x: Array, shape: Any, added: float) -> RoundFacets:
        """Those of a foundation.

        Args:
            x: the vertices of the facets, length, shape (m, d, d).
            shape: see ``is_round``.
            added: to the distance, length.
        """
        d = x.shape[2]
        away = shape.moved_points(np.array(shape.centre)[None]) - x
        if isinstance(shape, Cylinder):
            axis = shape.turn_matrix(d) @ np.array(shape.axis)
            axis /= np.linalg.norm(axis)
            away = away - (away @ axis)[..., None] * axis
        sign = -1.0 if shape.hollow else 1.0
        factor = added - sign * shape.radius
        # The square of the distance as a quadratic: of its values at vertices and middles of edges.
        squares = _square(away)
        lowest, highest = squares.min(axis=1).clip(min=0.0), squares[:, :d].max(axis=1)
        middle = (lowest + highest) / 2
        rho, near, far = np.sqrt(middle), np.sqrt(lowest), np.sqrt(highest)
        share = (highest - lowest) / (highest + lowest)
        short = share <= SHORT_OF_ROUND
        if factor < 0:  # the tangent where the facet is nearest, if it is long
            touched = np.where(short, middle, np.maximum(lowest, LONG_OF_ROUND * highest))[:, None]
            distances = (squares + touched) / (2 * np.sqrt(touched))
        else:
            distances = (squares + (near * far)[:, None]) / (near + far)[:, None]
        below = (sign * squares + factor * distances) / rho[:, None]
        direction = sign * away / rho[:, None, None]
        at = POINTS[d]
        distance = np.linalg.norm(at @ away, axis=2)
        gap = (sign * distance**2 + factor * distance) / rho[:, None]
        spread = np.where(short, share, 0.0)
        rests = {power: 2 * _SIXTH[power] * spread**6 / (1 - spread) ** (6 - power) for power in _SIXTH}
        return cls(
            direction,
            gap,
            below,
            abs(factor) * rests[0.5],
            rho[:, None] / distance,
            rests[-0.5],
            short,
        )


def _square(linear: Array) -> Array:
    """Coefficients of Bernstein of the squares of the lengths of linear vectors, shape (m, d, d) to (m, 3 or 6)."""
    first, second = EDGES_OF_FACET[linear.shape[1]].T
    return np.concatenate(((linear**2).sum(axis=2), (linear[:, first] * linear[:, second]).sum(axis=2)), axis=1)
