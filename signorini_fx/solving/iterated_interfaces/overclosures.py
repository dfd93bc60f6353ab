"""Soft contact: each point has the stiffness of its law in place of gamma_n."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from signorini_fx.results.certificate.law_of_method import overclosures_of
from signorini_fx.solving.iterated_interfaces.protocol import Interface, LoadStepEnd, LoadStepStart


class Overclosures(Interface):
    """Those of a scene, see ``Interface``."""

    def solve(self, step: LoadStepStart) -> LoadStepEnd:
        model, data = step.model, step.start.data
        assert model.boundary is not None
        share = np.ones(model.boundary.size)
        for number, law in overclosures_of(self.statement).items():
            share[model.boundary.part == number] = law.stiffness / data.gamma_n
        return step.solved(model, replace(step.start, data=replace(data, share=share)))


Kind = Overclosures
