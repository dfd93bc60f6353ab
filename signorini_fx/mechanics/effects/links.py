"""Stiff links between nodes: linear relations of their displacements, such as equations of decks."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

from signorini_fx.mechanics.statement.effect import Array, Coefficients, Points, Resistance
from signorini_fx.mechanics.statement.nodal_table import NodalTable, read_nodal_table
from signorini_fx.mechanics.statement.values import NonNegative


class Links(Resistance):
    """Springs between nodes, each of which resists a linear combination of displacements.

    A link with the vectors c_i at the nodes i has the energy k (sum of c_i . y_i)^2 / 2.  A stiff one keeps the sum at
    zero but for its force over k.

    Attributes:
        file: a .csv with the columns link, x, y, cx, cy, in space z and cz, and, where several parts of the body have a
            node at one place, region; rows with the same number ``link`` are one link.
        stiffness: k, force per length (in the plane per thickness, of a body of revolution of the whole ring).
    """

    nodal: ClassVar[bool] = True
    file: Path
    stiffness: NonNegative

    @property
    def given(self) -> dict[str, Any]:
        """See ``Effect``."""
        return {"stiffness": self.stiffness}

    @property
    def said(self) -> str:
        """See ``Effect``."""
        return f"file = {self.file.name}, stiffness = {self.stiffness:g}"

    def table(self, path: str, dimension: int) -> NodalTable:
        """The terms of all links, in space of a dimension.

        Raises:
            SceneError: its file cannot be read, see ``read_nodal_table``.
        """
        return read_nodal_table(f"{path}.file", self.file, "c", "link")

    def reaction(self, y: Any, on: Coefficients) -> Any:
        """Zero: it has no density, see ``Resistance``."""
        return 0 * y

    def reaction_at(self, at: Points) -> Array:
        """Zero: it has no density, see ``Resistance``."""
        return at.vector((0.0, 0.0, 0.0))


Entry = Links

# How ``signorini-fx new`` explains it.
EXAMPLE = """
# Stiff links between nodes: linear relations of their displacements.  As many [[links]] as you like.
[[links]]
file = "links.csv"                         # columns link, x, y, (z,) cx, cy, (cz,) and region
stiffness = 0.0                            # of each, force / length; 0: they do nothing, and need no file
"""
