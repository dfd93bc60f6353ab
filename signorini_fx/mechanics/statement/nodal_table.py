"""Vectors at single nodes, by their places; a body where several have a node at one place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class NodalTable:
    """Vectors at nodes, n of them.

    Attributes:
        points: where the nodes are, length, shape (n, d).
        regions: the part of the body that each node belongs to; empty: any.
        vectors: at them, shape (n, d).
    """

    points: Array
    regions: tuple[str, ...]
    vectors: Array

    def __len__(self) -> int:
        return len(self.points)
