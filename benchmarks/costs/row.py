"""A row of the table, and the sizes of the meshes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from clock import Key

Say = Callable[[str], None]


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        group: its name for ``--only``.
        what: what is measured.
        size: on what mesh.
        measured: one value a repeat; the median counts.
        target: the limit to be reached; None: shown for information.
        at_least: whether the target is the smallest value rather than the largest.
        key: the contestant whose seconds by phase are shown.
        unit: "" for ratios, else what the value is.
        note: anything else.
    """

    group: str
    what: str
    size: str
    measured: Sequence[float]
    target: float | None = None
    at_least: bool = False
    key: Key | None = None
    unit: str = ""
    note: str = ""
    where: dict[str, float] = field(default_factory=dict)

    @property
    def value(self) -> float:
        """The median."""
        return float(np.median(self.measured))

    @property
    def verdict(self) -> str:
        """Whether the target is reached."""
        if self.target is None:
            return "information"
        reached = self.value >= self.target if self.at_least else self.value <= self.target
        return "reached" if reached else "NOT REACHED"


@dataclass(frozen=True)
class Sizes:
    """Cells along the bottom: two for ratios, a small one for growth, a large one for time and memory.

    Attributes:
        space: cells along the block in 3D, of a mesh and of one with eight times as many cells.
    """

    small: int
    middle: int
    large: int
    huge: int
    space: tuple[int, int] = (12, 24)

    def name(self, nx: int) -> str:
        """As in 480x160."""
        return f"{nx}x{nx // 3}"
