"""The verdict: one word, its reason, figures with their limits, in ten lines and as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

AGREES = "agrees within the error of the mesh"
ANOTHER = "another problem"
VIOLATES = "violates "
NOT_TOLD = "cannot be told"
# What may be violated.
CONDITIONS = ("supports", "equilibrium", "penetration", "tension", "complementarity", "friction")
# With which the command ends.
EXIT_AGREES, EXIT_AS_READ, EXIT_ANOTHER, EXIT_VIOLATES, EXIT_NOT_TOLD = 0, 4, 5, 6, 7


@dataclass(frozen=True)
class Judgement:
    """A verdict on a result.

    Attributes:
        name: of the result.
        word: ``agrees within the error of the mesh``, ``another problem``, ``violates`` one of ``CONDITIONS``, or
            ``cannot be told``.
        reason: why, in words; "": the word says all.
        theirs: program, time and digits of the result.
        figures: by their names, each its value and threshold: shares of the energy norm, of the largest displacement,
            and of the largest pressure.
        beside: displacement and contact force beside ours, and how far ours differ from those on the finer mesh, each
            relative to ours.
        lost: what the problem as read lacks of its input file.
        lines: label -> text, the lines below the word.
    """

    name: str
    word: str
    reason: str = ""
    theirs: Mapping[str, Any] = field(default_factory=dict)
    figures: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    beside: Mapping[str, float] = field(default_factory=dict)
    lost: tuple[str, ...] = ()
    lines: Mapping[str, str] = field(default_factory=dict)

    @property
    def agrees(self) -> bool:
        """Whether it solves the problem, as far as its mesh can tell."""
        return self.word == AGREES

    @property
    def exit_code(self) -> int:
        """With which the command ends: 0 it agrees, 4 it does with what was read of the input file, 5 it solves another
        problem, 6 it violates the problem, 7 it cannot be told.
        """
        if self.agrees:
            return EXIT_AS_READ if self.lost else EXIT_AGREES
        if self.word == NOT_TOLD:
            return EXIT_NOT_TOLD
        return EXIT_ANOTHER if self.word == ANOTHER else EXIT_VIOLATES

    def as_dict(self) -> dict[str, Any]:
        """As plain data for JSON."""
        return {
            "word": self.word,
            "reason": self.reason,
            "agrees": self.agrees,
            "exit_code": self.exit_code,
            "theirs": _plain(self.theirs),
            "figures": {name: _plain(figure) for name, figure in self.figures.items()},
            "beside": _plain(self.beside),
            "lost": list(self.lost),
        }

    def __str__(self) -> str:
        first = f"{self.name}: {self.word}"
        if self.reason:
            first += f": {self.reason}"
        if self.lost:
            first += " (of the problem as read)"
        lines = [first, *(f"  {label:12s}{text}" for label, text in self.lines.items())]
        lines += [f"  not read    {remark}" for remark in self.lost]
        return "\n".join(lines)


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Without numbers that JSON does not know."""
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in values.items()
    }
