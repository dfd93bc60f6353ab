"""The verdict: one word, what speaks against the result, figures with their limits, in ten lines and as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

AGREES = "agrees"
OTHER_ELEMENT = "agrees with another element"
OTHER_PENALTY = "agrees with another penalty"
UNITS = "another problem: units"
OTHER_LOAD = "another problem: load or modulus"
SUPPORTS = "violates supports"
NOT_BALANCED = "not in equilibrium"
CONTACT = "violates contact: "
NO_RESULT = "not a result"
NOT_JUDGED = "cannot be judged"
# Of findings, by their keys, in the order in which the first one gives the word.
WORDS = {
    "result": NO_RESULT,
    "judged": NOT_JUDGED,
    "units": UNITS,
    "factors": OTHER_LOAD,
    "supports": SUPPORTS,
    "equilibrium": NOT_BALANCED,
    **{
        key: CONTACT + key
        for key in ("penetration", "tension", "apart", "reaction", "cone", "wrong way", "slip", "law", "penalty")
    },
    "coarse": NOT_JUDGED,
    "element": OTHER_ELEMENT,
    "another penalty": OTHER_PENALTY,
}
# With which the command ends.
EXIT_AGREES, EXIT_AS_READ, EXIT_ANOTHER, EXIT_VIOLATES, EXIT_NOT_JUDGED = 0, 4, 5, 6, 7
_AGREEING = ("element", "another penalty")


@dataclass(frozen=True)
class JudgedFinding:
    """Something that is to be said of a result.

    Attributes:
        key: of ``WORDS``.
        text: in words, with its numbers.
        value: the figure; None: it has none.
        threshold: that it is beyond.
        share: of the force or energy that it concerns.
        node: its number in the problem.
        at: where that is, length.
    """

    key: str
    text: str
    value: float | None = None
    threshold: float | None = None
    share: float | None = None
    node: int | None = None
    at: tuple[float, ...] | None = None

    @property
    def objects(self) -> bool:
        """Whether it speaks against the result."""
        return self.key not in _AGREEING


@dataclass(frozen=True)
class Judgement:
    """A verdict on a result.

    Attributes:
        name: of the result.
        findings: what is to be said of it, gravest first.
        theirs: program, element, formulation, step, time, digits.
        figures: by their names, each its value and threshold, or why there is none.
        factors: of loads or materials that are not 1, by their names.
        error: the interval of the error in the energy norm, relative to it: ``guaranteed``, ``low``, ``high``,
            ``ours_on_their_mesh``, ``distance``; a ``reason`` for what is missing.
        beside: differences from our solution: ``displacement``, ``force``, ``pressure``; or a ``reason``.
        formulations: that were tried, in words, each with the residual that it leaves, relative to the energy norm.
        lost: what the problem as read lacks of its input file.
        lines: label -> text, the ten lines below the word.
    """

    name: str
    findings: tuple[JudgedFinding, ...]
    theirs: Mapping[str, Any] = field(default_factory=dict)
    figures: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    factors: Mapping[str, float] = field(default_factory=dict)
    error: Mapping[str, Any] = field(default_factory=dict)
    beside: Mapping[str, Any] = field(default_factory=dict)
    formulations: Mapping[str, float] = field(default_factory=dict)
    lost: tuple[str, ...] = ()
    lines: Mapping[str, str] = field(default_factory=dict)

    @property
    def word(self) -> str:
        """The verdict in a word or two."""
        return WORDS[self.findings[0].key] if self.findings else AGREES

    @property
    def agrees(self) -> bool:
        """Whether nothing speaks against the result."""
        return not any(finding.objects for finding in self.findings)

    @property
    def exit_code(self) -> int:
        """0: agrees; 4: it does, with the problem as read; 5: of another problem; 6: violates it; 7: not judged."""
        if self.agrees:
            return EXIT_AS_READ if self.lost else EXIT_AGREES
        if self.word in (NO_RESULT, NOT_JUDGED):
            return EXIT_NOT_JUDGED
        return EXIT_ANOTHER if self.word in (UNITS, OTHER_LOAD) else EXIT_VIOLATES

    def as_dict(self) -> dict[str, Any]:
        """As plain data for JSON."""
        return {
            "word": self.word,
            "agrees": self.agrees,
            "exit_code": self.exit_code,
            "findings": [_plain(vars(finding)) for finding in self.findings],
            "theirs": _plain(self.theirs),
            "figures": {name: _plain(figure) for name, figure in self.figures.items()},
            "factors": _plain(self.factors),
            "error": _plain(self.error),
            "beside": _plain(self.beside),
            "judged_with": {
                "limits": {name: figure.get("threshold") for name, figure in self.figures.items()},
                "formulations": _plain(self.formulations),
            },
            "lost": list(self.lost),
        }

    def __str__(self) -> str:
        first = f"{self.name}: {self.word}"
        if self.findings and self.findings[0].objects:
            first += f": {self.findings[0].text}"
        if self.lost:
            first += " (of the problem as read)"
        lines = [first, *(f"  {label:12s}{text}" for label, text in self.lines.items())]
        lines += [f"  also        {finding.text}" for finding in self.findings[1:] if finding.objects]
        lines += [f"  not read    {remark}" for remark in self.lost]
        return "\n".join(lines)


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Without numbers that JSON does not know."""
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in values.items()
    }


def sorted_findings(findings: list[JudgedFinding]) -> tuple[JudgedFinding, ...]:
    """In the order of ``WORDS``."""
    order = list(WORDS)
    return tuple(sorted(findings, key=lambda finding: order.index(finding.key)))
