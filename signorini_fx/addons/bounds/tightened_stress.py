"""Stresses with the resultants of forces that tighten sections, (B16) of docs/bounds.md.

Let J_k be the displacement that a shortening of one of the k-th section adds, tau a stress in equilibrium with the
loads L, and N_k the tension through the section.  Where the shortenings are unknown tau also needs

    int tau : eps(J_k) - L(J_k) = N_k.

Of the stresses without loads and contact tractions let tau_k be the closest one to C eps(J_k).  Sums of these change
the left sides by a symmetric matrix, which is singular only where a section opens or closes without strain: then loads
and contact determine its tension.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from signorini_fx.addons.bounds.arrays import Array
from signorini_fx.addons.bounds.bounded_error import ROUND_OFF, UNBALANCED
from signorini_fx.addons.bounds.equilibrated_stress import EquilibratedStress, Equilibration, Loads
from signorini_fx.addons.bounds.preloaded_sections import LooseMotions, TightenedSection
from signorini_fx.addons.bounds.simplices import COLUMNS, ROWS, TWICE, Simplices, moments_of
from signorini_fx.addons.bounds.stress_products import from_strain, square
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.tuned import SAME_LENGTH, SINGULAR


@dataclass(frozen=True)
class TightenedStress:
    """What changes the resultants of a stress on sections.

    Attributes:
        t: the cells.
        sections: that forces tighten, m of them.
        strains: of J_k, shapes (n, 3 or 6).
        parts: tau_k.
        inverse: from changes of the left sides to the factors of tau_k; zero for those that loads and contact
            determine, length per force, shape (m, m).
        determined: an orthonormal basis of these, shape (m, k).
        norms: of tau_k, root of an energy per length squared, shape (m,).
    """

    t: Simplices
    sections: list[TightenedSection]
    strains: list[Array]
    parts: list[EquilibratedStress]
    inverse: Array
    determined: Array
    norms: Array

    @classmethod
    def of(
        cls,
        t: Simplices,
        sections: list[TightenedSection],
        loose: LooseMotions,
        equilibration: Equilibration,
        least: float = 1.0,
    ) -> TightenedStress:
        """Solve for tau_k.

        Args:
            t: the cells.
            sections: that forces tighten.
            loose: motions that open or close them.
            equilibration: the system of stresses in equilibrium.
            least: moduli are at least so many times those of the cells.

        Raises:
            Refused: a section has no stiffness, although it cannot open freely.
        """
        n, d, strains, parts = len(t.corners), t.dimension, list[Array](), list[EquilibratedStress]()
        for section in sections:
            gradient = np.einsum("nci,ncj->nij", section.moved, t.gradients)
            strains.append((gradient + gradient.transpose(0, 2, 1))[:, ROWS[d], COLUMNS[d]] / 2)
            of_jump = from_strain(t, np.repeat(strains[-1][:, None], d + 1, axis=1))
            nothing = Loads(np.zeros((n, d + 1, d)), np.zeros((len(t.facets), d, d)), initial=-of_jump)
            parts.append(equilibration.stress(nothing, np.zeros((len(t.facets), d, d))))
        changes = cls(t, sections, strains, parts, np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0))
        matrix = np.stack([changes.through(part) for part in parts])
        determined = np.linalg.qr(loose.closing)[0]
        projector = np.eye(len(sections)) - determined @ determined.T
        values, vectors = np.linalg.eigh(projector @ (matrix + matrix.T) @ projector / 2)
        count = determined.shape[1]
        largest = max(float(square(t, from_strain(t, np.repeat(s[:, None], d + 1, axis=1))).sum()) for s in strains)
        if (values[count:] <= SINGULAR * largest).any():
            raise Refused("the force through a section depends on nothing but its shortening, and hardly on this")
        inverse = vectors[:, count:] / values[count:] @ vectors[:, count:].T
        # Springs have a share of a norm, which is then the root of the work.
        squares = np.maximum(np.diag(matrix), [square(t, part.stress).sum() for part in parts])
        norms = np.sqrt(squares / least)
        return replace(changes, inverse=inverse, determined=determined, norms=norms)

    def through(self, stress: EquilibratedStress) -> Array:
        """The work of a stress on the strains of J_k, force, shape (m,)."""
        mean = stress.stress.mean(axis=(1, 2)) * TWICE[self.t.dimension] * self.t.volume[:, None]
        return np.array([(mean * strain).sum() for strain in self.strains])

    def work(self, loads: Loads) -> Array:
        """L(J_k), force, shape (m,)."""
        t, outer = self.t, self.t.outer
        moments = moments_of(t, loads.traction)[outer]
        cells = t.sides[outer, 0]
        places = (t.corners[cells][:, None] == t.facets[outer][:, :, None]).argmax(axis=2)
        return np.array(
            [
                (loads.body * section.moved).sum() + (moments * section.moved[cells[:, None], places]).sum()
                for section in self.sections
            ]
        )

    def with_tensions(self, stress: EquilibratedStress, wanted: Array, *, loaded: bool = True) -> EquilibratedStress:
        """The stress with left sides that are given.

        Args:
            stress: in equilibrium.
            wanted: N_k + L(J_k), force, shape (m,).
            loaded: whether loads or contact tractions act: without them what they determine is zero, up to round-off
                of which there is no scale.

        Raises:
            Refused: what loads and contact determine is not so.
        """
        factors = self.inverse @ (wanted - self.through(stress))
        parts, of_springs = list(zip(factors, self.parts, strict=True)), stress.of_springs
        for factor, part in parts:
            if of_springs is not None and part.of_springs is not None:
                of_springs = of_springs + factor * part.of_springs
        changed = replace(
            stress,
            stress=stress.stress + sum(factor * part.stress for factor, part in parts),
            tractions=stress.tractions + sum(factor * part.tractions for factor, part in parts),
            squares=(np.sqrt(stress.squares) + sum(abs(factor) * np.sqrt(part.squares) for factor, part in parts)) ** 2,
            of_springs=of_springs,
            lost=stress.lost + sum(abs(factor) * part.lost for factor, part in parts),
        )
        sizes, left = self._sizes(changed.stress) + np.abs(wanted), wanted - self.through(changed)
        if loaded and (np.abs(left @ self.determined) > SAME_LENGTH * (sizes @ np.abs(self.determined))).any():
            raise Refused(UNBALANCED)
        # What is left by round-off another change of this kind would take away: its norm is a bound of its work.
        unknown = np.abs(left) + ROUND_OFF * sizes + changed.lost
        rest = float(np.abs(self.inverse) @ unknown @ self.norms)
        shares = np.sqrt(changed.squares) if changed.missing > 0 else np.ones(len(self.t.corners))
        shares = shares / np.linalg.norm(shares)
        return replace(changed, squares=(np.sqrt(changed.squares) + rest * shares) ** 2)

    def _sizes(self, stress: Array) -> Array:
        """The sizes of what is summed up in ``through``, force, shape (m,)."""
        mean = np.abs(stress).mean(axis=(1, 2)) * TWICE[self.t.dimension] * self.t.volume[:, None]
        return np.array([(mean * np.abs(strain)).sum() for strain in self.strains])
