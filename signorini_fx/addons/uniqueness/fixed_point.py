"""How far a solution with Coulomb friction is from the fixed point of its mesh, proved by a contraction.

Let m be the multiple of the friction coefficients below which ``uniqueness`` proves that there is one solution, with
the weights d_i of the proof, and let r, r' be the nodal contact forces of two solutions with Tresca friction of the
nodal bounds g, g' (forces).  With |h|^2 = sum d_i h_i^2 / F_i over the tangential components the inequalities of the
proof give

    |F (r_N - r_N')| <= |g - g'| / m,        a(u - u', u - u') <= (2 / m) |g - g'|^2.

So for m > 1 the map from g to F r_N(g) has one fixed point g*, and |g - g*| <= |F r_N(g) - g| / (1 - 1 / m).  A
computed state is the solution for the bound g that is |mu| where a point slips, and at least F lambda where it sticks:
whatever ended the iteration.  docs/theory.md derives it.

*Why the solution on the body is not enclosed.*  Let u*, sigma*, p* be a solution with Coulomb friction on the body, v a
displacement that does not enter the foundation, and tau a stress in equilibrium with a pressure p >= 0 and a shear
|mu| <= F p.  As tau - sigma* is in equilibrium without loads,

    |v - u*|^2 + |tau - sigma*|^2 = |C eps(v) - tau|^2 + 2 int ((p* - p) (v_N - u*_N) + (mu* - mu) . (v_T - u*_T)),

and with p* (d - u*_N) = 0, mu* . u*_T = F p* |u*_T| and |mu*| <= F p* this is at most

    |C eps(v) - tau|^2 + 2 int p (d - v_N) + 2 int (F p |v_T| - mu . v_T) + 2 int F (p - p*) (|u*_T| - |v_T|).

All but the last term is (B1) of docs/theory.md, and known.  The energy bounds p - p* only in the dual space of H^(1/2),
so that the last term asks for | |u*_T| - |v_T| | <= c |u*_T - v_T| in H^(1/2).  There is no such c: on a circle of
length 2 pi the norm of phi = k^(-1/2) sin(k x) is the same for all k, and that of |phi + e| - |phi| with a small number
e is more than k^(1/2) times that of e, as it jumps between -e and e along k waves.  In L2, where c = 1, the pressure
is not bounded: cos(k x) has an energy of the order 1 / k.  On a mesh the norms are equivalent, with constants of the
order h^(-1/2), which the weights d_i make as good as they can be: so m falls as h^(1/2), and with q = 1 / m < 1 on one
mesh it is above 1 on finer ones.  That small coefficients make the solution on the body the only one is not known
either, but for a solution of more regularity (Y. Renard, SIAM J. Math. Anal. 38 (2006) 452-467).
"""

from __future__ import annotations

import numpy as np

from signorini_fx.addons.uniqueness.contact_stiffness import contact_stiffness
from signorini_fx.addons.uniqueness.proof import components, critical
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.quantities.proved_statements import FixedPoint
from signorini_fx.tuned import WEIGHT_EVALUATIONS, WEIGHT_WORK


def fixed_point(model: Model, contact: ContactState, step: float | None = None) -> FixedPoint:
    """The distance of a solution with Coulomb friction from the fixed point.

    Args:
        model: the model.
        contact: its contact nodes in the solution.
        step: the place of the load step in the lists of factors; None: the last one.
    """
    law, stiffness = model.law, contact_stiffness(model, step)
    assert law is not None
    if isinstance(stiffness, str):
        return FixedPoint(np.inf, reason=stiffness)
    rough = components(*stiffness, law)
    if isinstance(rough, str):
        return FixedPoint(np.inf, reason=rough)
    often = min(WEIGHT_EVALUATIONS, 1 + int(WEIGHT_WORK / len(rough.stiffness) ** 3))
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
