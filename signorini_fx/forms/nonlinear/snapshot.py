"""All that a solve changes, at the end of the last one that has a solution: what a failure goes back to."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.forms.nonlinear.linearised import LinearisedProblem, LinearSolution
from signorini_fx.forms.solver import StepBeginning
from signorini_fx.results.certificate.certificate import Certificate

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Snapshot:
    """A solution, or what there is before the first one.

    Attributes:
        displacement: values of ``u``, ghosts included.
        linear: the contact problem of the last iteration.
        certificate: of the solution; None: there is none.
        iterations: of Newton's method.
        shapes: of the foundations, where they were placed, by their numbers.
        tools: coordinates of those that forces move, lengths, shape (t, m), see ``MovingTools``.
    """

    displacement: Array
    linear: LinearSolution
    certificate: Certificate | None
    iterations: int
    shapes: dict[int, Any]
    tools: Array

    @classmethod
    def of(cls, u: fem.Function, linear: LinearisedProblem, solved: tuple[Certificate | None, int]) -> Snapshot:
        """What there is now; ``solved``: certificate and iterations."""
        now = {number: moving.shape for number, moving in linear.shapes.items()}
        return cls(u.x.array.copy(), linear.solved, *solved, now, linear.moving_tools.coordinates)

    def restore(self, u: fem.Function, linear: LinearisedProblem) -> tuple[Certificate | None, int]:
        """Go back to it; shapes stay where they are placed, but for those that forces move; collective.

        Returns:
            Certificate and iterations.
        """
        u.x.array[:] = self.displacement
        linear.go_back(self.linear)
        linear.moving_tools.carry_to(self.tools)
        return self.certificate, self.iterations


@dataclass(frozen=True)
class BeginningOnShapes:
    """Where a load step begins.

    Attributes:
        beginning: of the contact problem.
        settled: where the shapes were, by the numbers of their foundations.
    """

    beginning: StepBeginning
    settled: dict[int, Any]

    @classmethod
    def of(cls, linear: LinearisedProblem) -> BeginningOnShapes:
        """That of now."""
        return cls(linear.beginning(), {number: moving.settled for number, moving in linear.shapes.items()})

    def restore(self, linear: LinearisedProblem) -> None:
        """Go back to it."""
        linear.return_to(self.beginning)
        for number, settled in self.settled.items():
            linear.shapes[number].settled = settled

    @contextmanager
    def returned_to(self, linear: LinearisedProblem) -> Iterator[None]:
        """While it is where the step begins, whatever has been advanced since."""
        advanced = BeginningOnShapes.of(linear)
        self.restore(linear)
        try:
            yield
        finally:
            advanced.restore(linear)
