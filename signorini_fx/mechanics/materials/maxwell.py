"""Rubber or polymer that relaxes: the generalised Maxwell material at small strains, a spring beside springs in series
with dashpots (J. C. Simo and T. J. R. Hughes, Computational Inelasticity, Springer, 1998, section 10.3).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr

from signorini_fx.mechanics.materials.neo_hooke import PoissonBelowHalf
from signorini_fx.mechanics.materials.nonlinear import DEVIATORIC, PathDependent, deviator
from signorini_fx.mechanics.materials.protocol import Array
from signorini_fx.mechanics.statement.effect import Contradictions
from signorini_fx.mechanics.statement.values import Positive

_Branch = tuple[Positive, Positive]


class Maxwell(PathDependent):
    """The deviatoric stress 2 G e + sum of q_i with dq_i/dt = 2 G_i de/dt - q_i / tau_i, e the deviator of the strain;
    the mean stress is that of the spring alone.

    A load step is integrated exactly for a strain that changes evenly in it.  Its duration is that between the times of
    the load path, which begins at time 0.  The state are the q_i and e, 9 numbers each, and the time.

    Attributes:
        law: its name.
        young: Young's modulus of the spring, which is left after a long time, stress.
        poisson: Poisson's ratio of the spring, in (-1, 0.5).
        branches: rows [G_i, tau_i], the shear modulus that a branch adds at first, stress, and the time in which its
            stress falls to 1/e of itself.
        hypothesis, torsion, grading, density, expansion, region: see ``Material``.
    """

    law: Literal["maxwell"]
    young: Positive
    poisson: PoissonBelowHalf
    branches: Annotated[tuple[_Branch, ...], Field(min_length=1)]

    _time: float = PrivateAttr(1.0)

    @property
    def state_size(self) -> int:  # type: ignore[override]  # that of other materials is one number for all of a class
        return 9 * len(self.branches) + 10

    @property
    def constants_at_rest(self) -> tuple[float, float]:
        """See ``NonlinearMaterial``: at first, with all branches."""
        added = sum(shear for shear, _ in self.branches)
        return self._spring + added, self.young / (3 * (1 - 2 * self.poisson))

    @property
    def _spring(self) -> float:
        """G, stress."""
        return self.young / (2 * (1 + self.poisson))

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        yield from super().contradictions(statement, number)
        times = statement.load_steps.times
        if times is not None and times[0] <= 0:
            yield ("load_steps", "times"), "must be positive: a body that relaxes is without strain until time 0"

    def at_time(self, time: float) -> Self:
        material = self.model_copy()
        material._time = time
        return material

    def respond(self, strain: Array, state: Array) -> tuple[Array, Array, Array]:
        strain_deviator, last, since = deviator(strain), state[:, -10:-1].reshape(-1, 3, 3), self._time - state[:, -1]
        stress, stiffness, parts = (
            2 * self._spring * strain_deviator,
            np.full(len(strain_deviator), 2 * self._spring),
            list[Array](),
        )
        for branch, (shear, relaxation) in enumerate(self.branches):
            lasts = since / relaxation
            # (1 - exp(-x)) / x
            share = np.divide(-np.expm1(-lasts), lasts, out=np.ones_like(lasts), where=lasts > 0)
            part = np.exp(-lasts)[:, None, None] * state[:, 9 * branch : 9 * branch + 9].reshape(-1, 3, 3)
            part += 2 * shear * share[:, None, None] * (strain_deviator - last)
            stress, stiffness = stress + part, stiffness + 2 * shear * share
            parts.append(part.reshape(-1, 9))
        new = np.column_stack((*parts, strain_deviator.reshape(-1, 9), np.full(len(strain_deviator), self._time)))
        return stress, stiffness[:, None, None] * DEVIATORIC, new


Entry = Maxwell
