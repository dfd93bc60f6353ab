"""What one foundation or pair says at the nodes: its direction and measure, gap and friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from signorini_fx.body.elliptic_friction import Ellipse

if TYPE_CHECKING:
    from signorini_fx.body.paired_points import PairedSides

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    """What decides about the contact points of one foundation, at all nodes of this rank, nan where it is not.

    Attributes:
        factor: of the surface measure, shape (nodes,); None: 1.
        direction: n, of length one, shape (nodes, d); None: the outward normal.
        ellipse: of its friction; None: it has no direction.
    """

    factor: Array | None
    direction: Array | None
    ellipse: Ellipse | None = None


@dataclass(frozen=True)
class Bounds:
    """The friction of one foundation, at all nodes of this rank, ghosts included, arrays of shape (nodes,).

    Attributes:
        given: Tresca's g, or Coulomb's c, stress; zero without.
        coefficient: Coulomb's F; zero without.
        cap: the largest friction bound, stress; infinite without.
        cohesive: whether the given bound ends where the contact opens.
    """

    given: Array
    coefficient: Array
    cap: Array
    cohesive: bool


@dataclass(frozen=True)
class Data(Bounds):
    """What one foundation says, at all nodes of this rank, ghosts included, arrays of shape (nodes,).

    Attributes:
        facets: owned, local numbers.
        shape: its direction and measure.
        gap: d, length; nan where no facet is.
        bilateral: whether the contact cannot open.
        pair: both sides, where another body is the foundation; None: it is rigid.
        allowance: the part of a gap by geometry that is not geometry; None: the gap is given as a whole.
    """

    facets: npt.NDArray[np.int32]
    shape: Shape
    gap: Array
    bilateral: bool
    pair: PairedSides | None = None
    allowance: Array | None = None
