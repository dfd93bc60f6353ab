"""What is tried if a regularised problem with a given friction bound is not solved by full steps: an interior point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.attempts import CONVEX
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.records import Status


class FallBack:
    """The fall-back for the problems of a load step; ``exhausted``: whether it has failed for one of its problems,
    which most likely has no solution, such as one of a fixed-point iteration beyond a limit load, then it is not tried
    for the others.
    """

    def __init__(self) -> None:
        self.exhausted = False

    def __call__(
        self, newton: SemismoothNewton, data: RegularisedData, failed: Status, measure: Callable[[], float | None]
    ) -> Status:
        """How it ends, or else the original status, with the iterate that it left."""
        from signorini_fx.algebra.algorithms.interior_point import interior_point

        if self.exhausted or newton.history.exhausted:
            return failed
        start = newton.checkpoint()
        newton.history.add(f"{failed.value}: {CONVEX}")
        if interior_point(newton, replace(data, sigma=np.inf), measure) is Status.CONVERGED:
            return Status.CONVERGED
        self.exhausted = True
        newton.restore(start)
        return failed
