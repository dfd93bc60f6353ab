"""Sections that are tightened."""

from __future__ import annotations

from typing import Any

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.kinds import Number, Row, described
from signorini_fx.quantities.quantity import Quantity, Summary
from signorini_fx.quantities.text import labelled


class PreloadedSection(Row):
    """A section."""

    name: str = described("Which one.")
    force: Number = described("The tension through it.")
    shortening: Number = described("By how much its sides have moved towards each other.")


class Preloads(Quantity):
    """Their forces."""

    key, kind, stage = "preloads", list[PreloadedSection], "results"
    terminal, brief = "preload", True
    title = "Sections that are tightened."

    def value(self, solution: Any) -> Any:
        return [section.as_dict() for section in solution.preloads] or None

    def lines(self, summary: Summary) -> list[TerminalLine]:
        return labelled(self.terminal, [_in_words(section) for section in summary.get(self.key, ())])


def _in_words(section: dict[str, Any]) -> str:
    name = section["name"].removeprefix("preload ")
    return f"{name}: force {section['force']:.6g}, shortened by {section['shortening']:.6g}"


QUANTITIES = (Preloads(),)
