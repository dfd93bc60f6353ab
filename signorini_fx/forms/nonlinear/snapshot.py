"""All that a solve changes, at the end of the last one that has a solution: what a failure goes back to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.forms.nonlinear.linearised import LinearisedProblem, LinearSolution
from signorini_fx.forms.nonlinear.moving_shapes import MovingShape
from signorini_fx.results.certificate.certificate import Certificate

Array = npt.NDArray[np.float64]
Fields = tuple[fem.Function, ...]


@dataclass(frozen=True)
class Snapshot:
    """A solution, or what there is before the first one.

    Attributes:
        displacement: values of ``u``, ghosts included.
        fields: values of pressure, shear, gap and slip.
        linear: the contact problem of the last iteration.
        certificate: of the solution; None: there is none.
        iterations: of Newton's method.
        shapes: of the foundations, where they were placed, by their numbers.
        tools: coordinates of those that forces move, lengths, shape (t, m), see ``MovingTools``.
    """

    displacement: Array
    fields: tuple[Array, ...]
    linear: LinearSolution
    certificate: Certificate | None
    iterations: int
    shapes: dict[int, Any]
    tools: Array

    @classmethod
    def of(
        cls,
        u: fem.Function,
        fields: Fields,
        linear: LinearisedProblem,
        shapes: Mapping[int, MovingShape],
        solved: tuple[Certificate | None, int],
    ) -> Snapshot:
        """What there is now; ``solved``: certificate and iterations."""
        now = {number: moving.shape for number, moving in shapes.items()}
        values, tools = tuple(field.x.array.copy() for field in fields), linear.moving_tools.coordinates
        return cls(u.x.array.copy(), values, linear.solved, *solved, now, tools)

    def restore(self, u: fem.Function, fields: Fields, linear: LinearisedProblem) -> tuple[Certificate | None, int]:
        """Go back to it; the shapes stay where they are placed.

        Returns:
            Certificate and iterations.
        """
        for function, values in zip((u, *fields), (self.displacement, *self.fields), strict=True):
            function.x.array[:] = values
        linear.go_back(self.linear)
        return self.certificate, self.iterations
