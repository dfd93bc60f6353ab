"""Load steps in which a body jumps to another equilibrium, as beyond a limit point or when it buckles.

The first increment of Newton's method is what the tangent at the last equilibrium predicts, contact and friction
included.  A body that moves much farther has jumped, or has become softer within the step, as when metal yields: halves
of the step tell these apart, since a way becomes shorter with the step, and a jump does not.

Near a limit point the tangent predicts far ways itself, so that a jump need not be much farther: there the way is far
for the load that it takes, compared with the last step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from signorini_fx.records import Finding
from signorini_fx.tuned import FASTER, LEAPS, LITTLE_OF_STEP, SHORTER_WAY


class SnapThrough(Exception):
    """A step may have jumped over a limit point."""


@dataclass
class Leaps:
    """What the load steps of one ramp or path have shown.

    Attributes:
        yields: whether the material has a state, and may become softer within a step.
        findings: on each jump.
        end: where the shortest step ends that may jump and was not taken; None: there is none.
    """

    yields: bool
    findings: list[Finding] = field(default_factory=list)
    end: float | None = None
    _moved: float = 0.0  # in the step that ends there
    _ratio: float = 1.0  # by which the body moved farther in the last step that was taken than its tangent predicts
    _rate: float | None = None  # how far the body moved in that step, per size of the step; None: it is not known
    _tried: tuple[float, float] = (1.0, 0.0)  # both of the last step that has a solution

    def stored(self) -> dict[str, Any]:
        """What ``resume`` needs at the end of a load step, as plain data."""
        jumps = [found.message for found in self.findings]
        ways = {"moved": self._moved, "ratio": self._ratio, "rate": self._rate}
        return {"jumps": jumps, "end": self.end, **ways}

    def resume(self, figures: Mapping[str, Any]) -> None:
        """Go on from where an earlier run has come to, see ``stored``."""
        self.findings = [_finding(message) for message in figures["jumps"]]
        self.end, self._moved, self._ratio = figures["end"], figures["moved"], figures["ratio"]
        self._rate = figures["rate"]

    def suspects(self, moved: float, predicted: float, begin: float, end: float, *, large: bool = False) -> bool:
        """Whether a step that has a solution may jump.

        Args:
            moved: how far the body has moved in the step, length.
            predicted: how far its tangent moves it, length, above 0.
            begin: where the step begins.
            end: where it ends.
            large: whether a jump may be a small part of its way, so that this tells nothing as it becomes shorter.
        """
        ratio, rate = self._tried = moved / predicted, moved / abs(end - begin)
        jumps = self.end is not None and moved > SHORTER_WAY * self._moved
        if self.end is None or large:  # a body that has become softer goes on as it did
            farther, faster = FASTER[self.yields]
            jumps = jumps or ratio > LEAPS[self.yields] * self._ratio
            jumps = jumps or (self._rate is not None and ratio > farther and rate > faster * self._rate)
        if jumps:
            self.end, self._moved = end, moved
        return jumps

    def pass_by(self, begin: float, end: float) -> None:
        """A step is taken, and does not jump."""
        self._ratio, self._rate = max(1.0, self._tried[0]), self._tried[1]
        if not self.ends_beyond(end, end + (end - begin)):
            self.end = None

    def ends_beyond(self, reached: float, end: float) -> bool:
        """Whether a step that may jump ends beyond where the last one has ended, by more than a little of the way to
        ``end``.
        """
        return self.end is not None and (self.end - reached) / (end - reached) > LITTLE_OF_STEP

    def take(self, what: str, begin: float, end: float) -> None:
        """A step with a solution is taken that may jump.

        Args:
            what: loads or times, in the plural.
            begin: where it begins.
            end: where it ends.
        """
        self.end, self._ratio, self._rate = None, 1.0, None
        message = (
            f"between the {what} {begin:.6g} and {end:.6g} the body jumps to another equilibrium: smaller steps do not "
            f"shorten its motion; dynamics may lead to another one, and friction and material states take the jump "
            f"as one step: where forces act prescribe displacements instead, or end the {what} before"
        )
        self.findings.append(_finding(message))


def _finding(message: str) -> Finding:
    return Finding("warning", "load_steps", message)
