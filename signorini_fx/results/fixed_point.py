"""How far a solution with Coulomb friction is from the fixed point of its mesh, proved by a contraction.

Let m be the multiple of the friction coefficients below which ``uniqueness`` proves that there is one solution, with
the weights d_i of the proof, and let r, r' be the nodal contact forces of two solutions with Tresca friction of the
nodal bounds g, g' (forces).  With |h|^2 = sum d_i h_i^2 / F_i over the tangential components the inequalities of the
proof give

    |F (r_N - r_N')| <= |g - g'| / m,        a(u - u', u - u') <= (2 / m) |g - g'|^2.

So for m > 1 the map from g to F r_N(g) has one fixed point g*, and |g - g*| <= |F r_N(g) - g| / (1 - 1 / m).  A
computed state is the solution for the bound g that is |mu| where a point slips, and at least F lambda where it sticks:
whatever ended the iteration.  docs/theory.md derives it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.named_body import NamedBody
from signorini_fx.bounds.bounded_error import ErrorBound
from signorini_fx.contact.laws import Nodal
from signorini_fx.results.contact_stiffness import contact_stiffness
from signorini_fx.results.uniqueness import components, critical

# Eigenvalue problems that choose the weights; their work, a number of cubes of the size of the contact boundary.
_EVALUATIONS, _WORK = 60, 2e9


@dataclass(frozen=True)
class FixedPoint:
    """The distance from the solution with Coulomb friction on the same mesh.

    Attributes:
        contraction: factor by which the map from friction bound to friction bound is proved to contract; infinite where
            nothing is proved.
        distance: bound of the energy norm of the distance of the displacement; None: none is known.
        bound: bound of the distance of the friction bound relative to its size, in the norm above; None: none is known.
        reason: why nothing is proved; "": there is none.
    """

    contraction: float
    distance: float | None = None
    bound: float | None = None
    reason: str = ""

    def beside(self, bound: ErrorBound) -> dict[str, Any]:
        """Entries for those of the bound of the error, JSON-safe."""
        return {
            "contraction": self.contraction if np.isfinite(self.contraction) else None,
            "fixed_point": self.distance,
            "statement": f"{bound}; {self.said(bound.size)}",
        }

    def said(self, size: float) -> str:
        """A sentence without its end.

        Args:
            size: energy norm of the displacement.
        """
        if self.distance is None or self.bound is None:
            why = self.reason or f"the contraction number is {self.contraction:.3g}, not below 1"
            return f"how far the fixed point of this mesh is from it is not known: {why}"
        displacement, friction = f"{100 * self.distance / size:.2g} %", f"{100 * self.bound:.2g} %"
        return (
            f"if linear systems are solved, the fixed point of this mesh is within {displacement} of the displacement "
            f"in the energy norm and {friction} of the friction bound (contraction number {self.contraction:.3g})"
        )


def fixed_point(d: NamedBody, contact: ContactState, step: float | None = None) -> FixedPoint:
    """The distance of a solution with Coulomb friction from the fixed point.

    Args:
        d: the discretised scene.
        contact: its contact nodes in the solution.
        step: the place of the load step in the lists of factors; None: the last one.
    """
    law, stiffness = d.law, contact_stiffness(d, step)
    assert law is not None
    if isinstance(stiffness, str):
        return FixedPoint(np.inf, reason=stiffness)
    rough = components(*stiffness, law)
    if isinstance(rough, str):
        return FixedPoint(np.inf, reason=rough)
    often = min(_EVALUATIONS, 1 + int(_WORK / len(rough.stiffness) ** 3))
    multiple, why, weights = critical(rough, law.coefficient, often)
    if multiple <= 1:
        return FixedPoint(1 / multiple if multiple > 0 else np.inf, reason=why)
    acting = law.coefficient[rough.tangential] > 0
    points, scale = rough.tangential[acting], weights[acting] / law.coefficient[rough.tangential[acting]]

    def norm(stress: Nodal) -> float:
        return float(np.sqrt(scale @ (contact.points.weight * stress)[points] ** 2))

    size = np.linalg.norm(contact.shear, axis=1)
    slips = contact.direction.any(axis=1)
    used = np.where(slips, size, np.maximum(size, contact.bound))  # the bound that the shear is the one of
    away = norm(used - contact.bound) / (1 - 1 / multiple)
    least = norm(used) - away
    relative = away / least if least > 0 else (0.0 if away == 0 else np.inf)
    return FixedPoint(1 / multiple, float(np.sqrt(2 / multiple)) * away, relative)
