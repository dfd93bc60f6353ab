"""Two-sided bounds of the mean displacement of a boundary, from the bound of the error in the energy norm.

Let tau be a symmetric stress in equilibrium with a unit load Q on the boundary, without tractions where contact may
occur, and w a displacement that vanishes on supports and on the contact boundary.  Neither pressure nor friction
does work on w, so that a(u, w) = L(w), and the error of the computed displacement u_h is

    Q(u) - Q(u_h) = L(w) - a(u_h, w) + int (tau - C eps(w)) : eps(u - u_h),

whose last term is at most |tau - C eps(w)| times the bound (W. Prager and J. L. Synge, Quart. Appl. Math. 5 (1947)
241-269; the dual problem of R. Becker and R. Rannacher, Acta Numerica 10 (2001) 1-102, held where contact may occur).
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem

from signorini_fx.accuracy.equilibrated_stress import Loads
from signorini_fx.accuracy.error_bound import ROUND_OFF, Bounded, apart
from signorini_fx.accuracy.linear_displacement import Given, smallest_energy
from signorini_fx.accuracy.triangles import Array, free_motions
from signorini_fx.accuracy.triangulated import Refused
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.discretisation import Discretisation


def mean_displacement(
    d: Discretisation,
    y: fem.Function,
    contact: ContactState | None,
    boundary: str,
    direction: tuple[float, float],
    place: float = 0.0,
) -> tuple[float, float] | str:
    """Bounds of the mean of u . direction over a boundary, a length; or why there are none.

    What they rest on is what the bound of the error rests on.

    Args:
        d: the discretised scene.
        y: the displacement.
        contact: the contact nodes.
        boundary: its name.
        direction: any vector; a unit one gives a length.
        place: of the load step in the lists of factors.
    """
    try:
        return _Mean(d, y, contact, place).bounds(boundary, np.asarray(direction, dtype=np.float64))
    except Refused as refused:
        return str(refused)


class _Mean(Bounded):
    """A problem with what bounds a mean displacement."""

    def bounds(self, boundary: str, direction: Array) -> tuple[float, float]:
        """See ``mean_displacement``."""
        t, edges = self.t, self._edges(boundary)
        if free_motions(t, self.held).size:
            raise Refused("a mean displacement has bounds where supports hold the body without its contact")
        error = self.bound().error
        share = t.length[edges] / t.length[edges].sum()
        mean = (self.y[t.edges[edges]].sum(axis=1) + 4 * self.middle[edges]) / 6
        unit = np.zeros((len(t.edges), 2, 2))
        free = np.eye(2) - self.held[edges]
        unit[edges] = np.einsum("eij,j->ei", free, direction)[:, None] / t.length[edges].sum()
        stress = self.equilibration.stress(Loads(np.zeros((len(t.corners), 3, 2)), unit), np.zeros_like(unit))
        w = self._dual(unit)
        middle = w[t.edges].mean(axis=1)
        strain = t.strain_at_corners(w, middle)
        # The strain of w is constant: the mean of that of the solution is enough.
        own = t.stress(t.strain_at_corners(self.y, self.middle).mean(axis=1)[:, None])[:, 0]
        inside = float(t.area @ (own * strain[:, 0] * [1.0, 1.0, 2.0]).sum(axis=1))
        outside = self.work(w, middle)
        centre = float(share @ (mean @ direction)) + outside - inside
        half = error * (float(np.sqrt(apart(t, strain, stress.stress).sum())) + stress.missing)
        half += ROUND_OFF * len(t.corners) ** 0.5 * (abs(centre) + abs(outside) + abs(inside) + np.abs(mean).max())
        return float(centre - half), float(centre + half)

    def _dual(self, traction: Array) -> Array:
        """The displacement, linear on triangles, under a traction where supports and contacts are held, (v, 2).

        Args:
            traction: at both ends of each edge, stress, shape (e, 2, 2).
        """
        t = self.t
        load = np.zeros((len(t.x), 2))
        for k in (0, 1):
            np.add.at(load, t.edges[:, k], t.length[:, None] * (2 * traction[:, k] + traction[:, 1 - k]) / 6)
        closed = np.zeros_like(self.held)
        closed[np.flatnonzero(self.held.any(axis=(1, 2)))] = np.eye(2)
        for one in self.contacts:
            closed[one.edges] = np.eye(2)
        return smallest_energy(t, Given.of_edges(t, closed, np.zeros(2)), load)[0]
