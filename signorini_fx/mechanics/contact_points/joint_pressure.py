"""The pressure of loads within contact that opens, as a part of a solution."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.motions import FreeMotions, RigidLoad
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.machine import parallel

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Stage:
    """The last solution from which loads went on within a load step.

    Attributes:
        reached: see ``JointPressure``.
        open: the points at which the contact was open, shape (n,).
    """

    reached: Flags
    open: Flags


@dataclass(frozen=True)
class JointPressure:
    """The pressure of m loads within the contact at the n contact points of this rank.

    Attributes:
        pressure: stress, shape (n,): it presses besides lambda.
        reached: which load has reached which point through open ones, shape (n, m); loads in the order of the scene.
        stage: from which they came here; None: from where the load step began.
        settled: whether they go no further; otherwise this is a stage.
        recalled: whether an earlier run has found it, whose stages are not known.
    """

    pressure: Nodal
    reached: Flags
    stage: Stage | None = None
    settled: bool = True
    recalled: bool = False

    def times(self, factor: float) -> JointPressure:
        """That of loads that are so many times as large."""
        return replace(self, pressure=np.asarray(factor * self.pressure))


def work_on_motions(motions: FreeMotions, pressure: Nodal) -> RigidLoad:
    """The load of pressures at the contact points, shape (n,), on the free rigid motions; collective."""
    push = motions.points.weight * pressure
    size = [push[motions.of_point == number].sum() for number in motions.assembly]
    total = parallel.global_sum(motions.points.comm, np.array([-push @ motions.normal, size]))
    return RigidLoad(total[0], total[1], motions.assembly)
